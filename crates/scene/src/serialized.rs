//! Mitsuba's `serialized` meshes: several in one file, each compressed, and a table of where they begin at the end.
//!
//! *Definition.* Each mesh begins with 0x041C and the version (3 or 4), two bytes each, the rest is a zlib stream: flags, in version 4 a name, the numbers of vertices
//! and of triangles, positions, and if the flags say so normals, texture coordinates and colours; then the triangles. All numbers are little endian. The file
//! ends with the offset of each mesh, of four bytes in version 3 and of eight in version 4, and how many there are.
//!
//! *Limits.* Nothing is allocated because a header says so: memory grows with what is decompressed.

use std::io::{BufRead, Read};

use flate2::read::ZlibDecoder;
use glam::{DVec3, Vec2};

use crate::mesh::{Mesh, MeshError};

const MAGIC: [u8; 2] = [0x1c, 0x04];
const HAS_NORMALS: u32 = 0x0001;
const HAS_TEXTURE_COORDINATES: u32 = 0x0002;
const HAS_COLOURS: u32 = 0x0008;
const FACE_NORMALS: u32 = 0x0010;
const DOUBLE: u32 = 0x2000;
/// Bytes of a name.
const LONGEST_NAME: usize = 1 << 16;

/// Reads mesh number `index` of a file, of at most so many triangles and vertices. Cost: linear in the file.
pub(crate) fn read(input: &mut dyn BufRead, index: usize, most: usize) -> Result<Mesh, MeshError> {
    let mut file = Vec::new();
    input.read_to_end(&mut file).map_err(|e| MeshError::of_file(e.to_string(), ""))?;
    let wrong = |message: &str| MeshError::of_file(message, "");
    let version = version(&file).ok_or_else(|| wrong("the file is no serialized mesh of version 3 or 4"))?;
    let width = if version == 3 { 4 } else { 8 };
    let count = last_word(&file).ok_or_else(|| wrong("the file is too short"))?;
    if index >= count {
        return Err(MeshError::of_file(format!("there is no shape {index}: the file has {count}, counted from 0"), ""));
    }
    let table = count.checked_mul(width).and_then(|bytes| file.len().checked_sub(4 + bytes));
    let entry = table.map(|table| table + index * width).and_then(|at| file.get(at..at + width));
    let offset = entry.and_then(|bytes| usize::try_from(little_endian(bytes)).ok());
    let mesh = offset.and_then(|at| file.get(at..)).filter(|mesh| self::version(mesh).is_some());
    let mesh = mesh.ok_or_else(|| wrong("the table at the end of the file does not lead to the shape"))?;
    Stream { from: ZlibDecoder::new(&mesh[4..]), double: false }.mesh(version, most)
}

fn version(bytes: &[u8]) -> Option<u8> {
    match *bytes {
        [a, b, version @ (3 | 4), 0, ..] if [a, b] == MAGIC => Some(version),
        _ => None,
    }
}

fn last_word(file: &[u8]) -> Option<usize> {
    let at = file.len().checked_sub(4)?;
    usize::try_from(little_endian(&file[at..])).ok()
}

fn little_endian(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |n, &b| n << 8 | u64::from(b))
}

struct Stream<R> {
    from: R,
    /// Numbers have eight bytes.
    double: bool,
}

