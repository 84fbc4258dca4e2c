//! The parts of a segment that a point light sees.
//!
//! *Idea.* Along a line a shadow is an interval between roots of linear functions (`shadow.rs`). Those of all triangles between the segment and the
//! light are united; what is left is lit, and needs no queries.
//!
//! *Definition.* Each parameter t of the segment is dark, lit or unknown ([`LitIntervals::answer`]). Unknown are the guard bands about the ends of shadows,
//! some 10⁻¹⁴ long, in which rounding decides; shadows that meet at an edge that two triangles share have none between them.
//!
//! *Guarantee.* Where the answer is certain, it is that of [`Bvh::occluded`] from `segment.at(t)` to the light, exactly.
//!
//! *Cost.* A search of the hierarchy for the triangles between segment and light, about that of a shadow query where they are few, then some 60 ns
//! for each of them; no allocation.
//!
//! *Limits.* After [`MOST_TRIANGLES`] triangles, or where the shadows have too many pieces, everything is unknown: queries are cheaper
//! there.

mod shadow;

use std::ops::ControlFlow;

use glam::DVec3;
use smallvec::SmallVec;
use vdf_geometry::{Bvh, Segment};

use self::shadow::{Beam, End};
use crate::Answer;

/// Pieces that are kept at most.
const PIECES: usize = 16;

/// So many triangles between a segment and a light are looked at.
pub const MOST_TRIANGLES: u32 = 256;

/// Which parts of a segment a point light sees. Parameters are those of [`Segment::at`].
#[derive(Clone, Debug)]
pub struct LitIntervals {
    /// Certainly dark: disjoint, in order.
    dark: SmallVec<[[End; 2]; PIECES]>,
    /// Not certainly lit: disjoint, in order.
    shade: SmallVec<[[f64; 2]; PIECES]>,
}

impl LitIntervals {
    /// What `light` sees of `segment`, past the triangles of `bvh`.
    #[must_use]
    pub fn new(bvh: &Bvh, light: DVec3, segment: &Segment) -> Self {
        let beam = Beam::new(light, segment);
        let mut lit = Self { dark: SmallVec::new(), shade: SmallVec::new() };
        let mut triangles = 0;
        bvh.visit_wedge(light, segment, |triangle| {
            triangles += 1;
            if triangles > MOST_TRIANGLES {
                lit = Self::unknown();
                return ControlFlow::Break(());
            }
            let Some(shadow) = beam.shadow(triangle) else { return ControlFlow::Continue(()) };
            let kept = unite(&mut lit.shade, shadow.shade, |&[_, end], &[begin, _]| end >= begin, widest)
                && shadow.dark.is_none_or(|dark| unite(&mut lit.dark, dark, follow, longest));
            if !kept {
                lit = Self::unknown();
                return ControlFlow::Break(());
            }
            match lit.dark[..] {
                // Nothing is left to be hidden.
                [[begin, end]] if begin.t <= 0.0 && end.t >= 1.0 => ControlFlow::Break(()),
                _ => ControlFlow::Continue(()),
            }
        });
        lit
    }

    /// Nothing is known.
    fn unknown() -> Self {
        Self { dark: SmallVec::new(), shade: SmallVec::from_slice(&[[0.0, 1.0]]) }
    }

    /// Whether a query from the segment's point at `t`, in [0, 1], to the light is known to be occluded or not.
    #[inline]
    #[must_use]
    pub fn answer(&self, t: f64) -> Answer {
        if !self.shade.iter().any(|&[begin, end]| begin <= t && t <= end) {
            Answer::Unoccluded
        } else if self.dark.iter().any(|[begin, end]| begin.t <= t && t <= end.t) {
            Answer::Occluded
        } else {
            Answer::Unknown
        }
    }

    /// The closed intervals of all that is not dark, in order: lit or unknown. Their ends are dark, or those of the segment.
    pub fn open(&self) -> impl Iterator<Item = [f64; 2]> {
        let begins = std::iter::once(0.0).chain(self.dark.iter().map(|[_, end]| end.t));
        let ends = self.dark.iter().map(|[begin, _]| begin.t).chain([1.0]);
        begins.zip(ends).map(|(begin, end)| [begin, end]).filter(|[begin, end]| begin < end)
    }

