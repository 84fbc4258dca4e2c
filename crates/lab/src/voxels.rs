//! The voxels of a scene, to look at: what a method works on, without a render.

use glam::DVec3;
use rayon::prelude::*;
use vdf_voxel::{Voxel, VoxelGrid, VoxelSet, voxelize};

use crate::{
    Acceleration, Answer, BuildReport, Method, Proofs, ProofsVisitor, RenderError, World,
    options::{check_voxel_size, default_voxel_size, on_threads},
    scene::{Emitter, Scene},
};

/// The occupied voxels of a scene and the neighbourhoods of its point emitters.
#[derive(Clone, Debug)]
pub struct SceneVoxels {
    /// The grid, which covers occluders, medium boundaries and point emitters.
    pub grid: VoxelGrid,
    /// Σ′, the voxels that touch an occluder.
    pub occupied: VoxelSet,
    /// For each emitter of the scene the voxels that the method proves to see it: its safe neighbourhood (Def. 14 in
    /// \[Houska2013\]), kept or not. `None` if the emitter is no point in the grid, or the method is `none`.
    pub neighbourhoods: Vec<Option<VoxelSet>>,
    /// Sizes and times of the method's structures.
    pub build: BuildReport,
}

impl SceneVoxels {
    /// Voxelizes `scene` and asks `method` about every voxel and point emitter, on `threads` threads (by default one for each
    /// processor). By default the longest side of the scene has 128 voxels.
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
                Acceleration::build(method, &world.triangles, world.bounds, &scene.light_shapes(), size, max_voxels)?;
            let neighbourhood = |(emitter, e): (usize, &Emitter)| match *e {
                Emitter::Point { position, .. } if method != Method::None => {
                    grid.voxel_containing(position)?;
                    Some(acceleration.accept(Neighbourhood { grid: &grid, emitter, position }))
                }
                _ => None,
            };
            let neighbourhoods = scene.emitters.iter().enumerate().map(neighbourhood).collect();
            Ok(Self { grid, occupied, neighbourhoods, build })
        })
    }
}

/// The voxels of `grid` whose middles are proved to see an emitter. A proof is one for all of the two voxels.
struct Neighbourhood<'a> {
    grid: &'a VoxelGrid,
    emitter: usize,
    position: DVec3,
}

impl ProofsVisitor for Neighbourhood<'_> {
    type Output = VoxelSet;

    fn visit<P: Proofs>(self, proofs: &P) -> VoxelSet {
        let Self { grid, emitter, position } = self;
        let half = DVec3::splat(0.5 * grid.voxel_size());
        VoxelSet::from_rows(grid.resolution(), |j, k, row| {
            for i in 0..grid.resolution().x {
                let middle = grid.corner(Voxel::new(i, j, k)) + half;
                if proofs.answer(emitter, middle, position) == Answer::Unoccluded {
                    row[i as usize / 64] |= 1 << (i % 64);
                }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{LoadOptions, builtin};

    #[test]
    fn neighbourhoods_are_those_of_the_method() {
        let scene = Scene::from_source(&builtin("cbox_vol3").unwrap(), &LoadOptions::default()).unwrap();
        for method in Method::ALL {
            let voxels = SceneVoxels::build(&scene, method, Some(20.0), 1 << 20, Some(2)).unwrap();
            let counts: Vec<_> = voxels.neighbourhoods.iter().map(|n| n.as_ref().map(VoxelSet::count)).collect();
            assert_eq!(counts.len(), 2);
            for (count, built) in counts.iter().zip(&voxels.build.neighbourhoods) {
                assert_eq!(count.is_some(), method != Method::None, "{method}");
                assert!(built.is_none() || built == count, "{method}: {built:?} {count:?}");
            }
            for set in voxels.neighbourhoods.iter().flatten() {
                assert!(set.count() > 10 && set.iter().all(|v| !voxels.occupied.contains(v)), "{method}");
            }
        }
        // A method that keeps none has the same as one that does.
        let of = |method| SceneVoxels::build(&scene, method, None, 1 << 24, None).unwrap().neighbourhoods;
        let named = |name: &str| of(name.parse::<Method>().unwrap());
        assert_eq!(named("ndf"), named("ndf-sn"));
        assert_eq!(named("amr"), named("amr-sn"));
    }
}
