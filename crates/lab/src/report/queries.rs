//! `vdf report queries`.

use std::{fs, path::Path};

use anyhow::{Context as _, anyhow};
use vdf_render::{
    RenderOptions, World,
    queries::{
        MethodReplay, QueryStream, Replay, ReplayOptions, StreamOrigin, Timing, record_queries, replay, write_triangles,
    },
    scene::Scene,
};

use super::{
    figures::{About, Figure},
    grid, methods,
    page::{Cell, Page, Row, Section, Table},
    percent,
    plot::{Plot, Series},
    provenance::Provenance,
    seconds, short,
};
use crate::{
    args::ReportQueriesArgs,
    commands::render::{integrator, load, write_stream},
    failure::{Failure, say},
    progress::Reporter,
};

pub(crate) fn run(args: &ReportQueriesArgs) -> Result<(), Failure> {
    let options = ReplayOptions {
        methods: methods(&args.methods),
        voxel_sizes: args.voxel_sizes.clone(),
        passes: args.passes,
        threads: args.threads,
        ..ReplayOptions::default()
    };
    options.validate()?;
    let recorded = RenderOptions {
        integrator: integrator(args.integrator, args.samples_per_segment)?,
        spp: args.spp,
        seed: args.seed,
        threads: args.threads,
        ..RenderOptions::default()
    };
    args.files.check()?;
    let stream = args.queries.as_deref().map(QueryStream::read).transpose()?;
    let (name, scene) = load(args.scene.as_deref(), &args.defines)?;
    for warning in &scene.warnings {
        say(format_args!("warning: {warning}"));
    }

    let reporter = Reporter::new(args.files.quiet)?;
    let world = World::new(&scene);
    let result = stream
        .map_or_else(|| record_queries(&scene, &world, &recorded, args.max_queries, &reporter), Ok)
        .and_then(|stream| {
            if let Some(path) = &args.queries {
                stream.check_scene(path, &scene, &world)?;
            }
            replay(&scene, &world, &stream, &options, &reporter).map(|replay| (stream, replay))
        });
    reporter.finish();
    let (stream, replay) = result?;
    if reporter.interrupted() {
        return Err(Failure::Interrupted);
    }
    if let Some(folder) = &args.export {
        export(folder, &world, &stream)?;
    }
    let page = page(&name, &scene, &stream.origin, &replay);
    args.files.write(&page, &figures(&name, &stream.origin, &replay), &Provenance::new(stream.origin.seed))
}

fn export(folder: &Path, world: &World, stream: &QueryStream) -> Result<(), Failure> {
    fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))
        .map_err(Failure::Work)?;
    let triangles = folder.join("triangles.bin");
    write_triangles(&triangles, &world.triangles)
        .map_err(|e| Failure::Work(anyhow!(e).context(format!("cannot write {}", triangles.display()))))?;
    write_stream(&folder.join("queries.bin"), stream)
}

/// Name of an integrator with its setting.
pub(super) fn integrator_name(samples_per_segment: Option<u32>) -> String {
    samples_per_segment.map_or_else(|| "volpath".to_owned(), |n| format!("raymarch {n}"))
}

fn page(name: &str, scene: &Scene, origin: &StreamOrigin, r: &Replay) -> Page {
    let lead = vec![format!(
        "{} visibility queries of {} with {} samples per pixel in {name} ({} triangles, {} emitters), from {} of {} paths. \
         Each answer of each method was compared with the hierarchy's; all agree.",
        r.queries,
        integrator_name(origin.samples_per_segment),
        origin.spp,
        r.triangles,
        scene.emitters.len(),
        origin.paths_recorded,
        origin.paths
    )];
    Page {
        title: format!("Visibility queries in {name}"),
        lead,
        sections: vec![hierarchy_section(r), methods_section(r), verdict_section(r)],
    }
}

fn spread(t: Timing) -> String {
    format!("{} to {}", short(t.min), short(t.max))
}

