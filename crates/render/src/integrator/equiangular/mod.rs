//! Distances along a ray towards a point that shines: by the angle that they subtend there, and by what comes through the medium.
//!
//! *Idea.* Light from a point falls off with the squared distance r², so along a ray that passes it at distance D the angle φ that a distance
//! subtends at the point is drawn uniformly, not the distance: dφ = D/r² ds \[Kulla2012\]. What is left is smooth in φ, transmittance
//! to the camera and to the light, phase function, the cosine at an area light: it is tabulated at a few angles of each stretch, the nodes,
//! and the density follows the polygon through them.
//!
//! *Definition.* With a and b the ends of a stretch, s a distance, all from the point of the ray that is nearest to the light:
//! Δ = atan2(D(b − a), D² + ab), s = a + (D² + a²) sin φ/(D cos φ − a sin φ), density g(φ)/∫g · D/(D² + s²). No difference of two arcs and no
//! division by D, so nothing cancels for far lights or near ones. (The paper's eq. 8 is in error.)
//!
//! *Guarantee.* [`Equiangular::pdf`] is the density of [`Equiangular::sample`]; it integrates to 1 over the stretches. Where the polygon
//! misses a peak it is no good density; so it is used in a mixture with one that bounds the weights (`raymarch`).
//!
//! *Limits.* Lights nearer to the ray than 2⁻⁴⁴ of their distance from its ends count as that far away. In another medium than the ray a
//! light's transmittance is misjudged, which costs noise, not truth.

use std::f64::consts::PI;

use glam::DVec3;
use smallvec::SmallVec;
use vdf_scene::Phase;

use super::stretch::Stretch;

/// Where the light is as seen from a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightPlace {
    pub(super) position: DVec3,
    /// Unit normal of the side that shines, if it is only one.
    pub(super) normal: Option<DVec3>,
}

impl LightPlace {
    /// The least distance from it on the ray from `origin`.
    #[inline]
    pub(super) fn passed_at(&self, origin: DVec3, direction: DVec3) -> f64 {
        let to_light = self.position - origin;
        (to_light - direction * to_light.dot(direction).max(0.0)).length()
    }
}

/// A light counts as at least so far from the ray, in multiples of its distance from the ray's ends: 2⁻⁴⁴, some hundred times the rounding of
/// that distance.
const NEAREST: f64 = 1.0 / 17_592_186_044_416.0;

/// The density of distances towards one point that shines, with so many nodes on each stretch, at least two.
#[derive(Debug)]
pub(super) struct Equiangular<const NODES: usize> {
    /// Distance of the point of the ray that is nearest to the light.
    foot: f64,
    /// The light's distance from it, positive.
    gap: f64,
    arcs: SmallVec<[Arc<NODES>; 2]>,
    /// ∫g over all arcs; 0 if nothing can be drawn.
    total: f64,
    /// The least optical depth from the camera to the light, which all g are without.
    least: f64,
    /// How far g may be from what it stands for, at most; infinite if it is not known.
    contrast: f64,
}

/// A stretch as seen from the light.
#[derive(Clone, Copy, Debug)]
struct Arc<const NODES: usize> {
    /// Index of the stretch.
    stretch: usize,
    /// Its ends, from the foot.
    begin: f64,
    end: f64,
    /// The angle of a cell.
    step: f64,
    /// g at the ends of the cells.
    values: [f64; NODES],
}

