//! The tables of chapter 6, from what was measured.

use super::{
    data::ThesisData,
    measure::{MeasuredResult, MethodResult, RepeatedResult, SceneResult, SettingResult, Threaded},
};
use crate::commands::report::{
    figures::{About, Figure},
    grid,
    page::{Cell, Row, Section, Table},
    percent,
    plot::{Plot, Series},
    queries::{integrator_name, style},
    seconds, short,
};

pub(super) struct Tables<'a> {
    pub(super) thesis: &'a ThesisData,
    /// All threads, beside one.
    pub(super) threads: usize,
    pub(super) scenes: &'a [SceneResult],
    pub(super) repeated: &'a [RepeatedResult<'a>],
    pub(super) measured: &'a [MeasuredResult<'a>],
}

/// A percentage of the thesis, as it prints it.
fn printed(percent: f64) -> String {
    format!("{percent:.2} %")
}

fn millions(n: f64) -> String {
    format!("{:.2} M", n / 1e6)
}

/// Samples per path segment as the thesis writes them.
fn sps(samples: Option<u32>) -> String {
    samples.map_or_else(|| "VPT".to_owned(), |n| n.to_string())
}

impl Tables<'_> {
    pub(super) fn all(&self) -> (Vec<Section>, Vec<Figure>) {
        let mut figures = Vec::new();
        let mut sections = Vec::new();
        if !self.scenes.is_empty() {
            sections.push(Section {
                heading: "Scenes".to_owned(),
                images: self.scenes.iter().map(|s| s.picture.clone()).collect(),
                ..Section::default()
            });
            sections.push(self.queries(&mut figures));
            sections.push(self.proof_times(&mut figures));
            sections.extend(self.scenes.iter().map(|s| self.acceleration(s, &mut figures)));
            sections.push(self.inequality(&mut figures));
        }
        if !self.repeated.is_empty() {
            sections.push(self.repeatability(&mut figures));
        }
        if !self.measured.is_empty() {
            sections.push(self.influence(&mut figures));
        }
        (sections, figures)
    }

    fn queries(&self, figures: &mut Vec<Figure>) -> Section {
        let mut rows = Vec::new();
        for scene in self.scenes {
            for (i, setting) in scene.settings.iter().enumerate() {
                let thesis = self.thesis.queries(scene.name, setting.samples);
                let about = about("6.11", scene.name, setting.samples, "none", None);
                figures.push(about.figure("N", "", setting.n, thesis.map(|t| t.n)));
                figures.push(about.figure("p_sp", "", setting.p_sp, thesis.map(|t| t.p_sp / 100.0)));
                let cells = vec![
                    scene.name.into(),
                    sps(setting.samples).into(),
                    Cell::beside(millions(setting.n), thesis.map(|t| millions(t.n))),
                    Cell::beside(percent(setting.p_sp), thesis.map(|t| printed(t.p_sp))),
                ];
                rows.push(Row { cells, first: i == 0 && !rows.is_empty() });
            }
        }
        Section {
            heading: "Table 6.11: visibility queries".to_owned(),
            paragraphs: vec![
                "The thesis's renderer asks for visibility even where the light is behind the surface; this one does not, so its N is smaller and its p_sp larger."
                    .to_owned(),
            ],
            tables: vec![Table { caption: String::new(), columns: vec!["scene", "sps", "N", "p_sp"], rows }],
            ..Section::default()
        }
    }

    fn proof_times(&self, figures: &mut Vec<Figure>) -> Section {
        let mut rows = Vec::new();
        let mut plots = Vec::new();
        for scene in self.scenes {
            // As in the thesis: from the ray marcher with 49 samples.
            let Some(setting) = scene.settings.iter().find(|s| s.samples == Some(49)) else { continue };
            let t_query = setting.replay.hierarchy.t_query;
            let hierarchy = self.thesis.proof_time(scene.name, "none", 0.0).map(|t| t.t_acc);
            figures.push(about("6.4", scene.name, Some(49), "none", None).figure("t_query", "ns", t_query, hierarchy));
            let first = !rows.is_empty();
            let nanoseconds = |t: f64| format!("{} ns", short(t));
            let alone = [
                Cell::from(scene.name),
                "hierarchy".into(),
                "".into(),
                "".into(),
                Cell::beside(nanoseconds(t_query), hierarchy.map(nanoseconds)),
                "".into(),
            ];
            rows.push(Row { cells: alone.to_vec(), first });
            for m in &setting.methods {
                let (t_acc, r) = (m.replay.t_acc.median, &m.replay);
                let thesis = self.thesis.proof_time(scene.name, r.method, r.voxel_size);
                let about = about("6.4", scene.name, Some(49), r.method, Some(r.voxel_size));
                let derived = r.t_acc_derived;
                figures.push(about.figure("t_acc", "ns", t_acc, None));
                figures.push(about.figure("t_acc by 6.3.2", "ns", derived, thesis.map(|t| t.t_acc)));
                figures.push(about.figure("t_acc/t_query", "", derived / t_query, thesis.map(|t| t.ratio / 100.0)));
                rows.push(Row::new(vec![
                    scene.name.into(),
                    r.method.into(),
                    r.voxel_size.to_string().into(),
                    nanoseconds(t_acc).into(),
                    Cell::beside(nanoseconds(derived), thesis.map(|t| nanoseconds(t.t_acc))),
                    Cell::beside(
                        format!("{:.0} %", 100.0 * derived / t_query),
                        thesis.map(|t| format!("{:.0} %", t.ratio)),
                    ),
                ]));
            }
            plots.extend(self.proof_plot(scene.name, setting));
        }
        Section {
            heading: "Table 6.4 and Figure 6.7: the time of a proof".to_owned(),
            paragraphs: vec![
                "t_query is the mean over all queries of the ray marcher with 49 samples per segment, by the hierarchy alone. t_acc is the attempt of a proof for \
                 a spatial query, measured directly. By 6.3.2 is what the thesis computes from the difference of two renders, here from that of two replays: \
                 t_eff - (1 - p_acc|sp) t_query, with the time that a fallback waits for its proof."
                    .to_owned(),
            ],
            plots,
            tables: vec![Table {
                caption: String::new(),
                columns: vec!["scene", "method", "V_size", "t_acc", "by 6.3.2", "of t_query"],
                rows,
            }],
            ..Section::default()
        }
    }

    /// Figure 6.7, a plot for each scene.
    fn proof_plot(&self, scene: &str, setting: &SettingResult) -> Option<Plot> {
        let mut series: Vec<Series> = Vec::new();
        let mut add = |name: String, method: &str, dash: Option<usize>, point: (f64, f64)| match series
            .iter_mut()
            .find(|s| s.name == name)
        {
            Some(s) => s.points.push(point),
            None => {
                let style = style(method);
                series.push(Series { name, points: vec![point], dash: dash.unwrap_or(style.dash), ..style });
            }
        };
        for m in &setting.methods {
            let r = &m.replay;
            let voxels = r.grid.iter().map(|&n| f64::from(n)).product();
            add(r.method.to_owned(), r.method, None, (voxels, r.t_acc.median));
            if let Some(t) = self.thesis.proof_time(scene, r.method, r.voxel_size) {
                add(format!("{}, thesis", r.method), r.method, Some(3), (voxels, t.t_acc));
            }
        }
        Plot::logarithmic(format!("{scene}: time of a proof against voxels"), "voxels", "t_acc, ns", series)
    }

    fn acceleration(&self, scene: &SceneResult, figures: &mut Vec<Figure>) -> Section {
        let tables = scene.settings.iter().map(|setting| {
            let about = |method, size| about("6.5-6.10", scene.name, setting.samples, method, size);
            let thesis = |method: &str, size| self.thesis.acceleration(scene.name, method, size, setting.samples);
            let t = thesis("none", 0.0);
            let alone = about("none", None);
            figures.push(alone.figure("T_render", "s", setting.t_render, t.map(|t| t.t_render)));
            figures.push(alone.figure("T_query", "s", setting.t_query, t.map(|t| t.t_query)));
            figures.push(alone.figure("p_sp", "", setting.p_sp, t.map(|t| t.p_sp / 100.0)));
            figures.extend(self.threaded_figures(&alone, setting.threaded));
            let mut cells = vec![
                "none".into(),
                "".into(),
                Cell::beside(seconds(setting.t_render), t.map(|t| seconds(t.t_render))),
                Cell::beside(seconds(setting.t_query), t.map(|t| seconds(t.t_query))),
                "".into(),
                Cell::beside(percent(setting.p_sp), t.map(|t| printed(t.p_sp))),
                "".into(),
                "".into(),
            ];
            cells.extend(setting.threaded.iter().flat_map(|all| [seconds(all.t_render).into(), "".into()]));
            let mut rows = vec![Row::new(cells)];
            let mut size = None;
            for m in &setting.methods {
                let r = &m.replay;
                let first = size.replace(r.voxel_size) != Some(r.voxel_size);
                let t = thesis(r.method, r.voxel_size);
                let about = about(r.method, Some(r.voxel_size));
                figures.extend([
                    about.figure("T_render", "s", m.t_render, t.map(|t| t.t_render)),
                    about.figure("T_query", "s", m.t_query, t.map(|t| t.t_query)),
                    about.figure("T_build", "s", m.t_build, t.and_then(|t| t.t_build)),
                    about.figure("p_acc|sp", "", m.p_acc_sp, t.and_then(|t| t.p_acc_sp).map(|p| p / 100.0)),
                ]);
                figures.extend(self.threaded_figures(&about, m.threaded));
                let mut cells = vec![
                    r.method.into(),
                    r.voxel_size.to_string().into(),
                    Cell::beside(seconds(m.t_render), t.map(|t| seconds(t.t_render)))
                        .marked(m.t_render < setting.t_render),
                    Cell::beside(seconds(m.t_query), t.map(|t| seconds(t.t_query))).marked(m.t_query < setting.t_query),
                    Cell::beside(seconds(m.t_build), t.and_then(|t| t.t_build).map(seconds)),
                    Cell::beside(percent(setting.p_sp), t.map(|t| printed(t.p_sp))),
                    Cell::beside(grid(r.grid), t.and_then(|t| t.grid.as_ref()).map(|g| g.replace('x', "×"))),
                    Cell::beside(percent(m.p_acc_sp), t.and_then(|t| t.p_acc_sp).map(printed)),
                ];
                for (all, alone) in m.threaded.iter().zip(&setting.threaded) {
                    let t_render = Cell::from(seconds(all.t_render)).marked(all.t_render < alone.t_render);
                    cells.extend([t_render, seconds(all.t_build).into()]);
                }
                rows.push(Row { cells, first });
            }
            let caption = format!("{}, {SPP} samples per pixel", integrator_name(setting.samples), SPP = super::SPP);
            let mut columns =
                vec!["method", "V_size", "T_render", "T_query", "T_build", "p_sp", "dimensions", "p_acc|sp"];
            if setting.threaded.is_some() {
                columns.extend(["T_render, all", "T_build, all"]);
            }
            Table { caption, columns, rows }
        });
        Section {
            heading: format!("Tables 6.5 to 6.10: {}", scene.name),
            paragraphs: (self.threads > 1)
                .then(|| {
                    format!("T_render and T_build are for one thread, those of *all* for {} threads.", self.threads)
                })
                .into_iter()
                .chain([NOISE.to_owned()])
                .collect(),
            tables: tables.collect(),
            ..Section::default()
        }
    }

    fn threaded_figures(&self, about: &About, all: Option<Threaded>) -> Vec<Figure> {
        let times = |all: Threaded| [("T_render", all.t_render), ("T_build", all.t_build)];
        let figure = |(quantity, t)| about.figure(quantity, "s", t, None).against(self.threads as f64);
        // A hierarchy alone builds no more.
        let kept = |(quantity, _): &(&str, f64)| about.method != "none" || *quantity != "T_build";
        all.map(times).into_iter().flatten().filter(kept).map(figure).collect()
    }

    fn inequality(&self, figures: &mut Vec<Figure>) -> Section {
        let mut tables = Vec::new();
        for scene in self.scenes {
            let mut rows = Vec::new();
            for setting in &scene.settings {
                for (i, m) in setting.methods.iter().enumerate() {
                    let gain = Gain::of(setting, m);
                    let r = &m.replay;
                    let about = about("2.7", scene.name, setting.samples, r.method, Some(r.voxel_size));
                    figures.extend([
                        about.figure("threshold of p_acc|sp", "", gain.threshold, None),
                        about.figure("gain predicted by 2.6", "s", gain.predicted, None),
                        about.figure("gain in queries", "s", gain.queries, None),
                        about.figure("gain in the render", "s", gain.render, None),
                    ]);
                    let mut cells = vec![
                        sps(setting.samples).into(),
                        r.method.into(),
                        r.voxel_size.to_string().into(),
                        percent(m.p_acc_sp).into(),
                        percent(gain.threshold).into(),
                        Cell::from(seconds(gain.predicted)).marked(gain.predicted > 0.0),
                        Cell::from(seconds(gain.queries)).marked(gain.queries > 0.0),
                        Cell::from(seconds(gain.render)).marked(gain.render > 0.0),
                    ];
                    if let Some(threaded) = gain.threaded {
                        figures
                            .push(about.figure("gain in the render", "s", threaded, None).against(self.threads as f64));
                        cells.push(Cell::from(seconds(threaded)).marked(threaded > 0.0));
                    }
                    rows.push(Row { cells, first: i == 0 && !rows.is_empty() });
                }
            }
            let mut columns =
                vec!["sps", "method", "V_size", "p_acc|sp", "must exceed", "predicted", "in queries", "in the render"];
            if scene.settings.iter().any(|s| s.threaded.is_some()) {
                columns.push("on all threads");
            }
            tables.push(Table { caption: scene.name.to_owned(), columns, rows });
        }
        Section {
            heading: "Inequality 2.7: predicted and measured gain".to_owned(),
            paragraphs: vec![
                "A method is worth it if p_acc|sp exceeds t_acc/t_query + t_build/t_query, where t_build = T_build/(N p_sp). Predicted is T_render without the \
                 method less T_render with it by 2.6: N p_sp (p_acc|sp t_query − t_acc) − T_build, which takes a proved query to cost as much as any other. \
                 In queries is the same difference with the times of the replay, fallback and all; in the render is the difference of two renders, noise and all, \
                 and so it is on all threads. Negative is a loss."
                    .to_owned(),
            ],
            tables,
            ..Section::default()
        }
    }

    fn repeatability(&self, figures: &mut Vec<Figure>) -> Section {
        let mut tables = Vec::new();
        for r in self.repeated {
            let s = r.setting;
            let about = about("6.1", &s.scene, s.samples_per_segment, "ndf", Some(s.voxel_size));
            let theirs: Vec<[f64; 3]> = self
                .thesis
                .repeated
                .iter()
                .filter(|t| t.scene == s.scene)
                .map(|t| [t.t_build, t.t_render, t.t_query])
                .collect();
            let mut rows: Vec<Row> = r
                .runs
                .iter()
                .enumerate()
                .map(|(i, run)| {
                    let cell = |k: usize| Cell::beside(seconds(run[k]), theirs.get(i).map(|t| seconds(t[k])));
                    Row::new(vec![(i + 1).to_string().into(), cell(0), cell(1), cell(2)])
                })
                .collect();
            let deviation = |k: usize| {
                let of = |runs: &[[f64; 3]]| relative_deviation(&runs.iter().map(|run| run[k]).collect::<Vec<_>>());
                (of(&r.runs), of(&theirs))
            };
            let mut cells = vec![Cell::from("RSD")];
            for (k, quantity) in ["RSD of T_build", "RSD of T_render", "RSD of T_query"].into_iter().enumerate() {
                let (ours, thesis) = deviation(k);
                figures.push(about.figure(quantity, "", ours, Some(thesis)));
                cells.push(Cell::beside(percent(ours), Some(percent(thesis))));
            }
            rows.push(Row { cells, first: true });
            let caption = format!(
                "{}, {}, {} spp, ndf, V_size {}",
                s.scene,
                integrator_name(s.samples_per_segment),
                s.samples_per_pixel,
                s.voxel_size
            );
            tables.push(Table { caption, columns: vec!["run", "T_build", "T_render", "T_query"], rows });
        }
        Section {
            heading: "Table 6.1: repeatability".to_owned(),
            paragraphs: vec![
                "RSD is the relative standard deviation. T_query is of one pass of a replay here.".to_owned(),
            ],
            tables,
            ..Section::default()
        }
    }

    fn influence(&self, figures: &mut Vec<Figure>) -> Section {
        let mut rows = Vec::new();
        for m in self.measured {
            let s = m.setting;
            let about = about("6.2", &s.scene, s.samples_per_segment, "ndf", Some(s.voxel_size));
            let (ours, theirs) = (m.without / m.with - 1.0, s.t_render_without / s.t_render_with - 1.0);
            let timer = m.timer.t_spatial.median / m.t_spatial - 1.0;
            figures.extend([
                about.figure("T_render with measurement", "s", m.with, Some(s.t_render_with)),
                about.figure("T_render without measurement", "s", m.without, Some(s.t_render_without)),
                about.figure("T_query", "s", m.t_query, Some(s.t_query)),
                about.figure("relative difference", "", ours, Some(theirs)),
                about.figure("t_query without timer", "ns", m.t_spatial, None),
                about.figure("t_query with timer", "ns", m.timer.t_spatial.median, None),
                about.figure("t_query said by timer", "ns", m.timer.said.median, None),
            ]);
            rows.push(Row::new(vec![
                s.scene.clone().into(),
                sps(s.samples_per_segment).into(),
                Cell::beside(seconds(m.t_query), Some(seconds(s.t_query))),
                Cell::beside(seconds(m.with), Some(seconds(s.t_render_with))),
                Cell::beside(seconds(m.without), Some(seconds(s.t_render_without))),
                Cell::beside(percent(ours), Some(percent(theirs))),
                format!("{} ns", short(m.t_spatial)).into(),
                format!("{} ns", short(m.timer.said.median)).into(),
                format!("{} ns", short(m.timer.t_spatial.median)).into(),
                percent(timer).into(),
            ]));
        }
        Section {
            heading: "Table 6.2: influence of measuring".to_owned(),
            paragraphs: vec![
                "With measurement means here that the queries are recorded: in a pass of its own after the render, which does not know of it, so that the difference is the \
                 noise of two renders. The last columns show what the thesis's way would do: a spatial query of the hierarchy in a pass without timers, what timers around each \
                 query say, and what a query takes with them."
                    .to_owned(),
            ],
            tables: vec![Table {
                caption: String::new(),
                columns: vec![
                    "scene", "sps", "T_query", "T_render with", "without", "difference", "no timer", "timers say", "with timers", "slower by",
                ],
                rows,
            }],
            ..Section::default()
        }
    }
}

