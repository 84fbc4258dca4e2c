//! Fog where it is: flush with walls and floors, in stacks of boxes, rotated and far from the origin; and what else a path must not lose.

mod common;

use std::{
    f64::consts::PI,
    sync::atomic::{AtomicU32, Ordering},
};

use common::{Options, add_medium, builtin, cuboid, empty_scene, mean_and_error, options, rendered};
use glam::{DMat3, DMat4, DQuat, DVec3, Vec3, dvec3, vec3};
use vdf::{
    geometry::{Bounds, Segment, Triangle},
    render::{
        Integrator, Media, PrepareOptions, PreparedScene, Progress, Quiet, RenderError, RenderOptions,
        TransmittanceEstimator, World,
    },
    scene::{Boundary, Bsdf, Emitter, Medium, MediumId, Phase, Rgb, Scene, Surface},
    visibility::Method,
};

const BOTH: [Integrator; 2] = [Integrator::Volpath, Integrator::raymarch(2)];

/// A rotation and a shift of a whole scene.
#[derive(Clone, Copy, Debug)]
struct Place {
    turn: DMat3,
    shift: DVec3,
}

impl Place {
    fn point(&self, p: DVec3) -> DVec3 {
        self.turn * p + self.shift
    }

    fn triangles(&self, triangles: Vec<Triangle>) -> Vec<Triangle> {
        let at = |v: Vec3| self.point(v.as_dvec3()).as_vec3();
        triangles.into_iter().map(|t| Triangle { vertices: t.vertices.map(at) }).collect()
    }
}

fn places() -> [Place; 4] {
    let turn = |angle: f64| DMat3::from_axis_angle(dvec3(1.0, 0.7, -0.4).normalize(), angle);
    [
        Place { turn: DMat3::IDENTITY, shift: DVec3::ZERO },
        Place { turn: turn(0.9), shift: DVec3::ZERO },
        Place { turn: DMat3::IDENTITY, shift: dvec3(3e3, -2e3, 1e3) },
        Place { turn: turn(2.2), shift: dvec3(-1e3, 2e3, 3e3) },
    ]
}

/// The lower and upper bounds of the fog, beside a floor at y = 0.
const FOGS: [(&str, f32); 5] =
    [("flush", 0.0), ("below", -1.0), ("grown", -1e-6), ("shrunk", 1e-6), ("a hair below", -1e-3)];

const SIGMA_T: f64 = 0.35;
const EYE: DVec3 = DVec3::new(0.4, 1.5, -2.5);
const LIGHT: DVec3 = DVec3::new(0.3, 2.0, 0.2);
const TARGET: DVec3 = DVec3::new(-0.2, 0.0, 0.5);

/// A floor under absorbing fog, looked at from within the fog, so closely that all pixels show one point.
fn floor(fog_from: f32, place: Place, emitter: &str) -> Scene {
    let mut scene = empty_scene(8, 16, 1e-6);
    let forward = (TARGET - EYE).normalize();
    let left = DVec3::Y.cross(forward).normalize();
    let axes = DMat3::from_cols(left, forward.cross(left), forward);
    scene.sensor.world_from_camera =
        DMat4::from_rotation_translation(DQuat::from_mat3(&(place.turn * axes)), place.point(EYE));
    let square = |h: f32, y: f32, up: bool| {
        let v = |x: f32, z: f32| vec3(x * h, y, z * h);
        let mut t = vec![
            Triangle::new(v(-1.0, -1.0), v(1.0, 1.0), v(1.0, -1.0)),
            Triangle::new(v(-1.0, -1.0), v(-1.0, 1.0), v(1.0, 1.0)),
        ];
        if !up {
            t.iter_mut().for_each(|t| t.vertices.swap(1, 2));
        }
        place.triangles(t)
    };
    let grey = Rgb::splat(0.8);
    let bsdf = Bsdf::lambertian(grey, grey);
    scene.surfaces.push(Surface { triangles: square(5.0, 0.0, true), bsdf, radiance: None, ..Surface::default() });
    let fog = add_medium(&mut scene, SIGMA_T, 0.0, Phase::Isotropic);
    scene.sensor.medium = Some(fog);
    let triangles = place.triangles(cuboid(vec3(-4.0, fog_from, -4.0), vec3(4.0, 3.0, 4.0)));
    scene.boundaries.push(Boundary { triangles, interior: Some(fog), exterior: None, ..Boundary::default() });
    match emitter {
        "point" => {
            scene.emitters.push(Emitter::Point { position: place.point(LIGHT), intensity: Rgb::splat(10.0) });
        }
        "area" => {
            // A small lamp, 0.02 wide, in the plane of the fog's upper face.
            let lamp = Surface {
                triangles: square(0.01, 3.0, false),
                bsdf: Bsdf::lambertian(Rgb::ZERO, Rgb::ZERO),
                radiance: Some(Rgb::splat(1e4).into()),
                ..Surface::default()
            };
            scene.emitters.push(Emitter::Area { surface: scene.surfaces.len() });
            scene.surfaces.push(lamp);
        }
        _ => scene.emitters.push(Emitter::Constant { radiance: Rgb::splat(1.0) }),
    }
    scene
}

