//! The elements of a scene file, and how they refer to each other.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::names;
use crate::SceneError;

/// Elements that describe an object, with a plugin `type`.
pub(super) const OBJECT_TAGS: [&str; 11] =
    ["bsdf", "emitter", "film", "integrator", "medium", "phase", "rfilter", "sampler", "sensor", "texture", "volume"];
/// Elements that describe a property.
pub(super) const PROPERTY_TAGS: [&str; 7] = ["boolean", "float", "integer", "rgb", "spectrum", "string", "transform"];

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
    /// Unique in the document; children have larger ones.
    pub(super) serial: usize,
    /// The largest serial of the element and all that it contains.
    pub(super) last: usize,
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
        let tag = self.tag.as_str();
        tag == "shape" || OBJECT_TAGS.contains(&tag)
    }

    fn contains(&self, serial: usize) -> bool {
        (self.serial..=self.last).contains(&serial)
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
            user.at.error(format!("no object has the id \"{id}\""), names::suggest_defined(id, &known))
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
