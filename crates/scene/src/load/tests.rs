//! Whole scenes: what loads, what is refused, and where the message points.

use std::borrow::Cow;

use glam::{DVec3, Vec3};

use super::LoadOptions;
use crate::{Bsdf, EmbeddedFile, Emitter, Extinction, Phase, Projection, Scene, SceneError, SceneSource};

pub(super) const HEAD: &str = "<scene version='3.0.0'>\n<integrator type='volpath'/>\n";
pub(super) const FILM: &str = "<film type='hdrfilm'/>";
pub(super) const FOG: &str = "<medium type='homogeneous' id='fog'/>";
pub(super) const LIGHT: &str = "<emitter type='point'/>";

pub(super) fn file(path: &str, text: &str) -> EmbeddedFile {
    EmbeddedFile { path: Cow::Owned(path.to_owned()), bytes: Cow::Owned(text.as_bytes().to_owned()) }
}

pub(super) fn load_with(text: &str, others: &[(&str, &str)], defines: &[(&str, &str)]) -> Result<Scene, SceneError> {
    let others = others.iter().map(|(p, t)| file(p, t)).collect();
    let defines = defines.iter().map(|(n, v)| ((*n).to_owned(), (*v).to_owned())).collect();
    Scene::from_source(&SceneSource::embedded(file("s.xml", text), others), &LoadOptions { defines, sensor: None })
}

/// A scene with a sensor and a light, and `body` from line 3 on.
pub(super) fn scene(body: &str) -> String {
    format!("{HEAD}{body}\n<sensor type='perspective'>{FILM}</sensor>{LIGHT}</scene>")
}

pub(super) fn load(body: &str) -> Scene {
    load_with(&scene(body), &[], &[]).unwrap()
}

#[track_caller]
pub(super) fn refused_text(text: &str, others: &[(&str, &str)], place: &str, part: &str) {
    let message = load_with(text, others, &[]).expect_err("this must be refused").to_string();
    assert!(message.starts_with(&format!("{place}: ")), "expected {place} in: {message}");
    assert!(message.contains(part), "expected {part:?} in: {message}");
}

/// `body` begins at line 3, column 1.
#[track_caller]
pub(super) fn refused(body: &str, place: &str, part: &str) {
    refused_text(&scene(body), &[], &format!("s.xml:{place}"), part);
}

/// A cube with fog inside; `more` goes into the shape.
fn fog_cube(size: f64, more: &str) -> String {
    format!(
        "<shape type='cube'><transform name='to_world'><scale value='{size}'/></transform>\
         <bsdf type='null'/><ref id='fog' name='interior'/>{more}</shape>"
    )
}

/// Everything but the sensor's content at the usual place.
pub(super) fn with_sensor(body: &str, sensor: &str) -> String {
    format!("{HEAD}{body}\n<sensor type='perspective'>{FILM}{sensor}</sensor>{LIGHT}</scene>")
}

#[test]
fn parameters_are_substituted_and_defines_win() {
    let text = scene(
        "<default name='a' value='1'/><default name='ab' value='2'/><emitter type='point'><rgb name='intensity' value='$ab'/></emitter>",
    );
    let intensity = |defines: &[(&str, &str)]| load_with(&text, &[], defines).map(|s| s.emitters[0].clone());
    let expect = |v| Emitter::Point { position: DVec3::ZERO, intensity: Vec3::splat(v) };
    assert_eq!(intensity(&[]).unwrap(), expect(2.0));
    assert_eq!(intensity(&[("ab", "7")]).unwrap(), expect(7.0));
    let unused = intensity(&[("abc", "7")]).unwrap_err().to_string();
    assert!(unused.contains("parameter abc") && unused.contains("did you mean \"ab\""), "{unused}");
    refused("<emitter type='point'><float name='intensity' value='$q'/></emitter>", "3:47", "\"$q\" is not defined");
    refused("<bsdf type='\\$q'/>", "3:7", "bsdf type \"$q\" is not supported");
}

