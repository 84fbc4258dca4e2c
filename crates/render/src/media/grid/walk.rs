//! The walk of a ray through the cells of a grid.
//!
//! *Order.* The ray leaves a cell through the face whose parameter, computed from the face's own number, is least. A cell that is looked for at a parameter, where the ray begins or
//! where it leaves an empty cube, is the one that a walk would be in: the same expressions decide. So skipping changes no bit of a depth.
//!
//! *Rounding.* Fractions in a cell are clamped to [0, 1], so that interpolated values are never negative and a depth never shrinks; in the cells at the border, which have no outer
//! end, both values are equal.

use std::ops::ControlFlow;

use vdf_geometry::Segment;
use vdf_scene::VolumeFilter;

use super::{Grid, bricks::Bricks};

/// Coordinates beyond this have no fraction that means anything; clamped, for nothing may run away.
const FARTHEST: f64 = (1_u64 << 40) as f64;

/// The part of a segment that is in the box of a grid, in cell coordinates.
pub(super) struct Ray<'g> {
    grid: &'g Grid,
    /// The parameter along the segment where it begins; all others here count from there.
    begin: f64,
    /// Its length in units of the segment's parameter.
    end: f64,
    /// Where it begins.
    origin: [f64; 3],
    /// Cells a unit of the parameter, and their inverse; 0 along an axis that it does not move along.
    rate: [f64; 3],
    inverse: [f64; 3],
}

/// A part of a ray in one cell.
pub(super) struct Piece<'w, 'g, const CHANNELS: usize> {
    walk: &'w Walk<'w, 'g, CHANNELS>,
    /// Parameters from the ray's beginning.
    t0: f64,
    t1: f64,
    /// The values at its beginning, middle and end.
    values: [[f64; CHANNELS]; 3],
}

/// Of a grid with so many numbers a value.
struct Walk<'r, 'g, const CHANNELS: usize> {
    ray: &'r Ray<'g>,
    cell: [i64; 3],
    /// Where the ray leaves the cell along each axis.
    leave: [f64; 3],
    /// Where the values are that the cell lies between.
    ends: [[usize; 2]; 3],
}

impl<'g> Ray<'g> {
    /// The part of a segment between two parameters that is in the grid's box; `None` if there is none.
    #[inline]
    pub(super) fn new(grid: &'g Grid, segment: &Segment, t0: f64, t1: f64) -> Option<Self> {
        let along = segment.q - segment.p;
        let (mut begin, mut end) = (t0, t1);
        for axis in 0..3 {
            let (p, d) = (segment.p[axis], along[axis]);
            let (low, high) = (grid.bounds.min[axis], grid.bounds.max[axis]);
            if d == 0.0 {
                if p < low || p > high {
                    return None;
                }
                continue;
            }
            let (a, b) = ((low - p) / d, (high - p) / d);
            begin = begin.max(a.min(b));
            end = end.min(a.max(b));
        }
        // Not so if one is no number, either.
        if !(begin <= end && grid.scale > 0.0) {
            return None;
        }
        let origin = grid.cells_from_world.transform_point3(segment.p + along * begin);
        let rate = grid.cells_from_world.transform_vector3(along);
        if !(origin.is_finite() && rate.is_finite()) {
            return None;
        }
        let origin = origin.to_array().map(|x| x.clamp(-FARTHEST, FARTHEST));
        let moves = |rate: f64| rate.recip().is_finite();
        let rate = rate.to_array().map(|r| if moves(r) { r } else { 0.0 });
        let inverse = rate.map(|r| if moves(r) { r.recip() } else { 0.0 });
        Some(Self { grid, begin, end: end - begin, origin, rate, inverse })
    }

    /// About how many cells it is in.
    pub(super) fn cells(&self) -> f64 {
        self.rate.iter().map(|r| r.abs()).sum::<f64>() * self.end
    }

    /// The value where it begins.
    pub(super) fn first_value<const CHANNELS: usize>(&self) -> [f64; CHANNELS] {
        self.walk_at(0.0).value(0.0)
    }

    /// Where it passes the lower face of a cell along an axis.
    #[inline]
    fn passes(&self, axis: usize, cell: i64) -> f64 {
        (cell as f64 - self.origin[axis]) * self.inverse[axis]
    }

    /// Where it leaves a cell along an axis; at the border of the grid, and along an axis that it does not move along, never.
    #[inline]
    fn leaves(&self, axis: usize, first: i64, last: i64) -> f64 {
        if self.rate[axis] > 0.0 && last < self.grid.cells[axis] - 1 {
            self.passes(axis, last + 1)
        } else if self.rate[axis] < 0.0 && first > 0 {
            self.passes(axis, first)
        } else {
            f64::INFINITY
        }
    }

