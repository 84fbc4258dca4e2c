//! What methods may be expected to cost and to save before they are built: rules of thumb from measurements (`docs/performance.md`), good within a factor of two.
//! They decide only what is worth a trial.

use super::QueryCost;

/// Seconds of one processor, and seconds a path that are saved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Expected {
    pub(super) build: f64,
    pub(super) saves: f64,
}

/// A light buffer: for each triangle, for each texel.
const BUFFER_TRIANGLE: f64 = 4e-6;
const BUFFER_TEXEL: f64 = 40e-9;

/// A query of one: at least so much, and so much of what the hierarchy takes, for both get slower where there is more to be met.
const BUFFER_QUERY: f64 = 20e-9;
const BUFFER_SHARE: f64 = 0.45;

/// Voxels: for each triangle, for each voxel.
const VOXELS_TRIANGLE: f64 = 0.2e-6;
const VOXELS_VOXEL: f64 = 0.4e-9;

/// The attempt of a proof from voxels, and the share that is proved.
const VOXELS_QUERY: f64 = 18e-9;
const VOXELS_PROVED: f64 = 0.5;

/// Light buffers of `side` texels along each side of a face, one for each of `lights` lights, for queries towards these.
pub(super) fn buffers(triangles: usize, side: u32, lights: usize, queries: &[QueryCost]) -> Expected {
    let texels = 6.0 * f64::from(side) * f64::from(side);
    let one = BUFFER_TRIANGLE * triangles as f64 + BUFFER_TEXEL * texels;
    let saved = |q: &QueryCost| q.saved_at(BUFFER_QUERY + BUFFER_SHARE * q.seconds);
    Expected { build: one * lights as f64, saves: queries.iter().map(saved).sum() }
}

/// Neighbourhoods in so many voxels, for queries that these may prove.
pub(super) fn neighbourhoods(triangles: usize, voxels: f64, queries: &[QueryCost]) -> Expected {
    let saved = |q: &QueryCost| q.saved_at(VOXELS_QUERY + (1.0 - VOXELS_PROVED) * q.seconds);
    Expected {
        build: VOXELS_TRIANGLE * triangles as f64 + VOXELS_VOXEL * voxels,
        saves: queries.iter().map(saved).sum(),
    }
}
