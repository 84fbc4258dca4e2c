//! Random numbers as a pure function of (seed, pixel, sample, dimension).
//!
//! Idea: SplitMix64 \[Steele2014\] used as a counter-based generator: a 128-bit key is hashed from seed, pixel and
//! sample; dimension i is the finalizer of the i-th element of the key's Weyl sequence, with the key's other half mixed in
//! between the rounds so that no two keys share a sequence. No state is shared, so nothing depends on threads or tiles.
//!
//! `sobol` fills the pixel instead: the first [`SOBOL_DIMENSIONS`] numbers of a pixel's samples are the coordinates of a Sobol sequence, shuffled and
//! scrambled after Owen by hashing, with a seed for each pixel \[Burley2020\]. So each sample alone is uniform, and all of them together are even.
//! The sequence has 23 bits; those below, and all numbers after its last dimension, are independent. After 2¹⁶ samples another one begins.

/// How the samples of a pixel are spread; any is a function of (seed, pixel, sample, dimension) alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SamplerKind {
    /// Each for itself.
    Independent,
    /// By a Sobol sequence with Owen scrambling: together they fill the pixel, which is less noisy. Numbers of samples that are powers of two
    /// fill it best.
    #[default]
    Sobol,
}

impl SamplerKind {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Independent, Self::Sobol];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Independent => "independent",
            Self::Sobol => "sobol",
        }
    }
}

/// The random numbers of one sample of one pixel. Each call takes the next dimension.
#[derive(Clone, Debug)]
pub struct Sampler {
    counter: u64,
    key: u64,
    sobol: Option<Sobol>,
}

/// The numbers of a Sobol sequence that come next.
#[derive(Clone, Debug)]
struct Sobol {
    index: u32,
    seed: u32,
    dimension: u32,
    /// So many are even, at most [`SOBOL_DIMENSIONS`].
    even: u32,
    /// The four dimensions that this one is among.
    four: [f32; 4],
}

/// So many dimensions of a path are even: those of about ten events.
const SOBOL_DIMENSIONS: u32 = 64;

/// 2⁶⁴ divided by the golden ratio: the increment of SplitMix64.
const WEYL: u64 = 0x9e37_79b9_7f4a_7c15;

/// What numbers beside the sequence differ from it by: not a multiple of its step that it comes to.
const ASIDE: u64 = 0x5851_f42d_4c95_7f2d;

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
        Self { counter: mix(key ^ pixel.rotate_left(32), WEYL), key, sobol: None }
    }

    /// The numbers of the same sample, spread in this way.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "a hash")]
    pub fn of_kind(kind: SamplerKind, seed: u64, x: u32, y: u32, sample: u32) -> Self {
        let sobol = match kind {
            SamplerKind::Independent => None,
            SamplerKind::Sobol => {
                let pixel = mix((u64::from(y) << 32) | u64::from(x), seed ^ WEYL);
                let seed = mix(pixel.wrapping_add(u64::from(sample >> 16)), seed) as u32;
                Some(Sobol { index: sample & 0xffff, seed, dimension: 0, even: SOBOL_DIMENSIONS, four: [0.0; 4] })
            }
        };
        Self { sobol, ..Self::new(seed, x, y, sample) }
    }

    /// The same numbers, but for those after the first `dimensions`, a multiple of four: they are independent in any case.
    #[must_use]
    pub(crate) fn even_up_to(mut self, dimensions: u32) -> Self {
        if let Some(sobol) = &mut self.sobol {
            sobol.even = dimensions.min(SOBOL_DIMENSIONS);
        }
        self
    }

    /// Uniform in [0, 1), a multiple of 2⁻⁵³.
    #[inline]
    pub fn next_1d(&mut self) -> f64 {
        self.counter = self.counter.wrapping_add(WEYL);
        #[allow(clippy::cast_precision_loss, reason = "53 bits are exact")]
        let random = (mix(self.counter, self.key) >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0);
        match &mut self.sobol {
            Some(sobol) if sobol.dimension != sobol.even => sobol.next_1d(random),
            _ => random,
        }
    }

    /// Whether the next number is one of those that are even together.
    #[inline]
    pub(crate) fn is_even(&self) -> bool {
        self.sobol.as_ref().is_some_and(|sobol| sobol.dimension != sobol.even)
    }

    /// A uniform number beside the others: it takes none of them, and is the same until one is taken.
    #[inline]
    pub(crate) fn aside(&self) -> f64 {
        #[allow(clippy::cast_precision_loss, reason = "53 bits are exact")]
        let random = (mix(self.counter ^ ASIDE, self.key) >> 11) as f64;
        random * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Passes over so many numbers.
    #[inline]
    pub(crate) fn skip(&mut self, numbers: u32) {
        self.counter = self.counter.wrapping_add(WEYL.wrapping_mul(numbers.into()));
        if let Some(sobol) = &mut self.sobol {
            sobol.skip(numbers);
        }
    }

    /// Two uniform numbers in [0, 1).
    #[inline]
    pub fn next_2d(&mut self) -> [f64; 2] {
        [self.next_1d(), self.next_1d()]
    }
}

