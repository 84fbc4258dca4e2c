//! The order of the attributes in the header of an EXR.

use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};

/// Magic number and version.
const START: u64 = 8;

/// Sorts the attributes in the header by name, in place.
///
/// The encoder keeps custom attributes in a hash map, so that their order differs from run to run. The header keeps
/// its length, so all offsets stay right.
///
/// # Errors
/// What the system says, or that the file is no single-part EXR.
pub(super) fn sort_header(mut file: impl Read + Write + Seek) -> io::Result<()> {
    file.seek(SeekFrom::Start(START))?;
    let mut reader = BufReader::new(&mut file);
    let mut attributes = Vec::new();
    while let Some(attribute) = read_attribute(&mut reader)? {
        attributes.push(attribute);
    }
    // Names are unique and NUL-terminated, so comparing whole attributes compares names.
    attributes.sort_unstable();
    file.seek(SeekFrom::Start(START))?;
    file.write_all(&attributes.concat())
}

/// The bytes of the next attribute: name, type, size and value. An empty name ends the header.
fn read_attribute(reader: &mut impl BufRead) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    reader.read_until(0, &mut bytes)?;
    if bytes == [0] {
        return Ok(None);
    }
    reader.read_until(0, &mut bytes)?;
    let mut size = [0; 4];
    reader.read_exact(&mut size)?;
    bytes.extend(size);
    let size = u64::from(u32::from_le_bytes(size));
    if reader.take(size).read_to_end(&mut bytes)? as u64 != size {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(Some(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_are_sorted_and_all_else_stays() {
        let attribute = |name: &str, value: &[u8]| {
            let size = u32::try_from(value.len()).unwrap().to_le_bytes();
            [name.as_bytes(), b"\0string\0", &size, value].concat()
        };
        let [a, b, c] = [attribute("a", b"zz"), attribute("b", b""), attribute("bc", b"\0\0\0")];
        let file = |order: [&[u8]; 3]| [b"12345678", order[0], order[1], order[2], b"\0rest\0"].concat();
        let mut bytes = io::Cursor::new(file([&c, &b, &a]));
        sort_header(&mut bytes).unwrap();
        assert_eq!(bytes.into_inner(), file([&a, &b, &c]));
        let whole = file([&c, &b, &a]);
        for length in 0..8 + c.len() {
            assert!(sort_header(io::Cursor::new(whole[..length].to_vec())).is_err(), "{length}");
        }
    }
}
