//! The dual extents, `dual`.
//!
//! *Idea.* One distance in all directions, and for each of the six axis directions how far its ball can be pushed
//! before it would have to shrink: long corridors become one zone.
//!
//! *Definition.* Dist(V) = min over the occupied U of d_Man(U, V). The dual extent distance D^x+(V) is the number of
//! steps from V towards x+ for which Dist does not fall below Dist(V); the walk ends at the border of the grid (Def. 13
//! in \[Houska2013\]). With Δ = U − V the safe zone in that direction is here
//!
//! > dual^x+(V) = { U : Δ_x ≥ 0, |Δ_y| + |Δ_z| < Dist(V), |Δ_x| + |Δ_y| + |Δ_z| < D^x+(V) + Dist(V) },
//!
//! and so for the other directions; safe(V) is the union of the six. Dist and D are one byte each, saturated at 255.
//!
//! *Departure.* Def. 13 as printed asks for |Δ_y| < Dist and |Δ_z| < Dist, one by one. In two dimensions that is the
//! same, in three it is wrong: with Dist = 2 and D = 10 it admits Δ = (5, 1, 1), which is in none of the balls of
//! radius 2 around V + n·e_x. A test keeps the counterexample. The printed form also lacks Δ_x ≥ 0, which the choice of
//! the direction (4.3.1) implies.
//!
//! *Guarantee.* All balls of radius Dist(V) around V + n·e_x, 0 ≤ n ≤ D, are free. Let U be in dual^x+(V). If Δ_x ≤ D,
//! then U is nearer than Dist(V) to V + Δ_x·e_x. Else its distance to V + D·e_x is Δ_x − D + |Δ_y| + |Δ_z| < Dist(V).
//! So U is free; and bringing U nearer to V on any axis keeps it in the zone: the free cuboid property. A walk that is
//! cut off at 255 steps or at the border is a shorter walk.
//!
//! *Cost.* 7·X·Y·Z bytes; up to four loads an end. The build is one Manhattan transform, then one pass a direction.
//! Dist changes by at most 1 between neighbours, so a walk ends at the first voxel ahead with Dist(V) − 1: a table of
//! where each value was seen last answers that without searching.
//!
//! *Limits.* As `ndf`: a near wall on any side makes the zone thin; but it remains long.

use rayon::prelude::*;
use vdf_voxel::{Resolution, Voxel, VoxelSet};

use crate::{
    FieldError, SafeZones,
    bytes::Bytes,
    lines::{Contiguous, Lines, columns},
    manhattan, manhattan_distance,
    rows::{FAR, Ways},
    validate::{self, FACE_STEPS},
};

/// The names of the six extents, in the order of the directions' numbers.
const NAMES: [&str; 6] = ["dual x+", "dual x-", "dual y+", "dual y-", "dual z+", "dual z-"];

/// Voxels of a row that walk together along y or z.
const LANES: usize = 256;

/// The Manhattan distance field with dual extents; see the head of its source file.
#[derive(Clone, Debug)]
pub struct Dual {
    resolution: Resolution,
    /// Seven planes of one byte per voxel: Dist, then D in the order of the directions' numbers.
    values: Bytes,
}

impl Dual {
    /// Builds the field of these occupied voxels.
    #[must_use]
    pub fn build(occupied: &VoxelSet) -> Self {
        let mut field = Self::zeroed(occupied);
        let _ = field.walk_while(occupied, &|| true);
        field
    }

    /// [`Self::build`], as long as `next` says so: it is asked once before each of the seven planes; if it says no, there is no field.
    #[must_use]
    pub fn build_while(occupied: &VoxelSet, next: &(dyn Fn() -> bool + Sync)) -> Option<Self> {
        let mut field = Self::zeroed(occupied);
        field.walk_while(occupied, next)?;
        Some(field)
    }

    fn zeroed(occupied: &VoxelSet) -> Self {
        let resolution = occupied.resolution();
        Self { resolution, values: Bytes::zeroed(resolution.voxel_count().saturating_mul(7)) }
    }

