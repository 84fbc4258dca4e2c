//! Streams and replays: determinism, agreement with the render, and that a wrong answer is found.

use std::path::Path;

use glam::DVec3;

use super::{replay::Check, *};
use crate::{
    Acceleration, Answer, FieldKind, IntegratorKind, Method, NeighbourhoodKind, Progress, Proofs, ProofsVisitor,
    QueryKind, RenderError, RenderOptions, World, render,
    scene::{LoadOptions, Scene, builtin},
};

struct Quiet;

impl Progress for Quiet {
    fn phase(&self, _: &str) {}
    fn work_total(&self, _: u64) {}
    fn work_done(&self, _: u64) {}
    fn cancelled(&self) -> bool {
        false
    }
}

fn scene(name: &str, size: &str) -> (Scene, World) {
    let defines = [("width", size), ("height", size)].map(|(n, v)| (n.to_owned(), v.to_owned())).to_vec();
    let scene = Scene::from_source(&builtin(name).unwrap(), &LoadOptions { defines }).unwrap();
    let world = World::new(&scene);
    (scene, world)
}

fn options(integrator: IntegratorKind, threads: usize) -> RenderOptions {
    RenderOptions { method: Method::None, integrator, spp: Some(3), threads: Some(threads), ..RenderOptions::default() }
}

const RAYMARCH: IntegratorKind = IntegratorKind::Raymarch { samples_per_segment: 5 };

#[test]
fn all_paths_ask_what_the_render_asks() {
    let (scene, world) = scene("cbox_vol3", "21");
    for integrator in [IntegratorKind::Volpath, RAYMARCH] {
        let options = options(integrator, 2);
        let stream = record_queries(&scene, &world, &options, u64::MAX, &Quiet).unwrap();
        let statistics = render(&scene, &options, &Quiet).unwrap().statistics;
        assert_eq!(stream.queries.len() as u64, statistics.queries);
        assert_eq!(stream.spatial() as u64, statistics.spatial);
        assert_eq!((stream.origin.paths, stream.origin.paths_recorded), (3 * 21 * 21, 3 * 21 * 21));
        assert_eq!(stream.estimated_total(), Some(statistics.queries as f64));
        assert!(stream.unoccluded.contains(&true) && stream.unoccluded.contains(&false));
        assert!(stream.queries.iter().any(|q| q.emitter == 1));
    }
}

/// A stream with a bound: some of the whole paths of the unbounded one, in its order, the same for any number of threads.
#[test]
fn a_bounded_stream_is_a_deterministic_part() {
    let (scene, world) = scene("cbox_vol2", "40");
    for integrator in [IntegratorKind::Volpath, RAYMARCH] {
        let record = |n, threads| record_queries(&scene, &world, &options(integrator, threads), n, &Quiet).unwrap();
        let all = record(u64::MAX, 2);
        let mut before = 0;
        for n in [1_u64, 100, 2000, 10_000] {
            let part = record(n, 1);
            assert_eq!(part, record(n, 3));
            assert!(part.queries.len() as u64 <= n && part.queries.len() >= before);
            before = part.queries.len();
            // Fewer than a path's worth may be missing.
            assert!(part.queries.len() as u64 + 60 > n.min(all.queries.len() as u64), "{n}: {}", part.queries.len());
            let mut rest = all.queries.iter().zip(&all.unoccluded);
            for pair in part.queries.iter().zip(&part.unoccluded) {
                assert!(rest.any(|other| other == pair), "{n}: a query out of order, or none of the render's");
            }
        }
        // The smaller stream's 5 σ are far below this: paths are alike, and there are some thousand queries.
        let (part, total) = (record(4000, 2), all.queries.len() as f64);
        assert!(
            (part.estimated_total().unwrap() / total - 1.0).abs() < 0.25,
            "{:?} of {total}",
            part.estimated_total()
        );
    }
}

#[test]
fn a_file_is_read_as_it_was_written() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.vdfq");
    let (scene, world) = scene("cbox_vol3", "8");
    let mut stream = record_queries(&scene, &world, &options(RAYMARCH, 1), 500, &Quiet).unwrap();
    stream.queries[0].from.x = -0.0;
    stream.queries[1].to.y = f64::MIN_POSITIVE / 4.0;
    for stream in [&stream, &QueryStream { queries: vec![], unoccluded: vec![], ..stream.clone() }] {
        stream.write(&path).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().len(), 80 + 56 * stream.queries.len() as u64);
        let read = QueryStream::read(&path).unwrap();
        assert_eq!(&read, stream);
        let bits = |s: &QueryStream| s.queries.iter().map(|q| q.from.to_array().map(f64::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&read), bits(stream));
        read.check_scene(&path, &scene, &world).unwrap();
    }
    let (other, other_world) = self::scene("cbox_vol2", "8");
    let error = stream.check_scene(&path, &other, &other_world).unwrap_err().to_string();
    assert!(error.contains("a.vdfq: recorded in another scene, of 30 triangles and 2 emitters"), "{error}");
}

