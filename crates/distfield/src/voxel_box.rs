//! Boxes of voxels.

use vdf_voxel::Voxel;

/// The voxels between two corners, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VoxelBox {
    min: Voxel,
    max: Voxel,
}

impl VoxelBox {
    /// The smallest box that holds two voxels: their cuboid (4.4.1 in \[Houska2013\]).
    #[must_use]
    pub const fn spanning(a: Voxel, b: Voxel) -> Self {
        const fn in_order(a: u32, b: u32) -> (u32, u32) {
            if a <= b { (a, b) } else { (b, a) }
        }
        let ((i0, i1), (j0, j1), (k0, k1)) = (in_order(a.i, b.i), in_order(a.j, b.j), in_order(a.k, b.k));
        Self { min: Voxel::new(i0, j0, k0), max: Voxel::new(i1, j1, k1) }
    }

    /// The corner with the smallest coordinates.
    #[must_use]
    pub const fn min(&self) -> Voxel {
        self.min
    }

    /// The corner with the greatest coordinates.
    #[must_use]
    pub const fn max(&self) -> Voxel {
        self.max
    }

    /// True if `voxel` is in the box.
    #[must_use]
    pub const fn contains(&self, voxel: Voxel) -> bool {
        let (min, max) = (self.min, self.max);
        let (above, below) = (
            min.i <= voxel.i && min.j <= voxel.j && min.k <= voxel.k,
            voxel.i <= max.i && voxel.j <= max.j && voxel.k <= max.k,
        );
        above && below
    }

    /// All voxels of the box.
    pub fn voxels(self) -> impl Iterator<Item = Voxel> {
        (self.min.k..=self.max.k).flat_map(move |k| {
            (self.min.j..=self.max.j).flat_map(move |j| (self.min.i..=self.max.i).map(move |i| Voxel::new(i, j, k)))
        })
    }
}

impl From<Voxel> for VoxelBox {
    fn from(voxel: Voxel) -> Self {
        Self { min: voxel, max: voxel }
    }
}
