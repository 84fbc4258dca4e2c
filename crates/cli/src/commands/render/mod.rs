//! `vdf render`.

mod display;
mod output;
mod passes;
mod sequence;

use std::{
    path::{Path, PathBuf},
    sync::{Arc, atomic::AtomicBool},
};

use anyhow::{Context as _, anyhow};
use vdf_image::{StagedFile, check_distinct, shown};
use vdf_lab::queries::{QueryStream, record_queries};
use vdf_render::{
    Estimator, Film, FilmPart, Integrator, LightPaths, NoiseLimit, PrepareOptions, PreparedScene, RenderOptions,
    Roulette, SamplerKind, SegmentSamples, TransmittanceEstimator, Work, thread_count,
};
use vdf_scene::{LoadOptions, Scene, SceneSource};
use vdf_scenes::{DEFAULT_SCENE, builtin, builtin_names};
use vdf_visibility::{Method, PointProver};

use self::display::Display;
pub(super) use self::output::{Places, check_places, stage_json, write_json, write_picture};
use self::passes::{Checkpoint, Plan, Rendered};
use crate::{
    args::{
        EstimatorName, LightPathsName, MethodChoice, PictureArgs, RenderArgs, RouletteName, SamplerName,
        TransmittanceName,
    },
    failure::{Failure, say, tell},
    progress::Reporter,
};

/// So many samples per pixel are more than a limit of time lets anyone take.
pub(super) const MOST_SAMPLES: u32 = 1 << 30;

pub(crate) fn run(args: &RenderArgs) -> Result<(), Failure> {
    let renders = sequence::renders(args)?;
    let asked = picture_signal();
    let reporter = Reporter::of_kind(args.quiet, args.long.progress)?;
    renders.iter().try_for_each(|(frame, args)| {
        render(args, &reporter, &asked).map_err(|failure| match frame {
            Some(frame) => failure.of(&format!("frame {frame}")),
            None => failure,
        })
    })
}

/// One picture, or one shard of it.
fn render(args: &RenderArgs, reporter: &Reporter, asked: &AtomicBool) -> Result<(), Failure> {
    let mut options = options(args)?;
    if args.long.time_limit.is_some() {
        options.spp = Some(options.spp.unwrap_or(MOST_SAMPLES));
    } else if options.noise.is_some() {
        options.spp = Some(options.spp.unwrap_or(NoiseLimit::MOST_SAMPLES));
    }
    let choice = match args.method {
        Some(choice) => Some(choice),
        // Proofs of flights need a field, whatever the lights.
        None if args.segment_first => Some(MethodChoice::One(Method::best_with_voxels())),
        // What a layer shows must not hang on a clock: then the library's rule.
        None if options.layers.depend_on_method() => None,
        None => Some(MethodChoice::Auto),
    };
    let method = choice.map(|choice| match choice {
        MethodChoice::One(method) => method,
        MethodChoice::Auto => Method::NONE,
    });
    let prepare = PrepareOptions {
        method,
        voxel_size: args.voxel,
        grid: args.grid.into(),
        texels: args.light_buffer.and_then(|texels| texels.0),
        threads: args.threads,
        ..PrepareOptions::default()
    };
    prepare.validate()?;
    if args.long.noise.is_some() && args.long.shard.is_some() && !args.long.tiles {
        return Err(Failure::Usage(anyhow!(
            "--noise with --shard: shards of samples cannot know the noise of the whole; divide the pixels with --tiles"
        )));
    }
    let named = load(args.scene.as_deref(), &args.defines, args.sensor)?;
    options.validate(&named.scene)?;
    let output = output(args, &named)?;
    if args.long.skip_existing && output.exists(args) {
        say(format_args!("note: {} is there and is not rendered again", shown(output.path())));
        return Ok(());
    }
    named.warn();
    let Named { name, scene, .. } = named;

    let mut prepared = PreparedScene::new(scene, &prepare, reporter)?;
    if choice == Some(MethodChoice::Auto) {
        let work = work(args, &prepared, &options)?;
        prepared = prepared.with_best_method(&prepare, &options, work, reporter)?;
    }
    // Who did not ask finds it in the statistics.
    if let Some(choice) = prepared.choice().filter(|_| !args.quiet && args.method.is_some()) {
        say(format_args!("note: method {}: {}", choice.method, choice.reason));
    }
    prepared.notes().iter().for_each(|note| say(format_args!("note: {note}")));
    let checkpoint = args.long.checkpoint.as_ref();
    let checkpoint = checkpoint.map(|path| Checkpoint {
        path: path.clone(),
        every: args.long.every,
        ours: AtomicBool::new(args.long.resume && path.exists()),
    });
    let kept = checkpoint.as_ref().map(|c| (c.path.as_path(), args.long.resume));
    let film = passes::begin(prepared.film(&options, &name)?, kept)?;
    if checkpoint.is_some() {
        // Ctrl-C lets the last one be written.
        reporter.writes();
    }
    let part = args.long.part(film.origin().spp);
    let plan = Plan {
        prepared: &prepared,
        options: &options,
        part,
        time_limit: args.long.time_limit,
        threads: thread_count(options.threads)?,
        machine: machine(),
        display: args.long.display.as_ref().map(|address| Display::new(address, &name)),
    };
    let so_far = |film: &Film| output.write_so_far(film, &args.picture);
    let rendered = passes::render(&plan, film, checkpoint.as_ref(), reporter, asked, &so_far);
    let stream = match (&rendered, &args.record_queries) {
        (Ok(_), Some(_)) => Some(record_queries(&prepared, &options, args.max_queries, reporter)).transpose(),
        _ => Ok(None),
    };
    reporter.finish();
    let (rendered, stream) = (rendered?, stream?);
    reporter.writes();
    // A Ctrl-C after the last tile: the promise is that nothing is written.
    if reporter.interrupted() {
        return Err(Failure::Interrupted);
    }
    finish(args, &plan, &rendered, &output)?;
    // After the picture, so that queries do not stay without it.
    if let (Some(path), Some(stream)) = (&args.record_queries, &stream) {
        write_stream(path, stream)?;
        if !args.quiet {
            let (n, paths) = (stream.queries.len(), stream.origin.paths_recorded);
            tell(format_args!("recorded       {n} queries of {paths} paths in {}", shown(path)));
        }
    }
    Ok(())
}

