//! The processor's time of one thread: what a pass costs, also where other programs take their turns.

/// A point in the processor time of this thread.
#[derive(Clone, Copy, Debug)]
pub struct ThreadTime(cpu_time::ThreadTime);

impl ThreadTime {
    /// Now.
    #[must_use]
    pub fn now() -> Self {
        Self(cpu_time::ThreadTime::now())
    }

    /// Seconds that this thread has worked since.
    #[must_use]
    pub fn seconds(self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}
