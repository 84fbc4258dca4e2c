//! The set of regions against the winding number, along paths that do their best to lose count.

use glam::{DMat3, Vec3, dvec3, vec3};

use super::*;
use crate::Sampler;

fn cuboid(min: Vec3, max: Vec3, turn: DMat3, shift: DVec3) -> Vec<Triangle> {
    let corner = |i: u8| {
        let p = vec3(
            if i & 1 == 0 { min.x } else { max.x },
            if i & 2 == 0 { min.y } else { max.y },
            if i & 4 == 0 { min.z } else { max.z },
        );
        (turn * p.as_dvec3() + shift).as_vec3()
    };
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        .iter()
        .flat_map(|&[a, b, c, d]| {
            let [a, b, c, d] = [a, b, c, d].map(corner);
            [Triangle::new(a, b, c), Triangle::new(a, c, d)]
        })
        .collect()
}

fn boundary(triangles: Vec<Triangle>, medium: u32) -> Boundary {
    Boundary { triangles, interior: Some(MediumId(medium)), exterior: None, ..Boundary::default() }
}

fn turned(angle: f64) -> DMat3 {
    DMat3::from_axis_angle(dvec3(1.0, 2.0, -0.5).normalize(), angle)
}

/// Boxes that touch, that share corners and edges, that overlap and that lie in each other.
fn cluster(turn: DMat3, shift: DVec3) -> Vec<Boundary> {
    [
        (vec3(0.0, 0.0, 0.0), vec3(1.0, 1.0, 1.0)),
        (vec3(1.0, 0.0, 0.0), vec3(2.0, 1.0, 1.0)),
        (vec3(0.0, 1.0, 0.0), vec3(1.0, 2.0, 1.0)),
        (vec3(0.5, 0.5, 0.5), vec3(1.5, 1.5, 1.5)),
        (vec3(0.25, 0.25, 0.25), vec3(0.75, 0.75, 0.75)),
        (vec3(-1.0, -1.0, -1.0), vec3(3.0, 3.0, 3.0)),
        (vec3(1.0, 1.0, 1.0), vec3(2.0, 2.0, 2.0)),
    ]
    .into_iter()
    .zip(0..)
    .map(|((min, max), medium)| boundary(cuboid(min, max, turn, shift), medium))
    .collect()
}

/// A path of many segments between points on a coarse lattice, on faces, edges and corners, and beside them by rounding: at each vertex that is
/// on no boundary the set is what the winding numbers say.
#[test]
fn a_path_never_loses_count() {
    let mut compared = 0;
    for (case, (angle, shift)) in
        [(0.0, DVec3::ZERO), (0.7, DVec3::ZERO), (0.0, dvec3(1e4, -2e4, 5e3)), (2.1, dvec3(-3e4, 1e4, 1e4))]
            .into_iter()
            .enumerate()
    {
        let turn = turned(angle);
        let regions = Regions::new(&[], &cluster(turn, shift), None);
        let clear = 4.0 * f64::from(f32::EPSILON) * (4.0 + shift.abs().max_element());
        let ulp = 2.0 * f64::EPSILON * (4.0 + shift.abs().max_element());
        for walk in 0..300 {
            let mut u = Sampler::new(case as u64, walk, 0, 0);
            let mut here = shift + turn * dvec3(-5.0, 0.3, 0.7);
            let mut set = regions.at(here);
            for _ in 0..60 {
                let mut coordinate = || {
                    let lattice = (u.next_1d() * 17.0).floor() * 0.25 - 1.0;
                    match (u.next_1d() * 4.0) as u32 {
                        0 => lattice,
                        1 => lattice + 0.125,
                        2 => lattice + ulp,
                        _ => u.next_1d() * 4.5 - 1.25,
                    }
                };
                let local = dvec3(coordinate(), coordinate(), coordinate());
                let there = shift + turn * local;
                set = regions.at_end(&Segment::new(here, there), &set);
                here = there;
                // On a boundary, or so close that single precision decides where it is, both answers are right.
                let beside = (local * 4.0 - (local * 4.0).round()).abs() * 0.25;
                if beside.min_element() > clear {
                    compared += 1;
                    assert_eq!(set, regions.at(here), "case {case}, walk {walk}, at {here}");
                }
            }
        }
    }
    assert!(compared > 7000, "{compared}");
}

