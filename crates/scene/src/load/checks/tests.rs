//! Fog that is not where it seems to be is refused or warned about.

use super::super::tests::{FOG, load_with, refused_text, with_sensor};
use crate::Scene;

const OTHER: &str = "<medium type='homogeneous' id='other'><float name='sigma_t' value='7'/></medium>";
const AWAY: &str = "<transform name='to_world'><translate z='-50'/></transform>";

fn fog_box(medium: &str, ops: &str, more: &str) -> String {
    format!(
        "<shape type='cube'><transform name='to_world'>{ops}</transform><bsdf type='null'/>\
         <ref id='{medium}' name='interior'/>{more}</shape>\n"
    )
}

/// Media and fog boxes, seen from afar. The body begins in line 4.
fn seen(body: &str) -> Scene {
    load_with(&with_sensor(&format!("{FOG}{OTHER}\n{body}"), AWAY), &[], &[]).unwrap_or_else(|e| panic!("{e}"))
}

fn warned(scene: &Scene, place: &str, part: &str) -> bool {
    scene.warnings.iter().any(|w| w.starts_with(&format!("s.xml:{place}: ")) && w.contains(part))
}

fn mesh_scene(mesh: &str, more: &str) -> Result<Scene, crate::SceneError> {
    let shape = format!(
        "{FOG}\n<shape type='obj'><string name='filename' value='m.obj'/><boolean name='face_normals' value='true'/>\
         <bsdf type='null'/><ref id='fog' name='interior'/>{more}</shape>"
    );
    load_with(&with_sensor(&shape, AWAY), &[("m.obj", mesh)], &[])
}

const TETRAHEDRON: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\n";

#[test]
fn a_closed_boundary_wound_inwards_is_warned_about() {
    let inwards = TETRAHEDRON.replace("f 1 3 2\nf 1 2 4\nf 2 3 4\n", "f 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n");
    assert!(warned(&mesh_scene(&inwards, "").unwrap(), "4:1", "flip_normals"));
    let turned = mesh_scene(&inwards, "<boolean name='flip_normals' value='true'/>").unwrap();
    assert!(turned.warnings.is_empty(), "{:?}", turned.warnings);
    let outwards = mesh_scene(&format!("{TETRAHEDRON}f 3 1 4\n"), "").unwrap();
    assert!(outwards.warnings.is_empty(), "{:?}", outwards.warnings);
}

#[test]
fn an_open_boundary_is_refused_with_the_place_of_its_hole() {
    let message = mesh_scene(TETRAHEDRON, "").unwrap_err().to_string();
    assert!(
        message.starts_with("s.xml:4:1: the medium boundary is open: the edge from (0, 0, 0) to (0, 1, 0)"),
        "{message}"
    );
    let message = mesh_scene(&format!("{TETRAHEDRON}f 1 3 4\n"), "").unwrap_err().to_string();
    assert!(message.contains("wound against each other at the edge"), "{message}");
    let sheet = "<shape type='rectangle'><bsdf type='null'/><ref id='fog' name='interior'/></shape>";
    refused_text(&with_sensor(&format!("{FOG}\n{sheet}"), AWAY), &[], "s.xml:4:1", "is open");
    // It changes nothing, so it may be open.
    let nothing = sheet.replace("</shape>", "<ref id='fog' name='exterior'/></shape>");
    assert!(load_with(&with_sensor(&format!("{FOG}\n{nothing}"), AWAY), &[], &[]).is_ok());
}

/// In Mitsuba a wall between two media is a shape with a medium on each side. Its shapes are open, but not together.
#[test]
fn shapes_that_close_together_may_be_open() {
    let half = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\n";
    let other = half.replace("v 1 0 0", "v -1 0 0").replace("f 1 3 2\nf 1 2 4\nf 2 3 4", "f 1 2 3\nf 1 4 2\nf 2 4 3");
    // At x = 0, its normal along +x.
    let wall = "v 0 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n";
    let shape = |file: &str, media: &str| {
        format!(
            "<shape type='obj'><string name='filename' value='{file}'/><boolean name='face_normals' value='true'/>\
             <bsdf type='null'/>{media}</shape>\n"
        )
    };
    let between = |medium: &str| {
        let sides = format!("<ref id='{medium}' name='interior'/><ref id='fog' name='exterior'/>");
        let body = format!(
            "{FOG}{OTHER}\n{}{}{}",
            shape("half", "<ref id='fog' name='interior'/>"),
            shape("other", "<ref id='other' name='interior'/>"),
            shape("wall", &sides)
        );
        load_with(&with_sensor(&body, AWAY), &[("half", half), ("other", &other), ("wall", wall)], &[])
    };
    let scene = between("other").unwrap_or_else(|e| panic!("{e}"));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let message = between("fog").unwrap_err().to_string();
    assert!(message.contains("the medium boundary is open"), "{message}");
}

