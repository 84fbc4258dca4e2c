//! PLY meshes (Turk 1994): text, or binary numbers in either order.
//!
//! Of the element `vertex` the properties x, y, z, nx, ny, nz and u, v (or s, t, or texture_u, texture_v) are read, of `face` the list `vertex_indices` (or
//! `vertex_index`), and of both the attributes that Mitsuba knows; all others are passed over. Polygons become fans, as in most loaders.
//!
//! *Limits.* Nothing is allocated because a header says so: memory grows with what is read.

mod attributes;

use std::io::{BufRead, Read as _};

use glam::{DVec3, Vec2};

use crate::Rgb;
use crate::mesh::{Mesh, MeshError, NamedValues};

/// A header has at most this many lines, each at most this long; an element at most this many properties.
const MOST_LINES: u64 = 10_000;
const LONGEST_LINE: u64 = 1 << 16;
/// A face has at most this many corners.
const MOST_CORNERS: u64 = 1 << 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

#[derive(Debug)]
struct Property {
    name: String,
    /// The type of a list's length, if it is a list.
    length: Option<Number>,
    number: Number,
}

#[derive(Debug)]
struct ElementKind {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

/// Reads a mesh of at most so many triangles and vertices. Cost: linear in the file.
pub(crate) fn read(input: &mut dyn BufRead, most: usize) -> Result<Mesh, MeshError> {
    let mut lines = Lines { input, line: 0, text: Vec::new() };
    let (format, elements) = header(&mut lines)?;
    let mut body = Body { lines, format, row: Vec::new(), at: 0 };
    let mut mesh = Mesh::default();
    for element in &elements {
        match element.name.as_str() {
            "vertex" => vertices(&mut body, element, &mut mesh, most)?,
            "face" => faces(&mut body, element, &mut mesh, most)?,
            _ => (0..element.count).try_for_each(|_| body.skip(element))?,
        }
    }
    let vertices = mesh.positions.len();
    if mesh.triangles.iter().flatten().any(|&i| i as usize >= vertices) {
        return Err(MeshError::of_file(
            format!("a face names a vertex that is not there: the file has {vertices}"),
            "",
        ));
    }
    if !mesh.uvs.is_empty() {
        mesh.uv_triangles = mesh.triangles.clone();
    }
    if !mesh.normals.is_empty() {
        mesh.normal_triangles = mesh.triangles.clone();
    }
    Ok(mesh)
}

struct Lines<'a> {
    input: &'a mut dyn BufRead,
    line: u64,
    text: Vec<u8>,
}

impl Lines<'_> {
    /// The next line without its end; false at the end of the file.
    fn next(&mut self) -> Result<bool, MeshError> {
        self.text.clear();
        self.line += 1;
        let read = (&mut *self.input).take(LONGEST_LINE).read_until(b'\n', &mut self.text);
        let read = read.map_err(|e| MeshError::of_file(e.to_string(), ""))?;
        if self.text.pop_if(|b| *b == b'\n').is_none() && read as u64 == LONGEST_LINE {
            return Err(MeshError { line: self.line, message: "the line is too long".to_owned(), help: String::new() });
        }
        while self.text.pop_if(|b| *b == b'\r').is_some() {}
        Ok(read > 0)
    }

    fn error(&self, message: &str) -> MeshError {
        MeshError::at_line(self.line, message, &self.text)
    }
}

