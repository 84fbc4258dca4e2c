//! Efficiency of each estimator and sampler, 1/(time × variance), against the estimator `thesis` with independent samples. Time is that of the
//! thread's CPU, so that other work on the machine counts little; all ways take turns. `docs/performance.md` has the command and the figures.
//!
//! Usage: `efficiency SCENE [SPP] [IMAGES] [SIDE]`; a scene is a built-in name or a file, rendered SIDE × SIDE.

use std::{fs, path::Path};

use anyhow::{Context as _, anyhow};
use vdf::{
    render::{Estimator, Integrator, PrepareOptions, PreparedScene, Quiet, RenderOptions, SamplerKind, SegmentSamples},
    scene::{Bsdf, IntegratorSettings, LoadOptions, Rgb, Scene, SceneSource},
    scenes::builtin,
    visibility::Counters,
};

/// One way to render, and what came of it.
struct Way {
    integrator: Integrator,
    estimator: Estimator,
    sampler: SamplerKind,
    seconds: f64,
    /// For each pixel the sums of its values and of their squares.
    sums: Vec<[f64; 2]>,
}

/// Seconds of this thread on a processor.
fn thread_seconds() -> anyhow::Result<f64> {
    let text =
        fs::read_to_string("/proc/thread-self/schedstat").context("the time of a thread is only known on Linux")?;
    let nanoseconds = text.split_whitespace().next().ok_or_else(|| anyhow!("an empty schedstat"))?;
    Ok(nanoseconds.parse::<f64>()? * 1e-9)
}

impl Way {
    fn render(&mut self, prepared: &PreparedScene, spp: u32, seed: u64) -> anyhow::Result<()> {
        let Self { integrator, estimator, sampler, .. } = *self;
        let options = RenderOptions {
            integrator,
            estimator,
            sampler,
            spp: Some(spp),
            seed: Some(seed),
            ..RenderOptions::default()
        };
        let job = prepared.job(&options)?;
        let tracer = job.tracer(&Quiet);
        let [width, height] = job.size();
        let mut counters = Counters::default();
        self.sums.resize((width * height) as usize, [0.0; 2]);
        let start = thread_seconds()?;
        for y in 0..height {
            for x in 0..width {
                let mut sum = 0.0;
                for sample in 0..spp {
                    let (radiance, weight) = tracer.sample(x, y, sample, &mut counters);
                    sum += f64::from(radiance.element_sum()) / 3.0 * weight;
                }
                let value = sum / f64::from(spp);
                let [values, squares] = &mut self.sums[(y * width + x) as usize];
                *values += value;
                *squares += value * value;
            }
        }
        self.seconds += thread_seconds()? - start;
        Ok(())
    }

    /// The pixel that is brightest.
    fn brightest(&self) -> usize {
        (0..self.sums.len()).max_by(|&i, &j| self.sums[i][0].total_cmp(&self.sums[j][0])).unwrap_or(0)
    }

    /// Mean of the image; mean variance of a pixel; that without the worst hundredth of the pixels; and that of the pixels that are `kept`.
    fn variance(&self, images: f64, kept: impl Fn(usize) -> bool) -> [f64; 4] {
        let n = self.sums.len() as f64;
        let mean = self.sums.iter().map(|s| s[0]).sum::<f64>() / images / n;
        let of_pixel = |s: &[f64; 2]| (s[1] - s[0] * s[0] / images).max(0.0) / (images - 1.0);
        let mut variances: Vec<f64> = self.sums.iter().map(of_pixel).collect();
        let beside: Vec<f64> = variances.iter().enumerate().filter(|(i, _)| kept(*i)).map(|(_, v)| *v).collect();
        variances.sort_by(f64::total_cmp);
        let kept = variances.len() - variances.len() / 100;
        let trimmed = variances[..kept].iter().sum::<f64>() / kept as f64;
        [mean, variances.iter().sum::<f64>() / n, trimmed, beside.iter().sum::<f64>() / beside.len() as f64]
    }
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let name = arguments.first().ok_or_else(|| anyhow!("usage: efficiency SCENE [SPP] [IMAGES] [SIDE]"))?;
    let number = |i: usize, or: u32| arguments.get(i).map_or(Ok(or), |text| text.parse());
    let (spp, images, side) = (number(1, 16)?, number(2, 16)?, number(3, 64)?);
    let source = builtin(name).unwrap_or_else(|| SceneSource::disk(Path::new(name)));
    let defines = ["width", "height"].map(|n| (n.to_owned(), side.to_string())).to_vec();
    let scene = Scene::from_source(&source, &LoadOptions { defines, ..LoadOptions::default() })?;
    let once = IntegratorSettings { max_depth: Some(2), ..scene.integrator };
    let mut black = Scene { integrator: once, ..scene.clone() };
    for surface in &mut black.surfaces {
        surface.bsdf = Bsdf::lambertian(Rgb::ZERO, Rgb::ZERO);
    }
    let raymarch = |n| Integrator::raymarch(n);
    let auto = Integrator::Raymarch(SegmentSamples::Auto);
    let direct = Scene { integrator: once, ..scene.clone() };
    for (what, scene, integrators) in [
        ("scattered once in the medium", black, &[raymarch(7), raymarch(1), raymarch(2), auto][..]),
        ("with the direct light of surfaces", direct, &[raymarch(7), raymarch(2), auto]),
        ("marched, any number of surfaces", scene.clone(), &[raymarch(7), raymarch(2), auto]),
        ("all light", scene, &[Integrator::Volpath]),
    ] {
        let prepared = PreparedScene::new(scene, &PrepareOptions::default(), &Quiet)?;
        let mut ways: Vec<Way> = Vec::new();
        for &integrator in integrators {
            for estimator in Estimator::ALL {
                for sampler in SamplerKind::ALL {
                    ways.push(Way { integrator, estimator, sampler, seconds: 0.0, sums: Vec::new() });
                }
            }
        }
        for seed in 1..=images {
            for way in &mut ways {
                way.render(&prepared, spp, seed.into())?;
            }
        }
        println!("\n{name}, {what}: {side} × {side}, {spp} spp, {images} images");
        println!(
            "| integrator | estimator | sampler | µs a path | mean | variance | efficiency | trimmed by 1 % | beside the light |"
        );
        println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
        let images = f64::from(images);
        // Where the light is seen lines have an infinite variance: without the pixels within 3 of the brightest one, as one of the ways has it.
        let brightest = ways[ways.len() - 1].brightest();
        let width = side as usize;
        let apart = |i: usize, j: usize| i.abs_diff(j);
        let beside =
            |i: usize| apart(i % width, brightest % width).pow(2) + apart(i / width, brightest / width).pow(2) > 9;
        let of_first = ways[0].variance(images, beside);
        let first = ways[0].seconds;
        for way in &ways {
            let of_this = way.variance(images, beside);
            let gain = |i: usize| of_first[i] * first / (of_this[i] * way.seconds);
            let [mean, variance, ..] = of_this;
            let paths = images * f64::from(spp) * way.sums.len() as f64;
            println!(
                "| {} | {} | {} | {:.2} | {mean:.5} | {variance:.2e} | {:.2} | {:.2} | {:.2} |",
                way.integrator,
                way.estimator.name(),
                way.sampler.name(),
                way.seconds / paths * 1e6,
                gain(1),
                gain(2),
                gain(3)
            );
        }
    }
    Ok(())
}
