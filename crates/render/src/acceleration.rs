//! Building what a method needs: voxels, distance field, safe neighbourhoods.

use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;
use vdf_distfield::{
    Amr, Dsz, Dual, ExtendedNeighbourhood, FieldError, Ndf, Neighbourhood, SafeNeighbourhood, SafeZones,
};
use vdf_voxel::{Voxel, VoxelError, VoxelGrid, VoxelSet, voxelize};

use crate::{
    AreaNeighbourhood, FieldKind, Method, NeighbourhoodKind, Triangle,
    visibility::{FieldProofs, NeighbourhoodProofs, NoProofs, Proofs},
};

/// The proofs of one method, ready to be asked. Matched once for a whole render, by [`Acceleration::accept`], never per query.
#[derive(Debug)]
#[allow(missing_docs, reason = "the variants are the fields of the methods")]
pub enum Acceleration {
    None(NoProofs),
    Ndf(FieldAcceleration<Ndf>),
    Amr(FieldAcceleration<Amr>),
    Dsz(FieldAcceleration<Dsz>),
    Dual(FieldAcceleration<Dual>),
}

/// A field, with or without neighbourhoods of the point lights.
#[derive(Debug)]
#[allow(missing_docs, reason = "the variants are those of NeighbourhoodKind")]
pub enum FieldAcceleration<F> {
    None(FieldProofs<F>),
    Safe(NeighbourhoodProofs<F, SafeNeighbourhood>),
    Extended(NeighbourhoodProofs<F, ExtendedNeighbourhood>),
}

/// What is done with the proofs of a method, whichever that is: compiled for each, so that nothing is decided in its loops.
pub trait ProofsVisitor {
    /// The result.
    type Output;

    /// Does it.
    fn visit<P: Proofs>(self, proofs: &P) -> Self::Output;
}

/// Where an emitter is, as far as proofs are concerned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightShape<'a> {
    /// A point.
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
    /// Bytes of the occupancy, the field and the neighbourhoods.
    pub bytes: [usize; 3],
    /// Seconds for the voxelization, the field and the neighbourhoods.
    pub seconds: [f64; 3],
    /// For each emitter the number of voxels of its neighbourhood, if it has one.
    pub neighbourhoods: Vec<Option<usize>>,
}

impl Acceleration {
    /// Builds the structures of `method` for the occluders `triangles` in a grid that covers `bounds`. Runs on the current rayon pool.
    ///
    /// # Errors
    /// If the voxel size is not usable for these bounds, or the grid exceeds `max_voxels`.
    pub fn build(
        method: Method,
        triangles: &[Triangle],
        bounds: (DVec3, DVec3),
        lights: &[LightShape],
        voxel_size: f64,
        max_voxels: u64,
    ) -> Result<(Self, BuildReport), VoxelError> {
        if method == Method::None {
            return Ok((
                Self::None(NoProofs),
                BuildReport { neighbourhoods: vec![None; lights.len()], ..BuildReport::default() },
            ));
        }
        let grid = VoxelGrid::covering(bounds.0, bounds.1, voxel_size, max_voxels)?;
        let start = Instant::now();
        let occupied = voxelize(&grid, triangles.par_iter().map(|t| t.vertices))?;
        let r = grid.resolution();
        let mut report = BuildReport {
            resolution: Some([r.x, r.y, r.z]),
            voxel_size,
            occupied: occupied.count(),
            voxels: r.voxel_count(),
            bytes: [occupied.bytes(), 0, 0],
            seconds: [start.elapsed().as_secs_f64(), 0.0, 0.0],
            neighbourhoods: vec![None; lights.len()],
        };
        let builder = Builder { grid, occupied: &occupied, triangles, lights, report: &mut report };
        let acceleration = match method {
            Method::None => Self::None(NoProofs),
            Method::Field(FieldKind::Ndf, kind) => Self::Ndf(builder.field(kind, Ndf::build)?),
            Method::Field(FieldKind::Amr, kind) => Self::Amr(builder.field(kind, Amr::build)?),
            Method::Field(FieldKind::Dsz, kind) => Self::Dsz(builder.field(kind, Dsz::build)?),
            Method::Field(FieldKind::Dual, kind) => Self::Dual(builder.field(kind, Dual::build)?),
        };
        Ok((acceleration, report))
    }

    /// Checks the field and the neighbourhoods of points against the occupied voxels that they were built from. The neighbourhoods of
    /// area lights, built from fewer occluders, are not looked at.
    ///
    /// # Errors
    /// The first value that is wrong.
    pub fn validate(&self, occupied: &VoxelSet) -> Result<(), FieldError> {
        match self {
            Self::None(_) => Ok(()),
            Self::Ndf(field) => field.validate(occupied),
            Self::Amr(field) => field.validate(occupied),
            Self::Dsz(field) => field.validate(occupied),
            Self::Dual(field) => field.validate(occupied),
        }
    }

