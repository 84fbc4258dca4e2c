//! Eight numbers in single precision, or four in double, that are computed with at once.
//!
//! *Idea:* every x86-64 has registers of 128 bits, and nearly every one since 2013 has some of 256 (AVX2), which take the
//! boxes of a whole node. The hierarchy is compiled for both, and [`pulp`] says once a build which the machine has.
//!
//! *Guarantee:* the same results on both, bit by bit: sums and products are not contracted.

use glam::Vec4;
use pulp::{Arch, Scalar, Simd, WithSimd};

/// What is compiled for each kind of registers.
pub(super) trait InLanes {
    type Output;

    fn run(self, lanes: impl Lanes) -> Self::Output;
}

/// Runs it with the registers of the machine.
#[inline(always)]
pub(super) fn dispatch<Q: InLanes>(arch: Arch, query: Q) -> Q::Output {
    match arch {
        #[cfg(target_arch = "x86_64")]
        Arch::V3(lanes) => Simd::vectorize(lanes, With { lanes, query }),
        _ => query.run(Scalar),
    }
}

struct With<L, Q> {
    lanes: L,
    query: Q,
}

impl<L: Lanes, Q: InLanes> WithSimd for With<L, Q> {
    type Output = Q::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Q::Output {
        self.query.run(self.lanes)
    }
}

/// What is computed with, side by side. Comparisons give a bit for each lane, 0 where one is not a number. `min` and
/// `max` of two of which one is not a number are one of the two.
pub(super) trait Lanes: Copy {
    /// Eight numbers in single precision.
    type Singles: Copy;
    /// Four in double precision.
    type Doubles: Copy;

    fn singles(self, of: &[Vec4; 2]) -> Self::Singles;
    fn splat(self, x: f32) -> Self::Singles;
    fn array(self, a: Self::Singles) -> [f32; 8];
    fn sub(self, a: Self::Singles, b: Self::Singles) -> Self::Singles;
    fn mul(self, a: Self::Singles, b: Self::Singles) -> Self::Singles;
    fn min(self, a: Self::Singles, b: Self::Singles) -> Self::Singles;
    fn max(self, a: Self::Singles, b: Self::Singles) -> Self::Singles;
    fn at_most(self, a: Self::Singles, b: Self::Singles) -> u32;

