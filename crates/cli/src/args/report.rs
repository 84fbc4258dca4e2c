//! The command line of `vdf report`.

use std::path::PathBuf;

use clap::{
    Args, Subcommand,
    builder::{PossibleValuesParser, TypedValueParser as _},
};
use vdf_lab::report::{REPORTS, scaling::SweepKind, thesis::ThesisOptions};
use vdf_render::{Integrator, SegmentSamples};

use super::{Methods, ReportConvergenceArgs, integrator_parser, parse_count, parse_define};

/// What the report does, as its library says it.
pub(super) fn about(name: &str) -> &'static str {
    REPORTS.iter().find(|r| r.name == name).map_or("", |r| r.about)
}

/// Measure, and write what was measured as a page, as CSV or as JSON.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  vdf report queries cbox_vol4 --voxel 4,8,16       what a query costs, by each method and by the hierarchy alone
  vdf report convergence --html convergence.html    speed against error, by each method and integrator
  vdf report scaling --html scaling.html            how costs grow with triangles, voxels, lights and threads
  vdf report thesis --quick --html thesis.html      the tables of the thesis beside this program's, in miniature")]
pub(crate) struct ReportArgs {
    #[command(subcommand)]
    pub(crate) command: ReportCommand,
}

#[derive(Debug, Subcommand)]
pub(crate) enum ReportCommand {
    Queries(ReportQueriesArgs),
    Convergence(ReportConvergenceArgs),
    Scaling(ReportScalingArgs),
    Thesis(ReportThesisArgs),
}

#[derive(Debug, Args)]
#[command(
    about = about("queries"),
    after_help = "Every answer of every method is compared with that of the hierarchy before anything is timed. Times are
nanoseconds a query, medians of passes over the whole stream that take turns; no timer runs inside a pass.

  t_query   the hierarchy alone              p_acc|sp  share of the spatial queries that are proved
  t_acc     the attempt of a proof           u         1 - p_acc|sp, the unknown fraction
  t_eff     the proof, else the hierarchy    speed-up  t_query / t_eff, below 1 the method loses

--export writes triangles.bin and queries.bin, to time other programs on the same queries; the formats are in
docs/query-streams.md.

Examples:
  vdf report queries                                     records volpath's queries in cbox_vol2 and replays them
  vdf report queries cbox_vol4 --voxel 4,8,16 --integrator raymarch --samples-per-segment 49 --html fog.html
  vdf render scape --record-queries scape.vdfq && vdf report queries scape --queries scape.vdfq --methods amr,amr-sn
  vdf report queries san-miguel --export court           the same queries for another program

Exit codes: 0 done, 1 an answer is wrong or a file cannot be written, 2 usage or scene error, 130 interrupted."
)]
pub(crate) struct ReportQueriesArgs {
    /// A scene file (a subset of Mitsuba 3 XML) or the name of a built-in scene [default: cbox_vol2]
    pub(crate) scene: Option<PathBuf>,
    /// Methods, separated by commas; the hierarchy alone is always measured
    #[arg(long, default_value = "all", value_name = "all|METHOD", value_delimiter = ',')]
    pub(crate) methods: Vec<Methods>,
    /// Sides of voxels in world units, separated by commas [default: a 128th of the scene's longest side]
    #[arg(long = "voxel", value_name = "SIZE", value_delimiter = ',', allow_negative_numbers = true)]
    pub(crate) voxel_sizes: Vec<f64>,
    /// Replay these queries, which vdf render --record-queries wrote, instead of recording some
    #[arg(long, value_name = "FILE", conflicts_with_all = ["integrator", "samples_per_segment", "spp", "seed", "max_queries"])]
    pub(crate) queries: Option<PathBuf>,
    /// Whose queries to record
    #[arg(long, value_name = "INTEGRATOR", default_value = "volpath", value_parser = integrator_parser())]
    pub(crate) integrator: Integrator,
    /// Samples on each path segment, for raymarch only [default: 7]
    #[arg(long, value_name = "auto|N")]
    pub(crate) samples_per_segment: Option<SegmentSamples>,
    /// Samples per pixel of the render that is recorded [default: the scene's]
    #[arg(long, value_name = "N")]
    pub(crate) spp: Option<u32>,
    /// Seed of the render that is recorded [default: the scene's]
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// The most queries to record: those of whole paths, chosen at random but the same in every run
    #[arg(long, default_value = "2e5", value_name = "N", value_parser = parse_count)]
    pub(crate) max_queries: u64,
    /// Passes that a median is taken of
    #[arg(long, default_value_t = 7, value_name = "N")]
    pub(crate) passes: u32,
    /// Folder to write the triangles and the queries to, for other programs; made if it does not exist
    #[arg(long, value_name = "DIR")]
    pub(crate) export: Option<PathBuf>,
    /// Which sensor of the scene file, counted from 0 [default: the first]
    #[arg(long, value_name = "N")]
    pub(crate) sensor: Option<usize>,
    /// Set a parameter of the scene file; may be given several times
    #[arg(short = 'D', value_name = "NAME=VALUE", value_parser = parse_define)]
    pub(crate) defines: Vec<(String, String)>,
    /// Number of threads to record and to build; queries are timed on one [default: one for each processor]
    #[arg(short = 'j', long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    #[command(flatten)]
    pub(crate) files: ReportFiles,
}

#[derive(Debug, Args)]
#[command(
    about = about("scaling"),
    after_help = "Each sweep doubles one thing (refined: times four) and leaves the others alone. Exponents are slopes of a least-squares line through the
