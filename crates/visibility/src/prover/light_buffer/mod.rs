//! A light buffer: a cube map around a point light that knows which triangles can block the way to it \[Haines1986\].
//!
//! *Idea.* Each texel stands for a pyramid of directions. It keeps the depth before which nothing is met in any of them, the depth beyond which
//! something is met in all of them, and the triangles that decide in between, nearest first. A query is a division, a load and
//! two comparisons; where these leave it open, a few triangles are tested.
//!
//! *Definition.* Depth is the largest component of the difference of point and light; with it the point's place on its face of the cube
//! (`frame`). A triangle is a `cone` of directions and a plane. What certainly lies in front is a single triangle that covers a
//! texel, or a sheet of several (`sheets`). A triangle is decided by its `record`; of one alone that covers its texel only the plane is asked. Squares of texels
//! (`tables`) decide most points in space. `build` makes all of it.
//!
//! *Guarantee.* An answer other than [`Answer::Unknown`] is exact: "unoccluded" if no triangle meets the closed segment, "occluded" if one
//! does. Unlike proofs from voxels this is so for points on surfaces, too. *Departure from \[Haines1986\]:* there the lists are of all
//! objects in the pyramid, from the near to the far; nothing bounds depths.
//!
//! *Cost.* In batches 4 to 10 ns where comparisons decide, 8 to 15 ns where a triangle is tested, more where memory is waited for; alone two to three times
//! as much. 8 bytes a texel and a quarter of one for its square, 8 bytes an entry of a list, 64 bytes a triangle that occurs.
//!
//! *Limits.* A light on an occluder has no buffer: every closed segment to it is blocked. Nor has one that is a thousand times as far away
//! as the geometry is large. The hierarchy decides what is too close for the rounding of a record.

mod batch;
mod build;
mod cone;
mod frame;
mod place;
mod record;
mod sheets;
mod tables;
#[cfg(test)]
mod tests;

use glam::DVec3;

use self::{
    build::PARTS,
    frame::NEVER,
    place::{Cube, Direction, Place},
    record::Verdict,
    tables::{Tables, View},
};
use super::Answer;

/// The buffer of one point light.
#[derive(Clone, Debug, PartialEq)]
pub struct LightBuffer {
    cube: Cube,
    /// Texels of no face, those of the faces, then the parts of those that are divided; lists, of which the first and the last entry belong to none; records;
    /// squares of the texels that are no parts.
    tables: Tables,
}

/// Why a light has no buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It lies on an occluder.
    OnOccluder,
    /// It is so far away that its texels cannot tell the triangles apart.
    FarAway,
    /// What it sees is too small or too far away for single precision.
    Range,
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
            Self::Range => "what it sees is too small or too large for single precision",
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
    /// Two codes of depths: a query with a lower code than the low half meets nothing, one with the sum of both halves or a higher one is occluded.
    depths: u32,
    tag: Tag,
}

impl Texel {
    /// Nothing is met.
    const EMPTY: Self = Self::new(NEVER, NEVER, Tag::NOTHING);
    /// Nothing is known.
    const UNKNOWN: Self = Self::new(0, NEVER, Tag::NOTHING);

    /// Lit before one code, occluded from the other on, which is not the lower one.
    const fn new(lit: u16, occluded: u16, tag: Tag) -> Self {
        debug_assert!(lit <= occluded);
        Self { depths: (occluded.saturating_sub(lit) as u32) << 16 | lit as u32, tag }
    }

    #[inline(always)]
    const fn of([depths, tag]: [u32; 2]) -> Self {
        Self { depths, tag: Tag(tag) }
    }

    const fn pair(self) -> [u32; 2] {
        [self.depths, self.tag.0]
    }

    /// Before which code all is lit, and from which on all is occluded.
    const fn depths(self) -> [u16; 2] {
        let lit = self.depths & 0xffff;
        [lit as u16, (lit + (self.depths >> 16)) as u16]
    }
}

