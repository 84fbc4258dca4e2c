//! Where a query is looked up: its texel, and the code of its depth.
//!
//! *Idea.* All of it is arithmetic in single precision without a branch, so that the compiler makes vectors of it for many queries; one definition serves
//! single queries, too. What has no texel in a window gets one of two texels of its own, so that nothing has to be remembered of it.
//!
//! *Rounding.* See `frame`. Sums and products are rounded one by one, with every instruction set, so that places do not depend on it.

use glam::DVec3;

use super::frame::{DepthCode, TILE, Window};

/// The texel of all directions behind which there is no geometry.
pub(super) const NOTHING: u32 = 0;

/// The texel of the light itself, of what is too near or too far for single precision, and of what is no number.
pub(super) const UNKNOWN: u32 = 1;

/// Where texels of faces start: on a square.
pub(super) const FIRST: u32 = SQUARE * SQUARE;

/// Texels along the side of a square, which lie together.
pub(super) const SQUARE: u32 = 8;

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
    /// Texels along each side, a power of two, and its exponent.
    side: u32,
    log_side: u32,
    /// All windows are whole faces, one after the other.
    whole: bool,
    depths: DepthCode,
}

/// What records are asked about: a point relative to the light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction {
    /// The difference of both, divided by its largest component.
    pub(super) x: [f32; 3],
    /// That component.
    pub(super) w: f32,
}

/// A query's place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) direction: Direction,
    /// Where in the texel, from 0 to 1, both ends included.
    pub(super) at: [f32; 2],
    pub(super) texel: u32,
    pub(super) code: u32,
}

impl Cube {
    /// The cube around `light` with these windows, which have all the same sides, if any.
    pub(super) fn new(light: DVec3, windows: &[Window; 6], depths: DepthCode) -> Self {
        let side = windows.iter().map(Window::side).max().unwrap_or(0).max(1);
        let faces = [0, 1, 2, 3, 4, 5];
        let whole = (0..).zip(windows).all(|(i, w)| *w == Window::whole(side, FIRST + i * side * side));
        Self {
            light,
            origin: [0, 1].map(|i| faces.map(|f| windows[f].origin[i])),
            scale: [0, 1].map(|i| faces.map(|f| windows[f].scale[i])),
            first: windows.map(|w| w.first),
            side,
            log_side: side.ilog2(),
            whole,
            depths,
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

    /// The place of a query from this point.
    #[inline(always)]
    pub(super) fn place(&self, from: DVec3) -> Place {
        let d = self.difference(from);
        if self.whole { self.place_of::<true, false>(d) } else { self.place_of::<false, false>(d) }
    }

    /// The difference of a point and the light.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "the slack of a texel covers the rounding")]
    pub(super) fn difference(&self, from: DVec3) -> [f32; 3] {
        [(from.x - self.light.x) as f32, (from.y - self.light.y) as f32, (from.z - self.light.z) as f32]
    }

    /// The place of a query at this difference from the light. `WHOLE` says that the windows are whole faces, `MANY` that this is one of many, whose
    /// components are selected in vectors. One alone takes them from memory, for its selections would become branches, which are taken at random.
    #[inline(always)]
    pub(super) fn place_of<const WHOLE: bool, const MANY: bool>(&self, [x, y, z]: [f32; 3]) -> Place {
        // The face is that of the largest component.
        let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
        let second = ay > ax;
        let of_two = if second { ay } else { ax };
        let third = az > of_two;
        let w = if third { az } else { of_two };
        let axis = 2 * u32::from(third) + u32::from(second & !third);
        let (u, v, along) = if MANY {
            let (u, v, along) = if second { (z, x, y) } else { (y, z, x) };
            if third { (x, y, z) } else { (u, v, along) }
        } else {
            let (cycle, axis) = ([x, y, z, x, y], axis.min(2) as usize);
            (cycle[axis + 1], cycle[axis + 2], cycle[axis])
        };
        let face = 2 * axis + (along.to_bits() >> 31);
        // False for what is no number.
        let valid = (ax + ay + az <= REACH[1]) & (w >= REACH[0]);
        let inverse = w.recip();
        let ([origin_u, origin_v], [scale_u, scale_v], first) = self.window::<WHOLE>(face);
        let (column, row) = (u * (inverse * scale_u) + origin_u, v * (inverse * scale_v) + origin_v);
        let n = self.side as f32;
        let inside = valid & (WHOLE | ((column >= 0.0) & (row >= 0.0) & (column < n) & (row < n)));
        let last = self.side - 1;
        let (i, j) = (whole(column).min(last), whole(row).min(last));
        let texel = first + in_window(i, j, self.log_side);
        let beside = if valid { NOTHING } else { UNKNOWN };
        Place {
            direction: Direction { x: [x * inverse, y * inverse, z * inverse], w },
            at: [column - i as f32, row - j as f32],
            texel: if inside { texel } else { beside },
            code: self.depths.of(w),
        }
    }

    /// The window of a face: its origin, its scale and its first texel.
    #[inline(always)]
    fn window<const WHOLE: bool>(&self, face: u32) -> ([f32; 2], [f32; 2], u32) {
        if WHOLE {
            let half = self.side as f32 * 0.5;
            return ([half; 2], [half; 2], FIRST + (face << (2 * self.log_side)));
        }
        // Not closures, which would not be made vectors of.
        let (face, [of_u, of_v], [per_u, per_v]) = ((face as usize).min(5), &self.origin, &self.scale);
        ([of_u[face], of_v[face]], [per_u[face], per_v[face]], self.first[face])
    }
}

/// The number of a texel in its window: squares of 8 × 8, row by row.
#[inline(always)]
pub(super) const fn in_window(i: u32, j: u32, log_side: u32) -> u32 {
    const IN_SQUARE: u32 = SQUARE - 1;
    ((j & !IN_SQUARE) << log_side) + ((i & !IN_SQUARE) << 3) + ((j & IN_SQUARE) << 3) + (i & IN_SQUARE)
}

/// The number of a texel in its tile, as if that were a window.
pub(super) const fn in_tile(i: u32, j: u32) -> usize {
    in_window(i % TILE, j % TILE, TILE.ilog2()) as usize
}

/// The integer below `x`, which is less than 2²²; of an integer itself or the one below; 0 of what is negative. Half the instructions of a
/// conversion.
#[inline(always)]
fn whole(x: f32) -> u32 {
    // From 2²³ to 2²⁴ the last place is 1, so that a sum is rounded to the nearest integer; half of one less, for that is to be the one below.
    const SHIFT: f32 = (1_u32 << 23) as f32 - 0.5;
    const ZERO: i32 = ((1_u32 << 23) as f32).to_bits() as i32;
    #[allow(clippy::cast_sign_loss, clippy::cast_possible_wrap, reason = "not negative")]
    let whole = ((x + SHIFT).to_bits() as i32).max(ZERO) - ZERO;
    whole as u32
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
        (Cube::new(light, &windows, DepthCode::new(1e-3, 1e3)), windows)
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
            let place = cube.place(from);
            if place.texel == NOTHING {
                // Whatever face it was, it is beside the window by more than the slack of what is built for it.
                let near = |t: f64, middle: f64, half: f64| (t - middle).abs() < half - 24.0 * SLACK;
                assert!(
                    !(near(u, ends.u, ends.half_u) && near(v, ends.v, ends.half_v) && u.abs().max(v.abs()) < 0.999)
                );
                beside += 1;
                continue;
            }
            let number = place.texel - FIRST;
            let face = Face::ALL[(number / (window.side() * window.side())) as usize];
            let (i, j) = of[(number % (window.side() * window.side())) as usize];
            let rect = windows[face.index()].rect(f64::from(i), f64::from(j), 1.0);
            let local = face.local(d);
            let (u, v) = (local.x / local.z, local.y / local.z);
            assert!((u - rect.u).abs() <= rect.half_u - SLACK / 2.0, "{u} {rect:?} {place:?}");
            assert!((v - rect.v).abs() <= rect.half_v - SLACK / 2.0, "{v} {rect:?} {place:?}");
            assert!((f64::from(place.direction.w) / local.z - 1.0).abs() < 1e-7);
            let far = DVec3::from_array(place.direction.x.map(f64::from)) - d / local.z;
            assert!(far.abs().max_element() < 4.0 / 16_777_216.0);
            for (at, half) in place.at.iter().zip([rect.half_u, rect.half_v]) {
                let beyond = 2.0 * SLACK / half;
                assert!((-beyond..=1.0 + beyond).contains(&f64::from(*at)), "{place:?}");
            }
            found += 1;
        }
        assert!(found > 100_000 && beside > 5_000, "{found} {beside}");
    }

