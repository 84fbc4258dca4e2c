//! One file a subcommand.

pub(crate) mod compare;
pub(crate) mod merge;
pub(crate) mod render;
pub(crate) mod report;
pub(crate) mod scene;
pub(crate) mod verify;
pub(crate) mod voxelize;