fn header(lines: &mut Lines<'_>) -> Result<(Format, Vec<ElementKind>), MeshError> {
    lines.next()?;
    if lines.text != b"ply" {
        return Err(lines.error("the file is no PLY mesh: its first line is not \"ply\","));
    }
    let mut format = None;
    let mut elements: Vec<ElementKind> = Vec::new();
    loop {
        if !lines.next()? {
            return Err(MeshError::of_file("the file ends before the line end_header", ""));
        }
        if lines.line > MOST_LINES {
            return Err(lines.error("the header does not end"));
        }
        let text = String::from_utf8_lossy(&lines.text).into_owned();
        let words: Vec<&str> = text.split_whitespace().collect();
        match words.as_slice() {
            [] | ["comment" | "obj_info", ..] => {}
            ["end_header"] => break,
            ["format", kind, "1.0"] => {
                format = Some(match *kind {
                    "ascii" => Format::Ascii,
                    "binary_little_endian" => Format::LittleEndian,
                    "binary_big_endian" => Format::BigEndian,
                    _ => return Err(lines.error("an unknown format")),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| lines.error("this is not a number of elements"))?;
                elements.push(ElementKind { name: (*name).to_owned(), count, properties: Vec::new() });
            }
            ["property", rest @ ..] => {
                let number = |name: &str| number_type(name).ok_or_else(|| lines.error("an unknown type of number"));
                let (length, kind, name) = match rest {
                    ["list", length, kind, name] => (Some(number(length)?), number(kind)?, name),
                    [kind, name] => (None, number(kind)?, name),
                    _ => return Err(lines.error("a property without type and name")),
                };
                if length.is_some_and(|l| matches!(l, Number::F32 | Number::F64)) {
                    return Err(lines.error("the length of a list is no integer"));
                }
                let element = elements.last_mut().ok_or_else(|| lines.error("a property without an element"))?;
                element.properties.push(Property { name: (*name).to_owned(), length, number: kind });
            }
            _ => return Err(lines.error("this is not a line of a header")),
        }
    }
    let format = format.ok_or_else(|| MeshError::of_file("the header names no format", ""))?;
    if let Some(empty) = elements.iter().find(|e| e.properties.is_empty() && e.count > 0) {
        // They would be as many as a header can say, and none of them a byte.
        return Err(MeshError::of_file(format!("the element \"{}\" has no properties", empty.name), ""));
    }
    Ok((format, elements))
}

fn number_type(name: &str) -> Option<Number> {
    Some(match name {
        "char" | "int8" => Number::I8,
        "uchar" | "uint8" => Number::U8,
        "short" | "int16" => Number::I16,
        "ushort" | "uint16" => Number::U16,
        "int" | "int32" => Number::I32,
        "uint" | "uint32" => Number::U32,
        "float" | "float32" => Number::F32,
        "double" | "float64" => Number::F64,
        _ => return None,
    })
}

impl Number {
    const fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number that these bytes are, the lowest first.
    fn of(self, b: [u8; 8]) -> f64 {
        let [b0, b1, b2, b3, ..] = b;
        match self {
            Self::I8 => i8::from_le_bytes([b0]).into(),
            Self::U8 => b0.into(),
            Self::I16 => i16::from_le_bytes([b0, b1]).into(),
            Self::U16 => u16::from_le_bytes([b0, b1]).into(),
            Self::I32 => i32::from_le_bytes([b0, b1, b2, b3]).into(),
            Self::U32 => u32::from_le_bytes([b0, b1, b2, b3]).into(),
            Self::F32 => f32::from_le_bytes([b0, b1, b2, b3]).into(),
            Self::F64 => f64::from_le_bytes(b),
        }
    }
}

struct Body<'a> {
    lines: Lines<'a>,
    format: Format,
    /// Where the words of the current line of text begin and end.
    row: Vec<(usize, usize)>,
    at: usize,
}

impl Body<'_> {
    /// Goes to the next element: a line, if the file is text.
    fn begin(&mut self) -> Result<(), MeshError> {
        if self.format != Format::Ascii {
            return Ok(());
        }
        self.at = 0;
        loop {
            if !self.lines.next()? {
                return Err(MeshError::of_file("the file ends before its last element", ""));
            }
            self.row.clear();
            let mut start = None;
            for (i, b) in self.lines.text.iter().chain(b" ").enumerate() {
                match (b.is_ascii_whitespace(), start) {
                    (false, None) => start = Some(i),
                    (true, Some(from)) => {
                        self.row.push((from, i));
                        start = None;
                    }
                    _ => {}
                }
            }
            if !self.row.is_empty() {
                return Ok(());
            }
        }
    }

    fn number(&mut self, kind: Number) -> Result<f64, MeshError> {
        if self.format == Format::Ascii {
            let Some(&(from, to)) = self.row.get(self.at) else {
                return Err(self.lines.error("too few numbers"));
            };
            self.at += 1;
            let word = std::str::from_utf8(&self.lines.text[from..to]).ok();
            return word.and_then(|w| w.parse().ok()).ok_or_else(|| self.lines.error("something that is not a number"));
        }
        let mut bytes = [0; 8];
        let used = &mut bytes[..kind.bytes()];
        self.lines
            .input
            .read_exact(used)
            .map_err(|e| MeshError::of_file(format!("the file ends before its last element: {e}"), ""))?;
        if self.format == Format::BigEndian {
            used.reverse();
        }
        Ok(kind.of(bytes))
    }

    /// The length of a list.
    fn length(&mut self, kind: Number) -> Result<u64, MeshError> {
        let length = self.number(kind)?;
        if length >= 0.0 && length.fract() == 0.0 && length <= MOST_CORNERS as f64 {
            return Ok(length as u64);
        }
        Err(MeshError { line: self.line(), message: format!("a list of {length} numbers"), help: String::new() })
    }

    fn line(&self) -> u64 {
        if self.format == Format::Ascii { self.lines.line } else { 0 }
    }

    fn skip(&mut self, element: &ElementKind) -> Result<(), MeshError> {
        self.begin()?;
        element.properties.iter().try_for_each(|p| self.skip_property(p))
    }

    fn skip_property(&mut self, property: &Property) -> Result<(), MeshError> {
        let count = property.length.map_or(Ok(1), |length| self.length(length))?;
        (0..count).try_for_each(|_| self.number(property.number).map(drop))
    }
}

