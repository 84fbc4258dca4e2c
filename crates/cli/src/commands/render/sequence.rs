//! Sequences: one render for each row of a table or each value of a range.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use vdf_image::shown;
use vdf_scenes::DEFAULT_SCENE;

use crate::{
    args::{FrameRange, RenderArgs},
    failure::Failure,
};

/// One picture of a sequence.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Frame {
    number: u32,
    defines: Vec<(String, String)>,
}

/// More would be a slip of the pen.
const MOST_FRAMES: i128 = 1_000_000;

/// The arguments of each render with the number of its frame: those given, if there is no sequence.
pub(super) fn renders(args: &RenderArgs) -> Result<Vec<(Option<u32>, RenderArgs)>, Failure> {
    let Some(sequence) = &args.long.sequence else { return Ok(vec![(None, args.clone())]) };
    let of_sequence = |reason: String| Failure::Usage(anyhow!("--sequence {sequence}: {reason}"));
    let frames = match sequence.split_once('=') {
        Some((name, range)) if !Path::new(sequence).exists() => values(name, range).map_err(of_sequence)?,
        _ => table(Path::new(sequence)).map_err(of_sequence)?,
    };
    let chosen: Vec<Frame> = match args.long.frames {
        Some(FrameRange { first, last }) => frames.into_iter().filter(|f| (first..=last).contains(&f.number)).collect(),
        None => frames,
    };
    if chosen.is_empty() {
        return Err(of_sequence("there are no such frames".to_owned()));
    }
    let given = |name: &String| args.defines.iter().any(|(define, _)| define == name);
    if let Some((name, _)) = chosen[0].defines.iter().find(|(name, _)| given(name)) {
        return Err(of_sequence(format!("-D {name} is given as well; each frame has a value of its own")));
    }
    chosen.into_iter().map(|frame| Ok((Some(frame.number), render(args, frame)?))).collect()
}

/// The arguments of one frame.
fn render(args: &RenderArgs, frame: Frame) -> Result<RenderArgs, Failure> {
    let mut args = args.clone();
    args.defines.extend(frame.defines);
    let scene = args.scene.as_deref().unwrap_or(Path::new(DEFAULT_SCENE));
    let name = scene.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned());
    let output = args.output.take().unwrap_or_else(|| match args.long.shard {
        Some(shard) => PathBuf::from(format!("{name}.####.{}-of-{}.film", shard.index, shard.count)),
        None => PathBuf::from(format!("{name}.####.exr")),
    });
    args.output = Some(output);
    let paths = [
        ("--output", &mut args.output),
        ("--stats", &mut args.stats),
        ("--record-queries", &mut args.record_queries),
        ("--checkpoint", &mut args.long.checkpoint),
    ];
    for (option, path) in paths {
        if let Some(path) = path {
            *path = numbered(path, frame.number).ok_or_else(|| {
                let path = shown(path);
                Failure::Usage(anyhow!(
                    "{option} {path}: the name of a file of a sequence needs #### for the frame's number"
                ))
            })?;
        }
    }
    Ok(args)
}

/// The path with the number in place of `####`, filled with zeros to as many digits as there are signs.
fn numbered(path: &Path, number: u32) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let start = name.find('#')?;
    let signs = name[start..].bytes().take_while(|&b| b == b'#').count();
    let name = format!("{}{number:0signs$}{}", &name[..start], &name[start + signs..]);
    Some(path.with_file_name(name))
}

