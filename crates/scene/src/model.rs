//! Plain data: a scene as the renderer sees it.

use std::sync::Arc;

use glam::{DMat4, DVec3, Vec2, Vec3};
use vdf_geometry::{CurvedShape, Triangle};

use crate::{Bsdf, GridVolume, Pixels, Rgb, Texture};

/// Index into [`Scene::media`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MediumId(pub u32);

/// Everything that is needed to render, with all names resolved and all transforms applied.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The shapes that light does not just pass: the occluders.
    pub surfaces: Vec<Surface>,
    /// The shapes that change the medium. One with a `null` BSDF does nothing else; any other is among the surfaces, too.
    pub boundaries: Vec<Boundary>,
    /// The participating media.
    pub media: Vec<Medium>,
    /// The emitters, in the order of the file.
    pub emitters: Vec<Emitter>,
    /// The camera.
    pub sensor: Sensor,
    /// The image plane.
    pub film: FilmSettings,
    /// Path depth limits.
    pub integrator: IntegratorSettings,
    /// Samples per pixel; at least 1.
    pub sample_count: u32,
    /// Seed of the sampler.
    pub seed: u64,
    /// What is legal but probably not meant, one message each, with file and line.
    pub warnings: Vec<String>,
}

/// A shape that light does not just pass: an occluder.
#[derive(Clone, Debug, Default)]
pub struct Surface {
    /// The shape's triangles, in world units.
    pub triangles: Vec<Triangle>,
    /// The shape itself if it is curved; then it has no triangles.
    pub curved: Option<CurvedShape>,
    /// What the corners of the triangles carry.
    pub attributes: Arc<MeshAttributes>,
    /// How it scatters.
    pub bsdf: Bsdf,
    /// Radiance emitted from the front side (the side of the normal), if the shape is an area emitter. Such a
    /// surface also has an [`Emitter::Area`] in [`Scene::emitters`].
    pub radiance: Option<Texture>,
}

/// What the corners of a mesh's triangles carry beside their places, triangle by triangle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshAttributes {
    /// Unit normals for shading, in world space; empty where the triangles' own normals shade.
    pub normals: Vec<[Vec3; 3]>,
    /// Texture coordinates; empty if there are none.
    pub uvs: Vec<[Vec2; 3]>,
}

/// A surface between two media, index-matched: light passes it unchanged.
#[derive(Clone, Debug, Default)]
pub struct Boundary {
    /// The shape's triangles, in world units.
    pub triangles: Vec<Triangle>,
    /// The shape itself if it is a sphere; then it has no triangles.
    pub curved: Option<CurvedShape>,
    /// The medium behind the surface (against the normal); `None` is vacuum.
    pub interior: Option<MediumId>,
    /// The medium in front of the surface (along the normal); `None` is vacuum.
    pub exterior: Option<MediumId>,
}

/// A participating medium.
#[derive(Clone, Debug, PartialEq)]
pub struct Medium {
    /// Extinction coefficient in 1/world unit, including the file's `scale`.
    pub sigma_t: Extinction,
    /// Single-scattering albedo σ_s/σ_t.
    pub albedo: Albedo,
    /// Phase function.
    pub phase: Phase,
}

/// What a medium takes away, in 1/world unit.
#[derive(Clone, Debug, PartialEq)]
pub enum Extinction {
    /// The same everywhere, for red, green and blue; finite and at least 0.
    Constant(DVec3),
    /// What a grid says in its box ([`GridVolume::world_bounds`]), and nothing outside of it.
    Grid {
        /// The grid.
        volume: GridVolume,
        /// What its values are multiplied with; finite and at least 0, and so is the product.
        scale: f64,
    },
}

/// Single-scattering albedo σ_s/σ_t, each channel in [0, 1].
#[derive(Clone, Debug, PartialEq)]
pub enum Albedo {
    /// The same everywhere.
    Constant(Rgb),
    /// What a grid says, also outside of its box.
    Grid(GridVolume),
}

impl Medium {
    /// A medium; `sigma_t` may be one number, for grey fog, and `albedo` a colour.
    #[must_use]
    pub fn new(sigma_t: impl Into<Extinction>, albedo: impl Into<Albedo>, phase: Phase) -> Self {
        Self { sigma_t: sigma_t.into(), albedo: albedo.into(), phase }
    }
}

impl From<f64> for Extinction {
    /// A grey one.
    fn from(sigma_t: f64) -> Self {
        Self::Constant(DVec3::splat(sigma_t))
    }
}