    /// Gives the proofs to `visitor`.
    pub fn accept<V: ProofsVisitor>(&self, visitor: V) -> V::Output {
        match self {
            Self::None(proofs) => visitor.visit(proofs),
            Self::Ndf(field) => field.accept(visitor),
            Self::Amr(field) => field.accept(visitor),
            Self::Dsz(field) => field.accept(visitor),
            Self::Dual(field) => field.accept(visitor),
        }
    }
}

impl<F: SafeZones> FieldAcceleration<F> {
    fn validate(&self, occupied: &VoxelSet) -> Result<(), FieldError> {
        fn all<F: SafeZones, N: Neighbourhood>(
            proofs: &NeighbourhoodProofs<F, N>,
            occupied: &VoxelSet,
        ) -> Result<(), FieldError> {
            proofs.base.field.validate(occupied)?;
            proofs.neighbourhoods.iter().flatten().try_for_each(|n| n.validate(occupied))
        }
        match self {
            Self::None(proofs) => proofs.field.validate(occupied),
            Self::Safe(proofs) => all(proofs, occupied),
            Self::Extended(proofs) => all(proofs, occupied),
        }
    }

    fn accept<V: ProofsVisitor>(&self, visitor: V) -> V::Output {
        match self {
            Self::None(proofs) => visitor.visit(proofs),
            Self::Safe(proofs) => visitor.visit(proofs),
            Self::Extended(proofs) => visitor.visit(proofs),
        }
    }
}

/// Builds a field and its neighbourhoods and writes down what that took.
struct Builder<'a> {
    grid: VoxelGrid,
    occupied: &'a VoxelSet,
    triangles: &'a [Triangle],
    lights: &'a [LightShape<'a>],
    report: &'a mut BuildReport,
}

impl Builder<'_> {
    fn field<F: SafeZones>(
        self,
        kind: NeighbourhoodKind,
        build: impl FnOnce(&VoxelSet) -> F,
    ) -> Result<FieldAcceleration<F>, VoxelError> {
        let start = Instant::now();
        let field = build(self.occupied);
        self.report.seconds[1] = start.elapsed().as_secs_f64();
        self.report.bytes[1] = field.bytes();
        let base = FieldProofs { grid: self.grid, field };
        let occupied = self.occupied;
        Ok(match kind {
            NeighbourhoodKind::None => FieldAcceleration::None(base),
            NeighbourhoodKind::Safe => FieldAcceleration::Safe(
                self.neighbourhoods(base, |base, light| SafeNeighbourhood::new(&base.field, occupied, light))?,
            ),
            NeighbourhoodKind::Extended => FieldAcceleration::Extended(
                self.neighbourhoods(base, |_, light| ExtendedNeighbourhood::new(occupied, light.into()))?,
            ),
        })
    }

    /// One neighbourhood for each point light in the grid, and one for each area light.
    fn neighbourhoods<F: SafeZones, N: Neighbourhood + Send>(
        self,
        base: FieldProofs<F>,
        build: impl Fn(&FieldProofs<F>, Voxel) -> N + Sync,
    ) -> Result<NeighbourhoodProofs<F, N>, VoxelError> {
        let start = Instant::now();
        let neighbourhoods: Vec<_> = self
            .lights
            .par_iter()
            .map(|light| match light {
                LightShape::Point(position) => self.grid.voxel_containing(*position).map(|v| build(&base, v)),
                LightShape::Area(_) | LightShape::Infinite => None,
            })
            .collect();
        let areas: Vec<_> = self
            .lights
            .iter()
            .map(|light| match light {
                LightShape::Area(light) => AreaNeighbourhood::build(&self.grid, self.triangles, light),
                LightShape::Point(_) | LightShape::Infinite => Ok(None),
            })
            .collect::<Result<_, _>>()?;
        let sizes = neighbourhoods.iter().zip(&areas).map(|(point, area)| {
            let point = point.as_ref().map(|n| (n.count(), n.bytes()));
            point.or_else(|| area.as_ref().map(|n| (n.count(), n.bytes())))
        });
        let sizes: Vec<Option<(usize, usize)>> = sizes.collect();
        self.report.seconds[2] = start.elapsed().as_secs_f64();
        self.report.bytes[2] = sizes.iter().flatten().map(|(_, bytes)| bytes).sum();
        self.report.neighbourhoods = sizes.iter().map(|size| size.map(|(count, _)| count)).collect();
        Ok(NeighbourhoodProofs { base, neighbourhoods, areas })
    }
}
