//! The `vdf` program as its user sees it: exit codes, messages, and the files it writes or does not write.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod bad_input;
mod compare;
mod convergence;
mod long;
mod outputs;
mod render;
mod report;
mod sandbox;
mod scenes;
#[cfg(target_os = "linux")]
mod streams;
mod verify;
mod voxelize;
