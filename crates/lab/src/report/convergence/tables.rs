//! What was measured as pictures, plots and tables.

use vdf_image::Image;

use super::{
    curve::{Found, Median},
    measure::SettingResult,
    reference::{CLAIM, Reference},
    summary::Summary,
};
use crate::{
    LabError,
    report::{
        page::{Cell, Comparison, Page, Picture, Row, Section, Table},
        plot::{Banded, Plot, Series},
        words::{dash, percent, seconds, short},
    },
};

impl Summary<'_> {
    pub(super) fn page(&self) -> Result<Page, LabError> {
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

    fn pictures(&self) -> Result<Section, LabError> {
        let comparison = |s: &SettingResult, image: &Image, spp: u32| {
            let reference = self.reference(s);
            Ok(Comparison {
                caption: format!("{}: {spp} against {} samples per pixel", s.integrator, reference.spp),
                left: Picture::new(image, format!("{spp} spp"))?,
                right: Picture::new(&reference.image, format!("reference, {} spp", reference.spp))?,
            })
        };
        let mut comparisons = Vec::new();
        for s in &self.measured.settings {
            comparisons.push(comparison(s, &s.first, self.plan.spps[0]));
            if let [_, .., most] = self.plan.spps[..] {
                comparisons.push(comparison(s, &s.last, most));
            }
        }
        let comparisons = comparisons.into_iter().collect::<Result<_, LabError>>()?;
        Ok(Section { heading: "Pictures".to_owned(), comparisons, ..Section::default() })
    }

    fn references(&self) -> Section {
        let row = |r: &Reference| {
            let f = &r.floor;
            let cells = [
                r.integrator.to_string(),
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
                "No error can be told from that of the reference: it needs more samples, or the renders fewer."
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
            heading: s.integrator.to_string(),
            paragraphs,
            plots: plots.into_iter().flatten().collect(),
            tables: vec![self.methods_table(s), self.errors_table(s)],
            ..Section::default()
        }
    }

    /// A line for each method, through times and errors of the same samples. The band reaches from the lower ends of
    /// both intervals to the upper ends.
    fn curves(&self, s: &SettingResult, claimed: &[usize], value: &dyn Fn(usize) -> Median) -> Vec<Banded> {
        (0..self.plan.methods.len()).map(|m| self.curve(s, m, claimed, value)).collect()
    }

    fn curve(&self, s: &SettingResult, m: usize, claimed: &[usize], value: &dyn Fn(usize) -> Median) -> Banded {
        let name = self.plan.methods[m].name();
        let at =
            |end: fn(&Median) -> f64| claimed.iter().map(|&j| (end(&self.time(s, m, j)), end(&value(j)))).collect();
        let title = if m == 0 { "hierarchy alone" } else { name };
        let series = Series { name: title.to_owned(), points: at(|t| t.median), ..Series::in_style_of(name) };
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
        Table { caption: format!("{}: time", s.integrator), columns, rows }
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
        Table { caption: format!("{}: errors", s.integrator), columns, rows }
    }

    /// The samples per segment side by side, where there are several.
    fn per_segment(&self) -> Option<Section> {
        let m = self.plan.methods.len() - 1;
        let of = |r: usize| self.measured.settings.iter().filter(move |s| s.reference == r);
        let r = (0..self.measured.references.len()).find(|&r| of(r).count() > 1)?;
        let lines = of(r).enumerate().map(|(i, s)| {
            let Banded { series, low, high } = self.curve(s, m, &self.claimed(s), &|j| self.rel_mse(s, j));
            let series = Series { name: s.integrator.to_string(), colour: i, dash: i / 6, ..series };
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
                s.integrator,
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
