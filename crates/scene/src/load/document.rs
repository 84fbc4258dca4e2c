//! From XML text to a checked tree of elements: parameters substituted, includes spliced in, every element and
//! attribute known by name, each with its place for messages.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::names;
use super::parameters::Parameters;
use crate::SceneError;
use crate::SceneSource;

/// Includes nest at most this deep, as in Mitsuba.
const MAX_INCLUDE_DEPTH: usize = 15;
/// Elements nest at most this deep; the deepest legal path is scene/sensor/film/rfilter/float.
const MAX_ELEMENT_DEPTH: usize = 32;
/// Bounds the work of files that include each other many times over.
const MAX_ELEMENTS: usize = 1_000_000;

/// Elements that describe an object, with a plugin `type`.
pub(super) const OBJECT_TAGS: [&str; 9] =
    ["bsdf", "emitter", "film", "integrator", "medium", "phase", "rfilter", "sampler", "sensor"];
const PROPERTY_TAGS: [&str; 6] = ["boolean", "float", "integer", "rgb", "string", "transform"];

/// A place in a file.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub(super) file: Arc<Path>,
    pub(super) line: u32,
    pub(super) column: u32,
}

impl Place {
    /// The error that something at this place is wrong, and how to mend it.
    pub(super) fn error(&self, message: impl Into<String>, help: impl Into<String>) -> SceneError {
        SceneError::Element {
            path: self.file.to_path_buf(),
            line: self.line,
            column: self.column,
            message: message.into(),
            help: help.into(),
        }
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}:{}", self.file.display(), self.line, self.column)
    }
}

/// An attribute, with parameters substituted.
#[derive(Debug)]
pub(super) struct Attribute {
    pub(super) name: String,
    pub(super) value: String,
    pub(super) at: Place,
}

/// An element whose name and attribute names are legal.
#[derive(Debug)]
pub(super) struct Element {
    /// Unique in the document.
    pub(super) serial: usize,
    pub(super) tag: String,
    pub(super) attributes: Vec<Attribute>,
    pub(super) children: Vec<Element>,
    pub(super) at: Place,
}

impl Element {
    /// The attribute of that name.
    pub(super) fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|a| a.name == name)
    }

    /// The value of an attribute that must be there.
    pub(super) fn require(&self, name: &str) -> Result<&str, SceneError> {
        self.attribute(name).map(|a| a.value.as_str()).ok_or_else(|| {
            self.at.error(format!("<{}> has no attribute \"{name}\"", self.tag), format!("add {name}=\"…\""))
        })
    }

    /// True if it describes an object rather than a property.
    pub(super) fn is_object(&self) -> bool {
        self.tag == "shape" || OBJECT_TAGS.contains(&self.tag.as_str())
    }

    fn contains(&self, serial: usize) -> bool {
        self.serial == serial || self.children.iter().any(|c| c.contains(serial))
    }
}

/// All elements that have an `id`, and their aliases.
#[derive(Debug, Default)]
pub(super) struct Ids<'a> {
    by_name: HashMap<&'a str, &'a Element>,
}

impl<'a> Ids<'a> {
    /// Collects the ids below `root`; two elements with one id are an error.
    pub(super) fn collect(root: &'a Element) -> Result<Self, SceneError> {
        let mut ids = Self::default();
        ids.visit(root)?;
        Ok(ids)
    }

    fn visit(&mut self, element: &'a Element) -> Result<(), SceneError> {
        for child in &element.children {
            if child.tag == "alias" {
                let target = self.find(child.require("id")?, child)?;
                self.insert(child.require("as")?, target, &child.at)?;
            } else if child.is_object() {
                if let Some(id) = child.attribute("id") {
                    self.insert(&id.value, child, &id.at)?;
                }
                self.visit(child)?;
            }
        }
        Ok(())
    }

    fn insert(&mut self, id: &'a str, element: &'a Element, at: &Place) -> Result<(), SceneError> {
        match self.by_name.insert(id, element) {
            None => Ok(()),
            Some(earlier) => {
                Err(at
                    .error(format!("the id \"{id}\" is already used at {}", earlier.at), "give each object its own id"))
            }
        }
    }

