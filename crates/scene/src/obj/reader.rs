//! The lines of an OBJ file.

use std::io::BufRead;

use glam::{DVec3, Vec2};

use super::polygon::{Triangulator, Work};
use crate::mesh::{Mesh, MeshError, NO_INDEX};
use crate::text::quoted;

/// Statements without an effect on the surfaces.
const WITHOUT_EFFECT: [&[u8]; 16] = [
    b"g",
    b"o",
    b"s",
    b"mg",
    b"l",
    b"p",
    b"usemtl",
    b"mtllib",
    b"usemap",
    b"maplib",
    b"vp",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"lod",
    b"end",
];
/// At most this many statements that are not known are warned about.
const MOST_UNKNOWN: usize = 8;

/// What a file may cost at most.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Bytes of one statement, over all its continued lines.
    pub(crate) statement: usize,
    /// Triangles of the file.
    pub(crate) triangles: usize,
    /// Steps of the triangulation of polygons that are not convex; some nanoseconds each.
    pub(crate) polygon_steps: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { statement: 1 << 28, triangles: 1 << 28, polygon_steps: 1 << 28 }
    }
}

/// Reads a mesh. Cost: linear in the file, but for polygons that are not convex, which take up to [`Limits::polygon_steps`].
pub(crate) fn read(input: &mut dyn BufRead, limits: &Limits) -> Result<Mesh, MeshError> {
    let mut reader = Reader {
        limits,
        mesh: Mesh::default(),
        faces: Vec::new(),
        corners: [const { Vec::new() }; 3],
        farthest: [const { None }; 3],
        unknown: Vec::new(),
        line: 0,
    };
    let mut statement = Vec::new();
    let mut physical_line = 0;
    while let Some(lines) = next_statement(input, &mut statement, limits.statement, physical_line + 1)? {
        reader.line = physical_line + 1;
        physical_line += lines;
        let bytes =
            if reader.line == 1 { statement.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&statement) } else { &statement };
        reader.statement(bytes)?;
    }
    reader.finish()
}

/// Reads a line, and the lines that continue it after a `\`, without its comment. The answer is the number of lines; `None` at the end.
fn next_statement(
    input: &mut dyn BufRead,
    statement: &mut Vec<u8>,
    most: usize,
    line: u64,
) -> Result<Option<u64>, MeshError> {
    statement.clear();
    let mut lines = 0;
    loop {
        let start = statement.len();
        let ended = read_line(input, statement, most).map_err(|e| MeshError {
            line: line + lines,
            message: e.to_string(),
            help: String::new(),
        })?;
        if statement.len() == start && !ended {
            return Ok((lines > 0).then_some(lines));
        }
        lines += 1;
        while statement.len() > start && statement.ends_with(b"\r") {
            statement.pop();
        }
        // A comment goes to the end of its line: a path in it may well end with a backslash.
        if let Some(comment) = statement[start..].iter().position(|&b| b == b'#') {
            statement.truncate(start + comment);
        } else if statement[start..].last() == Some(&b'\\') {
            statement.pop();
            statement.push(b' ');
            continue;
        }
        return Ok(Some(lines));
    }
}

/// Appends the bytes up to the end of the line; true if there was one, false at the end of the file.
fn read_line(input: &mut dyn BufRead, line: &mut Vec<u8>, most: usize) -> std::io::Result<bool> {
    loop {
        let available = match input.fill_buf() {
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => continue,
            available => available?,
        };
        let end = available.iter().position(|&b| b == b'\n');
        let taken = end.unwrap_or(available.len());
        if line.len() + taken > most {
            return Err(std::io::Error::other(format!("the line is longer than {most} bytes")));
        }
        line.extend_from_slice(&available[..taken]);
        let at_end = available.is_empty();
        input.consume(taken + usize::from(end.is_some()));
        if end.is_some() || at_end {
            return Ok(end.is_some());
        }
    }
}

/// A face: its corners go from the end of the face before to `end`.
struct Face {
    end: usize,
    line: u64,
}

struct Reader<'a> {
    limits: &'a Limits,
    mesh: Mesh,
    faces: Vec<Face>,
    /// The numbers of the corners' vertices; those of their texture coordinates and normals, as many or, if no face has any, none.
    corners: [Vec<u32>; 3],
    /// A face may name a vertex that comes later. The largest such number of a vertex, texture coordinate and normal, with the error
    /// if it never comes.
    farthest: [Option<(u64, MeshError)>; 3],
    unknown: Vec<Vec<u8>>,
    line: u64,
}

