//! Distributions of the normals of microfacets \[Walter2007\]: Beckmann and GGX (Trowbridge–Reitz), with Smith's shadowing.
//!
//! *Sampling.* Normals are drawn in proportion to those of GGX that are visible \[Heitz2018\], for both distributions. Beckmann's are at most 4/e times as
//! dense as those of the GGX with the same α, so that weights stay bounded, and density and samples match exactly; a sampler of its own would need
//! an inversion by iteration.

use std::f64::consts::PI;

use glam::{DVec3, dvec3};
use vdf_scene::Microfacets;

use crate::frame::sin_cos_of_turn;

/// The distribution at a point of a surface; z is the normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facets {
    pub(super) kind: Microfacets,
    /// Roughness along x and y, positive.
    pub(super) alpha: [f64; 2],
}

impl Facets {
    /// ((x/α_x)² + (y/α_y)²)/z², the squared slope in units of α.
    fn slope2(&self, m: DVec3) -> f64 {
        let (x, y) = (m.x / self.alpha[0], m.y / self.alpha[1]);
        (x * x + y * y) / (m.z * m.z)
    }

    /// The density of facets with normal `m`, per steradian and per area of the surface.
    pub(super) fn density(&self, m: DVec3) -> f64 {
        match self.kind {
            Microfacets::Ggx => self.ggx_density(m),
            Microfacets::Beckmann => {
                let cos2 = m.z * m.z;
                let d = (-self.slope2(m)).exp() / (PI * self.alpha[0] * self.alpha[1] * cos2 * cos2);
                if m.z > 0.0 && d.is_finite() { d } else { 0.0 }
            }
        }
    }

    fn ggx_density(&self, m: DVec3) -> f64 {
        let cos2 = m.z * m.z;
        let lambda = 1.0 + self.slope2(m);
        let d = 1.0 / (PI * self.alpha[0] * self.alpha[1] * cos2 * cos2 * lambda * lambda);
        if m.z > 0.0 && d.is_finite() { d } else { 0.0 }
    }

    /// The squared tangent of the angle of `v`, in units of α.
    fn tan2(&self, v: DVec3) -> f64 {
        let (x, y) = (v.x * self.alpha[0], v.y * self.alpha[1]);
        (x * x + y * y) / (v.z * v.z)
    }

    /// The share of the facets with normal `m` that is visible from `v`.
    pub(super) fn visible(&self, v: DVec3, m: DVec3) -> f64 {
        if v.dot(m) * v.z <= 0.0 {
            return 0.0;
        }
        match self.kind {
            Microfacets::Ggx => ggx_visible(self.tan2(v)),
            Microfacets::Beckmann => {
                // The rational fit of [Walter2007].
                let a = self.tan2(v).sqrt().recip();
                if a >= 1.6 { 1.0 } else { a * (3.535 + 2.181 * a) / (1.0 + a * (2.276 + 2.577 * a)) }
            }
        }
    }

    /// A normal that is seen from `v`, which is above the surface; drawn with [`Facets::pdf`].
    pub(super) fn sample(&self, v: DVec3, [u0, u1]: [f64; 2]) -> DVec3 {
        let [ax, ay] = self.alpha;
        let stretched = dvec3(v.x * ax, v.y * ay, v.z).normalize();
        let across = dvec3(-stretched.y, stretched.x, 0.0).try_normalize().unwrap_or(DVec3::X);
        let third = stretched.cross(across);
        // A point of the projected hemisphere: a disk, of which one half is shortened.
        let (r, (sin, cos)) = (u0.sqrt(), sin_cos_of_turn(u1));
        let share = 0.5 * (1.0 + stretched.z);
        let x = r * cos;
        let y = (1.0 - share) * (1.0 - x * x).max(0.0).sqrt() + share * r * sin;
        let h = across * x + third * y + stretched * (1.0 - x * x - y * y).max(0.0).sqrt();
        dvec3(h.x * ax, h.y * ay, h.z.max(0.0)).try_normalize().unwrap_or(DVec3::Z)
    }

    /// The density per steradian with which [`Facets::sample`] draws `m`.
    pub(super) fn pdf(&self, v: DVec3, m: DVec3) -> f64 {
        let cos = v.dot(m);
        if cos <= 0.0 || v.z <= 0.0 {
            return 0.0;
        }
        ggx_visible(self.tan2(v)) * self.ggx_density(m) * cos / v.z
    }
}