/// Of Tables 6.5 to 6.10.
const NOISE: &str = "T_render of none is the median of renders between those of the methods; that of a method is one render, or the median of several where it is \
                     short, with the noise of the machine.";

fn about(
    table: &'static str,
    scene: &str,
    samples: Option<u32>,
    method: &'static str,
    voxel_size: Option<f64>,
) -> About {
    About { table, scene: scene.to_owned(), integrator: integrator_name(samples), method, voxel_size }
}

/// What a method gains, in seconds, and what inequality 2.7 wants.
struct Gain {
    threshold: f64,
    predicted: f64,
    queries: f64,
    render: f64,
    threaded: Option<f64>,
}

impl Gain {
    fn of(setting: &SettingResult, m: &MethodResult) -> Self {
        let spatial = setting.n * setting.p_sp;
        let (t_query, t_acc) = (1e-9 * setting.replay.hierarchy.t_query, 1e-9 * m.replay.t_acc.median);
        let t_build = m.t_build / spatial;
        Self {
            threshold: (t_acc + t_build) / t_query,
            predicted: spatial * (m.p_acc_sp * t_query - t_acc) - m.t_build,
            queries: setting.t_query - m.t_query - m.t_build,
            render: setting.t_render - m.t_render,
            threaded: setting.threaded.zip(m.threaded).map(|(none, with)| none.t_render - with.t_render),
        }
    }
}

/// Standard deviation of a sample over its mean.
fn relative_deviation(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    variance.sqrt() / mean
}