#[test]
fn a_damaged_file_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.vdfq");
    let (scene, world) = scene("cbox_vol2", "8");
    let stream = record_queries(&scene, &world, &options(RAYMARCH, 1), 50, &Quiet).unwrap();
    stream.write(&path).unwrap();
    let good = std::fs::read(&path).unwrap();
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        QueryStream::read(&path).map_err(|e| e.to_string())
    };
    assert_eq!(read(&good).unwrap(), stream);
    let refused = |bytes: &[u8], part: &str| {
        let error = read(bytes).unwrap_err();
        assert!(error.contains("a.vdfq: ") && error.contains(part), "{error}");
    };
    for length in [0, 7, 79, 80, 100, good.len() - 1] {
        refused(&good[..length], if length < 80 { "shorter than" } else { "bytes long, which does not fit" });
    }
    refused(&[&good[..], &[0]].concat(), "does not fit");
    let changed = |at: usize, bytes: &[u8]| {
        let mut changed = good.clone();
        changed[at..at + bytes.len()].copy_from_slice(bytes);
        changed
    };
    refused(&changed(0, b"x"), "not a file of queries");
    refused(&changed(8, &[2]), "version 2 of the format");
    refused(&changed(16, &u64::MAX.to_le_bytes()), "does not fit 18446744073709551615 queries");
    refused(&changed(80, &f64::NAN.to_le_bytes()), "query 0 makes no sense");
    refused(&changed(80 + 24, &f64::INFINITY.to_le_bytes()), "query 0 makes no sense");
    refused(&changed(80 + 56 + 48, &[1]), "query 1 makes no sense");
    refused(&changed(80 + 56 + 52, &[5]), "query 1 makes no sense");
    refused(&changed(80 + 56 + 52, &[8]), "query 1 makes no sense");
    // A changed bit that makes sense.
    refused(&changed(80, &[good[80] ^ 1]), "checksum");
    refused(&changed(80 + 52, &[good[80 + 52] ^ 2]), "checksum");
    let missing = QueryStream::read(Path::new("no/such.vdfq")).unwrap_err().to_string();
    assert!(missing.starts_with("no/such.vdfq: No such file"), "{missing}");
}

#[test]
fn a_replay_measures_all_methods() {
    let (scene, world) = scene("cbox_vol2", "12");
    let stream = record_queries(&scene, &world, &options(RAYMARCH, 2), 5000, &Quiet).unwrap();
    let options =
        ReplayOptions { voxel_sizes: vec![16.0, 40.0], passes: 2, threads: Some(2), ..ReplayOptions::default() };
    let r = replay(&scene, &world, &stream, &options, &Quiet).unwrap();
    assert_eq!((r.queries, r.spatial), (stream.queries.len(), stream.spatial()));
    assert_eq!(r.methods.len(), 2 * (Method::ALL.len() - 1));
    for t in [r.t_loop, r.hierarchy.t_spatial, r.timer.t_spatial, r.timer.said, r.hierarchy.t_superficial.unwrap()] {
        assert!(0.0 < t.min && t.min <= t.median && t.median <= t.max, "{t:?}");
    }
    for m in &r.methods {
        assert_eq!(m.p_accelerated_given_spatial, m.proved as f64 / r.spatial as f64);
        assert_eq!(m.unknown_fraction, 1.0 - m.p_accelerated_given_spatial);
        assert!(m.p_accelerated_given_spatial <= r.unoccluded_of_spatial, "{} proves more than there is", m.method);
        assert!(m.proved > 0 && m.t_acc.median > 0.0 && m.t_effective.median > 0.0 && m.bytes > 0 && m.t_build > 0.0);
        assert_eq!(m.speed_up, m.t_hierarchy.median / m.t_effective.median);
        assert_eq!(m.pays_from.is_some(), m.speed_up > 1.0);
    }
    let proved = |method: &str, size| {
        r.methods.iter().find(|m| m.method == method && m.voxel_size == size).map(|m| m.proved).unwrap()
    };
    assert!(proved("amr", 16.0) == proved("amr-sn", 16.0) && proved("amr", 16.0) <= proved("amr-xsn", 16.0));
    assert!(proved("amr", 16.0) > proved("ndf", 16.0));

    let fails = |options: ReplayOptions, part: &str| {
        let error = replay(&scene, &world, &stream, &options, &Quiet).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    };
    fails(ReplayOptions { passes: 0, ..options.clone() }, "--passes must be at least 1");
    fails(ReplayOptions { methods: vec![Method::None], ..options.clone() }, "--methods must name a method");
    fails(ReplayOptions { voxel_sizes: vec![8.0, -1.0], ..options.clone() }, "--voxel must be a positive");
    let superficial = QueryStream {
        queries: stream.queries.iter().filter(|q| q.kind != QueryKind::Spatial).copied().collect(),
        unoccluded: stream
            .queries
            .iter()
            .zip(&stream.unoccluded)
            .filter(|(q, _)| q.kind != QueryKind::Spatial)
            .map(|(_, u)| *u)
            .collect(),
        ..stream.clone()
    };
    let error = replay(&scene, &world, &superficial, &options, &Quiet).unwrap_err();
    assert!(matches!(error, RenderError::NoQueries { .. }), "{error}");
}

