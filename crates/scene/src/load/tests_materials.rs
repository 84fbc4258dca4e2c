//! BSDFs: Mitsuba's names and defaults, and what is refused.

use super::tests::{FOG, load, load_with, refused, scene};
use crate::{Bsdf, Conductor, Dielectric, Microfacets, Plastic, Rgb, Roughness};

/// The BSDF of a cube.
fn bsdf(text: &str) -> Bsdf {
    load(&format!("<shape type='cube'>{text}</shape>")).surfaces[0].bsdf
}

/// The defaults of Mitsuba 3.9.1, as it prints them: η of glass 1.504183, of plastic 1.489587; a conductor without a material is a mirror.
#[test]
fn materials_have_mitsubas_defaults() {
    let Bsdf::Dielectric(glass) = bsdf("<bsdf type='dielectric'/>") else { panic!("it is glass") };
    let white = Rgb::ONE;
    assert_eq!(
        Dielectric { eta: 0.0, ..glass },
        Dielectric { eta: 0.0, specular_reflectance: white, specular_transmittance: white, roughness: None }
    );
    assert!((glass.eta - 1.504_183_3).abs() < 1e-6);
    let Bsdf::Dielectric(rough) = bsdf("<bsdf type='roughdielectric'/>") else { panic!("it is glass") };
    assert_eq!(rough.roughness, Some(Roughness { alpha: 0.1, distribution: Microfacets::Beckmann }));
    let Bsdf::Plastic(plastic) = bsdf("<bsdf type='plastic'/>") else { panic!("it is plastic") };
    assert!((plastic.eta - 1.489_587_3).abs() < 1e-6);
    let grey = Rgb::splat(0.5);
    assert_eq!(
        Plastic { eta: 0.0, ..plastic },
        Plastic {
            eta: 0.0,
            diffuse_reflectance: grey,
            specular_reflectance: white,
            nonlinear: false,
            two_sided: false
        }
    );
    let mirror = Conductor { eta: Rgb::ZERO, k: white, specular_reflectance: white, roughness: None, two_sided: false };
    assert_eq!(bsdf("<bsdf type='conductor'/>"), Bsdf::Conductor(mirror));
    assert_eq!(
        bsdf("<bsdf type='twosided'><bsdf type='conductor'/></bsdf>"),
        Bsdf::Conductor(Conductor { two_sided: true, ..mirror })
    );
}

#[test]
fn materials_are_read_by_name_and_by_number() {
    let Bsdf::Conductor(gold) = bsdf(
        "<bsdf type='roughconductor'><string name='material' value='Au'/><string name='distribution' value='ggx'/>\
         <float name='alpha_u' value='0.3'/><float name='alpha_v' value='0.3'/></bsdf>",
    ) else {
        panic!("it is a metal")
    };
    assert!((gold.eta - Rgb::new(0.143, 0.375, 1.442)).abs().max_element() < 1e-3);
    assert_eq!(gold.roughness, Some(Roughness { alpha: 0.3, distribution: Microfacets::Ggx }));
    let own =
        "<bsdf type='conductor'><rgb name='eta' value='0.2, 0.9, 1.1'/><rgb name='k' value='3.9 2.5 2.2'/></bsdf>";
    let Bsdf::Conductor(own) = bsdf(own) else { panic!("it is a metal") };
    assert_eq!((own.eta, own.k), (Rgb::new(0.2, 0.9, 1.1), Rgb::new(3.9, 2.5, 2.2)));
    let ice = "<bsdf type='dielectric'><string name='int_ior' value='Water Ice'/><float name='ext_ior' value='1.333'/></bsdf>";
    let Bsdf::Dielectric(ice) = bsdf(ice) else { panic!("it is glass") };
    assert_eq!(ice.eta, 1.31 / 1.333);
}

#[test]
fn materials_that_make_no_sense_are_refused() {
    let cases = [
        ("<bsdf type='conductor'><string name='material' value='Gold'/></bsdf>", "the material \"Gold\" is not known"),
        (
            "<bsdf type='conductor'><string name='material' value='Au'/><float name='k' value='1'/></bsdf>",
            "both \"material\" and",
        ),
        ("<bsdf type='dielectric'><float name='int_ior' value='0'/></bsdf>", "it must be positive"),
        (
            "<bsdf type='dielectric'><string name='int_ior' value='glass'/></bsdf>",
            "the index of refraction of \"glass\" is not known",
        ),
        ("<bsdf type='roughconductor'><float name='alpha' value='0'/></bsdf>", "more than 0 and at most 10"),
        (
            "<bsdf type='roughconductor'><float name='alpha_u' value='0.1'/><float name='alpha_v' value='0.2'/></bsdf>",
            "as rough in all directions",
        ),
        (
            "<bsdf type='roughconductor'><string name='distribution' value='phong'/></bsdf>",
            "\"phong\" is not supported",
        ),
        ("<bsdf type='twosided'><bsdf type='dielectric'/></bsdf>", "bsdf type \"dielectric\" is not supported"),
        ("<bsdf type='twosided'><bsdf type='diffuse'/><bsdf type='plastic'/></bsdf>", "neither alike nor both diffuse"),
        ("<bsdf type='conductor'><boolean name='nonlinear' value='true'/></bsdf>", "nonlinear"),
    ];
    for (text, part) in cases {
        let error =
            load_with(&scene(&format!("<shape type='cube'>{text}</shape>")), &[], &[]).expect_err(text).to_string();
        assert!(error.starts_with("s.xml:3:") && error.contains(part), "expected {part:?} in: {error}");
    }
}

/// Glass with a medium inside is an occluder and the boundary of a region; what is opaque has no inside.
#[test]
fn glass_may_hold_a_medium() {
    let filled = |bsdf| {
        format!(
            "{FOG}<shape type='cube'><transform name='to_world'><translate z='5'/></transform><bsdf type='{bsdf}'/><ref id='fog' name='interior'/></shape>"
        )
    };
    for bsdf in ["dielectric", "roughdielectric"] {
        let scene = load(&filled(bsdf));
        assert_eq!((scene.surfaces.len(), scene.boundaries.len()), (1, 1));
        assert_eq!(scene.surfaces[0].triangles, scene.boundaries[0].triangles);
        assert!(scene.boundaries[0].interior.is_some() && scene.warnings.is_empty(), "{:?}", scene.warnings);
    }
    for bsdf in ["conductor", "plastic"] {
        let text = filled(bsdf);
        refused(&text, &format!("3:{}", FOG.len() + 1), "is opaque");
    }
}
