//! Look-ups of many queries at once.
//!
//! *Idea.* A query waits for its texel, then for its list, then for a record; many wait no longer than one. So each stage is done for a block of them before
//! the next begins. As long as squares decide most of a block they are asked before texels. The first stage is arithmetic on arrays without a branch, which
//! the compiler makes vectors of, as wide as the machine has them: all of it is compiled for several instruction sets, of which one is chosen once a run.
//!
//! *Guarantee.* The same answers as [`LightBuffer::answer`], with every instruction set.

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

use super::{
    Answer, LightBuffer, Tag, compare,
    place::{Cube, Direction},
    tables::View,
};
use crate::{QueryKind, ShadowQuery};

/// So many queries go through the stages together: a bit each.
const BLOCK: usize = 32;

/// Stages that are done in vectors are done for a multiple of this.
const LANES: usize = 8;

/// A multiple of `LANES` that holds so many queries of a block. Lanes beyond the last query hold what was there before.
#[inline(always)]
fn lanes(queries: usize) -> usize {
    (queries.min(BLOCK) + LANES - 1) & !(LANES - 1)
}

impl LightBuffer {
    /// What is known of the closed segments of the first of `queries`, as long as they are towards this light, the light number `emitter`: of how many
    /// that is. Whole blocks of them are answered or none; `answers` must be as long.
    pub(in crate::prover) fn answer_run(
        &self,
        arch: Arch,
        emitter: usize,
        queries: &[ShadowQuery],
        answers: &mut [Answer],
    ) -> usize {
        arch.dispatch(Run { buffer: self, emitter, queries, answers })
    }
}

/// Queries that are looked up with one instruction set.
struct Run<'a> {
    buffer: &'a LightBuffer,
    emitter: usize,
    queries: &'a [ShadowQuery],
    answers: &'a mut [Answer],
}

impl WithSimd for Run<'_> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        if self.buffer.cube.is_whole() { self.answer::<true>() } else { self.answer::<false>() }
    }
}

impl Run<'_> {
    #[inline(always)]
    fn answer<const WHOLE: bool>(self) -> usize {
        let (cube, view) = (&self.buffer.cube, self.buffer.tables.view());
        let mut places = Places::new();
        let mut done = 0;
        // Whether squares decide most: a guess from what was asked last, on which no answer depends.
        let mut squares = self.queries.first().is_some_and(|q| q.kind == QueryKind::Spatial);
        for (queries, answers) in self.queries.chunks(BLOCK).zip(self.answers.chunks_mut(BLOCK)) {
            if !are_towards(queries, self.emitter, cube.light()) {
                break;
            }
            places.find::<WHOLE>(cube, queries);
            let mut open = places.compare(&view, squares, answers);
            let left_open = open.count_ones();
            if squares && open != 0 {
                open = places.compare_texels(&view, open, answers);
            }
            squares = left_open < BLOCK as u32 / 4;
            if open != 0 {
                self.buffer.test_open(&view, &places, open, queries, answers);
            }
            done += queries.len();
        }
        done
    }
}

/// Whether all of these queries are towards this light.
#[inline(always)]
fn are_towards(queries: &[ShadowQuery], emitter: usize, light: DVec3) -> bool {
    let [x, y, z] = [light.x.to_bits(), light.y.to_bits(), light.z.to_bits()];
    // Bits, of four queries at a time, so that one load is compared with one vector. A zero of the other sign is asked about one by one.
    let (fours, rest) = queries.as_chunks::<4>();
    for four in fours {
        let mut differs = [0; 4];
        for query in four {
            add_differences(&mut differs, query, [x, y, z], emitter);
        }
        if differs[0] | differs[1] | differs[2] | differs[3] != 0 {
            return false;
        }
    }
    let mut differs = [0; 4];
    for query in rest {
        add_differences(&mut differs, query, [x, y, z], emitter);
    }
    differs[0] | differs[1] | differs[2] | differs[3] == 0
}

/// Adds the bits in which a query's end and emitter differ from these.
#[inline(always)]
fn add_differences(differs: &mut [u64; 4], query: &ShadowQuery, [x, y, z]: [u64; 3], emitter: usize) {
    let to = &query.to;
    let bits = [to.x.to_bits() ^ x, to.y.to_bits() ^ y, to.z.to_bits() ^ z, (query.emitter ^ emitter) as u64];
    for i in 0..4 {
        differs[i] |= bits[i];
    }
}

/// The places of a block of queries, field by field as in [`Place`].
// Each array in cache lines of its own: a number that is read from a vector that was written across two lines waits for the cache.
#[repr(align(64))]
struct Places {
    x: [[f32; BLOCK]; 3],
    reach: [f32; BLOCK],
    texel: [u32; BLOCK],
    code: [u32; BLOCK],
    /// Of each texel.
    depths: [u32; BLOCK],
}

impl Places {
    const fn new() -> Self {
        let zero = [0.0; BLOCK];
        Self { x: [zero; 3], reach: zero, texel: [0; BLOCK], code: [0; BLOCK], depths: [0; BLOCK] }
    }

