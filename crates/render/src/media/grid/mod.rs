//! Extinction on a grid: optical depths are exact, by a walk through the cells between the grid's values.
//!
//! *Idea.* Between eight values the extinction is trilinear, so along a ray it is a cubic in each cell, and its integral over the cell is known from three of its values
//! (Simpson's rule, which is exact for cubics). So the optical depth is a sum over cells, without noise and without a bound on the extinction, and
//! where it has a given value is found by inverting one cell's quartic. What draws free flights, strata of equal transmittance or shadow rays asks for nothing else.
//!
//! *Definition.* In *cell coordinates* the cell with the number c along an axis is [c, c + 1). Of n values along an axis there are n + 1 cells, of which the first and the last, half of
//! each in the unit cube, lie between a value and what [`Wrap`] puts beside it. There is no extinction outside of the box around the unit cube in the world.
//! Those cells go on to infinity; so a turned grid needs no cells of its own between its cube and its box, but where it repeats.
//!
//! *Empty space* is skipped by bricks of 8 × 8 × 8 cells: a chessboard distance field over them says how large a cube of empty bricks there is around one.
//!
//! *Guarantee.* Depths grow with the interval. An answer does not depend on whether empty space is skipped, to the last bit (`tests.rs`). Errors: `docs/numerics.md`.
//!
//! *Cost.* An interpolation at two places for each cell that is not skipped; one byte a brick. Figures: `docs/performance.md`; why no tracking by majorants: `docs/ARCHITECTURE.md`.

mod bricks;
#[cfg(test)]
mod tests;
mod walk;

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DMat4, DVec3, dvec3};
use smallvec::SmallVec;
use vdf_geometry::{Bounds, Segment};
use vdf_scene::{GridVolume, VolumeFilter, VoxelGrid, Wrap};

use self::{bricks::Bricks, walk::Ray};

/// A stretch of a ray is so many cells long at least.
const CELLS_A_KNOT: f64 = 8.0;
/// And a ray through a grid is cut into so many at most.
const KNOTS: usize = 32;

/// The extinction of a grid, prepared for walks along rays.
#[derive(Debug)]
pub(crate) struct Grid {
    values: Arc<VoxelGrid>,
    filter: VolumeFilter,
    wrap: Wrap,
    /// What the values are multiplied with; at least 0.
    scale: f64,
    /// The world to cell coordinates.
    cells_from_world: DAffine3,
    /// Where the extinction is, in the world.
    bounds: Bounds,
    /// Cells along x, y and z.
    cells: [i64; 3],
    /// The index of the lower value of the first cell.
    first: [i64; 3],
    /// Numbers from a value to the next one along each axis.
    strides: [usize; 3],
    bricks: Bricks,
}

/// Where a depth is reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reached<const CHANNELS: usize> {
    /// Parameter along the segment.
    pub(crate) t: f64,
    /// The optical depth of each channel up to there.
    pub(crate) depth: [f64; CHANNELS],
    /// The extinction coefficients there.
    pub(crate) sigma_t: [f64; CHANNELS],
}

#[inline]
fn added<const CHANNELS: usize>(a: [f64; CHANNELS], b: [f64; CHANNELS]) -> [f64; CHANNELS] {
    std::array::from_fn(|c| a[c] + b[c])
}

/// Where a ray enters a stretch, as a parameter along its segment, and its optical depth since the interval began.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Knot {
    pub(crate) t: f64,
    pub(crate) depth: f64,
}

