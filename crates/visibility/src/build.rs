//! Building what a method needs: voxels, a distance field, a prover for each light.

use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;
use vdf_distfield::{ExtendedNeighbourhood, SafeNeighbourhood};
use vdf_geometry::{Bounds, Triangle};
use vdf_voxel::{Voxel, VoxelGrid, VoxelSet, voxelize};

use crate::{
    AreaNeighbourhood, DistanceField, FieldProver, LightProver, Method, PointProver, Provers, VisibilityError,
    prover::each_field,
};

/// What to build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProverOptions {
    /// The method.
    pub method: Method,
    /// Side of a voxel in world units; positive.
    pub voxel_size: f64,
    /// The largest number of voxels that may be built; `amr` takes 8 bytes for each.
    pub max_voxels: u64,
}

impl Default for ProverOptions {
    /// `amr-xsn` with voxels of 1 unit, at most 2²⁹ (4 GiB).
    fn default() -> Self {
        Self { method: Method::default(), voxel_size: 1.0, max_voxels: 1 << 29 }
    }
}

/// Where an emitter is, as far as proofs are concerned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightShape<'a> {
    /// A point, in world units.
    Point(DVec3),
    /// Some of the occluders.
    Area(&'a [Triangle]),
    /// Infinitely far away.
    Infinite,
}

/// What was built, how large it is and how long it took.
#[derive(Clone, Debug, Default)]
pub struct BuildReport {
    /// Voxels along x, y and z; `None` for the method `none`.
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
    /// What was built: "voxels", "field" or "neighbourhoods".
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
    /// Its memory in bytes.
    pub bytes: usize,
}

impl BuildReport {
    /// `T_build` in seconds (Sec. 2.6 in \[Houska2013\]).
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.parts.iter().map(|p| p.seconds).sum()
    }

    /// The memory of all that was built, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.parts.iter().map(|p| p.bytes).sum()
    }

    /// Does a step and writes down what it took.
    fn step<T>(
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

impl Provers {
    /// Builds what `options.method` needs for the occluders `triangles` and these lights, in a grid that covers `bounds`, which must
    /// hold all occluders. Runs on the current rayon pool.
    ///
    /// # Errors
    /// If the voxel size is not usable for these bounds, or the grid exceeds `options.max_voxels`.
    pub fn build(
        options: &ProverOptions,
        triangles: &[Triangle],
        bounds: Bounds,
        lights: &[LightShape<'_>],
    ) -> Result<(Self, BuildReport), VisibilityError> {
        let mut report = BuildReport { lights: vec![LightReport::default(); lights.len()], ..BuildReport::default() };
        let Some(kind) = options.method.field() else { return Ok((Self::none(), report)) };
        let grid = VoxelGrid::covering(bounds.min, bounds.max, options.voxel_size, options.max_voxels)?;
        let occupied = report.step(
            "voxels",
            || Ok(voxelize(&grid, triangles.par_iter().map(|t| t.vertices))?),
            VoxelSet::bytes,
        )?;
        let r = grid.resolution();
        report.resolution = Some(r.sides());
        report.voxel_size = options.voxel_size;
        (report.occupied, report.voxels) = (occupied.count(), r.voxel_count());
        let field = report.step("field", || Ok(DistanceField::build(kind, &occupied)), DistanceField::bytes)?;

        let builder =
            LightBuilder { point: options.method.point_prover(), grid, occupied: &occupied, field: &field, triangles };
        let build = || lights.par_iter().map(|light| builder.prover(light)).collect::<Result<Vec<_>, _>>();
        let provers = report.step("neighbourhoods", build, |all| all.iter().map(LightProver::bytes).sum())?;
        report.lights = provers.iter().map(|p| LightReport { voxels: p.voxels(), bytes: p.bytes() }).collect();
        Ok((Self::new(grid, Some(FieldProver::new(grid, field)), provers), report))
    }
}

/// Chooses and builds the prover of each light.
struct LightBuilder<'a> {
    point: PointProver,
    grid: VoxelGrid,
    occupied: &'a VoxelSet,
    field: &'a DistanceField,
    triangles: &'a [Triangle],
}

impl LightBuilder<'_> {
    fn prover(&self, light: &LightShape<'_>) -> Result<LightProver, VisibilityError> {
        let keeps = self.point != PointProver::Field;
        match light {
            LightShape::Point(position) if keeps => {
                Ok(self.grid.voxel_containing(*position).map_or(LightProver::Field, |voxel| self.point_prover(voxel)))
            }
            LightShape::Area(light) if keeps => {
                let area = AreaNeighbourhood::build(&self.grid, self.triangles, light)?;
                Ok(area.map_or(LightProver::Field, LightProver::Area))
            }
            LightShape::Point(_) | LightShape::Area(_) | LightShape::Infinite => Ok(LightProver::Field),
        }
    }

    fn point_prover(&self, light: Voxel) -> LightProver {
        match self.point {
            PointProver::Field => LightProver::Field,
            PointProver::Safe => {
                LightProver::Safe(each_field!(self.field, field => SafeNeighbourhood::new(field, self.occupied, light)))
            }
            PointProver::Extended => LightProver::Extended(ExtendedNeighbourhood::new(self.occupied, light.into())),
        }
    }
}