    #[test]
    fn what_is_too_near_or_too_far_or_no_number_has_a_texel_of_its_own() {
        for (cube, _) in [cube(Window::whole(64, 0), true), cube(Window::new([-1.0, 1.0, -0.5, 0.5], 64, 0), false)] {
            let far = [1e31, 1e39, 1e300, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
            for axis in 0..3 {
                for far in far {
                    for at in [DVec3::ZERO, DVec3::ONE, DVec3::new(5.0, -4.0, 3.0)] {
                        let mut from = at;
                        from[axis] = far;
                        assert_eq!(cube.place(from).texel, UNKNOWN, "{from}");
                    }
                }
            }
            assert_eq!(cube.place(cube.light()).texel, UNKNOWN);
            assert_eq!(cube.place_of::<true, false>([1e-31, 0.0, 0.0]).texel, UNKNOWN);
            assert!(cube.place_of::<true, false>([-1e-29, 1e-30, 0.0]).texel >= FIRST);
        }
    }

    #[test]
    fn whole_is_the_integer_below_or_of_an_integer_the_one_below_that() {
        for n in [0, 1, 2, 7, 1000, 4_194_302_u32] {
            let x = n as f32;
            assert!([n, n.saturating_sub(1)].contains(&whole(x)));
            assert_eq!(whole(x + 0.25), n);
            assert_eq!(whole((n + 1) as f32 - 0.25), n);
        }
        for x in [-0.0, -1e-30, -0.5, -1e30, f32::NEG_INFINITY, 1e-30, 0.999] {
            assert_eq!(whole(x), 0, "{x}");
        }
    }
}
