//! Cases in which ray tracers and grid marchers are known to have failed, as segments here: each is asked of the hierarchy, of every
//! method and of a loop over all triangles, in both directions. The numbers in the comments are those of the project's list of
//! hard cases; those about voxelization and distance fields alone are tested in their crates.

use glam::{DVec3, Vec3, dvec3, vec3};
use vdf_geometry::{Bounds, Bvh, Segment, Triangle, intersect_exact};
use vdf_render::Lights;
use vdf_scene::{Emitter, LoadOptions, Rgb, Scene};
use vdf_visibility::{Answer, LightShape, Method, ProverOptions, Provers, QueryKind, Quiet, ShadowQuery};

/// Triangles, lights, and all methods on grids of several voxel sizes.
struct Fixture {
    triangles: Vec<Triangle>,
    lights: Vec<DVec3>,
    bvh: Bvh,
    provers: Vec<Provers>,
}

/// What all agree on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Found {
    occluded: bool,
    /// Proofs made by all methods on all grids, in both directions.
    proofs: usize,
}

fn answer(provers: &Provers, emitter: Option<usize>, from: DVec3, to: DVec3) -> Answer {
    emitter.map_or_else(
        || provers.answer_between(from, to),
        |emitter| provers.answer(&ShadowQuery { from, to, emitter, kind: QueryKind::Spatial }),
    )
}

impl Fixture {
    /// Grids cover `min` to `max`, in which the triangles have to lie.
    fn new(triangles: Vec<Triangle>, lights: &[DVec3], (min, max): (DVec3, DVec3), sizes: &[f64]) -> Self {
        let shapes: Vec<_> = lights.iter().map(|&position| LightShape::Point(position)).collect();
        let build = |method, voxel_size| {
            let options = ProverOptions { method, voxel_size, max_voxels: 1 << 24, ..ProverOptions::default() };
            Provers::build(&options, &triangles, Bounds::new(min, max), &shapes, &Quiet).expect("a sound grid").0
        };
        let provers =
            sizes.iter().flat_map(|&s| Method::all().map(move |m| (m, s))).map(|(m, s)| build(m, s)).collect();
        Self { bvh: Bvh::new(&triangles), triangles, lights: lights.to_vec(), provers }
    }

    /// Everybody must agree, in both directions.
    #[track_caller]
    fn ask(&self, p: DVec3, q: DVec3) -> Found {
        let occluded = self.triangles.iter().any(|t| intersect_exact(&Segment::new(p, q), t).is_some());
        let mut proofs = 0;
        for (from, to) in [(p, q), (q, p)] {
            let segment = Segment::new(from, to);
            assert_eq!(self.bvh.occluded(&segment), occluded, "{segment:?}");
            assert_eq!(self.bvh.intersect(&segment).is_some(), occluded, "{segment:?}");
            let light = self.lights.iter().position(|&l| l == to);
            for acceleration in &self.provers {
                for emitter in [None, light] {
                    match answer(acceleration, emitter, from, to) {
                        Answer::Unknown => continue,
                        Answer::Unoccluded => assert!(!occluded, "{segment:?} {emitter:?}"),
                        Answer::Occluded => assert!(occluded, "{segment:?} {emitter:?}"),
                    }
                    proofs += 1;
                }
            }
        }
        Found { occluded, proofs }
    }

    #[track_caller]
    fn occluded(&self, p: DVec3, q: DVec3) {
        assert!(self.ask(p, q).occluded, "{p} {q}");
    }

    #[track_caller]
    fn free(&self, p: DVec3, q: DVec3) {
        assert!(!self.ask(p, q).occluded, "{p} {q}");
    }

    #[track_caller]
    fn proved(&self, p: DVec3, q: DVec3) {
        let found = self.ask(p, q);
        assert!(!found.occluded && found.proofs > 0, "{p} {q}: {found:?}");
    }
}

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    dvec3(x, y, z)
}

/// The square from (low, low) to (high, high) at height `z`, as two triangles.
fn square(low: f32, high: f32, z: f32) -> Vec<Triangle> {
    let [a, b, c, d] = [[low, low], [high, low], [high, high], [low, high]].map(|[x, y]| vec3(x, y, z));
    vec![Triangle::new(a, b, c), Triangle::new(a, c, d)]
}

