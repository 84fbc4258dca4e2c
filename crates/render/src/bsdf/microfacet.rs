//! Surfaces of microfacets \[Walter2007\]: how their normals are distributed, which of them are seen, and how one is drawn.
//!
//! Directions are in the frame of the surface, whose normal is z; `w` is a direction above it. D integrates to 1 over the facets' projected
//! area; G₁ is Smith's, for Beckmann by the rational approximation of \[Walter2007\], as in Mitsuba 3.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use vdf_scene::{Microfacets, Roughness};

/// A distribution of normals.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Distribution {
    alpha: f64,
    kind: Microfacets,
}

impl Distribution {
    pub(super) const fn new(Roughness { alpha, distribution }: Roughness) -> Self {
        Self { alpha, kind: distribution }
    }

    /// D: the density of normals, per steradian and area.
    pub(super) fn density(&self, m: DVec3) -> f64 {
        if m.z <= 0.0 {
            return 0.0;
        }
        let (cos2, a2) = (m.z * m.z, self.alpha * self.alpha);
        // tan²/α², from sine and cosine, for both are exact where they are small.
        let e = (m.x * m.x + m.y * m.y) / (cos2 * a2);
        match self.kind {
            Microfacets::Beckmann => (-e).exp() / (PI * a2 * cos2 * cos2),
            Microfacets::Ggx => 1.0 / (PI * a2 * cos2 * cos2 * (1.0 + e) * (1.0 + e)),
        }
    }