fn vertices(body: &mut Body<'_>, element: &ElementKind, mesh: &mut Mesh, most: usize) -> Result<(), MeshError> {
    if element.count > most as u64 {
        return Err(MeshError::of_file(format!("it has {} vertices; at most {most} are read", element.count), ""));
    }
    // Where each property goes: position, normal, texture coordinates.
    let slot = |p: &Property| match p.name.as_str() {
        _ if p.length.is_some() => None,
        "x" => Some(0),
        "y" => Some(1),
        "z" => Some(2),
        "nx" => Some(3),
        "ny" => Some(4),
        "nz" => Some(5),
        "u" | "s" | "texture_u" => Some(6),
        "v" | "t" | "texture_v" => Some(7),
        _ => None,
    };
    let slots: Vec<Option<usize>> = element.properties.iter().map(slot).collect();
    let groups = attributes::groups(&element.properties);
    let mut others = Others::new(&groups, "vertex_", mesh);
    let has = |wanted: &[usize]| wanted.iter().all(|w| slots.contains(&Some(*w)));
    if !has(&[0, 1, 2]) {
        return Err(MeshError::of_file("the vertices have no x, y and z", ""));
    }
    let (has_normals, has_uvs) = (has(&[3, 4, 5]), has(&[6, 7]));
    for _ in 0..element.count {
        body.begin()?;
        let mut values = [0.0; 8];
        others.begin();
        for (i, (property, slot)) in element.properties.iter().zip(&slots).enumerate() {
            match slot {
                Some(slot) => values[*slot] = body.number(property.number)?,
                None if others.wants(i) => others.take(i, body.number(property.number)?),
                None => body.skip_property(property)?,
            }
        }
        others.push(mesh, 1);
        let [x, y, z, nx, ny, nz, u, v] = values;
        if !values.iter().all(|v| v.is_finite()) {
            let message = format!("vertex {} has a number that is not finite", mesh.positions.len());
            return Err(MeshError { line: body.line(), message, help: String::new() });
        }
        mesh.positions.push(DVec3::new(x, y, z));
        if has_normals {
            mesh.normals.push(DVec3::new(nx, ny, nz));
        }
        if has_uvs {
            mesh.uvs.push(Vec2::new(u as f32, v as f32));
        }
    }
    Ok(())
}

fn faces(body: &mut Body<'_>, element: &ElementKind, mesh: &mut Mesh, most: usize) -> Result<(), MeshError> {
    let is_corners = |p: &Property| p.length.is_some() && matches!(p.name.as_str(), "vertex_indices" | "vertex_index");
    if element.count > 0 && !element.properties.iter().any(is_corners) {
        return Err(MeshError::of_file("the faces have no list \"vertex_indices\"", ""));
    }
    let groups = attributes::groups(&element.properties);
    let mut others = Others::new(&groups, "face_", mesh);
    let mut corners = Vec::new();
    for _ in 0..element.count {
        body.begin()?;
        others.begin();
        let before = mesh.triangles.len();
        for (i, property) in element.properties.iter().enumerate() {
            let Some(length) = property.length.filter(|_| is_corners(property)) else {
                if others.wants(i) {
                    others.take(i, body.number(property.number)?);
                } else {
                    body.skip_property(property)?;
                }
                continue;
            };
            corners.clear();
            for _ in 0..body.length(length)? {
                let index = body.number(property.number)?;
                if !(index >= 0.0 && index.fract() == 0.0 && index < f64::from(u32::MAX)) {
                    let message = format!("{index} is not the number of a vertex");
                    return Err(MeshError { line: body.line(), message, help: "they count from 0".to_owned() });
                }
                corners.push(index as u32);
            }
            if let [first, ..] = *corners
                && corners.len() > 2
            {
                mesh.triangles.extend(corners[1..].windows(2).map(|pair| [first, pair[0], pair[1]]));
            }
            if mesh.triangles.len() > most {
                return Err(MeshError::of_file(format!("more than {most} triangles"), ""));
            }
        }
        others.push(mesh, mesh.triangles.len() - before);
    }
    Ok(())
}

/// The attributes of an element while its rows are read.
struct Others {
    /// Where each property goes: the attribute and its channel.
    slots: Vec<Option<(usize, usize)>>,
    /// How many channels each attribute has.
    channels: Vec<usize>,
    /// Of the row that is being read.
    row: Vec<[f64; 3]>,
    /// The number of the first attribute in the mesh.
    first: usize,
}

