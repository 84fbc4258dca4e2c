//! `vdf merge`.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use serde::Serialize;
use vdf_image::{StagedFile, check_distinct, shown};
use vdf_render::{Film, FilmError, FilmOrigin, FilmRun};

use super::render::{MOST_SAMPLES, Places, check_places, stage_json, write_picture};
use crate::{
    args::MergeArgs,
    failure::{Failure, say, tell},
};

pub(crate) fn run(args: &MergeArgs) -> Result<(), Failure> {
    let places = args.output.clone().map(Places::of_exr).transpose()?;
    check_outputs(args, places.as_ref())?;
    let film = merged(args)?;
    let missing = film.missing(0..film.origin().spp);
    if let Some(into) = &args.into {
        film.write(into).map_err(|e| Failure::Work(e.into()))?;
    }
    if missing.is_empty() || args.so_far {
        write(args, places.as_ref(), &film)?;
    }
    if missing.is_empty() {
        return Ok(());
    }
    let (whole, error) = (film.origin().spp, FilmError::Missing { missing });
    Err(Failure::Incomplete(format!("{error}, of {whole} in the whole render")))
}

fn check_outputs(args: &MergeArgs, places: Option<&Places>) -> Result<(), Failure> {
    let mut outputs: Vec<(&str, &Path)> = vec![];
    if let Some(Places { exr, png }) = places {
        outputs.extend([("--output", exr.as_path()), ("the PNG beside it", png.as_path())]);
    }
    let others = [("--stats", &args.stats), ("--into", &args.into)];
    outputs.extend(others.into_iter().filter_map(|(name, path)| Some((name, path.as_deref()?))));
    if let Some(into) =
        args.into.as_ref().filter(|into| into.extension().is_none_or(|e| !e.eq_ignore_ascii_case("film")))
    {
        return Err(Failure::Usage(anyhow!("--into {}: a film; give a name that ends in .film", shown(into))));
    }
    let inputs: Vec<&Path> = films(args).collect();
    check_distinct(&outputs, &inputs).map_err(|conflict| Failure::Usage(conflict.into()))?;
    check_places(outputs.iter().map(|(_, path)| *path))
}

/// The films to merge. That of `--into` may be among them, as `*.film` names it from the second time on.
fn films(args: &MergeArgs) -> impl Iterator<Item = &Path> {
    let into = args.into.as_ref().and_then(|into| into.canonicalize().ok());
    args.films.iter().map(PathBuf::as_path).filter(move |film| into.is_none() || film.canonicalize().ok() != into)
}

/// All films in one.
fn merged(args: &MergeArgs) -> Result<Film, Failure> {
    let before = args.into.as_deref().filter(|into| into.exists());
    let mut paths = before.into_iter().chain(films(args));
    let first = paths.next().ok_or_else(|| Failure::Usage(anyhow!("there are no films to merge")))?;
    let read = |path: &Path| Film::read(path).map_err(|e| Failure::Work(e.into()));
    let mut film = read(first)?;
    for path in paths {
        let next = read(path)?;
        let open = [&film, &next].iter().any(|film| film.origin().spp == MOST_SAMPLES);
        let cause = if open { "; one of them is a checkpoint of a render with --time-limit, not a shard" } else { "" };
        let stranger =
            |e: FilmError| Failure::Usage(anyhow!("cannot merge {} with {}: {e}{cause}", shown(path), shown(first)));
        film.origin().check_same_render(next.origin()).map_err(stranger)?;
        // A task that was run twice, or a shard of the last time: the same samples, which are the same numbers.
        if next.total_samples() > 0 && film.contains(&next) {
            if !args.quiet {
                say(format_args!("note: {} is passed over: all of its samples are there", shown(path)));
            }
            continue;
        }
        film.merge(next).map_err(stranger)?;
    }
    Ok(film)
}

/// The figures of a merged render.
#[derive(Serialize)]
struct Figures<'a> {
    #[serde(flatten)]
    origin: &'a FilmOrigin,
    samples: u64,
    paths: u64,
    queries: u64,
    spatial: u64,
    proved: u64,
    on_light: u64,
    on_light_proved: u64,
    superficial_proved: u64,
    rays: u64,
    refused: u64,
    runs: &'a [FilmRun],
}

fn write(args: &MergeArgs, places: Option<&Places>, film: &Film) -> Result<(), Failure> {
    let c = film.counters();
    let figures = Figures {
        origin: film.origin(),
        samples: film.total_samples(),
        paths: c.paths,
        queries: c.queries,
        spatial: c.spatial,
        proved: c.proved,
        on_light: c.on_light,
        on_light_proved: c.on_light_proved,
        superficial_proved: c.superficial_proved,
        rays: c.rays,
        refused: c.refused,
        runs: film.runs(),
    };
    let stats = args.stats.as_ref().map(|path| stage_json(path, &figures)).transpose()?;
    match places {
        Some(places) => {
            let image = film.develop_so_far().map_err(|e| Failure::Work(e.into()))?;
            write_picture(places, &image, film, &args.picture, stats)?;
            if !args.quiet {
                tell(format_args!("merged         {} films, {} samples", film.runs().len(), figures.samples));
                tell(format_args!("wrote          {} and {}", shown(&places.exr), shown(&places.png)));
            }
        }
        None => StagedFile::persist_all(stats.into_iter().collect()).map_err(|error| Failure::Work(error.into()))?,
    }
    Ok(())
}
