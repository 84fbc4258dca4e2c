//! Whether light paths pay: a look at some paths of the film, followed with and without them.
//!
//! *Idea.* Where light that is reflected once is much of an image, events that are connected to light paths (`integrator/bounce.rs`) have a half to a twentieth of the variance;
//! where a sky or a lamp is seen by nearly everything they cost a third of the time for nothing.
//!
//! *Definition.* Each of [`SIDE`]² pixels, spread evenly over the film, is rendered [`REPETITIONS`] times with [`SAMPLES`] paths in both ways. Noise is the variance of a pixel over the square of
//! the mean of the pixels around, averaged without the pixels where it is largest; cost is counted in rays and queries, by what they take in the profile. The less of the
//! product is taken. The paths are the same in both ways, but for their connections: so what makes noise in both, as light that glass gathers, decides nothing. Paths end after [`EVENTS`] events, or in white fog the look would take longer than the render.
//!
//! *Guarantee.* A function of the scene alone: no clock is asked, and neither crop, samples, seed, shards, threads nor method matter. Both ways have the same mean.
//!
//! *Cost.* 3872 paths, once a scene: some hundredths of a second.

use glam::DVec3;
use vdf_scene::{IntegratorSettings, Scene};
use vdf_visibility::{Counters, Provers, Visibility};

use crate::{
    Camera, Estimator, Integrator, Quiet, Roulette, Sampler, SamplerKind, TransmittanceEstimator,
    integrator::{Connected, Tracer},
    world::World,
};

/// Pixels along each side of the film, if it has so many.
const SIDE: u32 = 11;

/// How often each of them is rendered in each way.
const REPETITIONS: u64 = 2;

/// Paths of a pixel, each time: even ones, as most renders have them.
const SAMPLES: u32 = 8;

/// The most events of a path.
const EVENTS: u32 = 32;

/// The mean is taken over squares of so many of these pixels along each side.
const AROUND: u32 = 4;

/// The share of the pixels that is left out: the noisiest.
const LEFT_OUT: f64 = 0.03;

/// So much more may light paths seem to cost than they give. What is rarely bright is seldom seen in so few paths, and there they help most.
const IN_DOUBT: f64 = 1.15;

/// What a ray costs and what belongs to it, a shadow query and a connection.
const COSTS: [f64; 3] = [2.0, 1.0, 0.6];

/// Whether light paths pay in this scene.
pub(crate) fn pay(scene: &Scene, world: &World) -> bool {
    let (film, camera) = (&scene.film, Camera::new(&scene.sensor, &scene.film));
    let [columns, rows] = [film.width, film.height].map(|size| SIDE.min(size));
    let place = |i: u32, n: u32, size: u32| (f64::from(i) + 0.5) * f64::from(size) / f64::from(n);
    let provers = Provers::none();
    let max_depth = scene.integrator.max_depth.map_or(EVENTS, |depth| depth.min(EVENTS));
    let settings = IntegratorSettings { max_depth: Some(max_depth), ..scene.integrator };
    let mut ways = [Connected::PassedOver, Connected::Always].map(|light_paths| {
        let tracer = Tracer {
            world,
            visibility: Visibility::new(&world.bvh, &provers),
            settings,
            transmittance: TransmittanceEstimator::Analytic,
            roulette: Roulette::default(),
            estimator: Estimator::Equiangular,
            light_paths,
            arch: pulp::Arch::new(),
            progress: &Quiet,
        };
        (tracer, Counters::default(), Vec::new())
    });
    let squares = [columns.div_ceil(AROUND), rows.div_ceil(AROUND)];
    let mut means = vec![(DVec3::ZERO, 0.0); (squares[0] * squares[1]) as usize];
    for i in 0..columns * rows {
        let (column, row) = (i % columns, i / columns);
        let (x, y) = (place(column, columns, film.width), place(row, rows, film.height));
        let mean = &mut means[(row / AROUND * squares[0] + column / AROUND) as usize];
        for (tracer, counters, variances) in &mut ways {
            let (mut sum, mut squares, mut n) = (DVec3::ZERO, DVec3::ZERO, 0.0);
            for seed in 0..REPETITIONS {
                let mut one = DVec3::ZERO;
                for sample in 0..SAMPLES {
                    let ray = tracer.camera_ray(camera.position(), &camera.ray(x, y, world.lights.reach()));
                    let sampler = Sampler::of_kind(SamplerKind::Sobol, seed, column, row, sample);
                    let mut sampler = sampler.even_up_to(Integrator::Volpath.even_dimensions(world.lights.count()));
                    // The place in the pixel.
                    sampler.skip(2);
                    let radiance = tracer.volpath_by_mixture(ray, &mut sampler, counters);
                    if radiance.is_finite() {
                        one += radiance.as_dvec3();
                    }
                }
                (sum, squares, n) = (sum + one, squares + one * one, n + 1.0);
            }
            *mean = (mean.0 + sum, mean.1 + n);
            variances.push(squares - sum * sum / f64::max(n, 1.0));
        }
    }
    let means: Vec<DVec3> = means.into_iter().map(|(sum, n)| sum / f64::max(n, 1.0)).collect();
    let level = means.iter().sum::<DVec3>().element_sum() / (3.0 * means.len() as f64);
    let [without, with] = ways.map(|(_, counters, variances)| {
        let noise = |(variance, i): (DVec3, u32)| {
            let mean = means[(i / columns / AROUND * squares[0] + i % columns / AROUND) as usize];
            (variance / (mean * mean + 0.01 * level * level)).element_sum()
        };
        let mut noise: Vec<f64> = variances.into_iter().zip(0..).map(noise).filter(|n| n.is_finite()).collect();
        noise.sort_unstable_by(f64::total_cmp);
        noise.truncate((noise.len() as f64 * (1.0 - LEFT_OUT)).ceil() as usize);
        let of_each = [counters.rays, counters.queries, counters.connections].map(|n| n as f64);
        let cost: f64 = std::iter::zip(COSTS, of_each).map(|(cost, n)| cost * n).sum();
        noise.iter().sum::<f64>() * cost
    });
    with <= IN_DOUBT * without
}
