//! What was measured as pictures, plots and tables.

use anyhow::anyhow;
use vdf_render::{Image, encode_png, scene::FilmSettings};

use super::{
    curve::{Found, Median, MedianRule, slope, time_to},
    measure::{Errors, Measured, Plan, SettingResult},
    reference::{CLAIM, Floor, Reference},
};
use crate::{
    commands::report::{
        page::{Cell, Comparison, Page, Picture, Row, Section, Table},
        percent,
        plot::{Banded, Plot, Series},
        queries::style,
        seconds, short,
    },
    failure::Failure,
};

/// The relMSE that times are given for.
pub(super) const TARGETS: [f64; 2] = [1e-2, 1e-3];

pub(super) struct Tables<'a> {
    pub(super) name: &'a str,
    pub(super) plan: &'a Plan,
    pub(super) measured: &'a Measured,
    film: &'a FilmSettings,
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

impl<'a> Tables<'a> {
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
    fn claimed(&self, s: &SettingResult) -> Vec<usize> {
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

    pub(super) fn page(&self) -> Result<Page, Failure> {
        let Self { plan, measured, film, .. } = self;
        let (first, last) = (plan.seeds.first().unwrap_or(&0), plan.seeds.last().unwrap_or(&0));
        let samples: Vec<_> = plan.spps.iter().map(u32::to_string).collect();
        let lead = vec![
            format!(
                "Renders of {} × {} pixels with {} samples per pixel and the seeds {first} to {last}, on {} threads; voxels of {}. \
                 All methods made the same images, bit by bit, so their errors are the same and only their times differ.",
                film.crop.x1 - film.crop.x0,
                film.crop.y1 - film.crop.y0,
                samples.join(", "),
                measured.threads,
                short(plan.voxel_size),
            ),
            format!(
                "Times are T_build + T_render where nothing else is said; the hierarchy, which every method needs, is not in them. Figures are \
                 medians over {} seeds, with the interval from value {} to value {} in ascending order, which encloses the median of all \
                 seeds with a probability of {}; the bands of the plots join the lower ends, and the upper ones, of time and error. Methods took turns.",
                plan.seeds.len(),
                self.rule.k,
                plan.seeds.len() + 1 - self.rule.k,
                percent(self.rule.coverage),
            ),
        ];
        let mut sections = vec![self.pictures()?, self.references()];
        sections.extend(measured.settings.iter().map(|s| self.setting(s)));
        sections.extend(self.per_segment());
        sections.push(self.verdict());
        Ok(Page { title: format!("Speed against error in {}", self.name), lead, sections })
    }

    fn pictures(&self) -> Result<Section, Failure> {
        let comparison = |s: &SettingResult, image: &Image, spp: u32| {
            let reference = self.reference(s);
            Ok(Comparison {
                caption: format!("{}: {spp} against {} samples per pixel", s.setting, reference.spp),
                left: picture(image, format!("{spp} spp"))?,
                right: picture(&reference.image, format!("reference, {} spp", reference.spp))?,
            })
        };
        let mut comparisons = Vec::new();
        for s in &self.measured.settings {
            comparisons.push(comparison(s, &s.first, self.plan.spps[0]));
            if let [_, .., most] = self.plan.spps[..] {
                comparisons.push(comparison(s, &s.last, most));
            }
        }
        let comparisons = comparisons.into_iter().collect::<Result<_, Failure>>()?;
        Ok(Section { heading: "Pictures".to_owned(), comparisons, ..Section::default() })
    }

    fn references(&self) -> Section {
        let row = |r: &Reference| {
            let f = &r.floor;
            let cells = [
                r.setting.to_string(),
                r.spp.to_string(),
                format!("{:.2e}", f.mse),
                format!("{:.2e}", f.rel_mse),
                format!("{:.2e}", f.rel_mse_bound),
                format!("{:.2e}", CLAIM * f.rel_mse_bound),
                format!("{:.4}", r.flip),
                if r.cached { "kept and checked" } else { "rendered" }.to_owned(),
            ];
            Row::new(cells.map(Cell::from).to_vec())
        };
        let columns =
            vec!["reference", "spp", "MSE", "relMSE", "at most", "claimed from", "FLIP of its halves", "where from"];
        Section {
            heading: "References".to_owned(),
            paragraphs: vec![
                "Each integrator converges to an image of its own: volpath to all scattering, raymarch to light that the medium scatters once. \
                 Errors of the one say nothing about the other. The samples per segment of raymarch change its variance, not what it converges to."
                    .to_owned(),
                format!(
                    "A reference is the mean of two halves with seeds that no other render has, by the hierarchy alone. A quarter of their squared \
                     difference has the mean of the reference's own variance, which every error measured contains: it is subtracted from MSE and \
                     relMSE. \"At most\" is two standard errors more. An error is claimed if its relMSE and its MSE are, as measured, {CLAIM} times that; others are neither \
                     plotted nor used. FLIP cannot be corrected so: where it is in proportion to the standard deviation, the reference's noise \
                     raises it by 15 % at most in what is claimed."
                ),
            ],
            tables: vec![Table { caption: String::new(), columns, rows: self.measured.references.iter().map(row).collect() }],
            ..Section::default()
        }
    }

    fn setting(&self, s: &SettingResult) -> Section {
        let claimed = self.claimed(s);
        let mut paragraphs = Vec::new();
        if claimed.is_empty() {
            paragraphs.push(
                "No error can be told from that of the reference: it needs more samples (--reference-spp), or the renders fewer."
                    .to_owned(),
            );
        }
        if let Some(slope) = self.slope(s) {
            paragraphs.push(format!(
                "relMSE falls with the samples to the power of {:.3} ({:.3} to {:.3}); -1 is that of an unbiased estimator with a finite variance.",
                slope.median, slope.low, slope.high
            ));
        }
        let curves = |value: &dyn Fn(usize) -> Median| self.curves(s, &claimed, value);
        let plots = [
            Plot::logarithmic("relMSE".to_owned(), TIME, "relMSE", curves(&|j| self.rel_mse(s, j))),
            Plot::logarithmic("FLIP".to_owned(), TIME, "FLIP", curves(&|j| self.flip(s, j))),
        ];
        Section {
            heading: s.setting.to_string(),
            paragraphs,
            plots: plots.into_iter().flatten().collect(),
            tables: vec![self.methods_table(s), self.errors_table(s)],
            ..Section::default()
        }
    }

    /// A line for each method, through times and errors of the same samples. The band reaches from the lower ends of both intervals
    /// to the upper ends.
    fn curves(&self, s: &SettingResult, claimed: &[usize], value: &dyn Fn(usize) -> Median) -> Vec<Banded> {
        (0..self.plan.methods.len()).map(|m| self.curve(s, m, claimed, value)).collect()
    }

    fn curve(&self, s: &SettingResult, m: usize, claimed: &[usize], value: &dyn Fn(usize) -> Median) -> Banded {
        let name = self.plan.methods[m].name();
        let at =
            |end: fn(&Median) -> f64| claimed.iter().map(|&j| (end(&self.time(s, m, j)), end(&value(j)))).collect();
        let title = if m == 0 { "hierarchy alone" } else { name };
        let series = Series { name: title.to_owned(), points: at(|t| t.median), ..style(name) };
        Banded { series, low: at(|t| t.low), high: at(|t| t.high) }
    }

    fn methods_table(&self, s: &SettingResult) -> Table {
        let rows = (0..self.plan.methods.len())
            .map(|m| {
                let f = self.method(s, m);
                let efficiency = |i: usize| f.efficiency.map_or_else(dash, |e| format!("{:.3e}", e[i].median));
                let time = |i: usize| f.times[i].map_or_else(dash, |(t, found)| time_in_words(t, found));
                let gain = Cell::from(format!("{:.2} ({:.2} to {:.2})", f.gain.median, f.gain.low, f.gain.high));
                let t_render = f.t_render.last().map_or_else(dash, |t| spread(t, seconds));
                let cells = vec![
                    self.plan.methods[m].name().into(),
                    seconds(f.t_build.median).into(),
                    t_render.into(),
                    // Marked only where the whole interval is on one side.
                    if f.gain.low > 1.0 || f.gain.high < 1.0 { gain.marked(f.gain.low > 1.0) } else { gain },
                    efficiency(0).into(),
                    efficiency(1).into(),
                    time(0).into(),
                    time(1).into(),
                ];
                Row::new(cells)
            })
            .collect();
        let columns = vec![
            "method",
            "T_build",
            "T_render at the most samples",
            "faster than none",
            "1/(T_render × MSE)",
            "with T_build",
            "to relMSE 0.01",
            "to relMSE 0.001",
        ];
        Table { caption: format!("{}: time", s.setting), columns, rows }
    }

    fn errors_table(&self, s: &SettingResult) -> Table {
        let number = |e: f64| format!("{e:.2e}");
        let rows = (0..self.plan.spps.len())
            .map(|j| {
                let claimed = self.is_claimed(s, j);
                let error = |m: Median| if claimed { spread(&m, number) } else { dash() };
                Row::new(vec![
                    self.plan.spps[j].to_string().into(),
                    error(self.rel_mse(s, j)).into(),
                    error(self.mse(s, j)).into(),
                    spread(&self.flip(s, j), |f| format!("{f:.4}")).into(),
                    Cell::from(if claimed { "yes" } else { "no, too near the reference's own" }).marked(claimed),
                ])
            })
            .collect();
        let columns = vec!["spp", "relMSE", "MSE", "FLIP", "claimed"];
        Table { caption: format!("{}: errors", s.setting), columns, rows }
    }

    /// The samples per segment side by side, where there are several.
    fn per_segment(&self) -> Option<Section> {
        let m = self.plan.methods.len() - 1;
        let of = |r: usize| self.measured.settings.iter().filter(move |s| s.reference == r);
        let r = (0..self.measured.references.len()).find(|&r| of(r).count() > 1)?;
        let lines = of(r).enumerate().map(|(i, s)| {
            let Banded { series, low, high } = self.curve(s, m, &self.claimed(s), &|j| self.rel_mse(s, j));
            let series = Series { name: s.setting.to_string(), colour: i, dash: i / 6, ..series };
            Banded { series, low, high }
        });
        let method = self.plan.methods[m];
        let plot = Plot::logarithmic(format!("relMSE, {method}"), TIME, "relMSE", lines.collect());
        Some(Section {
            heading: "Samples per segment".to_owned(),
            paragraphs: vec!["All converge to the same reference, so these curves can be compared.".to_owned()],
            plots: plot.into_iter().collect(),
            ..Section::default()
        })
    }

    /// In words: who wins, who loses.
    fn verdict(&self) -> Section {
        let sentence = |s: &SettingResult| {
            let gain = |m: usize| self.method(s, m).gain;
            let named = |is: &dyn Fn(&Median) -> bool| {
                let all = (1..self.plan.methods.len()).filter(|m| is(&gain(*m)));
                let names: Vec<_> = all.map(|m| format!("{} ({:.2})", self.plan.methods[m], gain(m).median)).collect();
                if names.is_empty() { "none".to_owned() } else { names.join(", ") }
            };
            format!(
                "{}: to the same error faster than the hierarchy alone: {}; slower: {}; not told apart: {}.",
                s.setting,
                named(&|g| g.low > 1.0),
                named(&|g| g.high < 1.0),
                named(&|g| g.low <= 1.0 && g.high >= 1.0)
            )
        };
        let mut paragraphs: Vec<_> = self.measured.settings.iter().map(sentence).collect();
        paragraphs.push(format!(
            "By T_render at {} samples per pixel; T_build is in the times to an error.",
            self.plan.spps.last().unwrap_or(&1)
        ));
        Section { heading: "Verdict".to_owned(), paragraphs, ..Section::default() }
    }
}

/// The axis of time.
const TIME: &str = "T_build + T_render, s";

impl Median {
    fn less(self, floor: f64) -> Self {
        Self { median: self.median - floor, low: self.low - floor, high: self.high - floor }
    }
}

fn dash() -> String {
    "–".to_owned()
}

fn spread(m: &Median, number: impl Fn(f64) -> String) -> String {
    format!("{} ({} to {})", number(m.median), number(m.low), number(m.high))
}

fn time_in_words(t: Median, found: Found) -> String {
    let words = spread(&t, seconds);
    match found {
        Found::AtMost => format!("at most {words}"),
        Found::Between => words,
        Found::Beyond => format!("{words}, extrapolated"),
    }
}

fn picture(image: &Image, caption: String) -> Result<Picture, Failure> {
    let png = encode_png(image).map_err(|e| Failure::Work(anyhow!("{caption}: {e}")))?;
    Ok(Picture::png(&png, [image.width, image.height], caption))
}
