//! The voxel grid (Def. 5 and 6 in \[Houska2013\]) and its typed coordinates.

use std::fmt;

use glam::DVec3;

use crate::VoxelError;

/// Larger voxels are refused: the reciprocal of the size must be an accurate normal number.
const LARGEST_VOXEL_SIZE: f64 = 1e60;

/// No budget admits more voxels than this, so that counts are exact in `f64` and fit `usize`.
const LARGEST_BUDGET: u64 = 1 << 48;

/// Integer coordinates of a voxel in its grid (Def. 6 in \[Houska2013\]).
///
/// There is deliberately no conversion from or to a point; only a [`VoxelGrid`] knows how they relate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Voxel {
    /// Coordinate along x.
    pub i: u32,
    /// Coordinate along y.
    pub j: u32,
    /// Coordinate along z.
    pub k: u32,
}

impl Voxel {
    /// The voxel with these coordinates.
    #[must_use]
    #[inline]
    pub const fn new(i: u32, j: u32, k: u32) -> Self {
        Self { i, j, k }
    }
}

impl fmt::Display for Voxel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}, {}, {})", self.i, self.j, self.k)
    }
}

/// A point in grid coordinates: in voxels, from the grid's origin. Points in world units are plain [`DVec3`]s, so that
/// the two cannot be mixed up; only [`VoxelGrid::grid_coordinates`] leads from one to the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GridPoint(pub(crate) DVec3);

/// The number of voxels of a grid along each axis; at least 1 each, by construction:
///
/// ```compile_fail
/// let none = vdf_voxel::Resolution { x: 0, y: 1, z: 1 };
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Resolution {
    x: u32,
    y: u32,
    z: u32,
}

impl Resolution {
    /// A resolution; zeros are raised to 1, because a grid without voxels has no use.
    #[must_use]
    pub const fn new(x: u32, y: u32, z: u32) -> Self {
        const fn positive(n: u32) -> u32 {
            if n == 0 { 1 } else { n }
        }
        Self { x: positive(x), y: positive(y), z: positive(z) }
    }

    /// Voxels along x, at least 1.
    #[must_use]
    #[inline]
    pub const fn x(self) -> u32 {
        self.x
    }

    /// Voxels along y, at least 1.
    #[must_use]
    #[inline]
    pub const fn y(self) -> u32 {
        self.y
    }

    /// Voxels along z, at least 1.
    #[must_use]
    #[inline]
    pub const fn z(self) -> u32 {
        self.z
    }

    /// Voxels along x, y and z.
    #[must_use]
    #[inline]
    pub const fn sides(self) -> [u32; 3] {
        [self.x, self.y, self.z]
    }

    /// The number of voxels, at least 1; `usize::MAX` if there are more.
    #[must_use]
    #[inline]
    pub const fn voxel_count(self) -> usize {
        (self.x as usize).saturating_mul(self.row_count())
    }

    /// The number of rows along x, Y·Z, at least 1; `usize::MAX` if there are more.
    #[must_use]
    #[inline]
    pub const fn row_count(self) -> usize {
        (self.y as usize).saturating_mul(self.z as usize)
    }

    /// True if `voxel` is one of the grid's.
    #[must_use]
    #[inline]
    pub const fn contains(self, voxel: Voxel) -> bool {
        voxel.i < self.x && voxel.j < self.y && voxel.k < self.z
    }

    /// The linear coordinate i + j·X + k·X·Y (Def. 6 in \[Houska2013\]).
    #[must_use]
    #[inline]
    pub const fn linear_index(self, voxel: Voxel) -> usize {
        voxel.i as usize + self.x as usize * (voxel.j as usize + self.y as usize * voxel.k as usize)
    }

    /// The voxel farthest from (0, 0, 0).
    #[must_use]
    #[inline]
    pub const fn last(self) -> Voxel {
        Voxel::new(self.x - 1, self.y - 1, self.z - 1)
    }

    /// All voxels in the order of their linear coordinates.
    pub fn voxels(self) -> impl Iterator<Item = Voxel> {
        (0..self.z).flat_map(move |k| (0..self.y).flat_map(move |j| (0..self.x).map(move |i| Voxel::new(i, j, k))))
    }
}

impl fmt::Display for Resolution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} × {} × {}", self.x, self.y, self.z)
    }
}

/// A grid of cubic voxels: origin, voxel size and resolution (Def. 5 in \[Houska2013\]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoxelGrid {
    origin: DVec3,
    voxel_size: f64,
    inverse_size: f64,
    resolution: Resolution,
    /// The largest grid coordinates that still belong to the grid; see [`VoxelGrid::voxel_containing`].
    upper: DVec3,
    /// (|x|max + |o|max) / s: bounds every intermediate of the conversion from world to grid, in voxels.
    magnitude: f64,
}

