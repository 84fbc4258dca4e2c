//! The processor's time of one thread: what a pass costs, also where other programs take their turns.

/// A point in the processor time of this thread.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ThreadTime(cpu_time::ThreadTime);

impl ThreadTime {
    /// Now.
    pub(crate) fn now() -> Self {
        Self(cpu_time::ThreadTime::now())
    }

    /// Seconds that this thread has worked since.
    pub(crate) fn seconds(self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}
