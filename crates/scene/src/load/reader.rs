//! From XML text to a checked tree of elements: parameters substituted, includes spliced in, every element and
//! attribute known by name, each with its place for messages.

use std::collections::HashSet;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::document::{Attribute, Element, OBJECT_TAGS, PROPERTY_TAGS, Place};
use super::lines::Lines;
use super::parameters::Parameters;
use super::search::Search;
use super::{features, names, xml};
use crate::{SceneError, SceneSource};

/// Includes nest at most this deep, as in Mitsuba.
const MAX_INCLUDE_DEPTH: usize = 15;
/// Bounds the work of files that include each other many times over.
const MAX_ELEMENTS: usize = 1_000_000;
/// The scene file and its includes have at most this many bytes together; one that is included twice counts twice.
const MAX_BYTES: u64 = 64 << 20;
/// At most this many folders are looked through for each file.
const MAX_SEARCH_FOLDERS: usize = 64;

/// A scene file with everything that it includes.
#[derive(Debug)]
pub(super) struct Document {
    pub(super) root: Element,
    /// Where its meshes are looked for.
    pub(super) search: Search,
    pub(super) warnings: Vec<(Place, String)>,
}

/// Reads the scene file with everything that it includes.
pub(super) fn read(source: &SceneSource, parameters: &mut Parameters) -> Result<Document, SceneError> {
    let mut reader = Reader {
        source,
        parameters,
        search: Search::default(),
        elements: 0,
        bytes: 0,
        open_files: Vec::new(),
        warnings: Vec::new(),
        files_with_text: HashSet::new(),
    };
    let root = reader.file(source.path(), None)?;
    Ok(Document { root, search: reader.search, warnings: reader.warnings })
}

struct Reader<'a> {
    source: &'a SceneSource,
    parameters: &'a mut Parameters,
    search: Search,
    elements: usize,
    bytes: u64,
    /// The chain of files from the scene file to the one that is being read.
    open_files: Vec<PathBuf>,
    warnings: Vec<(Place, String)>,
    /// The files that have text between their elements.
    files_with_text: HashSet<Arc<Path>>,
}

