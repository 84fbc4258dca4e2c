//! The anisotropic macro-regions, `amr`.
//!
//! *Idea.* A voxel knows eight distances, one for each octant of directions: a wall behind does not shorten
//! the view ahead.
//!
//! *Definition.* dist^oct(V) = min of d_CD(U, V) over the occupied U in the closed octant of V (Def. 9 in
//! \[Houska2013\]); safe(V) = { U : d_CD(V, U) < dist^oct(V) } for an octant of V that holds U (Def. 10). Where U and V
//! have equal coordinates several octants hold U. The thesis takes the first; any is sound, so here it is the best. One
//! byte each, saturated at 255. Beyond the grid there is nothing.
//!
//! *Guarantee.* The cuboid of A and B is in the closed octant of A that holds B and is nowhere farther than B. So if
//! d_CD(A, B) < dist^oct(A) all of it is free (the free cuboid property, 4.4.1).
//!
//! *Cost.* 8·X·Y·Z bytes; two loads a query, up to eight if coordinates are equal. The build is one sweep per octant,
//! in parallel over octants, against its direction: 0 if occupied, else 1 + the minimum over the 7 neighbours in the
//! octant (4.1). A row takes the minimum over three finished rows, which vectorizes. By the recurrence these rise by at
//! most 1 from voxel to voxel against the octant's x, and so does their minimum; so along x nothing is to be swept but
//! the distances to the row's own occupied voxels, which are ramps that are copied. One plane an octant, not eight
//! bytes a voxel together: measured, that is slower towards point lights (docs/performance.md).
//!
//! *Limits.* Nothing is proved over 255 voxels or more. An occluder in the octant that is beside the segment, not on
//! it, stops the proof.

use rayon::prelude::*;
use vdf_voxel::{Resolution, Voxel, VoxelSet};

use crate::{
    FieldError, SafeZones,
    bytes::Bytes,
    chessboard_distance,
    rows::{self, Ways},
    validate,
};

/// Bits of an octant's number: set where it extends towards smaller coordinates.
const MINUS_X: usize = 1;
const MINUS_Y: usize = 2;
const MINUS_Z: usize = 4;

/// The names of the eight distances, in the order of the octants' numbers.
const NAMES: [&str; 8] = ["amr +++", "amr -++", "amr +-+", "amr --+", "amr ++-", "amr -+-", "amr +--", "amr ---"];

/// The octant-wise chessboard distance field; see the head of its source file.
#[derive(Clone, Debug)]
pub struct Amr {
    resolution: Resolution,
    /// Eight planes of one byte per voxel, in the order of the octants' numbers.
    distances: Bytes,
}

impl Amr {
    /// Builds the field of these occupied voxels.
    #[must_use]
    pub fn build(occupied: &VoxelSet) -> Self {
        let mut field = Self::zeroed(occupied);
        let _ = field.sweep_while(occupied, &|| true);
        field
    }

    /// [`Self::build`], as long as `next` says so: it is asked once before each of the eight planes, from any thread; if it says no, there is
    /// no field.
    #[must_use]
    pub fn build_while(occupied: &VoxelSet, next: &(dyn Fn() -> bool + Sync)) -> Option<Self> {
        let mut field = Self::zeroed(occupied);
        field.sweep_while(occupied, next)?;
        Some(field)
    }

    fn zeroed(occupied: &VoxelSet) -> Self {
        let resolution = occupied.resolution();
        Self { resolution, distances: Bytes::zeroed(resolution.voxel_count().saturating_mul(8)) }
    }

    fn sweep_while(&mut self, occupied: &VoxelSet, next: &(dyn Fn() -> bool + Sync)) -> Option<()> {
        let planes = self.distances.par_chunks_exact_mut(self.resolution.voxel_count()).enumerate();
        planes.map(|(octant, plane)| next().then(|| sweep(occupied, octant, plane))).collect()
    }

    /// The distance to the nearest occupied voxel in an octant, in voxels, at most 255; 0 for a voxel that the grid
    /// does not have. Bits 0, 1 and 2 of `octant`, which is below 8, are set where it extends towards smaller i, j and
    /// k.
    #[must_use]
    pub fn distance(&self, octant: usize, voxel: Voxel) -> u8 {
        if self.resolution.contains(voxel) { self.at(octant, voxel) } else { 0 }
    }

    /// [`Self::distance`] of one of the grid's voxels.
    #[inline]
    fn at(&self, octant: usize, voxel: Voxel) -> u8 {
        debug_assert!(octant < 8 && self.resolution.contains(voxel));
        let index = octant * self.resolution.voxel_count() + self.resolution.linear_index(voxel);
        self.distances.get(index).copied().unwrap_or(0)
    }

    /// The other octants that hold `b` as seen from `a`: those that differ where coordinates are equal.
    #[inline(never)]
    fn proves_tie(&self, a: Voxel, b: Voxel, ties: usize, distance: u32) -> bool {
        let octant = octant_of(a, b);
        (0..8)
            .filter(|other| (other ^ octant) & !ties == 0)
            .any(|other| distance < u32::from(self.at(other, a)) || distance < u32::from(self.at(other ^ 7, b)))
    }
}