impl<R: Read> Stream<R> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], MeshError> {
        let mut bytes = [0; N];
        self.from.read_exact(&mut bytes).map_err(|e| {
            MeshError::of_file(format!("the shape ends too early, or is not compressed by zlib: {e}"), "")
        })?;
        Ok(bytes)
    }

    fn number(&mut self) -> Result<f64, MeshError> {
        let number =
            if self.double { f64::from_le_bytes(self.bytes()?) } else { f32::from_le_bytes(self.bytes()?).into() };
        if number.is_finite() { Ok(number) } else { Err(MeshError::of_file("a number that is not finite", "")) }
    }

    fn point(&mut self) -> Result<DVec3, MeshError> {
        Ok(DVec3::new(self.number()?, self.number()?, self.number()?))
    }

    fn mesh(mut self, version: u8, most: usize) -> Result<Mesh, MeshError> {
        let flags = u32::from_le_bytes(self.bytes()?);
        self.double = flags & DOUBLE != 0;
        if version == 4 {
            let mut length = 0;
            while self.bytes()? != [0_u8] {
                length += 1;
                if length > LONGEST_NAME {
                    return Err(MeshError::of_file("the name of the shape does not end", ""));
                }
            }
        }
        let [vertices, triangles] = [u64::from_le_bytes(self.bytes()?), u64::from_le_bytes(self.bytes()?)];
        if vertices.max(triangles) > most as u64 {
            let message = format!("{vertices} vertices and {triangles} triangles; at most {most} are read");
            return Err(MeshError::of_file(message, ""));
        }
        let mut mesh = Mesh { face_normals: flags & FACE_NORMALS != 0, ..Mesh::default() };
        for _ in 0..vertices {
            mesh.positions.push(self.point()?);
        }
        if flags & HAS_NORMALS != 0 {
            for _ in 0..vertices {
                mesh.normals.push(self.point()?);
            }
        }
        if flags & HAS_TEXTURE_COORDINATES != 0 {
            for _ in 0..vertices {
                mesh.uvs.push(Vec2::new(self.number()? as f32, self.number()? as f32));
            }
        }
        if flags & HAS_COLOURS != 0 {
            for _ in 0..vertices {
                self.point()?;
            }
        }
        for _ in 0..triangles {
            let corners = [(); 3].map(|()| self.bytes().map(u32::from_le_bytes));
            let [a, b, c] = corners;
            let corners = [a?, b?, c?];
            if corners.iter().any(|&i| u64::from(i) >= vertices) {
                let message = format!("a triangle names a vertex that is not there: the shape has {vertices}");
                return Err(MeshError::of_file(message, ""));
            }
            mesh.triangles.push(corners);
        }
        if !mesh.uvs.is_empty() {
            mesh.uv_triangles = mesh.triangles.clone();
        }
        if !mesh.normals.is_empty() {
            mesh.normal_triangles = mesh.triangles.clone();
        }
        Ok(mesh)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    fn compressed(version: u16, flags: u32, index: u32) -> Vec<u8> {
        let mut shape = flags.to_le_bytes().to_vec();
        if version == 4 {
            shape.extend(b"name\0");
        }
        shape.extend([4_u64, 1].map(u64::to_le_bytes).concat());
        for number in 0..12 + if flags & HAS_TEXTURE_COORDINATES == 0 { 0 } else { 8 } {
            if flags & DOUBLE == 0 {
                shape.extend((number as f32).to_le_bytes());
            } else {
                shape.extend(f64::from(number).to_le_bytes());
            }
        }
        shape.extend([0, 1, index].map(u32::to_le_bytes).concat());
        let mut file = [MAGIC, version.to_le_bytes()].concat();
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(&shape).unwrap();
        file.extend(encoder.finish().unwrap());
        file
    }

    fn file(version: u16, shapes: &[Vec<u8>]) -> Vec<u8> {
        let (mut file, mut offsets): (Vec<u8>, Vec<u8>) = (Vec::new(), Vec::new());
        for shape in shapes {
            let offset = file.len() as u64;
            offsets.extend(&offset.to_le_bytes()[..if version == 3 { 4 } else { 8 }]);
            file.extend(shape);
        }
        file.extend(offsets);
        file.extend((shapes.len() as u32).to_le_bytes());
        file
    }

    #[test]
    fn each_version_and_shape_is_found() {
        for version in [3, 4] {
            for double in [0, DOUBLE] {
                let shapes = [3, 2].map(|index| compressed(version, HAS_TEXTURE_COORDINATES | double, index));
                let file = file(version, &shapes);
                for (number, last) in [(0, 3), (1, 2)] {
                    let mesh = read(&mut &*file, number, 100).unwrap();
                    assert_eq!(mesh.triangles, [[0, 1, last]]);
                    assert_eq!((mesh.positions[3], mesh.uvs[3]), (DVec3::new(9.0, 10.0, 11.0), Vec2::new(18.0, 19.0)));
                }
                let message = |number, most| read(&mut &*file, number, most).unwrap_err().message;
                assert!(message(2, 100).contains("has 2"));
                assert!(message(0, 3).contains("at most 3"));
            }
        }
    }

    #[test]
    fn what_is_damaged_is_refused() {
        let good = file(4, &[compressed(4, 0, 3)]);
        assert!(read(&mut &*good, 0, 100).is_ok());
        for length in 0..good.len() {
            assert!(read(&mut &good[..length], 0, 100).is_err(), "{length}");
        }
        assert!(read(&mut &*file(4, &[compressed(4, 0, 4)]), 0, 100).unwrap_err().message.contains("not there"));
        assert!(read(&mut &*[&MAGIC[..], &[4, 0], &[255; 30]].concat(), 0, 100).is_err());
    }
}
