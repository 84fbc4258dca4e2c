//! Slices.

use glam::DVec3;

use super::atomic_bits::AtomicBits;
use super::{Bounds, touched};

/// Adds the voxels that touch a triangle, row by row.
pub(super) fn scan(bits: &AtomicBits, vertices: &[DVec3; 3], [x, y, z]: &Bounds, dilation: f64) {
    for k in z[0]..=z[1] {
        let slice = Polygon::slice(vertices, f64::from(k) - dilation, f64::from(k) + 1.0 + dilation);
        let (low, high) = slice.rows();
        let Some(rows) = touched(low - dilation, high + dilation, y[1] + 1) else {
            continue;
        };
        for j in rows[0]..=rows[1] {
            let (left, right) = slice.extent(f64::from(j) - dilation, f64::from(j) + 1.0 + dilation);
            if let Some(run) = touched(left - dilation, right + dilation, x[1] + 1) {
                bits.insert_run(j, k, run);
            }
        }
    }
}

/// The part of a triangle between two planes across z, seen along z.
pub(super) struct Polygon {
    points: [[f64; 2]; 6],
    len: usize,
}

impl Polygon {
    fn slice(vertices: &[DVec3; 3], low: f64, high: f64) -> Self {
        let mut polygon = Self { points: [[0.0; 2]; 6], len: 0 };
        let mut a = vertices[2];
        for &b in vertices {
            let (below, above) = if a.z <= b.z { (a, b) } else { (b, a) };
            if below.z <= high && above.z >= low {
                let cross = |plane: f64| {
                    let t = (plane - below.z) / (above.z - below.z);
                    [below.x + t * (above.x - below.x), below.y + t * (above.y - below.y)]
                };
                if a.z < low {
                    polygon.push(cross(low));
                } else if a.z > high {
                    polygon.push(cross(high));
                }
                if b.z < low {
                    polygon.push(cross(low));
                } else if b.z > high {
                    polygon.push(cross(high));
                } else {
                    polygon.push([b.x, b.y]);
                }
            }
            a = b;
        }
        polygon
    }

    #[inline]
    fn push(&mut self, point: [f64; 2]) {
        self.points[self.len] = point;
        self.len += 1;
    }

    /// The least and the greatest y.
    fn rows(&self) -> (f64, f64) {
        self.points[..self.len]
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (least(low, p[1]), greatest(high, p[1])))
    }

    /// The least and the greatest x of what lies between `low` and `high`.
    fn extent(&self, low: f64, high: f64) -> (f64, f64) {
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut p = self.points[self.len - 1];
        for &q in &self.points[..self.len] {
            let (a, b) = if p[1] <= q[1] { (p, q) } else { (q, p) };
            if a[1] <= high && b[1] >= low {
                let cross = |line: f64| a[0] + (line - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
                let from = if a[1] < low { cross(low) } else { a[0] };
                let to = if b[1] > high { cross(high) } else { b[0] };
                left = least(left, least(from, to));
                right = greatest(right, greatest(from, to));
            }
            p = q;
        }
        (left, right)
    }
}

/// The lesser of two numbers; cheaper than `f64::min`, which looks for NaN.
#[inline]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers.
#[inline]
fn greatest(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
