//! Exact decisions about curved shapes: against points whose place is known, against a twin in higher precision, and hard cases.

use glam::{DMat3, DQuat, DVec3, dvec3};

use super::*;

fn unit(kind: CurvedKind) -> CurvedShape {
    CurvedShape::new(kind, DMat3::IDENTITY, DVec3::ZERO, false).expect("it can be inverted")
}

#[track_caller]
fn expect(shape: &CurvedShape, p: DVec3, q: DVec3, meets: bool) {
    let segment = Segment::new(p, q);
    for s in [segment, Segment::new(q, p)] {
        assert_eq!(shape.meets(&s), meets, "{s:?}");
        assert_eq!(shape.hits(&s)[0].is_some(), meets, "{s:?}");
        assert_eq!(CurvedSet::new(vec![*shape]).occluded(&s), meets, "{s:?}");
    }
}

#[test]
fn a_touch_is_a_hit_and_an_ulp_beside_is_none() {
    let sphere = unit(CurvedKind::Sphere);
    let beyond = 1.0_f64.next_up();
    for (x, meets) in [(1.0, true), (beyond, false), (1.0_f64.next_down(), true)] {
        expect(&sphere, dvec3(x, -2.0, 0.0), dvec3(x, 2.0, 0.0), meets);
        expect(&sphere, dvec3(x, 0.0, 0.0), dvec3(5.0, 1.0, 1.0), x <= 1.0);
        expect(&unit(CurvedKind::Cylinder), dvec3(x, -2.0, 0.5), dvec3(x, 2.0, 0.5), meets);
        expect(&unit(CurvedKind::Cylinder), dvec3(0.0, 0.0, x), dvec3(2.0, 0.0, x), meets);
        expect(&unit(CurvedKind::Disk), dvec3(x, 0.0, -1.0), dvec3(x, 0.0, 1.0), meets);
    }
    let deep = 1.0_f64.next_down();
    expect(&sphere, dvec3(-deep, 0.0, 0.0), dvec3(deep, 0.0, 0.0), false);
    expect(&sphere, dvec3(-deep, 0.0, 0.0), dvec3(1.0, 0.0, 0.0), true);
    expect(&unit(CurvedKind::Disk), dvec3(0.0, 0.0, 0.0), dvec3(0.0, 0.0, 1.0), true);
    expect(&unit(CurvedKind::Disk), dvec3(0.0, 0.0, 1e-300), dvec3(0.0, 0.0, 1.0), false);
    // In the plane.
    expect(&unit(CurvedKind::Disk), dvec3(-2.0, 0.0, 0.0), dvec3(2.0, 0.0, -0.0), false);
    // Through an open cylinder, along its axis, and just above its rim.
    expect(&unit(CurvedKind::Cylinder), dvec3(0.2, 0.0, -1.0), dvec3(0.3, 0.0, 2.0), false);
    expect(&unit(CurvedKind::Cylinder), dvec3(-2.0, 0.0, beyond), dvec3(2.0, 0.0, beyond), false);
    expect(&unit(CurvedKind::Cylinder), dvec3(-3.0, 0.0, 3.0), dvec3(3.0, 0.0, -3.0), true);
    // It enters through the top and leaves through the bottom.
    expect(&unit(CurvedKind::Cylinder), dvec3(-1.5, 0.0, 2.5), dvec3(1.5, 0.0, -1.5), false);
}

