//! What is read from an OBJ file, what is refused, and that polygons are filled exactly.

use glam::DVec3;

use super::{Limits, Mesh, MeshError, read};

fn parse(text: &str) -> Result<Mesh, MeshError> {
    read(&mut text.as_bytes(), &Limits::default())
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[track_caller]
fn refused(text: &str, line: u64, part: &str) {
    let error = parse(text).expect_err("this must be refused");
    assert_eq!(error.line, line, "{error:?}");
    assert!(format!("{error:?}").contains(part), "{error:?}");
}

/// Twice the area with its sign, seen along z, and twice the sum of the absolute areas.
fn areas(mesh: &Mesh) -> (f64, f64) {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        (b - a).cross(c - a).z
    };
    (mesh.triangles.iter().map(area).sum(), mesh.triangles.iter().map(|t| area(t).abs()).sum())
}

#[test]
fn lines_and_points_are_not_faces() {
    let mesh = parse(&format!("{SQUARE}l 1 2 3 4 1\np 1 2 3\nl 1 2\nf 1 2 3\n")).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert!(mesh.warnings.is_empty());
}

#[test]
fn what_exporters_write_is_read() {
    let expected = [[0, 1, 2], [0, 2, 3]];
    let face = "f 1 2 3 4\n";
    for text in [
        format!("\u{feff}{SQUARE}{face}"),
        format!("{SQUARE}{face}").replace('\n', "\r\n"),
        format!("{SQUARE}{face}").replace("0 1 0\n", "0 1 0 # corner \\\n"),
        format!("{SQUARE}f 1 2 \\\n3 4"),
        format!("{SQUARE}f 1 2 \\\r\n 3 \\\r\n 4"),
        format!("{SQUARE}f -4 -3 -2 -1\n"),
        format!("f 1 2 3 4\n{SQUARE}"),
        format!("{SQUARE}vt 0 0\nvn 0 0 1\nf 1/1/1 2//1 3/1 4/1/\n"),
        format!("# a\\\nmtllib C:\\x.mtl\nusemtl a\no b\ng c d\ns off\n{SQUARE}{face}"),
        SQUARE.replace("0\nv", "0 1.0\nv") + face,
        SQUARE.replace("0\nv", "0 .5 .5 .5\nv") + face,
        SQUARE.replace("0\nv", "0 .5 .5 .5 1\nv") + face,
        format!("\t{SQUARE}\n\n  {face}"),
    ] {
        let mesh = parse(&text).unwrap_or_else(|e| panic!("{e:?} in {text:?}"));
        assert_eq!(mesh.triangles, expected, "{text:?}");
        assert_eq!(mesh.positions[2], DVec3::new(1.0, 1.0, 0.0));
        assert!(mesh.warnings.is_empty(), "{:?}", mesh.warnings);
    }
}

#[test]
fn errors_name_the_line_and_its_text() {
    refused("v 0 0 0\nv -1,0 -1,0 0,0\n", 2, "in \\\"v -1,0 -1,0 0,0\\\"");
    refused("v -1,0 -1,0 0,0\n", 1, "decimal point");
    refused(&format!("{SQUARE}f 1 2 9"), 5, "no vertex 9 in \\\"f 1 2 9\\\"");
    refused(&format!("{SQUARE}f 1 2 9"), 5, "the file has 4 vertices");
    refused(&format!("{SQUARE}f 1 2 \\\n0"), 5, "count from 1");
    refused(&format!("{SQUARE}\n\nf 1 2 x"), 7, "\\\"x\\\" is not the number of a vertex");
    refused(&format!("{SQUARE}f -5 1 2"), 5, "no vertex -5");
    refused(&format!("{SQUARE}f 1/1 2/1 3/1"), 5, "no texture coordinate 1");
    refused(&format!("{SQUARE}vn 0 0 1\nf 1//1 2//2 3//1"), 6, "no normal 2");
    refused(&format!("{SQUARE}f 1/// 2 3"), 5, "is not a corner");
    refused(&format!("{SQUARE}f //1 2 3"), 5, "is not a corner");
    refused("v 1 2\n", 1, "2 numbers");
    refused("v 1 2 3 4 5\n", 1, "5 numbers");
    refused("v 1 2 3 4 5 6 7 8\n", 1, "too many numbers");
    refused("v 1 nan 3\n", 1, "not finite");
    refused("v 1 1e999 3\n", 1, "not finite");
    refused("v 1 a\u{1b}[2J 3\n", 1, "\\\\u{1b}");
}

