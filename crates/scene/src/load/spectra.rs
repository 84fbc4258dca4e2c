//! Spectra over wavelengths, and what of them red, green and blue see.
//!
//! *Definition.* A spectrum is linear between the wavelengths that are given and zero beyond them. It is weighed with the colour matching functions of
//! the CIE of 1931 and carried to the primaries of sRGB. What a surface does to light is weighed with daylight, D65, too, so that a spectrum that is 1
//! everywhere is a grey of 0.9989, as in Mitsuba 3.9.1; what an emitter sends is not.

use glam::{DMat3, DVec3};

/// CIE x̄, ȳ, z̄ and the power of D65 (CIE 015:2018), from 360 nm to 830 nm in steps of 5.
const CIE: [[f64; 4]; 95] = [
    [0.0001299, 3.917e-06, 0.0006061, 0.47111],
    [0.0002321, 6.965e-06, 0.001086, 0.49864],
    [0.0004149, 1.239e-05, 0.001946, 0.52617],
    [0.0007416, 2.202e-05, 0.003486, 0.51549],
    [0.001368, 3.9e-05, 0.00645, 0.50482],
    [0.002236, 6.4e-05, 0.01055, 0.52842],
    [0.004243, 0.00012, 0.02005, 0.55202],
    [0.00765, 0.000217, 0.03621, 0.69397],
    [0.01431, 0.000396, 0.06785, 0.83593],
    [0.02319, 0.00064, 0.1102, 0.88003],
    [0.04351, 0.00121, 0.2074, 0.92413],
    [0.07763, 0.00218, 0.3713, 0.93395],
    [0.1344, 0.004, 0.6456, 0.94378],
    [0.2148, 0.0073, 1.039, 0.90969],
    [0.2839, 0.0116, 1.386, 0.8756],
    [0.3285, 0.01684, 1.623, 0.96744],
    [0.3483, 0.023, 1.747, 1.0593],
    [0.3481, 0.0298, 1.783, 1.1206],
    [0.3362, 0.038, 1.772, 1.1819],
    [0.3187, 0.048, 1.744, 1.186],
    [0.2908, 0.06, 1.669, 1.1901],
    [0.2511, 0.0739, 1.528, 1.1751],
    [0.1954, 0.09098, 1.288, 1.1602],
    [0.1421, 0.1126, 1.042, 1.1656],
    [0.09564, 0.139, 0.813, 1.171],
    [0.05795, 0.1693, 0.6162, 1.135],
    [0.03201, 0.208, 0.4652, 1.0991],
    [0.0147, 0.2586, 0.3533, 1.1019],
    [0.0049, 0.323, 0.272, 1.1046],
    [0.0024, 0.4073, 0.2123, 1.0968],
    [0.0093, 0.503, 0.1582, 1.0889],
    [0.0291, 0.6082, 0.1117, 1.0737],
    [0.06327, 0.71, 0.07825, 1.0585],
    [0.1096, 0.7932, 0.05725, 1.0731],
    [0.1655, 0.862, 0.04216, 1.0878],
    [0.2257, 0.9149, 0.02984, 1.0712],
    [0.2904, 0.954, 0.0203, 1.0546],
    [0.3597, 0.9803, 0.0134, 1.0528],
    [0.4334, 0.995, 0.00875, 1.051],
    [0.5121, 1.0, 0.00575, 1.0306],
    [0.5945, 0.995, 0.0039, 1.0101],
    [0.6784, 0.9786, 0.00275, 0.99161],
    [0.7621, 0.952, 0.0021, 0.9731],
    [0.8425, 0.9154, 0.0018, 0.97034],
    [0.9163, 0.87, 0.00165, 0.96758],
    [0.9786, 0.8163, 0.0014, 0.93171],
    [1.026, 0.757, 0.0011, 0.89584],
    [1.057, 0.6949, 0.001, 0.90251],
    [1.062, 0.631, 0.0008, 0.90918],
    [1.046, 0.5668, 0.0006, 0.90712],
    [1.003, 0.503, 0.00034, 0.90507],
    [0.9384, 0.4412, 0.00024, 0.89547],
    [0.8544, 0.381, 0.00019, 0.88587],
    [0.7514, 0.321, 0.0001, 0.86359],
    [0.6424, 0.265, 5e-05, 0.84132],
    [0.5419, 0.217, 3e-05, 0.84339],
    [0.4479, 0.175, 2e-05, 0.84547],
    [0.3608, 0.1382, 1e-05, 0.82692],
    [0.2835, 0.107, 0.0, 0.80837],
    [0.2187, 0.0816, 0.0, 0.80932],
    [0.1649, 0.061, 0.0, 0.81027],
    [0.1212, 0.04458, 0.0, 0.82069],
    [0.0874, 0.032, 0.0, 0.83111],
    [0.0636, 0.0232, 0.0, 0.81094],
    [0.04677, 0.017, 0.0, 0.79077],
    [0.0329, 0.01192, 0.0, 0.74752],
    [0.0227, 0.00821, 0.0, 0.70427],
    [0.01584, 0.005723, 0.0, 0.71381],
    [0.01136, 0.004102, 0.0, 0.72334],
    [0.008111, 0.002929, 0.0, 0.73718],
    [0.00579, 0.002091, 0.0, 0.75102],
    [0.004109, 0.001484, 0.0, 0.68665],
    [0.002899, 0.001047, 0.0, 0.62228],
    [0.002049, 0.00074, 0.0, 0.66411],
    [0.00144, 0.00052, 0.0, 0.70593],
    [0.0009999, 0.0003611, 0.0, 0.7322],
    [0.0006901, 0.0002492, 0.0, 0.75847],
    [0.000476, 0.0001719, 0.0, 0.70042],
    [0.0003323, 0.00012, 0.0, 0.64237],
    [0.0002348, 8.48e-05, 0.0, 0.55562],
    [0.0001662, 6e-05, 0.0, 0.46888],
    [0.0001174, 4.24e-05, 0.0, 0.57185],
    [8.308e-05, 3e-05, 0.0, 0.67482],
    [5.871e-05, 2.12e-05, 0.0, 0.65753],
    [4.151e-05, 1.499e-05, 0.0, 0.64025],
    [2.935e-05, 1.06e-05, 0.0, 0.6449],
    [2.067e-05, 7.466e-06, 0.0, 0.64955],
    [1.456e-05, 5.258e-06, 0.0, 0.62505],
    [1.025e-05, 3.703e-06, 0.0, 0.60054],
    [7.221e-06, 2.608e-06, 0.0, 0.5627],
    [5.086e-06, 1.837e-06, 0.0, 0.52485],
    [3.582e-06, 1.293e-06, 0.0, 0.55254],
    [2.523e-06, 9.109e-07, 0.0, 0.58022],
    [1.777e-06, 6.415e-07, 0.0, 0.59473],
    [1.251e-06, 4.518e-07, 0.0, 0.60923],
];

