//! `vdf report`: options in, files out. What is measured is in `vdf-lab`.

use std::{env, io::Write as _, path::Path};

use anyhow::Context as _;
use vdf_image::{StagedFile, check_distinct, check_writable, shown};
use vdf_lab::{
    LabError,
    queries::{QueryStream, ReplayOptions, record_queries},
    report::{
        Report,
        convergence::{self, ConvergenceOptions},
        queries,
        scaling::{self, ScalingOptions},
        thesis::{self, ThesisOptions},
    },
};
use vdf_render::{Integrator, PrepareOptions, PreparedScene, RenderOptions, SegmentSamples};
use vdf_visibility::Method;

use super::render::{Named, integrator, load};
use crate::{
    args::{
        Methods, ReportCommand, ReportConvergenceArgs, ReportFiles, ReportQueriesArgs, ReportScalingArgs,
        ReportThesisArgs,
    },
    failure::{Failure, say},
    progress::Reporter,
};

pub(crate) fn run(command: &ReportCommand) -> Result<(), Failure> {
    match command {
        ReportCommand::Queries(args) => run_queries(args),
        ReportCommand::Convergence(args) => run_convergence(args),
        ReportCommand::Scaling(args) => run_scaling(args),
        ReportCommand::Thesis(args) => run_thesis(args),
    }
}

fn run_queries(args: &ReportQueriesArgs) -> Result<(), Failure> {
    let options = ReplayOptions {
        methods: methods(&args.methods),
        voxel_sizes: args.voxel_sizes.clone(),
        passes: args.passes,
        threads: args.threads,
        ..ReplayOptions::default()
    };
    options.validate()?;
    let recorded = RenderOptions {
        integrator: integrator(args.integrator, args.samples_per_segment)?,
        spp: args.spp,
        seed: args.seed,
        threads: args.threads,
        ..RenderOptions::thesis()
    };
    let exported = ["triangles.bin", "queries.bin"].map(|name| args.export.as_ref().map(|folder| folder.join(name)));
    let others = exported.iter().flatten().map(|path| ("--export", path.as_path()));
    args.files.check(&others.chain(args.queries.as_deref().map(|path| ("--queries", path))).collect::<Vec<_>>())?;
    let stream = args.queries.as_deref().map(QueryStream::read).transpose()?;
    let named = load(args.scene.as_deref(), &args.defines, args.sensor)?;
    recorded.validate(&named.scene)?;
    named.check_outputs(&args.files.outputs())?;
    named.warn();
    let Named { name, scene, .. } = named;
    args.files.report(|reporter| {
        let none = PrepareOptions { threads: args.threads, ..PrepareOptions::with_method(Method::NONE) };
        let prepared = PreparedScene::new(scene, &none, reporter)?;
        let stream = match (stream, &args.queries) {
            (Some(stream), Some(path)) => stream.check_scene(path, &prepared).map(|()| stream)?,
            _ => record_queries(&prepared, &recorded, args.max_queries, reporter)?,
        };
        let report = queries::run(&name, &prepared, &stream, &options, reporter)?;
        if let Some(folder) = args.export.as_deref().filter(|_| !reporter.interrupted()) {
            queries::export(folder, &prepared, &stream)?;
        }
        Ok(report)
    })
}

fn run_convergence(args: &ReportConvergenceArgs) -> Result<(), Failure> {
    let standard = if args.quick { ConvergenceOptions::quick() } else { ConvergenceOptions::default() };
    let options = ConvergenceOptions {
        methods: methods(&args.methods),
        voxel_size: args.voxel,
        integrators: integrators(&args.integrator, &args.samples_per_segment)?,
        max_spp: args.max_spp.unwrap_or(standard.max_spp),
        reference_spp: args.reference_spp,
        seeds: args.seeds,
        first_seed: args.seed,
        size: args.size.unwrap_or(standard.size),
        cache: args.cache.clone(),
        threads: args.threads,
        ..standard
    };
    options.validate()?;
    let named = load(args.scene.as_deref(), &args.defines, args.sensor)?;
    args.files.check(&[])?;
    named.check_outputs(&args.files.outputs())?;
    named.warn();
    let Named { name, scene, .. } = named;
    args.files.report(|reporter| convergence::run(&name, scene, &options, reporter))
}

fn run_scaling(args: &ReportScalingArgs) -> Result<(), Failure> {
    let standard = if args.quick { ScalingOptions::quick() } else { ScalingOptions::default() };
    let options = ScalingOptions {
        sweeps: args.only.clone(),
        max_triangles: args.max_triangles.unwrap_or(standard.max_triangles),
        max_voxels_per_side: args.max_voxels_per_side.unwrap_or(standard.max_voxels_per_side),
        max_lights: args.max_lights.unwrap_or(standard.max_lights),
        max_threads: args.max_threads.unwrap_or(standard.max_threads),
        repetitions: args.repetitions.unwrap_or(standard.repetitions),
        size: args.size.unwrap_or(standard.size),
        seed: args.seed,
        threads: args.threads,
        ..standard
    };
    options.validate()?;
    args.files.check(&[])?;
    args.files.report(|reporter| scaling::run(&options, reporter))
}

