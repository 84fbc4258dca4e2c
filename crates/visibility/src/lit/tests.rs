//! Lit intervals against a loop of exact tests over all triangles.

use glam::{Vec3, dvec3};
use vdf_geometry::{Triangle, intersect_exact};

use super::*;

/// The slow twin.
fn occluded(triangles: &[Triangle], from: DVec3, light: DVec3) -> bool {
    let way = Segment::new(from, light);
    triangles.iter().any(|t| intersect_exact(&way, t).is_some())
}

/// A rectangle of `n` × `n` cells of two triangles.
fn sheet(o: Vec3, u: Vec3, v: Vec3, n: u8) -> Vec<Triangle> {
    let at = |i: u8, j: u8| o + u * (f32::from(i) / f32::from(n)) + v * (f32::from(j) / f32::from(n));
    (0..n)
        .flat_map(|i| (0..n).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [Triangle::new(a, b, c), Triangle::new(a, c, d)]
        })
        .collect()
}

/// The faces of a cuboid.
fn block(min: Vec3, max: Vec3) -> Vec<Triangle> {
    let d = max - min;
    let [x, y, z] = [Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z];
    [(min, x, y), (min, y, z), (min, z, x), (min + z, x, y), (min + x, y, z), (min + y, z, x)]
        .into_iter()
        .flat_map(|(o, u, v)| sheet(o, u, v, 1))
        .collect()
}

/// Scenes with what is hard: sheets of shared edges and vertices, blocks that touch, cracks of an ulp, slivers, triangles without area, duplicates,
/// leaves, huge offsets.
fn scenes() -> Vec<(&'static str, Vec<Triangle>)> {
    let mut random = fastrand::Rng::with_seed(5);
    let mut anywhere = |size: f64| DVec3::from_array([(); 3].map(|()| size * (2.0 * random.f64() - 1.0))).as_vec3();
    let board = sheet(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0, 4);
    let blocks: Vec<_> = [
        block(Vec3::new(-0.5, -0.5, -0.25), Vec3::new(0.0, 0.0, 0.25)),
        block(Vec3::new(0.0, -0.5, -0.25), Vec3::new(0.5, 0.25, 0.5)),
        block(Vec3::new(0.0, 0.25, 0.5), Vec3::new(0.25, 0.5, 0.75)),
    ]
    .concat();
    let leaves = |count, size, anywhere: &mut dyn FnMut(f64) -> Vec3| -> Vec<Triangle> {
        (0..count)
            .map(|_| {
                let o = anywhere(1.0);
                Triangle::new(o, o + anywhere(size), o + anywhere(size))
            })
            .collect()
    };
    let mut cracked = board.clone();
    for t in cracked.iter_mut().step_by(3) {
        t.vertices[1].x = t.vertices[1].x.next_up();
        t.vertices[2].z = -0.0;
    }
    let mut slivers: Vec<_> = (0..20)
        .map(|_| {
            let (a, b) = (anywhere(1.0), anywhere(1.0));
            Triangle::new(a, b, (a + b) * 0.5 + anywhere(1e-6))
        })
        .collect();
    slivers.extend([Triangle::new(Vec3::X, Vec3::X, Vec3::Y), Triangle::new(Vec3::ZERO, Vec3::X, Vec3::X * 0.5)]);
    let large = leaves(20, 1.5, &mut anywhere);
    let small = leaves(600, 0.05, &mut anywhere);
    let moved = blocks.iter().map(|t| Triangle { vertices: t.vertices.map(|v| v + Vec3::new(1e6, -3e5, 2e5)) });
    vec![
        ("nothing", vec![]),
        ("one triangle", vec![board[0]]),
        ("a sheet", board.clone()),
        ("a sheet twice", [board.clone(), board].concat()),
        ("a cracked sheet", cracked),
        ("blocks", blocks.clone()),
        ("slivers", slivers),
        ("large triangles", large),
        ("leaves", small),
        ("far from the origin", moved.collect()),
    ]
}

/// A point of one of the hard kinds: on a lattice, so that it lies in planes, on edges and vertices of the scene; on a triangle, an ulp
/// beside it; anywhere, near or far.
fn hard_point(random: &mut fastrand::Rng, triangles: &[Triangle], kind: usize) -> DVec3 {
    let t = triangles.get(random.usize(..triangles.len().max(1)));
    let [a, b, c] = t.copied().unwrap_or(Triangle::new(Vec3::X, Vec3::Y, Vec3::Z)).vertices_f64();
    let origin = if a.length() > 10.0 { dvec3(1e6, -3e5, 2e5) } else { DVec3::ZERO };
    let any = DVec3::from_array([(); 3].map(|()| 3.0 * random.f64() - 1.5));
    let (s, r) = (random.f64(), random.f64());
    match kind % 9 {
        0 => a,
        1 => a + (b - a) * 0.5,
        2 => a + (b - a) * 1.5,
        3 => (a + b + c) / 3.0,
        4 => a + (b - a) * (s * 0.5) + (c - a) * (r * 0.5),
        5 => (a + (b - a) * 2.0 + (c - a) * s).with_z(c.z + 1e-16),
        6 => origin + any * 50.0,
        7 => origin + (any * 4.0).round() * 0.25,
        _ => origin + any,
    }
}

