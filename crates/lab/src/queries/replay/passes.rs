//! Passes over queries: one that checks every answer, and those that are timed.

use std::{hint::black_box, time::Instant};

use rayon::prelude::*;
use vdf_render::ThreadTime;
use vdf_visibility::{Answer, Counters, LightProver, LookUp, Provers, QueryKind, ShadowQuery, Visibility};

use super::figures::LookUpShares;

/// How many queries were proved when every answer was compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Checked(Counters);

impl Checked {
    /// Queries of a class that were proved.
    pub(crate) fn proved(&self, kind: QueryKind) -> usize {
        let n = match kind {
            QueryKind::Spatial => self.0.proved,
            QueryKind::OnLight => self.0.on_light_proved,
            QueryKind::Superficial => self.0.superficial_proved,
        };
        n as usize
    }
}

/// Compares every answer with the truth: how many were proved, or the index of the first query that is answered
/// wrongly.
pub(crate) fn check(visibility: &Visibility<'_>, queries: &[ShadowQuery], truth: &[bool]) -> Result<Checked, usize> {
    const BLOCK: usize = 4096;
    let answers = queries.par_chunks(BLOCK).zip(truth.par_chunks(BLOCK)).enumerate();
    let blocks: Vec<Counters> = answers
        .map(|(number, (queries, truth))| {
            let mut counters = Counters::default();
            let differs = queries.iter().zip(truth).position(|(q, &t)| visibility.unoccluded(q, &mut counters) != t);
            differs.map_or(Ok(counters), |i| Err(number * BLOCK + i))
        })
        .collect::<Result<_, usize>>()?;
    let mut all = Counters::default();
    blocks.into_iter().for_each(|counters| all += counters);
    Ok(Checked(all))
}

/// How light buffers answer; `None` if there are none for these queries.
pub(super) fn look_up_shares(provers: &Provers, queries: &[ShadowQuery]) -> Option<LookUpShares> {
    let (mut count, mut tests) = (0, 0);
    let (mut lit, mut occluded, mut by_list, mut open) = (0, 0, 0, 0);
    for query in queries {
        let Some(LightProver::Buffer(buffer)) = provers.light(query.emitter) else { continue };
        if query.to != buffer.position() {
            continue;
        }
        let found = buffer.look_up(query.from);
        count += 1;
        tests += u64::from(found.tests);
        match found {
            LookUp { answer: Answer::Unknown, .. } => open += 1,
            LookUp { tests: 1.., .. } => by_list += 1,
            LookUp { answer: Answer::Unoccluded, .. } => lit += 1,
            LookUp { answer: Answer::Occluded, .. } => occluded += 1,
        }
    }
    let share = |n: usize| n as f64 / count as f64;
    (count > 0).then(|| LookUpShares {
        queries: count,
        lit: share(lit),
        occluded: share(occluded),
        by_list: share(by_list),
        hierarchy: share(open),
        mean_tests: tests as f64 / ((by_list + open).max(1)) as f64,
    })
}

/// One pass over queries that asks only for proofs: its seconds, and how many there are.
pub(super) fn proof_pass(provers: &Provers, queries: &[ShadowQuery]) -> (f64, usize) {
    let start = ThreadTime::now();
    let mut proved = 0;
    for q in queries {
        proved += usize::from(provers.answer(black_box(q)) != Answer::Unknown);
    }
    (start.seconds(), proved)
}

/// One pass over queries as a render asks them: its seconds, and how many are unoccluded.
pub(super) fn query_pass(visibility: &Visibility<'_>, queries: &[ShadowQuery]) -> (f64, usize) {
    let start = ThreadTime::now();
    let mut counters = Counters::default();
    let mut unoccluded = 0;
    for q in queries {
        unoccluded += usize::from(visibility.unoccluded(black_box(q), &mut counters));
    }
    black_box(counters);
    (start.seconds(), unoccluded)
}

/// One pass over queries as a render asks them that has many at once, `batch` at a time: its seconds, and how many are
/// unoccluded.
pub(super) fn batch_pass(visibility: &Visibility<'_>, queries: &[ShadowQuery], batch: usize) -> (f64, usize) {
    let mut answers = vec![false; batch];
    let start = ThreadTime::now();
    let mut counters = Counters::default();
    let mut unoccluded = 0;
    for queries in queries.chunks(batch) {
        let answers = &mut answers[..queries.len()];
        visibility.all_unoccluded(black_box(queries), answers, &mut counters);
        unoccluded += answers.iter().filter(|&&a| a).count();
    }
    black_box(counters);
    (start.seconds(), unoccluded)
}

/// A pass of the hierarchy with a timer around each query: as [`query_pass`], and the sum of what the timers say.
pub(super) fn timer_pass(visibility: &Visibility<'_>, queries: &[ShadowQuery]) -> ((f64, usize), f64) {
    let start = ThreadTime::now();
    let mut counters = Counters::default();
    let (mut unoccluded, mut said) = (0, 0.0);
    for q in queries {
        let start = Instant::now();
        unoccluded += usize::from(visibility.unoccluded(black_box(q), &mut counters));
        said += start.elapsed().as_secs_f64();
    }
    black_box(counters);
    ((start.seconds(), unoccluded), said)
}

/// Nanoseconds a query to read the stream and nothing else.
pub(super) fn empty_pass(queries: &[ShadowQuery]) -> f64 {
    let start = ThreadTime::now();
    let mut sum = glam::DVec3::ZERO;
    for q in queries {
        let q = black_box(q);
        sum += q.from + q.to;
    }
    black_box(sum);
    1e9 * start.seconds() / queries.len() as f64
}
