//! Films in files: checkpoints and shards. The format, version 1, is described byte by byte in `docs/long-renders.md`.
//!
//! A header in JSON, and for each tile its blocks; each part has a checksum of its own, so that a flipped bit is found, and told where.

use std::{
    fs::File,
    io::{self, BufReader, Read, Write},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use vdf_image::{StagedFile, shown};
use vdf_scene::PixelRect;
use vdf_visibility::Counters;

use super::{Film, FilmOrigin, FilmRun, FilmTile, Picture, blocks::BlockId, tile_count, tile_rects};

const MAGIC: &[u8; 8] = b"VDFFILM\n";
const VERSION: u32 = 1;
/// A header has some kilobytes.
const LONGEST_HEADER: u32 = 16 << 20;
/// There are at most two blocks for each power of two.
const MOST_BLOCKS: u32 = 66;

/// Why a film could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FilmFileError {
    /// The system refused to write.
    #[error("cannot write {}", shown(path))]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The system refused to read.
    #[error("cannot read {}", shown(path))]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file is no film, or a damaged one.
    #[error("cannot read {}: {reason}", shown(path))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

#[derive(Serialize, Deserialize)]
struct Header {
    origin: FilmOrigin,
    picture: Picture,
    counters: Counts,
    runs: Vec<FilmRun>,
}

/// [`Counters`], in the order that `counts!` gives them.
#[derive(Serialize, Deserialize)]
struct Counts([u64; 14]);

macro_rules! counts {
    ($($counter:ident),*) => {
        impl From<&Counters> for Counts {
            fn from(counters: &Counters) -> Self {
                // No `..`: who adds a counter has to add it here.
                let &Counters { $($counter),* } = counters;
                Self([$($counter),*])
            }
        }

        impl From<Counts> for Counters {
            fn from(Counts([$($counter),*]): Counts) -> Self {
                Self { $($counter),* }
            }
        }
    };
}

counts!(
    queries,
    spatial,
    proved,
    on_light,
    on_light_proved,
    superficial_proved,
    proved_occluded,
    rays,
    flights,
    flights_proved,
    lit_segments,
    connections,
    paths,
    refused
);

impl Film {
    /// Writes the film. The file appears whole or not at all; an older one stays until then.
    ///
    /// # Errors
    /// [`FilmFileError::Write`] with what the system says.
    pub fn write(&self, path: &Path) -> Result<(), FilmFileError> {
        let failed = |source| FilmFileError::Write { path: path.to_owned(), source };
        self.stage(path)?.persist().map_err(failed)
    }

    /// As [`Film::write`], but the file does not appear before [`StagedFile::persist`].
    ///
    /// # Errors
    /// As [`Film::write`].
    pub fn stage(&self, path: &Path) -> Result<StagedFile, FilmFileError> {
        StagedFile::write(path, |out| self.encode(out))
            .map_err(|source| FilmFileError::Write { path: path.to_owned(), source })
    }

    /// Writes what [`Film::decode`] reads to anywhere.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn encode(&self, out: &mut dyn Write) -> io::Result<()> {
        let header = Header {
            origin: self.origin.clone(),
            picture: self.picture.clone(),
            counters: (&self.counters).into(),
            runs: self.runs.clone(),
        };
        let json = serde_json::to_vec(&header)?;
        let length = u32::try_from(json.len()).map_err(io::Error::other)?;
        let start = [MAGIC.as_slice(), &VERSION.to_le_bytes(), &length.to_le_bytes(), &json].concat();
        out.write_all(&start)?;
        out.write_all(&crc32fast::hash(&start).to_le_bytes())?;
        let mut record = Vec::new();
        for tile in &self.tiles {
            record.clear();
            record.extend((tile.blocks.len() as u32).to_le_bytes());
            for (id, sums) in &tile.blocks {
                record.extend([id.level, id.index].into_iter().flat_map(u32::to_le_bytes));
                record.extend(sums.iter().flat_map(|sum| sum.to_le_bytes()));
            }
            out.write_all(&record)?;
            out.write_all(&crc32fast::hash(&record).to_le_bytes())?;
        }
        Ok(())
    }

    /// Reads a film that [`Film::write`] wrote.
    ///
    /// # Errors
    /// [`FilmFileError`], if the file cannot be read or is not such a film, whole and unchanged.
    pub fn read(path: &Path) -> Result<Self, FilmFileError> {
        let failed = |source| FilmFileError::Read { path: path.to_owned(), source };
        // A pipe would wait for whoever writes to it.
        if !path.metadata().map_err(failed)?.is_file() {
            return Err(failed(io::Error::new(io::ErrorKind::InvalidInput, "it is not a plain file")));
        }
        let file = File::open(path).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        Self::decode(path, BufReader::new(file), length)
    }

    /// Decodes a film of `length` bytes from anywhere. `path` is for messages. What a file only claims takes no memory.
    ///
    /// # Errors
    /// Those of [`Film::read`].
    pub fn decode(path: &Path, bytes: impl Read, length: u64) -> Result<Self, FilmFileError> {
        let mut from = Source { bytes, left: length, crc: crc32fast::Hasher::new() };
        decode(&mut from, length).map_err(|failure| match failure {
            Failure::System(source) => FilmFileError::Read { path: path.to_owned(), source },
            Failure::Damaged(reason) => FilmFileError::Damaged { path: path.to_owned(), reason },
        })
    }
}

