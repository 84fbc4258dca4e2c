//! The command line as typed.

mod convergence;
mod long;
mod picture;
mod report;

use std::{path::PathBuf, str::FromStr};

use clap::{
    Args, Parser, Subcommand, ValueEnum,
    builder::{PossibleValue, PossibleValuesParser, TypedValueParser},
};
use vdf_image::metrics::PIXELS_PER_DEGREE;
use vdf_render::{GridExtent, Integrator, Layer, SegmentSamples};
use vdf_scene::PixelRect;
use vdf_visibility::{Method, UnknownMethod};

pub(crate) use convergence::ReportConvergenceArgs;
pub(crate) use long::{FrameRange, LongArgs, MergeArgs, ProgressName};
pub(crate) use picture::PictureArgs;
pub(crate) use report::{
    ReportArgs, ReportCommand, ReportFiles, ReportQueriesArgs, ReportScalingArgs, ReportThesisArgs,
};

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
    Merge(MergeArgs),
    Scene(SceneArgs),
    Verify(VerifyArgs),
    Voxelize(VoxelizeArgs),
    Compare(CompareArgs),
    Report(ReportArgs),
}

/// Render a scene to an EXR and a PNG.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:
  vdf render                                       the built-in scene cbox_vol2
  vdf render --method amr-sn --voxel 8 -o fog.exr  with a method and a voxel size
  vdf render scene.xml -D spp=64 --stats fog.json  a Mitsuba 3 scene with a parameter
  vdf render cbox_vol4 --integrator raymarch --samples-per-segment 49 --spp 4
  vdf render --record-queries fog.vdfq             also records visibility queries, to replay them
  vdf render --spp 4096 --checkpoint fog.film --resume   may be killed and run again; SIGUSR1 shows the picture so far
  vdf render --shard 3/8 -o 3.film                 an eighth of the samples, for vdf merge

