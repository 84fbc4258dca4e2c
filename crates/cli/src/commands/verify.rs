//! `vdf verify`.

use std::io::Write as _;

use anyhow::{Context as _, anyhow};
use vdf_image::{check_writable, shown};
use vdf_lab::verify::{VerifyOptions, VerifyReport, verify};
use vdf_visibility::Method;

use crate::{
    args::{Methods, VerifyArgs},
    commands::render::{load, write_json},
    failure::Failure,
    progress::Reporter,
};

pub(crate) fn run(args: &VerifyArgs) -> Result<(), Failure> {
    let options = options(args);
    options.validate()?;
    let named = load(args.scene.as_deref(), &args.defines, args.sensor)?;
    named.warn();
    if let Some(path) = &args.stats {
        named.check_outputs(&[("--stats", path)])?;
        check_writable(path).with_context(|| format!("cannot write {}", shown(path))).map_err(Failure::Work)?;
    }

    let reporter = Reporter::new(args.quiet)?;
    let report = verify(named.scene, &options, &reporter);
    reporter.finish();
    let report = report?;
    reporter.writes();
    if reporter.interrupted() {
        return Err(Failure::Interrupted);
    }

    if let Some(path) = &args.stats {
        write_json(path, &report)?;
    }
    writeln!(std::io::stdout(), "{report}")?;
    verdict(&report)
}

fn options(args: &VerifyArgs) -> VerifyOptions {
    let mut methods: Vec<Method> = Vec::new();
    for choice in &args.methods {
        match choice {
            Methods::All => methods.extend(Method::proving()),
            Methods::One(method) => methods.push(*method),
        }
    }
    // Each method once, in the order given.
    let methods = methods.iter().enumerate().filter(|(i, m)| !methods[..*i].contains(m)).map(|(_, m)| *m).collect();
    VerifyOptions {
        methods,
        voxel_sizes: args.voxel_sizes.clone(),
        grid: args.grid.into(),
        segments: args.segments,
        seed: args.seed,
        threads: args.threads,
        ..VerifyOptions::default()
    }
}

/// The report is out; what remains is the exit code.
fn verdict(report: &VerifyReport) -> Result<(), Failure> {
    if report.is_sound() {
        return Ok(());
    }
    Err(Failure::Work(anyhow!(
        "{} of {} proofs are wrong; the references disagree on {} segments",
        report.total.wrong,
        report.total.proofs,
        report.checks.disagreements + report.checks.curved_disagreements
    )))
}

#[cfg(test)]
mod tests {
    use std::process::ExitCode;

    use vdf_lab::verify::{Checks, Tally};

    use super::*;

    fn report(wrong: u64, disagreements: u64, curved_disagreements: u64) -> VerifyReport {
        VerifyReport {
            version: "0",
            seed: 0,
            threads: 1,
            triangles: 1,
            grids: vec![],
            seconds: 1.0,
            classes: vec![],
            total: Tally { segments: 9, proved: 5, proofs: 7, wrong },
            methods: vec![],
            checks: Checks { disagreements, curved_disagreements, ..Checks::default() },
            failures: vec![],
        }
    }

    #[test]
    fn a_wrong_proof_or_a_disagreement_fails_with_1() {
        assert!(verdict(&report(0, 0, 0)).is_ok());
        for report in [report(2, 0, 0), report(0, 1, 0), report(0, 0, 1)] {
            assert_eq!(verdict(&report).unwrap_err().report(), ExitCode::from(1));
        }
    }
}