impl Grid {
    /// Prepares a grid. Cost: a look at each value, in parallel.
    pub(crate) fn new(volume: &GridVolume, scale: f64) -> Self {
        let GridVolume { grid, filter, wrap, grid_from_world } = volume;
        let bounds = volume.world_bounds();
        let size = grid.size();
        // From the grid's space to where values have whole coordinates, or begin at them.
        let shift = if *filter == VolumeFilter::Trilinear { 0.5 } else { 0.0 };
        let scaled = DMat4::from_scale(dvec3(size[0].into(), size[1].into(), size[2].into()));
        let values_from_world = DMat4::from_translation(DVec3::splat(-shift)) * scaled * *grid_from_world;
        let (first, cells) = cells(size, *filter, *wrap, &values_from_world, &bounds);
        let origin = DVec3::from_array(first.map(|i| i as f64));
        let to_cells = DMat4::from_translation(-origin) * values_from_world;
        let cells_from_world = DAffine3::from_mat3_translation(DMat3::from_mat4(to_cells), to_cells.w_axis.truncate());
        let [nx, ny, _] = size.map(|n| n as usize);
        let mut new = Self {
            strides: [1, nx, nx * ny].map(|stride| stride * grid.channels()),
            values: Arc::clone(grid),
            filter: *filter,
            wrap: *wrap,
            scale,
            cells_from_world,
            bounds,
            cells,
            first,
            bricks: Bricks::none(),
        };
        new.bricks = Bricks::new(cells, |brick| new.is_empty(brick));
        new
    }

    /// Where the extinction may be, in the world.
    pub(crate) fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The mean of what is not zero; infinite if all is.
    pub(crate) fn typical(&self) -> f64 {
        let positive = || self.values.values().iter().filter(|v| **v > 0.0);
        let sum: f64 = positive().map(|&v| f64::from(v)).sum();
        if self.scale > 0.0 && sum > 0.0 { sum / positive().count() as f64 * self.scale } else { f64::INFINITY }
    }

    /// The optical depth of the part of a segment between two parameters, of each of its channels. `length` is the segment's.
    pub(crate) fn optical_depth<const CHANNELS: usize>(
        &self,
        segment: &Segment,
        [t0, t1]: [f64; 2],
        length: f64,
    ) -> [f64; CHANNELS] {
        let mut sum = [0.0; CHANNELS];
        let Some(ray) = Ray::new(self, segment, t0, t1) else { return sum };
        let _ = ray.walk(|piece| {
            sum = added(sum, piece.integral());
            ControlFlow::<()>::Continue(())
        });
        sum.map(|sum| sum * (self.scale * length))
    }

    /// Where between two parameters the optical depth of a channel, from the first on, is `tau`; or else the optical depth of all.
    pub(crate) fn distance<const CHANNELS: usize>(
        &self,
        segment: &Segment,
        [t0, t1]: [f64; 2],
        length: f64,
        tau: f64,
        channel: usize,
    ) -> Result<Reached<CHANNELS>, [f64; CHANNELS]> {
        let mut sum = [0.0; CHANNELS];
        let Some(ray) = Ray::new(self, segment, t0, t1) else { return Err(sum) };
        let unit = self.scale * length;
        let target = tau / unit;
        let reached = ray.walk(|piece| {
            let next = added(sum, piece.integral());
            if target < next[channel] {
                let part = piece.up_to((target - sum[channel]).max(0.0), channel);
                return ControlFlow::Break(Reached {
                    t: part.end().clamp(t0, t1),
                    depth: added(sum, part.integral()).map(|d| d * unit),
                    sigma_t: part.last().map(|v| v * self.scale),
                });
            }
            sum = next;
            ControlFlow::Continue(())
        });
        match reached {
            ControlFlow::Break(reached) => Ok(reached),
            ControlFlow::Continue(()) => Err(sum.map(|sum| sum * unit)),
        }
    }

