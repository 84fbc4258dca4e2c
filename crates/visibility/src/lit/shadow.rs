//! The shadow of one triangle on a segment: where it stands between the segment and a point light.
//!
//! *Idea.* Whether the way from a point P of the line to the light L meets the triangle abc is a matter of signs (`intersect_exact`): of the three
//! edge functions (a − L) × (b − L) · (P − L), and of n · (P − a), the side that P is on. All four are linear in the segment's
//! parameter, so each sign holds up to a root, and a shadow is what is left between four roots.
//!
//! *Definition.* With A = a − L, …, N = A × B, R = p − L and d the segment's vector as [`Segment::at`] computes it, an edge function is
//! f(t) = N·R + t N·d. On the far side of the triangle the sum of the three, n·(P − L), has the sign opposite to that of the light's side n·(L − a).
//!
//! *Guarantee.* A query from the rounded point `segment.at(t)` is occluded by this triangle if t lies in [`Shadow::dark`], and is not if t lies
//! outside of [`Shadow::shade`]. For with u = 2⁻⁵³, all norms the largest component and K = |R| + |d| + |p|:
//! a component of N is two products of rounded differences, and errs by at most 8u|A||B|; |N| ≤ 2|A||B| itself. So f errs, for t up to
//! 1, by 3·8u|A||B|(|R| + |d|) through N, by 6u|A||B||R| through R, by 18u|A||B|(|R| + |d|) through the products and sums of the two
//! dots. `at` rounds a point by at most u(|p| + 2|d|) along each axis, which changes f by at most 12u|A||B|K. A root (±E − f₀)/f₁ is rounded
//! twice, which is as if f erred by 2u(|f₀| + E) ≤ 13u|A||B|K. Together that is less than 73u|A||B|K; E = 128u|A||B|K leaves room
//! for terms of higher order. The same bound holds for n·(P − a) with |b − a||c − a| in place of |A||B|, and p − a in place of R.
//!
//! *Limits.* Those of the exact test: cubes of coordinates neither overflow nor underflow. Where something is not finite nothing is dark.

use glam::{DVec3, Vec3};
use vdf_geometry::{Segment, Triangle};

/// E in multiples of the product of three lengths: 128u.
const ERROR: f64 = 128.0 / 9_007_199_254_740_992.0;

/// A segment and a point light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beam {
    light: DVec3,
    /// The segment's start, from the origin and from the light.
    start: DVec3,
    from_light: DVec3,
    vector: DVec3,
    /// K, and K without |R|.
    size: f64,
    reach: f64,
}

/// One end of a shadow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct End {
    /// The parameter.
    pub(super) t: f64,
    /// Where the shadow would end if it were not for the edge that it ends at.
    pub(super) beyond: f64,
    /// That edge, in the direction in which its edge function is positive in the shadow; no number if it is none of the triangle's edges.
    pub(super) edge: [Vec3; 2],
}

impl End {
    /// Whether nothing lies between this end of a shadow and the beginning of another: they meet at an edge that the triangles share. For
    /// what is beside the edge on either side, or on it, is behind the one triangle or the other, by the sign of one edge function.
    pub(super) fn meets(&self, begin: &Self) -> bool {
        self.edge == [begin.edge[1], begin.edge[0]] && self.beyond >= begin.t && begin.beyond <= self.t
    }
}

/// What one triangle hides of a segment from a light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shadow {
    /// Outside of these parameters it certainly hides nothing.
    pub(super) shade: [f64; 2],
    /// Between these it certainly hides everything, if there is such a place.
    pub(super) dark: Option<[End; 2]>,
}

impl Shadow {
    /// A shadow that says nothing.
    const UNKNOWN: Self = Self { shade: [0.0, 1.0], dark: None };
}

/// A sign that has to hold: that of `at_start + t·slope`.
#[derive(Clone, Copy, Debug)]
struct Sign {
    at_start: f64,
    slope: f64,
    error: f64,
}

impl Sign {
    const fn negated(self) -> Self {
        Self { at_start: -self.at_start, slope: -self.slope, ..self }
    }

    /// The parameters where the function is at least `least`, all of them or none if it is constant.
    #[inline]
    fn at_least(&self, least: f64) -> [f64; 2] {
        let root = (least - self.at_start) / self.slope;
        if self.slope > 0.0 {
            [root, f64::INFINITY]
        } else if self.slope < 0.0 {
            [f64::NEG_INFINITY, root]
        } else if self.at_start >= least {
            [f64::NEG_INFINITY, f64::INFINITY]
        } else {
            [f64::INFINITY, f64::NEG_INFINITY]
        }
    }
}