/// Whether comparisons of a query's code with a texel's depths find it lit, and whether they leave it open.
#[inline(always)]
const fn compare(code: u32, depths: u32) -> (bool, bool) {
    // One comparison for both: less than nothing is more than all.
    let (lit, open) = (depths & 0xffff, depths >> 16);
    (code < lit, code.wrapping_sub(lit) < open)
}

/// What decides the other queries: three bits of kind and a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Tag(u32);

impl Tag {
    /// There must not be more triangles, entries or texels.
    const MOST: usize = Self::NUMBER as usize;
    const KIND: u32 = 29;
    const NUMBER: u32 = (1 << Self::KIND) - 1;
    const LIST: u32 = 0;
    const SINGLE: u32 = 1;
    const COVER: u32 = 2;
    const PARTS: u32 = 3;
    /// Nobody knows.
    const NOTHING: Self = Self(4 << Self::KIND);

    /// The list that starts at this entry.
    const fn list(first: usize) -> Self {
        Self(first as u32)
    }

    /// One triangle.
    const fn single(number: u32) -> Self {
        Self((Self::SINGLE << Self::KIND) | number)
    }

    /// One triangle that all directions of the texel meet, so that only its plane has to be asked.
    const fn cover(number: u32) -> Self {
        Self((Self::COVER << Self::KIND) | number)
    }

    /// The parts that start at this texel.
    const fn parts(first: usize) -> Self {
        Self((Self::PARTS << Self::KIND) | first as u32)
    }

    #[inline]
    const fn kind(self) -> u32 {
        self.0 >> Self::KIND
    }

    #[inline]
    const fn number(self) -> usize {
        (self.0 & Self::NUMBER) as usize
    }

    /// The triangle, if it is one alone.
    fn as_single(self) -> Option<u32> {
        matches!(self.kind(), Self::SINGLE | Self::COVER).then_some(self.number() as u32)
    }

    /// The same after the tile got its place among all.
    fn moved(self, record_of: &[u32], part: usize, entry: usize) -> Self {
        match self.kind() {
            Self::LIST => Self::list(self.number() + entry),
            Self::SINGLE => Self::single(record_of[self.number()]),
            Self::COVER => Self::cover(record_of[self.number()]),
            Self::PARTS => Self::parts(self.number() + part),
            _ => self,
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

impl Entry {
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "the low half is the nearest")]
    const fn of([triangle, more]: [u32; 2]) -> Self {
        Self { triangle, nearest: more as u16, last: (more >> 16) as u16 }
    }

    const fn pair(self) -> [u32; 2] {
        [self.triangle, (self.last as u32) << 16 | self.nearest as u32]
    }
}

impl LightBuffer {
    /// Where the light is.
    #[must_use]
    pub const fn position(&self) -> DVec3 {
        self.cube.light()
    }

    /// Texels along each side of a face.
    #[must_use]
    pub const fn side(&self) -> u32 {
        self.cube.side()
    }

    /// Bytes of the texels of six faces with `side` texels along each side.
    pub(crate) const fn texel_bytes(side: u32) -> u64 {
        6 * side as u64 * side as u64 * size_of::<Texel>() as u64
    }

    /// Its memory in bytes.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.tables.bytes()
    }

    /// What is known of the closed segment from `from` to the light. Never wrong.
    #[inline]
    #[must_use]
    pub fn answer(&self, from: DVec3) -> Answer {
        self.look_up(from).answer
    }

    /// The same answer, found sooner for points in space: of most of them it is enough to look at squares of texels.
    #[inline]
    #[must_use]
    pub fn answer_in_space(&self, from: DVec3) -> Answer {
        let d = from - self.cube.light();
        let Some(place) = self.cube.place_of_one(d.as_vec3a()) else { return self.look_up_beside(d).answer };
        let (lit, open) = compare(place.code, self.tables.view().square(place.texel));
        if open {
            return self.look_up_at(d, place).answer;
        }
        Answer::of(!lit)
    }

    /// The same, and how it was found.
    #[inline]
    #[must_use]
    pub fn look_up(&self, from: DVec3) -> LookUp {
        let d = from - self.cube.light();
        let Some(place) = self.cube.place_of_one(d.as_vec3a()) else { return self.look_up_beside(d) };
        self.look_up_at(d, place)
    }

