//! Look-ups of many queries at once.
//!
//! *Idea.* A query waits for its texel, then for its list, then for a record; eight wait no longer than one. So each stage is done for all of them before the next
//! begins. The first is arithmetic without branches on arrays, which the compiler makes vectors of.
//!
//! *Guarantee.* The same answers as [`LightBuffer::answer`], by the same operations.

use glam::DVec3;

use super::{
    Answer, LightBuffer, Place, Tag, Texel,
    build::TILE_TEXELS,
    frame::{TILE, whole},
    record::Record,
};

/// So many queries are looked up together.
pub(in crate::prover) const LANES: usize = 8;

/// The places of queries, field by field.
struct Places {
    /// From the light.
    d: [[f64; LANES]; 3],
    w: [f64; LANES],
    inverse_w: [f64; LANES],
    /// In the texel.
    x: [f64; LANES],
    y: [f64; LANES],
    texel: [u32; LANES],
    code: [u16; LANES],
    /// In a window: only then there is a texel.
    inside: [bool; LANES],
    /// In none of them, so that nothing can be met. Neither is what is no number, or the light itself.
    beyond: [bool; LANES],
}

impl LightBuffer {
    /// What is known of the closed segments from the first of these points to the light, as many as there are `answers`.
    pub(in crate::prover) fn answer_batch(&self, from: &[DVec3; LANES], answers: &mut [Answer]) {
        let places = self.places(from);
        let mut open = [0_usize; LANES];
        let mut left = 0;
        for (i, answer) in answers.iter_mut().enumerate().take(LANES) {
            let texel = self.texels.get(places.texel[i] as usize).unwrap_or(&Texel::EMPTY);
            let (lit, occluded) = (places.code[i] < texel.lit, places.code[i] >= texel.occluded);
            let beyond = places.beyond[i];
            *answer = if lit | beyond { Answer::Unoccluded } else { Answer::Occluded };
            open[left] = i;
            left += usize::from(!beyond & !(places.inside[i] & (lit | occluded)));
        }
        let open = &open[..left];
        self.touch(&places, open);
        for &i in open {
            answers[i] = self.answer_open(&places, i, from[i]);
        }
    }

    /// Loads the first records that the open queries will wait for.
    #[inline]
    fn touch(&self, places: &Places, open: &[usize]) {
        let mut first = [0; LANES];
        for (&i, first) in open.iter().zip(&mut first) {
            let Some(texel) = self.texels.get(places.texel[i] as usize) else { continue };
            *first = match texel.tag.kind() {
                Tag::SINGLE => texel.tag.number(),
                Tag::LIST => self.entries.get(texel.tag.number()).map_or(0, |entry| entry.triangle as usize),
                _ => 0,
            };
        }
        let records = first[..open.len()].iter().filter_map(|&record| self.records.get(record));
        // A load that nobody used would be left out.
        std::hint::black_box(records.map(Record::first).sum::<f64>());
    }

    /// The answer to a query that comparisons leave open.
    #[inline]
    fn answer_open(&self, places: &Places, i: usize, from: DVec3) -> Answer {
        if !places.inside[i] {
            return self.answer(from);
        }
        let place = Place {
            d: DVec3::new(places.d[0][i], places.d[1][i], places.d[2][i]),
            w: places.w[i],
            inverse_w: places.inverse_w[i],
            x: places.x[i],
            y: places.y[i],
            texel: places.texel[i] as usize,
            code: places.code[i],
        };
        self.test(&place, self.texels[place.texel].tag).answer
    }

    /// As [`LightBuffer::place`].
    #[inline(always)]
    fn places(&self, from: &[DVec3; LANES]) -> Places {
        let mut d = [[0.0; LANES]; 3];
        for (i, from) in from.iter().enumerate() {
            let at = *from - self.position;
            (d[0][i], d[1][i], d[2][i]) = (at.x, at.y, at.z);
        }
        let (mut u, mut v, mut w, mut face) = ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0_u32; LANES]);
        for i in 0..LANES {
            let [x, y, z] = [d[0][i], d[1][i], d[2][i]];
            // As `Face::of`.
            let second = y.abs() > x.abs();
            let of_two = if second { y.abs() } else { x.abs() };
            let third = z.abs() > of_two;
            let (u2, v2, w2) = if second { (z, x, y) } else { (y, z, x) };
            let along = if third { z } else { w2 };
            (u[i], v[i], w[i]) = (if third { x } else { u2 }, if third { y } else { v2 }, along.abs());
            let axis = if third { 4 } else { 2 * u32::from(second) };
            face[i] = axis + u32::from(along < 0.0);
        }
        let mut corner = [[0.0; LANES]; 2];
        let mut scale = [[0.0; LANES]; 2];
        let (mut side, mut first) = ([0_u32; LANES], [0_u32; LANES]);
        for i in 0..LANES {
            let window = &self.windows[(face[i] as usize).min(5)];
            ([corner[0][i], corner[1][i]], [scale[0][i], scale[1][i]]) = window.map();
            (side[i], first[i]) = (window.side(), window.first);
        }
        let mut places = Places {
            d,
            w,
            inverse_w: w.map(f64::recip),
            x: [0.0; LANES],
            y: [0.0; LANES],
            texel: [0; LANES],
            code: w.map(|w| self.depths.of(w)),
            inside: [false; LANES],
            beyond: [false; LANES],
        };
        for i in 0..LANES {
            let inverse = places.inverse_w[i];
            let x = (u[i] * inverse - corner[0][i]) * scale[0][i];
            let y = (v[i] * inverse - corner[1][i]) * scale[1][i];
            let n = f64::from(side[i]);
            // False for what is no number.
            let valid = (w[i] > 0.0) & (w[i] < f64::INFINITY) & (x + y < f64::INFINITY);
            let inside = valid & (x >= 0.0) & (y >= 0.0) & (x < n) & (y < n);
            let last = side[i].saturating_sub(1);
            let (column, row) = (whole(x).min(last), whole(y).min(last));
            (places.x[i], places.y[i]) = (x - f64::from(column), y - f64::from(row));
            let tile = (row / TILE) * (side[i] / TILE) + column / TILE;
            let texel = first[i] + tile * TILE_TEXELS as u32 + Self::place_in_tile(column, row) as u32;
            places.texel[i] = if inside { texel } else { 0 };
            (places.inside[i], places.beyond[i]) = (inside, valid & !inside);
        }
        places
    }
}
