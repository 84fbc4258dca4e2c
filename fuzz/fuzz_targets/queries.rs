//! A file of queries from anywhere: any answer will do, a panic will not. Records are checked one by one before the checksum of all is, so that
//! a change is met where it is.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use vdf_lab::queries::QueryStream;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(stream) = QueryStream::decode(Path::new("a.queries"), bytes, bytes.len() as u64) {
        assert_eq!(stream.queries.len(), stream.unoccluded.len());
        assert!(stream.queries.iter().all(|q| q.from.is_finite() && q.to.is_finite()));
    }
});
