//! The `vdf` command line.
fn main() {}
