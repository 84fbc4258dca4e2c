//! Cost against the number of triangles.

use vdf_geometry::Triangle;
use vdf_render::default_voxel_size;
use vdf_scene::{Scene, SceneSource};
use vdf_scenes::{GeneratedScene, generated};
use vdf_visibility::{Method, QueryKind};

use super::{
    super::words::grid,
    measure::{FIELD, Lab, NEIGHBOURHOODS, RECORDED, methods},
    sweep::{Group, Sweep, Unit, halvings},
};
use crate::{LabError, queries::Timing};

const SCENE: &str = "san-miguel";

/// The generator makes no fewer: it could not make all of the court.
pub(super) const MIN_TRIANGLES: u64 = GeneratedScene::MIN_TRIANGLES as u64;
pub(super) const MAX_TRIANGLES: u64 = GeneratedScene::MAX_TRIANGLES as u64;

/// The parts of [`refine`]d boxes; a split makes four of one.
const REFINED: &str = "cbox_vol2";
const MIN_SPLITS: u32 = 4;

const FIELDS: [&str; 4] = ["ndf", "amr-xsn", "dsz", "dual"];
const REPLAYED: [&str; 2] = ["amr", "amr-xsn"];

pub(super) fn sizes(most: u64) -> Vec<u64> {
    halvings(MIN_TRIANGLES, most)
}

/// Shapes get finer and there are more of them: a scene that is made with more detail.
pub(super) fn run(lab: &Lab<'_>) -> Result<Sweep, LabError> {
    let mut curves = Curves::new();
    for n in sizes(lab.options.max_triangles) {
        lab.step("triangles", n);
        let scene = generated(SCENE).ok_or_else(|| LabError::UnknownScene(SCENE.to_owned()))?;
        let scene = scene.with_triangles(u32::try_from(n).unwrap_or(u32::MAX))?;
        curves.measure(lab, lab.load(&SceneSource::from(scene))?)?;
        lab.done();
    }
    let paragraphs = vec![
        format!(
            "{SCENE} generated in several sizes, from {MIN_TRIANGLES} triangles, the fewest of which the court can be made; in {} voxels \
             whatever its size. Shapes get finer and leaves more: neither the occupied voxels nor p_acc|sp are the same in all sizes. xsn is the neighbourhood of its one point light.",
            curves.grid
        ),
        "Fields know voxels only, not triangles: their times should not grow. The time of a query grows as the tree gets deeper and the caches get too small, \
         not as a power; its exponent says how slowly."
            .to_owned(),
    ];
    Ok(curves.sweep("triangles", "Triangles", SCENE, paragraphs))
}

/// How often each triangle is split, for each size.
pub(super) fn splits(most: u64) -> Vec<u32> {
    // 30 triangles, of the room and its two blocks.
    (MIN_SPLITS..).take_while(|&k| 30 << (2 * k) <= most).collect()
}

/// The same shapes in more and more triangles: nothing else changes.
pub(super) fn run_refined(lab: &Lab<'_>) -> Result<Sweep, LabError> {
    let mut curves = Curves::new();
    for k in splits(lab.options.max_triangles) {
        let mut scene = lab.builtin(REFINED)?;
        for surface in &mut scene.surfaces {
            surface.triangles = (0..k).fold(std::mem::take(&mut surface.triangles), |all, _| refine(&all));
        }
        lab.step("refined", scene.surfaces.iter().map(|s| s.triangles.len()).sum::<usize>());
        curves.measure(lab, scene)?;
        lab.done();
    }
    let paragraphs = vec![format!(
        "{REFINED}, each of whose triangles is split into four at the middles of its edges, again and again; in {} voxels. The shapes are the same in all sizes, \
         so the occupied voxels and p_acc|sp are too, but for the rounding of vertices.",
        curves.grid
    )];
    Ok(curves.sweep("refined", "Triangles of the same shapes", REFINED, paragraphs))
}

/// Four triangles of each.
fn refine(triangles: &[Triangle]) -> Vec<Triangle> {
    let four = |t: &Triangle| {
        let [a, b, c] = t.vertices;
        let [ab, bc, ca] = [a.midpoint(b), b.midpoint(c), c.midpoint(a)];
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]].map(|[a, b, c]| Triangle::new(a, b, c))
    };
    triangles.iter().flat_map(four).collect()
}

/// Everything that is measured in scenes of several sizes.
struct Curves {
    build: Group,
    memory: Group,
    query: Group,
    share: Group,
    /// Resolution of the last.
    grid: String,
}

