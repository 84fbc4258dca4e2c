//! Where a query is looked up: its texel, and the code of its depth.
//!
//! *Idea.* All of it is arithmetic in single precision without a branch. Of many queries the compiler makes vectors, a component each, and what has no texel
//! in a window gets one of two texels of its own, so that nothing has to be remembered of it. The components of a single query are a vector themselves: taken
//! from memory by the number of the face they would wait for stores, and selected one by one they would become branches.
//! Tests compare both.
//!
//! *Rounding.* See `frame`. Sums and products are rounded one by one, with every instruction set, so that places do not depend on it.

use glam::{DVec3, Vec3A, Vec3Swizzles as _, Vec4};

use super::frame::{DepthCode, TILE, Window};

/// The texel of all directions behind which there is no geometry.
pub(super) const NOTHING: u32 = 0;

/// The texel of the light itself, of what is too near or too far for single precision, and of what is no number; in a square of its own.
pub(super) const UNKNOWN: u32 = SQUARE * SQUARE;

/// Where texels of faces start: on a square.
pub(super) const FIRST: u32 = 2 * SQUARE * SQUARE;

/// Texels along the side of a square, which lie together.
pub(super) const SQUARE: u32 = 1 << LOG_SQUARE;
const LOG_SQUARE: u32 = 2;

/// The least and the largest distance of a query that has a texel.
const REACH: [f32; 2] = [1.0 / (1_u128 << 100) as f32, (1_u128 << 100) as f32];

/// The cube around a light, for look-ups.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cube {
    light: DVec3,
    /// Of the windows of all six faces, each with a table of its own.
    origin: [[f32; 6]; 2],
    scale: [[f32; 6]; 2],
    first: [u32; 6],
    /// The same for single queries, which number faces by 1 for the second axis, 2 or 3 for the third, and 4 for a negative component.
    maps: [([[f32; 2]; 2], u32); 8],
    /// Texels along each side, a power of two, and its exponent.
    side: u32,
    log_side: u32,
    /// What is left of a mantissa, and the exponent of `side` as single precision has it.
    shift: u32,
    exponent: u32,
    /// All windows are whole faces, one after the other.
    whole: bool,
    depths: DepthCode,
    /// No component of the difference of a vertex and the light is larger.
    farthest: f32,
}

/// What records are asked about: a point relative to the light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction {
    /// The difference of both, divided by its largest component.
    pub(super) x: [f32; 3],
    /// That component, and the largest of any vertex.
    pub(super) reach: f32,
}

/// A query's place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) direction: Direction,
    /// Its column and row, and the texels along each side.
    at: [f32; 2],
    pub(super) texel: u32,
    pub(super) code: u32,
}

impl Cube {
    /// The cube around `light` with these windows, which have all the same sides, if any. No component of the difference of a vertex and the light is larger
    /// than `farthest`.
    pub(super) fn new(light: DVec3, windows: &[Window; 6], depths: DepthCode, farthest: f64) -> Self {
        let side = windows.iter().map(Window::side).max().unwrap_or(0).max(1);
        let faces = [0, 1, 2, 3, 4, 5];
        let whole = (0..).zip(windows).all(|(i, w)| *w == Window::whole(side, FIRST + i * side * side));
        Self {
            light,
            origin: [0, 1].map(|i| faces.map(|f| windows[f].origin[i])),
            scale: [0, 1].map(|i| faces.map(|f| windows[f].scale[i])),
            first: windows.map(|w| w.first),
            maps: BY_BITS.map(|f| ([windows[f].origin, windows[f].scale], windows[f].first)),
            side,
            log_side: side.ilog2(),
            shift: MANTISSA - side.ilog2(),
            exponent: ONE + side.ilog2(),
            whole,
            depths,
            #[allow(clippy::cast_possible_truncation, reason = "rounded up")]
            farthest: (farthest as f32).next_up(),
        }
    }

    pub(super) const fn light(&self) -> DVec3 {
        self.light
    }

    /// Texels along each side of a window.
    pub(super) const fn side(&self) -> u32 {
        self.side
    }

    /// Whether all windows are whole faces.
    pub(super) const fn is_whole(&self) -> bool {
        self.whole
    }