#[test]
fn crossing_boxes_of_different_media_are_warned_about() {
    let first = fog_box("fog", "<scale value='2'/>", "");
    let crossing = |medium: &str, ops: &str| seen(&format!("{first}{}", fog_box(medium, ops, "")));
    let message = "crosses that of the shape at s.xml:4:1: where both are, the one with the smaller volume wins";
    assert!(warned(&crossing("other", "<translate x='2'/>"), "5:1", message));
    assert!(warned(&crossing("other", "<scale x='9' y='.5' z='.5'/>"), "5:1", message));
    assert!(warned(&crossing("other", "<rotate z='1' angle='45'/><translate x='2'/>"), "5:1", message));
    for (medium, ops) in [
        ("fog", "<translate x='2'/>"),
        ("other", "<translate x='3'/>"),
        ("other", "<translate x='3' y='1'/>"),
        ("other", "<rotate z='1' angle='45'/><translate x='3.2' y='3.2'/>"),
        ("other", "<translate x='9'/>"),
    ] {
        let scene = crossing(medium, ops);
        assert!(scene.warnings.is_empty(), "{medium} {ops}: {:?}", scene.warnings);
    }
}

/// An edge that reaches into the other box by a fortieth of its size shows between no points of a grid; boxes that touch share nothing but rounding.
#[test]
fn slight_crossings_are_told_from_touching_boxes() {
    let turned = |ops: &str, more: &str| format!("{ops}<rotate x='0.6' z='0.8' angle='37'/><translate {more}/>");
    for place in ["x='0'", "x='1000' y='-700'"] {
        let pair = |ops: &str| {
            let first = fog_box("fog", &turned("<scale value='2'/>", place), "");
            seen(&format!("{first}{}", fog_box("other", &turned(ops, place), "")))
        };
        for reach in [0.05, 0.5] {
            let ops = format!("<rotate z='1' angle='45'/><translate x='{}'/>", 2.0 + 2_f64.sqrt() - reach);
            assert!(warned(&pair(&ops), "5:1", "its medium crosses"), "{place} {reach}");
        }
        for touching in ["<translate x='3'/>", "<translate x='3' y='1'/>", "<scale value='2'/><translate x='4'/>"] {
            let scene = pair(touching);
            assert!(!scene.warnings.iter().any(|w| w.contains("crosses")), "{place} {touching}: {:?}", scene.warnings);
        }
    }
}

/// Two copies of one fog are one fog.
#[test]
fn equal_media_are_one_medium() {
    let copy = FOG.replace("id='fog'", "id='copy'");
    let body = format!("{FOG}{copy}{}{}", fog_box("fog", "<scale value='4'/>", ""), fog_box("copy", "", ""));
    let scene = load_with(&with_sensor(&body, "<ref id='copy'/>"), &[], &[]).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn an_exterior_that_is_not_around_is_warned_about() {
    let alone = fog_box("fog", "", "<ref id='other' name='exterior'/>");
    assert!(warned(&seen(&alone), "4:1", "is not the medium that is around it"));
    let nested = fog_box("other", "<scale value='4'/>", "");
    assert!(seen(&format!("{nested}{alone}")).warnings.is_empty());
}

#[test]
fn clip_planes_that_hide_something_are_warned_about() {
    let looking = |from: f64, clip: &str, more: &str| {
        let sensor = format!(
            "<transform name='to_world'><lookat origin='0 0 {from}' target='0 0 {}'/></transform>{clip}{more}",
            from - 1.0
        );
        load_with(&with_sensor(&format!("{FOG}{}", fog_box("fog", "", "")), &sensor), &[], &[]).unwrap()
    };
    let near = "<float name='near_clip' value='1'/>";
    let jumps = |scene: &Scene| warned(scene, "5:1", "near_clip 1 jumps over the medium boundary at s.xml:3:38");
    assert!(jumps(&looking(1.5, near, "")));
    assert!(jumps(&looking(-0.5, near, "<ref id='fog'/>")));
    assert!(looking(2.5, near, "").warnings.is_empty());
    assert!(looking(0.5, near, "<ref id='fog'/>").warnings.is_empty());
    let nothing = "nothing of the scene lies between near_clip";
    assert!(warned(&looking(30_000.0, "", ""), "5:1", nothing));
    assert!(warned(&looking(9.0, "<float name='near_clip' value='20'/>", ""), "5:1", nothing));
    assert!(warned(&looking(-9.0, "", ""), "5:1", nothing));
    assert!(looking(9.0, "", "").warnings.is_empty());
}

#[test]
fn many_boundaries_take_little_time() {
    let begin = std::time::Instant::now();
    let grid: String = (0..4000)
        .map(|i| fog_box("fog", &format!("<scale value='.5'/><translate x='{}' y='{}'/>", i % 63, i / 63), ""))
        .collect();
    assert!(seen(&grid).warnings.is_empty());
    let nested: String = (1..1000)
        .map(|i| {
            fog_box(
                ["fog", "other"][i % 2],
                &format!("<scale value='{}'/>", i as f64 / 100.0),
                &format!("<ref id='{}' name='exterior'/>", ["other", "fog"][i % 2]),
            )
        })
        .collect();
    assert_eq!(seen(&nested).warnings.len(), 1);
    let heap: String = (0..1000)
        .map(|i| {
            fog_box(
                ["fog", "other"][i % 2],
                &format!("<rotate z='1' angle='{i}'/><translate x='{}'/>", i as f64 / 1700.0),
                "",
            )
        })
        .collect();
    assert!(!seen(&heap).warnings.is_empty());
    assert!(begin.elapsed().as_secs_f64() < 60.0, "{:?}", begin.elapsed());
}
