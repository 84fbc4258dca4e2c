//! Visibility: the one place that knows the acceleration method, the hierarchy and the counters. Integrators ask it and nothing else.
//!
//! A query is answered by the method's proof if it has one, else by the hierarchy. A proof is a statement about the exact
//! geometry, and the hierarchy's answer is exact, so the answer is the same with every method.

use glam::DVec3;
use vdf_distfield::{Neighbourhood, SafeZones};
use vdf_voxel::{Span, VoxelGrid};

use crate::{
    AreaNeighbourhood,
    geometry::{Bvh, Hit, Segment},
};

/// What a method knows of a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Proved: no occluder meets the closed segment.
    Unoccluded,
    /// Proved: an occluder meets it. None of the thesis's methods ever says so.
    Occluded,
    /// No proof either way.
    Unknown,
}

/// A method of acceleration: proofs about segments towards emitters.
pub trait Proofs: Sync {
    /// What is known about the closed segment `from`–`to`, where `to` is a sampled point of emitter `emitter`.
    fn answer(&self, emitter: usize, from: DVec3, to: DVec3) -> Answer;

    /// What is known about the closed segment between any two points.
    fn answer_between(&self, a: DVec3, b: DVec3) -> Answer;

    /// What is known about the closed segment `from`–`to`, where `to` is a sampled point of the area emitter `emitter`, which is an
    /// occluder itself.
    fn answer_on_light(&self, emitter: usize, from: DVec3, to: DVec3) -> Answer {
        let _ = (emitter, from, to);
        Answer::Unknown
    }
}

/// The method `none`: every query goes to the hierarchy.
#[derive(Clone, Copy, Debug)]
pub struct NoProofs;

impl Proofs for NoProofs {
    #[inline]
    fn answer(&self, _: usize, _: DVec3, _: DVec3) -> Answer {
        Answer::Unknown
    }

    #[inline]
    fn answer_between(&self, _: DVec3, _: DVec3) -> Answer {
        Answer::Unknown
    }
}

/// A method without a suffix: one of the end points' voxels lies in the safe zone of the other's.
#[derive(Debug)]
pub struct FieldProofs<F> {
    /// The grid of the field.
    pub grid: VoxelGrid,
    /// The field.
    pub field: F,
}

impl<F: SafeZones> Proofs for FieldProofs<F> {
    #[inline]
    fn answer(&self, _: usize, from: DVec3, to: DVec3) -> Answer {
        self.answer_between(from, to)
    }

    #[inline]
    fn answer_between(&self, a: DVec3, b: DVec3) -> Answer {
        let proved = match self.grid.voxel_span(a, b) {
            Span::Inside(a, b) => self.field.proves(a, b),
            // The grid covers all occluders.
            Span::Outside => true,
        };
        if proved { Answer::Unoccluded } else { Answer::Unknown }
    }
}

/// The methods `-sn` and `-xsn`: for each point emitter the voxels that see it (Def. 14 and 4.4.1 in \[Houska2013\]); other
/// emitters ask the field.
#[derive(Debug)]
pub struct NeighbourhoodProofs<F, N> {
    /// The field and its grid.
    pub base: FieldProofs<F>,
    /// For each emitter its neighbourhood, if it is a point inside the grid.
    pub neighbourhoods: Vec<Option<N>>,
    /// For each emitter the neighbourhood of its voxel box, if it is an area light with few occluders close to it.
    pub areas: Vec<Option<AreaNeighbourhood>>,
}

impl<F: SafeZones, N: Neighbourhood> Proofs for NeighbourhoodProofs<F, N> {
    #[inline]
    fn answer(&self, emitter: usize, from: DVec3, to: DVec3) -> Answer {
        match (&self.neighbourhoods[emitter], self.base.grid.voxel_containing(from)) {
            (Some(neighbourhood), Some(voxel)) => {
                if neighbourhood.proves(voxel) {
                    Answer::Unoccluded
                } else {
                    Answer::Unknown
                }
            }
            _ => self.base.answer_between(from, to),
        }
    }

    #[inline]
    fn answer_between(&self, a: DVec3, b: DVec3) -> Answer {
        self.base.answer_between(a, b)
    }

    #[inline]
    fn answer_on_light(&self, emitter: usize, from: DVec3, to: DVec3) -> Answer {
        match &self.areas[emitter] {
            Some(area) if area.proves(&self.base.grid, from, to) => Answer::Unoccluded,
            _ => Answer::Unknown,
        }
    }
}

/// A question for [`Visibility::unoccluded`].
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// Neither end: what fields and neighbourhoods prove.
    Spatial,
    /// Only the end on an area light: superficial, but the light's own neighbourhood may prove it (4.4.1).
    OnLight,
    /// At least the end where light would arrive. Nothing is proved.
    Superficial,
}

/// How many queries were asked and how they were answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Visibility queries, N.
    pub queries: u64,
    /// Those that were spatial.
    pub spatial: u64,
    /// Those of the spatial ones that a proof answered.
    pub proved: u64,
    /// Superficial queries of which only the end on an area light lies on an occluder.
    pub on_light: u64,
    /// Those of them that a proof answered.
    pub on_light_proved: u64,
    /// Rays cast for the first occluder.
    pub rays: u64,
    /// Free flights that were asked for a proof: those that neither start nor end on an occluder.
    pub flights: u64,
    /// Those that were proved free, each a ray saved; with any method those beside the bounds of all occluders are among them.
    pub flights_proved: u64,
    /// Camera paths.
    pub paths: u64,
    /// Paths whose radiance was not finite or negative and was therefore left out. Must be 0.
    pub refused: u64,
}