/// An index that overflows when it is multiplied by three once was a panic.
#[test]
fn huge_indices_are_refused() {
    for index in ["6148914691236517206", "9223372036854775807", "-9223372036854775808", "4294967297", "4294967296"] {
        refused(&format!("{SQUARE}vn 0 0 1\nf 1//{index} 2//1 3//1"), 6, "no normal");
        refused(&format!("{SQUARE}f {index} 2 3"), 5, "no vertex");
        refused(&format!("{SQUARE}vt 0 0\nf 1/{index} 2/1 3/1"), 6, "no texture coordinate");
    }
    refused(&format!("{SQUARE}f 99999999999999999999 2 3"), 5, "is not the number");
}

#[test]
fn unknown_statements_are_warned_about_once() {
    let mesh = parse(&format!("{SQUARE}curv 0 1\nf 1 2 3\ncurv 0 1\nxyz\nf 1 2\n")).unwrap();
    let lines: Vec<_> = mesh.warnings.iter().map(|(line, _)| *line).collect();
    assert_eq!(lines, [5, 8, 9]);
    let many: String = (0..1000).map(|i| format!("k{i}\n")).collect();
    assert!(parse(&format!("{SQUARE}f 1 2 3\n{many}")).unwrap().warnings.len() < 20);
}

#[test]
fn doubles_keep_their_digits() {
    let mesh = parse("v -2486999.9 4684683.001 1e-17\nv 0 0 0\nv 0 1 0\nf 1 2 3").unwrap();
    assert_eq!(mesh.positions[0], DVec3::new(-2_486_999.9, 4_684_683.001, 1e-17));
}

fn polygon(points: &[(f64, f64)]) -> Mesh {
    let vertices: String = points.iter().map(|(x, y)| format!("v {x} {y} 0\n")).collect();
    let face: String = (1..=points.len()).map(|i| format!(" {i}")).collect();
    parse(&format!("{vertices}f{face}\n")).unwrap()
}

/// A simple polygon is filled if no triangle is turned over and the areas add up to that of the outline.
#[track_caller]
fn is_filled(points: &[(f64, f64)]) {
    for shift in 0..points.len() {
        for reversed in [false, true] {
            let mut points = points.to_vec();
            points.rotate_left(shift);
            if reversed {
                points.reverse();
            }
            let outline: f64 =
                points.iter().zip(points.iter().cycle().skip(1)).map(|(a, b)| a.0 * b.1 - b.0 * a.1).sum();
            let mesh = polygon(&points);
            assert_eq!(mesh.triangles.len(), points.len() - 2);
            let (signed, absolute) = areas(&mesh);
            assert!((signed - outline).abs() < 1e-9 * absolute, "{shift} {reversed}: {signed} {outline}");
            assert!((signed.abs() - absolute).abs() < 1e-9 * absolute, "{shift} {reversed}: {signed} {absolute}");
            assert!(mesh.warnings.is_empty(), "{:?}", mesh.warnings);
        }
    }
}

#[test]
fn concave_polygons_are_filled_exactly() {
    // An L, a U, an arrow, a comb, one with corners on straight edges, a spiral.
    is_filled(&[(2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0), (0.0, 0.0)]);
    is_filled(&[(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (2.0, 2.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]);
    is_filled(&[(0.0, 0.0), (2.0, 1.0), (0.0, 2.0), (0.5, 1.0)]);
    let comb: Vec<_> = (0..20)
        .map(|i| (f64::from(i), if i % 2 == 0 { 0.0 } else { 5.0 }))
        .chain([(19.0, -9.0), (0.0, -9.0)])
        .collect();
    is_filled(&comb);
    is_filled(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0), (0.0, 1.0)]);
    let arm = |r: f64, i: i32| (r * (f64::from(i) * 0.4).cos(), r * (f64::from(i) * 0.4).sin());
    let spiral: Vec<_> = (0..40)
        .map(|i| arm(1.0 + f64::from(i) * 0.2, i))
        .chain((0..40).rev().map(|i| arm(0.5 + f64::from(i) * 0.2, i)))
        .collect();
    is_filled(&spiral);
}

