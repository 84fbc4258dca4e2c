//! Agreement with Mitsuba 3 `volpath`, without Python: its images lie in `tests/mitsuba/references` (see the README there).
//!
//! Means over blocks of 8 × 8 pixels are compared by z = (ours − theirs)/√(variance of both means). Next-event estimation towards
//! a point light in fog has infinite variance close to the light, so blocks whose reference is not known to 1 % are left out; the rest is close
//! to normal. A comparison fails beyond 5σ: 6·10⁻⁷ each, 10⁻³ for all 1300 together, if the errors were exactly normal. The mean
//! of z² over a scene must stay below 2.1: the channels of a block vary together, so about 60 values are independent, each Student's t² with 31
//! degrees of freedom (mean 1.07, standard deviation 1.6); their mean has the standard deviation 0.2, and 2.1 is 5 of these. Seeds are
//! fixed, so a test that passes keeps passing.

mod common;

use std::path::Path;

use common::{builtin, options, rendered};
use vdf::render::{Image, Method, RenderOptions, read_exr};

const BLOCK: u32 = 8;
const SEEDS: u32 = 32;

fn reference(name: &str) -> Image {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mitsuba/references");
    read_exr(&folder.join(format!("{name}.exr"))).expect("the reference is in the repository")
}

/// Sums over the blocks, channel by channel, divided by `divisor`.
fn blocks(image: &Image, divisor: f64) -> Vec<f64> {
    let across = image.width / BLOCK;
    let mut sums = vec![0.0; (across * (image.height / BLOCK) * 3) as usize];
    for (i, p) in (0..).zip(&image.pixels) {
        let (x, y) = (i % image.width, i / image.width);
        let block = y / BLOCK * across + x / BLOCK;
        for (c, v) in (0..).zip(p.to_array()) {
            sums[(block * 3 + c) as usize] += f64::from(v) / divisor;
        }
    }
    sums
}

/// The values of both renderers for the blocks and channels that are known well enough.
struct Blocks {
    theirs: Vec<f64>,
    their_variance: Vec<f64>,
    /// One list of blocks for each seed.
    ours: Vec<Vec<f64>>,
}

fn render_blocks(name: &str, depth: u32, spp: u32) -> Blocks {
    let pixels = f64::from(BLOCK * BLOCK);
    let theirs = blocks(&reference(&format!("{name}_d{depth}_mean")), pixels);
    // Pixels are independent: the variance of a mean of n is the sum of theirs over n².
    let their_variance = blocks(&reference(&format!("{name}_d{depth}_var")), pixels * pixels);
    let known: Vec<usize> = (0..theirs.len()).filter(|&i| their_variance[i].sqrt() <= 0.01 * theirs[i]).collect();
    assert!(known.len() > 100, "{name}, max_depth {depth}: only {} blocks are known well enough", known.len());

    let defines = [("width", "64"), ("height", "64"), ("max_depth", &*depth.to_string()), ("rr_depth", "100")];
    let scene = builtin(name, &defines);
    let keep = |all: &[f64]| known.iter().map(|&i| all[i]).collect::<Vec<_>>();
    let ours = (0..SEEDS).map(|seed| {
        let o = RenderOptions { method: Method::default(), seed: Some(u64::from(seed)), spp: Some(spp), ..options() };
        keep(&blocks(&rendered(&scene, &o).image, pixels))
    });
    Blocks { ours: ours.collect(), theirs: keep(&theirs), their_variance: keep(&their_variance) }
}

/// (ours − theirs) in standard errors, ours being the mean of one value a seed.
fn z(ours: &[f64], theirs: f64, their_variance: f64) -> f64 {
    let n = ours.len() as f64;
    let mean = ours.iter().sum::<f64>() / n;
    let variance = ours.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0));
    (mean - theirs) / (variance + their_variance).sqrt()
}

fn every_block_agrees(name: &str, depth: u32) {
    let b = render_blocks(name, depth, 16);
    let z: Vec<f64> = (0..b.theirs.len())
        .map(|i| z(&b.ours.iter().map(|seed| seed[i]).collect::<Vec<_>>(), b.theirs[i], b.their_variance[i]))
        .collect();
    let worst = z.iter().copied().fold(0.0, |a: f64, b| a.max(b.abs()));
    let mean_z2 = z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
    println!("{name}, max_depth {depth}: {} comparisons, worst |z| {worst:.2}, mean z² {mean_z2:.2}", z.len());
    assert!(worst < 5.0, "{name}, max_depth {depth}: a block is {worst:.2} standard errors off");
    assert!(mean_z2 < 2.1, "{name}, max_depth {depth}: mean z² is {mean_z2:.2}");
}

/// Where light is often scattered close to the light, every block has a heavy tail: contributions grow as 1/r² where events become
/// rare as r², so their variance is infinite and block means are far from normal (two of our own renders differ by 5 of the standard errors
/// that their samples suggest). The mean over all blocks, each weighted by what is known of it, is close enough to normal to be compared.
fn the_mean_agrees(name: &str, depth: u32) {
    let b = render_blocks(name, depth, 32);
    let weighted =
        |values: &[f64]| -> f64 { values.iter().zip(&b.their_variance).map(|(v, variance)| v / variance).sum() };
    let ours: Vec<f64> = b.ours.iter().map(|seed| weighted(seed)).collect();
    // Σ v/σ² has the variance Σ 1/σ²; the three channels of a block vary together, which makes it up to three times that.
    let their_variance = 3.0 * b.their_variance.iter().map(|v| 1.0 / v).sum::<f64>();
    let z = z(&ours, weighted(&b.theirs), their_variance);
    let ratio = ours.iter().sum::<f64>() / (ours.len() as f64 * weighted(&b.theirs));
    println!("{name}, max_depth {depth}: mean over {} blocks, ours/theirs {ratio:.4}, z {z:.2}", b.theirs.len());
    assert!(z.abs() < 5.0, "{name}, max_depth {depth}: the mean is {z:.2} standard errors off");
}

#[test]
fn single_scattering_agrees_with_mitsuba() {
    for name in ["cbox_vol2", "cbox_vol3", "cbox_vol4", "cbox_vol6"] {
        every_block_agrees(name, 2);
    }
}

#[test]
fn multiple_scattering_agrees_with_mitsuba() {
    for name in ["cbox_vol2", "cbox_vol3", "cbox_vol6"] {
        every_block_agrees(name, 8);
    }
    the_mean_agrees("cbox_vol4", 8);
}
