//! What was measured, figure by figure, for machines: medians with their intervals, and every single render.

use super::{
    curve::{Found, Median},
    measure::SettingResult,
    reference::Floor,
    summary::Summary,
};
use crate::report::figures::{About, Figure};

/// Names of a median and of the ends of its interval.
type Names = [&'static str; 3];

impl Summary<'_> {
    pub(super) fn figures(&self) -> Vec<Figure> {
        let mut all = Vec::new();
        for r in &self.measured.references {
            let about = self.about("reference", r.integrator.to_string(), "none", None);
            let Floor { mse, rel_mse, mse_bound, rel_mse_bound } = r.floor;
            let figures = [
                ("MSE floor", mse),
                ("MSE floor bound", mse_bound),
                ("relMSE floor", rel_mse),
                ("relMSE floor bound", rel_mse_bound),
                ("FLIP of halves", r.flip),
            ];
            all.extend(figures.map(|(name, value)| about.figure(name, "", value, None).of_spp(r.spp)));
        }
        for s in &self.measured.settings {
            self.errors(s, &mut all);
            for m in 0..self.plan.methods.len() {
                self.times(s, m, &mut all);
            }
        }
        all
    }

    fn about(&self, table: &'static str, integrator: String, method: &'static str, voxel_size: Option<f64>) -> About {
        About { table, scene: self.name.to_owned(), integrator, method, voxel_size }
    }

    fn errors(&self, s: &SettingResult, all: &mut Vec<Figure>) {
        let about = self.about("error", s.integrator.to_string(), "", None);
        for (j, &spp) in self.plan.spps.iter().enumerate() {
            let mut three = |names: Names, m: Median| {
                all.extend(of_median(&about, names, "", m).map(|f| f.of_spp(spp)));
            };
            three(["relMSE", "relMSE low", "relMSE high"], self.rel_mse(s, j));
            three(["MSE", "MSE low", "MSE high"], self.mse(s, j));
            three(["FLIP", "FLIP low", "FLIP high"], self.flip(s, j));
            let claimed = f64::from(u8::from(self.is_claimed(s, j)));
            all.push(about.figure("claimed", "", claimed, None).of_spp(spp));
            for (of_seed, &seed) in s.errors.iter().zip(&self.plan.seeds) {
                let e = of_seed[j];
                let figures = [("relMSE with floor", e.rel_mse), ("MSE with floor", e.mse), ("FLIP", e.flip)];
                all.extend(figures.map(|(name, value)| about.figure(name, "", value, None).of_spp(spp).of_seed(seed)));
            }
        }
        if let Some(slope) = self.slope(s) {
            all.extend(of_median(&about, ["slope", "slope low", "slope high"], "", slope));
        }
    }

    fn times(&self, s: &SettingResult, m: usize, all: &mut Vec<Figure>) {
        let method = self.plan.methods[m].name();
        let voxel_size = (m > 0).then_some(self.plan.voxel_size);
        let about = self.about("time", s.integrator.to_string(), method, voxel_size);
        let f = self.method(s, m);
        all.extend(of_median(&about, ["T_build", "T_build low", "T_build high"], "s", f.t_build));
        for (&t_build, &seed) in self.measured.t_build[m].iter().zip(&self.plan.seeds) {
            all.push(about.figure("T_build", "s", t_build, None).of_seed(seed));
        }
        for ((j, &spp), t_render) in self.plan.spps.iter().enumerate().zip(f.t_render) {
            let render = ["T_render", "T_render low", "T_render high"];
            let both = ["T_build + T_render", "T_build + T_render low", "T_build + T_render high"];
            all.extend(of_median(&about, render, "s", t_render).map(|f| f.of_spp(spp)));
            all.extend(of_median(&about, both, "s", self.time(s, m, j)).map(|f| f.of_spp(spp)));
            for (of_seed, &seed) in s.t_render[m].iter().zip(&self.plan.seeds) {
                all.push(about.figure("T_render", "s", of_seed[j], None).of_spp(spp).of_seed(seed));
            }
        }
        all.extend(of_median(&about, ["gain", "gain low", "gain high"], "", f.gain));
        if let Some([without, with]) = f.efficiency {
            let names = ["efficiency", "efficiency low", "efficiency high"];
            all.extend(of_median(&about, names, "1/s", without));
            let names = ["efficiency with T_build", "efficiency with T_build low", "efficiency with T_build high"];
            all.extend(of_median(&about, names, "1/s", with));
        }
        for (names, time) in TIMES.iter().zip(f.times) {
            let Some((t, found)) = time else { continue };
            let names = match found {
                Found::AtMost => names[0],
                Found::Between => names[1],
                Found::Beyond => names[2],
            };
            all.extend(of_median(&about, names, "s", t));
        }
    }
}

/// For each target and each way to find it; the name says what the value is worth.
const TIMES: [[Names; 3]; 2] = [
    [
        ["at most, to relMSE 0.01", "at most, to relMSE 0.01 low", "at most, to relMSE 0.01 high"],
        ["to relMSE 0.01", "to relMSE 0.01 low", "to relMSE 0.01 high"],
        ["extrapolated, to relMSE 0.01", "extrapolated, to relMSE 0.01 low", "extrapolated, to relMSE 0.01 high"],
    ],
    [
        ["at most, to relMSE 0.001", "at most, to relMSE 0.001 low", "at most, to relMSE 0.001 high"],
        ["to relMSE 0.001", "to relMSE 0.001 low", "to relMSE 0.001 high"],
        ["extrapolated, to relMSE 0.001", "extrapolated, to relMSE 0.001 low", "extrapolated, to relMSE 0.001 high"],
    ],
];

fn of_median(about: &About, [median, low, high]: Names, unit: &'static str, m: Median) -> [Figure; 3] {
    [
        about.figure(median, unit, m.median, None),
        about.figure(low, unit, m.low, None),
        about.figure(high, unit, m.high, None),
    ]
}