/// The floor's radiance at the camera by closed form; for the sky a quadrature over the fog's box.
fn expected(emitter: &str) -> f64 {
    let to_eye = (-SIGMA_T * EYE.distance(TARGET)).exp();
    let direct = |light: DVec3, intensity: f64| {
        let d = light - TARGET;
        0.8 / PI * intensity * d.normalize().y / d.length_squared() * (-SIGMA_T * d.length()).exp()
    };
    let arriving = match emitter {
        "point" => direct(LIGHT, 10.0),
        "area" => {
            let d = dvec3(0.0, 3.0, 0.0) - TARGET;
            direct(dvec3(0.0, 3.0, 0.0), 1e4 * 0.02 * 0.02 * d.normalize().y)
        }
        _ => {
            // ∫ cos θ/π · exp(−σ_t · the way out of the box) dω, cos²θ from 0 to 1 and φ around.
            let way = |d: DVec3| {
                let side = |k: usize| {
                    let wall = if d[k] > 0.0 { [4.0, 3.0, 4.0][k] } else { [-4.0, 0.0, -4.0][k] };
                    if d[k] == 0.0 { f64::INFINITY } else { (wall - TARGET[k]) / d[k] }
                };
                side(0).min(side(1)).min(side(2))
            };
            let n = 400;
            let mut sum = 0.0;
            for i in 0..n {
                for j in 0..n {
                    let y2: f64 = (f64::from(i) + 0.5) / f64::from(n);
                    let (s, c) = (2.0 * PI * (f64::from(j) + 0.5) / f64::from(n)).sin_cos();
                    let r = (1.0 - y2).sqrt();
                    sum += (-SIGMA_T * way(dvec3(r * c, y2.sqrt(), r * s))).exp();
                }
            }
            0.8 * sum / f64::from(n * n)
        }
    };
    arriving * to_eye
}

/// A fog box on a floor: the same radiance whether the fog ends at the floor, below it, or beside it by rounding; at any place and rotation,
/// for each light kind, both integrators and both estimators of transmittance. Within five standard errors (false alarm below 6·10⁻⁷ a case;
/// the seeds are fixed) and 2·10⁻³ for the lamp's size, the quadrature and vertices rounded far from the origin.
#[test]
fn a_floor_in_fog_has_its_closed_form() {
    for emitter in ["point", "area", "constant"] {
        let expected = expected(emitter);
        for (name, from) in FOGS {
            for place in places() {
                let scene = floor(from, place, emitter);
                for integrator in BOTH {
                    for transmittance in [TransmittanceEstimator::Analytic, TransmittanceEstimator::Analog] {
                        let o = Options { integrator, transmittance, spp: Some(64), ..options() };
                        let (mean, error) = mean_and_error(&rendered(&scene, &o).image.pixels);
                        assert!(
                            (mean - expected).abs() <= 5.0 * error + 2e-3 * expected,
                            "{emitter}, fog {name}, {place:?}, {integrator}, {transmittance:?}: {mean} ± {error}, not {expected}"
                        );
                    }
                }
            }
        }
    }
}