impl Sobol {
    #[inline]
    fn take_four(&mut self) {
        self.four = sobol_burley::sample_4d(self.index, self.dimension / 4, self.seed);
    }

    #[inline]
    fn skip(&mut self, numbers: u32) {
        let last = self.dimension;
        self.dimension = (last + numbers).min(self.even);
        // In the middle of another four than those that are there; a four is taken with its first number.
        if !self.dimension.is_multiple_of(4) && (last.is_multiple_of(4) || self.dimension / 4 != last / 4) {
            self.take_four();
        }
    }

    /// The next number, one of those that are even, with the bits of `random` below those that the sequence has.
    #[inline(never)]
    fn next_1d(&mut self, random: f64) -> f64 {
        const STEP: f64 = 1.0 / 8_388_608.0;
        if self.dimension.is_multiple_of(4) {
            self.take_four();
        }
        let even = f64::from(self.four[(self.dimension % 4) as usize]);
        self.dimension += 1;
        // So many bits that the sum is exact, and below 1. `floor` would be a call where the processor may be an old one.
        #[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "below 2³⁰")]
        let low = (random * (STEP.recip() * 128.0)) as i32 as f64;
        even + low * (STEP * STEP / 128.0)
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

    /// To pass over numbers is to take them and not to look.
    #[test]
    fn numbers_can_be_passed_over() {
        for kind in SamplerKind::ALL {
            for before in 0..SOBOL_DIMENSIONS + 5 {
                for skipped in 0..12 {
                    let mut s = Sampler::of_kind(kind, 3, 1, 2, 9).even_up_to(if skipped % 2 == 0 { 12 } else { 64 });
                    (0..before).for_each(|_| _ = s.next_1d());
                    let mut taken = s.clone();
                    s.skip(skipped);
                    (0..skipped).for_each(|_| _ = taken.next_1d());
                    for _ in 0..6 {
                        assert_eq!(s.next_1d(), taken.next_1d(), "{kind:?}: {skipped} after {before}");
                    }
                }
            }
        }
    }

    /// A number beside the others takes none of them, and is independent of the one before and of the next: χ² over 256 cells of pairs, bounds as below.
    #[test]
    fn a_number_beside_the_others_is_independent() {
        let mut cells = [[0_u32; 256]; 2];
        let n = 1 << 16;
        for i in 0..n {
            let mut s = Sampler::of_kind(SamplerKind::Sobol, 9, i % 256, i / 256, 0).even_up_to(0);
            let before = s.next_1d();
            let aside = s.aside();
            assert_eq!(aside, s.aside());
            let next = s.next_1d();
            assert_ne!(aside, s.aside());
            for (cells, other) in cells.iter_mut().zip([before, next]) {
                cells[(aside * 16.0) as usize * 16 + (other * 16.0) as usize] += 1;
            }
        }
        let expected = f64::from(n) / 256.0;
        for cells in cells {
            let chi2: f64 = cells.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
            assert!(chi2 < 400.0, "χ² = {chi2}");
        }
    }

    /// Numbers are those of the sequence up to a dimension, and independent ones after it.
    #[test]
    fn numbers_are_even_up_to_a_dimension() {
        let take = |mut s: Sampler| -> Vec<f64> { (0..20).map(|_| s.next_1d()).collect() };
        let [few, all, none] = [(SamplerKind::Sobol, 12), (SamplerKind::Sobol, 64), (SamplerKind::Independent, 12)]
            .map(|(kind, even)| take(Sampler::of_kind(kind, 3, 1, 2, 9).even_up_to(even)));
        assert_eq!(few[..12], all[..12]);
        assert_eq!(few[12..], none[12..]);
        assert!((0..12).all(|i| all[i] != none[i]));
        let mut sampler = Sampler::of_kind(SamplerKind::Sobol, 3, 1, 2, 9).even_up_to(12);
        for i in 0..20 {
            assert_eq!(sampler.is_even(), i < 12);
            sampler.next_1d();
        }
        assert!(!Sampler::new(3, 1, 2, 9).is_even());
    }

    #[test]
    fn stays_in_the_half_open_unit_interval() {
        let mut s = Sampler::new(0, 0, 0, 0);
        assert!((0..100_000).map(|_| s.next_1d()).all(|x| (0.0..1.0).contains(&x)));
    }

    /// The first 2ᵏ samples of a pixel lie one in each of 2ᵏ strata, in every dimension that is even, and of any two successive ones each
    /// elementary rectangle of the first two holds one.
    #[test]
    fn a_pixel_is_filled() {
        let n = 1024;
        let points: Vec<Vec<f64>> = (0..n)
            .map(|sample| {
                let mut s = Sampler::of_kind(SamplerKind::Sobol, 5, 17, 4, sample);
                (0..SOBOL_DIMENSIONS).map(|_| s.next_1d()).collect()
            })
            .collect();
        for k in 1..=10 {
            let strata = 1 << k;
            let first = &points[..strata];
            let index = |x: f64, strata: usize| (x * strata as f64) as usize;
            for d in 0..SOBOL_DIMENSIONS as usize {
                let mut seen = vec![false; strata];
                first.iter().for_each(|p| seen[index(p[d], strata)] = true);
                assert!(seen.iter().all(|&s| s), "dimension {d}, {strata} samples");
            }
            for of_x in 0..=k {
                let (columns, rows) = (1 << of_x, 1 << (k - of_x));
                let mut seen = vec![false; strata];
                first.iter().for_each(|p| seen[index(p[0], columns) * rows + index(p[1], rows)] = true);
                assert!(seen.iter().all(|&s| s), "{columns} × {rows}");
            }
        }
    }

    /// Each sample alone is uniform over the pixels, also in its low bits: χ² over 256 cells of successive pairs, in the first dimensions, the
    /// last even ones and those beyond, for samples before and after the end of a sequence. Bounds as above.
    #[test]
    fn each_sample_of_a_filled_pixel_is_uniform() {
        let n = 1 << 15;
        for (skipped, sample, scale) in [
            (0, 0, 1.0),
            (0, 3, 1.0),
            (0, 65_536, 1.0),
            (30, 1000, 1.0),
            (63, 7, 1.0),
            (80, 7, 1.0),
            (0, 3, 8_388_608.0),
        ] {
            let mut cells = [0_u32; 256];
            for i in 0..n {
                let mut s = Sampler::of_kind(SamplerKind::Sobol, 7, i % 256, i / 256, sample);
                (0..skipped).for_each(|_| _ = s.next_1d());
                let [a, b] = s.next_2d().map(|x| {
                    assert!((0.0..1.0).contains(&x));
                    (x * scale).fract()
                });
                cells[(a * 16.0) as usize * 16 + (b * 16.0) as usize] += 1;
            }
            let expected = f64::from(n) / 256.0;
            let chi2: f64 = cells.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
            assert!(chi2 < 400.0, "sample {sample} from dimension {skipped}, {scale}: χ² = {chi2}");
        }
    }

    /// Another pixel, seed or block of samples has another sequence; the independent numbers are as ever.
    #[test]
    fn kinds_are_functions_of_their_arguments() {
        let take = |kind, seed, x, y, sample| Sampler::of_kind(kind, seed, x, y, sample).next_2d();
        let sobol = take(SamplerKind::Sobol, 1, 2, 3, 4);
        assert_eq!(sobol, take(SamplerKind::Sobol, 1, 2, 3, 4));
        for (seed, x, y, sample) in [(0, 2, 3, 4), (1, 3, 2, 4), (1, 2, 3, 5), (1, 2, 3, 4 + 65_536)] {
            assert_ne!(sobol, take(SamplerKind::Sobol, seed, x, y, sample));
        }
        assert_eq!(take(SamplerKind::Independent, 1, 2, 3, 4), Sampler::new(1, 2, 3, 4).next_2d());
    }
}
