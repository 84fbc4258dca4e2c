//! Liars must be caught, and what is asked must not depend on threads.

use glam::{DMat3, DMat4, DVec3, Vec3};
use vdf_geometry::{CurvedKind, CurvedShape, Segment, Triangle};
use vdf_render::World;
use vdf_scene::{
    Bsdf, ComponentFormat, Emitter, FilmSettings, IntegratorSettings, PixelRect, Projection, ReconstructionFilter, Rgb,
    Sensor, Surface,
};
use vdf_visibility::VisibilityError;

use super::*;

/// A wall across the unit cube, which is as bright as day on both sides.
fn scene() -> Scene {
    let v = |y: f32, z: f32| Vec3::new(0.5, y, z);
    let white = Rgb::ONE;
    Scene {
        surfaces: vec![Surface {
            triangles: vec![
                Triangle::new(v(0.0, 0.0), v(1.0, 0.0), v(1.0, 1.0)),
                Triangle::new(v(0.0, 0.0), v(1.0, 1.0), v(0.0, 1.0)),
            ],
            bsdf: Bsdf::lambertian(white, white),
            radiance: None,
            ..Surface::default()
        }],
        boundaries: vec![],
        media: vec![],
        emitters: [0.0, 1.0].map(|x| Emitter::Point { position: DVec3::splat(x), intensity: white }).to_vec(),
        sensor: Sensor {
            world_from_camera: DMat4::IDENTITY,
            projection: Projection::Perspective { tan_half_fov_x: 1.0, lens: None, principal_point: [0.0; 2] },
            near_clip: 0.1,
            far_clip: 10.0,
            medium: None,
        },
        film: FilmSettings {
            width: 1,
            height: 1,
            crop: PixelRect { x0: 0, y0: 0, x1: 1, y1: 1 },
            filter: ReconstructionFilter::Box,
            component_format: ComponentFormat::Float32,
        },
        integrator: IntegratorSettings { max_depth: None, rr_depth: 5 },
        sample_count: 1,
        seed: 0,
        warnings: vec![],
    }
}

struct Quiet(bool);

impl Progress for Quiet {
    fn phase(&self, _: &str) {}
    fn work_total(&self, _: u64) {}
    fn work_done(&self, _: u64) {}
    fn cancelled(&self) -> bool {
        self.0
    }
}

/// Always says the same, or the truth but for queries towards emitter 1.
enum Liar {
    Always(Answer),
    AboutEmitter1(Box<World>),
}

impl Liar {
    fn answer(&self, query: &Query) -> Answer {
        match self {
            Self::Always(answer) => *answer,
            Self::AboutEmitter1(_) if query.emitter == Some(1) => Answer::Unoccluded,
            Self::AboutEmitter1(w) => self.truth(w, &query.segment),
        }
    }

    fn truth(&self, world: &World, segment: &Segment) -> Answer {
        if world.bvh.occluded(segment) { Answer::Occluded } else { Answer::Unoccluded }
    }
}

impl Claimant for Liar {
    fn claim(&self, queries: &[Query], claims: &mut [Claims], bit: u32) {
        for (query, claims) in queries.iter().zip(claims) {
            claims.add(self.answer(query), bit);
            // What is right about the two points, as provers say it beside the emitter's own answer.
            if let Self::AboutEmitter1(world) = self {
                claims.add(self.truth(world, &query.segment), bit);
            }
        }
    }
}

fn asked(liar: &Liar, segments: u64) -> Sum {
    let scene = scene();
    let world = World::new(&scene);
    let grid = grid_over(&world.bounds, 0.125, 1 << 20).unwrap();
    let none = Provers::none();
    let run = Run {
        claimants: vec![&none, liar],
        names: &["none", "liar"],
        generator: Generator::new(&scene, &world, grid, 3, 0),
        oracle: &Oracle::new(&world),
        classes: &SegmentClass::of(&world),
        voxel_size: 0.125,
    };
    run.all(segments, &Quiet(false)).unwrap()
}

#[test]
fn a_liar_is_caught_in_every_class() {
    for answer in [Answer::Unoccluded, Answer::Occluded] {
        let sum = asked(&Liar::Always(answer), 24_000);
        for (class, t) in SegmentClass::ALL[..12].iter().zip(&sum.classes) {
            assert_eq!((t.segments, t.proved, t.proofs), (2000, 2000, 2000), "{class:?}");
            assert!(t.wrong > 0 && t.wrong < t.proofs, "{class:?}: {t:?}");
            assert_eq!(t.bound(), None);
        }
        let wrong: u64 = sum.classes.iter().map(|t| t.wrong).sum();
        assert_eq!(sum.methods, [[0, 0], [24_000, wrong]]);
        assert_eq!(sum.checks.proved_by_hierarchy, 24_000);
        assert_eq!(sum.checks.proved_by_loop, 24_000);
        assert_eq!(sum.failures.len(), TOLD);
        assert!(sum.failures.iter().all(|f| f.methods == ["liar"]));
    }
}

