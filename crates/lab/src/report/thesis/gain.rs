//! Inequality 2.7: the gain that it predicts beside the gain measured.

use super::{
    Tables, about,
    scenes::{MethodResult, SettingResult},
    sps,
};
use crate::report::{
    figures::Figure,
    page::{Cell, Row, Section, Table},
    words::{percent, seconds},
};

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
        let spatial = setting.alone.n * setting.alone.p_sp;
        let (t_query, t_acc) = (1e-9 * setting.alone.t_query_each, 1e-9 * m.replay.t_acc);
        let t_build = m.t_build / spatial;
        Self {
            threshold: (t_acc + t_build) / t_query,
            predicted: spatial * (m.p_acc_sp * t_query - t_acc) - m.t_build,
            queries: setting.alone.t_query() - m.t_query - m.t_build,
            render: setting.t_render - m.t_render,
            threaded: setting.threaded.zip(m.threaded).map(|(none, with)| none.t_render - with.t_render),
        }
    }
}

impl Tables<'_> {
    pub(super) fn inequality(&self, figures: &mut Vec<Figure>) -> Section {
        let mut tables = Vec::new();
        for scene in self.scenes {
            let mut rows = Vec::new();
            for setting in &scene.settings {
                let limit = setting.alone.t_query();
                let none = about("2.7", scene.name, setting.integrator, "none", None);
                figures.push(none.figure("limit of saving by 2.9", "s", limit, None));
                for (i, m) in setting.methods.iter().enumerate() {
                    let gain = Gain::of(setting, m);
                    let about = about("2.7", scene.name, setting.integrator, m.method, Some(m.voxel_size));
                    figures.extend([
                        about.figure("threshold of p_acc|sp", "", gain.threshold, None),
                        about.figure("gain predicted by 2.6", "s", gain.predicted, None),
                        about.figure("gain in queries", "s", gain.queries, None),
                        about.figure("gain in the render", "s", gain.render, None),
                    ]);
                    let mut cells = vec![
                        sps(setting.integrator).into(),
                        m.method.into(),
                        m.voxel_size.to_string().into(),
                        percent(m.p_acc_sp).into(),
                        percent(gain.threshold).into(),
                        Cell::from(seconds(gain.predicted)).marked(gain.predicted > 0.0),
                        Cell::from(seconds(gain.queries)).marked(gain.queries > 0.0),
                        Cell::from(seconds(gain.render)).marked(gain.render > 0.0),
                        seconds(limit).into(),
                    ];
                    if let Some(threaded) = gain.threaded {
                        figures
                            .push(about.figure("gain in the render", "s", threaded, None).against(self.threads as f64));
                        cells.push(Cell::from(seconds(threaded)).marked(threaded > 0.0));
                    }
                    rows.push(Row { cells, first: i == 0 && !rows.is_empty() });
                }
            }
            let mut columns = vec![
                "sps",
                "method",
                "V_size",
                "p_acc|sp",
                "must exceed",
                "predicted",
                "in queries",
                "in the render",
                "at most",
            ];
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
                 and so it is on all threads. Negative is a loss. At most is the limit that follows from 2.9 for p_acc = 1, t_acc = 0 and T_build = 0: T_query, all the time of all queries, \
                 as the replay has it; a render that gains more gains by noise."
                    .to_owned(),
            ],
            tables,
            ..Section::default()
        }
    }
}