impl Others {
    fn new(groups: &[attributes::Group], prefix: &str, mesh: &mut Mesh) -> Self {
        let first = mesh.attributes.len();
        let mut slots = Vec::new();
        for (attribute, group) in groups.iter().enumerate() {
            for (channel, &property) in group.properties.iter().enumerate() {
                slots.resize(slots.len().max(property + 1), None);
                slots[property] = Some((attribute, channel));
            }
            let name = format!("{prefix}{}", group.name);
            mesh.attributes.push(NamedValues { name, values: Vec::new(), of_faces: prefix == "face_" });
        }
        let channels = groups.iter().map(|g| g.properties.len()).collect();
        Self { slots, channels, row: vec![[0.0; 3]; groups.len()], first }
    }

    fn wants(&self, property: usize) -> bool {
        self.slots.get(property).is_some_and(Option::is_some)
    }

    fn begin(&mut self) {
        self.row.fill([0.0; 3]);
    }

    fn take(&mut self, property: usize, value: f64) {
        if let Some(Some((attribute, channel))) = self.slots.get(property) {
            self.row[*attribute][*channel] = value;
        }
    }

    /// The row is one of so many vertices or triangles.
    fn push(&self, mesh: &mut Mesh, count: usize) {
        for ((attribute, row), channels) in mesh.attributes[self.first..].iter_mut().zip(&self.row).zip(&self.channels)
        {
            let [r, g, b] = row.map(|v| v as f32);
            let value = if *channels == 1 { Rgb::splat(r) } else { Rgb::new(r, g, b) };
            attribute.values.extend(std::iter::repeat_n(value, count));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "ply\nformat ascii 1.0\ncomment a square\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        property uchar red\nproperty float s\nproperty float t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    const BODY: &str = "0 0 0 255 0 0\n1 0 0 255 1 0\n\n1 1 0 255 1 1\n0 1 0 255 0 1\n4 0 1 2 3\n";

    fn parse(text: &[u8]) -> Result<Mesh, MeshError> {
        read(&mut &*text, 1000)
    }

    fn binary(format: &str, bytes: fn(f32) -> [u8; 4], corners: fn(i32) -> [u8; 4]) -> Vec<u8> {
        let mut file = HEAD.replace("ascii", format).into_bytes();
        for [x, y] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
            file.extend([x, y, 0.0].map(bytes).concat());
            file.push(255);
            file.extend([x, y].map(bytes).concat());
        }
        file.push(4);
        file.extend([0, 1, 2, 3].map(corners).concat());
        file
    }

    #[test]
    fn all_formats_are_one_mesh() {
        let text = parse(&[HEAD, BODY].concat().into_bytes()).unwrap();
        assert_eq!(text.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!((text.positions[2], text.uvs[2]), (DVec3::new(1.0, 1.0, 0.0), Vec2::ONE));
        assert_eq!(text.uv_triangles, text.triangles);
        assert!(text.normals.is_empty());
        let little = binary("binary_little_endian", f32::to_le_bytes, i32::to_le_bytes);
        let big = binary("binary_big_endian", f32::to_be_bytes, i32::to_be_bytes);
        assert_eq!(parse(&little).unwrap(), text);
        assert_eq!(parse(&big).unwrap(), text);
        assert!(parse(&little[..little.len() - 1]).unwrap_err().message.contains("ends before"));
    }

    #[test]
    fn errors_name_the_line() {
        let refused = |from: &str, to: &str, line: u64, part: &str| {
            let error = parse(&[HEAD, BODY].concat().replacen(from, to, 1).into_bytes()).unwrap_err();
            assert_eq!(error.line, line, "{error:?}");
            assert!(error.message.contains(part), "{error:?}");
        };
        refused("ply", "obj", 1, "no PLY");
        refused("1 0 0 255 1 0", "1 0 zero 255 1 0", 15, "not a number");
        refused("1 0 0 255 1 0", "1 0 0", 15, "too few");
        refused("1 0 0 255 1 0", "1 0 nan 255 1 0", 15, "not finite");
        refused("4 0 1 2 3", "4 0 1 2 9", 0, "not there");
        refused("4 0 1 2 3", "4 0 1 2 -1", 19, "-1");
        refused("4 0 1 2 3", "99999999 0", 19, "a list of");
        refused("vertex 4", "vertex 5", 19, "too few");
        refused("vertex 4", "vertex 99999999999", 0, "at most");
        refused("float x", "real x", 5, "type");
        refused("float x", "float w", 0, "no x");
        refused("end_header\n", "", 13, "not a line");
        refused(
            "element face 1\nproperty list uchar int vertex_indices",
            "element none 99999999999999",
            0,
            "no properties",
        );
    }
}
