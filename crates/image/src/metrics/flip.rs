//! FLIP: the difference that one sees when two images alternate in place.
//!
//! *Idea.* At a distance eyes average small detail away, and colours more than brightness. So filter both images by
//! what eyes resolve, take the difference of colours in a space made for large differences, and amplify it where the
//! one has an edge or a point that the other has not.
//!
//! *Definition.* \[Andersson2020\], on linear RGB clamped to [0, 1]. Colour pipeline: the opponent colours are filtered
//! by the contrast sensitivity functions, which are sums of Gaussians Σ aᵢ √(π/bᵢ) exp(−π²d²/bᵢ) of the distance d in
//! degrees, cut at three standard deviations of the widest and normalised; the result is clamped to RGB's cube and
//! taken to CIELAB with the Hunt adjustment. The HyAB distance to the power 0.7 is mapped to [0, 1]: [0, 0.4·c]
//! linearly to [0, 0.95] and the rest up to c, the distance of green and blue, to [0.95, 1]. Feature pipeline:
//! luminance is filtered by the first and second derivatives of a Gaussian with the standard deviation 0.082/2 degrees,
//! whose positive weights sum to 1 and whose negative weights to −1. The gradients' lengths are compared: ΔE_f =
//! (max(|Δedge|, |Δpoint|)/√2)^0.5. The error is ΔE_c^(1 − ΔE_f).
//!
//! *Guarantee.* Agrees with NVIDIA's flip-evaluator 1.7 to the rounding of single precision, in which both compute. 0
//! where nothing differs. The same for any number of threads.
//!
//! *Cost.* 16 separable filters of about 20 weights a pair of images, six cube roots and two powers a pixel; rows in
//! parallel; 56 bytes a pixel.
//!
//! *Limits.* Knows nothing of masking. What a display cannot show does not count; see `hdr_flip` for more than it can.

use std::f64::consts::{PI, SQRT_2};

use glam::Vec3;
use rayon::prelude::*;

use super::{
    ErrorMap, check_pair,
    colour::{ColourSpaces, hyab},
    convolution::{add_column, add_row, pad},
};
use crate::{Image, ImageError, Rgb};

/// Pixels per degree of visual angle where FLIP is used without another: a display 0.7 m wide with 3840 pixels, 0.7 m
/// away.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;

/// One Gaussian (a, b) of a contrast sensitivity function; b in square degrees.
const ACHROMATIC: [f64; 2] = [1.0, 0.0047];
const RED_GREEN: [f64; 2] = [1.0, 0.0053];
/// This one has two.
const BLUE_YELLOW: [[f64; 2]; 2] = [[34.1, 0.04], [13.5, 0.025]];

/// Width of the feature detection filters in degrees: twice their standard deviation.
const FEATURE_WIDTH: f64 = 0.082;

/// The exponent q_c of colour differences, and the knee that they are mapped to [0, 1] with: p_c of the largest becomes
/// p_t.
const COLOUR_EXPONENT: f32 = 0.7;
const KNEE: f32 = 0.4;
const KNEE_VALUE: f32 = 0.95;

/// The rows that are kept after filtering along x: a channel of the opponent colour with one of the filters.
const ROWS: [(usize, Filter); 7] = [
    (0, Filter::Achromatic),
    (1, Filter::RedGreen),
    (2, Filter::BlueYellow0),
    (2, Filter::BlueYellow1),
    (0, Filter::Edge),
    (0, Filter::Point),
    (0, Filter::Gaussian),
];

/// What is made of them by filtering along y: which row, with which filter, goes into which result.
const COLUMNS: [(usize, Filter, usize); 8] = [
    (0, Filter::Achromatic, 0),
    (1, Filter::RedGreen, 1),
    (2, Filter::BlueYellow0, 2),
    (3, Filter::BlueYellow1, 2),
    (4, Filter::Gaussian, 3),
    (6, Filter::Edge, 4),
    (5, Filter::Gaussian, 5),
    (6, Filter::Point, 6),
];

/// The results: the filtered opponent colour, the edge along x and y, the point along x and y.
const RESULTS: usize = 7;