/// A room that its fog fills exactly, or beyond its walls: white walls and white fog under light of radiance 1 from the walls are a furnace.
/// Emitted light only for `raymarch` would lose what scatters twice, so that only `volpath` is asked.
#[test]
fn a_flush_room_is_a_white_furnace() {
    for place in places() {
        for (fog, name) in [(1.0, "flush"), (1.0 + 1e-6, "grown"), (1.0 - 1e-6, "shrunk"), (1.2, "beyond")] {
            let mut scene = empty_scene(8, 256, 0.7);
            scene.sensor.world_from_camera =
                DMat4::from_rotation_translation(DQuat::from_mat3(&place.turn), place.shift);
            // Inward normals: the walls shine into the room, half of the light, and reflect the other half.
            let mut walls = place.triangles(cuboid(Vec3::NEG_ONE, Vec3::ONE));
            walls.iter_mut().for_each(|t| t.vertices.swap(1, 2));
            let half = Rgb::splat(0.5);
            scene.surfaces.push(Surface {
                triangles: walls,
                bsdf: Bsdf::lambertian(half, Rgb::ZERO),
                radiance: Some(half.into()),
                ..Surface::default()
            });
            scene.emitters.push(Emitter::Area { surface: 0 });
            let medium = add_medium(&mut scene, 1.5, 1.0, Phase::Isotropic);
            scene.sensor.medium = Some(medium);
            scene.boundaries.push(Boundary {
                triangles: place.triangles(cuboid(Vec3::splat(-fog), Vec3::splat(fog))),
                interior: Some(medium),
                exterior: None,
                ..Boundary::default()
            });
            let (mean, error) = mean_and_error(&rendered(&scene, &options()).image.pixels);
            assert!((mean - 1.0).abs() <= 5.0 * error, "{name}, {place:?}: {mean} ± {error}");
        }
    }
}

/// A thin sheet with fog on one of its sides only, in its plane: light that leaves either side knows what is there.
#[test]
fn a_sheet_has_two_sides() {
    let sheet = vec![
        Triangle::new(vec3(-5.0, -5.0, 2.0), vec3(5.0, -5.0, 2.0), vec3(5.0, 5.0, 2.0)),
        Triangle::new(vec3(-5.0, -5.0, 2.0), vec3(5.0, 5.0, 2.0), vec3(-5.0, 5.0, 2.0)),
    ];
    // Seen from the front through vacuum, with the fog behind it; and through fog that ends at it.
    for (fog_is_before, depth) in [(false, 0.0_f64), (true, 0.5 * (1.0 + 1.5))] {
        let mut scene = empty_scene(4, 16, 1e-6);
        let one = Rgb::ONE;
        scene.surfaces.push(Surface {
            triangles: sheet.clone(),
            bsdf: Bsdf::lambertian(one, one),
            radiance: None,
            ..Surface::default()
        });
        let medium = add_medium(&mut scene, 0.5, 0.0, Phase::Isotropic);
        let (z0, z1) = if fog_is_before { (0.5, 2.0) } else { (2.0, 4.0) };
        let triangles = cuboid(vec3(-5.0, -5.0, z0), vec3(5.0, 5.0, z1));
        scene.boundaries.push(Boundary { triangles, interior: Some(medium), exterior: None, ..Boundary::default() });
        scene.emitters.push(Emitter::Point { position: dvec3(0.0, 0.0, 1.0), intensity: Rgb::splat(PI as f32) });
        let expected = (-depth).exp();
        for integrator in BOTH {
            let o = Options { integrator, spp: Some(256), ..options() };
            let (mean, error) = mean_and_error(&rendered(&scene, &o).image.pixels);
            assert!((mean - expected).abs() <= 5.0 * error + 1e-6, "{integrator}: {mean} ± {error}, not {expected}");
        }
    }
}

