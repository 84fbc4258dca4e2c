//! Cost against the number of triangles.

use vdf_render::scene::{GeneratedScene, SceneSource, generated};
use vdf_render::{Method, default_voxel_size};

use super::{
    measure::{Lab, Phase, SAMPLES_PER_SEGMENT, methods},
    sweep::{Group, Sweep, Unit, halvings},
};
use crate::failure::Failure;
use anyhow::anyhow;

const SCENE: &str = "san-miguel";

/// The generator makes no fewer: it could not make all of the court.
pub(super) const LEAST: u64 = GeneratedScene::MIN_TRIANGLES as u64;
pub(super) const MOST: u64 = GeneratedScene::MAX_TRIANGLES as u64;

const FIELDS: [&str; 4] = ["ndf", "amr-xsn", "dsz", "dual"];
const REPLAYED: [&str; 2] = ["amr", "amr-xsn"];

pub(super) fn sizes(most: u64) -> Vec<u64> {
    halvings(LEAST, most)
}

pub(super) fn run(lab: &Lab<'_>) -> Result<Sweep, Failure> {
    let fields = methods(&FIELDS)?;
    let replayed = methods(&REPLAYED)?;
    let mut build = Group::new(
        "Time to build",
        Unit::Seconds,
        &[
            ("hierarchy", ""),
            ("voxelization", ""),
            ("ndf", "ndf"),
            ("amr", "amr"),
            ("dsz", "dsz"),
            ("dual", "dual"),
            ("xsn", "amr-xsn"),
        ],
    );
    let mut memory = Group::new("Memory", Unit::Bytes, &[("hierarchy", ""), ("amr-xsn, all", "amr-xsn")]);
    let mut query = Group::new(
        "A spatial query",
        Unit::Nanoseconds,
        &[
            ("t_query, hierarchy", "none"),
            ("t_acc, amr", "amr"),
            ("t_acc, amr-xsn", "amr-xsn"),
            ("t_eff, amr", "amr"),
            ("t_eff, amr-xsn", "amr-xsn"),
        ],
    );
    let mut share = Group::new(
        "Occupied voxels, and p_acc|sp",
        Unit::Share,
        &[("occupied", ""), ("amr", "amr"), ("amr-xsn", "amr-xsn")],
    );
    let mut grid = String::new();
    for n in sizes(lab.settings.max_triangles) {
        lab.step("triangles", n);
        let scene = generated(SCENE).ok_or_else(|| Failure::Work(anyhow!("no scene is called '{SCENE}'")))?;
        let scene = lab.load(&SceneSource::from(scene.with_triangles(u32::try_from(n).unwrap_or(u32::MAX))?))?;
        let ready = lab.ready(scene);
        let x = ready.world.triangles.len() as f64;
        let size = default_voxel_size(ready.world.bounds);
        build.push("hierarchy", x, &lab.hierarchies(&ready.world, &lab.pool)?);
        memory.push("hierarchy", x, &[ready.world.bvh.bytes() as f64]);

        let builds = lab.builds(&ready, &fields, size, &lab.pool)?;
        build.push("voxelization", x, &builds.voxelization());
        for &field in &fields {
            let name = field.name().split('-').next().unwrap_or_default();
            build.push(name, x, &builds.seconds(field, Phase::Field));
        }
        let xsn = Method::default();
        build.push("xsn", x, &builds.seconds(xsn, Phase::Neighbourhoods));
        let bytes = [Phase::Voxels, Phase::Field, Phase::Neighbourhoods].map(|p| builds.bytes(xsn, p));
        memory.push("amr-xsn, all", x, &[bytes.iter().flatten().sum()]);

        share.push("occupied", x, &[builds.occupied_share()]);

        let replay = lab.replay(&ready, &replayed, size)?;
        let timing = |t: vdf_render::queries::Timing| [t.min, t.median, t.max];
        query.push("t_query, hierarchy", x, &timing(replay.hierarchy.t_spatial));
        for m in &replay.methods {
            query.push(&format!("t_acc, {}", m.method), x, &timing(m.t_acc));
            query.push(&format!("t_eff, {}", m.method), x, &timing(m.t_effective));
            share.push(m.method, x, &[m.p_accelerated_given_spatial]);
            grid = super::grid(m.grid);
        }
        lab.done();
    }
    Ok(Sweep {
        name: "triangles",
        heading: "Triangles",
        paragraphs: vec![
            format!(
                "{SCENE} generated in several sizes, from {LEAST} triangles, the fewest of which the court can be made; in {grid} voxels \
                 whatever its size. Shapes get finer and leaves more: neither the occupied voxels nor p_acc|sp are the same in all sizes. xsn is the neighbourhood of its one point light."
            ),
            "Fields know voxels only, not triangles: their times should not grow. The time of a query grows as the tree gets deeper and the caches get too small, \
             not as a power; its exponent says how slowly."
                .to_owned(),
        ],
        against: "triangles",
        scene: SCENE,
        integrator: super::integrator_name(Some(SAMPLES_PER_SEGMENT)),
        groups: vec![build, memory, query, share],
    })
}