/// Boxes are crossed where their triangles are, in the same order and the same way, wherever they say so; and they do for nearly all segments that are not
/// on a lattice. Places differ by rounding.
#[test]
fn boxes_are_crossed_where_their_triangles_are() {
    for (case, shift) in [DVec3::ZERO, dvec3(1e4, -2e4, 5e3)].into_iter().enumerate() {
        let regions = Regions::new(&[], &cluster(DMat3::IDENTITY, shift), None);
        let (mut certain, mut any) = (0, 0);
        for i in 0..40_000 {
            let mut u = Sampler::new(70 + case as u64, i, 0, 0);
            let kind = i % 4;
            let mut coordinate = || match (u.next_1d() * 4.0) as u32 {
                0 if kind > 0 => (u.next_1d() * 17.0).floor() * 0.25 - 1.0,
                1 if kind > 1 => (u.next_1d() * 5.0).floor() - 1.0 + 1e-11 * (u.next_1d() - 0.5),
                _ => u.next_1d() * 6.0 - 2.0,
            };
            let mut point = || shift + dvec3(coordinate(), coordinate(), coordinate());
            let s = Segment::new(point(), point());
            any += i32::from(kind == 0);
            let (mut of_boxes, mut of_all) = (Crossings::new(), Crossings::new());
            if !regions.cross_boxes(&s, &mut of_boxes) {
                continue;
            }
            regions.cross_all(&s, &mut of_all);
            certain += i32::from(kind == 0);
            // Exact, for these are boxes.
            let around = |p: DVec3| -> RegionSet {
                let inside = |e: &Extent| p.cmpgt(e.bounds.min).all() && p.cmplt(e.bounds.max).all();
                (0..).zip(&regions.extents).filter(|(_, e)| inside(e)).map(|(region, _)| region).collect()
            };
            let start = around(s.p);
            let close = 2.0 * regions.tolerance(&s);
            let walk = |crossings: &Crossings| {
                let mut set = start.clone();
                let mut changes = Vec::new();
                for c in crossings {
                    if c.enters != set.contains(c.region) {
                        set.set(c.region, c.enters);
                        changes.push((c.t, c.region, c.enters));
                    }
                }
                changes.sort_by_key(|c| c.1);
                // Rounding may decide whether an edge is passed.
                while let Some(i) = changes.windows(2).position(|c| c[0].1 == c[1].1 && c[1].0 - c[0].0 < close) {
                    changes.drain(i..i + 2);
                }
                (set, changes)
            };
            let ((end, a), (end_of_all, b)) = (walk(&of_boxes), walk(&of_all));
            assert_eq!(end, around(s.q), "{s:?}");
            // The others ask winding numbers where an end is on a face but for rounding.
            let beside = |p: DVec3| ((p - shift) * 4.0 - ((p - shift) * 4.0).round()).abs().min_element() < 1e-6;
            if beside(s.p) || beside(s.q) {
                continue;
            }
            assert_eq!(end, end_of_all, "{s:?}");
            assert!(a.len() == b.len(), "{s:?}: {a:?}, {b:?}");
            for (a, b) in a.iter().zip(&b) {
                assert!(a.1 == b.1 && a.2 == b.2 && (a.0 - b.0).abs() < close, "{s:?}: {a:?}, {b:?}");
            }
        }
        assert!(certain * 1000 > any * 999, "{certain} of {any}");
    }
}

#[test]
fn the_innermost_is_the_smallest_and_then_the_last() {
    let boxes = cluster(DMat3::IDENTITY, DVec3::ZERO);
    let regions = Regions::new(&[], &boxes, Some(MediumId(99)));
    let medium = |p: DVec3| regions.medium(&regions.at(p));
    assert_eq!(medium(dvec3(9.0, 0.0, 0.0)), Some(MediumId(99)));
    assert_eq!(medium(dvec3(-0.5, 0.0, 0.0)), Some(MediumId(5)));
    assert_eq!(medium(dvec3(0.1, 0.1, 0.1)), Some(MediumId(0)));
    assert_eq!(medium(dvec3(0.4, 0.4, 0.4)), Some(MediumId(4)));
    // In the boxes 0 and 3, of one size.
    assert_eq!(medium(dvec3(0.9, 0.9, 0.9)), Some(MediumId(3)));
}

