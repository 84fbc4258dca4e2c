//! Streams of visibility queries: recorded from a render, kept in a file, replayed per method.
//!
//! *Idea.* The times of single queries, t_query and t_acc (Sec. 2.6 in \[Houska2013\]), are some ten nanoseconds. A
//! timer around each query of a render costs as much and distorts both (6.2.2); and the difference of two whole renders
//! (6.3.2) drowns in their noise. So the queries are recorded once, and then whole passes over them are timed, with
//! nothing else in the loop.
//!
//! *Definition.* [`record_queries`] follows some paths of a render and writes down every query they ask; [`replay`]
//! asks them again, of the hierarchy alone and of each method.
//!
//! *Guarantee.* A stream is a function of scene, options and bound, whatever the number of threads. Every answer of a
//! method is compared with that of the hierarchy in the same replay; a difference is
//! [`LabError::WrongAnswer`](crate::LabError::WrongAnswer).
//!
//! *Cost.* Recording follows only the paths that are kept, and is a pass of its own: a render never knows of it.
//!
//! *Limits.* A replay has nothing to do between queries, so caches hold more of the structures, and a core overlaps
//! more queries, than in a render. Both favour the hierarchy and the methods alike. Chosen paths lie apart from each
//! other and share less of the caches than all paths do: in `cbox_vol2` with `volpath`, fields of 7.5 million voxels
//! took up to a third longer than in a stream of all paths, speed-ups were within 0.1. One sample per pixel and a bound
//! that takes all of it has the coherence of a render.

mod record;
mod replay;
mod stream;
#[cfg(test)]
pub(crate) mod tests;

pub use record::record_queries;
pub use replay::{
    ClassReplay, HierarchyReplay, LookUpShares, MethodReplay, ProofReplay, Replay, ReplayOptions, TimerInfluence,
    Timing, WrongAnswer, replay,
};
pub use stream::{QueryStream, StreamOrigin, write_triangles};
