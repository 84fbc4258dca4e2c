//! Scenes that try to make numbers fail: hard cases 36 to 44 of the project's list (in `docs/numerics.md`), odd units, places and lights,
//! slivers, grazing rays, extreme media. No sample may ever be refused: not finite, or negative.
//!
//! Statistical comparisons allow 5 standard errors, estimated from the images: false alarm 6·10⁻⁷ each, seeds fixed. Precision itself is
//! tested in `precision.rs`.

mod common;

use common::{add_fog, add_medium, builtin, cuboid, empty_scene, integrate, mean_and_error, options, rendered};
use glam::{DMat4, DVec3, Vec3, dvec3, vec3};
use vdf::render::{
    Flight, IntegratorKind, Media, Method, RenderError, RenderOptions, Rgb, Sampler, Triangle, World,
    geometry::{Bvh, Segment, intersect_exact},
    render,
    scene::{Boundary, Bsdf, Emitter, IntegratorSettings, Medium, MediumId, Phase, Scene, Surface},
};

const BOTH: [IntegratorKind; 2] = [IntegratorKind::Volpath, IntegratorKind::Raymarch { samples_per_segment: 4 }];

const GREY: Bsdf = Bsdf { front: Rgb::splat(0.6), back: Rgb::splat(0.4) };

