//! What a render can be asked for beyond the scene file.

use vdf_scene::{PixelRect, Scene};
use vdf_visibility::Method;

use crate::{
    Integrator, Layers, NoiseLimit, RenderError, SamplerKind, SegmentSamples, film::layers_of_noise,
    threads::check_threads,
};

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

/// Texels along each side of a face of a light buffer: at most so many.
const MOST_TEXELS: u32 = 8192;

/// How the integrators draw what leads to light; all have the same mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// The thesis's own: distances by transmittance alone, emitters seen from wherever that leads (Sec. 2.3 and 2.5 in \[Houska2013\]).
    Thesis,
    /// Distances are drawn by the angle that they subtend at a light \[Kulla2012\], too, and events of `volpath` are connected to rays from the lights
    /// ([`LightPaths`]): far less noise in thin fog and around lights, and where light comes from other surfaces.
    #[default]
    Equiangular,
    /// By `raymarch` light of point emitters is gathered only where a ray is lit ([`vdf_visibility::LitIntervals`]); all else as `equiangular`, for
    /// paths gained nothing by it (`docs/performance.md`).
    Lit,
}

impl Estimator {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Thesis, Self::Equiangular, Self::Lit];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Thesis => "thesis",
            Self::Equiangular => "equiangular",
            Self::Lit => "lit",
        }
    }
}

/// When a path is ended by chance. All images have the same mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Roulette {
    /// After more scattering events than the scene's `rr_depth`, as in Mitsuba 3; in bounded fog a path that is worth 1 always survives.
    #[default]
    Standard,
    /// As in Mitsuba 0.4 to 0.6, the thesis's renderer: one event earlier, the boundary of a medium that is passed counts as an event, and
    /// at most 95 % survive everywhere. Paths are shorter, so N is less: there to reproduce Table 6.11 in \[Houska2013\].
    Thesis,
}

impl Roulette {
    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Standard => "standard",
            Self::Thesis => "thesis",
        }
    }
}

/// Whether the events of a path are connected to the first event of a ray from a light (`volpath` with another estimator than `thesis`). All images have the same mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightPaths {
    /// Where that pays in a look at some paths of the scene, the same for all of its renders.
    #[default]
    Auto,
    /// Wherever a light is in the scene that is not infinitely far away.
    Always,
    /// Nowhere.
    Never,
}

impl LightPaths {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Auto, Self::Always, Self::Never];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Always => "always",
            Self::Never => "never",
        }
    }
}

/// What a voxel grid covers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GridExtent {
    /// The occluders, and point emitters near them ([`World::occluder_bounds`](crate::World)).
    #[default]
    Occluders,
    /// The whole scene with fog, lights and camera, as in the thesis (5.2 in \[Houska2013\]).
    Scene,
}

/// How a scene is prepared; see [`PreparedScene`](crate::PreparedScene). `None` leaves it to the default named.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrepareOptions {
    /// Method of acceleration; by default [`Method::for_scene`].
    pub method: Option<Method>,
    /// Side of a voxel in world units; by default a 128th of the longest side of what the grid covers.
    pub voxel_size: Option<f64>,
    /// What the voxel grid covers; by default the occluders and the lights near them.
    pub grid: GridExtent,
    /// The largest number of voxels that may be built; `amr` takes 8 bytes for each.
    pub max_voxels: u64,
    /// Texels along each side of a face of a light buffer, rounded up to a power of two of at least 64; by default about as many in all as
    /// there are triangles.
    pub texels: Option<u32>,
    /// Number of threads; by default one for each processor.
    pub threads: Option<usize>,
}

impl Default for PrepareOptions {
    /// At most 2²⁹ voxels (4 GiB), all else by default.
    fn default() -> Self {
        Self {
            method: None,
            voxel_size: None,
            grid: GridExtent::Occluders,
            max_voxels: 1 << 29,
            texels: None,
            threads: None,
        }
    }
}

impl PrepareOptions {
    /// The defaults with this method.
    #[must_use]
    pub fn with_method(method: Method) -> Self {
        Self { method: Some(method), ..Self::default() }
    }

