//! Offset polygon.

use glam::DVec3;

use super::Bounds;
use super::atomic_bits::AtomicBits;
use super::separating_axes::Slab;

/// Adds the voxels of the columns that a triangle covers.
pub(super) fn scan(bits: &AtomicBits, vertices: &[DVec3; 3], bounds: &Bounds, dilation: f64) {
    let radius = 0.5 + dilation;
    let slab = Slab::new(vertices, radius);
    let w = slab.axis;
    let (u, v) = ((w + 1) % 3, (w + 2) % 3);
    OffsetPolygon::new(vertices.map(|p| [p[u], p[v]]), radius).trapezoids(|trapezoid| {
        let Some(rows) = centres(trapezoid.low, trapezoid.high, bounds[v]) else {
            return;
        };
        for cv in rows[0]..=rows[1] {
            let y = f64::from(cv) + 0.5;
            let Some(columns) = centres(trapezoid.left.at(y), trapezoid.right.at(y), bounds[u]) else {
                continue;
            };
            let Some((low, high)) = depths_in_row(vertices, v, w, y - radius, y + radius) else {
                continue;
            };
            let (low, high) = (low - radius, high + radius);
            for cu in columns[0]..=columns[1] {
                let x = f64::from(cu) + 0.5;
                let (near, far) = slab.depths(x, y);
                let near = (near - 4.0 * dilation).max(low);
                let far = (far + 4.0 * dilation).min(high);
                let Some(run) = centres(near, far, bounds[w]) else {
                    continue;
                };
                for cw in run[0]..=run[1] {
                    let mut voxel = [0; 3];
                    (voxel[u], voxel[v], voxel[w]) = (cu, cv, cw);
                    bits.insert_run(voxel[1], voxel[2], [voxel[0]; 2]);
                }
            }
        }
    });
}

/// The pixels within bounds whose centres are in [low, high].
fn centres(low: f64, high: f64, bounds: [u32; 2]) -> Option<[u32; 2]> {
    if high < 0.5 {
        return None;
    }
    let first = (low + 0.5) as u32;
    let first = if f64::from(first) + 0.5 < low { first + 1 } else { first };
    let first = if first >= 1 && f64::from(first) - 0.5 >= low { first - 1 } else { first };
    let last = (high - 0.5) as u32;
    let (first, last) = (first.max(bounds[0]), last.min(bounds[1]));
    (first <= last).then_some([first, last])
}

/// The depths of the part of a triangle between two planes across v.
fn depths_in_row(vertices: &[DVec3; 3], v: usize, w: usize, low: f64, high: f64) -> Option<(f64, f64)> {
    let (mut near, mut far) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut p = vertices[2];
    for &q in vertices {
        let (a, b) = if p[v] <= q[v] { (p, q) } else { (q, p) };
        if a[v] <= high && b[v] >= low {
            let cross = |plane: f64| a[w] + (plane - a[v]) / (b[v] - a[v]) * (b[w] - a[w]);
            let from = if a[v] < low { cross(low) } else { a[w] };
            let to = if b[v] > high { cross(high) } else { b[w] };
            near = near.min(from).min(to);
            far = far.max(from).max(to);
        }
        p = q;
    }
    (near <= far).then_some((near, far))
}

/// The convex hull of pixels centred at the vertices of a projected triangle, counter-clockwise.
struct OffsetPolygon {
    points: [[f64; 2]; 8],
    len: usize,
}

#[derive(Clone, Copy)]
struct Edge {
    from: [f64; 2],
    to: [f64; 2],
}

impl Edge {
    fn at(&self, y: f64) -> f64 {
        let [x0, y0] = self.from;
        let [x1, y1] = self.to;
        x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    }
}

struct Trapezoid {
    low: f64,
    high: f64,
    left: Edge,
    right: Edge,
}

impl OffsetPolygon {
    fn new(mut p: [[f64; 2]; 3], radius: f64) -> Self {
        let coord = |[x, y]: [f64; 2]| robust::Coord { x, y };
        let area = robust::orient2d(coord(p[0]), coord(p[1]), coord(p[2]));
        let mut polygon = Self { points: [[0.0; 2]; 8], len: 0 };
        if area == 0.0 {
            // The ends of the segment; a point has the same twice.
            p.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
            let ends = [p[0], p[2]];
            if ends[0] == ends[1] {
                (0..4).for_each(|quadrant| polygon.push(p[0], quadrant, radius));
            } else {
                polygon.surround(&ends, radius);
            }
        } else {
            if area < 0.0 {
                p.swap(1, 2);
            }
            polygon.surround(&p, radius);
        }
        polygon
    }

    fn surround(&mut self, vertices: &[[f64; 2]], radius: f64) {
        let n = vertices.len();
        let quadrant_of_edge = |i: usize| {
            let (p, q) = (vertices[i % n], vertices[(i + 1) % n]);
            quadrant([q[1] - p[1], p[0] - q[0]])
        };
        for i in 0..n {
            let (last, next) = (quadrant_of_edge(i + n - 1), quadrant_of_edge(i));
            let mut q = last;
            self.push(vertices[i], q, radius);
            while q != next {
                q = (q + 1) % 4;
                self.push(vertices[i], q, radius);
            }
        }
    }

    fn push(&mut self, [x, y]: [f64; 2], quadrant: usize, radius: f64) {
        let (sx, sy) = [(radius, radius), (-radius, radius), (-radius, -radius), (radius, -radius)][quadrant];
        self.points[self.len] = [x + sx, y + sy];
        self.len += 1;
    }

    /// Cuts the polygon across by the vertices of its left and its right chain.
    fn trapezoids(&self, mut visit: impl FnMut(&Trapezoid)) {
        let n = self.len;
        let y = |i: usize| self.points[i][1];
        let top = (1..n).fold(0, |best, i| if y(i) > y(best) { i } else { best });
        let bottom = (1..n).fold(0, |best, i| if y(i) < y(best) { i } else { best });
        let (mut left, mut right) = (top, top);
        let mut high = y(top);
        let floor = y(bottom);
        while high > floor {
            // The edges below `high`; level ones are skipped, for their ends belong to the next ones.
            while y((left + 1) % n) >= high {
                left = (left + 1) % n;
            }
            while y((right + n - 1) % n) >= high {
                right = (right + n - 1) % n;
            }
            let (next_left, next_right) = ((left + 1) % n, (right + n - 1) % n);
            let low = y(next_left).max(y(next_right));
            visit(&Trapezoid {
                low,
                high,
                left: Edge { from: self.points[left], to: self.points[next_left] },
                right: Edge { from: self.points[right], to: self.points[next_right] },
            });
            high = low;
        }
    }
}

/// The quadrant of a direction, half open, so that opposite directions are in opposite quadrants.
fn quadrant([x, y]: [f64; 2]) -> usize {
    if x > 0.0 && y >= 0.0 {
        0
    } else if x <= 0.0 && y > 0.0 {
        1
    } else if x < 0.0 {
        2
    } else {
        3
    }
}
