//! What the validators of the fields share.
//!
//! All distances are of one kind: the length, at most 255, of the shortest chain of steps from a voxel to an occupied
//! one, with steps to all 26 neighbours (`ndf`), to 7 of them (an octant of `amr`), to the 6 across faces (`dual`) or
//! to 5 of those (a face of `dsz`). A shortest chain never needs to leave the grid, so its length is the distance of
//! the definition.
//!
//! *Claim.* If d is 0 just for the occupied voxels, and d(V) = min(255, 1 + min d(V + step)) for every free one, where
//! beyond the grid d is 255, then d is that length. *Proof.* d(V) is at most the length: along the shortest chain from
//! the occupied voxel back to V the recurrence adds at most one a step. If d(V) < 255, then it is also at least the
//! length: some neighbour has d(V) − 1, one of its neighbours one less, and so on down to 0, which is occupied: that is
//! a chain of d(V) steps. And d(V) = 255 says only that the length is 255 or more, which the first half has shown.
//!
//! So a local check in linear time proves the whole field, without knowledge of how it was built.

use rayon::prelude::*;
use vdf_voxel::{Resolution, Voxel, VoxelSet};

use crate::{FieldError, rows::FAR};

/// The steps across the six faces of a voxel, in the order of the faces' numbers; face ^ 1 is opposite.
pub(crate) const FACE_STEPS: [[i64; 3]; 6] = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];

/// Those of the 26 steps to all neighbours that `admits` holds of.
pub(crate) fn chessboard_steps(admits: impl Fn([i64; 3]) -> bool) -> Vec<[i64; 3]> {
    let range = -1..=1;
    let all = range.clone().flat_map(|z| range.clone().flat_map(move |y| (-1..=1).map(move |x| [x, y, z])));
    all.filter(|&step| step != [0; 3] && admits(step)).collect()
}

/// The voxel that is `step` away, if the grid has it.
pub(crate) fn neighbour(resolution: Resolution, voxel: Voxel, step: [i64; 3]) -> Option<Voxel> {
    let along = |c: u32, s: i64| u32::try_from(i64::from(c) + s).ok();
    let next = Voxel::new(along(voxel.i, step[0])?, along(voxel.j, step[1])?, along(voxel.k, step[2])?);
    resolution.contains(next).then_some(next)
}

/// Level 1.
pub(crate) fn same_resolution(found: Resolution, occupied: &VoxelSet) -> Result<(), FieldError> {
    let expected = occupied.resolution();
    if found == expected { Ok(()) } else { Err(FieldError::Resolution { expected, found }) }
}

/// Level 2: `value` is 0 just where a voxel is occupied.
pub(crate) fn zero_where_occupied(
    occupied: &VoxelSet,
    part: &'static str,
    value: impl Fn(Voxel) -> u8 + Sync,
) -> Result<(), FieldError> {
    for_all(occupied.resolution(), |voxel| {
        let (found, occupied) = (value(voxel), occupied.contains(voxel));
        if (found == 0) == occupied { Ok(()) } else { Err(FieldError::Occupancy { part, voxel, occupied, found }) }
    })
}

/// Level 3: every free voxel's value is one more than the least of its neighbours' that are one of `steps` away.
pub(crate) fn recurrence(
    occupied: &VoxelSet,
    part: &'static str,
    steps: &[[i64; 3]],
    value: impl Fn(Voxel) -> u8 + Sync,
) -> Result<(), FieldError> {
    let resolution = occupied.resolution();
    values(resolution, part, &value, |voxel| {
        if occupied.contains(voxel) {
            return 0;
        }
        let neighbours = steps.iter().filter_map(|&step| neighbour(resolution, voxel, step));
        neighbours.map(&value).min().unwrap_or(FAR).saturating_add(1)
    })
}

/// Every value is the expected one.
pub(crate) fn values(
    resolution: Resolution,
    part: &'static str,
    found: impl Fn(Voxel) -> u8 + Sync,
    expected: impl Fn(Voxel) -> u8 + Sync,
) -> Result<(), FieldError> {
    for_all(resolution, |voxel| {
        let (found, expected) = (found(voxel), expected(voxel));
        if found == expected { Ok(()) } else { Err(FieldError::Value { part, voxel, expected, found }) }
    })
}

/// Checks all voxels, in parallel over slices; the error is that of the first wrong voxel in the order of linear
/// coordinates.
pub(crate) fn for_all(
    resolution: Resolution,
    check: impl Fn(Voxel) -> Result<(), FieldError> + Sync,
) -> Result<(), FieldError> {
    let slice = |k| {
        let rows = (0..resolution.y()).flat_map(|j| (0..resolution.x()).map(move |i| Voxel::new(i, j, k)));
        rows.map(&check).find_map(Result::err)
    };
    (0..resolution.z()).into_par_iter().find_map_first(slice).map_or(Ok(()), Err)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::{SafeZones, bytes::Bytes};

    /// Damages each stored byte of a field in turn, by one and by much, and requires that each time validation fails.
    pub(crate) fn assert_damage_is_found<F: SafeZones>(
        build: fn(&VoxelSet) -> F,
        bytes: impl Fn(&mut F) -> &mut Bytes,
    ) {
        let mut occupied = VoxelSet::new(Resolution::new(7, 5, 6));
        occupied.extend([Voxel::new(1, 1, 1), Voxel::new(5, 1, 2), Voxel::new(2, 4, 5), Voxel::new(2, 3, 5)]);
        let mut field = build(&occupied);
        assert_eq!(field.validate(&occupied), Ok(()));
        for n in 0..bytes(&mut field).len() {
            for change in [1, 255, 128, 7] {
                let value = bytes(&mut field)[n];
                bytes(&mut field)[n] = value.wrapping_add(change);
                assert!(field.validate(&occupied).is_err(), "byte {n} + {change}");
                bytes(&mut field)[n] = value;
            }
        }
        let other = VoxelSet::new(Resolution::new(7, 6, 5));
        assert!(matches!(field.validate(&other), Err(FieldError::Resolution { .. })));
    }
}
