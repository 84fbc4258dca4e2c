//! Mitsuba's `.vol` files: values on a lattice, in binary.
//!
//! *Definition.* `VOL`, the version 3, then in little endian the encoding (1: single precision), the numbers of values along x, y and z and of channels, all as
//! integers of four bytes; the least and the greatest corner of a box; and the values, the channels of one together, x fastest.
//!
//! *Limits.* Nothing is allocated because a header says so: memory grows with what is read.

use std::io::{self, BufRead, Read as _, Write};

use glam::Vec3;

use crate::VoxelGrid;

const MAGIC: [u8; 3] = *b"VOL";
const VERSION: u8 = 3;
const SINGLE_PRECISION: i32 = 1;
/// Bytes before the values.
const HEADER: u64 = 48;

/// Why a file holds no grid that can be read.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub(crate) struct VolError {
    /// What is wrong, and at which byte.
    pub(crate) message: String,
    /// How to mend it; may be empty.
    pub(crate) help: String,
}

impl VolError {
    fn new(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: help.into() }
    }
}

/// Reads a grid of at most so many numbers. Cost: linear in the file.
pub(crate) fn read(input: &mut dyn BufRead, most: u64) -> Result<VoxelGrid, VolError> {
    let [v, o, l, version] = bytes(input, 0)?;
    if [v, o, l] != MAGIC {
        return Err(VolError::new(
            "byte 0: the file does not begin with VOL",
            "write it by mitsuba.VolumeGrid(…).write(…)",
        ));
    }
    if version != VERSION {
        let help = "Mitsuba 3 reads and writes version 3: write the file anew by mitsuba.VolumeGrid(…).write(…)";
        return Err(VolError::new(format!("byte 3: version {version} is not supported"), help));
    }
    let encoding = i32::from_le_bytes(bytes(input, 4)?);
    if encoding != SINGLE_PRECISION {
        let help = "only 1, single precision, is supported, as in Mitsuba 3: convert the values";
        return Err(VolError::new(format!("byte 4: encoding {encoding} is not supported"), help));
    }
    let mut sides = [0_i32; 4];
    for (side, at) in sides.iter_mut().zip([8, 12, 16, 20]) {
        *side = i32::from_le_bytes(bytes(input, at)?);
    }
    let [x, y, z, channels] = sides;
    let unusable = |what: &str| {
        let message = format!("byte 8: {x} × {y} × {z} values of {channels} channels: {what}");
        VolError::new(message, "at least one value along each axis, of 1 or 3 channels")
    };
    let size = [x, y, z].map(u32::try_from);
    let ([Ok(nx), Ok(ny), Ok(nz)], 1 | 3) = (size, channels) else { return Err(unusable("not supported")) };
    let count = [nx, ny, nz].iter().try_fold(channels as u64, |n, &side| n.checked_mul(side.into()));
    if count == Some(0) {
        return Err(unusable("not supported"));
    }
    let count = count.unwrap_or(u64::MAX);
    if count > most {
        return Err(VolError::new(
            format!("byte 8: {x} × {y} × {z} values of {channels} channels; at most {most} numbers are read"),
            "use a coarser grid",
        ));
    }
    let mut corners = [0.0_f32; 6];
    for (corner, at) in corners.iter_mut().zip((24_u64..).step_by(4)) {
        *corner = f32::from_le_bytes(bytes(input, at)?);
    }
    let [a, b, c, d, e, f] = corners;
    let values = values(input, count)?;
    VoxelGrid::new([nx, ny, nz], channels as usize, values, [Vec3::new(a, b, c), Vec3::new(d, e, f)])
        .ok_or_else(|| unusable("not supported"))
}

fn values(input: &mut dyn BufRead, count: u64) -> Result<Vec<f32>, VolError> {
    let mut values: Vec<f32> = Vec::new();
    let mut buffer = Vec::with_capacity(1 << 16);
    while (values.len() as u64) < count {
        let wanted = 4 * (count - values.len() as u64).min(1 << 14);
        buffer.clear();
        let read = input.take(wanted).read_to_end(&mut buffer).map_err(|e| VolError::new(e.to_string(), ""))?;
        for chunk in buffer.chunks_exact(4) {
            let value = chunk.try_into().map_or(f32::NAN, f32::from_le_bytes);
            if !(value.is_finite() && value >= 0.0) {
                let at = HEADER + 4 * values.len() as u64;
                let message = format!("byte {at}: the value is {value}");
                return Err(VolError::new(message, "values must be finite and at least 0"));
            }
            values.push(value);
        }
        if (read as u64) < wanted {
            let message = format!("the file ends after {} of its {count} numbers", values.len());
            return Err(VolError::new(message, "it was cut off: write or copy it again"));
        }
    }
    Ok(values)
}