    /// The part of a segment between two parameters, cut where it enters and leaves empty space and every some cells: for each cut where it is, and the optical depth up to there.
    /// Between two cuts of the same depth there is nothing. No cuts if there is nothing at all.
    pub(crate) fn knots(&self, segment: &Segment, [t0, t1]: [f64; 2], length: f64) -> SmallVec<[Knot; 2]> {
        let mut knots = SmallVec::new();
        let Some(ray) = Ray::new(self, segment, t0, t1) else { return knots };
        let every = (ray.cells() / (KNOTS as f64 / 2.0)).max(CELLS_A_KNOT);
        let unit = self.scale * length;
        let (mut sum, mut cells) = (0.0, 0.0);
        let mut end = f64::NAN;
        let _ = ray.walk(|piece| {
            let [integral] = piece.integral();
            // After a gap, and at the very beginning.
            if piece.begin() != end {
                if end.is_finite() && cells > 0.0 {
                    knots.push(Knot { t: end, depth: sum * unit });
                }
                knots.push(Knot { t: piece.begin(), depth: sum * unit });
                cells = 0.0;
            } else if cells >= every && knots.len() + 2 < KNOTS {
                knots.push(Knot { t: end, depth: sum * unit });
                cells = 0.0;
            }
            sum += integral;
            cells += 1.0;
            end = piece.end();
            ControlFlow::<()>::Continue(())
        });
        if end.is_finite() {
            knots.push(Knot { t: end, depth: sum * unit });
        }
        knots
    }

    /// The extinction coefficient at a parameter of a segment, of the first channel.
    pub(crate) fn sigma_t(&self, segment: &Segment, t: f64) -> f64 {
        Ray::new(self, segment, t, t).map_or(0.0, |ray| ray.first_value::<1>()[0] * self.scale)
    }

    /// Numbers a value: 1, or 3 for red, green and blue.
    pub(crate) fn channels(&self) -> usize {
        self.values.channels()
    }

    /// The indices of the two values that a cell lies between, along one axis; in numbers from the start of the values.
    #[inline]
    fn ends(&self, axis: usize, cell: i64) -> [usize; 2] {
        [self.end(axis, cell), self.end(axis, cell + 1)]
    }

    /// The index of the lower value of a cell.
    #[inline]
    fn end(&self, axis: usize, cell: i64) -> usize {
        let n = i64::from(self.values.size()[axis]);
        self.wrap.pixel(self.first[axis] + cell, n) as usize * self.strides[axis]
    }

    /// True if all values of these cells, from the first to before the last along each axis, are zero.
    fn is_empty(&self, [x, y, z]: [[i64; 2]; 3]) -> bool {
        // A cell lies between two values along an axis, or has one.
        let more = i64::from(self.filter == VolumeFilter::Trilinear);
        let values = self.values.values();
        let channels = self.values.channels();
        (z[0]..z[1] + more).all(|k| {
            let k = self.ends(2, k)[0];
            (y[0]..y[1] + more).all(|j| {
                let row = self.ends(1, j)[0] + k;
                (x[0]..x[1] + more).all(|i| {
                    let at = self.ends(0, i)[0] + row;
                    values.get(at..at + channels).is_some_and(|v| v.iter().all(|v| *v == 0.0))
                })
            })
        })
    }
}

/// The first value's index and the number of cells along each axis: those that the box in the world reaches.
fn cells(
    size: [u32; 3],
    filter: VolumeFilter,
    wrap: Wrap,
    values_from_world: &DMat4,
    bounds: &Bounds,
) -> ([i64; 3], [i64; 3]) {
    let trilinear = filter == VolumeFilter::Trilinear;
    let corners = (0..8_u8).map(|i| {
        let pick = |bit: u8, axis: usize| if i & bit == 0 { bounds.min[axis] } else { bounds.max[axis] };
        values_from_world.transform_point3(dvec3(pick(1, 0), pick(2, 1), pick(4, 2)))
    });
    let reached = Bounds::of_points(corners);
    let range = |axis: usize| {
        let n = i64::from(size[axis]);
        let (least, last) = if trilinear { (-1, n - 1) } else { (0, n - 1) };
        match wrap {
            // Beyond the border nothing changes any more.
            Wrap::Clamp => [least, last],
            // Rounding on the faces of the cube itself must not add a row.
            Wrap::Repeat | Wrap::Mirror => {
                let (low, high) = (reached.min[axis] + 1e-6, reached.max[axis] - 1e-6);
                [(low.floor() as i64).min(least), (high.floor() as i64).max(last)]
            }
        }
    };
    let ranges = [0, 1, 2].map(range);
    (ranges.map(|[first, _]| first), ranges.map(|[first, last]| last - first + 1))
}
