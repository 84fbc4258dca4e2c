//! A scene prepared for rendering: hierarchy, media, emitters and the surface behind every triangle.

use std::{
    f64::consts::{PI, TAU},
    sync::{Arc, OnceLock},
};

use glam::{DVec3, Vec2, dvec3, vec2};
use vdf_geometry::{Bounds, Bvh, CurvedKind, CurvedSet, CurvedShape, Hit, Segment, Triangle};
use vdf_scene::{Bsdf, Emitter, Extinction, Medium, MeshAttributes, Rgb, Scene, Texture, TexturePoint};
use vdf_visibility::LightShape;

use crate::{
    GridExtent, RegionSet,
    bsdf::{Material, MaterialPoint, Prepared},
    light_paths,
    lights::Lights,
    media::Media,
    others::{CurvedPoint, Met, OtherShapes, TrianglePlace},
};

/// What the integrators need of a scene. Immutable and shared by all threads.
#[derive(Debug)]
pub struct World {
    /// Over all opaque triangles.
    pub bvh: Bvh,
    /// The media and their boundaries.
    pub media: Media,
    /// The emitters.
    pub lights: Lights,
    /// All opaque triangles, surface by surface: what proofs are about.
    pub triangles: Vec<Triangle>,
    /// Bounds of occluders, medium boundaries, point emitters and the camera.
    pub bounds: Bounds,
    /// What a voxel grid for proofs has to cover: the opaque triangles, and point emitters near them.
    pub occluder_bounds: Bounds,
    /// Whether the camera's far plane may hide something.
    pub(crate) far_plane_clips: bool,
    /// Curved shapes and veils, if there are any.
    pub(crate) others: Option<Box<OtherShapes>>,
    /// A box in which no boundary of a medium is met, if all lights are points in it and there are only opaque triangles.
    pub(crate) clear: Option<Bounds>,
    /// The regions that each of [`Lights::beams`] starts in.
    pub(crate) beam_regions: Vec<RegionSet>,
    /// The materials of the surfaces that are no plain Lambertian ones.
    pub(crate) materials: Vec<Shading>,
    surface_of_triangle: Vec<u32>,
    surfaces: Vec<SurfaceData>,
    /// Whether light paths pay, once somebody has asked.
    light_paths_pay: OnceLock<bool>,
}

#[derive(Clone, Debug)]
struct SurfaceData {
    /// Reflectance of the two sides, if it is plain.
    front: Rgb,
    back: Rgb,
    /// Where it is the same everywhere; black otherwise.
    radiance: Rgb,
    /// Where it is not.
    glow: Option<Box<Texture>>,
    /// What a texture of its radiance is looked up by.
    attributes: Arc<MeshAttributes>,
    /// Number of the area emitter, if it is one.
    emitter: Option<usize>,
    /// Number of its [`Shading`], if it is not plain.
    shading: Option<u32>,
    /// The number of its first triangle, among the opaque ones or, of a veil, among those of veils.
    first_triangle: u32,
    veil: bool,
    curved: Option<CurvedShape>,
}

/// How a surface scatters that is no plain Lambertian one.
#[derive(Debug)]
pub(crate) struct Shading {
    pub(crate) material: Material,
    needs_tangents: bool,
    attributes: Arc<MeshAttributes>,
}

/// A point on an occluder, seen from one side.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// The point, lifted off the surface towards the side it is seen from.
    pub point: DVec3,
    /// Unit normal on that side.
    pub normal: DVec3,
    /// Reflectance of that side, if it is a plain Lambertian surface.
    pub reflectance: Rgb,
    /// Radiance emitted from that side.
    pub emitted: Rgb,
    /// Number of the area emitter, if it is one.
    pub emitter: Option<usize>,
    /// Where it is, if it is not plain: [`World::shading`] finds what scattering depends on. That is large, and most points do not have it.
    pub(crate) place: Option<Place>,
}

/// A place on a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    surface: u32,
    /// The number of the triangle in the surface.
    triangle: u32,
    /// The barycentric weights of its second and third vertex.
    barycentric: [f64; 2],
}

/// What scattering at a point depends on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadingPoint {
    /// Index into [`World::materials`].
    pub(crate) material: u32,
    pub(crate) at: MaterialPoint,
    /// The shading frame: unit vectors, the last is the normal, in front of the surface whichever side is seen.
    frame: [DVec3; 3],
    /// To where the path comes from, in that frame.
    pub(crate) wi: DVec3,
    /// How far the point was lifted off the surface.
    lift: f64,
}

