//! Where on the film a sample falls, and what it is worth there.
//!
//! *Idea.* The filter is sampled instead of being used as a weight, as in pbrt-v4: each pixel is the plain mean of its own samples, so that
//! pixels, tiles and crops are independent. Filters with negative lobes are sampled by their magnitude, and the weight has their sign.
//!
//! *Guarantee.* The expected image is that of the normalized filter; a uniform image stays as it is. At the edge of the image samples fall
//! outside of it, where the peer renormalizes.
//!
//! *Cost.* Rejection from a rectangle where there is no inversion: two to four tries a coordinate.

use vdf_scene::ReconstructionFilter;

use crate::Sampler;

/// A filter, prepared for sampling. Separable: what follows is about one coordinate.
#[derive(Clone, Copy, Debug)]
pub struct PixelFilter {
    filter: ReconstructionFilter,
    /// ∫|f| / ∫f.
    magnitude: f64,
}

/// Where a sample falls, and its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSample {
    /// From the pixel's corner (0, 0), in pixels; the filter is centred at (0.5, 0.5).
    pub offset: [f64; 2],
    /// 1 but for filters with negative lobes; 1 on average.
    pub weight: f64,
}

impl PixelFilter {
    /// Prepares a filter.
    #[must_use]
    pub fn new(filter: &ReconstructionFilter) -> Self {
        let (r, n) = (radius(filter), 4096);
        let step = 2.0 * r / f64::from(n);
        let at = |i: i32| value(filter, (f64::from(i) + 0.5) * step - r);
        let (sum, magnitude) = (0..n).map(at).fold((0.0, 0.0), |(s, m), f: f64| (s + f, m + f.abs()));
        // Only a filter with negative lobes has a magnitude of its own; the midpoint rule errs by less than 10⁻⁶ there.
        let magnitude = if sum == magnitude { 1.0 } else { magnitude / sum };
        Self { filter: *filter, magnitude }
    }

    /// A sample in proportion to the filter's magnitude.
    #[inline]
    pub fn sample(&self, sampler: &mut Sampler) -> FilterSample {
        match self.filter {
            ReconstructionFilter::Box => FilterSample { offset: sampler.next_2d(), weight: 1.0 },
            ReconstructionFilter::Gaussian { stddev } => {
                let offset = [0, 1].map(|_| 0.5 + sample_truncated_gaussian(stddev, sampler));
                FilterSample { offset, weight: 1.0 }
            }
            ReconstructionFilter::Tent { radius } => {
                // The sum of two uniform numbers has the density of a tent.
                let offset = [0, 1].map(|_| 0.5 + radius * (sampler.next_1d() + sampler.next_1d() - 1.0));
                FilterSample { offset, weight: 1.0 }
            }
            ReconstructionFilter::Mitchell { .. }
            | ReconstructionFilter::CatmullRom
            | ReconstructionFilter::Lanczos { .. } => {
                let [(x, wx), (y, wy)] = [0, 1].map(|_| self.sample_magnitude(sampler));
                FilterSample { offset: [0.5 + x, 0.5 + y], weight: wx * wy }
            }
        }
    }

    /// By rejection: all these filters are at most `peak` in magnitude.
    fn sample_magnitude(&self, sampler: &mut Sampler) -> (f64, f64) {
        let (r, peak) = (radius(&self.filter), peak(&self.filter));
        loop {
            let x = r * (2.0 * sampler.next_1d() - 1.0);
            let f = value(&self.filter, x);
            if sampler.next_1d() * peak < f.abs() {
                return (x, self.magnitude.copysign(f));
            }
        }
    }
}

/// Half the width of what is not zero, in pixels.
fn radius(filter: &ReconstructionFilter) -> f64 {
    match *filter {
        ReconstructionFilter::Box => 0.5,
        ReconstructionFilter::Gaussian { stddev } => 4.0 * stddev,
        ReconstructionFilter::Tent { radius } => radius,
        ReconstructionFilter::Mitchell { .. } | ReconstructionFilter::CatmullRom => 2.0,
        ReconstructionFilter::Lanczos { lobes } => lobes.into(),
    }
}

/// The filter at `x` pixels from its middle, not normalized.
fn value(filter: &ReconstructionFilter, x: f64) -> f64 {
    let x = x.abs();
    if x >= radius(filter) {
        return 0.0;
    }
    match *filter {
        ReconstructionFilter::Box => 1.0,
        ReconstructionFilter::Gaussian { stddev } => (-0.5 * (x / stddev).powi(2)).exp() - (-8.0_f64).exp(),
        ReconstructionFilter::Tent { radius } => 1.0 - x / radius,
        ReconstructionFilter::Mitchell { b, c } => mitchell(b, c, x),
        ReconstructionFilter::CatmullRom => mitchell(0.0, 0.5, x),
        ReconstructionFilter::Lanczos { lobes } => sinc(x) * sinc(x / f64::from(lobes)),
    }
}

/// A bound of the magnitude.
fn peak(filter: &ReconstructionFilter) -> f64 {
    match *filter {
        // On [0, 1] and on [1, 2] the sum of the magnitudes of the coefficients times the powers of 1 and 2 would be too coarse: the cubic is
        // largest at its ends or where its slope is zero.
        ReconstructionFilter::Mitchell { b, c } => mitchell_peak(b, c),
        ReconstructionFilter::CatmullRom => mitchell_peak(0.0, 0.5),
        _ => 1.0,
    }
}

