//! PFM pictures: numbers of single precision as they are.
//!
//! *Definition.* `PF` (three channels) or `Pf` (grey), width, height and a scale as text, each with white space behind it, the last with one character; then the values in
//! rows from the bottom. A scale below 0 says little endian, one above 0 big endian; its amount multiplies the values, as in Mitsuba.
//!
//! *Limits.* Nothing is allocated because a header says so: the values must be there.

use image::{DynamicImage, ImageBuffer};

/// More characters are no number of a header.
const LONGEST_WORD: usize = 32;

/// True if the file says that it is one.
pub(crate) fn is_pfm(file: &[u8]) -> bool {
    matches!(file, [b'P', b'F' | b'f', space, ..] if space.is_ascii_whitespace())
}

/// Reads a picture of at most so many pixels. Cost: linear in the file.
pub(crate) fn read(file: &[u8], most: u64) -> Result<DynamicImage, String> {
    let channels = if file.starts_with(b"PF") { 3 } else { 1 };
    let mut rest = file.get(2..).unwrap_or_default();
    let (width, height) = (side(&mut rest, "width")?, side(&mut rest, "height")?);
    let scale = word(&mut rest).and_then(|text| text.parse::<f32>().ok()).filter(|s| s.is_finite() && *s != 0.0);
    let scale = scale.ok_or("the scale in its header is no number other than 0")?;
    let count = u64::from(width) * u64::from(height);
    if count > most || count == 0 {
        return Err(format!("it has {width} × {height} pixels; at most {most} are read"));
    }
    // The white space behind the scale is one character: what follows may look like more of it.
    let values = rest.get(1..).unwrap_or_default();
    let wanted = count * channels * 4;
    if (values.len() as u64) < wanted {
        return Err(format!("the file ends after {} of {wanted} bytes of pixels", values.len()));
    }
    let value = |bytes: &[u8]| {
        let bytes = bytes.try_into().unwrap_or_default();
        scale.abs() * if scale < 0.0 { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) }
    };
    let row = width as usize * channels as usize * 4;
    let rows = values.chunks_exact(row).take(height as usize).rev();
    let rgb = if channels == 3 {
        rows.flat_map(|row| row.chunks_exact(4).map(value)).collect()
    } else {
        rows.flat_map(|row| row.chunks_exact(4).flat_map(|grey| [value(grey); 3])).collect()
    };
    let image = ImageBuffer::from_raw(width, height, rgb).ok_or("it has too many pixels")?;
    Ok(DynamicImage::ImageRgb32F(image))
}

fn side(rest: &mut &[u8], name: &str) -> Result<u32, String> {
    let parsed = word(rest).and_then(|text| text.parse().ok());
    parsed.ok_or_else(|| format!("the {name} in its header is not an integer, or too large"))
}

/// The next word of the header. What is left begins with the white space behind it.
fn word<'a>(rest: &mut &'a [u8]) -> Option<&'a str> {
    let text = rest.trim_ascii_start();
    let length = text.iter().take(LONGEST_WORD).position(u8::is_ascii_whitespace)?;
    let (word, behind) = text.split_at(length);
    *rest = behind;
    std::str::from_utf8(word).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, values: impl IntoIterator<Item = f32>) -> Vec<u8> {
        header.bytes().chain(values.into_iter().flat_map(f32::to_le_bytes)).collect()
    }

    fn pixels(file: &[u8]) -> Vec<f32> {
        assert!(is_pfm(file));
        read(file, 100).expect("it is a picture").into_rgb32f().into_raw()
    }

    fn numbers(count: u8) -> impl Iterator<Item = f32> {
        (0..count).map(f32::from)
    }

    #[test]
    fn rows_begin_at_the_bottom_in_either_byte_order() {
        let expected = [6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        assert_eq!(pixels(&file("PF\n2 2\n-1.0\n", numbers(12))), expected);
        let big: Vec<u8> = b"PF 2\n2 1 ".iter().copied().chain(numbers(12).flat_map(f32::to_be_bytes)).collect();
        assert_eq!(pixels(&big), expected);
        assert_eq!(pixels(&file("PF\n2 2\n-2\n", numbers(14))), expected.map(|v| 2.0 * v));
        let grey = pixels(&file("Pf\n1 2\n-1\n", [0.25, -3.0]));
        assert_eq!(grey, [-3.0, -3.0, -3.0, 0.25, 0.25, 0.25]);
        // The first value begins with a byte that is a line break.
        let odd = f32::from_le_bytes(*b"\n\n\n\n");
        assert_eq!(pixels(&file("Pf\n1 1\n-1\n", [odd])), [odd; 3]);
    }

    #[test]
    fn what_is_cut_off_or_absurd_is_refused() {
        let refused = |file: &[u8], part: &str| {
            let message = read(file, 100).expect_err("this must be refused");
            assert!(message.contains(part), "{message}");
        };
        let whole = file("PF\n2 2\n-1.0\n", numbers(12));
        for length in 2..whole.len() {
            let message = read(&whole[..length], 100).expect_err("it is cut off");
            assert!(message.contains("header") || message.contains("of 48 bytes"), "{message}");
        }
        refused(b"PF\n65536 65536\n-1\n", "65536 × 65536 pixels; at most 100");
        refused(b"PF\n4294967295 4294967295\n-1\n", "at most 100");
        refused(b"PF\n0 2\n-1\n", "0 × 2 pixels");
        refused(b"PF\n-2 2\n-1\n", "width");
        refused(b"PF\n2 99999999999999999999\n-1\n", "height");
        for scale in ["0", "nan", "inf", "1e99", "one"] {
            refused(format!("PF\n1 1\n{scale}\n").as_bytes(), "scale");
        }
        refused(format!("PF\n1 1\n{}\n", "1".repeat(40)).as_bytes(), "scale");
        assert!(!is_pfm(b"PF4\n2 2\n-1\n") && !is_pfm(b"P6\n2 2\n255\n") && !is_pfm(b"PF"));
    }
}