impl ShadingPoint {
    /// A direction of the world in the shading frame.
    #[inline]
    pub(crate) fn local(&self, d: DVec3) -> DVec3 {
        dvec3(self.frame[0].dot(d), self.frame[1].dot(d), self.frame[2].dot(d))
    }

    /// A direction of the shading frame in the world.
    #[inline]
    pub(crate) fn world(&self, d: DVec3) -> DVec3 {
        (self.frame[0] * d.x + self.frame[1] * d.y + self.frame[2] * d.z).normalize_or(self.frame[2])
    }
}

impl SurfacePoint {
    /// The point lifted to the side that is not seen.
    pub(crate) fn behind(&self, shading: &ShadingPoint) -> DVec3 {
        self.point - self.normal * (2.0 * shading.lift)
    }
}

impl World {
    /// Prepares `scene`. Cost: that of [`Bvh::new`].
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let (mut materials, mut prepared) = (Vec::new(), Prepared::default());
        let mut surfaces: Vec<SurfaceData> = Vec::new();
        let (mut triangles, mut surface_of_triangle) = (Vec::new(), Vec::new());
        let (mut is_veil, mut veiled) = (Vec::new(), 0);
        for (i, s) in (0..).zip(&scene.surfaces) {
            let plain = match &s.bsdf {
                Bsdf::Lambertian { front, back } if s.attributes.normals.is_empty() => Some((*front, *back)),
                _ => None,
            };
            let shading = plain.is_none().then(|| {
                let material = Material::new(&s.bsdf, &mut prepared);
                let needs_tangents = material.needs_tangents();
                materials.push(Shading { material, needs_tangents, attributes: s.attributes.clone() });
                (materials.len() - 1) as u32
            });
            let veil = shading.is_some_and(|m| materials[m as usize].material.may_pass());
            let (front, back) = plain.unwrap_or_default();
            let first_triangle = if veil { veiled } else { triangles.len() as u32 };
            let (radiance, glow) = match &s.radiance {
                Some(Texture::Constant(radiance)) => (*radiance, None),
                Some(texture) => (Rgb::ZERO, Some(Box::new(texture.clone()))),
                None => (Rgb::ZERO, None),
            };
            let (curved, attributes) = (s.curved, s.attributes.clone());
            let emitter = None;
            surfaces.push(SurfaceData {
                front,
                back,
                radiance,
                glow,
                attributes,
                emitter,
                shading,
                first_triangle,
                veil,
                curved,
            });
            is_veil.push(veil);
            if veil {
                veiled += s.triangles.len() as u32;
            } else {
                triangles.extend(&s.triangles);
                surface_of_triangle.resize(triangles.len(), i);
            }
        }
        for (i, emitter) in scene.emitters.iter().enumerate() {
            if let Emitter::Area { surface } = emitter {
                surfaces[*surface].emitter = Some(i);
            }
        }
        let bvh = Bvh::new(&triangles);
        let others = OtherShapes::new(scene, |i| is_veil[i]).map(Box::new);
        let boundaries = Bounds::of_triangles(scene.boundaries.iter().flat_map(|b| &b.triangles));
        let spheres = scene.boundaries.iter().filter_map(|b| b.curved).map(|c| *c.bounds());
        let curved = others.as_ref().map_or(Bounds::EMPTY, |o| o.bounds());
        let shapes = spheres.fold(bvh.bounds().union(boundaries).union(curved), Bounds::union);
        // No ray has to come near an emitter that is a point, so that a sun far away takes nobody's precision.
        let media = Media::of_scene(scene);
        let shapes = shapes.union(media.ambient_bounds());
        let matter = scene.sensor.origins().into_iter().fold(shapes, Bounds::with);
        let bounds = positions(scene).fold(matter, Bounds::with);
        let lights = Lights::new(scene, reach(scene, matter.extent().length(), bounds.extent().length()));
        Self {
            beam_regions: lights.beams().iter().map(|beam| media.regions_at(beam.position)).collect(),
            clear: clear(&media, &lights).filter(|_| others.is_none()),
            media,
            lights,
            far_plane_clips: scene.sensor.far_clip < matter.extent().length(),
            occluder_bounds: occluder_bounds(scene, &bvh, bounds),
            bvh,
            triangles,
            bounds,
            others,
            materials,
            surface_of_triangle,
            surfaces,
            light_paths_pay: OnceLock::new(),
        }
    }

    /// Whether it pays that paths are connected to paths of the lights, in the scene that this is of. Cost: see [`light_paths`], at first; then nothing.
    pub(crate) fn light_paths_pay(&self, scene: &Scene) -> bool {
        *self.light_paths_pay.get_or_init(|| light_paths::pay(scene, self))
    }

    /// What a voxel grid of this extent covers.
    #[must_use]
    pub const fn grid_bounds(&self, extent: GridExtent) -> &Bounds {
        match extent {
            GridExtent::Occluders => &self.occluder_bounds,
            GridExtent::Scene => &self.bounds,
        }
    }

    /// The opaque curved shapes, of which no prover knows; `None` if there are none.
    #[must_use]
    pub fn curved(&self) -> Option<&CurvedSet> {
        self.others.as_ref().map(|others| others.curved()).filter(|curved| !curved.is_empty())
    }

    /// The surface at a hit, for a ray of direction `direction`.
    #[inline]
    #[must_use]
    pub fn surface_point(&self, hit: &Hit, direction: DVec3) -> SurfacePoint {
        let triangle = &self.triangles[hit.triangle as usize];
        let surface = self.surface_of_triangle[hit.triangle as usize];
        let data = &self.surfaces[surface as usize];
        let number = hit.triangle - data.first_triangle;
        triangle_point(data, triangle, hit, direction, TrianglePlace { surface, number })
    }

    /// The surface at whatever a segment meets, for a ray of direction `direction`.
    pub(crate) fn surface_at(&self, met: &Met, segment: &Segment, direction: DVec3) -> SurfacePoint {
        match met {
            Met::Triangle(hit) => self.surface_point(hit, direction),
            Met::Veil(hit, triangle, place) => {
                triangle_point(&self.surfaces[place.surface as usize], triangle, hit, direction, *place)
            }
            Met::Curved(surface, t) => {
                let data = &self.surfaces[*surface as usize];
                let Some(shape) = &data.curved else { return nothing(segment.at(*t), direction) };
                curved_point(data, shape, &point_of(shape, segment.at(*t)), direction, *surface)
            }
        }
    }

    /// What of light that travels in `direction` passes the veil that a segment meets.
    pub(crate) fn passes(&self, met: &Met, segment: &Segment, direction: DVec3) -> Rgb {
        let shading = self.shading(&self.surface_at(met, segment, direction), direction);
        shading.map_or(Rgb::ZERO, |s| self.materials[s.material as usize].material.passes(s.wi, &s.at))
    }

    /// What scattering at a point depends on, for a path that comes in `direction`; `None` at a plain one.
    #[inline(never)]
    pub(crate) fn shading(&self, point: &SurfacePoint, direction: DVec3) -> Option<ShadingPoint> {
        let place = point.place?;
        let data = &self.surfaces[place.surface as usize];
        let material = data.shading?;
        if let Some(shape) = &data.curved {
            let on_shape = point_of(shape, point.point);
            let (uv, tangents) = parametrization(shape, on_shape.local);
            let frame = frame(on_shape.normal, Some(tangents[0]));
            let tangents = tangents.map(|t| local(&frame, t));
            let at = MaterialPoint { texture: uv.into(), tangents, normal: DVec3::Z };
            return Some(ShadingPoint { material, at, wi: local(&frame, -direction), frame, lift: curved_lift(shape) });
        }
        let index = (data.first_triangle + place.triangle) as usize;
        let triangle = match &self.others {
            Some(others) if data.veil => others.veil_triangle(index)?,
            _ => self.triangles.get(index)?,
        };
        Some(self.shade_triangle(material, triangle, &place, direction))
    }

    fn shade_triangle(&self, shading: u32, triangle: &Triangle, place: &Place, direction: DVec3) -> ShadingPoint {
        let Shading { attributes, needs_tangents, .. } = &self.materials[shading as usize];
        let MeshAttributes { normals, uvs } = &**attributes;
        let number = place.triangle as usize;
        let [wb, wc] = place.barycentric;
        let wa = 1.0 - wb - wc;
        let own = triangle.area_normal().normalize_or(-direction);
        let normal = normals.get(number).map_or(own, |n| {
            let [a, b, c] = n.map(|n| n.as_dvec3());
            (a * wa + b * wb + c * wc).normalize_or(own)
        });
        // Without texture coordinates these are the weights, as in Mitsuba.
        let &[a, b, c] = uvs.get(number).unwrap_or(&[Vec2::ZERO, Vec2::X, Vec2::Y]);
        let uv = (a.as_dvec2() * wa + b.as_dvec2() * wb + c.as_dvec2() * wc).as_vec2();
        // ∂p/∂u and ∂p/∂v times a determinant, from p and (u, v) at the corners.
        let [p, q, r] = triangle.vertices_f64();
        let (du, dv) = ((b - a).as_dvec2(), (c - a).as_dvec2());
        let determinant = du.perp_dot(dv);
        let along = (q - p) * dv.y - (r - p) * du.y;
        let frame = frame(normal, (determinant != 0.0).then(|| along * determinant.signum()));
        let mut at =
            MaterialPoint::from(TexturePoint { uv, triangle: place.triangle, barycentric: [wb as f32, wc as f32] });
        if *needs_tangents {
            let across = (r - p) * du.x - (q - p) * dv.x;
            at.normal = local(&frame, if own.dot(normal) < 0.0 { -own } else { own });
            at.tangents = if determinant == 0.0 {
                [DVec3::X, DVec3::Y]
            } else {
                [along, across].map(|t| local(&frame, t / determinant))
            };
        }
        ShadingPoint { material: shading, at, wi: local(&frame, -direction), frame, lift: lift(triangle) }
    }
}

