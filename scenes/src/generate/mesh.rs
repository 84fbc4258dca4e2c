//! Where generated triangles go. They are passed on as they are made, so a mesh of any size needs no memory.

use std::io::{self, Write};

use glam::DVec3;

/// A consumer of one mesh.
pub(super) trait MeshSink {
    /// Takes a vertex and returns its number.
    fn vertex(&mut self, p: DVec3) -> io::Result<u32>;

    /// Takes a triangle of vertices that were passed before; counter-clockwise seen from its front.
    fn triangle(&mut self, corners: [u32; 3]) -> io::Result<()>;
}

/// Coordinates are written as multiples of 1/10000: short, and far coarser than any rounding on the way.
const DECIMALS: usize = 4;
const STEPS: f64 = 10_000.0;

/// Writes Wavefront OBJ text.
pub(super) struct ObjWriter<'a> {
    out: &'a mut dyn Write,
    line: Vec<u8>,
    vertices: u32,
}

impl<'a> ObjWriter<'a> {
    pub(super) fn new(out: &'a mut dyn Write) -> Self {
        Self { out, line: Vec::with_capacity(64), vertices: 0 }
    }

    fn write_line(&mut self) -> io::Result<()> {
        self.line.push(b'\n');
        self.out.write_all(&self.line)
    }
}

impl MeshSink for ObjWriter<'_> {
    fn vertex(&mut self, p: DVec3) -> io::Result<u32> {
        self.line.clear();
        self.line.push(b'v');
        for c in p.to_array() {
            self.line.push(b' ');
            let steps = (c * STEPS).round() as i64;
            if steps < 0 {
                self.line.push(b'-');
            }
            push_digits(&mut self.line, steps.unsigned_abs(), DECIMALS);
        }
        self.write_line()?;
        // OBJ counts from 1.
        self.vertices += 1;
        Ok(self.vertices)
    }

    fn triangle(&mut self, corners: [u32; 3]) -> io::Result<()> {
        self.line.clear();
        self.line.push(b'f');
        for c in corners {
            self.line.push(b' ');
            push_digits(&mut self.line, u64::from(c), 0);
        }
        self.write_line()
    }
}

/// Appends `number` with its last `decimals` digits behind a point.
fn push_digits(line: &mut Vec<u8>, mut number: u64, decimals: usize) {
    let start = line.len();
    let mut digits = 0;
    while number > 0 || digits <= decimals {
        if digits == decimals && decimals > 0 {
            line.push(b'.');
        }
        line.push(b'0' + (number % 10) as u8);
        number /= 10;
        digits += 1;
    }
    line[start..].reverse();
}

/// Counts triangles.
#[derive(Debug, Default)]
pub(super) struct TriangleCounter {
    pub(super) triangles: u32,
    vertices: u32,
}

impl MeshSink for TriangleCounter {
    fn vertex(&mut self, _: DVec3) -> io::Result<u32> {
        self.vertices += 1;
        Ok(self.vertices)
    }

    fn triangle(&mut self, _: [u32; 3]) -> io::Result<()> {
        self.triangles += 1;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_a_mesh() {
        let mut text = Vec::new();
        let mut obj = ObjWriter::new(&mut text);
        let a = obj.vertex(DVec3::new(-12.345_67, 0.0, 1e-9)).unwrap();
        let b = obj.vertex(DVec3::new(0.5, -0.000_06, 1024.0)).unwrap();
        obj.triangle([a, b, 120]).unwrap();
        assert_eq!(
            String::from_utf8(text).unwrap(),
            "v -12.3457 0.0000 0.0000\nv 0.5000 -0.0001 1024.0000\nf 1 2 120\n"
        );
    }
}
