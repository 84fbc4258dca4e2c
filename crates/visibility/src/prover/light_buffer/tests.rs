//! Light buffers against a loop of exact tests over all triangles.

use glam::{DVec3, Vec3, dvec3};
use pulp::Arch;
use vdf_geometry::{Segment, Triangle, intersect_exact};

use super::*;
use crate::{QueryKind, ShadowQuery};

/// The slow twin.
fn occluded(triangles: &[Triangle], from: DVec3, light: DVec3) -> bool {
    let segment = Segment::new(from, light);
    triangles.iter().any(|t| intersect_exact(&segment, t).is_some())
}

const fn query(from: DVec3, to: DVec3) -> ShadowQuery {
    ShadowQuery { from, to, emitter: 0, kind: QueryKind::Spatial }
}

fn quad(corners: [[f32; 3]; 4]) -> [Triangle; 2] {
    let [a, b, c, d] = corners.map(Vec3::from_array);
    [Triangle::new(a, b, c), Triangle::new(a, c, d)]
}

/// The six walls of a box from `min` to `max`, each a grid of `cells` × `cells` quads.
fn walls(min: Vec3, max: Vec3, cells: u16) -> Vec<Triangle> {
    let mut all = Vec::new();
    for axis in 0..3 {
        for side in [min[axis], max[axis]] {
            let at = |i: u16, j: u16| {
                let mut p = Vec3::ZERO;
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                p[axis] = side;
                p[u] = min[u] + (max[u] - min[u]) * f32::from(i) / f32::from(cells);
                p[v] = min[v] + (max[v] - min[v]) * f32::from(j) / f32::from(cells);
                p.to_array()
            };
            for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
                all.extend(quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]));
            }
        }
    }
    all
}

fn random_point(random: &mut fastrand::Rng, size: f64) -> DVec3 {
    DVec3::from_array([(); 3].map(|()| size * (2.0 * random.f64() - 1.0)))
}

/// Small triangles anywhere in the cube of ±1.
fn leaves(random: &mut fastrand::Rng, count: usize, size: f64) -> Vec<Triangle> {
    (0..count)
        .map(|_| {
            let o = random_point(random, 1.0);
            let [a, b] = [(); 2].map(|()| (o + random_point(random, size)).as_vec3());
            Triangle::new(o.as_vec3(), a, b)
        })
        .collect()
}

/// Scenes with what is hard for sheets: pinholes, T-junctions, cracks, duplicates, two-sided stacks, triangles seen edge-on.
fn scenes() -> Vec<(&'static str, Vec<Triangle>, DVec3)> {
    let mut random = fastrand::Rng::with_seed(21);
    let room = walls(Vec3::NEG_ONE, Vec3::ONE, 4);
    let inner = walls(Vec3::splat(-0.3), Vec3::new(0.25, 0.125, 0.4), 3);
    let with = |more: &[Triangle]| room.iter().chain(more).copied().collect::<Vec<_>>();
    let light = dvec3(0.5, 0.625, -0.4375);
    let mut scenes = vec![
        ("nothing", vec![], light),
        ("one triangle", vec![room[0]], light),
        ("a room", room.clone(), light),
        ("a box in a room", with(&inner), light),
        ("leaves in a room", with(&leaves(&mut random, 300, 0.1)), light),
        ("leaves", leaves(&mut random, 2000, 0.03), dvec3(0.1, 0.2, 0.3)),
        ("large triangles", leaves(&mut random, 40, 1.5), dvec3(0.1, 0.2, 0.3)),
        ("light outside", inner.clone(), dvec3(3.0, 0.1, 0.2)),
        ("light far outside", inner.clone(), dvec3(90.0, 40.0, 250.0)),
        ("light in the plane of a wall, beside it", inner.clone(), dvec3(0.25, 0.5, 0.0)),
        ("light near a wall", with(&inner), dvec3(1.0 - 1e-9, 0.3, 0.2)),
        ("light nearer to a wall", with(&inner), dvec3(1.0_f64.next_down(), 0.25, 0.25)),
        ("light before an edge", with(&inner), dvec3(1.0 - 1e-6, 1.0 - 1e-6, 0.0)),
        ("a two-sided room", with(&room), light),
    ];
    let mut pinhole = with(&inner);
    pinhole.remove(7);
    scenes.push(("a pinhole", pinhole, light));
    let mut cracked = with(&inner);
    for t in cracked.iter_mut().step_by(5) {
        let v = &mut t.vertices[1];
        v.x = v.x.next_up();
        v.z = v.z.next_down();
    }
    scenes.push(("cracks of an ulp", cracked, light));
    let mut t_junctions = walls(Vec3::NEG_ONE, Vec3::ONE, 2);
    t_junctions.extend(walls(Vec3::splat(-0.5), Vec3::splat(0.5), 1));
    t_junctions.splice(0..2, quad([[-1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]]));
    scenes.push(("T-junctions", t_junctions, light));
    let mut duplicated = with(&inner);
    duplicated.extend(inner.iter().step_by(3).copied());
    scenes.push(("duplicates", duplicated, light));
    let offset = Vec3::new(1e6, -3e5, 2e5);
    let moved = with(&inner).iter().map(|t| Triangle { vertices: t.vertices.map(|v| v + offset) }).collect();
    scenes.push(("far from the origin", moved, light + offset.as_dvec3()));
    scenes
}

