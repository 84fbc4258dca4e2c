//! A proof is never wrong: segments of all kinds, and hard ones above all, against a loop over all triangles.
//!
//! `VDF_SEGMENTS=10000000 cargo test --release --test soundness -- --nocapture` is the long run (segments per scene), which also tries the
//! finer voxels; CI runs a small one, of the same scenes and classes of segments.
//! Any scene file can be tried with `vdf verify`.

mod common;

use common::{builtin, cuboid, empty_scene};
use glam::{DVec3, Vec3, dvec3, vec3};
use vdf::{
    geometry::Triangle,
    lab::verify::{VerifyOptions, VerifyReport, verify},
    render::Quiet,
    scene::{Bsdf, Emitter, Rgb, Scene, Surface},
};

/// Runs all methods on a scene; none may be wrong. Voxels of the sizes `finer` are for the long run only: nearly all time would go into
/// building and validating their structures.
fn sound(name: &str, scene: &Scene, voxel_sizes: &[f64], finer: &[f64]) -> VerifyReport {
    let long = std::env::var("VDF_SEGMENTS").ok().map(|n| n.parse().expect("VDF_SEGMENTS is a number"));
    let voxel_sizes = [voxel_sizes, if long.is_some() { finer } else { &[] }].concat();
    let options = VerifyOptions { voxel_sizes, segments: long.unwrap_or(100_000), ..VerifyOptions::default() };
    let report = verify(scene.clone(), &options, &Quiet).expect("sound options");
    println!("{name}\n{report}\n");
    assert!(report.is_sound(), "{name}:\n{report}");
    report
}

/// A scene of these triangles and point lights.
fn scene(triangles: Vec<Triangle>, lights: &[DVec3]) -> Scene {
    let mut scene = empty_scene(1, 1, 1.0);
    let bsdf = Bsdf::lambertian(Rgb::ONE, Rgb::ONE);
    scene.surfaces.push(Surface { triangles, bsdf, radiance: None, ..Surface::default() });
    scene.emitters = lights.iter().map(|&position| Emitter::Point { position, intensity: Rgb::ONE }).collect();
    scene
}

/// Hardly anything proved would be hardly anything tested.
fn much_proved(name: &str, report: &VerifyReport) {
    for m in &report.methods {
        assert!(m.proofs * 20 > report.total.segments, "{name}: hardly anything was proved by {}\n{report}", m.method);
    }
}

#[test]
fn builtin_scenes() {
    for name in ["cbox_vol2", "cbox_vol3", "cbox_vol4", "cbox_vol6"] {
        much_proved(name, &sound(name, &builtin(name, &[]), &[16.0, 100.0], &[4.0, 8.0]));
    }
}

/// The light is an occluder, and shares its voxels with the ceiling.
#[test]
fn a_light_in_the_ceiling() {
    sound("ceiling light", &builtin("cbox_light", &[]), &[12.0, 100.0], &[4.0, 8.0]);
}

/// Slopes whose planes go through corners of voxels, exactly but for rounding: only the dilation decides on which side a corner is.
/// No binary fraction equals the voxel sizes.
fn slopes(offset: f32) -> Scene {
    let mut triangles = Vec::new();
    for i in 0..24_u8 {
        let o = vec3(f32::from(i % 3) * 14.0, f32::from(i / 3 % 3) * 14.0, f32::from(i / 9) * 14.0) + offset;
        let [a, b, c] = [[7.0, 0.0, 0.0], [0.0, 7.0, 0.0], [0.0, f32::from(i % 2) * 3.0, 7.0]].map(Vec3::from);
        triangles.push(Triangle::new(o + a, o + b, o + c));
    }
    let o = DVec3::splat(offset.into());
    scene(triangles, &[o + dvec3(10.0, 10.0, 10.0), o + dvec3(38.5, 3.0, 21.0), o])
}

#[test]
fn slopes_through_corners_of_voxels() {
    much_proved("slopes", &sound("slopes", &slopes(0.0), &[0.7, 1.4, 7.0 / 3.0], &[0.35]));
}

/// At 2¹⁹ a single-precision step is 1/16: the coordinates are as large as they may be for such voxels.
#[test]
fn slopes_far_from_the_origin() {
    for offset in [524_288.0, -524_288.0] {
        much_proved("far slopes", &sound("far slopes", &slopes(offset), &[0.7, 1.4, 7.0 / 3.0], &[0.35]));
    }
}

/// Longer than the largest stored distance in voxels, with a thin wall across it here and there.
#[test]
fn a_corridor_longer_than_distances_can_say() {
    let length = 1200.0;
    let mut triangles = Vec::new();
    for x in [0.0, 300.0, 830.0, length] {
        // The walls leave a gap above.
        triangles.extend(cuboid(vec3(x, 0.0, 0.0), vec3(x + 0.25, 2.5, 4.0)));
    }
    let lights = [dvec3(5.0, 2.0, 2.0), dvec3(299.0, 3.5, 0.5), dvec3(600.0, 1.0, 3.0)];
    sound("corridor", &scene(triangles, &lights), &[1.0, 0.5], &[]);
}

#[test]
fn degenerate_scenes() {
    let lights = [DVec3::ZERO, dvec3(10.0, 10.0, 10.0)];
    let empty = sound("empty", &scene(vec![], &lights), &[1.0, 3.0], &[]);
    assert_eq!(empty.total.proved, empty.total.segments, "nothing occludes");

    let floor = |z: f32| {
        let v = |x, y| vec3(x, y, z);
        [Triangle::new(v(0.0, 0.0), v(9.0, 0.0), v(9.0, 9.0)), Triangle::new(v(0.0, 0.0), v(9.0, 9.0), v(-0.0, 9.0))]
    };
    // All in one plane: the grid is one voxel thick, and all of it is occupied.
    sound("flat", &scene(floor(0.0).to_vec(), &[dvec3(3.0, 4.0, 0.0)]), &[1.0, 0.3], &[]);
    // One row of voxels.
    let needle = Triangle::new(vec3(0.0, 0.0, 0.0), vec3(3.0, 1e-6, 0.0), vec3(3.0, -1e-6, 0.0));
    sound("needle", &scene(vec![needle], &[dvec3(100.0, 0.0, 0.0)]), &[1.0, 0.3], &[]);
    // Lights in occupied voxels, and right on an occluder.
    let at_walls = [dvec3(4.5, 4.5, 1e-9), dvec3(4.5, 4.5, 0.0), dvec3(0.0, 0.0, 5.0), dvec3(9.0, 9.0, 9.0)];
    sound("lights at walls", &scene(floor(0.0).to_vec(), &at_walls), &[1.0, 0.3], &[]);
}

#[test]
fn a_mesh_goes_partly_through_the_loop() {
    let mut triangles = Vec::new();
    for i in 0..600_u16 {
        let a = f32::from(i) * 2.4;
        let p = vec3(a.cos() * (1.0 + a * 0.01), a.sin() * (1.0 + a * 0.01), a * 0.01);
        triangles.push(Triangle::new(p, p + vec3(0.3, 0.1, 0.0), p + vec3(0.0, 0.2, 0.3)));
    }
    let report = sound("mesh", &scene(triangles, &[dvec3(0.0, 0.0, 7.0)]), &[0.5], &[0.25]);
    assert!(report.checks.proved_by_loop > 1000 && report.checks.proved_by_loop < report.total.proved);
}