impl Curves {
    fn new() -> Self {
        let build = [
            ("hierarchy", ""),
            ("voxelization", ""),
            ("ndf", "ndf"),
            ("amr", "amr"),
            ("dsz", "dsz"),
            ("dual", "dual"),
            ("xsn", "amr-xsn"),
        ];
        let query = [
            ("t_query, hierarchy", "none"),
            ("t_acc, amr", "amr"),
            ("t_acc, amr-xsn", "amr-xsn"),
            ("t_eff, amr", "amr"),
            ("t_eff, amr-xsn", "amr-xsn"),
        ];
        let share = [("occupied", ""), ("amr", "amr"), ("amr-xsn", "amr-xsn")];
        Self {
            build: Group::new("Time to build", Unit::Seconds, &build),
            memory: Group::new("Memory", Unit::Bytes, &[("hierarchy", ""), ("amr-xsn, all", "amr-xsn")]),
            query: Group::new("A spatial query", Unit::Nanoseconds, &query),
            share: Group::new("Occupied voxels, and p_acc|sp", Unit::Share, &share),
            grid: String::new(),
        }
    }

    fn measure(&mut self, lab: &Lab<'_>, scene: Scene) -> Result<(), LabError> {
        let Self { build, memory, query, share, grid: resolution } = self;
        let alone = lab.prepare(scene)?;
        let world = alone.world();
        let x = world.triangles.len() as f64;
        let size = default_voxel_size(&world.occluder_bounds);
        let threads = lab.options.threads;
        build.push("hierarchy", x, &lab.hierarchies(world, threads)?);
        memory.push("hierarchy", x, &[world.bvh.bytes() as f64]);

        let fields = methods(FIELDS);
        let builds = lab.builds(&alone, &fields, size, threads)?;
        build.push("voxelization", x, &builds.voxelization());
        for field in fields {
            let name = field.name().split('-').next().unwrap_or_default();
            build.push(name, x, &builds.seconds(field, FIELD));
        }
        let xsn = Method::best_with_voxels();
        build.push("xsn", x, &builds.seconds(xsn, NEIGHBOURHOODS));
        memory.push("amr-xsn, all", x, &[builds.all_bytes(xsn)]);

        share.push("occupied", x, &[builds.occupied_share()]);

        let replay = lab.replay(&alone, &methods(REPLAYED), size)?;
        let timing = |t: Timing| [t.min, t.median, t.max];
        let spatial = replay.hierarchy.class(QueryKind::Spatial).map(|c| timing(c.time));
        query.push("t_query, hierarchy", x, &spatial.unwrap_or_default());
        for (m, p) in replay.methods.iter().filter_map(|m| Some((m, m.spatial()?))) {
            query.push(&format!("t_acc, {}", m.method), x, &timing(p.t_acc));
            query.push(&format!("t_eff, {}", m.method), x, &timing(p.t_effective));
            share.push(m.method, x, &[p.p_accelerated]);
            *resolution = grid(m.grid);
        }
        Ok(())
    }

    fn sweep(self, name: &'static str, heading: &'static str, scene: &'static str, paragraphs: Vec<String>) -> Sweep {
        Sweep {
            name,
            heading,
            paragraphs,
            against: "triangles",
            scene,
            integrator: RECORDED.to_string(),
            groups: vec![self.build, self.memory, self.query, self.share],
        }
    }
}

#[cfg(test)]
mod tests {
    use vdf_scene::LoadOptions;
    use vdf_scenes::builtin;

    use super::*;

    #[test]
    fn a_refined_box_is_the_same_box() {
        let scene = Scene::from_source(&builtin(REFINED).unwrap(), &LoadOptions::default()).unwrap();
        let all: Vec<_> = scene.surfaces.iter().flat_map(|s| s.triangles.iter().copied()).collect();
        assert_eq!(all.len(), 30);
        let area = |all: &[Triangle]| all.iter().map(|t| t.area_normal().length()).sum::<f64>();
        let finer = refine(&refine(&all));
        assert_eq!(finer.len(), 16 * 30);
        assert!((area(&finer) / area(&all) - 1.0).abs() < 1e-6);
        for (old, new) in all.iter().zip(finer.chunks(16)) {
            let facing = |t: &Triangle| t.area_normal().normalize().dot(old.area_normal().normalize());
            assert!(new.iter().all(|t| facing(t) > 1.0 - 1e-6));
        }
        assert_eq!(splits(400_000), [4, 5, 6]);
        assert_eq!(splits(10_000_000), [4, 5, 6, 7, 8, 9]);
    }
}
