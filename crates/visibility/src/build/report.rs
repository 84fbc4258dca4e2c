//! What was built: how large it is, how long it took, and what each light keeps.

use std::time::Instant;

use vdf_voxel::VoxelGrid;

use super::neighbourhoods::{TOO_LARGE, TOO_LONG};
use crate::{FieldProver, LightProver, Provers, VisibilityError};

/// What was built, how large it is and how long it took.
#[derive(Clone, Debug, Default)]
pub struct BuildReport {
    /// Voxels along x, y and z; `None` if the method needs none for these lights.
    pub resolution: Option<[u32; 3]>,
    /// Side of a voxel in world units.
    pub voxel_size: f64,
    /// Occupied voxels.
    pub occupied: usize,
    /// All voxels.
    pub voxels: usize,
    /// What was built, in this order.
    pub parts: Vec<BuiltPart>,
    /// For each emitter what its prover keeps.
    pub lights: Vec<LightReport>,
}

/// One step of a build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuiltPart {
    /// What was built: "light buffers", "voxels", "field" or "neighbourhoods".
    pub name: &'static str,
    /// Its memory in bytes.
    pub bytes: usize,
    /// How long it took, in seconds.
    pub seconds: f64,
}

/// What the prover of one light keeps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LightReport {
    /// Voxels of its neighbourhood, if it has one.
    pub voxels: Option<usize>,
    /// Texels along each side of a face of its light buffer, if it has one.
    pub texels: Option<u32>,
    /// Its memory in bytes.
    pub bytes: usize,
    /// How long its light buffer took to build, in seconds, if it has one.
    pub seconds: Option<f64>,
    /// Why it has not what the method would keep for it; `None` if that is not so. A light without a buffer gets a neighbourhood, one without
    /// a neighbourhood asks the field, if there is one.
    pub fallback: Option<&'static str>,
}

impl BuildReport {
    /// `T_build` in seconds (Sec. 2.6 in \[Houska2013\]).
    #[must_use]
    pub fn seconds(&self) -> f64 {
        // An empty sum of floating-point numbers would be −0, which is printed with its sign.
        self.parts.iter().fold(0.0, |sum, p| sum + p.seconds)
    }

    /// The memory of all that was built, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.parts.iter().map(|p| p.bytes).sum()
    }

    /// Lights that have no neighbourhood of their own because those of the lights before them take all memory or time that there is.
    #[must_use]
    pub fn over_budget(&self) -> usize {
        self.lights
            .iter()
            .filter(|light| light.fallback.is_some_and(|why| [TOO_LARGE, TOO_LONG].contains(&why)))
            .count()
    }

    /// Does a step and writes down what it took.
    pub(super) fn step<T>(
        &mut self,
        name: &'static str,
        work: impl FnOnce() -> Result<T, VisibilityError>,
        bytes: impl FnOnce(&T) -> usize,
    ) -> Result<T, VisibilityError> {
        let start = Instant::now();
        let built = work()?;
        self.parts.push(BuiltPart { name, bytes: bytes(&built), seconds: start.elapsed().as_secs_f64() });
        Ok(built)
    }
}

impl BuildReport {
    /// The provers of what was built, and the lights' part of this report.
    pub(super) fn finished(&mut self, grid: Option<VoxelGrid>, field: Option<FieldProver>, kept: Vec<Kept>) -> Provers {
        let lights = kept.into_iter().map(|kept| {
            let prover = kept.prover.unwrap_or(LightProver::Field);
            self.lights.push(LightReport {
                voxels: prover.voxels(),
                texels: prover.texels(),
                bytes: prover.bytes(),
                seconds: kept.seconds,
                fallback: kept.fallback,
            });
            prover
        });
        let lights = lights.collect();
        Provers::new(grid, field, lights)
    }
}

/// What is kept for a light so far.
#[derive(Default)]
pub(super) struct Kept {
    pub(super) prover: Option<LightProver>,
    /// How long its light buffer took.
    pub(super) seconds: Option<f64>,
    /// Why it is not what the method would keep.
    pub(super) fallback: Option<&'static str>,
}

impl Kept {
    pub(super) fn bytes(&self) -> usize {
        self.prover.as_ref().map_or(0, LightProver::bytes)
    }
}