    fn doubles(self, of: &[f32; 4]) -> Self::Doubles;
    fn splat_double(self, x: f64) -> Self::Doubles;
    fn array_of_doubles(self, a: Self::Doubles) -> [f64; 4];
    fn add_doubles(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    fn sub_doubles(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    fn mul_doubles(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    fn min_doubles(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    fn max_doubles(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    fn less_doubles(self, a: Self::Doubles, b: Self::Doubles) -> u32;
}

#[inline(always)]
fn each(a: [f64; 4], b: [f64; 4], f: impl Fn(f64, f64) -> f64) -> [f64; 4] {
    [f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2]), f(a[3], b[3])]
}

/// Registers that every machine has.
impl Lanes for Scalar {
    type Singles = [Vec4; 2];
    type Doubles = [f64; 4];

    #[inline(always)]
    fn singles(self, of: &[Vec4; 2]) -> [Vec4; 2] {
        *of
    }

    #[inline(always)]
    fn splat(self, x: f32) -> [Vec4; 2] {
        [Vec4::splat(x); 2]
    }

    #[inline(always)]
    fn array(self, a: [Vec4; 2]) -> [f32; 8] {
        bytemuck::cast(a)
    }

    #[inline(always)]
    fn sub(self, a: [Vec4; 2], b: [Vec4; 2]) -> [Vec4; 2] {
        [a[0] - b[0], a[1] - b[1]]
    }

    #[inline(always)]
    fn mul(self, a: [Vec4; 2], b: [Vec4; 2]) -> [Vec4; 2] {
        [a[0] * b[0], a[1] * b[1]]
    }

    #[inline(always)]
    fn min(self, a: [Vec4; 2], b: [Vec4; 2]) -> [Vec4; 2] {
        [a[0].min(b[0]), a[1].min(b[1])]
    }

    #[inline(always)]
    fn max(self, a: [Vec4; 2], b: [Vec4; 2]) -> [Vec4; 2] {
        [a[0].max(b[0]), a[1].max(b[1])]
    }

    #[inline(always)]
    fn at_most(self, a: [Vec4; 2], b: [Vec4; 2]) -> u32 {
        a[0].cmple(b[0]).bitmask() | a[1].cmple(b[1]).bitmask() << 4
    }

    #[inline(always)]
    fn doubles(self, of: &[f32; 4]) -> [f64; 4] {
        of.map(f64::from)
    }

    #[inline(always)]
    fn splat_double(self, x: f64) -> [f64; 4] {
        [x; 4]
    }

    #[inline(always)]
    fn array_of_doubles(self, a: [f64; 4]) -> [f64; 4] {
        a
    }

    #[inline(always)]
    fn add_doubles(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn sub_doubles(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn mul_doubles(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn min_doubles(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max_doubles(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn less_doubles(self, a: [f64; 4], b: [f64; 4]) -> u32 {
        let less = |i: usize| u32::from(a[i] < b[i]) << i;
        less(0) | less(1) | less(2) | less(3)
    }
}

#[cfg(target_arch = "x86_64")]
mod wide {
    use core::arch::x86_64::{__m128, __m256, __m256d, _CMP_LE_OQ, _CMP_LT_OQ};

    use glam::Vec4;
    use pulp::x86::V3;

    use super::Lanes;

    #[allow(clippy::cast_sign_loss, reason = "a few bits")]
    impl Lanes for V3 {
        type Singles = __m256;
        type Doubles = __m256d;

        #[inline(always)]
        fn singles(self, of: &[Vec4; 2]) -> __m256 {
            bytemuck::cast(*of)
        }

        #[inline(always)]
        fn splat(self, x: f32) -> __m256 {
            self.avx._mm256_set1_ps(x)
        }

        #[inline(always)]
        fn array(self, a: __m256) -> [f32; 8] {
            bytemuck::cast(a)
        }

        #[inline(always)]
        fn sub(self, a: __m256, b: __m256) -> __m256 {
            self.avx._mm256_sub_ps(a, b)
        }

        #[inline(always)]
        fn mul(self, a: __m256, b: __m256) -> __m256 {
            self.avx._mm256_mul_ps(a, b)
        }

        #[inline(always)]
        fn min(self, a: __m256, b: __m256) -> __m256 {
            self.avx._mm256_min_ps(a, b)
        }

        #[inline(always)]
        fn max(self, a: __m256, b: __m256) -> __m256 {
            self.avx._mm256_max_ps(a, b)
        }

        #[inline(always)]
        fn at_most(self, a: __m256, b: __m256) -> u32 {
            self.avx._mm256_movemask_ps(self.avx._mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u32
        }

        #[inline(always)]
        fn doubles(self, of: &[f32; 4]) -> __m256d {
            self.avx._mm256_cvtps_pd(bytemuck::cast::<[f32; 4], __m128>(*of))
        }

        #[inline(always)]
        fn splat_double(self, x: f64) -> __m256d {
            self.avx._mm256_set1_pd(x)
        }

        #[inline(always)]
        fn array_of_doubles(self, a: __m256d) -> [f64; 4] {
            bytemuck::cast(a)
        }

        #[inline(always)]
        fn add_doubles(self, a: __m256d, b: __m256d) -> __m256d {
            self.avx._mm256_add_pd(a, b)
        }

        #[inline(always)]
        fn sub_doubles(self, a: __m256d, b: __m256d) -> __m256d {
            self.avx._mm256_sub_pd(a, b)
        }

        #[inline(always)]
        fn mul_doubles(self, a: __m256d, b: __m256d) -> __m256d {
            self.avx._mm256_mul_pd(a, b)
        }

        #[inline(always)]
        fn min_doubles(self, a: __m256d, b: __m256d) -> __m256d {
            self.avx._mm256_min_pd(a, b)
        }

        #[inline(always)]
        fn max_doubles(self, a: __m256d, b: __m256d) -> __m256d {
            self.avx._mm256_max_pd(a, b)
        }

        #[inline(always)]
        fn less_doubles(self, a: __m256d, b: __m256d) -> u32 {
            self.avx._mm256_movemask_pd(self.avx._mm256_cmp_pd::<_CMP_LT_OQ>(a, b)) as u32
        }
    }
}