    fn walk_while(&mut self, occupied: &VoxelSet, next: &(dyn Fn() -> bool + Sync)) -> Option<()> {
        let resolution = self.resolution;
        let (distances, extents) = self.values.split_at_mut(resolution.voxel_count());
        next().then_some(())?;
        manhattan::distances(occupied, [Ways::Both; 3], distances);
        let (width, slice) = (resolution.x() as usize, resolution.x() as usize * resolution.y() as usize);
        for (plane, direction) in extents.chunks_exact_mut(resolution.voxel_count()).zip(0..) {
            next().then_some(())?;
            let backwards = direction % 2 != 0;
            match direction / 2 {
                0 => plane
                    .par_chunks_exact_mut(width)
                    .zip(distances.par_chunks_exact(width))
                    .for_each_init(Walk::<1>::new, |walk, (row, distances)| walk.along_row(row, backwards, distances)),
                1 => plane.par_chunks_exact_mut(slice).zip(distances.par_chunks_exact(slice)).for_each_init(
                    Walk::<LANES>::new,
                    |walk, (slice, distances)| {
                        let mut rows = Contiguous { voxels: slice, width };
                        walk.along(&mut rows, backwards, |j| &distances[j * width..]);
                    },
                ),
                _ if slice <= LANES => {
                    let mut slices = Contiguous { voxels: plane, width: slice };
                    Walk::<LANES>::new().along(&mut slices, backwards, |k| &distances[k * slice..]);
                }
                _ => columns(plane, slice, LANES).into_par_iter().enumerate().for_each_init(
                    Walk::<LANES>::new,
                    |walk, (block, mut parts)| {
                        walk.along(&mut parts, backwards, |k| &distances[k * slice + block * LANES..]);
                    },
                ),
            }
        }
        Some(())
    }

    /// Dist: the Manhattan distance to the nearest occupied voxel, in voxels, at most 255; 0 for a voxel that the grid
    /// does not have.
    #[must_use]
    pub fn distance(&self, voxel: Voxel) -> u8 {
        if self.resolution.contains(voxel) { self.distance_at(voxel) } else { 0 }
    }

    /// [`Self::distance`] of one of the grid's voxels.
    #[inline]
    fn distance_at(&self, voxel: Voxel) -> u8 {
        debug_assert!(self.resolution.contains(voxel));
        self.values.get(self.resolution.linear_index(voxel)).copied().unwrap_or(0)
    }

    /// D: how many steps in a direction Dist does not fall below its value here, at most 255; 0 for an occupied voxel
    /// and for one that the grid does not have. Directions 0 to 5 are x+, x−, y+, y−, z+, z−.
    #[must_use]
    pub fn extent(&self, direction: usize, voxel: Voxel) -> u8 {
        if self.resolution.contains(voxel) { self.extent_at(direction, voxel) } else { 0 }
    }

    /// [`Self::extent`] of one of the grid's voxels.
    #[inline]
    fn extent_at(&self, direction: usize, voxel: Voxel) -> u8 {
        debug_assert!(direction < 6 && self.resolution.contains(voxel));
        let index = (1 + direction) * self.resolution.voxel_count() + self.resolution.linear_index(voxel);
        self.values.get(index).copied().unwrap_or(0)
    }

    /// True if `b`, at `distance`, is in the safe zone of `a`.
    #[inline]
    fn reaches(&self, a: Voxel, b: Voxel, distance: u32) -> bool {
        let radius = u32::from(self.distance_at(a));
        // Without a difference on its axis, an extent admits what the ball does.
        let extended = |axis: usize, from: u32, to: u32| {
            from != to
                && distance - from.abs_diff(to) < radius
                && distance < radius + u32::from(self.extent_at(2 * axis + usize::from(to < from), a))
        };
        distance < radius || extended(0, a.i, b.i) || extended(1, a.j, b.j) || extended(2, a.k, b.k)
    }

    /// What D must be, from its values in voxels ahead: one step and, where Dist rises, at the end of the next one's
    /// walk.
    fn expected_extent(&self, direction: usize, voxel: Voxel) -> u8 {
        let step = FACE_STEPS[direction];
        let ahead = |voxel, n: u8| validate::neighbour(self.resolution, voxel, step.map(|s| s * (i64::from(n) + 1)));
        let here = self.distance(voxel);
        let Some(next) = ahead(voxel, 0).filter(|&next| here > 0 && self.distance(next) >= here) else { return 0 };
        let walk = self.extent(direction, next);
        if self.distance(next) == here {
            return walk.saturating_add(1);
        }
        match ahead(next, walk) {
            Some(end) => walk.saturating_add(2).saturating_add(self.extent(direction, end)),
            None => walk.saturating_add(1),
        }
    }
}

impl SafeZones for Dual {
    #[inline]
    fn proves(&self, a: Voxel, b: Voxel) -> bool {
        let distance = manhattan_distance(a, b);
        self.reaches(a, b, distance) || self.reaches(b, a, distance)
    }

    fn resolution(&self) -> Resolution {
        self.resolution
    }

    fn bytes(&self) -> usize {
        self.values.len()
    }

    fn validate(&self, occupied: &VoxelSet) -> Result<(), FieldError> {
        validate::same_resolution(self.resolution, occupied)?;
        validate::zero_where_occupied(occupied, "dual", |voxel| self.distance(voxel))?;
        validate::recurrence(occupied, "dual", &FACE_STEPS, |voxel| self.distance(voxel))?;
        NAMES.into_iter().enumerate().try_for_each(|(direction, name)| {
            validate::values(
                self.resolution,
                name,
                |voxel| self.extent(direction, voxel),
                |voxel| self.expected_extent(direction, voxel),
            )
        })
    }
}

