//! How many queries were asked and how they were answered.

/// Counts of one thread or of a whole render.
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
    /// Camera paths.
    pub paths: u64,
    /// Paths whose radiance was not finite or negative and was therefore left out. Must be 0.
    pub refused: u64,
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
        self.paths = self.paths.saturating_add(other.paths);
        self.refused = self.refused.saturating_add(other.refused);
    }
}
