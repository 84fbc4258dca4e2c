//! `vdf compare`.

use std::{io::Write as _, path::Path};

use anyhow::{Context as _, anyhow};
use vdf_image::{
    Image, ImageError, ImageFormat, check_writable,
    metrics::{Comparison, DynamicRange, compare, write_error_map},
    read_image, shown,
};
use vdf_render::{RenderError, on_threads};

use crate::{args::CompareArgs, failure::Failure};

pub(crate) fn run(args: &CompareArgs) -> Result<(), Failure> {
    if let Some(map) = &args.map {
        check_map(map, args)?;
    }
    let (a, b, range) = read(args)?;
    // The default pool would panic if it could not start.
    let comparison = on_threads(None, || Ok::<_, RenderError>(compare(&a, &b, range, args.ppd)))?;
    let comparison = comparison.map_err(|e| match e {
        // The library knows no names of files.
        ImageError::Uncomparable { image, reason } => {
            let path = if image == "image" { &args.a } else { &args.b };
            Failure::Usage(anyhow!("cannot compare: {} {reason}", shown(path)))
        }
        ImageError::PixelsPerDegree { value } => {
            Failure::Usage(anyhow!("--ppd must be from 1 to 1000 pixels, not {value}"))
        }
        e => e.into(),
    })?;
    if let Some(map) = &args.map {
        write_error_map(map, &comparison.map)?;
    }
    let stdout = &mut std::io::stdout();
    if args.json {
        let json = serde_json::to_string_pretty(&comparison).map_err(|e| Failure::Work(e.into()))?;
        writeln!(stdout, "{json}")?;
    } else {
        write!(stdout, "{}", table(&comparison))?;
    }
    match args.max_relmse {
        Some(max) if comparison.rel_mse > max => {
            Err(Failure::Work(anyhow!("relmse {:e} is more than --max-relmse {max:e}", comparison.rel_mse)))
        }
        _ => Ok(()),
    }
}

/// Fails now if the map cannot be written, or would replace an image.
fn check_map(map: &Path, args: &CompareArgs) -> Result<(), Failure> {
    let canonical = |path: &Path| path.canonicalize().ok();
    if canonical(map)
        .is_some_and(|map| [&args.a, &args.b].into_iter().any(|image| canonical(image).as_ref() == Some(&map)))
    {
        return Err(Failure::Usage(anyhow!("--map {}: that is one of the images; give another name", shown(map))));
    }
    if map.extension().is_none_or(|e| !e.eq_ignore_ascii_case("png")) {
        return Err(Failure::Usage(anyhow!("--map {}: the map is a PNG; give a name that ends in .png", shown(map))));
    }
    check_writable(map).with_context(|| format!("cannot write {}", shown(map))).map_err(Failure::Work)
}

fn read(args: &CompareArgs) -> Result<(Image, Image, DynamicRange), Failure> {
    // Not the failure of a comparison: 1 means that the images differ too much.
    let image = |path: &Path| read_image(path).map_err(|e| Failure::Usage(e.into()));
    let (a, a_format) = image(&args.a)?;
    let (b, b_format) = image(&args.b)?;
    let range = match (a_format, b_format) {
        (ImageFormat::Exr, ImageFormat::Exr) => DynamicRange::High,
        (ImageFormat::Png, ImageFormat::Png) => DynamicRange::Low,
        (ImageFormat::Exr, ImageFormat::Png) => return Err(mixed(&args.a, &args.b)),
        (ImageFormat::Png, ImageFormat::Exr) => return Err(mixed(&args.b, &args.a)),
    };
    Ok((a, b, range))
}

fn mixed(exr: &Path, png: &Path) -> Failure {
    Failure::Usage(anyhow!(
        "{} is an EXR and {} a PNG, which is rounded and clamped: compare EXR with EXR or PNG with PNG (vdf render writes both)",
        shown(exr),
        shown(png)
    ))
}

/// One figure a line, aligned.
fn table(c: &Comparison) -> String {
    let ssim =
        c.ssim.map_or_else(|| "none, an image of less than 11 x 11 pixels".to_owned(), |ssim| format!("{ssim:.6}"));
    let mut lines = vec![
        ("mse", format!("{:.6e}", c.mse)),
        ("mae", format!("{:.6e}", c.mae)),
        ("relmse", format!("{:.6e}", c.rel_mse)),
        ("psnr", format!("{:.4} dB", c.psnr)),
        ("ssim", ssim),
        ("flip-ldr", format!("{:.6}", c.flip_ldr)),
    ];
    lines.extend(c.flip_hdr.map(|flip| ("flip-hdr", format!("{flip:.6}"))));
    lines.push(("identical", if c.identical { "yes" } else { "no" }.to_owned()));
    lines.into_iter().map(|(name, value)| format!("{:<11}{value}\n", format!("{name}:"))).collect()
}