    /// All that is not certainly dark: closed intervals, disjoint and in order. Each is [`Answer::Unoccluded`] or [`Answer::Unknown`] as a whole, and all
    /// parameters in [0, 1] that are in none are [`Answer::Occluded`]; so they say what [`LitIntervals::answer`] says, to the last bit.
    pub fn parts(&self) -> impl Iterator<Item = ([f64; 2], Answer)> {
        (0..=self.shade.len())
            .flat_map(|i| {
                // What is lit ends just before a shade, and begins just after the one before.
                let begin = i.checked_sub(1).map_or(0.0, |before| self.shade[before][1].next_up());
                let end = self.shade.get(i).map_or(1.0, |shade| shade[0].next_down());
                let lit = std::iter::once(([begin, end], Answer::Unoccluded));
                lit.chain(self.shade.get(i).into_iter().flat_map(|&shade| self.unknown_of(shade)))
            })
            .filter(|([begin, end], _)| begin <= end)
    }

    /// What is between the dark pieces of a shade; where they touch, or lie beyond it, the end is less than the beginning.
    fn unknown_of(&self, [begin, end]: [f64; 2]) -> impl Iterator<Item = ([f64; 2], Answer)> {
        let (begin, end) = (begin.max(0.0), end.min(1.0));
        let begins = std::iter::once(begin).chain(self.dark.iter().map(move |[_, dark]| dark.t.next_up().max(begin)));
        let ends = self.dark.iter().map(move |[dark, _]| dark.t.next_down().min(end)).chain([end]);
        begins.zip(ends).map(|piece| (piece.into(), Answer::Unknown))
    }

    /// The parameters, together, at which nothing is known, in [0, 1].
    #[must_use]
    #[inline]
    pub fn unknown_share(&self) -> f64 {
        let shade: f64 = self.shade.iter().map(|[begin, end]| end - begin).sum();
        let dark: f64 = self.dark.iter().map(|[begin, end]| end.t - begin.t).sum();
        (shade - dark).max(0.0)
    }
}

/// Whether a dark piece leaves nothing between itself and another that begins later.
#[inline]
fn follow(first: &[End; 2], second: &[End; 2]) -> bool {
    first[1].t >= second[0].t || first[1].meets(&second[0])
}

#[inline]
fn longest(first: [End; 2], second: [End; 2]) -> [End; 2] {
    [first[0], if second[1].t > first[1].t { second[1] } else { first[1] }]
}

#[inline]
fn widest(first: [f64; 2], second: [f64; 2]) -> [f64; 2] {
    [first[0], first[1].max(second[1])]
}

/// Where a piece begins.
trait Piece: Copy {
    fn begin(&self) -> f64;
}

impl Piece for [f64; 2] {
    #[inline]
    fn begin(&self) -> f64 {
        self[0]
    }
}

impl Piece for [End; 2] {
    #[inline]
    fn begin(&self) -> f64 {
        self[0].t
    }
}

/// Adds a piece to others that are disjoint and in order. False if they are too many then.
#[inline]
fn unite<P: Piece>(
    pieces: &mut SmallVec<[P; PIECES]>,
    mut piece: P,
    joins: impl Fn(&P, &P) -> bool,
    join: impl Fn(P, P) -> P,
) -> bool {
    // Those that begin before it and do not reach it stay in front.
    let mut at = pieces.partition_point(|other| other.begin() <= piece.begin());
    if at > 0 && joins(&pieces[at - 1], &piece) {
        at -= 1;
        piece = join(pieces[at], piece);
        pieces.remove(at);
    }
    while at < pieces.len() && joins(&piece, &pieces[at]) {
        piece = join(piece, pieces[at]);
        pieces.remove(at);
    }
    if pieces.len() == PIECES {
        return false;
    }
    pieces.insert(at, piece);
    true
}

#[cfg(test)]
mod tests;
