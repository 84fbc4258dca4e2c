//! Pearson's χ² test, for the unit tests of what is sampled. The end-to-end tests have one of their own, for they see only what is public.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Fails if counts as far from `n · probabilities` as these, or farther, have a probability below 10⁻⁷ (a false alarm, had the
/// seeds not been fixed). Each cell must expect at least 5.
#[track_caller]
pub(crate) fn assert_drawn_from(name: &str, counts: &[u64], probabilities: &[f64]) {
    assert_eq!(counts.len(), probabilities.len());
    let sum: f64 = probabilities.iter().sum();
    assert!((sum - 1.0).abs() < 1e-9, "{name}: the probabilities add up to {sum}");
    let n = counts.iter().sum::<u64>() as f64;
    let chi2: f64 = counts
        .iter()
        .zip(probabilities)
        .map(|(&count, p)| {
            assert!(n * p >= 5.0, "{name}: a cell expects only {}", n * p);
            (count as f64 - n * p).powi(2) / (n * p)
        })
        .sum();
    let p = ChiSquared::new((counts.len() - 1) as f64).expect("positive").sf(chi2);
    assert!(p > 1e-7, "{name}: χ² = {chi2} with {} degrees of freedom, p = {p}", counts.len() - 1);
}
