//! The room that most of these tests are set in, and what is compared of its pictures.

use glam::{DMat4, DVec3, Vec3, dvec3, vec3};
use vdf::{
    geometry::Triangle,
    render::Integrator,
    scene::{Bsdf, Emitter, Phase, Rgb, Scene, Surface},
    visibility::Method,
};

use crate::common::{Options, add_fog, add_medium, cuboid, empty_scene, options, rendered};

pub(crate) const BOTH: [Integrator; 2] = [Integrator::Volpath, Integrator::raymarch(4)];

pub(crate) const GREY: Bsdf = Bsdf::lambertian(Rgb::splat(FRONT), Rgb::splat(BACK));
/// The reflectances of its sides.
pub(crate) const FRONT: f32 = 0.6;
pub(crate) const BACK: f32 = 0.4;

pub(crate) fn bits(pixels: &[Rgb]) -> Vec<[u32; 3]> {
    pixels.iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

pub(crate) fn surface(triangles: Vec<Triangle>) -> Surface {
    Surface { triangles, bsdf: GREY, radiance: None, ..Surface::default() }
}

/// A closed room from 0 to 8, open only in being seen from inside, with a block on whose corner voxels of size 1 meet, and
/// fog between 1 and 7 in every direction. Camera in a corner, in the fog.
pub(crate) fn room(lights: &[DVec3]) -> Scene {
    let mut scene = empty_scene(12, 4, 0.8);
    scene.surfaces.push(surface(cuboid(Vec3::ZERO, Vec3::splat(8.0))));
    scene.surfaces.push(surface(cuboid(vec3(3.0, 0.0, 4.0), vec3(5.0, 3.0, 6.0))));
    let fog = add_medium(&mut scene, 0.15, 0.8, Phase::HenyeyGreenstein { g: 0.4 });
    add_fog(&mut scene, Vec3::splat(1.0), Vec3::splat(7.0), fog);
    scene.sensor.medium = Some(fog);
    scene.sensor.world_from_camera = DMat4::from_translation(dvec3(4.0, 4.0, 1.5));
    scene.emitters = lights.iter().map(|&position| Emitter::Point { position, intensity: Rgb::splat(9.0) }).collect();
    scene
}

/// Renders by both integrators, without and with methods; all images are equal, and returned for each integrator.
#[track_caller]
pub(crate) fn same_for_all_methods(name: &str, scene: &Scene, voxel_size: f64) -> [Vec<Rgb>; 2] {
    BOTH.map(|integrator| {
        let render = |method| {
            let o = Options { method, integrator, voxel_size: Some(voxel_size), ..options() };
            rendered(scene, &o).image.pixels
        };
        let reference = render(Method::NONE);
        for method in ["amr-sn", "dsz", "dual-xsn"] {
            let method = method.parse().expect("a method");
            assert!(bits(&render(method)) == bits(&reference), "{name}, {integrator:?}, {method}");
        }
        reference
    })
}

/// A wall from (−8, −8) to (8, 8) at this z.
pub(crate) fn wall(z: f32) -> Surface {
    let [a, b, c, d] = [[-8.0, -8.0], [8.0, -8.0], [8.0, 8.0], [-8.0, 8.0]].map(|[x, y]: [f32; 2]| vec3(x, y, z));
    surface(vec![Triangle::new(a, b, c), Triangle::new(a, c, d)])
}
