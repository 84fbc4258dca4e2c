//! Tables 6.11 and 6.4, and Figure 6.7: how many queries there are, and what a proof costs.

use super::{
    MANY, Tables, about, printed,
    scenes::{Alone, SettingResult},
    sps,
};
use crate::report::{
    figures::Figure,
    page::{Cell, Row, Section, Table},
    plot::{Plot, Series},
    words::{dash, percent, short},
};

impl Tables<'_> {
    pub(super) fn queries(&self, figures: &mut Vec<Figure>) -> Section {
        let mut rows = Vec::new();
        for scene in self.scenes {
            for (i, setting) in scene.settings.iter().enumerate() {
                let thesis = self.thesis.queries(scene.name, setting.integrator);
                let about = about("6.11", scene.name, setting.integrator, "none", None);
                let Alone { n, p_sp, superficial_unoccluded, .. } = setting.alone;
                let counted = n * (p_sp + superficial_unoccluded);
                let thesis_n = thesis.map(|t| t.n);
                figures.push(about.figure("N", "", n, thesis_n));
                figures.push(about.figure("N of spatial and unoccluded superficial", "", counted, thesis_n));
                figures.push(about.figure("p_sp", "", p_sp, thesis.map(|t| t.p_sp / 100.0)));
                let cells = vec![
                    scene.name.into(),
                    sps(setting.integrator).into(),
                    Cell::beside(millions(n), thesis_n.map(millions)),
                    thesis_n.map_or_else(dash, |t| format!("{:+.1} %", 100.0 * (n / t - 1.0))).into(),
                    millions(counted).into(),
                    Cell::beside(percent(p_sp), thesis.map(|t| printed(t.p_sp))),
                ];
                rows.push(Row { cells, first: i == 0 && !rows.is_empty() });
            }
        }
        Section {
            heading: "Table 6.11: visibility queries".to_owned(),
            paragraphs: vec![
                "Paths end as in the thesis's renderer, Mitsuba 0.4 to 0.6: roulette begins one event earlier than in Mitsuba 3, a boundary of a medium that is \
                 passed counts as an event, and at most 95 % survive. Without that (render --roulette standard) N is up to 1.4 times as large. The thesis's ray \
                 marcher has fewer superficial queries to a path than its path tracer where walls hide the light, and as many where none does: about as many as are \
                 unoccluded. The column *unoccluded only* counts spatial queries and those."
                    .to_owned(),
            ],
            tables: vec![Table { caption: String::new(), columns: vec!["scene", "sps", "N", "difference", "unoccluded only", "p_sp"], rows }],
            ..Section::default()
        }
    }

    pub(super) fn proof_times(&self, figures: &mut Vec<Figure>) -> Section {
        let mut rows = Vec::new();
        let mut plots = Vec::new();
        for scene in self.scenes {
            // As in the thesis: from the ray marcher with 49 samples.
            let Some(setting) = scene.settings.iter().find(|s| s.integrator == MANY) else { continue };
            let t_query = setting.alone.t_query_each;
            let hierarchy = self.thesis.proof_time(scene.name, "none", 0.0).map(|t| t.t_acc);
            figures.push(about("6.4", scene.name, MANY, "none", None).figure("t_query", "ns", t_query, hierarchy));
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
                let t_acc = m.replay.t_acc;
                let thesis = self.thesis.proof_time(scene.name, m.method, m.voxel_size);
                let about = about("6.4", scene.name, MANY, m.method, Some(m.voxel_size));
                let derived = m.replay.t_acc_derived;
                figures.push(about.figure("t_acc", "ns", t_acc, None));
                figures.push(about.figure("t_acc by 6.3.2", "ns", derived, thesis.map(|t| t.t_acc)));
                figures.push(about.figure("t_acc/t_query", "", derived / t_query, thesis.map(|t| t.ratio / 100.0)));
                rows.push(Row::new(vec![
                    scene.name.into(),
                    m.method.into(),
                    m.voxel_size.to_string().into(),
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
                let style = Series::in_style_of(method);
                series.push(Series { name, points: vec![point], dash: dash.unwrap_or(style.dash), ..style });
            }
        };
        for m in &setting.methods {
            let voxels = m.grid.iter().map(|&n| f64::from(n)).product();
            add(m.method.to_owned(), m.method, None, (voxels, m.replay.t_acc));
            if let Some(t) = self.thesis.proof_time(scene, m.method, m.voxel_size) {
                add(format!("{}, thesis", m.method), m.method, Some(3), (voxels, t.t_acc));
            }
        }
        Plot::logarithmic(format!("{scene}: time of a proof against voxels"), "voxels", "t_acc, ns", series)
    }
}

fn millions(n: f64) -> String {
    format!("{:.2} M", n / 1e6)
}
