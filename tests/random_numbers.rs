//! The random numbers are uniform and independent along every way in which a renderer walks through (seed, pixel, sample, dimension).
//!
//! Each way gives a sequence, and each sequence goes through the tests of [Knuth1997], Sec. 3.3.2, with birthday spacings and ranks of bit
//! matrices [Marsaglia1995]. A test fails if its p-value is below 10⁻⁸ or above 1 − 10⁻⁸: for the some 120 tests together a
//! false alarm of 3·10⁻⁶. CI takes 2²⁰ numbers of each sequence; the long run is
//! `VDF_NUMBERS=1000000000 cargo test --release --test random_numbers -- --nocapture`. External batteries are fed by
//! `examples/random_stream.rs`.

mod common;

use common::statistics::{chi_squared, chi_squared_tail, normal_tails};
use rayon::prelude::*;
use statrs::distribution::{Binomial, Discrete, Poisson};
use vdf::render::Sampler;

const ALARM: f64 = 1e-8;

/// The 53 random bits of a number.
fn bits(x: f64) -> u64 {
    let scaled = x * 9_007_199_254_740_992.0;
    assert!(scaled.fract() == 0.0 && scaled < 9_007_199_254_740_992.0);
    scaled as u64
}

fn first(seed: u64, x: u32, y: u32, sample: u32) -> u64 {
    bits(Sampler::new(seed, x, y, sample).next_1d())
}

/// The number of dimension `d` (from 0).
fn nth(mut sampler: Sampler, d: u32) -> u64 {
    for _ in 0..d {
        sampler.next_1d();
    }
    bits(sampler.next_1d())
}

type Numbers = Box<dyn Iterator<Item = u64> + Send>;

