//! The film: sums of samples that can be cut and put together again.
//!
//! *Idea.* Floating-point addition is not associative, so a pixel's mean depends on the order of its samples. Here that order is a tree: a
//! block of 2ᵏ samples whose first number is a multiple of 2ᵏ is the sum of its two halves, and a pixel is the sum of the largest such blocks
//! that make up its samples, from the first to the last.
//!
//! *Guarantee.* The image has the same bytes however the samples are divided between threads, passes or machines: every division consists of
//! blocks of the same tree. Tiles are independent, so that one film may have more samples in some than in others: a checkpoint between two
//! tiles, or a machine's share of the tiles.
//!
//! *Cost.* 8 bytes for each sum of a pixel (three without layers) and each of its blocks, of which there are at most two for each power of two
//! in the number of samples, and one after 2ᵏ samples. A copy shares all sums with its original.

mod blocks;
mod file;
mod layers;
mod noise;
mod origin;

use std::{ops::Range, sync::Arc};

use vdf_image::{Channel, Image};
use vdf_scene::{PixelRect, Rgb};
use vdf_visibility::Counters;

use self::blocks::BlockId;
pub(crate) use self::blocks::PixelSum;
pub(crate) use self::layers::{Feature, LayerSums};
pub(crate) use self::noise::layers_of_noise;
pub use self::{
    file::FilmFileError,
    layers::{Layer, Layers, UnknownLayer},
    noise::{NoNoiseLimit, NoiseLimit},
    origin::{FilmOrigin, FilmRun, Picture},
};
use crate::{FilmPart, RenderError};

/// Side of a tile in pixels.
pub(crate) const TILE: u32 = 16;

/// Sums of some samples of every pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    origin: FilmOrigin,
    picture: Picture,
    /// Row by row.
    tiles: Vec<FilmTile>,
    counters: Counters,
    runs: Vec<FilmRun>,
}

/// The sums of one tile: for each block those of all pixels, row by row, one after the other for each pixel. In the order of the samples.
#[derive(Clone, Debug, Default, PartialEq)]
struct FilmTile {
    blocks: Vec<(BlockId, Arc<[f64]>)>,
}

/// Why two films cannot be merged, or a film is not complete.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FilmError {
    /// They are of different renders.
    #[error("the films are of different renders: {field} differs, {one} and {other}")]
    Stranger {
        /// What differs.
        field: &'static str,
        /// Its value in the one film.
        one: String,
        /// Its value in the other.
        other: String,
    },
    /// Both have some of these samples.
    #[error("both films have the samples {} to {} of {tiles} tiles", samples.start, samples.end - 1)]
    Overlap {
        /// The samples that both have in the first such tile.
        samples: Range<u64>,
        /// In how many tiles there are such samples.
        tiles: usize,
    },
    /// Some samples are missing.
    #[error("the film lacks {}", missing.iter().map(ToString::to_string).collect::<Vec<_>>().join(", and "))]
    Missing {
        /// Which, with one entry for each range.
        missing: Vec<MissingSamples>,
    },
    /// There is no memory for the image.
    #[error("an image of {} x {} pixels does not fit into memory", size[0], size[1])]
    Memory {
        /// Width and height in pixels.
        size: [u32; 2],
    },
}

/// Samples that some tiles lack.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissingSamples {
    /// Their numbers.
    pub samples: Range<u64>,
    /// How many tiles lack them.
    pub tiles: usize,
    /// Of how many.
    pub of: usize,
}

impl std::fmt::Display for MissingSamples {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.samples.start, self.samples.end - 1) {
            (first, last) if first == last => write!(f, "sample {first}")?,
            (first, last) => write!(f, "samples {first} to {last}")?,
        }
        if self.tiles < self.of { write!(f, " of {} of {} tiles", self.tiles, self.of) } else { Ok(()) }
    }
}

impl FilmTile {
    /// The ranges of samples, in order; ranges that follow each other are one.
    fn samples(&self) -> Vec<Range<u64>> {
        let mut ranges: Vec<Range<u64>> = Vec::new();
        for (id, _) in &self.blocks {
            let samples = id.samples();
            match ranges.last_mut() {
                Some(last) if last.end == samples.start => last.end = samples.end,
                _ => ranges.push(samples),
            }
        }
        ranges
    }

