//! What follows from points of time and error: medians with their intervals, slopes, and the time that an error takes.

/// The median of so many values, and which of them enclose it.
///
/// *Definition.* Of n independent draws of any distribution, fewer than k lie below its median with the probability
/// that fewer than k of n fair coins show heads. So the k-th smallest and the k-th largest enclose it with the
/// probability 1 − 2·P(B(n, ½) < k). Taken is the largest k for which that is at least 15/16, what the smallest and the
/// largest of five have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MedianRule {
    /// From 1.
    pub(super) k: usize,
    /// With what probability they enclose it.
    pub(super) coverage: f64,
}

/// A median and an interval that encloses that of the distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Median {
    pub(super) median: f64,
    pub(super) low: f64,
    pub(super) high: f64,
}

/// The fewest values with such an interval.
pub(super) const MIN_VALUES: usize = 5;

/// The most; above it the probabilities of few heads are no longer normal numbers in double precision.
pub(super) const MAX_VALUES: usize = 1000;

const COVERAGE: f64 = 15.0 / 16.0;

impl MedianRule {
    /// For `n` values, from [`MIN_VALUES`] to [`MAX_VALUES`].
    pub(super) fn new(n: usize) -> Self {
        // P(B = i), and the sum of those below k.
        let mut p = 0.5_f64.powi(n as i32);
        let mut below = p;
        let mut rule = Self { k: 1, coverage: 1.0 - 2.0 * below };
        for k in 2..=n / 2 {
            p *= (n + 2 - k) as f64 / (k - 1) as f64;
            below += p;
            let coverage = 1.0 - 2.0 * below;
            if coverage < COVERAGE {
                break;
            }
            rule = Self { k, coverage };
        }
        rule
    }

    /// Of these values; all zero if there are none.
    pub(super) fn of(&self, values: impl IntoIterator<Item = f64>) -> Median {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        if n == 0 {
            return Median { median: 0.0, low: 0.0, high: 0.0 };
        }
        let k = self.k.clamp(1, n) - 1;
        Median {
            median: 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]),
            low: sorted[k.min((n - 1) / 2)],
            high: sorted[(n - 1 - k).max(n / 2)],
        }
    }
}

/// How a time was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Found {
    /// The shortest render has the error already.
    AtMost,
    /// Between two renders.
    Between,
    /// Beyond the longest render.
    Beyond,
}

/// The time after which the error stays at `target` or below: `t_build`, and that of the render. `points` are times of
/// renders in seconds and their errors, longer renders later. `None` if no point is of any use.
///
/// Between two renders both logarithms are interpolated; beyond the longest the error falls as 1/t, as that of any
/// unbiased estimator with a variance does. If the error crosses the target several times the last time counts.
pub(super) fn time_to(points: &[(f64, f64)], t_build: f64, target: f64) -> Option<(f64, Found)> {
    let usable: Vec<_> = points.iter().copied().filter(|p| is_usable(*p)).collect();
    let (t_first, _) = *usable.first()?;
    let Some(above) = usable.iter().rposition(|(_, e)| *e > target) else {
        return Some((t_build + t_first, Found::AtMost));
    };
    let (t, e) = usable[above];
    Some(match usable.get(above + 1) {
        None => (t_build + t * e / target, Found::Beyond),
        Some((t_next, e_next)) => {
            let share = (e / target).ln() / (e / e_next).ln();
            (t_build + t * (t_next / t).powf(share), Found::Between)
        }
    })
}

/// The exponent of the power law through the points, by least squares of logarithms; −1 is that of an unbiased
/// estimator over samples. `None` with fewer than two usable places.
pub(super) fn slope(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<_> = points.iter().filter(|p| is_usable(**p)).map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let (x, y) = logs.iter().fold((0.0, 0.0), |sum, p| (sum.0 + p.0 / n, sum.1 + p.1 / n));
    let (xx, xy) = logs.iter().fold((0.0, 0.0), |sum, p| {
        let dx = p.0 - x;
        (sum.0 + dx * dx, sum.1 + dx * (p.1 - y))
    });
    (xx > 0.0).then(|| xy / xx)
}

