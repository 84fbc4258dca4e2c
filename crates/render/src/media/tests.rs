//! What is said of a box without a look at its triangles, against the walk over them: the same box with one more triangle, without area,
//! which is met by nothing, is not taken for a closed box.

use glam::{DVec3, Vec3, dvec3, vec3};
use vdf_geometry::Triangle;
use vdf_scene::{Phase, Rgb};

use super::{extent::Extent, *};
use crate::Sampler;

const FOG: MediumId = MediumId(0);

/// The twelve triangles of a box, normals outwards; `turned` picks the diagonals.
fn cuboid(min: Vec3, max: Vec3, turned: u32) -> Vec<Triangle> {
    let mut triangles = vec![];
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for high in [false, true] {
            let corner = |a: bool, b: bool| {
                let mut p = if high { max } else { min };
                (p[u], p[v]) = (if a { max } else { min }[u], if b { max } else { min }[v]);
                p
            };
            let mut ring = [corner(false, false), corner(true, false), corner(true, true), corner(false, true)];
            ring.rotate_left((turned >> (2 * axis + usize::from(high)) & 1) as usize);
            if !high {
                ring.reverse();
            }
            triangles.extend([[0, 1, 2], [0, 2, 3]].map(|[a, b, c]| Triangle::new(ring[a], ring[b], ring[c])));
        }
    }
    triangles
}

fn media(triangles: Vec<Triangle>, sigma_t: f64) -> Media {
    let medium = Medium::new(sigma_t, Rgb::ONE, Phase::Isotropic);
    Media::new(&[medium], &[Boundary { triangles, interior: Some(FOG), exterior: None, ..Boundary::default() }], None)
}

fn is_closed(triangles: &[Triangle]) -> bool {
    Extent::of(triangles).closed_box
}

#[test]
fn a_box_is_closed_if_nothing_is_missing() {
    for turned in 0..64 {
        let whole = cuboid(vec3(-1.0, 2.0, 0.5), vec3(3.0, 2.5, 9.0), turned);
        assert!(is_closed(&whole));
        let inwards: Vec<_> =
            whole.iter().map(|t| Triangle::new(t.vertices[0], t.vertices[2], t.vertices[1])).collect();
        assert!(is_closed(&inwards));
        for i in 0..12 {
            let changed = |f: &dyn Fn(&mut Vec<Triangle>)| {
                let mut changed = whole.clone();
                f(&mut changed);
                assert!(Extent::of(&changed).shell || !is_closed(&changed));
                is_closed(&changed)
            };
            assert!(
                !changed(&|t| {
                    t.remove(i);
                }),
                "one missing"
            );
            let but_one: Vec<_> = inwards.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, t)| *t).collect();
            assert!(!is_closed(&but_one), "inwards, one missing");
            assert!(!changed(&|t| t[i].vertices.swap(0, 1)), "one turned over");
            assert!(!changed(&|t| t[i] = whole[(i + 1) % 12]), "one twice");
            assert!(!changed(&|t| t[i] = whole[(i + 6) % 12]), "a face without and one with too much");
            assert!(!changed(&|t| t.push(whole[i])), "one too many");
            assert!(!changed(&|t| t[i].vertices[0] = whole[i].vertices[1]), "one without area");
            assert!(!changed(&|t| t[i].vertices[1].z += 0.25), "one out of place");
            assert!(!changed(&|t| {
                // The same half of a face as the other triangle's, from another corner.
                let other = t[i ^ 1].vertices;
                t[i].vertices = [other[1], other[2], other[0]];
            }));
            let across = [whole[i].vertices[0], whole[i].vertices[1], whole[(i + 2) % 12].vertices[2]];
            assert!(!changed(&|t| t[i].vertices = across) || across == whole[i].vertices, "across the box");
        }
    }
    assert!(!is_closed(&[]));
    assert!(!is_closed(&cuboid(Vec3::ZERO, vec3(1.0, 0.0, 1.0), 0)), "flat");
}

