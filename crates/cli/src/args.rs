//! The command line as typed.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use vdf_render::{Method, metrics::PIXELS_PER_DEGREE, scene::PixelRect};

/// Render fog, smoke and haze; prove most shadow segments unoccluded instead of tracing them.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 100)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Render(RenderArgs),
    Scene(SceneArgs),
    Compare(CompareArgs),
}

/// Render a scene to an EXR and a PNG.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  vdf render                                       the built-in scene cbox_vol2
  vdf render --method amr-sn --voxel 8 -o fog.exr  with a method and a voxel size
  vdf render scene.xml -D spp=64 --stats fog.json  a Mitsuba 3 scene with a parameter
  vdf render cbox_vol4 --integrator raymarch --samples-per-segment 49 --spp 4

Exit codes: 0 done, 1 failure while rendering or writing, 2 usage or scene error, 130 interrupted.")]
pub(crate) struct RenderArgs {
    /// A scene file (a subset of Mitsuba 3 XML) or the name of a built-in scene [default: cbox_vol2]
    pub(crate) scene: Option<PathBuf>,
    /// The EXR to write; a PNG is written beside it [default: the scene's name in the current folder]
    #[arg(short, long, value_name = "OUT.exr")]
    pub(crate) output: Option<PathBuf>,
    /// Acceleration of visibility queries: none, ndf, amr, ndf-sn or amr-sn; the image is the same with all
    #[arg(long, default_value_t, value_name = "METHOD")]
    pub(crate) method: Method,
    /// Side of a voxel in world units [default: a 128th of the scene's longest side]
    #[arg(long, value_name = "SIZE", allow_negative_numbers = true)]
    pub(crate) voxel: Option<f64>,
    /// Path tracing of all scattering, or ray marching of single scattering
    #[arg(long, value_enum, default_value_t = IntegratorName::Volpath)]
    pub(crate) integrator: IntegratorName,
    /// Samples on each path segment, for raymarch only [default: 7]
    #[arg(long, value_name = "N")]
    pub(crate) samples_per_segment: Option<u32>,
    /// Samples per pixel [default: the scene's]
    #[arg(long, value_name = "N")]
    pub(crate) spp: Option<u32>,
    /// Seed of the random numbers [default: the scene's]
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Number of threads [default: one for each processor]
    #[arg(short = 'j', long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Set a parameter of the scene file; may be given several times
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parse_define)]
    pub(crate) defines: Vec<(String, String)>,
    /// Render only these pixels of the full image (x1 and y1 are one past the last)
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = parse_crop)]
    pub(crate) crop: Option<PixelRect>,
    /// Write the statistics as JSON
    #[arg(long, value_name = "FILE.json")]
    pub(crate) stats: Option<PathBuf>,
    /// No progress and no statistics in words; errors and warnings only
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum IntegratorName {
    Volpath,
    Raymarch,
}

/// List the built-in scenes, or write one to disk.
#[derive(Debug, Args)]
pub(crate) struct SceneArgs {
    #[command(subcommand)]
    pub(crate) command: SceneCommand,
}

#[derive(Debug, Subcommand)]
pub(crate) enum SceneCommand {
    /// List the built-in scenes
    List,
    /// Write a built-in scene and its meshes, to edit it or to load it in Mitsuba 3
    Write {
        /// Name of the scene
        name: String,
        /// Folder to write to; made if it does not exist
        #[arg(default_value = ".")]
        folder: PathBuf,
    },
}

/// Compare an image with a reference: two EXR, or two PNG.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  vdf compare fog.exr reference.exr --map error.png
  vdf compare fog.exr reference.exr --max-relmse 1e-3 || echo too noisy

Of linear values (a PNG is decoded as sRGB), over all pixels and channels:
  mse       mean squared error
  mae       mean absolute error
  relmse    mean of (A - B)^2 / (B^2 + 0.01 * (mean of B)^2)
Of values as displayed, that is clamped to [0, 1] and encoded as sRGB:
  psnr      peak signal-to-noise ratio with the peak 1
  ssim      structural similarity, window of 11 x 11 pixels, mean of the channels; 1 is equal
Perceived differences, mean over the pixels, 0 is equal, 1 is the worst:
  flip-ldr  FLIP of the values clamped to [0, 1]
  flip-hdr  FLIP over all exposures that suit B; for EXR only
And whether all pixels are the same, bit for bit.

Exit codes: 0 compared, 1 relmse is more than --max-relmse or a file cannot be read or written,
2 images that cannot be compared.")]
pub(crate) struct CompareArgs {
    /// The image
    pub(crate) a: PathBuf,
    /// The reference
    pub(crate) b: PathBuf,
    /// Write the map of FLIP (HDR-FLIP for EXR) in the colours of magma: black is equal, light yellow the worst
    #[arg(long, value_name = "FILE.png")]
    pub(crate) map: Option<PathBuf>,
    /// Exit with 1 if relmse is more than this
    #[arg(long, value_name = "X", value_parser = parse_limit, allow_negative_numbers = true)]
    pub(crate) max_relmse: Option<f64>,
    /// Pixels per degree of the observer's eye, for FLIP [default: 67.02, a 0.7 m wide display of 3840 pixels at 0.7 m]
    #[arg(long, value_name = "N", default_value_t = PIXELS_PER_DEGREE, hide_default_value = true, allow_negative_numbers = true)]
    pub(crate) ppd: f64,
    /// Print the figures as JSON; what is infinite or not defined is null
    #[arg(long)]
    pub(crate) json: bool,
}

fn parse_limit(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(limit) if limit >= 0.0 => Ok(limit),
        _ => Err("expected a number of 0 or more".to_owned()),
    }
}

fn parse_define(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => Ok((name.to_owned(), value.to_owned())),
        _ => Err("expected NAME=VALUE".to_owned()),
    }
}

fn parse_crop(text: &str) -> Result<PixelRect, String> {
    let numbers: Vec<u32> = text
        .split(',')
        .map(|n| n.trim().parse().map_err(|_| format!("'{n}' is not a number of pixels")))
        .collect::<Result<_, _>>()?;
    match numbers[..] {
        [x0, y0, x1, y1] => Ok(PixelRect { x0, y0, x1, y1 }),
        _ => Err("expected four numbers, X0,Y0,X1,Y1".to_owned()),
    }
}
