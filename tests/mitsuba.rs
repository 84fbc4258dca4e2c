//! Agreement with Mitsuba 3 `volpath`, without Python: its images lie in `tests/mitsuba/references` (see the README there).
//!
//! Each scene is rendered at one or two depths in two ways: as users get it, and as Mitsuba looks for light. The other ways are a test of their own, which takes longer:
//! `cargo test --test mitsuba -- --ignored --nocapture`.
//! The film is cut into 8 × 8 blocks. Four things are asked of each of these 66 renders, and of the 126 of the longer test, channel by channel:
//!
//! - *every block*: z = (ours − theirs)/√(variance of both means) stays below 5.3. If the errors were exactly normal, one of the 12,000
//!   comparisons would fail by chance with a probability of 1.3·10⁻³.
//! - *all blocks together*: the mean of z². The channels of a block vary together, so that no more than its blocks are surely independent: the limit
//!   is the value that the mean of as many squared normal variables exceeds with a probability of 2·10⁻⁵ (66 tests: 1.3·10⁻³).
//! - *the image*: the mean over the blocks of ours/theirs, each channel, is within 4.5 standard errors of 1 (198 tests: 1.3·10⁻³).
//! - *the variance* of a sample, in the geometric mean over the blocks: as Mitsuba looks for light it is theirs within 4.5 standard errors, and not above theirs by more than
//!   these where the transmittance is computed instead. They are estimated from how the blocks differ (20 tests of Student's t with 63 degrees
//!   of freedom: 6·10⁻⁴; in the longer test 20 one-sided ones: 3·10⁻⁴).
//!
//! Mitsuba's connections to a light end at 1 − ε of their length, lest they hit the light, and so does the fog on them: what arrives is too much by a factor of up to
//! exp(ε τ), τ being the optical depth of the connection, 0.36 % at τ = 4. (A plane under a point light in fog that absorbs, τ = 4: Mitsuba's llvm_ad_rgb gives
//! 1.00345 ± 0.0005 times the closed form.) So ours are expected between theirs and that much less, for the longest connection that there may be, and z counts from there.
//!
//! Next-event estimation towards a point light in fog has infinite variance close to the light, so blocks whose reference is not known to
//! 1 % are left out (5 % where only the image is compared). Seeds are fixed, so a test that passes keeps passing. `VDF_MITSUBA_SAMPLES=16` takes 16 times as many samples.

mod common;

use std::path::{Path, PathBuf};

use common::{Options, builtin, options, rendered};
use vdf::{
    geometry::Bounds,
    image::{Image, read_exr},
    render::{Estimator, Integrator, SamplerKind, TransmittanceEstimator},
    scene::{Extinction, LoadOptions, Scene},
    visibility::Method,
};

/// Blocks along each side of the film.
const GRID: usize = 8;
/// Renders of each scene, from whose spread our variance is estimated.
const SEEDS: u32 = 8;

/// What of a scene is compared.
#[derive(Clone, Copy, PartialEq)]
enum Compared {
    Everything,
    /// All but the variance.
    Means,
    /// The mean of the image only.
    Image,
}
use Compared::{Everything, Image as OnlyImage, Means};

/// How light is looked for.
#[derive(Clone, Copy)]
struct Way {
    integrator: Integrator,
    transmittance: TransmittanceEstimator,
    estimator: Estimator,
    sampler: SamplerKind,
}

impl Way {
    /// As Mitsuba does it.
    const ALIKE: Self = Self { transmittance: TransmittanceEstimator::Analog, ..Self::THESIS };
    /// As the thesis does it: with the transmittance towards the light computed.
    const THESIS: Self = Self {
        integrator: Integrator::Volpath,
        transmittance: TransmittanceEstimator::Analytic,
        estimator: Estimator::Thesis,
        sampler: SamplerKind::Independent,
    };
    /// What users get.
    const DEFAULT: Self = Self { estimator: Estimator::Equiangular, sampler: SamplerKind::Sobol, ..Self::THESIS };

    /// Whether its variance is known to be Mitsuba's, or less.
    fn is_as_noisy(&self) -> bool {
        (self.integrator, self.estimator, self.sampler)
            == (Integrator::Volpath, Estimator::Thesis, SamplerKind::Independent)
    }

    fn name(&self) -> String {
        let Self { integrator, transmittance, estimator, sampler } = self;
        format!("{integrator}, {}, {}, {}", transmittance.name(), estimator.name(), sampler.name())
    }
}

