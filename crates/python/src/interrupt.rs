//! Long work without Python's lock, which Ctrl-C stops.

use std::{
    sync::{
        atomic::{AtomicBool, Ordering},
        mpsc::{RecvTimeoutError, channel},
    },
    thread,
    time::Duration,
};

use pyo3::{exceptions::PyRuntimeError, prelude::*};
use vdf_render::Progress;

/// How often Python is asked whether a signal has come.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Whether to stop.
#[derive(Debug, Default)]
pub(crate) struct Stop(AtomicBool);

impl Progress for Stop {
    fn phase(&self, _: &str) {}

    fn work_total(&self, _: u64) {}

    fn work_done(&self, _: u64) {}

    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Does `work` in a thread of its own, without Python's lock, until it is done or a signal handler of Python raises: `KeyboardInterrupt`.
pub(crate) fn interruptible<T: Send>(py: Python<'_>, work: impl FnOnce(&Stop) -> T + Send) -> PyResult<T> {
    let stop = Stop::default();
    py.detach(|| {
        thread::scope(|scope| {
            let (done, ended) = channel();
            let stop = &stop;
            let worker = scope.spawn(move || {
                let result = work(stop);
                // Nobody listens any more if a signal came.
                let _ = done.send(());
                result
            });
            let raised = loop {
                match ended.recv_timeout(LOOK_EVERY) {
                    Err(RecvTimeoutError::Timeout) => {
                        if let Err(raised) = Python::attach(|py| py.check_signals()) {
                            stop.0.store(true, Ordering::Relaxed);
                            break Some(raised);
                        }
                    }
                    Ok(()) | Err(RecvTimeoutError::Disconnected) => break None,
                }
            };
            let result = worker.join().map_err(|_| PyRuntimeError::new_err("vdf failed; please report it"))?;
            raised.map_or(Ok(result), Err)
        })
    })
}
