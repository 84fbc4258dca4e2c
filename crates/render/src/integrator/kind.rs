//! The integrators by name. A new one is a file beside this one, a variant here and a line in [`Tracer::radiance`](super::Tracer).

use std::{fmt, str::FromStr};

use serde::{Serialize, Serializer};

/// How many samples `raymarch` takes on a path segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SegmentSamples {
    /// So many, at least 1.
    Count(u32),
    /// As many as the segment is worth: in proportion to what light scattered there contributes to the pixel at most, its share 1 − T of
    /// what comes along the segment times what that is worth at the camera. From 1 to [`SegmentSamples::MOST`].
    Auto,
}

impl SegmentSamples {
    /// The most samples that [`SegmentSamples::Auto`] takes: those of a dense fog before the camera.
    pub const MOST: u32 = 16;

    /// How many samples to take on a segment by whose medium at most `share` of the pixel comes, from 0 to 1.
    #[inline]
    #[must_use]
    pub fn of_share(self, share: f64) -> u32 {
        match self {
            Self::Count(n) => n,
            Self::Auto if share > 0.0 => (share * f64::from(Self::MOST)).ceil().min(f64::from(Self::MOST)) as u32,
            Self::Auto => 1,
        }
    }
}

impl fmt::Display for SegmentSamples {
    /// The number, or `auto`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(n) => n.fmt(f),
            Self::Auto => f.write_str("auto"),
        }
    }
}

/// A text that is no [`SegmentSamples`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("must be a number from 1 on, or auto")]
pub struct NoSegmentSamples;

impl FromStr for SegmentSamples {
    type Err = NoSegmentSamples;

    /// Reads what [`fmt::Display`] writes.
    fn from_str(text: &str) -> Result<Self, NoSegmentSamples> {
        if text == "auto" { Ok(Self::Auto) } else { text.parse().map(Self::Count).map_err(|_| NoSegmentSamples) }
    }
}

impl Serialize for SegmentSamples {
    /// The number, or `auto`.
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Count(n) => to.serialize_u32(*n),
            Self::Auto => to.serialize_str("auto"),
        }
    }
}

/// The estimator of light transport, with its parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Volumetric path tracing (Sec. 2.3 in \[Houska2013\]): any number of scattering events.
    #[default]
    Volpath,
    /// Ray marching (Sec. 2.5) with so many samples on each path segment: the medium scatters once.
    Raymarch(SegmentSamples),
}

impl Integrator {
    /// All names, each with what the integrator does.
    pub const NAMES: [(&'static str, &'static str); 2] =
        [("volpath", "path tracing of all scattering"), ("raymarch", "ray marching of single scattering")];

    /// The samples on each path segment where none are given.
    pub const SAMPLES_PER_SEGMENT: u32 = 7;

    /// Ray marching with so many samples on each path segment.
    #[must_use]
    pub const fn raymarch(samples_per_segment: u32) -> Self {
        Self::Raymarch(SegmentSamples::Count(samples_per_segment))
    }

    /// The name, without the parameter.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Volpath => "volpath",
            Self::Raymarch(_) => "raymarch",
        }
    }

    /// So many of a path's first random numbers are worth being even: those of the pixel and of one event and a half, for path tracing, whose light
    /// comes from many; more take time and no noise away (`docs/performance.md`). Of several emitters one has to be chosen, too.
    #[must_use]
    pub(crate) const fn even_dimensions(self, emitters: usize) -> u32 {
        match self {
            Self::Volpath if emitters > 1 => 16,
            Self::Volpath => 12,
            Self::Raymarch(_) => 64,
        }
    }

    /// The samples on each path segment, if it takes any.
    #[must_use]
    pub const fn samples_per_segment(self) -> Option<SegmentSamples> {
        match self {
            Self::Volpath => None,
            Self::Raymarch(samples) => Some(samples),
        }
    }

    /// This integrator with so many samples on each path segment; `None` if it takes none.
    #[must_use]
    pub const fn with_samples_per_segment(self, samples: SegmentSamples) -> Option<Self> {
        match self {
            Self::Volpath => None,
            Self::Raymarch(_) => Some(Self::Raymarch(samples)),
        }
    }

    /// Whether both estimate the same image: the samples per segment change the variance only.
    #[must_use]
    pub fn converges_as(self, other: Self) -> bool {
        self.name() == other.name()
    }
}

impl fmt::Display for Integrator {
    /// `volpath`, `raymarch 7` or `raymarch auto`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        self.samples_per_segment().map_or(Ok(()), |n| write!(f, " {n}"))
    }
}

/// A name that is none of the integrators'.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown integrator; the integrators are {}", Integrator::NAMES.map(|(name, _)| name).join(", "))]
pub struct UnknownIntegrator;

impl FromStr for Integrator {
    type Err = UnknownIntegrator;

    /// Reads what [`fmt::Display`] writes; without a number the samples per segment are [`Integrator::SAMPLES_PER_SEGMENT`].
    fn from_str(text: &str) -> Result<Self, UnknownIntegrator> {
        let (name, samples) = match text.split_once(' ') {
            Some((name, samples)) => (name, Some(samples.parse().map_err(|_| UnknownIntegrator)?)),
            None => (text, None),
        };
        let integrator = match name {
            "volpath" => Self::Volpath,
            "raymarch" => Self::raymarch(Self::SAMPLES_PER_SEGMENT),
            _ => return Err(UnknownIntegrator),
        };
        samples.map_or(Ok(integrator), |n| integrator.with_samples_per_segment(n).ok_or(UnknownIntegrator))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for integrator in [
            Integrator::Volpath,
            Integrator::raymarch(1),
            Integrator::raymarch(49),
            Integrator::Raymarch(SegmentSamples::Auto),
        ] {
            assert_eq!(integrator.to_string().parse(), Ok(integrator));
            assert!(Integrator::NAMES.iter().any(|(name, _)| *name == integrator.name()));
        }
        for (name, _) in Integrator::NAMES {
            assert_eq!(name.parse::<Integrator>().map(Integrator::name), Ok(name));
        }
        for wrong in ["", "Volpath", "volpath 7", "raymarch x", "raymarch  7", "raymarch -1", "volpath auto"] {
            assert_eq!(wrong.parse::<Integrator>(), Err(UnknownIntegrator), "{wrong}");
        }
    }

    #[test]
    fn samples_are_taken_where_light_comes_from() {
        let auto = |share| SegmentSamples::Auto.of_share(share);
        assert_eq!([0.0, 1e-9, 0.0625, 0.07, 0.5, 1.0].map(auto), [1, 1, 1, 2, 8, 16]);
        // What glass does to radiance may make a share larger than 1.
        assert_eq!([7.0, f64::INFINITY, f64::NAN].map(auto), [16, 16, 1]);
        assert_eq!(SegmentSamples::Count(49).of_share(0.0), 49);
    }
}