impl Beam {
    /// All ways from the points of `segment` to `light`.
    pub(super) fn new(light: DVec3, segment: &Segment) -> Self {
        let size = |v: DVec3| v.abs().max_element();
        let (start, vector, from_light) = (segment.p, segment.q - segment.p, segment.p - light);
        let reach = size(vector) + size(start);
        Self { light, start, from_light, vector, size: size(from_light) + reach, reach }
    }

    /// The shadow of a triangle; `None` if it certainly hides nothing.
    #[inline]
    pub(super) fn shadow(&self, triangle: &Triangle) -> Option<Shadow> {
        let size = |v: DVec3| v.abs().max_element();
        let vertices = triangle.vertices_f64();
        let [a, b, c] = vertices.map(|v| v - self.light);
        let lengths = [a, b, c].map(size);
        let edge = |v: DVec3, w: DVec3, lengths: f64| {
            let normal = v.cross(w);
            Sign {
                at_start: normal.dot(self.from_light),
                slope: normal.dot(self.vector),
                error: ERROR * self.size * lengths,
            }
        };
        let edges = [
            edge(a, b, lengths[0] * lengths[1]),
            edge(b, c, lengths[1] * lengths[2]),
            edge(c, a, lengths[2] * lengths[0]),
        ];
        let (ab, ac) = (vertices[1] - vertices[0], vertices[2] - vertices[0]);
        let (normal, lengths_of_normal) = (ab.cross(ac), size(ab) * size(ac));
        let from_a = self.start - vertices[0];
        let side = Sign {
            at_start: normal.dot(from_a),
            slope: normal.dot(self.vector),
            error: ERROR * (size(from_a) + self.reach) * lengths_of_normal,
        };
        let light_side = -normal.dot(a);
        let light_error = ERROR * lengths[0] * lengths_of_normal;
        if !(light_side.abs() < f64::INFINITY
            && side.error < f64::INFINITY
            && edges.iter().all(|e| e.error < f64::INFINITY))
        {
            return Some(Shadow::UNKNOWN);
        }
        if light_side.abs() > light_error {
            // The ways that meet it begin on the other side, where the edge functions have the sign of that side.
            let above = light_side > 0.0;
            let signs = if above { edges.map(Sign::negated) } else { edges };
            let side = if above { side.negated() } else { side };
            let shade = shade(&[signs[0], signs[1], signs[2], side])?;
            return Some(Shadow { shade, dark: dark(&signs, &side, triangle, above) });
        }
        // Seen edge-on, as far as one can tell: either sign may be the one, and none is certain.
        let ways = [shade(&edges), shade(&edges.map(Sign::negated))];
        let shade = match ways {
            [Some(a), Some(b)] => [a[0].min(b[0]), a[1].max(b[1])],
            [one, other] => one.or(other)?,
        };
        Some(Shadow { shade, dark: None })
    }
}

/// Where no sign is certainly wrong.
#[inline]
fn shade(signs: &[Sign]) -> Option<[f64; 2]> {
    let mut shade = [0.0_f64, 1.0_f64];
    for sign in signs {
        let [from, to] = sign.at_least(-sign.error);
        shade = [shade[0].max(from), shade[1].min(to)];
    }
    (shade[0] <= shade[1]).then_some(shade)
}

/// Where all signs are certain.
#[inline]
fn dark(edges: &[Sign; 3], side: &Sign, triangle: &Triangle, above: bool) -> Option<[End; 2]> {
    let none = [Vec3::NAN; 2];
    let [a, b, c] = triangle.vertices;
    let mut begin = End { t: 0.0, beyond: f64::NEG_INFINITY, edge: none };
    let mut end = End { t: 1.0, beyond: f64::INFINITY, edge: none };
    let vertices = [[a, b], [b, c], [c, a]];
    for (sign, [v, w]) in edges.iter().zip(vertices).chain([(side, none)]) {
        let [from, to] = sign.at_least(sign.error);
        let edge = if above { [w, v] } else { [v, w] };
        begin = if from > begin.t {
            End { t: from, beyond: begin.t, edge }
        } else {
            End { beyond: begin.beyond.max(from), ..begin }
        };
        end = if to < end.t { End { t: to, beyond: end.t, edge } } else { End { beyond: end.beyond.min(to), ..end } };
    }
    (begin.t <= end.t).then_some([begin, end])
}