/// A method that lies about one query only.
struct Liar<'a, P> {
    honest: &'a P,
    about: DVec3,
}

impl<P: Proofs> Proofs for Liar<'_, P> {
    fn answer(&self, emitter: usize, from: DVec3, to: DVec3) -> Answer {
        if from == self.about { Answer::Unoccluded } else { self.honest.answer(emitter, from, to) }
    }

    fn answer_between(&self, a: DVec3, b: DVec3) -> Answer {
        self.honest.answer_between(a, b)
    }
}

struct CheckLiar<'a> {
    world: &'a World,
    stream: &'a QueryStream,
    about: usize,
}

impl ProofsVisitor for CheckLiar<'_> {
    type Output = Result<u64, usize>;

    fn visit<P: Proofs>(self, proofs: &P) -> Self::Output {
        let liar = Liar { honest: proofs, about: self.stream.queries[self.about].from };
        Check { bvh: &self.world.bvh, queries: &self.stream.queries, truth: &self.stream.unoccluded }.visit(&liar)
    }
}

#[test]
fn every_single_wrong_answer_is_found() {
    let (scene, world) = scene("cbox_vol2", "12");
    let stream = record_queries(&scene, &world, &options(RAYMARCH, 2), 9000, &Quiet).unwrap();
    let method = Method::Field(FieldKind::Amr, NeighbourhoodKind::Safe);
    let (acceleration, _) =
        Acceleration::build(method, &world.triangles, world.bounds, &scene.light_shapes(), 16.0, 1 << 20).unwrap();
    let classes = |spatial, unoccluded| {
        let queries = stream.queries.iter().zip(&stream.unoccluded).enumerate();
        queries.filter(move |(_, (q, u))| (q.kind == QueryKind::Spatial, **u) == (spatial, unoccluded)).map(|(i, _)| i)
    };
    let lies: Vec<usize> = classes(true, false).step_by(50).chain(classes(true, false).next_back()).collect();
    assert!(lies.len() > 3 && lies.last() > Some(&4096), "beyond the first block: {lies:?}");
    for about in lies {
        assert_eq!(acceleration.accept(CheckLiar { world: &world, stream: &stream, about }), Err(about));
    }
    // What is true anyway is no lie, and of superficial queries no proof is asked.
    for about in [classes(true, true).next(), classes(false, false).next()].into_iter().flatten() {
        assert!(acceleration.accept(CheckLiar { world: &world, stream: &stream, about }).is_ok());
    }

    // A stream whose answers are not those of the hierarchy.
    let mut forged = stream.clone();
    forged.unoccluded[17] ^= true;
    let options = ReplayOptions { methods: vec![method], passes: 1, ..ReplayOptions::default() };
    match replay(&scene, &world, &forged, &options, &Quiet) {
        Err(RenderError::WrongAnswer(w)) => {
            assert_eq!(
                (w.method, w.index, w.query, w.unoccluded),
                ("none", 17, stream.queries[17], stream.unoccluded[17])
            );
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn triangles_are_written_as_documented() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("triangles.bin");
    let (scene, world) = scene("cbox_vol2", "4");
    write_triangles(&path, &world.triangles).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let u32_at = |i: usize| u32::from_le_bytes(bytes[i..i + 4].try_into().unwrap());
    assert_eq!((&bytes[..8], u32_at(8), u32_at(12)), (&b"VDFTRIAN"[..], 1, 32));
    assert_eq!(
        (u32_at(16) as usize, u32_at(20), bytes.len()),
        (world.triangles.len(), 0, 32 + 36 * world.triangles.len())
    );
    assert_eq!(u32_at(24), crc32fast::hash(&bytes[32..]));
    let stream = record_queries(&scene, &world, &options(RAYMARCH, 1), 10, &Quiet).unwrap();
    assert_eq!(stream.origin.triangles_crc32, u32_at(24));
    let last = world.triangles.last().unwrap().vertices[2];
    assert_eq!(u32_at(bytes.len() - 4), last.z.to_bits());
}