impl Reader<'_> {
    fn bytes(&mut self, path: &Path) -> std::io::Result<Vec<u8>> {
        let (input, _) = self.source.open(path, MAX_BYTES - self.bytes).map_err(|e| match e.kind() {
            std::io::ErrorKind::Other if self.bytes > 0 => {
                std::io::Error::other(format!("{e}, after the {} bytes of the files before it", self.bytes))
            }
            _ => e,
        })?;
        let mut bytes = Vec::new();
        input.take(MAX_BYTES - self.bytes).read_to_end(&mut bytes)?;
        self.bytes += bytes.len() as u64;
        Ok(bytes)
    }

    fn file(&mut self, path: &Path, includer: Option<&Place>) -> Result<Element, SceneError> {
        let bytes = self.bytes(path).map_err(|e| match includer {
            Some(at) => at.error(
                format!("cannot read \"{}\": {e}", path.display()),
                "the path is relative to this file, to the scene file, or to a folder of a <path>",
            ),
            None => SceneError::File { path: path.to_path_buf(), message: format!("cannot read the scene: {e}") },
        })?;
        let text = scene_text(&bytes, path).map_err(|message| match includer {
            Some(at) => at.error(format!("\"{}\" {message}", path.display()), ""),
            None => SceneError::File { path: path.to_path_buf(), message: format!("the file {message}") },
        })?;
        let lines = Lines::new(text, Arc::from(path));
        let prepared = xml::prepare(text, MAX_ELEMENTS.saturating_sub(self.elements))
            .map_err(|e| lines.place(e.offset).error(e.message, ""))?;
        if let Some(offset) = prepared.behind {
            let message = "what follows the end of the scene is ignored, as in Mitsuba".to_owned();
            self.warnings.push((lines.place(offset), message));
        }
        let document = roxmltree::Document::parse(&prepared.text).map_err(|e| {
            let pos = e.pos();
            let at = match e {
                // The parser gives no place to what lacks its end.
                roxmltree::Error::UnexpectedEndOfStream | roxmltree::Error::UnclosedRootNode => {
                    lines.place(text.trim_end().len())
                }
                _ => Place { file: lines.file.clone(), line: pos.row, column: pos.col },
            };
            at.error(format!("XML: {}", without_position(&e.to_string())), "")
        })?;
        self.open_files.push(path.to_path_buf());
        let mut root = self.element(document.root_element(), &lines, 0)?;
        self.open_files.pop();
        if root.tag != "scene" {
            return Err(root
                .at
                .error(format!("the root element is <{}>", root.tag), "it must be <scene version=\"3.0.0\">"));
        }
        if check_version(&root)? {
            upgrade(&mut root);
        }
        Ok(root)
    }

    fn element(
        &mut self,
        node: roxmltree::Node<'_, '_>,
        lines: &Lines<'_>,
        depth: usize,
    ) -> Result<Element, SceneError> {
        let at = lines.place(node.range().start);
        self.elements += 1;
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
        let mut element = Element { serial, last: serial, tag, attributes, children: Vec::new(), at };
        textured_spectrum(&mut element)?;
        if element.is_object() {
            element.require("type")?;
        }
        for child in node.children() {
            if child.is_text() {
                self.text(child, lines, &element, allowed)?;
            }
            if child.is_element() {
                let may_hold = match element.tag.as_str() {
                    "scene" | "transform" => true,
                    "spectrum" => element.attribute("type").is_some(),
                    _ => element.is_object(),
                };
                if !may_hold {
                    let at = lines.place(child.range().start);
                    return Err(at.error(
                        format!("an element inside <{}>", element.tag),
                        "only objects and <transform> have children",
                    ));
                }
                self.child(child, lines, depth, &mut element)?;
            }
        }
        element.last = self.elements;
        Ok(element)
    }

    /// Text between elements says nothing, in Mitsuba as well. In an element that lacks its value it was meant to be that.
    fn text(
        &mut self,
        node: roxmltree::Node<'_, '_>,
        lines: &Lines<'_>,
        parent: &Element,
        allowed: &[&str],
    ) -> Result<(), SceneError> {
        if node.text().unwrap_or_default().trim().is_empty() {
            return Ok(());
        }
        let source = node.document().input_text().get(node.range()).unwrap_or_default();
        let at = lines.place(node.range().start + xml::first_text(source).unwrap_or(0));
        let wants_value = allowed.contains(&"value") && !matches!(parent.tag.as_str(), "translate" | "scale");
        if wants_value && parent.attributes.iter().all(|a| matches!(a.name.as_str(), "name" | "id")) {
            return Err(at.error(format!("text inside <{}>", parent.tag), "values are written as attributes"));
        }
        if self.files_with_text.insert(lines.file.clone()) {
            let message =
                format!("text inside <{}> is ignored, as in Mitsuba: values are written as attributes", parent.tag);
            self.warnings.push((at, message));
        }
        Ok(())
    }

    fn child(
        &mut self,
        node: roxmltree::Node<'_, '_>,
        lines: &Lines<'_>,
        depth: usize,
        parent: &mut Element,
    ) -> Result<(), SceneError> {
        let child = self.element(node, lines, depth + 1)?;
        if matches!(child.tag.as_str(), "default" | "include" | "alias" | "path")
            && !(parent.tag == "scene" || parent.is_object())
        {
            let help = "it must stand directly inside <scene> or an object";
            return Err(child.at.error(format!("<{}> inside <{}>", child.tag, parent.tag), help));
        }
        match child.tag.as_str() {
            "default" => self.parameters.default(child.require("name")?, child.require("value")?, &child.at)?,
            "path" => self.search_folder(&child, &lines.file)?,
            "include" => {
                let path = self.search.include(self.source, &lines.file, child.require("filename")?);
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

    fn search_folder(&mut self, element: &Element, file: &Path) -> Result<(), SceneError> {
        let folder = self.search.folder(self.source, file, element.require("value")?);
        if !self.source.has_folder(&folder) {
            return Err(element.at.error(
                format!("there is no folder \"{}\"", folder.display()),
                "the path is relative to this file, to the scene file, or to a folder of an earlier <path>",
            ));
        }
        if self.search.len() >= MAX_SEARCH_FOLDERS {
            return Err(element.at.error(format!("more than {MAX_SEARCH_FOLDERS} of <path>"), ""));
        }
        self.search.add(folder);
        Ok(())
    }
}

/// The text of a scene file, or what the file is instead and what to do about it.
fn scene_text<'b>(bytes: &'b [u8], path: &Path) -> Result<&'b str, String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let is_xml = bytes.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'<');
    if !is_xml {
        return Err(not_a_scene(bytes, path));
    }
    std::str::from_utf8(bytes).map_err(|e| format!("is not UTF-8 text (byte {})", e.valid_up_to()))
}