    /// The parts of `wanted` that are not here.
    fn missing(&self, wanted: Range<u64>) -> Vec<Range<u64>> {
        let (mut missing, mut at) = (Vec::new(), wanted.start);
        for have in self.samples() {
            if have.start.min(wanted.end) > at {
                missing.push(at..have.start.min(wanted.end));
            }
            at = at.max(have.end);
        }
        if at < wanted.end {
            missing.push(at..wanted.end);
        }
        missing
    }

    fn overlap(&self, other: &Self) -> Option<Range<u64>> {
        let theirs = other.samples();
        self.samples().into_iter().find_map(|a| {
            theirs.iter().map(|b| a.start.max(b.start)..a.end.min(b.end)).find(|common| common.start < common.end)
        })
    }

    /// Adds blocks that have no sample in common with those here.
    fn add(&mut self, blocks: impl IntoIterator<Item = (BlockId, Arc<[f64]>)>) {
        self.blocks.extend(blocks);
        self.blocks.sort_by_key(|(id, _)| id.samples().start);
        let mut joined: Vec<(BlockId, Arc<[f64]>)> = Vec::with_capacity(self.blocks.len());
        for (mut id, mut sums) in self.blocks.drain(..) {
            while let Some((left, _)) = joined.last()
                && let Some(parent) = left.parent_with(id)
                && let Some((_, left_sums)) = joined.pop()
            {
                sums = left_sums.iter().zip(&*sums).map(|(left, right)| left + right).collect();
                id = parent;
            }
            joined.push((id, sums));
        }
        self.blocks = joined;
    }

    fn count(&self) -> u64 {
        self.blocks.iter().map(|(id, _)| 1 << id.level).sum()
    }
}

/// What some samples of the pixels of a tile add up to.
#[derive(Debug)]
pub(crate) struct TileSums {
    blocks: Vec<(BlockId, Vec<f64>)>,
}

impl TileSums {
    pub(crate) const fn new() -> Self {
        Self { blocks: Vec::new() }
    }

    /// Adds the next pixel, all of which must have the same samples. `write` appends the numbers that the film keeps of a sum.
    pub(crate) fn push<V: Copy>(&mut self, pixels: usize, sum: &PixelSum<V>, write: impl Fn(V, &mut Vec<f64>)) {
        for (at, (id, value)) in sum.blocks.iter().enumerate() {
            if self.blocks.len() == at {
                self.blocks.push((*id, Vec::with_capacity(3 * pixels)));
            }
            write(*value, &mut self.blocks[at].1);
        }
    }
}

impl Film {
    /// A film without samples.
    ///
    /// # Errors
    /// [`RenderError::Film`] if there is no memory for the sums of its pixels.
    pub(crate) fn new(origin: FilmOrigin, picture: Picture) -> Result<Self, RenderError> {
        let PixelRect { x0, y0, x1, y1 } = origin.crop;
        let (width, height) = (x1 - x0, y1 - y0);
        // Tried now, so that a film that does not fit is told at once and not after an hour.
        let sums = u64::from(width) * u64::from(height) * origin.sums_per_pixel() as u64;
        let mut room: Vec<f64> = Vec::new();
        if usize::try_from(sums).ok().and_then(|sums| room.try_reserve_exact(sums).ok()).is_none() {
            let bytes = sums.saturating_mul(8);
            return Err(RenderError::Film(vdf_image::ImageError::Memory { width, height, bytes }));
        }
        let tiles = vec![FilmTile::default(); tile_count(origin.crop)];
        Ok(Self { origin, picture, tiles, counters: Counters::default(), runs: Vec::new() })
    }

    /// What the samples are samples of.
    #[must_use]
    pub const fn origin(&self) -> &FilmOrigin {
        &self.origin
    }

    /// What a file of the picture says beside its pixels.
    #[must_use]
    pub const fn picture(&self) -> &Picture {
        &self.picture
    }

    /// The runs of the program that made the samples.
    #[must_use]
    pub fn runs(&self) -> &[FilmRun] {
        &self.runs
    }

    /// Remembers a run, and what it took until now.
    pub fn set_run(&mut self, number: usize, run: FilmRun) {
        self.runs.truncate(number);
        self.runs.push(run);
    }

    /// Takes the film as a part of a render of so many samples per pixel: a longer one than it was begun for, say.
    #[must_use]
    pub fn of_spp(mut self, spp: u32) -> Self {
        self.origin.spp = spp;
        self
    }

    /// Takes the film as a part of a render to another limit of noise. Of a render without one it has no sums that tell noise.
    #[must_use]
    pub fn of_noise(mut self, limit: NoiseLimit) -> Self {
        self.origin.noise = self.origin.noise.map(|_| limit);
        self
    }