    /// The place of one query at this difference from the light: all components in one vector, without memory or a branch between them. `None` for what has no
    /// texel of a face.
    #[inline(always)]
    pub(super) fn place_of_one(&self, d: Vec3A) -> Option<Place> {
        let a = d.abs();
        // The face is that of the largest component.
        let [ax, ay, az] = [Vec3A::splat(a.x), Vec3A::splat(a.y), Vec3A::splat(a.z)];
        let second = ay.cmpgt(ax);
        let of_two = ay.max(ax);
        let third = az.cmpgt(of_two);
        let w = az.max(of_two);
        let turned = Vec3A::select(third, d, Vec3A::select(second, d.zxy(), d.yzx()));
        let face =
            (second.bitmask() & 1) | (third.bitmask() & 2) | (Vec4::from((turned, 0.0)).is_negative_bitmask() & 4);
        let inverse = Vec3A::ONE / w;
        let ([[origin_u, origin_v], [scale_u, scale_v]], first) = self.maps[face as usize % 8];
        let scale = inverse * Vec3A::new(scale_u, scale_v, 0.0);
        let place = turned * scale + Vec3A::new(origin_u, origin_v, 0.0);
        let at = [place.x, place.y];
        // False for what is no number: that is the largest, or its column or row is none.
        if !(Self::reaches(w.x) & self.holds(at[0]) & self.holds(at[1])) {
            return None;
        }
        let [x, y, z] = (d * inverse).to_array();
        let texel = first + in_window(self.whole(at[0]), self.whole(at[1]), self.log_side);
        let direction = Direction { x: [x, y, z], reach: w.x + self.farthest };
        Some(Place { direction, at, texel, code: self.depths.of(w.x) })
    }

    /// The texel of a single query that has none of a face.
    #[cold]
    pub(super) fn beside(&self, [x, y, z]: [f32; 3]) -> u32 {
        self.place_of::<false>([x, y, z]).texel
    }

    /// Whether single precision reaches so far, and so near.
    #[inline(always)]
    fn reaches(w: f32) -> bool {
        (REACH[0]..=REACH[1]).contains(&w)
    }

    /// The place of one of many queries. `WHOLE` says that the windows are whole faces.
    #[inline(always)]
    pub(super) fn place_of<const WHOLE: bool>(&self, [x, y, z]: [f32; 3]) -> Place {
        // The face is that of the largest component.
        let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
        let second = ay > ax;
        let of_two = if second { ay } else { ax };
        let third = az > of_two;
        let w = if third { az } else { of_two };
        let axis = 2 * u32::from(third) + u32::from(second & !third);
        let (u, v, along) = if second { (z, x, y) } else { (y, z, x) };
        let (u, v, along) = if third { (x, y, z) } else { (u, v, along) };
        let face = 2 * axis + (along.to_bits() >> 31);
        // The sum is no number if one of them is none.
        let valid = (ax + ay + az <= 4.0 * REACH[1]) & Self::reaches(w);
        let inverse = w.recip();
        let ([origin_u, origin_v], [scale_u, scale_v], first) = self.window::<WHOLE>(face);
        let (column, row) = (u * (inverse * scale_u) + origin_u, v * (inverse * scale_v) + origin_v);
        let inside = valid & (WHOLE | (self.holds(column) & self.holds(row)));
        let texel = first + in_window(self.whole(column), self.whole(row), self.log_side);
        let beside = if valid { NOTHING } else { UNKNOWN };
        Place {
            direction: Direction { x: [x * inverse, y * inverse, z * inverse], reach: w + self.farthest },
            at: [column, row],
            texel: if inside { texel } else { beside },
            code: self.depths.of(w),
        }
    }

    /// The window of a face: its origin, its scale and its first texel.
    #[inline(always)]
    fn window<const WHOLE: bool>(&self, face: u32) -> ([f32; 2], [f32; 2], u32) {
        let ([of_u, of_v], [per_u, per_v]) = (&self.origin, &self.scale);
        if WHOLE {
            return ([of_u[0], of_v[0]], [per_u[0], per_v[0]], FIRST + (face << (2 * self.log_side)));
        }
        // Not closures, which would not be made vectors of.
        let face = (face as usize).min(5);
        ([of_u[face], of_v[face]], [per_u[face], per_v[face]], self.first[face])
    }

    /// Whether a column or row is one of the window: a number from n to 2n, and no other, has the exponent of n.
    #[inline(always)]
    const fn holds(&self, column: f32) -> bool {
        column.to_bits() >> MANTISSA == self.exponent
    }

