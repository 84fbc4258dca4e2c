//! BSDFs.

use super::document::Element;
use super::metals::METALS;
use super::properties::Object;
use super::{Loader, features, names, textures};
use crate::{Bsdf, Microfacets, Perturbation, Principled, PrincipledThin, Rgb, Roughness, SceneError, Texture};

/// BSDFs nest at most this deep.
const MAX_DEPTH: usize = 8;

/// Indices of refraction that have a name in Mitsuba.
const INDICES: [(&str, f64); 23] = [
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water ice", 1.31),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
    ("benzene", 1.501),
    ("silicone oil", 1.520_45),
    ("bromine", 1.661),
];

/// A metal with a larger index reflects all light, but the fourth power of the index must fit into single precision.
const LARGEST_INDEX: f32 = 1e9;

/// What a shape without a BSDF has.
pub(super) fn default_bsdf(emits: bool) -> Bsdf {
    Bsdf::lambertian(Rgb::splat(if emits { 0.0 } else { 0.5 }), Rgb::ZERO)
}

/// A BSDF.
pub(super) fn bsdf<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<Bsdf, SceneError> {
    read(loader, element, 0)
}

fn read<'a>(loader: &Loader<'a>, element: &'a Element, depth: usize) -> Result<Bsdf, SceneError> {
    let mut object = Object::new(loader, element, features::kinds("bsdf"))?;
    if depth == MAX_DEPTH {
        return Err(object.error("BSDFs nest too deep", ""));
    }
    let o = &mut object;
    let bsdf = match o.kind() {
        "diffuse" => match o.texture(loader, "reflectance", 0.5)? {
            Texture::Constant(front) => Bsdf::lambertian(front, Rgb::ZERO),
            reflectance => Bsdf::Diffuse { reflectance },
        },
        "dielectric" | "roughdielectric" => Bsdf::Dielectric {
            eta: relative_index(o, "bk7")?,
            reflectance: o.texture(loader, "specular_reflectance", 1.0)?,
            transmittance: o.texture(loader, "specular_transmittance", 1.0)?,
            roughness: if o.kind() == "dielectric" { None } else { Some(roughness(loader, o, true)?) },
        },
        "thindielectric" => Bsdf::ThinDielectric {
            eta: relative_index(o, "bk7")?,
            reflectance: o.texture(loader, "specular_reflectance", 1.0)?,
            transmittance: o.texture(loader, "specular_transmittance", 1.0)?,
        },
        "conductor" | "roughconductor" => {
            let [eta, k] = metal(loader, o)?;
            let specular = o.texture(loader, "specular_reflectance", 1.0)?;
            let roughness = if o.kind() == "conductor" { None } else { Some(roughness(loader, o, true)?) };
            Bsdf::Conductor { eta, k, specular, roughness }
        }
        "plastic" | "roughplastic" => Bsdf::Plastic {
            eta: relative_index(o, "polypropylene")?,
            diffuse: o.texture(loader, "diffuse_reflectance", 0.5)?,
            specular: o.texture(loader, "specular_reflectance", 1.0)?,
            nonlinear: o.boolean("nonlinear", false)?,
            roughness: if o.kind() == "plastic" { None } else { Some(roughness(loader, o, false)?) },
        },
        "pplastic" => Bsdf::PolarizedPlastic {
            eta: match (o.has("eta"), o.has("int_ior") || o.has("ext_ior")) {
                (true, true) => {
                    return Err(o.error("\"eta\" together with \"int_ior\" or \"ext_ior\"", "write one or the other"));
                }
                (true, false) => o.float_where("eta", 1.5, |v| v > 0.0, "positive")?,
                _ => relative_index(o, "polypropylene")?,
            },
            diffuse: o.texture(loader, "diffuse_reflectance", 0.5)?,
            specular: o.texture(loader, "specular_reflectance", 1.0)?,
            roughness: roughness(loader, o, true)?,
        },
        "polarizer" | "retarder" | "circular" => filter(loader, o)?,
        "twosided" => two_sided(loader, o, depth)?,
        "mask" => {
            let opacity = o.texture(loader, "opacity", 0.5)?;
            let [nested] = o.nested("bsdf")[..] else { return Err(o.error("it must hold one BSDF", "nest one")) };
            Bsdf::Mask { opacity, of: Box::new(read(loader, nested.object, depth + 1)?) }
        }
        "blendbsdf" => {
            let weight = o.texture(loader, "weight", 0.5)?;
            let [first, second] = o.nested("bsdf")[..] else {
                return Err(o.error("it must hold two BSDFs", "nest two"));
            };
            let of = [read(loader, first.object, depth + 1)?, read(loader, second.object, depth + 1)?];
            Bsdf::Blend { weight, of: Box::new(of) }
        }
        "normalmap" | "bumpmap" => perturbed(loader, o, depth)?,
        "principled" => principled(loader, o)?,
        "principledthin" => principled_thin(loader, o)?,
        _ => Bsdf::Null,
    };
    object.finish()?;
    Ok(bsdf)
}