impl VoxelGrid {
    /// The grid with origin `min` that covers the box from `min` to `max`, max(1, ceil(extent / `voxel_size`)) voxels
    /// along each axis. A flat box gets one layer of voxels.
    ///
    /// # Errors
    /// If the bounds are not finite or are empty, the size is not a positive number, the grid has more than
    /// `max_voxels` voxels, or the voxels are smaller than four single-precision steps at the scene's largest
    /// coordinate. The last two name a size that works and is the smallest but for rounding to three digits.
    pub fn covering(min: DVec3, max: DVec3, voxel_size: f64, max_voxels: u64) -> Result<Self, VoxelError> {
        let largest = min.abs().max_element().max(max.abs().max_element());
        if !(min.is_finite() && max.is_finite() && largest <= f64::from(f32::MAX)) {
            return Err(VoxelError::NonFiniteBounds);
        }
        if !min.cmple(max).all() {
            return Err(VoxelError::EmptyBounds);
        }
        if !(voxel_size > 0.0 && voxel_size <= LARGEST_VOXEL_SIZE) {
            return Err(VoxelError::InvalidVoxelSize { size: voxel_size });
        }
        let budget = max_voxels.clamp(1, LARGEST_BUDGET);
        let extent = max - min;
        let finest = finest_size(largest);
        let smallest = || smallest_usable(extent, finest, budget);
        if voxel_size < finest {
            return Err(VoxelError::TooFine { size: voxel_size, smallest: smallest() });
        }
        let voxels = count(extent, voxel_size);
        if voxels > budget as f64 {
            return Err(VoxelError::TooManyVoxels { size: voxel_size, voxels, budget, smallest: smallest() });
        }

        let inverse_size = voxel_size.recip();
        // Adding zero turns −0.0 into 0.0.
        let origin = min + DVec3::ZERO;
        Ok(Self {
            origin,
            voxel_size,
            inverse_size,
            resolution: resolution(extent, voxel_size),
            upper: counts(extent, voxel_size) * (1.0 + 8.0 * f64::EPSILON),
            magnitude: (largest + origin.abs().max_element()) * inverse_size,
        })
    }

    /// [`Self::covering`] with a limit of memory: `bytes` says what will be stored for a grid of a resolution, and must
    /// not grow when a side of the grid shrinks.
    ///
    /// # Errors
    /// Those of [`Self::covering`], and [`VoxelError::TooMuchMemory`] if `bytes` gives more than `max_bytes`; that
    /// names a size that works and is the smallest but for rounding to three digits.
    pub fn covering_within(
        min: DVec3,
        max: DVec3,
        voxel_size: f64,
        max_voxels: u64,
        max_bytes: u64,
        bytes: impl Fn(Resolution) -> u64,
    ) -> Result<Self, VoxelError> {
        let grid = Self::covering(min, max, voxel_size, max_voxels)?;
        let needed = bytes(grid.resolution);
        // A grid of one voxel is always allowed, so that there is a size that works.
        let limit = max_bytes.max(bytes(Resolution::new(1, 1, 1)));
        if needed <= limit {
            return Ok(grid);
        }
        let fits = |size: f64| bytes(resolution(max - min, size)) <= limit;
        let smallest = smallest_that_fits(voxel_size, (max - min).max_element(), fits);
        Err(VoxelError::TooMuchMemory { size: voxel_size, bytes: needed, limit: max_bytes, smallest })
    }

    /// The least corner of the grid.
    #[must_use]
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The edge length of a voxel in world units.
    #[must_use]
    pub fn voxel_size(&self) -> f64 {
        self.voxel_size
    }

    /// The number of voxels along each axis.
    #[must_use]
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// The corner of `voxel` that is nearest to the origin, in world units, rounded. For export and display: proofs
    /// never convert voxels back to points.
    #[must_use]
    pub fn corner(&self, voxel: Voxel) -> DVec3 {
        self.origin + DVec3::new(voxel.i.into(), voxel.j.into(), voxel.k.into()) * self.voxel_size
    }

    /// The voxel that holds `point`, or `None` if the point is outside the grid or is not a number.
    ///
    /// Computed as the truncation of (p − o)·fl(1/s) in `f64`; where rounding puts a point that is next to a face
    /// into the neighbour, [`VoxelGrid::dilation`] pays for it. Points on the greatest faces of the grid, where
    /// truncation would give the coordinate X, belong to the last voxel; so do points beyond them by rounding error,
    /// 8·2⁻⁵²·X voxels, without which the box that [`VoxelGrid::covering`] was given might not be covered.
    #[must_use]
    #[inline]
    pub fn voxel_containing(&self, point: DVec3) -> Option<Voxel> {
        let at = self.grid_coordinates(point);
        let GridPoint(t) = at;
        // NaN fails every comparison; −0.0 passes as 0.0.
        let inside = (t.x >= 0.0) & (t.y >= 0.0) & (t.z >= 0.0);
        let inside = inside & (t.x <= self.upper.x) & (t.y <= self.upper.y) & (t.z <= self.upper.z);
        inside.then(|| self.truncated(at))
    }

