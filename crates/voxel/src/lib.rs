//! Voxel grids.