/// Every certain answer is that of the twin: at both ends of all intervals and some ulps about them, where rounding decides, on vertices and edges, in
/// between. And what is open is what is not dark, and what the parts say is the same.
#[track_caller]
fn check(case: &str, triangles: &[Triangle], bvh: &Bvh, light: DVec3, segment: &Segment, place: f64) -> [usize; 3] {
    let lit = LitIntervals::new(bvh, light, segment);
    let mut places = vec![0.0, 1.0, 0.5, place];
    let mut last = -1.0;
    for [begin, end] in lit.open() {
        assert!(last < begin && begin < end && end <= 1.0, "{case}: {lit:?}");
        places.extend([begin, end, 0.5 * (begin + end), begin + (end - begin) * 0.9]);
        last = end;
    }
    last = -1.0;
    for ([begin, end], _) in lit.parts() {
        assert!(last < begin && begin <= end && end <= 1.0, "{case}: {lit:?}");
        places.extend([begin, end, begin.next_down(), end.next_up()]);
        last = end;
    }
    places.extend(lit.shade.as_flattened());
    places.extend(lit.dark.iter().flatten().map(|end| end.t));
    places.extend(lit.shade.windows(2).map(|w| 0.5 * (w[0][1] + w[1][0])));
    let mut counts = [0; 3];
    for place in places {
        for ulps in [-40_i64, -9, -2, -1, 0, 1, 2, 9, 40] {
            let t = place + ulps as f64 * f64::EPSILON / 2.0 * place.abs().max(0.01);
            let t = if t.is_finite() { t.clamp(0.0, 1.0) } else { continue };
            let truth = occluded(triangles, segment.at(t), light);
            let answer = lit.answer(t);
            match answer {
                Answer::Unoccluded => assert!(!truth, "{case}: lit at {t:e}, {light} {segment:?} {lit:?}"),
                Answer::Occluded => assert!(truth, "{case}: dark at {t:e}, {light} {segment:?} {lit:?}"),
                Answer::Unknown => {}
            }
            counts[answer as usize] += 1;
            let open = lit.open().any(|[begin, end]| begin < t && t < end);
            assert!(open || answer == Answer::Occluded || t == 0.0 || t == 1.0, "{case}: {t:e} {lit:?}");
            assert!(!open || answer != Answer::Occluded, "{case}: {t:e} {lit:?}");
            let of_parts = lit.parts().find(|([begin, end], _)| (begin..=end).contains(&&t)).map(|(_, answer)| answer);
            assert_eq!(of_parts.unwrap_or(Answer::Occluded), answer, "{case}: {t:e} {lit:?}");
        }
    }
    counts
}

#[test]
fn what_is_certain_is_exact() {
    let mut random = fastrand::Rng::with_seed(17);
    for (name, triangles) in scenes() {
        let bvh = Bvh::new(&triangles);
        let mut counts = [0; 3];
        for i in 0..400 {
            let light = hard_point(&mut random, &triangles, i);
            let p = hard_point(&mut random, &triangles, i / 9);
            let q = match i % 7 {
                // The light on the line, an end at the light, no length, an ulp.
                0 => light + (light - p) * 0.5,
                1 => light,
                2 if i % 3 == 0 => p,
                2 => p.with_x(p.x + p.x.abs().max(1e-3) * f64::EPSILON),
                _ => hard_point(&mut random, &triangles, i / 5 + 4),
            };
            let of_this = check(&format!("{name} {i}"), &triangles, &bvh, light, &Segment::new(p, q), 0.3);
            counts.iter_mut().zip(of_this).for_each(|(sum, n)| *sum += n);
        }
        // All three answers are met, or the test would prove little.
        assert!(triangles.is_empty() || counts.iter().all(|&n| n > 100), "{name}: {counts:?}");
    }
}