fn ggx_visible(tan2: f64) -> f64 {
    2.0 / (1.0 + (1.0 + tan2).sqrt())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::{Sampler, chi_squared::assert_drawn_from};

    /// The projected area of all facets is that of the surface: ∫D(m) cos θ dω = 1, and the visible ones seen from v project to cos θ_v. The midpoint
    /// rule in sin² θ and azimuth; Smith's function for Beckmann is a fit, good to 0.4 %.
    #[test]
    fn facets_cover_the_surface() {
        for (kind, most) in [(Microfacets::Beckmann, 6e-3), (Microfacets::Ggx, 2e-3)] {
            for alpha in [[0.3, 0.3], [0.2, 0.5], [0.9, 0.9]] {
                let facets = Facets { kind, alpha };
                for v in [DVec3::Z, dvec3(0.6, 0.0, 0.8), dvec3(0.3, 0.9, 0.2).normalize()] {
                    let (mut area, mut seen) = (0.0, 0.0);
                    let (n, k) = (2000, 64);
                    for i in 0..n {
                        // Slopes from 0 to infinity, evenly in the angle.
                        let theta = (f64::from(i) + 0.5) / f64::from(n) * 0.5 * PI;
                        let ring = theta.sin() * 0.5 * PI / f64::from(n) * TAU / f64::from(k);
                        for j in 0..k {
                            let (sin, cos) = ((f64::from(j) + 0.5) / f64::from(k) * TAU).sin_cos();
                            let m = dvec3(theta.sin() * cos, theta.sin() * sin, theta.cos());
                            area += facets.density(m) * m.z * ring;
                            seen += facets.density(m) * facets.visible(v, m) * v.dot(m).max(0.0) * ring;
                        }
                    }
                    assert!((area - 1.0).abs() < 1e-4, "{facets:?} {area}");
                    assert!((seen / v.z - 1.0).abs() < most, "{facets:?} {v} {}", seen / v.z);
                }
            }
        }
    }

    /// χ² over cells of angle and azimuth whose probabilities are integrals of the density, by the midpoint rule.
    #[test]
    fn normals_are_drawn_with_their_density() {
        const RINGS: usize = 12;
        const SECTORS: usize = 8;
        for (round, (alpha, v)) in [
            ([0.3, 0.3], dvec3(0.5, 0.2, 0.7).normalize()),
            ([0.15, 0.6], dvec3(0.9, -0.3, 0.1).normalize()),
            ([0.8, 0.8], DVec3::Z),
        ]
        .into_iter()
        .enumerate()
        {
            let facets = Facets { kind: Microfacets::Ggx, alpha };
            let fine = 40;
            let mut probabilities = [0.0; RINGS * SECTORS];
            for i in 0..RINGS * fine {
                let (a, b) = (i as f64 / (RINGS * fine) as f64, (i + 1) as f64 / (RINGS * fine) as f64);
                // Cells even in cos θ.
                let cos = 0.5 * (a + b);
                for j in 0..SECTORS * fine {
                    let phi = (j as f64 + 0.5) / (SECTORS * fine) as f64 * TAU;
                    let sin = (1.0 - cos * cos).sqrt();
                    let m = dvec3(sin * phi.cos(), sin * phi.sin(), cos);
                    probabilities[i / fine * SECTORS + j / fine] +=
                        facets.pdf(v, m) * (b - a) * TAU / (SECTORS * fine) as f64;
                }
            }
            let total: f64 = probabilities.iter().sum();
            assert!((total - 1.0).abs() < 5e-3, "{total}");
            probabilities.iter_mut().for_each(|p| *p /= total);
            let mut cells = [0_u64; RINGS * SECTORS];
            for i in 0..40_000 {
                let m = facets.sample(v, Sampler::new(31, i, round as u32, 0).next_2d());
                let ring = ((m.z * RINGS as f64) as usize).min(RINGS - 1);
                let sector = ((m.y.atan2(m.x) / TAU + 1.0).fract() * SECTORS as f64) as usize;
                cells[ring * SECTORS + sector.min(SECTORS - 1)] += 1;
            }
            // Cells that are hardly ever met are taken together.
            let (mut kept, mut counts) = (vec![0.0], vec![0]);
            for (p, c) in probabilities.iter().zip(&cells) {
                if *p * 40_000.0 < 20.0 {
                    kept[0] += p;
                    counts[0] += c;
                } else {
                    kept.push(*p);
                    counts.push(*c);
                }
            }
            if kept[0] * 40_000.0 < 20.0 {
                let (p, c) = (kept.remove(0), counts.remove(0));
                kept[0] += p;
                counts[0] += c;
            }
            assert_drawn_from(&format!("{facets:?}"), &counts, &kept);
        }
    }
}
