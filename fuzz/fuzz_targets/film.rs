//! A film from anywhere, as a checkpoint or a shard: any answer will do, a panic or a hunger for memory will not. Checksums are not compared here,
//! for nobody guesses them.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use vdf_render::{Film, FilmPart};

fn decode(bytes: &[u8]) -> Option<Film> {
    Film::decode(Path::new("a.film"), bytes, bytes.len() as u64).ok()
}

fn encode(film: &Film) -> Vec<u8> {
    let mut bytes = Vec::new();
    film.encode(&mut bytes).expect("memory takes all");
    bytes
}

fuzz_target!(|bytes: &[u8]| {
    let Some(film) = decode(bytes) else { return };
    let encoded = encode(&film);
    // Compared as bytes, for no film with a NaN is equal to itself.
    assert_eq!(decode(&encoded).map(|film| encode(&film)), Some(encoded));
    // What `vdf merge` and `--resume` do with it.
    let (spp, crop) = (film.origin().spp, film.origin().crop);
    let missing = film.missing(0..spp);
    let part = FilmPart::samples(0..spp);
    assert_eq!(missing.is_empty(), film.missing_samples(&part) == 0);
    assert!(film.complete_until(&part) <= spp);
    assert!(film.contains(&film));
    let mut merged = film.clone();
    assert_eq!(merged.merge(film.clone()).is_ok(), film.total_samples() == 0);
    // A crop of many pixels takes memory once it is developed, which is no fault.
    if u64::from(crop.x1 - crop.x0) * u64::from(crop.y1 - crop.y0) < 1 << 20 {
        let so_far = film.develop_so_far().expect("a small image");
        // The whole picture is the one so far, or it lacks samples.
        assert!(film.develop().map_or(true, |image| image.pixels.len() == so_far.pixels.len()));
        film.develop_layers();
    }
});
