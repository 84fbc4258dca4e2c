//! Voxelization by clipping a triangle to slices and rows of the grid.
//!
//! *Idea.* A triangle is convex, and so is what a slice of the grid, one voxel thick, leaves of it; and so is what a
//! row of voxels leaves of that. The voxels of a row that touch a convex set are a run, from the voxel of its least to
//! the voxel of its greatest coordinate. So two clips give all voxels of a row at once, exactly but for rounding.
//!
//! *Definition.* For each slice k the polygon P = {p ∈ triangle: k − δ ≤ z ≤ k + 1 + δ}, seen along z; for each row j
//! the interval I = {x of p ∈ P: j − δ ≤ y ≤ j + 1 + δ}; the run is {i: \[i − δ, i + 1 + δ\] ∩ I ≠ ∅}.
//!
//! This is the scheme of 3.5.1 in \[Houska2013\]: rasterize a projection of the triangle conservatively, and fill for
//! each covered pixel the run between the least and the greatest depth of the triangle. It departs in how it finds
//! them. The thesis tests the centres of pixels against an offset polygon \[Hasselgren2005\] cut into trapezoids, and
//! then still needs depths; the clip gives pixels and depths together, and depths of the *triangle*, not of its plane.
//! And the projection is always along x, not along the dominant axis of the normal, because runs along x are bits of
//! words. `docs/ARCHITECTURE.md` compares both.
//!
//! *Guarantee.* That of [`super`]. Clipping only interpolates along edges, with weights in \[0, 1\]: it is as accurate
//! for slivers, needles, segments and points as for any triangle, and cannot overflow. No normal is ever computed.
//!
//! *Cost.* One clip for each slice, up to six crossings; one for each row, usually four; one OR for each 64 voxels
//! of a run. So O(n²) for a triangle across n³ voxels, whatever its direction. A triangle inside one voxel, or inside
//! a straight row of them, needs no clip.

use super::{AtomicBits, GridTriangle, touched};
use crate::grid::GridPoint;

/// Adds the voxels that touch a triangle.
pub(super) fn scan(triangle: &GridTriangle, bits: &AtomicBits) {
    let GridTriangle { vertices, bounds: [x, y, z], dilation, fills_bounds } = triangle;
    if *fills_bounds {
        for k in z[0]..=z[1] {
            for j in y[0]..=y[1] {
                bits.insert_run(j, k, *x);
            }
        }
        return;
    }
    let (columns, rows) = (x[1] + 1, y[1] + 1);
    for k in z[0]..=z[1] {
        let slice = Slice::of(vertices, f64::from(k) - dilation, f64::from(k + 1) + dilation);
        let [low, high] = slice.depth;
        let Some([first, last]) = touched(low - dilation, high + dilation, rows) else {
            continue;
        };
        for j in first..=last {
            let [left, right] = slice.extent(f64::from(j) - dilation, f64::from(j + 1) + dilation);
            if let Some(run) = touched(left - dilation, right + dilation, columns) {
                bits.insert_run(j, k, run);
            }
        }
    }
}

/// A triangle between two planes across z, seen along z, as the edges of a convex polygon.
struct Slice {
    edges: [Edge; 6],
    len: usize,
    /// The least and the greatest y; (∞, −∞) if there is nothing between the planes.
    depth: [f64; 2],
}

/// An edge with its ends (x, y) in the order of y.
#[derive(Clone, Copy)]
struct Edge {
    low: [f64; 2],
    high: [f64; 2],
}

impl Slice {
    fn of(vertices: &[GridPoint; 3], low: f64, high: f64) -> Self {
        // A plane takes one corner off a triangle and leaves two, so two planes leave at most five; six fit.
        let (mut points, mut len) = ([[0.0; 2]; 6], 0);
        let mut push = |point: [f64; 2]| {
            points[len] = point;
            len += 1;
        };
        let GridPoint(mut a) = vertices[2];
        for &GridPoint(b) in vertices {
            // Always from the lower end, so that the order of the vertices does not matter.
            let (from, to) = if a.z <= b.z { (a, b) } else { (b, a) };
            if from.z <= high && to.z >= low {
                let cross = |plane: f64| {
                    let t = (plane - from.z) / (to.z - from.z);
                    [from.x + t * (to.x - from.x), from.y + t * (to.y - from.y)]
                };
                if a.z < low {
                    push(cross(low));
                } else if a.z > high {
                    push(cross(high));
                }
                if b.z < low {
                    push(cross(low));
                } else if b.z > high {
                    push(cross(high));
                } else {
                    push([b.x, b.y]);
                }
            }
            a = b;
        }

        let mut edges = [Edge { low: [0.0; 2], high: [0.0; 2] }; 6];
        let mut depth = [f64::INFINITY, f64::NEG_INFINITY];
        for (n, edge) in edges.iter_mut().enumerate().take(len) {
            let (p, q) = (points[n], points[if n + 1 < len { n + 1 } else { 0 }]);
            *edge = if p[1] <= q[1] { Edge { low: p, high: q } } else { Edge { low: q, high: p } };
            depth = [least(depth[0], p[1]), greatest(depth[1], p[1])];
        }
        Self { edges, len, depth }
    }

    /// The least and the greatest x of what lies between two lines across y; (∞, −∞) if nothing does.
    #[inline]
    fn extent(&self, low: f64, high: f64) -> [f64; 2] {
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for edge in &self.edges[..self.len] {
            let ([x0, y0], [x1, y1]) = (edge.low, edge.high);
            if y0 <= high && y1 >= low {
                let cross = |line: f64| x0 + (line - y0) / (y1 - y0) * (x1 - x0);
                let from = if y0 < low { cross(low) } else { x0 };
                let to = if y1 > high { cross(high) } else { x1 };
                left = least(left, least(from, to));
                right = greatest(right, greatest(from, to));
            }
        }
        [left, right]
    }
}

/// The lesser of two numbers; cheaper than `f64::min`, which looks for NaN. None occurs: vertices are finite and
/// grid coordinates stay below 10⁹⁰.
#[inline]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers.
#[inline]
fn greatest(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
