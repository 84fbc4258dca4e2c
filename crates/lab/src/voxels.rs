//! The voxels of a scene, to look at: what a method works on, without a render.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use vdf_render::{PrepareOptions, PreparedScene, Progress, on_threads};
use vdf_scene::{Emitter, Scene};
use vdf_visibility::{Answer, BuildReport, Method, Provers, QueryKind, ShadowQuery};
use vdf_voxel::{Voxel, VoxelGrid, VoxelSet, voxelize};

use crate::LabError;

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
    /// Voxelizes `scene` and asks the method about every voxel and point emitter. The method `none` has no voxels of
    /// its own; those of `amr-xsn`, the default, stand for it, without neighbourhoods.
    ///
    /// # Errors If the voxel size or the number of threads is not usable, the grid exceeds `options.max_voxels`, or
    /// `progress` asks to stop.
    pub fn build(
        scene: impl Into<Arc<Scene>>,
        options: &PrepareOptions,
        progress: &dyn Progress,
    ) -> Result<Self, LabError> {
        let asked = options.method.unwrap_or_else(Method::best_with_voxels);
        let method = if asked == Method::NONE { Method::best_with_voxels() } else { asked };
        let prepared = PreparedScene::new(scene, &PrepareOptions { method: Some(method), ..*options }, progress)?;
        let (world, provers) = (prepared.world(), prepared.provers());
        let Some(&grid) = provers.grid() else {
            return Err(LabError::option("method", format!("must have voxels, such as amr-xsn; {method} has none")));
        };
        on_threads(options.threads, || {
            let occupied = voxelize(&grid, world.triangles.par_iter().map(|t| t.vertices))?;
            let neighbourhood = |(emitter, e): (usize, &Emitter)| match *e {
                Emitter::Point { position, .. } if asked != Method::NONE => {
                    grid.voxel_containing(position)?;
                    Some(neighbourhood(&grid, provers, emitter, position))
                }
                _ => None,
            };
            let neighbourhoods = prepared.scene().emitters.iter().enumerate().map(neighbourhood).collect();
            Ok(Self { grid, occupied, neighbourhoods, build: prepared.build_report().clone() })
        })
    }
}

/// The voxels of `grid` whose middles are proved to see an emitter. A proof is one for all of the two voxels.
fn neighbourhood(grid: &VoxelGrid, provers: &Provers, emitter: usize, position: DVec3) -> VoxelSet {
    let half = DVec3::splat(0.5 * grid.voxel_size());
    VoxelSet::from_rows(grid.resolution(), |j, k, row| {
        for i in 0..grid.resolution().x() {
            let middle = grid.corner(Voxel::new(i, j, k)) + half;
            let query = ShadowQuery { from: middle, to: position, emitter, kind: QueryKind::Spatial };
            if provers.answer(&query) == Answer::Unoccluded {
                row[i as usize / 64] |= 1 << (i % 64);
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use vdf_render::Quiet;
    use vdf_scene::LoadOptions;
    use vdf_scenes::builtin;

    use super::*;

    #[test]
    fn neighbourhoods_are_those_of_the_method() {
        let scene = Scene::from_source(&builtin("cbox_vol3").unwrap(), &LoadOptions::default()).unwrap();
        let scene = Arc::new(scene);
        let build = |method, voxel_size| {
            let options = PrepareOptions { voxel_size, threads: Some(2), ..PrepareOptions::with_method(method) };
            SceneVoxels::build(Arc::clone(&scene), &options, &Quiet).unwrap()
        };
        for method in Method::with_voxels().chain([Method::NONE]) {
            let voxels = build(method, Some(20.0));
            let counts: Vec<_> = voxels.neighbourhoods.iter().map(|n| n.as_ref().map(VoxelSet::count)).collect();
            assert_eq!(counts.len(), 2);
            for (count, built) in counts.iter().zip(&voxels.build.lights) {
                assert_eq!(count.is_some(), method != Method::NONE, "{method}");
                if method != Method::NONE {
                    assert!(built.voxels.is_none() || built.voxels == *count, "{method}: {built:?} {count:?}");
                }
            }
            for set in voxels.neighbourhoods.iter().flatten() {
                assert!(set.count() > 10 && set.iter().all(|v| !voxels.occupied.contains(v)), "{method}");
            }
        }
        // A method that keeps none has the same as one that does.
        let named = |name: &str| build(name.parse().unwrap(), None).neighbourhoods;
        assert_eq!(named("ndf"), named("ndf-sn"));
        assert_eq!(named("amr"), named("amr-sn"));
    }
}
