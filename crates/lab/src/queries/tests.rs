//! Streams and replays: determinism, agreement with the render, and that a wrong answer is found.

use std::path::Path;

use vdf_render::{GridExtent, Integrator, PrepareOptions, PreparedScene, Quiet, RenderOptions};
use vdf_scene::{Emitter, LoadOptions, Scene};
use vdf_scenes::builtin;
use vdf_visibility::{Method, QueryKind};

use super::{replay::check, *};
use crate::LabError;

fn scene(name: &str, size: &str) -> Scene {
    let defines = [("width", size), ("height", size)].map(|(n, v)| (n.to_owned(), v.to_owned())).to_vec();
    Scene::from_source(&builtin(name).unwrap(), &LoadOptions { defines, ..LoadOptions::default() }).unwrap()
}

fn prepared(scene: Scene, method: Method) -> PreparedScene {
    let options = PrepareOptions { voxel_size: Some(16.0), ..PrepareOptions::with_method(method) };
    PreparedScene::new(scene, &options, &Quiet).unwrap()
}

fn plain(name: &str, size: &str) -> PreparedScene {
    prepared(scene(name, size), Method::NONE)
}

fn options(integrator: Integrator, threads: usize) -> RenderOptions {
    RenderOptions { integrator, spp: Some(3), threads: Some(threads), ..RenderOptions::thesis() }
}

const RAYMARCH: Integrator = Integrator::raymarch(5);

#[test]
fn all_paths_ask_what_the_render_asks() {
    let prepared = plain("cbox_vol3", "21");
    for integrator in [Integrator::Volpath, RAYMARCH] {
        let options = options(integrator, 2);
        let stream = record_queries(&prepared, &options, u64::MAX, &Quiet).unwrap();
        let statistics = prepared.render(&options, &Quiet).unwrap().statistics;
        assert_eq!(stream.queries.len() as u64, statistics.queries);
        assert_eq!(stream.spatial() as u64, statistics.spatial);
        assert_eq!((stream.origin.paths, stream.origin.paths_recorded), (3 * 21 * 21, 3 * 21 * 21));
        assert_eq!(stream.estimated_total(), Some(statistics.queries as f64));
        assert!(stream.unoccluded.contains(&true) && stream.unoccluded.contains(&false));
        assert!(stream.queries.iter().any(|q| q.emitter == 1));
    }
}

/// A stream with a bound: some of the whole paths of the unbounded one, in its order, the same for any number of
/// threads.
#[test]
fn a_bounded_stream_is_a_deterministic_part() {
    let prepared = plain("cbox_vol2", "40");
    for integrator in [Integrator::Volpath, RAYMARCH] {
        let record = |n, threads| record_queries(&prepared, &options(integrator, threads), n, &Quiet).unwrap();
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
    let prepared = plain("cbox_vol3", "8");
    let mut stream = record_queries(&prepared, &options(RAYMARCH, 1), 500, &Quiet).unwrap();
    stream.queries[0].from.x = -0.0;
    stream.queries[1].to.y = f64::MIN_POSITIVE / 4.0;
    for stream in [&stream, &QueryStream { queries: vec![], unoccluded: vec![], ..stream.clone() }] {
        stream.write(&path).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().len(), 80 + 56 * stream.queries.len() as u64);
        let read = QueryStream::read(&path).unwrap();
        assert_eq!(&read, stream);
        let bits = |s: &QueryStream| s.queries.iter().map(|q| q.from.to_array().map(f64::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&read), bits(stream));
        read.check_scene(&path, &prepared).unwrap();
    }
    let refused = |other: &PreparedScene, part: &str| {
        let error = stream.check_scene(&path, other).unwrap_err().to_string();
        assert!(error.contains("a.vdfq: recorded in") && error.contains(part), "{error}");
    };
    refused(&plain("cbox_vol2", "8"), "another scene, of 30 triangles and 2 emitters");
    // The queries of a light that has moved go to another place: that is no wrong answer, but another scene.
    let mut moved = scene("cbox_vol3", "8");
    if let Emitter::Point { position, .. } = &mut moved.emitters[0] {
        position.x += 1.0;
    }
    refused(&self::prepared(moved, Method::NONE), "other lights, media, materials or camera");
    let mut bent = scene("cbox_vol3", "8");
    bent.surfaces[0].triangles[0].vertices[0].x += 1.0;
    refused(&self::prepared(bent, Method::NONE), "whose triangles lie elsewhere");
}

