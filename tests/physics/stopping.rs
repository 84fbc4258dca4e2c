//! What stopping by noise (`--noise`) does to the mean: samples that decide when to stop are not independent of their mean.

use vdf::{
    render::{NoiseLimit, PrepareOptions, PreparedScene, Quiet, RenderOptions},
    scene::PixelRect,
    visibility::Method,
};

use crate::common::builtin;

fn mean_and_standard_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
    (mean, (squares / (n - 1.0) / n).sqrt())
}

/// The mean of all pixels of one tile over many seeds, rendered to a limit and with a fixed number of samples, and their standard errors, all over
/// the latter.
fn bias(scene: &str, way: &RenderOptions, limit: f64, most: u32, seeds: u64) -> (f64, f64, f64) {
    let scene = builtin(scene, &[("width", "64"), ("height", "64")]);
    let prepared =
        PreparedScene::new(scene, &PrepareOptions::with_method(Method::NONE), &Quiet).expect("a sound scene");
    let mean = |noise: Option<NoiseLimit>, spp: u32, seed: u64| {
        let crop = Some(PixelRect { x0: 28, y0: 28, x1: 36, y1: 36 });
        let options = RenderOptions { spp: Some(spp), seed: Some(seed), crop, noise, ..way.clone() };
        let image = prepared.render(&options, &Quiet).expect("usable options").image;
        image.pixels.iter().map(|p| f64::from(p.element_sum())).sum::<f64>()
    };
    let stopped: Vec<f64> = (0..seeds).map(|seed| mean(Some(limit.try_into().expect("a limit")), most, seed)).collect();
    let fixed: Vec<f64> = (0..seeds).map(|seed| mean(None, 64, seeds + seed)).collect();
    let ((a, error_a), (b, error_b)) = (mean_and_standard_error(&stopped), mean_and_standard_error(&fixed));
    (a / b - 1.0, error_a.hypot(error_b) / b, error_a * (seeds as f64).sqrt() / b)
}

/// Five standard errors, a false alarm of 6·10⁻⁷ a case, and a bias of a 20th of the limit: what is documented.
#[test]
fn stopping_by_noise_moves_the_mean_by_little() {
    for (scene, limit) in [("cbox_vol2", 0.2), ("cbox_vol4", 0.2)] {
        let (bias, error, _) = bias(scene, &RenderOptions::default(), limit, 256, 32);
        println!("{scene}, noise {limit}: the mean is off by {:.2} ± {:.2} %", 100.0 * bias, 100.0 * error);
        assert!(bias.abs() < limit / 20.0 + 5.0 * error, "{scene}: {bias} ± {error}");
        assert!(error < limit / 20.0, "too noisy to tell: {error}");
    }
}

/// The figures of `docs/accuracy.md`.
#[test]
#[ignore = "minutes: for the table in docs/accuracy.md"]
fn bias_of_stopping_by_noise() {
    println!("| scene | limit | estimator, sampler | bias of the mean, % | standard deviation of a tile's mean, % |");
    println!("| --- | --- | --- | --- | --- |");
    for (scene, limits) in [
        ("cbox_vol2", &[0.4, 0.2, 0.1][..]),
        ("cbox_vol4", &[0.4, 0.2]),
        ("cbox_light", &[0.4, 0.2]),
        ("scape", &[0.2, 0.1]),
    ] {
        for (&limit, way) in
            limits.iter().flat_map(|limit| [RenderOptions::default(), RenderOptions::thesis()].map(|way| (limit, way)))
        {
            let names = format!("{}, {}", way.estimator.name(), way.sampler.name());
            let (bias, error, spread) = bias(scene, &way, limit, 1 << 12, 200);
            let [bias, error, spread] = [bias, error, spread].map(|x| 100.0 * x);
            println!("| `{scene}` | {limit} | {names} | {bias:.2} ± {error:.2} | {spread:.2} |");
        }
    }
}