struct Case {
    scene: &'static str,
    depth: i32,
    compared: Compared,
}

const fn case(scene: &'static str, depth: i32, compared: Compared) -> Case {
    Case { scene, depth, compared }
}

const CASES: [Case; 33] = [
    case("cbox_vol2", 2, Everything),
    case("cbox_vol3", 2, Everything),
    case("cbox_vol4", 2, Everything),
    case("cbox_vol6", 2, Everything),
    // Scattered twice or more, light from a point light in fog has infinite variance everywhere: contributions grow as 1/r² where events
    // become rare as r². An estimate of it says nothing.
    case("cbox_vol2", 8, Means),
    case("cbox_vol3", 8, Means),
    // Here that is most of the light, or the whole room sees it: block means are far from normal (two of our own renders of `cbox_vol4` differ by
    // 5 of the standard errors that their samples suggest).
    case("cbox_vol6", 8, OnlyImage),
    case("cbox_vol4", 8, OnlyImage),
    case("area_light", 2, Everything),
    case("area_light", 8, Everything),
    case("sky", 3, Everything),
    case("sky", -1, Everything),
    case("forward", 3, Everything),
    case("forward", -1, Everything),
    case("backward", 2, Everything),
    case("backward", 8, Everything),
    case("outside", 2, Everything),
    case("outside", 8, Everything),
    case("touching", 3, Everything),
    case("touching", -1, Everything),
    case("nested", 2, Everything),
    case("nested", -1, Everything),
    case("rock", 2, Everything),
    case("rock", 8, Everything),
    // Mitsuba splats a sample over many pixels, vdf draws it for one: another variance.
    case("cropped", 3, Means),
    // A plugin or two in each place of the picture: other samplers, other variances.
    case("curved", 8, Means),
    case("textures", 8, Means),
    // Mitsuba tracks through a grid, vdf integrates: another variance.
    case("grids", 8, Means),
    case("colours", 8, Means),
    // Facets are drawn otherwise than by Mitsuba: another variance.
    case("metals_and_coats", -1, Means),
    case("glass_blocks", -1, Means),
    case("disney", 8, Means),
    case("turned", 4, Means),
];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mitsuba")
}

fn record() -> serde_json::Value {
    let text = std::fs::read_to_string(folder().join("references/references.json")).expect("it is in the repository");
    serde_json::from_str(&text).expect("it is JSON")
}

/// Means over the blocks of a render, three channels each, from independent samples.
struct Blocks {
    mean: Vec<f64>,
    /// Of these means.
    variance: Vec<f64>,
    /// How many samples each mean has.
    samples: f64,
}

/// The mean over each block, channel by channel, divided by `divisor`.
fn blocks(width: usize, pixels: &[[f64; 3]]) -> Vec<f64> {
    let (columns, rows) = (width / GRID, pixels.len() / width / GRID);
    assert_eq!(columns * rows * GRID * GRID, pixels.len(), "the film can be cut into blocks");
    let mut sums = vec![0.0; GRID * GRID * 3];
    for (i, p) in pixels.iter().enumerate() {
        let block = i / width / rows * GRID + i % width / columns;
        for (c, v) in p.iter().enumerate() {
            sums[block * 3 + c] += v / (columns * rows) as f64;
        }
    }
    sums
}

/// Pixels in double precision, without `border` columns and rows on every side; and how many are in a row.
fn pixels(image: &Image, border: u32) -> (usize, Vec<[f64; 3]>) {
    let inside = |n: u32, size: u32| n >= border && n < size - border;
    let kept = (0..)
        .zip(&image.pixels)
        .filter(|&(i, _)| inside(i % image.width, image.width) && inside(i / image.width, image.height));
    ((image.width - 2 * border) as usize, kept.map(|(_, p)| p.to_array().map(f64::from)).collect())
}

fn theirs(key: &str, record: &serde_json::Value) -> Blocks {
    let read = |what: &str| {
        let path = folder().join(format!("references/{key}_{what}.exr"));
        let (width, pixels) = pixels(&read_exr(&path).expect("the reference is in the repository"), 0);
        (blocks(width, &pixels), pixels.len() / (GRID * GRID))
    };
    let ((mean, _), (variance, kept)) = (read("mean"), read("var"));
    let number = |name: &str| record[key][name].as_f64().expect("it is recorded");
    let seeds: f64 = record[key]["seeds"].as_str().and_then(|s| s.strip_prefix("1..")?.parse().ok()).expect("1..n");
    Blocks {
        mean,
        // Where pixels are kept they are independent: the variance of a mean of n is the sum of theirs over n².
        variance: variance.iter().map(|v| v / kept as f64).collect(),
        samples: seeds * number("spp_per_seed") * number("width") * number("height") / (GRID * GRID) as f64,
    }
}