#[test]
fn a_damaged_file_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.vdfq");
    let prepared = plain("cbox_vol2", "8");
    let stream = record_queries(&prepared, &options(RAYMARCH, 1), 50, &Quiet).unwrap();
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
    refused(&changed(8, &[9]), "version 9 of the format");
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
    let prepared = plain("cbox_vol2", "12");
    let stream = record_queries(&prepared, &options(RAYMARCH, 2), 5000, &Quiet).unwrap();
    let options = ReplayOptions {
        voxel_sizes: vec![16.0, 40.0],
        grid: GridExtent::Scene,
        passes: 2,
        threads: Some(2),
        ..ReplayOptions::default()
    };
    let r = replay(&prepared, &stream, &options, &Quiet).unwrap();
    let classes: Vec<_> = r.hierarchy.classes.iter().map(|c| (c.kind, c.queries)).collect();
    let superficial = stream.queries.len() - stream.spatial();
    assert_eq!(classes, [(QueryKind::Spatial, stream.spatial()), (QueryKind::Superficial, superficial)]);
    assert_eq!((r.queries, r.p_spatial), (stream.queries.len(), stream.spatial() as f64 / stream.queries.len() as f64));
    assert_eq!(r.methods.len(), 2 * (Method::proving().count()));
    // In the order asked for, though they are measured field by field.
    let order: Vec<_> = r.methods.iter().map(|m| (m.method, m.voxel_size)).collect();
    let expected = [16.0, 40.0].into_iter().flat_map(|size| Method::proving().map(move |m| (m.name(), size)));
    assert_eq!(order, expected.collect::<Vec<_>>());
    let times = r.hierarchy.classes.iter().map(|c| c.time);
    for t in times.chain([r.t_loop, r.timer.time, r.timer.said]) {
        assert!(0.0 < t.min && t.min <= t.median && t.median <= t.max, "{t:?}");
    }
    let spatial = r.hierarchy.class(QueryKind::Spatial).unwrap();
    let other = r.hierarchy.t_other();
    // The mean over the other classes: a product and a quotient, each rounded, where there is only one.
    let only = r.hierarchy.class(QueryKind::Superficial).unwrap().time.median;
    assert!((other / only - 1.0).abs() <= 2.0 * f64::EPSILON, "{other} {only}");
    let mixed = r.p_spatial * r.hierarchy.t_spatial() + (1.0 - r.p_spatial) * other;
    assert!((r.hierarchy.t_query / mixed - 1.0).abs() < 1e-12);
    for m in &r.methods {
        let buffer = m.method == "lb";
        assert!(m.bytes > 0 && m.t_build > 0.0 && m.proofs.len() == 1 + usize::from(buffer));
        let p = m.spatial().unwrap();
        assert_eq!(p.p_accelerated, p.proved as f64 / spatial.queries as f64);
        assert_eq!(p.unknown_fraction, 1.0 - p.p_accelerated);
        assert!(p.proved > 0 && (buffer || p.proved <= spatial.unoccluded), "{} proves more than there is", m.method);
        assert!(p.t_batch.median > 0.0 && p.t_batch_16.median > 0.0 && m.speed_up_batches > 0.0);
        assert_eq!(p.look_ups.is_some(), buffer, "{}", m.method);
        if let Some(l) = p.look_ups {
            assert_eq!(l.queries, spatial.queries);
            assert!((l.lit + l.occluded + l.open() - 1.0).abs() < 1e-12 && l.mean_tests >= 1.0, "{l:?}");
            assert!((l.hierarchy - p.unknown_fraction).abs() < 1e-12, "{l:?}");
        }
        assert!(p.t_acc.median > 0.0 && p.t_effective.median > 0.0);
        assert_eq!(p.speed_up, p.t_hierarchy.median / p.t_effective.median);
        assert_eq!(p.pays_from.is_some(), p.speed_up > 1.0);
    }
    let proved = |method: &str, size| {
        let found = r.methods.iter().find(|m| m.method == method && m.voxel_size == size);
        found.and_then(MethodReplay::spatial).map(|p| p.proved).unwrap()
    };
    let [field, safe, extended] = ["amr", "amr-sn", "amr-xsn"].map(|method| proved(method, 16.0));
    assert!(field == safe && field <= extended, "{field} {safe} {extended}");
    assert!(proved("amr", 16.0) > proved("ndf", 16.0));

    let fails = |options: ReplayOptions, part: &str| {
        let error = replay(&prepared, &stream, &options, &Quiet).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    };
    fails(ReplayOptions { passes: 0, ..options.clone() }, "passes must be at least 1");
    fails(ReplayOptions { methods: vec![Method::NONE], ..options.clone() }, "methods must name a method");
    fails(ReplayOptions { voxel_sizes: vec![8.0, -1.0], ..options.clone() }, "voxel must be a positive");
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
    let of_voxels = ReplayOptions { methods: Method::with_voxels().collect(), ..options.clone() };
    let error = replay(&prepared, &superficial, &of_voxels, &Quiet).unwrap_err();
    assert!(matches!(error, LabError::NoQueries { .. }), "{error}");
    assert!(replay(&prepared, &superficial, &options, &Quiet).is_ok(), "a light buffer proves them");
}