fn bits(pixels: &[Rgb]) -> Vec<[u32; 3]> {
    pixels.iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

fn surface(triangles: Vec<Triangle>) -> Surface {
    Surface { triangles, bsdf: GREY, radiance: None }
}

/// A closed room from 0 to 8, open only in being seen from inside, with a block on whose corner voxels of size 1 meet, and
/// fog between 1 and 7 in every direction. Camera in a corner, in the fog.
fn room(lights: &[DVec3]) -> Scene {
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
fn same_for_all_methods(name: &str, scene: &Scene, voxel_size: f64) -> [Vec<Rgb>; 2] {
    BOTH.map(|integrator| {
        let render = |method| {
            let o = RenderOptions { method, integrator, voxel_size: Some(voxel_size), ..options() };
            rendered(scene, &o).image.pixels
        };
        let reference = render(Method::None);
        for method in ["amr-sn", "dsz", "dual-xsn"] {
            let method = method.parse().expect("a method");
            assert!(bits(&render(method)) == bits(&reference), "{name}, {integrator:?}, {method}");
        }
        reference
    })
}

/// The scene in other units and elsewhere: x becomes scale·x + shift. The picture is the same.
fn moved(scene: &Scene, scale: f64, shift: DVec3) -> Scene {
    let mut scene = scene.clone();
    let map = |p: DVec3| p * scale + shift;
    let all = scene.surfaces.iter_mut().map(|s| &mut s.triangles);
    for t in all.chain(scene.boundaries.iter_mut().map(|b| &mut b.triangles)).flatten() {
        t.vertices = t.vertices.map(|v| map(v.as_dvec3()).as_vec3());
    }
    scene.media.iter_mut().for_each(|m| m.sigma_t /= scale);
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
    sky.surfaces[1].radiance = Some(Rgb::splat(0.3));
    for (name, scene, voxel_size) in [("cbox_vol2", builtin("cbox_vol2", &small), 16.0), ("room", sky, 1.0)] {
        for integrator in BOTH {
            let render = |scale: f64, method: &str| {
                let method = method.parse().expect("a method");
                let o = RenderOptions { method, integrator, voxel_size: Some(voxel_size * scale), ..options() };
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
            let pixels = rendered(scene, &RenderOptions { seed: Some(seed), ..options() }).image.pixels;
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
            let o = RenderOptions { integrator, spp: Some(16), ..options() };
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
    let o = RenderOptions { method: "amr-sn".parse().expect("a method"), voxel_size: Some(1.0), ..options() };
    let Err(RenderError::Voxel(error)) = render(&there, &o, &common::Quiet) else { panic!("no error") };
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

/// A wall from (−8, −8) to (8, 8) at this z.
fn wall(z: f32) -> Surface {
    let [a, b, c, d] = [[-8.0, -8.0], [8.0, -8.0], [8.0, 8.0], [-8.0, 8.0]].map(|[x, y]: [f32; 2]| vec3(x, y, z));
    surface(vec![Triangle::new(a, b, c), Triangle::new(a, c, d)])
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
            let exact = f64::from(GREY.front.x) / std::f64::consts::PI * height / height.hypot(x).powi(3);
            let found = lit_from_height(height, x);
            // At x = 0 the distance is too small as well: 1/h² changes by twice as much. Film positions spread over 10⁻⁹.
            let allowed = 2.1 * lift / height + 1e-6 + 8e-9 / height;
            assert!((found / exact - 1.0).abs() < allowed, "height {height}, x = {x}: {found}, expected {exact}");
        }
    }
    assert_eq!(lit_from_height(0.0, 1.0), 0.0);
    assert_eq!(lit_from_height(-1e-6, 1.0), 0.0);
}

/// The airlight integral along +Z with any transmittance towards the light.
fn airlight(scene: &Scene, z: (f64, f64)) -> f64 {
    let media = Media::new(&scene.media, &scene.boundaries);
    let Emitter::Point { position, intensity } = scene.emitters[0] else { panic!("a point light") };
    let Medium { sigma_t, albedo, phase } = scene.media[0];
    let outside = Segment::new(dvec3(0.0, 0.0, -99.0), DVec3::ZERO);
    assert_eq!(media.transmittance(&outside, None), 1.0, "the camera is in vacuum");
    let f = |t: f64| {
        let p = dvec3(0.0, 0.0, t);
        let d = (position - p).normalize();
        let in_scattered = phase.pdf_direction(DVec3::Z, d) * f64::from(intensity.x) / p.distance_squared(position);
        let tau = sigma_t * (t - z.0) + media.optical_depth(&Segment::new(p, position), Some(MediumId(0)));
        sigma_t * f64::from(albedo.x) * in_scattered * (-tau).exp()
    };
    integrate(&f, z.0, z.1)
}

/// Lights outside the fog, in another fog, on the border between the two, behind the camera, beside its axis: single scattering is the
/// airlight integral, for any mean cosine, and for media from nearly nothing to optical depths of hundreds.
#[test]
fn case_37_and_42_airlight_from_odd_places() {
    for (i, light) in [
        dvec3(0.0, 3.0, 4.0),
        dvec3(0.5, 0.5, 9.0),
        dvec3(0.5, 0.5, 7.0),
        dvec3(0.3, -0.2, -4.0),
        dvec3(0.0, 0.05, 4.5),
        dvec3(0.5, 0.0, 3.0),
    ]
    .into_iter()
    .enumerate()
    {
        for sigma_t in [1e-9, 0.3, 200.0] {
            // In a dense medium only what is close to its border is seen, and light from far inside does not come out.
            let light = if sigma_t > 1.0 { dvec3(0.5, 0.4 + 0.1 * i as f64, 2.9) } else { light };
            let g = [0.0, 0.7, -0.7][i % 3];
            let mut scene = empty_scene(24, 64, 1e-7);
            let fog = add_medium(&mut scene, sigma_t, 0.8, Phase::HenyeyGreenstein { g });
            // It only absorbs, and not so much that the samples go there.
            let other = add_medium(&mut scene, sigma_t.min(0.2), 0.0, Phase::Isotropic);
            add_fog(&mut scene, vec3(-1.0, -1.0, 3.0), vec3(1.0, 1.0, 7.0), fog);
            add_fog(&mut scene, vec3(-9.0, -9.0, 7.0), vec3(9.0, 9.0, 10.0), other);
            scene.emitters.push(Emitter::Point { position: light, intensity: Rgb::splat(3.0) });
            scene.integrator = IntegratorSettings { max_depth: Some(2), rr_depth: 10 };
            let expected = airlight(&scene, (3.0, 7.0));
            for integrator in BOTH {
                let pixels = rendered(&scene, &RenderOptions { integrator, ..options() }).image.pixels;
                let (mean, error) = mean_and_error(&pixels);
                // So thin a medium that `volpath` hardly ever collides tells nothing.
                if sigma_t < 1e-6 && integrator == IntegratorKind::Volpath {
                    continue;
                }
                assert!(
                    (mean - expected).abs() <= 5.0 * error + 4e-7 * expected,
                    "light at {light}, σ_t = {sigma_t}, {integrator:?}: {mean} ± {error}, expected {expected}"
                );
            }
        }
    }
}

/// ξ = 0 and ξ = 1 − 2⁻⁵³: a collision at the start, and one at optical depth 36.7; never a NaN, never beyond the segment.
#[test]
fn case_36_the_ends_of_the_unit_interval() {
    let scene = room(&[]);
    let media = Media::new(&scene.media, &scene.boundaries);
    let inside = dvec3(4.0, 6.0, 4.0);
    let s = Segment::new(inside, inside + DVec3::X * 2.0);
    let depth = |xi: f64| -(-xi).ln_1p();
    assert_eq!(media.fly(&s, Some(MediumId(0)), depth(0.0)), Flight::Collision { t: 0.0, medium: MediumId(0) });
    assert_eq!(media.fly(&s, Some(MediumId(0)), depth(1.0_f64.next_down())), Flight::Passed(Some(MediumId(0))));
    assert!(depth(1.0_f64.next_down()) < 37.0);
    // No collision in a vacuum, not even at depth 0; the first one where the fog begins.
    let from_outside = Segment::new(dvec3(0.0, 4.0, 4.0), dvec3(4.0, 4.0, 4.0));
    assert_eq!(media.fly(&from_outside, None, 0.0), Flight::Collision { t: 0.25, medium: MediumId(0) });
    // A depth that is reached exactly at the end belongs to what comes behind.
    let tau = media.optical_depth(&s, Some(MediumId(0)));
    assert_eq!(media.fly(&s, Some(MediumId(0)), tau), Flight::Passed(Some(MediumId(0))));
    let Flight::Collision { t, .. } = media.fly(&s, Some(MediumId(0)), tau.next_down()) else { panic!("no collision") };
    assert!(t <= 1.0);
}

/// From no extinction at all to the largest number: nothing is refused, thin fog does not show, black thick fog is black.
#[test]
fn case_37_extinction_without_limits() {
    let make = |sigma_t: f64, albedo: f32| {
        let mut scene = room(&[dvec3(2.0, 6.0, 3.0)]);
        scene.media[0] = Medium { sigma_t, albedo: Rgb::splat(albedo), phase: Phase::HenyeyGreenstein { g: 0.9 } };
        scene
    };
    let vacuum = BOTH.map(|integrator| {
        let mut scene = make(0.0, 0.5);
        scene.boundaries.clear();
        scene.sensor.medium = None;
        rendered(&scene, &RenderOptions { integrator, ..options() }).image.pixels
    });
    for sigma_t in [0.0, 5e-324, 1e-300, 1e-30, 1e-20] {
        for (integrator, vacuum) in BOTH.into_iter().zip(&vacuum) {
            let fog = rendered(&make(sigma_t, 0.5), &RenderOptions { integrator, ..options() }).image.pixels;
            // `raymarch` draws numbers for fog of any thinness, so that only the first surface can be compared there.
            if integrator == IntegratorKind::Volpath || sigma_t == 0.0 {
                assert!(bits(&fog) == bits(vacuum), "σ_t = {sigma_t}");
            }
        }
    }
    for sigma_t in [1e4, 1e30, 1e300, f64::MAX] {
        for albedo in [0.0, 1.0] {
            for pixels in same_for_all_methods(&format!("σ_t = {sigma_t}"), &make(sigma_t, albedo), 1.0) {
                assert!(albedo > 0.0 || pixels.iter().all(|&p| p == Rgb::ZERO), "σ_t = {sigma_t}: not black");
            }
        }
    }
}

/// There are no null collisions to choose by a density of zero: media are homogeneous and flights analytic. What comes nearest are
/// boundaries that change nothing, and media without extinction among others: transmittance and collisions are those of one piece.
#[test]
fn case_38_boundaries_that_change_nothing() {
    let medium = |sigma_t| Medium { sigma_t, albedo: Rgb::ONE, phase: Phase::Isotropic };
    let slab = |x0: f32, x1: f32, m| Boundary {
        triangles: cuboid(vec3(x0, -1.0, -1.0), vec3(x1, 1.0, 1.0)),
        interior: Some(MediumId(m)),
        exterior: None,
    };
    let whole = Media::new(&[medium(0.7)], &[slab(0.0, 8.0, 0)]);
    let pieces: Vec<_> = (0..8_u8).map(|i| slab(f32::from(i), f32::from(i) + 1.0, u32::from(i % 2))).collect();
    let cut = Media::new(&[medium(0.7), medium(0.7)], &pieces);
    let mut empty_between = pieces.clone();
    empty_between[3].interior = Some(MediumId(2));
    let gap = Media::new(&[medium(0.7), medium(0.7), medium(0.0)], &empty_between);
    for i in 0..2000 {
        let mut u = Sampler::new(71, i, 0, 0);
        let mut end = |x: f64| dvec3(x, 1.6 * u.next_1d() - 0.8, 1.6 * u.next_1d() - 0.8);
        let s = Segment::new(end(-1.0), end(9.0));
        let tau = whole.optical_depth(&s, None);
        assert!((cut.optical_depth(&s, None) - tau).abs() < 1e-13 * tau);
        assert!((gap.optical_depth(&s, None) - tau * 7.0 / 8.0).abs() < 1e-13 * tau);
        let wanted = tau * u.next_1d();
        let at = |media: &Media| match media.fly(&s, None, wanted) {
            Flight::Collision { t, medium } => Some((t, medium)),
            Flight::Passed(_) => None,
        };
        let (a, b) = (at(&whole).expect("reached"), at(&cut).expect("reached"));
        assert!((a.0 - b.0).abs() < 1e-13, "{a:?} {b:?}");
        assert_ne!(at(&gap).map(|g| g.1), Some(MediumId(2)), "a collision where there is nothing");
    }
}

/// There is no majorant to exceed. What comes nearest: a collision is never outside its medium's part of the segment, whatever rounds.
#[test]
fn case_39_collisions_stay_in_their_medium() {
    let scene = room(&[]);
    let media = Media::new(&scene.media, &scene.boundaries);
    for i in 0..20_000 {
        let mut u = Sampler::new(72, i, 0, 0);
        let mut point = || dvec3(u.next_1d(), u.next_1d(), u.next_1d()) * 10.0 - 1.0;
        let s = Segment::new(point(), point());
        let inside = |p: DVec3| p.cmpge(DVec3::splat(1.0)).all() && p.cmple(DVec3::splat(7.0)).all();
        let start = inside(s.p).then_some(MediumId(0));
        let tau = media.optical_depth(&s, start);
        // The last depths before the end of the fog, or any.
        let wanted = if i % 2 == 0 { tau.next_down() } else { tau * u.next_1d() };
        if let Flight::Collision { t, .. } = media.fly(&s, start, wanted) {
            let p = s.at(t);
            let off = (DVec3::splat(1.0) - p).max(p - DVec3::splat(7.0)).max_element();
            assert!((0.0..=1.0).contains(&t) && off < 1e-12, "{s:?}: {t}, outside by {off}");
        }
    }
}

/// Channels do not mix: without Russian roulette, which looks at the brightest, each channel of a coloured scene has the very bits of a
/// grey one, and where a channel is zero it stays zero.
#[test]
fn case_40_channels_that_are_zero() {
    let colours = [Rgb::new(0.9, 0.0, 0.4), Rgb::new(0.0, 0.0, 0.7), Rgb::new(1.0, 0.5, 0.0)];
    let make = |[albedo, reflectance, intensity]: [Rgb; 3]| {
        let mut scene = room(&[dvec3(2.0, 6.0, 3.0)]);
        scene.media[0].albedo = albedo;
        scene.surfaces.iter_mut().for_each(|s| s.bsdf = Bsdf { front: reflectance, back: reflectance });
        scene.emitters = vec![Emitter::Point { position: dvec3(2.0, 6.0, 3.0), intensity }];
        scene.integrator = IntegratorSettings { max_depth: Some(6), rr_depth: 100 };
        scene
    };
    for integrator in BOTH {
        let o = RenderOptions { integrator, ..options() };
        for first in 0..3 {
            let colours: [Rgb; 3] = std::array::from_fn(|i| colours[(i + first) % 3]);
            let coloured = rendered(&make(colours), &o).image.pixels;
            for channel in 0..3 {
                let grey = rendered(&make(colours.map(|c| Rgb::splat(c[channel]))), &o).image.pixels;
                for (c, g) in coloured.iter().zip(&grey) {
                    assert_eq!(
                        c[channel].to_bits(),
                        g.x.to_bits(),
                        "{integrator:?}, colours {first}, channel {channel}"
                    );
                }
            }
        }
    }
}

/// The white furnace for mean cosines up to ±0.999999: fog of albedo 1 under a uniform sky does not darken anything.
#[test]
fn case_41_peaked_phase_functions() {
    for g in [-0.999_999, -0.99, -1e-4, 1e-4, 0.99, 0.999_999, 1.0_f64.next_down(), -1.0_f64.next_down()] {
        let mut scene = empty_scene(24, 16, 0.5);
        scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
        let fog = add_medium(&mut scene, 1.0, 1.0, Phase::HenyeyGreenstein { g });
        add_fog(&mut scene, vec3(-2.0, -2.0, 1.0), vec3(2.0, 2.0, 4.0), fog);
        let (mean, error) = mean_and_error(&rendered(&scene, &options()).image.pixels);
        assert!((mean - 1.0).abs() <= 5.0 * error + 4e-6, "g = {g}: {mean} ± {error}");
        let mut lit = room(&[dvec3(2.0, 6.0, 3.0)]);
        lit.media[0].phase = Phase::HenyeyGreenstein { g };
        same_for_all_methods(&format!("g = {g}"), &lit, 1.0);
    }
}

/// A light on the very axis of the camera, in front and behind, at the camera, and beside the axis by less than rounding. The
/// expectation is infinite on the axis itself; the samples are not.
#[test]
fn case_42_a_light_on_the_camera_ray() {
    for (x, z) in [(0.0, 3.0), (0.0, 1.5), (0.0, 1.2), (1e-17, 3.0), (1e-12, 3.0), (1e-6, 6.0), (0.0, 7.0)] {
        let mut scene = room(&[dvec3(4.0 + x, 4.0, z)]);
        scene.sensor.tan_half_fov_x = 1e-12;
        same_for_all_methods(&format!("light at {x}, {z}"), &scene, 1.0);
    }
}

/// Intervals without length, and those that have lost it: everything between is as if they were not there.
#[test]
fn case_43_intervals_without_length() {
    let medium = |sigma_t| Medium { sigma_t, albedo: Rgb::ONE, phase: Phase::Isotropic };
    let closed =
        |min: Vec3, max: Vec3| Boundary { triangles: cuboid(min, max), interior: Some(MediumId(0)), exterior: None };
    let large = Vec3::splat(1e4);
    let s = Segment::new(dvec3(0.3, 0.2, -50.0), dvec3(1.0, 2.0, 70.0));
    for thickness in [0.0, 1e-30, 1e-12, 1e-9, 1e-8] {
        // Thinner than the place of a crossing is known beside coordinates of 10⁴.
        let slab = closed(-large * vec3(1.0, 1.0, 0.0), large * vec3(1.0, 1.0, 0.0) + Vec3::Z * thickness);
        let media = Media::new(&[medium(1.0)], &[slab]);
        let tau = media.optical_depth(&s, None);
        assert!(tau <= 1.1e-8, "a slab of {thickness} has the optical depth {tau}");
        assert_eq!(media.fly(&s, None, 1.0), Flight::Passed(None), "a slab of {thickness}");
    }
    let unit = closed(Vec3::ZERO, Vec3::ONE);
    let media = Media::new(&[medium(1.0)], &[unit.clone()]);
    let through = |p: DVec3, q: DVec3| {
        let there = media.optical_depth(&Segment::new(p, q), None);
        let back = media.optical_depth(&Segment::new(q, p), None);
        assert!((there - back).abs() < 1e-15, "{p} {q}: {there} there, {back} back");
        there
    };
    // Touching an edge or a corner from outside; passing through edges and corners.
    assert_eq!(through(dvec3(0.5, 1.5, 0.3), dvec3(1.5, 0.5, 0.3)), 0.0);
    assert_eq!(through(dvec3(0.0, 2.0, 1.0), dvec3(2.0, 0.0, 1.0)), 0.0);
    assert_eq!(through(dvec3(0.5, 1.5, 0.9), dvec3(1.5, 0.5, 1.1)), 0.0);
    assert_eq!(through(dvec3(0.0, 2.0, 0.0), dvec3(2.0, 0.0, 2.0)), 0.0);
    let diagonal = 3.0_f64.sqrt();
    assert!((through(DVec3::splat(-1.0), DVec3::splat(2.0)) - diagonal).abs() < 1e-15);
    assert!((through(dvec3(-1.0, -1.0, 0.25), dvec3(2.0, 2.0, 0.25)) - 2.0_f64.sqrt()).abs() < 1e-15);
    // No length at all, on a corner, inside, outside; zero optical depth, and no collision unless in fog.
    for p in [DVec3::ZERO, DVec3::splat(0.5), DVec3::splat(9.0)] {
        let point = Segment::new(p, p);
        assert_eq!(media.optical_depth(&point, Some(MediumId(0))), 0.0);
        assert_eq!(media.transmittance(&point, Some(MediumId(0))), 1.0);
        assert_eq!(media.fly(&point, Some(MediumId(0)), 0.0), Flight::Passed(Some(MediumId(0))));
        assert!(media.short_flight(&point, MediumId(0), 1.0).is_none());
    }
    // Each face twice, and once more the other way round: entered and left at one place is not entered.
    let mut folded = unit;
    let turned = folded.triangles.iter().map(|t| Triangle::new(t.vertices[0], t.vertices[2], t.vertices[1]));
    folded.triangles = folded.triangles.iter().copied().chain(turned).chain(folded.triangles.iter().copied()).collect();
    let media = Media::new(&[medium(1.0)], &[folded]);
    assert_eq!(media.optical_depth(&Segment::new(dvec3(0.3, 0.4, -1.0), dvec3(0.4, 0.3, 2.0)), None), 0.0);
    // A length beyond all measure.
    let far = Segment::new(DVec3::ZERO, DVec3::X * 1e150);
    assert_eq!(Media::new(&[medium(1e-300)], &[]).transmittance(&far, Some(MediumId(0))), 1.0);
    assert_eq!(Media::new(&[medium(1.0)], &[]).transmittance(&far, Some(MediumId(0))), 0.0);
}

/// Emitters that fill a ten-millionth of a degree, and one that fills nearly half of the sphere: the light on a wall that faces them.
#[test]
fn case_44_tiny_and_huge_emitters() {
    for half in [1e-6_f32, 1e-3, 1.0, 4e3] {
        let mut scene = empty_scene(24, if half > 1e-2 { 256 } else { 1 }, 1e-9);
        scene.sensor.world_from_camera = DMat4::from_translation(dvec3(0.0, 0.0, -1.0));
        scene.surfaces.push(wall(0.0));
        let z = -2.0;
        let [a, b, c, d] =
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]: [f32; 2]| vec3(x * half, y * half, z));
        scene.surfaces.push(Surface {
            triangles: vec![Triangle::new(a, b, c), Triangle::new(a, c, d)],
            bsdf: Bsdf { front: Rgb::ZERO, back: Rgb::ZERO },
            radiance: Some(Rgb::splat(0.5 / (half * half).min(1.0))),
        });
        scene.emitters.push(Emitter::Area { surface: 1 });
        scene.integrator.max_depth = Some(2);
        // The form factor of a square of side 2a at distance h, parallel to the point's plane: 4/π·x/√(1 + x²)·atan(x/√(1 + x²)), x = a/h.
        let x = f64::from(half) / 2.0;
        let root = (1.0 + x * x).sqrt();
        let form = 2.0 / std::f64::consts::PI * x / root * (x / root).atan() * 2.0;
        let radiance = f64::from(0.5 / (half * half).min(1.0));
        let expected = f64::from(GREY.back.x) * radiance * form;
        let (mean, error) = mean_and_error(&rendered(&scene, &options()).image.pixels);
        assert!(
            (mean - expected).abs() <= 5.0 * error + 2e-6 * expected,
            "half side {half}: {mean} ± {error}, expected {expected}"
        );
    }
}

/// A hundred thousand bounces at albedo 1, and still as bright as the sky. A sum of n single-precision terms that add up to 1 errs by
/// up to n·2⁻²⁴ = 0.6 %.
#[test]
fn a_hundred_thousand_bounces() {
    let mut scene = empty_scene(4, 2, 0.5);
    scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
    let fog = add_medium(&mut scene, 160.0, 1.0, Phase::Isotropic);
    add_fog(&mut scene, vec3(-1.0, -1.0, -1.0), vec3(1.0, 1.0, 1.0), fog);
    scene.sensor.medium = Some(fog);
    scene.integrator = IntegratorSettings { max_depth: None, rr_depth: u32::MAX };
    let rendering = rendered(&scene, &options());
    let bounces = rendering.statistics.queries as f64 / rendering.statistics.paths as f64;
    assert!(bounces > 1e4, "only {bounces} bounces a path");
    let (mean, error) = mean_and_error(&rendering.image.pixels);
    assert!((mean - 1.0).abs() <= 5.0 * error + 6e-3, "{mean} ± {error}");
    // And exactly so many that a limit is met: no path is longer than it says.
    scene.integrator.max_depth = Some(100_000);
    scene.media[0].sigma_t = 1e5;
    let rendering = rendered(
        &scene,
        &RenderOptions {
            spp: Some(1),
            crop: Some(vdf::render::scene::PixelRect { x0: 0, y0: 0, x1: 2, y1: 2 }),
            ..options()
        },
    );
    assert_eq!(rendering.statistics.queries, 4 * 99_999);
}

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
        scene.sensor.tan_half_fov_x = 1e-9;
        same_for_all_methods(&format!("camera at height {y}"), &scene, 1.0);
    }
}

