//! What surfaces are made of: turned normals, attributes of meshes, Disney's materials.

use glam::Vec3;

use super::tests::{load, load_with, refused, refused_text, scene};
use crate::{Attribute, Bsdf, Perturbation, Principled, PrincipledThin, Rgb, Scene, Texture};

fn material(bsdf: &str) -> Bsdf {
    load(&format!("<shape type='cube'>{bsdf}</shape>")).surfaces[0].bsdf.clone()
}

const RAW: &str =
    "<texture type='rawconstant' name='normalmap'><vector name='value' value='0.5, 0.25, 1.5'/></texture>";

#[test]
fn normals_are_turned_by_maps_and_by_bumps() {
    let nested = "<bsdf type='conductor'/>";
    let Bsdf::Perturbed { by, flip_invalid_normals: true, shadowing: true, of } =
        material(&format!("<bsdf type='normalmap'>{RAW}{nested}</bsdf>"))
    else {
        panic!("no normal map")
    };
    assert_eq!(by, Perturbation::Normals(Texture::Constant(Vec3::new(0.5, 0.25, 1.5))));
    assert!(matches!(*of, Bsdf::Conductor { .. }));
    let bumps = "<texture type='rawconstant' name='any'><float name='value' value='0.5'/></texture>\
        <float name='scale' value='-2'/><boolean name='flip_invalid_normals' value='false'/>\
        <boolean name='use_shadowing_function' value='false'/>";
    let Bsdf::Perturbed { by, flip_invalid_normals: false, shadowing: false, .. } =
        material(&format!("<bsdf type='bumpmap'>{bumps}{nested}</bsdf>"))
    else {
        panic!("no bumps")
    };
    assert_eq!(by, Perturbation::Heights { texture: Texture::grey(0.5), scale: -2.0 });
    // Texture coordinates are kept for them, even if no colour needs any.
    let cube = load(&format!("<shape type='cube'><bsdf type='normalmap'>{RAW}{nested}</bsdf></shape>"));
    assert_eq!(cube.surfaces[0].attributes.uvs.len(), 12);

    let masked =
        format!("<shape type='cube'><bsdf type='normalmap'>{RAW}<bsdf type='mask'>{nested}</bsdf></bsdf></shape>");
    assert!(load(&masked).warnings[0].contains("Mitsuba blocks shadow rays"));
    let bad = |bsdf: &str, part: &str| refused(&format!("<shape type='cube'>\n{bsdf}</shape>"), "4:1", part);
    bad(&format!("<bsdf type='normalmap'>{nested}</bsdf>"), "no texture \"normalmap\"");
    bad(&format!("<bsdf type='normalmap'>{RAW}</bsdf>"), "must hold one BSDF");
    bad(&format!("<bsdf type='bumpmap'>{nested}</bsdf>"), "must hold one texture");
    refused(
        &format!(
            "<shape type='cube'>\n<bsdf type='bumpmap'><texture type='checkerboard' name='a'/>{nested}</bsdf></shape>"
        ),
        "4:22",
        "no picture",
    );
    refused("<texture type='rawconstant'/>", "3:1", "no value");
    // The fields of a checkerboard may be numbers that are no reflectance.
    let board = "<texture type='checkerboard' name='diff_trans'><float name='color0' value='1.5'/></texture>";
    let Bsdf::PrincipledThin(thin) = material(&format!("<bsdf type='principledthin'>{board}</bsdf>")) else {
        panic!("not thin")
    };
    assert!(matches!(&thin.diff_trans, Texture::Checkerboard { first, .. } if **first == Texture::grey(1.5)));
    let negative = "<texture type='rawconstant'>\n<float name='value' value='-1'/></texture>";
    refused(negative, "4:1", "at least 0");
}

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    property float r\nproperty float g\nproperty float b\nproperty float heat_0\nelement face 2\n\
    property list uchar int vertex_indices\nproperty float tint_r\nproperty float tint_g\nproperty float tint_b\nend_header\n\
    0 0 0 1 0 0 0.1\n1 0 0 0 1 0 0.2\n1 1 0 0 0 1 0.3\n0 1 0 1 1 -1 0.4\n3 0 1 2 0.5 0.25 1\n3 0 2 3 2 3 4\n";

/// A square with the attribute of that name as its reflectance; `more` goes into the texture, `flags` into the shape.
fn coloured(name: &str, more: &str, flags: &str) -> String {
    scene(&format!(
        "<shape type='ply'><string name='filename' value='m.ply'/>{flags}<bsdf type='diffuse'>\
         <texture type='mesh_attribute' name='reflectance'>\n<string name='name' value='{name}'/>{more}</texture></bsdf></shape>"
    ))
}

fn attribute(scene: &Scene) -> &Attribute {
    match &scene.surfaces[0].bsdf {
        Bsdf::Diffuse { reflectance: Texture::Attribute(attribute) } => attribute,
        other => panic!("{other:?}"),
    }
}

