//! Visibility queries: the one place where provers, the hierarchy and the counters meet. Integrators ask it and nothing else.

use glam::DVec3;
use vdf_geometry::{Bvh, Hit, Segment};

use crate::{Answer, Counters, LitIntervals, Provers};

/// A question for [`Visibility::unoccluded`].
#[derive(Clone, Copy, Debug, PartialEq)]
// In this order, so that vectors are loaded from it; as many bytes as a cache line.
#[repr(C)]
pub struct ShadowQuery {
    /// Where light would arrive.
    pub from: DVec3,
    /// The sampled point on the emitter.
    pub to: DVec3,
    /// Number of the emitter.
    pub emitter: usize,
    /// Which ends lie on an occluder.
    pub kind: QueryKind,
}

/// Which ends of a query lie on an occluder (Def. 2 in \[Houska2013\]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QueryKind {
    /// Neither end: what all methods prove.
    Spatial,
    /// Only the end on an area light: superficial, but the light's own neighbourhood may prove it (4.4.1).
    OnLight,
    /// At least the end where light would arrive. Voxels prove nothing, light buffers do.
    Superficial,
}

/// Hears every query that is asked, with its answer.
pub trait Recorder {
    /// A query is about to be asked, or several together.
    #[inline(always)]
    fn begins(&self) {}

    /// `query` was asked, and this was the answer.
    fn record(&self, query: &ShadowQuery, unoccluded: bool);
}

/// Nobody listens; compiles to nothing.
#[derive(Clone, Copy, Debug)]
pub struct NoRecorder;

impl Recorder for NoRecorder {
    #[inline(always)]
    fn record(&self, _: &ShadowQuery, _: bool) {}
}

/// So that an integrator is compiled once for all who listen.
impl Recorder for &dyn Recorder {
    #[inline]
    fn begins(&self) {
        (**self).begins();
    }

    #[inline]
    fn record(&self, query: &ShadowQuery, unoccluded: bool) {
        (**self).record(query, unoccluded);
    }
}

/// Answers all visibility questions of an integrator.
#[derive(Debug)]
pub struct Visibility<'a, R = NoRecorder> {
    bvh: &'a Bvh,
    provers: &'a Provers,
    segment_first: bool,
    recorder: R,
}

impl<'a> Visibility<'a> {
    /// Asks `provers` first and `bvh` for the rest; both must be about the same occluders.
    #[must_use]
    pub const fn new(bvh: &'a Bvh, provers: &'a Provers) -> Self {
        Self { bvh, provers, segment_first: false, recorder: NoRecorder }
    }

    /// Asks for proofs of free flights, too, if `segment_first` is true (Sec. 2.4 in \[Houska2013\]).
    #[must_use]
    pub const fn segment_first(self, segment_first: bool) -> Self {
        Self { segment_first, ..self }
    }

    /// Lets `recorder` hear of every query.
    #[must_use]
    pub fn recorded<R: Recorder>(self, recorder: R) -> Visibility<'a, R> {
        let Self { bvh, provers, segment_first, recorder: NoRecorder } = self;
        Visibility { bvh, provers, segment_first, recorder }
    }
}

impl<R: Recorder> Visibility<'_, R> {
    /// The first occluder along the segment.
    #[inline]
    #[must_use]
    pub fn intersect(&self, segment: &Segment, counters: &mut Counters) -> Option<Hit> {
        counters.rays += 1;
        self.bvh.intersect(segment)
    }

    /// The first occluder along a free flight; no ray is cast if there is a proof that there is none (Sec. 2.4 in \[Houska2013\]).
    /// `spatial` says that it does not start on an occluder.
    #[inline]
    #[must_use]
    pub fn intersect_flight(&self, flight: &Segment, spatial: bool, counters: &mut Counters) -> Option<Hit> {
        if spatial && self.segment_first {
            counters.flights += 1;
            // The bounds of all occluders are a proof, too, and cheaper than a field, whose bytes are seldom in the cache.
            if self.bvh.bounds().misses(flight) || self.provers.answer_between(flight.p, flight.q) == Answer::Unoccluded
            {
                counters.flights_proved += 1;
                return None;
            }
        }
        self.intersect(flight, counters)
    }

    /// Whether the closed segment between two places meets no occluder. No method is asked, for the segment leads to no light.
    #[inline]
    pub fn connected(&self, segment: &Segment, counters: &mut Counters) -> bool {
        counters.connections += 1;
        !self.bvh.occluded(segment)
    }

    /// Which parts of `segment` a point light at `light` sees. No method is asked, for the hierarchy answers for all of it at once.
    #[inline]
    #[must_use]
    pub fn lit_intervals(&self, light: DVec3, segment: &Segment, counters: &mut Counters) -> LitIntervals {
        counters.lit_segments += 1;
        LitIntervals::new(self.bvh, light, segment)
    }

    /// Whether the closed segment of the query meets no occluder.
    #[inline]
    pub fn unoccluded(&self, query: &ShadowQuery, counters: &mut Counters) -> bool {
        self.recorder.begins();
        let unoccluded = self.ask(query, counters);
        self.recorder.record(query, unoccluded);
        unoccluded
    }

    /// Whether the closed segments of `queries` meet no occluder, each as [`Visibility::unoccluded`] says; `unoccluded` must be as long.
    pub fn all_unoccluded(&self, queries: &[ShadowQuery], unoccluded: &mut [bool], counters: &mut Counters) {
        const BATCH: usize = 256;
        let mut answers = [Answer::Unknown; BATCH];
        for (queries, unoccluded) in queries.chunks(BATCH).zip(unoccluded.chunks_mut(BATCH)) {
            let answers = &mut answers[..queries.len()];
            self.recorder.begins();
            self.provers.answer_all(queries, answers);
            counters.count_all(queries, answers);
            let mut unknown = false;
            for (unoccluded, answer) in unoccluded.iter_mut().zip(&*answers) {
                *unoccluded = *answer == Answer::Unoccluded;
                unknown |= *answer == Answer::Unknown;
            }
            if unknown {
                for ((query, answer), unoccluded) in queries.iter().zip(answers).zip(&mut *unoccluded) {
                    if *answer == Answer::Unknown {
                        *unoccluded = self.look(query);
                    }
                }
            }
            for (query, unoccluded) in queries.iter().zip(unoccluded) {
                self.recorder.record(query, *unoccluded);
            }
        }
    }

    #[inline]
    fn ask(&self, query: &ShadowQuery, counters: &mut Counters) -> bool {
        self.conclude(query, self.provers.answer(query), counters)
    }

    /// Counts, and asks the hierarchy where nothing is known.
    #[inline(always)]
    fn conclude(&self, query: &ShadowQuery, answer: Answer, counters: &mut Counters) -> bool {
        counters.count(query.kind, answer);
        // No branch for what a proof says, which would be taken at random.
        if answer == Answer::Unknown { self.look(query) } else { answer == Answer::Unoccluded }
    }

    /// Asks the hierarchy.
    #[inline]
    fn look(&self, query: &ShadowQuery) -> bool {
        !self.bvh.occluded(&Segment::new(query.from, query.to))
    }
}

#[cfg(test)]
mod tests;