#[test]
fn a_wrong_answer_for_an_emitter_is_not_hidden_by_a_right_one_for_the_points() {
    let scene = scene();
    let sum = asked(&Liar::AboutEmitter1(Box::new(World::new(&scene))), 24_000);
    assert!(sum.methods[1][1] > 500, "{:?}", sum.methods);
    assert!(sum.failures.iter().all(|f| f.emitter == Some(1) && f.to == [1.0; 3]));
}

#[test]
fn silence_is_no_proof() {
    let sum = asked(&Liar::Always(Answer::Unknown), 24_000);
    assert!(sum.classes.iter().all(|t| t.proved == 0 && t.proofs == 0 && t.bound().is_none()));
    assert!(sum.failures.is_empty() && sum.checks.disagreements == 0);
    // One in sixteen is compared all the same.
    assert_eq!(sum.checks.compared, 12 * 2000 / 16);
}

#[test]
fn a_failure_can_be_repeated_from_its_text() {
    let failure = Failure {
        methods: vec!["ndf"],
        voxel_size: 0.1,
        class: SegmentClass::Axis,
        index: 7,
        emitter: Some(0),
        from: [-0.0, 0.1_f64.next_up(), 1e300],
        to: [1.0; 3],
        occluded_by_hierarchy: Some(true),
        occluded_by_loop: None,
        meets_curved: None,
    };
    assert_eq!(
        failure.to_string(),
        "ndf: voxel 0.1, axis 7, to emitter 0: from [-0.0, 0.10000000000000002, 1e300] to [1.0, 1.0, 1.0], \
         1.000e301 voxels long; hierarchy: occluded, loop: not asked"
    );
}

#[test]
fn the_report_does_not_depend_on_threads() {
    let report = |threads| {
        let voxel_sizes = vec![0.125, 0.1];
        let options = VerifyOptions { voxel_sizes, segments: 60_001, threads: Some(threads), ..Default::default() };
        let report = verify(scene(), &options, &Quiet(false)).unwrap();
        VerifyReport { seconds: 0.0, threads: 0, ..report }
    };
    let one = report(1);
    assert_eq!(one, report(3));
    assert!(one.is_sound(), "{one}");
    assert_eq!((one.total.segments, one.grids.len()), (60_001, 2));
    assert!(one.classes.iter().all(|c| c.tally.segments.abs_diff(5000) <= 2), "{one}");
    assert!(one.methods.iter().all(|m| m.proofs > 2000), "{one}");
    assert_eq!(one.total.bound(), Some(3.0 / one.total.proved as f64));
}

#[test]
fn a_share_of_the_proofs_goes_through_the_loop_if_triangles_are_many() {
    let mut scene = scene();
    let wall = scene.surfaces[0].triangles.clone();
    scene.surfaces[0].triangles = wall.repeat(500);
    let options = VerifyOptions { segments: 100_000, ..Default::default() };
    let report = verify(scene, &options, &Quiet(false)).unwrap();
    assert_eq!(report.checks.proved_by_hierarchy, report.total.proved);
    // 1000 triangles: one in ceil(1000/256).
    let share = report.checks.proved_by_loop as f64 / report.total.proved as f64;
    assert!((0.2..0.3).contains(&share), "{share}");
    assert!(report.is_sound(), "{report}");
}

#[test]
fn bad_options_and_a_wish_to_stop_are_errors() {
    let with = |change: fn(&mut VerifyOptions)| {
        let mut options = VerifyOptions { segments: 1000, ..Default::default() };
        change(&mut options);
        verify(scene(), &options, &Quiet(false)).map(drop)
    };
    let option = |r: Result<(), LabError>| match r {
        Err(LabError::Render(RenderError::Option { option, .. })) => option,
        other => panic!("{other:?}"),
    };
    assert_eq!(option(with(|o| o.segments = 0)), "segments");
    assert_eq!(option(with(|o| o.methods.clear())), "method");
    assert_eq!(option(with(|o| o.methods.push(Method::NONE))), "method");
    assert_eq!(option(with(|o| o.methods = vec![Method::default(); 33])), "method");
    assert_eq!(option(with(|o| o.threads = Some(0))), "threads");
    assert_eq!(option(with(|o| o.voxel_sizes = vec![0.1, -1.0])), "voxel");
    assert!(matches!(with(|o| o.voxel_sizes = vec![1e-9]), Err(LabError::Visibility(VisibilityError::Voxel(_)))));
    let options = VerifyOptions::default();
    assert!(matches!(verify(scene(), &options, &Quiet(true)), Err(LabError::Render(RenderError::Cancelled))));
}