/// How much is to be rendered, for a pilot.
fn work(args: &RenderArgs, prepared: &PreparedScene, options: &RenderOptions) -> Result<Work, Failure> {
    let job = prepared.job(options)?;
    let [width, height] = job.size();
    let FilmPart { samples, tiles: (_, parts) } = args.long.part(job.spp());
    let paths = u64::from(width) * u64::from(height) * u64::from(samples.end - samples.start) / parts as u64;
    Ok(Work { paths, seconds: args.long.time_limit.map(|limit| limit.as_secs_f64()) })
}

/// Writes the results and tells of them.
fn finish(args: &RenderArgs, plan: &Plan<'_>, rendered: &Rendered, output: &Output) -> Result<(), Failure> {
    let Rendered { film, end } = rendered;
    let spp = end - plan.part.samples.start;
    let statistics = plan.prepared.statistics(plan.options, film, spp)?;
    if statistics.refused > 0 {
        say(format_args!("warning: {} samples were not finite or negative and were left out", statistics.refused));
    }
    let stats = args.stats.as_ref().map(|path| stage_json(path, &statistics)).transpose()?;
    let wrote = match output {
        Output::Film(path) => {
            let film = film.stage(path).map_err(|e| Failure::Work(e.into()))?;
            let files = stats.into_iter().chain([film]).collect();
            StagedFile::persist_all(files).map_err(|error| Failure::Work(error.into()))?;
            shown(path).to_string()
        }
        Output::Picture(places) => {
            // A render that was cut short is a whole render of fewer samples.
            let film = film.clone().of_spp(*end);
            let image = film.develop().map_err(|e| Failure::Work(e.into()))?;
            write_picture(places, &image, &film, &args.picture, stats)?;
            format!("{} and {}", shown(&places.exr), shown(&places.png))
        }
    };
    if !args.quiet {
        tell(format_args!("{statistics}\nwrote          {wrote}"));
    }
    Ok(())
}

/// Set by the signal that asks for the picture so far.
fn picture_signal() -> Arc<AtomicBool> {
    let asked = Arc::new(AtomicBool::new(false));
    // If that cannot be had, there is no picture on demand, and all else works.
    #[cfg(unix)]
    drop(signal_hook::flag::register(signal_hook::consts::SIGUSR1, Arc::clone(&asked)));
    asked
}

/// The name of this machine, where the system tells it.
fn machine() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    name.or_else(|| std::env::var("HOSTNAME").ok())
        .or_else(|| std::env::var("COMPUTERNAME").ok())
        .map_or_else(String::new, |name| name.trim().to_owned())
}

/// Where results go.
enum Output {
    /// The picture of a render.
    Picture(Places),
    /// The film of a shard.
    Film(PathBuf),
}

impl Output {
    /// The file that appears last.
    fn path(&self) -> &Path {
        match self {
            Self::Picture(places) => &places.exr,
            Self::Film(path) => path,
        }
    }