impl SafeZones for Amr {
    #[inline]
    fn proves(&self, a: Voxel, b: Voxel) -> bool {
        let distance = chessboard_distance(a, b);
        let octant = octant_of(a, b);
        if distance < u32::from(self.at(octant, a)) || distance < u32::from(self.at(octant ^ 7, b)) {
            return true;
        }
        let ties = number(a.i == b.i, a.j == b.j, a.k == b.k);
        ties != 0 && self.proves_tie(a, b, ties, distance)
    }

    fn resolution(&self) -> Resolution {
        self.resolution
    }

    fn bytes(&self) -> usize {
        self.distances.len()
    }

    fn validate(&self, occupied: &VoxelSet) -> Result<(), FieldError> {
        validate::same_resolution(self.resolution, occupied)?;
        let plane = |octant| move |voxel| self.distance(octant, voxel);
        for (octant, name) in NAMES.into_iter().enumerate() {
            validate::zero_where_occupied(occupied, name, plane(octant))?;
        }
        for (octant, name) in NAMES.into_iter().enumerate() {
            let within = |[x, y, z]: [i64; 3]| {
                let ahead = |s: i64, minus: usize| if octant & minus == 0 { s >= 0 } else { s <= 0 };
                ahead(x, MINUS_X) && ahead(y, MINUS_Y) && ahead(z, MINUS_Z)
            };
            validate::recurrence(occupied, name, &validate::chessboard_steps(within), plane(octant))?;
        }
        Ok(())
    }
}

/// An octant of `a` that holds `b`.
#[inline]
fn octant_of(a: Voxel, b: Voxel) -> usize {
    number(b.i < a.i, b.j < a.j, b.k < a.k)
}

#[inline]
fn number(x: bool, y: bool, z: bool) -> usize {
    MINUS_X * usize::from(x) + MINUS_Y * usize::from(y) + MINUS_Z * usize::from(z)
}

/// Fills one octant's plane, beginning at the corner of the grid that the octant points to.
fn sweep(occupied: &VoxelSet, octant: usize, plane: &mut [u8]) {
    let [width, height, depth] = occupied.resolution().sides().map(|n| n as usize);
    let slice_len = width * height;
    let (ways, ahead) = if octant & MINUS_X == 0 { (Ways::Plus, 2) } else { (Ways::Minus, 0) };
    let nothing = vec![rows::FAR; slice_len];
    // The least of the three finished rows ahead on y and z, between what is beyond the grid.
    let mut nearest = vec![rows::FAR; width + 2];
    for step_k in 0..depth {
        let k = if octant & MINUS_Z == 0 { depth - 1 - step_k } else { step_k };
        let (slice, next_slice) = with_ahead(plane, k, slice_len, octant & MINUS_Z != 0);
        let next_slice = next_slice.unwrap_or(&nothing);
        for step_j in 0..height {
            let j = if octant & MINUS_Y == 0 { height - 1 - step_j } else { step_j };
            let (row, next_row) = with_ahead(slice, j, width, octant & MINUS_Y != 0);
            let of_next = |j: usize| next_slice.get(j * width..(j + 1) * width);
            let diagonal = if octant & MINUS_Y == 0 { of_next(j + 1) } else { j.checked_sub(1).and_then(of_next) };
            let nothing = &nothing[..width];
            let finished =
                next_row.unwrap_or(nothing).iter().zip(of_next(j).unwrap_or(nothing)).zip(diagonal.unwrap_or(nothing));
            for (nearest, ((&on_y, &on_z), &on_both)) in nearest[1..].iter_mut().zip(finished) {
                *nearest = on_y.min(on_z).min(on_both);
            }
            // Finished rows obey the recurrence, so along x only the distances to the row's own occupied voxels are
            // still to spread.
            rows::along_row(occupied.row(j as u32, k as u32), row, ways);
            let nearest = nearest[1..].iter().zip(&nearest[ahead..]);
            for (distance, (&beside, &ahead)) in row.iter_mut().zip(nearest) {
                *distance = beside.min(ahead).saturating_add(1).min(*distance);
            }
        }
    }
}

/// Line `n` of lines that lie behind each other, and the finished line ahead of it, which is the one before if the
/// sweep goes `up`.
#[inline]
fn with_ahead(lines: &mut [u8], n: usize, len: usize, up: bool) -> (&mut [u8], Option<&[u8]>) {
    if up {
        let (done, rest) = lines.split_at_mut(n * len);
        (&mut rest[..len], done.len().checked_sub(len).map(|last| &done[last..]))
    } else {
        let (rest, done) = lines.split_at_mut((n + 1) * len);
        (&mut rest[n * len..], done.get(..len))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_damaged_byte_is_found() {
        validate::tests::assert_damage_is_found(Amr::build, |field| &mut field.distances);
    }
}