    /// The cell along an axis that a walk is in at `t`, after all faces that it passes there.
    #[inline]
    fn cell_at(&self, axis: usize, t: f64) -> i64 {
        let last = self.grid.cells[axis] - 1;
        // What is below 0 is cut off towards it, so that no `floor` is needed.
        let mut cell = ((self.origin[axis] + t * self.rate[axis]) as i64).clamp(0, last);
        if self.rate[axis] > 0.0 {
            while cell > 0 && self.passes(axis, cell) > t {
                cell -= 1;
            }
            while cell < last && self.passes(axis, cell + 1) <= t {
                cell += 1;
            }
        } else if self.rate[axis] < 0.0 {
            while cell < last && self.passes(axis, cell + 1) > t {
                cell += 1;
            }
            while cell > 0 && self.passes(axis, cell) <= t {
                cell -= 1;
            }
        }
        cell
    }

    fn walk_at<const CHANNELS: usize>(&self, t: f64) -> Walk<'_, 'g, CHANNELS> {
        let cell = [0, 1, 2].map(|axis| self.cell_at(axis, t));
        let mut walk = Walk { ray: self, cell, leave: [0.0; 3], ends: [[0; 2]; 3] };
        (0..3).for_each(|axis| walk.enter(axis));
        walk
    }

    /// Visits the pieces in order, but those in empty bricks, until the visitor breaks.
    #[inline]
    pub(super) fn walk<const CHANNELS: usize, B>(
        &self,
        mut visit: impl FnMut(&Piece<'_, 'g, CHANNELS>) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let mut walk = self.walk_at::<CHANNELS>(0.0);
        let mut t = 0.0;
        let trilinear = self.grid.filter == VolumeFilter::Trilinear;
        let mut value: Option<[f64; CHANNELS]> = None;
        let mut is_new_brick = true;
        loop {
            if is_new_brick && let Some(empty) = self.grid.bricks.empty_around(walk.cell) {
                let out = [0, 1, 2].map(|axis| self.leaves(axis, empty[axis][0], empty[axis][1]));
                t = out[0].min(out[1]).min(out[2]).max(t);
                if t >= self.end {
                    return ControlFlow::Continue(());
                }
                walk = self.walk_at(t);
                // The values of a face are those on both sides of it.
                value = Some([0.0; CHANNELS]);
                continue;
            }
            let axis = walk.first_left();
            let t1 = walk.leave[axis].min(self.end);
            // A cell that is only touched is none: the value stays what it is on its other side.
            if t1 > t {
                let values = if trilinear {
                    let first = value.unwrap_or_else(|| walk.value(t));
                    let [middle, last] = walk.pair([0.5 * (t + t1), t1]);
                    [first, middle, last]
                } else {
                    [walk.nearest(); 3]
                };
                visit(&Piece { walk: &walk, t0: t, t1, values })?;
                (t, value) = (t1, Some(values[2]));
            }
            if t1 >= self.end {
                return ControlFlow::Continue(());
            }
            let step = if self.rate[axis] > 0.0 { 1 } else { -1 };
            walk.step(axis, step);
            is_new_brick = Bricks::is_entered(walk.cell[axis], step);
        }
    }
}

impl<const CHANNELS: usize> Walk<'_, '_, CHANNELS> {
    /// What depends on the cell along one axis.
    #[inline]
    fn enter(&mut self, axis: usize) {
        let cell = self.cell[axis];
        self.leave[axis] = self.ray.leaves(axis, cell, cell);
        self.ends[axis] = self.ray.grid.ends(axis, cell);
    }

    /// Enters the next cell along an axis, up or down: it shares a face, and so an end.
    #[inline]
    fn step(&mut self, axis: usize, step: i64) {
        let grid = self.ray.grid;
        self.cell[axis] += step;
        let cell = self.cell[axis];
        self.leave[axis] = self.ray.leaves(axis, cell, cell);
        let [low, high] = self.ends[axis];
        self.ends[axis] = if step > 0 { [high, grid.end(axis, cell + 1)] } else { [grid.end(axis, cell), low] };
    }

    /// The axis along which the cell is left first.
    #[inline]
    fn first_left(&self) -> usize {
        let [x, y, z] = self.leave;
        if x <= y {
            if x <= z { 0 } else { 2 }
        } else if y <= z {
            1
        } else {
            2
        }
    }

