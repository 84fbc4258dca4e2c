//! What a replay finds.

use std::fmt;

use serde::Serialize;
use vdf_visibility::{QueryKind, ShadowQuery};

/// Nanoseconds a query, over the passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Timing {
    /// The median.
    pub median: f64,
    /// The fastest pass.
    pub min: f64,
    /// The slowest pass.
    pub max: f64,
}

/// What a replay found. Times are nanoseconds a query on one thread, unless a name says otherwise.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    /// Queries in the stream.
    pub queries: usize,
    /// Share of them that is spatial, p_sp.
    pub p_spatial: f64,
    /// N of the whole render, estimated.
    pub estimated_total: Option<f64>,
    /// Triangles in the hierarchy.
    pub triangles: usize,
    /// Passes of each kind.
    pub passes: u32,
    /// The loop without a query.
    pub t_loop: Timing,
    /// The hierarchy alone.
    pub hierarchy: HierarchyReplay,
    /// What a timer in the loop would have done.
    pub timer: TimerInfluence,
    /// Each method with each voxel size, size by size.
    pub methods: Vec<MethodReplay>,
}

/// The hierarchy alone, without a method.
#[derive(Clone, Debug, PartialEq)]
pub struct HierarchyReplay {
    /// Each class of which there are queries: first the spatial ones, then those on an area light, then the other
    /// superficial ones.
    pub classes: Vec<ClassReplay>,
    /// Any query of the stream: `t_query`.
    pub t_query: f64,
}

/// The queries of one class, asked of the hierarchy alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassReplay {
    /// The class.
    pub kind: QueryKind,
    /// How many there are, at least 1.
    pub queries: usize,
    /// How many of them are unoccluded: no method that proves nothing else can prove more.
    pub unoccluded: usize,
    /// A query.
    pub time: Timing,
}

/// Queries of the hierarchy with a timer started and stopped around each (6.2.2 in \[Houska2013\]): those of the first
/// class.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TimerInfluence {
    /// What a query takes in the pass with timers.
    pub time: Timing,
    /// What the timers say that it takes.
    pub said: Timing,
}

/// A method with a voxel size.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodReplay {
    /// The method.
    pub method: &'static str,
    /// Side of a voxel in world units.
    pub voxel_size: f64,
    /// Voxels along x, y and z.
    pub grid: [u32; 3],
    /// Bytes of all the method's structures.
    pub bytes: usize,
    /// `T_build` in seconds.
    pub t_build: f64,
    /// Each class that a method can prove and of which there are queries, in the order of [`HierarchyReplay::classes`].
    pub proofs: Vec<ProofReplay>,
    /// How many times faster the mixture of all queries of the stream is than by the hierarchy alone; below 1 it is
    /// slower.
    pub speed_up_all: f64,
    /// The same for queries that are asked in batches of 256.
    pub speed_up_batches: f64,
}

/// A method and the queries of one class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProofReplay {
    /// The class.
    pub kind: QueryKind,
    /// Queries that were proved.
    pub proved: usize,
    /// proved / queries: `p_acc|sp` if they are spatial.
    pub p_accelerated: f64,
    /// u = 1 − proved / queries, the unknown fraction.
    pub unknown_fraction: f64,
    /// `t_acc`, the attempt of a proof.
    pub t_acc: Timing,
    /// A query: the proof, and the fallback where there is none.
    pub t_effective: Timing,
    /// A query of those that are asked in batches of 256.
    pub t_batch: Timing,
    /// The same in batches of 16.
    pub t_batch_16: Timing,
    /// How light buffers answer, if the method keeps any.
    pub look_ups: Option<LookUpShares>,
    /// `t_acc` as the thesis computes it (6.3.2), from the whole: t_eff − (1 − p_acc)·t_query. Larger than
    /// [`Self::t_acc`] where proofs alone overlap in the processor but a fallback has to wait for its proof; smaller
    /// where proved queries are the expensive ones.
    pub t_acc_derived: f64,
    /// A query of the hierarchy alone, in passes that alternated with those of this method.
    pub t_hierarchy: Timing,
    /// How many times faster a query is than by the hierarchy alone; below 1 it is slower.
    pub speed_up: f64,
    /// What criterion 2.8 in \[Houska2013\] wants p_acc to exceed: `t_acc / t_query`.
    pub threshold: f64,
    /// From how many of these queries on the build is worth its time, by [`Self::t_effective`]; `None` if never.
    pub pays_from: Option<f64>,
}

