//! Manhattan distances to the occupied voxels, also to those of a half-space only.
//!
//! |Δi| + |Δj| + |Δk| is a sum of one term an axis, so its minimum over the occupied voxels is found axis by axis \[Rosenfeld1966\]: first
//! along the rows, then d(V) = min(d(V), 1 + d(V ∓ e)) up and down along y, then along z. If only one of the two ways
//! is walked on an axis, only the occupied voxels on that side count. Passes along y and z work on whole rows and
//! vectorize.

use rayon::prelude::*;
use vdf_voxel::VoxelSet;

use crate::{
    lines::{Contiguous, columns, relax},
    rows::{self, Ways},
};

/// Voxels of a slice that go along z together: of all slices of a grid of 256³ they fit into the second-level cache.
const BLOCK: usize = 2048;

/// Writes for each voxel the distance to the nearest occupied voxel that lies on the sides `ways` of it, saturated at
/// [`rows::FAR`]. In parallel over slices, then over blocks of columns.
pub(crate) fn distances(occupied: &VoxelSet, ways: [Ways; 3], field: &mut [u8]) {
    let resolution = occupied.resolution();
    let width = resolution.x() as usize;
    let slice = width * resolution.y() as usize;
    field.par_chunks_exact_mut(slice).zip(0..resolution.z()).for_each(|(slice, k)| {
        for (row, j) in slice.chunks_exact_mut(width).zip(0..resolution.y()) {
            rows::along_row(occupied.row(j, k), row, ways[0]);
        }
        relax(&mut Contiguous { voxels: slice, width }, ways[1]);
    });
    if slice <= BLOCK {
        relax(&mut Contiguous { voxels: field, width: slice }, ways[2]);
    } else {
        columns(field, slice, BLOCK).into_par_iter().for_each(|mut column| relax(&mut column, ways[2]));
    }
}