    fn find(&self, id: &str, user: &Element) -> Result<&'a Element, SceneError> {
        self.by_name.get(id).copied().ok_or_else(|| {
            let mut known: Vec<&str> = self.by_name.keys().copied().collect();
            known.sort_unstable();
            user.at.error(format!("no object has the id \"{id}\""), names::suggest(id, &known))
        })
    }

    /// The object that a `ref` stands for.
    pub(super) fn resolve(&self, reference: &Element) -> Result<&'a Element, SceneError> {
        let target = self.find(reference.require("id")?, reference)?;
        if target.contains(reference.serial) {
            return Err(reference.at.error(
                "reference cycle: the object refers to itself",
                format!("the object that this refers to begins at {} and contains this reference", target.at),
            ));
        }
        Ok(target)
    }
}

/// Reads the scene file with everything that it includes.
pub(super) fn read(source: &SceneSource, parameters: &mut Parameters) -> Result<Element, SceneError> {
    let mut reader = Reader { source, parameters, elements: 0, open_files: Vec::new() };
    reader.file(source.path(), None)
}

struct Reader<'a> {
    source: &'a SceneSource,
    parameters: &'a mut Parameters,
    elements: usize,
    /// The chain of files from the scene file to the one that is being read.
    open_files: Vec<PathBuf>,
}

impl Reader<'_> {
    fn file(&mut self, path: &Path, includer: Option<&Place>) -> Result<Element, SceneError> {
        let bytes = self.source.read(path).map_err(|e| match includer {
            Some(at) => {
                at.error(format!("cannot read \"{}\": {e}", path.display()), "the path is relative to this file")
            }
            None => SceneError::File { path: path.to_path_buf(), message: format!("cannot read the scene: {e}") },
        })?;
        let text = String::from_utf8(bytes).map_err(|e| {
            let message = format!("not UTF-8 text (byte {})", e.utf8_error().valid_up_to());
            SceneError::File { path: path.to_path_buf(), message }
        })?;
        let file: Arc<Path> = Arc::from(path);
        let document = roxmltree::Document::parse(&text).map_err(|e| {
            let pos = e.pos();
            let at = Place { file: file.clone(), line: pos.row, column: pos.col };
            at.error(format!("XML: {}", without_position(&e.to_string())), "")
        })?;
        let lines = Lines::new(&text, file);
        self.open_files.push(path.to_path_buf());
        let root = self.element(document.root_element(), &lines, 0)?;
        self.open_files.pop();
        if root.tag != "scene" {
            return Err(root
                .at
                .error(format!("the root element is <{}>", root.tag), "it must be <scene version=\"3.0.0\">"));
        }
        check_version(&root)?;
        Ok(root)
    }

    fn element(
        &mut self,
        node: roxmltree::Node<'_, '_>,
        lines: &Lines<'_>,
        depth: usize,
    ) -> Result<Element, SceneError> {
        let at = lines.place(node.range().start);
        if depth > MAX_ELEMENT_DEPTH {
            return Err(at.error(format!("elements nest more than {MAX_ELEMENT_DEPTH} deep"), ""));
        }
        self.elements += 1;
        if self.elements > MAX_ELEMENTS {
            return Err(at.error(format!("the scene has more than {MAX_ELEMENTS} elements"), ""));
        }
        let serial = self.elements;
        let tag = node.tag_name().name().to_owned();
        let allowed = allowed_attributes(&tag, &at)?;
        let mut attributes = Vec::new();
        for attribute in node.attributes() {
            let at = lines.place(attribute.range().start);
            let name = attribute.name();
            if !allowed.contains(&name) {
                return Err(at.error(format!("<{tag}> has no attribute \"{name}\""), names::suggest(name, allowed)));
            }
            let value = self.parameters.substitute(attribute.value(), &at)?;
            attributes.push(Attribute { name: name.to_owned(), value, at });
        }
        let mut element = Element { serial, tag, attributes, children: Vec::new(), at };
        if element.is_object() {
            element.require("type")?;
        }
        for child in node.children() {
            if child.is_text() {
                let text = child.text().unwrap_or_default();
                if !text.trim().is_empty() {
                    let at = lines.place(child.range().start);
                    return Err(at.error(format!("text inside <{}>", element.tag), "values are written as attributes"));
                }
            }
            if child.is_element() {
                if !element.is_object() && !matches!(element.tag.as_str(), "scene" | "transform") {
                    let at = lines.place(child.range().start);
                    return Err(at.error(
                        format!("an element inside <{}>", element.tag),
                        "only objects and <transform> have children",
                    ));
                }
                self.child(child, lines, depth, &mut element)?;
            }
        }
        Ok(element)
    }

    fn child(
        &mut self,
        node: roxmltree::Node<'_, '_>,
        lines: &Lines<'_>,
        depth: usize,
        parent: &mut Element,
    ) -> Result<(), SceneError> {
        let child = self.element(node, lines, depth + 1)?;
        if matches!(child.tag.as_str(), "default" | "include" | "alias") && parent.tag != "scene" {
            return Err(child
                .at
                .error(format!("<{}> inside <{}>", child.tag, parent.tag), "it must stand directly inside <scene>"));
        }
        match child.tag.as_str() {
            "default" => self.parameters.default(child.require("name")?, child.require("value")?, &child.at)?,
            "include" => {
                let path = sibling(&lines.file, child.require("filename")?);
                if self.open_files.contains(&path) {
                    return Err(child.at.error(format!("\"{}\" includes itself", path.display()), ""));
                }
                if self.open_files.len() > MAX_INCLUDE_DEPTH {
                    return Err(child.at.error(format!("includes nest more than {MAX_INCLUDE_DEPTH} deep"), ""));
                }
                let included = self.file(&path, Some(&child.at))?;
                parent.children.extend(included.children);
            }
            _ => parent.children.push(child),
        }
        Ok(())
    }
}

