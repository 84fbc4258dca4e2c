//! Tables 6.1 and 6.2: repeatability, and the influence of measuring.

use super::{Tables, about, sps};
use crate::report::{
    figures::Figure,
    page::{Cell, Row, Section, Table},
    words::{percent, seconds, short},
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
        for m in self.measured {
            let s = m.setting;
            let about = about("6.2", &s.scene, s.integrator, "ndf", Some(s.voxel_size));
            let (ours, theirs) = (m.without / m.with - 1.0, s.t_render_without / s.t_render_with - 1.0);
            let timer = m.timer.time.median / m.t_spatial - 1.0;
            figures.extend([
                about.figure("T_render with measurement", "s", m.with, Some(s.t_render_with)),
                about.figure("T_render without measurement", "s", m.without, Some(s.t_render_without)),
                about.figure("T_query", "s", m.t_query, Some(s.t_query)),
                about.figure("relative difference", "", ours, Some(theirs)),
                about.figure("t_query without timer", "ns", m.t_spatial, None),
                about.figure("t_query with timer", "ns", m.timer.time.median, None),
                about.figure("t_query said by timer", "ns", m.timer.said.median, None),
            ]);
            rows.push(Row::new(vec![
                s.scene.clone().into(),
                sps(s.integrator).into(),
                Cell::beside(seconds(m.t_query), Some(seconds(s.t_query))),
                Cell::beside(seconds(m.with), Some(seconds(s.t_render_with))),
                Cell::beside(seconds(m.without), Some(seconds(s.t_render_without))),
                Cell::beside(percent(ours), Some(percent(theirs))),
                format!("{} ns", short(m.t_spatial)).into(),
                format!("{} ns", short(m.timer.said.median)).into(),
                format!("{} ns", short(m.timer.time.median)).into(),
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

/// Standard deviation of a sample over its mean.
fn relative_deviation(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    variance.sqrt() / mean
}