/// A way through the numbers, by name.
type Way = (&'static str, fn() -> Numbers);

/// Whatever is walked along, the rest is fixed; the last two are the ways of a renderer.
const WAYS: [Way; 9] = [
    ("dimensions", || {
        let mut sampler = Sampler::new(1, 3, 4, 5);
        Box::new(std::iter::repeat_with(move || bits(sampler.next_1d())))
    }),
    ("columns", || Box::new((0..=u32::MAX).map(|i| first(1, i, 0, 0)))),
    ("rows", || Box::new((0..=u32::MAX).map(|i| first(0, 0, i, 0)))),
    ("diagonal", || Box::new((0..=u32::MAX).map(|i| first(1, i, i, i)))),
    ("samples", || Box::new((0..=u32::MAX).map(|i| first(1, 7, 9, i)))),
    ("seeds", || Box::new((0_u64..).map(|i| first(i, 7, 9, 0)))),
    ("seeds by high bits", || Box::new((0_u64..).map(|i| first(i.reverse_bits(), 0, 0, 0)))),
    ("the 17th dimension of each column", || Box::new((0..=u32::MAX).map(|i| nth(Sampler::new(2, i, 1, 0), 16)))),
    ("a film of 512 columns, 4 samples, 5 dimensions", || {
        Box::new((0..=u32::MAX).flat_map(|pixel| {
            (0..4).flat_map(move |s| {
                let mut sampler = Sampler::new(0, pixel % 512, pixel / 512, s);
                std::array::from_fn::<_, 5, _>(|_| bits(sampler.next_1d()))
            })
        }))
    }),
];

/// A test of the next `n` numbers: a p-value.
type Test = (&'static str, fn(&mut dyn Iterator<Item = u64>, u64) -> f64);

const TESTS: [Test; 13] = [
    ("equidistribution, high bits", |x, n| uniform(x.take(n as usize).map(|v| v >> 41), 4096)),
    ("equidistribution, low bits", |x, n| uniform(x.take(n as usize).map(|v| v & 0xfff), 4096)),
    ("pairs, high bits", |x, n| uniform(tuples::<2>(x, n).map(|t| join(t, |v| v >> 47, 64)), 4096)),
    ("pairs, low bits", |x, n| uniform(tuples::<2>(x, n).map(|t| join(t, |v| v & 63, 64)), 4096)),
    ("quadruples", |x, n| uniform(tuples::<4>(x, n).map(|t| join(t, |v| v >> 50, 8)), 4096)),
    ("permutations of five", |x, n| uniform(tuples::<5>(x, n).map(permutation), 120)),
    ("maxima of eight", |x, n| {
        let maximum = |t: [u64; 8]| unit(t.into_iter().max().unwrap_or_default());
        uniform(tuples::<8>(x, n).map(|t| (maximum(t).powi(8) * 128.0) as u64), 128)
    }),
    ("gaps", gaps),
    ("correlation with the next 16", correlation),
    ("ones in a number and in its change", ones),
    ("birthday spacings, high bits", |x, n| birthdays(x, n, |v| (v >> 21) as u32)),
    ("birthday spacings, low bits", |x, n| birthdays(x, n, |v| v as u32)),
    ("ranks of bit matrices", ranks),
];

fn unit(x: u64) -> f64 {
    x as f64 / 9_007_199_254_740_992.0
}

fn tuples<const K: usize>(x: &mut dyn Iterator<Item = u64>, n: u64) -> impl Iterator<Item = [u64; K]> {
    (0..n / K as u64).map(|_| std::array::from_fn(|_| x.next().expect("endless")))
}

fn join<const K: usize>(t: [u64; K], digit: impl Fn(u64) -> u64, base: u64) -> u64 {
    t.into_iter().fold(0, |sum, v| sum * base + digit(v))
}

fn uniform(cells: impl Iterator<Item = u64>, count: usize) -> f64 {
    let mut counts = vec![0; count];
    cells.for_each(|c| counts[c as usize] += 1);
    chi_squared(&counts, &vec![1.0 / count as f64; count])
}

/// The number of the permutation that sorts the values (ties, of probability 10⁻¹⁵, go to the first).
fn permutation(t: [u64; 5]) -> u64 {
    (1..5).fold(0, |sum, i| sum * (i as u64 + 1) + t[..i].iter().filter(|&&v| v > t[i]).count() as u64)
}

/// Lengths of the gaps between numbers below 1/8.
fn gaps(x: &mut dyn Iterator<Item = u64>, n: u64) -> f64 {
    const LONGEST: usize = 64;
    let mut counts = [0; LONGEST + 1];
    let mut gap = 0;
    for v in x.take(n as usize) {
        if v >> 50 == 0 {
            counts[gap.min(LONGEST)] += 1;
            gap = 0;
        } else {
            gap += 1;
        }
    }
    let mut probabilities: Vec<_> = (0..LONGEST).map(|i| 0.125 * 0.875_f64.powi(i as i32)).collect();
    probabilities.push(0.875_f64.powi(LONGEST as i32));
    chi_squared(&counts, &probabilities)
}

/// The coefficients of correlation with the next 16 numbers are normal with variance 1/n and nearly independent: their squares add up to χ².
fn correlation(x: &mut dyn Iterator<Item = u64>, n: u64) -> f64 {
    let mut last = [0.0; 16];
    let mut sums = [0.0; 16];
    for (i, v) in x.take(n as usize).enumerate() {
        // Mean 0, variance 1.
        let v = (unit(v) - 0.5) * 12.0_f64.sqrt();
        for (lag, sum) in sums.iter_mut().enumerate() {
            *sum += v * last[(i + 16 - lag - 1) % 16];
        }
        last[i % 16] = v;
    }
    chi_squared_tail(sums.iter().map(|s| s * s / n as f64).sum(), 16)
}

/// Ones in each number, and in its difference (exclusive or) from the one before it; pairs do not overlap.
fn ones(x: &mut dyn Iterator<Item = u64>, n: u64) -> f64 {
    let binomial = Binomial::new(0.5, 53).expect("a probability");
    let single: Vec<_> = (0..=53).map(|k| binomial.pmf(k)).collect();
    let joint: Vec<_> = single.iter().flat_map(|a| single.iter().map(move |b| a * b)).collect();
    let mut counts = vec![0; joint.len()];
    for [a, b] in tuples::<2>(x, n) {
        counts[(a.count_ones() * 54 + (a ^ b).count_ones()) as usize] += 1;
    }
    chi_squared(&counts, &joint)
}

/// Equal spacings of 4096 birthdays in a year of 2³² days are Poisson with mean 4096³/(4·2³²) = 4.
fn birthdays(x: &mut dyn Iterator<Item = u64>, n: u64, day: fn(u64) -> u32) -> f64 {
    const MOST: u64 = 24;
    let mut counts = vec![0; MOST as usize + 1];
    for _ in 0..n / 4096 {
        let mut days: Vec<_> = x.take(4096).map(day).collect();
        days.sort_unstable();
        let mut spacings: Vec<_> = days.windows(2).map(|w| w[1] - w[0]).collect();
        spacings.sort_unstable();
        let equal = spacings.windows(2).filter(|w| w[0] == w[1]).count();
        counts[equal.min(MOST as usize)] += 1;
    }
    let poisson = Poisson::new(4.0).expect("positive");
    let mut probabilities: Vec<_> = (0..MOST).map(|k| poisson.pmf(k)).collect();
    probabilities.push(1.0 - probabilities.iter().sum::<f64>());
    chi_squared(&counts, &probabilities)
}

/// Ranks of 53 × 53 matrices whose rows are numbers. A random one has rank 53 − d with probability
/// 2^(−d²) · ∏ₖ₌d₊₁ (1 − 2⁻ᵏ) / ∏ₖ₌₁ᵈ (1 − 2⁻ᵏ) up to 2⁻⁵³.
fn ranks(x: &mut dyn Iterator<Item = u64>, n: u64) -> f64 {
    let mut counts = [0; 5];
    for mut rows in tuples::<53>(x, n) {
        let mut rank = 0;
        for bit in 0..53 {
            if let Some(pivot) = (rank..53).find(|&r| rows[r] >> bit & 1 == 1) {
                rows.swap(rank, pivot);
                for r in rank + 1..53 {
                    rows[r] ^= if rows[r] >> bit & 1 == 1 { rows[rank] } else { 0 };
                }
                rank += 1;
            }
        }
        counts[(53 - rank).min(4)] += 1;
    }
    let product = |from: i32, to: i32| (from..=to).map(|k| 1.0 - 0.5_f64.powi(k)).product::<f64>();
    let mut probabilities: Vec<_> = (0..4).map(|d| 0.5_f64.powi(d * d) * product(d + 1, 60) / product(1, d)).collect();
    probabilities.push(1.0 - probabilities.iter().sum::<f64>());
    chi_squared(&counts, &probabilities)
}

#[test]
fn every_way_passes_every_test() {
    let n = std::env::var("VDF_NUMBERS").ok().and_then(|n| n.parse().ok()).unwrap_or(1 << 20);
    let cases: Vec<_> = WAYS.iter().flat_map(|way| TESTS.iter().map(move |test| (way, test))).collect();
    let p_values: Vec<f64> =
        cases.par_iter().map(|((_, numbers), (_, test))| test(&mut numbers().take(n as usize + 64), n)).collect();
    for (((way, _), (test, _)), p) in cases.iter().zip(&p_values) {
        println!("{p:.6}  {test}: {way}");
    }
    for (((way, _), (test, _)), &p) in cases.iter().zip(&p_values) {
        assert!(p > ALARM && p < 1.0 - ALARM, "{test}: {way}: p = {p}");
    }
    // The p-values themselves are uniform.
    let mut tenths = [0; 10];
    p_values.iter().for_each(|p| tenths[((p * 10.0) as usize).min(9)] += 1);
    let p = chi_squared(&tenths, &[0.1; 10]);
    assert!(p > ALARM, "p-values are not uniform: {tenths:?}, p = {p}");
}

/// Each bit of seed, pixel, sample and dimension flips each bit of the number half of the time: for each pair the number of flips in m trials is
/// normal about m/2 with variance m/4, and the squares add up to χ². Each input bit is a test of 53 degrees of freedom.
#[test]
fn every_bit_of_the_input_flips_every_bit_of_the_output() {
    const TRIALS: u64 = 4096;
    let number = |[seed, x, y, sample, dimension]: [u64; 5]| {
        nth(Sampler::new(seed, x as u32, y as u32, sample as u32), dimension as u32)
    };
    let inputs: Vec<_> =
        [64, 32, 32, 32, 6].iter().enumerate().flat_map(|(i, &n)| (0..n).map(move |b| (i, b))).collect();
    let p_values: Vec<_> = inputs
        .par_iter()
        .map(|&(field, bit)| {
            let mut flips = [0_u64; 53];
            for trial in 0..TRIALS {
                // Small numbers, as renders have them, and arbitrary ones.
                let mut noise = Sampler::new(77, field as u32, bit, trial as u32);
                let size = if trial % 2 == 0 { 8.0 } else { 4_294_967_296.0 };
                let mut input: [u64; 5] = std::array::from_fn(|_| (noise.next_1d() * size) as u64);
                input[4] %= 64;
                let before = number(input);
                input[field] ^= 1 << bit;
                let change = before ^ number(input);
                (0..53).for_each(|k| flips[k] += change >> k & 1);
            }
            let z2 = |&f: &u64| (f as f64 - TRIALS as f64 / 2.0).powi(2) / (TRIALS as f64 / 4.0);
            chi_squared_tail(flips.iter().map(z2).sum(), 53)
        })
        .collect();
    for ((field, bit), p) in inputs.iter().zip(&p_values) {
        assert!(*p > ALARM, "bit {bit} of {}: p = {p}", ["seed", "x", "y", "sample", "dimension"][*field]);
    }
}

/// The numbers of one sample in two dimensions have nothing to do with those of a neighbour: correlation between equal dimensions of
/// neighbouring pixels, samples and seeds, each normal with variance 1/n.
#[test]
fn neighbours_are_uncorrelated_in_every_dimension() {
    const N: u32 = 1 << 16;
    const DIMENSIONS: usize = 12;
    type Neighbour = fn(u32) -> [Sampler; 2];
    let neighbours: [(&str, Neighbour); 4] = [
        ("right", |i| [Sampler::new(3, i % 256 * 2, i / 256, 0), Sampler::new(3, i % 256 * 2 + 1, i / 256, 0)]),
        ("below", |i| [Sampler::new(3, i % 256, i / 256 * 2, 0), Sampler::new(3, i % 256, i / 256 * 2 + 1, 0)]),
        ("sample", |i| [Sampler::new(3, 1, 1, 2 * i), Sampler::new(3, 1, 1, 2 * i + 1)]),
        ("seed", |i| [Sampler::new(u64::from(2 * i), 1, 1, 0), Sampler::new(u64::from(2 * i + 1), 1, 1, 0)]),
    ];
    for (name, neighbour) in neighbours {
        let mut sums = [[0.0; DIMENSIONS]; DIMENSIONS];
        for i in 0..N {
            let [a, b] = neighbour(i).map(|mut s| std::array::from_fn::<_, DIMENSIONS, _>(|_| s.next_1d() - 0.5));
            for (row, a) in sums.iter_mut().zip(a) {
                row.iter_mut().zip(b).for_each(|(sum, b)| *sum += 12.0 * a * b);
            }
        }
        for (i, row) in sums.iter().enumerate() {
            for (j, sum) in row.iter().enumerate() {
                let p = normal_tails(sum / f64::from(N).sqrt());
                assert!(p > ALARM, "{name}: dimensions {i} and {j}: p = {p}");
            }
        }
    }
}
