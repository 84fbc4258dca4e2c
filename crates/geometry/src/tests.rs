//! The filtered test against its exact twin, and the hierarchy against a loop over all triangles.

use glam::{DVec3, Vec3};
use proptest::prelude::*;

use crate::{Bounds, Bvh, Segment, SegmentTest, Triangle, intersect_exact};

/// Coordinates where tests go wrong: a coarse lattice (shared planes, edges, corners), its neighbours in single
/// precision, −0.0.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => (-4_i8..=4).prop_map(f32::from),
        2 => (-4_i8..=4).prop_map(|i| f32::from(i).next_up()),
        2 => (-4_i8..=4).prop_map(|i| f32::from(i).next_down()),
        1 => Just(-0.0_f32),
        1 => -4.0_f32..4.0,
        1 => (-4.0_f32..4.0).prop_map(|x| x * 1e-6),
    ]
}

fn point() -> impl Strategy<Value = Vec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
}

fn triangle() -> impl Strategy<Value = Triangle> {
    prop_oneof![
        6 => [point(), point(), point()].prop_map(|[a, b, c]| Triangle::new(a, b, c)),
        1 => (point(), point()).prop_map(|(a, b)| Triangle::new(a, b, a)),
        // A sliver: 10⁶ times as long as wide.
        1 => (point(), point(), -1e-6_f32..1e-6).prop_map(|(a, b, e)| Triangle::new(a, b, (a + b) * 0.5 + e)),
    ]
}

/// End points anywhere, or aimed: through a vertex, along an edge, ±1 ulp of double precision.
fn segment_for(t: Triangle) -> impl Strategy<Value = Segment> {
    let [a, b, c] = t.vertices_f64();
    let any = (point(), point()).prop_map(|(p, q)| Segment::new(p.as_dvec3(), q.as_dvec3()));
    let aimed = (point(), 0..5_u8, -1_i8..=1, 0.5..2.0_f64).prop_map(move |(p, what, ulp, length)| {
        let target = [a, b, c, (a + b) * 0.5, (a + b + c) / 3.0][usize::from(what)];
        let nudge = |x: f64| match ulp {
            0 => x,
            1 => x.next_up(),
            _ => x.next_down(),
        };
        let target = DVec3::new(nudge(target.x), target.y, nudge(target.z));
        let p = p.as_dvec3();
        Segment::new(p, if what == 4 { target } else { p + (target - p) * length })
    });
    let edge = (-1.0..2.0_f64, -1.0..2.0_f64).prop_map(move |(s, t)| Segment::new(a + (b - a) * s, a + (b - a) * t));
    prop_oneof![3 => any, 4 => aimed, 1 => edge]
}

fn bounds(t: &Triangle) -> (DVec3, DVec3) {
    let [a, b, c] = t.vertices_f64();
    (a.min(b).min(c), a.max(b).max(c))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn filter_agrees_with_exact_predicates((t, s) in triangle().prop_flat_map(|t| (Just(t), segment_for(t)))) {
        let (min, max) = bounds(&t);
        let fast = SegmentTest::new(s, min, max).intersect(&t);
        let exact = intersect_exact(&s, &t);
        prop_assert_eq!(fast.is_some(), exact.is_some(), "{:?} {:?}", s, t);
        if let Some(hit) = fast {
            prop_assert!((0.0..=1.0).contains(&hit.t));
            prop_assert!(hit.barycentric.iter().all(|w| (0.0..=1.0).contains(w)));
        }
    }

    #[test]
    fn a_reversed_segment_has_the_same_answer((t, s) in triangle().prop_flat_map(|t| (Just(t), segment_for(t)))) {
        let (min, max) = bounds(&t);
        let hit = |s: Segment| SegmentTest::new(s, min, max).intersect(&t).is_some();
        prop_assert_eq!(hit(s), hit(Segment::new(s.q, s.p)));
    }
}

