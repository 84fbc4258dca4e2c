//! What follows from all renders: errors without the references' own, medians over the seeds, claims.

use vdf_scene::FilmSettings;

use super::{
    curve::{Found, Median, MedianRule, slope, time_to},
    measure::{Errors, Measured, SettingResult},
    plan::Plan,
    reference::{Floor, Reference},
};

/// The relMSE that times are given for.
pub(super) const TARGETS: [f64; 2] = [1e-2, 1e-3];

/// What was measured, with its scene and plan.
pub(super) struct Summary<'a> {
    pub(super) name: &'a str,
    pub(super) plan: &'a Plan,
    pub(super) measured: &'a Measured,
    pub(super) film: &'a FilmSettings,
    pub(super) rule: MedianRule,
}

/// A method in a setting, medians over the seeds.
pub(super) struct MethodFigures {
    pub(super) t_build: Median,
    /// At each number of samples.
    pub(super) t_render: Vec<Median>,
    /// At the most samples, by how much faster than the hierarchy alone, `T_build` left out.
    pub(super) gain: Median,
    /// 1/(time × MSE) at the most samples whose error is claimed, without `T_build` and with it.
    pub(super) efficiency: Option<[Median; 2]>,
    /// For each target.
    pub(super) times: [Option<(Median, Found)>; 2],
}

impl<'a> Summary<'a> {
    pub(super) fn new(name: &'a str, plan: &'a Plan, measured: &'a Measured, film: &'a FilmSettings) -> Self {
        Self { name, plan, measured, film, rule: MedianRule::new(plan.seeds.len()) }
    }

    pub(super) fn reference(&self, s: &SettingResult) -> &Reference {
        &self.measured.references[s.reference]
    }

    /// Median over the seeds of an error as measured, with the floor.
    pub(super) fn as_measured(&self, s: &SettingResult, spp: usize, error: fn(&Errors) -> f64) -> Median {
        self.rule.of(s.errors.iter().map(|of_seed| error(&of_seed[spp])))
    }

    pub(super) fn rel_mse(&self, s: &SettingResult, spp: usize) -> Median {
        self.as_measured(s, spp, |e| e.rel_mse).less(self.reference(s).floor.rel_mse)
    }

    pub(super) fn mse(&self, s: &SettingResult, spp: usize) -> Median {
        self.as_measured(s, spp, |e| e.mse).less(self.reference(s).floor.mse)
    }

    pub(super) fn flip(&self, s: &SettingResult, spp: usize) -> Median {
        self.as_measured(s, spp, |e| e.flip)
    }

    /// Whether the errors of so many samples can be told from the reference's own.
    pub(super) fn is_claimed(&self, s: &SettingResult, spp: usize) -> bool {
        let median = |error| self.as_measured(s, spp, error).median;
        self.reference(s).claims(median(|e| e.rel_mse), median(|e| e.mse))
    }

    /// The places in the plan of all samples whose errors are claimed.
    pub(super) fn claimed(&self, s: &SettingResult) -> Vec<usize> {
        (0..self.plan.spps.len()).filter(|&j| self.is_claimed(s, j)).collect()
    }

    /// `T_build` + `T_render`.
    pub(super) fn time(&self, s: &SettingResult, method: usize, spp: usize) -> Median {
        let t_build = &self.measured.t_build[method];
        self.rule.of(t_build.iter().zip(&s.t_render[method]).map(|(build, render)| build + render[spp]))
    }

    pub(super) fn method(&self, s: &SettingResult, method: usize) -> MethodFigures {
        let Floor { mse, rel_mse, .. } = self.reference(s).floor;
        let (t_build, t_render) = (&self.measured.t_build[method], &s.t_render[method]);
        let seeds = 0..self.plan.seeds.len();
        let last = self.plan.spps.len() - 1;
        let claimed = self.claimed(s);
        let efficiency = claimed.last().map(|&j| {
            [0.0, 1.0].map(|with| {
                let of = |i: usize| ((t_render[i][j] + with * t_build[i]) * (s.errors[i][j].mse - mse)).recip();
                self.rule.of(seeds.clone().map(of))
            })
        });
        let times = TARGETS.map(|target| {
            let of = |i: usize| {
                let points: Vec<_> =
                    claimed.iter().map(|&j| (t_render[i][j], s.errors[i][j].rel_mse - rel_mse)).collect();
                time_to(&points, t_build[i], target)
            };
            let all: Vec<_> = seeds.clone().map(of).collect::<Option<_>>()?;
            let found = all.iter().map(|t| t.1).max()?;
            Some((self.rule.of(all.iter().map(|t| t.0)), found))
        });
        MethodFigures {
            t_build: self.rule.of(t_build.iter().copied()),
            t_render: (0..=last).map(|j| self.rule.of(t_render.iter().map(|of_seed| of_seed[j]))).collect(),
            gain: self.rule.of(seeds.map(|i| s.t_render[0][i][last] / t_render[i][last])),
            efficiency,
            times,
        }
    }

    /// The exponent of relMSE over samples.
    pub(super) fn slope(&self, s: &SettingResult) -> Option<Median> {
        let floor = self.reference(s).floor.rel_mse;
        let claimed = self.claimed(s);
        let of = |of_seed: &Vec<Errors>| {
            let point = |&j: &usize| (f64::from(self.plan.spps[j]), of_seed[j].rel_mse - floor);
            slope(&claimed.iter().map(point).collect::<Vec<_>>())
        };
        Some(self.rule.of(s.errors.iter().map(of).collect::<Option<Vec<_>>>()?))
    }
}

impl Median {
    fn less(self, floor: f64) -> Self {
        Self { median: self.median - floor, low: self.low - floor, high: self.high - floor }
    }
}