/// Boxes that touch are one region of fog, up to what rounding of their vertices to single precision makes of it.
#[test]
fn stacks_of_touching_boxes_are_one_fog() {
    for boxes in [1_u16, 3, 5, 50] {
        for place in places() {
            let height = 1.0 / f32::from(boxes);
            let boundary = |i: u16| {
                let z = f32::from(i) * height;
                let triangles = cuboid(vec3(-3.0, -3.0, z), vec3(3.0, 3.0, z + height));
                Boundary {
                    triangles: place.triangles(triangles),
                    interior: Some(MediumId(0)),
                    exterior: None,
                    ..Boundary::default()
                }
            };
            let medium = Medium::new(1.0, Rgb::ONE, Phase::Isotropic);
            let media = Media::new(&[medium], &(0..boxes).map(boundary).collect::<Vec<_>>(), None);
            for (p, q) in [
                (dvec3(0.1, 0.2, -1.0), dvec3(0.3, 0.1, 2.0)),
                (dvec3(0.0, 0.0, 2.0), dvec3(0.0, 0.0, -1.0)),
                (dvec3(-1.0, 1.0, -0.5), dvec3(1.0, -1.0, 1.5)),
            ] {
                let s = Segment::new(place.point(p), place.point(q));
                let expected = 1.0 / ((q - p).z.abs() / (q - p).length());
                let tau = media.optical_depth(&s, &media.regions_at(s.p));
                let ulp = f64::from(f32::EPSILON) * (4.0 + place.shift.abs().max_element());
                let allowed = f64::from(boxes) * 2.0 * ulp + 1e-12;
                assert!((tau - expected).abs() <= allowed, "{boxes} boxes, {place:?}: {tau}, not {expected}");
            }
        }
    }
}

/// Roulette must not kill what is worth 1: white fog under a white sky is a furnace at any density.
#[test]
fn dense_white_fog_is_a_furnace() {
    for sigma_t in [10.0, 100.0, 1000.0] {
        let mut scene = empty_scene(12, 12, 0.2);
        scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
        let fog = add_medium(&mut scene, sigma_t, 1.0, Phase::Isotropic);
        common::add_fog(&mut scene, vec3(-0.5, -0.5, 1.0), vec3(0.5, 0.5, 2.0), fog);
        let (mean, error) = mean_and_error(&rendered(&scene, &options()).image.pixels);
        assert!((mean - 1.0).abs() <= 5.0 * error + 1e-6 && error < 0.02, "σ_t = {sigma_t}: {mean} ± {error}");
    }
}

/// Two constant emitters are the sum of both: seen directly, and on a white floor, which returns what arrives.
#[test]
fn two_skies_are_their_sum() {
    let mut scene = floor(-1.0, places()[0], "constant");
    scene.boundaries.clear();
    scene.sensor.medium = None;
    scene.emitters =
        vec![Emitter::Constant { radiance: Rgb::splat(0.25) }, Emitter::Constant { radiance: Rgb::splat(1.5) }];
    for integrator in BOTH {
        let (mean, error) = mean_and_error(&rendered(&scene, &Options { integrator, ..options() }).image.pixels);
        assert!((mean - 0.8 * 1.75).abs() <= 5.0 * error + 1e-6, "{integrator}: {mean} ± {error}");
    }
}

/// A sun that is a point light a real distance away: a closed room stays dark. Rays used to start 35 units beside their surface for it.
#[test]
fn no_light_leaks_into_a_closed_room() {
    let mut scene = empty_scene(8, 16, 0.7);
    scene.sensor.world_from_camera = DMat4::from_translation(dvec3(2.0, 2.0, 2.0));
    let bsdf = Bsdf::lambertian(Rgb::ONE, Rgb::ONE);
    scene.surfaces.push(Surface {
        triangles: cuboid(Vec3::ZERO, Vec3::splat(5.0)),
        bsdf,
        radiance: None,
        ..Surface::default()
    });
    scene.emitters.push(Emitter::Point { position: dvec3(0.0, 1.5e11, 0.0), intensity: Rgb::splat(1e23) });
    for method in [Method::NONE, Method::default()] {
        let image = rendered(&scene, &Options { method, ..options() }).image;
        assert!(image.pixels.iter().all(|&p| p == Rgb::ZERO), "{method}");
    }
}

/// Fog, camera and far lights do not coarsen the voxels of what can occlude.
#[test]
fn grids_cover_the_occluders_and_lights_near_them() {
    let mut scene = builtin("cbox_vol2", &[]);
    let occluders = Bounds::of_triangles(scene.surfaces.iter().flat_map(|s| &s.triangles));
    scene.emitters.push(Emitter::Point { position: dvec3(1e9, 0.0, 0.0), intensity: Rgb::ONE });
    scene.emitters.push(Emitter::Point { position: dvec3(278.0, 600.0, 278.0), intensity: Rgb::ONE });
    let world = World::new(&scene);
    assert_eq!(world.occluder_bounds, occluders.with(dvec3(278.0, 600.0, 278.0)));
    assert!(world.bounds.contains(dvec3(1e9, 0.0, 0.0)) && world.bounds.contains(dvec3(278.0, 273.0, -789.0)));
}