/// LDR-FLIP of every pixel, from 0 to 1. The images are linear; values outside [0, 1] are clamped. See the head of the
/// file.
///
/// `pixels_per_degree` is from 1 to 1000: how small pixels are to the observer. [`PIXELS_PER_DEGREE`] is usual.
///
/// # Errors
/// The images differ in size, have no pixels, or have one that is not finite; `pixels_per_degree` is out of range.
pub fn ldr_flip(image: &Image, reference: &Image, pixels_per_degree: f64) -> Result<ErrorMap, ImageError> {
    check_pair(image, reference)?;
    let mut flip = Flip::new(image.width, image.height, pixels_per_degree)?;
    let mut map = flip.empty_map();
    flip.evaluate(image, reference, |rgb| rgb.clamp(Rgb::ZERO, Rgb::ONE), &mut map.values);
    Ok(map)
}

#[derive(Clone, Copy, Debug)]
enum Filter {
    Achromatic,
    RedGreen,
    BlueYellow0,
    BlueYellow1,
    Gaussian,
    Edge,
    Point,
}

/// The filters and the memory to evaluate FLIP for images of one size.
pub(super) struct Flip {
    width: usize,
    height: usize,
    spaces: ColourSpaces,
    /// One axis of each filter, in the order of [`Filter`].
    filters: [Vec<f32>; 7],
    /// Largest radius of the filters.
    radius: usize,
    /// The largest colour difference to the power q_c.
    c_max: f32,
    /// [`ROWS`] of both images: those of one pixel row follow each other.
    rows: [Vec<f32>; 2],
}

impl Flip {
    pub(super) fn new(width: u32, height: u32, pixels_per_degree: f64) -> Result<Self, ImageError> {
        // Below 1 a filter is a single pixel, above 1000 it is larger than images are.
        if !(1.0..=1000.0).contains(&pixels_per_degree) {
            return Err(ImageError::PixelsPerDegree { value: pixels_per_degree });
        }
        let (width, height) = (width as usize, height as usize);
        let filters = filters(pixels_per_degree);
        let spaces = ColourSpaces::new();
        let [green, blue] = [Vec3::Y, Vec3::Z].map(|rgb| spaces.hunt_lab(spaces.opponent(rgb)));
        Ok(Self {
            width,
            height,
            spaces,
            radius: filters.iter().map(|f| f.len() / 2).max().unwrap_or(0),
            filters,
            c_max: hyab(green, blue).powf(COLOUR_EXPONENT),
            rows: [0, 1].map(|_| vec![0.0; ROWS.len() * width * height]),
        })
    }

    pub(super) fn empty_map(&self) -> ErrorMap {
        let [width, height] = [self.width, self.height].map(|n| n as u32);
        ErrorMap { width, height, values: vec![0.0; self.width * self.height] }
    }

    /// FLIP of every pixel, where `display` makes of a pixel what is displayed: linear RGB in [0, 1].
    pub(super) fn evaluate(
        &mut self,
        image: &Image,
        reference: &Image,
        display: impl Fn(Rgb) -> Rgb + Sync,
        errors: &mut [f32],
    ) {
        let mut rows = std::mem::take(&mut self.rows);
        for (rows, image) in rows.iter_mut().zip([image, reference]) {
            self.filter_rows(&image.pixels, &display, rows);
        }
        let stride = ROWS.len() * self.width;
        errors.par_chunks_mut(self.width).enumerate().for_each_init(
            || [0, 1].map(|_| vec![0.0; RESULTS * self.width]),
            |[a, b], (y, errors)| {
                for (results, rows) in [&mut *a, &mut *b].into_iter().zip(&rows) {
                    results.fill(0.0);
                    for (row, filter, result) in COLUMNS {
                        let row = |y: usize| &rows[y * stride + row * self.width..][..self.width];
                        let out = &mut results[result * self.width..][..self.width];
                        add_column(row, self.height, y, self.filter(filter), out);
                    }
                }
                for (x, error) in errors.iter_mut().enumerate() {
                    let [a, b] = [&*a, &*b].map(|r| std::array::from_fn(|i| r[i * self.width + x]));
                    *error = self.error(a, b);
                }
            },
        );
        self.rows = rows;
    }

