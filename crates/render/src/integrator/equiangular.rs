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
use vdf_scene::{MediumId, Phase, Rgb};

use crate::media::{Homogeneous, Media, MediumIntervals, Substance};

/// A part of a ray in one medium that scatters. Distances are in world units from the ray's start.
///
/// Where a medium changes in space, a ray through it is cut into several. Densities are those of their mean extinction; what arrives, and what is drawn by
/// optical depth, is exact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    /// Its number among the ray's medium intervals.
    pub(super) part: usize,
    /// The medium.
    pub(super) medium: MediumId,
    /// Where it begins and ends, as parameters along the ray's segment.
    pub(super) ends: [f64; 2],
    /// Where it begins.
    pub(super) begin: f64,
    /// Where it ends, not before it begins.
    pub(super) end: f64,
    /// The ray's optical depth where it begins.
    pub(super) depth: f64,
    /// Extinction coefficient, positive; its mean if it is not even.
    pub(super) sigma_t: f64,
    /// Single-scattering albedo; where it is not even, that of its middle.
    pub(super) albedo: Rgb,
    /// Phase function.
    pub(super) phase: Phase,
    /// Whether extinction and albedo are the same in all of it.
    pub(super) is_even: bool,
}

impl Stretch {
    /// The ray's optical depth at a distance in the stretch.
    #[inline]
    pub(super) fn depth_at(&self, distance: f64, intervals: &MediumIntervals<'_>) -> f64 {
        if self.is_even {
            return self.depth + self.sigma_t * (distance - self.begin);
        }
        self.depth + intervals.depth_in(self.medium, [self.begin, distance])
    }

    /// The distance up to which the stretch has this optical depth; its end if it has less.
    #[inline]
    pub(super) fn distance_of(&self, depth: f64, intervals: &MediumIntervals<'_>) -> f64 {
        if self.is_even {
            return (self.begin + depth / self.sigma_t).min(self.end);
        }
        intervals.distance_in(self.medium, [self.begin, self.end], depth)
    }

    /// σ_t exp(−τ) at a distance in the stretch.
    #[inline]
    pub(super) fn arrives(&self, distance: f64, intervals: &MediumIntervals<'_>) -> f64 {
        let sigma_t = if self.is_even { self.sigma_t } else { intervals.sigma_t_at(self.medium, distance) };
        sigma_t * (-self.depth_at(distance, intervals)).exp()
    }

    /// The albedo at a point of the stretch.
    #[inline]
    pub(super) fn albedo_at(&self, point: DVec3, intervals: &MediumIntervals<'_>) -> Rgb {
        if self.is_even { self.albedo } else { intervals.albedo_at(self.medium, point) }
    }

    /// The part between two distances; `None` if there is nothing in it.
    pub(super) fn cut(&self, begin: f64, end: f64, intervals: &MediumIntervals<'_>) -> Option<Self> {
        let depth = self.depth_at(begin, intervals);
        if self.is_even {
            return Some(Self { begin, end, depth, ..*self });
        }
        let sigma_t = (self.depth_at(end, intervals) - depth) / (end - begin);
        (sigma_t > 0.0).then_some(Self { begin, end, depth, sigma_t, ..*self })
    }
}