/// A point to ask from, of one of the hard kinds: through edges and vertices of triangles and of texels, seams and diagonals of the cube, on
/// surfaces and just off them, in depths of ulps around a surface.
fn hard_point(random: &mut fastrand::Rng, triangles: &[Triangle], light: DVec3, kind: usize) -> DVec3 {
    let t = triangles.get(random.usize(..triangles.len().max(1))).copied();
    let [a, b, c] = t.unwrap_or(Triangle::new(Vec3::X, Vec3::Y, Vec3::Z)).vertices_f64();
    let (s, r) = (random.f64(), random.f64());
    let inside = a + (b - a) * (s * 0.5) + (c - a) * (r * 0.5);
    let lift = (b - a).cross(c - a).normalize_or_zero() * (a.abs().max_element() / 4_294_967_296.0);
    let beyond = |on: DVec3, reach: f64| light + (on - light) * reach;
    match kind % 12 {
        0 => {
            random_point(random, 1.2)
                + (a - a.signum().clamp(DVec3::NEG_ONE, DVec3::ONE)) * f64::from(a.length() > 10.0)
        }
        1 => inside + lift,
        2 => inside - lift,
        3 => beyond(inside, 1.0 + random.f64() * 1e-9),
        4 => beyond(inside, 1.0 - random.f64() * 1e-3),
        5 => beyond(a + (b - a) * s, 0.5 + r),
        6 => beyond(a, 0.5 + r),
        7 => {
            // A border of texels, or the seams and diagonals of the cube, moved by some ulps.
            let step = 2.0 / 64.0;
            let mut d = DVec3::from_array([(); 3].map(|()| 1.0 - step * f64::from(random.u8(..=64))));
            d[random.usize(..3)] = if random.bool() { 1.0 } else { -1.0 };
            if random.bool() {
                let (i, j) = (random.usize(..3), random.usize(..3));
                d[i] = d[j].abs() * d[i].signum();
            }
            let axis = random.usize(..3);
            d[axis] = if random.bool() { d[axis].next_up() } else { d[axis].next_down() };
            if random.bool() {
                // By ulps of single precision, in which places are found.
                d[axis] += f64::from(random.i8(-3..=3)) / 16_777_216.0;
            }
            light + d * (0.01 + 2.0 * random.f64())
        }
        8 => (a + b + c) / 3.0,
        9 => light + random_point(random, 1e-9),
        10 => light + random_point(random, 1e6),
        _ => beyond(inside, 1.0 + 3e-10 * random.f64()) + random_point(random, 1e-12),
    }
}

#[test]
fn answers_are_those_of_a_loop() {
    let mut random = fastrand::Rng::with_seed(4);
    for (name, triangles, light) in scenes() {
        for side in [64, 128] {
            let buffer = LightBuffer::build(&triangles, light, side, 1 << 30).expect(name);
            let (mut known, mut tests, mut blocked) = (0, 0, 0);
            const ASKED: usize = 12_000;
            let mut together = (Vec::new(), Vec::new());
            for kind in 0..ASKED {
                let from = hard_point(&mut random, &triangles, light, kind);
                let LookUp { answer, tests: n } = buffer.look_up(from);
                assert_eq!(buffer.answer_in_space(from), answer, "{name}, {side}: {from:?} by squares");
                let truth = occluded(&triangles, from, light);
                assert!(
                    answer == Answer::Unknown || (answer == Answer::Occluded) == truth,
                    "{name}, {side}: {from:?} is {truth}, not {answer:?} after {n} tests"
                );
                together.0.push(query(from, light));
                together.1.push(answer);
                // Towards edges, vertices and points of the very surface an answer would be luck.
                if !matches!(kind % 12, 1 | 2 | 3 | 5 | 6 | 8 | 11) {
                    known += usize::from(answer != Answer::Unknown);
                    tests += n;
                    blocked += usize::from(truth);
                }
            }
            // Every number of queries at once, with every instruction set.
            for arch in [Arch::new(), Arch::Scalar] {
                let (mut rest, mut count) = ((&together.0[..], &together.1[..]), 0);
                while !rest.0.is_empty() {
                    count = (count % 70 + 1).min(rest.0.len());
                    let mut answers = vec![Answer::Unknown; count];
                    assert_eq!(buffer.answer_run(arch, 0, &rest.0[..count], &mut answers), count);
                    assert_eq!(answers, rest.1[..count], "{name}, {side}, {arch:?}: {:?}", &rest.0[..count]);
                    rest = (&rest.0[count..], &rest.1[count..]);
                }
            }
            // Where the light nearly touches a plane that plane leaves much open.
            let share = if name.starts_with("light") { 60 } else { 97 };
            assert!(known * 100 >= ASKED * 5 / 12 * share, "{name}: {known} known, {tests} tests, {blocked} blocked");
        }
    }
}