Exit codes: 0 done, 1 failure while rendering or writing, 2 usage or scene error, 130 interrupted.")]
pub(crate) struct RenderArgs {
    /// A scene file (a subset of Mitsuba 3 XML) or the name of a built-in scene [default: cbox_vol2]
    pub(crate) scene: Option<PathBuf>,
    /// The EXR to write; a PNG is written beside it [default: the scene's name in the current folder]
    #[arg(short, long, value_name = "OUT.exr")]
    pub(crate) output: Option<PathBuf>,
    /// Acceleration of visibility queries; the image is the same with all. "auto" follows some paths first, a hundredth of the render, and takes what renders this many
    /// samples soonest: no method, xsn or lb [default: auto; with --segment-first amr-xsn; where an --aov depends on it lb, or amr-xsn beyond 10,000 triangles]
    #[arg(long, value_name = "METHOD", value_parser = method_choice_parser())]
    pub(crate) method: Option<MethodChoice>,
    /// Texels along each side of a face of a light buffer (method lb), rounded up to a power of two [default: auto, about
    /// as many in all as there are triangles]
    #[arg(long, value_name = "auto|TEXELS", value_parser = parse_texels)]
    pub(crate) light_buffer: Option<Texels>,
    /// Side of a voxel in world units [default: a 128th of the longest side of what they cover]
    #[arg(long, value_name = "SIZE", allow_negative_numbers = true)]
    pub(crate) voxel: Option<f64>,
    /// What the voxels cover: the occluders and the lights near them, or the whole scene with fog and camera
    #[arg(long, value_enum, default_value_t = GridName::Occluders)]
    pub(crate) grid: GridName,
    /// How light is followed
    #[arg(long, value_name = "INTEGRATOR", default_value = "volpath", value_parser = integrator_parser())]
    pub(crate) integrator: Integrator,
    /// Samples on each path segment, for raymarch only; auto takes as many as the segment is worth, up to 16 [default: 7]
    #[arg(long, value_name = "auto|N")]
    pub(crate) samples_per_segment: Option<SegmentSamples>,
    /// Transmittance towards emitters: exp(-tau), or the 0/1 estimate of other renderers, noisier and of the same mean
    #[arg(long, value_enum, default_value_t = TransmittanceName::Analytic)]
    pub(crate) transmittance: TransmittanceName,
    /// When paths are ended by chance: as in Mitsuba 3, or earlier, as in the thesis's renderer; the mean is the same
    #[arg(long, value_enum, default_value_t = RouletteName::Standard)]
    pub(crate) roulette: RouletteName,
    /// How light is looked for: as in the thesis, or with distances drawn towards point lights, too, which is less noisy; "lit" looks only where a ray is lit; all of the same mean
    #[arg(long, value_enum, default_value_t = EstimatorName::Equiangular)]
    pub(crate) estimator: EstimatorName,
    /// Connect paths to rays from the lights (volpath, not with the estimator thesis): less noise where light comes from other surfaces; auto tries it on some paths
    #[arg(long, value_enum, default_value_t = LightPathsName::Auto)]
    pub(crate) light_paths: LightPathsName,
    /// How the samples of a pixel are spread: each for itself, or so that they fill it, which is less noisy
    #[arg(long, value_enum, default_value_t = SamplerName::Sobol)]
    pub(crate) sampler: SamplerName,
    /// Ask for a proof of each free flight before a ray is cast for it (volpath); the image is the same
    #[arg(long)]
    pub(crate) segment_first: bool,
    /// Samples per pixel [default: the scene's]
    #[arg(long, value_name = "N")]
    pub(crate) spp: Option<u32>,
    /// Seed of the random numbers [default: the scene's]
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Number of threads [default: one for each processor]
    #[arg(short = 'j', long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Which sensor of the scene file, counted from 0 [default: the first]
    #[arg(long, value_name = "N")]
    pub(crate) sensor: Option<usize>,
    /// Set a parameter of the scene file; may be given several times
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parse_define)]
    pub(crate) defines: Vec<(String, String)>,
    /// Render only these pixels of the full image (x1 and y1 are one past the last)
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = parse_crop)]
    pub(crate) crop: Option<PixelRect>,
    /// Layers to write into the EXR beside the picture, separated by commas: albedo, normal, depth, position, variance, samples, cost, unknown
    #[arg(long, value_name = "LAYERS", value_delimiter = ',')]
    pub(crate) aov: Vec<Layer>,
    /// Write the statistics as JSON
    #[arg(long, value_name = "FILE.json")]
    pub(crate) stats: Option<PathBuf>,
    /// Write visibility queries of this render, to replay them with vdf report queries; followed in a pass of their
    /// own after the render, which they neither change nor slow
    #[arg(long, value_name = "FILE")]
    pub(crate) record_queries: Option<PathBuf>,
    /// The most queries to record: those of whole paths, chosen at random but the same in every run
    #[arg(long, default_value = "1e6", value_name = "N", value_parser = parse_count, requires = "record_queries")]
    pub(crate) max_queries: u64,
    /// No progress and no statistics in words; errors and warnings only
    #[arg(short, long)]
    pub(crate) quiet: bool,
    #[command(flatten)]
    pub(crate) picture: PictureArgs,
    #[command(flatten)]
    pub(crate) long: LongArgs,
}

/// A method as typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MethodChoice {
    /// Whatever a pilot finds.
    Auto,
    One(Method),
}

impl FromStr for MethodChoice {
    type Err = UnknownMethod;

    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        if name == "auto" { Ok(Self::Auto) } else { name.parse().map(Self::One) }
    }
}

/// The side of a light buffer's faces as typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Texels(pub(crate) Option<u32>);