fn bytes<const N: usize>(input: &mut dyn BufRead, at: u64) -> Result<[u8; N], VolError> {
    let mut bytes = [0; N];
    input.read_exact(&mut bytes).map_err(|e| match e.kind() {
        io::ErrorKind::UnexpectedEof => VolError::new(
            format!("byte {at}: the file ends within its header"),
            "it is no .vol file, or was cut off: write or copy it again",
        ),
        _ => VolError::new(e.to_string(), ""),
    })?;
    Ok(bytes)
}

impl VoxelGrid {
    /// Writes a `.vol` file of version 3, which Mitsuba reads, too.
    ///
    /// # Errors
    /// If `out` does not take it.
    pub fn write_vol(&self, out: &mut dyn Write) -> io::Result<()> {
        out.write_all(&MAGIC)?;
        out.write_all(&[VERSION])?;
        out.write_all(&SINGLE_PRECISION.to_le_bytes())?;
        for side in self.size() {
            out.write_all(&side.to_le_bytes())?;
        }
        out.write_all(&(self.channels() as u32).to_le_bytes())?;
        for corner in self.bounds().iter().flat_map(|corner| corner.to_array()) {
            out.write_all(&corner.to_le_bytes())?;
        }
        for chunk in self.values().chunks(1 << 14) {
            let bytes: Vec<u8> = chunk.iter().flat_map(|v| v.to_le_bytes()).collect();
            out.write_all(&bytes)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOST: u64 = 1000;

    fn file() -> Vec<u8> {
        let values = (0..18_u8).map(f32::from).collect();
        let grid = VoxelGrid::new([3, 2, 1], 3, values, [Vec3::NEG_ONE, Vec3::splat(2.5)]).unwrap();
        let mut file = Vec::new();
        grid.write_vol(&mut file).unwrap();
        assert_eq!(read(&mut &*file, MOST), Ok(grid));
        file
    }

    fn with(at: usize, bytes: &[u8]) -> Vec<u8> {
        let mut file = file();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        file
    }

    fn refused(file: &[u8], words: &str) {
        let error = read(&mut &*file, MOST).expect_err(words);
        assert!(error.message.contains(words), "{error}, not {words}");
    }

    #[test]
    fn what_is_wrong_is_said() {
        assert_eq!(file().len() as u64, HEADER + 18 * 4);
        refused(&with(0, b"PLY"), "byte 0");
        refused(&with(3, &[2]), "version 2");
        refused(&with(4, &[3]), "encoding 3");
        refused(&with(8, &[0]), "0 × 2 × 1");
        refused(&with(8, &[255; 4]), "-1 × 2");
        refused(&with(20, &[6]), "6 channels");
        refused(&with(8, &0x7fff_ffff_i32.to_le_bytes()), "at most 1000");
        refused(&[with(8, &[255, 255, 255, 127]), vec![]].concat(), "at most");
        for (value, words) in [(f32::NAN, "NaN"), (-1.0, "-1"), (f32::INFINITY, "inf")] {
            refused(&with(48 + 4 * 7, &value.to_le_bytes()), &format!("byte 76: the value is {words}"));
        }
    }

    /// Every cut-off file is refused, and a longer one is read as Mitsuba reads it: without its end.
    #[test]
    fn cut_files_are_refused() {
        let whole = file();
        for length in 0..whole.len() {
            refused(&whole[..length], if length < 48 { "within its header" } else { "ends after" });
        }
        assert!(read(&mut &*[whole.clone(), vec![7; 9]].concat(), MOST).is_ok());
    }

    /// A header that claims a gigabyte costs what follows it.
    #[test]
    fn memory_grows_with_what_is_read() {
        let mut lies = with(8, &[1000_i32, 1000, 1000].map(i32::to_le_bytes).concat());
        lies.truncate(60);
        let error = read(&mut &*lies, u64::MAX).expect_err("too short");
        assert!(error.message.contains("ends after 3 of its 3000000000"), "{error}");
    }
}
