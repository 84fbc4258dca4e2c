//! The measurements behind Tables 6.1 and 6.2: how repeatable it is, and what measuring does.

use vdf_render::{PreparedScene, RenderOptions};
use vdf_visibility::{FieldKind, Method, PointProver};

use super::{
    super::bench::median,
    bench::{Bench, total},
    data::{Measured, Repeated},
};
use crate::{
    LabError,
    queries::{MethodReplay, Replay, TimerInfluence},
};

/// A setting of Table 6.1 and its runs: `T_build`, `T_render`, `T_query`.
pub(super) struct RepeatedResult<'a> {
    pub(super) setting: &'a Repeated,
    pub(super) runs: Vec<[f64; 3]>,
}

/// A setting of Table 6.2.
pub(super) struct MeasuredResult<'a> {
    pub(super) setting: &'a Measured,
    /// Median of `T_render` in renders whose queries were not recorded, and in renders whose queries were.
    pub(super) without: f64,
    pub(super) with: f64,
    pub(super) t_query: f64,
    /// Nanoseconds a query of the hierarchy, without timers and with.
    pub(super) t_spatial: f64,
    pub(super) timer: TimerInfluence,
}

/// Renders that alternate for Table 6.2.
const ALTERNATIONS: usize = 3;

/// Tables 6.1 and 6.2 are about the non-directional distance field.
fn thesis_method() -> Method {
    Method::of(FieldKind::Ndf, PointProver::Field)
}

/// Nanoseconds of a spatial query with the one method of this replay.
fn effective(replay: &Replay) -> f64 {
    replay.methods.first().and_then(MethodReplay::spatial).map_or(0.0, |p| p.t_effective.median)
}

impl Bench<'_> {
    /// Runs of each setting of Table 6.1.
    const fn runs(&self) -> usize {
        if self.quick { 3 } else { 8 }
    }

    /// How many steps so many settings of Table 6.1 and 6.2 take.
    pub(super) fn repeated_steps(&self, repeated: usize, measured: usize) -> usize {
        repeated * (1 + self.runs()) + measured * (1 + 2 * ALTERNATIONS)
    }

    /// A setting of Table 6.1, measured again and again.
    pub(super) fn repeated<'a>(&self, setting: &'a Repeated) -> Result<RepeatedResult<'a>, LabError> {
        let alone = self.prepare(&setting.scene)?;
        let options = self.options(setting.integrator, setting.samples_per_pixel);
        self.step(&setting.scene, "repeatability");
        let stream = self.record(&alone, &options)?;
        self.done();
        let run = |_| {
            let built = self.build(&alone, thesis_method(), setting.voxel_size, 1)?;
            let replay = self.replay(&alone, &stream, &[thesis_method()], &[setting.voxel_size], 1)?;
            let [t_build, t_render, t_query] = self.times(&built, &options, &replay)?;
            self.done();
            Ok([t_build, t_render, t_query])
        };
        let runs = (0..self.runs()).map(run).collect::<Result<_, LabError>>()?;
        Ok(RepeatedResult { setting, runs })
    }

    /// A setting of Table 6.2.
    pub(super) fn measured<'a>(&self, setting: &'a Measured) -> Result<MeasuredResult<'a>, LabError> {
        let alone = self.prepare(&setting.scene)?;
        let options = self.options(setting.integrator, setting.samples_per_pixel);
        self.step(&setting.scene, "influence");
        let built = self.build(&alone, thesis_method(), setting.voxel_size, 1)?;
        let stream = self.record(&alone, &options)?;
        let replay = self.replay(&alone, &stream, &[thesis_method()], &[setting.voxel_size], 5)?;
        self.done();
        let (mut without, mut with) = (Vec::new(), Vec::new());
        let mut last = 0.0;
        for i in 0..2 * ALTERNATIONS {
            let [_, t_render, t_query] = self.times(&built, &options, &replay)?;
            last = t_query;
            // As a recorded render does: the pass that records comes after.
            if i % 2 == 1 {
                self.record(&alone, &options)?;
                with.push(t_render);
            } else {
                without.push(t_render);
            }
            self.done();
        }
        Ok(MeasuredResult {
            setting,
            without: median(&without),
            with: median(&with),
            t_query: last,
            t_spatial: replay.hierarchy.t_spatial(),
            timer: replay.timer,
        })
    }

    /// `T_build`, `T_render` with it, and `T_query` in seconds, scaled but for `T_build`.
    fn times(&self, built: &PreparedScene, options: &RenderOptions, replay: &Replay) -> Result<[f64; 3], LabError> {
        let (_, s) = self.render(built, options)?;
        let (n, p_sp) = (self.scale() * s.queries as f64, s.p_spatial.unwrap_or(0.0));
        Ok([s.t_build, self.scale() * s.t_render + s.t_build, total(n, p_sp, replay, effective(replay))])
    }
}