/// The box 0…8.
const BOX: (DVec3, DVec3) = (DVec3::ZERO, DVec3::splat(8.0));

/// A table at z = 4 in the middle of the box; voxel faces at whole numbers, and at none.
fn table() -> Fixture {
    let lights = [v(4.0, 4.0, 7.0), v(1.0, 1.0, 1.0), v(4.5, 4.5, 4.25), v(8.0, 8.0, 8.0), v(4.0, 4.0, 4.0)];
    Fixture::new(square(2.0, 6.0, 4.0), &lights, BOX, &[1.0, 0.3, 0.7])
}

/// A number and its neighbours in the last place.
fn around(x: f64) -> [f64; 3] {
    // Next to 0 steps are denormal, which is beyond what the predicates promise.
    if x == 0.0 { [-1e-60, -0.0, 1e-60] } else { [x.next_down(), x, x.next_up()] }
}

fn points_around(p: DVec3) -> impl Iterator<Item = DVec3> {
    let [x, y, z] = p.to_array().map(around);
    x.into_iter().flat_map(move |x| y.into_iter().flat_map(move |y| z.map(|z| v(x, y, z))))
}

/// 4: Triangles without area, collinear or a point, block nothing. To the voxels they are there, so nothing near them is proved but by the
/// light buffer, which has none of them.
#[test]
fn case_04_triangles_without_area() {
    let line = Triangle::new(vec3(2.0, 2.0, 2.0), vec3(6.0, 6.0, 6.0), vec3(4.0, 4.0, 4.0));
    let point = Triangle::new(Vec3::splat(4.0), Vec3::splat(4.0), Vec3::splat(4.0));
    let doubled = Triangle::new(vec3(2.0, 6.0, 4.0), vec3(6.0, 2.0, 4.0), vec3(2.0, 6.0, 4.0));
    let f = Fixture::new(vec![line, point, doubled], &[v(7.0, 4.0, 4.0)], BOX, &[1.0]);
    for q in [v(7.0, 4.0, 4.0), v(4.0, 4.0, 7.0), v(6.0, 6.0, 6.0)] {
        let found = f.ask(v(8.0, 8.0, 8.0) - q, q);
        assert_eq!(found, Found { occluded: false, proofs: usize::from(f.lights.contains(&q)) });
    }
    f.proved(v(1.0, 7.0, 1.0), v(7.0, 7.0, 1.0));
}

/// 5: A needle 10⁶ times as long as wide is hit through its middle, missed beside it, and not lost by the hierarchy.
#[test]
fn case_05_needle() {
    let needle = Triangle::new(vec3(1.0, 1.0, 1.0), vec3(7.0, 7.0, 7.0), vec3(7.0, 7.0 + 6e-6, 7.0));
    let [a, b, c] = needle.vertices_f64();
    let light = v(7.0, 1.0, 4.0);
    let f = Fixture::new(vec![needle], &[light], BOX, &[1.0, 0.3]);
    for k in 1..100 {
        let middle = a + ((b + c) * 0.5 - a) * (f64::from(k) / 100.0);
        f.occluded(middle * 2.0 - light, light);
        f.free(middle * 2.0 - light + v(0.0, 1e-4, 0.0), light);
    }
}

/// 8: Coordinates of a million, and voxels as small as single precision allows.
#[test]
fn case_08_a_million_from_the_origin() {
    let o = DVec3::splat(1e6);
    let light = o + v(4.0, 4.0, 7.0);
    let f = Fixture::new(square(1e6 + 2.0, 1e6 + 6.0, 1e6 + 4.0), &[light], (o, o + 8.0), &[0.25, 0.3, 1.0]);
    f.occluded(o + v(3.0, 3.0, 1.0), light);
    f.proved(o + v(4.0, 4.0, 6.0), light);
    for p in points_around(o + v(3.0, 3.0, 4.0)) {
        f.ask(p, light);
        f.ask(p, o + v(3.0, 3.0, 4.25));
    }
}