fn load(name: &str, depth: i32) -> Scene {
    // As the references were made: no Russian roulette where the depth is limited.
    let (max_depth, rr_depth) = (depth.to_string(), if depth < 0 { 5 } else { depth }.to_string());
    let mut defines = vec![("max_depth", &*max_depth), ("rr_depth", &*rr_depth)];
    if name.starts_with("cbox") {
        defines.extend([("width", "64"), ("height", "64")]);
        return builtin(name, &defines);
    }
    let defines = defines.iter().map(|&(k, v)| (k.to_owned(), v.to_owned())).collect();
    Scene::load(&folder().join(format!("scenes/{name}.xml")), &LoadOptions { defines, ..LoadOptions::default() })
        .expect("the scene loads")
}

fn ours(case: &Case, scene: &Scene, way: Way) -> Blocks {
    let longer =
        std::env::var("VDF_MITSUBA_SAMPLES").map_or(1, |n| n.parse().expect("VDF_MITSUBA_SAMPLES is a number"));
    let spp = if case.scene.starts_with("cbox") { 16 } else { 32 } * longer;
    let border = if case.scene == "cropped" { 4 } else { 0 };
    let Way { integrator, transmittance, estimator, sampler } = way;
    let mut width = 0;
    let renders: Vec<_> = (0..SEEDS)
        .map(|seed| {
            let o = Options {
                method: Method::default(),
                integrator,
                transmittance,
                estimator,
                sampler,
                seed: Some(seed.into()),
                spp: Some(spp),
                ..options()
            };
            let (row, pixels) = pixels(&rendered(scene, &o).image, border);
            width = row;
            pixels
        })
        .collect();
    let n = f64::from(SEEDS);
    let mean: Vec<[f64; 3]> = (0..renders[0].len())
        .map(|i| std::array::from_fn(|c| renders.iter().map(|r| r[i][c]).sum::<f64>() / n))
        .collect();
    // Pixels are independent, so the spread of each is used: the variance is known from 36 times as many values as blocks would give.
    let variance: Vec<[f64; 3]> = (0..mean.len())
        .map(|i| {
            std::array::from_fn(|c| {
                renders.iter().map(|r| (r[i][c] - mean[i][c]).powi(2)).sum::<f64>() / (n * (n - 1.0))
            })
        })
        .collect();
    let pixels_of_block = (mean.len() / (GRID * GRID)) as f64;
    Blocks {
        mean: blocks(width, &mean),
        variance: blocks(width, &variance).iter().map(|v| v / pixels_of_block).collect(),
        samples: pixels_of_block * n * f64::from(spp),
    }
}

/// ε: `math::ShadowEpsilon` of Mitsuba 3.9.1 in single precision.
const SHADOW_EPSILON: f64 = 15_000.0 / 16_777_216.0;

/// The share by which Mitsuba's light may be too much: by the greatest optical depth through all homogeneous media that triangles bound. Of other media nothing is
/// assumed.
fn largest_excess(scene: &Scene) -> f64 {
    let depth = |boundary: &vdf::scene::Boundary| match scene.media[boundary.interior?.0 as usize].sigma_t {
        Extinction::Constant(sigma_t) if !boundary.triangles.is_empty() => {
            Some(sigma_t.max_element() * Bounds::of_triangles(&boundary.triangles).extent().length())
        }
        _ => None,
    };
    let depth: f64 = scene.boundaries.iter().filter_map(depth).sum();
    -(-SHADOW_EPSILON * depth).exp_m1()
}

/// The share by which Mitsuba's light may be too little. In `curved` its lamp, seen through a part of a sphere of fog at depth 1, is 0.46 ± 0.08 % fainter than by Beer–Lambert
/// and quadrature over the pixels, and ours is not (24 × 8192 samples a pixel; without fog both agree). Why is not known.
fn largest_lack(case: &Case) -> f64 {
    if case.scene == "curved" { 5e-3 } else { 0.0 }
}

/// By how much `ours` is more than `theirs` with all that it may lack, or less than that without the excess that it may have.
fn beyond(ours: f64, theirs: f64, [lack, excess]: [f64; 2]) -> f64 {
    (ours - theirs * (1.0 + lack)).max(0.0) + (ours - theirs * (1.0 - excess)).min(0.0)
}

