//! Which proofs a question may use.

use glam::{DVec3, Vec3, dvec3};
use vdf_distfield::Neighbourhood as _;
use vdf_geometry::{Bounds, Triangle};

use super::*;
use crate::{LightShape, Method, ProverOptions, Quiet};

/// Provers of a scene without the occluder that the hierarchy knows: whoever believes them can be told by a wrong answer.
fn liars(method: Method, light: LightShape<'_>, others: &[Triangle]) -> Provers {
    let bounds = Bounds::new(DVec3::splat(-2.0), DVec3::splat(2.0));
    let options = ProverOptions { method, voxel_size: 0.25, ..ProverOptions::default() };
    Provers::build(&options, others, bounds, &[light], &Quiet).expect("a sound grid").0
}

/// Of queries by their kind, of free flights only from a point in space, and if asked for.
#[test]
fn each_question_uses_its_own_proofs() {
    let wall = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);
    let lamp = Triangle::new(Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 1.0, 1.0));
    let bvh = Bvh::new(&[wall]);
    let (from, to) = (dvec3(0.25, 0.25, -1.0), dvec3(0.25, 0.25, 0.999));
    let method = "amr-xsn".parse().expect("a method");
    let point = liars(method, LightShape::Point(to), &[]);
    let buffer = liars(Method::default(), LightShape::Point(to), &[]);
    let area = liars(method, LightShape::Area(&[lamp]), &[lamp]);
    for (provers, spatial_proof, on_light_proof, any_proof) in [
        (&Provers::none(), false, false, false),
        (&point, true, false, false),
        (&area, false, true, false),
        (&buffer, true, true, true),
    ] {
        let visibility = Visibility::new(&bvh, provers);
        for (kind, believed) in [
            (QueryKind::Spatial, spatial_proof),
            (QueryKind::OnLight, on_light_proof),
            (QueryKind::Superficial, any_proof),
        ] {
            let mut counters = Counters::default();
            let query = ShadowQuery { from, to, emitter: 0, kind };
            assert_eq!(visibility.unoccluded(&query, &mut counters), believed, "{kind:?}");
            let proved = counters.proved + counters.on_light_proved + counters.superficial_proved;
            assert_eq!((proved, counters.proved_occluded), (u64::from(believed), 0), "{kind:?}");
            assert_eq!(counters.spatial, u64::from(kind == QueryKind::Spatial), "{kind:?}");
        }
        for (segment_first, spatial) in [(false, false), (true, false), (false, true), (true, true)] {
            let mut counters = Counters::default();
            let visibility = Visibility::new(&bvh, provers).segment_first(segment_first);
            let hit = visibility.intersect_flight(&Segment::new(from, to), spatial, &mut counters);
            let flight_proof = spatial_proof && !any_proof;
            assert_eq!(hit.is_none(), flight_proof && segment_first && spatial, "{segment_first} {spatial}");
            assert_eq!(counters.flights, u64::from(segment_first && spatial));
        }
    }
}

/// The clipped end of a segment from outside is rounded outwards, so hops do not know it: only free cuboids are asked about it.
#[test]
fn hops_say_nothing_of_clipped_segments() {
    let obstacle = Triangle::new(Vec3::splat(0.05), Vec3::new(0.2, 0.1, 0.1), Vec3::new(0.1, 0.2, 0.1));
    let light = dvec3(1.1, 0.9, 0.8);
    let provers = liars("ndf-hop".parse().expect("a method"), LightShape::Point(light), &[obstacle]);
    let (Some(grid), Some(crate::LightProver::Hop(hops))) = (provers.grid(), provers.light(0)) else {
        panic!("{provers:?}")
    };
    let answer = |from| provers.answer(&ShadowQuery { from, to: light, emitter: 0, kind: QueryKind::Spatial });
    let resolution = grid.resolution();
    let mut only_by_hops = 0;
    for voxel in resolution.voxels().filter(|v| v.i == 0 && hops.proves(*v)) {
        let inside = grid.corner(voxel) + 0.125;
        assert_eq!(answer(inside), Answer::Unoccluded);
        let outside = inside - (light - inside) * 0.2;
        assert_eq!(grid.voxel_containing(outside), None);
        let Some(entry) = grid.entry_voxel(outside, light) else { continue };
        let by_cuboid = hops.cuboids().proves(entry);
        only_by_hops += u32::from(hops.proves(entry) && !by_cuboid);
        assert_eq!(answer(outside) == Answer::Unoccluded, by_cuboid, "{voxel:?}");
    }
    assert!(only_by_hops > 20, "{only_by_hops}");
}