    /// The answer for a difference `d` of point and light, which has this place.
    #[inline(always)]
    fn look_up_at(&self, d: DVec3, place: Place) -> LookUp {
        let view = self.tables.view();
        let texel = view.texel(place.texel);
        let (lit, open) = compare(place.code, texel.depths);
        if !open {
            return LookUp { answer: Answer::of(!lit), tests: 0 };
        }
        if texel.tag.kind() == Tag::COVER {
            let side = view.record(texel.tag.number() as u32).side(d, place.direction.reach);
            return LookUp { answer: side.into(), tests: 1 };
        }
        // A copy, so that the place is in memory only here.
        self.look_up_more(d, &{ place }, texel.tag)
    }

    /// The answer where edges have to be asked, or parts of the texel.
    #[inline(never)]
    fn look_up_more(&self, d: DVec3, place: &Place, tag: Tag) -> LookUp {
        let view = self.tables.view();
        match tag.kind() {
            Tag::PARTS => view.look_up_part(place, d, self.cube.in_texel(place), tag.number()),
            _ => view.test(place, d, tag),
        }
    }

    /// The answer where there is no texel of a face.
    #[cold]
    #[allow(clippy::cast_possible_truncation, reason = "as for others")]
    fn look_up_beside(&self, d: DVec3) -> LookUp {
        let texel = self.tables.view().texel(self.cube.beside(d.as_vec3().to_array()));
        LookUp { answer: if texel == Texel::EMPTY { Answer::Unoccluded } else { Answer::Unknown }, tests: 0 }
    }
}

impl View<'_> {
    /// The answer by the triangles that may decide in a texel without parts, for a difference `d` of point and light.
    #[inline]
    fn test(&self, place: &Place, d: DVec3, tag: Tag) -> LookUp {
        match tag.kind() {
            Tag::SINGLE => {
                LookUp { answer: self.record(tag.number() as u32).test(d, &place.direction).into(), tests: 1 }
            }
            Tag::LIST => self.test_list(place.code, d, &place.direction, tag.number()),
            Tag::COVER => {
                LookUp { answer: self.record(tag.number() as u32).side(d, place.direction.reach).into(), tests: 1 }
            }
            _ => LookUp { answer: Answer::Unknown, tests: 0 },
        }
    }

    /// The answer by a list, from this entry on.
    #[inline]
    fn test_list(&self, code: u32, d: DVec3, direction: &Direction, first: usize) -> LookUp {
        let (mut tests, mut found) = (0, Verdict::Passes);
        for number in first.. {
            let entry = self.entry(number as u32);
            if code < u32::from(entry.nearest) {
                break;
            }
            tests += 1;
            match self.record(entry.triangle).test(d, direction) {
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
        LookUp { answer: found.into(), tests }
    }

    /// The answer in the part of a divided texel that this place in it, from 0 to 1, belongs to. Its parts start at `first`.
    #[cold]
    fn look_up_part(&self, place: &Place, d: DVec3, at: [f32; 2], first: usize) -> LookUp {
        let parts = PARTS as f32;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to what there is")]
        let part = |at: f32| {
            let part = ((at * parts) as u32).min(PARTS - 1);
            (part, at * parts - part as f32)
        };
        let [(i, x), (j, y)] = at.map(part);
        let texel = self.texel(first as u32 + j * PARTS + i);
        let (lit, open) = compare(place.code, texel.depths);
        if !open {
            return LookUp { answer: Answer::of(!lit), tests: 0 };
        }
        if texel.tag.kind() == Tag::PARTS {
            return self.look_up_part(place, d, [x, y], texel.tag.number());
        }
        self.test(place, d, texel.tag)
    }
}

impl From<Verdict> for Answer {
    #[inline(always)]
    fn from(verdict: Verdict) -> Self {
        match verdict {
            Verdict::Passes => Self::Unoccluded,
            Verdict::Blocks => Self::Occluded,
            Verdict::Close => Self::Unknown,
        }
    }
}