    /// The whole part of a column or row that the window holds, from 0: the first bits of its mantissa. Of any other number something less than n.
    #[inline(always)]
    const fn whole(&self, column: f32) -> u32 {
        (column.to_bits() >> self.shift) & (self.side - 1)
    }

    /// Where in its texel a place is, from 0 to 1, 1 left out. Exact.
    #[inline]
    pub(super) fn in_texel(&self, place: &Place) -> [f32; 2] {
        place.at.map(|column| column - self.side as f32 - self.whole(column) as f32)
    }
}

/// The faces as single queries number them.
const BY_BITS: [usize; 8] = [0, 2, 4, 4, 1, 3, 5, 5];

/// Bits of a mantissa in single precision, and the exponent of one.
const MANTISSA: u32 = 23;
const ONE: u32 = 127;

/// The square of a texel.
#[inline(always)]
pub(super) const fn square(texel: u32) -> u32 {
    texel >> (2 * LOG_SQUARE)
}

/// The number of a texel in its window: squares of 4 × 4, row by row.
#[inline(always)]
pub(super) const fn in_window(i: u32, j: u32, log_side: u32) -> u32 {
    const IN_SQUARE: u32 = SQUARE - 1;
    let (row, column) = ((j & !IN_SQUARE) << log_side, (i & !IN_SQUARE) << LOG_SQUARE);
    row + column + ((j & IN_SQUARE) << LOG_SQUARE) + (i & IN_SQUARE)
}

/// The number of a texel in its tile, as if that were a window.
pub(super) const fn in_tile(i: u32, j: u32) -> usize {
    in_window(i % TILE, j % TILE, TILE.ilog2()) as usize
}

#[cfg(test)]
mod tests {
    use super::{
        super::frame::{Face, SLACK},
        *,
    };

    fn cube(window: Window, whole: bool) -> (Cube, [Window; 6]) {
        let side = window.side();
        let windows = [0, 1, 2, 3, 4, 5].map(|i| {
            let first = FIRST + i * side * side;
            let mut of_face = window;
            of_face.first = first;
            if whole { Window::whole(side, first) } else { of_face }
        });
        let light = DVec3::new(0.3, -17.0, 1e-3);
        (Cube::new(light, &windows, DepthCode::new(1e-3, 1e3), 0.0), windows)
    }

    /// As one of many.
    fn place_of_many(cube: &Cube, d: DVec3) -> Place {
        let d = d.as_vec3().to_array();
        if cube.whole { cube.place_of::<true>(d) } else { cube.place_of::<false>(d) }
    }

    /// The columns and rows of texels, by their numbers.
    fn texels(side: u32) -> Vec<(u32, u32)> {
        let mut of = vec![(0, 0); (side * side) as usize];
        for (i, j) in (0..side).flat_map(|j| (0..side).map(move |i| (i, j))) {
            of[in_window(i, j, side.ilog2()) as usize] = (i, j);
        }
        of
    }