/// 9: Edges of 10⁻²⁰, whose edge functions underflow in single precision.
#[test]
fn case_09_tiny_triangles() {
    let e = 1e-20_f32;
    let size = f64::from(e);
    let tiny = Triangle::new(vec3(0.0, 0.0, 0.0), vec3(e, 0.0, 0.0), vec3(0.0, e, 0.0));
    let f = Fixture::new(vec![tiny], &[v(0.0, 0.0, 1.0)], (DVec3::NEG_ONE, DVec3::ONE), &[0.25, 0.3]);
    for x in [0.0, 0.25, 0.5, 0.75, 1.0, 1.5] {
        let p = v(x * size, 0.125 * size, 0.0);
        assert_eq!(f.ask(p - v(0.0, 0.0, 0.5), p + v(0.0, 0.0, 0.5)).occluded, x < 0.875, "{x}");
    }
    // All of the scene is of this size, so the grid's own numbers are.
    let f = Fixture::new(vec![tiny], &[], (DVec3::ZERO, DVec3::splat(size)), &[size / 8.0]);
    let p = v(0.25, 0.25, 0.0) * size;
    let up = v(0.0, 0.0, 0.125) * size;
    f.occluded(p - up, p + up);
    f.free(p + up, p + up * 2.0);
    f.proved(p + up * 3.0, p + up * 7.0);
}

/// 10: A vertex that is not finite is an error; an end that is not gets no proof, and nothing hangs.
#[test]
fn case_10_not_a_number() {
    let f = table();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut t = square(2.0, 6.0, 4.0);
        t[1].vertices[2].y = bad as f32;
        assert!(Provers::build(&ProverOptions::default(), &t, Bounds::new(BOX.0, BOX.1), &[], &Quiet).is_err());
        for axis in 0..3 {
            let mut p = v(1.0, 1.0, 1.0);
            p[axis] = bad;
            for q in [p, v(7.0, 7.0, 7.0), v(4.0, 4.0, 7.0)] {
                assert!(!f.bvh.occluded(&Segment::new(p, q)));
                assert_eq!(f.bvh.intersect(&Segment::new(q, p)), None);
                for a in &f.provers {
                    assert_eq!(answer(a, None, p, q), Answer::Unknown);
                    assert_eq!(answer(a, Some(0), p, f.lights[0]), Answer::Unknown);
                }
            }
        }
    }
}

/// 12: A flat scene, whose bounds have no extent along one axis.
#[test]
fn case_12_flat_scene() {
    for axis in 0..3 {
        let turn = |p: DVec3| DVec3::from_array([0, 1, 2].map(|k| p[(k + axis) % 3]));
        let turned = |t: &Triangle| Triangle { vertices: t.vertices.map(|v| turn(v.as_dvec3()).as_vec3()) };
        let wall = square(0.0, 8.0, 4.0).iter().map(turned).collect();
        let [min, max] = [v(0.0, 0.0, 4.0), v(8.0, 8.0, 4.0)].map(turn);
        let f = Fixture::new(wall, &[turn(v(3.0, 3.0, 4.0))], (min, max), &[1.0, 0.3]);
        f.occluded(turn(v(3.0, 2.0, 3.0)), turn(v(3.0, 2.0, 5.0)));
        f.proved(turn(v(3.0, 2.0, 5.5)), turn(v(3.0, 2.0, 6.5)));
        // In the plane of the wall nothing is met, and nothing is proved.
        assert_eq!(f.ask(turn(v(1.0, 2.0, 4.0)), turn(v(3.0, 3.0, 4.0))), Found { occluded: false, proofs: 0 });
    }
}

