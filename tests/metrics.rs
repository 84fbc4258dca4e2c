//! The metrics of `vdf compare` against NVIDIA's flip-evaluator, scikit-image and numpy; see tests/metrics/README.md.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::path::{Path, PathBuf};

use serde_json::Value;
use vdf::{
    image::metrics::{Comparison, DynamicRange, PIXELS_PER_DEGREE, compare, hdr_flip, magma},
    image::{ImageFormat, read_exr, read_image},
};

/// FLIP is computed in single precision here and there, with sums in another order. Near 0 both of its powers magnify rounding: a colour
/// difference wrong by δ is wrong by 0.95/(0.4·c_max)·δ^0.7 in the map, for δ = 1e-5 (an ulp of lightness 100) by 2e-5; a feature
/// difference wrong by 1e-8 moves the exponent by √(1e-8/√2) = 8e-5 and the map by up to 8e-5/e = 3e-5. Found were at most 4e-6.
const PIXEL_TOLERANCE: f32 = 5e-5;

/// Relative, of means: the errors of pixels have no common sign, and few differences are near 0. Found were at most 5e-7.
const MEAN_TOLERANCE: f64 = 5e-6;

/// Relative, of figures in double precision. Displayed values, and linear ones of a PNG, go through the sRGB curve in single precision
/// here: wrong by 2e-7, where errors are 0.02 and more. Found were at most 2e-7.
const FIGURE_TOLERANCE: f64 = 2e-6;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/metrics/references")
}

fn references() -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder().join("figures.json")).unwrap()).unwrap()
}

fn close(name: &str, got: f64, expected: &Value, tolerance: f64) {
    let expected = expected.as_f64().unwrap();
    println!("{name}: {got:.9} expected {expected:.9}, relative error {:.1e}", (got - expected).abs() / expected);
    assert!((got - expected).abs() <= tolerance * expected.abs(), "{name}: {got} instead of {expected}");
}

fn check(name: &str) {
    let close = |metric: &str, got, expected, tolerance| close(&format!("{name}, {metric}"), got, expected, tolerance);
    let references = references();
    let pair = references["pairs"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap();
    let read = |role: &str| read_image(&folder().join(pair[role].as_str().unwrap())).unwrap();
    let ((image, format), (reference, _)) = (read("image"), read("reference"));
    let range = if format == ImageFormat::Exr { DynamicRange::High } else { DynamicRange::Low };
    let figures = |ppd| -> Comparison { compare(&image, &reference, range, ppd).unwrap() };
    let c = figures(PIXELS_PER_DEGREE);
    close("mse", c.mse, &pair["mse"], FIGURE_TOLERANCE);
    close("mae", c.mae, &pair["mae"], FIGURE_TOLERANCE);
    close("relmse", c.rel_mse, &pair["relmse"], FIGURE_TOLERANCE);
    close("psnr", c.psnr, &pair["psnr"], FIGURE_TOLERANCE);
    close("ssim", c.ssim.unwrap(), &pair["ssim"], FIGURE_TOLERANCE);
    close("flip-ldr", c.flip_ldr, &pair["flip_ldr"]["default"], MEAN_TOLERANCE);
    let far = figures(30.0);
    close("flip-ldr at 30 ppd", far.flip_ldr, &pair["flip_ldr"]["30"], MEAN_TOLERANCE);

    let maps = read_exr(&folder().join(format!("{name}_maps.exr"))).unwrap();
    let same_map = |got: &[f32], expected: &[f32]| {
        let worst = got.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        println!("{name}, largest difference of a pixel of the map: {worst:.1e}");
        assert!(worst <= PIXEL_TOLERANCE, "{worst}");
    };
    let (ldr, hdr): (Vec<f32>, Vec<f32>) = maps.pixels.iter().map(|p| (p.x, p.y)).unzip();
    same_map(&vdf::image::metrics::ldr_flip(&image, &reference, PIXELS_PER_DEGREE).unwrap().values, &ldr);
    assert_eq!(c.flip_hdr.is_some(), pair.get("flip_hdr").is_some());
    let (Some(flip), Some(flip_far)) = (c.flip_hdr, far.flip_hdr) else { return };
    close("flip-hdr", flip, &pair["flip_hdr"]["default"], MEAN_TOLERANCE);
    close("flip-hdr at 30 ppd", flip_far, &pair["flip_hdr"]["30"], MEAN_TOLERANCE);
    same_map(&c.map.values, &hdr);
    let exposures = hdr_flip(&image, &reference, PIXELS_PER_DEGREE).unwrap().exposures;
    let expected: Vec<f64> = pair["exposures"].as_array().unwrap().iter().map(|e| e.as_f64().unwrap()).collect();
    // Their logarithms are in single precision.
    assert!(
        (exposures.start - expected[0]).abs() < 1e-5 && (exposures.stop - expected[1]).abs() < 1e-5,
        "{exposures:?}"
    );
    assert_eq!(f64::from(exposures.count), expected[2]);
}

#[test]
fn noise_of_a_render() {
    check("noise");
}

#[test]
fn blurred_and_tinted_edges() {
    check("edges");
}

#[test]
fn highlights_that_moved() {
    check("highlights");
}

#[test]
fn colours_of_the_map() {
    let references = references();
    let colours = references["colours"].as_array().unwrap();
    assert!(colours.len() > 20);
    for sample in colours {
        let sample: Vec<f64> = sample.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
        // Their bytes are rounded, the library's cut off.
        let got = magma(sample[0] as f32).map(f64::from);
        assert!(
            got.iter().zip(&sample[1..]).all(|(got, want)| [0.0, 1.0].contains(&(want - got))),
            "{got:?} {sample:?}"
        );
    }
}