    /// How the queries of all samples were answered.
    #[must_use]
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Number of tiles: squares of 16 pixels from the top left corner of the crop, row by row, cut at its edges.
    #[must_use]
    pub const fn tiles(&self) -> usize {
        self.tiles.len()
    }

    /// The parts of the samples `wanted` that tile `tile` has not yet. With a limit of noise only those up to where the tile is judged next, and
    /// none if it is quiet.
    #[must_use]
    pub fn missing_of_tile(&self, tile: usize, wanted: Range<u32>) -> Vec<Range<u64>> {
        let tile = &self.tiles[tile];
        tile.missing(self.before_next_look(tile, wanted.start.into()..wanted.end.into()))
    }

    /// The end of the samples that any tile has; 0 if none has any.
    #[must_use]
    pub fn samples_end(&self) -> u64 {
        self.tiles.iter().filter_map(|t| t.blocks.last()).map(|(id, _)| id.samples().end).max().unwrap_or(0)
    }

    /// Up to which sample all tiles of `part` are complete.
    #[must_use]
    pub fn complete_until(&self, part: &FilmPart) -> u32 {
        let ends = (0..self.tiles.len()).filter(|&tile| part.has_tile(tile)).map(|tile| {
            let missing = self.missing_of_tile(tile, part.samples.clone());
            missing.first().map_or(part.samples.end, |first| first.start as u32)
        });
        ends.min().unwrap_or(part.samples.end)
    }

    /// How many samples of `part` are not here: pixels times samples. With a limit of noise those that the next looks need, at least.
    #[must_use]
    pub fn missing_samples(&self, part: &FilmPart) -> u64 {
        let tiles = tile_rects(self.origin.crop).enumerate().filter(|(tile, _)| part.has_tile(*tile));
        let missing = tiles.map(|(tile, rect)| {
            let samples = self.missing_of_tile(tile, part.samples.clone()).into_iter().map(|r| r.end - r.start);
            samples.sum::<u64>() * area(rect)
        });
        missing.sum()
    }

    /// The samples that all tiles have together: pixels times samples.
    #[must_use]
    pub fn total_samples(&self) -> u64 {
        tile_rects(self.origin.crop).map(area).zip(&self.tiles).map(|(area, tile)| area * tile.count()).sum()
    }

    /// The ranges of samples that every pixel has, in order.
    #[must_use]
    pub fn samples(&self) -> Vec<Range<u64>> {
        let Some((first, rest)) = self.tiles.split_first() else { return Vec::new() };
        rest.iter().fold(first.samples(), |common, tile| {
            let theirs = tile.samples();
            let both = common.iter().flat_map(|a| theirs.iter().map(|b| a.start.max(b.start)..a.end.min(b.end)));
            both.filter(|r| r.start < r.end).collect()
        })
    }

    /// What is missing of the samples `wanted`, range by range.
    #[must_use]
    pub fn missing(&self, wanted: Range<u32>) -> Vec<MissingSamples> {
        let mut missing: Vec<MissingSamples> = Vec::new();
        let of = self.tiles.len();
        for tile in 0..of {
            for samples in self.missing_of_tile(tile, wanted.clone()) {
                match missing.iter_mut().find(|m| m.samples == samples) {
                    Some(known) => known.tiles += 1,
                    None => missing.push(MissingSamples { samples, tiles: 1, of }),
                }
            }
        }
        missing.sort_by_key(|m| (m.samples.start, m.samples.end));
        missing
    }

    pub(crate) fn add_tile(&mut self, tile: usize, sums: TileSums, counters: &Counters) {
        self.tiles[tile].add(sums.blocks.into_iter().map(|(id, sums)| (id, sums.into())));
        self.counters += *counters;
    }

    /// Whether all samples of `other` are already here.
    #[must_use]
    pub fn contains(&self, other: &Self) -> bool {
        self.tiles.iter().zip(&other.tiles).all(|(a, b)| b.samples().into_iter().all(|r| a.missing(r).is_empty()))
    }

