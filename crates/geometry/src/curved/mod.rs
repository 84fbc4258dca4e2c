//! Curved shapes: spheres, disks and cylinders, and whether a segment meets them: exactly.
//!
//! *Definition.* A shape is a canonical one in a space of its own: the unit sphere; the unit disk in the plane z = 0; the side of the unit
//! cylinder between z = 0 and z = 1, without caps. A double-precision affine map leads there from the world, and that map *is* the geometry:
//! a point p of the world is on the shape if A·p + t, without rounding, is on the canonical one. Nothing is ever tessellated.
//!
//! *Guarantee.* [`CurvedShape::meets`] and [`CurvedShape::side`] are exact for the double-precision ends of a segment: they are signs of
//! polynomials, computed with a bound of their rounding and again as expansions where that does not decide (`exact.rs`). As with triangles a segment
//! in the plane of a disk does not meet it. Only the places of hits are rounded.
//!
//! *Cost.* Some 30 ns for a shape whose box is met, 10 for a sphere; close calls take microseconds.

mod exact;
mod set;

use std::cmp::Ordering;

use glam::{DMat3, DVec3, dvec3};

use self::exact::{Bounded, Expansion, Number};
pub use self::set::{CurvedHit, CurvedSet};
use crate::{Bounds, Segment};

/// Which canonical shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurvedKind {
    /// |p| = 1, normals outwards.
    Sphere,
    /// |p| ≤ 1 in the plane z = 0, normal +z.
    Disk,
    /// x² + y² = 1 and 0 ≤ z ≤ 1, normals outwards.
    Cylinder,
}

/// A canonical shape at its place in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvedShape {
    kind: CurvedKind,
    /// The rows of the linear part of the map from the world.
    rows: [DVec3; 3],
    /// Its translation.
    offset: DVec3,
    /// The map back, rounded.
    world_from_local: DMat3,
    origin: DVec3,
    flipped: bool,
    bounds: Bounds,
    /// The largest sum of absolute values of a row of the map, and the largest absolute value of its translation.
    sizes: [f64; 2],
}

/// The bounds of a shape are widened by this share of their largest coordinate, far more than the rounding of the map back.
const PAD: f64 = 1e-9;

/// What distances from the centre of a sphere are off by at most, in its own space, over the largest value that the map of the points adds up: 128 halves of an ulp
/// (`docs/numerics.md`).
const DISTANCE_ERROR: f64 = 1.0 / 70_368_744_177_664.0;

/// The map back may be off by this in units of the shape; a point that was computed with it is lifted by more.
const MOST_INVERSION_ERROR: f64 = 1e-12;

impl CurvedShape {
    /// The shape that the map from its own space puts into the world: `linear`·p + `origin`. `flipped` turns the normals round. `None` if the map
    /// cannot be inverted, or not accurately enough: its axes differ by more than a thousandfold or are nearly parallel.
    #[must_use]
    pub fn new(kind: CurvedKind, linear: DMat3, origin: DVec3, flipped: bool) -> Option<Self> {
        let inverse = linear.inverse();
        let finite = inverse.is_finite() && linear.is_finite() && origin.is_finite();
        let product = inverse * linear - DMat3::IDENTITY;
        let exact = product.to_cols_array().iter().all(|e| e.abs() < MOST_INVERSION_ERROR);
        if !(finite && exact) {
            return None;
        }
        let transposed = inverse.transpose();
        let rows = [transposed.x_axis, transposed.y_axis, transposed.z_axis];
        let reach = |axis: usize| {
            let [x, y, z] = [linear.x_axis[axis], linear.y_axis[axis], linear.z_axis[axis]];
            match kind {
                CurvedKind::Sphere => [x.hypot(y).hypot(z); 2].map(|r| (r, 0.0)),
                CurvedKind::Disk => [x.hypot(y); 2].map(|r| (r, 0.0)),
                CurvedKind::Cylinder => [(x.hypot(y), z.min(0.0)), (x.hypot(y), z.max(0.0))],
            }
        };
        let (mut min, mut max) = (origin, origin);
        for axis in 0..3 {
            let [(low, shift_low), (high, shift_high)] = reach(axis);
            min[axis] += shift_low - low;
            max[axis] += shift_high + high;
        }
        let pad = PAD * Bounds::new(min, max).largest_coordinate();
        let bounds = Bounds::new(min - pad, max + pad);
        let offset = -(inverse * origin);
        let gain = rows.map(|row| row.abs().element_sum()).into_iter().fold(0.0, f64::max);
        let sizes = [gain, offset.abs().max_element()];
        Some(Self { kind, rows, offset, world_from_local: linear, origin, flipped, bounds, sizes })
    }

