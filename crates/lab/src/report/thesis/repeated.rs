//! The measurements behind Tables 6.1 to 6.3: how repeatable it is, and what measuring does.

use serde::{Deserialize, Serialize};
use vdf_render::{PreparedScene, RenderOptions};
use vdf_visibility::{FieldKind, Method, PointProver};

use super::{
    super::bench::median,
    MANY, SPP,
    bench::{Bench, total},
    data::{Measured, Repeated},
    timed::{TimedRender, timed_render},
};
use crate::{
    LabError,
    progress::Part,
    queries::{MethodReplay, Replay},
};

/// A setting of Table 6.1 and its runs: `T_build`, `T_render`, `T_query`.
pub(super) struct RepeatedResult<'a> {
    pub(super) setting: &'a Repeated,
    pub(super) runs: Vec<[f64; 3]>,
}

/// A setting of Table 6.2.
pub(super) struct MeasuredResult<'a> {
    pub(super) setting: &'a Measured,
    pub(super) cell: MeasuredCell,
}

/// What was measured for it: a cell. Seconds are scaled but for `T_build`.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct MeasuredCell {
    /// `T_build`, `T_render` with it, and `T_query`: as the timers say, and as a replay without timers does. Medians.
    pub(super) with: [f64; 3],
    pub(super) without: [f64; 3],
    /// Nanoseconds of a spatial query of the hierarchy: without timers, with them, and as they say.
    pub(super) t_spatial: f64,
    pub(super) t_with: f64,
    pub(super) t_said: f64,
}

/// A scene of Table 6.3 with the hierarchy alone: a cell. Seconds, scaled; medians.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct OverheadCell {
    /// `T_render` with timers and without.
    pub(super) with: f64,
    pub(super) without: f64,
    /// `T_query` as the timers say.
    pub(super) said: f64,
    pub(super) n: f64,
}

/// Renders that alternate for Tables 6.2 and 6.3.
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

    /// How many steps so many settings of Table 6.1 and 6.2 and scenes of Table 6.3 take.
    pub(super) fn repeated_steps(&self, repeated: usize, measured: usize, overheads: usize) -> usize {
        repeated * (1 + self.runs()) + measured * (1 + ALTERNATIONS) + overheads * ALTERNATIONS
    }

    /// A setting of Table 6.1, measured again and again.
    pub(super) fn repeated<'a>(&self, setting: &'a Repeated) -> Result<RepeatedResult<'a>, LabError> {
        let name = format!("6.1 {} {}", setting.scene, setting.integrator);
        let mut steps = 1 + self.runs();
        let runs = self.store.cell(&name, || {
            let alone = self.prepare(&setting.scene)?;
            let options = self.options(setting.integrator, setting.samples_per_pixel);
            self.step(&setting.scene, "repeatability");
            let stream = self.record(&alone, &options)?;
            let mut runs = Vec::new();
            for _ in 0..self.runs() {
                let built = self.build(&alone, thesis_method(), setting.voxel_size, 1)?;
                let replay = self.replay(&alone, &stream, &[thesis_method()], &[setting.voxel_size], 1)?;
                runs.push(self.times(&built, &options, &replay)?);
                steps -= 1;
                self.done();
            }
            Ok(runs)
        })?;
        (0..steps).for_each(|_| self.done());
        Ok(RepeatedResult { setting, runs })
    }

    /// A setting of Table 6.2: a render with timers takes turns with one without.
    pub(super) fn measured<'a>(&self, setting: &'a Measured) -> Result<MeasuredResult<'a>, LabError> {
        let name = format!("6.2 {} {}", setting.scene, setting.integrator);
        let mut steps = 1 + ALTERNATIONS;
        let cell = self.store.cell(&name, || {
            let alone = self.prepare(&setting.scene)?;
            let options = self.options(setting.integrator, setting.samples_per_pixel);
            self.step(&setting.scene, "influence");
            let stream = self.record(&alone, &options)?;
            let replay = self.replay(&alone, &stream, &[thesis_method()], &[setting.voxel_size], 5)?;
            let mut times: [[Vec<f64>; 3]; 2] = Default::default();
            let mut replayed = 0.0;
            for _ in 0..ALTERNATIONS {
                for (timers, times) in [false, true].into_iter().zip(&mut times) {
                    let built = self.build(&alone, thesis_method(), setting.voxel_size, 1)?;
                    let s = self.timed(&built, &options, timers)?;
                    let t_build = built.build_report().seconds();
                    let render = self.scale() * s.t_render + t_build;
                    for (all, t) in times.iter_mut().zip([t_build, render, self.scale() * s.t_query]) {
                        all.push(t);
                    }
                    let (n, p_sp) = (self.scale() * s.queries as f64, replay.p_spatial);
                    replayed = total(n, p_sp, effective(&replay), replay.hierarchy.t_other());
                }
                steps -= 1;
                self.done();
            }
            let [mut without, with] = times.map(|of| of.map(|times| median(&times)));
            without[2] = replayed;
            Ok(MeasuredCell {
                with,
                without,
                t_spatial: replay.hierarchy.t_spatial(),
                t_with: replay.timer.time.median,
                t_said: replay.timer.said.median,
            })
        })?;
        (0..steps).for_each(|_| self.done());
        Ok(MeasuredResult { setting, cell })
    }

    /// A scene of Table 6.3.
    pub(super) fn overhead(&self, scene: &str) -> Result<OverheadCell, LabError> {
        let mut steps = ALTERNATIONS;
        let cell = self.store.cell(&format!("6.3 {scene} {MANY}"), || {
            let alone = self.prepare(scene)?;
            let options = self.options(MANY, SPP);
            self.step(scene, "overhead");
            let (mut with, mut without, mut said, mut n) = (vec![], vec![], vec![], 0.0);
            for _ in 0..ALTERNATIONS {
                without.push(self.scale() * self.timed(&alone, &options, false)?.t_render);
                let s = self.timed(&alone, &options, true)?;
                with.push(self.scale() * s.t_render);
                said.push(self.scale() * s.t_query);
                n = self.scale() * s.queries as f64;
                steps -= 1;
                self.done();
            }
            Ok(OverheadCell { with: median(&with), without: median(&without), said: median(&said), n })
        })?;
        (0..steps).for_each(|_| self.done());
        Ok(cell)
    }

    fn timed(&self, prepared: &PreparedScene, options: &RenderOptions, timers: bool) -> Result<TimedRender, LabError> {
        Ok(timed_render(&prepared.job(options)?, timers, &Part(self.progress))?)
    }

    /// `T_build`, `T_render` with it, and `T_query` in seconds, scaled but for `T_build`.
    fn times(&self, built: &PreparedScene, options: &RenderOptions, replay: &Replay) -> Result<[f64; 3], LabError> {
        let (_, (s, _)) = self.render(built, options)?;
        let (n, p_sp) = (self.scale() * s.queries as f64, s.p_spatial.unwrap_or(0.0));
        let t_query = total(n, p_sp, effective(replay), replay.hierarchy.t_other());
        Ok([s.t_build, self.scale() * s.t_render + s.t_build, t_query])
    }
}
