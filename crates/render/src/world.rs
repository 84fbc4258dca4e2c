//! A scene prepared for rendering: hierarchy, media, emitters and the surface behind every triangle.

use glam::DVec3;
use vdf_geometry::{Bounds, Bvh, Hit, Triangle};
use vdf_scene::{Bsdf, Emitter, Rgb, Scene};
use vdf_visibility::LightShape;

use crate::{GridExtent, lights::Lights, media::Media};

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
    /// Bounds of occluders, medium boundaries, point emitters and the camera.
    pub bounds: Bounds,
    /// What a voxel grid for proofs has to cover: the occluders, and point emitters near them.
    pub occluder_bounds: Bounds,
    /// Whether the camera's far plane may hide something.
    pub(crate) far_plane_clips: bool,
    surface_of_triangle: Vec<u32>,
    surfaces: Vec<SurfaceData>,
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
        let bvh = Bvh::new(&triangles);
        let boundaries = Bounds::of_triangles(scene.boundaries.iter().flat_map(|b| &b.triangles));
        // No ray has to come near an emitter that is a point, so that a sun far away takes nobody's precision.
        let matter = bvh.bounds().union(boundaries).with(scene.sensor.world_from_camera.w_axis.truncate());
        let bounds = positions(scene).fold(matter, Bounds::with);
        Self {
            media: Media::of_scene(scene),
            lights: Lights::new(scene, reach(scene, matter.extent().length(), bounds.extent().length())),
            far_plane_clips: scene.sensor.far_clip < matter.extent().length(),
            occluder_bounds: occluder_bounds(scene, &bvh, bounds),
            bvh,
            triangles,
            bounds,
            surface_of_triangle,
            surfaces,
        }
    }

    /// What a voxel grid of this extent covers.
    #[must_use]
    pub const fn grid_bounds(&self, extent: GridExtent) -> &Bounds {
        match extent {
            GridExtent::Occluders => &self.occluder_bounds,
            GridExtent::Scene => &self.bounds,
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
            point: a * wa + b * wb + c * wc + normal * lift(triangle),
            normal,
            reflectance: if front { data.bsdf.front } else { data.bsdf.back },
            emitted: if front { data.radiance } else { Rgb::ZERO },
            emitter: data.emitter,
        }
    }
}

/// How far a ray starts from the triangle that it leaves, in world units: more than the rounding of a hit's position, and nothing beside a
/// single-precision vertex's. It depends on the triangle alone: a far camera or light must not let rays leak through a wall.
///
/// A hit's position errs by less than 2⁻⁴⁹ of the triangle's largest coordinate (three products and two sums in double precision); this is
/// 2¹⁷ times as much, and still 2⁸ times finer than the step of single precision there.
#[inline]
pub(crate) fn lift(triangle: &Triangle) -> f64 {
    let [a, b, c] = triangle.vertices_f64().map(|v| v.abs());
    a.max(b).max(c).max_element() * (1.0 / 4_294_967_296.0)
}

/// The point emitters' positions.
fn positions(scene: &Scene) -> impl Iterator<Item = DVec3> {
    scene.emitters.iter().filter_map(|e| if let Emitter::Point { position, .. } = e { Some(*position) } else { None })
}

/// The bounds of the occluders, and of the point emitters that are no farther from them than half their longest side: those get
/// neighbourhoods. Fog, camera and far emitters would only make the voxels coarser; queries from outside are clipped. Without any occluder
/// all of the scene.
fn occluder_bounds(scene: &Scene, bvh: &Bvh, all: Bounds) -> Bounds {
    let occluders = *bvh.bounds();
    if occluders.is_empty() {
        return all;
    }
    let near = 0.5 * occluders.extent().max_element();
    let close = Bounds::new(occluders.min - near, occluders.max + near);
    positions(scene).filter(|p| close.contains(*p)).fold(occluders, Bounds::with)
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
/// `matter` is the diagonal of what rays can meet, `all` that of the scene with its lights.
fn reach(scene: &Scene, matter: f64, all: f64) -> f64 {
    let (matter, all) = (matter.max(f64::MIN_POSITIVE), all.max(f64::MIN_POSITIVE));
    let thinnest = scene.media.iter().map(|m| m.sigma_t).filter(|&s| s > 0.0).fold(f64::INFINITY, f64::min);
    (800.0 / thinnest).clamp(2.0 * matter, 1e6 * all)
}
