//! `vdf report thesis`: chapter 6 of the thesis, measured again.
//!
//! Where this departs from the thesis: `T_query` is N times the time of a query in a replay, not the sum of a timer in the loop, which distorts both (6.2.2).
//! Flights are not proved (`segment_first` is off), so that proofs only ever save visibility queries, as there.

mod data;
mod measure;
mod tables;

use anyhow::anyhow;
use vdf_render::Progress as _;

use self::{data::ThesisData, measure::Bench};
use super::{
    bench::{MOST_THREADS, processors},
    methods,
    page::Page,
    provenance::Provenance,
};
use crate::{args::ReportThesisArgs, failure::Failure, progress::Reporter};

/// Side of the thesis's images in pixels. It is not printed there; its numbers of queries fit this.
const SIDE: u32 = 512;

/// A scene of chapter 6, and the voxel sizes of its tables.
#[derive(Clone, Copy, Debug)]
struct ThesisScene {
    name: &'static str,
    sizes: [f64; 3],
}

/// The scenes of Tables 6.4 to 6.11.
const SCENES: [ThesisScene; 4] = [
    ThesisScene { name: "cbox_vol6", sizes: [4.0, 8.0, 16.0] },
    ThesisScene { name: "cbox_vol4", sizes: [4.0, 8.0, 16.0] },
    ThesisScene { name: "san-miguel", sizes: [0.25, 0.5, 1.0] },
    ThesisScene { name: "scape", sizes: [0.25, 0.5, 1.0] },
];

/// Samples per path segment in these tables; `None` is the path tracer.
const SETTINGS: [Option<u32>; 4] = [Some(1), Some(7), Some(49), None];

/// Samples per pixel in these tables.
const SPP: u32 = 4;

pub(crate) fn run(args: &ReportThesisArgs) -> Result<(), Failure> {
    let side = args.size.unwrap_or(if args.quick { 32 } else { SIDE });
    if !(1..=4096).contains(&side) {
        return Err(Failure::Usage(anyhow!("--size must be from 1 to 4096, not {side}")));
    }
    let methods = methods(&args.methods);
    if methods.is_empty() {
        return Err(Failure::Usage(anyhow!("--methods must name a method that proves something, such as amr-sn")));
    }
    args.files.check()?;
    let thesis = ThesisData::load().map_err(Failure::Work)?;

    let threads = args.threads.unwrap_or_else(processors);
    if !(1..=MOST_THREADS).contains(&threads) {
        return Err(Failure::Usage(anyhow!("--threads must be from 1 to {MOST_THREADS}, not {threads}")));
    }

    let reporter = Reporter::new(args.files.quiet)?;
    let bench = Bench { reporter: &reporter, methods: &methods, side, quick: args.quick, seed: args.seed, threads };
    let named = |name: &str| args.scenes.iter().any(|s| s == name);
    let scenes: Vec<ThesisScene> = SCENES.into_iter().filter(|s| named(s.name)).collect();
    let repeated = thesis.repeated_settings().into_iter().filter(|s| named(&s.scene)).collect::<Vec<_>>();
    let measured = thesis.measured.iter().filter(|m| named(&m.scene)).collect::<Vec<_>>();
    reporter.work_total(bench.work(scenes.len(), repeated.len(), measured.len()));

    let measure = || -> Result<_, Failure> {
        let scenes = scenes.iter().map(|s| bench.scene(s)).collect::<Result<Vec<_>, Failure>>()?;
        let repeated = repeated.into_iter().map(|s| bench.repeated(s)).collect::<Result<Vec<_>, Failure>>()?;
        let measured = measured.into_iter().map(|m| bench.measured(m)).collect::<Result<Vec<_>, Failure>>()?;
        Ok((scenes, repeated, measured))
    };
    let result = measure();
    reporter.finish();
    let (scenes, repeated, measured) = result?;
    if reporter.interrupted() {
        return Err(Failure::Interrupted);
    }

    let tables = tables::Tables { thesis: &thesis, threads, scenes: &scenes, repeated: &repeated, measured: &measured };
    let (sections, figures) = tables.all();
    let small = if side == SIDE {
        String::new()
    } else {
        format!(
            " Images are {side} × {side} pixels; N, T_render and T_query are scaled by {:.0} to {SIDE} × {SIDE}, T_build is not.",
            bench.scale()
        )
    };
    let page = Page {
        title: "Chapter 6 of the thesis, measured again".to_owned(),
        lead: vec![
            format!(
                "Each figure has that of the thesis [Houska2013] beside or below it, where there is one: one thread of an Intel Core i7-3632QM in \
                 Mitsuba 0.x then, one thread of the machine named below now, unless a column says otherwise.{small}"
            ),
            "All images were compared bit by bit with those of the hierarchy alone, and every replayed answer with the hierarchy's; all agree. The geometry of \
             san-miguel and scape is generated, not the thesis's; the places of lights and media are not printed there."
                .to_owned(),
        ],
        sections,
    };
    args.files.write(&page, &figures, &Provenance::new(args.seed))
}
