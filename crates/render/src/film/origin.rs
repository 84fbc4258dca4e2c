//! What a film's samples are samples of, and where they come from.

use serde::{Deserialize, Serialize};
use vdf_scene::PixelRect;

use super::{FilmError, Layers, NoiseLimit};

/// What the samples of a film are samples of: films that differ in it cannot be merged.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FilmOrigin {
    /// Version of the program: another one may follow other paths.
    pub version: String,
    /// [`vdf_scene::Scene::checksum`].
    pub scene: u32,
    /// The integrator with its parameter, as [`Integrator`](crate::Integrator) is displayed.
    pub integrator: String,
    /// Name of the estimator of transmittance.
    pub transmittance: String,
    /// Name of the roulette.
    pub roulette: String,
    /// Name of the estimator of light.
    pub estimator: String,
    /// Name of the use of light paths.
    pub light_paths: String,
    /// How the samples of a pixel are spread.
    pub sampler: String,
    /// Seed of the render.
    pub seed: u64,
    /// Width and height of the full film in pixels.
    pub full_size: [u32; 2],
    /// The pixels.
    #[serde(with = "rect")]
    pub crop: PixelRect,
    /// What is kept beside the picture.
    pub layers: Layers,
    /// Name of the method, if one of the layers depends on it.
    pub method: Option<String>,
    /// Samples per pixel of the whole render.
    pub spp: u32,
    /// At what noise a tile gets no more samples than it has.
    pub noise: Option<NoiseLimit>,
}

impl FilmOrigin {
    /// Of a film of this size without layers, for tests.
    #[cfg(test)]
    pub(super) fn example([width, height]: [u32; 2], spp: u32) -> Self {
        Self {
            version: "1".to_owned(),
            scene: 1,
            integrator: "volpath".to_owned(),
            transmittance: "analytic".to_owned(),
            roulette: "standard".to_owned(),
            estimator: "thesis".to_owned(),
            light_paths: "auto".to_owned(),
            sampler: "independent".to_owned(),
            seed: 0,
            full_size: [width, height],
            crop: PixelRect { x0: 0, y0: 0, x1: width, y1: height },
            layers: Layers::default(),
            method: None,
            spp,
            noise: None,
        }
    }

    /// Numbers that are kept of each pixel and block.
    pub(super) fn sums_per_pixel(&self) -> usize {
        self.layers.count()
    }

    /// Checks that both are of the same render.
    ///
    /// # Errors
    /// [`FilmError::Stranger`], which says what differs.
    pub fn check_same_render(&self, other: &Self) -> Result<(), FilmError> {
        self.check_same_samples(other)?;
        differ("the number of samples per pixel of the whole render", &self.spp, &other.spp)?;
        let noise = |limit: Option<NoiseLimit>| limit.map_or_else(|| "none".to_owned(), |l| f64::from(l).to_string());
        differ("the limit of noise", &noise(self.noise), &noise(other.noise))
    }

    /// As [`FilmOrigin::check_same_render`], but the one may be a longer render than the other, or one to another noise.
    ///
    /// # Errors
    /// [`FilmError::Stranger`], which says what differs.
    pub fn check_same_samples(&self, other: &Self) -> Result<(), FilmError> {
        // No `..`: who adds a field has to decide.
        let Self {
            version,
            scene,
            integrator,
            transmittance,
            roulette,
            estimator,
            light_paths,
            sampler,
            seed,
            full_size,
            crop,
            layers,
            method,
            spp: _,
            noise: _,
        } = self;
        differ("the program's version", version, &other.version)?;
        differ("the scene (its checksum)", &format!("{scene:08x}"), &format!("{:08x}", other.scene))?;
        differ("the integrator", integrator, &other.integrator)?;
        differ("the estimator of transmittance", transmittance, &other.transmittance)?;
        differ("the roulette", roulette, &other.roulette)?;
        differ("the estimator of light", estimator, &other.estimator)?;
        differ("the use of light paths", light_paths, &other.light_paths)?;
        differ("the sampler", sampler, &other.sampler)?;
        differ("the seed", seed, &other.seed)?;
        let size = |[width, height]: [u32; 2]| format!("{width} x {height}");
        differ("the size of the film", &size(*full_size), &size(other.full_size))?;
        let corners = |c: &PixelRect| format!("{},{},{},{}", c.x0, c.y0, c.x1, c.y1);
        differ("the crop", &corners(crop), &corners(&other.crop))?;
        differ("the set of layers", layers, &other.layers)?;
        let method_of = |method: &Option<String>| method.clone().unwrap_or_default();
        differ("the method, on which layers depend,", &method_of(method), &method_of(&other.method))
    }
}

fn differ<T: PartialEq + ToString>(field: &'static str, one: &T, other: &T) -> Result<(), FilmError> {
    if one == other {
        return Ok(());
    }
    Err(FilmError::Stranger { field, one: one.to_string(), other: other.to_string() })
}

/// What a file of the picture says beside its pixels, for those who have the film but not the scene. Films need not agree in it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Picture {
    /// The scene's name.
    pub name: String,
    /// Whether components are stored in half precision.
    pub half: bool,
    /// The matrix from world to camera, column by column.
    pub world_to_camera: [f64; 16],
}

/// One run of the program that made samples of a film. Times in seconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FilmRun {
    /// Name of the machine, where it is known.
    pub machine: String,
    /// Method of acceleration.
    pub method: String,
    /// Side of a voxel in world units, if there are voxels.
    pub voxel_size: Option<f64>,
    /// Number of threads.
    pub threads: usize,
    /// Camera paths.
    pub paths: u64,
    /// Time to build the hierarchy.
    pub t_hierarchy: f64,
    /// Time to build what the method needs.
    pub t_build: f64,
    /// Time to render.
    pub t_render: f64,
}

/// A rectangle as four numbers.
mod rect {
    use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer, de::Error as _};
    use vdf_scene::PixelRect;

    pub(super) fn serialize<S: Serializer>(r: &PixelRect, to: S) -> Result<S::Ok, S::Error> {
        [r.x0, r.y0, r.x1, r.y1].serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<PixelRect, D::Error> {
        let [x0, y0, x1, y1] = <[u32; 4]>::deserialize(from)?;
        if x0 < x1 && y0 < y1 {
            Ok(PixelRect { x0, y0, x1, y1 })
        } else {
            Err(D::Error::custom("the crop has no pixels"))
        }
    }
}
