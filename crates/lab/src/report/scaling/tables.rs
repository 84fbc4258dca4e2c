//! Sweeps as tables, plots and figures.

use super::sweep::{Group, Line, Sweep, Unit};
use crate::report::{
    figures::{About, Figure},
    page::{Cell, Row, Section, Table},
    plot::{COLOURS, Plot, Series},
    words::{dash, percent, seconds, short},
};

pub(super) fn section(sweep: &Sweep) -> Section {
    Section {
        heading: sweep.heading.to_owned(),
        paragraphs: sweep.paragraphs.clone(),
        plots: sweep.groups.iter().filter_map(|g| plot(sweep, g)).collect(),
        tables: sweep.groups.iter().map(|g| table(sweep, g)).collect(),
        ..Section::default()
    }
}

/// A row for each x, and the fits below.
fn table(sweep: &Sweep, group: &Group) -> Table {
    let columns = std::iter::once(sweep.against).chain(group.lines.iter().map(|l| l.name)).collect();
    let value = |line: &Line, x| line.at(x).map_or_else(dash, |p| in_words(group.unit, p.median));
    let mut rows: Vec<Row> = group
        .xs()
        .into_iter()
        .map(|x| {
            let first = std::iter::once(Cell::from(x.to_string()));
            Row::new(first.chain(group.lines.iter().map(|l| value(l, x).into())).collect())
        })
        .collect();
    if group.unit.fitted() {
        let fits: Vec<_> = group.lines.iter().map(Line::fit).collect();
        let slope = |x: Option<f64>| x.map_or_else(dash, |x| format!("{x:.2}"));
        let mut row = |name: &str, of: fn(&super::fit::PowerLaw) -> Option<f64>| {
            let cells = fits.iter().map(|f| slope(f.as_ref().and_then(of)).into());
            let first = name == "exponent";
            rows.push(Row { cells: std::iter::once(Cell::from(name)).chain(cells).collect(), first });
        };
        row("exponent", |f| Some(f.exponent));
        row("its standard error", |f| f.standard_error);
        row("slope of the last step", |f| Some(f.last_step));
    }
    Table { caption: group.title.to_owned(), columns, rows }
}

fn in_words(unit: Unit, value: f64) -> String {
    match unit {
        Unit::Seconds => seconds(value),
        Unit::Nanoseconds => format!("{} ns", short(value)),
        Unit::Bytes if value < 1024.0 * 1024.0 => format!("{} KiB", short(value / 1024.0)),
        Unit::Bytes => format!("{} MiB", short(value / (1024.0 * 1024.0))),
        Unit::Share => percent(value),
        Unit::Ratio => short(value),
    }
}

/// The medians; the exponent of each line is in its legend.
fn plot(sweep: &Sweep, group: &Group) -> Option<Plot> {
    if group.unit == Unit::Share || group.xs().len() < 2 {
        return None;
    }
    let series = |(i, line): (usize, &Line)| {
        let fit = line.fit().filter(|_| group.unit.fitted());
        Series {
            name: fit.map_or_else(|| line.name.to_owned(), |f| format!("{}, {:.2}", line.name, f.exponent)),
            points: line.points.iter().map(|p| (p.x, p.median)).collect(),
            colour: i % COLOURS,
            dash: i / COLOURS,
        }
    };
    let y_label = match group.unit {
        Unit::Seconds => "seconds",
        Unit::Nanoseconds => "ns a query",
        Unit::Bytes => "bytes",
        Unit::Share | Unit::Ratio => "ratio",
    };
    let series = group.lines.iter().enumerate().map(series).collect();
    Plot::logarithmic(group.title.to_owned(), sweep.against, y_label, series)
}

/// Every median with the least and the most, and every fit; the table says which of these.
pub(super) fn figures(sweep: &Sweep) -> Vec<Figure> {
    let lines = sweep.groups.iter().flat_map(|group| group.lines.iter().map(move |line| (group, line)));
    lines.flat_map(|(group, line)| of_line(sweep, group, line)).collect()
}

fn of_line(sweep: &Sweep, group: &Group, line: &Line) -> Vec<Figure> {
    let about = About {
        table: sweep.name,
        scene: sweep.scene.to_owned(),
        integrator: sweep.integrator.clone(),
        method: line.method,
        voxel_size: None,
    };
    let table = |what: &str| format!("{}: {}{what}", sweep.name, group.title);
    let mut all = Vec::new();
    for p in &line.points {
        for (what, value) in [("", p.median), (", least", p.least), (", most", p.most)] {
            let figure = about.figure(line.name, group.unit.symbol(), value, None);
            all.push(Figure { table: table(what), against: Some(p.x), ..figure });
        }
    }
    if let Some(fit) = line.fit().filter(|_| group.unit.fitted()) {
        let slopes = [
            (", exponent", Some(fit.exponent)),
            (", standard error", fit.standard_error),
            (", last step", Some(fit.last_step)),
        ];
        for (what, value) in slopes {
            all.extend(value.map(|v| Figure { table: table(what), ..about.figure(line.name, "", v, None) }));
        }
    }
    all
}
