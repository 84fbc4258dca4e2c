//! Spectra that are objects with a type: Mitsuba's plugins `uniform`, `srgb`, `d65`, `regular`, `irregular` and `blackbody`, each as one colour.
//!
//! Without wavelengths Mitsuba renders the first three alone; the others have the colour that its spectral modes see.

use glam::DVec3;

use super::document::Element;
use super::properties::Object;
use super::spectra::{self, Weighed};
use super::{Loader, features, transform};
use crate::SceneError;

/// The second radiation constant hc/k in nm·K, and 2hc² in W·nm⁴/(m²·sr) (CODATA 2018).
const C2: f64 = 1.438_776_877e7;
const C1: f64 = 1.191_042_972e20;

/// A typed spectrum, or the texture that it is.
pub(super) fn spectrum<'a>(loader: &Loader<'a>, element: &'a Element, weighed: Weighed) -> Result<DVec3, SceneError> {
    let mut object = Object::new(loader, element, features::kinds("spectrum"))?;
    let o = &mut object;
    let colour = match o.kind() {
        "uniform" => DVec3::splat(o.float("value")?.unwrap_or(1.0)),
        "srgb" => {
            // An upper bound for reflectances is the user's to ask for.
            o.boolean("unbounded", false)?;
            o.unbounded(loader, "color", 0.0)?.as_dvec3()
        }
        "d65" => o.unbounded(loader, "color", 1.0)?.as_dvec3() * o.float("scale")?.unwrap_or(1.0),
        kind => {
            let pairs = match kind {
                "regular" => regular(o)?,
                "irregular" => irregular(o)?,
                _ => blackbody(o)?,
            };
            spectra::colour(&pairs, weighed).max(DVec3::ZERO)
        }
    };
    object.finish()?;
    Ok(colour)
}

fn numbers(object: &mut Object<'_>, name: &'static str) -> Result<Vec<f64>, SceneError> {
    let Some(text) = object.string(name)? else {
        return Err(object.error(format!("no \"{name}\""), "add it as a <string> of numbers"));
    };
    let separated = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|part| !part.is_empty());
    separated.map(|part| transform::parse(part, object.place_of(name))).collect()
}

fn regular(o: &mut Object<'_>) -> Result<Vec<(f64, f64)>, SceneError> {
    let values = numbers(o, "values")?;
    let [from, to] = [o.float("wavelength_min")?, o.float("wavelength_max")?];
    let (Some(from), Some(to)) = (from, to) else {
        return Err(o.error("no \"wavelength_min\" or \"wavelength_max\"", "add both, in nm"));
    };
    if values.len() < 2 || from >= to {
        return Err(o.error("it must have two values, and wavelengths that grow", ""));
    }
    let step = (to - from) / (values.len() - 1) as f64;
    Ok(values.into_iter().enumerate().map(|(i, value)| (from + step * i as f64, value)).collect())
}

fn irregular(o: &mut Object<'_>) -> Result<Vec<(f64, f64)>, SceneError> {
    let (wavelengths, values) = (numbers(o, "wavelengths")?, numbers(o, "values")?);
    if wavelengths.len() != values.len() || !wavelengths.is_sorted_by(|a, b| a < b) {
        return Err(o.error("as many values as wavelengths are needed, and wavelengths that grow", ""));
    }
    Ok(wavelengths.into_iter().zip(values).collect())
}

/// Planck's law, in W/(m²·sr·nm).
fn blackbody(o: &mut Object<'_>) -> Result<Vec<(f64, f64)>, SceneError> {
    if !o.has("temperature") {
        return Err(o.error("no \"temperature\"", "add <float name=\"temperature\" …>, in K"));
    }
    let temperature = o.float_where("temperature", 0.0, |t| t > 0.0, "positive")?;
    let [from, to] = [("wavelength_min", spectra::FIRST), ("wavelength_max", spectra::LAST)]
        .map(|(name, default)| o.float(name).map(|value| value.unwrap_or(default)));
    let (from, to) = (from?, to?);
    let wavelengths = (0..=94_u8).map(|i| spectra::FIRST + 5.0 * f64::from(i)).filter(|w| (from..=to).contains(w));
    Ok(wavelengths.map(|w| (w, C1 / w.powi(5) / ((C2 / (w * temperature)).exp() - 1.0))).collect())
}