#[test]
fn parameters_cannot_blow_up() {
    let mut body = String::from("<default name='p0' value='xxxxxxxx'/>");
    for i in 1..40 {
        body += &format!("<default name='q{i}' value='$p{j}$p{j}'/><default name='p{i}' value='$q{i}'/>", j = i - 1);
    }
    let error = load_with(&scene(&body), &[], &[]).unwrap_err().to_string();
    assert!(error.contains("too long"), "{error}");
    let many = format!("<default name='p' value='{}'/>{}", "x".repeat(60_000), "<alias id='a' as='$p'/>".repeat(2000));
    let error = load_with(&scene(&many), &[], &[]).unwrap_err().to_string();
    assert!(error.contains("too long"), "{error}");
}

#[test]
fn includes_are_relative_and_cannot_loop() {
    let text = scene("<include filename='sub/a.xml'/>");
    let inner = "<scene version='3.0.0'><include filename='b.xml'/></scene>";
    let leaf = format!("<scene version='3.0.0'>\n{LIGHT}</scene>");
    let loaded = load_with(&text, &[("sub/a.xml", inner), ("sub/b.xml", &leaf)], &[]).unwrap();
    assert_eq!(loaded.emitters.len(), 2);
    refused_text(&text, &[("sub/a.xml", "<scene version='3.0.0'>\n<oops/></scene>")], "sub/a.xml:2:1", "<oops>");
    refused_text(&text, &[], "s.xml:3:1", "sub/a.xml");
    let looped = "<scene version='3.0.0'><include filename='a.xml'/></scene>";
    refused_text(&text, &[("sub/a.xml", looped)], "sub/a.xml:1:24", "includes itself");
}

#[test]
fn references_may_point_forward_and_bad_ones_are_refused() {
    let loaded = load(
        "<shape type='cube'><ref id='b'/></shape><bsdf type='diffuse' id='b'><rgb name='reflectance' value='1'/></bsdf>",
    );
    assert_eq!(loaded.surfaces[0].bsdf, Bsdf::lambertian(Vec3::ONE, Vec3::ZERO));
    refused(
        "<shape type='cube'><ref id='fgo'/></shape><medium type='homogeneous' id='fog'/>",
        "3:20",
        "did you mean \"fog\"",
    );
    refused("<bsdf type='null' id='a'/>\n<bsdf type='null' id='a'/>", "4:19", "already used at s.xml:3:1");
    refused("<bsdf type='twosided' id='a'><ref id='a'/></bsdf>", "3:30", "cycle");
    assert_eq!(
        load("<bsdf type='diffuse' id='a'/><alias id='a' as='b'/><shape type='cube'><ref id='b'/></shape>")
            .surfaces
            .len(),
        1
    );
}

#[test]
fn unknown_names_are_refused_with_the_nearest_one() {
    refused("<shpae type='cube'/>", "3:1", "did you mean \"shape\"");
    refused("<shape type='shpere'/>", "3:8", "did you mean \"sphere\"? supported: obj, ply, serialized");
    refused("<shape type='cube' tpye='x'/>", "3:20", "did you mean \"type\"");
    refused(
        "<shape type='cube'><boolean name='flip_normal' value='true'/></shape>",
        "3:20",
        "did you mean \"flip_normals\"",
    );
    refused("<shape type='cube'><phase type='hg'/></shape>", "3:20", "takes no <phase>");
    refused("<shape type='cube'><string name='flip_normals' value='a'/></shape>", "3:20", "cannot be a <string>");
    refused("<film type='hdrfilm'/>", "3:1", "inside <sensor>");
    refused("<float name='a' value='1'><float name='b' value='1'/></float>", "3:27", "inside <float>");
    let vector = "<shape type='cube'><emitter type='area'><vector name='r' value='1'/></emitter></shape>";
    refused(vector, "3:41", "has no property \"r\"\n  help: supported: radiance, sampling_weight");
    refused("<texture type='wood' id='a'/>", "3:10", "texture type \"wood\" is not supported");
    refused("<texture type='bitmap' id='a'/>", "3:1", "no filename");
}