impl<const NODES: usize> Equiangular<NODES> {
    /// Prepares the density along the ray from `origin` in the unit direction `direction`.
    pub(super) fn new(origin: DVec3, direction: DVec3, stretches: &[Stretch], light: &LightPlace) -> Self {
        let to_light = light.position - origin;
        let foot = to_light.dot(direction);
        let ends = stretches.first().zip(stretches.last());
        let (first, last) = ends.map_or((0.0, 0.0), |(a, b)| (a.begin - foot, b.end - foot));
        let gap = (to_light - direction * foot).length();
        let gap = gap.max(NEAREST * first.abs().max(last.abs()).max(foot.abs())).max(f64::MIN_POSITIVE);
        // The cosine at the light is (rise + slope·s)/r.
        let [rise, slope] = light.normal.map_or([0.0; 2], |n| [(direction * foot - to_light).dot(n), direction.dot(n)]);
        // Along a stretch the way from the camera to the light does not get shorter, so what comes through is most where it begins.
        let depth = |stretch: &Stretch| stretch.depth + stretch.sigma_t * gap.hypot(stretch.begin - foot);
        let least = stretches.iter().map(depth).fold(f64::INFINITY, f64::min);
        let mut arcs = SmallVec::new();
        let mut total = 0.0;
        let is_known = light.normal.is_none() && stretches.iter().all(|stretch| stretch.is_even);
        let mut contrast = if is_known { 1.0_f64 } else { f64::INFINITY };
        let [mut nearest, mut farthest, mut densest] = [f64::INFINITY, 0.0_f64, 0.0_f64];
        for (i, stretch) in stretches.iter().enumerate() {
            let (begin, end) = (stretch.begin - foot, stretch.end - foot);
            let step = (gap * (end - begin)).atan2(gap * gap + begin * end) / Arc::<NODES>::CELLS as f64;
            if !(step > 0.0 && step.is_finite()) {
                continue;
            }
            let sigma_s = stretch.sigma_t * f64::from(stretch.albedo.element_sum()) / 3.0;
            let mut arc = Arc { stretch: i, begin, end, step, values: [0.0; NODES] };
            // Cosine and sine of the angle at the light between the foot and a point of the ray, turned by a step a cell. Their rounding is
            // beside the point, for the polygon is whatever they make it.
            let (sin_step, cos_step) = step.sin_cos();
            let r = gap.hypot(begin);
            let (mut cos, mut sin) = (gap / r, begin / r);
            let least_cos = gap / r.max(gap.hypot(end));
            nearest = nearest.min(if begin < 0.0 && end > 0.0 { gap } else { r.min(gap.hypot(end)) });
            farthest = farthest.max(gap / least_cos);
            densest = densest.max(stretch.sigma_t);
            let mut last: Option<[f64; 2]> = None;
            for value in &mut arc.values {
                let r = gap / cos.max(least_cos);
                let s = (r * sin).clamp(begin, end);
                let through = (least - stretch.depth - stretch.sigma_t * ((s - begin) + r)).exp();
                let at_light = if light.normal.is_some() { ((rise + slope * s) / r).max(0.0) } else { 1.0 };
                let phase = phase_at_cosine(stretch.phase, -sin);
                *value = sigma_s * through * at_light * phase;
                if let Some([last_through, last_phase]) = last.replace([through, phase]) {
                    // Both are monotone in between, so there their product is not beyond that of their extremes.
                    let extremes = |a: f64, b: f64| a.max(b) / a.min(b);
                    contrast = contrast.max(extremes(last_through, through) * extremes(last_phase, phase));
                }
                (cos, sin) = (cos * cos_step - sin * sin_step, sin * cos_step + cos * sin_step);
            }
            total += arc.area();
            arcs.push(arc);
        }
        // These have a minimum that may lie between two nodes.
        if stretches.iter().any(|s| matches!(s.phase, Phase::Rayleigh | Phase::TwoLobes { .. })) {
            contrast = f64::INFINITY;
        }
        // Where there is another medium on the way to the light, the way's transmittance is misjudged.
        contrast = contrast.max((densest * (farthest - nearest)).exp());
        // A maximum passes over what is no number.
        let contrast = if arcs.is_empty() || total > 0.0 { contrast } else { f64::INFINITY };
        Self { foot, gap, arcs, total: if total.is_finite() { total } else { 0.0 }, least, contrast }
    }

    /// The contribution of the light, for an intensity of 1, if it saw all of the stretches; as far as g is close.
    #[inline]
    pub(super) fn worth(&self) -> f64 {
        self.total * (-self.least).exp() / self.gap
    }

    /// How many times g may be as large, or as small, as what it stands for; infinite if that is not known.
    #[inline]
    pub(super) fn contrast(&self) -> f64 {
        self.contrast
    }

    /// True if nothing can be drawn: the stretches are empty, or all behind the light.
    #[inline]
    pub(super) fn is_empty(&self) -> bool {
        self.total <= 0.0
    }

