//! What of Mitsuba's features is read, and what a scene needs beyond that: all of it at once, for whoever has to decide whether to convert a
//! scene wants the whole list, not its first item.

use std::collections::HashMap;

use super::document::{Element, Place};
use super::names;
use crate::SceneError;
use crate::text::quoted;

/// More features are counted, not named.
const MOST_NAMED: usize = 12;

/// The plugins that are read for objects of that tag.
pub(super) fn kinds(tag: &str) -> &'static [&'static str] {
    match tag {
        "bsdf" => &[
            "diffuse",
            "dielectric",
            "roughdielectric",
            "thindielectric",
            "conductor",
            "roughconductor",
            "plastic",
            "roughplastic",
            "pplastic",
            "polarizer",
            "retarder",
            "circular",
            "twosided",
            "mask",
            "blendbsdf",
            "normalmap",
            "bumpmap",
            "principled",
            "principledthin",
            "null",
        ],
        "emitter" => &["point", "constant", "area", "envmap", "spot", "projector", "directional"],
        "film" => &["hdrfilm"],
        "integrator" => &[
            "volpath",
            "volpathmis",
            "path",
            "direct",
            "prb",
            "prbvolpath",
            "prb_basic",
            "ptracer",
            "moment",
            "aov",
            "stokes",
        ],
        "medium" => &["homogeneous", "heterogeneous"],
        "phase" => &["isotropic", "hg", "rayleigh", "blendphase"],
        "rfilter" => &["box", "gaussian", "tent", "mitchell", "catmullrom", "lanczos"],
        "sampler" => &["independent", "stratified", "multijitter", "orthogonal", "ldsampler"],
        "sensor" => &["perspective", "thinlens", "orthographic"],
        "shape" => &[
            "obj",
            "ply",
            "serialized",
            "cube",
            "rectangle",
            "sphere",
            "disk",
            "cylinder",
            "shapegroup",
            "instance",
            "merge",
        ],
        "texture" => &[
            "bitmap",
            "checkerboard",
            "mesh_attribute",
            "rawconstant",
            "uniform",
            "srgb",
            "d65",
            "regular",
            "irregular",
            "blackbody",
        ],
        "spectrum" => &["uniform", "srgb", "d65", "regular", "irregular", "blackbody"],
        "volume" => &["gridvolume", "constvolume"],
        _ => &[],
    }
}

/// The error that an object is of a kind that is not one of `kinds`.
pub(super) fn unsupported(element: &Element, kind: &str, kinds: &[&str]) -> SceneError {
    let at = element.attribute("type").map_or(&element.at, |a| &a.at);
    let (tag, mut help) = (&element.tag, names::suggest(kind, kinds));
    if (tag.as_str(), kind) == ("film", "specfilm") {
        help = "it records a spectrum, and vdf renders red, green and blue: write <film type=\"hdrfilm\">".to_owned();
    }
    at.error(format!("{tag} type \"{kind}\" is not supported"), help)
}

/// A kind of thing that the scene has and that is not read.
struct Feature<'a> {
    name: String,
    /// The first of them.
    element: &'a Element,
    count: usize,
}

/// An error if the scene needs features that are not read; it names all of them. Of the sensors only the one with the index `sensor` counts. What
/// is written wrongly in other ways is left to those who read it.
pub(super) fn check(root: &Element, sensor: usize) -> Result<(), SceneError> {
    let mut features = Features::default();
    let mut sensors = 0;
    for child in &root.children {
        if child.tag == "sensor" {
            sensors += 1;
            if sensors != sensor + 1 {
                continue;
            }
        }
        features.visit(child);
    }
    match features.found.as_slice() {
        [] => Ok(()),
        [one] => Err(one.error()),
        several => Err(all(several)),
    }
}

#[derive(Default)]
struct Features<'a> {
    found: Vec<Feature<'a>>,
    by_name: HashMap<String, usize>,
}

impl<'a> Features<'a> {
    fn visit(&mut self, element: &'a Element) {
        if let Some(name) = feature(element) {
            let next = self.found.len();
            let index = *self.by_name.entry(name.clone()).or_insert(next);
            if index == next {
                self.found.push(Feature { name, element, count: 0 });
            }
            self.found[index].count += 1;
        }
        for child in &element.children {
            self.visit(child);
        }
    }
}

/// What the element is, if that is not read.
fn feature(element: &Element) -> Option<String> {
    let kind = element.attribute("type").map(|kind| kind.value.as_str());
    match (element.tag.as_str(), kind) {
        (tag, Some(kind)) if (element.is_object() || tag == "spectrum") && !kinds(tag).contains(&kind) => {
            Some(format!("{tag} {}", quoted(kind)))
        }
        _ => None,
    }
}

impl Feature<'_> {
    /// The error of a scene that lacks nothing but this.
    fn error(&self) -> SceneError {
        let kind = self.element.attribute("type").map_or("", |kind| &kind.value);
        unsupported(self.element, kind, kinds(&self.element.tag))
    }
}

/// The error that names them all.
fn all(features: &[Feature<'_>]) -> SceneError {
    let item = |feature: &Feature<'_>| {
        let Place { file, line, .. } = &feature.element.at;
        let more = if feature.count > 1 { format!(" and {} more", feature.count - 1) } else { String::new() };
        format!("{} ({}:{line}{more})", feature.name, file.file_name().unwrap_or_default().to_string_lossy())
    };
    let mut list: Vec<String> = features.iter().take(MOST_NAMED).map(item).collect();
    if features.len() > MOST_NAMED {
        list.push(format!("and {} more", features.len() - MOST_NAMED));
    }
    let mut tags: Vec<&str> =
        features.iter().map(|f| f.element.tag.as_str()).filter(|tag| !kinds(tag).is_empty()).collect();
    tags.sort_unstable();
    tags.dedup();
    let supported: Vec<String> = tags.iter().map(|tag| format!("{tag} {}", kinds(tag).join(", "))).collect();
    let help = if supported.is_empty() { String::new() } else { format!("supported: {}", supported.join("; ")) };
    let message = format!("{} features of this scene are not supported: {}", features.len(), list.join(", "));
    features[0].element.at.error(message, help)
}
