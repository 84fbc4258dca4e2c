//! BSDFs, with Mitsuba 3's names and defaults.

use super::document::Element;
use super::properties::Object;
use super::{Loader, features, names};
use crate::{Bsdf, Conductor, Dielectric, Microfacets, Plastic, Rgb, Roughness, SceneError};

/// What a shape without a BSDF has.
pub(super) fn default_bsdf(emits: bool) -> Bsdf {
    Bsdf::Diffuse { front: Rgb::splat(if emits { 0.0 } else { 0.5 }), back: Rgb::ZERO }
}

/// A BSDF; `None` is `null`.
pub(super) fn bsdf<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<Option<Bsdf>, SceneError> {
    let mut object = Object::new(loader, element, features::kinds("bsdf"))?;
    let bsdf = match object.kind() {
        "null" => None,
        "twosided" => Some(two_sided(loader, &mut object)?),
        _ => Some(one_sided(loader, &mut object)?),
    };
    object.finish()?;
    Ok(bsdf)
}

fn one_sided<'a>(loader: &Loader<'a>, object: &mut Object<'a>) -> Result<Bsdf, SceneError> {
    Ok(match object.kind() {
        "diffuse" => Bsdf::Diffuse { front: object.reflectance("reflectance", 0.5)?, back: Rgb::ZERO },
        "conductor" => Bsdf::Conductor(conductor(object, None)?),
        "roughconductor" => {
            let roughness = roughness(loader, object)?;
            Bsdf::Conductor(conductor(object, Some(roughness))?)
        }
        "dielectric" => Bsdf::Dielectric(dielectric(object, None)?),
        "roughdielectric" => {
            let roughness = roughness(loader, object)?;
            Bsdf::Dielectric(dielectric(object, Some(roughness))?)
        }
        _ => Bsdf::Plastic(Plastic {
            eta: relative_index(object, "polypropylene")?,
            diffuse_reflectance: object.reflectance("diffuse_reflectance", 0.5)?,
            specular_reflectance: object.reflectance("specular_reflectance", 1.0)?,
            nonlinear: object.boolean("nonlinear", false)?,
            two_sided: false,
        }),
    })
}

/// One BSDF for both sides, or two diffuse ones: front and back.
fn two_sided<'a>(loader: &Loader<'a>, object: &mut Object<'a>) -> Result<Bsdf, SceneError> {
    let nested = object.nested("bsdf");
    let (front, back) = match nested.as_slice() {
        [both] => (both, both),
        [front, back] => (front, back),
        other => {
            let help = "nest one BSDF, or two diffuse ones: front and back";
            return Err(object.error(format!("{} nested BSDFs", other.len()), help));
        }
    };
    let read = |element: &'a Element| {
        let mut object = Object::new(loader, element, OPAQUE)?;
        let bsdf = one_sided(loader, &mut object)?;
        object.finish()?;
        Ok(bsdf)
    };
    Ok(match (read(front.object)?, read(back.object)?) {
        (Bsdf::Diffuse { front, .. }, Bsdf::Diffuse { front: back, .. }) => Bsdf::Diffuse { front, back },
        (Bsdf::Conductor(metal), back) if back == Bsdf::Conductor(metal) => {
            Bsdf::Conductor(Conductor { two_sided: true, ..metal })
        }
        (Bsdf::Plastic(plastic), back) if back == Bsdf::Plastic(plastic) => {
            Bsdf::Plastic(Plastic { two_sided: true, ..plastic })
        }
        _ => {
            let help = "give both sides one BSDF, or two diffuse ones";
            return Err(object.error("its sides are neither alike nor both diffuse", help));
        }
    })
}

/// What may be put on both sides of a surface.
const OPAQUE: &[&str] = &["diffuse", "conductor", "roughconductor", "plastic"];

