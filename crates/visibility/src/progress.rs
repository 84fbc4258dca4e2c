//! How a long work tells how it goes on, and how it is stopped.

/// Is told how a long work goes on, from any thread, and may stop it.
pub trait Progress: Sync {
    /// A new phase of the work begins, named by what is done or made in it.
    fn phase(&self, name: &str);
    /// How much there is to do in the phase: planes of a field, lights, samples of all pixels of a render, segments of a verification.
    fn work_total(&self, n: u64);
    /// `n` more of these are done.
    fn work_done(&self, n: u64);
    /// Whether to stop; asked often, so it should be quick.
    fn cancelled(&self) -> bool;
}

/// Tells nobody and never stops.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet;

impl Progress for Quiet {
    fn phase(&self, _: &str) {}
    fn work_total(&self, _: u64) {}
    fn work_done(&self, _: u64) {}
    fn cancelled(&self) -> bool {
        false
    }
}
