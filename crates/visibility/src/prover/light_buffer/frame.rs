//! The cube around a light: its faces, what part of a face has texels, and how depths are coded.
//!
//! A direction belongs to the face of its largest component, which is its depth `w`; the other two, divided by it, are its coordinates
//! (`u`, `v`) on the face. The texels of a face divide a window, the part of it behind which there is any geometry.
//!
//! *Rounding.* A look-up is done in single precision (`place`). So a direction lies within [`SLACK`] of the texel in which it is looked up, and
//! what is built for a texel is built for its [`Rect`], which is that much larger on every side. With ε = 2⁻²⁴:
//! - The difference of point and light is rounded to single precision: an error of ε, relative to each component, and 2⁻⁵³ before.
//! - At the seams, where two components are equal within these, any of the two faces may be chosen, and `u` is at most 1 + 2ε.
//! - The texel's column, and the n columns of the window more, is x = d·t + c, where t = (1/w)·s, with s texels per unit. The errors of d, of w, of its
//!   reciprocal, of t and of their product come to 5ε, relative to d·t: 5ε in units of `u`. The window's corner is *defined* by the rounded c and s. In
//!   the window x is from n to 2n, where the sum is rounded by εn, which is at most 2ε in units of `u`, for a window is at most 2 wide.
//! - Of a whole face `s` is 16ε less than half of n, so that 1 + 2ε times t, with the errors of t and of the product, is less than half of n by more than the
//!   rounding of the sum: the column of whatever belongs to the face is from 0 to n, n left out, without being clamped.
//! - Rectangles, in double precision, err by less than 2⁻⁴⁸.
//!
//! That is 7ε and little more, less than half of `SLACK`, 16ε. What is looked up in a part of a texel errs by no more: the place in the texel and its
//! multiples by powers of two are exact.

use glam::DVec3;

use super::build::PARTS;

/// By how much a texel is enlarged on every side, in units of `u` and `v`.
pub(super) const SLACK: f64 = 1.0 / (1_u64 << 20) as f64;

/// By how much depths are moved to the safe side, relative to themselves: for the rounding of what is computed in double precision.
pub(super) const DEPTH_SLACK: f64 = 1.0 / (1_u64 << 46) as f64;

/// Texels along the side of a tile, the unit of building.
pub(super) const TILE: u32 = 64;

/// By how much rectangles are enlarged, in units of `u` and `v`, to find the squares that they meet: twice the slack, which is far more than the
/// rounding of a place.
const MARGIN: f64 = 2.0 * SLACK;

/// By how much a whole face's texels are wider than the face divided: 1 − 16ε, see above.
const WITHIN: f32 = 1.0 - 1.0 / (1 << 20) as f32;

/// A texel is at least so many times the slack wide.
const NARROWEST: f64 = 32.0;

/// A face of the cube around a light, 0 to 5: twice the axis of the depth, and one more if that is negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Face(usize);

impl Face {
    pub(super) const ALL: [Self; 6] = [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5)];

    #[inline]
    pub(super) const fn index(self) -> usize {
        self.0
    }

    /// The face of a direction, as nobody in a hurry would find it.
    #[cfg(test)]
    pub(super) fn of(d: DVec3) -> Self {
        let along = |face: &Self| face.local(d).z;
        Self::ALL.into_iter().max_by(|a, b| along(a).total_cmp(&along(b))).expect("six faces")
    }

    /// The vector of the world with these (u, v, w) on this face.
    #[cfg(test)]
    pub(super) fn world(self, local: DVec3) -> DVec3 {
        let mut d = DVec3::ZERO;
        let axis = self.0 >> 1;
        d[axis] = if self.0 & 1 == 0 { local.z } else { -local.z };
        (d[(axis + 1) % 3], d[(axis + 2) % 3]) = (local.x, local.y);
        d
    }

    /// A vector of the world as (u, v, w) of this face: axes in cyclic order, the last with the sign of the face.
    #[inline]
    pub(super) fn local(self, d: DVec3) -> DVec3 {
        let w = if self.0 & 1 == 0 { 1.0 } else { -1.0 };
        let [x, y, z] = d.to_array();
        // In cyclic order from any axis.
        let cycle = [x, y, z, x, y];
        let axis = (self.0 >> 1).min(2);
        DVec3::new(cycle[axis + 1], cycle[axis + 2], w * cycle[axis])
    }
}

