//! A scene prepared for rendering: hierarchy, media, emitters and the surface behind every triangle.

use glam::DVec3;
use vdf_geometry::{Bounds, Bvh, Hit, Triangle};
use vdf_scene::{Bsdf, Emitter, Rgb, Scene};
use vdf_visibility::LightShape;

use crate::{lights::Lights, media::Media};

/// What the integrators need of a scene. Immutable and shared by all threads.
#[derive(Debug)]
pub struct World {
    /// Over all occluders.
    pub bvh: Bvh,
    /// The media and their boundaries.
    pub media: Media,
    /// The emitters.
    pub lights: Lights,
    /// All occluders, surface by surface.
    pub triangles: Vec<Triangle>,
    /// Bounds of occluders, medium boundaries and point emitters: what a voxel grid has to cover.
    pub bounds: Bounds,
    surface_of_triangle: Vec<u32>,
    surfaces: Vec<SurfaceData>,
    /// How far a ray starts from its surface: more than the rounding of a hit's position, and nothing beside a single-precision
    /// vertex's.
    lift: f64,
}

#[derive(Clone, Copy, Debug)]
struct SurfaceData {
    bsdf: Bsdf,
    radiance: Rgb,
    /// Number of the area emitter, if it is one.
    emitter: Option<usize>,
}

/// A point on an occluder, seen from one side.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// The point, lifted off the surface towards the side it is seen from.
    pub point: DVec3,
    /// Unit normal on that side.
    pub normal: DVec3,
    /// Reflectance of that side.
    pub reflectance: Rgb,
    /// Radiance emitted from that side.
    pub emitted: Rgb,
    /// Number of the area emitter, if it is one.
    pub emitter: Option<usize>,
}

impl World {
    /// Prepares `scene`. Cost: that of [`Bvh::new`].
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let triangles: Vec<_> = scene.surfaces.iter().flat_map(|s| s.triangles.iter().copied()).collect();
        let surface_of_triangle = (0..).zip(&scene.surfaces).flat_map(|(i, s)| vec![i; s.triangles.len()]).collect();
        let mut surfaces: Vec<_> = scene
            .surfaces
            .iter()
            .map(|s| SurfaceData { bsdf: s.bsdf, radiance: s.radiance.unwrap_or(Rgb::ZERO), emitter: None })
            .collect();
        for (i, emitter) in scene.emitters.iter().enumerate() {
            if let Emitter::Area { surface } = emitter {
                surfaces[*surface].emitter = Some(i);
            }
        }
        let bounds = bounds(scene, &triangles);
        let camera = scene.sensor.world_from_camera.w_axis.truncate();
        let with_camera = bounds.with(camera);
        let largest = with_camera.largest_coordinate();
        Self {
            bvh: Bvh::new(&triangles),
            media: Media::new(&scene.media, &scene.boundaries),
            lights: Lights::new(scene, reach(scene, with_camera.extent().length()), largest * LIFT),
            triangles,
            bounds,
            surface_of_triangle,
            surfaces,
            lift: largest * LIFT,
        }
    }

    /// The surface at a hit, for a ray of direction `direction`.
    #[inline]
    #[must_use]
    pub fn surface_point(&self, hit: &Hit, direction: DVec3) -> SurfacePoint {
        let triangle = &self.triangles[hit.triangle as usize];
        let [a, b, c] = triangle.vertices_f64();
        let [wa, wb, wc] = hit.barycentric;
        // Exact predicates can hit so thin a triangle that its rounded normal is zero.
        let normal = triangle.area_normal().normalize_or(-direction);
        let data = &self.surfaces[self.surface_of_triangle[hit.triangle as usize] as usize];
        let front = direction.dot(normal) < 0.0;
        let normal = if front { normal } else { -normal };
        SurfacePoint {
            point: a * wa + b * wb + c * wc + normal * self.lift,
            normal,
            reflectance: if front { data.bsdf.front } else { data.bsdf.back },
            emitted: if front { data.radiance } else { Rgb::ZERO },
            emitter: data.emitter,
        }
    }
}

/// A hit's position errs by less than 2⁻⁴⁹ of the largest coordinate (three products and two sums in double precision); this is
/// 2¹⁷ times as much, and still 2⁸ times finer than a single-precision vertex.
const LIFT: f64 = 1.0 / 4_294_967_296.0;

/// The box around occluders, medium boundaries and point emitters; around the camera if there are none.
fn bounds(scene: &Scene, triangles: &[Triangle]) -> Bounds {
    let boundaries = scene.boundaries.iter().flat_map(|b| &b.triangles);
    let lights = scene
        .emitters
        .iter()
        .filter_map(|e| if let Emitter::Point { position, .. } = e { Some(*position) } else { None });
    let bounds = Bounds::of_points(triangles.iter().chain(boundaries).flat_map(Triangle::vertices_f64).chain(lights));
    if bounds.is_empty() { Bounds::of_points([scene.sensor.world_from_camera.w_axis.truncate()]) } else { bounds }
}

/// Where the emitters of `scene` are, as far as proofs are concerned.
#[must_use]
pub fn light_shapes(scene: &Scene) -> Vec<LightShape<'_>> {
    let shape = |emitter: &Emitter| match *emitter {
        Emitter::Point { position, .. } => LightShape::Point(position),
        Emitter::Area { surface } => LightShape::Area(&scene.surfaces[surface].triangles),
        Emitter::Constant { .. } => LightShape::Infinite,
    };
    scene.emitters.iter().map(shape).collect()
}

/// A distance that leads out of the scene from anywhere in it, and, where fog is unbounded, through nearly all of it:
/// beyond optical depth 800 nothing is left in double precision. It is limited to 10⁶ scenes, so that positions keep their precision.
fn reach(scene: &Scene, diagonal: f64) -> f64 {
    let diagonal = diagonal.max(f64::MIN_POSITIVE);
    let thinnest = scene.media.iter().map(|m| m.sigma_t).filter(|&s| s > 0.0).fold(f64::INFINITY, f64::min);
    (800.0 / thinnest).clamp(2.0 * diagonal, 1e6 * diagonal)
}