/// Where on its way each of some parallel walks saw each distance last.
///
/// Steps are numbered on from walk to walk, so that what an earlier walk saw counts as the border and nothing has to be
/// cleared: a table is 256 KiB, and grids of 10⁵ slices of 8 × 8 voxels have 10⁵ walks.
struct Walk<const LANES: usize> {
    /// The number of the step, for each distance and lane.
    seen: Box<[[u32; LANES]; 256]>,
    /// The number of the last step of all walks.
    steps: u32,
}

impl Walk<1> {
    /// Writes the extents of a row along x.
    fn along_row(&mut self, row: &mut [u8], backwards: bool, distances: &[u8]) {
        let count = row.len();
        let border = self.start(count);
        for (n, step) in (0..count).zip(border + 1..) {
            let i = if backwards { n } else { count - 1 - n };
            self.step(border, step, &distances[i..=i], &mut row[i..=i]);
        }
    }
}

impl<const LANES: usize> Walk<LANES> {
    fn new() -> Self {
        let seen = vec![[0; LANES]; 256].try_into().unwrap_or_else(|_| unreachable!("256 rows were made"));
        Self { seen, steps: 0 }
    }

    /// Starts a walk of `count` steps; gives the number of the border, after which they are numbered.
    fn start(&mut self, count: usize) -> u32 {
        // A walk is no longer than an axis of the grid.
        let count = u32::try_from(count).unwrap_or(u32::MAX);
        let border = self.steps;
        self.steps = border.checked_add(count).unwrap_or_else(|| {
            self.seen.fill([0; LANES]);
            count
        });
        self.steps - count
    }

    /// Writes the extents of lines that follow each other along an axis; `distances(n)` begins with those of line n.
    fn along<'a>(&mut self, lines: &mut impl Lines, backwards: bool, distances: impl Fn(usize) -> &'a [u8]) {
        let count = lines.count();
        let width = lines.line(0).len();
        for first in (0..width).step_by(LANES) {
            let border = self.start(count);
            for (n, step) in (0..count).zip(border + 1..) {
                // An extent looks ahead, so the walk comes from the border ahead.
                let n = if backwards { n } else { count - 1 - n };
                self.step(border, step, &distances(n)[first..width], &mut lines.line(n)[first..]);
            }
        }
    }

    #[inline]
    fn step(&mut self, border: u32, step: u32, distances: &[u8], extents: &mut [u8]) {
        for ((lane, &distance), extent) in (0..LANES).zip(distances).zip(extents) {
            *extent = match distance {
                0 => 0,
                _ => (step - 1 - self.seen[usize::from(distance) - 1][lane].max(border)).min(FAR.into()) as u8,
            };
            self.seen[usize::from(distance)][lane] = step;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What an earlier walk saw does not matter, and neither does the end of the numbers.
    #[test]
    fn walks_do_not_see_each_other() {
        let distances = [3, 2, 1, 0, 1, 2, 3, 2, 3, 4, 3];
        let extents = |walk: &mut Walk<1>| {
            let mut row = [77; 11];
            walk.along_row(&mut row, false, &distances);
            row
        };
        let expected = [0, 0, 0, 0, 6, 5, 0, 3, 2, 0, 0];
        assert_eq!(extents(&mut Walk::new()), expected);
        let mut walk = Walk::new();
        walk.steps = u32::MAX - 25;
        for _ in 0..5 {
            walk.along_row(&mut [0; 3], true, &[1, 2, 3]);
            assert_eq!(extents(&mut walk), expected);
        }
        assert!(walk.steps < 100, "the numbers have ended once: {}", walk.steps);
    }

    /// A table is 256 KiB, and grids of 10⁵ slices of 8 × 8 voxels have 10⁵ walks, which took 50 times as long when each cleared it.
    #[test]
    fn walks_leave_the_table_as_it_is() {
        let mut walk: Walk<1> = Walk::new();
        walk.along_row(&mut [0; 3], true, &[1, 2, 3]);
        let seen = walk.seen.clone();
        walk.along_row(&mut [0; 3], true, &[7, 8, 9]);
        assert_eq!(walk.seen[..=6], seen[..=6], "only the distances seen have changed");
        assert_eq!(walk.seen[7..10].concat(), [4, 5, 6]);
    }

    #[test]
    fn every_damaged_byte_is_found() {
        validate::tests::assert_damage_is_found(Dual::build, |field| &mut field.values);
    }
}