/// A rectangle of directions on a face, slack included.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rect {
    /// The middle.
    pub(super) u: f64,
    pub(super) v: f64,
    /// Half the sides.
    pub(super) half_u: f64,
    pub(super) half_v: f64,
}

/// The part of a face that has texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Window {
    u0: f64,
    v0: f64,
    /// Sides of a texel.
    du: f64,
    dv: f64,
    /// What maps `u` and `v` to columns and rows of texels: how many there are to the left of 0, and `side` more; how many there are in a unit.
    pub(super) origin: [f32; 2],
    pub(super) scale: [f32; 2],
    /// Texels along each side; 0 if there is no geometry behind this face.
    side: u32,
    /// The first texel of the face among all.
    pub(super) first: u32,
}

impl Window {
    /// Of a face without geometry: nothing is in it.
    pub(super) const NONE: Self =
        Self { u0: 0.0, v0: 0.0, du: 0.0, dv: 0.0, origin: [-1.0; 2], scale: [0.0; 2], side: 0, first: 0 };

    /// All of a face, and so much more that directions which the seams' rounding puts beside it have texels.
    pub(super) const fn whole(side: u32, first: u32) -> Self {
        let half = side as f32 * 0.5;
        let scale = half * WITHIN;
        let (u0, du) = (-(half as f64) / scale as f64, 1.0 / scale as f64);
        Self { u0, v0: u0, du, dv: du, origin: [side as f32 + half; 2], scale: [scale; 2], side, first }
    }

    /// The window that holds these bounds (least and greatest `u`, least and greatest `v`) with `side` texels along each side.
    pub(super) fn new([u0, u1, v0, v1]: [f64; 4], side: u32, first: u32) -> Self {
        let n = f64::from(side);
        #[allow(clippy::cast_possible_truncation, reason = "the window is what is rounded")]
        let map = |a: f64, b: f64| {
            // Wider than the slack on every side, and never so narrow that the slack would count.
            let margin = (b - a) / 1024.0 + n * NARROWEST * SLACK;
            let (a, b) = ((a - margin).max(-1.0 - 4.0 * SLACK), (b + margin).min(1.0 + 4.0 * SLACK));
            // Rounded down, so that the window becomes wider by less than the margin.
            let scale = ((n / (b - a)) as f32).next_down();
            let origin = (n - a * f64::from(scale)) as f32;
            (origin, scale, (n - f64::from(origin)) / f64::from(scale), f64::from(scale).recip())
        };
        let ((origin_u, scale_u, u0, du), (origin_v, scale_v, v0, dv)) = (map(u0, u1), map(v0, v1));
        Self { u0, v0, du, dv, origin: [origin_u, origin_v], scale: [scale_u, scale_v], side, first }
    }

    pub(super) const fn side(&self) -> u32 {
        self.side
    }

    /// The rectangle of `size` × `size` texels from (`x`, `y`), in texels, which may be fractions.
    pub(super) fn rect(&self, x: f64, y: f64, size: f64) -> Rect {
        let half = 0.5 * size;
        Rect {
            u: self.u0 + (x + half) * self.du,
            v: self.v0 + (y + half) * self.dv,
            half_u: half * self.du + SLACK,
            half_v: half * self.dv + SLACK,
        }
    }

    /// Of the parts of `size` × `size` texels into which a square from texel (`x`, `y`) is divided, row by row, those that a rectangle of
    /// directions meets.
    #[inline]
    pub(super) fn parts(&self, [u0, u1, v0, v1]: &[f64; 4], x: u32, y: u32, size: u32) -> impl Iterator<Item = usize> {
        let per_part = f64::from(size).recip();
        let part = |t: f64, start: f64, scale: f32, first: u32| {
            let part = ((t - start) * f64::from(scale) - f64::from(first)) * per_part;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to what there is")]
            let part = part.clamp(0.0, f64::from(PARTS - 1)) as usize;
            part
        };
        let [scale_u, scale_v] = self.scale;
        let columns = part(*u0 - MARGIN, self.u0, scale_u, x)..=part(*u1 + MARGIN, self.u0, scale_u, x);
        let rows = part(*v0 - MARGIN, self.v0, scale_v, y)..=part(*v1 + MARGIN, self.v0, scale_v, y);
        rows.flat_map(move |j| columns.clone().map(move |i| j * PARTS as usize + i))
    }