/// 14: Coincident triangles, also with opposite faces: the one with the lower number is met, in whatever order they are found.
#[test]
fn case_14_coincident_faces() {
    let [a, b] = [square(2.0, 6.0, 4.0)[0], square(2.0, 6.0, 4.0)[1]];
    let flipped = |t: Triangle| Triangle::new(t.vertices[0], t.vertices[2], t.vertices[1]);
    // Others above them, so that the tree has something to order.
    let others: Vec<_> = (0..20_u8).flat_map(|i| square(f32::from(i) * 0.1, 8.0, 5.0 + f32::from(i) * 0.125)).collect();
    for copies in [vec![a, flipped(a), b, flipped(b), a, b], vec![flipped(b), b, a, a, flipped(a), flipped(b)]] {
        for triangles in [[copies.clone(), others.clone()].concat(), [others.clone(), copies.clone()].concat()] {
            let bvh = Bvh::new(&triangles);
            for (x, y) in [(5.0, 3.0), (3.0, 5.0), (4.0, 4.0), (2.0, 2.0), (5.5, 2.25)] {
                let ends =
                    [(v(x, y, 1.0), v(x, y, 6.0)), (v(x, y, 4.5), v(x, y, 1.0)), (v(1e12, y, -1e12), v(x, y, 4.0))];
                for (p, q) in ends {
                    let segment = Segment::new(p, q);
                    let hits = (0..).zip(&triangles).filter_map(|(i, t)| Some((intersect_exact(&segment, t)?.t, i)));
                    let (_, first) = hits.min_by(|a: &(f64, u32), b| a.partial_cmp(b).expect("finite")).expect("one");
                    assert_eq!(bvh.intersect(&segment).map(|h| h.triangle), Some(first), "{segment:?}");
                    let mut count = 0;
                    bvh.visit_hits(&segment, |_| count += 1);
                    assert_eq!(count, triangles.iter().filter(|t| intersect_exact(&segment, t).is_some()).count());
                }
            }
        }
    }
}

/// 15: A vertex in the middle of a neighbour's edge: where it lies on the edge exactly, no segment slips through.
#[test]
fn case_15_t_junctions() {
    // One large triangle below y = 4; above it two small ones that meet on its edge.
    let (a, b, m) = (vec3(1.0, 4.0, 4.0), vec3(7.0, 4.0, 4.0), vec3(3.0, 4.0, 4.0));
    let below = Triangle::new(a, vec3(4.0, 1.0, 4.0), b);
    let above = [Triangle::new(a, m, vec3(4.0, 7.0, 4.0)), Triangle::new(m, b, vec3(4.0, 7.0, 4.0))];
    let f = Fixture::new(vec![below, above[0], above[1]], &[v(3.0, 4.0, 7.0)], BOX, &[1.0, 0.3]);
    for k in 1..60 {
        for y in around(4.0) {
            let on_edge = v(1.0 + 0.1 * f64::from(k), y, 4.0);
            for from in [v(3.0, 4.0, 7.0), v(0.5, 7.0, 6.0), v(6.0, 0.125, 7.0)] {
                f.occluded(on_edge * 2.0 - from, from);
            }
        }
    }
}

/// 16: Nearly degenerate normals: the position of a hit stays in range, and everybody agrees.
#[test]
fn case_16_nearly_degenerate_normals() {
    for k in 1..40_i32 {
        let e = 2.0_f32.powi(-k);
        let t = Triangle::new(vec3(1.0, 1.0, 4.0), vec3(7.0, 7.0, 4.0), vec3(4.0, 4.0 + e, 4.0 + e));
        let [a, b, c] = t.vertices_f64();
        let f = Fixture::new(vec![t], &[], BOX, &[1.0]);
        let middle = (a + b + c) / 3.0;
        for from in [v(4.0, 4.0, 7.0), v(7.0, 1.0, 4.0), v(1.0, 7.0, 4.5), a, (a + b) * 0.5] {
            for q in [middle, middle * 2.0 - from, b, c, middle + v(0.0, f64::from(e), 0.0)] {
                f.ask(from, q);
                if let Some(hit) = f.bvh.intersect(&Segment::new(from, q)) {
                    assert!((0.0..=1.0).contains(&hit.t) && hit.barycentric.iter().all(|w| (0.0..=1.0).contains(w)));
                }
            }
        }
    }
}

