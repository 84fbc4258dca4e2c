//! The `vdf` program as its user sees it: exit codes, messages, and the files it writes or does not write.

mod bad_input;
mod compare;
mod render;
mod sandbox;
mod scenes;
#[cfg(target_os = "linux")]
mod streams;