#[test]
fn old_names_and_options_of_the_renderer_have_their_hints() {
    let medium = |name| format!("<medium type='homogeneous'><float name='{name}' value='1'/></medium>");
    for name in ["sigmaS", "sigma_s", "sigmaA", "sigma_a", "density"] {
        refused(&medium(name), "3:28", "albedo");
    }
    refused("<shape type='cube'><transform name='toWorld'/></shape>", "3:20", "\"to_world\"");
    refused("<integrator type='volpath'><string name='method' value='amr'/></integrator>", "3:1", "second integrator");
    let text = "<scene version='3.0.0'><integrator type='volpath'><string name='method' value='amr'/></integrator><sensor type='perspective'><film type='hdrfilm'/></sensor></scene>";
    refused_text(text, &[], "s.xml:1:51", "option of the renderer");
    // Files from before version 2 get the names of today, as in Mitsuba; what has more than another name is refused.
    let old = |body: &str| scene(body).replacen("3.0.0", "0.6.0", 1);
    let ball = "<shape type='sphere'><transform name='toWorld'><scale value='2'/></transform><bsdf type='diffuse'><rgb name='diffuseReflectance' value='0.1'/></bsdf></shape>";
    let loaded = load_with(&old(ball), &[], &[]).unwrap();
    assert_eq!(loaded.surfaces[0].curved.unwrap().placement().0.x_axis.length(), 2.0);
    assert_eq!(loaded.surfaces[0].bsdf, crate::Bsdf::lambertian(Vec3::splat(0.1), Vec3::ZERO));
    refused_text(
        &old("<medium type='homogeneous'><rgb name='sigmaS' value='1'/></medium>"),
        &[],
        "s.xml:3:28",
        "sigma_t",
    );
    refused_text("<scene/>", &[], "s.xml:1:1", "version");
}

#[test]
fn xml_errors_have_places() {
    refused_text("<scene version='3.0.0'>\n  <ref></rfe></scene>", &[], "s.xml:2:8", "XML");
    let bomb = "<!DOCTYPE s [<!ENTITY a 'b'>]><scene version='3.0.0'>&a;</scene>";
    assert!(load_with(bomb, &[], &[]).unwrap_err().to_string().contains("XML"));
    let deep = format!("<scene version='3.0.0'>{}", "<transform name='a'>".repeat(100_000));
    assert!(load_with(&deep, &[], &[]).is_err());
    let deep = format!("<scene version='3.0.0'>{}{}</scene>", "<shape type='a'>".repeat(500), "</shape>".repeat(500));
    assert!(load_with(&deep, &[], &[]).unwrap_err().to_string().contains("nest"));
}

#[test]
fn values_outside_their_range_are_refused() {
    let bsdf = |v| format!("<bsdf type='diffuse'><rgb name='reflectance' value='{v}'/></bsdf>");
    for bad in ["1.5", "-0.1", "nan", "inf", "1,2", "a", "", "1e400"] {
        refused(&bsdf(bad), "3:22", "");
    }
    let medium = |inner: &str| format!("<medium type='homogeneous'>{inner}</medium>");
    refused(&medium("<rgb name='sigma_t' value='2'/>"), "3:28", "more than 1");
    refused(&medium("<float name='sigma_t' value='-1'/>"), "3:28", "at least 0");
    refused(&medium("<phase type='hg'><float name='g' value='1'/></phase>"), "3:45", "between -1 and 1");
    load(&medium("<boolean name='sample_emitters' value='FALSE'/>"));
    refused("<shape type='cube'><boolean name='flip_normals' value='yes'/></shape>", "3:20", "not a boolean");
    let film =
        |inner: &str| format!("{HEAD}<sensor type='perspective'><film type='hdrfilm'>{inner}</film></sensor></scene>");
    refused_text(&film("<integer name='width' value='1.0'/>"), &[], "s.xml:3:49", "not an integer");
    refused_text(&film("<integer name='width' value='0'/>"), &[], "s.xml:3:49", "between 1 and");
    refused_text(&film("<integer name='crop_offset_x' value='9'/>"), &[], "s.xml:3:28", "beyond the film");
    refused_text(&film("<string name='pixel_format' value='cmyk'/>"), &[], "s.xml:3:49", "supported: rgb");
}

