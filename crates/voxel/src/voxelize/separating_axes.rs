//! Voxelization by the separating-axis test of a triangle and dilated unit cubes, prepared for many cubes of one
//! triangle.
//!
//! A closed triangle and a closed box are disjoint iff one of 13 axes separates them: the 3 axes of the box, the normal
//! of the triangle, and the 9 products of a box axis and an edge (Akenine-Möller). The products with one box axis live
//! in the projection along it, so they are 2D edge tests (Schwarz and Seidel 2010).
//!
//! Here every axis, the normal included, keeps the interval of *all three* projected vertices. For soundness an axis
//! then may be anything: the exactly computed or a badly cancelled normal of a sliver, or the zero vector of a
//! degenerate triangle, which separates nothing. Points and segments need no special case: the remaining axes are
//! exactly those that they require.

use glam::DVec3;

use crate::grid::GridPoint;

/// Axes shorter than this (in the 1-norm) are not used: near the denormals relative error bounds fail.
const SHORTEST_AXIS: f64 = 1e-180;

/// An axis of a projection along one coordinate axis, as the admissible interval for the centre of the voxel.
#[derive(Clone, Copy, Debug)]
struct PlanarAxis {
    a: [f64; 2],
    low: f64,
    high: f64,
}

/// The three edge axes of the triangle projected along a coordinate axis.
#[derive(Clone, Copy, Debug)]
struct Projection {
    axes: [PlanarAxis; 3],
}

impl Projection {
    /// Prepares the projection to the coordinates `u` and `v`; `radius` is half of the dilated voxel.
    fn new(vertices: &[GridPoint; 3], u: usize, v: usize, radius: f64) -> Self {
        let points = vertices.map(|GridPoint(p)| [p[u], p[v]]);
        let axes = [0, 1, 2].map(|edge| {
            let [p, q] = [points[edge], points[(edge + 1) % 3]];
            let a = [p[1] - q[1], q[0] - p[0]];
            let norm = a[0].abs() + a[1].abs();
            if norm < SHORTEST_AXIS {
                return PlanarAxis { a: [0.0; 2], low: 0.0, high: 0.0 };
            }
            let dots = points.map(|p| a[0] * p[0] + a[1] * p[1]);
            let (low, high) = range(dots);
            PlanarAxis { a, low: low - radius * norm, high: high + radius * norm }
        });
        Self { axes }
    }

    /// False if an axis separates the triangle from the voxel that is centred at these coordinates.
    #[inline]
    fn touches(&self, u: f64, v: f64) -> bool {
        self.axes.iter().all(|axis| {
            let dot = axis.a[0] * u + axis.a[1] * v;
            axis.low <= dot && dot <= axis.high
        })
    }
}

/// The normal as an axis, solved for one coordinate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slab {
    n: DVec3,
    low: f64,
    high: f64,
    /// The coordinate along which the normal is longest, or the triangle if it has no normal.
    pub(super) axis: usize,
    /// The normal is long enough to be used.
    usable: bool,
}

impl Slab {
    /// Prepares the normal axis; `radius` is half of the dilated voxel.
    pub(super) fn new(vertices: &[GridPoint; 3], radius: f64) -> Self {
        let [GridPoint(a), GridPoint(b), GridPoint(c)] = *vertices;
        let n = (b - a).cross(c - a);
        let norm = n.abs().element_sum();
        let usable = norm >= SHORTEST_AXIS;
        let size = if usable { n.abs() } else { a.max(b).max(c) - a.min(b).min(c) };
        let (low, high) = range([a, b, c].map(|p| n.dot(p)));
        Self { n, low: low - radius * norm, high: high + radius * norm, axis: size.max_position(), usable }
    }

    /// The interval of centre coordinates along `self.axis` that the normal does not separate, for a column centred at
    /// `u`, `v` on the next two axes in cyclic order.
    ///
    /// Errors and radius are both divided by the same coordinate of the normal, so the dilation covers the rounding.
    #[inline]
    pub(super) fn depths(&self, u: f64, v: f64) -> (f64, f64) {
        if !self.usable {
            return (f64::NEG_INFINITY, f64::INFINITY);
        }
        let [nu, nv] = [self.n[(self.axis + 1) % 3], self.n[(self.axis + 2) % 3]];
        let dot = nu * u + nv * v;
        let (d0, d1) = ((self.low - dot) / self.n[self.axis], (self.high - dot) / self.n[self.axis]);
        (d0.min(d1), d0.max(d1))
    }
}

fn range(values: [f64; 3]) -> (f64, f64) {
    let [a, b, c] = values;
    (a.min(b).min(c), a.max(b).max(c))
}

/// Visits the voxels within bounds that touch a triangle, column by column along the dominant axis of its normal.
///
/// The bounds are the three axes of the box. A column that the projection of the triangle misses is skipped; the normal
/// bounds the run of voxels in it, and only these are tested against the other two projections.
pub(super) fn scan(vertices: &[GridPoint; 3], bounds: &[[u32; 2]; 3], dilation: f64, mut visit: impl FnMut([u32; 3])) {
    let radius = 0.5 + dilation;
    let slab = Slab::new(vertices, radius);
    let w = slab.axis;
    let (u, v) = ((w + 1) % 3, (w + 2) % 3);
    let along_w = Projection::new(vertices, u, v, radius);
    let along_u = Projection::new(vertices, v, w, radius);
    let along_v = Projection::new(vertices, w, u, radius);

    for cv in bounds[v][0]..=bounds[v][1] {
        let y = f64::from(cv) + 0.5;
        for cu in bounds[u][0]..=bounds[u][1] {
            let x = f64::from(cu) + 0.5;
            if !along_w.touches(x, y) {
                continue;
            }
            let (near, far) = slab.depths(x, y);
            // From centres to indices.
            let first = (near - 0.5).ceil().max(f64::from(bounds[w][0]));
            let last = (far - 0.5).floor().min(f64::from(bounds[w][1]));
            if first > last {
                continue;
            }
            for cw in first as u32..=last as u32 {
                let z = f64::from(cw) + 0.5;
                if along_u.touches(y, z) && along_v.touches(z, x) {
                    let mut voxel = [0; 3];
                    (voxel[u], voxel[v], voxel[w]) = (cu, cv, cw);
                    visit(voxel);
                }
            }
        }
    }
}