impl std::ops::AddAssign for Counters {
    fn add_assign(&mut self, other: Self) {
        self.queries += other.queries;
        self.spatial += other.spatial;
        self.proved += other.proved;
        self.on_light += other.on_light;
        self.on_light_proved += other.on_light_proved;
        self.rays += other.rays;
        self.flights += other.flights;
        self.flights_proved += other.flights_proved;
        self.paths += other.paths;
        self.refused += other.refused;
    }
}

/// Hears every query that is asked, with its answer.
pub trait Recorder {
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

/// Answers all visibility questions of an integrator.
#[derive(Debug)]
pub struct Visibility<'a, P, R = NoRecorder> {
    bvh: &'a Bvh,
    proofs: &'a P,
    segment_first: bool,
    recorder: R,
}

impl<'a, P: Proofs> Visibility<'a, P> {
    /// Asks `proofs` first and `bvh` for the rest; both about the same occluders. `segment_first` asks for proofs of free flights, too.
    #[must_use]
    pub const fn new(bvh: &'a Bvh, proofs: &'a P, segment_first: bool) -> Self {
        Self { bvh, proofs, segment_first, recorder: NoRecorder }
    }
}

impl<'a, P: Proofs, R: Recorder> Visibility<'a, P, R> {
    /// As [`Visibility::new`], but `recorder` hears of every query.
    #[must_use]
    pub const fn recorded(bvh: &'a Bvh, proofs: &'a P, segment_first: bool, recorder: R) -> Self {
        Self { bvh, proofs, segment_first, recorder }
    }

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
            if self.bvh.is_beside(flight) || self.proofs.answer_between(flight.p, flight.q) == Answer::Unoccluded {
                counters.flights_proved += 1;
                return None;
            }
        }
        self.intersect(flight, counters)
    }

    /// Whether the closed segment of the query meets no occluder.
    #[inline]
    pub fn unoccluded(&self, query: &ShadowQuery, counters: &mut Counters) -> bool {
        let unoccluded = self.ask(query, counters);
        self.recorder.record(query, unoccluded);
        unoccluded
    }

    #[inline]
    fn ask(&self, query: &ShadowQuery, counters: &mut Counters) -> bool {
        counters.queries += 1;
        let answer = match query.kind {
            QueryKind::Spatial => {
                let answer = self.proofs.answer(query.emitter, query.from, query.to);
                counters.spatial += 1;
                counters.proved += u64::from(answer != Answer::Unknown);
                answer
            }
            QueryKind::OnLight => {
                let answer = self.proofs.answer_on_light(query.emitter, query.from, query.to);
                counters.on_light += 1;
                counters.on_light_proved += u64::from(answer != Answer::Unknown);
                answer
            }
            QueryKind::Superficial => Answer::Unknown,
        };
        if answer != Answer::Unknown {
            return answer == Answer::Unoccluded;
        }
        !self.bvh.occluded(&Segment::new(query.from, query.to))
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, dvec3};

    use super::*;
    use crate::Triangle;

    /// Claims that nothing is occluded; who believes it can be told by a wrong answer.
    struct Liar {
        between: bool,
        on_light: bool,
    }

    impl Proofs for Liar {
        fn answer(&self, _: usize, a: DVec3, b: DVec3) -> Answer {
            self.answer_between(a, b)
        }

        fn answer_between(&self, _: DVec3, _: DVec3) -> Answer {
            if self.between { Answer::Unoccluded } else { Answer::Unknown }
        }

        fn answer_on_light(&self, _: usize, _: DVec3, _: DVec3) -> Answer {
            if self.on_light { Answer::Unoccluded } else { Answer::Unknown }
        }
    }

    /// Which proofs a question may use: of queries by their kind, of free flights only from a point in space, and if asked for.
    #[test]
    fn each_question_uses_its_own_proofs() {
        let bvh = Bvh::new(&[Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y)]);
        let (from, to) = (dvec3(0.25, 0.25, -1.0), dvec3(0.25, 0.25, 1.0));
        for (between, on_light) in [(false, false), (true, false), (false, true), (true, true)] {
            let liar = Liar { between, on_light };
            let visibility = Visibility::new(&bvh, &liar, true);
            for (kind, believed) in
                [(QueryKind::Spatial, between), (QueryKind::OnLight, on_light), (QueryKind::Superficial, false)]
            {
                let mut counters = Counters::default();
                let query = ShadowQuery { from, to, emitter: 0, kind };
                assert_eq!(visibility.unoccluded(&query, &mut counters), believed, "{kind:?}");
                assert_eq!(counters.proved + counters.on_light_proved, u64::from(believed), "{kind:?}");
                assert_eq!(counters.spatial, u64::from(kind == QueryKind::Spatial), "{kind:?}");
            }
            for (segment_first, spatial) in [(false, false), (true, false), (false, true), (true, true)] {
                let mut counters = Counters::default();
                let visibility = Visibility::new(&bvh, &liar, segment_first);
                let hit = visibility.intersect_flight(&Segment::new(from, to), spatial, &mut counters);
                assert_eq!(hit.is_none(), between && segment_first && spatial, "{segment_first} {spatial}");
                assert_eq!(counters.flights, u64::from(segment_first && spatial));
            }
        }
    }
}