#[test]
fn media_are_read_with_scale_and_phase() {
    let scene = load(
        "<medium type='homogeneous'><rgb name='sigma_t' value='.5'/><float name='scale' value='4'/><rgb name='albedo' value='.1, .2 .3'/><phase type='hg'/></medium>",
    );
    assert_eq!(scene.media[0].sigma_t, 2.0.into());
    assert_eq!(scene.media[0].albedo, Vec3::new(0.1, 0.2, 0.3).into());
    assert_eq!(scene.media[0].phase, Phase::HenyeyGreenstein { g: 0.8 });
    // Of colours, too.
    let scene = load(
        "<medium type='homogeneous'><rgb name='sigma_t' value='.1 .2 .3'/><float name='scale' value='10'/></medium>",
    );
    assert_eq!(scene.media[0].sigma_t, Extinction::Constant(DVec3::new(0.1, 0.2, 0.3) * 10.0));
}

#[test]
fn transforms_apply_in_listed_order() {
    let position = |ops: &str| {
        let scene = load(&format!("<emitter type='point'><transform name='to_world'>{ops}</transform></emitter>"));
        let Emitter::Point { position, .. } = scene.emitters[0].clone() else { panic!("not a point") };
        position
    };
    assert_eq!(position("<translate x='1'/><scale value='2'/>"), DVec3::new(2.0, 0.0, 0.0));
    assert_eq!(position("<scale value='2'/><translate x='1'/>"), DVec3::new(1.0, 0.0, 0.0));
    assert!((position("<translate x='1'/><rotate z='1' angle='90'/>") - DVec3::Y).length() < 1e-12);
    assert_eq!(position("<matrix value='1 0 0 5, 0 1 0 6, 0 0 1 7, 0 0 0 1'/>"), DVec3::new(5.0, 6.0, 7.0));
    assert_eq!(position("<translate x='1' y='2'/><matrix value='0 1 0 1 0 0 0 0 1'/>"), DVec3::new(2.0, 1.0, 0.0));
    assert_eq!(position("<lookat origin='1 2 3' target='9 9 9'/>"), DVec3::new(1.0, 2.0, 3.0));
    let op = |op: &str| format!("<emitter type='point'><transform name='to_world'>{op}</transform></emitter>");
    refused(&op("<scale x='0'/>"), "3:23", "inverted");
    refused(&op("<rotate angle='3'/>"), "3:50", "axis is zero");
    refused(&op("<rotate value='1' x='2' angle='3'/>"), "3:50", "together with");
    refused(&op("<lookat origin='0 0 0' target='0 0 0'/>"), "3:50", "same point");
    refused(&op("<lookat origin='0 0 0' target='0 1 0' up='0 3 0'/>"), "3:50", "parallel");
    refused(&op("<matrix value='1 2'/>"), "3:50", "16 or 9");
}

#[test]
fn cube_and_rectangle_face_outward() {
    let scene = load(
        "<shape type='cube'/><shape type='rectangle'/><shape type='rectangle'><boolean name='flip_normals' value='True'/></shape>\
        <shape type='rectangle'><transform name='to_world'><scale x='-1'/></transform></shape>",
    );
    assert_eq!(scene.surfaces[0].triangles.len(), 12);
    for t in &scene.surfaces[0].triangles {
        assert!(t.area_normal().dot(t.vertices_f64()[0]) > 0.0);
    }
    for (surface, z) in [(1, 1.0), (2, -1.0), (3, 1.0)] {
        assert!(scene.surfaces[surface].triangles.iter().all(|t| t.area_normal().z * z > 0.0), "{surface}");
    }
    assert!(scene.warnings.iter().any(|w| w.starts_with("s.xml:3:") && w.contains("mirrors")));
}

#[test]
fn a_mirrored_boundary_follows_its_winding() {
    let fog = format!("{FOG}{}", fog_cube(-1.0, ""));
    let away = "<transform name='to_world'><translate z='-5'/></transform>";
    let scene = load_with(&with_sensor(&fog, away), &[], &[]).unwrap();
    assert!(scene.boundaries[0].triangles.iter().all(|t| t.area_normal().dot(t.vertices_f64()[0]) < 0.0));
    let scene = load("<shape type='cube'><transform name='to_world'><scale value='-1'/></transform></shape>");
    assert!(scene.surfaces[0].triangles.iter().all(|t| t.area_normal().dot(t.vertices_f64()[0]) > 0.0));
}

