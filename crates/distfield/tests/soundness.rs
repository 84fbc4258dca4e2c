//! No proof is wrong in the continuum: proved segments miss every triangle, by exact arithmetic on the very numbers.

use glam::{DVec3, Vec3};
use proptest::prelude::*;
use robust::{Coord, Coord3D, orient2d, orient3d};
use vdf_distfield::{
    Amr, Dsz, Dual, ExtendedNeighbourhood, Ndf, Neighbourhood, SafeNeighbourhood, SafeZones, VoxelBox,
};
use vdf_voxel::{Span, VoxelGrid, voxelize};

fn sign(x: f64) -> i8 {
    i8::from(x > 0.0) - i8::from(x < 0.0)
}

fn side3(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> i8 {
    let at = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    sign(orient3d(at(a), at(b), at(c), at(d)))
}

fn side2(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> i8 {
    let at = |p: [f64; 2]| Coord { x: p[0], y: p[1] };
    sign(orient2d(at(a), at(b), at(c)))
}

fn same_side(signs: [i8; 3]) -> bool {
    signs.iter().all(|&s| s >= 0) || signs.iter().all(|&s| s <= 0)
}

fn segments_meet(p: [f64; 2], q: [f64; 2], a: [f64; 2], b: [f64; 2]) -> bool {
    let boxes = (0..2).all(|i| p[i].min(q[i]) <= a[i].max(b[i]) && a[i].min(b[i]) <= p[i].max(q[i]));
    boxes && side2(p, q, a) * side2(p, q, b) <= 0 && side2(a, b, p) * side2(a, b, q) <= 0
}

fn meets_flat(p: [f64; 2], q: [f64; 2], t: [[f64; 2]; 3]) -> bool {
    let [a, b, c] = t;
    let inside = side2(a, b, c) != 0 && same_side([side2(a, b, p), side2(b, c, p), side2(c, a, p)]);
    inside || segments_meet(p, q, a, b) || segments_meet(p, q, b, c) || segments_meet(p, q, c, a)
}

/// Exact unless products underflow: does the closed segment touch the closed triangle, degenerate or not?
fn hits(p: DVec3, q: DVec3, t: [DVec3; 3]) -> bool {
    let [a, b, c] = t;
    let (from, to) = (side3(a, b, c, p), side3(a, b, c, q));
    if from * to > 0 {
        return false;
    }
    let through = same_side([side3(p, q, a, b), side3(p, q, b, c), side3(p, q, c, a)]);
    if from != 0 || to != 0 {
        return through;
    }
    // All in one plane, or the triangle has none. Then they touch iff they do in all projections: one of the
    // projections keeps the plane. A triangle without a plane is a segment, which must be in a plane with the other
    // one.
    through
        && [[0, 1], [1, 2], [2, 0]].iter().all(|&[u, v]| {
            let flat = |p: DVec3| [p[u], p[v]];
            meets_flat(flat(p), flat(q), t.map(flat))
        })
}

#[test]
fn the_exact_test_is_right() {
    let v = DVec3::new;
    let t = [v(0.0, 0.0, 0.0), v(4.0, 0.0, 0.0), v(0.0, 4.0, 0.0)];
    assert!(hits(v(1.0, 1.0, -1.0), v(1.0, 1.0, 1.0), t));
    assert!(hits(v(1.0, 1.0, 0.0), v(1.0, 1.0, 1.0), t), "touches with an end");
    assert!(hits(v(2.0, 2.0, -1.0), v(2.0, 2.0, 1.0), t), "through an edge");
    assert!(hits(v(4.0, 0.0, 1.0), v(4.0, 0.0, -1.0), t), "through a vertex");
    assert!(!hits(v(1.0, 1.0, 0.1), v(1.0, 1.0, 1.0), t), "ends before");
    assert!(!hits(v(2.1, 2.1, -1.0), v(2.1, 2.1, 1.0), t), "misses");
    assert!(hits(v(-1.0, 1.0, 0.0), v(9.0, 1.0, 0.0), t), "in the plane");
    assert!(!hits(v(3.0, 3.0, 0.0), v(9.0, 1.0, 0.0), t), "in the plane, but beside");
    let line = [v(0.0, 0.0, 0.0), v(2.0, 2.0, 2.0), v(4.0, 4.0, 4.0)];
    assert!(hits(v(3.0, 3.0, 0.0), v(3.0, 3.0, 9.0), line) && !hits(v(3.0, 3.1, 0.0), v(3.0, 3.1, 9.0), line));
    let point = [v(1.0, 1.0, 1.0); 3];
    assert!(hits(v(0.0, 0.0, 0.0), v(2.0, 2.0, 2.0), point) && !hits(v(0.0, 0.0, 0.0), v(0.5, 0.5, 0.5), point));
}

/// The scene is within 0…SIDE on each axis, and many coordinates are whole: they are faces of voxels for most sizes.
const SIDE: i32 = 42;

fn vertex() -> impl Strategy<Value = [f32; 3]> {
    let whole = prop_oneof![0..=SIDE, (0..=14).prop_map(|c| 3 * c), (0..=8).prop_map(|c| 5 * c)].prop_map(|c| c as f32);
    prop::array::uniform3(prop_oneof![4 => whole, 1 => 0f32..42.0, 1 => Just(-0.0)])
}

fn triangle() -> impl Strategy<Value = [[f32; 3]; 3]> {
    let near = || prop::array::uniform3(-4..=4i32);
    let plus = |a: [f32; 3], d: [i32; 3]| [0, 1, 2].map(|i| (a[i] + d[i] as f32).clamp(0.0, SIDE as f32));
    prop_oneof![
        6 => (vertex(), near(), near()).prop_map(move |(a, d, e)| [a, plus(a, d), plus(a, e)]),
        1 => prop::array::uniform3(vertex()),
        1 => (vertex(), near()).prop_map(move |(a, d)| [a, plus(a, d), a]),
        // Collinear: the computed normal is nothing but rounding error.
        1 => (prop::array::uniform3(12..=30i32), near(), -3..=3i32).prop_map(|(a, d, n)| {
            [0, 1, n].map(|n| [0, 1, 2].map(|i| (a[i] + n * d[i]) as f32))
        }),
        1 => (prop::array::uniform3(vertex()), 0..3usize).prop_map(|(t, axis)| t.map(|mut v| { v[axis] = t[0][axis]; v })),
    ]
}

/// How an end of a segment is chosen.
#[derive(Clone, Debug)]
enum End {
    /// Anywhere, even outside.
    At([f64; 3]),
    /// A point of triangle `.0` with weights in quarters, moved by whole numbers and by steps of the last place.
    On(prop::sample::Index, [i32; 2], [i32; 3], [i8; 3]),
}

fn end() -> impl Strategy<Value = End> {
    let coordinate =
        prop_oneof![4 => -10f64..60.0, 2 => (-3..50i32).prop_map(f64::from), 1 => Just(-0.0), 1 => -1e7f64..1e7];
    prop_oneof![
        1 => prop::array::uniform3(coordinate).prop_map(End::At),
        3 => (
            any::<prop::sample::Index>(),
            prop::sample::select(vec![[4, 0], [0, 4], [0, 0], [2, 2], [2, 0], [1, 1], [2, 1]]),
            prop::array::uniform3(prop_oneof![3 => Just(0), 2 => -3..=3i32]),
            prop::array::uniform3(prop_oneof![3 => Just(0i8), 1 => -1i8..=1]),
        )
            .prop_map(|(triangle, weights, offset, steps)| End::On(triangle, weights, offset, steps)),
    ]
}

/// Two ends, or one point and a vector to both ends on either side: then the point is in the middle of the segment,
/// exactly so if the sums are representable.
fn segment() -> impl Strategy<Value = (End, End, Option<[f64; 3]>)> {
    let exponent = prop::sample::select(vec![0, 1, 4, 20, 40, 44]);
    let vector = (prop::array::uniform3(-9i32..=9), exponent)
        .prop_map(|(d, exponent)| d.map(|c| f64::from(c) * 2f64.powi(exponent)));
    (end(), end(), prop_oneof![2 => Just(None), 1 => vector.prop_map(Some)])
}

fn resolve(end: &End, triangles: &[[Vec3; 3]]) -> DVec3 {
    match end {
        End::At(p) => DVec3::from_array(*p),
        End::On(triangle, [wa, wb], offset, steps) => {
            let [a, b, c] = triangle.get(triangles).map(Vec3::as_dvec3);
            let (wa, wb) = (f64::from(*wa), f64::from(*wb));
            let mut p = (a * wa + b * wb + c * (4.0 - wa - wb)) / 4.0;
            for axis in 0..3 {
                p[axis] += f64::from(offset[axis]);
                // Next to 0 a step is denormal, and products with it underflow: the predicates are exact only without.
                p[axis] = match (steps[axis], p[axis] == 0.0) {
                    (0, _) => p[axis],
                    (step, true) => f64::from(step) * 1e-30,
                    (1, false) => p[axis].next_up(),
                    _ => p[axis].next_down(),
                };
            }
            p
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3_000))]

    #[test]
    fn proved_segments_hit_nothing(
        triangles in prop::collection::vec(triangle(), 1..6),
        size in prop::sample::select(vec![1.0, 3.0, 5.0, 7.0, 0.7, 1.0 / 3.0 * 7.0, 2.1]),
        origin in prop::array::uniform3(-9i32..=0),
        shift in prop_oneof![4 => Just(0.0f32), 1 => Just(524_288.0f32), 1 => Just(-999_999.0f32)],
        ends in prop::collection::vec(segment(), 60),
    ) {
        let triangles: Vec<[Vec3; 3]> = triangles.iter().map(|t| t.map(|v| Vec3::from_array(v) + shift)).collect();
        let shift = DVec3::splat(shift.into());
        let origin = DVec3::from_array(origin.map(f64::from)) + shift;
        let grid = VoxelGrid::covering(origin, DVec3::splat(SIDE.into()) + shift, size, 1 << 30).expect("a legal grid");
        let occupied = voxelize(&grid, triangles.clone()).expect("finite vertices");
        let (ndf, amr) = (Ndf::build(&occupied), Amr::build(&occupied));
        let (dsz, dual) = (Dsz::build(&occupied), Dual::build(&occupied));
        for (a, b, vector) in &ends {
            let a = resolve(a, &triangles) + if matches!(a, End::At(_)) { shift } else { DVec3::ZERO };
            let b = resolve(b, &triangles) + if matches!(b, End::At(_)) { shift } else { DVec3::ZERO };
            let (a, b) = match vector {
                Some(d) => (a - DVec3::from_array(*d), a + DVec3::from_array(*d)),
                None => (a, b),
            };
            let proved = match grid.voxel_span(a, b) {
                Span::Outside => true,
                Span::Inside(u, v) => {
                    prop_assert!(grid.resolution().contains(u) && grid.resolution().contains(v));
                    let inside = grid.voxel_containing(a).is_some() && grid.voxel_containing(b).is_some();
                    let leaves = || (grid.leaves_through(a, b), grid.leaves_through(b, a));
                    let by_face = || dsz.proves_leaving(u, v, || leaves().0, || leaves().1);
                    let by_cuboid = ndf.proves(u, v) || amr.proves(u, v) || dsz.proves(u, v) || dual.proves(u, v);
                    by_cuboid || (inside && by_face())
                }
            };
            if proved {
                for t in &triangles {
                    prop_assert!(!hits(a, b, t.map(Vec3::as_dvec3)), "{a} {b} hits {t:?}");
                }
            }
        }
        // One light: bits instead of queries; and an area light, whose points are anywhere on the segment between two.
        let [light, other] = [&ends[0].0, &ends[0].1].map(|end| resolve(end, &triangles));
        if let (Some(voxel), Some(end)) = (grid.voxel_containing(light), grid.voxel_containing(other)) {
            let near = SafeNeighbourhood::new(&amr, &occupied, voxel);
            let extended = ExtendedNeighbourhood::new(&occupied, voxel.into());
            let area = ExtendedNeighbourhood::new(&occupied, VoxelBox::spanning(voxel, end));
            for (n, (_, b, _)) in (0u32..).zip(&ends) {
                let b = resolve(b, &triangles);
                let Some(u) = grid.voxel_containing(b) else { continue };
                let between = light.lerp(other, f64::from(n % 5) / 4.0);
                // Rounding may put a point between the two into a voxel next to their box.
                let sampled = grid.voxel_containing(between).is_some_and(|v| VoxelBox::spanning(voxel, end).contains(v));
                let proved = [
                    (near.proves(u) || extended.proves(u)).then_some(light),
                    (area.proves(u) && sampled).then_some(between),
                ];
                for a in proved.into_iter().flatten() {
                    for t in &triangles {
                        prop_assert!(!hits(a, b, t.map(Vec3::as_dvec3)), "{a} {b} hits {t:?}");
                    }
                }
            }
        }
    }
}
