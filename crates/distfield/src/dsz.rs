//! The directed safe zones, `dsz`.
//!
//! *Idea.* A segment that leaves its voxel through one face never comes back: only what lies beyond that face matters.
//! So a voxel knows six distances, one for each face.
//!
//! *Definition.* dist^x+(V) = min of d_Man(U, V) over the occupied U with U_x > V_x, and so for the other five faces
//! (Def. 11 in \[Houska2013\]); safe^x+(V) = { U : d_Man(U, V) < dist^x+(V), U_x > V_x } (Def. 12). B is in safe(A) if
//! A is free and B is in the safe zones of *all* faces of A that look towards B; A itself is in safe(A) if it is free.
//!
//! *Which face.* The thesis takes the face through which the ray leaves A (4.2.2), and a ray through an edge could take
//! either. Where only voxels are known, a query stands for all segments between their points. On each axis on which B
//! differs from A some of these begin on the face towards B and leave through it at once; so each such face is a
//! candidate, and only the smallest of their distances is safe ([`SafeZones::proves`], and so safe neighbourhoods). On an
//! axis without difference no segment leaves. Where the points are known, one face is enough: see below.
//!
//! *Stored form.* dist^x+(V) = 1 + H^x+(V + e_x) with the distance to the *closed* half-space, H^x+(V) = min of
//! d_Man(U, V) over the occupied U with U_x ≥ V_x. H is stored: it is 0 just for occupied voxels, it is a separable
//! distance transform, and, unlike dist, it obeys a recurrence between neighbours everywhere, which
//! [`SafeZones::validate`] checks.
//!
//! *Guarantee.* Let B be in safe(A). A voxel W ≠ A of their cuboid differs from A on some axis, so it lies strictly
//! beyond a face of A that looks towards B; and d_Man(W, A) ≤ d_Man(B, A) < dist of that face. So W is free, and A is:
//! the free cuboid property.
//!
//! *By the ray's face* ([`Dsz::proves_leaving`]). Let the segment leave A through the face towards x+, say, and let
//! d_Man(A, B) < dist^x+(A), A be free and B_x > A_x. Up to that face the segment is in A. From there on its x does not
//! fall, so it is in voxels W of the cuboid of A and B with W_x > A_x; and d_Man(A, W) ≤ d_Man(A, B). So all voxels that
//! it enters are free. The cuboid need not be. `VoxelGrid::leaves_through` finds the faces, and shows that rounding next
//! to edges is within what the voxelization's dilation pays for the ends of segments anyway.
//!
//! *Cost.* 6·X·Y·Z bytes; up to four loads an end, and as many again and three divisions by the ray's face. The build is one Manhattan transform a face, each parallel over
//! slices and columns.
//!
//! *Limits.* Nothing is proved over 256 voxels or more, in Manhattan distance: a diagonal is three times as long as for
//! `amr`. Obstacles beside or behind, but beyond the face, stop the proof.

use vdf_voxel::{Resolution, Voxel, VoxelSet};

use crate::{
    FieldError, SafeZones,
    bytes::Bytes,
    manhattan, manhattan_distance,
    rows::Ways,
    validate::{self, FACE_STEPS},
};

/// The names of the six distances, in the order of the faces' numbers.
const NAMES: [&str; 6] = ["dsz x+", "dsz x-", "dsz y+", "dsz y-", "dsz z+", "dsz z-"];

/// The half-space-wise Manhattan distance field; see the head of its source file.
#[derive(Clone, Debug)]
pub struct Dsz {
    resolution: Resolution,
    /// Six planes of H, one byte per voxel, in the order of the faces' numbers.
    distances: Bytes,
}

impl Dsz {
    /// Builds the field of these occupied voxels.
    #[must_use]
    pub fn build(occupied: &VoxelSet) -> Self {
        let mut field = Self::zeroed(occupied);
        let _ = field.sweep_while(occupied, &|| true);
        field
    }

    /// [`Self::build`], as long as `next` says so: it is asked once before each of the six planes; if it says no, there is no field.
    #[must_use]
    pub fn build_while(occupied: &VoxelSet, next: &(dyn Fn() -> bool + Sync)) -> Option<Self> {
        let mut field = Self::zeroed(occupied);
        field.sweep_while(occupied, next)?;
        Some(field)
    }

    fn zeroed(occupied: &VoxelSet) -> Self {
        let resolution = occupied.resolution();
        Self { resolution, distances: Bytes::zeroed(resolution.voxel_count().saturating_mul(6)) }
    }

    fn sweep_while(&mut self, occupied: &VoxelSet, next: &(dyn Fn() -> bool + Sync)) -> Option<()> {
        for (plane, step) in self.distances.chunks_exact_mut(self.resolution.voxel_count()).zip(FACE_STEPS) {
            next().then_some(())?;
            let ways = step.map(|s| match s {
                0 => Ways::Both,
                1.. => Ways::Plus,
                _ => Ways::Minus,
            });
            manhattan::distances(occupied, ways, plane);
        }
        Some(())
    }

