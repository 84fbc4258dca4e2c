//! What Mitsuba lets pass, and so does the loader, mostly with a warning.

use glam::Vec3;

use super::tests::{FOG, LIGHT, load, load_with, refused, scene};
use crate::{Bsdf, IntegratorSettings, Texture};

#[test]
fn what_follows_the_scene_is_ignored_with_a_warning() {
    for behind in ["<shape type='sphere'/>", "<oops/>", "modifications = []", "\u{200b}"] {
        let loaded = load_with(&format!("{}\n <!-- -->{behind}\n", scene("")), &[], &[]).unwrap();
        let expected = "s.xml:5:10: what follows the end of the scene is ignored, as in Mitsuba";
        assert_eq!((loaded.surfaces.len(), loaded.warnings), (0, vec![expected.to_owned()]));
    }
    for behind in ["</scene>", "<shape type='sphere'>", "a < b"] {
        assert!(load_with(&format!("{}{behind}", scene("")), &[], &[]).unwrap_err().to_string().contains("XML"));
    }
    let included = format!("<scene version='3.0.0'>{LIGHT}</scene>\nx");
    let loaded = load_with(&scene("<include filename='a.xml'/>"), &[("a.xml", &included)], &[]).unwrap();
    assert!(loaded.emitters.len() == 2 && loaded.warnings[0].starts_with("a.xml:2:1: "), "{:?}", loaded.warnings);
}

#[test]
fn text_between_elements_is_ignored_with_one_warning_a_file() {
    for (body, place, tag) in [
        ("<shape type='cube'/>x", "3:21", "scene"),
        ("<shape type='cube'>\n\u{200b}</shape>", "4:1", "shape"),
        ("<shape type='cube'><transform name='to_world'> é<scale value='2'/></transform></shape>", "3:48", "transform"),
        ("<shape type='sphere'><float name='radius' value='2'> 3</float></shape>", "3:54", "float"),
        ("<shape type='cube'><![CDATA[x]]></shape> y", "3:20", "shape"),
    ] {
        let warnings = load(body).warnings;
        let expected =
            format!("s.xml:{place}: text inside <{tag}> is ignored, as in Mitsuba: values are written as attributes");
        assert_eq!(warnings, [expected]);
    }
    let included = format!("<scene version='3.0.0'>{LIGHT}x</scene>");
    let twice = "a<include filename='a.xml'/>b<include filename='a.xml'/>c";
    let warnings = load_with(&scene(twice), &[("a.xml", &included)], &[]).unwrap().warnings;
    assert!(warnings.len() == 2 && warnings[1].starts_with("a.xml:1:"), "{warnings:?}");
    // Where it was meant to be the value.
    let inside = |property: &str| format!("<bsdf type='diffuse' id='b'>{property}</bsdf>");
    refused(&inside("<rgb name='reflectance'>1, 0, 0</rgb>"), "3:53", "text inside <rgb>");
    refused(&inside("<spectrum name='reflectance'>400:1</spectrum>"), "3:58", "written as attributes");
    refused("<default name='a'>1</default>", "3:19", "written as attributes");
}

/// Mitsuba makes no difference between the two.
#[test]
fn a_spectrum_of_a_textures_type_is_that_texture() {
    let surface = |tag: &str| {
        let texture = format!("<{tag} type='checkerboard' name='reflectance'><rgb name='color0' value='0.1'/></{tag}>");
        let board = format!("<{tag} type='checkerboard' id='board'/>");
        let light = "<shape type='rectangle'><emitter type='area'><ref id='board' name='radiance'/></emitter></shape>";
        load(&format!("{board}<shape type='cube'><bsdf type='diffuse'>{texture}</bsdf></shape>{light}")).surfaces
    };
    let (spectra, textures) = (surface("spectrum"), surface("texture"));
    assert_eq!(spectra[0].bsdf, textures[0].bsdf);
    assert!(matches!(spectra[0].bsdf, Bsdf::Diffuse { reflectance: Texture::Checkerboard { .. } }));
    assert!(matches!(spectra[1].radiance, Some(Texture::Checkerboard { .. })));
    let bitmap = |more: &str| format!("<bsdf type='diffuse'><spectrum name='reflectance' type='bitmap'{more}/></bsdf>");
    refused(&bitmap(""), "3:22", "no filename");
    refused(&bitmap(" value='0.5'"), "3:65", "has no attribute \"value\"");
}