    /// Which canonical shape it is.
    #[must_use]
    pub const fn kind(&self) -> CurvedKind {
        self.kind
    }

    /// Whether its normals are turned round.
    #[must_use]
    pub const fn is_flipped(&self) -> bool {
        self.flipped
    }

    /// A box around it.
    #[must_use]
    pub const fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The map from the shape's own space: its linear part and its translation.
    #[must_use]
    pub const fn placement(&self) -> (&DMat3, DVec3) {
        (&self.world_from_local, self.origin)
    }

    /// The same shape with its normals on the other side.
    #[must_use]
    pub const fn turned(self) -> Self {
        Self { flipped: !self.flipped, ..self }
    }

    /// A point of the world in the shape's own space, rounded.
    #[inline]
    #[must_use]
    pub fn to_local(&self, p: DVec3) -> DVec3 {
        dvec3(self.rows[0].dot(p), self.rows[1].dot(p), self.rows[2].dot(p)) + self.offset
    }

    /// A point of the shape's own space in the world, rounded.
    #[inline]
    #[must_use]
    pub fn to_world(&self, p: DVec3) -> DVec3 {
        self.world_from_local * p + self.origin
    }

    /// The point of the canonical shape next to a hit that was rounded.
    #[inline]
    #[must_use]
    pub fn snapped(&self, local: DVec3) -> DVec3 {
        match self.kind {
            CurvedKind::Sphere => local.normalize_or(DVec3::Z),
            CurvedKind::Disk => dvec3(local.x, local.y, 0.0),
            CurvedKind::Cylinder => {
                let r = local.x.hypot(local.y);
                let (x, y) = if r > 0.0 { (local.x / r, local.y / r) } else { (1.0, 0.0) };
                dvec3(x, y, local.z.clamp(0.0, 1.0))
            }
        }
    }

    /// The unit normal at a point of the canonical shape, in the world.
    #[inline]
    #[must_use]
    pub fn normal(&self, local: DVec3) -> DVec3 {
        let n = match self.kind {
            CurvedKind::Sphere => local,
            CurvedKind::Disk => DVec3::Z,
            CurvedKind::Cylinder => dvec3(local.x, local.y, 0.0),
        };
        // A normal is carried by the transpose of the map from the world.
        let n = (self.rows[0] * n.x + self.rows[1] * n.y + self.rows[2] * n.z).normalize_or(DVec3::Z);
        if self.flipped { -n } else { n }
    }

    /// On which side of a sphere a point is, exactly: less inside, greater outside, equal on it. Other shapes have no sides: greater.
    #[inline]
    #[must_use]
    pub fn side(&self, p: DVec3) -> Ordering {
        if self.kind != CurvedKind::Sphere {
            return Ordering::Greater;
        }
        let error = self.distance_error(p.abs().max_element());
        side_of(self.to_local(p).length_squared(), error).unwrap_or_else(|| self.side_closely(p))
    }

    #[cold]
    fn side_closely(&self, p: DVec3) -> Ordering {
        self.side_with::<Bounded>(p).or_else(|| self.side_with::<Expansion>(p)).unwrap_or(Ordering::Greater)
    }

    fn side_with<N: Number>(&self, p: DVec3) -> Option<Ordering> {
        let [x, y, z] = self.local::<N>(p);
        x.squared().plus(&y.squared()).plus(&z.squared()).minus(&N::of(1.0)).sign()
    }

    /// Whether the closed segment meets the shape, exactly.
    #[inline]
    #[must_use]
    pub fn meets(&self, segment: &Segment) -> bool {
        if self.bounds.misses(segment) || !(segment.p.is_finite() && segment.q.is_finite()) {
            return false;
        }
        if self.kind == CurvedKind::Sphere
            && let Some(meets) = self.meets_clearly(segment)
        {
            return meets;
        }
        self.meets_with::<Bounded>(segment).unwrap_or_else(|| self.meets_exactly(segment))
    }

    /// What the distances from the centre of a sphere are off by at most, for points with no coordinate larger than `size`.
    #[inline]
    fn distance_error(&self, size: f64) -> f64 {
        DISTANCE_ERROR * (1.0 + self.sizes[0] * size + self.sizes[1])
    }