impl From<Rgb> for Albedo {
    fn from(albedo: Rgb) -> Self {
        Self::Constant(albedo)
    }
}

impl Extinction {
    /// The extinction, if it is the same everywhere and for all colours.
    #[must_use]
    pub fn grey(&self) -> Option<f64> {
        match self {
            Self::Constant(sigma_t) if sigma_t.x == sigma_t.y && sigma_t.y == sigma_t.z => Some(sigma_t.x),
            _ => None,
        }
    }
}

/// A phase function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase {
    /// 1/4π everywhere.
    Isotropic,
    /// Henyey–Greenstein with mean cosine `g` in (−1, 1); positive scatters forward.
    HenyeyGreenstein {
        /// Mean cosine.
        g: f64,
    },
    /// Rayleigh's, 3/16π (1 + cos² θ): particles much smaller than the wavelength.
    Rayleigh,
    /// A mixture of two of Henyey–Greenstein: the second with this weight, else the first.
    TwoLobes {
        /// In [0, 1].
        weight: f64,
        /// Mean cosines in (−1, 1); 0 is isotropic.
        g: [f64; 2],
    },
}

/// A light source.
#[derive(Clone, Debug, PartialEq)]
pub enum Emitter {
    /// A point that radiates equally in all directions.
    Point {
        /// Position in world units.
        position: DVec3,
        /// Radiant intensity in W/sr.
        intensity: Rgb,
    },
    /// A point that radiates into a cone; the intensity falls linearly in the angle from the beam to the cutoff.
    Spot {
        /// Position in world units.
        position: DVec3,
        /// Unit vector, the middle of the cone.
        direction: DVec3,
        /// Radiant intensity in W/sr within the beam.
        intensity: Rgb,
        /// Half the angle of the full beam in radians.
        beam: f64,
        /// Half the angle beyond which there is no light, in radians; not less than `beam`.
        cutoff: f64,
        /// A picture that the cone is coloured with.
        slide: Option<Box<Slide>>,
    },
    /// A point that throws a picture.
    Projector {
        /// Position in world units.
        position: DVec3,
        /// Unit vector, to the middle of the picture.
        direction: DVec3,
        /// The picture; its colours times π are the irradiance of a plane at right angles to `direction`, one unit away.
        slide: Box<Slide>,
    },
    /// Parallel light from infinitely far away.
    Directional {
        /// Unit vector in which the light travels.
        direction: DVec3,
        /// Power per area at right angles to the direction.
        irradiance: Rgb,
    },
    /// The front side of a surface.
    Area {
        /// Index into [`Scene::surfaces`]; that surface has a `radiance`.
        surface: usize,
    },
    /// The same radiance from every direction, infinitely far away.
    Constant {
        /// Radiance.
        radiance: Rgb,
    },
    /// Radiance from a picture of all directions, infinitely far away.
    Envmap {
        /// Columns go round: the first and the last are neighbours; the middle is +Z of the map, the upper row +Y.
        image: Arc<Pixels>,
        /// What the pixels are multiplied with.
        scale: f32,
        /// From the map's directions to the world's; a rotation.
        world_from_map: DMat4,
    },
}

/// A picture that a light throws. Texture coordinates of a direction d are 1/2 + (a·d)/(c·d)/2 and 1/2 + (b·d)/(c·d)/2, where c is where the light shines to.
#[derive(Clone, Debug, PartialEq)]
pub struct Slide {
    /// The picture.
    pub texture: Texture,
    /// What its colours are multiplied with; at least 0.
    pub scale: f32,
    /// The vectors a and b.
    pub axes: [DVec3; 2],
}

impl Emitter {
    /// Where it is, if it is a point.
    #[must_use]
    pub const fn position(&self) -> Option<DVec3> {
        match *self {
            Self::Point { position, .. } | Self::Spot { position, .. } | Self::Projector { position, .. } => {
                Some(position)
            }
            Self::Directional { .. } | Self::Area { .. } | Self::Constant { .. } | Self::Envmap { .. } => None,
        }
    }
}

/// A camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Camera to world: +X is left in the image, +Y up, +Z forward; a rigid transform.
    pub world_from_camera: DMat4,
    /// Which rays belong to a place of the film.
    pub projection: Projection,
    /// Rays start on this plane, in world units along +Z.
    pub near_clip: f64,
    /// Rays end on this plane, in world units along +Z.
    pub far_clip: f64,
    /// The medium around the camera; `None` is vacuum.
    pub medium: Option<MediumId>,
}

