//! Safe neighbourhoods, the suffix `-sn`.
//!
//! *Idea.* All queries to a point light end in the same voxel: ask the field once for each voxel and keep the answers
//! as bits.
//!
//! *Definition.* neigh(V) = { U : U in safe(V) or V in safe(U) } (Def. 14 in \[Houska2013\]), over any field.
//!
//! *Guarantee.* Exactly the answers of the field, [`SafeZones::proves`]; so its guarantee.
//!
//! *Cost.* X·Y·Z bits per light; one load a query, and the voxel of the light is not needed. The build asks the field
//! for every voxel of the extended neighbourhood, which holds this one, in parallel over slices.
//!
//! *Limits.* One set per light. A light in an occupied voxel proves nothing.

use std::borrow::Cow;

use vdf_voxel::{Voxel, VoxelSet};

use crate::{ExtendedNeighbourhood, FieldError, SafeZones, validate};

/// What the neighbourhoods of a light have in common: they know which voxels see all of it.
pub trait Neighbourhood: Sync {
    /// True if no segment between the light's voxels and `voxel` can be occluded. False says nothing; so it is for
    /// a voxel that the grid does not have.
    fn proves(&self, voxel: Voxel) -> bool;

    /// The voxels of the neighbourhood.
    fn voxels(&self) -> Cow<'_, VoxelSet>;

    /// The number of voxels in the neighbourhood.
    fn count(&self) -> usize;

    /// The memory of the neighbourhood in bytes.
    fn bytes(&self) -> usize;

    /// Checks the neighbourhood against the occupied voxels that it was built from, cheap checks first. What that
    /// proves, the implementations say.
    ///
    /// # Errors
    /// The first voxel found that is in it and must not be, or the other way round.
    fn validate(&self, occupied: &VoxelSet) -> Result<(), FieldError>;
}

/// The voxels that a field proves visible from one voxel; see the head of its source file.
#[derive(Clone, Debug)]
pub struct SafeNeighbourhood {
    light: Voxel,
    voxels: VoxelSet,
}

impl SafeNeighbourhood {
    /// The safe neighbourhood of the voxel `light` in a field that was built from `occupied`; empty if `light` is
    /// occupied or outside the grid, or if the two are of different grids.
    #[must_use]
    pub fn new<F: SafeZones + ?Sized>(field: &F, occupied: &VoxelSet, light: Voxel) -> Self {
        let resolution = field.resolution();
        if resolution != occupied.resolution() || occupied.contains(light) || !resolution.contains(light) {
            return Self { light, voxels: VoxelSet::new(resolution) };
        }
        // What a field proves has a free cuboid, so it need not be asked about other voxels.
        let extended = ExtendedNeighbourhood::new(occupied, light.into());
        let voxels = VoxelSet::from_rows(resolution, |j, k, row| {
            for i in extended.members(j, k) {
                row[(i / 64) as usize] |= u64::from(field.proves(light, Voxel::new(i, j, k))) << (i % 64);
            }
        });
        Self { light, voxels }
    }
}

impl Neighbourhood for SafeNeighbourhood {
    #[inline]
    fn proves(&self, voxel: Voxel) -> bool {
        self.voxels.contains(voxel)
    }

    fn voxels(&self) -> Cow<'_, VoxelSet> {
        Cow::Borrowed(&self.voxels)
    }

    fn count(&self) -> usize {
        self.voxels.count()
    }

    fn bytes(&self) -> usize {
        self.voxels.bytes()
    }

    /// Checks the resolution, that no member is occupied, and that each member and the light span a free cuboid. The
    /// last proves that no answer is wrong, whatever field it came from; that none is missing, only the field could
    /// tell.
    fn validate(&self, occupied: &VoxelSet) -> Result<(), FieldError> {
        let resolution = self.voxels.resolution();
        validate::same_resolution(resolution, occupied)?;
        let wrong = |voxel| Err(FieldError::Member { voxel, expected: false, found: true });
        self.voxels.iter().find(|&voxel| occupied.contains(voxel)).map_or(Ok(()), wrong)?;
        let extended = ExtendedNeighbourhood::new(occupied, self.light.into());
        self.voxels.iter().find(|&voxel| !extended.proves(voxel)).map_or(Ok(()), wrong)
    }
}

#[cfg(test)]
mod tests {
    use vdf_voxel::Resolution;

    use super::*;
    use crate::{Amr, VoxelBox};

    #[test]
    fn a_wrong_member_is_found() {
        let resolution = Resolution::new(6, 4, 4);
        let mut occupied = VoxelSet::new(resolution);
        occupied.extend([Voxel::new(3, 1, 1), Voxel::new(5, 3, 3)]);
        let light = Voxel::new(1, 1, 1);
        let mut near = SafeNeighbourhood::new(&Amr::build(&occupied), &occupied, light);
        assert_eq!(near.validate(&occupied), Ok(()));
        for voxel in resolution.voxels() {
            let free = VoxelBox::spanning(light, voxel).voxels().all(|v| !occupied.contains(v));
            let before = near.voxels.clone();
            near.voxels.insert(voxel);
            assert_eq!(near.validate(&occupied).is_ok(), free, "{voxel:?}");
            near.voxels = before;
        }
    }
}