    /// Adds the samples of `other`. The result does not depend on the order in which films are merged, but for the order of [`Film::runs`].
    ///
    /// # Errors
    /// If the films are of different renders or have a sample in common; then this film is unchanged.
    pub fn merge(&mut self, other: Self) -> Result<(), FilmError> {
        self.origin.check_same_render(&other.origin)?;
        let mut overlaps = self.tiles.iter().zip(&other.tiles).filter_map(|(a, b)| a.overlap(b));
        if let Some(samples) = overlaps.next() {
            return Err(FilmError::Overlap { samples, tiles: 1 + overlaps.count() });
        }
        for (tile, new) in self.tiles.iter_mut().zip(other.tiles) {
            tile.add(new.blocks);
        }
        self.counters += other.counters;
        self.runs.extend(other.runs);
        Ok(())
    }

    /// The image: the mean of the samples of each pixel.
    ///
    /// # Errors
    /// If the samples are not all those from 0 to some number, the same for all tiles but those that are quiet; or if there is no memory.
    pub fn develop(&self) -> Result<Image, FilmError> {
        let missing = self.missing(0..u32::try_from(self.samples_end().max(1)).unwrap_or(u32::MAX));
        if missing.is_empty() { self.develop_so_far() } else { Err(FilmError::Missing { missing }) }
    }

    /// The image so far: each pixel is the mean of the samples that it has, and black if it has none.
    ///
    /// # Errors
    /// If there is no memory.
    pub fn develop_so_far(&self) -> Result<Image, FilmError> {
        let FilmOrigin { full_size, crop, .. } = self.origin;
        let size = [crop.x1 - crop.x0, crop.y1 - crop.y0];
        let mut image =
            Image::try_cropped(full_size, [crop.x0, crop.y0], size).map_err(|_| FilmError::Memory { size })?;
        self.each_pixel(|at, n, sums| {
            let [r, g, b] = [0, 1, 2].map(|i| (sums[i] / n) as f32);
            image.pixels[at] = Rgb::new(r, g, b);
        });
        Ok(image)
    }

    /// The channels of the layers, such as `normal.X`; none if there are no layers. Pixels without samples are 0.
    #[must_use]
    pub fn develop_layers(&self) -> Vec<Channel> {
        let FilmOrigin { crop, layers, .. } = self.origin;
        let sums = LayerSums::new(layers);
        let mut channels = sums.channels(area(crop) as usize);
        if !channels.is_empty() {
            self.each_pixel(|at, n, kept| sums.develop(at, n, kept, &mut channels));
        }
        channels
    }

    /// Calls `pixel` with the number of each pixel that has samples, their number and their sums.
    fn each_pixel(&self, mut pixel: impl FnMut(usize, f64, &[f64])) {
        let crop = self.origin.crop;
        let (width, stride) = ((crop.x1 - crop.x0) as usize, self.origin.sums_per_pixel());
        let mut sums = vec![0.0; stride];
        for (rect, tile) in tile_rects(crop).zip(&self.tiles).filter(|(_, tile)| !tile.blocks.is_empty()) {
            let n = tile.count() as f64;
            for (i, (x, y)) in pixels(rect).enumerate() {
                sums.fill(0.0);
                for (_, block) in &tile.blocks {
                    sums.iter_mut().zip(&block[i * stride..]).for_each(|(total, sum)| *total += sum);
                }
                pixel((y - crop.y0) as usize * width + (x - crop.x0) as usize, n, &sums);
            }
        }
    }
}

/// The tiles of a rectangle, row by row.
pub(crate) fn tile_rects(rect: PixelRect) -> impl Iterator<Item = PixelRect> {
    let PixelRect { x0, y0, x1, y1 } = rect;
    // Not by `step_by`: the next corner may not have a 32-bit number.
    let starts = |from: u32, to: u32| (0..(to - from).div_ceil(TILE)).map(move |i| from + i * TILE);
    starts(y0, y1).flat_map(move |y| starts(x0, x1).map(move |x| (x, y))).map(move |(x, y)| PixelRect {
        x0: x,
        y0: y,
        x1: x + TILE.min(x1 - x),
        y1: y + TILE.min(y1 - y),
    })
}

fn area(r: PixelRect) -> u64 {
    u64::from(r.x1 - r.x0) * u64::from(r.y1 - r.y0)
}

fn tile_count(rect: PixelRect) -> usize {
    (rect.x1 - rect.x0).div_ceil(TILE) as usize * (rect.y1 - rect.y0).div_ceil(TILE) as usize
}

/// The pixels of a rectangle, row by row.
pub(crate) fn pixels(r: PixelRect) -> impl Iterator<Item = (u32, u32)> {
    (r.y0..r.y1).flat_map(move |y| (r.x0..r.x1).map(move |x| (x, y)))
}

#[cfg(test)]
mod tests;
