//! The cube around a light: its faces, what part of a face has texels, and how depths are coded.
//!
//! A direction belongs to the face of its largest component, which is its depth `w`; the other two, divided by it, are its coordinates
//! (`u`, `v`) on the face. The texels of a face divide a window, the part of it behind which there is any geometry.
//!
//! *Rounding.* A look-up computes `u` and `v` from a difference of two points, a reciprocal and a product: with an error of at most 2⁻⁵⁰.
//! Subtracting the window's corner and the borders of a texel add less than 2⁻⁵⁰ each. So a direction lies within [`SLACK`] of the texel in
//! which it is looked up, and what is built for a texel is built for its [`Rect`], which is that much larger on every side. The same holds
//! at the seams: where two components are equal within their rounding any of the two faces may be chosen, and then `u` is at most 1 +
//! 2⁻⁵⁰.

use glam::DVec3;

use super::build::PARTS;

/// By how much a texel is enlarged on every side, in units of `u` and `v`.
pub(super) const SLACK: f64 = 1.0 / (1_u64 << 46) as f64;

/// Texels along the side of a tile, the unit of building.
pub(super) const TILE: u32 = 64;

/// By how much rectangles are enlarged, in texels, to find the squares that they meet: a texel is at least 2048 times the slack
/// ([`Window::new`]), so this is twice the slack or more, and far more than the rounding of a place in texels.
const MARGIN: f64 = 1.0 / 1024.0;

/// A face of the cube around a light, 0 to 5: twice the axis of the depth, and one more if that is negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Face(usize);

impl Face {
    pub(super) const ALL: [Self; 6] = [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5)];

    /// The face of a direction: that of its largest component. Any face for what is no number.
    #[inline]
    pub(super) fn of(d: DVec3) -> Self {
        let a = d.abs();
        // Selections, not branches, which would be taken at random.
        let of_two = usize::from(a.y > a.x);
        let axis = if a.z > a.x.max(a.y) { 2 } else { of_two };
        Self(2 * axis + usize::from(d.to_array()[axis] < 0.0))
    }

    #[inline]
    pub(super) const fn index(self) -> usize {
        self.0
    }

    /// The components (u, v, |w|) of a vector that belongs to this face.
    #[inline(always)]
    pub(super) fn magnitudes(self, d: DVec3) -> [f64; 3] {
        let [x, y, z] = d.to_array();
        let cycle = [x, y, z, x, y];
        let axis = (self.0 >> 1).min(2);
        [cycle[axis + 1], cycle[axis + 2], cycle[axis].abs()]
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
    /// Texels per unit.
    scale_u: f64,
    scale_v: f64,
    /// Texels along each side; 0 if there is no geometry behind this face.
    side: u32,
    /// The first texel of the face among all.
    pub(super) first: u32,
}

impl Window {
    /// Of a face without geometry.
    pub(super) const NONE: Self =
        Self { u0: 0.0, v0: 0.0, du: 0.0, dv: 0.0, scale_u: 0.0, scale_v: 0.0, side: 0, first: 0 };

    /// The window that holds these bounds (least and greatest `u`, least and greatest `v`) with `side` texels along each side.
    pub(super) fn new([u0, u1, v0, v1]: [f64; 4], side: u32, first: u32) -> Self {
        // Wider than the slack on every side, and never so narrow that the slack would count.
        let wide = |a: f64, b: f64| {
            let margin = (b - a) / 1024.0 + f64::from(side) * 1024.0 * SLACK;
            ((a - margin).max(-1.0 - 2.0 * SLACK), (b + margin).min(1.0 + 2.0 * SLACK))
        };
        let ((u0, u1), (v0, v1)) = (wide(u0, u1), wide(v0, v1));
        let n = f64::from(side);
        let (du, dv) = ((u1 - u0) / n, (v1 - v0) / n);
        Self { u0, v0, du, dv, scale_u: du.recip(), scale_v: dv.recip(), side, first }
    }

    pub(super) const fn side(&self) -> u32 {
        self.side
    }

    /// What maps directions to texels: the corner, and texels per unit.
    #[inline]
    pub(super) const fn map(&self) -> ([f64; 2], [f64; 2]) {
        ([self.u0, self.v0], [self.scale_u, self.scale_v])
    }