enum Failure {
    System(io::Error),
    Damaged(String),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::UnexpectedEof { truncated() } else { Self::System(error) }
    }
}

fn damaged(reason: impl Into<String>) -> Failure {
    Failure::Damaged(reason.into())
}

fn truncated() -> Failure {
    damaged("the file is cut off")
}

/// Bytes with the checksum of those read so far.
struct Source<R> {
    bytes: R,
    left: u64,
    crc: crc32fast::Hasher,
}

impl<R: Read> Source<R> {
    fn fill(&mut self, buffer: &mut [u8]) -> Result<(), Failure> {
        self.left = self.left.checked_sub(buffer.len() as u64).ok_or_else(truncated)?;
        self.bytes.read_exact(buffer)?;
        self.crc.update(buffer);
        Ok(())
    }

    fn take(&mut self, length: usize) -> Result<Vec<u8>, Failure> {
        if length as u64 > self.left {
            return Err(truncated());
        }
        let mut buffer = vec![0; length];
        self.fill(&mut buffer)?;
        Ok(buffer)
    }

    fn word(&mut self) -> Result<u32, Failure> {
        let mut word = [0; 4];
        self.fill(&mut word)?;
        Ok(u32::from_le_bytes(word))
    }

    /// Compares the checksum of all since the last one with that in the file.
    #[allow(unexpected_cfgs, reason = "cargo-fuzz sets it")]
    fn check(&mut self, what: &str) -> Result<(), Failure> {
        let computed = std::mem::take(&mut self.crc).finalize();
        let stored = self.word()?;
        self.crc = crc32fast::Hasher::new();
        // Nobody guesses a checksum: with it no fuzzer would come further.
        if stored == computed || cfg!(fuzzing) {
            return Ok(());
        }
        Err(damaged(format!("{what} is damaged: its checksum is {computed:08x} and should be {stored:08x}")))
    }
}

fn decode(from: &mut Source<impl Read>, length: u64) -> Result<Film, Failure> {
    let mut magic = [0; 8];
    if length < 8 {
        return Err(damaged("it is no film of vdf"));
    }
    from.fill(&mut magic)?;
    if magic != *MAGIC {
        return Err(damaged("it is no film of vdf"));
    }
    let version = from.word()?;
    if version != VERSION {
        return Err(damaged(format!(
            "it has version {version} of the format, and this program reads version {VERSION}"
        )));
    }
    let header_length = from.word()?;
    if header_length > LONGEST_HEADER {
        return Err(damaged(format!("its header claims to have {header_length} bytes")));
    }
    let json = from.take(header_length as usize)?;
    from.check("its header")?;
    let header: Header = serde_json::from_slice(&json).map_err(|e| damaged(format!("its header: {e}")))?;
    let Header { origin, picture, counters, runs } = header;
    let PixelRect { x1, y1, .. } = origin.crop;
    if x1 > origin.full_size[0] || y1 > origin.full_size[1] {
        return Err(damaged("its header: the crop is larger than the film"));
    }
    let count = tile_count(origin.crop);
    // Each tile has at least the number of its blocks and a checksum.
    if from.left / 8 < count as u64 {
        return Err(truncated());
    }
    let mut tiles = Vec::with_capacity(count);
    for rect in tile_rects(origin.crop) {
        let sums = rect_area(rect) * origin.sums_per_pixel();
        tiles.push(decode_tile(from, sums, tiles.len())?);
    }
    if from.left > 0 {
        return Err(damaged(format!("{} bytes follow its end", from.left)));
    }
    Ok(Film { origin, picture, tiles, counters: counters.into(), runs })
}

fn decode_tile(from: &mut Source<impl Read>, sums: usize, number: usize) -> Result<FilmTile, Failure> {
    let what = format!("its tile {number}");
    let blocks = from.word()?;
    if blocks > MOST_BLOCKS {
        return Err(damaged(format!("{what} is damaged: it claims to have {blocks} blocks")));
    }
    let mut tile = FilmTile::default();
    for _ in 0..blocks {
        let (level, index) = (from.word()?, from.word()?);
        let bytes = from.take(sums * 8)?;
        let id = BlockId::checked(level, index).ok_or_else(|| damaged(format!("{what} is damaged")))?;
        let after = tile.blocks.last().map_or(0, |(last, _)| last.samples().end);
        if id.samples().start < after {
            return Err(damaged(format!("{what} is damaged: its blocks are not in order")));
        }
        tile.blocks.push((id, bytes.as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b)).collect()));
    }
    from.check(&what)?;
    Ok(tile)
}

fn rect_area(rect: PixelRect) -> usize {
    (rect.x1 - rect.x0) as usize * (rect.y1 - rect.y0) as usize
}
