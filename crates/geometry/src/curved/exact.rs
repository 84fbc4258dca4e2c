//! Arithmetic whose signs are exact: numbers with an error bound, and sums of doubles without any error \[Shewchuk1997\].
//!
//! *Idea.* A predicate is a polynomial of doubles, written once for any [`Number`]. First it is computed with a bound of its rounding; only where that
//! does not decide the sign is it computed again, as an expansion: a sum of doubles that do not overlap, the last of which has the sign of all.
//!
//! *Guarantee.* [`Number::sign`] of an [`Expansion`] is exact, and that of a [`Bounded`] is where it answers, as long as nothing overflows or
//! underflows: the predicates here are of degree eight, so for numbers between 1e-35 and 1e35.

use std::cmp::Ordering;

use smallvec::{SmallVec, smallvec};

/// What predicates are computed with.
pub(super) trait Number: Clone {
    fn of(value: f64) -> Self;
    fn plus(&self, other: &Self) -> Self;
    fn minus(&self, other: &Self) -> Self;
    fn times(&self, other: &Self) -> Self;
    /// How it compares with zero; `None` if that is not known.
    fn sign(&self) -> Option<Ordering>;

    fn squared(&self) -> Self {
        self.times(self)
    }

    fn negated(&self) -> Self {
        Self::of(0.0).minus(self)
    }
}

/// A value, and by how much it is off at most.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounded {
    value: f64,
    error: f64,
}

/// More than half an ulp of 1, so that the bounds cover their own rounding: each is a sum of a few positive terms, rounded by less than
/// six halves of an ulp of itself.
const U: f64 = f64::EPSILON;
const SLACK: f64 = 1.0 + 8.0 * f64::EPSILON;

impl Number for Bounded {
    #[inline]
    fn of(value: f64) -> Self {
        Self { value, error: 0.0 }
    }

    #[inline]
    fn plus(&self, other: &Self) -> Self {
        let value = self.value + other.value;
        Self { value, error: (self.error + other.error + U * value.abs()) * SLACK }
    }

    #[inline]
    fn minus(&self, other: &Self) -> Self {
        let value = self.value - other.value;
        Self { value, error: (self.error + other.error + U * value.abs()) * SLACK }
    }

    #[inline]
    fn times(&self, other: &Self) -> Self {
        let value = self.value * other.value;
        let crossed = self.value.abs() * other.error + other.value.abs() * self.error;
        // What is so small that it lost bits is covered by the last term.
        Self { value, error: (crossed + self.error * other.error + U * value.abs()) * SLACK + f64::MIN_POSITIVE }
    }

    #[inline]
    fn sign(&self) -> Option<Ordering> {
        // Not so if one of them is NaN.
        if self.value.abs() > self.error { self.value.partial_cmp(&0.0) } else { None }
    }
}

/// A sum of doubles that do not overlap, the smallest first; zero has none.
#[derive(Clone, Debug)]
pub(super) struct Expansion(SmallVec<[f64; 32]>);

/// a + b without error: the rounded sum and what it lacks.
fn two_sum(a: f64, b: f64) -> [f64; 2] {
    let sum = a + b;
    let of_b = sum - a;
    [sum, (a - (sum - of_b)) + (b - of_b)]
}

/// a · b without error.
fn two_product(a: f64, b: f64) -> [f64; 2] {
    let product = a * b;
    [product, a.mul_add(b, -product)]
}

impl Expansion {
    /// Adds one double (GROW-EXPANSION, without its zeros).
    fn grow(&mut self, b: f64) {
        let mut rest = b;
        let mut kept = SmallVec::with_capacity(self.0.len() + 1);
        for &part in &self.0 {
            let [sum, lost] = two_sum(rest, part);
            if lost != 0.0 {
                kept.push(lost);
            }
            rest = sum;
        }
        if rest != 0.0 {
            kept.push(rest);
        }
        self.0 = kept;
    }
}

impl Number for Expansion {
    fn of(value: f64) -> Self {
        if value == 0.0 { Self(SmallVec::new()) } else { Self(smallvec![value]) }
    }

    fn plus(&self, other: &Self) -> Self {
        let mut sum = self.clone();
        other.0.iter().for_each(|&part| sum.grow(part));
        sum
    }

    fn minus(&self, other: &Self) -> Self {
        let mut difference = self.clone();
        other.0.iter().for_each(|&part| difference.grow(-part));
        difference
    }

    fn times(&self, other: &Self) -> Self {
        let mut product = Self(SmallVec::new());
        for &a in &self.0 {
            for &b in &other.0 {
                let [high, low] = two_product(a, b);
                product.grow(low);
                product.grow(high);
            }
        }
        product
    }

    fn sign(&self) -> Option<Ordering> {
        self.0.last().map_or(Some(Ordering::Equal), |largest| largest.partial_cmp(&0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Polynomials that are zero, or the last bit of a huge number: expansions see it, bounds say that they do not know.
    #[test]
    fn signs_are_exact() {
        let check = |terms: &[(f64, f64)], expected: Ordering| {
            let sum =
                |of: fn(f64) -> Expansion| terms.iter().fold(of(0.0), |sum, &(a, b)| sum.plus(&of(a).times(&of(b))));
            assert_eq!(sum(Expansion::of).sign(), Some(expected), "{terms:?}");
            let bounded =
                terms.iter().fold(Bounded::of(0.0), |sum, &(a, b)| sum.plus(&Bounded::of(a).times(&Bounded::of(b))));
            assert!(bounded.sign().is_none_or(|sign| sign == expected), "{terms:?}");
        };
        let tiny = f64::EPSILON * f64::EPSILON;
        check(&[(0.1, 10.0), (-0.1, 10.0)], Ordering::Equal);
        check(&[(1e20, 1.0), (1.0, 1.0), (-1e20, 1.0)], Ordering::Greater);
        check(&[(1e20, 1.0), (-tiny, 1.0), (-1e20, 1.0)], Ordering::Less);
        // (1 + ε)² − 1 − 2ε − ε² is zero, and ε² is lost in double precision.
        let e = f64::EPSILON;
        check(&[(1.0 + e, 1.0 + e), (-1.0, 1.0), (-2.0, e), (-e, e)], Ordering::Equal);
        check(&[(1.0 + e, 1.0 + e), (-1.0, 1.0), (-2.0, e)], Ordering::Greater);
        let mut random = fastrand::Rng::with_seed(3);
        for _ in 0..1000 {
            let [a, b, c] = [(); 3].map(|()| (random.f64() - 0.5) * (1_u64 << random.u32(0..40)) as f64);
            // (a + b)(a − b) − a² + b² + c − c
            let of = Expansion::of;
            let zero = of(a).plus(&of(b)).times(&of(a).minus(&of(b))).minus(&of(a).squared()).plus(&of(b).squared());
            assert_eq!(zero.plus(&of(c)).minus(&of(c)).sign(), Some(Ordering::Equal));
            assert_eq!(zero.plus(&of(1e-200)).sign(), Some(Ordering::Greater));
        }
    }
}