fn conductor(object: &mut Object<'_>, roughness: Option<Roughness>) -> Result<Conductor, SceneError> {
    let own = ["eta", "k"].into_iter().any(|name| object.has(name));
    if own && object.has("material") {
        return Err(object.place_of("material").error("both \"material\" and \"eta\" or \"k\"", "remove one"));
    }
    let (eta, k) = match object.string("material")? {
        None if own => (object.at_least_0("eta", 0.0)?, object.at_least_0("k", 1.0)?),
        None | Some("none") => (Rgb::ZERO, Rgb::ONE),
        Some(name) => METALS
            .iter()
            .find(|(metal, ..)| *metal == name)
            .map(|(_, eta, k)| (Rgb::from_array(*eta), Rgb::from_array(*k)))
            .ok_or_else(|| {
                let known: Vec<&str> = METALS.iter().map(|(metal, ..)| *metal).chain(["none"]).collect();
                let message = format!("the material \"{name}\" is not known");
                object.place_of("material").error(message, names::suggest(name, &known))
            })?,
    };
    let specular_reflectance = object.reflectance("specular_reflectance", 1.0)?;
    Ok(Conductor { eta, k, specular_reflectance, roughness, two_sided: false })
}

fn dielectric(object: &mut Object<'_>, roughness: Option<Roughness>) -> Result<Dielectric, SceneError> {
    Ok(Dielectric {
        eta: relative_index(object, "bk7")?,
        specular_reflectance: object.reflectance("specular_reflectance", 1.0)?,
        specular_transmittance: object.reflectance("specular_transmittance", 1.0)?,
        roughness,
    })
}

fn roughness<'a>(loader: &Loader<'a>, object: &mut Object<'a>) -> Result<Roughness, SceneError> {
    object.without_effect(loader, &["sample_visible"])?;
    let distribution = match object.choice("distribution", "beckmann", &["beckmann", "ggx"])? {
        "ggx" => Microfacets::Ggx,
        _ => Microfacets::Beckmann,
    };
    let mut alpha =
        |name| object.float_where(name, 0.1, |alpha| alpha > 0.0 && alpha <= 10.0, "more than 0 and at most 10");
    let (u, v) = (alpha("alpha_u")?, alpha("alpha_v")?);
    let both = alpha("alpha")?;
    let alpha = match object.has("alpha_u") || object.has("alpha_v") {
        false => both,
        true if u == v => u,
        true => {
            let at = object.place_of(if object.has("alpha_v") { "alpha_v" } else { "alpha_u" });
            let help = "only surfaces that are as rough in all directions are supported: write \"alpha\"";
            return Err(at.error(format!("\"alpha_u\" is {u} and \"alpha_v\" {v}"), help));
        }
    };
    // As in Mitsuba: smoother ones are mirrors but for rounding.
    Ok(Roughness { alpha: alpha.max(1e-4), distribution })
}

/// The index of refraction inside over that outside.
fn relative_index(object: &mut Object<'_>, inside: &'static str) -> Result<f64, SceneError> {
    Ok(index(object, "int_ior", inside)? / index(object, "ext_ior", "air")?)
}

/// An index of refraction: a number, or the name of a substance.
fn index(object: &mut Object<'_>, name: &'static str, default: &'static str) -> Result<f64, SceneError> {
    let substance = match object.number_or_word(name)? {
        Some(Ok(number)) if number > 0.0 => return Ok(number),
        Some(Ok(number)) => {
            return Err(object.place_of(name).error(format!("\"{name}\" is {number}"), "it must be positive"));
        }
        Some(Err(word)) => word,
        None => default,
    };
    let lower = substance.to_ascii_lowercase();
    SUBSTANCES.iter().find(|(known, _)| *known == lower).map(|(_, index)| *index).ok_or_else(|| {
        let known: Vec<&str> = SUBSTANCES.iter().map(|(known, _)| *known).collect();
        let message = format!("the index of refraction of \"{substance}\" is not known");
        object.place_of(name).error(message, names::suggest(substance, &known))
    })
}

/// Indices of refraction for yellow light.
const SUBSTANCES: [(&str, f64); 23] = [
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.520_45),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
];