    /// A distance, and the index of its stretch, from a uniform number in [0, 1); `None` if nothing can be drawn.
    #[inline]
    pub(super) fn sample(&self, u: f64) -> Option<(usize, f64)> {
        let mut left = u * self.total;
        let mut drawn = None;
        for arc in &self.arcs {
            let area = arc.area();
            if area > 0.0 {
                drawn = Some(arc);
                if left < area {
                    break;
                }
                left -= area;
            }
        }
        // Rounding may leave something beyond the last; it belongs to its end.
        drawn.map(|arc| {
            let (sin, cos) = arc.angle(left).sin_cos();
            let (gap, begin) = (self.gap, arc.begin);
            let s = begin + (gap * gap + begin * begin) * sin / (gap * cos - begin * sin);
            // At the very end the denominator may round to zero.
            let s = if s >= begin { s.min(arc.end) } else { arc.end };
            (arc.stretch, s + self.foot)
        })
    }

    /// The density per world unit at a distance in the stretch with this index; 0 if nothing can be drawn.
    #[inline]
    pub(super) fn pdf(&self, stretch: usize, distance: f64) -> f64 {
        let s = distance - self.foot;
        let arc = self.arcs.iter().find(|arc| arc.stretch == stretch && self.total > 0.0);
        arc.map_or(0.0, |arc| {
            let phi = (self.gap * (s - arc.begin)).atan2(self.gap * self.gap + arc.begin * s);
            let r = self.gap.hypot(s);
            arc.value(phi) / self.total * (self.gap / r) / r
        })
    }
}

impl<const NODES: usize> Arc<NODES> {
    const CELLS: usize = NODES - 1;

    /// ∫g, by the trapezoids that the polygon is made of.
    #[inline]
    fn area(&self) -> f64 {
        let inner: f64 = self.values[1..Self::CELLS].iter().sum();
        self.step * (0.5 * (self.values[0] + self.values[Self::CELLS]) + inner)
    }

    /// The angle up to which the area is `area`.
    #[inline]
    fn angle(&self, area: f64) -> f64 {
        let mut left = area / self.step;
        let mut phi = 0.0;
        for (j, g) in (0_u8..).zip(self.values.windows(2)) {
            let cell = 0.5 * (g[0] + g[1]);
            if cell > 0.0 {
                // The root of g₀x + (g₁ − g₀)x²/2 = left, in the form in which nothing cancels.
                let root = (g[0] * g[0] + 2.0 * left * (g[1] - g[0])).max(0.0).sqrt();
                phi = f64::from(j) + (2.0 * left / (g[0] + root)).clamp(0.0, 1.0);
                if left < cell {
                    break;
                }
                left -= cell;
                phi = f64::from(j) + 1.0;
            }
        }
        phi * self.step
    }

    /// g at an angle.
    #[inline]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the cells")]
    fn value(&self, phi: f64) -> f64 {
        let x = (phi / self.step).clamp(0.0, Self::CELLS as f64);
        let j = (x as usize).min(Self::CELLS - 1);
        self.values[j] + (self.values[j + 1] - self.values[j]) * (x - j as f64)
    }
}

/// The phase function at this cosine; close enough for a density.
#[inline]
fn phase_at_cosine(phase: Phase, cos: f64) -> f64 {
    match phase {
        Phase::Isotropic => 0.25 / PI,
        Phase::HenyeyGreenstein { g } => {
            let (a, cos) = (g.abs(), if g < 0.0 { -cos } else { cos });
            let d = (1.0 - a) * (1.0 - a) + 2.0 * a * (1.0 - cos.min(1.0));
            0.25 / PI * (1.0 - a) * (1.0 + a) / (d * d.sqrt())
        }
        Phase::Rayleigh => 3.0 / (16.0 * PI) * (1.0 + cos * cos),
        Phase::TwoLobes { weight, g } => {
            let [first, second] = g.map(|g| phase_at_cosine(Phase::HenyeyGreenstein { g }, cos));
            (1.0 - weight) * first + weight * second
        }
    }
}

#[cfg(test)]
mod tests;
