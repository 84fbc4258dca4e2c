//! Streams in memory and in files. The format, version 2, is described byte by byte in `docs/query-streams.md`: a
//! header of 80 bytes, and 56 bytes for each query, little-endian, with checksums of both the queries and the triangles
//! that they are about.

use std::{
    fs::File,
    io::{self, BufReader, Read},
    path::Path,
};

use glam::DVec3;
use vdf_geometry::Triangle;
use vdf_image::write_atomically;
use vdf_render::{Integrator, PreparedScene, SegmentSamples};
use vdf_visibility::{QueryKind, ShadowQuery};

use crate::LabError;

const MAGIC: &[u8; 8] = b"VDFQUERY";
const TRIANGLES_MAGIC: &[u8; 8] = b"VDFTRIAN";
const VERSION: u32 = 2;
const TRIANGLES_VERSION: u32 = 1;
const HEADER: usize = 80;
const QUERY: usize = 56;
const SPATIAL: u32 = 1;
const UNOCCLUDED: u32 = 2;
const ON_LIGHT: u32 = 4;
/// In place of a number of samples per segment.
const AUTO: u32 = u32::MAX;

/// Where the queries of a stream come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StreamOrigin {
    /// Paths of the whole render.
    pub paths: u64,
    /// Paths whose queries are in the stream.
    pub paths_recorded: u64,
    /// Seed of the render.
    pub seed: u64,
    /// Samples per pixel of the render.
    pub spp: u32,
    /// Integrator of the render.
    pub integrator: Integrator,
    /// Number of occluding triangles.
    pub triangles: u64,
    /// CRC-32 of their vertices.
    pub triangles_crc32: u32,
    /// [`vdf_scene::Scene::checksum`] of the scene.
    pub scene_crc32: u32,
    /// Number of emitters.
    pub emitters: u32,
}

/// Queries in the order in which a render of one thread asks them, and the exact answers.
#[derive(Clone, Debug, PartialEq)]
pub struct QueryStream {
    /// Where they come from.
    pub origin: StreamOrigin,
    /// The queries.
    pub queries: Vec<ShadowQuery>,
    /// For each query whether it is unoccluded, as the hierarchy answered when it was recorded.
    pub unoccluded: Vec<bool>,
}

impl QueryStream {
    /// Number of spatial queries in the stream.
    #[must_use]
    pub fn spatial(&self) -> usize {
        self.queries.iter().filter(|q| q.kind == QueryKind::Spatial).count()
    }

    /// N, the number of queries of the whole render, estimated from the paths recorded; exact if they are all.
    #[must_use]
    pub fn estimated_total(&self) -> Option<f64> {
        let o = &self.origin;
        (o.paths_recorded > 0).then(|| self.queries.len() as f64 * (o.paths as f64 / o.paths_recorded as f64))
    }

