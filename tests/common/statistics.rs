//! Statistical tests, and when they fail.
//!
//! A test fails if its p-value is below [`ALARM`]; with fixed seeds one that passes keeps passing, and the false-alarm rate is that of the
//! day on which a seed was chosen. No seed of these tests was chosen twice.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

/// The p-value below which a test fails: its false-alarm rate.
pub const ALARM: f64 = 1e-7;

/// The probability of counts at least as far from `n · probabilities` as these (Pearson's χ²). Cells that expect fewer than 5
/// are joined with those after them, the last ones with the one before.
pub fn chi_squared(counts: &[u64], probabilities: &[f64]) -> f64 {
    assert_eq!(counts.len(), probabilities.len());
    let n = counts.iter().sum::<u64>() as f64;
    let mut cells: Vec<(f64, f64)> = Vec::new();
    let (mut count, mut expected) = (0.0, 0.0);
    for (&c, &p) in counts.iter().zip(probabilities) {
        count += c as f64;
        expected += n * p;
        if expected >= 5.0 {
            cells.push((count, expected));
            (count, expected) = (0.0, 0.0);
        }
    }
    let last = cells.last_mut().expect("enough samples for one cell");
    last.0 += count;
    last.1 += expected;
    assert!(cells.len() > 1, "too few samples for a test");
    let chi2 = cells.iter().map(|(c, e)| (c - e).powi(2) / e).sum();
    chi_squared_tail(chi2, cells.len() - 1)
}

/// The probability that a χ² variable is at least this large.
pub fn chi_squared_tail(chi2: f64, degrees_of_freedom: usize) -> f64 {
    ChiSquared::new(degrees_of_freedom as f64).expect("at least one degree of freedom").sf(chi2)
}

/// The probability that a normal variable is at least `z` standard deviations off.
pub fn normal_tails(z: f64) -> f64 {
    2.0 * Normal::standard().sf(z.abs())
}

/// Fails if the counts were not drawn with these probabilities, which have to add up to 1 within 10⁻⁹.
#[track_caller]
pub fn assert_drawn_from(name: &str, counts: &[u64], probabilities: &[f64]) {
    let sum: f64 = probabilities.iter().sum();
    assert!((sum - 1.0).abs() < 1e-9, "{name}: the probabilities add up to {sum}");
    let p = chi_squared(counts, probabilities);
    assert!(p > ALARM, "{name}: p = {p}");
}
