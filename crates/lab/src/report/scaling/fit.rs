//! Exponents: straight lines through logarithms.

/// y ∝ x^exponent, fitted to points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PowerLaw {
    /// Slope of the least-squares line through (ln x, ln y).
    pub(super) exponent: f64,
    /// Its standard error, from the scatter of the points about the line; `None` for two points, which have none.
    ///
    /// A cost with a constant or logarithmic part is no straight line: then this is mostly the bend, not noise.
    pub(super) standard_error: Option<f64>,
    /// Slope between the last two points: where the largest part of the cost shows most.
    pub(super) last_step: f64,
}

impl PowerLaw {
    /// Fits points (x, y), the largest x last. What is not positive and finite is left out; `None` if fewer than two
    /// different x remain.
    pub(super) fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let usable = |v: f64| v > 0.0 && v.is_finite();
        let logs: Vec<(f64, f64)> =
            points.iter().filter(|(x, y)| usable(*x) && usable(*y)).map(|(x, y)| (x.ln(), y.ln())).collect();
        let [.., before, last] = logs[..] else { return None };
        let n = logs.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / n;
        let (x, y) = (mean(|p| p.0), mean(|p| p.1));
        let sum = |of: &dyn Fn(f64, f64) -> f64| logs.iter().map(|p| of(p.0 - x, p.1 - y)).sum::<f64>();
        let spread = sum(&|dx, _| dx * dx);
        if spread == 0.0 || before.0 == last.0 {
            return None;
        }
        let exponent = sum(&|dx, dy| dx * dy) / spread;
        let residual = sum(&|dx, dy| (dy - exponent * dx).powi(2));
        Some(Self {
            exponent,
            standard_error: (logs.len() > 2).then(|| (residual / (n - 2.0) / spread).sqrt()),
            last_step: (last.1 - before.1) / (last.0 - before.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const XS: [f64; 5] = [1e4, 3e4, 1e5, 4e5, 1e6];

    fn fit(y: impl Fn(f64) -> f64) -> PowerLaw {
        PowerLaw::fit(&XS.map(|x| (x, y(x)))).unwrap()
    }

    #[test]
    fn power_laws_are_found() {
        for exponent in [-1.0, 0.0, 0.5, 1.0, 3.0] {
            for factor in [1e-9, 1.0, 7e12] {
                let f = fit(|x| factor * x.powf(exponent));
                assert!((f.exponent - exponent).abs() < 1e-12 && (f.last_step - exponent).abs() < 1e-12, "{f:?}");
                assert!(f.standard_error.unwrap() < 1e-12, "{f:?}");
            }
        }
    }

    #[test]
    fn a_bend_shows_in_the_last_step() {
        let constant = fit(|x| 1e5 + x);
        assert!(constant.exponent < 0.6 && constant.last_step > 0.85 && constant.standard_error.unwrap() > 0.05);
        let n_log_n = fit(|x| x * x.ln());
        let slope = |x: f64| 1.0 + 1.0 / x.ln();
        assert!(n_log_n.last_step < n_log_n.exponent);
        assert!((slope(1e6)..slope(4e5)).contains(&n_log_n.last_step), "{n_log_n:?}");
    }

    /// By hand: ln x = 0, 1, 2, 3 and ln y = 0, 1, 1, 2. Slope 3/5, residuals ∓0.1 ±0.3 in pairs, their squares' sum
    /// 0.2, so the standard error is √(0.2 / 2 / 5).
    #[test]
    fn the_standard_error_is_that_of_a_slope() {
        let points = [(0.0, 0.0), (1.0, 1.0), (2.0, 1.0), (3.0, 2.0)].map(|(x, y): (f64, f64)| (x.exp(), y.exp()));
        let f = PowerLaw::fit(&points).unwrap();
        assert!((f.exponent - 0.6).abs() < 1e-12 && (f.last_step - 1.0).abs() < 1e-12, "{f:?}");
        assert!((f.standard_error.unwrap() - 0.02_f64.sqrt()).abs() < 1e-12, "{f:?}");
    }

    #[test]
    fn few_and_odd_points() {
        let two = PowerLaw::fit(&[(1.0, 3.0), (2.0, 6.0)]).unwrap();
        assert!((two.exponent - 1.0).abs() < 1e-12 && two.standard_error.is_none());
        for points in [&[][..], &[(1.0, 1.0)], &[(2.0, 1.0), (2.0, 3.0)], &[(1.0, 0.0), (2.0, 1.0)]] {
            assert_eq!(PowerLaw::fit(points), None, "{points:?}");
        }
        let odd = [(0.0, 1.0), (1.0, 1.0), (1.5, f64::NAN), (2.0, 4.0), (4.0, f64::INFINITY)];
        assert!((PowerLaw::fit(&odd).unwrap().exponent - 2.0).abs() < 1e-12);
    }
}