/// The two cubics of Mitchell and Netravali for |x| < 1 and |x| < 2, highest power first.
fn mitchell_cubics(b: f64, c: f64) -> [[f64; 4]; 2] {
    [
        [12.0 - 9.0 * b - 6.0 * c, -18.0 + 12.0 * b + 6.0 * c, 0.0, 6.0 - 2.0 * b],
        [-b - 6.0 * c, 6.0 * b + 30.0 * c, -12.0 * b - 48.0 * c, 8.0 * b + 24.0 * c],
    ]
}

fn cubic([a, b, c, d]: [f64; 4], x: f64) -> f64 {
    (((a * x + b) * x + c) * x + d) / 6.0
}

fn mitchell(b: f64, c: f64, x: f64) -> f64 {
    cubic(mitchell_cubics(b, c)[usize::from(x >= 1.0)], x)
}

fn mitchell_peak(b: f64, c: f64) -> f64 {
    let mut peak = 0.0_f64;
    for (coefficients, from) in mitchell_cubics(b, c).into_iter().zip([0.0, 1.0]) {
        let [a, b, c, _] = coefficients;
        let root = (b * b - 3.0 * a * c).max(0.0).sqrt();
        let flat = [(-b + root) / (3.0 * a), (-b - root) / (3.0 * a)];
        let inside = flat.into_iter().filter(|x| (from..=from + 1.0).contains(x));
        peak = inside.chain([from, from + 1.0]).map(|x| cubic(coefficients, x).abs()).fold(peak, f64::max);
    }
    // Beyond the rounding of the roots.
    peak * (1.0 + 1e-9)
}

fn sinc(x: f64) -> f64 {
    let y = std::f64::consts::PI * x;
    // Below 10⁻⁴ the next term of the series, y²/6, is less than 2·10⁻⁹, and the first neglected one far below rounding.
    if y < 1e-4 { 1.0 - y * y / 6.0 } else { y.sin() / y }
}

/// Draws x with density proportional to max(0, exp(−x²/2σ²) − exp(−r²/2σ²)), r = 4σ, by rejection (31 % are accepted).
fn sample_truncated_gaussian(stddev: f64, sampler: &mut Sampler) -> f64 {
    let floor = (-8.0_f64).exp();
    loop {
        let z = 8.0 * sampler.next_1d() - 4.0;
        if sampler.next_1d() * (1.0 - floor) < (-0.5 * z * z).exp() - floor {
            return z * stddev;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NEGATIVE: [ReconstructionFilter; 5] = [
        ReconstructionFilter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 },
        ReconstructionFilter::Mitchell { b: 0.0, c: 1.0 },
        ReconstructionFilter::CatmullRom,
        ReconstructionFilter::Lanczos { lobes: 1 },
        ReconstructionFilter::Lanczos { lobes: 3 },
    ];

    #[test]
    fn no_value_exceeds_the_peak() {
        for filter in NEGATIVE {
            for i in 0..100_000 {
                let x = f64::from(i) * 1e-4;
                assert!(value(&filter, x).abs() <= peak(&filter), "{filter:?} at {x}");
            }
        }
        // They keep what is constant: the values at whole distances from any point add up to one (Mitchell and Netravali 1988).
        let sum: f64 = (-3..=3).map(|k| value(&NEGATIVE[0], f64::from(k) + 0.3)).sum();
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
    }

    /// The weighted mean of a function of x over the samples is its mean under the filter: 10⁶ samples, five standard errors (false alarm
    /// below 6·10⁻⁷ a case; the seed is fixed).
    #[test]
    fn weighted_samples_have_the_moments_of_the_filter() {
        for filter in NEGATIVE {
            let prepared = PixelFilter::new(&filter);
            let n = 200_000;
            let step = 2.0 * radius(&filter) / f64::from(n);
            let mean = |g: fn(f64) -> f64| {
                let points = (0..n).map(|i| (f64::from(i) + 0.5) * step - radius(&filter));
                let (sum, weight) = points.fold((0.0, 0.0), |(s, w), x| {
                    let f = value(&filter, x);
                    (s + f * g(x), w + f)
                });
                sum / weight
            };
            for (name, g) in [("1", (|_| 1.0) as fn(f64) -> f64), ("x²", |x| x * x), ("|x|", f64::abs)] {
                let (mut sum, mut sum2) = (0.0, 0.0);
                let samples = 1_000_000;
                for i in 0..samples {
                    let s = prepared.sample(&mut Sampler::new(53, i, 0, 0));
                    let y = s.weight * g(s.offset[0] - 0.5);
                    sum += y;
                    sum2 += y * y;
                }
                let found = sum / f64::from(samples);
                let error = ((sum2 / f64::from(samples) - found * found) / f64::from(samples)).sqrt();
                let expected = mean(g);
                assert!((found - expected).abs() <= 5.0 * error + 1e-6, "{filter:?} {name}: {found}, not {expected}");
            }
        }
    }
}
