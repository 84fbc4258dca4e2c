//! Other units, other places, and places for lights where they should not be.

use glam::{DMat4, DVec3, dvec3};
use vdf::{
    render::RenderError,
    scene::{Emitter, Rgb, Scene},
    visibility::VisibilityError,
};

use crate::{
    common::{self, Options, builtin, empty_scene, mean_and_error, options, rendered},
    room::{BOTH, FRONT, bits, room, same_for_all_methods, wall},
};

/// The scene in other units and elsewhere: x becomes scale·x + shift. The picture is the same.
fn moved(scene: &Scene, scale: f64, shift: DVec3) -> Scene {
    let mut scene = scene.clone();
    let map = |p: DVec3| p * scale + shift;
    let all = scene.surfaces.iter_mut().map(|s| &mut s.triangles);
    for t in all.chain(scene.boundaries.iter_mut().map(|b| &mut b.triangles)).flatten() {
        t.vertices = t.vertices.map(|v| map(v.as_dvec3()).as_vec3());
    }
    scene.media.iter_mut().for_each(|m| m.sigma_t = (m.sigma_t.grey().expect("plain fog") / scale).into());
    for e in &mut scene.emitters {
        if let Emitter::Point { position, intensity } = e {
            *position = map(*position);
            *intensity *= (scale * scale) as f32;
        }
    }
    let camera = &mut scene.sensor;
    camera.world_from_camera.w_axis = map(camera.world_from_camera.w_axis.truncate()).extend(1.0);
    (camera.near_clip, camera.far_clip) = (camera.near_clip * scale, camera.far_clip * scale);
    scene
}

/// A unit that is a power of two changes no bit, from 10⁻⁶ to 10⁶ and far beyond what anyone would call a unit; with any method.
#[test]
fn powers_of_two_as_units_change_no_bit() {
    let small = [("width", "16"), ("height", "16"), ("spp", "2")];
    let mut sky = room(&[dvec3(2.0, 6.0, 3.0)]);
    sky.emitters.push(Emitter::Area { surface: 1 });
    sky.surfaces[1].radiance = Some(Rgb::splat(0.3).into());
    for (name, scene, voxel_size) in [("cbox_vol2", builtin("cbox_vol2", &small), 16.0), ("room", sky, 1.0)] {
        for integrator in BOTH {
            let render = |scale: f64, method: &str| {
                let method = method.parse().expect("a method");
                let o = Options { method, integrator, voxel_size: Some(voxel_size * scale), ..options() };
                bits(&rendered(&moved(&scene, scale, DVec3::ZERO), &o).image.pixels)
            };
            let reference = render(1.0, "none");
            for exponent in [-30, -20, -1, 7, 20, 26] {
                for method in ["none", "amr-sn", "dual-xsn"] {
                    let image = render(2.0_f64.powi(exponent), method);
                    assert!(image == reference, "{name}, {integrator:?}, {method}, unit 2^{exponent}");
                }
            }
        }
    }
}

/// Mean over all pixels and channels, and its standard error over seeds.
fn mean_over_seeds(scene: &Scene, first_seed: u64) -> (f64, f64) {
    let means: Vec<_> = (first_seed..first_seed + 24)
        .map(|seed| {
            let pixels = rendered(scene, &Options { seed: Some(seed), ..options() }).image.pixels;
            Rgb::splat((pixels.iter().map(|p| f64::from(p.element_sum())).sum::<f64>() / pixels.len() as f64) as f32)
        })
        .collect();
    mean_and_error(&means)
}

/// Units that are powers of ten, where every vertex rounds anew, and places up to 10⁷ away, where the vertices are whole numbers and
/// positions lose seven digits. Means with other seeds agree within 5 standard errors of their difference. With the
/// same seed paths stay close, so that far less shows: the means of the images agree to 10⁻³.
#[test]
fn units_and_places_do_not_change_the_picture() {
    // Large enough for voxels of 8, which are the finest beside 10⁷.
    let scene = moved(&room(&[dvec3(2.0, 6.0, 3.0)]), 64.0, DVec3::ZERO);
    let here = mean_over_seeds(&scene, 0);
    let whole = |image: &[Rgb]| image.iter().map(|p| f64::from(p.element_sum())).sum::<f64>();
    for (scale, shift) in [
        (1e-6, DVec3::ZERO),
        (1e6, DVec3::ZERO),
        (1.0, DVec3::splat(1e4)),
        (1.0, dvec3(1e7, -1e7, 1e7)),
        (1.0, dvec3(0.0, 1e7, 0.0)),
        (1e-6, DVec3::splat(1e-3)),
    ] {
        let there = moved(&scene, scale, shift);
        let (mean, error) = mean_over_seeds(&there, 100);
        let z = (mean - here.0) / here.1.hypot(error);
        assert!(z.abs() < 5.0, "×{scale} + {shift}: {mean} ± {error}, here {here:?}");
        for integrator in BOTH {
            let o = Options { integrator, spp: Some(16), ..options() };
            let (a, b) = (rendered(&scene, &o).image.pixels, rendered(&there, &o).image.pixels);
            let off = whole(&b) / whole(&a) - 1.0;
            assert!(off.abs() < 1e-3, "×{scale} + {shift}, {integrator:?}: off by {off}");
        }
        same_for_all_methods(&format!("×{scale} + {shift}"), &there, 8.0 * scale);
    }
}

