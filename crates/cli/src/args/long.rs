//! What long renders, renders on several machines and programs that watch need.

use std::{path::PathBuf, time::Duration};

use clap::{Args, ValueEnum};
use vdf_render::{FilmPart, NoiseLimit};

use super::PictureArgs;

/// The options of long renders.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Long renders (docs/long-renders.md)")]
pub(crate) struct LongArgs {
    /// Render for at most so long, not counting what is built before; without --spp as many samples as fit
    #[arg(long, value_name = "TIME", value_parser = parse_time)]
    pub(crate) time_limit: Option<Duration>,
    /// Render each tile of 16 x 16 pixels until the standard error of its pixels over their mean is at most this, such as 0.02; without
    /// --spp with at most 16384 samples. Adds the layers variance and samples
    #[arg(long, value_name = "LIMIT")]
    pub(crate) noise: Option<NoiseLimit>,
    /// Keep what is rendered in this file, so that --resume can go on with it after a crash or an interrupt
    #[arg(long, value_name = "FILE")]
    pub(crate) checkpoint: Option<PathBuf>,
    /// How often the checkpoint is written, such as 90, 90s, 5m or 1h
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = parse_time, requires = "checkpoint")]
    pub(crate) every: Duration,
    /// Go on from the checkpoint if it is there; the image has the bytes of an uninterrupted render
    #[arg(long, requires = "checkpoint")]
    pub(crate) resume: bool,
    /// Render part I of N only, with I from 0 to N-1, to a .film for vdf merge
    #[arg(long, value_name = "I/N", value_parser = parse_shard, conflicts_with_all = ["time_limit", "record_queries"])]
    pub(crate) shard: Option<ShardArg>,
    /// Divide the pixels among the shards, in tiles, and not the samples
    #[arg(long, requires = "shard")]
    pub(crate) tiles: bool,
    /// Render a picture for each value of a parameter, or each line of a table in CSV with the parameters' names in its first; #### in
    /// the names of files is the frame's number
    #[arg(long, value_name = "NAME=FIRST..LAST[:STEP]|FILE.csv", conflicts_with = "time_limit")]
    pub(crate) sequence: Option<String>,
    /// Only these frames of the sequence
    #[arg(long, value_name = "N|FIRST-LAST", value_parser = parse_frames, requires = "sequence")]
    pub(crate) frames: Option<FrameRange>,
    /// Pass over what has been rendered: all its files are there
    #[arg(long)]
    pub(crate) skip_existing: bool,
    /// Show the picture after each pass in tev or whoever speaks its protocol, tev's own port being 14158; the render goes on if the viewer goes away
    #[arg(long, value_name = "HOST:PORT")]
    pub(crate) display: Option<String>,
    /// How progress is told on stderr: for people, or as one JSON object a line
    #[arg(long, value_enum, default_value_t = ProgressName::Auto)]
    pub(crate) progress: ProgressName,
}

impl LongArgs {
    /// The part of the render that was asked for.
    pub(crate) fn part(&self, spp: u32) -> FilmPart {
        match self.shard {
            None => FilmPart::samples(0..spp),
            Some(ShardArg { index, count }) if self.tiles => FilmPart::by_tiles(spp, index, count),
            Some(ShardArg { index, count }) => FilmPart::by_samples(spp, index, count),
        }
    }
}

/// Put the shards of a render together: the EXR and PNG have the pixels of the whole render.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  vdf merge shards/*.film -o fog.exr                  the picture, once all shards are there
  vdf merge shards/*.film --into fog.film             now and then, as shards arrive; says what is missing
  vdf merge fog.film -o preview.exr --so-far          a picture of what is there

Exit codes: 0 the render is complete, 1 failure while reading or writing, 2 usage error, or films that do not belong together,
3 films merged, but samples are missing.")]
pub(crate) struct MergeArgs {
    /// The films to merge
    #[arg(required = true, value_name = "FILM")]
    pub(crate) films: Vec<PathBuf>,
    /// The EXR to write when no sample is missing; a PNG is written beside it
    #[arg(short, long, value_name = "OUT.exr", required_unless_present = "into")]
    pub(crate) output: Option<PathBuf>,
    /// Add the films to this one, which is made if it is not there; films that it holds already are passed over
    #[arg(long, value_name = "FILE.film")]
    pub(crate) into: Option<PathBuf>,
    /// Write the picture although samples are missing: each pixel is the mean of those that it has
    #[arg(long, requires = "output")]
    pub(crate) so_far: bool,
    /// Write the figures of the merged render as JSON
    #[arg(long, value_name = "FILE.json")]
    pub(crate) stats: Option<PathBuf>,
    /// Errors and what is missing only
    #[arg(short, long)]
    pub(crate) quiet: bool,
    #[command(flatten)]
    pub(crate) picture: PictureArgs,
}

/// How progress is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressName {
    /// A bar on a terminal, else a line now and then
    Auto,
    /// One JSON object a line
    Json,
}

/// One of several parts of a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ShardArg {
    pub(crate) index: u32,
    pub(crate) count: u32,
}

fn parse_shard(text: &str) -> Result<ShardArg, String> {
    let parts = text.split_once('/').and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
    match parts {
        Some((index, count)) if index < count => Ok(ShardArg { index, count }),
        Some((_, count)) if count > 0 => Err(format!("the shards of {count} are 0/{count} to {}/{count}", count - 1)),
        _ => Err("expected I/N, such as 0/8 to 7/8".to_owned()),
    }
}

/// Some frames of a sequence, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameRange {
    pub(crate) first: u32,
    pub(crate) last: u32,
}

fn parse_frames(text: &str) -> Result<FrameRange, String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    match (first.parse(), last.parse()) {
        (Ok(first), Ok(last)) if first <= last => Ok(FrameRange { first, last }),
        _ => Err("expected N or FIRST-LAST, such as 7 or 1-24".to_owned()),
    }
}

/// Seconds, or a number with a unit.
pub(crate) fn parse_time(text: &str) -> Result<Duration, String> {
    let (number, unit) = match text.find(|c: char| c.is_ascii_alphabetic()) {
        Some(at) => text.split_at(at),
        None => (text, "s"),
    };
    let factor = match unit {
        "ms" => 0.001,
        "s" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => 0.0,
    };
    let seconds = number.trim().parse::<f64>().ok().map(|n| n * factor);
    seconds
        .filter(|s| *s > 0.0 && *s <= 1e9)
        .map(Duration::from_secs_f64)
        .ok_or_else(|| "expected a time above 0, such as 90, 90s, 5m or 1h".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units() {
        for (text, seconds) in [("90", 90.0), ("90s", 90.0), ("1.5m", 90.0), ("2 min", 120.0), ("1h", 3600.0)] {
            assert_eq!(parse_time(text), Ok(Duration::from_secs_f64(seconds)), "{text}");
        }
        assert_eq!(parse_time("250ms"), Ok(Duration::from_millis(250)));
        for wrong in ["", "s", "0", "-1", "1d", "nan", "inf", "1e300", "1m30s"] {
            assert!(parse_time(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn shards_are_counted_from_zero() {
        assert_eq!(parse_shard("7/8"), Ok(ShardArg { index: 7, count: 8 }));
        for wrong in ["8/8", "0/0", "1", "/", "-1/8", "a/b", "1/8/2"] {
            assert!(parse_shard(wrong).is_err(), "{wrong}");
        }
    }
}
