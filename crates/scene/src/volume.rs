//! Quantities that change in space: values at the points of a lattice, and what is between and beyond them.
//!
//! *Definition*, as in Mitsuba 3.9.1. A [`GridVolume`] is over the unit cube of its own space; there are n values along an axis, the i-th at (i + ½)/n. With
//! x the coordinate of a point, the value there lies between those of the indices ⌊nx − ½⌋ and ⌊nx − ½⌋ + 1, or is that of ⌊nx⌋; an index that is out of
//! range is replaced by [`Wrap`].

use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3};
use vdf_geometry::Bounds;

use crate::{Rgb, Wrap};

/// Values on a lattice, as a `.vol` file holds them.
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelGrid {
    /// Values along x, y and z; at least 1 each.
    size: [u32; 3],
    /// Numbers a value: 1 or 3.
    channels: usize,
    /// Finite and at least 0; the channels of a value together, x fastest, z slowest.
    values: Vec<f32>,
    /// The box that the file names, for those who ask for it.
    bounds: [Vec3; 2],
}

impl VoxelGrid {
    /// A grid of these values. `None` if there are not as many as `size` and `channels` say, if a size is 0, if there are neither 1 nor 3 channels, or if a value is negative or not finite.
    #[must_use]
    pub fn new(size: [u32; 3], channels: usize, values: Vec<f32>, bounds: [Vec3; 2]) -> Option<Self> {
        let count = size.iter().try_fold(channels, |n, &side| n.checked_mul(side as usize))?;
        let sound = matches!(channels, 1 | 3)
            && count == values.len()
            && count > 0
            && values.iter().all(|v| v.is_finite() && *v >= 0.0);
        sound.then_some(Self { size, channels, values, bounds })
    }

    /// Values along x, y and z.
    #[must_use]
    pub const fn size(&self) -> [u32; 3] {
        self.size
    }

    /// Numbers a value: 1, or 3 for red, green and blue.
    #[must_use]
    pub const fn channels(&self) -> usize {
        self.channels
    }

    /// All numbers; the channels of a value together, x fastest, z slowest.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The box that the file names: least and greatest corner.
    #[must_use]
    pub const fn bounds(&self) -> [Vec3; 2] {
        self.bounds
    }

    /// The largest number.
    #[must_use]
    pub fn max(&self) -> f32 {
        self.values.iter().fold(0.0, |most, &v| most.max(v))
    }

    fn value(&self, [x, y, z]: [usize; 3]) -> Vec3 {
        let [nx, ny, _] = self.size.map(|n| n as usize);
        let at = ((z * ny + y) * nx + x) * self.channels;
        match self.values.get(at..at + self.channels) {
            Some(&[r, g, b]) => Vec3::new(r, g, b),
            Some(&[v]) => Vec3::splat(v),
            _ => Vec3::ZERO,
        }
    }
}

/// What is between the points of a lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VolumeFilter {
    /// Linear in each coordinate.
    #[default]
    Trilinear,
    /// The value of the nearest point.
    Nearest,
}

/// A [`VoxelGrid`] that is somewhere in the world.
#[derive(Clone, Debug)]
pub struct GridVolume {
    /// The values.
    pub grid: Arc<VoxelGrid>,
    /// Between them.
    pub filter: VolumeFilter,
    /// Outside of the unit cube.
    pub wrap: Wrap,
    /// From the world to the grid's space, in which it is over the unit cube; affine, and its inverse is finite.
    pub grid_from_world: DMat4,
}

impl PartialEq for GridVolume {
    /// Two copies of one grid are compared without a look at its values.
    fn eq(&self, other: &Self) -> bool {
        let Self { grid, filter, wrap, grid_from_world } = self;
        (filter, wrap, grid_from_world) == (&other.filter, &other.wrap, &other.grid_from_world)
            && (Arc::ptr_eq(grid, &other.grid) || grid == &other.grid)
    }
}

impl GridVolume {
    /// The box around the grid's unit cube in the world. As in Mitsuba, that is where an extinction is: outside of it there is none, and in
    /// those parts of it that are outside of a turned cube [`Wrap`] says what there is.
    #[must_use]
    pub fn world_bounds(&self) -> Bounds {
        let world_from_grid = self.grid_from_world.inverse();
        let corners = (0..8_u8).map(|i| DVec3::from_array([1, 2, 4].map(|bit| f64::from(u8::from(i & bit != 0)))));
        Bounds::of_points(corners.map(|corner| world_from_grid.transform_point3(corner)))
    }