/// Fog that only an area light lights.
pub(crate) fn lamp() -> Scene {
    let text = r#"<scene version="3.0.0">
        <integrator type="volpath"/>
        <sensor type="perspective">
            <transform name="to_world"><lookat origin="0, 0, 8" target="0, 0, 0" up="0, 1, 0"/></transform>
            <film type="hdrfilm"><integer name="width" value="12"/><integer name="height" value="12"/></film>
            <ref id="fog"/>
        </sensor>
        <medium type="homogeneous" id="fog"><rgb name="albedo" value="0.9"/><float name="sigma_t" value="0.1"/></medium>
        <shape type="rectangle">
            <transform name="to_world"><rotate x="1" angle="90"/><translate y="3"/></transform>
            <emitter type="area"><rgb name="radiance" value="1"/></emitter>
        </shape>
        <shape type="rectangle">
            <transform name="to_world"><rotate x="1" angle="-90"/><scale value="2"/><translate y="-3"/></transform>
            <bsdf type="diffuse"/>
        </shape>
    </scene>"#;
    let file = vdf_scene::EmbeddedFile { path: "lamp.xml".into(), bytes: text.as_bytes().to_vec().into() };
    let source = vdf_scene::SceneSource::embedded(file, vec![]);
    Scene::from_source(&source, &LoadOptions::default()).unwrap()
}

/// Where only an area light lights fog no query is spatial, but the light's neighbourhood proves some, and a replay
/// says so.
#[test]
fn proofs_towards_area_lights_are_a_class_of_their_own() {
    let prepared = self::prepared(lamp(), Method::NONE);
    let options = options(RAYMARCH, 2);
    let stream = record_queries(&prepared, &options, 5000, &Quiet).unwrap();
    assert_eq!(stream.spatial(), 0);
    let methods = ["amr", "amr-xsn"].map(|m| m.parse().unwrap()).to_vec();
    let replay_options = ReplayOptions { methods, voxel_sizes: vec![0.5], passes: 2, ..ReplayOptions::default() };
    let r = replay(&prepared, &stream, &replay_options, &Quiet).unwrap();
    let class = r.hierarchy.class(QueryKind::OnLight).unwrap();
    assert!(class.queries > 100 && class.unoccluded > 0 && r.p_spatial == 0.0 && r.hierarchy.t_spatial() == 0.0);
    let of = |i: usize| r.methods[i].proofs_of(QueryKind::OnLight).unwrap();
    assert!(r.methods.iter().all(|m| m.spatial().is_none()));
    assert_eq!(of(0).proved, 0, "a field knows nothing of the light's surface");
    assert!(of(1).proved > 0 && of(1).proved <= class.unoccluded && of(1).t_acc.median > 0.0);
    // The render counts the same proofs.
    let options = RenderOptions { spp: Some(3), ..options };
    let with = PrepareOptions { voxel_size: Some(0.5), ..PrepareOptions::with_method(Method::best_with_voxels()) };
    let all = record_queries(&prepared, &options, u64::MAX, &Quiet).unwrap();
    let replayed = replay(&prepared, &all, &replay_options, &Quiet).unwrap();
    let statistics = prepared.with_options(&with, &Quiet).unwrap().render(&options, &Quiet).unwrap().statistics;
    let proved = replayed.methods[1].proofs_of(QueryKind::OnLight).unwrap().proved;
    assert_eq!(proved as u64, statistics.on_light_proved);
}

/// Of methods that were built, at most those of one field exist at a time: the peak is that of one field, not of all.
#[test]
fn fields_are_dropped_before_others_are_built() {
    // Told by the phases: each group of methods is replayed before the next is built.
    #[derive(Default)]
    struct Phases(std::sync::Mutex<Vec<String>>);
    impl vdf_render::Progress for Phases {
        fn phase(&self, name: &str) {
            self.0.lock().unwrap().push(name.to_owned());
        }
        fn work_total(&self, _: u64) {}
        fn work_done(&self, _: u64) {
            self.0.lock().unwrap().push("step".to_owned());
        }
        fn cancelled(&self) -> bool {
            false
        }
    }
    let prepared = plain("cbox_vol2", "8");
    let stream = record_queries(&prepared, &options(RAYMARCH, 2), 500, &Quiet).unwrap();
    let methods = Method::with_voxels().collect();
    let options = ReplayOptions { methods, voxel_sizes: vec![40.0], passes: 1, ..ReplayOptions::default() };
    let phases = Phases::default();
    replay(&prepared, &stream, &options, &phases).unwrap();
    let seen = phases.0.into_inner().unwrap();
    // `ndf` and `amr` have four methods each, with hops; `dsz` and `dual` three.
    let group = |methods| [vec!["checking"], vec!["step"; methods], vec!["replaying"], vec!["step"; methods]].concat();
    assert_eq!(seen, [4, 4, 3, 3].map(group).concat());
}

