//! How many queries were asked and how they were answered.

use crate::{Answer, QueryKind, ShadowQuery};

/// Counts of one thread or of a whole render.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
// In this order, so that vectors are added to it.
#[repr(C)]
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
    /// Superficial queries from a surface that a proof answered: only light buffers can.
    pub superficial_proved: u64,
    /// Of all that a proof answered those that are occluded: only light buffers say so.
    pub proved_occluded: u64,
    /// Rays cast for the first occluder.
    pub rays: u64,
    /// Free flights that were asked for a proof: those that neither start nor end on an occluder.
    pub flights: u64,
    /// Those that were proved free, each a ray saved; with any method those that miss the bounds of all occluders are among them.
    pub flights_proved: u64,
    /// Segments of which it was found which parts a point light sees.
    pub lit_segments: u64,
    /// Segments between events of a camera path and one of a light's that were asked whether anything is in the way.
    pub connections: u64,
    /// Camera paths.
    pub paths: u64,
    /// Paths whose radiance was not finite or negative and was therefore left out. Must be 0.
    pub refused: u64,
}

/// What one query adds to `spatial`, `proved`, `on_light`, `on_light_proved`, `superficial_proved` and `proved_occluded`.
#[inline(always)]
const fn shares(kind: QueryKind, answer: Answer) -> [u8; 6] {
    let known = !matches!(answer, Answer::Unknown);
    let spatial = matches!(kind, QueryKind::Spatial);
    let on_light = matches!(kind, QueryKind::OnLight);
    let superficial = matches!(kind, QueryKind::Superficial);
    let occluded = matches!(answer, Answer::Occluded);
    [
        spatial as u8,
        (spatial & known) as u8,
        on_light as u8,
        (on_light & known) as u8,
        (superficial & known) as u8,
        occluded as u8,
    ]
}

/// The same for one query, of each kind and with each answer, and 1 for `queries` before it.
const SHARES: [[[u64; 7]; 3]; 3] = {
    let mut all = [[[0; 7]; 3]; 3];
    let kinds = [QueryKind::Spatial, QueryKind::OnLight, QueryKind::Superficial];
    let answers = [Answer::Unoccluded, Answer::Occluded, Answer::Unknown];
    let mut i = 0;
    while i < 9 {
        let (kind, answer) = (kinds[i / 3], answers[i % 3]);
        let [a, b, c, d, e, f] = shares(kind, answer);
        all[kind as usize][answer as usize] = [1, a as u64, b as u64, c as u64, d as u64, e as u64, f as u64];
        i += 1;
    }
    all
};

impl Counters {
    /// Counts a query with this answer of the provers.
    #[inline(always)]
    pub(crate) fn count(&mut self, kind: QueryKind, answer: Answer) {
        self.add(SHARES[kind as usize][answer as usize]);
    }

    /// Counts many.
    pub(crate) fn count_all(&mut self, queries: &[ShadowQuery], answers: &[Answer]) {
        // So many that no sum exceeds a byte: vectors hold sixteen of these.
        const MANY: usize = 128;
        for (queries, answers) in queries.chunks(MANY).zip(answers.chunks(MANY)) {
            let mut kinds = [QueryKind::Spatial; MANY];
            for (kind, query) in kinds.iter_mut().zip(queries) {
                *kind = query.kind;
            }
            let mut sums = [0; 6];
            for (kind, answer) in kinds.iter().zip(answers) {
                for (sum, share) in sums.iter_mut().zip(shares(*kind, *answer)) {
                    *sum += share;
                }
            }
            let [a, b, c, d, e, f] = sums.map(u64::from);
            self.add([queries.len() as u64, a, b, c, d, e, f]);
        }
    }

    #[inline(always)]
    fn add(&mut self, shares: [u64; 7]) {
        let [queries, spatial, proved, on_light, on_light_proved, superficial_proved, proved_occluded] = shares;
        self.queries += queries;
        self.spatial += spatial;
        self.proved += proved;
        self.on_light += on_light;
        self.on_light_proved += on_light_proved;
        self.superficial_proved += superficial_proved;
        self.proved_occluded += proved_occluded;
    }
}

/// Saturates, for the counts of a film may come from anywhere.
impl std::ops::AddAssign for Counters {
    fn add_assign(&mut self, other: Self) {
        self.queries = self.queries.saturating_add(other.queries);
        self.spatial = self.spatial.saturating_add(other.spatial);
        self.proved = self.proved.saturating_add(other.proved);
        self.on_light = self.on_light.saturating_add(other.on_light);
        self.on_light_proved = self.on_light_proved.saturating_add(other.on_light_proved);
        self.superficial_proved = self.superficial_proved.saturating_add(other.superficial_proved);
        self.proved_occluded = self.proved_occluded.saturating_add(other.proved_occluded);
        self.rays = self.rays.saturating_add(other.rays);
        self.flights = self.flights.saturating_add(other.flights);
        self.flights_proved = self.flights_proved.saturating_add(other.flights_proved);
        self.lit_segments = self.lit_segments.saturating_add(other.lit_segments);
        self.connections = self.connections.saturating_add(other.connections);
        self.paths = self.paths.saturating_add(other.paths);
        self.refused = self.refused.saturating_add(other.refused);
    }
}