    /// The tiles that a rectangle of directions meets: columns and rows, ends included.
    pub(super) fn tiles(&self, [u0, u1, v0, v1]: [f64; 4]) -> [u32; 4] {
        let last = f64::from(self.side / TILE - 1);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to what there is")]
        let tile = |t: f64, start: f64, scale: f32| {
            (((t - start) * f64::from(scale) / f64::from(TILE)).floor().clamp(0.0, last)) as u32
        };
        let [scale_u, scale_v] = self.scale;
        [
            tile(u0 - MARGIN, self.u0, scale_u),
            tile(u1 + MARGIN, self.u0, scale_u),
            tile(v0 - MARGIN, self.v0, scale_v),
            tile(v1 + MARGIN, self.v0, scale_v),
        ]
    }
}

/// Depths as numbers of 16 bits: five bits of exponent, eleven of mantissa, so that steps are 0.05 %.
///
/// What is coded is y = 1 + (w − `base`)/`unit`. The code of a depth below the base is 0.
///
/// *Rounding.* Every step from a depth to its code is monotone, rounding included. Queries and bounds are coded by the same steps, so of two depths
/// the smaller never has the higher code: `code(w) < code(bound)` says that w < bound. Bounds are moved by [`DEPTH_SLACK`] before, for their own
/// rounding in double precision and that of the query's difference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DepthCode {
    base: f32,
    inverse_unit: f32,
}

/// The code of a depth that no query has.
pub(super) const NEVER: u16 = u16::MAX;

impl DepthCode {
    /// The greatest of all farthest depths, and the inverse of the least.
    pub(super) const FARTHEST: f64 = (1_u128 << 80) as f64;

    /// For depths from about `base` to about `farthest`.
    pub(super) fn new(base: f64, farthest: f64) -> Self {
        let farthest = farthest.clamp(1.0 / Self::FARTHEST, Self::FARTHEST);
        // Beyond 2³⁰ codes would saturate, which is safe but tells nothing apart.
        let base = base.clamp(farthest / f64::from(1 << 30), farthest);
        // From 2⁻¹¹³ to 2⁸⁰.
        let unit = base.min((farthest - base).max(farthest / f64::from(1 << 23)) / 1024.0);
        #[allow(clippy::cast_possible_truncation, reason = "any base and any unit will do")]
        let (base, inverse_unit) = (base as f32, unit.recip() as f32);
        Self { base, inverse_unit }
    }

    /// The code of a query's depth, at most `NEVER − 1`.
    #[inline(always)]
    pub(super) fn of(&self, w: f32) -> u32 {
        // So that 1 is the first depth with the code 1. What is negative is less than that as an integer, too.
        const ZERO: i32 = (1.0_f32.to_bits() - (1 << 12)) as i32;
        let y = (w - self.base) * self.inverse_unit + 1.0;
        #[allow(clippy::cast_sign_loss, clippy::cast_possible_wrap, reason = "not negative")]
        let code = ((y.to_bits() as i32).max(ZERO) - ZERO) as u32 >> 12;
        code.min(u32::from(NEVER) - 1)
    }

    /// The code of a lower bound: a query with a lower code is nearer.
    #[inline]
    pub(super) fn lower(&self, w: f64) -> u16 {
        self.code(w - w.abs() * DEPTH_SLACK)
    }