/// How two renderers' blocks compare.
struct Comparison {
    /// (ours − theirs) in standard errors, for each block and channel that is known well enough.
    z: Vec<f64>,
    /// How many of these blocks have noise at all.
    noisy_blocks: usize,
    /// Mean over the blocks of ours/theirs.
    ratio: f64,
    /// (mean over the blocks of ours/theirs − 1) in standard errors, for the worst channel.
    image_z: f64,
    /// ln of our variance of a sample over theirs: mean over the blocks, and its standard error.
    log_variance: (f64, f64),
}

/// Mitsuba sums up to 1024 samples in single precision, each sum rounding by 2⁻²⁵ on the average.
const ROUNDING: f64 = 1.0 / 32_768.0;

/// Blocks whose reference is not known so well are left out. Where single blocks are not compared it may be worse: a ratio to a mean with the
/// relative error e is too large by e², less than 3·10⁻³ of it at the worst and below the standard error of the image in `cbox_vol4`, 4·10⁻³.
fn largest_error(compared: Compared) -> f64 {
    if compared == OnlyImage { 0.05 } else { 0.01 }
}

fn compare(ours: &Blocks, theirs: &Blocks, off: [f64; 2], compared: Compared) -> Comparison {
    let known = |i: &usize| theirs.variance[*i].sqrt() <= largest_error(compared) * theirs.mean[*i];
    // A block that sees only the background has no noise.
    let noisy = |i: &usize| known(i) && theirs.variance[*i] > 0.0 && ours.variance[*i] > 0.0;
    let all = 0..GRID * GRID * 3;

    let mut exact = 0;
    let mut z = Vec::new();
    for i in all.clone().filter(known) {
        let difference = beyond(ours.mean[i], theirs.mean[i], off);
        if noisy(&i) {
            z.push(difference / (ours.variance[i] + theirs.variance[i]).sqrt());
        } else {
            let noise = 5.3 * (ours.variance[i] + theirs.variance[i]).sqrt();
            let close = difference.abs() <= ROUNDING * theirs.mean[i] + noise;
            assert!(close, "block {i}: {} for {}", ours.mean[i], theirs.mean[i]);
            exact += 1;
        }
    }
    assert!(z.len() + exact > 100, "only {} blocks are known well enough", z.len());

    let channel = |c: usize| {
        let blocks: Vec<_> = all.clone().filter(|i| i % 3 == c && noisy(i)).collect();
        let n = blocks.len() as f64;
        let ratio = blocks.iter().map(|&i| ours.mean[i] / theirs.mean[i]).sum::<f64>() / n;
        let variance = blocks.iter().map(|&i| (ours.variance[i] + theirs.variance[i]) / theirs.mean[i].powi(2));
        (ratio, beyond(ratio, 1.0, off) / (variance.sum::<f64>() / (n * n)).sqrt())
    };
    let channels = [0, 1, 2].map(channel);

    let log_ratio = |i: usize| (ours.variance[i] * ours.samples / (theirs.variance[i] * theirs.samples)).ln();
    // One value a block: its channels vary together.
    let logs: Vec<f64> = (0..GRID * GRID)
        .filter_map(|block| {
            let channels: Vec<_> = (3 * block..3 * block + 3).filter(noisy).map(log_ratio).collect();
            (!channels.is_empty()).then(|| channels.iter().sum::<f64>() / channels.len() as f64)
        })
        .collect();
    let n = logs.len() as f64;
    let mean = logs.iter().sum::<f64>() / n;
    let spread = logs.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0));

    Comparison {
        z,
        noisy_blocks: logs.len(),
        ratio: channels.iter().map(|c| c.0).sum::<f64>() / 3.0,
        image_z: channels.iter().map(|c| c.1).fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a }),
        log_variance: (mean, spread.sqrt()),
    }
}

impl Comparison {
    fn worst(&self) -> f64 {
        self.z.iter().fold(0.0, |a: f64, z| a.max(z.abs()))
    }

    fn mean_z2(&self) -> f64 {
        self.z.iter().map(|z| z * z).sum::<f64>() / self.z.len() as f64
    }

    /// What the mean of z² exceeds with a probability of 2·10⁻⁵ (4.11σ): χ²/n by Wilson and Hilferty's approximation.
    fn limit_of_mean_z2(&self) -> f64 {
        let v = 2.0 / (9.0 * self.noisy_blocks as f64);
        (1.0 - v + 4.11 * v.sqrt()).powi(3)
    }