/// A sphere, a disk and a cylinder beside the wall.
fn scene_with_curved_shapes() -> Scene {
    let shape = |kind, at, size| CurvedShape::new(kind, DMat3::from_diagonal(size), at, false).unwrap();
    let shapes = [
        shape(CurvedKind::Sphere, DVec3::new(0.2, 0.3, 0.4), DVec3::new(0.2, 0.1, 0.15)),
        shape(CurvedKind::Disk, DVec3::new(0.8, 0.5, 0.5), DVec3::splat(0.3)),
        shape(CurvedKind::Cylinder, DVec3::new(0.8, 0.2, 0.1), DVec3::new(0.1, 0.1, 0.7)),
    ];
    let mut scene = scene();
    scene.surfaces.extend(shapes.map(|shape| Surface {
        triangles: vec![],
        curved: Some(shape),
        bsdf: Bsdf::lambertian(Rgb::ONE, Rgb::ONE),
        ..Surface::default()
    }));
    scene
}

#[test]
fn curved_shapes_are_compared_with_exact_arithmetic() {
    let scene = scene_with_curved_shapes();
    let world = World::new(&scene);
    let report =
        verify(scene.clone(), &VerifyOptions { segments: 52_000, ..Default::default() }, &Quiet(false)).unwrap();
    assert!(report.is_sound(), "{report}");
    let class = report.classes.iter().find(|c| c.class == SegmentClass::Curved).unwrap();
    assert_eq!(class.tally.segments, 4000);
    // One of the class in as many as there are shapes, and one in eight times as many of the others.
    assert_eq!(report.checks.curved, 4000_u64.div_ceil(3) + 12 * 4000_u64.div_ceil(24));
    assert!(report.to_string().contains("they disagree on 0"), "{report}");

    // The class holds what it is for: hits and misses, both next to each other.
    let grid = grid_over(&world.bounds, 0.125, 1 << 20).unwrap();
    let generator = Generator::new(&scene, &world, grid, 0, 0);
    let hits = (0..2000).filter(|&i| {
        let query = generator.query(SegmentClass::Curved, i);
        world.curved().is_some_and(|curved| curved.occluded(&query.segment))
    });
    assert!((400..1800).contains(&hits.count()));
}

#[test]
fn a_wrong_answer_about_curved_shapes_is_a_failure() {
    for wrong in [[true, false, false], [false, true, false], [false, false, true], [true, true, false]] {
        let truth = Truth { by_hierarchy: None, by_loop: None, curved: Some(wrong) };
        assert!(truth.disagrees_about_curved() && !truth.disagrees());
    }
    let truth = Truth { by_hierarchy: Some(true), by_loop: Some(true), curved: Some([true; 3]) };
    assert!(!truth.disagrees_about_curved());
}

/// Every class must reach the cases that it is for: this counts them.
#[test]
fn classes_are_what_they_say() {
    let scene = scene();
    let world = World::new(&scene);
    let grid = grid_over(&world.bounds, 0.125, 1 << 20).unwrap();
    let generator = Generator::new(&scene, &world, grid, 0, 0);
    let count =
        |class, wanted: &dyn Fn(&Query) -> bool| (0..2000).filter(|&i| wanted(&generator.query(class, i))).count();
    let inside = |p: DVec3| grid.voxel_containing(p).is_some();
    let whole = |x: f64| (x * 8.0).fract() == 0.0;
    assert_eq!(count(SegmentClass::Random, &|q| q.emitter.is_none() && inside(q.segment.p)), 2000);
    assert_eq!(count(SegmentClass::Light, &|q| q.emitter.is_some()), 2000);
    for class in SegmentClass::of(&world).into_iter().skip(2) {
        let ends_in_light = |q: &Query| q.emitter.is_some_and(|e| q.segment.q == DVec3::splat(e as f64));
        assert!(count(class, &ends_in_light) > 200, "{class:?}");
        assert_eq!(count(class, &|q| q.emitter.is_some() && !ends_in_light(q)), 0, "{class:?}");
    }
    assert!(count(SegmentClass::Surface, &|q| q.segment.p.x == 0.5) > 300);
    assert!(count(SegmentClass::Lattice, &|q| q.segment.p.to_array().into_iter().all(whole)) > 100);
    let in_one_face = |q: &Query| (0..3).any(|k| q.segment.p[k] == q.segment.q[k] && whole(q.segment.p[k]));
    assert!(count(SegmentClass::Lattice, &in_one_face) > 200);
    let zero_of = |sign: bool| {
        move |q: &Query| (0..3).any(|k| q.segment.p[k] == 0.0 && q.segment.p[k].is_sign_negative() == sign)
    };
    assert!(count(SegmentClass::Axis, &zero_of(true)) > 50 && count(SegmentClass::Axis, &zero_of(false)) > 50);
    // The wall is in the plane of faces, so a snapped point stays on it.
    assert!(
        count(SegmentClass::Corner, &|q| q.segment.p.x == 0.5 && q.segment.p.to_array().into_iter().all(whole)) > 500
    );
    assert!(count(SegmentClass::Short, &|q| q.segment.length() == 0.0) > 200);
    assert!(count(SegmentClass::Outside, &|q| !inside(q.segment.p)) > 800);
    assert!(count(SegmentClass::Outside, &|q| q.segment.p.abs().max_element() > 1e11) > 200);
}
