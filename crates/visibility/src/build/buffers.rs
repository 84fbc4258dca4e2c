//! The light buffers of point lights.

use std::time::Instant;

use vdf_geometry::Triangle;

use super::{ProverOptions, begin, next, options::LIGHTS_BYTES, report::Kept};
use crate::{LightBuffer, LightProver, LightShape, Progress, Refusal, VisibilityError};

/// Builds the buffers of all point lights, one after the other, each on all threads, as long as they fit.
pub(super) fn build_buffers(
    options: &ProverOptions,
    triangles: &[Triangle],
    lights: &[LightShape<'_>],
    kept: &mut [Kept],
    progress: &dyn Progress,
) -> Result<(), VisibilityError> {
    let count = lights.iter().filter(|l| matches!(l, LightShape::Point(_))).count();
    begin(progress, "light buffers", count as u64)?;
    let mut free = options.max_bytes.min(LIGHTS_BYTES);
    let mut side = options.texels_for(triangles.len(), count);
    for (light, kept) in lights.iter().zip(kept) {
        let LightShape::Point(position) = light else { continue };
        next(progress)?;
        let start = Instant::now();
        let mut built = LightBuffer::build(triangles, *position, side, free);
        if matches!(built, Err(Refusal::Memory)) && options.texels.is_none() && side > 64 {
            // Those that come after it have no better chance.
            side = 64;
            built = LightBuffer::build(triangles, *position, side, free);
        }
        match built {
            Ok(buffer) => {
                free -= buffer.bytes() as u64;
                kept.seconds = Some(start.elapsed().as_secs_f64());
                kept.prover = Some(LightProver::Buffer(Box::new(buffer)));
            }
            Err(refusal) => kept.fallback = Some(refusal.reason()),
        }
    }
    Ok(())
}