/// A boundary wound inwards has its interior outside, as in Mitsuba.
#[test]
fn an_inward_boundary_is_turned_around() {
    let mut inward = cuboid(Vec3::ZERO, Vec3::ONE, DMat3::IDENTITY, DVec3::ZERO);
    inward.iter_mut().for_each(|t| t.vertices.swap(1, 2));
    let regions = Regions::new(&[], &[boundary(inward, 0)], Some(MediumId(0)));
    let (inside, outside) = (regions.at(DVec3::splat(0.5)), regions.at(DVec3::splat(1.5)));
    assert_eq!((regions.medium(&inside), regions.medium(&outside)), (None, Some(MediumId(0))));
    let out = Segment::new(DVec3::splat(0.5), dvec3(0.5, 0.6, 7.0));
    assert_eq!(regions.at_end(&out, &inside), outside);
    assert_eq!(regions.at_end(&Segment::new(out.q, out.p), &outside), inside);
}

/// Very many boundaries are asked of the hierarchy, not one by one, and give the same.
#[test]
fn many_boundaries_are_as_good_as_few() {
    let puff = |i: u32| {
        let x = i as f32 * 3.0;
        boundary(cuboid(vec3(x, 0.0, 0.0), vec3(x + 1.0, 1.0, 1.0), DMat3::IDENTITY, DVec3::ZERO), i)
    };
    let many = Regions::new(&[], &(0..1000).map(puff).collect::<Vec<_>>(), None);
    for i in [0_u32, 7, 999] {
        let middle = dvec3(f64::from(i) * 3.0 + 0.5, 0.5, 0.5);
        let inside = many.at(middle);
        assert_eq!(many.medium(&inside), Some(MediumId(i)));
        assert!(many.are_not_crossed(&Segment::new(middle, middle + 0.25)));
        let out = Segment::new(middle, middle + dvec3(0.1, 0.2, 4.0));
        assert!(!many.are_not_crossed(&out));
        assert_eq!(many.at_end(&out, &inside), RegionSet::default());
    }
    let (mut length, mut parts) = (0.0, 0);
    let through = Segment::new(dvec3(-1.0, 0.5, 0.4), dvec3(3001.0, 0.5, 0.6));
    let _ = many.walk(&through, &RegionSet::default(), |i, _| {
        if i.medium.is_some() {
            length += (i.t1 - i.t0) * through.length();
            parts += 1;
        }
        ControlFlow::<()>::Continue(())
    });
    assert!(parts == 1000 && (length - 1000.0).abs() < 1e-4, "{parts} {length}");
}

/// Two open shells and the wall between them, which names the medium of either side: two regions; with equal media one.
#[test]
fn open_boundaries_close_together() {
    use vdf_scene::{Phase, Rgb};
    let cube = |x: f32| cuboid(vec3(x, 0.0, 0.0), vec3(x + 1.0, 1.0, 1.0), DMat3::IDENTITY, DVec3::ZERO);
    let at_wall = |t: &Triangle| t.vertices.iter().all(|v| v.x == 1.0);
    let (wall, left): (Vec<_>, Vec<_>) = cube(0.0).into_iter().partition(at_wall);
    let right: Vec<_> = cube(1.0).into_iter().filter(|t| !at_wall(t)).collect();
    let wall =
        Boundary { triangles: wall, interior: Some(MediumId(0)), exterior: Some(MediumId(1)), ..Boundary::default() };
    let boundaries = [boundary(left, 0), boundary(right, 1), wall];
    let medium = |sigma_t| Medium::new(sigma_t, Rgb::ONE, Phase::Isotropic);
    for (media, expected) in [
        ([medium(1.0), medium(2.0)], [Some(MediumId(0)), Some(MediumId(1))]),
        ([medium(1.0), medium(1.0)], [Some(MediumId(0)); 2]),
    ] {
        let regions = Regions::new(&media, &boundaries, None);
        let s = Segment::new(dvec3(-1.0, 0.4, 0.4), dvec3(3.0, 0.5, 0.6));
        let mut found = Vec::new();
        let end = regions.walk(&s, &RegionSet::default(), |i, _| {
            found.push(i.medium);
            ControlFlow::<()>::Continue(())
        });
        found.dedup();
        let mut wanted = vec![None, expected[0], expected[1], None];
        wanted.dedup();
        assert_eq!(found, wanted);
        assert!(matches!(end, ControlFlow::Continue(Some(set)) if set == RegionSet::default()));
    }
}