fn is_usable((x, y): (f64, f64)) -> bool {
    x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against sums of binomial coefficients: for each n the largest k that is wide enough.
    #[test]
    fn intervals_have_the_coverage_they_state() {
        for n in MIN_VALUES..=60 {
            let choose = |k: usize| (0..k).fold(1_u128, |c, i| c * (n - i) as u128 / (i + 1) as u128);
            let coverage = |k: usize| 1.0 - 2.0 * (0..k).map(choose).sum::<u128>() as f64 / 2_f64.powi(n as i32);
            let rule = MedianRule::new(n);
            assert!((rule.coverage - coverage(rule.k)).abs() < 1e-12, "{n}");
            assert!(rule.coverage >= COVERAGE && coverage(rule.k + 1) < COVERAGE, "{n}");
        }
        let coverage = |n| MedianRule::new(n);
        assert_eq!((coverage(5).k, coverage(5).coverage), (1, 0.9375));
        assert_eq!((coverage(7).k, coverage(8).k, coverage(9).k), (1, 1, 2));
        // The normal approximation: k = n/2 − z √n/2, with z = 1.8627 for 15/16.
        let most = MedianRule::new(MAX_VALUES);
        assert!((most.k as f64 - (500.5 - 1.8627 * 1000_f64.sqrt() / 2.0)).abs() < 1.0, "{most:?}");
        assert!((most.coverage - COVERAGE).abs() < 0.01);
    }

    #[test]
    fn medians_by_hand() {
        let five = MedianRule::new(5);
        assert_eq!(five.of([5.0, 1.0, 9.0, 3.0, 4.0]), Median { median: 4.0, low: 1.0, high: 9.0 });
        let nine = MedianRule::new(9);
        let values = [9.0, 8.0, 7.0, 6.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        assert_eq!(nine.of(values), Median { median: 5.0, low: 2.0, high: 8.0 });
        assert_eq!(MedianRule::new(6).of([1.0, 2.0, 3.0, 5.0, 6.0, 7.0]).median, 4.0);
        // Fewer than the rule is for: never an interval without the median.
        assert_eq!(nine.of([1.0, 2.0]), Median { median: 1.5, low: 1.0, high: 2.0 });
        assert_eq!(five.of([]).median, 0.0);
    }

    /// Points on a power law: whatever is asked for lies on it.
    #[test]
    fn times_on_a_power_law() {
        for exponent in [-1.0_f64, -0.5, -2.0] {
            let points: Vec<_> = (0..6).map(|i| f64::from(1 << i)).map(|t| (t, 0.3 * t.powf(exponent))).collect();
            assert!((slope(&points).unwrap() - exponent).abs() < 1e-12);
            for t in [1.0_f64, 1.5, 2.0, 7.0, 31.0] {
                let (found, how) = time_to(&points, 10.0, 0.3 * t.powf(exponent) * (1.0 - 1e-12)).unwrap();
                assert!((found - 10.0 - t).abs() < 1e-9, "{found} {t}");
                assert_eq!(how, Found::Between);
            }
        }
        let points = [(1.0, 0.4), (2.0, 0.2), (4.0, 0.1)];
        assert_eq!(time_to(&points, 0.5, 0.01), Some((40.5, Found::Beyond)));
        assert_eq!(time_to(&points, 0.5, 0.4), Some((1.5, Found::AtMost)));
        assert_eq!(time_to(&points, 0.5, 3.0), Some((1.5, Found::AtMost)));
        assert_eq!(time_to(&points[2..], 0.0, 0.05), Some((8.0, Found::Beyond)));
    }

    #[test]
    fn the_last_crossing_counts_and_what_is_no_error_does_not() {
        // A stray sample at t = 4 lifts the error above the target again.
        let points = [(1.0, 0.4), (2.0, 0.1), (4.0, 0.4), (8.0, 0.1)];
        let (t, how) = time_to(&points, 0.0, 0.2).unwrap();
        assert!((t - 4.0 * 2_f64.sqrt()).abs() < 1e-12 && how == Found::Between, "{t}");
        let odd = [(1.0, 0.4), (2.0, 0.0), (3.0, -1.0), (4.0, f64::NAN), (0.0, 0.1), (5.0, f64::INFINITY)];
        assert_eq!(time_to(&odd, 0.0, 0.2), Some((2.0, Found::Beyond)));
        assert_eq!(time_to(&odd[1..], 0.0, 0.2), None);
        assert_eq!((slope(&odd), slope(&[]), slope(&[(2.0, 1.0), (2.0, 3.0)])), (None, None, None));
    }
}
