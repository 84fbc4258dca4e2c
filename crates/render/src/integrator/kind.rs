//! The integrators by name. A new one is a file beside this one, a variant here and a line in [`Tracer::radiance`](super::Tracer).

use std::{fmt, str::FromStr};

/// The estimator of light transport, with its parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Volumetric path tracing (Sec. 2.3 in \[Houska2013\]): any number of scattering events.
    #[default]
    Volpath,
    /// Ray marching (Sec. 2.5): the medium scatters once.
    Raymarch {
        /// Samples on each path segment, at least 1.
        samples_per_segment: u32,
    },
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
        Self::Raymarch { samples_per_segment }
    }

    /// The name, without the parameter.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Volpath => "volpath",
            Self::Raymarch { .. } => "raymarch",
        }
    }

    /// The samples on each path segment, if it takes any.
    #[must_use]
    pub const fn samples_per_segment(self) -> Option<u32> {
        match self {
            Self::Volpath => None,
            Self::Raymarch { samples_per_segment } => Some(samples_per_segment),
        }
    }

    /// This integrator with so many samples on each path segment; `None` if it takes none.
    #[must_use]
    pub const fn with_samples_per_segment(self, n: u32) -> Option<Self> {
        match self {
            Self::Volpath => None,
            Self::Raymarch { .. } => Some(Self::raymarch(n)),
        }
    }

    /// Whether both estimate the same image: the samples per segment change the variance only.
    #[must_use]
    pub fn converges_as(self, other: Self) -> bool {
        self.name() == other.name()
    }
}

impl fmt::Display for Integrator {
    /// `volpath`, or `raymarch 7`.
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
        for integrator in [Integrator::Volpath, Integrator::raymarch(1), Integrator::raymarch(49)] {
            assert_eq!(integrator.to_string().parse(), Ok(integrator));
            assert!(Integrator::NAMES.iter().any(|(name, _)| *name == integrator.name()));
        }
        for (name, _) in Integrator::NAMES {
            assert_eq!(name.parse::<Integrator>().map(Integrator::name), Ok(name));
        }
        for wrong in ["", "Volpath", "volpath 7", "raymarch x", "raymarch  7", "raymarch -1"] {
            assert_eq!(wrong.parse::<Integrator>(), Err(UnknownIntegrator), "{wrong}");
        }
    }
}