    fn row(&self, case: &Case, way: Way) -> String {
        let beyond = self.z.iter().filter(|z| z.abs() > 3.0).count();
        let (log, error) = self.log_variance;
        format!(
            "| {} | {} | {} | {} | {beyond} | {:.1} | {:.2} | {:.2} | {:.2} | {:.4} | {:+.2} | {:.3} ± {:.3} |",
            case.scene,
            case.depth,
            way.name(),
            self.z.len(),
            0.0027 * self.z.len() as f64,
            self.worst(),
            self.mean_z2(),
            self.limit_of_mean_z2(),
            self.ratio,
            self.image_z,
            log.exp(),
            log.exp() * error,
        )
    }

    /// What is wrong, in words.
    fn complaints(&self, case: &Case, way: Way) -> Vec<String> {
        let mut found = Vec::new();
        let mut expect = |holds: bool, what: String| {
            if !holds {
                found.push(format!("{}, max_depth {}, {}: {what}", case.scene, case.depth, way.name()));
            }
        };
        expect(self.image_z.abs() < 4.5, format!("the image is {:.2} standard errors off", self.image_z));
        if case.compared != OnlyImage {
            let (worst, mean_z2) = (self.worst(), self.mean_z2());
            expect(worst < 5.3, format!("a block is {worst:.2} standard errors off"));
            expect(mean_z2 < self.limit_of_mean_z2(), format!("mean z² is {mean_z2:.2}"));
        }
        if case.compared == Everything && way.is_as_noisy() {
            let (log, error) = self.log_variance;
            let off = if way.transmittance == TransmittanceEstimator::Analog { log.abs() } else { log };
            expect(off < 4.5 * error, format!("our variance is {:.3} of theirs", log.exp()));
        }
        found
    }
}

const HEAD: &str = "| scene | max_depth | way | blocks × channels | beyond 3σ | by chance | worst | mean z² | limit | ours/theirs | its z | variance of a sample, ours/theirs |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |";

/// Compares a render with a reference, prints the row of the table, and returns what is wrong.
fn check(case: &Case, reference: &str, way: Way, record: &serde_json::Value) -> Vec<String> {
    let scene = load(case.scene, case.depth);
    let off = [largest_lack(case), largest_excess(&scene)];
    let comparison = compare(&ours(case, &scene, way), &theirs(reference, record), off, case.compared);
    println!("{}", comparison.row(case, way));
    comparison.complaints(case, way)
}

/// Renders all cases in all of the ways that `ways` gives them.
fn check_all(ways: impl Fn(&Case) -> Vec<Way>) {
    let record = record();
    let mut complaints = Vec::new();
    println!("{HEAD}");
    for case in &CASES {
        let reference = format!("{}_d{}", case.scene, case.depth);
        for way in ways(case) {
            complaints.extend(check(case, &reference, way, &record));
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn every_scene_agrees_with_mitsuba() {
    check_all(|_| vec![Way::DEFAULT, Way::ALIKE]);
}

/// Estimators and samplers apart from each other; and `raymarch`, where light is scattered once, so that both integrators have one mean.
#[test]
#[ignore = "two minutes"]
fn every_way_agrees_with_mitsuba() {
    let volpath = [
        Way::THESIS,
        Way { sampler: SamplerKind::Sobol, ..Way::THESIS },
        Way { sampler: SamplerKind::Independent, ..Way::DEFAULT },
    ];
    let integrator = Integrator::raymarch(8);
    let raymarch = Estimator::ALL.map(|estimator| Way { integrator, estimator, ..Way::DEFAULT });
    check_all(|case| volpath.iter().chain(raymarch.iter().filter(|_| case.depth == 2)).copied().collect());
}

/// Two closed cubes that share a face are the same media as one wall with a medium on each side (see `scenes/touching_cubes.xml`).
#[test]
fn closed_media_that_touch_need_no_reference_to_each_other() {
    let cubes = case("touching_cubes", -1, Everything);
    let complaints = check(&cubes, "touching_d-1", Way::DEFAULT, &record());
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn every_reference_is_compared() {
    let record = record();
    let mut recorded: Vec<_> = record.as_object().expect("a table").keys().cloned().collect();
    let mut compared: Vec<_> = CASES.iter().map(|c| format!("{}_d{}", c.scene, c.depth)).collect();
    recorded.sort();
    compared.sort();
    assert_eq!(recorded, compared);
}
