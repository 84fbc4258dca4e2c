//! Time against the number of threads.

use anyhow::anyhow;
use vdf_render::Method;

use super::{
    super::bench::pool,
    measure::{Lab, Phase, method},
    sweep::{Group, Sweep, Unit, halvings},
};
use crate::failure::Failure;

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

pub(super) fn run(lab: &Lab<'_>) -> Result<Sweep, Failure> {
    let xsn = Method::default();
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
    let ready = lab.ready(scene);
    let (min, max) = ready.world.bounds;
    let size = (max - min).max_element() / f64::from(lab.settings.voxels_for_threads);
    let mut image = None;
    let mut proved = None;
    let methods = FIELDS.iter().map(|(_, from)| method(from)).collect::<Result<Vec<_>, Failure>>()?;
    for threads in sizes(lab.settings.max_threads) {
        lab.step("threads", threads);
        let x = threads as f64;
        let pool = pool(Some(threads))?;
        time.push("hierarchy", x, &lab.hierarchies(&ready.world, &pool)?);
        let builds = lab.builds(&ready, &methods, size, &pool)?;
        time.push("voxelization", x, &builds.voxelization());
        for ((name, _), &field) in FIELDS.iter().zip(&methods) {
            time.push(name, x, &builds.seconds(field, Phase::Field));
        }
        let built = [Method::None, xsn].map(|m| lab.build(&ready, m, size, &pool));
        let built = built.into_iter().collect::<Result<Vec<_>, Failure>>()?;
        let renders = lab.renders(&ready, &built, Some(threads), &mut image)?;
        for (name, (seconds, statistics)) in ["render, none", "render, amr-xsn"].into_iter().zip(&renders) {
            time.push(name, x, seconds);
            if statistics.method == xsn.name() {
                // Proofs do not show in the image; a field that is not the same shows in their number.
                let expected = *proved.get_or_insert(statistics.proved);
                if statistics.proved != expected {
                    return Err(Failure::Work(anyhow!(
                        "WRONG PROOFS: {threads} threads prove {} queries, one thread {expected}. Please report it with this command",
                        statistics.proved
                    )));
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
            ready.world.triangles.len(),
            lab.settings.voxels_for_threads,
            lab.settings.size,
            lab.settings.size,
            lab.settings.spp
        )],
        against: "threads",
        scene: SCENE,
        integrator: super::integrator_name(None),
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