/// The least parameter, and of equal ones the least number.
fn first_by_a_loop(triangles: &[Triangle], s: &Segment) -> Option<(f64, u32)> {
    let Bounds { min, max } = Bounds::of_triangles(triangles);
    let test = SegmentTest::new(*s, min, max);
    let hits = triangles.iter().zip(0..).filter_map(|(t, number)| test.intersect(t).map(|hit| (hit.t, number)));
    // −0 is no less than 0.
    hits.min_by(|a, b| (a.0 + 0.0).total_cmp(&(b.0 + 0.0)).then(a.1.cmp(&b.1)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn hierarchy_agrees_with_a_loop(
        triangles in prop::collection::vec(triangle(), 0..40), p in point(), q in point(), near in point(),
        aim in any::<prop::sample::Index>(), k in 0..3_usize, unit in prop::sample::select(vec![0_i32, -7, -20, -100, -126, -140, 90]),
    ) {
        // The same in any unit, also in one in which vertices are subnormal.
        let unit = 2.0_f64.powi(unit) as f32;
        let triangles: Vec<_> =
            triangles.iter().map(|t| Triangle { vertices: t.vertices.map(|v| v * unit) }).collect();
        let (p, q, near) = (p * unit, q * unit, near * unit * 1e-5);
        let bvh = Bvh::new(&triangles);
        let mut segments = vec![Segment::new(p.as_dvec3(), q.as_dvec3()), Segment::new(p.as_dvec3() * 1e3, q.as_dvec3())];
        if !triangles.is_empty() {
            let target = triangles[aim.index(triangles.len())].vertices_f64()[k];
            segments.push(Segment::new(p.as_dvec3(), target));
            segments.push(Segment::new(p.as_dvec3() * 1e3, target));
            // So short that it is inside the padding.
            segments.push(Segment::new(target + near.as_dvec3(), target - near.as_dvec3() * 0.5));
        }
        for s in segments {
            let first = triangles.iter().filter_map(|t| intersect_exact(&s, t)).map(|h| h.t).min_by(f64::total_cmp);
            prop_assert_eq!(bvh.occluded(&s), first.is_some());
            let hit = bvh.intersect(&s);
            prop_assert_eq!(hit.map(|hit| (hit.t, hit.triangle)), first_by_a_loop(&triangles, &s));
            if let (Some(hit), Some(first)) = (hit, first) {
                // Of short segments the place, not the parameter.
                let length = (s.length() / f64::from(unit)).min(1.0);
                prop_assert!((hit.t - first).abs() * length < 1e-6, "{} {}", hit.t, first);
            }
            let mut count = 0;
            bvh.visit_hits(&s, |_| count += 1);
            prop_assert_eq!(count, triangles.iter().filter(|t| intersect_exact(&s, t).is_some()).count());
        }
    }
}

/// A closed sphere with displaced vertices: every segment from inside to outside meets it, also through vertices and
/// along edges (after pbrt's `Triangle.Watertight`).
#[test]
fn closed_meshes_are_watertight() {
    let n = 16_u16;
    let mut noise = fastrand::Rng::with_seed(1);
    let mut rings: Vec<Vec<Vec3>> = Vec::new();
    for i in 0..=n {
        let theta = std::f64::consts::PI * f64::from(i) / f64::from(n);
        let pole = i == 0 || i == n;
        let ring: Vec<Vec3> = (0..n)
            .map(|j| {
                let phi = std::f64::consts::TAU * f64::from(j) / f64::from(n);
                let r = if pole { 3.0 } else { 2.0 + noise.f64() };
                (DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()) * r).as_vec3()
            })
            .collect();
        rings.push(if pole { vec![ring[0]; usize::from(n)] } else { ring });
    }
    let mut triangles = Vec::new();
    for i in 0..usize::from(n) {
        for j in 0..usize::from(n) {
            let k = (j + 1) % usize::from(n);
            triangles.push(Triangle::new(rings[i][j], rings[i + 1][j], rings[i + 1][k]));
            triangles.push(Triangle::new(rings[i][j], rings[i + 1][k], rings[i][k]));
        }
    }
    let bvh = Bvh::new(&triangles);
    for i in 0..100_000_u32 {
        let mut u = fastrand::Rng::with_seed(u64::from(i));
        let mut inside = || DVec3::new(u.f64(), u.f64(), u.f64()) - 0.5;
        let p = inside();
        let free = p + (inside() - p).normalize() * 10.0;
        let t = &triangles[i as usize % triangles.len()].vertices_f64();
        for q in [free, p + (t[0] - p) * 4.0, p + ((t[0] + t[1]) * 0.5 - p) * 4.0] {
            assert!(bvh.occluded(&Segment::new(p, q)), "{p} {q}");
        }
    }
}

/// The box of a triangle seen from far away, or far from the origin, must not be culled.
#[test]
fn hierarchy_finds_hits_far_from_the_origin() {
    let base = Vec3::new(1e6, -2e6, 3e6);
    let triangles: Vec<_> = (0..50_u8)
        .map(|i| {
            let o = base + Vec3::new(f32::from(i) * 4.0, f32::from(i % 7), 0.0);
            Triangle::new(o, o + Vec3::X * 2.0, o + Vec3::Y * 2.0)
        })
        .collect();
    let bvh = Bvh::new(&triangles);
    for t in &triangles {
        let [a, b, c] = t.vertices_f64();
        let target = (a + b + c) / 3.0;
        for from in [target + DVec3::new(0.1, 0.2, 1.0), target + DVec3::new(3e5, -1e5, 7e6), DVec3::ZERO] {
            assert!(bvh.occluded(&Segment::new(from, target)));
            assert!(bvh.intersect(&Segment::new(from, target + (target - from) * 0.5)).is_some());
        }
    }
}

/// Segments with one end or both up to 10¹⁵ times as far away as the scene is large, against a loop over all triangles;
/// in either direction.
#[test]
fn far_ends_miss_nothing() {
    let mut noise = fastrand::Rng::with_seed(5);
    let mut uniform = |size: f64| DVec3::from_array([(); 3].map(|()| size * (2.0 * noise.f64() - 1.0)));
    let triangles: Vec<_> = (0..60_u8)
        .map(|i| {
            let [o, a, b] =
                [uniform(8.0), uniform(2.0), uniform(if i % 3 == 0 { 1e-3 } else { 2.0 })].map(|v| v.as_vec3());
            Triangle::new(o, o + a, o + b)
        })
        .collect();
    let bvh = Bvh::new(&triangles);
    let Bounds { min, max } = *bvh.bounds();
    let (mut hits, mut crossings) = (0, 0);
    for i in 0..6000 {
        let t = triangles[if i % 2 == 0 { 0 } else { i % triangles.len() }].vertices_f64();
        let target = [t[0], (t[0] + t[1]) * 0.5, t[0] * 0.98 + t[1] * 0.01 + t[2] * 0.01, uniform(9.0)][i / 7 % 4];
        let away = uniform([2e3, 1e9, 1e12, 1e15][i / 2 % 4]);
        let p = target + away;
        // An end at the target, one behind it, and one as far away on the other side.
        let q = [target, target - away.normalize() * 20.0, target - away][i / 5 % 3];
        for s in [Segment::new(p, q), Segment::new(q, p)] {
            let test = SegmentTest::new(s, min, max);
            let found: Vec<_> = triangles.iter().filter_map(|t| test.intersect(t)).map(|h| h.t).collect();
            assert_eq!(found.len(), triangles.iter().filter(|t| intersect_exact(&s, t).is_some()).count(), "{s:?}");
            assert_eq!(bvh.occluded(&s), !found.is_empty(), "{s:?}");
            let first = found.iter().copied().min_by(f64::total_cmp);
            assert_eq!(bvh.intersect(&s).map(|h| h.t), first, "{s:?}");
            let mut visited = 0;
            bvh.visit_hits(&s, |_| visited += 1);
            assert_eq!(visited, found.len(), "{s:?}");
            hits += usize::from(visited > 0);
            crossings += usize::from(visited > 1);
        }
    }
    assert!(hits > 2000 && crossings > 100, "{hits} {crossings}");
}

/// Slivers along a segment whose parameters are mostly rounding: the first hit is that of a loop, whatever the order of
/// the triangles and whatever else shapes the tree; and its place is in the triangle's box.
///
/// The edges are neighbouring Fibonacci numbers, whose cross product is 1: 0.3 long, 10⁻¹⁴ wide, with no exact zero in
/// any determinant. The segment passes exactly through a vertex of each.
#[test]
fn the_first_of_grazing_slivers_does_not_depend_on_the_tree() {
    const UNIT: f64 = 1.0 / 16_777_216.0;
    let mut noise = fastrand::Rng::with_seed(3);
    let edges = [DVec3::new(5_702_887.0, 3_524_578.0, 2_178_309.0), DVec3::new(3_524_578.0, 2_178_309.0, 1_346_269.0)];
    let (mut crossings, mut jumbled) = (0, 0);
    for round in 0..100 {
        let whole = |noise: &mut fastrand::Rng, size: i32| {
            DVec3::from_array([(); 3].map(|()| f64::from(noise.i32(-size..=size))))
        };
        let (centre, step) = (whole(&mut noise, 4_000_000), whole(&mut noise, 400));
        let mut triangles: Vec<_> = (0..40)
            .map(|k| {
                let vertex = centre + step * f64::from(k);
                let signs = DVec3::from_array([(); 3].map(|()| if noise.bool() { 1.0 } else { -1.0 }));
                let turned = |e: DVec3| match k % 3 {
                    0 => e,
                    1 => DVec3::new(e.y, e.z, e.x),
                    _ => DVec3::new(e.z, e.x, e.y),
                };
                let corners = [vertex, vertex + turned(edges[0]) * signs, vertex + turned(edges[1]) * signs];
                Triangle { vertices: corners.map(|v| (v * UNIT).as_vec3()) }
            })
            .collect();
        for _ in 0..round % 60 {
            let o = whole(&mut noise, 10_000_000);
            let [a, b] = [o + whole(&mut noise, 500_000), o + whole(&mut noise, 500_000)];
            triangles.push(Triangle { vertices: [o, a, b].map(|v| (v * UNIT).as_vec3()) });
        }
        let [near, far] = [centre - step * 20_000.0, centre + step * 20_000.0].map(|p| p * UNIT);
        for _ in 0..4 {
            noise.shuffle(&mut triangles);
            let bvh = Bvh::new(&triangles);
            for s in [Segment::new(near, far), Segment::new(far, near)] {
                let hit = bvh.intersect(&s);
                assert_eq!(hit.map(|hit| (hit.t, hit.triangle)), first_by_a_loop(&triangles, &s), "{round} {s:?}");
                let mut hits = 0;
                bvh.visit_hits(&s, |hit| {
                    hits += 1;
                    let triangle = &triangles[hit.triangle as usize];
                    let (min, max) = bounds(triangle);
                    let place = s.at(hit.t);
                    assert!((place - place.clamp(min, max)).abs().max_element() < 2e-6, "{place} {min} {max}");
                    // What the predicates alone would say.
                    let place = intersect_exact(&s, triangle).map_or(place, |hit| s.at(hit.t));
                    jumbled += usize::from((place - place.clamp(min, max)).abs().max_element() > 1e-5);
                });
                crossings += usize::from(hits > 1);
            }
        }
    }
    assert!(crossings > 700 && jumbled > 1000, "{crossings} {jumbled}");
}

/// Nothing divides coincident triangles, so the tree may be as deep as it likes.
#[test]
fn many_coincident_triangles_are_one() {
    for count in [2, 1000, 100_000] {
        let t = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);
        let far = Triangle::new(Vec3::Z, Vec3::X + Vec3::Z, Vec3::Y + Vec3::Z);
        let bvh = Bvh::new(&[vec![far; count / 2], vec![t; count]].concat());
        let p = DVec3::new(0.25, 0.25, -1.0);
        assert_eq!(bvh.intersect(&Segment::new(p, p + DVec3::Z * 9.0)).map(|h| h.triangle as usize), Some(count / 2));
        assert!(bvh.occluded(&Segment::new(p, p + DVec3::Z * 9.0)));
        assert!(!bvh.occluded(&Segment::new(p, p + DVec3::Z * 0.5)));
        let mut hits = 0;
        bvh.visit_hits(&Segment::new(p, p + DVec3::Z * 9.0), |_| hits += 1);
        assert_eq!(hits, count + count / 2);
    }
}

/// Of nested boxes only the two smallest are joined at a time: the binary tree is as deep as it has triangles. The
/// stack need not be: 26 bytes a level.
#[test]
fn nested_triangles_need_no_deep_stack() {
    const COUNT: u16 = 5000;
    let test = || {
        let vertices = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.3), Vec3::new(0.0, 1.0, 0.5)];
        let nested = |i| Triangle { vertices: vertices.map(|v| v * (1.0 + f32::from(i) * 1e-3)) };
        let triangles: Vec<_> = (0..COUNT).map(nested).collect();
        let bvh = Bvh::new(&triangles);
        let p = DVec3::new(0.1, 0.0, -9.0);
        let s = Segment::new(p, p + DVec3::Z * 20.0);
        let found = triangles.iter().filter(|t| intersect_exact(&s, t).is_some()).count();
        let mut hits = 0;
        bvh.visit_hits(&s, |_| hits += 1);
        assert!(hits == found && found > 1000 && bvh.occluded(&s), "{hits} {found}");
    };
    std::thread::Builder::new().stack_size(128 << 10).spawn(test).unwrap().join().unwrap();
}
