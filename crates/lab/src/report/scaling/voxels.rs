//! Cost against the number of voxels.

use vdf_visibility::{Method, QueryKind};

use super::{
    measure::{FIELD, Lab, NEIGHBOURHOODS, RECORDED, VOXELS, method, methods},
    sweep::{Group, Sweep, Unit, halvings},
};
use crate::{LabError, queries::Timing};

const SCENE: &str = "cbox_vol2";

pub(super) const MIN_SIDE: u32 = 32;
pub(super) const MAX_SIDE: u32 = 512;

/// Of each field once, of the neighbourhoods both kinds.
const BUILT: [&str; 5] = ["ndf", "amr-sn", "amr-xsn", "dsz", "dual"];
const REPLAYED: [&str; 6] = ["ndf", "amr", "dsz", "dual", "amr-sn", "amr-xsn"];

/// Sides of cubes.
pub(super) fn sizes(most: u32) -> Vec<u64> {
    halvings(MIN_SIDE.into(), most.into())
}

pub(super) fn run(lab: &Lab<'_>) -> Result<Sweep, LabError> {
    let built = methods(BUILT);
    let (sn, xsn) = (method("amr-sn"), Method::best_with_voxels());
    let structures =
        [("ndf", "ndf"), ("amr", "amr"), ("dsz", "dsz"), ("dual", "dual"), ("sn", "amr-sn"), ("xsn", "amr-xsn")];
    let with = |first: &'static str| [&[(first, "")], &structures[..]].concat();
    let mut build = Group::new("Time to build", Unit::Seconds, &with("voxelization"));
    let mut memory = Group::new("Memory", Unit::Bytes, &with("occupancy"));
    let lines: Vec<_> = REPLAYED.iter().map(|&m| (m, m)).collect();
    let mut acc = Group::new("t_acc, the attempt of a proof", Unit::Nanoseconds, &lines);
    let mut effective =
        Group::new("t_eff, a spatial query", Unit::Nanoseconds, &[&[("hierarchy alone", "none")], &lines[..]].concat());
    let mut share = Group::new("p_acc|sp", Unit::Share, &lines);

    let scene = lab.builtin(SCENE)?;
    let alone = lab.prepare(scene)?;
    let volume = alone.world().occluder_bounds.extent().element_product();
    for n in sizes(lab.options.max_voxels_per_side) {
        lab.step("voxels", format_args!("{n}³"));
        let size = volume.cbrt() / n as f64;
        let builds = lab.builds(&alone, &built, size, lab.options.threads)?;
        let x = builds.voxels() as f64;
        build.push("voxelization", x, &builds.voxelization());
        memory.push("occupancy", x, &builds.bytes(sn, VOXELS));
        let fields = [("ndf", "ndf"), ("amr", "amr-sn"), ("dsz", "dsz"), ("dual", "dual")];
        for (name, from) in fields {
            build.push(name, x, &builds.seconds(method(from), FIELD));
            memory.push(name, x, &builds.bytes(method(from), FIELD));
        }
        for (name, from) in [("sn", sn), ("xsn", xsn)] {
            build.push(name, x, &builds.seconds(from, NEIGHBOURHOODS));
            memory.push(name, x, &builds.bytes(from, NEIGHBOURHOODS));
        }
        let replay = lab.replay(&alone, &methods(REPLAYED), size)?;
        let timing = |t: Timing| [t.min, t.median, t.max];
        let alone = replay.hierarchy.class(QueryKind::Spatial).map(|c| timing(c.time));
        effective.push("hierarchy alone", x, &alone.unwrap_or_default());
        for (m, p) in replay.methods.iter().filter_map(|m| Some((m, m.spatial()?))) {
            acc.push(m.method, x, &timing(p.t_acc));
            effective.push(m.method, x, &timing(p.t_effective));
            share.push(m.method, x, &[p.p_accelerated]);
        }
        lab.done();
    }
    Ok(Sweep {
        name: "voxels",
        heading: "Voxels",
        paragraphs: vec![
            format!(
                "{SCENE}, {} triangles and one point light, in as many voxels as cubes of {MIN_SIDE} and more a side. Exponents are against the number of \
                 voxels, not against the side. sn and xsn are the neighbourhoods of the light, on top of the field.",
                alone.world().triangles.len()
            ),
            "Occupied voxels are a surface, so their share falls as voxels get smaller, and most of p_acc|sp rise. What grows in t_acc is the number of hops \
             and the share of the accesses that miss the caches; the hierarchy alone is the same at all sizes and shows the noise."
                .to_owned(),
        ],
        against: "voxels",
        scene: SCENE,
        integrator: RECORDED.to_string(),
        groups: vec![build, memory, acc, effective, share],
    })
}