    /// Every direction near seams, diagonals and borders of texels lies in the rectangle of the texel where it is looked up, and what has
    /// none lies beside the window.
    #[test]
    fn look_ups_hit_the_rectangle_of_their_texel() {
        let mut random = fastrand::Rng::with_seed(5);
        let cubes = [
            cube(Window::whole(128, 0), true),
            cube(Window::new([0.1, 0.101, -0.3, -0.2999], 1024, 0), false),
            cube(Window::new([-1.0, -0.5, 0.9, 1.0], 64, 0), false),
            cube(Window::new([-0.7, 0.8, -1.0, 1.0], 256, 0), false),
            cube(Window::whole(1024, 0), true),
        ];
        let of = cubes.each_ref().map(|(cube, _)| texels(cube.side()));
        let (mut found, mut beside) = (0, 0);
        for i in 0..150_000 {
            let ((cube, windows), of) = (&cubes[i % 5], &of[i % 5]);
            let face = Face::ALL[random.usize(..6)];
            let window = &windows[face.index()];
            // A border or a seam, moved by some ulps of either precision.
            let n = f64::from(window.side());
            let mut ends = window.rect(0.5 * n - 0.5, 0.5 * n - 0.5, 1.0);
            (ends.half_u, ends.half_v) = (0.5 * n * (ends.half_u - SLACK) * 2.0, 0.5 * n * (ends.half_v - SLACK) * 2.0);
            let mut border = |middle: f64, half: f64| {
                let t = match random.u8(..8) {
                    0 => 1.0,
                    1 => -1.0,
                    2 => 2.0 * random.f64() - 1.0,
                    _ => middle + half * (2.0 * f64::from(random.u32(..=window.side())) / n - 1.0),
                };
                t + (random.f64() - 0.5) * [0.0, 1e-16, 1e-7, 1e-6][random.usize(..4)]
            };
            let (u, v) = (border(ends.u, ends.half_u), border(ends.v, ends.half_v));
            let w = 10.0_f64.powf(6.0 * random.f64() - 3.0);
            let d = face.world(DVec3::new(u, v, 1.0)) * w;
            let from = cube.light() + d;
            let d = from - cube.light();
            let many = place_of_many(cube, d);
            let Some(place) = cube.place_of_one(d.as_vec3a()) else {
                assert_eq!(many.texel, NOTHING);
                assert_eq!(cube.beside(d.as_vec3().to_array()), NOTHING);
                // Whatever face it was, it is beside the window by more than the slack of what is built for it.
                let near = |t: f64, middle: f64, half: f64| (t - middle).abs() < half - 24.0 * SLACK;
                assert!(
                    !(near(u, ends.u, ends.half_u) && near(v, ends.v, ends.half_v) && u.abs().max(v.abs()) < 0.999)
                );
                beside += 1;
                continue;
            };
            assert_eq!((place.texel, place.code), (many.texel, many.code));
            assert_eq!((place.direction.x, place.direction.reach), (many.direction.x, many.direction.reach));
            let number = place.texel - FIRST;
            let face = Face::ALL[(number / (window.side() * window.side())) as usize];
            let (i, j) = of[(number % (window.side() * window.side())) as usize];
            let rect = windows[face.index()].rect(f64::from(i), f64::from(j), 1.0);
            let local = face.local(d);
            let (u, v) = (local.x / local.z, local.y / local.z);
            assert!((u - rect.u).abs() <= rect.half_u - SLACK / 2.0, "{u} {rect:?} {place:?}");
            assert!((v - rect.v).abs() <= rect.half_v - SLACK / 2.0, "{v} {rect:?} {place:?}");
            assert!((f64::from(place.direction.reach) / local.z - 1.0).abs() < 1e-7);
            let far = DVec3::from_array(place.direction.x.map(f64::from)) - d / local.z;
            assert!(far.abs().max_element() < 4.0 / 16_777_216.0);
            for (at, t, middle, half) in [(0, u, rect.u, rect.half_u), (1, v, rect.v, rect.half_v)] {
                let at = f64::from(cube.in_texel(&place)[at]);
                let exact = 0.5 + 0.5 * (t - middle) / (half - SLACK);
                assert!((0.0..1.0).contains(&at) && (at - exact).abs() < 0.5 * SLACK / half, "{at} {exact} {place:?}");
            }
            found += 1;
        }
        assert!(found > 100_000 && beside > 5_000, "{found} {beside}");
    }

    #[test]
    fn what_is_too_near_or_too_far_or_no_number_has_a_texel_of_its_own() {
        for (cube, _) in [cube(Window::whole(64, 0), true), cube(Window::new([-1.0, 1.0, -0.5, 0.5], 64, 0), false)] {
            let check = |d: DVec3| {
                assert!(cube.place_of_one(d.as_vec3a()).is_none(), "{d}");
                assert_eq!(cube.beside(d.as_vec3().to_array()), UNKNOWN, "{d}");
                assert_eq!(place_of_many(&cube, d).texel, UNKNOWN, "{d}");
            };
            let far = [1e31, 1e39, 1e300, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
            for axis in 0..3 {
                for far in far {
                    for at in [DVec3::ZERO, DVec3::ONE, DVec3::new(5.0, -4.0, 3.0)] {
                        let mut from = at;
                        from[axis] = far;
                        check(from - cube.light());
                    }
                }
            }
            check(DVec3::ZERO);
            check(DVec3::X * 1e-31);
            assert!(cube.place_of_one(Vec3A::new(-1e-29, 1e-30, 0.0)).is_some());
            assert!(cube.place_of::<true>([-1e-29, 1e-30, 0.0]).texel >= FIRST);
        }
    }
}
