//! The files of a render.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use serde::Serialize;
use vdf_image::{
    AttributeValue, ComponentFormat, ExrOptions, Image, StagedFile, check_writable, shown, stage_exr_layers, stage_png,
};
use vdf_render::{Film, Integrator, SegmentSamples};

use crate::{args::PictureArgs, failure::Failure};

/// Where a picture goes.
#[derive(Clone, Debug)]
pub(in crate::commands) struct Places {
    pub(in crate::commands) exr: PathBuf,
    pub(in crate::commands) png: PathBuf,
}

impl Places {
    /// An EXR and the PNG beside it.
    pub(in crate::commands) fn of_exr(exr: PathBuf) -> Result<Self, Failure> {
        if exr.extension().is_none_or(|e| !e.eq_ignore_ascii_case("exr")) {
            return Err(Failure::Usage(anyhow!(
                "{}: the output must end in .exr; a .png is written beside it",
                shown(&exr)
            )));
        }
        Ok(Self { png: exr.with_extension("png"), exr })
    }

    /// Where the picture so far goes: `fog.partial.exr` beside `fog.exr`.
    pub(super) fn partial(&self) -> Self {
        Self { exr: self.exr.with_extension("partial.exr"), png: self.exr.with_extension("partial.png") }
    }
}

/// Fails now if one of the files cannot be written, rather than after an hour of rendering.
pub(in crate::commands) fn check_places<'a>(paths: impl Iterator<Item = &'a Path>) -> Result<(), Failure> {
    for path in paths {
        check_writable(path).with_context(|| format!("cannot write {}", shown(path))).map_err(Failure::Work)?;
    }
    Ok(())
}

/// Writes the statistics, the PNG and the EXR, and only when all are written moves them to their places, the EXR last: who waits for
/// it finds all three, and a failure leaves none.
pub(in crate::commands) fn write_picture(
    places: &Places,
    image: &Image,
    film: &Film,
    how: &PictureArgs,
    stats: Option<StagedFile>,
) -> Result<(), Failure> {
    let format = if film.picture().half { ComponentFormat::Half } else { ComponentFormat::Float };
    let format = how.exr_format.map_or(format, Into::into);
    let options = ExrOptions::default().with_component_format(format).with_compression(how.exr_compression.into());
    let attributes = attributes(film, how.reproducible);
    let layers = film.develop_layers();
    let mut files: Vec<StagedFile> = stats.into_iter().collect();
    files.push(stage_png(&places.png, image)?);
    files.push(stage_exr_layers(&places.exr, image, &layers, &attributes, &options)?);
    StagedFile::persist_all(files).map_err(|error| Failure::Work(error.into()))
}

/// Writes the figures of a run for machines.
pub(in crate::commands) fn write_json(path: &Path, figures: &impl Serialize) -> Result<(), Failure> {
    let file = stage_json(path, figures)?;
    file.persist().with_context(|| format!("cannot write {}", shown(path))).map_err(Failure::Work)
}

pub(in crate::commands) fn stage_json(path: &Path, figures: &impl Serialize) -> Result<StagedFile, Failure> {
    let json =
        serde_json::to_string_pretty(figures).context("cannot express the figures as JSON").map_err(Failure::Work)?;
    StagedFile::write(path, |w| writeln!(w, "{json}"))
        .with_context(|| format!("cannot write {}", shown(path)))
        .map_err(Failure::Work)
}

/// What the EXR says of its making.
fn attributes(film: &Film, reproducible: bool) -> Vec<(&'static str, AttributeValue)> {
    let (o, c, runs) = (film.origin(), film.counters(), film.runs());
    let integrator: Option<Integrator> = o.integrator.parse().ok();
    let spp = film.samples().first().map_or(0, |samples| samples.end - samples.start);
    let mut attributes: Vec<(&'static str, AttributeValue)> = vec![
        ("worldToCamera", AttributeValue::Matrix(film.picture().world_to_camera.map(|x| x as f32))),
        ("vdf.version", o.version.as_str().into()),
        ("vdf.scene", film.picture().name.as_str().into()),
        ("vdf.sceneHash", format!("{:08x}", o.scene).into()),
        ("vdf.integrator", integrator.map_or("unknown", Integrator::name).into()),
        ("vdf.transmittance", o.transmittance.as_str().into()),
        ("vdf.roulette", o.roulette.as_str().into()),
        ("vdf.estimator", o.estimator.as_str().into()),
        ("vdf.lightPaths", o.light_paths.as_str().into()),
        ("vdf.sampler", o.sampler.as_str().into()),
        ("vdf.samplesPerPixel", (spp as i64).into()),
        ("vdf.seed", o.seed.to_string().into()),
    ];
    let samples_per_segment = integrator.and_then(Integrator::samples_per_segment);
    attributes.extend(samples_per_segment.map(|samples| {
        let value = match samples {
            SegmentSamples::Count(n) => i64::from(n).into(),
            SegmentSamples::Auto => "auto".into(),
        };
        ("vdf.samplesPerSegment", value)
    }));
    attributes.extend(o.noise.map(|limit| ("vdf.noiseLimit", f64::from(limit).into())));
    if reproducible {
        return attributes;
    }
    let count = |n: u64| AttributeValue::from(n as f64);
    let method = match runs {
        [first, rest @ ..] if rest.iter().all(|run| run.method == first.method) => first.method.as_str(),
        _ => "several",
    };
    let seconds = |time: fn(&vdf_render::FilmRun) -> f64| AttributeValue::from(runs.iter().map(time).sum::<f64>());
    attributes.extend([
        ("vdf.method", method.into()),
        ("vdf.queries", count(c.queries)),
        ("vdf.spatialQueries", count(c.spatial)),
        ("vdf.provedQueries", count(c.proved)),
        ("vdf.buildTimeSeconds", seconds(|run| run.t_build)),
        ("renderTime", seconds(|run| run.t_render)),
        ("vdf.renderTimeSeconds", seconds(|run| run.t_render)),
    ]);
    attributes.extend(runs.first().and_then(|run| run.voxel_size).map(|v| ("vdf.voxelSize", v.into())));
    attributes
}
