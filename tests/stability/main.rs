//! Scenes that try to make numbers fail: hard cases 36 to 44 of the project's list (in `docs/numerics.md`), odd units, places and lights,
//! slivers, grazing rays, extreme media. No sample may ever be refused: not finite, or negative.
//!
//! Statistical comparisons allow 5 standard errors, estimated from the images: false alarm 6·10⁻⁷ each, seeds fixed. Precision itself is
//! tested in `precision.rs`.

#[path = "../common/mod.rs"]
mod common;
mod media;
mod room;
mod shapes;
mod units;