    /// The texel of a direction, and where in it from 0 to 1; `None` if it is not in the window: then there is no geometry behind it. A
    /// direction on a border may be given to either texel, as the slack allows.
    #[inline(always)]
    pub(super) fn place(&self, u: f64, v: f64) -> Option<([u32; 2], [f64; 2])> {
        let (x, y) = ((u - self.u0) * self.scale_u, (v - self.v0) * self.scale_v);
        let n = f64::from(self.side);
        if !(x >= 0.0 && y >= 0.0 && x < n && y < n) {
            return None;
        }
        let (i, j) = (whole(x).min(self.side - 1), whole(y).min(self.side - 1));
        Some(([i, j], [x - f64::from(i), y - f64::from(j)]))
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
        let part = |t: f64, start: f64, scale: f64, first: u32, margin: f64| {
            let part = ((t - start) * scale - f64::from(first) + margin) * per_part;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to what there is")]
            let part = part.clamp(0.0, f64::from(PARTS - 1)) as usize;
            part
        };
        let columns = part(*u0, self.u0, self.scale_u, x, -MARGIN)..=part(*u1, self.u0, self.scale_u, x, MARGIN);
        let rows = part(*v0, self.v0, self.scale_v, y, -MARGIN)..=part(*v1, self.v0, self.scale_v, y, MARGIN);
        rows.flat_map(move |j| columns.clone().map(move |i| j * PARTS as usize + i))
    }

    /// The tiles that a rectangle of directions meets: columns and rows, ends included.
    pub(super) fn tiles(&self, [u0, u1, v0, v1]: [f64; 4]) -> [u32; 4] {
        let last = f64::from(self.side / TILE - 1);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to what there is")]
        let tile = |t: f64, start: f64, scale: f64, margin: f64| {
            ((((t - start) * scale + margin) / f64::from(TILE)).floor().clamp(0.0, last)) as u32
        };
        [
            tile(u0, self.u0, self.scale_u, -MARGIN),
            tile(u1, self.u0, self.scale_u, MARGIN),
            tile(v0, self.v0, self.scale_v, -MARGIN),
            tile(v1, self.v0, self.scale_v, MARGIN),
        ]
    }
}

/// The integer below `x`, from 0 to 2³¹; of an integer itself or the one below. Half the instructions of a conversion that saturates.
#[inline(always)]
#[allow(clippy::cast_possible_truncation, reason = "the low bits of the mantissa are the integer")]
pub(super) fn whole(x: f64) -> u32 {
    // From 2⁵² to 2⁵³ the last place is 1, so that a sum is rounded to the nearest integer; in the middle, for `x` may be less than ½.
    const SHIFT: f64 = (3_u64 << 51) as f64;
    (x - 0.5 + SHIFT).to_bits() as u32
}

/// Depths as numbers of 16 bits: five bits of exponent, eleven of mantissa, so that steps are 0.05 %.
///
/// What is coded is y = 1 + (w − `base`)/`unit`. The code of a depth below the base is 0. With codes rounded down, `code(w) < code(bound)`
/// says that w < bound; that is all that look-ups rely on.
///
/// *Rounding.* A look-up's depth has a relative error below 2⁻⁵⁰, and y one of 2⁻²³ (single precision) besides. Bounds are moved by 2⁻⁴⁶ and
/// 2⁻²¹ to the safe side before they are coded, which covers both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DepthCode {
    base: f64,
    inverse_unit: f64,
}

/// The code of a depth that no query has.
pub(super) const NEVER: u16 = u16::MAX;

impl DepthCode {
    /// For depths from about `base` to about `farthest`.
    pub(super) fn new(base: f64, farthest: f64) -> Self {
        let farthest = farthest.max(f64::MIN_POSITIVE);
        // Beyond 2³⁰ codes would saturate, which is safe but tells nothing apart.
        let base = base.max(farthest / f64::from(1 << 30));
        let unit = base.min((farthest - base).max(farthest * f64::EPSILON) / 1024.0);
        Self { base, inverse_unit: unit.recip() }
    }

    /// The code of a query's depth, at most `NEVER − 1`.
    #[inline]
    pub(super) fn of(&self, w: f64) -> u16 {
        Self::code(1.0 + (w - self.base) * self.inverse_unit)
    }