#[test]
fn meshes_bring_colours_of_their_vertices_and_faces() {
    let load = |name: &str, more: &str, flags: &str| {
        load_with(&coloured(name, more, flags), &[("m.ply", PLY)], &[]).expect("it loads")
    };
    let (red, green, blue) = (Rgb::X, Rgb::Y, Rgb::Z);
    // Below zero is black.
    let yellow = Rgb::new(1.0, 1.0, 0.0);
    let corners = vec![[red, green, blue], [red, blue, yellow]];
    assert_eq!(attribute(&load("vertex_color", "", "")), &Attribute::Corners(corners));
    let turned = vec![[red, blue, green], [red, yellow, blue]];
    let flip = "<boolean name='flip_normals' value='true'/>";
    let flipped = load("vertex_color", "", flip);
    assert_eq!(attribute(&flipped), &Attribute::Corners(turned));
    // The corners are turned with what they carry.
    assert_eq!(flipped.surfaces[0].triangles[0].vertices[1], Vec3::new(1.0, 1.0, 0.0));
    let faces = vec![Rgb::new(1.0, 0.5, 2.0), Rgb::new(4.0, 6.0, 8.0)];
    let twice = "<float name='scale' value='2'/>";
    assert_eq!(attribute(&load("face_tint_color", twice, "")), &Attribute::Faces(faces));
    let Attribute::Corners(heat) = attribute(&load("vertex_heat", "", "")).clone() else { panic!("of vertices") };
    assert_eq!(heat[1], [0.1, 0.3, 0.4].map(Rgb::splat));

    let bad = |name: &str, place: &str, part: &str| {
        refused_text(&coloured(name, "", ""), &[("m.ply", PLY)], place, part);
    };
    bad("vertex_colour", "s.xml:4:1", "it has vertex_color, vertex_heat, face_tint_color");
    bad("color", "s.xml:4:1", "must begin with vertex_ or face_");
    let on_cube = coloured("vertex_color", "", "")
        .replace("<string name='filename' value='m.ply'/>", "")
        .replace("'ply'", "'cube'");
    refused_text(&on_cube, &[], "s.xml:4:1", "only PLY meshes");
    // One that stands by itself is read where a shape refers to it.
    let texture = "<bsdf type='diffuse' id='b'><texture type='mesh_attribute' name='reflectance'>\
        <string name='name' value='vertex_color'/></texture></bsdf>";
    let shape = "<shape type='ply'><string name='filename' value='m.ply'/><ref id='b'/></shape>";
    let shared = load_with(&scene(&format!("{texture}{shape}")), &[("m.ply", PLY)], &[]).expect("it loads");
    assert!(matches!(attribute(&shared), Attribute::Corners(c) if c[0][1] == green));
}

#[test]
fn disney_materials_have_mitsubas_defaults() {
    let grey = Texture::grey;
    let Bsdf::Principled(p) = material("<bsdf type='principled'/>") else { panic!("not principled") };
    let defaults = Principled {
        base_color: grey(0.5),
        roughness: grey(0.5),
        anisotropic: grey(0.0),
        metallic: grey(0.0),
        spec_trans: grey(0.0),
        eta: 1.5,
        spec_tint: grey(0.0),
        sheen: grey(0.0),
        sheen_tint: grey(0.0),
        flatness: grey(0.0),
        clearcoat: grey(0.0),
        clearcoat_gloss: grey(0.0),
        sampling_rates: [1.0; 3],
    };
    // A `specular` of 0.5 is an index of 1.5.
    assert_eq!(*p, Principled { eta: p.eta, ..defaults });
    assert!((p.eta - 1.5).abs() < 1e-12 && !p.transmits());
    let eta = |inner: &str| match material(&format!("<bsdf type='principled'>{inner}</bsdf>")) {
        Bsdf::Principled(p) => p.eta,
        other => panic!("{other:?}"),
    };
    let glass = "<float name='spec_trans' value='0.5'/>";
    assert_eq!([eta("<float name='eta' value='1'/>"), eta("<float name='specular' value='0'/>")], [1.0, 1.0]);
    assert_eq!(eta(&format!("{glass}<float name='eta' value='1'/>")), 1.001);
    assert!((eta(&format!("{glass}<float name='specular' value='0'/>")) - 1.018_05).abs() < 1e-5);

    let Bsdf::PrincipledThin(p) = material("<bsdf type='principledthin'/>") else { panic!("not thin") };
    let defaults = PrincipledThin {
        base_color: grey(0.5),
        roughness: grey(0.5),
        anisotropic: grey(0.0),
        spec_trans: grey(0.0),
        eta: grey(1.5),
        spec_tint: grey(0.0),
        sheen: grey(0.0),
        sheen_tint: grey(0.0),
        flatness: grey(0.0),
        diff_trans: grey(0.0),
        sampling_rates: [1.0; 4],
    };
    assert_eq!(*p, defaults);
    let bad = |inner: &str, part: &str| {
        let (kind, inner) = inner.split_once(' ').expect("a kind");
        refused(&format!("<shape type='cube'><bsdf type='{kind}'>\n{inner}</bsdf></shape>"), "4:1", part);
    };
    bad("principled <float name='eta' value='0'/>", "positive");
    bad("principled <float name='specular' value='1'/><float name='eta' value='1'/>", "together");
    bad("principled <float name='main_specular_sampling_rate' value='-1'/>", "from 0");
    bad("principledthin <float name='diff_trans' value='2.5'/>", "in [0, 2]");
    bad("principledthin <float name='eta' value='0'/>", "positive");
}
