//! Typed reading of an object's properties and nested objects. What nobody asked for is an error, as in Mitsuba.

use std::collections::HashSet;
use std::io::Read as _;

use glam::{DMat4, DVec3};

use super::Loader;
use super::document::{Element, Place};
use super::spectra::{self, Weighed};
use super::{features, names, plugins, textures, transform};
use crate::{Rgb, SceneError, Texture};

/// The colour of the spectrum that is 1 at each wavelength, with the primaries of sRGB and its white, D65; as Mitsuba 3.9.1 has it.
const EQUAL_ENERGY: DVec3 = DVec3::new(1.204_793_93, 0.948_291, 0.908_916_06);

/// What the channels of a colour may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Channels {
    /// From 0 to 1.
    Share,
    /// At least 0.
    Unbounded,
    /// Any numbers.
    Signed,
}

/// A nested object, or one that a `ref` stands for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nested<'a> {
    /// The object itself.
    pub(super) object: &'a Element,
    /// Its name in the parent, as `interior`.
    pub(super) name: Option<&'a str>,
    /// Where the parent mentions it.
    pub(super) at: &'a Place,
}

/// An object being read. Each question marks what it answers; [`Object::finish`] complains about the rest.
#[derive(Debug)]
pub(super) struct Object<'a> {
    pub(super) element: &'a Element,
    kind: &'a str,
    /// Each child with the object it stands for, if it is an object or a `ref`.
    children: Vec<(&'a Element, Option<&'a Element>, bool)>,
    asked_properties: Vec<&'static str>,
    asked_objects: Vec<&'static str>,
}

impl<'a> Object<'a> {
    /// Starts to read `element`, whose `type` must be one of `kinds`.
    pub(super) fn new(loader: &Loader<'a>, element: &'a Element, kinds: &[&str]) -> Result<Self, SceneError> {
        let kind = element.require("type")?;
        if !kinds.contains(&kind) {
            return Err(features::unsupported(element, kind, kinds));
        }
        let mut seen = HashSet::new();
        let mut children = Vec::new();
        for child in element.children.iter().filter(|child| child.tag != "alias") {
            let target = match child.tag.as_str() {
                "ref" => Some(loader.ids.resolve(child)?),
                _ if child.is_object() => Some(child),
                _ => None,
            };
            if target.is_none() {
                let name = child.require("name")?;
                if let Some((message, help)) = names::foreign_name(name) {
                    return Err(child.at.error(message, help));
                }
                if !seen.insert(name) {
                    return Err(child
                        .at
                        .error(format!("the property \"{name}\" is given twice"), "remove one of them"));
                }
            }
            children.push((child, target, false));
        }
        Ok(Self { element, kind, children, asked_properties: Vec::new(), asked_objects: Vec::new() })
    }