/// Complex indices of refraction in red, green and blue: measured spectra as Mitsuba 3.9.1 weights them. Zeros are where a colour is out of
/// gamut.
const METALS: [(&str, [f32; 3], [f32; 3]); 37] = [
    ("a-C", [2.944_05, 2.227_14, 1.968_16], [0.887_46, 0.7993, 0.815_29]),
    ("Ag", [0.155_28, 0.116_73, 0.138_39], [4.828_35, 3.122_22, 2.1469]),
    ("Al", [1.6575, 0.8804, 0.521_24], [9.223_81, 6.2695, 4.837]),
    ("AlAs", [3.6053, 3.232_94, 2.216_32], [0.000_68, 0.0, 0.007_51]),
    ("AlSb", [0.0, 4.139_37, 4.669_25], [0.0, 0.094_01, 1.300_57]),
    ("Au", [0.143_04, 0.375_31, 1.442_05], [3.983, 2.385_56, 1.603_36]),
    ("Be", [4.185_01, 3.185_03, 2.784_06], [3.835_47, 3.010_12, 2.868_99]),
    ("Cr", [4.369_67, 2.916_51, 1.6549], [5.206_55, 4.231_31, 3.7547]),
    ("CsI", [2.1449, 1.702_32, 1.662_43], [0.0, 0.0, 0.0]),
    ("Cu", [0.201_01, 0.923_75, 1.102_22], [3.913_26, 2.453_05, 2.142_09]),
    ("Cu2O", [3.551_77, 2.949_87, 2.751_88], [0.114_21, 0.1939, 0.606_13]),
    ("CuO", [3.247_54, 2.447_81, 2.210_22], [0.521_09, 0.570_03, 0.722_18]),
    ("d-C", [2.708_72, 2.318_83, 2.2289], [0.0, 0.0, 0.0]),
    ("Hg", [2.398_94, 1.440_03, 0.909_57], [6.327_59, 4.371_92, 3.421_76]),
    ("HgTe", [4.779_04, 3.2312, 2.6599], [1.631_61, 1.580_81, 1.729_29]),
    ("Ir", [3.0863, 2.082_19, 1.617_91], [5.592_15, 4.067_09, 3.267_31]),
    ("K", [0.064_04, 0.046_41, 0.038_18], [2.1042, 1.348_94, 0.913_13]),
    ("Li", [0.265_79, 0.195_62, 0.220_95], [3.540_15, 2.311_12, 1.668_61]),
    ("MgO", [2.089_58, 1.650_72, 1.594_88], [0.0, 0.0, 0.0]),
    ("Mo", [4.483_97, 3.525_13, 2.776_31], [4.111_44, 3.420_83, 3.150_61]),
    ("Na_palik", [0.060_27, 0.056_14, 0.061_99], [3.179_27, 2.112_49, 1.579_04]),
    ("Nb", [3.420_07, 2.790_09, 2.395_63], [3.441_39, 2.737_67, 2.579_75]),
    ("Ni_palik", [2.3673, 1.663_37, 1.467_08], [4.498_81, 3.050_15, 2.345_44]),
    ("Rh", [2.585_79, 1.860_22, 1.554_26], [6.782_26, 4.702_99, 3.976_07]),
    ("Se", [4.058_31, 2.842_94, 2.820_85], [0.754_05, 0.638_44, 0.521_81]),
    ("SiC", [3.172_34, 2.525_97, 2.479_37], [0.0, 0.0, 0.000_01]),
    ("SnTe", [4.524_25, 1.981_64, 1.281_59], [0.0, 0.0, 0.0]),
    ("Ta", [2.062_72, 2.392_94, 2.627_93], [2.408_36, 1.741_49, 1.947_03]),
    ("Te", [7.390_23, 4.4821, 2.637_11], [3.256_02, 3.527_06, 3.292_05]),
    ("ThF4", [1.830_71, 1.442_23, 1.387_65], [0.0, 0.0, 0.0]),
    ("TiC", [3.700_53, 2.837_42, 2.582_29], [3.265_64, 2.351_59, 2.172_79]),
    ("TiN", [1.648_45, 1.150_52, 1.379_82], [3.368_33, 1.9435, 1.102_07]),
    ("TiO2", [3.456_61, 2.801_74, 2.905_17], [0.000_11, 0.0, 0.000_65]),
    ("VC", [3.657_57, 2.752_74, 2.532_67], [3.0683, 2.198_69, 1.963_19]),
    ("V_palik", [4.277_58, 3.512_95, 2.761_07], [3.4913, 2.889_45, 3.111_52]),
    ("VN", [2.8656, 2.119_19, 1.940_09], [3.032_24, 2.056_12, 1.616_31]),
    ("W", [4.370_82, 3.300_25, 2.998_41], [3.500_64, 2.604_87, 2.273_23]),
];
