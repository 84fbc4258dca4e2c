//! The share of light that an interface reflects, unpolarized \[Born1999, Sec. 1.5.2 and 14.2\].

use vdf_scene::Rgb;

/// Between two clear bodies: for the cosine of the incident direction, in [0, 1], and the index behind the interface over that before it. The
/// share that is reflected, and the cosine of the refracted direction: 0 where all is reflected.
#[inline]
pub(super) fn dielectric(cos_i: f64, eta: f64) -> (f64, f64) {
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let across = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let along = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    // Two equal bodies at grazing angles: 0/0.
    let share = 0.5 * (across * across + along * along);
    (if share.is_finite() { share } else { 0.0 }, cos_t)
}

/// At a metal with the complex index `eta` + i`k`, each channel by itself.
#[inline]
pub(super) fn conductor(cos_i: f64, eta: Rgb, k: Rgb) -> Rgb {
    let channel = |eta: f32, k: f32| {
        let (eta, k) = (f64::from(eta), f64::from(k));
        let cos2 = cos_i * cos_i;
        let sin2 = 1.0 - cos2;
        let t0 = eta * eta - k * k - sin2;
        let a2_plus_b2 = (t0 * t0 + 4.0 * k * k * eta * eta).sqrt();
        let t1 = a2_plus_b2 + cos2;
        let a = (0.5 * (a2_plus_b2 + t0)).max(0.0).sqrt();
        let t2 = 2.0 * a * cos_i;
        let across = (t1 - t2) / (t1 + t2);
        let t3 = a2_plus_b2 * cos2 + sin2 * sin2;
        let t4 = t2 * sin2;
        let along = across * (t3 - t4) / (t3 + t4);
        #[allow(clippy::cast_possible_truncation, reason = "radiance is single precision")]
        let share = (0.5 * (across + along)) as f32;
        // An index of 1 at a grazing angle: 0/0.
        if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
    };
    Rgb::new(channel(eta.x, k.x), channel(eta.y, k.y), channel(eta.z, k.z))
}

/// The share of diffuse light that an interface reflects: 2∫F(µ)µ dµ over the cosines, by the midpoint rule, to six digits.
///
/// *Departure from Mitsuba 3*, which has a rational fit for it, good to three digits.
pub(super) fn diffuse_reflectance(eta: f64) -> f64 {
    const STEPS: u32 = 20_000;
    let step = 1.0 / f64::from(STEPS);
    let at = |i: u32| (f64::from(i) + 0.5) * step;
    (0..STEPS).map(|i| 2.0 * at(i) * dielectric(at(i), eta).0).sum::<f64>() * step
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal incidence ((n − 1)/(n + 1))², Brewster's angle, total reflection, reciprocity, equal bodies.
    #[test]
    fn glass_reflects_as_in_textbooks() {
        let eta = 1.5_f64;
        assert!((dielectric(1.0, eta).0 - 0.04).abs() < 1e-15);
        let brewster = (1.0 / (1.0 + eta * eta)).sqrt();
        let (share, cos_t) = dielectric(brewster, eta);
        let across = (brewster - eta * cos_t) / (brewster + eta * cos_t);
        assert!((share - 0.5 * across * across).abs() < 1e-15, "no light along the plane");
        assert_eq!(dielectric(0.7, 1.0 / eta), (1.0, 0.0));
        for i in 0..100 {
            let cos_i = f64::from(i) / 100.0;
            let (there, cos_t) = dielectric(cos_i, eta);
            assert!((0.0..=1.0).contains(&there));
            assert!((there - dielectric(cos_t, 1.0 / eta).0).abs() < 1e-12, "{cos_i}: the same from behind");
            // Along the surface all is reflected. The cosine is known to 2⁻⁵³, over its size.
            assert!(i == 0 || dielectric(cos_i, 1.0).0 < 1e-24, "{cos_i}");
        }
    }

    /// Normal incidence ((n − 1)² + k²)/((n + 1)² + k²); without absorption a metal is glass; the index 0 is a mirror.
    #[test]
    fn metals_reflect_as_in_textbooks() {
        let (eta, k) = (Rgb::new(0.2, 1.5, 0.0), Rgb::new(3.9, 0.0, 1.0));
        let normal = conductor(1.0, eta, k);
        for (share, (n, k)) in normal.to_array().into_iter().zip([(0.2_f32, 3.9_f32), (1.5, 0.0), (0.0, 1.0)]) {
            assert!((share - ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k)).abs() < 1e-6);
        }
        for i in 0..=100 {
            let cos_i = f64::from(i) / 100.0;
            let share = conductor(cos_i, eta, k);
            assert!((f64::from(share.y) - dielectric(cos_i, 1.5).0).abs() < 1e-6, "{cos_i}");
            assert!((share.z - 1.0).abs() < 1e-6 && share.x <= 1.0);
        }
    }

    /// Known values for an index of 1.5: 0.0918 from outside, 0.5963 from inside \[Walsh1926\].
    #[test]
    fn diffuse_light_is_reflected_as_in_textbooks() {
        assert!((diffuse_reflectance(1.5) - 0.091_78).abs() < 2e-5, "{}", diffuse_reflectance(1.5));
        assert!((diffuse_reflectance(1.0 / 1.5) - 0.596_34).abs() < 2e-5, "{}", diffuse_reflectance(1.0 / 1.5));
    }
}