    /// The value at a point of the world; a single channel three times.
    #[must_use]
    pub fn at(&self, point: DVec3) -> Rgb {
        let size = self.grid.size.map(f64::from);
        let local = self.grid_from_world.transform_point3(point);
        // Far outside no conversion may saturate, and the index of what is no number is any.
        let place: [f64; 3] = std::array::from_fn(|a| {
            let x = local[a] * size[a];
            if x.is_finite() { x.clamp(-1e15, 1e15) } else { 0.0 }
        });
        let index = |a: usize, i: f64| self.wrap.pixel(i as i64, i64::from(self.grid.size[a])) as usize;
        match self.filter {
            VolumeFilter::Nearest => self.grid.value(std::array::from_fn(|a| index(a, place[a].floor()))),
            VolumeFilter::Trilinear => {
                let low = place.map(|x| (x - 0.5).floor());
                let share: [f32; 3] = std::array::from_fn(|a| (place[a] - 0.5 - low[a]) as f32);
                let ends: [[usize; 2]; 3] = std::array::from_fn(|a| [index(a, low[a]), index(a, low[a] + 1.0)]);
                let along_x = |j: usize, k: usize| {
                    let [a, b] = ends[0].map(|i| self.grid.value([i, ends[1][j], ends[2][k]]));
                    a + (b - a) * share[0]
                };
                let in_plane = |k: usize| {
                    let (a, b) = (along_x(0, k), along_x(1, k));
                    a + (b - a) * share[1]
                };
                let (a, b) = (in_plane(0), in_plane(1));
                a + (b - a) * share[2]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(filter: VolumeFilter, wrap: Wrap, world_from_grid: DMat4) -> GridVolume {
        let values = (0..24_u8).map(f32::from).collect();
        let grid = VoxelGrid::new([4, 3, 2], 1, values, [Vec3::ZERO, Vec3::ONE]).unwrap();
        GridVolume { grid: Arc::new(grid), filter, wrap, grid_from_world: world_from_grid.inverse() }
    }

    /// What Mitsuba 3.9.1 (`scalar_rgb`) gives for a grid of 4 × 3 × 2 with the values 0 to 23.
    #[test]
    fn values_lie_as_in_mitsuba() {
        let points = [
            [0.0, 0.0, 0.0],
            [0.125, 1.0 / 6.0, 0.25],
            [0.3, 0.4, 0.6],
            [1.0, 1.0, 1.0],
            [1.2, -0.3, 0.5],
            [0.25, 0.5, 0.5],
            [-2.3, 0.5, 0.5],
        ];
        use {VolumeFilter::*, Wrap::*};
        let cases = [
            (Trilinear, Clamp, [0.0, 0.0, 11.9, 23.0, 9.0, 10.5, 10.0]),
            (Trilinear, Repeat, [11.5, 0.0, 11.9, 11.5, 12.7, 10.5, 12.3]),
            (Trilinear, Mirror, [0.0, 0.0, 11.9, 23.0, 10.3, 10.5, 10.7]),
            (Nearest, Clamp, [0.0, 0.0, 17.0, 23.0, 15.0, 17.0, 16.0]),
            (Nearest, Repeat, [0.0, 0.0, 17.0, 0.0, 20.0, 17.0, 18.0]),
            (Nearest, Mirror, [0.0, 0.0, 17.0, 23.0, 15.0, 17.0, 17.0]),
        ];
        let moved = DMat4::from_translation(DVec3::new(5.0, -3.0, 2.0)) * DMat4::from_scale(DVec3::new(2.0, 3.0, 8.0));
        for (filter, wrap, expected) in cases {
            for world_from_grid in [DMat4::IDENTITY, moved] {
                let volume = volume(filter, wrap, world_from_grid);
                for (p, expected) in points.iter().zip(expected) {
                    // Off the faces where rounding decides.
                    let p = DVec3::from_array(*p) + 1e-9;
                    let value = volume.at(world_from_grid.transform_point3(p));
                    assert!(
                        (value - Vec3::splat(expected)).abs().max_element() < 1e-5,
                        "{filter:?} {wrap:?} {p}: {value}"
                    );
                }
            }
            for odd in [f64::NAN, f64::INFINITY, 1e300, -1e300] {
                assert!(volume(filter, wrap, DMat4::IDENTITY).at(DVec3::splat(odd)).is_finite());
            }
        }
    }

    /// Mitsuba's `bbox()` of a grid turned by 45° about z.
    #[test]
    fn a_turned_grid_has_a_larger_box() {
        let turned = volume(VolumeFilter::Trilinear, Wrap::Clamp, DMat4::from_rotation_z(45_f64.to_radians()));
        let Bounds { min, max } = turned.world_bounds();
        let half = 0.5_f64.sqrt();
        assert!((min - DVec3::new(-half, 0.0, 0.0)).abs().max_element() < 1e-12, "{min}");
        assert!((max - DVec3::new(half, 2.0 * half, 1.0)).abs().max_element() < 1e-12, "{max}");
    }

    #[test]
    fn grids_are_what_they_say() {
        let new = |size, channels, values: &[f32]| VoxelGrid::new(size, channels, values.to_vec(), [Vec3::ZERO; 2]);
        assert!(new([2, 1, 1], 1, &[0.0, 3.0]).is_some_and(|g| g.max() == 3.0));
        for odd in [f32::NAN, f32::INFINITY, -1.0] {
            assert!(new([2, 1, 1], 1, &[0.0, odd]).is_none());
        }
        assert!(
            new([0, 1, 1], 1, &[]).is_none()
                && new([2, 1, 1], 1, &[0.0]).is_none()
                && new([1, 1, 1], 2, &[0.0; 2]).is_none()
        );
        assert!(new([u32::MAX; 3], 3, &[]).is_none());
        // −0 is at least 0.
        assert!(new([1, 1, 1], 1, &[-0.0]).is_some());
    }
}