    #[inline]
    fn number(&self, i: usize, j: usize, k: usize) -> [f64; CHANNELS] {
        let at = self.ends[0][i] + self.ends[1][j] + self.ends[2][k];
        let numbers = self.ray.grid.values.values().get(at..at + CHANNELS);
        numbers.and_then(|n| <[f32; CHANNELS]>::try_from(n).ok()).unwrap_or([0.0; CHANNELS]).map(f64::from)
    }

    #[inline]
    fn nearest(&self) -> [f64; CHANNELS] {
        self.number(0, 0, 0)
    }

    #[inline]
    fn fraction(&self, axis: usize, t: f64) -> f64 {
        (self.ray.origin[axis] + t * self.ray.rate[axis] - self.cell[axis] as f64).clamp(0.0, 1.0)
    }

    /// The value at one place.
    #[inline]
    fn value(&self, t: f64) -> [f64; CHANNELS] {
        if self.ray.grid.filter == VolumeFilter::Trilinear { self.pair([t; 2])[0] } else { self.nearest() }
    }

    /// The trilinear values at two places.
    #[inline]
    fn pair(&self, t: [f64; 2]) -> [[f64; CHANNELS]; 2] {
        let [x, y, z] = [0, 1, 2].map(|axis| t.map(|t| self.fraction(axis, t)));
        let along_x = |j: usize, k: usize| {
            let (a, b) = (self.number(0, j, k), self.number(1, j, k));
            x.map(|x| std::array::from_fn(|c| a[c] + (b[c] - a[c]) * x))
        };
        let between = |a: [[f64; CHANNELS]; 2], b: [[f64; CHANNELS]; 2], f: [f64; 2]| {
            [0, 1].map(|i| std::array::from_fn(|c| a[i][c] + (b[i][c] - a[i][c]) * f[i]))
        };
        let in_plane = |k: usize| between(along_x(0, k), along_x(1, k), y);
        between(in_plane(0), in_plane(1), z)
    }
}

impl<const CHANNELS: usize> Piece<'_, '_, CHANNELS> {
    /// Where it begins, as a parameter along the segment.
    #[inline]
    pub(super) fn begin(&self) -> f64 {
        self.walk.ray.begin + self.t0
    }

    /// Where it ends.
    #[inline]
    pub(super) fn end(&self) -> f64 {
        self.walk.ray.begin + self.t1
    }

    /// The integral of the values over the parameter, by Simpson's rule.
    #[inline]
    pub(super) fn integral(&self) -> [f64; CHANNELS] {
        let [a, m, b] = &self.values;
        std::array::from_fn(|c| (self.t1 - self.t0) * ((a[c] + b[c]) + 4.0 * m[c]) * (1.0 / 6.0))
    }

    /// The part of it up to where the integral of a channel is `target`, which is less than all of it.
    #[cold]
    pub(super) fn up_to(&self, target: f64, channel: usize) -> Self {
        let whole = self.integral()[channel];
        let [a, m, b] = self.values.map(|value| value[channel]);
        let step = self.t1 - self.t0;
        // The cubic through four values; Newton's steps in a bracket that shrinks.
        let [c0, c1, c2, c3] = if self.walk.ray.grid.filter == VolumeFilter::Trilinear {
            let q = self.walk.value(self.t0 + 0.25 * step)[channel];
            let (m, b, q) = (m - a, b - a, q - a);
            let c1 = (64.0 * q - 24.0 * m + 2.0 * b) / 6.0;
            let c2 = 8.0 * m - b - 3.0 * c1;
            [a, c1, c2, b - c1 - c2]
        } else {
            [a, 0.0, 0.0, 0.0]
        };
        let target = target / step;
        let (mut low, mut high) = (0.0, 1.0);
        let mut x = (target / whole * step).clamp(0.0, 1.0);
        for _ in 0..64 {
            let value = c0 + x * (c1 + x * (c2 + x * c3));
            let integral = x * (c0 + x * (0.5 * c1 + x * (c2 / 3.0 + x * (0.25 * c3))));
            let error = integral - target;
            if error < 0.0 {
                low = x;
            } else {
                high = x;
            }
            let newton = x - error / value;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - x).abs() <= f64::EPSILON {
                x = next;
                break;
            }
            x = next;
        }
        let t1 = (self.t0 + x * step).min(self.t1);
        let values = if self.walk.ray.grid.filter == VolumeFilter::Trilinear {
            let [middle, last] = self.walk.pair([0.5 * (self.t0 + t1), t1]);
            [self.values[0], middle, last]
        } else {
            self.values
        };
        Self { walk: self.walk, t0: self.t0, t1, values }
    }

    /// The values where it ends.
    #[inline]
    pub(super) fn last(&self) -> [f64; CHANNELS] {
        self.values[2]
    }
}
