//! Replaying a stream, per method and voxel size.
//!
//! *Idea.* What is timed is one whole pass over all queries of one class, on one thread. Passes of the hierarchy, of
//! the proofs and of the proofs with the fallback take turns, as often as asked for, forwards and backwards through the
//! methods. So a machine that grows slower or faster does so for all; a median is over the passes of one kind. A pass
//! without any query is timed, too: the loop and the reading of the stream are part of all the other figures.
//!
//! *Cost.* The structures of one voxel size and one kind of field exist at a time, those of up to three methods.

mod figures;
mod passes;
mod run;

use vdf_render::{GridExtent, PreparedScene, Progress, check_voxel_size, on_threads};
use vdf_visibility::Method;

pub use self::figures::{
    ClassReplay, HierarchyReplay, LookUpShares, MethodReplay, ProofReplay, Replay, TimerInfluence, Timing, WrongAnswer,
};
#[cfg(test)]
pub(super) use self::passes::check;
use super::stream::QueryStream;
use crate::LabError;

/// What to replay a stream with.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayOptions {
    /// The methods, at least one; [`Method::NONE`] is measured in any case and may be left out.
    pub methods: Vec<Method>,
    /// Sides of voxels in world units; if empty a 128th of the scene's longest side.
    pub voxel_sizes: Vec<f64>,
    /// What the voxel grids cover.
    pub grid: GridExtent,
    /// Passes over the stream that a median is taken of; at least 1.
    pub passes: u32,
    /// Number of threads that build and check; by default one for each processor. Queries are always timed on one.
    pub threads: Option<usize>,
    /// The largest number of voxels that may be built.
    pub max_voxels: u64,
}

impl Default for ReplayOptions {
    /// All methods, one voxel size, medians of five passes.
    fn default() -> Self {
        Self {
            methods: Method::all().collect(),
            voxel_sizes: vec![],
            grid: GridExtent::default(),
            passes: 5,
            threads: None,
            max_voxels: 1 << 29,
        }
    }
}

impl ReplayOptions {
    /// Checks what can be checked without a scene.
    ///
    /// # Errors
    /// [`vdf_render::RenderError::Option`] names the option and what it has to be.
    pub fn validate(&self) -> Result<(), LabError> {
        if self.passes == 0 {
            return Err(LabError::option("passes", "must be at least 1"));
        }
        if self.methods.iter().all(|&m| m == Method::NONE) {
            let message = "must name a method that proves something, such as amr-sn; none is always measured";
            return Err(LabError::option("methods", message));
        }
        Ok(self.voxel_sizes.iter().try_for_each(|&s| check_voxel_size(s))?)
    }
}

/// Replays `stream` in `prepared`, whose own method does not matter.
///
/// # Errors [`LabError::WrongAnswer`] at the first answer that differs from the hierarchy's, or if that differs from
/// the stream's; [`LabError::NoQueries`] if no query can be proved; an option or voxel size that is not usable; or
/// `progress` asks to stop.
pub fn replay(
    prepared: &PreparedScene,
    stream: &QueryStream,
    options: &ReplayOptions,
    progress: &dyn Progress,
) -> Result<Replay, LabError> {
    options.validate()?;
    on_threads(options.threads, || run::Replaying::new(prepared, stream, progress)?.run(options))
}