/// A point of a triangle, as if it were plain.
#[inline(always)]
fn triangle_point(
    data: &SurfaceData,
    triangle: &Triangle,
    hit: &Hit,
    direction: DVec3,
    at: TrianglePlace,
) -> SurfacePoint {
    let [a, b, c] = triangle.vertices_f64();
    let [wa, wb, wc] = hit.barycentric;
    // Exact predicates can hit so thin a triangle that its rounded normal is zero.
    let normal = triangle.area_normal().normalize_or(-direction);
    let front = direction.dot(normal) < 0.0;
    let normal = if front { normal } else { -normal };
    SurfacePoint {
        point: a * wa + b * wb + c * wc + normal * lift(triangle),
        normal,
        reflectance: if front { data.front } else { data.back },
        emitted: match &data.glow {
            _ if !front => Rgb::ZERO,
            None => data.radiance,
            Some(texture) => glow(texture, &data.attributes, at.number, [wb, wc]),
        },
        emitter: data.emitter,
        place: data.shading.map(|_| Place { surface: at.surface, triangle: at.number, barycentric: [wb, wc] }),
    }
}

/// What a triangle emits at a place of it.
#[cold]
pub(crate) fn glow(texture: &Texture, attributes: &MeshAttributes, triangle: u32, [wb, wc]: [f64; 2]) -> Rgb {
    let &[a, b, c] = attributes.uvs.get(triangle as usize).unwrap_or(&[Vec2::ZERO, Vec2::X, Vec2::Y]);
    let uv = (a.as_dvec2() * (1.0 - wb - wc) + b.as_dvec2() * wb + c.as_dvec2() * wc).as_vec2();
    texture.at(&TexturePoint { uv, triangle, barycentric: [wb as f32, wc as f32] })
}