fn parse_texels(text: &str) -> Result<Texels, String> {
    match text {
        "auto" => Ok(Texels(None)),
        _ => text.parse().map(|n| Texels(Some(n))).map_err(|_| "must be auto or a whole number".to_owned()),
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum GridName {
    Occluders,
    Scene,
}

impl From<GridName> for GridExtent {
    fn from(name: GridName) -> Self {
        match name {
            GridName::Occluders => Self::Occluders,
            GridName::Scene => Self::Scene,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RouletteName {
    Standard,
    Thesis,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TransmittanceName {
    Analytic,
    Analog,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum LightPathsName {
    Auto,
    Always,
    Never,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SamplerName {
    Independent,
    Sobol,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum EstimatorName {
    Thesis,
    Equiangular,
    Lit,
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
    /// Write a built-in scene with its meshes and volumes, to edit it or to load it in Mitsuba 3
    #[command(after_help = "Examples:
  vdf scene write cbox_vol2 my-scene                      a scene to start from
  vdf scene write san-miguel court --triangles 1e7        a generated scene in another size (0.7 GB)
  vdf scene write smoke . --voxels 16777216               a grid of 256 × 256 × 256 (64 MB, half a minute)")]
    Write {
        /// Name of the scene
        name: String,
        /// Folder to write to; made if it does not exist
        #[arg(default_value = ".")]
        folder: PathBuf,
        /// Replace files that are there and differ
        #[arg(long)]
        force: bool,
        /// About how many triangles a generated scene gets, from 100000 to 10000000
        #[arg(long, value_name = "N", value_parser = parse_size)]
        triangles: Option<u32>,
        /// About how many voxels a generated volume gets, from 32768 to 100000000
        #[arg(long, value_name = "N", value_parser = parse_size)]
        voxels: Option<u32>,
    },
}

/// Try to make a proof wrong: ask about many segments, hard ones above all, and check every proof.
#[derive(Debug, Args)]
#[command(
    after_help = "Every proof is checked by the exact hierarchy, and by a loop over all triangles as often as that is
affordable. With n proofs and none wrong, the chance of a wrong one is below 3/n with 95 % confidence,
among segments so distributed (rule of three).

Examples:
  vdf verify                                      a million segments in the built-in scene cbox_vol2
  vdf verify scene.xml --segments 1e8 --voxel 4,8  all methods with two voxel sizes
  vdf verify cbox_vol3 --method amr-sn --seed 7   one method, other segments

Exit codes: 0 every proof is right, 1 a proof is wrong, 2 usage or scene error, 130 interrupted."
)]
pub(crate) struct VerifyArgs {
    /// A scene file (a subset of Mitsuba 3 XML) or the name of a built-in scene [default: cbox_vol2]
    pub(crate) scene: Option<PathBuf>,
    /// Number of segments, such as 5000000 or 1e8
    #[arg(long, default_value = "1e6", value_name = "N", value_parser = parse_count)]
    pub(crate) segments: u64,
    /// Methods, separated by commas; all are asked about the same segments
    #[arg(long = "method", default_value = "all", value_name = "all|METHOD", value_delimiter = ',')]
    pub(crate) methods: Vec<Methods>,
    /// Sides of voxels in world units, separated by commas [default: a 128th of the longest side of what they cover]
    #[arg(long = "voxel", value_name = "SIZE", value_delimiter = ',', allow_negative_numbers = true)]
    pub(crate) voxel_sizes: Vec<f64>,
    /// What the voxels cover: the occluders and the lights near them, or the whole scene with fog and camera
    #[arg(long, value_enum, default_value_t = GridName::Occluders)]
    pub(crate) grid: GridName,
    /// Seed of the segments
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub(crate) seed: u64,
    /// Number of threads [default: one for each processor]
    #[arg(short = 'j', long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Which sensor of the scene file, counted from 0 [default: the first]
    #[arg(long, value_name = "N")]
    pub(crate) sensor: Option<usize>,
    /// Set a parameter of the scene file; may be given several times
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parse_define)]
    pub(crate) defines: Vec<(String, String)>,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE.json")]
    pub(crate) stats: Option<PathBuf>,
    /// No progress; the results only
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

/// A choice of methods that prove something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Methods {
    All,
    One(Method),
}

impl FromStr for Methods {
    type Err = UnknownMethod;

    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        if name == "all" { Ok(Self::All) } else { name.parse().map(Self::One) }
    }
}

/// Show what a method works on: the occupied voxels and the safe neighbourhoods of the lights.
#[derive(Debug, Args)]
#[command(
    after_help = "With --export the folder gets, for the occupied voxels and for each light with a neighbourhood, a surface
(.obj, in world units) and a list of linear indices a + b*X + c*X*Y (.txt).

Examples:
  vdf voxelize                                      figures of the built-in scene cbox_vol2
  vdf voxelize cbox_vol3 --voxel 16 --export voxels  with files to look at
  vdf voxelize scene.xml --method ndf-sn --export .  the neighbourhoods of another method

Exit codes: 0 done, 1 failure while writing, 2 usage or scene error, 130 interrupted."
)]
pub(crate) struct VoxelizeArgs {
    /// A scene file (a subset of Mitsuba 3 XML) or the name of a built-in scene [default: cbox_vol2]
    pub(crate) scene: Option<PathBuf>,
    /// Side of a voxel in world units [default: a 128th of the longest side of what they cover]
    #[arg(long, value_name = "SIZE", allow_negative_numbers = true)]
    pub(crate) voxel: Option<f64>,
    /// What the voxels cover: the occluders and the lights near them, or the whole scene with fog and camera
    #[arg(long, value_enum, default_value_t = GridName::Occluders)]
    pub(crate) grid: GridName,
    /// Method that proves which voxels see a light
    #[arg(long, default_value_t = Method::best_with_voxels(), value_name = "METHOD", value_parser = method_parser())]
    pub(crate) method: Method,
    /// Folder to write the voxels to; made if it does not exist
    #[arg(long, value_name = "DIR")]
    pub(crate) export: Option<PathBuf>,
    /// Number of threads [default: one for each processor]
    #[arg(short = 'j', long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Which sensor of the scene file, counted from 0 [default: the first]
    #[arg(long, value_name = "N")]
    pub(crate) sensor: Option<usize>,
    /// Set a parameter of the scene file; may be given several times
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parse_define)]
    pub(crate) defines: Vec<(String, String)>,
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

Exit codes: 0 compared, 1 relmse is more than --max-relmse or the map cannot be written, 2 images that cannot be
read or compared.")]
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

/// Methods by name; the help lists them all.
fn method_parser() -> impl TypedValueParser<Value = Method> {
    PossibleValuesParser::new(Method::all().map(Method::name)).try_map(|name| name.parse::<Method>())
}

/// The same, and what chooses one.
fn method_choice_parser() -> impl TypedValueParser<Value = MethodChoice> {
    let names = std::iter::once("auto").chain(Method::all().map(Method::name));
    PossibleValuesParser::new(names).try_map(|name| name.parse::<MethodChoice>())
}

/// Integrators by name; the help lists them all.
pub(crate) fn integrator_parser() -> impl TypedValueParser<Value = Integrator> {
    let names = Integrator::NAMES.map(|(name, help)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new(names).try_map(|name| name.parse::<Integrator>())
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

/// A whole number, also as a power of ten.
fn parse_count(text: &str) -> Result<u64, String> {
    let floating =
        || text.parse::<f64>().ok().filter(|x| x.fract() == 0.0 && (0.0..=1e15).contains(x)).map(|x| x as u64);
    let count: Option<u64> = text.parse().ok().or_else(floating);
    count
        .filter(|n| *n <= 1_000_000_000_000_000)
        .ok_or_else(|| "expected a whole number of at most 1e15, such as 5000000 or 1e8".to_owned())
}

/// As [`parse_count`], of the parts of a scene.
fn parse_size(text: &str) -> Result<u32, String> {
    u32::try_from(parse_count(text)?).map_err(|_| format!("expected at most {}", u32::MAX))
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