/// The attributes that an element may have; an error if there is no such element.
fn allowed_attributes(tag: &str, at: &Place) -> Result<&'static [&'static str], SceneError> {
    Ok(match tag {
        "scene" => &["version"],
        "default" => &["name", "value"],
        "include" => &["filename"],
        "alias" => &["id", "as"],
        "ref" => &["id", "name"],
        "shape" => &["type", "id", "name"],
        _ if OBJECT_TAGS.contains(&tag) => &["type", "id", "name"],
        "boolean" | "integer" | "float" | "string" | "rgb" => &["name", "value"],
        "vector" | "point" => &["name", "value", "x", "y", "z"],
        "transform" => &["name"],
        "translate" | "scale" => &["x", "y", "z", "value"],
        "rotate" => &["x", "y", "z", "angle"],
        "lookat" => &["origin", "target", "up"],
        "matrix" => &["value"],
        _ => {
            if let Some((message, help)) = names::foreign_name(tag) {
                return Err(at.error(message, help));
            }
            let mut known = vec!["scene", "default", "include", "alias", "ref", "shape", "vector", "point"];
            known.extend(OBJECT_TAGS);
            known.extend(PROPERTY_TAGS);
            known.extend(["translate", "scale", "rotate", "lookat", "matrix"]);
            return Err(at.error(format!("<{tag}> is not supported"), names::suggest(tag, &known)));
        }
    })
}

fn check_version(root: &Element) -> Result<(), SceneError> {
    let version = root.require("version")?;
    let parts: Vec<Option<u32>> = version.split('.').map(|p| p.parse().ok()).collect();
    match parts.as_slice() {
        [Some(major), Some(_), Some(_)] if *major >= 2 => Ok(()),
        [Some(_), Some(_), Some(_)] => Err(root.at.error(
            format!("scene version {version} is too old"),
            "2.0.0 or later is supported; Mitsuba 3 rewrites old scenes when it loads them. Names are now snake_case, and sigma_s, sigma_a are sigma_t, albedo",
        )),
        _ => Err(root.at.error(format!("\"{version}\" is not a version"), "write version=\"3.0.0\"")),
    }
}

/// `name` relative to the folder of `file`.
pub(super) fn sibling(file: &Path, name: &str) -> PathBuf {
    file.parent().unwrap_or_else(|| Path::new("")).join(name)
}

/// `roxmltree` ends its messages with " at line:column", which our own prefix already says.
fn without_position(message: &str) -> &str {
    message.rsplit_once(" at ").map_or(message, |(head, _)| head)
}

/// Places of byte offsets in one file.
struct Lines<'a> {
    text: &'a str,
    file: Arc<Path>,
    starts: Vec<usize>,
}

impl<'a> Lines<'a> {
    fn new(text: &'a str, file: Arc<Path>) -> Self {
        let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect();
        Self { text, file, starts }
    }

    fn place(&self, offset: usize) -> Place {
        let line = self.starts.partition_point(|&s| s <= offset);
        let start = self.starts.get(line.saturating_sub(1)).copied().unwrap_or(0);
        let column = self.text.get(start..offset).map_or(0, |s| s.chars().count()) + 1;
        Place { file: self.file.clone(), line: saturate(line), column: saturate(column) }
    }
}

fn saturate(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}