#[test]
fn obj_files_are_read_or_refused_by_name() {
    let text = scene("<shape type='obj'><string name='filename' value='m.obj'/></shape>");
    let v = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let good = load_with(
        &text,
        &[("m.obj", &format!("{v}g a\nf 1 2 3 4\ng b\nusemtl x\nf 1//1 2 3\n").replace("//1", ""))],
        &[],
    )
    .unwrap();
    assert_eq!(good.surfaces[0].triangles.len(), 3);
    assert!(good.surfaces[0].attributes.normals.is_empty(), "what is flat needs no normals of its corners");
    let bad = |faces: &str, part: &str| refused_text(&text, &[("m.obj", &format!("{v}{faces}"))], "s.xml:3:19", part);
    bad("", "m.obj: the mesh has no faces");
    bad("f 1 2 9", "m.obj:5: there is no vertex 9 in \"f 1 2 9\"");
    bad("f 1 2 0", "m.obj:5: ");
    bad("v 1 nan 2\nf 1 2 5", "m.obj:5: ");
    refused_text(&text, &[], "s.xml:3:19", "cannot read \"m.obj\"");
}

#[test]
fn emitters_are_read() {
    let scene = load(
        "<shape type='rectangle'><emitter type='area'><rgb name='radiance' value='1 2 3'/></emitter></shape><emitter type='constant'/>",
    );
    assert_eq!(scene.emitters[0], Emitter::Area { surface: 0 });
    assert_eq!(scene.surfaces[0].radiance, Some(Vec3::new(1.0, 2.0, 3.0).into()));
    assert_eq!(scene.surfaces[0].bsdf, Bsdf::lambertian(Vec3::ZERO, Vec3::ZERO));
    assert_eq!(scene.emitters[1], Emitter::Constant { radiance: Vec3::ONE });
    refused("<emitter type='area'/>", "3:1", "no shape");
    refused("<shape type='sphere'><emitter type='spot'/></shape>", "3:31", "\"spot\" cannot be inside of a shape");
    refused("<shape type='sphere'><emitter type='sopt'/></shape>", "3:31", "\"sopt\" is not supported");
    refused("<emitter type='constant'/>\n<emitter type='constant'/>", "4:1", "second environment emitter");
    let dark = load_with(&format!("{HEAD}<sensor type='perspective'>{FILM}</sensor></scene>"), &[], &[]).unwrap();
    assert!(dark.warnings[0].contains("no emitter"));
}