/// The parts of a ray in media that take something away.
pub(super) fn stretches(intervals: &MediumIntervals<'_>, media: &Media) -> SmallVec<[Stretch; 4]> {
    let length = intervals.length();
    let mut depth = 0.0;
    let mut stretches = SmallVec::new();
    for (part, i) in intervals.parts().enumerate() {
        let Some(medium) = i.medium else { continue };
        match media.substance(medium) {
            Substance::Homogeneous(m) => {
                if m.sigma_t > 0.0 {
                    let Homogeneous { sigma_t, albedo, phase } = *m;
                    stretches.push(Stretch {
                        part,
                        medium,
                        ends: [i.t0, i.t1],
                        begin: i.t0 * length,
                        end: i.t1 * length,
                        depth,
                        sigma_t,
                        albedo,
                        phase,
                        is_even: true,
                    });
                }
                depth += m.optical_depth((i.t1 - i.t0) * length);
            }
            Substance::Heterogeneous(m) => {
                let knots = m.knots(intervals.segment(), [i.t0, i.t1], length);
                for pair in knots.windows(2) {
                    let [from, to] = [pair[0], pair[1]];
                    let (begin, end) = (from.t * length, to.t * length);
                    let sigma_t = (to.depth - from.depth) / (end - begin);
                    if sigma_t > 0.0 && sigma_t.is_finite() {
                        let middle = intervals.segment().at(0.5 * (from.t + to.t));
                        let (albedo, phase) = media.scattering(medium, middle);
                        let depth = depth + from.depth;
                        stretches.push(Stretch {
                            part,
                            medium,
                            ends: [from.t, to.t],
                            begin,
                            end,
                            depth,
                            sigma_t,
                            albedo,
                            phase,
                            is_even: false,
                        });
                    }
                }
                depth += knots.last().map_or(0.0, |last| last.depth);
            }
        }
    }
    stretches
}

