//! Media on grids against closed forms, and all ways to find their light against each other.

use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3, dvec3, vec3};
use vdf::{
    geometry::Segment,
    render::{Estimator, FreeFlight, Media, Sampler},
    scene::{
        Albedo, Boundary, Emitter, Extinction, GridVolume, IntegratorSettings, Medium, MediumId, Phase, Rgb, Scene,
        VolumeFilter, VoxelGrid, Wrap,
    },
};

use crate::{
    check::{Check, RAYMARCH, TRACED, VOLPATH, WAYS},
    common::{Options, add_block_and_lights, add_fog, cuboid, empty_scene, options, rendered},
};

/// A grid over the box from `min` to `max`.
fn grid(size: [u32; 3], values: Vec<f32>, min: Vec3, max: Vec3) -> GridVolume {
    let channels = values.len() / size.iter().product::<u32>() as usize;
    let grid = VoxelGrid::new(size, channels, values, [Vec3::ZERO, Vec3::ONE]).expect("a grid");
    let world_from_grid = DMat4::from_translation(min.as_dvec3()) * DMat4::from_scale((max - min).as_dvec3());
    GridVolume {
        grid: Arc::new(grid),
        filter: VolumeFilter::Trilinear,
        wrap: Wrap::Clamp,
        grid_from_world: world_from_grid.inverse(),
    }
}

/// Fills a box with a medium on a grid over it.
fn add_grid(scene: &mut Scene, size: [u32; 3], values: Vec<f32>, [min, max]: [Vec3; 2], medium: [f64; 2]) -> MediumId {
    let [scale, albedo] = medium;
    let sigma_t = Extinction::Grid { volume: grid(size, values, min, max), scale };
    let id = MediumId(u32::try_from(scene.media.len()).expect("few"));
    scene.media.push(Medium::new(0.0, Rgb::splat(albedo as f32), Phase::HenyeyGreenstein { g: 0.3 }));
    scene.media[id.0 as usize].sigma_t = sigma_t;
    add_fog(scene, min, max, id);
    id
}

/// About half of them zero, in a corner and here and there.
fn sparse(size: [u32; 3]) -> Vec<f32> {
    let mut u = Sampler::new(5, 0, 0, 0);
    (0..size.iter().product::<u32>())
        .map(|i| if i % size[0] < size[0] / 3 || u.next_1d() < 0.3 { 0.0 } else { 3.0 * u.next_1d() as f32 })
        .collect()
}

/// Where the values are equal it is a homogeneous medium: depths, free flights, and pictures up to how the same numbers round.
#[test]
fn a_constant_grid_is_homogeneous_fog() {
    let (min, max) = (vec3(-1.5, -1.0, 1.0), vec3(1.0, 2.0, 3.5));
    let media = |sigma_t: Extinction| {
        let medium = Medium::new(sigma_t, Rgb::ONE, Phase::Isotropic);
        let boundary = Boundary { triangles: cuboid(min, max), interior: Some(MediumId(0)), ..Boundary::default() };
        Media::new(&[medium], &[boundary], None)
    };
    let on_grid = media(Extinction::Grid { volume: grid([3, 17, 9], vec![0.5; 459], min, max), scale: 1.4 });
    let fog = media(0.7.into());
    let mut u = Sampler::new(3, 0, 0, 0);
    let mut collisions = 0;
    for _ in 0..2000 {
        let mut point =
            || (dvec3(u.next_1d(), u.next_1d(), u.next_1d()) * 2.0 - 0.5) * (max - min).as_dvec3() + min.as_dvec3();
        let s = Segment::new(point(), point());
        let start = fog.regions_at(s.p);
        let (a, b) = (on_grid.optical_depth(&s, &start), fog.optical_depth(&s, &start));
        assert!((a - b).abs() <= 1e-13, "{s:?}: {a}, not {b}");
        let tau = u.next_1d();
        match (on_grid.free_flight(&s, &start, tau), fog.free_flight(&s, &start, tau)) {
            (FreeFlight::Collision { t: a, .. }, FreeFlight::Collision { t: b, .. }) => {
                collisions += 1;
                assert!((a - b).abs() <= 1e-12, "{s:?}: {a}, not {b}");
            }
            (a, b) => assert_eq!(a, b, "{s:?}, {tau}"),
        }
    }
    assert!(collisions > 300, "{collisions}");

    let image = |sigma_t: Extinction, integrator| {
        let mut scene = empty_scene(16, 8, 0.6);
        scene.media.push(Medium::new(sigma_t, Rgb::splat(0.8), Phase::Isotropic));
        add_fog(&mut scene, min, max, MediumId(0));
        scene.emitters.push(Emitter::Point { position: dvec3(2.0, 1.2, 0.6), intensity: Rgb::splat(5.0) });
        scene.integrator.max_depth = Some(2);
        rendered(&scene, &Options { integrator, ..options() }).image.pixels
    };
    for integrator in [VOLPATH, RAYMARCH] {
        let a = image(Extinction::Grid { volume: grid([3, 17, 9], vec![0.5; 459], min, max), scale: 1.4 }, integrator);
        for (a, b) in a.iter().zip(image(0.7.into(), integrator)) {
            assert!((*a - b).abs().max_element() <= 1e-5 * b.max_element(), "{integrator:?}: {a}, not {b}");
        }
    }
}