/// What turns or filters polarization, for light that has none: half of it passes a polarizer, and all a retarder.
fn filter<'a>(loader: &Loader<'a>, o: &mut Object<'a>) -> Result<Bsdf, SceneError> {
    let share = if o.kind() == "retarder" { 1.0 } else { 0.5 };
    // Angles matter for polarized light alone.
    match o.kind() {
        "polarizer" => {
            o.unbounded_texture(loader, "theta", 0.0)?;
            o.boolean("polarizing", true)?;
        }
        "retarder" => {
            o.unbounded_texture(loader, "theta", 0.0)?;
            o.unbounded_texture(loader, "delta", 90.0)?;
        }
        _ => {
            o.boolean("left_handed", false)?;
        }
    }
    Ok(Bsdf::Filter { transmittance: o.texture(loader, "transmittance", 1.0)?, share })
}

fn perturbed<'a>(loader: &Loader<'a>, object: &mut Object<'a>, depth: usize) -> Result<Bsdf, SceneError> {
    let flip_invalid_normals = object.boolean("flip_invalid_normals", true)?;
    let shadowing = object.boolean("use_shadowing_function", true)?;
    let by = if object.kind() == "normalmap" {
        if !object.has_any("normalmap") {
            return Err(object.error("no texture \"normalmap\"", "add <texture name=\"normalmap\" …>"));
        }
        Perturbation::Normals(object.texture(loader, "normalmap", 0.5)?)
    } else {
        let scale = object.float("scale")?.unwrap_or(1.0);
        let [texture] = object.other_textures()[..] else {
            return Err(object.error("it must hold one texture", "nest one, of any name"));
        };
        let heights = textures::read(loader, texture)?;
        if !matches!(heights, Texture::Constant(_) | Texture::Bitmap { .. }) {
            return Err(texture.at.error("bumps of something that is no picture", "write <texture type=\"bitmap\" …>"));
        }
        Perturbation::Heights { texture: heights, scale }
    };
    let [nested] = object.nested("bsdf")[..] else {
        return Err(object.error("it must hold one BSDF", "nest one"));
    };
    let of = Box::new(read(loader, nested.object, depth + 1)?);
    if of.passes_straight() {
        let message = "light goes straight through the BSDF inside: Mitsuba blocks shadow rays there, here they pass";
        loader.warn(nested.at, message);
    }
    Ok(Bsdf::Perturbed { by, flip_invalid_normals, shadowing, of })
}

/// How often a lobe is drawn.
fn rate(object: &mut Object<'_>, name: &'static str) -> Result<f64, SceneError> {
    object.float_where(name, 1.0, |v| (0.0..=1e6).contains(&v), "from 0 to a million")
}

