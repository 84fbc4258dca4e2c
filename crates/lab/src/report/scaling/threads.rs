//! Time against the number of threads.

use vdf_render::Integrator;
use vdf_visibility::Method;

use super::{
    measure::{FIELD, Lab, method},
    sweep::{Group, Sweep, Unit, halvings},
};
use crate::LabError;

const SCENE: &str = "san-miguel";

/// Every number up to eight, then by doubling.
pub(super) fn sizes(most: usize) -> Vec<usize> {
    if most <= 8 {
        return (1..=most).collect();
    }
    halvings(9, most as u64).into_iter().map(|n| n as usize).fold((1..=8).collect(), |mut all, n| {
        all.push(n);
        all
    })
}

const FIELDS: [(&str, &str); 4] = [("ndf", "ndf"), ("amr", "amr-xsn"), ("dsz", "dsz"), ("dual", "dual")];

pub(super) fn run(lab: &Lab<'_>) -> Result<Sweep, LabError> {
    let xsn = Method::best_with_voxels();
    let mut time = Group::new(
        "Time",
        Unit::Seconds,
        &[
            ("hierarchy", ""),
            ("voxelization", ""),
            ("ndf", "ndf"),
            ("amr", "amr"),
            ("dsz", "dsz"),
            ("dual", "dual"),
            ("render, none", "none"),
            ("render, amr-xsn", "amr-xsn"),
        ],
    );
    let scene = lab.builtin(SCENE)?;
    let alone = lab.prepare(scene)?;
    let size = alone.world().occluder_bounds.extent().max_element() / f64::from(lab.options.voxels_for_threads);
    let mut image = None;
    let mut proved = None;
    let methods = FIELDS.map(|(_, from)| method(from));
    for threads in sizes(lab.options.max_threads) {
        lab.step("threads", threads);
        let x = threads as f64;
        time.push("hierarchy", x, &lab.hierarchies(alone.world(), Some(threads))?);
        let builds = lab.builds(&alone, &methods, size, Some(threads))?;
        time.push("voxelization", x, &builds.voxelization());
        for ((name, _), &field) in FIELDS.iter().zip(&methods) {
            time.push(name, x, &builds.seconds(field, FIELD));
        }
        let built = [Method::NONE, xsn].map(|m| lab.build(&alone, m, size, Some(threads)));
        let built = built.into_iter().collect::<Result<Vec<_>, LabError>>()?;
        let renders = lab.renders(&built, Some(threads), &mut image)?;
        for (name, (seconds, statistics)) in ["render, none", "render, amr-xsn"].into_iter().zip(&renders) {
            time.push(name, x, seconds);
            if statistics.method == xsn.name() {
                // Proofs do not show in the image; a field that is not the same shows in their number.
                let expected = *proved.get_or_insert(statistics.proved);
                if statistics.proved != expected {
                    return Err(LabError::WrongProofs { threads, found: statistics.proved, expected });
                }
            }
        }
        lab.done();
    }
    let efficiency = time.efficiency("Efficiency: the time of one thread / (threads × time)");
    Ok(Sweep {
        name: "threads",
        heading: "Threads",
        paragraphs: vec![format!(
            "{SCENE}, {} triangles, its longest side {} voxels; images of {} × {} pixels, {} samples each. With threads that do not wait for \
             each other the exponent is -1 and the efficiency 1. All images were the same bit by bit, and amr-xsn proved the same number of queries.",
            alone.world().triangles.len(),
            lab.options.voxels_for_threads,
            lab.options.size,
            lab.options.size,
            lab.options.spp
        )],
        against: "threads",
        scene: SCENE,
        integrator: Integrator::Volpath.to_string(),
        groups: vec![time, efficiency],
    })
}

#[cfg(test)]
mod tests {
    use super::sizes;

    #[test]
    fn numbers_of_threads() {
        assert_eq!(sizes(1), [1]);
        assert_eq!(sizes(6), [1, 2, 3, 4, 5, 6]);
        assert_eq!(sizes(12), [1, 2, 3, 4, 5, 6, 7, 8, 12]);
        assert_eq!(sizes(64), [1, 2, 3, 4, 5, 6, 7, 8, 16, 32, 64]);
    }
}
