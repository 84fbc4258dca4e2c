//! A light buffer: a cube map around a point light that knows which triangles can block the way to it \[Haines1986\].
//!
//! *Idea.* Each texel stands for a pyramid of directions. It keeps the depth before which nothing is met in any of them, the depth beyond which
//! something is met in all of them, and the triangles that decide in between, nearest first. A query is a division, a load and
//! two comparisons; where these leave it open, a few triangles are tested.
//!
//! *Definition.* Depth is the largest component of the difference of point and light; with it the point's place on its face of the cube
//! (`frame`). A triangle is a `cone` of directions and a plane. What certainly lies in front is a single triangle that covers a
//! texel, or a sheet of several (`sheets`). A triangle is decided by its `record`. `build` makes all of it.
//!
//! *Guarantee.* An answer other than [`Answer::Unknown`] is exact: "unoccluded" if no triangle meets the closed segment, "occluded" if one
//! does. Unlike proofs from voxels this is so for points on surfaces, too. *Departure from \[Haines1986\]:* there the lists are of all
//! objects in the pyramid, from the near to the far; nothing bounds depths.
//!
//! *Cost.* Some 10 ns where comparisons decide, 20 to 60 ns where triangles are tested. 8 bytes a texel, 8 bytes an entry of a list, 64
//! bytes a triangle that occurs.
//!
//! *Limits.* A light on an occluder has no buffer: every closed segment to it is blocked. Nor has one that is a thousand times as far away
//! as the geometry is large. The hierarchy decides what is too close for the rounding of a record.

mod batch;
mod build;
mod cone;
mod frame;
mod record;
mod sheets;
#[cfg(test)]
mod tests;

use glam::DVec3;

pub(in crate::prover) use self::batch::LANES;
use self::{
    build::{PARTS, TILE_TEXELS},
    frame::{DepthCode, Face, NEVER, TILE, Window},
    record::{Record, Verdict},
};
use super::Answer;

/// The buffer of one point light.
#[derive(Clone, Debug, PartialEq)]
pub struct LightBuffer {
    position: DVec3,
    windows: [Window; 6],
    depths: DepthCode,
    /// Tile by tile; then the parts of texels that are divided.
    texels: Vec<Texel>,
    entries: Vec<Entry>,
    records: Vec<Record>,
}

/// Why a light has no buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It lies on an occluder.
    OnOccluder,
    /// It is so far away that its texels cannot tell the triangles apart.
    FarAway,
    /// The buffer would take more memory than is allowed.
    Memory,
    /// It, or a vertex, is not finite.
    NotFinite,
}

impl Refusal {
    /// The reason, in the words of the statistics.
    #[must_use]
    pub const fn reason(self) -> &'static str {
        match self {
            Self::OnOccluder => "it lies on an occluder, which blocks every way to it",
            Self::FarAway => "it is too far away for a light buffer",
            Self::Memory => "its light buffer does not fit into the limit of memory",
            Self::NotFinite => "it, or a vertex, is not finite",
        }
    }
}

/// How a query was answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LookUp {
    /// The answer.
    pub answer: Answer,
    /// Triangles that were tested; 0 if comparisons decided.
    pub tests: u32,
}

/// What is known of a pyramid of directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Texel {
    /// A query with a lower code meets nothing.
    lit: u16,
    /// A query with this code or a higher one is occluded.
    occluded: u16,
    tag: Tag,
}

impl Texel {
    const EMPTY: Self = Self { lit: NEVER, occluded: NEVER, tag: Tag(0) };
}

/// What decides the other queries: two bits of kind and a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Tag(u32);

impl Tag {
    /// There must not be more triangles, entries or texels.
    const MOST: usize = Self::NUMBER as usize;
    const NUMBER: u32 = (1 << 30) - 1;
    const LIST: u32 = 0;
    const SINGLE: u32 = 1;

    /// The list that starts at this entry.
    const fn list(first: usize) -> Self {
        Self(first as u32)
    }

    /// One triangle.
    const fn single(number: u32) -> Self {
        Self((Self::SINGLE << 30) | number)
    }

    /// The parts that start at this texel.
    const fn parts(first: usize) -> Self {
        Self((2 << 30) | first as u32)
    }

    #[inline]
    const fn kind(self) -> u32 {
        self.0 >> 30
    }

    #[inline]
    const fn number(self) -> usize {
        (self.0 & Self::NUMBER) as usize
    }

    fn as_single(self) -> Option<u32> {
        (self.kind() == Self::SINGLE).then_some(self.number() as u32)
    }

    /// The same after the tile got its place among all.
    fn moved(self, record_of: &[u32], part: usize, entry: usize) -> Self {
        match self.kind() {
            Self::LIST => Self::list(self.number() + entry),
            Self::SINGLE => Self::single(record_of[self.number()]),
            _ => Self::parts(self.number() + part),
        }
    }
}

/// A triangle in a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Entry {
    /// Number of its record.
    triangle: u32,
    /// A query with a lower code is in front of it.
    nearest: u16,
    /// 1 at the end of the list.
    last: u16,
}