/// Segments of all lengths, also from afar and grazing, against the same predicates in expansions alone; and the other way: where the filter answers it
/// is right. The places of hits are on the shape.
#[test]
fn the_filter_agrees_with_exact_arithmetic() {
    let mut random = fastrand::Rng::with_seed(7);
    let mut close = 0;
    let (mut clear, mut doubtful) = (0, 0);
    for round in 0..4_320 {
        let kind = [CurvedKind::Sphere, CurvedKind::Disk, CurvedKind::Cylinder][round % 3];
        let mut number = |size: f64| size * (2.0 * random.f64() - 1.0);
        let rotation = DQuat::from_xyzw(number(1.0), number(1.0), number(1.0), number(1.0)).normalize();
        let scale = [1.0, 1e-3, 300.0][round / 3 % 3];
        let origin = dvec3(number(1.0), number(1.0), number(1.0)) * [0.0, 10.0, 1e5][round / 9 % 3];
        let shape = CurvedShape::new(kind, DMat3::from_quat(rotation) * scale, origin, false).expect("a rotation");
        // A point of the shape; a segment through it, one that touches there, or one that ends there.
        let angle = number(3.2);
        let (height, r) = (number(1.0), number(1.0).abs().sqrt());
        let (at, normal, along) = match kind {
            CurvedKind::Sphere => {
                let s = (1.0 - height * height).sqrt();
                let n = dvec3(s * angle.cos(), s * angle.sin(), height);
                (n, n, n.any_orthonormal_vector())
            }
            CurvedKind::Disk => (dvec3(r * angle.cos(), r * angle.sin(), 0.0), DVec3::Z, DVec3::X),
            CurvedKind::Cylinder => {
                let n = dvec3(angle.cos(), angle.sin(), 0.0);
                (n + DVec3::Z * height.abs(), n, DVec3::Z.cross(n))
            }
        };
        let far = [1.0, 30.0, 1e6, 1e-6][round / 27 % 4];
        let (p, q) = match round / 108 % 4 {
            0 => (at + normal * far, at - normal * 0.5),
            1 => (at + along * far, at - along * far),
            2 => (at, at + (normal + along) * far),
            _ => (at + (normal * 0.1 + along) * far, at - (normal * 0.1 + along) * far),
        };
        let segment = Segment::new(shape.to_world(p), shape.to_world(q));
        let exact = shape.meets_with::<Expansion>(&segment).expect("exact");
        match shape.meets_with::<Bounded>(&segment) {
            Some(answer) => assert_eq!(answer, exact, "{round} {segment:?}"),
            None => close += 1,
        }
        assert_eq!(shape.meets(&segment), exact, "{round}");
        let reversed = Segment::new(segment.q, segment.p);
        assert_eq!(shape.meets(&reversed), exact, "{round}");
        if kind == CurvedKind::Sphere {
            for p in [segment.p, segment.q] {
                assert_eq!(Some(shape.side(p)), shape.side_with::<Expansion>(p), "{round} {p}");
            }
            // Where ends and nearest point are clear: near the surface by multiples of what counts as close.
            let error = shape.distance_error(segment.p.abs().max(segment.q.abs()).max_element());
            for by in [-3.0, -1.1, -0.9, 0.9, 1.1, 3.0] {
                let moved = normal * (by * error);
                let s = Segment::new(shape.to_world(p + moved), shape.to_world(q + moved));
                let exact = shape.meets_with::<Expansion>(&s).expect("exact");
                match shape.meets_clearly(&s) {
                    Some(answer) => clear += usize::from(answer == exact),
                    None => doubtful += 1,
                }
                assert!(shape.meets_clearly(&s).is_none_or(|answer| answer == exact), "{round} {by} {s:?}");
            }
        }
        for t in shape.hits(&segment).into_iter().flatten() {
            let local = shape.to_local(segment.at(t));
            let off = local.distance(shape.snapped(local));
            let rounding = 1e-15 * (segment.p.abs().max(segment.q.abs()).max_element() + origin.abs().max_element());
            // A grazing hit is where the line is nearest, which may be off by the square root of what the line is off.
            assert!(off <= (64.0 * rounding / scale).max(1e-7 * far.max(1.0)), "{round} {off} {segment:?}");
        }
    }
    assert!(close > 400, "the test is about close calls: {close}");
    assert!(clear > 5000 && doubtful > 1000, "{clear} clear, {doubtful} doubtful");
}

/// The first hit by the hierarchy is the first by a loop.
#[test]
fn the_set_only_culls() {
    let mut random = fastrand::Rng::with_seed(5);
    let mut number = |size: f64| size * (2.0 * random.f64() - 1.0);
    let shapes: Vec<_> = (0..60)
        .map(|i| {
            let kind = [CurvedKind::Sphere, CurvedKind::Disk, CurvedKind::Cylinder][i % 3];
            let at = dvec3(number(5.0), number(5.0), number(5.0));
            CurvedShape::new(kind, DMat3::from_rotation_x(number(3.0)) * (0.1 + number(1.0).abs()), at, false).unwrap()
        })
        .collect();
    let set = CurvedSet::new(shapes.clone());
    let mut hits = 0;
    for i in 0..2000 {
        let size = if i % 10 == 0 { 1e4 } else { 6.0 };
        let p = dvec3(number(size), number(size), number(size));
        let mut q = dvec3(number(6.0), number(6.0), number(6.0));
        if i % 7 == 0 {
            q = p.with_x(-p.x);
        }
        let s = Segment::new(p, q);
        let by_loop =
            (0..).zip(&shapes).flat_map(|(n, shape)| shape.hits(&s).into_iter().flatten().map(move |t| (t, n)));
        let first = by_loop.min_by(|a, b| a.partial_cmp(b).expect("numbers"));
        assert_eq!(set.intersect(&s, f64::INFINITY).map(|hit| (hit.t, hit.shape)), first, "{s:?}");
        // What is met beyond a place may be left out, and nothing else.
        let t = first.map_or(0.5, |(t, _)| t);
        for before in [t, t.next_down(), t.next_up(), 0.5 * t, 2.0 * t] {
            let hit = set.intersect(&s, before).map(|hit| (hit.t, hit.shape));
            assert_eq!(hit.filter(|hit| hit.0 <= before), first.filter(|hit| hit.0 <= before), "{s:?}, {before}");
        }
        assert_eq!(set.occluded(&s), first.is_some());
        hits += usize::from(first.is_some());
    }
    assert!(hits > 300, "{hits}");
    assert!(CurvedSet::new(vec![]).intersect(&Segment::new(DVec3::ZERO, DVec3::ONE), f64::INFINITY).is_none());
}

#[test]
fn sides_and_normals() {
    let shape = CurvedShape::new(CurvedKind::Sphere, DMat3::from_diagonal(DVec3::splat(2.0)), DVec3::X, false).unwrap();
    assert_eq!(shape.side(dvec3(3.0, 0.0, 0.0)), Ordering::Equal);
    assert_eq!(shape.side(dvec3(3.0_f64.next_down(), 0.0, 0.0)), Ordering::Less);
    assert_eq!(shape.side(dvec3(3.0_f64.next_up(), 0.0, 0.0)), Ordering::Greater);
    assert_eq!(shape.normal(DVec3::X), DVec3::X);
    assert_eq!(shape.turned().normal(DVec3::X), -DVec3::X);
    assert!(
        CurvedShape::new(CurvedKind::Disk, DMat3::from_diagonal(dvec3(1.0, 1.0, 0.0)), DVec3::ZERO, false).is_none()
    );
}