/// Points in and about a box, of those where rounding could matter more than by chance.
fn point(u: &mut Sampler, min: DVec3, max: DVec3) -> DVec3 {
    let mut p = DVec3::ZERO;
    for k in 0..3 {
        let size = max[k] - min[k];
        let ulp = |x: f64, n: f64| x + n * f64::EPSILON * x.abs();
        p[k] = match (u.next_1d() * 12.0) as u32 {
            0 => min[k],
            1 => max[k],
            2 => ulp(min[k], 2.0),
            3 => ulp(max[k], -2.0),
            4 => ulp(max[k], 2.0),
            5 => min[k] - size * 1e6 * u.next_1d(),
            6 => max[k] + size * 1e-12 * u.next_1d(),
            7 => max[k] + size * u.next_1d(),
            8 => min[k] + size * 0.5,
            _ => min[k] + size * u.next_1d(),
        };
    }
    p
}

#[test]
fn a_box_and_its_triangles_say_the_same() {
    let boxes = [
        (vec3(-26.0, -16.0, -790.0), vec3(584.0, 566.0, 560.0)),
        (Vec3::ZERO, Vec3::ONE),
        (vec3(1e6, -1e6, 3.0), vec3(1e6 + 1.0, -1e6 + 0.5, 3.0 + 1e-6)),
        (vec3(-1e-20, -2e-20, 0.0), vec3(1e-20, 2e-20, 5e-20)),
    ];
    let (mut left, mut short, mut gone, mut compared) = (0, 0, 0, 0);
    for (n, (min, max)) in (0..).zip(boxes) {
        let triangles = cuboid(min, max, 0b01_1010 + n);
        let extent = Extent::of(&triangles);
        let mut with_another = triangles.clone();
        with_another.push(Triangle::new(min, min, max.with_x(min.x)));
        let diagonal = f64::from((max - min).length());
        let (fast, slow) = (media(triangles, 0.3 / diagonal), media(with_another, 0.3 / diagonal));
        assert!(fast.regions.is_one_box() && !slow.regions.is_one_box());
        let (min, max) = (min.as_dvec3(), max.as_dvec3());
        for i in 0..60_000 {
            let mut u = Sampler::new(7, i, n, 0);
            let p = point(&mut u, min, max);
            let segment = Segment::new(p, point(&mut u, min, max));
            let segment = if i % 3 == 0 { Segment::new(p, p + (segment.q - p) * 1e6) } else { segment };
            let tau = match i % 4 {
                0 => 0.0,
                // Just about where the segment ends.
                1 => 0.3 / diagonal * segment.length() * (1.0 + (u.next_1d() - 0.5) * 1e-15),
                _ => -(-u.next_1d()).ln_1p(),
            };
            let found = fast.short_flight(&segment, FOG, tau);
            assert_eq!(found, slow.short_flight(&segment, FOG, tau), "{segment:?}, {tau}");
            short += u32::from(matches!(found, ShortFlight::Collides(_)));
            let t = tau / (0.3 / diagonal * segment.length());
            left += u32::from(extent.is_left(&Segment::new(p, segment.at(t.min(1.0)))));
            let start = slow.regions_at(p);
            let (flight, depth) = (slow.free_flight(&segment, &start, tau), slow.optical_depth(&segment, &start));
            if fast.leaves_for_good(&segment, FOG, tau) {
                gone += 1;
                assert_eq!(flight, FreeFlight::Passed(RegionSet::default()), "{segment:?}, {tau}");
            }
            let intervals = fast.intervals(&segment, &start);
            // Exact for a box, wherever the crossings were rounded to.
            let beside = |end: DVec3| end.cmpeq(min).any() || end.cmpeq(max).any();
            if !beside(segment.p) && !beside(segment.q) {
                let inside = segment.q.cmpgt(min).all() && segment.q.cmplt(max).all();
                assert_eq!(!intervals.end().is_empty(), inside, "{segment:?}");
            }
            // Where the segment hardly moves along the axis of a face that it crosses, the crossing of a triangle is rounded far more than the box's.
            let (p, q) = (segment.p, segment.q);
            let moves = |k: &usize| [min[*k], max[*k]].iter().any(|face| (p[*k] < *face) != (q[*k] < *face));
            let grazes = |k: usize| (p[k].abs() + q[k].abs()).max(segment.length()) > 1e3 * (q[k] - p[k]).abs();
            // Nor are winding numbers to be trusted where an end is on the box but for rounding.
            let apart = |end: DVec3| (end - min).abs().min((end - max).abs()).min_element() > 1e-9 * diagonal;
            if !apart(p) || !apart(q) || [0, 1, 2].into_iter().filter(moves).any(grazes) {
                continue;
            }
            compared += 1;
            assert_eq!(intervals.end(), &slow.at_end(&segment, &start), "{segment:?}");
            // Crossings may differ by what counts as one place, at either end of the part in the box; and where the segment starts far away, its places
            // are rounded by more than that.
            let others = slow.intervals(&segment, &start);
            let parts = intervals.parts().chain(others.parts());
            let far = parts.filter(|i| i.medium.is_some()).map(|i| i.t1).fold(0.0, f64::max);
            let doubt = 2.0 * slow.doubt(&segment) + 4e3 * f64::EPSILON * far;
            let of_depth = 0.3 / diagonal * segment.length() * doubt + 1e-15 * depth;
            let of_box = intervals.optical_depth();
            assert!((of_box - depth).abs() <= of_depth, "{segment:?}: {of_box} {depth}");
            match (intervals.free_flight(tau), flight) {
                (FreeFlight::Passed(a), FreeFlight::Passed(b)) => assert_eq!(a, b),
                (FreeFlight::Collision { t: a, .. }, FreeFlight::Collision { t: b, .. }) => {
                    assert!((a - b).abs() <= doubt, "{segment:?}, {tau}: {a} {b}");
                }
                (a, b) => assert!((tau - depth).abs() <= of_depth, "{segment:?}, {tau}: {a:?} {b:?}"),
            }
        }
    }
    assert!(compared > 5000, "{compared}");
    assert!(left > 2000 && short > 2000 && gone > 2000, "{left} left the box, {short} did not, {gone} for good");
}