fn run_thesis(args: &ReportThesisArgs) -> Result<(), Failure> {
    let standard = if args.quick { ThesisOptions::quick() } else { ThesisOptions::default() };
    let options = ThesisOptions {
        scenes: args.scenes.clone(),
        methods: methods(&args.methods),
        size: args.size.unwrap_or(standard.size),
        seed: args.seed,
        threads: args.threads,
        resume: args.resume.clone(),
        ..standard
    };
    options.validate()?;
    args.files.check(&[])?;
    args.files.report(|reporter| thesis::run(&options, reporter))
}

fn methods(choices: &[Methods]) -> Vec<Method> {
    let named = |choice: &Methods| match choice {
        Methods::All => Method::all().collect(),
        Methods::One(method) => vec![*method],
    };
    choices.iter().flat_map(named).collect()
}

/// The integrators that two options name together: each name with each number of samples, if it takes any.
fn integrators(names: &[Integrator], all_samples: &[SegmentSamples]) -> Result<Vec<Integrator>, Failure> {
    // Samples that no integrator takes are a mistake.
    if names.iter().all(|name| name.samples_per_segment().is_none()) {
        names.first().map(|&name| integrator(name, all_samples.first().copied())).transpose()?;
    }
    let with_samples = |&name: &Integrator| {
        let with: Vec<_> = all_samples.iter().filter_map(|&n| name.with_samples_per_segment(n)).collect();
        if with.is_empty() { vec![name] } else { with }
    };
    Ok(names.iter().flat_map(with_samples).collect())
}

impl ReportFiles {
    fn named(&self) -> impl Iterator<Item = (&str, &Path)> {
        let all = [("--html", &self.html), ("--csv", &self.csv), ("--json", &self.json)];
        all.into_iter().filter_map(|(option, path)| Some((option, path.as_deref()?)))
    }

    fn outputs(&self) -> Vec<(&str, &Path)> {
        self.named().collect()
    }

    /// Fails now rather than after an hour of measuring: if a file cannot be written, or would replace another that this run writes or reads.
    fn check<'a>(&'a self, others: &[(&'a str, &'a Path)]) -> Result<(), Failure> {
        let all: Vec<_> = others.iter().copied().chain(self.named()).collect();
        check_distinct(&all, &[]).map_err(|conflict| Failure::Usage(conflict.into()))?;
        for (_, path) in self.named() {
            check_writable(path).with_context(|| format!("cannot write {}", shown(path))).map_err(Failure::Work)?;
        }
        Ok(())
    }

    /// Measures, writes the files that were asked for, all or none of them, and then the tables to stdout.
    fn report(&self, measure: impl FnOnce(&Reporter) -> Result<Report, LabError>) -> Result<(), Failure> {
        let reporter = Reporter::new(self.quiet)?;
        let report = measure(&reporter);
        reporter.finish();
        let mut report = report?;
        if reporter.interrupted() {
            return Err(Failure::Interrupted);
        }
        reporter.writes();
        report.provenance.set_command(env::args_os());
        report.warnings.iter().for_each(|warning| say(format_args!("warning: {warning}")));
        let mut staged = Vec::new();
        for (option, path) in self.named() {
            let content = match option {
                "--html" => report.html(),
                "--csv" => report.csv(),
                _ => report.json(),
            }?;
            let file = StagedFile::write(path, |out| out.write_all(content.as_bytes()));
            let file = file.with_context(|| format!("cannot write {}", shown(path))).map_err(Failure::Work)?;
            staged.push(file);
        }
        StagedFile::persist_all(staged).map_err(|error| Failure::Work(error.into()))?;
        let stdout = &mut std::io::stdout().lock();
        write!(stdout, "{}", report.text())?;
        for (_, path) in self.named() {
            writeln!(stdout, "wrote {}", shown(path))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;
    use vdf_lab::report::REPORTS;

    use super::*;
    use crate::args::Arguments;

    #[test]
    fn the_command_line_has_the_reports_of_the_library() {
        let command = Arguments::command();
        let reports = command.find_subcommand("report").unwrap().get_subcommands();
        let found: Vec<_> = reports.map(|c| (c.get_name().to_owned(), c.get_about().unwrap().to_string())).collect();
        assert_eq!(found, REPORTS.map(|r| (r.name.to_owned(), r.about.to_owned())));
    }

    #[test]
    fn two_options_name_integrators() {
        let [volpath, raymarch] = [Integrator::Volpath, Integrator::raymarch(7)];
        assert_eq!(integrators(&[volpath, raymarch], &[]).unwrap(), [volpath, raymarch]);
        let [one, three] = [1, 3].map(Integrator::raymarch);
        assert_eq!(
            integrators(&[raymarch, volpath], &[1, 3].map(SegmentSamples::Count)).unwrap(),
            [one, three, volpath]
        );
        assert!(matches!(integrators(&[volpath], &[SegmentSamples::Count(3)]), Err(Failure::Usage(_))));
    }
}