/// `FIRST..LAST` or `FIRST..LAST:STEP`, both ends included. Numbers keep the decimals that they have, so that the values are exact.
fn values(name: &str, range: &str) -> Result<Vec<Frame>, String> {
    let wrong = || "expected a file, or NAME=FIRST..LAST or NAME=FIRST..LAST:STEP with decimal numbers".to_owned();
    let (ends, step) = range.split_once(':').unwrap_or((range, "1"));
    let (first, last) = ends.split_once("..").ok_or_else(wrong)?;
    let texts = [first, last, step];
    let decimals = texts.iter().map(|t| t.split_once('.').map_or(0, |(_, d)| d.len())).max().unwrap_or(0);
    let scaled = |text: &str| {
        let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
        let digits = whole.strip_prefix('-').unwrap_or(whole);
        let plain = !digits.is_empty() && [digits, fraction].iter().all(|t| t.bytes().all(|b| b.is_ascii_digit()));
        (plain && text.len() < 20).then(|| format!("{whole}{fraction:0<decimals$}").parse::<i128>().ok()).flatten()
    };
    let [Some(first), Some(last), Some(step)] = texts.map(scaled) else { return Err(wrong()) };
    if step == 0 || (last - first) / step < 0 {
        return Err("the step does not lead from the first to the last value".to_owned());
    }
    let count = (last - first) / step + 1;
    if name.is_empty() || count > MOST_FRAMES {
        return Err(wrong());
    }
    let shown = |value: i128| {
        let (sign, digits) = (if value < 0 { "-" } else { "" }, format!("{:0>1$}", value.abs(), decimals + 1));
        let (whole, fraction) = digits.split_at(digits.len() - decimals);
        if decimals == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{fraction}") }
    };
    // Whole values are the numbers of their frames.
    let by_value = decimals == 0 && first.min(last) >= 0;
    let frame = |i: i128| {
        let value = first + i * step;
        let number = u32::try_from(if by_value { value } else { i + 1 }).map_err(|_| wrong())?;
        Ok(Frame { number, defines: vec![(name.to_owned(), shown(value))] })
    };
    (0..count).map(frame).collect()
}

/// A table in CSV: the first line has the parameters' names, each other line the values of a frame. A column `frame` has the frames' numbers; else they count
/// from 1.
fn table(path: &Path) -> Result<Vec<Frame>, String> {
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(|e| format!("cannot read it: {e}"))?;
    let names = reader.headers().map_err(|e| format!("cannot read it: {e}"))?.clone();
    let mut frames: Vec<Frame> = Vec::new();
    for (row, record) in (1_u32..).zip(reader.records()) {
        let record = record.map_err(|e| format!("cannot read it: {e}"))?;
        let mut frame = Frame { number: row, defines: Vec::new() };
        for (name, value) in names.iter().zip(&record) {
            if name == "frame" {
                frame.number = value.parse().map_err(|_| format!("line {}: {value} is no frame's number", row + 1))?;
            } else {
                frame.defines.push((name.to_owned(), value.to_owned()));
            }
        }
        if frames.iter().any(|f| f.number == frame.number) {
            return Err(format!("line {}: there are two frames {}", row + 1, frame.number));
        }
        frames.push(frame);
    }
    Ok(frames)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(name: &str, range: &str) -> Vec<(u32, String)> {
        values(name, range).unwrap().into_iter().map(|mut f| (f.number, f.defines.remove(0).1)).collect()
    }

    #[test]
    fn ranges_keep_their_decimals() {
        let frame = |number, value: &str| (number, value.to_owned());
        assert_eq!(shown("t", "8..10"), [frame(8, "8"), frame(9, "9"), frame(10, "10")]);
        assert_eq!(shown("t", "-0.1..0.1:0.1"), [frame(1, "-0.1"), frame(2, "0.0"), frame(3, "0.1")]);
        assert_eq!(shown("t", "1..0:-0.5"), [frame(1, "1.0"), frame(2, "0.5"), frame(3, "0.0")]);
        assert_eq!(shown("t", "0..10:4"), [frame(0, "0"), frame(4, "4"), frame(8, "8")]);
        for wrong in ["", "1", "1..", "1..2:0", "1..2:-1", "a..b", "0..1e3", "1..2:x", "0..9999999", "..", "1..2..3"] {
            assert!(values("t", wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn numbers_take_the_place_of_signs() {
        let of = |path: &str, number| numbered(Path::new(path), number).map(|p| p.to_str().unwrap().to_owned());
        assert_eq!(of("a/fog.####.exr", 7).as_deref(), Some("a/fog.0007.exr"));
        assert_eq!(of("fog#.exr", 123).as_deref(), Some("fog123.exr"));
        assert_eq!(of("a#/fog.exr", 7), None);
    }
}