    /// G₁: the share of the facets with normal `m` that are seen from `w`.
    pub(super) fn seen(&self, w: DVec3, m: DVec3) -> f64 {
        if w.dot(m) * w.z <= 0.0 {
            return 0.0;
        }
        let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
        if tan2 == 0.0 {
            return 1.0;
        }
        match self.kind {
            Microfacets::Beckmann => {
                let a = 1.0 / (self.alpha * tan2.sqrt());
                if a >= 1.6 { 1.0 } else { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) }
            }
            Microfacets::Ggx => 2.0 / (1.0 + (1.0 + self.alpha * self.alpha * tan2).sqrt()),
        }
    }

    /// A normal: of those that are seen from `w` \[Heitz2018\] with GGX, of all with Beckmann.
    pub(super) fn sample(&self, w: DVec3, [u0, u1]: [f64; 2]) -> DVec3 {
        match self.kind {
            Microfacets::Beckmann => {
                // ln(1 − u) ≤ 0; u < 1.
                let tan2 = -self.alpha * self.alpha * (-u0).ln_1p();
                let cos = 1.0 / (1.0 + tan2).sqrt();
                let (sin_phi, cos_phi) = (TAU * u1).sin_cos();
                let sin = cos * tan2.sqrt();
                DVec3::new(sin * cos_phi, sin * sin_phi, cos)
            }
            Microfacets::Ggx => {
                let stretched = DVec3::new(self.alpha * w.x, self.alpha * w.y, w.z).normalize();
                // The second axis is foreshortened: it lies in the plane of the direction and the surface's normal.
                let t1 = DVec3::new(-stretched.y, stretched.x, 0.0).normalize_or(DVec3::X);
                let t2 = stretched.cross(t1);
                let (sin_phi, cos_phi) = (TAU * u1).sin_cos();
                // A point of the disc, moved so that the half that is seen from the side is shorter.
                let (p1, across) = (u0.sqrt() * cos_phi, u0.sqrt() * sin_phi);
                let s = 0.5 * (1.0 + stretched.z);
                let p2 = (1.0 - s) * (1.0 - p1 * p1).max(0.0).sqrt() + s * across;
                let p3 = (1.0 - p1 * p1 - p2 * p2).max(0.0).sqrt();
                let m = t1 * p1 + t2 * p2 + stretched * p3;
                DVec3::new(self.alpha * m.x, self.alpha * m.y, m.z.max(0.0)).normalize_or(DVec3::Z)
            }
        }
    }

    /// The density per steradian with which [`Distribution::sample`] draws a normal.
    pub(super) fn pdf(&self, w: DVec3, m: DVec3) -> f64 {
        match self.kind {
            Microfacets::Beckmann => self.density(m) * m.z.max(0.0),
            Microfacets::Ggx => self.density(m) * self.seen(w, m) * w.dot(m).max(0.0) / w.z,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Sampler, chi_squared::assert_drawn_from};

    /// χ² over 16 × 8 cells of cos θ and azimuth against the integral of the density over each cell, which also has to be 1 in all: normals are
    /// drawn with the density that they are said to have. And what is seen from a direction is as large as its projection (GGX: ∫ G₁ D ⟨w, m⟩
    /// dm = cos θ, \[Heitz2014\] eq. 14), which is what that density being 1 in all says.
    #[test]
    fn normals_are_drawn_with_their_density() {
        const N: usize = 160;
        for kind in [Microfacets::Beckmann, Microfacets::Ggx] {
            for alpha in [0.1, 0.5, 1.0] {
                for z in [1.0, 0.7, 0.1_f64] {
                    let d = Distribution { alpha, kind };
                    let w = DVec3::new((1.0 - z * z).sqrt() * 0.6, (1.0 - z * z).sqrt() * 0.8, z);
                    // Cells of equal tan θ/(1 + tan θ/α), so that they follow the lobe.
                    let theta = |t: f64| (alpha * t / (1.0 - t).max(1e-12)).atan();
                    let mut expected = vec![0.0; 128];
                    for i in 0..16 * N {
                        let (t0, t1) = (theta(i as f64 / (16 * N) as f64), theta((i + 1) as f64 / (16 * N) as f64));
                        let middle = 0.5 * (t0 + t1);
                        for j in 0..8 * 8 {
                            let phi = TAU * (f64::from(j) + 0.5) / 64.0;
                            let m = DVec3::new(middle.sin() * phi.cos(), middle.sin() * phi.sin(), middle.cos());
                            let solid = (t0.cos() - t1.cos()) * TAU / 64.0;
                            expected[i / N * 8 + j as usize / 8] += d.pdf(w, m) * solid;
                        }
                    }
                    let sum: f64 = expected.iter().sum();
                    assert!((sum - 1.0).abs() < 2e-3, "{kind:?} {alpha} {z}: {sum}");
                    expected.iter_mut().for_each(|p| *p /= sum);
                    let mut cells = vec![0_u64; 128];
                    for i in 0..40_000 {
                        let m = d.sample(w, Sampler::new(3, i, 0, 0).next_2d());
                        assert!((m.length() - 1.0).abs() < 1e-12 && m.z >= 0.0);
                        let tan = (m.x * m.x + m.y * m.y).sqrt() / m.z.max(1e-300) / alpha;
                        let azimuth = (m.y.atan2(m.x) / TAU + 1.0).fract();
                        let row = ((tan / (1.0 + tan)) * 16.0) as usize;
                        cells[row.min(15) * 8 + ((azimuth * 8.0) as usize).min(7)] += 1;
                    }
                    // Cells that hardly anything falls into become one with the fullest.
                    let most = (0..128).max_by(|&a, &b| expected[a].total_cmp(&expected[b])).unwrap_or(0);
                    for i in (0..128).filter(|&i| i != most) {
                        if expected[i] * 40_000.0 < 8.0 {
                            expected[most] += std::mem::take(&mut expected[i]);
                            cells[most] += std::mem::take(&mut cells[i]);
                        }
                    }
                    let kept: Vec<_> = (0..128).filter(|&i| expected[i] > 0.0).collect();
                    let counts: Vec<_> = kept.iter().map(|&i| cells[i]).collect();
                    let expected: Vec<_> = kept.iter().map(|&i| expected[i]).collect();
                    assert_drawn_from(&format!("{kind:?} {alpha} {z}"), &counts, &expected);
                }
            }
        }
    }
}