/// How the light buffers answer the queries of a class that are towards their lights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LookUpShares {
    /// Queries towards a light with a buffer.
    pub queries: usize,
    /// Share that comparisons with a texel find unoccluded.
    pub lit: f64,
    /// Share that comparisons find occluded.
    pub occluded: f64,
    /// Share that is decided by testing triangles.
    pub by_list: f64,
    /// Share that goes to the hierarchy.
    pub hierarchy: f64,
    /// Triangles tested, for each query that comparisons leave open.
    pub mean_tests: f64,
}

impl LookUpShares {
    /// The share that comparisons leave open.
    #[must_use]
    pub fn open(&self) -> f64 {
        self.by_list + self.hierarchy
    }
}

impl HierarchyReplay {
    /// The class, if there are queries of it.
    #[must_use]
    pub fn class(&self, kind: QueryKind) -> Option<&ClassReplay> {
        self.classes.iter().find(|c| c.kind == kind)
    }

    /// Nanoseconds of a spatial query; 0 if there are none.
    #[must_use]
    pub fn t_spatial(&self) -> f64 {
        self.class(QueryKind::Spatial).map_or(0.0, |c| c.time.median)
    }

    /// Nanoseconds of a query that is not spatial; 0 if there are none.
    #[must_use]
    pub fn t_other(&self) -> f64 {
        let others = || self.classes.iter().filter(|c| c.kind != QueryKind::Spatial);
        let n: usize = others().map(|c| c.queries).sum();
        let weighted = others().map(|c| c.queries as f64 * c.time.median).fold(0.0, |sum, t| sum + t);
        if n == 0 { 0.0 } else { weighted / n as f64 }
    }
}

impl MethodReplay {
    /// The class, if there are queries of it and methods can prove them.
    #[must_use]
    pub fn proofs_of(&self, kind: QueryKind) -> Option<&ProofReplay> {
        self.proofs.iter().find(|p| p.kind == kind)
    }

    /// The spatial queries, if there are any.
    #[must_use]
    pub fn spatial(&self) -> Option<&ProofReplay> {
        self.proofs_of(QueryKind::Spatial)
    }
}

impl Timing {
    /// Median, least and largest of these times; all 0 of no times.
    pub(super) fn of(times: &[f64]) -> Self {
        let mut sorted = times.to_vec();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        match n {
            0 => Self::default(),
            _ => Self { median: 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]), min: sorted[0], max: sorted[n - 1] },
        }
    }
}

/// A query that was answered wrongly.
#[derive(Clone, Debug, PartialEq)]
pub struct WrongAnswer {
    /// The method; `none` if the hierarchy contradicts the answer in the stream.
    pub method: &'static str,
    /// Side of a voxel in world units, if the method has voxels.
    pub voxel_size: Option<f64>,
    /// Place of the query in the stream.
    pub index: usize,
    /// The query.
    pub query: ShadowQuery,
    /// The wrong answer.
    pub unoccluded: bool,
}

impl fmt::Display for WrongAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let said = if self.unoccluded { "unoccluded" } else { "occluded" };
        write!(f, "{}", self.method)?;
        if let Some(size) = self.voxel_size {
            write!(f, " with voxel {size:?}")?;
        }
        let (from, to) = (self.query.from.to_array(), self.query.to.to_array());
        let twin = if self.voxel_size.is_some() { "the hierarchy" } else { "the stream" };
        write!(f, " says {said} of query {}, from {from:?} to {to:?}, emitter {}", self.index, self.query.emitter)?;
        write!(f, "; {twin} says otherwise. Please report it with the scene")
    }
}