    /// Filters all rows along x.
    fn filter_rows(&self, pixels: &[Rgb], display: impl Fn(Rgb) -> Rgb + Sync, rows: &mut [f32]) {
        let width = self.width;
        rows.par_chunks_mut(ROWS.len() * width).zip(pixels.par_chunks(width)).for_each_init(
            || ([vec![], vec![], vec![]], vec![Vec3::ZERO; width]),
            |(channels, opponent), (rows, pixels)| {
                opponent.iter_mut().zip(pixels).for_each(|(o, &rgb)| *o = self.spaces.opponent(display(rgb)));
                for (i, channel) in channels.iter_mut().enumerate() {
                    pad(opponent.iter().map(|o| o[i]), self.radius, channel);
                }
                rows.fill(0.0);
                for (out, (channel, filter)) in rows.chunks_mut(width).zip(ROWS) {
                    add_row(&channels[channel], self.radius, self.filter(filter), out);
                }
            },
        );
    }

    fn filter(&self, filter: Filter) -> &[f32] {
        &self.filters[filter as usize]
    }

    /// The error of one pixel from the results of filtering both images.
    fn error(&self, a: [f32; RESULTS], b: [f32; RESULTS]) -> f32 {
        let lab = |r: [f32; RESULTS]| self.spaces.hunt_lab(Vec3::new(r[0], r[1], r[2]));
        let colour = self.colour_error(hyab(lab(a), lab(b)));
        let length = |r: [f32; RESULTS], i: usize| (r[i] * r[i] + r[i + 1] * r[i + 1]).sqrt();
        let [edge, point] = [3, 5].map(|i| (length(a, i) - length(b, i)).abs());
        let feature = (edge.max(point) / SQRT_2 as f32).sqrt();
        colour.powf(1.0 - feature)
    }

    /// ΔE_c: the distance of colours, raised to a power that large distances are compressed by, and mapped to [0, 1].
    fn colour_error(&self, distance: f32) -> f32 {
        let power = distance.powf(COLOUR_EXPONENT);
        let knee = KNEE * self.c_max;
        if power < knee {
            KNEE_VALUE / knee * power
        } else {
            // No distance of displayable colours should be larger than that of green and blue; rounding must not make
            // it so.
            (KNEE_VALUE + (power - knee) / (self.c_max - knee) * (1.0 - KNEE_VALUE)).min(1.0)
        }
    }
}

/// One axis of each filter, in the order of [`Filter`].
fn filters(pixels_per_degree: f64) -> [Vec<f32>; 7] {
    let widest = BLUE_YELLOW.iter().fold(ACHROMATIC[1].max(RED_GREEN[1]), |widest, [_, b]| widest.max(*b));
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil();
    // A sum of Gaussians is separable one by one. The product of both axes should have the factor a·√(π/b), so each has
    // its root.
    let gaussian = |[a, b]: [f64; 2]| {
        let weight = |d: f64| (a * (PI / b).sqrt()).sqrt() * (-PI * PI * d * d / b).exp();
        sample(radius, |i| weight(i / pixels_per_degree))
    };
    let sum = |weights: &[f64]| weights.iter().sum::<f64>();
    let alone = |csf| {
        let weights = gaussian(csf);
        scaled(&weights, 1.0 / sum(&weights))
    };
    let [first, second] = BLUE_YELLOW.map(gaussian);
    // Both together have the sum 1 over the two axes.
    let together = 1.0 / (sum(&first).powi(2) + sum(&second).powi(2)).sqrt();

    let deviation = 0.5 * FEATURE_WIDTH * pixels_per_degree;
    let radius = (3.0 * deviation).ceil();
    let bell = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let gaussian = sample(radius, bell);
    let gaussian = scaled(&gaussian, 1.0 / sum(&gaussian));
    let edge = sample(radius, |x| -x * bell(x));
    let point = sample(radius, |x| (x * x / (deviation * deviation) - 1.0) * bell(x));
    [
        alone(ACHROMATIC),
        alone(RED_GREEN),
        scaled(&first, together),
        scaled(&second, together),
        gaussian,
        balanced(&edge),
        balanced(&point),
    ]
}

/// The values of `f` at the whole numbers from −`radius` to `radius`.
fn sample(radius: f64, f: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..=2 * radius as usize).map(|i| f(i as f64 - radius)).collect()
}

fn scaled(weights: &[f64], factor: f64) -> Vec<f32> {
    weights.iter().map(|w| (w * factor) as f32).collect()
}

