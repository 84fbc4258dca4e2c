//! Triangles that try to be missed, hit twice or to face nowhere.

use glam::{DMat4, DVec3, dvec3, vec3};
use vdf::{
    geometry::{Bvh, Segment, Triangle, intersect_exact},
    render::{Sampler, World},
    scene::{Bsdf, Emitter, Projection, Rgb, Surface},
};

use crate::{
    common::{empty_scene, mean_and_error},
    room::{GREY, bits, room, same_for_all_methods, surface, wall},
};

/// Rays that graze a wall at angles down to 10⁻¹²: what is hit, and where, against exact arithmetic; and renders from within a wall's plane.
#[test]
fn grazing_rays_along_walls() {
    let triangles = wall(0.0).triangles;
    let bvh = Bvh::new(&triangles);
    for i in 0..4000 {
        let mut u = Sampler::new(73, i, 0, 0);
        let angle = 10.0_f64.powf(-12.0 * u.next_1d());
        let p = dvec3(-7.5, 2.0 * u.next_1d() - 1.0, angle * 15.0 * u.next_1d());
        let q = dvec3(7.5, 2.0 * u.next_1d() - 1.0, p.z - angle * 15.0);
        let s = Segment::new(p, q);
        let exact = triangles.iter().any(|t| intersect_exact(&s, t).is_some());
        let hit = bvh.intersect(&s);
        assert_eq!(hit.is_some(), exact, "{s:?}");
        if let Some(hit) = hit {
            let expected = p.z / (p.z - q.z);
            // 2¹¹um³/det along the ray, with m ≤ 16 and det = 256·|d_z|/|d_x|; and the rounding of p.z and of the ends themselves.
            let allowed = 2048.0 * f64::EPSILON / 2.0 * 4096.0 / (256.0 * angle) / 15.0 + 1e-15;
            assert!((hit.t - expected).abs() < allowed, "{s:?}: {} for {expected}", hit.t);
        }
    }
    // In the plane of a wall, and a little beside it, looking along it.
    for y in [0.0, 1e-300, 1e-15, 1e-9, -1e-9, 8.0] {
        let mut scene = room(&[dvec3(2.0, 6.0, 3.0)]);
        scene.sensor.world_from_camera = DMat4::from_translation(dvec3(4.0, y, 1.5));
        scene.sensor.medium = None;
        scene.sensor.projection =
            Projection::Perspective { tan_half_fov_x: 1e-9, lens: None, principal_point: [0.0; 2] };
        same_for_all_methods(&format!("camera at height {y}"), &scene, 1.0);
    }
}

/// Triangles without area change no bit, wherever they are; nor do doubles of others. As emitters they emit nothing.
#[test]
fn degenerate_and_duplicated_triangles() {
    let mut scene = room(&[dvec3(2.0, 6.0, 3.0)]);
    scene.surfaces[1].radiance = Some(Rgb::splat(0.2).into());
    scene.emitters.push(Emitter::Area { surface: 1 });
    let reference = same_for_all_methods("without", &scene, 1.0);
    let points =
        [vec3(2.0, 2.0, 2.0), vec3(4.0, 4.0, 1.5), vec3(3.0, 3.0, 4.0), vec3(0.0, 8.0, 8.0), vec3(2.0, 6.0, 3.0)];
    let degenerate: Vec<_> = points
        .iter()
        .flat_map(|&a| points.iter().flat_map(move |&b| [Triangle::new(a, b, a), Triangle::new(a, (a + b) * 0.5, b)]))
        .filter(|t| t.area_normal() == DVec3::ZERO)
        .collect();
    assert!(degenerate.len() > 30);
    scene.surfaces.iter_mut().for_each(|s| s.triangles.extend(&degenerate));
    scene.boundaries[0].triangles.extend(&degenerate);
    for (a, b) in same_for_all_methods("with triangles without area", &scene, 1.0).iter().zip(&reference) {
        assert!(bits(a) == bits(b), "triangles without area change the image");
    }
    // Of two triangles at one place the first counts.
    let doubles: Vec<_> = scene.surfaces[0].triangles.clone();
    scene.surfaces.push(Surface {
        triangles: doubles,
        bsdf: Bsdf::lambertian(Rgb::ZERO, Rgb::ONE),
        radiance: None,
        ..Surface::default()
    });
    for (a, b) in same_for_all_methods("with doubles", &scene, 1.0).iter().zip(&reference) {
        assert!(bits(a) == bits(b), "doubles change the image");
    }
    // An emitter of which nothing is left.
    let mut dark = room(&[]);
    dark.surfaces.push(Surface {
        triangles: degenerate,
        bsdf: GREY,
        radiance: Some(Rgb::ONE.into()),
        ..Surface::default()
    });
    dark.emitters.push(Emitter::Area { surface: 2 });
    for pixels in same_for_all_methods("an emitter without area", &dark, 1.0) {
        assert!(pixels.iter().all(|&p| p == Rgb::ZERO));
    }
}

