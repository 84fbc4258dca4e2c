//! Light transport against closed forms, for both integrators. `cargo test --test physics -- --nocapture` prints how near they come.

mod agreement;
mod airlight;
mod check;
mod colours;
#[path = "../common/mod.rs"]
mod common;
mod estimators;
mod fog;
mod furnace;
mod grids;
mod light_paths;
mod stopping;
mod surfaces;
mod transmittance;
