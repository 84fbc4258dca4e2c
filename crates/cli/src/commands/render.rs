//! `vdf render`.

use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

use anyhow::{Context as _, anyhow};
use serde::Serialize;
use vdf_image::{
    AttributeValue, ComponentFormat, ExrOptions, StagedFile, check_distinct, check_writable, shown, stage_exr_with,
    stage_png,
};
use vdf_lab::queries::{QueryStream, record_queries};
use vdf_render::{
    Estimator, Integrator, PrepareOptions, PreparedScene, RenderOptions, Rendering, Roulette, SamplerKind, Statistics,
    TransmittanceEstimator,
};
use vdf_scene::{LoadOptions, Scene, SceneSource};
use vdf_scenes::{DEFAULT_SCENE, builtin, builtin_names};
use vdf_visibility::Method;

use crate::{
    args::{EstimatorName, RenderArgs, RouletteName, SamplerName, TransmittanceName},
    failure::{Failure, say},
    progress::Reporter,
};

pub(crate) fn run(args: &RenderArgs) -> Result<(), Failure> {
    let options = options(args)?;
    let prepare = PrepareOptions {
        // Proofs of flights need a field, whatever the lights.
        method: args.method.or_else(|| args.segment_first.then(Method::best_with_voxels)),
        voxel_size: args.voxel,
        grid: args.grid.into(),
        texels: args.light_buffer.and_then(|texels| texels.0),
        threads: args.threads,
        ..PrepareOptions::default()
    };
    prepare.validate()?;
    let named = load(args.scene.as_deref(), &args.defines, args.sensor)?;
    options.validate(&named.scene)?;
    let output = output(args, &named)?;
    named.warn();
    let Named { name, scene, .. } = named;

    let reporter = Reporter::new(args.quiet)?;
    let prepared = PreparedScene::new(scene, &prepare, &reporter)?;
    prepared.notes().iter().for_each(|note| say(format_args!("note: {note}")));
    let rendering = prepared.render(&options, &reporter);
    let stream = match (&rendering, &args.record_queries) {
        (Ok(_), Some(_)) => Some(record_queries(&prepared, &options, args.max_queries, &reporter)).transpose(),
        _ => Ok(None),
    };
    reporter.finish();
    let (rendering, stream) = (rendering?, stream?);
    reporter.writes();
    // A Ctrl-C after the last tile: the promise is that nothing is written.
    if reporter.interrupted() {
        return Err(Failure::Interrupted);
    }

    if args.quiet && rendering.statistics.refused > 0 {
        say(format_args!(
            "warning: {} samples were not finite or negative and were left out",
            rendering.statistics.refused
        ));
    }
    let attributes = attributes(&rendering.statistics, &name, prepared.scene());
    write_all(&rendering, &output, args, prepared.scene(), &attributes)?;
    // Last, so that queries do not stay without their picture.
    if let (Some(path), Some(stream)) = (&args.record_queries, &stream) {
        write_stream(path, stream)?;
    }
    let stdout = &mut std::io::stdout();
    if !args.quiet {
        writeln!(stdout, "{}", rendering.statistics)?;
        writeln!(stdout, "wrote          {} and {}", shown(&output.exr), shown(&output.png))?;
        if let (Some(path), Some(stream)) = (&args.record_queries, &stream) {
            let (n, paths) = (stream.queries.len(), stream.origin.paths_recorded);
            writeln!(stdout, "recorded       {n} queries of {paths} paths in {}", shown(path))?;
        }
    }
    Ok(())
}

/// Where results go.
struct Output {
    exr: PathBuf,
    png: PathBuf,
}

/// Writes recorded queries.
pub(super) fn write_stream(path: &Path, stream: &QueryStream) -> Result<(), Failure> {
    stream.write(path).with_context(|| format!("cannot write {}", shown(path))).map_err(Failure::Work)
}