    /// Whether the closed segment meets the sphere, by the distances of its ends and of its nearest point from the centre; `None` where one of them is so close to
    /// the radius that rounding matters.
    #[inline]
    fn meets_clearly(&self, segment: &Segment) -> Option<bool> {
        let (a, b) = (self.to_local(segment.p), self.to_local(segment.q));
        let error = self.distance_error(segment.p.abs().max(segment.q.abs()).max_element());
        let (p, q) = (side_of(a.length_squared(), error)?, side_of(b.length_squared(), error)?);
        if p.is_lt() || q.is_lt() {
            return Some(p != q);
        }
        let d = b - a;
        let t = (-a.dot(d) / d.length_squared()).clamp(0.0, 1.0);
        side_of((a + d * t).length_squared(), error).map(Ordering::is_lt)
    }

    /// The slow twin of [`CurvedShape::meets`]: exact arithmetic alone, without a look at the shape's box. Cost: some microseconds.
    #[cold]
    #[must_use]
    pub fn meets_exactly(&self, segment: &Segment) -> bool {
        segment.p.is_finite() && segment.q.is_finite() && self.meets_with::<Expansion>(segment).unwrap_or(false)
    }

    /// A·p + t.
    fn local<N: Number>(&self, p: DVec3) -> [N; 3] {
        let [x, y, z] = p.to_array().map(N::of);
        [0, 1, 2].map(|i| {
            let [a, b, c] = self.rows[i].to_array().map(N::of);
            a.times(&x).plus(&b.times(&y)).plus(&c.times(&z)).plus(&N::of(self.offset[i]))
        })
    }

    fn meets_with<N: Number>(&self, segment: &Segment) -> Option<bool> {
        let (a, b) = (self.local::<N>(segment.p), self.local::<N>(segment.q));
        match self.kind {
            CurvedKind::Sphere => meets_sphere(&a, &b),
            CurvedKind::Disk => meets_disk(&a, &b),
            CurvedKind::Cylinder => meets_cylinder(&a, &b),
        }
    }

    /// Where the closed segment meets the shape: at most two places, in order, each a parameter along the segment in [0, 1]. There is one exactly if
    /// [`CurvedShape::meets`] says so; that it is, and which of the two places a sphere is met at, is exact; where is rounded.
    #[inline]
    #[must_use]
    pub fn hits(&self, segment: &Segment) -> [Option<f64>; 2] {
        if !self.meets(segment) {
            return [None; 2];
        }
        let (a, b) = (self.to_local(segment.p), self.to_local(segment.q));
        let d = b - a;
        let clamped = |t: f64| if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
        match self.kind {
            CurvedKind::Disk => [Some(clamped(a.z / (a.z - b.z))), None],
            CurvedKind::Sphere => {
                let [first, second] = roots(a, d);
                let (p_in, q_in) = (self.side(segment.p).is_le(), self.side(segment.q).is_le());
                match (p_in, q_in) {
                    (false, true) => [Some(clamped(first)), None],
                    (true, false) => [Some(clamped(second)), None],
                    // Both ends on it or inside: one of them is on it.
                    (true, true) if self.side(segment.p).is_eq() => [Some(0.0), None],
                    (true, true) => [Some(1.0), None],
                    (false, false) => [Some(clamped(first)), Some(clamped(second))],
                }
            }
            CurvedKind::Cylinder => {
                let flat = |v: DVec3| dvec3(v.x, v.y, 0.0);
                let places = roots(flat(a), flat(d));
                let within = |t: &f64| (0.0..=1.0).contains(t) && (0.0..=1.0).contains(&(a.z + d.z * t));
                let mut valid = places.into_iter().filter(within);
                match (valid.next(), valid.next()) {
                    (None, _) => {
                        // Rounding has moved it beyond an end or a rim: the nearest of all that would do.
                        let beyond = |t: f64| {
                            let t = clamped(t);
                            let z = a.z + d.z * t;
                            (z - z.clamp(0.0, 1.0)).abs() + ((flat(a) + flat(d) * t).length() - 1.0).abs()
                        };
                        let candidates = [places[0], places[1], -a.z / d.z, (1.0 - a.z) / d.z, 0.0, 1.0];
                        let best = candidates
                            .into_iter()
                            .filter(|t| !t.is_nan())
                            .min_by(|s, t| beyond(*s).total_cmp(&beyond(*t)));
                        [best.map(clamped), None]
                    }
                    found => [found.0, found.1],
                }
            }
        }
    }
}

/// How a squared distance that is off by so much at most, before it is squared, compares with 1; `None` if that is not known. An error beyond a half tells nothing.
#[inline]
fn side_of(distance2: f64, error: f64) -> Option<Ordering> {
    let (low, high) = ((1.0 - error) * (1.0 - error), (1.0 + error) * (1.0 + error));
    if error > 0.5 {
        None
    } else if distance2 > high {
        Some(Ordering::Greater)
    } else if distance2 < low {
        Some(Ordering::Less)
    } else {
        None
    }
}

