//! Randomness and circles for generated scenes, the same on every platform.
//!
//! Everything here is integer arithmetic or `+ − × ÷`, which IEEE 754 defines to the last bit. The `sin` of a platform's library is not:
//! one ulp could turn a printed digit, and a scene would no longer be the same file everywhere.

use glam::DVec3;

/// 2⁶⁴ divided by the golden ratio: the increment of SplitMix64 \[Steele2014\].
const WEYL: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finalizer of SplitMix64.
const fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Random numbers of one object: a function of what it is (`stream`) and which it is (`index`), so that objects do not
/// depend on the order or number of the others.
#[derive(Clone, Debug)]
pub(super) struct Random {
    counter: u64,
}

impl Random {
    pub(super) const fn new(stream: u64, index: u64) -> Self {
        Self { counter: mix(mix(stream.wrapping_mul(WEYL)) ^ index) }
    }

    const fn bits(&mut self) -> u64 {
        self.counter = self.counter.wrapping_add(WEYL);
        mix(self.counter)
    }

    /// Uniform in [0, 1).
    pub(super) const fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }

    /// Uniform in [a, b).
    pub(super) const fn between(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }

    /// Uniform in the unit ball.
    pub(super) fn in_ball(&mut self) -> DVec3 {
        loop {
            let p = DVec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            if p.length_squared() <= 1.0 {
                return p;
            }
        }
    }

    /// A uniform unit vector.
    pub(super) fn direction(&mut self) -> DVec3 {
        loop {
            let p = self.in_ball();
            // Close to the centre the direction would be coarse.
            if p.length_squared() > 1e-6 {
                return p.normalize();
            }
        }
    }
}

/// Cosine and sine of `turns` full turns, to about 10⁻¹³; exact for quarters.
pub(super) fn circle(turns: f64) -> [f64; 2] {
    let quarters = (turns - turns.floor()) * 4.0;
    let quarter = quarters.floor();
    let x = (quarters - quarter) * std::f64::consts::FRAC_PI_2;
    let (mut cos, mut sin) = (0.0, 0.0);
    let mut term = 1.0;
    for n in 0_u32..20 {
        match n % 4 {
            0 => cos += term,
            1 => sin += term,
            2 => cos -= term,
            _ => sin -= term,
        }
        term *= x / f64::from(n + 1);
    }
    match quarter as u8 % 4 {
        0 => [cos, sin],
        1 => [-sin, cos],
        2 => [-cos, -sin],
        _ => [sin, -cos],
    }
}

/// Gradient noise over the plane: smooth, 0 at the integers, mean 0, mostly within ±0.6.
pub(super) fn noise(x: f64, z: f64, stream: u64) -> f64 {
    let (i, k) = (x.floor(), z.floor());
    let (fx, fz) = (x - i, z - k);
    let corner = |di: f64, dk: f64| {
        // Lattice coordinates are small: 2³² columns are enough.
        let place = (((i + di) as i64) << 32) ^ ((k + dk) as i64 & 0xffff_ffff);
        let bits = mix(mix(stream.wrapping_mul(WEYL)) ^ place as u64);
        let component = |shift: u32| f64::from((bits >> shift) as u32) * (2.0 / 4_294_967_296.0) - 1.0;
        component(0) * (fx - di) + component(32) * (fz - dk)
    };
    let (u, w) = (fade(fx), fade(fz));
    let near = corner(0.0, 0.0) * (1.0 - u) + corner(1.0, 0.0) * u;
    let far = corner(0.0, 1.0) * (1.0 - u) + corner(1.0, 1.0) * u;
    near * (1.0 - w) + far * w
}

/// From 0 at t ≤ 0 to 1 at t ≥ 1, with two continuous derivatives.
pub(super) fn fade(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_circle_is_round() {
        for i in -40..=80 {
            let turns = f64::from(i) / 32.0;
            let (sin, cos) = (turns * std::f64::consts::TAU).sin_cos();
            let [c, s] = circle(turns);
            assert!((c - cos).abs() < 1e-12 && (s - sin).abs() < 1e-12, "{turns}: {c} {s}");
        }
        assert_eq!([0.0, 0.25, 0.5, 0.75].map(circle), [[1.0, 0.0], [-0.0, 1.0], [-1.0, -0.0], [0.0, -1.0]]);
    }

    #[test]
    fn noise_is_continuous_and_fills_its_range() {
        let (mut low, mut high) = (0.0_f64, 0.0_f64);
        for i in 0..40_000_u32 {
            let mut random = Random::new(1, u64::from(i));
            let (x, z) = (random.between(-50.0, 50.0), random.between(-50.0, 50.0));
            let n = noise(x, z, 2);
            assert!((noise(x + 1e-7, z - 1e-7, 2) - n).abs() < 1e-6, "{x} {z}");
            (low, high) = (low.min(n), high.max(n));
        }
        assert!(low < -0.5 && low > -1.5 && high > 0.5 && high < 1.5, "{low} {high}");
        assert_eq!(noise(3.0, -7.0, 2), 0.0);
    }
}
