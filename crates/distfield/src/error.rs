//! What validation finds wrong with a field or a neighbourhood.

use vdf_voxel::{Resolution, Voxel};

/// A field or neighbourhood that is not what its definition says; each message says what to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FieldError {
    /// The set of occupied voxels belongs to another grid.
    #[error("the field has {found} voxels, the occupied set {expected}: validate against the set it was built from")]
    Resolution {
        /// The resolution of the occupied set.
        expected: Resolution,
        /// That of the field.
        found: Resolution,
    },
    /// A stored value is wrong.
    #[error(
        "{part} at voxel ({}, {}, {}) is {found}, but must be {expected}: the field is damaged or belongs to other \
         occluders; build it again",
        voxel.i, voxel.j, voxel.k
    )]
    Value {
        /// Which of the field's values.
        part: &'static str,
        /// Where.
        voxel: Voxel,
        /// The value that follows from the occupied voxels and the neighbouring values.
        expected: u8,
        /// The stored value.
        found: u8,
    },
    /// An occupied voxel has a distance other than 0, or a free one has 0.
    #[error(
        "{part} at voxel ({}, {}, {}), which is {}, is {found}: the field is damaged or belongs to other occluders; \
         build it again",
        voxel.i, voxel.j, voxel.k, if *occupied { "occupied" } else { "free" }
    )]
    Occupancy {
        /// Which of the field's values.
        part: &'static str,
        /// Where.
        voxel: Voxel,
        /// Whether the voxel is occupied.
        occupied: bool,
        /// The stored value.
        found: u8,
    },
    /// A voxel is in a neighbourhood and must not be, or the other way round.
    #[error(
        "voxel ({}, {}, {}) is {} the neighbourhood, but must {}be: it is damaged or belongs to other occluders or \
         another light; build it again",
        voxel.i, voxel.j, voxel.k,
        if *found { "in" } else { "not in" }, if *expected { "" } else { "not " }
    )]
    Member {
        /// Which voxel.
        voxel: Voxel,
        /// Whether it must be in the neighbourhood.
        expected: bool,
        /// Whether it is.
        found: bool,
    },
}