    /// The code of a lower bound: a query with a lower code is nearer.
    #[inline]
    pub(super) fn lower(&self, w: f64) -> u16 {
        Self::code((1.0 + (w - w.abs() * SLACK - self.base) * self.inverse_unit) * (1.0 - 1.0 / 2_097_152.0))
    }

    /// The code of an upper bound: a query with this code or a higher one is farther.
    #[inline]
    pub(super) fn upper(&self, w: f64) -> u16 {
        let y = 1.0 + (w + w.abs() * SLACK - self.base) * self.inverse_unit;
        let code = Self::code(y.max(1.0) * (1.0 + 1.0 / 2_097_152.0));
        if code >= NEVER - 1 { NEVER } else { code + 1 }
    }

    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "rounding is covered by the bounds, the code is clamped")]
    fn code(y: f64) -> u16 {
        let y = y as f32;
        // False for NaN.
        if y >= 1.0 { (((y.to_bits() - 1.0_f32.to_bits()) >> 12) + 1).min(u32::from(NEVER - 1)) as u16 } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the codes of a bound and of a query say of their order is so, for bounds within ulps of each other, too.
    #[test]
    fn codes_never_lie_about_the_order() {
        let mut random = fastrand::Rng::with_seed(3);
        for (base, farthest) in
            [(1.0, 1000.0), (1e-9, 1.0), (1.5e11, 1.5e11 + 200.0), (0.0, 5.0), (3.0, 3.0), (1e-30, 1e30)]
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
                if codes.of(w) < codes.lower(bound) {
                    assert!(w < bound, "{w} {bound}");
                    told += 1;
                }
                if codes.of(w) >= codes.upper(bound) {
                    assert!(w > bound, "{w} {bound}");
                    told += 1;
                }
                asked += usize::from(i % 5 == 0);
            }
            assert!(told * 2 > asked || farthest / base.max(1e-300) > 1e20 || base == farthest, "{told} of {asked}");
        }
        let codes = DepthCode::new(1.0, 2.0);
        assert_eq!((codes.of(f64::NAN), codes.of(-1.0), codes.of(f64::INFINITY)), (0, 0, NEVER - 1));
        assert_eq!(codes.upper(f64::INFINITY), NEVER);
    }

    /// Every direction near seams, diagonals and borders of texels lies in the rectangle of the texel where it is looked up.
    #[test]
    fn look_ups_hit_the_rectangle_of_their_texel() {
        let mut random = fastrand::Rng::with_seed(5);
        for i in 0..100_000 {
            let window = match i % 3 {
                0 => Window::new([-1.0, 1.0, -1.0, 1.0], 128, 0),
                1 => Window::new([0.1, 0.101, -0.3, -0.2999], 1024, 0),
                _ => Window::new([-1.0, -0.5, 0.9, 1.0], 64, 0),
            };
            // A border or a seam, moved by some ulps.
            let border = |start: f64, step: f64, random: &mut fastrand::Rng| {
                let mut t =
                    if random.u8(..4) == 0 { 1.0 } else { start + step * f64::from(random.u32(..=window.side)) };
                for _ in 0..random.u8(..4) {
                    t = if random.bool() { t.next_up() } else { t.next_down() };
                }
                t
            };
            let (u, v) = (border(window.u0, window.du, &mut random), border(window.v0, window.dv, &mut random));
            let w = 10.0_f64.powf(6.0 * random.f64() - 3.0);
            let (du, dv) = (u * w, v * w);
            let inverse = w.recip();
            let Some(([i, j], [x, y])) = window.place(du * inverse, dv * inverse) else { continue };
            assert!((0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y), "{x} {y}");
            let rect = window.rect(f64::from(i), f64::from(j), 1.0);
            // What the components stand for, exactly enough: one more rounding.
            assert!((du / w - rect.u).abs() <= rect.half_u - SLACK / 4.0, "{u} {rect:?}");
            assert!((dv / w - rect.v).abs() <= rect.half_v - SLACK / 4.0, "{v} {rect:?}");
        }
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
            }
        }
        for d in [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z] {
            assert_eq!(Face::of(d).local(d), DVec3::Z);
        }
        assert_eq!(Face::of(DVec3::ONE), Face(0));
    }
}