    /// Writes the stream; the file appears whole or not at all.
    ///
    /// # Errors
    /// What the system says.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        let mut crc = crc32fast::Hasher::new();
        self.records().for_each(|record| crc.update(&record));
        let o = &self.origin;
        write_atomically(path, |out| {
            out.write_all(MAGIC)?;
            out.write_all(&VERSION.to_le_bytes())?;
            out.write_all(&(HEADER as u32).to_le_bytes())?;
            for n in [self.queries.len() as u64, o.paths, o.paths_recorded, o.seed] {
                out.write_all(&n.to_le_bytes())?;
            }
            out.write_all(&o.spp.to_le_bytes())?;
            let samples = match o.integrator.samples_per_segment() {
                None => 0,
                Some(SegmentSamples::Count(n)) => n,
                Some(SegmentSamples::Auto) => AUTO,
            };
            out.write_all(&samples.to_le_bytes())?;
            out.write_all(&o.triangles.to_le_bytes())?;
            for n in [o.triangles_crc32, o.emitters, crc.finalize(), o.scene_crc32] {
                out.write_all(&n.to_le_bytes())?;
            }
            self.records().try_for_each(|record| out.write_all(&record))
        })
    }

    fn records(&self) -> impl Iterator<Item = [u8; QUERY]> + '_ {
        self.queries.iter().zip(&self.unoccluded).map(|(q, &unoccluded)| {
            let mut record = [0; QUERY];
            let (numbers, integers) = record.split_at_mut(48);
            let coordinates = q.from.to_array().into_iter().chain(q.to.to_array());
            for (bytes, x) in numbers.chunks_exact_mut(8).zip(coordinates) {
                bytes.copy_from_slice(&x.to_le_bytes());
            }
            let kind = match q.kind {
                QueryKind::Spatial => SPATIAL,
                QueryKind::OnLight => ON_LIGHT,
                QueryKind::Superficial => 0,
            };
            let flags = kind | if unoccluded { UNOCCLUDED } else { 0 };
            integers[..4].copy_from_slice(&(q.emitter as u32).to_le_bytes());
            integers[4..].copy_from_slice(&flags.to_le_bytes());
            record
        })
    }

    /// Reads a stream that [`QueryStream::write`] wrote.
    ///
    /// # Errors
    /// [`LabError::Queries`] if the file cannot be read or is not such a stream, whole and unchanged.
    pub fn read(path: &Path) -> Result<Self, LabError> {
        let fail = |message: String| LabError::Queries { path: path.to_owned(), message };
        let file = File::open(path).map_err(|e| fail(e.to_string()))?;
        let length = file.metadata().map_err(|e| fail(e.to_string()))?.len();
        Self::decode(path, BufReader::new(file), length)
    }

    /// Decodes a stream of `length` bytes from anywhere. `path` is for messages.
    ///
    /// # Errors
    /// Those of [`QueryStream::read`].
    pub fn decode(path: &Path, mut bytes: impl Read, length: u64) -> Result<Self, LabError> {
        decode(&mut bytes, length).map_err(|message| LabError::Queries { path: path.to_owned(), message })
    }

    /// Checks that the stream was recorded in `prepared`: a light that has moved, or another fog, gives other queries.
    ///
    /// # Errors
    /// [`LabError::Queries`], which names `path` and what differs.
    pub fn check_scene(&self, path: &Path, prepared: &PreparedScene) -> Result<(), LabError> {
        let (o, scene, world) = (&self.origin, prepared.scene(), prepared.world());
        let fail = |message| Err(LabError::Queries { path: path.to_owned(), message });
        let help = "name the scene that it was recorded in, with the same parameters, or record it again";
        if o.triangles != world.triangles.len() as u64 || o.emitters as usize != scene.emitters.len() {
            return fail(format!(
                "recorded in another scene, of {} triangles and {} emitters (here: {} and {}); {help}",
                o.triangles,
                o.emitters,
                world.triangles.len(),
                scene.emitters.len()
            ));
        }
        if o.triangles_crc32 != triangles_crc32(&world.triangles) {
            return fail(format!("recorded in a scene whose triangles lie elsewhere; {help}"));
        }
        if o.scene_crc32 != scene.checksum() {
            return fail(format!(
                "recorded in a scene with the same triangles but other lights, media, materials or camera; {help}"
            ));
        }
        Ok(())
    }
}

