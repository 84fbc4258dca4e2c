//! Building what a method needs: light buffers, voxels, a distance field, a prover for each light; within a limit of memory.
//!
//! Point lights get their buffers first, if the method has any. Voxels are built if a field or a light needs them; they and the field must
//! fit, or nothing is built. Then lights get their neighbourhoods in the order of their list, as long as these fit; the
//! lights that are left ask the field, if there is one. All sizes but those of buffers are known before anything is allocated.

mod buffers;
mod neighbourhoods;
mod options;
mod report;
#[cfg(test)]
mod tests;

use rayon::prelude::*;
use vdf_geometry::{Bounds, Triangle};
use vdf_voxel::{Resolution, VoxelError, VoxelGrid, VoxelSet, voxelize};

use self::{buffers::build_buffers, neighbourhoods::LightBuilder, options::LIGHTS_BYTES, report::Kept};
pub use self::{
    options::ProverOptions,
    report::{BuildReport, BuiltPart, LightReport},
};
use crate::{DistanceField, FieldKind, FieldProver, LightShape, PointProver, Progress, Provers, VisibilityError};

impl Provers {
    /// Builds what `options.method` needs for the occluders `triangles` and these lights, in a grid that covers
    /// `bounds`, which must hold all occluders. Runs on the current rayon pool. `progress` hears of each step, and in it of light buffers,
    /// planes of the field and neighbourhoods.
    ///
    /// # Errors
    /// If `progress` asks to stop, which is looked at before each of these; if voxels are needed and their size is not usable for these bounds,
    /// or the grid exceeds `options.max_voxels`, or its voxels and field `options.max_bytes` or what the system gives. What is kept for a light and exceeds `max_bytes`, or 1 GiB
    /// together with the others', is no error: see [`LightReport::fallback`].
    pub fn build(
        options: &ProverOptions,
        triangles: &[Triangle],
        bounds: Bounds,
        lights: &[LightShape<'_>],
        progress: &dyn Progress,
    ) -> Result<(Self, BuildReport), VisibilityError> {
        let mut report = BuildReport::default();
        let method = options.method;
        let mut kept: Vec<Kept> = lights.iter().map(|_| Kept::default()).collect();
        let (mut max_bytes, mut lights_bytes) = (options.max_bytes, options.max_bytes.min(LIGHTS_BYTES));
        if method.point_prover() == PointProver::Buffer {
            if !triangles.par_iter().all(Triangle::is_finite) {
                return Err(VoxelError::NonFiniteTriangle.into());
            }
            report.step("light buffers", || build_buffers(options, triangles, lights, &mut kept, progress), |()| 0)?;
            let bytes = kept.iter().map(Kept::bytes).sum();
            report.parts[0].bytes = bytes;
            max_bytes = max_bytes.saturating_sub(bytes as u64);
            lights_bytes = lights_bytes.saturating_sub(bytes as u64);
        }
        let wanting = |(light, kept): (&LightShape<'_>, &Kept)| *light != LightShape::Infinite && kept.prover.is_none();
        let needs_voxels = match method.point_prover() {
            PointProver::Buffer | PointProver::Extended if method.field().is_none() => {
                lights.iter().zip(&kept).any(wanting)
            }
            _ => method.field().is_some(),
        };
        if !needs_voxels {
            return Ok((report.finished(None, None, kept), report));
        }
        let kind = method.field();
        let bytes = |resolution| shared_bytes(kind, resolution);
        let grid = VoxelGrid::covering_within(
            bounds.min,
            bounds.max,
            options.voxel_size,
            options.max_voxels,
            max_bytes,
            bytes,
        )?;
        if !is_there(bytes(grid.resolution())) {
            return Err(VisibilityError::NoMemory { size: options.voxel_size, bytes: bytes(grid.resolution()) });
        }
        let free = max_bytes.saturating_sub(bytes(grid.resolution())).min(lights_bytes);
        begin(progress, "voxels", 1)?;
        let occupied = report.step(
            "voxels",
            || Ok(voxelize(&grid, triangles.par_iter().map(|t| t.vertices))?),
            VoxelSet::bytes,
        )?;
        let r = grid.resolution();
        report.resolution = Some(r.sides());
        report.voxel_size = options.voxel_size;
        (report.occupied, report.voxels) = (occupied.count(), r.voxel_count());
        let field = match kind {
            Some(kind) => {
                begin(progress, "distance field", DistanceField::planes(kind))?;
                let next = || next(progress).is_ok();
                let build = || DistanceField::build_while(kind, &occupied, &next).ok_or(VisibilityError::Cancelled);
                Some(report.step("field", build, DistanceField::bytes)?)
            }
            None => None,
        };
        let builder = LightBuilder { point: method.point_prover(), grid, occupied: &occupied, field: field.as_ref() };
        let neighbourhoods = || builder.build_wanting(triangles, lights, &mut kept, free, progress);
        report.step("neighbourhoods", neighbourhoods, |&bytes| bytes)?;
        let field = field.map(|field| FieldProver::new(grid, field));
        Ok((report.finished(Some(grid), field, kept), report))
    }
}

/// The memory of the voxels and of a field over them, in bytes.
fn shared_bytes(kind: Option<FieldKind>, resolution: Resolution) -> u64 {
    let planes = kind.map_or(0, DistanceField::planes);
    (resolution.voxel_count() as u64).saturating_mul(planes).saturating_add(VoxelSet::bytes_of(resolution))
}

/// Whether the system gives so much memory: asked before what would end the program if it were not there.
fn is_there(bytes: u64) -> bool {
    usize::try_from(bytes).is_ok_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok())
}

/// A step begins that has so many parts.
fn begin(progress: &dyn Progress, name: &str, parts: u64) -> Result<(), VisibilityError> {
    progress.phase(name);
    progress.work_total(parts);
    if progress.cancelled() { Err(VisibilityError::Cancelled) } else { Ok(()) }
}

/// A part of a step begins, and counts as done: parts are told apart by when they begin.
fn next(progress: &dyn Progress) -> Result<(), VisibilityError> {
    progress.work_done(1);
    if progress.cancelled() { Err(VisibilityError::Cancelled) } else { Ok(()) }
}