/// Planes that are absurdly far away clip nothing, and do not overflow.
#[test]
fn a_far_plane_beyond_all_measure() {
    let mut scene = builtin("cbox_vol4", &[("width", "12"), ("height", "12"), ("spp", "2")]);
    let images: Vec<_> = [1e9, 1e150, 1e154, 1e300, f64::MAX]
        .into_iter()
        .map(|far_clip| {
            scene.sensor.far_clip = far_clip;
            rendered(&scene, &options()).image.pixels
        })
        .collect();
    assert!(images.iter().all(|image| *image == images[0]));
}

/// A far plane ends a camera ray only in the medium in which it starts, as in Mitsuba 3: here the sky is seen through a slab of fog.
#[test]
fn fog_before_the_far_plane_is_followed_to_the_sky() {
    let mut scene = empty_scene(4, 4, 1e-6);
    scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
    let fog = add_medium(&mut scene, 1.0, 0.0, Phase::Isotropic);
    common::add_fog(&mut scene, vec3(-5.0, -5.0, 2.0), vec3(5.0, 5.0, 3.0), fog);
    scene.sensor.far_clip = 2.5;
    let o = Options { integrator: Integrator::raymarch(1), ..options() };
    let (mean, _) = mean_and_error(&rendered(&scene, &o).image.pixels);
    assert!((mean - (-1.0_f64).exp()).abs() < 1e-6, "{mean}");
}

/// Stops after so many looks.
struct StopAfter(AtomicU32);

impl Progress for StopAfter {
    fn phase(&self, _: &str) {}
    fn work_total(&self, _: u64) {}
    fn work_done(&self, _: u64) {}
    fn cancelled(&self) -> bool {
        self.0.fetch_sub(1, Ordering::Relaxed) == 0 || self.0.load(Ordering::Relaxed) > u32::MAX / 2
    }
}

/// A path between white walls that roulette may not end for a long time, and a segment of very many samples, look whether to stop.
#[test]
fn endless_paths_can_be_stopped() {
    let mut scene = empty_scene(1, 1, 0.7);
    let bsdf = Bsdf::lambertian(Rgb::ONE, Rgb::ONE);
    scene.surfaces.push(Surface {
        triangles: cuboid(Vec3::NEG_ONE, Vec3::ONE),
        bsdf,
        radiance: None,
        ..Surface::default()
    });
    scene.emitters.push(Emitter::Point { position: dvec3(0.5, 0.5, 0.5), intensity: Rgb::ONE });
    let fog = add_medium(&mut scene, 1.0, 1.0, Phase::Isotropic);
    common::add_fog(&mut scene, Vec3::NEG_ONE, Vec3::ONE, fog);
    scene.sensor.medium = Some(fog);
    scene.integrator.rr_depth = u32::MAX;
    let prepared = PreparedScene::new(scene, &PrepareOptions::default(), &Quiet).expect("a sound scene");
    for integrator in [Integrator::Volpath, Integrator::raymarch(u32::MAX)] {
        let o = RenderOptions { integrator, spp: Some(1 << 20), ..RenderOptions::default() };
        let stopped = prepared.render(&o, &StopAfter(AtomicU32::new(3)));
        assert!(matches!(stopped, Err(RenderError::Cancelled)), "{integrator}");
    }
}

/// A default voxel size that does not fit is replaced with a note; one that was asked for is an error.
#[test]
fn a_default_voxel_size_is_never_the_error() {
    let mut scene = builtin("cbox_vol2", &[("width", "4"), ("height", "4"), ("spp", "1")]);
    let shift = 3.0e8;
    for t in scene.surfaces.iter_mut().flat_map(|s| &mut s.triangles) {
        t.vertices.iter_mut().for_each(|v| v.x += shift);
    }
    let prepare = |voxel_size| {
        let options = PrepareOptions { voxel_size, ..PrepareOptions::with_method(Method::default()) };
        PreparedScene::new(scene.clone(), &options, &Quiet)
    };
    let prepared = prepare(None).expect("a coarser one is taken");
    assert!(!prepared.notes().is_empty(), "without a note");
    assert!(prepare(Some(4.0)).is_err());
}
