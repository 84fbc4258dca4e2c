//! The wedge against a loop over all triangles.

use glam::{DVec3, Vec3};

use super::*;
use crate::{Bvh, SegmentTest};

/// Triangles on a coarse lattice, its neighbours in single precision, and anywhere; large ones, small ones and slivers.
fn soup(random: &mut fastrand::Rng, count: usize, unit: f32) -> Vec<Triangle> {
    let lattice = |random: &mut fastrand::Rng| {
        Vec3::from_array([(); 3].map(|()| {
            let x = f32::from(random.i8(-4..=4)) * 0.25;
            [x, x, x.next_up(), x.next_down(), random.f32() * 2.0 - 1.0][random.usize(..5)]
        }))
    };
    (0..count)
        .map(|i| {
            let a = lattice(random);
            let size = [2.0, 0.1, 0.01][i % 3];
            let mut near = || a + (lattice(random) - a) * size;
            Triangle { vertices: [a, near(), near()].map(|v| v * unit) }
        })
        .collect()
}

/// Whatever stands between a point of the segment and the apex is visited: from points anywhere, on lattice planes, on vertices, on the line
/// itself, far away; in any unit. And little else is: of small triangles no more than those within their own size of the wedge.
#[test]
fn what_stands_in_the_way_is_visited() {
    let mut random = fastrand::Rng::with_seed(7);
    let (mut hits, mut visited, mut all) = (0, 0_usize, 0_usize);
    for round in 0..150 {
        let unit = 2.0_f32.powi([0, 0, 0, -20, -100, -135, 90][round % 7]);
        let triangles = soup(&mut random, 1 + round % 60, unit);
        let bvh = Bvh::new(&triangles);
        for i in 0..12 {
            let mut point = |kind: usize| {
                let [x, y, z] = [(); 3].map(|()| 2.5 * random.f64() - 1.25);
                let p = match kind {
                    0 => triangles[random.usize(..triangles.len())].vertices_f64()[0] / f64::from(unit),
                    1 => DVec3::new((4.0 * x).round() * 0.25, (4.0 * y).round() * 0.25, z),
                    2 => DVec3::new(x, y, z) * 1e4,
                    _ => DVec3::new(x, y, z),
                };
                p * f64::from(unit)
            };
            let (mut apex, mut p, mut q) = (point(i % 4), point(i / 2 % 5), point(i / 3 % 6));
            match i {
                9 => q = p,
                10 => q = apex + (apex - p) * 0.5,
                11 => q = p + (q - p) * 1e-12,
                // Through the scene from far away to far away, in a plane whose normal is exact: rounding moves the ways out of it.
                1 | 4 | 7 => {
                    let v = triangles[random.usize(..triangles.len())].vertices_f64()[i % 3] / f64::from(unit);
                    let beside = v + DVec3::X * [0.0, 1.0, -1.0][random.usize(..3)] * 2.0_f64.powi(-16);
                    let far = |z: f64| DVec3::new(1.0, -1.0, z) * 2.0_f64.powi(36);
                    let ways = [beside + far(0.5), beside - far(0.3), beside - far(0.9)];
                    [apex, p, q] = ways.map(|p| p * f64::from(unit));
                }
                _ => {}
            }
            let segment = Segment::new(p, q);
            let mut seen = Vec::new();
            bvh.visit_wedge(apex, &segment, |t| {
                seen.push(*t);
                ControlFlow::Continue(())
            });
            visited += seen.len();
            all += triangles.len();
            let targets = triangles.iter().take(4).map(|t| {
                // Where the way to the segment passes the triangle's vertex, if it does: hits at edges are the last to be lost.
                let normal = (p - apex).cross(q - apex);
                let v = t.vertices_f64()[0] - apex;
                let across = normal.cross(v);
                let (a, b) = (across.dot(p - apex), across.dot(q - apex));
                if a != b { (a / (a - b)).clamp(0.0, 1.0) } else { 0.5 }
            });
            for t in targets.chain([0.0, 1.0, 0.5]) {
                for t in [t, t.next_up().min(1.0), t.next_down().max(0.0)] {
                    let way = Segment::new(segment.at(t), apex);
                    let test = SegmentTest::new(way, bvh.bounds().min, bvh.bounds().max);
                    for triangle in triangles.iter().filter(|t| test.intersect(t).is_some()) {
                        hits += 1;
                        assert!(seen.contains(triangle), "round {round}, {i}: {way:?} {triangle:?}");
                    }
                }
            }
        }
    }
    assert!(hits > 5000 && visited * 2 < all, "{hits} {visited} of {all}");
}

/// Boxes and triangles that do not meet the wedge by a thousandth are not asked about: small triangles about a wedge, each beyond its plane or
/// beyond one of its sides.
#[test]
fn what_stands_beside_is_not_visited() {
    let (apex, p, q) = (DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.9, 0.3, 0.1), DVec3::new(0.2, 0.9, 0.8));
    let normal = (p - apex).cross(q - apex).normalize();
    let middle = (apex + p + q) / 3.0;
    let mut beside = Vec::new();
    let mut random = fastrand::Rng::with_seed(3);
    for i in 0..600 {
        let edge = [[apex, p], [p, q], [q, apex]][i % 3];
        let on = edge[0] + (edge[1] - edge[0]) * random.f64();
        let out = (edge[1] - edge[0]).cross(normal).normalize();
        let at = match i % 4 {
            0 => middle + (on - middle) * random.f64() + normal * 2e-3,
            1 => middle + (on - middle) * random.f64() - normal * 2e-3,
            _ => on + out * 2e-3,
        };
        let vertices = [(); 3].map(|()| at + DVec3::from_array([(); 3].map(|()| (random.f64() - 0.5) * 1e-3)));
        beside.push(Triangle { vertices: vertices.map(|v| v.as_vec3()) });
    }
    let bvh = Bvh::new(&beside);
    bvh.visit_wedge(apex, &Segment::new(p, q), |t| panic!("{t:?}"));
    let mut count = 0;
    let above = normal * 2e-3;
    bvh.visit_wedge(apex + above, &Segment::new(p + above, q + above), |_| {
        count += 1;
        if count == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(count, 3);
}