/// Fresnel's equations know the squares of both parts alone.
#[test]
fn indices_of_metals_may_be_negative() {
    let metal = |inner: &str| {
        let loaded = load(&format!("<shape type='cube'><bsdf type='roughconductor'>{inner}</bsdf></shape>"));
        match loaded.surfaces[0].bsdf.clone() {
            Bsdf::Conductor { eta, k, .. } => (eta, k, loaded.warnings),
            other => panic!("{other:?}"),
        }
    };
    let (eta, k, warnings) = metal("<rgb name='eta' value='-0.05, 4, 4.5'/><rgb name='k' value='1, -0.5, 0'/>");
    assert_eq!((eta, k), (Vec3::new(-0.05, 4.0, 4.5), Vec3::new(1.0, -0.5, 0.0)));
    let expected = ["eta", "k"].map(|name| format!("\"{name}\" is negative: its sign changes nothing, as in Mitsuba"));
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(warnings.iter().zip(expected).all(|(w, e)| w.starts_with("s.xml:3:") && w.ends_with(&e)), "{warnings:?}");
    for flat in [
        "<float name='eta' value='-2'/>",
        "<spectrum name='eta' value='-2'/>",
        "<spectrum name='eta' type='uniform'><float name='value' value='-2'/></spectrum>",
    ] {
        let (eta, _, warnings) = metal(flat);
        assert_eq!((eta, warnings.len()), (Vec3::splat(-2.0), 1), "{flat}");
    }
    // What would overflow in these equations reflects all light.
    assert_eq!(metal("<rgb name='eta' value='-1e30, 1e30, 1'/>").0, Vec3::new(-1e9, 1e9, 1.0));
    for bad in ["1e39", "nan", "-inf"] {
        refused(&format!("<bsdf type='conductor'><rgb name='eta' value='{bad}'/></bsdf>"), "3:24", "");
    }
    refused("<bsdf type='conductor'><float name='ext_eta' value='-1'/></bsdf>", "3:24", "");
}

/// A BSDF is read where it stands, and again for each shape that refers to it.
#[test]
fn a_warning_is_told_once() {
    let bsdf = "<bsdf type='conductor' id='b'><float name='eta' value='-1'/></bsdf>";
    let shapes = "<shape type='cube'><ref id='b'/></shape>".repeat(3);
    let warnings = load(&format!("{bsdf}{shapes}")).warnings;
    assert!(warnings.len() == 1 && warnings[0].contains("negative"), "{warnings:?}");
}

#[test]
fn a_medium_of_a_shape_without_a_name_is_ignored() {
    for medium in ["<medium type='homogeneous'/>", "<ref id='fog'/>"] {
        let loaded = load(&format!("{FOG}\n<shape type='cube'><bsdf type='null'/>{medium}{medium}</shape>"));
        assert!(loaded.boundaries.is_empty());
        assert!(
            loaded.warnings[0].starts_with("s.xml:4:39: a medium of a shape without a name"),
            "{:?}",
            loaded.warnings
        );
    }
    let wrong = "<shape type='cube'><medium type='homogeneous'><float name='g' value='1'/></medium></shape>";
    refused(wrong, "3:47", "no property \"g\"");
}

/// Mitsuba loads it, too, and renders it with the integrator that it is told.
#[test]
fn a_scene_without_an_integrator_is_rendered_as_volpath() {
    let text = format!("<scene version='3.0.0'><sensor type='perspective'/>{LIGHT}</scene>");
    let loaded = load_with(&text, &[], &[]).unwrap();
    assert_eq!(loaded.integrator, IntegratorSettings { max_depth: None, rr_depth: 5 });
    assert_eq!(loaded.integrator, load("").integrator);
    assert_eq!(loaded.warnings, ["s.xml:1:1: the scene has no integrator: rendered as volpath"]);
}