/// The parameters at which the line a + t·d is at the distance 1 from the origin, where it is at all; else twice that of its nearest point.
///
/// The distance of the line from the origin is found from its nearest point, not by b² − 4ac, which cancels for a far start \[Haines2019\].
fn roots(a: DVec3, d: DVec3) -> [f64; 2] {
    let length2 = d.length_squared();
    let nearest = -a.dot(d) / length2;
    let gap2 = (a + d * nearest).length_squared();
    let half = ((1.0 - gap2).max(0.0) / length2).sqrt();
    [nearest - half, nearest + half]
}

/// Whether the segment from a to b meets the unit circle or sphere, by the signs of |a|² − w², |b|² − w² and, if both are outside, whether the nearest
/// point of the line lies between them and is no farther than 1: |a × b|² ≤ |d|², all times a common factor. `beside` is computed only then.
fn meets_round<N: Number>(a: &N, b: &N, beside: impl FnOnce() -> (N, N, N)) -> Option<bool> {
    let (a, b) = (a.sign()?, b.sign()?);
    if a.is_gt() && b.is_gt() {
        let (before, after, gap) = beside();
        return Some(before.sign()?.is_lt() && after.sign()?.is_gt() && gap.sign()?.is_le());
    }
    Some(!(a.is_lt() && b.is_lt()))
}

fn dot<N: Number>(a: &[N], b: &[N]) -> N {
    a.iter().zip(b).fold(N::of(0.0), |sum, (a, b)| sum.plus(&a.times(b)))
}

fn meets_sphere<N: Number>(a: &[N; 3], b: &[N; 3]) -> Option<bool> {
    let one = N::of(1.0);
    meets_round(&dot(a, a).minus(&one), &dot(b, b).minus(&one), || {
        let d = [0, 1, 2].map(|i| b[i].minus(&a[i]));
        let cross = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i].times(&b[j]).minus(&a[j].times(&b[i])));
        (dot(a, &d), dot(b, &d), dot(&cross, &cross).minus(&dot(&d, &d)))
    })
}

fn meets_disk<N: Number>(a: &[N; 3], b: &[N; 3]) -> Option<bool> {
    let (above, below) = (a[2].sign()?, b[2].sign()?);
    if above == below {
        // On one side, or in the plane.
        return Some(false);
    }
    // Where the line meets the plane, times b.z − a.z.
    let at = |i: usize| a[i].times(&b[2]).minus(&b[i].times(&a[2]));
    let w = b[2].minus(&a[2]);
    Some(at(0).squared().plus(&at(1).squared()).minus(&w.squared()).sign()?.is_le())
}

fn meets_cylinder<N: Number>(a: &[N; 3], b: &[N; 3]) -> Option<bool> {
    let one = N::of(1.0);
    // The part of the segment between the planes of the rims, its ends as x, y and w > 0.
    let end = |from: &[N; 3], to: &[N; 3]| -> Option<Option<[N; 3]>> {
        for (rim, outside) in [(&N::of(0.0), Ordering::Less), (&one, Ordering::Greater)] {
            if from[2].minus(rim).sign()? == outside {
                let beyond = to[2].minus(rim).sign()?;
                if beyond == outside {
                    return Some(None);
                }
                let (from_rim, to_rim) = (from[2].minus(rim), to[2].minus(rim));
                let point = [
                    from[0].times(&to_rim).minus(&to[0].times(&from_rim)),
                    from[1].times(&to_rim).minus(&to[1].times(&from_rim)),
                    to[2].minus(&from[2]),
                ];
                let turned = outside.is_gt();
                return Some(Some(if turned { point.map(|v| v.negated()) } else { point }));
            }
        }
        Some(Some([from[0].clone(), from[1].clone(), one.clone()]))
    };
    let (Some(a), Some(b)) = (end(a, b)?, end(b, a)?) else { return Some(false) };
    let round = |p: &[N; 3]| p[0].squared().plus(&p[1].squared()).minus(&p[2].squared());
    meets_round(&round(&a), &round(&b), || {
        let d = [0, 1].map(|i| b[i].times(&a[2]).minus(&a[i].times(&b[2])));
        let cross = a[0].times(&b[1]).minus(&a[1].times(&b[0]));
        (dot(&a[..2], &d), dot(&b[..2], &d), cross.squared().minus(&dot(&d, &d)))
    })
}

#[cfg(test)]
mod tests;
