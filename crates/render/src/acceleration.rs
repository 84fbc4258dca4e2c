//! Building what a method needs: voxels, distance field, safe neighbourhoods.

use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;
use vdf_distfield::{Amr, Ndf, SafeNeighbourhood, SafeZones};
use vdf_voxel::{VoxelError, VoxelGrid, VoxelSet, voxelize};

use crate::{
    Method, Triangle,
    scene::Emitter,
    visibility::{FieldProofs, NeighbourhoodProofs, NoProofs, Proofs},
};

/// The proofs of one method, ready to be asked. Matched once for a whole render, never per query.
#[derive(Debug)]
#[allow(missing_docs, reason = "the variants are the methods")]
pub enum Acceleration {
    None(NoProofs),
    Ndf(FieldProofs<Ndf>),
    Amr(FieldProofs<Amr>),
    NdfSn(NeighbourhoodProofs<Ndf>),
    AmrSn(NeighbourhoodProofs<Amr>),
}

/// What is done with the proofs of a method, whichever that is: compiled for each, so that nothing is decided in its loops.
pub trait ProofsVisitor {
    /// The result.
    type Output;

    /// Does it.
    fn visit<P: Proofs>(self, proofs: &P) -> Self::Output;
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
        emitters: &[Emitter],
        voxel_size: f64,
        max_voxels: u64,
    ) -> Result<(Self, BuildReport), VoxelError> {
        if method == Method::None {
            return Ok((
                Self::None(NoProofs),
                BuildReport { neighbourhoods: vec![None; emitters.len()], ..BuildReport::default() },
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
            neighbourhoods: vec![None; emitters.len()],
        };
        let acceleration = match method {
            Method::None => Self::None(NoProofs),
            Method::Ndf => Self::Ndf(build_field(grid, &mut report, || Ndf::build(&occupied))),
            Method::Amr => Self::Amr(build_field(grid, &mut report, || Amr::build(&occupied))),
            Method::NdfSn => {
                let base = build_field(grid, &mut report, || Ndf::build(&occupied));
                Self::NdfSn(build_neighbourhoods(base, &occupied, emitters, &mut report))
            }
            Method::AmrSn => {
                let base = build_field(grid, &mut report, || Amr::build(&occupied));
                Self::AmrSn(build_neighbourhoods(base, &occupied, emitters, &mut report))
            }
        };
        Ok((acceleration, report))
    }

    /// Gives the proofs to `visitor`.
    pub fn accept<V: ProofsVisitor>(&self, visitor: V) -> V::Output {
        match self {
            Self::None(proofs) => visitor.visit(proofs),
            Self::Ndf(proofs) => visitor.visit(proofs),
            Self::Amr(proofs) => visitor.visit(proofs),
            Self::NdfSn(proofs) => visitor.visit(proofs),
            Self::AmrSn(proofs) => visitor.visit(proofs),
        }
    }
}

fn build_field<F: SafeZones>(grid: VoxelGrid, report: &mut BuildReport, build: impl FnOnce() -> F) -> FieldProofs<F> {
    let start = Instant::now();
    let field = build();
    report.seconds[1] = start.elapsed().as_secs_f64();
    report.bytes[1] = field.bytes();
    FieldProofs { grid, field }
}

/// One neighbourhood for each point emitter.
fn build_neighbourhoods<F: SafeZones>(
    base: FieldProofs<F>,
    occupied: &VoxelSet,
    emitters: &[Emitter],
    report: &mut BuildReport,
) -> NeighbourhoodProofs<F> {
    let start = Instant::now();
    let neighbourhoods: Vec<_> = emitters
        .iter()
        .map(|e| match e {
            Emitter::Point { position, .. } => {
                base.grid.voxel_containing(*position).map(|v| SafeNeighbourhood::new(&base.field, occupied, v))
            }
            Emitter::Area { .. } | Emitter::Constant { .. } => None,
        })
        .collect();
    report.seconds[2] = start.elapsed().as_secs_f64();
    report.bytes[2] = neighbourhoods.iter().flatten().map(SafeNeighbourhood::bytes).sum();
    report.neighbourhoods = neighbourhoods.iter().map(|n| n.as_ref().map(SafeNeighbourhood::count)).collect();
    NeighbourhoodProofs { base, neighbourhoods }
}