/// Decodes a file of `length` bytes; the message of an error says what is wrong.
fn decode(file: &mut impl Read, length: u64) -> Result<QueryStream, String> {
    let mut header = [0; HEADER];
    let read = |e: io::Error| match e.kind() {
        io::ErrorKind::UnexpectedEof => "shorter than a file of queries; record it again".to_owned(),
        _ => e.to_string(),
    };
    file.read_exact(&mut header).map_err(read)?;
    if &header[..8] != MAGIC {
        return Err("not a file of queries; record one".to_owned());
    }
    let u32_at = |i: usize| u32::from_le_bytes([header[i], header[i + 1], header[i + 2], header[i + 3]]);
    let u64_at = |i: usize| u64::from(u32_at(i)) | u64::from(u32_at(i + 4)) << 32;
    let (version, size) = (u32_at(8), u32_at(12) as usize);
    if (version, size) != (VERSION, HEADER) {
        return Err(format!(
            "version {version} of the format with a header of {size} bytes; this program reads version {VERSION} with {HEADER}: record it again"
        ));
    }
    let n = u64_at(16);
    // Before any memory is taken for it.
    if n.checked_mul(QUERY as u64).and_then(|b| b.checked_add(HEADER as u64)) != Some(length) {
        return Err(format!("{length} bytes long, which does not fit {n} queries; record it again"));
    }
    let origin = StreamOrigin {
        paths: u64_at(24),
        paths_recorded: u64_at(32),
        seed: u64_at(40),
        spp: u32_at(48),
        integrator: match u32_at(52) {
            0 => Integrator::Volpath,
            AUTO => Integrator::Raymarch(SegmentSamples::Auto),
            n => Integrator::raymarch(n),
        },
        triangles: u64_at(56),
        triangles_crc32: u32_at(64),
        scene_crc32: u32_at(76),
        emitters: u32_at(68),
    };
    let mut stream = QueryStream { origin, queries: Vec::new(), unoccluded: Vec::new() };
    let mut crc = crc32fast::Hasher::new();
    let mut record = [0; QUERY];
    for i in 0..n {
        file.read_exact(&mut record).map_err(read)?;
        crc.update(&record);
        let (query, unoccluded) =
            query(&record, &origin).ok_or_else(|| format!("query {i} makes no sense; record it again"))?;
        stream.queries.push(query);
        stream.unoccluded.push(unoccluded);
    }
    if crc.finalize() != u32_at(72) {
        return Err("damaged, its checksum is wrong; record it again".to_owned());
    }
    Ok(stream)
}

/// The query of a record and its answer, if it makes sense.
fn query(record: &[u8; QUERY], origin: &StreamOrigin) -> Option<(ShadowQuery, bool)> {
    let (numbers, integers) = record.split_at(48);
    let mut x = [0.0; 6];
    for (x, bytes) in x.iter_mut().zip(numbers.chunks_exact(8)) {
        *x = f64::from_le_bytes(bytes.try_into().ok()?);
    }
    let emitter = u32::from_le_bytes(integers[..4].try_into().ok()?);
    let flags = u32::from_le_bytes(integers[4..].try_into().ok()?);
    let (from, to) = (DVec3::new(x[0], x[1], x[2]), DVec3::new(x[3], x[4], x[5]));
    let kind = match flags & !UNOCCLUDED {
        0 => QueryKind::Superficial,
        SPATIAL => QueryKind::Spatial,
        ON_LIGHT => QueryKind::OnLight,
        _ => return None,
    };
    let sound = from.is_finite() && to.is_finite() && emitter < origin.emitters;
    sound.then_some((ShadowQuery { from, to, emitter: emitter as usize, kind }, flags & UNOCCLUDED != 0))
}

fn triangle_bytes(triangle: &Triangle) -> [u8; 36] {
    let mut bytes = [0; 36];
    let coordinates = triangle.vertices.iter().flat_map(|v| v.to_array());
    for (bytes, x) in bytes.chunks_exact_mut(4).zip(coordinates) {
        bytes.copy_from_slice(&x.to_le_bytes());
    }
    bytes
}

/// CRC-32 of the triangles as they are in the file of [`write_triangles`].
pub(super) fn triangles_crc32(triangles: &[Triangle]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    triangles.iter().for_each(|t| crc.update(&triangle_bytes(t)));
    crc.finalize()
}

/// Writes triangles for other programs, little-endian: `VDFTRIAN`, u32 version 2, u32 size of this header 32, u64
/// number of triangles, u32 CRC-32 of all that follows the header, u32 0; then nine f32 each, the coordinates of three
/// vertices. They are the exact geometry that the answers of a [`QueryStream`] are about. The file appears whole or not
/// at all.
///
/// # Errors
/// What the system says.
pub fn write_triangles(path: &Path, triangles: &[Triangle]) -> io::Result<()> {
    write_atomically(path, |out| {
        out.write_all(TRIANGLES_MAGIC)?;
        for n in [TRIANGLES_VERSION, 32] {
            out.write_all(&n.to_le_bytes())?;
        }
        out.write_all(&(triangles.len() as u64).to_le_bytes())?;
        for n in [triangles_crc32(triangles), 0] {
            out.write_all(&n.to_le_bytes())?;
        }
        triangles.iter().try_for_each(|t| out.write_all(&triangle_bytes(t)))
    })
}