/// Triangles without area change no bit, wherever they are; nor do doubles of others. As emitters they emit nothing.
#[test]
fn degenerate_and_duplicated_triangles() {
    let mut scene = room(&[dvec3(2.0, 6.0, 3.0)]);
    scene.surfaces[1].radiance = Some(Rgb::splat(0.2));
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
        bsdf: Bsdf { front: Rgb::ZERO, back: Rgb::ONE },
        radiance: None,
    });
    for (a, b) in same_for_all_methods("with doubles", &scene, 1.0).iter().zip(&reference) {
        assert!(bits(a) == bits(b), "doubles change the image");
    }
    // An emitter of which nothing is left.
    let mut dark = room(&[]);
    dark.surfaces.push(Surface { triangles: degenerate, bsdf: GREY, radiance: Some(Rgb::ONE) });
    dark.emitters.push(Emitter::Area { surface: 2 });
    for pixels in same_for_all_methods("an emitter without area", &dark, 1.0) {
        assert!(pixels.iter().all(|&p| p == Rgb::ZERO));
    }
}

/// A floor cut into slivers, a million times as long as wide and thinner, is the same floor: with one seed the images agree to 10⁻⁴.
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
    let mut emitting = Surface { triangles: strip(&[1.0, 7.0]), bsdf: GREY, radiance: Some(Rgb::splat(0.3)) };
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