/// The point of a shape that is nearest to a place on it that was rounded.
fn point_of(shape: &CurvedShape, place: DVec3) -> CurvedPoint {
    let local = shape.snapped(shape.to_local(place));
    CurvedPoint { point: shape.to_world(local), normal: shape.normal(local), local }
}

fn curved_point(
    data: &SurfaceData,
    shape: &CurvedShape,
    at: &CurvedPoint,
    direction: DVec3,
    surface: u32,
) -> SurfacePoint {
    let front = direction.dot(at.normal) < 0.0;
    let normal = if front { at.normal } else { -at.normal };
    SurfacePoint {
        point: at.point + normal * curved_lift(shape),
        normal,
        reflectance: if front { data.front } else { data.back },
        emitted: match &data.glow {
            _ if !front => Rgb::ZERO,
            None => data.radiance,
            Some(texture) => texture.at(&parametrization(shape, at.local).0.into()),
        },
        emitter: data.emitter,
        place: data.shading.map(|_| Place { surface, triangle: 0, barycentric: [0.0; 2] }),
    }
}

/// A black point, for what cannot be.
fn nothing(point: DVec3, direction: DVec3) -> SurfacePoint {
    let (reflectance, emitted) = (Rgb::ZERO, Rgb::ZERO);
    SurfacePoint { point, normal: -direction, reflectance, emitted, emitter: None, place: None }
}