/// From anywhere to anywhere, guard bands are next to nothing, and where shadows meet at shared edges there are none: a sheet's shadow is one
/// interval.
#[test]
fn next_to_nothing_is_unknown() {
    let mut random = fastrand::Rng::with_seed(23);
    let mut sheets = 0;
    for (name, triangles) in scenes() {
        let bvh = Bvh::new(&triangles);
        let (mut unknown, mut n) = (0.0, 0);
        for _ in 0..400 {
            let [light, p, q] = [(); 3].map(|()| hard_point(&mut random, &triangles, 8));
            let lit = LitIntervals::new(&bvh, light, &Segment::new(p, q));
            unknown += lit.unknown_share();
            n += 1;
            if name == "a sheet" && light.z * p.z < 0.0 && p.z * q.z > 0.0 {
                sheets += usize::from(!lit.shade.is_empty());
                assert!(lit.dark.len() <= 1 && lit.open().count() <= 2, "{lit:?}");
            }
        }
        // Guard bands are as long as the rounding of the coordinates makes them.
        let bound = match name {
            "leaves" => 0.1,
            "far from the origin" => 1e-6,
            "slivers" => 1e-8,
            _ => 1e-9,
        };
        assert!(unknown < bound * f64::from(n), "{name}: {unknown} of {n}");
    }
    assert!(sheets > 50, "{sheets}");
}

/// What is too complex is unknown, as is what is not finite.
#[test]
fn what_is_too_much_is_unknown() {
    let stripes: Vec<_> = (0..100_u8)
        .flat_map(|i| sheet(Vec3::new(f32::from(i) * 0.02 - 1.0, -1.0, 0.0), Vec3::X * 0.01, Vec3::Y * 2.0, 1))
        .collect();
    let bvh = Bvh::new(&stripes);
    let light = dvec3(0.0, 0.1, 1.0);
    let along = |length: f64| Segment::new(dvec3(-length, 0.1, -1.0), dvec3(length, 0.2, -1.0));
    let few = LitIntervals::new(&bvh, light, &along(0.14));
    assert!(few.open().count() > 6 && few.unknown_share() < 1e-9, "{few:?}");
    // Too many pieces; too many triangles, although they have one shadow.
    let pile = vec![stripes[100]; MOST_TRIANGLES as usize + 1];
    for (bvh, length) in [(&bvh, 2.0), (&Bvh::new(&pile), 0.3)] {
        let lit = LitIntervals::new(bvh, light, &along(length));
        assert!(lit.dark.is_empty() && lit.unknown_share() == 1.0, "{lit:?}");
    }
    let fewer = LitIntervals::new(&Bvh::new(&pile[1..]), light, &along(0.3));
    assert!(fewer.dark.len() == 1 && fewer.unknown_share() < 1e-9, "{fewer:?}");
    // No query from what is not finite is occluded.
    for (p, q) in [(DVec3::NAN, DVec3::ZERO), (dvec3(f64::NAN, 0.0, -1.0), DVec3::ONE), (DVec3::ZERO, DVec3::INFINITY)]
    {
        let lit = LitIntervals::new(&bvh, light, &Segment::new(p, q));
        assert!(lit.dark.is_empty(), "{p} {q}");
        assert!(LitIntervals::new(&bvh, p, &along(0.14)).dark.is_empty(), "{p}");
    }
    // Nothing is left to be looked at behind what hides all.
    let wall = sheet(Vec3::new(-9.0, -9.0, 0.5), Vec3::X * 18.0, Vec3::Y * 18.0, 1);
    let lit = LitIntervals::new(&Bvh::new(&wall), light, &along(2.0));
    assert_eq!((lit.open().count(), lit.answer(0.0), lit.answer(1.0)), (0, Answer::Occluded, Answer::Occluded));
}

/// Two triangles that share an edge and leave a notch at its end: ways that pass by the vertex, on it and below it by next to nothing, are not
/// dark because the two shadows end and begin at one edge.
#[test]
fn a_notch_is_not_dark() {
    let [v, w, a, b] =
        [[0.0, 0.0], [0.0078125, 0.03125], [-0.5, -1.0], [0.5, -1.25]].map(|[x, y]| Vec3::new(0.25 + x, 0.5 + y, 0.0));
    let dart = [Triangle::new(v, w, a), Triangle::new(w, v, b)];
    let bvh = Bvh::new(&dart);
    let mut random = fastrand::Rng::with_seed(29);
    let mut bridged = 0;
    for i in 0..3000 {
        let light = dvec3(0.25 + (random.f64() - 0.5) * 0.1, 0.5, 1.0 + random.f64());
        let slope = 0.2 * (random.f64() - 0.5);
        let below = [0.0, 1e-16, -1e-16, 1e-15, 3e-15, 1e-14, 3e-14, 1e-13][i % 8];
        // Through the vertex's image in the plane of the segment, by rounding at least.
        let image = light + (v.as_dvec3() - light) * (2.0 + random.f64());
        let at = |x: f64| dvec3(image.x + x, image.y + slope * x - below, image.z);
        let segment = Segment::new(at(-0.02), at(0.02 + random.f64() * 0.03));
        let place = (image.x - segment.p.x) / (segment.q.x - segment.p.x);
        check(&format!("{i}"), &dart, &bvh, light, &segment, place);
        bridged += usize::from(LitIntervals::new(&bvh, light, &segment).dark.len() == 1);
    }
    assert!(bridged < 2000, "{bridged}");
}
