//! What a render can be asked for beyond the scene file, and how it reports while it runs.

use glam::DVec3;

use crate::{
    Method, RenderError,
    scene::{PixelRect, Scene},
};

/// The estimator of light transport.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntegratorKind {
    /// Volumetric path tracing (Sec. 2.3 in \[Houska2013\]): any number of scattering events.
    Volpath,
    /// Ray marching (Sec. 2.5): the medium scatters once.
    Raymarch {
        /// Samples on each path segment, at least 1.
        samples_per_segment: u32,
    },
}

/// The estimator of transmittance towards emitters; both have the same mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TransmittanceEstimator {
    /// exp(−τ), without variance.
    #[default]
    Analytic,
    /// 1 if a random free flight reaches the emitter, else 0: what the `volpath` of Mitsuba 3 and pbrt-v4 make of a homogeneous
    /// medium. One more random number for each emitter sample; there to compare with these renderers like for like.
    Analog,
}

impl TransmittanceEstimator {
    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Analytic => "analytic",
            Self::Analog => "analog",
        }
    }
}

/// Options of [`crate::render()`]; `None` leaves it to the scene or to the default named.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Method of acceleration.
    pub method: Method,
    /// Side of a voxel in world units; by default a 128th of the scene's longest side.
    pub voxel_size: Option<f64>,
    /// Integrator.
    pub integrator: IntegratorKind,
    /// Estimator of transmittance towards emitters.
    pub transmittance: TransmittanceEstimator,
    /// Samples per pixel; by default the scene's.
    pub spp: Option<u32>,
    /// Seed of the random numbers; by default the scene's.
    pub seed: Option<u64>,
    /// Number of threads; by default one for each processor.
    pub threads: Option<usize>,
    /// Part of the full film to render; by default the scene's.
    pub crop: Option<PixelRect>,
    /// Whether `volpath` asks for a proof of each free flight before it casts a ray (Sec. 2.4). The image is the same either way; it has seldom
    /// paid (`docs/performance.md`).
    pub segment_first: bool,
    /// The largest number of voxels that may be built; `amr` takes 8 bytes for each.
    pub max_voxels: u64,
}

impl Default for RenderOptions {
    /// `volpath` with `amr-xsn` and analytic transmittance, at most 2²⁹ voxels (4 GiB), all else from the scene.
    fn default() -> Self {
        Self {
            method: Method::default(),
            voxel_size: None,
            integrator: IntegratorKind::Volpath,
            transmittance: TransmittanceEstimator::Analytic,
            spp: None,
            seed: None,
            threads: None,
            crop: None,
            segment_first: false,
            max_voxels: 1 << 29,
        }
    }
}

/// Tens of thousands of threads do not speed up anything but make the system refuse to start them, or stall.
const MAX_THREADS: usize = 4096;

impl RenderOptions {
    /// Checks what can be checked before anything is built.
    ///
    /// # Errors
    /// [`RenderError::Option`] names the option and what it has to be.
    pub fn validate(&self, scene: &Scene) -> Result<(), RenderError> {
        if self.spp == Some(0) {
            return fail("spp", "must be at least 1".into());
        }
        check_threads(self.threads)?;
        self.voxel_size.map_or(Ok(()), check_voxel_size)?;
        if self.integrator == (IntegratorKind::Raymarch { samples_per_segment: 0 }) {
            return fail("samples-per-segment", "must be at least 1".into());
        }
        if let Some(c) = self.crop {
            let (width, height) = (scene.film.width, scene.film.height);
            if !(c.x0 < c.x1 && c.y0 < c.y1 && c.x1 <= width && c.y1 <= height) {
                let message = format!(
                    "{},{},{},{} must be x0,y0,x1,y1 with 0 ≤ x0 < x1 ≤ {width} and 0 ≤ y0 < y1 ≤ {height}, the size of the film",
                    c.x0, c.y0, c.x1, c.y1
                );
                return fail("crop", message);
            }
        }
        Ok(())
    }
}

pub(crate) fn fail<T>(option: &'static str, message: String) -> Result<T, RenderError> {
    Err(RenderError::Option { option, message })
}

pub(crate) fn check_voxel_size(size: f64) -> Result<(), RenderError> {
    if !(size.is_finite() && size > 0.0) {
        return fail("voxel", format!("must be a positive finite number, not {size}"));
    }
    Ok(())
}

fn check_threads(threads: Option<usize>) -> Result<(), RenderError> {
    match threads {
        Some(0) => fail("threads", "must be at least 1".into()),
        Some(n) if n > MAX_THREADS => fail("threads", format!("must be at most {MAX_THREADS}")),
        _ => Ok(()),
    }
}

/// Runs `work` on a pool of that many threads, one for each processor by default.
pub(crate) fn on_threads<T: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<T, RenderError> + Send,
) -> Result<T, RenderError> {
    check_threads(threads)?;
    // Rayon takes 0 for its default.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    pool.map_err(|e| RenderError::Threads { message: e.to_string() })?.install(work)
}

/// A 128th of the longest side of these bounds, the side of a voxel where none is given; 1 if they are one point.
#[must_use]
pub fn default_voxel_size((min, max): (DVec3, DVec3)) -> f64 {
    let extent = (max - min).max_element();
    // A scene of one point has no extent; any size covers it with one voxel.
    if extent > 0.0 { extent / 128.0 } else { 1.0 }
}

/// Is told how a long work goes on, from any thread, and may stop it.
pub trait Progress: Sync {
    /// A new phase of the work begins, named by what is done or made in it.
    fn phase(&self, name: &str);
    /// How much there is to do: pixels of a render, segments of a verification.
    fn work_total(&self, n: u64);
    /// `n` more of these are done.
    fn work_done(&self, n: u64);
    /// Whether to stop; asked often, so it should be quick.
    fn cancelled(&self) -> bool;
}
