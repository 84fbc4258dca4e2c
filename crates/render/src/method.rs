//! The names of the methods of acceleration.

use std::{fmt, str::FromStr};

use crate::acceleration::LightShape;

/// How visibility queries are accelerated; see `docs/ARCHITECTURE.md`. All methods give the same image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Every query goes to the hierarchy.
    None,
    /// A distance field, and what is kept for each point light.
    Field(FieldKind, NeighbourhoodKind),
}

/// A distance field with safe zones; the definitions are those of \[Houska2013\].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldKind {
    /// One chessboard distance a voxel (Def. 8).
    Ndf,
    /// Anisotropic macro-regions: a chessboard distance for each octant (Def. 9, 10).
    Amr,
    /// Directed safe zones: a Manhattan distance for each face (Def. 11, 12).
    Dsz,
    /// Dual extents: one Manhattan distance, and six extents (Def. 13, corrected).
    Dual,
}

/// What answers queries to a point light; all other queries ask the field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeighbourhoodKind {
    /// The field.
    None,
    /// `-sn`: the answers of the field, kept for each light (Def. 14).
    Safe,
    /// `-xsn`: all that free cuboids prove (4.4.1).
    Extended,
}

/// All methods with their names, the plainest first.
const NAMES: [(Method, &str); 13] = {
    use FieldKind::{Amr, Dsz, Dual, Ndf};
    use NeighbourhoodKind::{Extended, None, Safe};
    [
        (Method::None, "none"),
        (Method::Field(Ndf, None), "ndf"),
        (Method::Field(Ndf, Safe), "ndf-sn"),
        (Method::Field(Ndf, Extended), "ndf-xsn"),
        (Method::Field(Amr, None), "amr"),
        (Method::Field(Amr, Safe), "amr-sn"),
        (Method::Field(Amr, Extended), "amr-xsn"),
        (Method::Field(Dsz, None), "dsz"),
        (Method::Field(Dsz, Safe), "dsz-sn"),
        (Method::Field(Dsz, Extended), "dsz-xsn"),
        (Method::Field(Dual, None), "dual"),
        (Method::Field(Dual, Safe), "dual-sn"),
        (Method::Field(Dual, Extended), "dual-xsn"),
    ]
};

impl Method {
    /// All methods, the plainest first.
    pub const ALL: [Self; NAMES.len()] = {
        let mut all = [Self::None; NAMES.len()];
        let mut n = 0;
        while n < all.len() {
            all[n] = NAMES[n].0;
            n += 1;
        }
        all
    };

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        NAMES.iter().find(|(method, _)| *method == self).map_or("", |(_, name)| name)
    }

    /// The method for a scene with such emitters where none is asked for: [`Self::default`] if there is one that a neighbourhood can be
    /// kept for, else [`Self::None`]. Towards an infinite emitter there is but the field, which takes longer than it saves wherever it was measured
    /// (`docs/performance.md`).
    #[must_use]
    pub fn for_lights(lights: &[LightShape<'_>]) -> Self {
        let somewhere = lights.iter().any(|light| !matches!(light, LightShape::Infinite));
        if somewhere { Self::default() } else { Self::None }
    }
}

impl Default for Method {
    /// `amr-xsn`, which proves the most.
    fn default() -> Self {
        Self::Field(FieldKind::Amr, NeighbourhoodKind::Extended)
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that is none of the methods'.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown method; the methods are {}", NAMES.map(|(_, name)| name).join(", "))]
pub struct UnknownMethod;

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        NAMES.iter().find(|(_, n)| *n == name).map(|(method, _)| *method).ok_or(UnknownMethod)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for m in Method::ALL {
            assert_eq!(m.to_string().parse(), Ok(m));
            assert_eq!(Method::ALL.iter().filter(|other| other.name() == m.name()).count(), 1);
            assert!(UnknownMethod.to_string().contains(m.name()));
        }
        assert_eq!("AMR".parse::<Method>(), Err(UnknownMethod));
        assert_eq!(Method::default().name(), "amr-xsn");
    }

    #[test]
    fn a_scene_with_a_light_somewhere_has_a_method() {
        let (point, sky) = (LightShape::Point(glam::DVec3::ZERO), LightShape::Infinite);
        assert_eq!(Method::for_lights(&[sky, point]), Method::default());
        assert_eq!(Method::for_lights(&[LightShape::Area(&[])]), Method::default());
        for none in [&[][..], &[sky]] {
            assert_eq!(Method::for_lights(none), Method::None);
        }
    }
}