logarithms; the slope of the last step is beside them, since small sizes are not asymptotic.

  triangles   san-miguel, 100000 and more: hierarchy, voxels, fields, memory, the time of a query and of a proof
  refined     cbox_vol2, each triangle split into four, 7680 triangles and more: the same
  voxels      cbox_vol2, as many as cubes of 32 and more a side: all fields and neighbourhoods, memory, t_acc, p_acc|sp
  lights      cbox_vol2 with 1 and more point lights: neighbourhoods, memory, renders
  threads     san-miguel: renders, voxels, fields; the efficiency of more than one

Answers of proofs are compared with the hierarchy's, images bit by bit between methods and numbers of threads.

Examples:
  vdf report scaling --quick                                         a look
  vdf report scaling --html scaling.html --csv scaling.csv           a minute and a half on two cores
  vdf report scaling --only triangles --max-triangles 1e7            takes gigabytes of memory
  vdf report scaling --only voxels --max-voxels-per-side 512 --repetitions 3

Exit codes: 0 done, 1 an answer or image is wrong or a file cannot be written, 2 usage error, 130 interrupted."
)]
pub(crate) struct ReportScalingArgs {
    /// Sweeps, separated by commas
    #[arg(long, value_name = "SWEEP", value_delimiter = ',', default_value = "triangles,refined,voxels,lights,threads",
        value_parser = PossibleValuesParser::new(SweepKind::ALL.map(SweepKind::name)).try_map(|name| name.parse::<SweepKind>()))]
    pub(crate) only: Vec<SweepKind>,
    /// Smaller sizes, fewer repetitions
    #[arg(long)]
    pub(crate) quick: bool,
    /// The most triangles, from 100000 to 10000000 [default: 1e6, or 4e5 with --quick]
    #[arg(long, value_name = "N", value_parser = parse_count)]
    pub(crate) max_triangles: Option<u64>,
    /// The most voxels, as the side of a cube, from 32 to 512 [default: 256, or 128 with --quick]
    #[arg(long, value_name = "N")]
    pub(crate) max_voxels_per_side: Option<u32>,
    /// The most point lights, from 1 to 1024 [default: 64, or 16 with --quick]
    #[arg(long, value_name = "N")]
    pub(crate) max_lights: Option<u32>,
    /// The most threads, from 1 to 1024 [default: one for each processor]
    #[arg(long, value_name = "N")]
    pub(crate) max_threads: Option<usize>,
    /// Measurements that a median is taken of [default: 5, or 3 with --quick]
    #[arg(long, value_name = "N")]
    pub(crate) repetitions: Option<u32>,
    /// Side of the images in pixels [default: 128, or 48 with --quick]
    #[arg(long, value_name = "N")]
    pub(crate) size: Option<u32>,
    /// Seed of the renders
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub(crate) seed: u64,
    /// Number of threads outside the sweep of threads; queries are timed on one [default: one for each processor]
    #[arg(short = 'j', long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    #[command(flatten)]
    pub(crate) files: ReportFiles,
}

#[derive(Debug, Args)]
#[command(
    about = about("thesis"),
    after_help = "Tables 6.1 to 6.11 and Figure 6.7, for all methods, and the inequality 2.7: the gain that it
predicts and the gain measured. Images are compared bit by bit between all methods. The times of renders are
for one thread, as in the thesis, and for all, and scaled to its images of 512 x 512 pixels if these are smaller.

At full size this takes most of a day; --size 128 a sixteenth of that, --quick a minute. With --resume each
figure is kept as soon as it is measured: the same command goes on where it was stopped.

Examples:
  vdf report thesis --quick                                     a look
  vdf report thesis --size 128 --html thesis.html --csv thesis.csv
  vdf report thesis --scenes scape --methods amr,amr-xsn        part of it
  vdf report thesis --threads 1 --resume cells --html thesis.html    all of it, in as many runs as it takes

Exit codes: 0 done, 1 an answer or image is wrong or a file cannot be written, 2 usage error, 130 interrupted."
)]
pub(crate) struct ReportThesisArgs {
    /// Scenes, separated by commas; cbox_vol2 and cbox_vol3 are in Tables 6.1 and 6.2 only
    #[arg(long, value_name = "SCENE", value_delimiter = ',', default_value = "cbox_vol2,cbox_vol3,cbox_vol4,cbox_vol6,san-miguel,scape",
        value_parser = PossibleValuesParser::new(ThesisOptions::SCENES))]
    pub(crate) scenes: Vec<String>,
    /// Methods, separated by commas
    #[arg(long, default_value = "all", value_name = "all|METHOD", value_delimiter = ',')]
    pub(crate) methods: Vec<Methods>,
    /// Small images, the middle voxel size only, fewer repetitions
    #[arg(long)]
    pub(crate) quick: bool,
    /// Side of the images in pixels [default: 512, or 32 with --quick]
    #[arg(long, value_name = "N")]
    pub(crate) size: Option<u32>,
    /// Seed of the renders
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub(crate) seed: u64,
    /// Number of all threads, whose renders stand beside those on one thread [default: one for each processor]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Keep each figure in this folder as soon as it is measured, and take from it what a stopped run with the same
    /// options has measured
    #[arg(long, value_name = "DIR")]
    pub(crate) resume: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) files: ReportFiles,
}

/// Where a report goes, beside the tables on stdout.
#[derive(Debug, Args)]
pub(crate) struct ReportFiles {
    /// Write a page of tables and plots, all in one file
    #[arg(long, value_name = "FILE.html")]
    pub(crate) html: Option<PathBuf>,
    /// Write every figure as CSV
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) csv: Option<PathBuf>,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE.json")]
    pub(crate) json: Option<PathBuf>,
    /// No progress; the tables only
    #[arg(short, long)]
    pub(crate) quiet: bool,
}
