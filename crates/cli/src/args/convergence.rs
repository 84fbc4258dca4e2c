//! The command line of `vdf report convergence`.

use std::path::PathBuf;

use clap::Args;
use vdf_render::{Integrator, SegmentSamples};

use super::{Methods, ReportFiles, integrator_parser, parse_define, report::about};

#[derive(Debug, Args)]
#[command(
    about = about("convergence"),
    after_help = "Each integrator has a reference of its own, for they converge to different images: volpath to all scattering,
raymarch to single scattering in the medium. A reference is two independent halves; their difference bounds its
own error, which is subtracted, and no error is claimed that is not four times as large. References are kept in
a folder, and checked before they are used again.

Renders have 1, 2, 4, ... samples per pixel. Methods take turns and their images are compared bit by bit, so a
method changes the time only. Times include T_build; medians over the seeds with their intervals.

Examples:
  vdf report convergence --quick                                 a look
  vdf report convergence --html convergence.html --csv convergence.csv
  vdf report convergence cbox_vol4 --integrator raymarch --samples-per-segment 1,7,49 --size 128
  vdf report convergence scape --methods all --max-spp 256 --seeds 9

Exit codes: 0 done, 1 an image is wrong or a file cannot be written, 2 usage or scene error, 130 interrupted."
)]
pub(crate) struct ReportConvergenceArgs {
    /// A scene file (a subset of Mitsuba 3 XML) or the name of a built-in scene [default: cbox_vol2]
    pub(crate) scene: Option<PathBuf>,
    /// Methods, separated by commas; the hierarchy alone is always measured
    #[arg(long, default_value = "ndf,amr,amr-xsn", value_name = "all|METHOD", value_delimiter = ',')]
    pub(crate) methods: Vec<Methods>,
    /// Side of a voxel in world units [default: a 128th of the scene's longest side]
    #[arg(long, value_name = "SIZE", allow_negative_numbers = true)]
    pub(crate) voxel: Option<f64>,
    /// Integrators, separated by commas
    #[arg(long, value_name = "INTEGRATOR", default_value = "volpath,raymarch", value_delimiter = ',', value_parser = integrator_parser())]
    pub(crate) integrator: Vec<Integrator>,
    /// Samples on each path segment, for raymarch only; several are separated by commas [default: 7]
    #[arg(long, value_name = "auto|N", value_delimiter = ',')]
    pub(crate) samples_per_segment: Vec<SegmentSamples>,
    /// The most samples per pixel; renders have 1, 2, 4, ... up to this [default: 32, or 8 with --quick]
    #[arg(long, value_name = "N")]
    pub(crate) max_spp: Option<u32>,
    /// Samples per pixel of the references [default: 16 times the most]
    #[arg(long, value_name = "N")]
    pub(crate) reference_spp: Option<u32>,
    /// How many seeds medians are taken over, at least 5
    #[arg(long, default_value_t = 5, value_name = "N")]
    pub(crate) seeds: usize,
    /// The first seed; others follow it
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub(crate) seed: u64,
    /// Width of the images in pixels, the height in proportion [default: 48, or 24 with --quick]
    #[arg(long, value_name = "N")]
    pub(crate) size: Option<u32>,
    /// Small images and few samples
    #[arg(long)]
    pub(crate) quick: bool,
    /// Folder of the references; made if it does not exist [default: vdf-references where the system keeps caches]
    #[arg(long, value_name = "DIR")]
    pub(crate) cache: Option<PathBuf>,
    /// Which sensor of the scene file, counted from 0 [default: the first]
    #[arg(long, value_name = "N")]
    pub(crate) sensor: Option<usize>,
    /// Set a parameter of the scene file; may be given several times
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parse_define)]
    pub(crate) defines: Vec<(String, String)>,
    /// Number of threads [default: one for each processor]
    #[arg(short = 'j', long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    #[command(flatten)]
    pub(crate) files: ReportFiles,
}