impl Reader<'_> {
    fn error(&self, statement: &[u8], message: &str, help: impl Into<String>) -> MeshError {
        let text = quoted(&String::from_utf8_lossy(statement));
        MeshError { line: self.line, message: format!("{message} in {text}"), help: help.into() }
    }

    fn statement(&mut self, statement: &[u8]) -> Result<(), MeshError> {
        let mut words = statement.split(|b| b.is_ascii_whitespace()).filter(|w| !w.is_empty());
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword {
            b"v" => self.vertex(statement, words),
            b"f" => self.face(statement, words),
            b"vt" => self.texture_coordinates(statement, words),
            b"vn" => self.normal(statement, words),
            _ if WITHOUT_EFFECT.contains(&keyword) => Ok(()),
            _ => {
                self.warn_unknown(keyword);
                Ok(())
            }
        }
    }

    fn warn_unknown(&mut self, keyword: &[u8]) {
        if self.unknown.len() < MOST_UNKNOWN && !self.unknown.iter().any(|k| k == keyword) {
            self.unknown.push(keyword.to_vec());
            let text = quoted(&String::from_utf8_lossy(keyword));
            self.mesh.warnings.push((self.line, format!("the statement {text} is not known and has no effect")));
        }
    }

    fn vertex<'w>(&mut self, statement: &[u8], words: impl Iterator<Item = &'w [u8]>) -> Result<(), MeshError> {
        let mut numbers = [0.0; 7];
        let mut count = 0;
        for word in words {
            let Some(slot) = numbers.get_mut(count) else {
                count += 1;
                break;
            };
            *slot = self.number(statement, word)?;
            count += 1;
        }
        // x y z, then nothing, a weight, a colour, or a colour with alpha. Only rational curves use the weight.
        if !matches!(count, 3 | 4 | 6 | 7) {
            let message = if count > 7 { "too many numbers".to_owned() } else { format!("{count} numbers") };
            return Err(self.error(statement, &message, "a vertex has x, y and z, and may have a weight or a colour"));
        }
        self.has_room(statement, self.mesh.positions.len())?;
        self.mesh.positions.push(DVec3::new(numbers[0], numbers[1], numbers[2]));
        Ok(())
    }

    fn texture_coordinates<'w>(
        &mut self,
        statement: &[u8],
        words: impl Iterator<Item = &'w [u8]>,
    ) -> Result<(), MeshError> {
        let mut uv = Vec2::ZERO;
        let mut count = 0;
        for word in words {
            let number = self.number(statement, word)?;
            if count < 2 {
                uv[count] = number as f32;
            }
            count += 1;
        }
        if !(1..=3).contains(&count) || !uv.is_finite() {
            let message = format!("{count} numbers");
            return Err(self.error(
                statement,
                &message,
                "texture coordinates are u, v and maybe w, in single precision",
            ));
        }
        self.has_room(statement, self.mesh.uvs.len())?;
        self.mesh.uvs.push(uv);
        Ok(())
    }

    fn normal<'w>(&mut self, statement: &[u8], words: impl Iterator<Item = &'w [u8]>) -> Result<(), MeshError> {
        let mut normal = DVec3::ZERO;
        let mut count = 0;
        for word in words {
            let number = self.number(statement, word)?;
            if count < 3 {
                normal[count] = number;
            }
            count += 1;
        }
        if count != 3 {
            return Err(self.error(statement, &format!("{count} numbers"), "a normal has x, y and z"));
        }
        self.has_room(statement, self.mesh.normals.len())?;
        self.mesh.normals.push(normal);
        Ok(())
    }

    /// An error if there are already as many as may be.
    fn has_room(&self, statement: &[u8], count: usize) -> Result<(), MeshError> {
        if count < self.limits.triangles {
            return Ok(());
        }
        Err(self.error(statement, "too many vertices", format!("at most {} are read", self.limits.triangles)))
    }

    fn number(&self, statement: &[u8], word: &[u8]) -> Result<f64, MeshError> {
        let number = std::str::from_utf8(word).ok().and_then(|w| w.parse::<f64>().ok());
        match number {
            Some(number) if number.is_finite() => Ok(number),
            Some(_) => Err(self.error(statement, "a number that is not finite", "")),
            None => {
                let help = if word.contains(&b',') {
                    "numbers have a decimal point, as in 0.5: export the mesh again with a locale that writes one"
                } else {
                    ""
                };
                let word = quoted(&String::from_utf8_lossy(word));
                Err(self.error(statement, &format!("{word} is not a number"), help))
            }
        }
    }

    fn face<'w>(&mut self, statement: &[u8], words: impl Iterator<Item = &'w [u8]>) -> Result<(), MeshError> {
        let start = self.corners[0].len();
        for word in words {
            let mut parts = word.split(|&b| b == b'/');
            let counts = self.counts();
            let mut corner = [None; 3];
            for (kind, count) in counts.into_iter().enumerate() {
                let Some(part) = parts.next().filter(|p| !p.is_empty()) else { continue };
                corner[kind] = Some(self.index(statement, part, kind, count)?);
            }
            let position = corner[0].filter(|_| parts.next().is_none()).ok_or_else(|| {
                let word = quoted(&String::from_utf8_lossy(word));
                let message = format!("{word} is not a corner of a face");
                self.error(statement, &message, "write the number of a vertex, as in 3, 3/1, 3//2 or 3/1/2")
            })?;
            let [positions, attributes @ ..] = &mut self.corners;
            for (list, index) in attributes.iter_mut().zip(&corner[1..]) {
                // Most meshes without texture coordinates have them nowhere.
                if index.is_some() || !list.is_empty() {
                    list.resize(positions.len(), NO_INDEX);
                    list.push(index.unwrap_or(NO_INDEX));
                }
            }
            positions.push(position);
        }
        let corners = self.corners[0].len() - start;
        if corners < 3 {
            self.corners.iter_mut().for_each(|list| list.truncate(start));
            let line = self.line;
            self.mesh.warnings.push((line, format!("a face with {corners} corners has no area and is left out")));
            // One warning is enough.
            if self.mesh.warnings.len() > MOST_UNKNOWN {
                self.mesh.warnings.pop();
            }
            return Ok(());
        }
        // The number of triangles is bounded by that of the corners.
        if self.corners[0].len() > self.limits.triangles.saturating_mul(3) {
            return Err(self.error(
                statement,
                "too many faces",
                format!("at most {} triangles are read", self.limits.triangles),
            ));
        }
        self.faces.push(Face { end: self.corners[0].len(), line: self.line });
        Ok(())
    }

    /// The index from 0 that a number from 1 stands for; a negative one counts back from the newest.
    fn index(&mut self, statement: &[u8], part: &[u8], kind: usize, count: u64) -> Result<u32, MeshError> {
        const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];
        let number = std::str::from_utf8(part).ok().and_then(|w| w.parse::<i64>().ok()).filter(|&n| n != 0);
        let Some(number) = number else {
            let message = format!("{} is not the number of a {}", quoted(&String::from_utf8_lossy(part)), KINDS[kind]);
            return Err(self.error(statement, &message, "they count from 1; -1 is the newest"));
        };
        let index = if number > 0 { Some(number.unsigned_abs() - 1) } else { count.checked_sub(number.unsigned_abs()) };
        let missing = |reader: &Self| {
            let message = format!("there is no {} {number}", KINDS[kind]);
            reader.error(statement, &message, "")
        };
        let Some(index) = index else { return Err(missing(self)) };
        let Ok(narrow) = u32::try_from(index) else { return Err(missing(self)) };
        if index >= count && self.farthest[kind].as_ref().is_none_or(|(far, _)| *far < index) {
            self.farthest[kind] = Some((index, missing(self)));
        }
        Ok(narrow)
    }

    /// How many vertices, texture coordinates and normals there are so far.
    fn counts(&self) -> [u64; 3] {
        [self.mesh.positions.len(), self.mesh.uvs.len(), self.mesh.normals.len()].map(|n| n as u64)
    }

    fn finish(mut self) -> Result<Mesh, MeshError> {
        let counts = self.counts();
        for ((farthest, count), kind) in
            self.farthest.iter_mut().zip(counts).zip(["vertices", "texture coordinates", "normals"])
        {
            if let Some((_, mut error)) = farthest.take().filter(|(index, _)| *index >= count) {
                error.help = format!("the file has {count} {kind}");
                return Err(error);
            }
        }
        let Self { mut mesh, corners: [positions, uvs, normals], .. } = self;
        mesh.triangles.reserve_exact(positions.len() - 2 * self.faces.len());
        let mut triangulator = Triangulator::default();
        let mut work = Work { left: self.limits.polygon_steps };
        let mut start = 0;
        let mut crossed = None;
        // A polygon is cut as its corners are numbered, so that they keep what else they have.
        let (mut places, mut numbers, mut cut) = (Vec::new(), Vec::new(), Vec::new());
        for Face { end, line } in self.faces {
            let count = end - start;
            cut.clear();
            if count == 3 {
                cut.push([0, 1, 2]);
            } else {
                places.clear();
                places.extend(positions[start..end].iter().map(|&i| mesh.positions[i as usize]));
                numbers.clear();
                numbers.extend((0..).take(count));
                let simple =
                    triangulator.triangulate(&places, &numbers, &mut cut, &mut work).ok_or_else(|| MeshError {
                        line,
                        message: format!(
                            "a polygon of {count} corners that is not convex takes too long to cut into triangles"
                        ),
                        help: "cut the polygons into triangles when you export the mesh".to_owned(),
                    })?;
                if !simple && crossed.is_none() {
                    crossed = Some(line);
                }
            }
            let lists = [&positions, &uvs, &normals];
            let triangles = [&mut mesh.triangles, &mut mesh.uv_triangles, &mut mesh.normal_triangles];
            for (list, triangles) in lists.into_iter().zip(triangles) {
                let of = |i: u32| list.get(start + i as usize).copied().unwrap_or(NO_INDEX);
                if !list.is_empty() {
                    triangles.extend(cut.iter().map(|t: &[u32; 3]| t.map(of)));
                }
            }
            start = end;
        }
        if let Some(line) = crossed {
            mesh.warnings.push((
                line,
                "a polygon crosses or touches itself: which part of it is filled is not defined".to_owned(),
            ));
        }
        Ok(mesh)
    }
}
