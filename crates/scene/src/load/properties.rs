//! Typed reading of an object's properties and nested objects. What nobody asked for is an error, as in Mitsuba.

use std::collections::HashSet;

use glam::{DMat4, DVec3};

use super::Loader;
use super::document::{Element, Place};
use super::{features, names, transform};
use crate::{Rgb, SceneError};

/// The colour of the spectrum that is 1 at each wavelength, with the primaries of sRGB and its white, D65; as Mitsuba 3.9.1 has it.
const EQUAL_ENERGY: DVec3 = DVec3::new(1.204_793_93, 0.948_291, 0.908_916_06);

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
        for child in &element.children {
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

    /// A boolean that Mitsuba has and of which only `only` is supported.
    pub(super) fn fixed(&mut self, name: &'static str, only: bool) -> Result<(), SceneError> {
        if self.boolean(name, only)? == only {
            return Ok(());
        }
        let message = format!("\"{name}\" = {} is not supported", !only);
        Err(self.place_of(name).error(message, format!("only {only} is; leave it out")))
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

    /// A reflectance or albedo, each channel in [0, 1]; `<float>` and `<spectrum>` make a grey.
    pub(super) fn reflectance(&mut self, name: &'static str, default: f32) -> Result<Rgb, SceneError> {
        self.colour(name, default, 1.0, DVec3::ONE)
    }

    /// What an emitter emits. `<float>` makes a grey. A `<spectrum>` is as bright at each wavelength, which is not white:
    /// white is daylight, which is weaker in red.
    pub(super) fn emission(&mut self, name: &'static str) -> Result<Rgb, SceneError> {
        self.colour(name, 1.0, f64::from(f32::MAX), EQUAL_ENERGY)
    }

    fn colour(&mut self, name: &'static str, default: f32, most: f64, spectrum: DVec3) -> Result<Rgb, SceneError> {
        let Some(element) = self.property(name, &["rgb", "float", "spectrum"])? else { return Ok(Rgb::splat(default)) };
        let values = match element.tag.as_str() {
            "rgb" => rgb(element)?,
            "spectrum" => constant_spectrum(element)? * spectrum,
            _ => DVec3::splat(number(element)?),
        };
        if values.cmpge(DVec3::ZERO).all() && values.cmple(DVec3::splat(most)).all() {
            return Ok(values.as_vec3());
        }
        let range = if most == 1.0 { "in [0, 1]" } else { "at least 0 and fit into single precision" };
        Err(element.at.error(
            format!("\"{name}\" is {}, {}, {}", values.x, values.y, values.z),
            format!("each channel must be {range}"),
        ))
    }

    /// A number, or a colour whose channels are equal.
    pub(super) fn grey(&mut self, name: &'static str, default: f64) -> Result<f64, SceneError> {
        let Some(element) = self.property(name, &["float", "rgb", "spectrum"])? else { return Ok(default) };
        match element.tag.as_str() {
            "float" => return number(element),
            "spectrum" => return constant_spectrum(element),
            _ => {}
        }
        let value = rgb(element)?;
        if value.x != value.y || value.y != value.z {
            return Err(features::chromatic(element));
        }
        if value.x > 1.0 {
            return Err(element.at.error(
                format!("\"{name}\" as <rgb> is {}, more than 1", value.x),
                format!("Mitsuba refuses that: write <float name=\"{name}\" …>, or use \"scale\""),
            ));
        }
        Ok(value.x)
    }

    /// A point.
    pub(super) fn point(&mut self, name: &'static str) -> Result<Option<DVec3>, SceneError> {
        let Some(element) = self.property(name, &["point"])? else { return Ok(None) };
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
            return Err(child.at.error(message, names::suggest(&target.tag, &self.asked_objects)));
        }
        let name = child.require("name")?;
        Err(child.at.error(
            format!("{} has no property \"{name}\"", self.describe()),
            names::suggest(name, &self.asked_properties),
        ))
    }
}

fn number(element: &Element) -> Result<f64, SceneError> {
    if element.tag == "integer" {
        #[allow(clippy::cast_precision_loss, reason = "an integer where a number is asked for is rounded to one")]
        return parse_integer(element).map(|i| i as f64);
    }
    transform::parse(element.require("value")?, &element.at)
}

/// A spectrum that is the same at each wavelength; there are no others after the check of features.
fn constant_spectrum(element: &Element) -> Result<f64, SceneError> {
    transform::parse(element.require("value")?, &element.at)
}

fn parse_integer(element: &Element) -> Result<i64, SceneError> {
    let text = element.require("value")?;
    text.trim()
        .parse()
        .map_err(|_| element.at.error(format!("\"{text}\" is not an integer"), "write digits only, as in 16"))
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