/// The stretch and the distance in it where the ray's optical depth is `depth`; rounding may place it at the very end.
#[inline]
pub(super) fn distance_at_depth(
    stretches: &[Stretch],
    depth: f64,
    intervals: &MediumIntervals<'_>,
) -> Option<(usize, f64)> {
    let i = stretches.partition_point(|s| s.depth <= depth).checked_sub(1)?;
    let s = &stretches[i];
    Some((i, s.distance_of(depth - s.depth, intervals)))
}

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
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::{Sampler, chi_squared::assert_drawn_from};

    const PHASES: [Phase; 4] = [
        Phase::Isotropic,
        Phase::HenyeyGreenstein { g: 0.8 },
        Phase::HenyeyGreenstein { g: 0.999 },
        Phase::HenyeyGreenstein { g: -0.999 },
    ];

    fn stretch(begin: f64, end: f64, tau: f64, phase: Phase) -> Stretch {
        Stretch {
            part: 0,
            medium: MediumId(0),
            ends: [0.0, 1.0],
            begin,
            end,
            depth: 0.0,
            sigma_t: tau / (end - begin),
            albedo: Rgb::ONE,
            phase,
            is_even: true,
        }
    }

    /// A light so far from the ray, its foot at a distance from the ray's start.
    fn light(foot: f64, gap: f64, normal: Option<DVec3>) -> LightPlace {
        LightPlace { position: dvec3(0.0, gap, foot), normal }
    }

    /// The share of each cell between the borders: the integral of the density, by the midpoint rule in the angle at the light, in which the
    /// density is a polygon. So many steps lie in each of its cells that the rule errs by less than 10⁻⁴ of a cell.
    fn shares<const NODES: usize>(
        towards: &Equiangular<NODES>,
        stretches: &[Stretch],
        borders: &[(usize, f64)],
    ) -> Vec<f64> {
        let angle = |s: f64| (s - towards.foot).atan2(towards.gap);
        borders
            .windows(2)
            .map(|w| {
                let [(i, a), (j, b)] = [w[0], w[1]];
                assert_eq!(i, j, "{stretches:?}");
                let (from, to) = (angle(a), angle(b));
                let n = 2000;
                let step = (to - from) / f64::from(n);
                (0..n)
                    .map(|k| {
                        let theta = from + (f64::from(k) + 0.5) * step;
                        // dφ = D/r² ds.
                        let s = towards.gap * theta.tan();
                        towards.pdf(i, s + towards.foot) * (towards.gap * towards.gap + s * s) / towards.gap * step
                    })
                    .sum()
            })
            .collect()
    }

    /// The density integrates to 1, and samples are drawn with it: χ² over cells of equal angle. Lights beside, before and behind the stretch,
    /// from 10⁻⁶ to 10⁶ of its length away; thin and opaque; peaks of the phase function; lights of one side.
    #[test]
    fn distances_are_drawn_with_their_density() {
        density_is_sampled::<2>();
        density_is_sampled::<3>();
        density_is_sampled::<9>();
    }

    fn density_is_sampled<const NODES: usize>() {
        const CELLS: usize = 24;
        let mut cases = 0;
        for phase in PHASES {
            for tau in [1e-12, 1.0, 50.0, 1e4] {
                for gap in [1e-6, 0.01, 1.0, 1e6] {
                    for foot in [-3.0, 0.0, 0.7, 1.0, 2.5] {
                        for normal in [None, Some(dvec3(0.0, -0.6, 0.8))] {
                            let stretches = [stretch(0.0, 1.0, tau, phase)];
                            let towards =
                                Equiangular::<9>::new(DVec3::ZERO, DVec3::Z, &stretches, &light(foot, gap, normal));
                            if towards.is_empty() {
                                continue;
                            }
                            let (first, last) = ((0.0 - foot).atan2(towards.gap), (1.0 - foot).atan2(towards.gap));
                            let border = |i: usize| {
                                let theta = first + (last - first) * i as f64 / CELLS as f64;
                                (0, (foot + towards.gap * theta.tan()).clamp(0.0, 1.0))
                            };
                            let borders: Vec<_> = (0..=CELLS).map(border).collect();
                            // A far light sees the ray under an angle in which tan and atan keep but ten digits.
                            let exact = gap < 1e3 && (last - first) > 1e-3;
                            let shares = shares(&towards, &stretches, &borders);
                            let sum: f64 = shares.iter().sum();
                            let tolerance = if exact { 1e-4 } else { 1e-2 };
                            let case = format!("{phase:?}, τ {tau}, gap {gap}, foot {foot}, {normal:?}");
                            assert!((sum - 1.0).abs() < tolerance, "{case}: ∫p = {sum}");
                            if !exact {
                                continue;
                            }
                            cases += 1;
                            let n = 4000;
                            let mut counts = [0_u64; CELLS];
                            for k in 0..n {
                                let u = Sampler::new(17, k, cases, 0).next_1d();
                                let (i, s) = towards.sample(u).expect("not empty");
                                assert!(i == 0 && (0.0..=1.0).contains(&s), "{case}: {s}");
                                counts[borders.partition_point(|&(_, b)| b <= s).clamp(1, CELLS) - 1] += 1;
                            }
                            let mut cells: Vec<(u64, f64)> = Vec::new();
                            for (&count, share) in counts.iter().zip(&shares) {
                                match cells.last_mut() {
                                    Some(last) if last.1 * f64::from(n) < 5.0 => {
                                        last.0 += count;
                                        last.1 += share / sum;
                                    }
                                    _ => cells.push((count, share / sum)),
                                }
                            }
                            while cells.len() > 1 && cells.last().is_some_and(|c| c.1 * f64::from(n) < 5.0) {
                                let last = cells.pop().expect("more than one");
                                let before = cells.last_mut().expect("another");
                                before.0 += last.0;
                                before.1 += last.1;
                            }
                            if cells.len() > 1 {
                                let (counts, shares): (Vec<_>, Vec<_>) = cells.into_iter().unzip();
                                assert_drawn_from(&case, &counts, &shares);
                            }
                        }
                    }
                }
            }
        }
        assert!(cases > 200, "{cases}");
    }

    /// Several stretches with gaps and without, among them empty ones and one of an ulp: each gets its share, and every sample a density.
    #[test]
    fn stretches_get_their_shares() {
        let ulp = 2.0_f64.next_up();
        let at = |begin, end, depth, sigma_t| Stretch {
            part: 0,
            medium: MediumId(0),
            ends: [0.0, 1.0],
            begin,
            end,
            depth,
            sigma_t,
            albedo: Rgb::ONE,
            phase: Phase::Isotropic,
            is_even: true,
        };
        let stretches = [
            at(0.0, 0.0, 0.0, 1.0),
            at(0.0, 1.0, 0.0, 1.0),
            at(1.0, 2.0, 1.0, 0.1),
            at(2.0, ulp, 1.1, 5.0),
            at(ulp, ulp, 1.1, 5.0),
            at(3.0, 5.0, 1.1, 0.5),
        ];
        for gap in [1e-12, 1e-3, 0.5, 1e3] {
            for foot in [-1.0, 0.0, 1.5, 2.0, 4.0, 7.0] {
                let towards = Equiangular::<9>::new(DVec3::ZERO, DVec3::Z, &stretches, &light(foot, gap, None));
                let areas: Vec<f64> = towards.arcs.iter().map(|arc| arc.area() / towards.total).collect();
                let n = 20_000;
                let mut counts = vec![0_u64; stretches.len()];
                for k in 0..n {
                    let u = (f64::from(k) + Sampler::new(3, k, 0, 0).next_1d()) / f64::from(n);
                    let (i, s) = towards.sample(u).expect("not empty");
                    assert!((stretches[i].begin..=stretches[i].end).contains(&s), "{gap} {foot}: {s} in {i}");
                    assert!(towards.pdf(i, s) > 0.0, "{gap} {foot}: {s} in {i}");
                    counts[i] += 1;
                }
                for (arc, area) in towards.arcs.iter().zip(areas) {
                    // One sample a stratum: a share is met within two of them.
                    let error = (counts[arc.stretch] as f64 - area * f64::from(n)).abs();
                    assert!(
                        error <= 2.0,
                        "{gap} {foot}: {} of {n} in {}, not {area}",
                        counts[arc.stretch],
                        arc.stretch
                    );
                }
            }
        }
    }

    /// Nothing to draw: no stretch, no length, a light that shines the other way.
    #[test]
    fn nothing_is_drawn_where_nothing_is() {
        let light_behind = light(0.5, 1.0, Some(DVec3::Y));
        for (stretches, light) in [
            (vec![], light(0.5, 1.0, None)),
            (vec![stretch(0.0, 1.0, 1.0, Phase::Isotropic)], light_behind),
            (vec![Stretch { end: 0.0, ..stretch(0.0, 1.0, 1.0, Phase::Isotropic) }], light(0.5, 1.0, None)),
        ] {
            let towards = Equiangular::<9>::new(DVec3::ZERO, DVec3::Z, &stretches, &light);
            assert!(towards.is_empty(), "{stretches:?}");
        }
    }

    /// In thin fog with an isotropic phase function the density is that of the angle alone, whatever the distance: so sampled, 1/r² times
    /// anything is the integral without any variance. The closed form is the angle over the gap.
    #[test]
    fn inverse_squares_have_no_variance() {
        for gap in [1e-12, 1e-9, 1e-3, 1.0, 1e3, 1e6] {
            for foot in [-10.0, -1e-3, 0.0, 0.3, 1.0, 5.0] {
                let stretches = [stretch(0.0, 1.0, 1e-12, Phase::Isotropic)];
                let towards = Equiangular::<9>::new(DVec3::ZERO, DVec3::Z, &stretches, &light(foot, gap, None));
                let integral = gap.atan2(gap * gap + foot * (foot - 1.0)) / gap;
                for k in 0..100 {
                    let (i, s) = towards.sample(Sampler::new(9, k, 0, 0).next_1d()).expect("not empty");
                    let estimate = 1.0 / (gap * gap + (s - foot).powi(2)) / towards.pdf(i, s);
                    // The distances of near feet are rounded, and so is the angle that the light is nearest at.
                    assert!((estimate / integral - 1.0).abs() < 1e-9, "{gap} {foot} {s}: {estimate} for {integral}");
                }
            }
        }
    }
}