/// A buffer knows ways to its own light and to nothing else.
#[test]
fn a_buffer_answers_for_its_own_light_alone() {
    let light = dvec3(0.25, 0.25, 1.0);
    let provers = liars(Method::default(), LightShape::Point(light), &[]);
    let answer =
        |to, emitter| provers.answer(&ShadowQuery { from: DVec3::ZERO, to, emitter, kind: QueryKind::Spatial });
    assert_eq!(answer(light, 0), Answer::Unoccluded);
    assert_eq!(answer(light.with_x(0.25_f64.next_up()), 0), Answer::Unknown);
    assert_eq!(answer(light, 1), Answer::Unknown);
}

/// Many queries at once are answered as one by one, whatever lights, kinds and provers they mix, and whatever their number.
#[test]
fn batches_are_answered_as_single_queries() {
    let wall = Triangle::new(Vec3::new(-1.0, -1.0, 0.5), Vec3::new(1.0, -1.0, 0.5), Vec3::new(0.0, 1.0, 0.5));
    let lights = [dvec3(0.0, 0.0, 1.0), dvec3(0.5, 0.25, -1.0)];
    let bvh = Bvh::new(&[wall]);
    let bounds = Bounds::new(DVec3::splat(-2.0), DVec3::splat(2.0));
    for name in ["none", "amr-sn", "lb"] {
        let options =
            ProverOptions { method: name.parse().expect("a method"), voxel_size: 0.25, ..ProverOptions::default() };
        let shapes = [LightShape::Point(lights[0]), LightShape::Point(lights[1]), LightShape::Infinite];
        let provers = Provers::build(&options, &[wall], bounds, &shapes, &Quiet).expect("a sound grid").0;
        let visibility = Visibility::new(&bvh, &provers);
        let mut random = fastrand::Rng::with_seed(1);
        let queries: Vec<_> = (0..1000)
            .map(|i| ShadowQuery {
                from: DVec3::from_array([(); 3].map(|()| 4.0 * random.f64() - 2.0)),
                to: lights.get(i % 3).copied().unwrap_or(DVec3::splat(5.0)),
                emitter: i % 4,
                kind: [QueryKind::Spatial, QueryKind::OnLight, QueryKind::Superficial][i / 4 % 3],
            })
            .collect();
        let (mut one_by_one, mut counters) = (Vec::new(), Counters::default());
        one_by_one.extend(queries.iter().map(|q| visibility.unoccluded(q, &mut counters)));
        for size in [1, 7, 16, 64, 100, 256, 1000] {
            let (mut together, mut of_batches) = (vec![false; 1000], Counters::default());
            for (queries, answers) in queries.chunks(size).zip(together.chunks_mut(size)) {
                visibility.all_unoccluded(queries, answers, &mut of_batches);
            }
            assert_eq!((&together, of_batches), (&one_by_one, counters), "{name}, {size}");
        }
    }
}

#[derive(Default)]
struct Listener {
    began: std::cell::Cell<u32>,
    heard: std::cell::Cell<u32>,
}

impl Recorder for Listener {
    fn begins(&self) {
        self.began.set(self.began.get() + 1);
    }

    fn record(&self, _: &ShadowQuery, _: bool) {
        assert!(self.began.get() > 0, "nobody said that a query is about to be asked");
        self.heard.set(self.heard.get() + 1);
    }
}

/// Who listens hears that queries are about to be asked, once for a batch, and then of each.
#[test]
fn a_listener_hears_that_queries_begin() {
    let (bvh, provers, listener) = (Bvh::new(&[]), Provers::none(), Listener::default());
    let visibility = Visibility::new(&bvh, &provers).recorded(&listener as &dyn Recorder);
    let query = ShadowQuery { from: DVec3::ZERO, to: DVec3::ONE, emitter: 0, kind: QueryKind::Spatial };
    visibility.all_unoccluded(&[query; 300], &mut [false; 300], &mut Counters::default());
    assert_eq!((listener.began.take(), listener.heard.take()), (2, 300));
    assert!(visibility.unoccluded(&query, &mut Counters::default()));
    assert_eq!((listener.began.get(), listener.heard.get()), (1, 1));
}