/// The integrator with its samples per segment, if it takes any.
pub(super) fn integrator(integrator: Integrator, samples_per_segment: Option<u32>) -> Result<Integrator, Failure> {
    let Some(n) = samples_per_segment else { return Ok(integrator) };
    integrator
        .with_samples_per_segment(n)
        .ok_or_else(|| Failure::Usage(anyhow!("--samples-per-segment goes with --integrator raymarch only")))
}

fn options(args: &RenderArgs) -> Result<RenderOptions, Failure> {
    if args.max_queries == 0 {
        return Err(Failure::Usage(anyhow!("--max-queries must be at least 1")));
    }
    Ok(RenderOptions {
        integrator: integrator(args.integrator, args.samples_per_segment)?,
        transmittance: match args.transmittance {
            TransmittanceName::Analytic => TransmittanceEstimator::Analytic,
            TransmittanceName::Analog => TransmittanceEstimator::Analog,
        },
        roulette: match args.roulette {
            RouletteName::Standard => Roulette::Standard,
            RouletteName::Thesis => Roulette::Thesis,
        },
        estimator: match args.estimator {
            EstimatorName::Thesis => Estimator::Thesis,
            EstimatorName::Equiangular => Estimator::Equiangular,
            EstimatorName::Lit => Estimator::Lit,
        },
        sampler: match args.sampler {
            SamplerName::Independent => SamplerKind::Independent,
            SamplerName::Sobol => SamplerKind::Sobol,
        },
        spp: args.spp,
        seed: args.seed,
        threads: args.threads,
        crop: args.crop,
        segment_first: args.segment_first,
    })
}

/// A scene as the command line names it.
pub(super) struct Named {
    pub(super) name: String,
    pub(super) scene: Scene,
    /// The files that it was read from; none for a built-in scene.
    pub(super) inputs: Vec<PathBuf>,
}

impl Named {
    /// Fails if one of the outputs would replace a file of the scene, or another output.
    pub(super) fn check_outputs(&self, outputs: &[(&str, &Path)]) -> Result<(), Failure> {
        let inputs: Vec<&Path> = self.inputs.iter().map(PathBuf::as_path).collect();
        check_distinct(outputs, &inputs).map_err(|conflict| Failure::Usage(conflict.into()))
    }

    /// Says what the scene file may not have meant.
    pub(super) fn warn(&self) {
        self.scene.warnings.iter().for_each(|warning| say(format_args!("warning: {warning}")));
    }
}

/// The scene: a file if there is one of that path, else a built-in one. A folder is no scene, so it hides none.
pub(super) fn load(
    scene: Option<&Path>,
    defines: &[(String, String)],
    sensor: Option<usize>,
) -> Result<Named, Failure> {
    let options = LoadOptions { defines: defines.to_vec(), sensor };
    let path = scene.unwrap_or(Path::new(DEFAULT_SCENE));
    if scene.is_none() || !path.exists() || path.is_dir() {
        if let Some(source) = path.to_str().and_then(builtin) {
            let name = shown(path).to_string();
            return Ok(Named { name, scene: Scene::from_source(&source, &options)?, inputs: vec![] });
        }
        let what = if path.is_dir() { "a folder; name the scene file in it" } else { "no such file" };
        let (path, names) = (shown(path), builtin_names().join(", "));
        return Err(Failure::Usage(anyhow!("{path}: {what}, nor a built-in scene; the built-in scenes are {names}")));
    }
    let name = path.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned());
    let source = SceneSource::disk(path);
    let scene = Scene::from_source(&source, &options)?;
    Ok(Named { name, scene, inputs: source.opened_files() })
}