#[test]
fn every_single_wrong_answer_is_found() {
    let prepared = self::prepared(scene("cbox_vol2", "12"), "amr-sn".parse().unwrap());
    let stream = record_queries(&prepared, &options(RAYMARCH, 2), 9000, &Quiet).unwrap();
    assert!(stream.queries.len() > 4096, "more than a block");
    let asked = |truth: &[bool]| check(&prepared.visibility(), &stream.queries, truth);
    assert!(asked(&stream.unoccluded).is_ok_and(|checked| checked.proved(QueryKind::Spatial) > 100));
    for wrong in (0..stream.queries.len()).step_by(97).chain([4095, 4096, stream.queries.len() - 1]) {
        let mut truth = stream.unoccluded.clone();
        truth[wrong] ^= true;
        assert_eq!(asked(&truth), Err(wrong));
    }

    // A stream whose answers are not those of the hierarchy.
    let mut forged = stream.clone();
    forged.unoccluded[17] ^= true;
    let options = ReplayOptions { methods: vec![Method::default()], passes: 1, ..ReplayOptions::default() };
    match replay(&prepared, &forged, &options, &Quiet) {
        Err(LabError::WrongAnswer(w)) => {
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
    let prepared = plain("cbox_vol2", "4");
    write_triangles(&path, &prepared.world().triangles).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let u32_at = |i: usize| u32::from_le_bytes(bytes[i..i + 4].try_into().unwrap());
    assert_eq!((&bytes[..8], u32_at(8), u32_at(12)), (&b"VDFTRIAN"[..], 1, 32));
    assert_eq!(
        (u32_at(16) as usize, u32_at(20), bytes.len()),
        (prepared.world().triangles.len(), 0, 32 + 36 * prepared.world().triangles.len())
    );
    assert_eq!(u32_at(24), crc32fast::hash(&bytes[32..]));
    let stream = record_queries(&prepared, &options(RAYMARCH, 1), 10, &Quiet).unwrap();
    assert_eq!(stream.origin.triangles_crc32, u32_at(24));
    let last = prepared.world().triangles.last().unwrap().vertices[2];
    assert_eq!(u32_at(bytes.len() - 4), last.z.to_bits());
}

/// Files of the fuzzer's corpus, changed at random but always in the same way; with half of them the checksum is made right again, so that a change
/// that makes sense is read.
#[test]
fn mutated_files_of_the_corpus_never_panic() {
    const NUMBERS: [u64; 8] = [0, 1, 7, 0x7ff0_0000_0000_0000, 0x7ff8_0000_0000_0000, 1 << 31, 1 << 63, u64::MAX];
    let mut state = 3_u64;
    let mut below = |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % n.max(1)
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/queries");
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(paths.len() >= 2);
    let (mut read, mut refused) = (0, 0);
    for path in paths {
        let original = std::fs::read(&path).unwrap();
        assert!(QueryStream::decode(&path, &original[..], original.len() as u64).is_ok());
        for case in 0..2000 {
            let mut bytes = original.clone();
            for _ in 0..=below(3) {
                let at = below(bytes.len());
                match below(5) {
                    0 => bytes[at] = below(256) as u8,
                    1 => bytes[at] ^= 1 << below(8),
                    2 if at + 8 <= bytes.len() => bytes[at..at + 8].copy_from_slice(&NUMBERS[below(8)].to_le_bytes()),
                    3 => bytes.truncate(at + 1),
                    _ => bytes.extend([0; 56]),
                }
            }
            if case % 2 == 0 && bytes.len() >= 80 {
                let count = (bytes.len() as u64 - 80) / 56;
                bytes.truncate(80 + 56 * count as usize);
                bytes[16..24].copy_from_slice(&count.to_le_bytes());
                let sum = crc32fast::hash(&bytes[80..]);
                bytes[72..76].copy_from_slice(&sum.to_le_bytes());
            }
            match QueryStream::decode(&path, &bytes[..], bytes.len() as u64) {
                Ok(stream) => {
                    read += 1;
                    assert!(stream.queries.iter().all(|q| q.from.is_finite() && q.to.is_finite()));
                    assert!(stream.queries.iter().all(|q| q.emitter < stream.origin.emitters as usize));
                }
                Err(LabError::Queries { .. }) => refused += 1,
                Err(e) => panic!("{e}"),
            }
        }
    }
    // Otherwise the changes are too strong to be read, or too weak to matter.
    assert!(read > 200 && refused > 200, "{read} {refused}");
}