/// Texture coordinates as Mitsuba has them, and ∂p/∂u and ∂p/∂v in the world.
pub(crate) fn parametrization(shape: &CurvedShape, p: DVec3) -> (Vec2, [DVec3; 2]) {
    let turn = (p.y.atan2(p.x) / TAU).rem_euclid(1.0);
    let radius = p.x.hypot(p.y);
    // Outwards from the axis and around it.
    let out = if radius > 0.0 { dvec3(p.x, p.y, 0.0) / radius } else { DVec3::X };
    let around = dvec3(-p.y, p.x, 0.0) * TAU;
    let (u, v, tangents) = match shape.kind() {
        CurvedKind::Sphere => (turn, p.z.clamp(-1.0, 1.0).acos() / PI, [around, (out * p.z - DVec3::Z * radius) * PI]),
        CurvedKind::Disk => (radius, turn, [out, around]),
        CurvedKind::Cylinder => (turn, p.z, [around, DVec3::Z]),
    };
    (vec2(u as f32, v as f32), tangents.map(|t| *shape.placement().0 * t))
}

/// A frame about a normal whose first axis goes along with `along`, if that leads anywhere.
fn frame(normal: DVec3, along: Option<DVec3>) -> [DVec3; 3] {
    let flat = along.map(|a| a - normal * a.dot(normal)).and_then(DVec3::try_normalize);
    let first = flat.unwrap_or_else(|| normal.any_orthonormal_vector());
    [first, normal.cross(first), normal]
}

fn local(frame: &[DVec3; 3], d: DVec3) -> DVec3 {
    dvec3(frame[0].dot(d), frame[1].dot(d), frame[2].dot(d))
}

/// As [`lift`]; a point of a curved shape is off it by the rounding of the map to the world, below 2⁻⁴⁹ of the largest coordinate and the error of
/// the map, 10⁻¹² of the shape's size: a hundredth of this.
pub(crate) fn curved_lift(shape: &CurvedShape) -> f64 {
    shape.bounds().largest_coordinate() * (1.0 / 4_294_967_296.0)
}

/// How far a ray starts from the triangle that it leaves, in world units: more than the rounding of a hit's position, and nothing beside a
/// single-precision vertex's. It depends on the triangle alone: a far camera or light must not let rays leak through a wall.
///
/// A hit's position errs by less than 2⁻⁴⁹ of the triangle's largest coordinate (three products and two sums in double precision); this is
/// 2¹⁷ times as much, and still 2⁸ times finer than the step of single precision there.
#[inline]
pub(crate) fn lift(triangle: &Triangle) -> f64 {
    let [a, b, c] = triangle.vertices_f64();
    a.abs().max(b.abs()).max(c.abs()).max_element() * (1.0 / 4_294_967_296.0)
}

/// A box in which no boundary is met, if all lights are points inside of it.
fn clear(media: &Media, lights: &Lights) -> Option<Bounds> {
    let clear = media.clear();
    let inside = |p: DVec3| p.cmpgt(clear.min).all() && p.cmplt(clear.max).all();
    let all_inside = lights.points().iter().all(|(_, position, _)| inside(*position));
    (all_inside && lights.points().len() == lights.count() && lights.count() > 0).then_some(clear)
}

/// The point emitters' positions.
fn positions(scene: &Scene) -> impl Iterator<Item = DVec3> {
    scene.emitters.iter().filter_map(Emitter::position)
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
        Emitter::Point { position, .. } | Emitter::Spot { position, .. } | Emitter::Projector { position, .. } => {
            LightShape::Point(position)
        }
        // A curved one has no triangles: nothing is kept for it.
        Emitter::Area { surface } => LightShape::Area(&scene.surfaces[surface].triangles),
        Emitter::Directional { .. } | Emitter::Constant { .. } | Emitter::Envmap { .. } => LightShape::Infinite,
    };
    scene.emitters.iter().map(shape).collect()
}

/// A distance that leads out of the scene from anywhere in it, and, where fog is unbounded, through nearly all of it:
/// beyond optical depth 800 nothing is left in double precision. It is limited to 10⁶ scenes, so that positions keep their precision.
/// `matter` is the diagonal of what rays can meet, `all` that of the scene with its lights.
fn reach(scene: &Scene, matter: f64, all: f64) -> f64 {
    let (matter, all) = (matter.max(f64::MIN_POSITIVE), all.max(f64::MIN_POSITIVE));
    // A grid has an end.
    let least = |m: &Medium| match m.sigma_t {
        Extinction::Constant(sigma_t) => {
            sigma_t.to_array().into_iter().filter(|&s| s > 0.0).fold(f64::INFINITY, f64::min)
        }
        Extinction::Grid { .. } => f64::INFINITY,
    };
    let thinnest = scene.media.iter().map(least).fold(f64::INFINITY, f64::min);
    (800.0 / thinnest).clamp(2.0 * matter, 1e6 * all)
}
