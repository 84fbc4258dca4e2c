//! Boxes of fog with their closed forms: optical depth by clipping to slabs, single scattering by quadrature. Independent of the
//! renderer's hierarchy, boundaries and phase functions.

use std::f64::consts::PI;

use glam::{DVec3, Vec3, dvec3};
use vdf::scene::{Phase, Scene};

use crate::common::{add_fog, add_medium, integrate};

/// A box of homogeneous fog. Boxes of one scene may touch but not overlap.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fog {
    pub(crate) min: Vec3,
    pub(crate) max: Vec3,
    pub(crate) sigma_t: f64,
    pub(crate) albedo: f32,
    pub(crate) phase: Phase,
}

impl Fog {
    /// Fog that absorbs only.
    pub(crate) fn absorbing(min: Vec3, max: Vec3, sigma_t: f64) -> Self {
        Self { min, max, sigma_t, albedo: 0.0, phase: Phase::Isotropic }
    }

    /// Fog without bounds, for scenes whose camera is in it.
    pub(crate) fn unbounded(sigma_t: f64, albedo: f32, phase: Phase) -> Self {
        Self { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY, sigma_t, albedo, phase }
    }

    /// The parameters between which the closed segment from `a` to `b` is in the closed box, by clipping to its slabs [Kay1986].
    pub(crate) fn clip(&self, a: DVec3, b: DVec3) -> Option<(f64, f64)> {
        let d = b - a;
        let (mut t0, mut t1) = (0.0_f64, 1.0_f64);
        for k in 0..3 {
            let (low, high) = (f64::from(self.min[k]) - a[k], f64::from(self.max[k]) - a[k]);
            if d[k] == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
            } else {
                let (u, v) = (low / d[k], high / d[k]);
                t0 = t0.max(u.min(v));
                t1 = t1.min(u.max(v));
            }
        }
        (t0 <= t1).then_some((t0, t1))
    }

    /// Whether `p` lies in the open box.
    pub(crate) fn holds(&self, p: DVec3) -> bool {
        (0..3).all(|k| f64::from(self.min[k]) < p[k] && p[k] < f64::from(self.max[k]))
    }

    /// The phase function by the textbook's formula [Henyey1941].
    fn phase(&self, cos_theta: f64) -> f64 {
        let lobe = |g: f64| 0.25 / PI * (1.0 - g * g) / (1.0 + g * g - 2.0 * g * cos_theta).powf(1.5);
        match self.phase {
            Phase::Isotropic => 0.25 / PI,
            Phase::HenyeyGreenstein { g } => lobe(g),
            Phase::Rayleigh => 3.0 / 16.0 / PI * (1.0 + cos_theta * cos_theta),
            Phase::TwoLobes { weight, g: [first, second] } => (1.0 - weight) * lobe(first) + weight * lobe(second),
        }
    }
}

/// Puts the fogs into the scene, and the camera into that which holds it.
pub(crate) fn add_fogs(scene: &mut Scene, fogs: &[Fog]) {
    let eye = crate::common::eye(scene);
    for fog in fogs {
        let medium = add_medium(scene, fog.sigma_t, fog.albedo, fog.phase);
        if fog.min.is_finite() {
            add_fog(scene, fog.min, fog.max, medium);
        }
        if fog.holds(eye) {
            scene.sensor.medium = Some(medium);
        }
    }
}

/// ∫σ_t along the segment.
pub(crate) fn optical_depth(fogs: &[Fog], a: DVec3, b: DVec3) -> f64 {
    optical_depth_to(fogs, a, b, 1.0)
}

/// ∫σ_t along the part of the segment up to parameter `t`.
pub(crate) fn optical_depth_to(fogs: &[Fog], a: DVec3, b: DVec3, t: f64) -> f64 {
    let length = (b - a).length();
    let of_fog = |f: &Fog| f.clip(a, b).map(|(t0, t1)| f.sigma_t * (t1.min(t) - t0).max(0.0) * length);
    fogs.iter().filter_map(of_fog).sum()
}

/// Light of a point of this intensity scattered once into the axis +Z before `end`, seen from the origin:
/// ∫ σ_s p(θ) I/r² exp(−τ(0, t) − τ(t, light)) dt.
///
/// Integrated over the angle under which the light is seen [Kulla2012], where 1/r² cancels, and over t as it stands; the two must
/// agree to 10⁻⁷ of the result, a tenth of what is asked of the quadrature.
pub(crate) fn single_scattering(fogs: &[Fog], light: DVec3, intensity: f64, end: f64) -> f64 {
    let (eye, h) = (DVec3::ZERO, light.x.hypot(light.y));
    let integral = |over_angle: bool| -> f64 {
        let of_fog = |fog: &Fog| {
            let far = dvec3(0.0, 0.0, end);
            let Some((t0, t1)) = fog.clip(eye, far) else { return 0.0 };
            let scattered = |t: f64| {
                let p = dvec3(0.0, 0.0, t);
                let cos_theta = (light.z - t) / (light - p).length();
                let depth = optical_depth(fogs, eye, p) + optical_depth(fogs, p, light);
                f64::from(fog.albedo) * fog.sigma_t * fog.phase(cos_theta) * intensity * (-depth).exp()
            };
            // Beyond optical depth 60 in this fog there is nothing left.
            let (z0, z1) = (t0 * end, (t1 * end).min(t0 * end + 60.0 / fog.sigma_t));
            if over_angle {
                let angle = |z: f64| ((z - light.z) / h).atan();
                integrate(&|phi| scattered(light.z + h * phi.tan()) / h, angle(z0), angle(z1))
            } else {
                // Split at the peak, so that it lies at an end.
                let middle = light.z.clamp(z0, z1);
                let f = |z: f64| scattered(z) / (h * h + (z - light.z).powi(2));
                integrate(&f, z0, middle) + integrate(&f, middle, z1)
            }
        };
        fogs.iter().map(of_fog).sum()
    };
    let (a, b) = (integral(true), integral(false));
    assert!((a - b).abs() <= 1e-7 * a, "quadratures differ: {a}, {b}");
    a
}