pub(super) const FIRST: f64 = 360.0;
pub(super) const LAST: f64 = 830.0;
const STEP: f64 = 5.0;

/// What a spectrum that is 1 everywhere is in daylight. Mitsuba's norms of daylight and of the matching functions do not fit each other, and scenes are to have
/// the colours that they have there.
const WHITE: f64 = 1.0 / 1.001_13;

/// Whether a spectrum is what a surface does to light, or light itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Weighed {
    ByDaylight,
    Equally,
}

/// The colour of a spectrum given as wavelengths in nm, growing, with values. Cost: one step a nanometre.
pub(super) fn colour(spectrum: &[(f64, f64)], weighed: Weighed) -> DVec3 {
    let (mut sum, mut norm) = (DVec3::ZERO, 0.0);
    let nanometres = (LAST - FIRST) as u32;
    for i in 0..=nanometres {
        let wavelength = FIRST + f64::from(i);
        let [x, y, z, daylight] = between(&CIE, (wavelength - FIRST) / STEP);
        let power = if weighed == Weighed::ByDaylight { daylight } else { 1.0 };
        sum += DVec3::new(x, y, z) * (power * at(spectrum, wavelength));
        norm += power * y;
    }
    if weighed == Weighed::ByDaylight {
        norm /= WHITE;
    }
    // Columns: what one unit of X, Y and Z is in red, green and blue (IEC 61966-2-1).
    let to_rgb = DMat3::from_cols_array(&[
        3.240_479, -0.969_256, 0.055_648, -1.537_150, 1.875_991, -0.204_043, -0.498_535, 0.041_556, 1.057_311,
    ]);
    to_rgb * (sum / norm)
}

fn between(table: &[[f64; 4]], place: f64) -> [f64; 4] {
    let i = (place as usize).min(table.len() - 2);
    let share = place - i as f64;
    let (a, b) = (table[i], table[i + 1]);
    std::array::from_fn(|k| a[k] + share * (b[k] - a[k]))
}

fn at(spectrum: &[(f64, f64)], wavelength: f64) -> f64 {
    let next = spectrum.partition_point(|&(w, _)| w <= wavelength);
    match (next.checked_sub(1).and_then(|i| spectrum.get(i)), spectrum.get(next)) {
        (Some(&(a, va)), Some(&(b, vb))) => va + (vb - va) * (wavelength - a) / (b - a),
        (Some(&(a, va)), None) if a == wavelength => va,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What Mitsuba 3.9.1 makes of some spectra, up to the digits of its tables.
    #[test]
    fn spectra_have_the_colours_of_mitsuba() {
        let near = |a: DVec3, b: [f64; 3], most: f64| {
            let off = (a / DVec3::from_array(b) - 1.0).abs().max_element();
            assert!(off < most, "{a} {b:?}");
        };
        let flat = [(360.0, 1.0), (830.0, 1.0)];
        near(colour(&flat, Weighed::ByDaylight), [0.998_985, 0.998_874, 0.998_802], 1e-4);
        near(colour(&flat, Weighed::Equally), [1.204_884, 0.948_228, 0.909_267], 3e-4);
        let green = [(400.0, 0.1), (500.0, 0.2), (550.0, 0.8), (600.0, 0.3), (700.0, 0.1)];
        near(colour(&green, Weighed::ByDaylight), [0.292_270, 0.580_076, 0.106_170], 4e-4);
        let grey = [400.0, 500.0, 600.0, 700.0].map(|wavelength| (wavelength, 0.78));
        near(colour(&grey, Weighed::ByDaylight), [0.776_367, 0.779_810, 0.776_029], 5e-4);
        near(colour(&green, Weighed::Equally), [0.351_550, 0.557_507, 0.091_273], 0.001);
        let lamp = [(400.0, 0.0), (500.0, 8.0), (600.0, 15.6), (700.0, 18.4)];
        near(colour(&lamp, Weighed::Equally), [20.710_8, 10.854_6, 2.771_15], 3e-4);
        assert_eq!(at(&[(500.0, 2.0)], 500.0), 2.0);
        assert_eq!(at(&[(500.0, 2.0)], 501.0), 0.0);
        assert_eq!(at(&[], 501.0), 0.0);
    }
}
