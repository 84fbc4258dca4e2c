//! `vdf render`.

use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

use anyhow::{Context as _, anyhow};
use serde::Serialize;
use vdf_image::{AttributeValue, StagedFile, check_writable, stage_exr, stage_png};
use vdf_lab::queries::{QueryStream, record_queries};
use vdf_render::{
    Integrator, PrepareOptions, PreparedScene, RenderOptions, Rendering, Statistics, TransmittanceEstimator,
};
use vdf_scene::{LoadOptions, Scene};
use vdf_scenes::{DEFAULT_SCENE, builtin, builtin_names};
use vdf_visibility::Method;

use crate::{
    args::{RenderArgs, TransmittanceName},
    failure::{Failure, say},
    progress::Reporter,
};

pub(crate) fn run(args: &RenderArgs) -> Result<(), Failure> {
    let options = options(args)?;
    let prepare = PrepareOptions {
        // Proofs of flights need a method, whatever the lights.
        method: args.method.or_else(|| args.segment_first.then(Method::default)),
        voxel_size: args.voxel,
        threads: args.threads,
        ..PrepareOptions::default()
    };
    prepare.validate()?;
    let (name, scene) = load(args.scene.as_deref(), &args.defines)?;
    options.validate(&scene)?;
    let output = output(args, &name)?;
    for warning in &scene.warnings {
        say(format_args!("warning: {warning}"));
    }

    let reporter = Reporter::new(args.quiet)?;
    let prepared = PreparedScene::new(scene, &prepare, &reporter)?;
    let rendering = prepared.render(&options, &reporter);
    let stream = match (&rendering, &args.record_queries) {
        (Ok(_), Some(_)) => Some(record_queries(&prepared, &options, args.max_queries, &reporter)).transpose(),
        _ => Ok(None),
    };
    reporter.finish();
    let (rendering, stream) = (rendering?, stream?);
    // A Ctrl-C after the last tile: the promise is that nothing is written.
    if reporter.interrupted() {
        return Err(Failure::Interrupted);
    }

    if let (Some(path), Some(stream)) = (&args.record_queries, &stream) {
        write_stream(path, stream)?;
    }
    let attributes = attributes(&rendering.statistics, &name, prepared.scene());
    write_all(&rendering, &output, args, &attributes)?;
    let stdout = &mut std::io::stdout();
    if !args.quiet {
        writeln!(stdout, "{}", rendering.statistics)?;
        writeln!(stdout, "wrote          {} and {}", output.exr.display(), output.png.display())?;
        if let (Some(path), Some(stream)) = (&args.record_queries, &stream) {
            let (n, paths) = (stream.queries.len(), stream.origin.paths_recorded);
            writeln!(stdout, "recorded       {n} queries of {paths} paths in {}", path.display())?;
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
    stream.write(path).with_context(|| format!("cannot write {}", path.display())).map_err(Failure::Work)
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
        spp: args.spp,
        seed: args.seed,
        threads: args.threads,
        crop: args.crop,
        segment_first: args.segment_first,
    })
}

/// The scene and its name: a file if there is one of that path, else a built-in scene. A folder is no scene, so it hides none.
pub(super) fn load(scene: Option<&Path>, defines: &[(String, String)]) -> Result<(String, Scene), Failure> {
    let options = LoadOptions { defines: defines.to_vec(), ..LoadOptions::default() };
    let path = scene.unwrap_or(Path::new(DEFAULT_SCENE));
    if scene.is_none() || !path.exists() || path.is_dir() {
        if let Some(source) = path.to_str().and_then(builtin) {
            return Ok((path.display().to_string(), Scene::from_source(&source, &options)?));
        }
        let what = if path.is_dir() { "a folder; name the scene file in it" } else { "no such file" };
        let (path, names) = (path.display(), builtin_names().join(", "));
        return Err(Failure::Usage(anyhow!("{path}: {what}, nor a built-in scene; the built-in scenes are {names}")));
    }
    let stem = path.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned());
    Ok((stem, Scene::load(path, &options)?))
}

/// Where to write; fails now rather than after an hour of rendering.
fn output(args: &RenderArgs, name: &str) -> Result<Output, Failure> {
    let exr = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{name}.exr")));
    if exr.extension().is_none_or(|e| !e.eq_ignore_ascii_case("exr")) {
        return Err(Failure::Usage(anyhow!(
            "{}: the output must end in .exr; a .png is written beside it",
            exr.display()
        )));
    }
    let png = exr.with_extension("png");
    for (option, path) in [("stats", &args.stats), ("record-queries", &args.record_queries)] {
        if let Some(path) = path.as_ref().filter(|s| is_same(s, &exr) || is_same(s, &png)) {
            return Err(Failure::Usage(anyhow!("--{option} {}: the image is written there", path.display())));
        }
    }
    if let (Some(a), Some(b)) = (&args.stats, &args.record_queries)
        && is_same(a, b)
    {
        return Err(Failure::Usage(anyhow!("--record-queries {}: the statistics are written there", b.display())));
    }
    for path in [Some(&exr), Some(&png), args.stats.as_ref(), args.record_queries.as_ref()].into_iter().flatten() {
        check_writable(path).with_context(|| format!("cannot write {}", path.display())).map_err(Failure::Work)?;
    }
    Ok(Output { exr, png })
}

/// Whether both paths name one file, which need not exist yet.
fn is_same(a: &Path, b: &Path) -> bool {
    let absolute = |p: &Path| std::path::absolute(p).unwrap_or_else(|_| p.to_owned());
    absolute(a) == absolute(b)
}

/// Writes the statistics, the PNG and the EXR, and only when all are written moves them to their places, the EXR last: who waits for
/// it finds all three, and a failure leaves none.
fn write_all(
    rendering: &Rendering,
    output: &Output,
    args: &RenderArgs,
    attributes: &[(&str, AttributeValue)],
) -> Result<(), Failure> {
    let mut files = Vec::new();
    if let Some(path) = &args.stats {
        files.push(stage_json(path, &rendering.statistics)?);
    }
    files.push(stage_png(&output.png, &rendering.image)?);
    files.push(stage_exr(&output.exr, &rendering.image, attributes)?);
    StagedFile::persist_all(files).map_err(|error| Failure::Work(error.into()))
}

/// Writes the figures of a run for machines.
pub(super) fn write_json(path: &Path, figures: &impl Serialize) -> Result<(), Failure> {
    let file = stage_json(path, figures)?;
    file.persist().with_context(|| format!("cannot write {}", path.display())).map_err(Failure::Work)
}

fn stage_json(path: &Path, figures: &impl Serialize) -> Result<StagedFile, Failure> {
    let json =
        serde_json::to_string_pretty(figures).context("cannot express the figures as JSON").map_err(Failure::Work)?;
    StagedFile::write(path, |w| writeln!(w, "{json}"))
        .with_context(|| format!("cannot write {}", path.display()))
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