/// 24: Ends on a face, an edge and a corner of a voxel, and one step of the last place beside.
#[test]
fn case_24_ends_on_faces_edges_and_corners() {
    let f = table();
    let mut proofs = 0;
    for corner in [v(1.0, 1.0, 1.0), v(2.0, 2.0, 4.0), v(3.0, 4.0, 5.0), v(6.0, 6.0, 4.0), v(2.1, 4.2, 3.9)] {
        for p in points_around(corner) {
            for q in [v(4.0, 4.0, 7.0), v(1.0, 1.0, 1.0), v(7.0, 0.5, 3.0), corner, v(2.0, 4.0, 4.0), v(3.0, 3.0, 5.0)]
            {
                proofs += f.ask(p, q).proofs;
            }
        }
    }
    assert!(proofs > 100, "{proofs}");
}

/// 25: Direction components of either zero, and nothing but zeros.
#[test]
fn case_25_zeros_of_either_sign() {
    let lights = [v(0.0, -0.0, 1.0), v(-0.0, 0.0, -1.0), v(-0.0, -0.0, -0.0)];
    let bounds = (DVec3::splat(-4.0), DVec3::splat(4.0));
    let f = Fixture::new(square(-2.0, 2.0, 0.0), &lights, bounds, &[1.0, 0.3]);
    let zeros = [0.0, -0.0];
    for (x, y) in zeros.into_iter().flat_map(|x| zeros.map(|y| (x, y))) {
        f.occluded(v(x, y, -1.0), v(0.0, -0.0, 1.0));
        f.occluded(v(x, y, -0.0), v(0.0, -0.0, 1.0));
        f.occluded(v(x, y, 0.0), v(-0.0, 0.0, -1.0));
        f.free(v(x, y, 1.0), v(-0.0, 0.0, 1e-60));
        f.proved(v(x, y, 3.0), v(0.0, -0.0, 2.5));
        // Even in the wall a segment without length meets nothing.
        f.free(v(x, y, 0.0), v(-0.0, -0.0, -0.0));
        f.free(v(x, y, 3.0), v(y, x, 3.0));
    }
}

/// 26: Parallel to an axis in the plane of voxel faces, of the grid's border and of the hierarchy's boxes.
#[test]
fn case_26_along_grid_planes() {
    let f = table();
    let mut proofs = 0;
    for axis in 0..3 {
        for (a, b) in [(0.0, 8.0), (1.0, 1.0), (2.0, 2.0), (4.0, 4.0), (8.0, 8.0), (2.0, 4.0), (-0.0, 3.0)] {
            let at = |x| {
                let mut p = DVec3::splat(x);
                (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (a, b);
                p
            };
            for (from, to) in [(0.0, 8.0), (-1.0, 9.0), (1.0, 3.0), (4.0, 7.0), (6.0, 6.0), (1e6, 1.0)] {
                proofs += f.ask(at(from), at(to)).proofs;
            }
        }
    }
    assert!(proofs > 100, "{proofs}");
    f.occluded(v(4.0, 4.0, 8.0), v(4.0, 4.0, 0.0));
    f.free(v(0.0, 4.0, 4.0), v(8.0, 4.0, 4.0));
}

/// 27: Diagonals through the corners of voxels.
#[test]
fn case_27_diagonals_through_corners() {
    let f = table();
    for signs in 0..8_u8 {
        let d = DVec3::from_array([1, 2, 4].map(|bit| if signs & bit == 0 { 1.0 } else { -1.0 }));
        for k in 1..8 {
            let corner = DVec3::splat(f64::from(k));
            for (s, t) in [(-9.0, 9.0), (-1.0, 1.0), (0.0, 3.0), (-0.5, 0.0), (0.25, 1e6)] {
                f.ask(corner + d * s, corner + d * t);
            }
        }
    }
    f.occluded(DVec3::ZERO, DVec3::splat(8.0));
    f.proved(v(1.0, 1.0, 7.0), v(7.0, 1.0, 7.0));
}

/// 28: Start and target are equal, in one voxel, or in adjacent voxels.
#[test]
fn case_28_short_segments() {
    let f = table();
    for p in
        [v(4.0, 4.0, 4.0), v(3.0, 3.0, 4.0), v(2.0, 2.0, 4.0), v(1.5, 1.5, 1.5), v(8.0, 8.0, 8.0), v(9.0, 9.0, 9.0)]
    {
        f.free(p, p);
        for step in [1e-15, 1e-9, 0.1, 0.99, 1.0, 1.01] {
            for d in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE, DVec3::NEG_Z, v(1.0, -1.0, 0.5)] {
                f.ask(p, p + d * step);
            }
        }
    }
    let [below, on, above] = around(4.0).map(|z| v(4.0, 4.0, z));
    f.occluded(below, above);
    f.occluded(on, above);
    f.free(above, v(4.0, 4.0, 4.5));
    f.proved(v(1.5, 1.5, 1.5), v(1.5, 1.5, 1.5));
}

