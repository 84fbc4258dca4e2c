//! Tables 6.5 to 6.10: times of renders with each method, on one thread and on all.

use super::{
    Tables, about, printed,
    scenes::{SceneResult, Threaded},
};
use crate::report::{
    figures::{About, Figure},
    page::{Cell, Row, Section, Table},
    words::{grid, percent, seconds},
};

/// Of Tables 6.5 to 6.10.
const NOISE: &str = "T_render of none is the median of renders between those of the methods; that of a method is the median of two renders, or of up to five short ones. \
                     Spread is (greatest − least) / median of these times: the noise of the machine.";

impl Tables<'_> {
    pub(super) fn acceleration(&self, scene: &SceneResult, figures: &mut Vec<Figure>) -> Section {
        let tables = scene.settings.iter().map(|setting| {
            let about = |method, size| about("6.5-6.10", scene.name, setting.integrator, method, size);
            let thesis = |method: &str, size| self.thesis.acceleration(scene.name, method, size, setting.integrator);
            let t = thesis("none", 0.0);
            let alone = about("none", None);
            figures.push(alone.figure("T_render", "s", setting.t_render, t.map(|t| t.t_render)));
            figures.push(alone.figure("T_query", "s", setting.alone.t_query(), t.map(|t| t.t_query)));
            figures.push(alone.figure("spread of T_render", "", setting.spread, None));
            figures.push(alone.figure("p_sp", "", setting.alone.p_sp, t.map(|t| t.p_sp / 100.0)));
            figures.extend(self.threaded_figures(&alone, setting.threaded));
            let mut cells = vec![
                "none".into(),
                "".into(),
                Cell::beside(seconds(setting.t_render), t.map(|t| seconds(t.t_render))),
                Cell::beside(seconds(setting.alone.t_query()), t.map(|t| seconds(t.t_query))),
                "".into(),
                Cell::beside(percent(setting.alone.p_sp), t.map(|t| printed(t.p_sp))),
                "".into(),
                "".into(),
                percent(setting.spread).into(),
            ];
            cells.extend(setting.threaded.iter().flat_map(|all| [seconds(all.t_render).into(), "".into()]));
            let mut rows = vec![Row::new(cells)];
            let mut size = None;
            for m in &setting.methods {
                let first = size.replace(m.voxel_size) != Some(m.voxel_size);
                let t = thesis(m.method, m.voxel_size);
                let about = about(m.method, Some(m.voxel_size));
                figures.extend([
                    about.figure("T_render", "s", m.t_render, t.map(|t| t.t_render)),
                    about.figure("spread of T_render", "", m.spread, None),
                    about.figure("T_query", "s", m.t_query, t.map(|t| t.t_query)),
                    about.figure("T_build", "s", m.t_build, t.and_then(|t| t.t_build)),
                    about.figure("p_acc|sp", "", m.p_acc_sp, t.and_then(|t| t.p_acc_sp).map(|p| p / 100.0)),
                ]);
                figures.extend(self.threaded_figures(&about, m.threaded));
                let mut cells = vec![
                    m.method.into(),
                    m.voxel_size.to_string().into(),
                    Cell::beside(seconds(m.t_render), t.map(|t| seconds(t.t_render)))
                        .marked(m.t_render < setting.t_render),
                    Cell::beside(seconds(m.t_query), t.map(|t| seconds(t.t_query)))
                        .marked(m.t_query < setting.alone.t_query()),
                    Cell::beside(seconds(m.t_build), t.and_then(|t| t.t_build).map(seconds)),
                    Cell::beside(percent(setting.alone.p_sp), t.map(|t| printed(t.p_sp))),
                    Cell::beside(grid(m.grid), t.and_then(|t| t.grid.as_ref()).map(|g| g.replace('x', "×"))),
                    Cell::beside(percent(m.p_acc_sp), t.and_then(|t| t.p_acc_sp).map(printed)),
                    percent(m.spread).into(),
                ];
                for (all, alone) in m.threaded.iter().zip(&setting.threaded) {
                    let t_render = Cell::from(seconds(all.t_render)).marked(all.t_render < alone.t_render);
                    cells.extend([t_render, seconds(all.t_build).into()]);
                }
                rows.push(Row { cells, first });
            }
            let caption = format!("{}, {SPP} samples per pixel", setting.integrator, SPP = super::SPP);
            let mut columns =
                vec!["method", "V_size", "T_render", "T_query", "T_build", "p_sp", "dimensions", "p_acc|sp", "spread"];
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
}