/// Scales the positive weights to the sum 1 and the negative weights to the sum −1.
fn balanced(weights: &[f64]) -> Vec<f32> {
    let positive: f64 = weights.iter().filter(|w| **w > 0.0).sum();
    let negative: f64 = weights.iter().filter(|w| **w < 0.0).sum();
    weights.iter().map(|&w| (if w > 0.0 { w / positive } else { w / -negative }) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, value: impl Fn(u32, u32) -> Rgb) -> Image {
        let mut image = Image::new(width, height);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel = value(i as u32 % width, i as u32 / width);
        }
        image
    }

    #[test]
    fn filters_are_normalised() {
        for ppd in [1.0, 7.3, 30.0, PIXELS_PER_DEGREE, 1000.0] {
            let filters = filters(ppd);
            let sum = |f: Filter| filters[f as usize].iter().map(|&w| f64::from(w)).sum::<f64>();
            assert!((sum(Filter::Achromatic) - 1.0).abs() < 1e-5, "{ppd}");
            assert!((sum(Filter::RedGreen) - 1.0).abs() < 1e-5, "{ppd}");
            assert!((sum(Filter::Gaussian) - 1.0).abs() < 1e-5, "{ppd}");
            assert!((sum(Filter::BlueYellow0).powi(2) + sum(Filter::BlueYellow1).powi(2) - 1.0).abs() < 1e-5, "{ppd}");
            assert!(sum(Filter::Edge).abs() < 1e-5 && sum(Filter::Point).abs() < 1e-5, "{ppd}");
            assert!(filters.iter().all(|f| f.len() % 2 == 1 && f.iter().all(|w| w.is_finite())), "{ppd}");
        }
        let radii = filters(PIXELS_PER_DEGREE).map(|f| f.len() / 2);
        assert_eq!(radii, [10, 10, 10, 10, 9, 9, 9]);
    }

    #[test]
    fn constant_images_have_the_colour_difference_alone() {
        let (green, blue) = (image(9, 7, |_, _| Rgb::Y), image(9, 7, |_, _| Rgb::Z));
        let map = ldr_flip(&green, &blue, PIXELS_PER_DEGREE).unwrap();
        // The largest difference there is.
        assert!(map.values.iter().all(|e| (e - 1.0).abs() < 1e-3), "{map:?}");
        // Greys of lightness 50 and 60: 10^0.7 of the knee, which is 0.4 of the largest distance to the power 0.7.
        let grey = |lightness: f32| image(5, 5, |_, _| Rgb::splat(((lightness + 16.0) / 116.0).powi(3)));
        let map = ldr_flip(&grey(50.0), &grey(60.0), PIXELS_PER_DEGREE).unwrap();
        let flip = Flip::new(1, 1, 1.0).unwrap();
        let expected = 0.95 * 10_f32.powf(0.7) / (0.4 * flip.c_max);
        // Edges of a constant come out as some 1e-8 instead of 0; the root of that is in the exponent.
        assert!(map.values.iter().all(|e| (e - expected).abs() < 1e-4), "{expected} {map:?}");
    }

    #[test]
    fn turning_and_mirroring_both_images_turns_the_map() {
        let a =
            |x: u32, y: u32| Rgb::new((x * 7 % 5) as f32 / 5.0, (y * 3 % 4) as f32 / 4.0, ((x + y) % 3) as f32 / 3.0);
        let b = |x: u32, y: u32| a(x + 1, y);
        let (w, h) = (23, 17);
        let map = ldr_flip(&image(w, h, a), &image(w, h, b), 20.0).unwrap();
        let turned =
            ldr_flip(&image(h, w, |x, y| a(w - 1 - y, x)), &image(h, w, |x, y| b(w - 1 - y, x)), 20.0).unwrap();
        for (y, row) in turned.values.chunks(h as usize).enumerate() {
            for (x, value) in row.iter().enumerate() {
                let other = map.values[x * w as usize + w as usize - 1 - y];
                assert!((value - other).abs() < 1e-4, "{x} {y}: {value} {other}");
            }
        }
        // The order of the images does not matter.
        assert_eq!(ldr_flip(&image(w, h, b), &image(w, h, a), 20.0).unwrap(), map);
    }

    #[test]
    fn the_number_of_threads_does_not_matter() {
        let a = image(31, 29, |x, y| Rgb::new((x * y % 7) as f32 / 7.0, 0.3, (x % 2) as f32));
        let b = image(31, 29, |x, y| Rgb::new((x * y % 11) as f32 / 11.0, 0.3, (y % 2) as f32));
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| ldr_flip(&a, &b, PIXELS_PER_DEGREE).unwrap())
        };
        assert_eq!(on(1), on(3));
    }
}