    /// H: the Manhattan distance to the nearest occupied voxel that is not behind `voxel` as seen in the direction of a
    /// face, in voxels, at most 255. Faces 0 to 5 look towards x+, x−, y+, y−, z+, z−. 0 for a voxel that the grid does
    /// not have.
    #[must_use]
    pub fn half_space_distance(&self, face: usize, voxel: Voxel) -> u8 {
        debug_assert!(face < 6);
        if self.resolution.contains(voxel) { self.plane_value(face, self.resolution.linear_index(voxel)) } else { 0 }
    }

    /// dist of Def. 11: the Manhattan distance to the nearest occupied voxel strictly beyond a face, at most 256. Faces
    /// as in [`Dsz::half_space_distance`]. Here it does not matter whether the voxel is occupied. 0 for one that the
    /// grid does not have.
    #[must_use]
    pub fn distance(&self, face: usize, voxel: Voxel) -> u16 {
        if !self.resolution.contains(voxel) {
            return 0;
        }
        let beyond = validate::neighbour(self.resolution, voxel, FACE_STEPS[face]);
        1 + beyond.map_or(u16::from(u8::MAX), |next| self.half_space_distance(face, next).into())
    }

    #[inline]
    fn plane_value(&self, face: usize, index: usize) -> u8 {
        self.distances.get(face * self.resolution.voxel_count() + index).copied().unwrap_or(0)
    }

    /// True only if a segment from a point of `a` to one of `b` enters no occupied voxel that leaves `a` through the faces
    /// that `from_a` names and, seen from its other end, `b` through those of `from_b` (4.2.2 in \[Houska2013\]). For each
    /// axis they say whether it leaves through the face towards the other end; they are asked only if a face that is
    /// left could prove it. False says nothing; what [`SafeZones::proves`] proves is not asked again.
    #[inline]
    pub fn proves_leaving(
        &self,
        a: Voxel,
        b: Voxel,
        from_a: impl FnOnce() -> [bool; 3],
        from_b: impl FnOnce() -> [bool; 3],
    ) -> bool {
        let distance = manhattan_distance(a, b);
        self.reaches_leaving(a, b, distance, from_a) || self.reaches_leaving(b, a, distance, from_b)
    }

    /// True if `b`, at `distance`, is in the safe zone of one of the faces of `a` that `leaves` names.
    #[inline]
    fn reaches_leaving(&self, a: Voxel, b: Voxel, distance: u32, leaves: impl FnOnce() -> [bool; 3]) -> bool {
        let index = self.resolution.linear_index(a);
        let row = self.resolution.x() as usize;
        // As in `reaches`, but an axis on which they do not differ has no face that is left.
        let safe = |axis: usize, from: u32, to: u32, stride: usize| {
            if from < to {
                distance <= u32::from(self.plane_value(2 * axis, index + stride))
            } else {
                from > to && distance <= u32::from(self.plane_value(2 * axis + 1, index - stride))
            }
        };
        if self.plane_value(0, index) == 0 {
            return false;
        }
        let x = safe(0, a.i, b.i, 1);
        let y = safe(1, a.j, b.j, row);
        let z = safe(2, a.k, b.k, row * self.resolution.y() as usize);
        (x || y || z) && {
            let [leaves_x, leaves_y, leaves_z] = leaves();
            (x && leaves_x) || (y && leaves_y) || (z && leaves_z)
        }
    }

    /// True if `b`, at `distance`, is in the safe zone of `a`.
    #[inline]
    fn reaches(&self, a: Voxel, b: Voxel, distance: u32) -> bool {
        let index = self.resolution.linear_index(a);
        let row = self.resolution.x() as usize;
        // d_Man < 1 + H of the next voxel; where the coordinates differ there is a next one.
        let beyond = |axis: usize, from: u32, to: u32, stride: usize| match from.cmp(&to) {
            std::cmp::Ordering::Less => distance <= self.plane_value(2 * axis, index + stride).into(),
            std::cmp::Ordering::Equal => true,
            std::cmp::Ordering::Greater => distance <= self.plane_value(2 * axis + 1, index - stride).into(),
        };
        self.plane_value(0, index) != 0
            && beyond(0, a.i, b.i, 1)
            && beyond(1, a.j, b.j, row)
            && beyond(2, a.k, b.k, row * self.resolution.y() as usize)
    }
}

impl SafeZones for Dsz {
    #[inline]
    fn proves(&self, a: Voxel, b: Voxel) -> bool {
        let distance = manhattan_distance(a, b);
        self.reaches(a, b, distance) || self.reaches(b, a, distance)
    }

    fn resolution(&self) -> Resolution {
        self.resolution
    }

    fn bytes(&self) -> usize {
        self.distances.len()
    }

    fn validate(&self, occupied: &VoxelSet) -> Result<(), FieldError> {
        validate::same_resolution(self.resolution, occupied)?;
        let plane = |face| move |voxel| self.half_space_distance(face, voxel);
        for (face, name) in NAMES.into_iter().enumerate() {
            validate::zero_where_occupied(occupied, name, plane(face))?;
        }
        for (face, name) in NAMES.into_iter().enumerate() {
            let back = FACE_STEPS[face ^ 1];
            let steps: Vec<_> = FACE_STEPS.into_iter().filter(|&step| step != back).collect();
            validate::recurrence(occupied, name, &steps, plane(face))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_damaged_byte_is_found() {
        validate::tests::assert_damage_is_found(Dsz::build, |field| &mut field.distances);
    }
}