fn principled<'a>(loader: &Loader<'a>, o: &mut Object<'a>) -> Result<Bsdf, SceneError> {
    let spec_trans = o.texture(loader, "spec_trans", 0.0)?;
    let transmits = spec_trans != Texture::grey(0.0);
    if o.has("eta") && o.has("specular") {
        return Err(o.place_of("specular").error("\"eta\" together with \"specular\"", "write one or the other"));
    }
    // A boundary between equal indices would not refract: as Mitsuba does, it gets a little.
    let eta = if o.has("eta") {
        let eta = o.float_where("eta", 1.5, |v| v > 0.0, "positive")?;
        if transmits && eta == 1.0 { 1.001 } else { eta }
    } else {
        let specular = o.float_where("specular", 0.5, |v| (0.0..=1.0).contains(&v), "in [0, 1]")?;
        let specular = if transmits && specular == 0.0 { 1e-3 } else { specular };
        2.0 / (1.0 - (0.08 * specular).sqrt()) - 1.0
    };
    let mut texture = |name, default| o.texture(loader, name, default);
    let mut principled = Principled {
        base_color: texture("base_color", 0.5)?,
        roughness: texture("roughness", 0.5)?,
        anisotropic: texture("anisotropic", 0.0)?,
        metallic: texture("metallic", 0.0)?,
        spec_trans,
        eta,
        spec_tint: texture("spec_tint", 0.0)?,
        sheen: texture("sheen", 0.0)?,
        sheen_tint: texture("sheen_tint", 0.0)?,
        flatness: texture("flatness", 0.0)?,
        clearcoat: texture("clearcoat", 0.0)?,
        clearcoat_gloss: texture("clearcoat_gloss", 0.0)?,
        sampling_rates: [1.0; 3],
    };
    let names = ["diffuse_reflectance_sampling_rate", "main_specular_sampling_rate", "clearcoat_sampling_rate"];
    for (slot, name) in principled.sampling_rates.iter_mut().zip(names) {
        *slot = rate(o, name)?;
    }
    Ok(Bsdf::Principled(Box::new(principled)))
}

fn principled_thin<'a>(loader: &Loader<'a>, o: &mut Object<'a>) -> Result<Bsdf, SceneError> {
    let (eta, diff_trans) = (o.unbounded_texture(loader, "eta", 1.5)?, o.unbounded_texture(loader, "diff_trans", 0.0)?);
    let outside = |texture: &Texture, legal: fn(f32) -> bool| {
        texture.constant().is_some_and(|c| !c.to_array().into_iter().all(legal))
    };
    if outside(&eta, |v| v > 0.0) {
        return Err(o.place_of("eta").error("\"eta\" is 0", "it must be positive"));
    }
    if outside(&diff_trans, |v| v <= 2.0) {
        return Err(o.place_of("diff_trans").error("\"diff_trans\" is more than 2", "it must be in [0, 2]"));
    }
    let mut texture = |name, default| o.texture(loader, name, default);
    let mut thin = PrincipledThin {
        base_color: texture("base_color", 0.5)?,
        roughness: texture("roughness", 0.5)?,
        anisotropic: texture("anisotropic", 0.0)?,
        spec_trans: texture("spec_trans", 0.0)?,
        eta,
        spec_tint: texture("spec_tint", 0.0)?,
        sheen: texture("sheen", 0.0)?,
        sheen_tint: texture("sheen_tint", 0.0)?,
        flatness: texture("flatness", 0.0)?,
        diff_trans,
        sampling_rates: [1.0; 4],
    };
    let names = [
        "diffuse_reflectance_sampling_rate",
        "specular_reflectance_sampling_rate",
        "diffuse_transmittance_sampling_rate",
        "specular_transmittance_sampling_rate",
    ];
    for (slot, name) in thin.sampling_rates.iter_mut().zip(names) {
        *slot = rate(o, name)?;
    }
    Ok(Bsdf::PrincipledThin(Box::new(thin)))
}

fn two_sided<'a>(loader: &Loader<'a>, object: &mut Object<'a>, depth: usize) -> Result<Bsdf, SceneError> {
    let nested = object.nested("bsdf");
    let (front, back) = match nested.as_slice() {
        [both] => (both, both),
        [front, back] => (front, back),
        other => {
            let message = format!("{} nested BSDFs", other.len());
            return Err(object.error(message, "nest one, or two: front and back"));
        }
    };
    let of = [read(loader, front.object, depth + 1)?, read(loader, back.object, depth + 1)?];
    if let Some((_, transparent)) = of.iter().zip([front, back]).find(|(bsdf, _)| bsdf.transmits()) {
        return Err(transparent.at.error(
            "a BSDF that transmits light inside of twosided",
            "it has two sides itself: remove the twosided around it",
        ));
    }
    Ok(match of {
        [Bsdf::Lambertian { front, .. }, Bsdf::Lambertian { front: back, .. }] => Bsdf::lambertian(front, back),
        of => Bsdf::TwoSided(Box::new(of)),
    })
}

