//! What a scaling report sweeps, how far and how often.

use std::{fmt, str::FromStr};

use super::{
    super::{MAX_THREADS, bench::processors},
    lights, triangles, voxels,
};
use crate::LabError;

/// A sweep by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SweepKind {
    /// `san-miguel`, generated with more and more triangles.
    Triangles,
    /// `cbox_vol2`, its triangles split into more and more of the same shapes.
    Refined,
    /// `cbox_vol2` in more and more voxels.
    Voxels,
    /// `cbox_vol2` with more and more point lights.
    Lights,
    /// `san-miguel` on more and more threads.
    Threads,
}

impl SweepKind {
    /// All sweeps.
    pub const ALL: [Self; 5] = [Self::Triangles, Self::Refined, Self::Voxels, Self::Lights, Self::Threads];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Refined => "refined",
            Self::Voxels => "voxels",
            Self::Lights => "lights",
            Self::Threads => "threads",
        }
    }
}

impl fmt::Display for SweepKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that is none of the sweeps'.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown sweep; the sweeps are {}", SweepKind::ALL.map(SweepKind::name).join(", "))]
pub struct UnknownSweep;

impl FromStr for SweepKind {
    type Err = UnknownSweep;

    fn from_str(name: &str) -> Result<Self, UnknownSweep> {
        Self::ALL.into_iter().find(|s| s.name() == name).ok_or(UnknownSweep)
    }
}

/// What is measured, how far and how often.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScalingOptions {
    /// The sweeps, in any order.
    pub sweeps: Vec<SweepKind>,
    /// The most triangles, from 10⁵ to 10⁷.
    pub max_triangles: u64,
    /// The most voxels, as the side of a cube, from 32 to 512.
    pub max_voxels_per_side: u32,
    /// The most point lights, from 1 to 1024.
    pub max_lights: u32,
    /// The most threads, from 1 to 1024.
    pub max_threads: usize,
    /// Measurements that a median is taken of, from 1 to 1000.
    pub repetitions: u32,
    /// Side of the images in pixels, from 1 to 4096.
    pub size: u32,
    /// Samples per pixel, at least 1.
    pub spp: u32,
    /// Seed of the renders.
    pub seed: u64,
    /// Number of threads outside the sweep of threads; by default one for each processor. Queries are timed on one.
    pub threads: Option<usize>,
    /// The most queries to replay, at least 1.
    pub queries: u64,
    /// Voxels along the longest side of the scene in the sweep of threads, at least 1: enough work for several.
    pub voxels_for_threads: u32,
}

impl Default for ScalingOptions {
    /// All sweeps: a minute and a half on two cores.
    fn default() -> Self {
        Self {
            sweeps: SweepKind::ALL.to_vec(),
            max_triangles: 1_000_000,
            max_voxels_per_side: 256,
            max_lights: 64,
            max_threads: processors().min(MAX_THREADS),
            repetitions: 5,
            size: 128,
            spp: 16,
            seed: 0,
            threads: None,
            queries: 200_000,
            voxels_for_threads: 512,
        }
    }
}

impl ScalingOptions {
    /// Smaller sizes and fewer repetitions: a look.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            max_triangles: 400_000,
            max_voxels_per_side: 128,
            max_lights: 16,
            repetitions: 3,
            size: 48,
            spp: 4,
            queries: 20_000,
            voxels_for_threads: 128,
            ..Self::default()
        }
    }

    /// Checks all options.
    ///
    /// # Errors
    /// [`vdf_render::RenderError::Option`] names the option and what it has to be.
    pub fn validate(&self) -> Result<(), LabError> {
        let limits = [
            ("max-triangles", self.max_triangles, triangles::MIN_TRIANGLES, triangles::MAX_TRIANGLES),
            ("max-voxels-per-side", self.max_voxels_per_side.into(), voxels::MIN_SIDE.into(), voxels::MAX_SIDE.into()),
            ("max-lights", self.max_lights.into(), 1, lights::MAX_LIGHTS.into()),
            ("max-threads", self.max_threads as u64, 1, MAX_THREADS as u64),
            ("repetitions", self.repetitions.into(), 1, 1000),
            ("size", self.size.into(), 1, 4096),
            ("spp", self.spp.into(), 1, 1 << 24),
            ("max-queries", self.queries, 1, u64::MAX),
            ("voxels-for-threads", self.voxels_for_threads.into(), 1, voxels::MAX_SIDE.into()),
        ];
        for (option, value, least, most) in limits {
            LabError::check_range(option, value, least, most)?;
        }
        self.threads.map_or(Ok(()), |n| LabError::check_range("threads", n as u64, 1, MAX_THREADS as u64))
    }
}

#[cfg(test)]
mod tests {
    use vdf_visibility::Method;

    use super::*;
    use crate::report::scaling::measure::method;

    #[test]
    fn defaults_are_valid_and_limits_are_kept() {
        for options in [ScalingOptions::default(), ScalingOptions::quick()] {
            options.validate().unwrap();
        }
        let many = ScalingOptions { max_lights: 1025, ..ScalingOptions::default() };
        assert_eq!(many.validate().unwrap_err().to_string(), "max-lights must be from 1 to 1024, not 1025");
        let none = ScalingOptions { threads: Some(0), ..ScalingOptions::default() };
        assert_eq!(none.validate().unwrap_err().to_string(), "threads must be from 1 to 1024, not 0");
    }

    #[test]
    fn names_round_trip() {
        for kind in SweepKind::ALL {
            assert_eq!(kind.to_string().parse(), Ok(kind));
        }
        assert_eq!("stars".parse::<SweepKind>(), Err(UnknownSweep));
        let named = ["ndf", "amr", "amr-sn", "amr-xsn", "dsz", "dual"];
        assert!(named.into_iter().all(|name| method(name) != Method::NONE && method(name).name() == name));
    }
}