/// 29: A light outside the grid, on its border, inside an occupied voxel, and on or all but on a wall.
#[test]
fn case_29_lights_in_odd_places() {
    let [below, on, above] = around(4.0).map(|z| v(4.5, 4.5, z));
    let places = [v(4.5, 4.5, 40.0), v(4.5, 4.5, 1e9), v(4.5, 4.5, 8.0), v(4.5, 4.5, 8.0_f64.next_up())];
    let places = places.into_iter().chain([v(4.5, 4.5, 4.25), v(4.5, 4.5, 3.75), below, on, above]);
    for light in places.chain([v(-3.0, 4.0, 1e9), v(0.0, 0.0, 0.0), v(8.0, 4.0, 8.0), v(2.0, 2.0, 4.0)]) {
        let f = Fixture::new(square(2.0, 6.0, 4.0), &[light], BOX, &[1.0, 0.3]);
        for p in [v(4.5, 4.5, 1.0), v(4.5, 4.5, 7.0), v(1.0, 7.0, 7.0), v(7.0, 7.0, 1.0), v(3.0, 3.0, 4.0), light] {
            f.ask(p, light);
            f.ask(p + (p - light) * 1e3, light);
        }
        if light.x == light.y && light.x == 4.5 {
            assert_eq!(f.ask(v(4.5, 4.5, 1.0), light).occluded, light.z >= 4.0, "{light}");
            assert_eq!(f.ask(v(4.5, 4.5, 7.0), light).occluded, light.z <= 4.0, "{light}");
        }
    }
}

/// 30: An occluder exactly at the end of the segment, or one step of the last place before or behind it.
#[test]
fn case_30_occluder_at_the_end() {
    let f = table();
    let [below, on, above] = around(4.0);
    for from in [v(4.0, 4.0, 7.0), v(4.0, 4.0, 1.0), v(5.0, 3.0, 7.5), v(0.0, 0.0, 8.0)] {
        let (before, behind) = if from.z > 4.0 { (above, below) } else { (below, above) };
        f.occluded(from, v(3.0, 3.5, on));
        f.free(from, v(3.0, 3.5, before));
        f.occluded(from, v(3.0, 3.5, behind));
        // On the border of the table, and just beside it.
        f.occluded(from, v(2.0, 3.5, on));
        f.free(from, v(2.0_f64.next_down(), 3.5, on));
    }
}

/// 31: Through a shared edge or a vertex: at least one of the triangles is met, from any side and distance.
#[test]
fn case_31_shared_edges_and_vertices() {
    let height = |i: u8, j: u8| f32::from((i * 7 + j * 13) % 5) * 0.25 + 3.0;
    let at = |i: u8, j: u8| vec3(f32::from(i), f32::from(j), height(i, j));
    let mut triangles = Vec::new();
    for (i, j) in (0..8).flat_map(|i| (0..8).map(move |j| (i, j))) {
        triangles.push(Triangle::new(at(i, j), at(i + 1, j), at(i + 1, j + 1)));
        triangles.push(Triangle::new(at(i, j), at(i + 1, j + 1), at(i, j + 1)));
    }
    let f = Fixture::new(triangles.clone(), &[v(4.0, 4.0, 7.5)], BOX, &[1.0, 0.3]);
    for t in &triangles {
        let [a, b, c] = t.vertices_f64();
        for target in [a, b, c, (a + b) * 0.5, b + (c - b) * 0.3, (c + a) * 0.5] {
            // At the outer border a rounding is enough to miss.
            let inner = target.x > 0.0 && target.x < 8.0 && target.y > 0.0 && target.y < 8.0;
            for from in [v(4.0, 4.0, 7.5), target + v(0.0, 0.0, 2.0), target + v(1e-3, -2e-3, 1e3)] {
                let found = f.ask(target + (target - from), from);
                assert!(found.occluded || !inner, "{from} {target}");
            }
        }
    }
}