    /// The code of an upper bound: a query with this code or a higher one is farther.
    #[inline]
    pub(super) fn upper(&self, w: f64) -> u16 {
        let code = self.code(w + w.abs() * DEPTH_SLACK);
        if code >= NEVER - 1 { NEVER } else { code + 1 }
    }

    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "rounding is monotone, codes have 16 bits")]
    fn code(&self, w: f64) -> u16 {
        self.of(w as f32) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the codes of a bound and of a query say of their order is so, for bounds within ulps of each other, too.
    #[test]
    fn codes_never_lie_about_the_order() {
        let mut random = fastrand::Rng::with_seed(3);
        for (base, farthest) in [(1.0, 1000.0), (1e-9, 1.0), (1.5e11, 1.501e11), (0.0, 5.0), (3.0, 3.0), (1e-20, 1e20)]
        {
            let codes = DepthCode::new(base, farthest);
            let (mut told, mut asked) = (0, 0);
            for i in 0..40_000 {
                let w = if i % 4 == 0 {
                    base * (1.0 + random.f64() * 1e-3)
                } else {
                    base + (farthest - base) * random.f64().powi(1 + i % 7)
                };
                let mut bound = w;
                for _ in 0..i % 3 {
                    bound = if i % 2 == 0 { bound.next_up() } else { bound.next_down() };
                }
                if i % 5 == 0 {
                    bound = base + (farthest - base) * random.f64();
                }
                if codes.code(w) < codes.lower(bound) {
                    assert!(w < bound, "{w} {bound}");
                    told += 1;
                }
                if codes.code(w) >= codes.upper(bound) {
                    assert!(w > bound, "{w} {bound}");
                    told += 1;
                }
                asked += usize::from(i % 5 == 0);
            }
            assert!(told * 2 > asked || farthest / base.max(1e-300) > 1e20 || base == farthest, "{told} of {asked}");
        }
        let codes = DepthCode::new(1.0, 2.0);
        assert_eq!((codes.code(-1.0), codes.code(f64::INFINITY)), (0, NEVER - 1));
        assert_eq!(codes.upper(f64::INFINITY), NEVER);
    }

    /// Bounds that meet a part's rectangle, if only by its slack, are given to it; and few others.
    #[test]
    fn parts_are_all_that_bounds_meet() {
        let mut random = fastrand::Rng::with_seed(6);
        let (mut given, mut met) = (0, 0);
        for i in 0..20_000 {
            let window = match i % 3 {
                0 => Window::new([-1.0, 1.0, -1.0, 1.0], 64, 0),
                1 => Window::new([0.1, 0.101, -0.3, -0.2999], 1024, 0),
                _ => Window::new([-1.0, -0.5, 0.9, 1.0], 256, 0),
            };
            let size = [1, 4, 16][i / 3 % 3];
            let [x, y] = [(); 2].map(|()| random.u32(..window.side / (4 * size)) * 4 * size);
            let square = window.rect(f64::from(x), f64::from(y), f64::from(4 * size));
            // On a border of a part, beside it by some ulps or by the slack, or anywhere.
            let mut place = |middle: f64, half: f64| match random.u8(..4) {
                0 => middle + half * (random.f64() * 2.5 - 1.25),
                kind => {
                    let border = middle + half * (f64::from(random.u8(..5)) * 0.5 - 1.0);
                    let ulps = (random.f64() - 0.5) * [0.0, 1e-15, 2.0 * SLACK][usize::from(kind - 1)];
                    border + ulps
                }
            };
            let ends = |a: f64, b: f64| [a.min(b), a.max(b)];
            let [u0, u1] = ends(place(square.u, square.half_u), place(square.u, square.half_u));
            let [v0, v1] = ends(place(square.v, square.half_v), place(square.v, square.half_v));
            let parts: Vec<_> = window.parts(&[u0, u1, v0, v1], x, y, size).collect();
            for part in 0..16 {
                let (i, j) = ((part % 4) as u32, (part / 4) as u32);
                let rect = window.rect(f64::from(x + i * size), f64::from(y + j * size), f64::from(size));
                let meets = u0 <= rect.u + rect.half_u
                    && u1 >= rect.u - rect.half_u
                    && v0 <= rect.v + rect.half_v
                    && v1 >= rect.v - rect.half_v;
                assert!(!meets || parts.contains(&part), "{u0} {u1} {v0} {v1} {rect:?}");
                met += usize::from(meets);
            }
            given += parts.len();
        }
        assert!(given < met + met / 2, "{given} {met}");
    }

    #[test]
    fn faces_are_right_handed_or_mirrored_but_lose_nothing() {
        for face in Face::ALL {
            for d in [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-3.0, 0.5, 0.25)] {
                assert_eq!(face.local(d).length_squared(), d.length_squared());
                assert_eq!(face.world(face.local(d)), d);
            }
        }
    }
}