    /// Whether all that the render would write is there.
    fn exists(&self, args: &RenderArgs) -> bool {
        let beside = match self {
            Self::Picture(places) => Some(&places.png),
            Self::Film(_) => None,
        };
        let others = [beside, args.stats.as_ref(), args.record_queries.as_ref()];
        self.path().exists() && others.into_iter().flatten().all(|path| path.exists())
    }

    fn write_so_far(&self, film: &Film, how: &PictureArgs) -> Result<(), Failure> {
        let places = match self {
            Self::Picture(places) => places.partial(),
            Self::Film(path) => Places::of_exr(path.with_extension("exr"))?.partial(),
        };
        let image = film.develop_so_far().map_err(|e| Failure::Work(e.into()))?;
        write_picture(&places, &image, film, how, None)
    }
}

/// Writes recorded queries.
pub(super) fn write_stream(path: &Path, stream: &QueryStream) -> Result<(), Failure> {
    stream.write(path).with_context(|| format!("cannot write {}", shown(path))).map_err(Failure::Work)
}

/// The integrator with its samples per segment, if it takes any.
pub(super) fn integrator(
    integrator: Integrator,
    samples_per_segment: Option<SegmentSamples>,
) -> Result<Integrator, Failure> {
    let Some(n) = samples_per_segment else { return Ok(integrator) };
    integrator
        .with_samples_per_segment(n)
        .ok_or_else(|| Failure::Usage(anyhow!("--samples-per-segment goes with --integrator raymarch only")))
}

fn options(args: &RenderArgs) -> Result<RenderOptions, Failure> {
    if args.max_queries == 0 {
        return Err(Failure::Usage(anyhow!("--max-queries must be at least 1")));
    }
    let traced = args.integrator == Integrator::Volpath;
    if args.light_paths == LightPathsName::Always && !(traced && args.estimator != EstimatorName::Thesis) {
        return Err(Failure::Usage(anyhow!(
            "--light-paths always goes with --integrator volpath and an estimator other than thesis"
        )));
    }
    if args.segment_first && !(traced && args.method != Some(MethodChoice::One(Method::NONE))) {
        return Err(Failure::Usage(anyhow!(
            "--segment-first goes with --integrator volpath and a method other than none"
        )));
    }
    if args.light_buffer.is_some()
        && matches!(args.method, Some(MethodChoice::One(method)) if method.point_prover() != PointProver::Buffer)
    {
        return Err(Failure::Usage(anyhow!("--light-buffer goes with --method lb or auto")));
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
        light_paths: match args.light_paths {
            LightPathsName::Auto => LightPaths::Auto,
            LightPathsName::Always => LightPaths::Always,
            LightPathsName::Never => LightPaths::Never,
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
        layers: args.aov.iter().copied().collect(),
        noise: args.long.noise,
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
        let names = builtin_names().join(", ");
        let what =
            if path.is_dir() { "a folder; name the scene file in it" } else { "no such file, nor a built-in scene" };
        return Err(Failure::Usage(anyhow!("{}: {what}; the built-in scenes are {names}", shown(path))));
    }
    let name = path.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned());
    let source = SceneSource::disk(path);
    let scene = Scene::from_source(&source, &options)?;
    Ok(Named { name, scene, inputs: source.opened_files() })
}

/// Where to write; fails now rather than after an hour of rendering.
fn output(args: &RenderArgs, named: &Named) -> Result<Output, Failure> {
    let mut outputs = vec![];
    let output = match args.long.shard {
        None => {
            let exr = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{}.exr", named.name)));
            let places = Places::of_exr(exr)?;
            outputs.extend([("--output", places.exr.clone()), ("the PNG beside it", places.png.clone())]);
            Output::Picture(places)
        }
        Some(shard) => {
            let name = format!("{}.{}-of-{}.film", named.name, shard.index, shard.count);
            let film = args.output.clone().unwrap_or_else(|| PathBuf::from(name));
            if film.extension().is_none_or(|e| !e.eq_ignore_ascii_case("film")) {
                let film = shown(&film);
                return Err(Failure::Usage(anyhow!(
                    "{film}: the output of a shard must end in .film; vdf merge makes the EXR"
                )));
            }
            outputs.push(("--output", film.clone()));
            Output::Film(film)
        }
    };
    let others =
        [("--stats", &args.stats), ("--record-queries", &args.record_queries), ("--checkpoint", &args.long.checkpoint)];
    outputs.extend(others.into_iter().filter_map(|(name, path)| Some((name, path.clone()?))));
    let outputs: Vec<(&str, &Path)> = outputs.iter().map(|(name, path)| (*name, path.as_path())).collect();
    named.check_outputs(&outputs)?;
    check_places(outputs.iter().map(|(_, path)| *path))?;
    Ok(output)
}
