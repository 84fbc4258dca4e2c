//! Tables 6.1 to 6.3: repeatability, the influence of measuring, and its overhead.

use super::{MANY, Tables, about, sps};
use crate::report::{
    figures::Figure,
    page::{Cell, Row, Section, Table},
    words::{dash, percent, seconds, short},
};

impl Tables<'_> {
    pub(super) fn repeatability(&self, figures: &mut Vec<Figure>) -> Section {
        let mut tables = Vec::new();
        for r in self.repeated {
            let s = r.setting;
            let about = about("6.1", &s.scene, s.integrator, "ndf", Some(s.voxel_size));
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
            let caption =
                format!("{}, {}, {} spp, ndf, V_size {}", s.scene, s.integrator, s.samples_per_pixel, s.voxel_size);
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

    pub(super) fn influence(&self, figures: &mut Vec<Figure>) -> Section {
        let mut rows = Vec::new();
        let mut each = Vec::new();
        for m in self.measured {
            let (s, c) = (m.setting, &m.cell);
            let about = about("6.2", &s.scene, s.integrator, "ndf", Some(s.voxel_size));
            let theirs = [
                [Some(s.t_build_with), Some(s.t_render_with), Some(s.t_query)],
                [Some(s.t_build_without), Some(s.t_render_without), None],
            ];
            let quantities = [
                ["T_build with timers", "T_render with timers", "T_query with timers"],
                ["T_build without timers", "T_render without timers", "T_query without timers"],
            ];
            let ours = [c.with, c.without];
            for (k, measuring) in ["with", "without"].into_iter().enumerate() {
                let mut cells = vec![s.scene.clone().into(), sps(s.integrator).into(), measuring.into()];
                for i in 0..3 {
                    figures.push(about.figure(quantities[k][i], "s", ours[k][i], theirs[k][i]));
                    cells.push(Cell::beside(seconds(ours[k][i]), theirs[k][i].map(seconds)));
                }
                rows.push(Row { cells, first: k == 0 && !rows.is_empty() });
            }
            let mut cells: Vec<Cell> = vec![s.scene.clone().into(), sps(s.integrator).into(), "difference".into()];
            for i in 0..3 {
                let relative = |with: f64, without: f64| without / with - 1.0;
                let thesis = theirs[0][i].zip(theirs[1][i]).map(|(with, without)| relative(with, without));
                let ours = relative(ours[0][i], ours[1][i]);
                if i == 1 {
                    figures.push(about.figure("relative difference of T_render", "", ours, thesis));
                }
                cells.push(Cell::beside(percent(ours), thesis.map(percent)));
            }
            rows.push(Row::new(cells));
            figures.extend([
                about.figure("t_query without timer", "ns", c.t_spatial, None),
                about.figure("t_query with timer", "ns", c.t_with, None),
                about.figure("t_query said by timer", "ns", c.t_said, None),
            ]);
            each.push(Row::new(vec![
                s.scene.clone().into(),
                format!("{} ns", short(c.t_spatial)).into(),
                format!("{} ns", short(c.t_said)).into(),
                format!("{} ns", short(c.t_with)).into(),
                percent(c.t_with / c.t_spatial - 1.0).into(),
            ]));
        }
        Section {
            heading: "Table 6.2: influence of measuring".to_owned(),
            paragraphs: vec![
                "With: a timer around each query of the render, as in the thesis. Without: none; T_query is then that of a replay, which the thesis had not. Renders with and \
                 without take turns, on one thread and without a film; medians of three."
                    .to_owned(),
            ],
            tables: vec![
                Table {
                    caption: String::new(),
                    columns: vec!["scene", "sps", "timers", "T_build", "T_render", "T_query"],
                    rows,
                },
                Table {
                    caption: "A spatial query of the hierarchy in a replay: without timers, as timers say, and with them".to_owned(),
                    columns: vec!["scene", "no timer", "timers say", "with timers", "slower by"],
                    rows: each,
                },
            ],
            ..Section::default()
        }
    }

    /// Table 6.3 and what 6.3.1 makes of it.
    pub(super) fn overhead(&self, figures: &mut Vec<Figure>) -> Section {
        let mut rows = Vec::new();
        for (scene, c) in self.overheads {
            let about = about("6.3", scene, MANY, "none", None);
            let t = self.thesis.overhead(scene);
            let thesis_n = self.thesis.queries(scene, MANY).map(|q| q.n);
            let real = |with: f64, without: f64, said: f64| said - 0.5 * (with - without);
            let thesis = t.map(|t| real(t.t_render_with, t.t_render_without, t.t_query));
            let ours = real(c.with, c.without, c.said);
            let each = 1e9 * ours / c.n;
            let thesis_each = thesis.zip(thesis_n).map(|(t, n)| 1e9 * t / n);
            let setting = self.scenes.iter().find(|s| s.name == *scene).map(|s| &s.settings);
            let setting = setting.and_then(|settings| settings.iter().find(|s| s.integrator == MANY));
            let replayed = setting.map(|s| s.alone.t_query_each);
            let overhead = c.with - c.without;
            figures.extend([
                about.figure("T_render with timers", "s", c.with, t.map(|t| t.t_render_with)),
                about.figure("T_render without timers", "s", c.without, t.map(|t| t.t_render_without)),
                about.figure("T_query said by timers", "s", c.said, t.map(|t| t.t_query)),
                about.figure("overhead", "s", overhead, t.map(|t| t.t_render_with - t.t_render_without)),
                about.figure("T_query less half the overhead", "s", ours, thesis),
                about.figure("t_query by 6.3.1", "ns", each, thesis_each),
            ]);
            let nanoseconds = |t: f64| format!("{} ns", short(t));
            rows.push(Row::new(vec![
                (*scene).into(),
                Cell::beside(seconds(c.with), t.map(|t| seconds(t.t_render_with))),
                Cell::beside(seconds(c.without), t.map(|t| seconds(t.t_render_without))),
                Cell::beside(seconds(overhead), t.map(|t| seconds(t.t_render_with - t.t_render_without))),
                Cell::beside(seconds(c.said), t.map(|t| seconds(t.t_query))),
                Cell::beside(seconds(ours), thesis.map(seconds)),
                Cell::beside(nanoseconds(each), thesis_each.map(nanoseconds)),
                replayed.map_or_else(dash, nanoseconds).into(),
            ]));
        }
        Section {
            heading: "Table 6.3 and 6.3.1: the overhead of measuring, and the time of a query".to_owned(),
            paragraphs: vec![
                "The hierarchy alone, 49 samples per segment. The thesis takes half of the overhead, T_render with timers less T_render without, from what the timers say \
                 (6.2.2): as much of a timer's own time falls inside the span that it measures as outside. Divided by N that is its t_query. The last column is what a replay \
                 without any timer finds; this report goes by that."
                    .to_owned(),
            ],
            tables: vec![Table {
                caption: String::new(),
                columns: vec![
                    "scene", "T_render with", "without", "overhead", "T_query said", "less half", "t_query", "by replay",
                ],
                rows,
            }],
            ..Section::default()
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