    /// The places of these queries.
    #[inline(always)]
    fn find<const WHOLE: bool>(&mut self, cube: &Cube, queries: &[ShadowQuery]) {
        let n = queries.len().min(BLOCK);
        let queries = &queries[..n];
        let [x, y, z] = &mut self.x;
        let (dx, dy, dz) = (&mut x[..n], &mut y[..n], &mut z[..n]);
        // By themselves, for a loop that holds numbers of double precision is made of vectors of half as many lanes.
        for i in 0..n {
            [dx[i], dy[i], dz[i]] = (queries[i].from - cube.light()).as_vec3().to_array();
        }
        let n = lanes(n);
        let (x, y, z, reach) = (&mut x[..n], &mut y[..n], &mut z[..n], &mut self.reach[..n]);
        let (texel, code) = (&mut self.texel[..n], &mut self.code[..n]);
        for i in 0..n {
            let place = cube.place_of::<WHOLE>([x[i], y[i], z[i]]);
            [x[i], y[i], z[i]] = place.direction.x;
            reach[i] = place.direction.reach;
            texel[i] = place.texel;
            code[i] = place.code;
        }
    }

    /// The answers by comparisons with squares or with texels, and a bit for each that they leave open.
    #[inline(always)]
    fn compare(&mut self, view: &View<'_>, squares: bool, answers: &mut [Answer]) -> u32 {
        let n = lanes(answers.len());
        let (loaded, _) = self.depths[..n].as_chunks_mut::<LANES>();
        let (texels, _) = self.texel[..n].as_chunks::<LANES>();
        for (depths, texels) in loaded.iter_mut().zip(texels) {
            for i in 0..LANES {
                depths[i] = if squares { view.square(texels[i]) } else { view.texel(texels[i]).depths };
            }
        }
        let (mut found, mut is_open) = ([Answer::Unknown; BLOCK], [false; BLOCK]);
        for i in 0..n {
            let (lit, open) = compare(self.code[i], self.depths[i]);
            // Those that are left open are so until a triangle blocks their way.
            found[i] = Answer::of(!(lit | open));
            is_open[i] = open;
        }
        let count = answers.len().min(BLOCK);
        answers[..count].copy_from_slice(&found[..count]);
        // Lanes beyond the last query hold anything.
        let asked = u32::MAX >> (BLOCK - count);
        (0..BLOCK).fold(0, |open, i| open | u32::from(is_open[i]) << i) & asked
    }

    /// The same by comparisons with texels, of those that squares left `open`.
    #[inline(always)]
    fn compare_texels(&self, view: &View<'_>, mut open: u32, answers: &mut [Answer]) -> u32 {
        let mut still = 0;
        while open != 0 {
            let i = open.trailing_zeros();
            open &= open - 1;
            let (lit, is_open) = compare(self.code[i as usize], view.texel(self.texel[i as usize]).depths);
            answers[i as usize] = Answer::of(!(lit | is_open));
            still |= u32::from(is_open) << i;
        }
        still
    }

    #[inline(always)]
    fn direction(&self, i: usize) -> Direction {
        Direction { x: [self.x[0][i], self.x[1][i], self.x[2][i]], reach: self.reach[i] }
    }
}

impl LightBuffer {
    /// Answers those of a block that comparisons leave open, which have a bit in `open`.
    #[inline(always)]
    fn test_open(
        &self,
        view: &View<'_>,
        places: &Places,
        mut open: u32,
        queries: &[ShadowQuery],
        answers: &mut [Answer],
    ) {
        let light = self.cube.light();
        // Who has a list, in the order of the queries: whose it is, where it starts.
        let (mut lane, mut entry) = ([0_u32; BLOCK], [0_u32; BLOCK]);
        let mut waiting = 0;
        while open != 0 {
            let i = open.trailing_zeros() as usize;
            open &= open - 1;
            let tag = view.texel(places.texel[i]).tag;
            let number = tag.number() as u32;
            match tag.kind() {
                Tag::COVER => answers[i] = view.record(number).side(queries[i].from - light, places.reach[i]).into(),
                Tag::SINGLE => {
                    answers[i] = view.record(number).test(queries[i].from - light, &places.direction(i)).into();
                }
                Tag::LIST => {
                    (lane[waiting % BLOCK], entry[waiting % BLOCK]) = (i as u32, number);
                    waiting += 1;
                }
                _ => answers[i] = self.answer(queries[i].from),
            }
        }
        if waiting > 0 {
            test_lists(view, places, (lane, entry, waiting), light, queries, answers);
        }
    }
}

/// Answers those who have a list: one triangle for each of them, then the next for those that still wait.
#[inline(always)]
fn test_lists(
    view: &View<'_>,
    places: &Places,
    (mut lane, mut entry, mut waiting): ([u32; BLOCK], [u32; BLOCK], usize),
    light: DVec3,
    queries: &[ShadowQuery],
    answers: &mut [Answer],
) {
    let mut record = [0_u32; BLOCK];
    for at in 0..waiting.min(BLOCK) {
        record[at] = view.entry(entry[at]).triangle;
    }
    while waiting > 0 {
        let mut left = 0;
        for at in 0..waiting.min(BLOCK) {
            let (i, number) = (lane[at] as usize % BLOCK, entry[at]);
            let found: Answer = view.record(record[at]).test(queries[i].from - light, &places.direction(i)).into();
            answers[i] = if found == Answer::Unoccluded { answers[i] } else { found };
            let next = view.entry(number + 1);
            (lane[left], entry[left], record[left]) = (i as u32, number + 1, next.triangle);
            let ends = (view.entry(number).last == 1) | (places.code[i] < u32::from(next.nearest));
            left += usize::from(!(ends | (found == Answer::Occluded)));
        }
        waiting = left;
    }
}
