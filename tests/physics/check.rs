//! Comparison with a closed form. Each prints the largest relative error that it met; see them with `--nocapture`.
//!
//! *Statistical* comparisons allow 5 standard errors, estimated from the pixels, which are independent: a false alarm has a probability of
//! 6·10⁻⁷ each, and 2·10⁻⁴ for all of the some 250 here together. Seeds are fixed, so a test that passes keeps passing.
//! *Deterministic* ones allow what single precision must round.

use vdf::{
    render::{Estimator, Integrator},
    scene::{Rgb, Scene},
};

use crate::common::{Options, mean_and_error, options, rendered};

pub(crate) const VOLPATH: Integrator = Integrator::Volpath;
/// So many strata that hardly any noise is left.
pub(crate) const RAYMARCH: Integrator = Integrator::raymarch(64);
pub(crate) const INTEGRATORS: [Integrator; 2] = [VOLPATH, RAYMARCH];
/// The ways to trace paths of any number of events.
pub(crate) const TRACED: [(Integrator, Estimator); 2] =
    [(VOLPATH, Estimator::Thesis), (VOLPATH, Estimator::Equiangular)];
/// All ways to find light scattered in fog.
pub(crate) const WAYS: [(Integrator, Estimator); 5] = [
    (VOLPATH, Estimator::Thesis),
    (VOLPATH, Estimator::Equiangular),
    (RAYMARCH, Estimator::Thesis),
    (RAYMARCH, Estimator::Equiangular),
    (RAYMARCH, Estimator::Lit),
];

/// Roundings that all samples share, of 2⁻²⁴ each: the light's weight and intensity, the phase function or BSDF, the transmittance twice,
/// their product, the pixel. Those that differ between samples average out.
const SHARED_ROUNDINGS: f64 = 7.0 / 16_777_216.0;

/// The comparisons of one integrator with one closed form.
pub(crate) struct Check {
    form: &'static str,
    integrator: Integrator,
    estimator: Estimator,
    cases: u32,
    /// Largest |mean − expected|/expected, and the relative standard error of that case.
    worst: (f64, f64),
    largest_deviation: f64,
}

impl Check {
    pub(crate) fn new(form: &'static str, integrator: Integrator) -> Self {
        Self::by(form, (integrator, Estimator::Thesis))
    }

    pub(crate) fn by(form: &'static str, (integrator, estimator): (Integrator, Estimator)) -> Self {
        Self { form, integrator, estimator, cases: 0, worst: (0.0, 0.0), largest_deviation: 0.0 }
    }

    pub(crate) fn form(&self) -> &'static str {
        self.form
    }

    pub(crate) fn is(&self, integrator: Integrator) -> bool {
        self.integrator == integrator
    }

    fn name(&self) -> &'static str {
        match (self.integrator, self.estimator) {
            (Integrator::Volpath, Estimator::Thesis) => "volpath",
            (Integrator::Volpath, Estimator::Equiangular) => "volpath, equiangular",
            (Integrator::Raymarch(_), Estimator::Thesis) => "raymarch",
            (Integrator::Raymarch(_), Estimator::Equiangular) => "raymarch, equiangular",
            (Integrator::Volpath, Estimator::Lit) => "volpath, lit",
            (Integrator::Raymarch(_), Estimator::Lit) => "raymarch, lit",
        }
    }

    /// The scene's pixels, `spp` samples each.
    pub(crate) fn render(&self, scene: &Scene, spp: u32) -> Vec<Rgb> {
        let o = Options { integrator: self.integrator, estimator: self.estimator, spp: Some(spp), ..options() };
        rendered(scene, &o).image.pixels
    }

    /// All pixels have the expectation `expected`.
    #[track_caller]
    pub(crate) fn mean(&mut self, case: &str, pixels: &[Rgb], expected: f64) {
        let (mean, error) = mean_and_error(pixels);
        self.judge(case, mean, error, expected);
    }

    /// All pixels are binomial means of 0 and 1 with `samples` samples each: the standard error is known.
    #[track_caller]
    pub(crate) fn share(&mut self, case: &str, pixels: &[Rgb], samples: u32, expected: f64) {
        let (mean, _) = mean_and_error(pixels);
        let n = pixels.len() as f64 * f64::from(samples);
        self.judge(case, mean, (expected * (1.0 - expected) / n).sqrt(), expected);
    }

    /// Every pixel is `expected`, but for the rounding that all samples share.
    #[track_caller]
    pub(crate) fn exact(&mut self, case: &str, pixels: &[Rgb], expected: f64) {
        let worst = pixels.iter().map(|p| relative(f64::from(p.x), expected)).fold(0.0, f64::max);
        self.note(worst, 0.0);
        assert!(worst <= SHARED_ROUNDINGS, "{}, {}, {case}: {} for {expected}", self.form, self.name(), pixels[0].x);
    }

    #[track_caller]
    fn judge(&mut self, case: &str, mean: f64, error: f64, expected: f64) {
        self.note(relative(mean, expected), relative(error + expected, expected));
        if error > 0.0 {
            self.largest_deviation = self.largest_deviation.max((mean - expected).abs() / error);
        }
        let (form, name) = (self.form, self.name());
        let bound = 5.0 * error + SHARED_ROUNDINGS * expected.abs();
        assert!((mean - expected).abs() <= bound, "{form}, {name}, {case}: {mean} ± {error}, expected {expected}");
    }

    fn note(&mut self, error: f64, standard: f64) {
        self.cases += 1;
        if error >= self.worst.0 {
            self.worst = (error, standard);
        }
    }
}

/// 0 for 0: a closed form that is nothing has to be met exactly.
fn relative(value: f64, expected: f64) -> f64 {
    if value == expected { 0.0 } else { (value - expected).abs() / expected.abs() }
}

impl Drop for Check {
    fn drop(&mut self) {
        let (error, standard) = self.worst;
        println!(
            "closed form: {} | {} | {} cases | largest relative error {error:.1e} (standard error there {standard:.1e}) | at most {:.1} standard errors",
            self.form,
            self.name(),
            self.cases,
            self.largest_deviation
        );
    }
}