    /// The voxel nearest to `point`: the one that holds it, or one at the border if the point is outside the grid. A
    /// coordinate that is not a number counts as the least. Clamping is done in grid coordinates, so it does not depend
    /// on where in the world the grid lies.
    #[must_use]
    pub fn nearest_voxel(&self, point: DVec3) -> Voxel {
        self.truncated(self.grid_coordinates(point))
    }

    /// The linear coordinate i + j·X + k·X·Y of a voxel (Def. 6 in \[Houska2013\]).
    #[must_use]
    #[inline]
    pub fn linear_index(&self, voxel: Voxel) -> usize {
        self.resolution.linear_index(voxel)
    }

    /// δ, in voxels: voxelization treats a voxel as if it were larger by δ on each side.
    ///
    /// δ = 2⁻⁴⁷·(1 + M), which is 64·u·(1 + M) with the unit roundoff u = 2⁻⁵³ and M = (|x|max + |o|max) / s, the bound
    /// of grid coordinates. It covers the rounding of end points (20u·(1 + M)), of vertices (4u·(1 + M)) and of the
    /// voxelization itself (the rest). `docs/numerics.md` has the derivation.
    ///
    /// Because a voxel spans at least four `f32` steps, M ≤ 2²³ and δ ≤ 2⁻²³ voxels: proofs lose next to nothing.
    #[must_use]
    pub fn dilation(&self) -> f64 {
        dilation_for(self.magnitude)
    }

    /// (p − o)/s with three roundings.
    #[inline]
    pub(crate) fn grid_coordinates(&self, point: DVec3) -> GridPoint {
        GridPoint((point - self.origin) * self.inverse_size)
    }

    /// The voxel of grid coordinates; what is outside goes to the nearest voxel.
    #[inline]
    pub(crate) fn truncated(&self, GridPoint(t): GridPoint) -> Voxel {
        let last = self.resolution.last();
        Voxel::new((t.x as u32).min(last.i), (t.y as u32).min(last.j), (t.z as u32).min(last.k))
    }

    /// The dilation for triangles whose grid coordinates may exceed those that the grid was laid out for.
    pub(crate) fn dilation_reaching(&self, coordinate: f64) -> f64 {
        dilation_for(self.magnitude.max(coordinate))
    }
}

fn dilation_for(magnitude: f64) -> f64 {
    32.0 * f64::EPSILON * (1.0 + magnitude)
}

/// Voxels along each axis, as floating-point integers.
fn counts(extent: DVec3, size: f64) -> DVec3 {
    (extent / size).ceil().max(DVec3::ONE)
}

fn resolution(extent: DVec3, size: f64) -> Resolution {
    let counts = counts(extent, size);
    Resolution::new(counts.x as u32, counts.y as u32, counts.z as u32)
}

fn count(extent: DVec3, size: f64) -> f64 {
    let counts = counts(extent, size);
    counts.x * counts.y * counts.z
}

/// Four single-precision steps at `largest`, so that the geometry's own grid is finer than the voxels.
fn finest_size(largest: f64) -> f64 {
    // Clearing the mantissa leaves the power of two below; denormals have the step 2⁻¹⁴⁹.
    let power = f64::from(f32::from_bits((largest as f32).to_bits() & 0x7f80_0000));
    let step = (power * f64::from(f32::EPSILON)).max(f64::from(f32::from_bits(1)));
    4.0 * step
}

/// The smallest voxel size that is at least `finest` and within the budget, rounded up to three digits.
fn smallest_usable(extent: DVec3, finest: f64, budget: u64) -> f64 {
    smallest_that_fits(finest, extent.max_element(), |size| count(extent, size) <= budget as f64)
}

/// The smallest size that is at least `finest` and fits, rounded up to three digits. What fits must fit in larger
/// voxels, too, and anything fits in voxels of the size `largest`.
fn smallest_that_fits(finest: f64, largest: f64, fits: impl Fn(f64) -> bool) -> f64 {
    let mut size = finest;
    if !fits(size) {
        let (mut low, mut high) = (finest, finest.max(largest));
        for _ in 0..100 {
            let middle = (low * high).sqrt();
            if fits(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        size = high;
    }
    let digit = 10f64.powf(size.log10().floor() - 2.0);
    // Half a digit of slack may be lost to rounding; an unrounded size that works beats a round one that does not.
    let rounded = (size / digit).ceil() * digit;
    if rounded >= finest && fits(rounded) { rounded } else { size }
}

#[cfg(test)]
mod tests;
