//! Random numbers as a pure function of (seed, pixel, sample, dimension).
//!
//! Idea: SplitMix64 \[Steele2014\] used as a counter-based generator: a 128-bit key is hashed from seed, pixel and
//! sample; dimension i is the finalizer of the i-th element of the key's Weyl sequence, with the key's other half mixed in
//! between the rounds so that no two keys share a sequence. No state is shared, so nothing depends on threads or tiles.

/// The random numbers of one sample of one pixel. Each call takes the next dimension.
#[derive(Clone, Debug)]
pub struct Sampler {
    counter: u64,
    key: u64,
}

/// 2⁶⁴ divided by the golden ratio: the increment of SplitMix64.
const WEYL: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finalizer of SplitMix64 (Stafford's variant 13), with `key` mixed in between its rounds.
#[inline]
const fn mix(mut z: u64, key: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z ^= key;
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Sampler {
    /// The numbers for sample `sample` of pixel (`x`, `y`) of the full film.
    #[must_use]
    pub fn new(seed: u64, x: u32, y: u32, sample: u32) -> Self {
        let pixel = mix((u64::from(y) << 32) | u64::from(x), seed);
        let key = mix(pixel.wrapping_add(WEYL.wrapping_mul(u64::from(sample) + 1)), seed.rotate_left(32));
        Self { counter: mix(key ^ pixel.rotate_left(32), WEYL), key }
    }

    /// Uniform in [0, 1), a multiple of 2⁻⁵³.
    #[inline]
    pub fn next_1d(&mut self) -> f64 {
        self.counter = self.counter.wrapping_add(WEYL);
        #[allow(clippy::cast_precision_loss, reason = "53 bits are exact")]
        let bits = (mix(self.counter, self.key) >> 11) as f64;
        bits * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Two uniform numbers in [0, 1).
    #[inline]
    pub fn next_2d(&mut self) -> [f64; 2] {
        [self.next_1d(), self.next_1d()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_a_function_of_its_arguments() {
        let take = |mut s: Sampler| [s.next_1d(), s.next_1d(), s.next_1d()];
        let reference = take(Sampler::new(1, 2, 3, 4));
        assert_eq!(reference, take(Sampler::new(1, 2, 3, 4)));
        for other in
            [Sampler::new(0, 2, 3, 4), Sampler::new(1, 3, 2, 4), Sampler::new(1, 2, 3, 5), Sampler::new(1, 2, 4, 3)]
        {
            assert_ne!(reference, take(other));
        }
    }

    /// χ² over 256 cells of 2D pairs, taken across pixels, samples and dimensions in turn: 255 degrees of freedom, mean 255, standard
    /// deviation 22.6. The bound of 400 is 6.4 σ: false alarm below 10⁻⁸ (and the seed is fixed).
    #[test]
    fn pairs_are_uniform_across_pixels_samples_and_dimensions() {
        let n = 1 << 16;
        let draws: [Box<dyn Fn(u32) -> [f64; 2]>; 4] = [
            Box::new(|i| Sampler::new(7, i % 256, i / 256, 0).next_2d()),
            Box::new(|i| Sampler::new(7, 5, 9, i).next_2d()),
            Box::new(|i| [Sampler::new(7, i, 0, 0).next_1d(), Sampler::new(7, i + 1, 0, 0).next_1d()]),
            Box::new(|i| Sampler::new(u64::from(i), 0, 0, 0).next_2d()),
        ];
        for (k, draw) in draws.iter().enumerate() {
            let mut cells = [0_u32; 256];
            for i in 0..n {
                let [a, b] = draw(i);
                cells[(a * 16.0) as usize * 16 + (b * 16.0) as usize] += 1;
            }
            let expected = f64::from(n) / 256.0;
            let chi2: f64 = cells.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
            assert!(chi2 < 400.0, "draw {k}: χ² = {chi2}");
        }
    }

    #[test]
    fn stays_in_the_half_open_unit_interval() {
        let mut s = Sampler::new(0, 0, 0, 0);
        assert!((0..100_000).map(|_| s.next_1d()).all(|x| (0.0..1.0).contains(&x)));
    }
}