/// Fog that absorbs, thicker to the right: the sky behind it is e^(−τ), with τ in closed form.
#[test]
fn a_ramp_lets_through_what_it_should() {
    let ramp = vec![0.0, 1.0, 2.0, 3.0];
    for x in [-0.9, -0.4, 0.0, 0.3, 0.8] {
        let mut scene = empty_scene(32, 1, 1e-12);
        add_grid(&mut scene, [4, 1, 1], ramp.clone(), [vec3(-1.0, -1.0, 1.0), vec3(1.0, 1.0, 3.0)], [0.4, 0.0]);
        scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
        scene.sensor.world_from_camera = DMat4::from_translation(dvec3(x, 0.1, 0.0));
        // Values at −¾, −¼, ¼ and ¾; two units thick.
        let sigma_t = 0.4 * (1.5 + 2.0 * x).clamp(0.0, 3.0);
        let expected = (-2.0 * sigma_t).exp();
        let case = format!("x = {x}");
        let mut marched = Check::new("transmittance of a ramp", RAYMARCH);
        marched.exact(&case, &marched.render(&scene, 1), expected);
        let mut traced = Check::new("transmittance of a ramp", VOLPATH);
        traced.share(&case, &traced.render(&scene, 16), 16, expected);
    }
}

/// Nothing is lost in fog of albedo 1, wherever it is thick, under a uniform sky; from outside and from inside, with an albedo from a grid, too.
#[test]
fn nothing_is_lost_in_a_grid() {
    let size = [6, 5, 7];
    let (min, max) = (vec3(-1.5, -1.0, 1.0), vec3(1.0, 2.0, 3.5));
    for way in TRACED {
        let mut check = Check::by("white furnace in a grid", way);
        for albedo in [Albedo::Constant(Rgb::ONE), Albedo::Grid(grid([1, 1, 2], vec![1.0; 2], min, max))] {
            let mut scene = empty_scene(32, 1, 0.5);
            let fog = add_grid(&mut scene, size, sparse(size), [min, max], [1.0, 1.0]);
            scene.media[0].albedo = albedo;
            scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
            scene.emitters.push(Emitter::Point { position: dvec3(1.6, 0.8, 1.8), intensity: Rgb::ZERO });
            check.mean("outside", &check.render(&scene, 16), 1.0);
            scene.sensor.world_from_camera = DMat4::from_translation(dvec3(0.1, 0.1, 1.2));
            scene.sensor.medium = Some(fog);
            check.mean("inside", &check.render(&scene, 16), 1.0);
        }
    }
}

/// All ways to find light that is scattered once: the mean over the image of the difference to `volpath`, in standard errors; 5 are a false alarm of 6·10⁻⁷. Two grids and plain
/// fog, with a turned grid of colours as the albedo of one.
#[test]
fn all_ways_find_the_same_light() {
    let mut scene = empty_scene(32, 1, 0.6);
    scene.integrator = IntegratorSettings { max_depth: Some(2), rr_depth: 10 };
    let size = [9, 5, 7];
    add_grid(&mut scene, size, sparse(size), [vec3(-2.0, -1.5, 1.0), vec3(0.2, 1.5, 3.0)], [0.8, 0.9]);
    add_grid(&mut scene, [2, 2, 30], vec![0.7; 120], [vec3(0.2, -2.0, 1.5), vec3(2.0, 1.0, 4.0)], [1.0, 0.6]);
    let mut tint = grid([2, 2, 1], [0.9, 0.2, 0.5, 1.0].repeat(3), vec3(-2.0, -1.5, 1.0), vec3(0.2, 1.5, 3.0));
    tint.grid_from_world *= DMat4::from_axis_angle(DVec3::Y, 0.4);
    tint.wrap = Wrap::Mirror;
    scene.media[0].albedo = Albedo::Grid(tint);
    scene.media.push(Medium::new(0.3, Rgb::splat(0.8), Phase::Isotropic));
    add_fog(&mut scene, vec3(-1.0, -2.0, 4.5), vec3(2.5, 1.0, 6.0), MediumId(2));
    add_block_and_lights(&mut scene);
    let image = |(integrator, estimator), spp, seed| {
        let o = Options { integrator, estimator, spp: Some(spp), seed: Some(seed), ..options() };
        rendered(&scene, &o).image.pixels
    };
    let traced = image((VOLPATH, Estimator::Thesis), 128, 1);
    let level = traced.iter().map(|p| f64::from(p.element_sum())).sum::<f64>() / traced.len() as f64;
    for way in WAYS {
        let spp = if way.0 == VOLPATH { 128 } else { 2 };
        let other = image(way, spp, 2);
        let n = traced.len() as f64;
        let differences: Vec<f64> =
            traced.iter().zip(&other).map(|(a, b)| f64::from(a.element_sum() - b.element_sum())).collect();
        let mean = differences.iter().sum::<f64>() / n;
        let error = (differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
        println!("{way:?}: {:.1e} ± {:.1e}", mean / level, error / level);
        assert!(mean.abs() < 5.0 * error, "{way:?}: {mean} ± {error}");
        // Or the test would prove little.
        assert!(error < 6e-3 * level, "{way:?}: too noisy, {error} of {level}");
    }
}