/// 32: Lengths from 10⁻²⁰ to 10²⁰, in both directions.
#[test]
fn case_32_tiny_and_huge_lengths() {
    let f = table();
    for k in -20..=20 {
        let length = 10.0_f64.powi(k);
        for target in [v(4.0, 4.0, 4.0), v(3.25, 5.0, 4.0), v(1.0, 1.0, 1.0), v(4.0, 4.0, 7.0), v(2.0, 3.0, 4.0)] {
            for d in [v(0.3, 0.2, 0.9), v(0.0, 0.0, -1.0), v(-0.5, 0.7, -0.1), v(1.0, 0.0, 0.0)] {
                f.ask(target, target + d * length);
                f.ask(target - d * length, target + d * length);
                f.ask(target - d * length, target + d);
            }
        }
        f.occluded(v(4.0, 4.0, 4.0), v(4.0, 4.0, 4.0 + length.max(1e-15)));
        f.occluded(v(4.0, 4.0, 4.0 - length.max(1e-15)), v(4.0, 4.0, 4.0));
    }
    // From so far away that a position computed from there is rounded to more than the scene: nobody may lose the table.
    for far in [1e9, 1e11, 1e13, 1e15, 1e18, 1e25] {
        f.occluded(v(0.3, -0.2, 0.9) * far, v(4.0, 4.0, 4.0));
        f.occluded(v(4.0, 4.0, far), v(4.0, 4.0, -far));
        f.free(v(1.0, 4.0, far), v(1.0, 4.0, -far));
        let mut hits = 0;
        f.bvh.visit_hits(&Segment::new(v(0.3, -0.2, 0.9) * far, v(4.0, 3.0, 4.0)), |_| hits += 1);
        assert_eq!(hits, 1);
    }
}

/// 33: Without any occluder everything is proved, to infinity as well; nothing loops.
#[test]
fn case_33_empty_scene() {
    let f = Fixture::new(vec![], &[v(4.0, 4.0, 4.0)], BOX, &[1.0, 0.3]);
    assert!(f.bvh.bounds().is_empty());
    for far in [1.0, 1e3, 1e6, 1e20, 1e80] {
        f.proved(v(1.0, -2.0, 0.5) * far, v(4.0, 4.0, 4.0));
        f.proved(v(-1.0, 0.0, 0.0) * far, v(0.0, 1.0, 0.0) * far);
    }
    // A single voxel, without extent.
    let f = Fixture::new(vec![], &[], (DVec3::ONE, DVec3::ONE), &[1.0]);
    f.proved(DVec3::ONE, DVec3::ONE);
    f.proved(DVec3::ZERO, v(1e6, 0.0, 0.0));
}

/// 35: A point at the light itself: there is nothing to sample, and whoever asks all the same gets the answer for a point.
#[test]
fn case_35_at_the_light() {
    let f = table();
    let source = vdf_scenes::builtin("cbox_vol6").expect("built in");
    let mut scene = Scene::from_source(&source, &LoadOptions::default()).expect("a sound scene");
    for &light in &f.lights {
        f.free(light, light);
        scene.emitters = vec![Emitter::Point { position: light, intensity: Rgb::ONE }];
        let lights = Lights::new(&scene, 100.0);
        assert!(lights.sample(light, 0.5, [0.5, 0.5]).is_none());
        let beside = v(light.x, light.y, light.z.next_up());
        let near = lights.sample(beside, 0.5, [0.5, 0.5]).expect("a light");
        assert!(near.direction == DVec3::NEG_Z && near.weight.is_finite(), "{near:?}");
        f.ask(beside, light);
    }
    f.proved(v(1.0, 1.0, 1.0), v(1.0, 1.0, 1.0));
}
