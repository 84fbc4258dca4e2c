//! Cost against the number of point lights.

use vdf_render::{Integrator, default_voxel_size};
use vdf_scene::{Emitter, Rgb, Scene};
use vdf_visibility::Method;

use super::{
    measure::{Lab, NEIGHBOURHOODS, method},
    sweep::{Group, Sweep, Unit, halvings},
};
use crate::LabError;

const SCENE: &str = "cbox_vol2";

pub(super) const MAX_LIGHTS: u32 = 1024;

/// Where the lights are: in the upper part of the room, above the blocks.
const CORNERS: [[f64; 3]; 2] = [[30.0, 350.0, 30.0], [520.0, 530.0, 530.0]];

/// Of all lights together.
const INTENSITY: f32 = 300_000.0;

pub(super) fn sizes(most: u32) -> Vec<u64> {
    halvings(1, most.into())
}

/// Light `i`, of the sequence R₃ of Roberts (multiples of powers of 1/g, g⁴ = g + 1): any number of first ones is
/// spread evenly.
fn position(i: u32) -> [f64; 3] {
    const G: f64 = 1.220_744_084_605_759_5;
    let [low, high] = CORNERS;
    std::array::from_fn(|axis| {
        let u = (0.5 + f64::from(i + 1) * G.powi(-(axis as i32 + 1))).fract();
        low[axis] + u * (high[axis] - low[axis])
    })
}

pub(super) fn run(lab: &Lab<'_>) -> Result<Sweep, LabError> {
    let (none, sn, xsn) = (Method::NONE, method("amr-sn"), Method::best_with_voxels());
    let neighbourhoods = [("sn", "amr-sn"), ("xsn", "amr-xsn")];
    let mut build = Group::new("Time to build all neighbourhoods", Unit::Seconds, &neighbourhoods);
    let mut memory = Group::new("Memory of all neighbourhoods", Unit::Bytes, &neighbourhoods);
    let all = [("none", "none"), ("amr-sn", "amr-sn"), ("amr-xsn", "amr-xsn")];
    let mut render = Group::new("Time to render, without building", Unit::Seconds, &all);
    let mut share = Group::new("p_acc|sp", Unit::Share, &all[1..]);
    let scene = lab.builtin(SCENE)?;
    for n in sizes(lab.options.max_lights) {
        lab.step("lights", n);
        let x = n as f64;
        let intensity = Rgb::splat(INTENSITY / x as f32);
        let light = |i| Emitter::Point { position: position(i).into(), intensity };
        let emitters = (0..n as u32).map(light).collect();
        let alone = lab.prepare(Scene { emitters, ..scene.clone() })?;
        let size = default_voxel_size(&alone.world().occluder_bounds);
        let threads = lab.options.threads;
        let builds = lab.builds(&alone, &[sn, xsn], size, threads)?;
        for (name, from) in [("sn", sn), ("xsn", xsn)] {
            build.push(name, x, &builds.seconds(from, NEIGHBOURHOODS));
            memory.push(name, x, &builds.bytes(from, NEIGHBOURHOODS));
        }
        let built = [none, sn, xsn].map(|m| lab.build(&alone, m, size, threads));
        let built = built.into_iter().collect::<Result<Vec<_>, LabError>>()?;
        let renders = lab.renders(&built, threads, &mut None)?;
        for (built, (seconds, statistics)) in built.iter().zip(&renders) {
            render.push(built.method().name(), x, seconds);
            if let Some(p) = statistics.p_accelerated_given_spatial.filter(|_| built.method() != none) {
                share.push(built.method().name(), x, &[p]);
            }
        }
        lab.done();
    }
    Ok(Sweep {
        name: "lights",
        heading: "Lights",
        paragraphs: vec![format!(
            "{SCENE} with point lights in the upper part of the room, which together are as bright as its own; a 128th of the \
             scene's longest side is the side of a voxel. One light is drawn for each sample, so a render asks as many queries of 64 \
             lights as of one; what may grow are misses of the caches. Images of {} × {} pixels, {} samples each; the three methods' were the same bit by bit.",
            lab.options.size, lab.options.size, lab.options.spp
        )],
        against: "lights",
        scene: SCENE,
        integrator: Integrator::Volpath.to_string(),
        groups: vec![build, memory, render, share],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_are_spread_over_the_upper_room() {
        let all: Vec<_> = (0..64).map(position).collect();
        for (i, p) in all.iter().enumerate() {
            assert!((0..3).all(|a| (CORNERS[0][a]..CORNERS[1][a]).contains(&p[a])), "{p:?}");
            let distance = |q: &[f64; 3]| (0..3).map(|a| (p[a] - q[a]).powi(2)).sum::<f64>().sqrt();
            assert!(all[..i].iter().all(|q| distance(q) > 25.0), "{i}");
        }
        for axis in 0..3 {
            let middle = 0.5 * (CORNERS[0][axis] + CORNERS[1][axis]);
            let above = all.iter().filter(|p| p[axis] > middle).count();
            assert!((30..=34).contains(&above), "{above}");
        }
    }
}