    /// Checks what can be checked before anything is built.
    ///
    /// # Errors
    /// [`RenderError::Option`] names the option and what it has to be.
    pub fn validate(&self) -> Result<(), RenderError> {
        check_threads(self.threads)?;
        if let Some(texels) = self.texels.filter(|n| !(1..=MOST_TEXELS).contains(n)) {
            return Err(RenderError::option("light-buffer", format!("must be from 1 to {MOST_TEXELS}, not {texels}")));
        }
        self.voxel_size.map_or(Ok(()), check_voxel_size)
    }
}

/// Checks that `size` can be the side of a voxel.
///
/// # Errors
/// [`RenderError::Option`] if it is not a positive finite number.
pub fn check_voxel_size(size: f64) -> Result<(), RenderError> {
    if size.is_finite() && size > 0.0 {
        return Ok(());
    }
    Err(RenderError::option("voxel", format!("must be a positive finite number, not {size}")))
}

/// How a prepared scene is rendered; `None` leaves it to the scene or to the default named.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderOptions {
    /// Integrator; by default `volpath`.
    pub integrator: Integrator,
    /// Estimator of transmittance towards emitters; by default analytic.
    pub transmittance: TransmittanceEstimator,
    /// When paths are ended by chance.
    pub roulette: Roulette,
    /// How the integrator draws what leads to light.
    pub estimator: Estimator,
    /// Whether events are connected to paths of the lights.
    pub light_paths: LightPaths,
    /// How the samples of a pixel are spread.
    pub sampler: SamplerKind,
    /// Samples per pixel; by default the scene's.
    pub spp: Option<u32>,
    /// Seed of the random numbers; by default the scene's.
    pub seed: Option<u64>,
    /// Number of threads; by default one for each processor.
    pub threads: Option<usize>,
    /// Part of the full film to render; by default the scene's.
    pub crop: Option<PixelRect>,
    /// Whether `volpath` asks for a proof of each free flight before it casts a ray (Sec. 2.4 in \[Houska2013\]). The image is the same
    /// either way; it has seldom paid (`docs/performance.md`).
    pub segment_first: bool,
    /// What is kept beside the picture. Layers of surfaces cost one more ray a sample.
    pub layers: Layers,
    /// At what noise a tile of 16 × 16 pixels gets no more samples; `spp` is then the most that any gets.
    pub noise: Option<NoiseLimit>,
}

impl RenderOptions {
    /// As the thesis renders: its estimator, each sample for itself. What is measured beside its figures, and beside earlier ones, is measured so.
    #[must_use]
    pub fn thesis() -> Self {
        Self { estimator: Estimator::Thesis, sampler: SamplerKind::Independent, ..Self::default() }
    }

    /// The layers that a film of this render keeps: those asked for, and `variance` and `samples` if there is a limit of noise.
    #[must_use]
    pub fn kept_layers(&self) -> Layers {
        if self.noise.is_some() { self.layers.with(layers_of_noise()) } else { self.layers }
    }

    /// Checks what can be checked before anything is built.
    ///
    /// # Errors
    /// [`RenderError::Option`] names the option and what it has to be.
    pub fn validate(&self, scene: &Scene) -> Result<(), RenderError> {
        if self.spp == Some(0) {
            return Err(RenderError::option("spp", "must be at least 1"));
        }
        check_threads(self.threads)?;
        if self.integrator.samples_per_segment() == Some(SegmentSamples::Count(0)) {
            return Err(RenderError::option("samples-per-segment", "must be at least 1"));
        }
        if let Some(c) = self.crop {
            let (width, height) = (scene.film.width, scene.film.height);
            if !(c.x0 < c.x1 && c.y0 < c.y1 && c.x1 <= width && c.y1 <= height) {
                let message = format!(
                    "{},{},{},{} must be x0,y0,x1,y1 with 0 ≤ x0 < x1 ≤ {width} and 0 ≤ y0 < y1 ≤ {height}, the size of the film",
                    c.x0, c.y0, c.x1, c.y1
                );
                return Err(RenderError::option("crop", message));
            }
        }
        Ok(())
    }
}