/// A query's place: what comparisons and tests need of it.
#[derive(Clone, Copy, Debug)]
struct Place {
    d: DVec3,
    w: f64,
    inverse_w: f64,
    /// Where in the texel, from 0 to 1.
    x: f64,
    y: f64,
    texel: usize,
    code: u16,
}

impl LightBuffer {
    /// Where the light is.
    #[must_use]
    pub const fn position(&self) -> DVec3 {
        self.position
    }

    /// Texels along each side of a face.
    #[must_use]
    pub fn side(&self) -> u32 {
        self.windows.iter().map(Window::side).max().unwrap_or(0)
    }

    /// Bytes of the texels of six faces with `side` texels along each side.
    pub(crate) const fn texel_bytes(side: u32) -> u64 {
        6 * side as u64 * side as u64 * size_of::<Texel>() as u64
    }

    /// Its memory in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.texels[..]) + size_of_val(&self.entries[..]) + size_of_val(&self.records[..])
    }

    /// What is known of the closed segment from `from` to the light. Never wrong.
    #[inline]
    #[must_use]
    pub fn answer(&self, from: DVec3) -> Answer {
        self.look_up(from).answer
    }

    /// The same, and how it was found.
    #[inline]
    #[must_use]
    pub fn look_up(&self, from: DVec3) -> LookUp {
        match self.place(from) {
            Ok(place) => self.decide(&place, self.texels[place.texel]),
            Err(answer) => LookUp { answer, tests: 0 },
        }
    }

    /// The place of a query, or its answer if it has none.
    #[inline(always)]
    fn place(&self, from: DVec3) -> Result<Place, Answer> {
        let d = from - self.position;
        let face = Face::of(d);
        let [u, v, w] = face.magnitudes(d);
        // The light itself, and what is no number.
        if !(w > 0.0 && d.is_finite()) {
            return Err(Answer::Unknown);
        }
        let window = &self.windows[face.index()];
        let inverse_w = w.recip();
        let Some(([i, j], [x, y])) = window.place(u * inverse_w, v * inverse_w) else { return Err(Answer::Unoccluded) };
        let tile = (j / TILE) * (window.side() / TILE) + i / TILE;
        let texel = window.first as usize + tile as usize * TILE_TEXELS + Self::place_in_tile(i, j);
        Ok(Place { d, w, inverse_w, x, y, texel, code: self.depths.of(w) })
    }

    /// The number of a texel in its tile: squares of 8 × 8, row by row.
    #[inline]
    const fn place_in_tile(x: u32, y: u32) -> usize {
        ((((y >> 3) & 7) << 9) | (((x >> 3) & 7) << 6) | ((y & 7) << 3) | (x & 7)) as usize
    }

    /// The answer at a place.
    #[inline]
    fn decide(&self, place: &Place, texel: Texel) -> LookUp {
        if place.code < texel.lit {
            LookUp { answer: Answer::Unoccluded, tests: 0 }
        } else if place.code >= texel.occluded {
            LookUp { answer: Answer::Occluded, tests: 0 }
        } else {
            self.test(place, texel.tag)
        }
    }

    /// The answer by the triangles that may decide.
    #[inline]
    fn test(&self, place: &Place, tag: Tag) -> LookUp {
        #[allow(clippy::cast_possible_truncation, reason = "`Record` covers the rounding")]
        let x = (place.d * place.inverse_w).as_vec3();
        let (tests, verdict) = match tag.kind() {
            Tag::SINGLE => (1, self.records[tag.number()].test(place.d, x, place.w)),
            Tag::LIST => {
                let (mut tests, mut found) = (0, Verdict::Passes);
                for entry in &self.entries[tag.number()..] {
                    if place.code < entry.nearest {
                        break;
                    }
                    tests += 1;
                    match self.records[entry.triangle as usize].test(place.d, x, place.w) {
                        Verdict::Passes => {}
                        Verdict::Close => found = Verdict::Close,
                        Verdict::Blocks => {
                            found = Verdict::Blocks;
                            break;
                        }
                    }
                    if entry.last == 1 {
                        break;
                    }
                }
                (tests, found)
            }
            _ => return self.decide_part(place, tag.number()),
        };
        let answer = match verdict {
            Verdict::Passes => Answer::Unoccluded,
            Verdict::Blocks => Answer::Occluded,
            Verdict::Close => Answer::Unknown,
        };
        LookUp { answer, tests }
    }

    /// The answer in the part of a divided texel, whose parts start at `first`.
    #[cold]
    fn decide_part(&self, place: &Place, first: usize) -> LookUp {
        let parts = f64::from(PARTS);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to the number of parts")]
        let part = |at: f64| {
            let part = ((at * parts) as u32).min(PARTS - 1);
            (part as usize, at * parts - f64::from(part))
        };
        let ((i, x), (j, y)) = (part(place.x), part(place.y));
        self.decide(&Place { x, y, ..*place }, self.texels[first + j * PARTS as usize + i])
    }
}
