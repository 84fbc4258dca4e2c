//! The queries report: a stream replayed, per method and voxel size.

use std::{fs, path::Path};

use vdf_render::{PreparedScene, Progress};
use vdf_visibility::QueryKind;

use super::{
    Report,
    figures::{About, Figure},
    page::{Cell, Page, Row, Section, Table},
    plot::{Plot, Series},
    words::{grid, percent, seconds, short},
};
use crate::{
    LabError,
    queries::{
        ClassReplay, MethodReplay, ProofReplay, QueryStream, Replay, ReplayOptions, StreamOrigin, Timing, replay,
        write_triangles,
    },
};

/// Replays `stream`, which was recorded in `prepared`, the scene called `name`.
///
/// # Errors
/// As [`replay`].
pub fn run(
    name: &str,
    prepared: &PreparedScene,
    stream: &QueryStream,
    options: &ReplayOptions,
    progress: &dyn Progress,
) -> Result<Report, LabError> {
    let replay = replay(prepared, stream, options, progress)?;
    let origin = &stream.origin;
    let page = page(name, prepared.scene().emitters.len(), origin, &replay);
    Ok(Report::new(page, figures(name, origin, &replay), origin.seed))
}

/// Writes `triangles.bin` and `queries.bin` for other programs to `folder`, which is made if it does not exist.
///
/// # Errors
/// [`LabError::Write`] with the system's reason.
pub fn export(folder: &Path, prepared: &PreparedScene, stream: &QueryStream) -> Result<(), LabError> {
    let fail = |path: &Path| {
        let path = path.to_owned();
        move |source| LabError::Write { path, source }
    };
    fs::create_dir_all(folder).map_err(fail(folder))?;
    let [triangles, queries] = ["triangles.bin", "queries.bin"].map(|name| folder.join(name));
    write_triangles(&triangles, &prepared.world().triangles).map_err(fail(&triangles))?;
    stream.write(&queries).map_err(fail(&queries))
}

