//! Provers: what a method knows of a segment. One file each; [`LightProver`] is the list of those that are kept for one light.

mod area;
mod field;
mod light_buffer;
mod provers;

use vdf_distfield::{ExtendedNeighbourhood, HopNeighbourhood, Neighbourhood as _, SafeNeighbourhood};

pub use area::AreaNeighbourhood;
pub(crate) use area::{Occluders, Site};
pub(crate) use field::each_field;
pub use field::{DistanceField, FieldProver};
pub use light_buffer::{LightBuffer, LookUp, Refusal};
pub use provers::Provers;

/// What is known of a closed segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Proved: no occluder meets it.
    Unoccluded,
    /// Proved: an occluder meets it. Only light buffers say so, none of the thesis's methods.
    Occluded,
    /// No proof either way.
    Unknown,
}

impl Answer {
    /// A proof of either.
    #[inline(always)]
    const fn of(occluded: bool) -> Self {
        if occluded { Self::Occluded } else { Self::Unoccluded }
    }

    #[inline]
    const fn unoccluded_if(proved: bool) -> Self {
        if proved { Self::Unoccluded } else { Self::Unknown }
    }
}

/// What answers queries towards one light.
#[derive(Debug)]
pub enum LightProver {
    /// The field that all lights share, if there is one.
    Field,
    /// The answers of the field, kept (Def. 14 in \[Houska2013\]); for a point light in the grid.
    Safe(SafeNeighbourhood),
    /// All that free cuboids prove (4.4.1); for a point light in the grid.
    Extended(ExtendedNeighbourhood),
    /// All that hops prove; for a point light in the grid.
    Hop(HopNeighbourhood),
    /// The neighbourhood of an area light's voxel box (4.4.1).
    Area(AreaNeighbourhood),
    /// The light buffer of a point light.
    Buffer(Box<LightBuffer>),
}

impl LightProver {
    /// The number of voxels of its neighbourhood, if it keeps one.
    pub(crate) fn voxels(&self) -> Option<usize> {
        match self {
            Self::Field | Self::Buffer(_) => None,
            Self::Safe(n) => Some(n.count()),
            Self::Extended(n) => Some(n.count()),
            Self::Hop(n) => Some(n.count()),
            Self::Area(n) => Some(n.count()),
        }
    }

    /// Texels along each side of a face of its light buffer, if it keeps one.
    pub(crate) fn texels(&self) -> Option<u32> {
        match self {
            Self::Buffer(buffer) => Some(buffer.side()),
            _ => None,
        }
    }

    /// Its memory in bytes, without the field.
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Field => 0,
            Self::Safe(n) => n.bytes(),
            Self::Extended(n) => n.bytes(),
            Self::Hop(n) => n.bytes(),
            Self::Area(n) => n.bytes(),
            Self::Buffer(buffer) => buffer.bytes(),
        }
    }
}
