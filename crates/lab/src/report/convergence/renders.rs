//! The renders of a plan, and what they count as progress.

use vdf_image::Image;
use vdf_render::{Integrator, PrepareOptions, PreparedScene, Progress, RenderOptions};
use vdf_scene::PixelRect;
use vdf_visibility::Method;

use super::plan::{Plan, REFERENCE_SEEDS};
use crate::{LabError, progress::look};

/// Renders a scene by plan.
pub(super) struct Renders<'a> {
    pub(super) plan: &'a Plan,
    /// The scene with the hierarchy alone.
    pub(super) alone: &'a PreparedScene,
    pub(super) progress: &'a dyn Progress,
}

/// Progress of a render as a part of the whole, which is counted in paths.
struct Paths<'a> {
    whole: &'a dyn Progress,
    counts: bool,
}

impl Progress for Paths<'_> {
    fn phase(&self, _: &str) {}

    fn work_total(&self, _: u64) {}

    fn work_done(&self, paths: u64) {
        if self.counts {
            self.whole.work_done(paths);
        }
    }

    fn cancelled(&self) -> bool {
        self.whole.cancelled()
    }
}

impl Renders<'_> {
    pub(super) fn build(&self, method: Method) -> Result<PreparedScene, LabError> {
        look(self.progress)?;
        let options = PrepareOptions {
            voxel_size: Some(self.plan.voxel_size),
            grid: self.plan.grid,
            threads: self.plan.threads,
            ..PrepareOptions::with_method(method)
        };
        Ok(self.alone.with_options(&options, &Paths { whole: self.progress, counts: false })?)
    }

    /// The image and `T_render` in seconds.
    pub(super) fn render(
        &self,
        prepared: &PreparedScene,
        integrator: Integrator,
        seed: u64,
        spp: u32,
    ) -> Result<(Image, f64), LabError> {
        let options = self.options(integrator, seed, spp);
        let rendering = prepared.render(&options, &Paths { whole: self.progress, counts: true })?;
        Ok((rendering.image, rendering.statistics.t_render))
    }

    /// Both halves of a reference by the hierarchy alone, or a part of them, which only checks something and is no
    /// progress.
    pub(super) fn halves(&self, integrator: Integrator, crop: Option<PixelRect>) -> Result<[Image; 2], LabError> {
        let half_spp = self.plan.half_spp;
        let progress = Paths { whole: self.progress, counts: crop.is_none() };
        let half = |seed| {
            let options = RenderOptions { crop, ..self.options(integrator, seed, half_spp) };
            self.alone.render(&options, &progress).map(|r| r.image)
        };
        Ok([half(REFERENCE_SEEDS[0])?, half(REFERENCE_SEEDS[1])?])
    }

    fn options(&self, integrator: Integrator, seed: u64, spp: u32) -> RenderOptions {
        RenderOptions {
            integrator,
            spp: Some(spp),
            seed: Some(seed),
            threads: self.plan.threads,
            ..RenderOptions::thesis()
        }
    }
}