fn hierarchy_section(r: &Replay) -> Section {
    let row = |name: &str, queries: usize, t: Timing| {
        let cells = [name.to_owned(), queries.to_string(), short(t.median), spread(t)];
        Row::new(cells.map(Cell::from).to_vec())
    };
    let mut rows = vec![row("hierarchy, spatial", r.spatial, r.hierarchy.t_spatial)];
    rows.extend(r.hierarchy.t_superficial.map(|t| row("hierarchy, superficial", r.queries - r.spatial, t)));
    rows.push(row("loop without a query", r.spatial, r.t_loop));
    rows.push(row("hierarchy, spatial, with a timer around each query", r.spatial, r.timer.t_spatial));
    rows.push(row("the same, as the timers say", r.spatial, r.timer.said));
    Section {
        heading: "The hierarchy alone".to_owned(),
        paragraphs: vec![format!(
            "p_sp = {}: so many of the queries are spatial. {} of the spatial ones are unoccluded. Medians of {} passes on one thread. \
             The loop is part of all other times.",
            percent(r.p_spatial),
            percent(r.unoccluded_of_spatial),
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
    let columns = vec![
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
        "of all",
        "pays from",
    ];
    let mut size = None;
    let rows = r
        .methods
        .iter()
        .map(|m| {
            let first = size.replace(m.voxel_size).is_some_and(|before| before != m.voxel_size);
            Row { cells: method_cells(m), first }
        })
        .collect();
    Section {
        heading: "Methods".to_owned(),
        paragraphs: vec![
            "t_acc is the attempt of a proof for a spatial query, t_eff the whole query with the fallback, speed-up = t_query / t_eff: below 1 \
             the method loses against the hierarchy alone. \"t_acc by 6.3.2\" is t_eff - (1 - p_acc|sp) t_query, as the thesis computes t_acc: with \
             the time that a fallback waits for its proof. \"Of all\" counts superficial queries, too, which no method can prove. \"Pays from\" is the number \
             of spatial queries that outweighs T_build."
                .to_owned(),
        ],
        plots: plots(r),
        tables: vec![Table { caption: String::new(), columns, rows }],
        ..Section::default()
    }
}

fn method_cells(m: &MethodReplay) -> Vec<Cell> {
    vec![
        m.method.into(),
        m.voxel_size.to_string().into(),
        grid(m.grid).into(),
        format!("{} MiB", short(m.bytes as f64 / f64::from(1 << 20))).into(),
        seconds(m.t_build).into(),
        percent(m.p_accelerated_given_spatial).into(),
        percent(m.unknown_fraction).into(),
        short(m.t_hierarchy.median).into(),
        short(m.t_acc.median).into(),
        Cell::from(percent(m.threshold)).marked(m.p_accelerated_given_spatial > m.threshold),
        short(m.t_effective.median).into(),
        short(m.t_acc_derived).into(),
        Cell::from(format!("{:.2}", m.speed_up)).marked(m.speed_up > 1.0),
        Cell::from(format!("{:.2}", m.speed_up_all)).marked(m.speed_up_all > 1.0),
        m.pays_from.map_or_else(|| "never".to_owned(), |n| format!("{n:.1e}")).into(),
    ]
}

/// Times against the number of voxels, where there is more than one size.
fn plots(r: &Replay) -> Vec<Plot> {
    let plot = |title: &str, y_label: &str, time: fn(&MethodReplay) -> f64| {
        let mut series: Vec<Series> = Vec::new();
        for m in &r.methods {
            let voxels = m.grid.iter().map(|&n| f64::from(n)).product();
            let point = (voxels, time(m));
            match series.iter_mut().find(|s| s.name == m.method) {
                Some(s) => s.points.push(point),
                None => series.push(Series { name: m.method.to_owned(), points: vec![point], ..style(m.method) }),
            }
        }
        let xs: Vec<f64> = series.iter().flat_map(|s| s.points.iter().map(|p| p.0)).collect();
        let t = r.hierarchy.t_spatial.median;
        series.push(Series {
            name: "hierarchy alone".to_owned(),
            points: xs.iter().map(|&x| (x, t)).collect(),
            ..style("none")
        });
        Plot::logarithmic(title.to_owned(), "voxels", y_label, series)
    };
    let effective = plot("A spatial query with its fallback", "t_eff, ns", |m| m.t_effective.median);
    let acc = plot("The attempt of a proof", "t_acc, ns", |m| m.t_acc.median);
    [effective, acc].into_iter().flatten().collect()
}

/// A colour for the field, a dash for the neighbourhood.
pub(super) fn style(method: &str) -> Series {
    let (field, kind) = method.split_once('-').unwrap_or((method, ""));
    let colour = ["ndf", "amr", "dsz", "dual"].iter().position(|f| *f == field).unwrap_or(4);
    let dash = ["", "sn", "xsn"].iter().position(|k| *k == kind).unwrap_or(0);
    Series { name: String::new(), points: vec![], colour, dash }
}

/// In words: who wins, who loses.
fn verdict_section(r: &Replay) -> Section {
    let name = |m: &MethodReplay| format!("{} at {} ({:.2})", m.method, m.voxel_size, m.speed_up);
    let named = |losers: bool| {
        let chosen: Vec<String> = r.methods.iter().filter(|m| (m.speed_up <= 1.0) == losers).map(name).collect();
        if chosen.is_empty() { "none".to_owned() } else { chosen.join(", ") }
    };
    let contradicted: Vec<String> = r
        .methods
        .iter()
        .filter(|m| (m.p_accelerated_given_spatial > m.threshold) != (m.speed_up > 1.0))
        .map(name)
        .collect();
    let criterion = if contradicted.is_empty() {
        "Criterion 2.8, p_acc|sp > t_acc / t_query, tells both apart.".to_owned()
    } else {
        format!("Criterion 2.8, p_acc|sp > t_acc / t_query, says otherwise of: {}.", contradicted.join(", "))
    };
    Section {
        heading: "Verdict".to_owned(),
        paragraphs: vec![
            format!("Faster than the hierarchy alone (speed-up of a spatial query): {}.", named(false)),
            format!("Not faster: {}.", named(true)),
            criterion,
        ],
        ..Section::default()
    }
}

fn figures(name: &str, origin: &StreamOrigin, r: &Replay) -> Vec<Figure> {
    let about = |method, voxel_size| About {
        table: "queries",
        scene: name.to_owned(),
        integrator: integrator_name(origin.samples_per_segment),
        method,
        voxel_size,
    };
    let stream = about("none", None);
    let mut all = vec![
        stream.figure("queries", "", r.queries as f64, None),
        stream.figure("p_sp", "", r.p_spatial, None),
        stream.figure("unoccluded of spatial", "", r.unoccluded_of_spatial, None),
        stream.figure("t_loop", "ns", r.t_loop.median, None),
        stream.figure("t_query spatial", "ns", r.hierarchy.t_spatial.median, None),
        stream.figure("t_query spatial with timer", "ns", r.timer.t_spatial.median, None),
        stream.figure("t_query spatial said by timer", "ns", r.timer.said.median, None),
        stream.figure("t_query", "ns", r.hierarchy.t_query, None),
    ];
    all.extend(r.hierarchy.t_superficial.map(|t| stream.figure("t_query superficial", "ns", t.median, None)));
    all.extend(r.estimated_total.map(|n| stream.figure("N", "", n, None)));
    for m in &r.methods {
        let about = about(m.method, Some(m.voxel_size));
        all.extend([
            about.figure("bytes", "B", m.bytes as f64, None),
            about.figure("T_build", "s", m.t_build, None),
            about.figure("p_acc|sp", "", m.p_accelerated_given_spatial, None),
            about.figure("u", "", m.unknown_fraction, None),
            about.figure("t_query spatial", "ns", m.t_hierarchy.median, None),
            about.figure("t_acc", "ns", m.t_acc.median, None),
            about.figure("t_acc least", "ns", m.t_acc.min, None),
            about.figure("t_acc most", "ns", m.t_acc.max, None),
            about.figure("t_eff", "ns", m.t_effective.median, None),
            about.figure("t_acc by 6.3.2", "ns", m.t_acc_derived, None),
            about.figure("t_eff least", "ns", m.t_effective.min, None),
            about.figure("t_eff most", "ns", m.t_effective.max, None),
            about.figure("speed-up", "", m.speed_up, None),
            about.figure("speed-up of all", "", m.speed_up_all, None),
        ]);
        all.extend(m.pays_from.map(|n| about.figure("pays from", "", n, None)));
    }
    all
}
