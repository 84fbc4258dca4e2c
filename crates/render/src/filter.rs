//! Where on the film a sample falls.

use vdf_scene::ReconstructionFilter;

use crate::Sampler;

/// An offset from the pixel's corner (0, 0) drawn from the filter centred at (0.5, 0.5).
///
/// The filter is sampled instead of being used as a weight, as in pbrt-v4: each pixel is the plain mean of its own samples, so that
/// pixels, tiles and crops are independent. The expected image is that of the weighted sum; at the edge of
/// the image samples fall outside it, where the peer renormalizes.
#[inline]
pub fn sample_filter(filter: &ReconstructionFilter, sampler: &mut Sampler) -> [f64; 2] {
    match *filter {
        ReconstructionFilter::Box => sampler.next_2d(),
        ReconstructionFilter::Gaussian { stddev } => [0, 1].map(|_| 0.5 + sample_truncated_gaussian(stddev, sampler)),
    }
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