/// The index of refraction inside over that outside.
fn relative_index(object: &mut Object<'_>, inside: &'static str) -> Result<f64, SceneError> {
    let inside = index(object, "int_ior", inside)?;
    let outside = index(object, "ext_ior", "air")?;
    Ok(inside / outside)
}

fn index(object: &mut Object<'_>, name: &'static str, default: &'static str) -> Result<f64, SceneError> {
    if object.is_string(name) || !object.has(name) {
        let material = object.string(name)?.unwrap_or(default);
        let found = INDICES.iter().find(|(known, _)| known.eq_ignore_ascii_case(material.trim()));
        return found.map(|&(_, index)| index).ok_or_else(|| {
            let known: Vec<&str> = INDICES.iter().map(|(known, _)| *known).collect();
            let message = format!("\"{material}\" is not a material whose index of refraction is known");
            object.place_of(name).error(message, names::suggest(material, &known))
        });
    }
    object.float_where(name, 1.0, |v| v > 0.0, "positive")
}

/// The complex index of refraction of a metal, relative to what is outside.
fn metal<'a>(loader: &Loader<'a>, object: &mut Object<'a>) -> Result<[Rgb; 2], SceneError> {
    let material = object.string("material")?;
    let outside =
        if object.has("ext_eta") { object.float_where("ext_eta", 1.0, |v| v > 0.0, "positive")? as f32 } else { 1.0 };
    if let Some(name) = material {
        if object.has("eta") || object.has("k") {
            let at = object.place_of("material");
            return Err(at.error("\"material\" together with \"eta\" or \"k\"", "write one or the other"));
        }
        if name.eq_ignore_ascii_case("none") {
            return Ok([Rgb::ZERO, Rgb::ONE]);
        }
        let found = METALS.iter().find(|(known, ..)| *known == name);
        return found.map(|&(_, eta, k)| [Rgb::from_array(eta) / outside, Rgb::from_array(k) / outside]).ok_or_else(
            || {
                let known: Vec<&str> = METALS.iter().map(|(known, ..)| *known).collect();
                let message = format!("\"{name}\" is not a metal whose index of refraction is known");
                object.place_of("material").error(message, names::suggest(name, &known))
            },
        );
    }
    match (object.has("eta"), object.has("k")) {
        // Mitsuba's own defaults, which are those of a mirror.
        (false, false) => Ok([Rgb::ZERO, Rgb::ONE]),
        _ => {
            let mut part = |name, default| {
                let value = object.signed(loader, name, default)? / outside;
                if value.min_element() < 0.0 {
                    let message = format!("\"{name}\" is negative: its sign changes nothing, as in Mitsuba");
                    loader.warn(object.place_of(name), &message);
                }
                Ok(value.clamp(Rgb::splat(-LARGEST_INDEX), Rgb::splat(LARGEST_INDEX)))
            };
            Ok([part("eta", 0.0)?, part("k", 1.0)?])
        }
    }
}

fn roughness<'a>(loader: &Loader<'a>, object: &mut Object<'a>, directed: bool) -> Result<Roughness, SceneError> {
    let distribution = match object.choice("distribution", "beckmann", &["beckmann", "ggx"])? {
        "ggx" => Microfacets::Ggx,
        _ => Microfacets::Beckmann,
    };
    // How directions are drawn; all visible normals are drawn here.
    object.boolean("sample_visible", true)?;
    if directed && (object.has_any("alpha_u") || object.has_any("alpha_v")) {
        if object.has_any("alpha") {
            return Err(object.error("\"alpha\" together with \"alpha_u\" or \"alpha_v\"", "write one or the other"));
        }
        let alpha_u = object.unbounded_texture(loader, "alpha_u", 0.1)?;
        let alpha_v = object.unbounded_texture(loader, "alpha_v", 0.1)?;
        return Ok(Roughness { distribution, alpha_u, alpha_v });
    }
    let alpha = object.unbounded_texture(loader, "alpha", 0.1)?;
    Ok(Roughness { distribution, alpha_u: alpha.clone(), alpha_v: alpha })
}