/// The field of view, as the tangent of its half.
pub(super) fn tan_of(scene: &Scene) -> f64 {
    match scene.sensor.projection {
        Projection::Perspective { tan_half_fov_x, .. } => tan_half_fov_x,
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_field_of_view_follows_its_axis() {
    let tan = |inner: &str| tan_of(&load_with(&with_sensor("", inner), &[], &[]).unwrap());
    let aspect = 768.0 / 576.0;
    let fov = "<float name='fov' value='90'/>";
    for (axis, expected) in [("x", 1.0), ("larger", 1.0), ("y", aspect), ("smaller", aspect), ("diagonal", 0.8)] {
        let got = tan(&format!("{fov}<string name='fov_axis' value='{axis}'/>"));
        assert!((got - expected).abs() < 1e-12, "{axis}: {got}");
    }
    assert!((tan("") - f64::hypot(36.0, 24.0) / 100.0 * 0.8).abs() < 1e-12);
    refused_text(
        &with_sensor("", &format!("{fov}<string name='focal_length' value='50mm'/>")),
        &[],
        "s.xml:4:80",
        "both",
    );
    let scaled = "<transform name='to_world'><scale value='2'/></transform>";
    refused_text(&with_sensor("", scaled), &[], "s.xml:4:50", "scales");
}

#[test]
fn traps_around_shapes() {
    let opaque = load(&format!("{FOG}\n<shape type='cube'><ref id='fog' name='interior'/></shape>"));
    assert!(opaque.boundaries.is_empty() && opaque.warnings[0].contains("inside of an opaque shape is not seen"));
    refused(
        &format!("{FOG}\n<shape type='cube'><bsdf type='null'/><ref id='fog' name='inside'/></shape>"),
        "4:39",
        "\"interior\"",
    );
    let glowing = "<shape type='cube'><bsdf type='null'/><emitter type='area'/><medium type='homogeneous' name='interior'/></shape>";
    refused(glowing, "3:1", "area emitter on the boundary");
    let nothing = load("<shape type='cube'><bsdf type='null'/></shape>");
    assert!(nothing.boundaries.is_empty() && nothing.warnings[0].contains("no effect"));
}

#[test]
fn the_cameras_medium_is_checked() {
    let inside = format!("{FOG}{}", fog_cube(1.0, ""));
    refused(&inside, "4:1", "camera is inside the medium");
    assert!(load_with(&with_sensor(&inside, "<ref id='fog'/>"), &[], &[]).is_ok());
    let outside = "<transform name='to_world'><translate z='-5'/></transform>";
    assert!(load_with(&with_sensor(&inside, outside), &[], &[]).is_ok());
    // Turned inside out, the inner side is the exterior.
    let turned = format!("{FOG}{}", fog_cube(1.0, "<boolean name='flip_normals' value='true'/>"));
    assert!(load_with(&with_sensor(&turned.replace("interior", "exterior"), "<ref id='fog'/>"), &[], &[]).is_ok());
    refused(&turned.replace("interior", "exterior"), "4:1", "camera is inside the medium");
    let thick = "<medium type='homogeneous'><float name='sigma_t' value='2'/></medium>";
    let other = with_sensor(&inside, thick);
    refused_text(&other, &[], "s.xml:4:1", "not the one that is around");
}

#[test]
fn fog_must_not_vanish_behind_an_inner_boundary() {
    let thick = "<medium type='homogeneous' id='thick'><float name='sigma_t' value='2'/></medium>";
    let cube = |more: &str| {
        let moved = fog_cube(1.0, more).replace("</transform>", "<translate z='5'/></transform>");
        moved.replace("id='fog' name='interior'", "id='thick' name='interior'")
    };
    let nested =
        |more: &str| with_sensor(&format!("{FOG}{thick}{}\n{}", fog_cube(9.0, ""), cube(more)), "<ref id='fog'/>");
    refused_text(&nested(""), &[], "s.xml:4:1", "would vanish");
    assert!(load_with(&nested("<ref id='fog' name='exterior'/>"), &[], &[]).is_ok());
    let away = "<transform name='to_world'><translate z='-5'/></transform><ref id='fog'/>";
    refused_text(&with_sensor(&format!("{FOG}{thick}\n{}", cube("")), away), &[], "s.xml:4:1", "would vanish");
}

#[test]
fn unbounded_fog_under_an_infinite_sky_is_refused() {
    let sky = "\n<emitter type='constant'/>";
    refused_text(&with_sensor(&format!("{FOG}{sky}"), "<ref id='fog'/>"), &[], "s.xml:4:1", "unbounded fog");
    assert!(load_with(&with_sensor(&format!("{FOG}{}{sky}", fog_cube(9.0, "")), "<ref id='fog'/>"), &[], &[]).is_ok());
    assert!(load_with(&with_sensor(FOG, "<ref id='fog'/>"), &[], &[]).is_ok());
}

#[test]
fn a_sensor_is_needed_and_an_integrator_given_once() {
    refused_text("<scene version='3.0.0'><integrator type='volpath'/></scene>", &[], "s.xml:1:1", "no sensor");
    let default = load_with(&format!("{HEAD}<sensor type='perspective'/></scene>"), &[], &[]).unwrap().film;
    assert_eq!((default.width, default.height), (768, 576));
    let second = "<integrator type='path'/>";
    refused(second, "3:1", "a second integrator");
}

/// A shape that single precision would make another one is refused; one whose vertices can be said exactly is not, nor one without extent.
#[test]
fn a_shape_too_far_from_the_origin_is_refused() {
    let at = |x: &str, scale: f64| {
        format!(
            "<shape type='cube'><transform name='to_world'><scale value='{scale}'/><translate x='{x}' y='-{x}'/></transform></shape>"
        )
    };
    refused(&at("10000000.3", 5.0), "3:1", "precision exhausted");
    refused(&at("1e9", 5.0), "3:1", "closer to the origin");
    refused(&at("0", 1e-44), "3:1", "precision exhausted");
    for fine in [at("1e7", 5.0), at("10000000.3", 500.0), at("70.1", 0.01), at("0", 1e-40)] {
        load(&fine);
    }
}

/// The coordinates of maps have seven digits before the point: they are moved to the origin before they are rounded.
#[test]
fn a_mesh_far_away_is_moved_before_it_is_rounded() {
    let mesh = "v -2487000.1 4684683.1 0\nv -2487000 4684683.1 0\nv -2487000 4684683.2 0\nf 1 2 3\n";
    let text = |more: &str| {
        scene(&format!(
            "<shape type='obj'><string name='filename' value='m.obj'/><boolean name='face_normals' value='true'/>{more}</shape>"
        ))
    };
    let near = "<transform name='to_world'><translate x='2487000' y='-4684683'/></transform>";
    let loaded = load_with(&text(near), &[("m.obj", mesh)], &[]).unwrap();
    let expected = [Vec3::new(-0.1, 0.1, 0.0), Vec3::new(0.0, 0.1, 0.0), Vec3::new(0.0, 0.2, 0.0)];
    for (vertex, expected) in loaded.surfaces[0].triangles[0].vertices.iter().zip(expected) {
        assert!((*vertex - expected).abs().max_element() < 1e-8, "{vertex} {expected}");
    }
    refused_text(&text(""), &[("m.obj", mesh)], "s.xml:3:1", "precision exhausted");
}

#[test]
fn includes_and_meshes_are_found_in_their_folders() {
    let leaf = format!("<scene version='3.0.0'>{LIGHT}</scene>");
    let two = format!("<scene version='3.0.0'>{LIGHT}{LIGHT}</scene>");
    let outer = "<scene version='3.0.0'><include filename='leaf.xml'/></scene>";
    let count = |text: &str, others: &[(&str, &str)]| load_with(&scene(text), others, &[]).unwrap().emitters.len() - 1;
    let nested = "<include filename='a/outer.xml'/>";
    assert_eq!(count(nested, &[("a/outer.xml", outer), ("a/leaf.xml", &two), ("leaf.xml", &leaf)]), 2);
    assert_eq!(count(nested, &[("a/outer.xml", outer), ("leaf.xml", &leaf)]), 1);
    let path = "<path value='p'/><include filename='leaf.xml'/>";
    assert_eq!(count(path, &[("p/leaf.xml", &leaf)]), 1);
    assert_eq!(count(path, &[("p/leaf.xml", &leaf), ("leaf.xml", &two)]), 2);
    let mesh = "<path value='p'/><shape type='obj'><string name='filename' value='m.obj'/></shape>";
    let one = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let loaded = load_with(&scene(mesh), &[("p/m.obj", one), ("m.obj", &one.repeat(2))], &[]).unwrap();
    assert_eq!(loaded.surfaces[0].triangles.len(), 1);
    refused("<path value='q'/>", "3:1", "there is no folder \"q\"");
    refused("<shape type='cube'><path value='q'/></shape>", "3:20", "there is no folder \"q\"");
    let inside = "<shape type='cube'><transform name='to_world'><path value='q'/></transform></shape>";
    refused(inside, "3:47", "<path> inside <transform>");
    // What stands in an object concerns all that follows, and what is included belongs to the object.
    let sphere =
        "<shape type='sphere'><default name='r' value='2'/><alias id='b' as='c'/><include filename='r.xml'/></shape>";
    let text = scene(&format!("<bsdf type='diffuse' id='b'/>{sphere}<shape type='cube'><ref id='c'/></shape>"));
    let radius = "<scene version='3.0.0'><float name='radius' value='$r'/><ref id='c'/></scene>";
    let loaded = load_with(&text, &[("r.xml", radius)], &[]).unwrap();
    assert_eq!(loaded.surfaces[0].curved.unwrap().placement().0.x_axis.length(), 2.0);
}