/// A box in a larger medium, and two boxes: whoever leaves one is not gone for good.
#[test]
fn nobody_is_gone_for_good_where_something_may_come() {
    let segment = Segment::new(dvec3(0.5, 0.5, 0.5), dvec3(0.5, 0.5, 50.0));
    let shape = cuboid(Vec3::ZERO, Vec3::ONE, 0);
    let fog = Medium::new(1.0, Rgb::ONE, Phase::Isotropic);
    let alone = Boundary { triangles: shape.clone(), interior: Some(FOG), exterior: None, ..Boundary::default() };
    assert!(
        Media::new(std::slice::from_ref(&fog), std::slice::from_ref(&alone), None).leaves_for_good(&segment, FOG, 2.0)
    );
    assert!(
        !Media::new(std::slice::from_ref(&fog), std::slice::from_ref(&alone), Some(FOG))
            .leaves_for_good(&segment, FOG, 2.0)
    );
    let behind = Boundary { triangles: cuboid(vec3(0.0, 0.0, 3.0), vec3(1.0, 1.0, 9.0), 0), ..alone.clone() };
    assert!(!Media::new(std::slice::from_ref(&fog), &[alone, behind], None).leaves_for_good(&segment, FOG, 2.0));
}

/// Fog without an end and without boundaries is everywhere; only where there is none either nothing is asked.
#[test]
fn fog_outside_of_all_boundaries_is_somewhere() {
    let medium = Medium::new(0.5, Rgb::ONE, Phase::Isotropic);
    let segment = Segment::new(DVec3::ZERO, dvec3(0.0, 6.0, 8.0));
    for (ambient, tau) in [(Some(FOG), 5.0), (None, 0.0)] {
        let media = Media::new(std::slice::from_ref(&medium), &[], ambient);
        assert_eq!(media.optical_depth(&segment, &RegionSet::default()), tau);
        let flight = media.free_flight(&segment, &RegionSet::default(), 1.0);
        assert_eq!(matches!(flight, FreeFlight::Collision { t, .. } if t == 0.2), tau > 0.0, "{flight:?}");
        assert_eq!(media.are_nowhere(), tau == 0.0);
    }
}