fn not_a_scene(bytes: &[u8], path: &Path) -> String {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let kind = match extension.as_str() {
        "obj" | "ply" | "stl" | "serialized" | "off" => {
            "is a mesh, not a scene: write a scene file with a sensor, an emitter, and a <shape type=\"obj\"> that names an OBJ mesh"
        }
        "pbrt" => "is a PBRT scene: write it as Mitsuba 3 XML, and its meshes as OBJ",
        "blend" => "is a Blender file: export it with the Mitsuba add-on of Blender as XML, and its meshes as OBJ",
        "json" | "gltf" | "glb" | "usd" | "usda" | "usdc" | "usdz" | "fbx" | "dae" => {
            "is not a scene of a kind that is read: import it into Blender, and export it with the Mitsuba add-on as XML"
        }
        _ if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) => "is UTF-16 text: save it as UTF-8",
        _ if bytes.is_empty() => "is empty: a scene is Mitsuba 3 XML, <scene version=\"3.0.0\">…</scene>",
        _ if bytes.contains(&0) || std::str::from_utf8(bytes).is_err() => {
            "is binary: a scene is Mitsuba 3 XML text, <scene version=\"3.0.0\">…</scene>"
        }
        _ => "is not XML: a scene is Mitsuba 3 XML, <scene version=\"3.0.0\">…</scene>",
    };
    kind.to_owned()
}

/// The attributes that an element may have; an error if there is no such element.
fn allowed_attributes(tag: &str, at: &Place) -> Result<&'static [&'static str], SceneError> {
    Ok(match tag {
        "scene" => &["version"],
        "default" => &["name", "value"],
        "include" => &["filename"],
        "path" => &["value"],
        "alias" => &["id", "as"],
        "ref" => &["id", "name"],
        "shape" => &["type", "id", "name"],
        _ if OBJECT_TAGS.contains(&tag) => &["type", "id", "name"],
        "boolean" | "integer" | "float" | "string" | "rgb" => &["name", "value"],
        "spectrum" => &["name", "value", "type", "filename", "id"],
        "vector" | "point" => &["name", "value", "x", "y", "z"],
        "transform" => &["name"],
        "translate" | "scale" => &["x", "y", "z", "value"],
        "rotate" => &["x", "y", "z", "value", "angle"],
        "lookat" => &["origin", "target", "up"],
        "matrix" => &["value"],
        _ => {
            if let Some((message, help)) = names::foreign_name(tag) {
                return Err(at.error(message, help));
            }
            let mut known = vec!["scene", "default", "include", "path", "alias", "ref", "shape", "vector", "point"];
            known.extend(OBJECT_TAGS);
            known.extend(PROPERTY_TAGS);
            known.extend(["translate", "scale", "rotate", "lookat", "matrix"]);
            return Err(at.error(format!("<{tag}> is not supported"), names::suggest(tag, &known)));
        }
    })
}

/// A spectrum whose type is one of a texture's is that texture.
fn textured_spectrum(element: &mut Element) -> Result<(), SceneError> {
    let Some(kind) = element.attribute("type").filter(|_| element.tag == "spectrum") else { return Ok(()) };
    let kind = kind.value.as_str();
    if features::kinds("spectrum").contains(&kind) || !features::kinds("texture").contains(&kind) {
        return Ok(());
    }
    if let Some(other) = element.attributes.iter().find(|a| matches!(a.name.as_str(), "value" | "filename")) {
        return Err(other.at.error(
            format!("<spectrum type=\"{kind}\"> has no attribute \"{}\"", other.name),
            "it is a texture: write its properties inside of it",
        ));
    }
    "texture".clone_into(&mut element.tag);
    Ok(())
}

/// Whether the file is from before version 2.
fn check_version(root: &Element) -> Result<bool, SceneError> {
    let version = root.require("version")?;
    let parts: Vec<Option<u32>> = version.split('.').map(|p| p.parse().ok()).collect();
    match parts.as_slice() {
        [Some(major), Some(_), Some(_)] => Ok(*major < 2),
        _ => Err(root.at.error(format!("\"{version}\" is not a version"), "write version=\"3.0.0\"")),
    }
}

/// Gives what a file from before version 2 names in camelCase its name of today, as Mitsuba 3 does. What has more than another name is left to be refused.
fn upgrade(element: &mut Element) {
    let is_diffuse = element.tag == "bsdf" && element.attribute("type").is_some_and(|kind| kind.value == "diffuse");
    for child in &mut element.children {
        if let Some(name) = child.attributes.iter_mut().find(|a| a.name == "name") {
            name.value = names::snake_case(&name.value);
            if is_diffuse && name.value == "diffuse_reflectance" {
                "reflectance".clone_into(&mut name.value);
            }
        }
        upgrade(child);
    }
}

/// `roxmltree` ends its messages with " at line:column", which our own prefix already says.
fn without_position(message: &str) -> &str {
    message.rsplit_once(" at ").map_or(message, |(head, _)| head)
}
