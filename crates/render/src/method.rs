//! The names of the methods of acceleration.

use std::{fmt, str::FromStr};

/// How visibility queries are accelerated; see `docs/ARCHITECTURE.md`. All methods give the same image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Method {
    /// Every query goes to the hierarchy.
    None,
    /// One chessboard distance a voxel (Def. 8 in \[Houska2013\]).
    Ndf,
    /// Anisotropic macro-regions: a chessboard distance for each octant (Def. 9, 10).
    Amr,
    /// `ndf` with a safe neighbourhood for each point light (Def. 14).
    NdfSn,
    /// `amr` with a safe neighbourhood for each point light.
    #[default]
    AmrSn,
}

impl Method {
    /// All methods, the plainest first.
    pub const ALL: [Self; 5] = [Self::None, Self::Ndf, Self::Amr, Self::NdfSn, Self::AmrSn];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Ndf => "ndf",
            Self::Amr => "amr",
            Self::NdfSn => "ndf-sn",
            Self::AmrSn => "amr-sn",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that is none of the methods'.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown method; the methods are none, ndf, amr, ndf-sn and amr-sn")]
pub struct UnknownMethod;

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        Self::ALL.into_iter().find(|m| m.name() == name).ok_or(UnknownMethod)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for m in Method::ALL {
            assert_eq!(m.to_string().parse(), Ok(m));
        }
        assert_eq!("AMR".parse::<Method>(), Err(UnknownMethod));
    }
}