/// A ring is written as one outline that goes in along a slit and back.
#[test]
fn a_hole_behind_a_slit_stays_open() {
    is_filled(&[
        (0.0, 0.0),
        (3.0, 0.0),
        (3.0, 3.0),
        (0.0, 3.0),
        (0.0, 0.0),
        (1.0, 1.0),
        (1.0, 2.0),
        (2.0, 2.0),
        (2.0, 1.0),
        (1.0, 1.0),
    ]);
}

#[test]
fn random_star_shaped_polygons_are_filled() {
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from(u32::try_from(state >> 33).unwrap()) / f64::from(1_u32 << 31)
    };
    for corners in 4..24 {
        let points: Vec<_> = (0..corners)
            .map(|i| {
                let angle = std::f64::consts::TAU * f64::from(i) / f64::from(corners);
                let radius = 0.05 + random();
                (radius * angle.cos(), radius * angle.sin())
            })
            .collect();
        is_filled(&points);
    }
}

/// Scenes of convex quads keep their pictures, bit for bit.
#[test]
fn convex_polygons_are_fans_from_their_first_corner() {
    let regular: Vec<_> = (0..9).map(|i| (f64::from(i) * 0.69).sin_cos()).map(|(s, c)| (c, s)).collect();
    let fan: Vec<_> = (1..8).map(|i| [0, i, i + 1]).collect();
    assert_eq!(polygon(&regular).triangles, fan);
    // Not planar, but convex as it is seen along its normal.
    let mesh = parse("v 0 0 0\nv 1 0 .3\nv 1 1 0\nv 0 1 .3\nf 1 2 3 4").unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn degenerate_polygons_come_to_an_end() {
    let point = (1.0, 1.0);
    for points in [
        vec![point; 50],
        (0..50).map(|i| (f64::from(i), f64::from(i))).collect(),
        vec![(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)],
        vec![(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0), (0.5, 3.0)],
        (0..5).map(|i| (f64::from(i) * 2.513).sin_cos()).collect(),
        (0..400).map(|i| ((f64::from(i) * 7.1).sin(), (f64::from(i) * 3.3).cos())).collect(),
        vec![(1e300, 0.0), (0.0, 1e300), (-1e300, 1e300), (1e300, 1e300)],
    ] {
        let mesh = polygon(&points);
        assert_eq!(mesh.triangles.len(), points.len() - 2);
        assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < points.len()));
    }
}

/// Ear cutting is quadratic for a comb; the budget stops it. A convex polygon takes linear time whatever its size.
#[test]
fn the_work_for_polygons_is_bounded() {
    let comb: String = (0..1000).map(|i| format!("v {i} {} 0\n", if i % 2 == 0 { 0 } else { 5 + i })).collect();
    let face: String = (1..=1001).map(|i| format!(" {i}")).collect();
    let text = format!("{comb}v 500 -9 0\nf{face}\n");
    let error = read(&mut text.as_bytes(), &Limits { polygon_steps: 2000, ..Limits::default() }).unwrap_err();
    assert_eq!(error.line, 1002);
    assert!(error.message.contains("1001 corners"), "{error:?}");
    assert!(parse(&text).is_ok());
    let many = 200_000;
    let round: String = (0..many)
        .map(|i| (f64::from(i) * std::f64::consts::TAU / f64::from(many)).sin_cos())
        .map(|(s, c)| format!("v {c} {s} 0\n"))
        .collect();
    let face: String = (1..=many).map(|i| format!(" {i}")).collect();
    let limits = Limits { polygon_steps: 0, ..Limits::default() };
    let mesh = read(&mut format!("{round}f{face}").as_bytes(), &limits).unwrap();
    assert_eq!(mesh.triangles.len(), 199_998);
}

#[test]
fn sizes_are_bounded() {
    let limits = Limits { statement: 10, triangles: 2, polygon_steps: 0 };
    let message = |text: &str| read(&mut text.as_bytes(), &limits).unwrap_err().message;
    assert!(message("v 0 0 0\nv 0 0 0.0000").contains("longer than 10 bytes"));
    assert!(message("v 0 0 \\\n 0 \\\n 0").contains("longer than 10 bytes"));
    assert!(message("v 0 0 0\nv 0 0 0\nv 0 0 0\n").contains("too many vertices"));
    assert!(message("v 0 0 0\nf 1 1 1\nf 1 1 1\nf 1 1 1\n").contains("too many faces"));
}