/// What a class of queries is called, and the names of its figures.
struct ClassNames {
    name: &'static str,
    t_query: &'static str,
    unoccluded: &'static str,
    timer: [&'static str; 2],
    method: [&'static str; 17],
}

/// All classes; those of spatial queries have the names of the thesis.
const CLASSES: [ClassNames; 3] = [
    ClassNames {
        name: "spatial",
        t_query: "t_query spatial",
        unoccluded: "unoccluded of spatial",
        timer: ["t_query spatial with timer", "t_query spatial said by timer"],
        method: [
            "p_acc|sp",
            "u",
            "t_query spatial",
            "t_acc",
            "t_acc least",
            "t_acc most",
            "t_eff",
            "t_acc by 6.3.2",
            "t_eff least",
            "t_eff most",
            "speed-up",
            "t_batch",
            "pays from",
            "t_batch 16",
            "left open",
            "by list",
            "mean tests",
        ],
    },
    ClassNames {
        name: "on an area light",
        t_query: "t_query on light",
        unoccluded: "unoccluded of on light",
        timer: ["t_query on light with timer", "t_query on light said by timer"],
        method: [
            "p_acc on light",
            "u on light",
            "t_query on light",
            "t_acc on light",
            "t_acc on light least",
            "t_acc on light most",
            "t_eff on light",
            "t_acc on light by 6.3.2",
            "t_eff on light least",
            "t_eff on light most",
            "speed-up on light",
            "t_batch on light",
            "pays from on light",
            "t_batch 16 on light",
            "left open on light",
            "by list on light",
            "mean tests on light",
        ],
    },
    ClassNames {
        name: "superficial",
        t_query: "t_query superficial",
        unoccluded: "unoccluded of superficial",
        timer: ["t_query superficial with timer", "t_query superficial said by timer"],
        method: [
            "p_acc superficial",
            "u superficial",
            "t_query superficial of method",
            "t_acc superficial",
            "t_acc superficial least",
            "t_acc superficial most",
            "t_eff superficial",
            "t_acc superficial by 6.3.2",
            "t_eff superficial least",
            "t_eff superficial most",
            "speed-up superficial",
            "t_batch superficial",
            "pays from superficial",
            "t_batch 16 superficial",
            "left open superficial",
            "by list superficial",
            "mean tests superficial",
        ],
    },
];

fn names(kind: QueryKind) -> &'static ClassNames {
    match kind {
        QueryKind::Spatial => &CLASSES[0],
        QueryKind::OnLight => &CLASSES[1],
        QueryKind::Superficial => &CLASSES[2],
    }
}

fn page(name: &str, emitters: usize, origin: &StreamOrigin, r: &Replay) -> Page {
    let lead = vec![format!(
        "{} visibility queries of {} with {} samples per pixel in {name} ({} triangles, {emitters} emitters), from {} of {} \
         paths. Each answer of each method was compared with the hierarchy's; all agree.",
        r.queries, origin.integrator, origin.spp, r.triangles, origin.paths_recorded, origin.paths
    )];
    let mut sections = vec![hierarchy_section(r), methods_section(r)];
    sections.extend(buffers_section(r));
    sections.extend(provable(r).map(|class| verdict_section(class.kind, r)));
    Page { title: format!("Visibility queries in {name}"), lead, sections }
}

/// The classes that one of the methods can prove.
fn provable(r: &Replay) -> impl Iterator<Item = &ClassReplay> {
    r.hierarchy.classes.iter().filter(|c| r.methods.iter().any(|m| m.proofs_of(c.kind).is_some()))
}

/// A method with its figures of a class.
fn of_class(r: &Replay, kind: QueryKind) -> impl Iterator<Item = (&MethodReplay, &ProofReplay)> {
    r.methods.iter().filter_map(move |m| Some((m, m.proofs_of(kind)?)))
}

fn spread(t: Timing) -> String {
    format!("{} to {}", short(t.min), short(t.max))
}

fn hierarchy_section(r: &Replay) -> Section {
    let row = |name: String, queries: usize, t: Timing| {
        let cells = [name, queries.to_string(), short(t.median), spread(t)];
        Row::new(cells.map(Cell::from).to_vec())
    };
    let class_row = |c: &ClassReplay| row(format!("hierarchy, {}", names(c.kind).name), c.queries, c.time);
    let mut rows: Vec<Row> = r.hierarchy.classes.iter().map(class_row).collect();
    if let Some(first) = r.hierarchy.classes.first() {
        let name = names(first.kind).name;
        let timed = format!("hierarchy, {name}, with a timer around each query");
        rows.push(row("loop without a query".to_owned(), first.queries, r.t_loop));
        rows.push(row(timed, first.queries, r.timer.time));
        rows.push(row("the same, as the timers say".to_owned(), first.queries, r.timer.said));
    }
    let unoccluded = provable(r).map(|c| {
        let share = percent(c.unoccluded as f64 / c.queries as f64);
        format!(" {share} of those {} are unoccluded.", names(c.kind).name)
    });
    Section {
        heading: "The hierarchy alone".to_owned(),
        paragraphs: vec![format!(
            "p_sp = {}: so many of the queries are spatial.{} Medians of {} passes on one thread. The loop is part of all other \
             times.",
            percent(r.p_spatial),
            unoccluded.collect::<String>(),
            r.passes
        )],
        tables: vec![Table {
            caption: String::new(),
            columns: vec!["what", "queries", "ns a query", "least to most"],
            rows,
        }],
        ..Section::default()
    }
}

fn methods_section(r: &Replay) -> Section {
    let table = |class: &ClassReplay| {
        let mut size = None;
        let rows = of_class(r, class.kind).map(|(m, p)| {
            let first = size.replace(m.voxel_size).is_some_and(|before| before != m.voxel_size);
            Row { cells: method_cells(m, p), first }
        });
        let caption = match class.kind {
            QueryKind::OnLight => "Queries on an area light".to_owned(),
            QueryKind::Superficial => "Superficial queries, which only light buffers prove".to_owned(),
            QueryKind::Spatial => String::new(),
        };
        Table { caption, columns: METHOD_COLUMNS.to_vec(), rows: rows.collect() }
    };
    Section {
        heading: "Methods".to_owned(),
        paragraphs: vec![
            "t_acc is the attempt of a proof for a query of the class, t_eff the whole query with the fallback, speed-up = \
             t_query / t_eff: below 1 the method loses against the hierarchy alone. \"t_acc by 6.3.2\" is t_eff - (1 - p_acc) \
             t_query, as the thesis computes t_acc: with the time that a fallback waits for its proof. \"t_batch\" is \
             t_eff of queries that are asked 256 at a time. \"Of all\" counts all queries of the stream, one by one and in batches. \"Pays from\" is the number of such queries that outweighs \
             T_build."
                .to_owned(),
        ],
        plots: provable(r).next().map(|class| plots(class, r)).unwrap_or_default(),
        tables: provable(r).map(table).collect(),
        ..Section::default()
    }
}

/// How light buffers answer, if a method keeps any.
fn buffers_section(r: &Replay) -> Option<Section> {
    let rows: Vec<Row> = r
        .methods
        .iter()
        .flat_map(|m| m.proofs.iter().filter_map(move |p| Some((m, p, p.look_ups?))))
        .map(|(m, p, l)| {
            let cells = [
                m.method.to_owned(),
                names(p.kind).name.to_owned(),
                l.queries.to_string(),
                percent(l.lit),
                percent(l.occluded),
                percent(l.open()),
                percent(l.by_list),
                percent(l.hierarchy),
                short(l.mean_tests),
                short(p.t_effective.median),
                short(p.t_batch_16.median),
                short(p.t_batch.median),
            ];
            Row::new(cells.map(Cell::from).to_vec())
        })
        .collect();
    let columns = vec![
        "method",
        "queries",
        "number",
        "lit",
        "occluded",
        "left open",
        "by list",
        "hierarchy",
        "tests",
        "1 at a time",
        "16",
        "256",
    ];
    (!rows.is_empty()).then(|| Section {
        heading: "Look-ups in light buffers".to_owned(),
        paragraphs: vec![
            "Comparisons with a texel find a query lit or occluded; what they leave open, u of a light buffer, is decided by a list of triangles or, where it is too close, by the \
             hierarchy. \"Tests\" are triangles tested for each query left open. The last columns are nanoseconds a query, fallback included, for queries that are asked one at a time and in \
             batches."
                .to_owned(),
        ],
        tables: vec![Table { caption: String::new(), columns, rows }],
        ..Section::default()
    })
}

const METHOD_COLUMNS: [&str; 17] = [
    "method",
    "V_size",
    "voxels",
    "memory",
    "T_build",
    "p_acc|sp",
    "u",
    "t_query ns",
    "t_acc ns",
    "t_acc/t_query",
    "t_eff ns",
    "t_acc by 6.3.2",
    "speed-up",
    "t_batch",
    "of all",
    "in batches",
    "pays from",
];

fn method_cells(m: &MethodReplay, p: &ProofReplay) -> Vec<Cell> {
    vec![
        m.method.into(),
        m.voxel_size.to_string().into(),
        grid(m.grid).into(),
        format!("{} MiB", short(m.bytes as f64 / f64::from(1 << 20))).into(),
        seconds(m.t_build).into(),
        percent(p.p_accelerated).into(),
        percent(p.unknown_fraction).into(),
        short(p.t_hierarchy.median).into(),
        short(p.t_acc.median).into(),
        Cell::from(percent(p.threshold)).marked(p.p_accelerated > p.threshold),
        short(p.t_effective.median).into(),
        short(p.t_acc_derived).into(),
        Cell::from(format!("{:.2}", p.speed_up)).marked(p.speed_up > 1.0),
        short(p.t_batch.median).into(),
        Cell::from(format!("{:.2}", m.speed_up_all)).marked(m.speed_up_all > 1.0),
        Cell::from(format!("{:.2}", m.speed_up_batches)).marked(m.speed_up_batches > 1.0),
        p.pays_from.map_or_else(|| "never".to_owned(), |n| format!("{n:.1e}")).into(),
    ]
}

/// Times of the class against the number of voxels.
fn plots(class: &ClassReplay, r: &Replay) -> Vec<Plot> {
    let plot = |title: &str, y_label: &str, time: fn(&ProofReplay) -> f64| {
        let mut series: Vec<Series> = Vec::new();
        for (m, p) in of_class(r, class.kind) {
            let voxels = m.grid.iter().map(|&n| f64::from(n)).product();
            let point = (voxels, time(p));
            match series.iter_mut().find(|s| s.name == m.method) {
                Some(s) => s.points.push(point),
                None => {
                    let style = Series::in_style_of(m.method);
                    series.push(Series { name: m.method.to_owned(), points: vec![point], ..style });
                }
            }
        }
        let xs: Vec<f64> = series.iter().flat_map(|s| s.points.iter().map(|p| p.0)).collect();
        series.push(Series {
            name: "hierarchy alone".to_owned(),
            points: xs.iter().map(|&x| (x, class.time.median)).collect(),
            ..Series::in_style_of("none")
        });
        Plot::logarithmic(title.to_owned(), "voxels", y_label, series)
    };
    let effective = format!("A query, {}, with its fallback", names(class.kind).name);
    let effective = plot(&effective, "t_eff, ns", |p| p.t_effective.median);
    let acc = plot("The attempt of a proof", "t_acc, ns", |p| p.t_acc.median);
    [effective, acc].into_iter().flatten().collect()
}

/// In words: who wins, who loses.
fn verdict_section(kind: QueryKind, r: &Replay) -> Section {
    let chosen = |is: &dyn Fn(&ProofReplay) -> bool| {
        let chosen = of_class(r, kind).filter(|(_, p)| is(p));
        let names: Vec<_> =
            chosen.map(|(m, p)| format!("{} at {} ({:.2})", m.method, m.voxel_size, p.speed_up)).collect();
        if names.is_empty() { "none".to_owned() } else { names.join(", ") }
    };
    let contradicted = chosen(&|p| (p.p_accelerated > p.threshold) != (p.speed_up > 1.0));
    let criterion = if contradicted == "none" {
        "Criterion 2.8, p_acc > t_acc / t_query, tells both apart.".to_owned()
    } else {
        format!("Criterion 2.8, p_acc > t_acc / t_query, says otherwise of: {contradicted}.")
    };
    let name = names(kind).name;
    Section {
        heading: if kind == QueryKind::Spatial { "Verdict".to_owned() } else { format!("Verdict, queries {name}") },
        paragraphs: vec![
            format!("Faster than the hierarchy alone (speed-up of a query): {}.", chosen(&|p| p.speed_up > 1.0)),
            format!("Not faster: {}.", chosen(&|p| p.speed_up <= 1.0)),
            criterion,
        ],
        ..Section::default()
    }
}

fn figures(name: &str, origin: &StreamOrigin, r: &Replay) -> Vec<Figure> {
    let about = |method, voxel_size| About {
        table: "queries",
        scene: name.to_owned(),
        integrator: origin.integrator.to_string(),
        method,
        voxel_size,
    };
    let stream = about("none", None);
    let mut all = vec![
        stream.figure("queries", "", r.queries as f64, None),
        stream.figure("p_sp", "", r.p_spatial, None),
        stream.figure("t_loop", "ns", r.t_loop.median, None),
        stream.figure("t_query", "ns", r.hierarchy.t_query, None),
    ];
    for class in &r.hierarchy.classes {
        let names = names(class.kind);
        let share = class.unoccluded as f64 / class.queries as f64;
        all.push(stream.figure(names.t_query, "ns", class.time.median, None));
        all.push(stream.figure(names.unoccluded, "", share, None));
    }
    if let Some(first) = r.hierarchy.classes.first() {
        let [with, said] = names(first.kind).timer;
        all.push(stream.figure(with, "ns", r.timer.time.median, None));
        all.push(stream.figure(said, "ns", r.timer.said.median, None));
    }
    all.extend(r.estimated_total.map(|n| stream.figure("N", "", n, None)));
    for m in &r.methods {
        let about = about(m.method, Some(m.voxel_size));
        all.push(about.figure("bytes", "B", m.bytes as f64, None));
        all.push(about.figure("T_build", "s", m.t_build, None));
        all.push(about.figure("speed-up of all", "", m.speed_up_all, None));
        all.push(about.figure("speed-up of all in batches", "", m.speed_up_batches, None));
        all.extend(m.proofs.iter().flat_map(|p| proof_figures(&about, p)));
    }
    all
}

fn proof_figures(about: &About, p: &ProofReplay) -> Vec<Figure> {
    let values = [
        ("", p.p_accelerated),
        ("", p.unknown_fraction),
        ("ns", p.t_hierarchy.median),
        ("ns", p.t_acc.median),
        ("ns", p.t_acc.min),
        ("ns", p.t_acc.max),
        ("ns", p.t_effective.median),
        ("ns", p.t_acc_derived),
        ("ns", p.t_effective.min),
        ("ns", p.t_effective.max),
        ("", p.speed_up),
        ("ns", p.t_batch.median),
    ];
    let names = names(p.kind).method;
    let mut all: Vec<_> =
        names.iter().zip(values).map(|(name, (unit, value))| about.figure(name, unit, value, None)).collect();
    all.extend(p.pays_from.map(|n| about.figure(names[12], "", n, None)));
    all.push(about.figure(names[13], "ns", p.t_batch_16.median, None));
    if let Some(l) = p.look_ups {
        let shares = names[14..].iter().zip([l.open(), l.by_list, l.mean_tests]);
        all.extend(shares.map(|(name, value)| about.figure(name, "", value, None)));
    }
    all
}