/// Voxels finer than the vertices can be placed are an error that names the finest ones.
#[test]
fn exhausted_precision_is_an_error() {
    let there = moved(&room(&[dvec3(2.0, 6.0, 3.0)]), 64.0, DVec3::splat(1e7));
    let o = Options { method: "amr-sn".parse().expect("a method"), voxel_size: Some(1.0), ..options() };
    let Err(RenderError::Visibility(VisibilityError::Voxel(error))) = common::render(&there, &o) else {
        panic!("no error")
    };
    assert!(error.to_string().contains('4'), "{error}");
}

/// Point lights where they should not be: on corners, edges and faces of voxels, beside and on surfaces, on vertices, at the camera, on its
/// axis, outside the fog, outside everything. All methods agree and nothing is refused.
#[test]
fn lights_in_odd_places() {
    let eps = 1e-6;
    for light in [
        dvec3(4.0, 5.0, 3.0),
        dvec3(4.0, 5.5, 3.0),
        dvec3(4.0, 5.5, 3.5),
        dvec3(0.0, 4.0, 4.0),
        dvec3(eps, 4.0, 4.0),
        dvec3(-eps, 4.0, 4.0),
        dvec3(0.0, 0.0, 0.0),
        dvec3(eps, eps, eps),
        dvec3(3.0, 3.0, 4.0),
        dvec3(3.0 - eps, 3.0 + eps, 4.0 - eps),
        dvec3(4.0, 3.0 + eps, 5.0),
        dvec3(4.0, 2.0, 5.0),
        dvec3(4.0, 4.0, 1.5),
        dvec3(4.0, 4.0, 1.5 + eps),
        dvec3(4.0, 4.0, 3.0),
        dvec3(1.0, 1.0, 1.0),
        dvec3(1.0, 4.0, 4.0),
        dvec3(1.0 - eps, 4.0, 4.0),
        dvec3(0.5, 7.5, 0.5),
        dvec3(40.0, 4.0, 4.0),
        dvec3(1e7, 1e7, 1e7),
    ] {
        // Voxels beside coordinates of 10⁷ must be larger than the whole room.
        let unit = if light.x > 1e3 { 1e6 } else { 1.0 };
        same_for_all_methods(&format!("light at {light}"), &room(&[light]), unit);
        same_for_all_methods(&format!("two lights at {light}"), &room(&[light, light]), 0.7 * unit);
    }
}

/// The camera at (x, 0, 1) looks along −Z at a wall at z = 0 that a light at this height above the origin lights.
fn lit_from_height(height: f64, x: f64) -> f64 {
    let mut scene = empty_scene(4, 4, 1e-9);
    scene.surfaces.push(wall(0.0));
    scene.emitters.push(Emitter::Point { position: dvec3(0.0, 0.0, height), intensity: Rgb::ONE });
    scene.sensor.world_from_camera =
        DMat4::from_translation(dvec3(x, 0.0, 1.0)) * DMat4::from_rotation_y(std::f64::consts::PI);
    scene.integrator.max_depth = Some(2);
    let images = same_for_all_methods(&format!("light at height {height}"), &scene, 1.0);
    assert_eq!(bits(&images[0]), bits(&images[1]));
    mean_and_error(&images[0]).0
}

/// A light close above a wall: I·h/r³ on the wall beside it. The point that is lit was lifted by 2⁻³² of the largest coordinate, here
/// 8·2⁻³² = 2·10⁻⁹, so h is too small by this. A light on the wall itself lights nothing of it.
#[test]
fn a_light_close_to_a_wall() {
    let lift = 8.0 / 4_294_967_296.0;
    for height in [1e-6, 1e-3, 0.5_f64] {
        for x in [0.0, height, 1.0, 7.0] {
            let exact = f64::from(FRONT) / std::f64::consts::PI * height / height.hypot(x).powi(3);
            let found = lit_from_height(height, x);
            // At x = 0 the distance is too small as well: 1/h² changes by twice as much. Film positions spread over 10⁻⁹.
            let allowed = 2.1 * lift / height + 1e-6 + 8e-9 / height;
            assert!((found / exact - 1.0).abs() < allowed, "height {height}, x = {x}: {found}, expected {exact}");
        }
    }
    assert_eq!(lit_from_height(0.0, 1.0), 0.0);
    assert_eq!(lit_from_height(-1e-6, 1.0), 0.0);
}
