//! Fresnel's equations for unpolarized light, and the directions of reflected and refracted rays.
//!
//! Directions are in a frame whose z axis is the normal and point away from the surface.

use glam::{DVec3, dvec3};
use vdf_scene::Rgb;

/// What a smooth boundary between two transparent materials does to light from one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct DielectricFresnel {
    /// The share that is reflected.
    pub(super) reflected: f64,
    /// The cosine of the refracted direction, on the other side than the incident one; 0 at total reflection.
    pub(super) cos_t: f64,
    /// The index of refraction where the light goes over that where it comes from.
    pub(super) eta: f64,
}

/// The equations for an index `eta` behind the normal over that before it, and an incident direction with this cosine to the normal.
pub(super) fn dielectric(cos_i: f64, eta: f64) -> DielectricFresnel {
    let eta = if cos_i >= 0.0 { eta } else { 1.0 / eta };
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    let cos = cos_i.abs();
    if sin2_t >= 1.0 {
        return DielectricFresnel { reflected: 1.0, cos_t: 0.0, eta };
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let s = (cos - eta * cos_t) / (cos + eta * cos_t);
    let p = (eta * cos - cos_t) / (eta * cos + cos_t);
    let reflected = if eta == 1.0 { 0.0 } else { 0.5 * (s * s + p * p) };
    DielectricFresnel { reflected, cos_t: -cos_t.copysign(cos_i), eta }
}

/// The share of light that a metal reflects, channel by channel, for an incident direction with this cosine to the normal.
pub(super) fn conductor(cos_i: f64, eta: Rgb, k: Rgb) -> Rgb {
    let cos = cos_i.abs().min(1.0) as f32;
    let (cos2, sin2) = (cos * cos, 1.0 - cos * cos);
    let of = |eta: f32, k: f32| {
        let difference = eta * eta - k * k - sin2;
        let both = (difference * difference + 4.0 * eta * eta * k * k).sqrt();
        let a = (0.5 * (both + difference)).max(0.0).sqrt();
        let (sum, twice) = (both + cos2, 2.0 * a * cos);
        let s = (sum - twice) / (sum + twice);
        let (sum, twice) = (both * cos2 + sin2 * sin2, twice * sin2);
        // At normal incidence of a mirror that is 0/0, and both polarizations are one.
        let ratio = if sum + twice > 0.0 { (sum - twice) / (sum + twice) } else { 1.0 };
        0.5 * s * (1.0 + ratio)
    };
    Rgb::new(of(eta.x, k.x), of(eta.y, k.y), of(eta.z, k.z))
}

/// The mean of the reflected share over directions, weighted with the cosine: fits of \[Egan1973\] below 1 and of \[dEon2011\] above, as Mitsuba has
/// them; good to half a per cent.
pub(super) fn diffuse_reflectance(eta: f64) -> f64 {
    if eta < 1.0 {
        return -1.4399 * eta * eta + 0.7099 * eta + 0.6681 + 0.0636 / eta;
    }
    let x = 1.0 / eta;
    0.919_317 + x * (-3.4793 + x * (6.753_35 + x * (-7.809_89 + x * (4.985_54 - 1.368_81 * x))))
}

/// Mirrored at the normal.
#[inline]
pub(super) fn mirrored(wi: DVec3) -> DVec3 {
    dvec3(-wi.x, -wi.y, wi.z)
}

/// Mirrored at the microfacet normal `m`.
#[inline]
pub(super) fn reflected(wi: DVec3, m: DVec3) -> DVec3 {
    m * (2.0 * wi.dot(m)) - wi
}

/// Refracted at the microfacet normal `m`.
#[inline]
pub(super) fn refracted(wi: DVec3, m: DVec3, fresnel: &DielectricFresnel) -> DVec3 {
    m * (wi.dot(m) / fresnel.eta + fresnel.cos_t) - wi / fresnel.eta
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal incidence, Brewster's angle, total reflection, and the same share both ways.
    #[test]
    fn known_angles() {
        let glass = 1.5;
        assert!((dielectric(1.0, glass).reflected - 0.04).abs() < 1e-12);
        assert!((dielectric(-1.0, glass).reflected - 0.04).abs() < 1e-12);
        let brewster = (1.0 / (1.0 + glass * glass)).sqrt();
        let f = dielectric(brewster, glass);
        let s = (glass * glass - 1.0) / (glass * glass + 1.0);
        assert!((f.reflected - 0.5 * s * s).abs() < 1e-12);
        assert!((dielectric(f.cos_t, glass).reflected - f.reflected).abs() < 1e-12);
        assert_eq!(dielectric(-0.5, glass).reflected, 1.0);
        let wi = dvec3(0.6, 0.0, 0.8);
        let wo = refracted(wi, DVec3::Z, &dielectric(0.8, glass));
        assert!((wo.x + 0.4).abs() < 1e-12 && (wo.length() - 1.0).abs() < 1e-12 && wo.z < 0.0);
        // A metal that does not absorb is a dielectric.
        for cos in [1.0, 0.7, 0.1] {
            let metal = conductor(cos, Rgb::splat(1.5), Rgb::ZERO).x;
            assert!((f64::from(metal) - dielectric(cos, glass).reflected).abs() < 1e-5, "{cos}");
            assert_eq!(conductor(cos, Rgb::ZERO, Rgb::ONE), Rgb::ONE);
        }
    }

    /// Against the integral itself, by the midpoint rule.
    #[test]
    fn the_mean_is_that_of_the_shares() {
        for eta in [1.0 / 1.49, 1.0 / 1.33, 1.33, 1.49] {
            let n = 20_000;
            let share = |i: u32| dielectric((f64::from(i) + 0.5).sqrt() / f64::from(n).sqrt(), eta).reflected;
            let mean = (0..n).map(share).sum::<f64>() / f64::from(n);
            assert!((mean - diffuse_reflectance(eta)).abs() < 0.006, "{eta}: {mean} {}", diffuse_reflectance(eta));
        }
    }
}