#[test]
fn a_light_on_an_occluder_or_far_away_has_no_buffer() {
    let room = walls(Vec3::NEG_ONE, Vec3::ONE, 2);
    let build = |light| LightBuffer::build(&room, light, 64, 1 << 30).err();
    assert_eq!(build(dvec3(1.0, 0.25, 0.3)), Some(Refusal::OnOccluder));
    assert_eq!(build(dvec3(1.0, 1.0, 0.3)), Some(Refusal::OnOccluder), "on an edge");
    assert_eq!(build(DVec3::ONE), Some(Refusal::OnOccluder), "in a corner");
    assert_eq!(build(dvec3(1.0_f64.next_down(), 0.25, 0.3)), None);
    assert_eq!(build(dvec3(1e5, 0.0, 0.0)), Some(Refusal::FarAway));
    assert_eq!(LightBuffer::build(&room, DVec3::ZERO, 64, 1000).err(), Some(Refusal::Memory));
    for side in [1 << 14, 1 << 16, u32::MAX] {
        assert_eq!(LightBuffer::build(&room, DVec3::ZERO, side, u64::MAX).err(), Some(Refusal::Memory), "{side}");
    }
    assert_eq!(build(dvec3(0.0, f64::NAN, 0.0)), Some(Refusal::NotFinite));
    for size in [1e-30, 1e30] {
        let room = walls(Vec3::splat(-size), Vec3::splat(size), 2);
        assert_eq!(LightBuffer::build(&room, DVec3::ZERO, 64, 1 << 30).err(), Some(Refusal::Range), "{size}");
    }
    let mut torn = room.clone();
    torn[5].vertices[1].y = f32::INFINITY;
    assert_eq!(LightBuffer::build(&torn, DVec3::ZERO, 64, 1 << 30).err(), Some(Refusal::NotFinite));
}

#[test]
fn nothing_is_said_about_what_is_no_point() {
    let room = walls(Vec3::NEG_ONE, Vec3::ONE, 2);
    let light = dvec3(0.1, 0.2, 0.3);
    let buffer = LightBuffer::build(&room, light, 64, 1 << 30).expect("a buffer");
    let one_is_none = DVec3::ONE.with_y(f64::NAN);
    for from in [DVec3::NAN, one_is_none, DVec3::INFINITY, DVec3::X * f64::NAN, DVec3::Y * f64::NEG_INFINITY, light] {
        assert_eq!(buffer.answer(from), Answer::Unknown, "{from}");
        let mut together = [Answer::Occluded; 9];
        assert_eq!(buffer.answer_run(Arch::new(), 0, &[query(from, light); 9], &mut together), 9);
        assert_eq!(together, [Answer::Unknown; 9], "{from}");
    }
    assert_eq!(buffer.answer(DVec3::X * 1e30), Answer::Occluded);
    assert_eq!(buffer.answer(DVec3::X * 1e300), Answer::Unknown, "too far for single precision");
}

#[test]
fn it_is_the_same_for_any_number_of_threads() {
    let mut random = fastrand::Rng::with_seed(8);
    // A swarm of small triangles in a few texels of a room, which are divided.
    let swarm = leaves(&mut random, 5000, 0.04).into_iter();
    let swarm = swarm.map(|t| Triangle { vertices: t.vertices.map(|v| v * 0.05 + 0.5) });
    let triangles: Vec<_> = swarm.chain(walls(Vec3::NEG_ONE, Vec3::ONE, 4)).collect();
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| LightBuffer::build(&triangles, DVec3::ZERO, 64, 1 << 30).expect("a buffer"))
    };
    let one = build(1);
    assert_eq!(one, build(3));
    assert!(one.tables.view().entries().skip(1).any(|e| e.last == 1), "it has lists");
    assert!(one.tables.view().texels().any(|t| t.tag.kind() == Tag::PARTS), "it has parts");
    // Where they are they are asked.
    for _ in 0..4000 {
        let from = DVec3::splat(0.5) + random_point(&mut random, 0.06);
        let answer = one.answer(from);
        let truth = occluded(&triangles, from, DVec3::ZERO);
        assert!(answer == Answer::Unknown || (answer == Answer::Occluded) == truth, "{from}");
    }
}

/// Triangles behind each other in every direction, whose lists nothing makes shorter: refused, and soon.
#[test]
fn memory_is_bounded_before_it_is_taken() {
    let room = walls(Vec3::NEG_ONE, Vec3::ONE, 1);
    let many: Vec<_> = (0..400).flat_map(|_| room.clone()).collect();
    let build = |max_bytes| LightBuffer::build(&many, dvec3(0.1, 0.2, 0.3), 64, max_bytes);
    assert_eq!(build(10 << 20).err(), Some(Refusal::Memory));
    let buffer = build(1 << 30).expect("it fits");
    let view = buffer.tables.view();
    let parts = view.texels().filter(|t| t.tag.kind() == Tag::PARTS).count();
    assert!(parts * 20 < view.texels().count(), "nearly all parts would have the same lists, not {parts} others");
}