/// A floor cut into slivers, a million times as long as wide and thinner, is the same floor, to within the noise.
#[test]
fn slivers() {
    let strip = |cuts: &[f32]| {
        let mut triangles = vec![];
        for w in cuts.windows(2) {
            let [a, b, c, d] = [vec3(1.0, 0.5, w[0]), vec3(7.0, 0.5, w[0]), vec3(7.0, 0.5, w[1]), vec3(1.0, 0.5, w[1])];
            triangles.push(Triangle::new(a, c, b));
            triangles.push(Triangle::new(a, d, c));
        }
        triangles
    };
    let thin: Vec<f32> = (0..200_u8).map(|i| 2.0 + f32::from(i) * 6e-6).collect();
    let cuts: Vec<f32> = [vec![1.0], thin, vec![2.5, 2.5_f32.next_up(), 4.0, 7.0]].concat();
    let mut scene = room(&[dvec3(2.0, 6.0, 3.0)]);
    scene.sample_count = 32;
    let mut emitting = Surface {
        triangles: strip(&[1.0, 7.0]),
        bsdf: GREY,
        radiance: Some(Rgb::splat(0.3).into()),
        ..Surface::default()
    };
    scene.surfaces.push(emitting.clone());
    scene.emitters.push(Emitter::Area { surface: 2 });
    let whole = same_for_all_methods("one floor", &scene, 1.0);
    emitting.triangles = strip(&cuts);
    scene.surfaces[2] = emitting;
    let cut = same_for_all_methods("slivers", &scene, 1.0);
    for (a, b) in whole.iter().zip(&cut) {
        let sum = |p: &[Rgb]| p.iter().map(|p| f64::from(p.x)).sum::<f64>();
        let error = mean_and_error(a).1 * a.len() as f64;
        // The emitter's points are drawn in another order, so only the noise can agree.
        assert!((sum(a) - sum(b)).abs() < 5.0 * std::f64::consts::SQRT_2 * error, "{} and {}", sum(a), sum(b));
    }
}

/// Exact predicates hit a sliver so thin that its normal rounds to zero; it faces whoever hits it, instead of nowhere.
#[test]
fn a_hit_on_a_triangle_whose_normal_is_rounded_away() {
    let tiny = 2.0_f32.powi(-60);
    let sliver = Triangle::new(
        vec3(tiny, 0.0, 0.0),
        vec3(1.0, 1.0, 0.0),
        vec3(2.0 + 2.0_f32.powi(-22), 2.0 + 2.0_f32.powi(-22), 0.0),
    );
    assert_eq!(sliver.area_normal(), DVec3::ZERO);
    let mut scene = empty_scene(4, 4, 1e-300);
    scene.surfaces.push(surface(vec![sliver]));
    scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
    let world = World::new(&scene);
    let hit =
        world.bvh.intersect(&Segment::new(dvec3(1.5, 1.5, -1.0), dvec3(1.5, 1.5, 1.0))).expect("it lies on an edge");
    let point = world.surface_point(&hit, DVec3::Z);
    assert_eq!(point.normal, -DVec3::Z);
    assert!(point.point.is_finite());
    scene.sensor.world_from_camera = DMat4::from_translation(dvec3(1.5, 1.5, -1.0));
    same_for_all_methods("a sliver without a normal", &scene, 0.1);
}