    /// The plugin type.
    pub(super) fn kind(&self) -> &'a str {
        self.kind
    }

    /// `shape "obj"`, for messages.
    pub(super) fn describe(&self) -> String {
        format!("{} \"{}\"", self.element.tag, self.kind)
    }

    /// The error that something is wrong with the object as a whole.
    pub(super) fn error(&self, message: impl AsRef<str>, help: impl Into<String>) -> SceneError {
        self.element.at.error(format!("{}: {}", self.describe(), message.as_ref()), help)
    }

    fn property(&mut self, name: &'static str, tags: &[&str]) -> Result<Option<&'a Element>, SceneError> {
        self.asked_properties.push(name);
        let found = self
            .children
            .iter_mut()
            .find(|(child, target, _)| target.is_none() && child.attribute("name").is_some_and(|a| a.value == name));
        let Some((child, _, used)) = found else { return Ok(None) };
        *used = true;
        let child: &'a Element = child;
        if tags.contains(&child.tag.as_str()) {
            return Ok(Some(child));
        }
        let tags: Vec<String> = tags.iter().map(|t| format!("<{t}>")).collect();
        let message = format!("\"{name}\" of {} cannot be a <{}>", self.describe(), child.tag);
        Err(child.at.error(message, format!("write {}", tags.join(" or "))))
    }

    /// True if the property is there, whatever its type. Asks nothing.
    pub(super) fn has(&self, name: &str) -> bool {
        self.children.iter().any(|(c, t, _)| t.is_none() && c.attribute("name").is_some_and(|a| a.value == name))
    }

    /// Where the property is, or else the object.
    pub(super) fn place_of(&self, name: &str) -> &'a Place {
        let found =
            self.children.iter().find(|(c, t, _)| t.is_none() && c.attribute("name").is_some_and(|a| a.value == name));
        found.map_or(&self.element.at, |(c, ..)| &c.at)
    }

    /// A finite number; an `<integer>` will do.
    pub(super) fn float(&mut self, name: &'static str) -> Result<Option<f64>, SceneError> {
        self.property(name, &["float", "integer"])?.map(number).transpose()
    }

    /// A finite number for which `legal` holds.
    pub(super) fn float_where(
        &mut self,
        name: &'static str,
        default: f64,
        legal: impl Fn(f64) -> bool,
        range: &str,
    ) -> Result<f64, SceneError> {
        let value = self.float(name)?.unwrap_or(default);
        if legal(value) {
            return Ok(value);
        }
        Err(self.place_of(name).error(format!("\"{name}\" is {value}"), format!("it must be {range}")))
    }

    /// An integer in a range.
    pub(super) fn integer(
        &mut self,
        name: &'static str,
        default: i64,
        range: std::ops::RangeInclusive<i64>,
    ) -> Result<i64, SceneError> {
        let Some(element) = self.property(name, &["integer"])? else { return Ok(default) };
        let value = parse_integer(element)?;
        if range.contains(&value) {
            return Ok(value);
        }
        let message = format!("\"{name}\" is {value}");
        Err(element.at.error(message, format!("it must be between {} and {}", range.start(), range.end())))
    }

    /// True or false.
    pub(super) fn boolean(&mut self, name: &'static str, default: bool) -> Result<bool, SceneError> {
        let Some(element) = self.property(name, &["boolean"])? else { return Ok(default) };
        match element.require("value")?.to_ascii_lowercase().as_str() {
            "true" => Ok(true),
            "false" => Ok(false),
            other => Err(element.at.error(format!("\"{other}\" is not a boolean"), "write true or false")),
        }
    }

    /// A string.
    pub(super) fn string(&mut self, name: &'static str) -> Result<Option<&'a str>, SceneError> {
        self.property(name, &["string"])?.map(|e| e.require("value")).transpose()
    }

    /// One of several words.
    pub(super) fn choice(
        &mut self,
        name: &'static str,
        default: &'static str,
        choices: &[&'static str],
    ) -> Result<&'static str, SceneError> {
        let Some(value) = self.string(name)? else { return Ok(default) };
        choices.iter().copied().find(|&c| c == value.to_ascii_lowercase()).ok_or_else(|| {
            self.place_of(name).error(format!("{name} \"{value}\" is not supported"), names::suggest(value, choices))
        })
    }

    /// Properties of Mitsuba's that change nothing here; a warning says so.
    pub(super) fn without_effect(&mut self, loader: &Loader<'_>, names: &[&'static str]) -> Result<(), SceneError> {
        for name in names {
            if let Some(element) = self.property(name, &["float", "integer", "boolean", "string"])? {
                loader.warn(&element.at, &format!("\"{name}\" of {} has no effect here", self.describe()));
            }
        }
        Ok(())
    }

    /// A reflectance or albedo, each channel in [0, 1]; `<float>` and a `<spectrum>` of one number make a grey.
    pub(super) fn reflectance(
        &mut self,
        loader: &Loader<'a>,
        name: &'static str,
        default: f32,
    ) -> Result<Rgb, SceneError> {
        self.colour(loader, name, default, Channels::Share, Weighed::ByDaylight)
    }

    /// A colour whose channels are any numbers.
    pub(super) fn signed(&mut self, loader: &Loader<'a>, name: &'static str, default: f32) -> Result<Rgb, SceneError> {
        self.colour(loader, name, default, Channels::Signed, Weighed::ByDaylight)
    }

    /// A colour whose channels are at least 0.
    pub(super) fn unbounded(
        &mut self,
        loader: &Loader<'a>,
        name: &'static str,
        default: f32,
    ) -> Result<Rgb, SceneError> {
        self.colour(loader, name, default, Channels::Unbounded, Weighed::ByDaylight)
    }

    /// What an emitter emits. `<float>` makes a grey. A `<spectrum>` of one number is as bright at each wavelength, which is not white:
    /// white is daylight, which is weaker in red.
    pub(super) fn emission(&mut self, loader: &Loader<'a>, name: &'static str) -> Result<Rgb, SceneError> {
        self.colour(loader, name, 1.0, Channels::Unbounded, Weighed::Equally)
    }

    fn colour(
        &mut self,
        loader: &Loader<'a>,
        name: &'static str,
        default: f32,
        channels: Channels,
        weighed: Weighed,
    ) -> Result<Rgb, SceneError> {
        let nested = self.texture_element(name)?;
        let element = match nested {
            Some(nested) => Some(nested),
            None => self.property(name, &["rgb", "float", "integer", "spectrum"])?,
        };
        let Some(element) = element else { return Ok(Rgb::splat(default)) };
        let values = match element.tag.as_str() {
            "rgb" => rgb(element)?,
            "texture" => plugins::spectrum(loader, element, weighed)?,
            "spectrum" => spectrum(loader, element, weighed)?,
            _ => DVec3::splat(number(element)?),
        };
        let largest = f64::from(f32::MAX);
        let (least, most, range) = match channels {
            Channels::Share => (0.0, 1.0, "in [0, 1]"),
            Channels::Unbounded => (0.0, largest, "at least 0 and fit into single precision"),
            Channels::Signed => (-largest, largest, "finite and fit into single precision"),
        };
        // A spectrum over wavelengths may be so pure that there is less than nothing of a primary; Mitsuba cuts that off, too.
        let is_typed = element.attribute("type").is_some();
        let is_cut = !(is_flat(element) || (is_typed && channels == Channels::Signed));
        let values = if element.tag == "spectrum" && is_cut {
            values.max(DVec3::ZERO).min(if channels == Channels::Share { DVec3::ONE } else { DVec3::INFINITY })
        } else {
            values
        };
        if values.cmpge(DVec3::splat(least)).all() && values.cmple(DVec3::splat(most)).all() {
            return Ok(values.as_vec3());
        }
        Err(element.at.error(
            format!("\"{name}\" is {}, {}, {}", values.x, values.y, values.z),
            format!("each channel must be {range}"),
        ))
    }

    /// A colour in [0, 1] over a surface: a texture, or what [`Object::reflectance`] reads.
    pub(super) fn texture(
        &mut self,
        loader: &Loader<'a>,
        name: &'static str,
        default: f32,
    ) -> Result<Texture, SceneError> {
        match self.texture_element(name)? {
            Some(nested) => textures::read(loader, nested),
            None => self.reflectance(loader, name, default).map(Texture::Constant),
        }
    }

    /// As [`Object::texture`], for what may exceed 1.
    pub(super) fn unbounded_texture(
        &mut self,
        loader: &Loader<'a>,
        name: &'static str,
        default: f32,
    ) -> Result<Texture, SceneError> {
        match self.texture_element(name)? {
            Some(nested) => textures::read(loader, nested),
            None => self.colour(loader, name, default, Channels::Unbounded, Weighed::ByDaylight).map(Texture::Constant),
        }
    }

    /// The texture of that name, nested or referred to.
    pub(super) fn texture_element(&mut self, name: &'static str) -> Result<Option<&'a Element>, SceneError> {
        self.named("texture", name)
    }

    /// The volume of that name, nested or referred to.
    pub(super) fn volume_element(&mut self, name: &'static str) -> Result<Option<&'a Element>, SceneError> {
        self.named("volume", name)
    }

    fn named(&mut self, tag: &str, name: &'static str) -> Result<Option<&'a Element>, SceneError> {
        self.asked_properties.push(name);
        let mut found = None;
        for (child, target, used) in &mut self.children {
            let Some(object) = target.filter(|t| t.tag == tag) else { continue };
            if child.attribute("name").is_some_and(|a| a.value == name) {
                *used = true;
                if found.replace(object).is_some() {
                    return Err(child.at.error(format!("a second {tag} \"{name}\""), "remove one of them"));
                }
            }
        }
        Ok(found)
    }

    /// The textures that nobody asked for by their name.
    pub(super) fn other_textures(&mut self) -> Vec<&'a Element> {
        let mut found = Vec::new();
        for (_, target, used) in &mut self.children {
            let Some(object) = target.filter(|t| t.tag == "texture" && !*used) else { continue };
            *used = true;
            found.push(object);
        }
        found
    }

    /// Three numbers that are no colour, each at least 0; a `<float>` is all three.
    pub(super) fn raw(&mut self, name: &'static str) -> Result<Option<Rgb>, SceneError> {
        let Some(element) = self.property(name, &["float", "integer", "vector", "rgb"])? else { return Ok(None) };
        let value = match element.tag.as_str() {
            "float" | "integer" => DVec3::splat(number(element)?),
            "rgb" => rgb(element)?,
            _ => self.three(name, &["vector"])?.unwrap_or_default(),
        };
        if value.min_element() >= 0.0 && value.as_vec3().is_finite() {
            return Ok(Some(value.as_vec3()));
        }
        let message = format!("\"{name}\" is {}, {}, {}", value.x, value.y, value.z);
        Err(element.at.error(message, "each must be at least 0 and fit into single precision"))
    }

    /// True if there is a property, or a texture, of that name.
    pub(super) fn has_any(&self, name: &str) -> bool {
        self.children.iter().any(|(c, ..)| c.attribute("name").is_some_and(|a| a.value == name))
    }

    /// True if the property is there as a string.
    pub(super) fn is_string(&self, name: &str) -> bool {
        self.is_a(name, "string")
    }

    /// True if the property is there as a number.
    pub(super) fn is_number(&self, name: &str) -> bool {
        self.is_a(name, "float")
    }

    fn is_a(&self, name: &str, tag: &str) -> bool {
        self.children.iter().any(|(c, ..)| c.tag == tag && c.attribute("name").is_some_and(|a| a.value == name))
    }

    /// A transform that is not read yet.
    pub(super) fn transform_element(&mut self, name: &'static str) -> Result<Option<&'a Element>, SceneError> {
        self.property(name, &["transform"])
    }

    /// An extinction coefficient: a number or a colour, each channel finite and at least 0.
    pub(super) fn extinction(
        &mut self,
        loader: &Loader<'a>,
        name: &'static str,
        default: f64,
    ) -> Result<DVec3, SceneError> {
        let Some(element) = self.property(name, &["float", "integer", "rgb", "spectrum"])? else {
            return Ok(DVec3::splat(default));
        };
        let value = match element.tag.as_str() {
            "rgb" => rgb(element)?,
            "spectrum" => {
                let value = spectrum(loader, element, Weighed::ByDaylight)?;
                if is_flat(element) { value } else { value.max(DVec3::ZERO) }
            }
            _ => DVec3::splat(number(element)?),
        };
        if !(value.is_finite() && value.cmpge(DVec3::ZERO).all()) {
            let message = format!("\"{name}\" is {}, {}, {}", value.x, value.y, value.z);
            return Err(element.at.error(message, "each channel must be finite and at least 0"));
        }
        let most = value.max_element();
        if most > 1.0 && element.tag == "rgb" && self.kind != "constvolume" {
            return Err(element.at.error(
                format!("\"{name}\" as <rgb> is {most}, more than 1"),
                format!("Mitsuba refuses that: write <float name=\"{name}\" …>, or use \"scale\""),
            ));
        }
        Ok(value)
    }

    /// A point.
    pub(super) fn point(&mut self, name: &'static str) -> Result<Option<DVec3>, SceneError> {
        self.three(name, &["point"])
    }

    /// A vector.
    pub(super) fn vector(&mut self, name: &'static str) -> Result<Option<DVec3>, SceneError> {
        self.three(name, &["vector"])
    }

    fn three(&mut self, name: &'static str, tags: &[&str]) -> Result<Option<DVec3>, SceneError> {
        let Some(element) = self.property(name, tags)? else { return Ok(None) };
        if element.attribute("value").is_some() {
            return transform::numbers(element, "value").and_then(|v| one_or_three(element, &v)).map(Some);
        }
        let axis = |name| element.require(name).and_then(|text| transform::parse(text, &element.at));
        Ok(Some(DVec3::new(axis("x")?, axis("y")?, axis("z")?)))
    }

    /// The `to_world` transform; the identity if there is none.
    pub(super) fn world_transform(&mut self, loader: &Loader<'_>) -> Result<DMat4, SceneError> {
        let element = self.property("to_world", &["transform"])?;
        element.map_or(Ok(DMat4::IDENTITY), |element| transform::read(loader, element))
    }

    /// The nested objects with that tag, in order.
    pub(super) fn nested(&mut self, tag: &'static str) -> Vec<Nested<'a>> {
        self.asked_objects.push(tag);
        let mut found = Vec::new();
        for (child, target, used) in &mut self.children {
            let Some(object) = target.filter(|t| t.tag == tag) else { continue };
            *used = true;
            let name = child.attribute("name").map(|a| a.value.as_str());
            found.push(Nested { object, name, at: &child.at });
        }
        found
    }

    /// The nested object with that tag; two are an error.
    pub(super) fn at_most_one(&mut self, tag: &'static str) -> Result<Option<Nested<'a>>, SceneError> {
        match self.nested(tag).as_slice() {
            [] => Ok(None),
            [one] => Ok(Some(*one)),
            [_, second, ..] => {
                Err(second.at.error(format!("{} has more than one {tag}", self.describe()), "remove all but one"))
            }
        }
    }

    /// The first child that was not asked for is an error.
    pub(super) fn finish(self) -> Result<(), SceneError> {
        let Some((child, target, _)) = self.children.iter().find(|(.., used)| !used) else { return Ok(()) };
        if let Some(target) = target {
            let message = format!("{} takes no <{}>", self.describe(), target.tag);
            return Err(child.at.error(message, names::suggest(&target.tag, &without_repeats(self.asked_objects))));
        }
        let name = child.require("name")?;
        Err(child.at.error(
            format!("{} has no property \"{name}\"", self.describe()),
            names::suggest(name, &without_repeats(self.asked_properties)),
        ))
    }
}

/// The names in their order, each once: some are asked for in several ways.
fn without_repeats(names: Vec<&'static str>) -> Vec<&'static str> {
    let mut seen = HashSet::new();
    names.into_iter().filter(|name| seen.insert(*name)).collect()
}

pub(super) fn number(element: &Element) -> Result<f64, SceneError> {
    if element.tag == "integer" {
        #[allow(clippy::cast_precision_loss, reason = "an integer where a number is asked for is rounded to one")]
        return parse_integer(element).map(|i| i as f64);
    }
    transform::parse(element.require("value")?, &element.at)
}

/// A spectrum as a colour: one number, the same at each wavelength; a list of wavelengths with values; or such a list in a file.
fn spectrum<'a>(loader: &Loader<'a>, element: &'a Element, weighed: Weighed) -> Result<DVec3, SceneError> {
    if element.attribute("type").is_some() {
        return plugins::spectrum(loader, element, weighed);
    }
    let text = match element.attribute("filename") {
        None => element.require("value")?.to_owned(),
        Some(file) => spectrum_file(loader, &file.value, element)?,
    };
    if is_flat(element) {
        let value = transform::parse(&text, &element.at)?;
        return Ok(match weighed {
            Weighed::ByDaylight => DVec3::splat(value),
            Weighed::Equally => EQUAL_ENERGY * value,
        });
    }
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    for pair in text.split(|c: char| c == ',' || c.is_whitespace()).filter(|p| !p.is_empty()) {
        let Some((wavelength, value)) = pair.split_once(':') else {
            let help = "write wavelengths in nm with values, as in 400:0.2, 700:0.8";
            return Err(element.at.error(format!("\"{pair}\" in a spectrum"), help));
        };
        let (wavelength, value) = (transform::parse(wavelength, &element.at)?, transform::parse(value, &element.at)?);
        if pairs.last().is_some_and(|&(last, _)| last >= wavelength) {
            return Err(element.at.error("the wavelengths of a spectrum do not grow", "sort them"));
        }
        pairs.push((wavelength, value));
    }
    Ok(spectra::colour(&pairs, weighed))
}

/// True for a spectrum of one number.
fn is_flat(element: &Element) -> bool {
    let is_separator = |c: char| c == ':' || c == ',' || c.is_whitespace();
    element.attribute("value").is_some_and(|v| !v.value.trim().contains(is_separator))
}

/// The lines of a file with a wavelength and a value in each, as pairs with a colon.
fn spectrum_file(loader: &Loader<'_>, name: &str, element: &Element) -> Result<String, SceneError> {
    const MOST: u64 = 1 << 20;
    let path = loader.search.mesh(loader.source, name);
    let unreadable = |e: std::io::Error| {
        let help = "the path is relative to the folder of the scene file, or to a folder of a <path>";
        element.at.error(format!("cannot read \"{}\": {e}", path.display()), help)
    };
    let (input, _) = loader.source.open(&path, MOST).map_err(unreadable)?;
    let mut text = String::new();
    std::io::Read::take(input, MOST).read_to_string(&mut text).map_err(unreadable)?;
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim()).filter(|l| !l.is_empty());
    let pairs: Vec<String> = lines.map(|line| line.split_whitespace().collect::<Vec<_>>().join(":")).collect();
    Ok(format!("{},", pairs.join(",")))
}

fn parse_integer(element: &Element) -> Result<i64, SceneError> {
    let text = element.require("value")?;
    text.trim().parse().map_err(|e: std::num::ParseIntError| {
        use std::num::IntErrorKind::{NegOverflow, PosOverflow};
        match e.kind() {
            PosOverflow | NegOverflow => element.at.error(format!("{text} is too large for an integer"), "of 64 bits"),
            _ => element.at.error(format!("\"{text}\" is not an integer"), "write digits only, as in 16"),
        }
    })
}

fn rgb(element: &Element) -> Result<DVec3, SceneError> {
    transform::numbers(element, "value").and_then(|v| one_or_three(element, &v))
}

fn one_or_three(element: &Element, values: &[f64]) -> Result<DVec3, SceneError> {
    match values {
        [v] => Ok(DVec3::splat(*v)),
        [x, y, z] => Ok(DVec3::new(*x, *y, *z)),
        _ => Err(element.at.error(format!("<{}> with {} numbers", element.tag, values.len()), "write one or three")),
    }
}
