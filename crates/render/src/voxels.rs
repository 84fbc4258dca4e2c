//! The voxels of a scene, to look at: what a method works on, without a render.

use rayon::prelude::*;
use vdf_voxel::{VoxelGrid, VoxelSet, voxelize};

use crate::{
    Acceleration, BuildReport, Method, RenderError, World,
    options::{check_voxel_size, default_voxel_size, on_threads},
    scene::Scene,
};

/// The occupied voxels of a scene and the safe neighbourhoods of its emitters.
#[derive(Debug)]
pub struct SceneVoxels {
    /// The grid, which covers occluders, medium boundaries and point emitters.
    pub grid: VoxelGrid,
    /// Σ′, the voxels that touch an occluder.
    pub occupied: VoxelSet,
    /// For each emitter of the scene the voxels of its neighbourhood, if the method builds one for it.
    pub neighbourhoods: Vec<Option<VoxelSet>>,
    /// Sizes and times of the method's structures.
    pub build: BuildReport,
}

impl SceneVoxels {
    /// Voxelizes `scene` and builds the structures of `method`, on `threads` threads (by default one for each processor). By default
    /// the longest side of the scene has 128 voxels.
    ///
    /// # Errors
    /// If the voxel size or the number of threads is not usable, or the grid exceeds `max_voxels`.
    pub fn build(
        scene: &Scene,
        method: Method,
        voxel_size: Option<f64>,
        max_voxels: u64,
        threads: Option<usize>,
    ) -> Result<Self, RenderError> {
        voxel_size.map_or(Ok(()), check_voxel_size)?;
        on_threads(threads, || {
            let world = World::new(scene);
            let (min, max) = world.bounds;
            let size = voxel_size.unwrap_or_else(|| default_voxel_size(world.bounds));
            let grid = VoxelGrid::covering(min, max, size, max_voxels)?;
            let occupied = voxelize(&grid, world.triangles.par_iter().map(|t| t.vertices))?;
            let (acceleration, build) =
                Acceleration::build(method, &world.triangles, world.bounds, &scene.emitters, size, max_voxels)?;
            let mut neighbourhoods = acceleration.neighbourhoods();
            neighbourhoods.resize(scene.emitters.len(), None);
            Ok(Self { grid, occupied, neighbourhoods, build })
        })
    }
}