/// Where to write; fails now rather than after an hour of rendering.
fn output(args: &RenderArgs, named: &Named) -> Result<Output, Failure> {
    let exr = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{}.exr", named.name)));
    if exr.extension().is_none_or(|e| !e.eq_ignore_ascii_case("exr")) {
        return Err(Failure::Usage(anyhow!(
            "{}: the output must end in .exr; a .png is written beside it",
            shown(&exr)
        )));
    }
    let png = exr.with_extension("png");
    let outputs = [
        ("--output", Some(&exr)),
        ("the PNG beside it", Some(&png)),
        ("--stats", args.stats.as_ref()),
        ("--record-queries", args.record_queries.as_ref()),
    ];
    let outputs = outputs.into_iter().filter_map(|(name, path)| Some((name, path?.as_path())));
    named.check_outputs(&outputs.clone().collect::<Vec<_>>())?;
    for (_, path) in outputs {
        check_writable(path).with_context(|| format!("cannot write {}", shown(path))).map_err(Failure::Work)?;
    }
    Ok(Output { exr, png })
}

/// Writes the statistics, the PNG and the EXR, and only when all are written moves them to their places, the EXR last: who waits for
/// it finds all three, and a failure leaves none.
fn write_all(
    rendering: &Rendering,
    output: &Output,
    args: &RenderArgs,
    scene: &Scene,
    attributes: &[(&str, AttributeValue)],
) -> Result<(), Failure> {
    let format = match scene.film.component_format {
        vdf_scene::ComponentFormat::Float16 => ComponentFormat::Half,
        vdf_scene::ComponentFormat::Float32 => ComponentFormat::Float,
    };
    let options = ExrOptions::default().with_component_format(format);
    let mut files = Vec::new();
    if let Some(path) = &args.stats {
        files.push(stage_json(path, &rendering.statistics)?);
    }
    files.push(stage_png(&output.png, &rendering.image)?);
    files.push(stage_exr_with(&output.exr, &rendering.image, attributes, &options)?);
    StagedFile::persist_all(files).map_err(|error| Failure::Work(error.into()))
}

/// Writes the figures of a run for machines.
pub(super) fn write_json(path: &Path, figures: &impl Serialize) -> Result<(), Failure> {
    let file = stage_json(path, figures)?;
    file.persist().with_context(|| format!("cannot write {}", shown(path))).map_err(Failure::Work)
}

fn stage_json(path: &Path, figures: &impl Serialize) -> Result<StagedFile, Failure> {
    let json =
        serde_json::to_string_pretty(figures).context("cannot express the figures as JSON").map_err(Failure::Work)?;
    StagedFile::write(path, |w| writeln!(w, "{json}"))
        .with_context(|| format!("cannot write {}", shown(path)))
        .map_err(Failure::Work)
}

/// What the EXR says of its making.
fn attributes(s: &Statistics, name: &str, scene: &Scene) -> Vec<(&'static str, AttributeValue)> {
    let count = |n: u64| AttributeValue::from(n as f64);
    let mut attributes = vec![
        ("vdf.version", s.version.into()),
        ("vdf.scene", name.into()),
        ("vdf.sceneHash", format!("{:08x}", scene.checksum()).into()),
        ("vdf.method", s.method.into()),
        ("vdf.integrator", s.integrator.into()),
        ("vdf.transmittance", s.transmittance.into()),
        ("vdf.roulette", s.roulette.into()),
        ("vdf.estimator", s.estimator.into()),
        ("vdf.sampler", s.sampler.into()),
        ("vdf.samplesPerPixel", i64::from(s.spp).into()),
        ("vdf.seed", s.seed.to_string().into()),
        ("vdf.queries", count(s.queries)),
        ("vdf.spatialQueries", count(s.spatial)),
        ("vdf.provedQueries", count(s.proved)),
        ("vdf.buildTimeSeconds", s.t_build.into()),
        ("vdf.renderTimeSeconds", s.t_render.into()),
    ];
    attributes.extend(s.voxel_size.map(|v| ("vdf.voxelSize", v.into())));
    attributes.extend(s.samples_per_segment.map(|n| ("vdf.samplesPerSegment", i64::from(n).into())));
    attributes
}