/// Which rays belong to a place of the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Those through the camera's place, or through its lens.
    Perspective {
        /// tan(X/2), where X is the horizontal field of view of the full film; positive.
        tan_half_fov_x: f64,
        /// The lens, if it is no pinhole.
        lens: Option<Lens>,
        /// How far left of the film's middle the camera's axis meets it, and how far above, in widths and heights of the film.
        principal_point: [f64; 2],
    },
    /// Parallel ones along +Z.
    Orthographic {
        /// Half the width of what the full film sees, in world units; positive.
        half_width: f64,
        /// Half its height; positive.
        half_height: f64,
    },
}

impl Sensor {
    /// The ray through a place of the full film, in the space of the camera: its point at depth 0 and how far it goes for each unit of depth, from the middle of the
    /// lens if there is one. `x` and `y` are from −1 to 1, +X left and +Y up; `aspect` is the width of the film over its height.
    #[must_use]
    pub fn ray(&self, x: f64, y: f64, aspect: f64) -> (DVec3, DVec3) {
        match self.projection {
            Projection::Perspective { tan_half_fov_x: t, principal_point: [px, py], .. } => {
                (DVec3::ZERO, DVec3::new((x - 2.0 * px) * t, (y - 2.0 * py) * t / aspect, 1.0))
            }
            Projection::Orthographic { half_width, half_height } => {
                (DVec3::new(x * half_width, y * half_height, 0.0), DVec3::Z)
            }
        }
    }

    /// Points whose hull holds the points of all rays at depth 0: the camera's place or, if rays are parallel, the corners of the film.
    #[must_use]
    pub fn origins(&self) -> [DVec3; 4] {
        let (w, h) = match self.projection {
            Projection::Perspective { .. } => (0.0, 0.0),
            Projection::Orthographic { half_width, half_height } => (half_width, half_height),
        };
        [(-w, -h), (w, -h), (-w, h), (w, h)]
            .map(|(x, y)| self.world_from_camera.transform_point3(DVec3::new(x, y, 0.0)))
    }
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of the aperture in world units; positive.
    pub radius: f64,
    /// Distance along +Z at which the picture is sharp, in world units; positive.
    pub focus_distance: f64,
}

/// The image that is recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmSettings {
    /// Full width in pixels.
    pub width: u32,
    /// Full height in pixels.
    pub height: u32,
    /// The part of the full image to render; the whole image unless the film is cropped.
    pub crop: PixelRect,
    /// Reconstruction filter.
    pub filter: ReconstructionFilter,
    /// How the image is stored; Mitsuba's default is `Float16`.
    pub component_format: ComponentFormat,
}

/// The numbers of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComponentFormat {
    /// Half precision: about three digits, at most 65,504.
    Float16,
    /// Single precision.
    Float32,
}

/// A rectangle of pixels, half open: `x0 ≤ x < x1`, `y0 ≤ y < y1`; (0, 0) is the top left pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRect {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// One past the last column.
    pub x1: u32,
    /// One past the last row.
    pub y1: u32,
}

/// How samples around a pixel are weighted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReconstructionFilter {
    /// The pixel's own square.
    Box,
    /// max(0, exp(−x²/2σ²) − exp(−r²/2σ²)) in x and in y, with r = 4σ.
    Gaussian {
        /// Standard deviation σ in pixels; positive.
        stddev: f64,
    },
    /// max(0, 1 − |x|/r) in x and in y.
    Tent {
        /// Radius r in pixels; positive.
        radius: f64,
    },
    /// The cubic filters of Mitchell and Netravali (1988), with a radius of 2 pixels; negative in parts.
    Mitchell {
        /// Their parameter B; 1/3 by default.
        b: f64,
        /// Their parameter C; 1/3 by default.
        c: f64,
    },
    /// Mitchell with B = 0 and C = 1/2.
    CatmullRom,
    /// sinc(x) · sinc(x/lobes) in x and in y, for |x| < lobes; negative in parts.
    Lanczos {
        /// Radius in pixels; at least 1, 3 by default.
        lobes: u32,
    },
}

/// Limits of the paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IntegratorSettings {
    /// Longest path in scattering events plus one, as Mitsuba counts; `None` is unlimited.
    pub max_depth: Option<u32>,
    /// Russian roulette starts beyond this depth.
    pub rr_depth: u32,
}
