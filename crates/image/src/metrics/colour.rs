//! The colour spaces of FLIP.
//!
//! XYZ is relative to the white point throughout, so that white is (1, 1, 1). The opponent space of the filters is
//! YCxCz, Y = 116y − 16, Cx = 500(x − y), Cz = 200(y − z) \[Andersson2020\]. The filters are linear and their weights
//! sum to 1, so scale and offset of a channel pass through them unchanged; they are left out here: an opponent colour
//! is (y, x − y, y − z).

use glam::{DMat3, DVec3, Mat3, Vec3};

use crate::Rgb;

/// Chromaticities (x, y) of the primaries of sRGB.
const PRIMARIES: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];

/// Chromaticity of D65 to five digits, as in the matrix that FLIP uses; the standard rounds to four.
const WHITE: [f64; 2] = [0.312_71, 0.329_02];

/// Conversions between linear RGB and the spaces of FLIP.
#[derive(Clone, Copy, Debug)]
pub(super) struct ColourSpaces {
    xyz_from_rgb: Mat3,
    rgb_from_xyz: Mat3,
}

impl ColourSpaces {
    pub(super) fn new() -> Self {
        let xyz = |[x, y]: [f64; 2]| DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
        let [red, green, blue] = PRIMARIES.map(xyz);
        let primaries = DMat3::from_cols(red, green, blue);
        // How much of each primary makes white.
        let amounts = primaries.inverse() * xyz(WHITE);
        let absolute = primaries * DMat3::from_diagonal(amounts);
        let relative = DMat3::from_diagonal(xyz(WHITE).recip()) * absolute;
        Self { xyz_from_rgb: relative.as_mat3(), rgb_from_xyz: relative.inverse().as_mat3() }
    }

    /// The opponent colour (y, x − y, y − z) of linear RGB.
    pub(super) fn opponent(&self, rgb: Rgb) -> Vec3 {
        let xyz = self.xyz_from_rgb * rgb;
        Vec3::new(xyz.y, xyz.x - xyz.y, xyz.y - xyz.z)
    }

    /// CIELAB, with the Hunt adjustment, of an opponent colour, which is first clamped to what a display can show.
    pub(super) fn hunt_lab(&self, opponent: Vec3) -> Vec3 {
        let xyz = Vec3::new(opponent.x + opponent.y, opponent.x, opponent.x - opponent.z);
        let rgb = (self.rgb_from_xyz * xyz).clamp(Vec3::ZERO, Vec3::ONE);
        let xyz = self.xyz_from_rgb * rgb;
        let (x, y, z) = (lab_curve(xyz.x), lab_curve(xyz.y), lab_curve(xyz.z));
        let lightness = 116.0 * y - 16.0;
        // Colours look less colourful in the dark [Hunt1952], as in [Andersson2020].
        let hunt = 0.01 * lightness;
        Vec3::new(lightness, hunt * 500.0 * (x - y), hunt * 200.0 * (y - z))
    }
}

/// The luminance of linear RGB, with the rounded weights of BT.709 that FLIP chooses exposures with.
pub(super) fn luminance(rgb: Rgb) -> f64 {
    DVec3::new(0.2126, 0.7152, 0.0722).dot(rgb.as_dvec3())
}

/// The HyAB distance of two colours in CIELAB: |ΔL| + √(Δa² + Δb²) \[Abasi2020\].
pub(super) fn hyab(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x.abs() + (d.y * d.y + d.z * d.z).sqrt()
}

/// The curve of CIELAB: a cube root with a straight part near black.
fn lab_curve(t: f32) -> f32 {
    const DELTA: f32 = 6.0 / 29.0;
    if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_colours() {
        let spaces = ColourSpaces::new();
        let white = spaces.opponent(Vec3::ONE);
        assert!((white - Vec3::X).length() < 1e-6, "{white}");
        assert_eq!(luminance(Vec3::new(0.0, 1.0, 0.0)), 0.7152);
        // They are the row of luminance of the matrix, rounded.
        assert!((f64::from(spaces.opponent(Vec3::Y).x) - 0.7152).abs() < 5e-5);
        let lab = |r, g, b| spaces.hunt_lab(spaces.opponent(Vec3::new(r, g, b)));
        assert!((lab(1.0, 1.0, 1.0) - Vec3::new(100.0, 0.0, 0.0)).length() < 1e-3);
        assert!(lab(0.0, 0.0, 0.0).length() < 1e-4);
        // sRGB's red in CIELAB is (53.24, 80.09, 67.20); the Hunt adjustment takes a and b times 0.5324.
        let red = lab(1.0, 0.0, 0.0);
        assert!((red - Vec3::new(53.24, 0.5324 * 80.09, 0.5324 * 67.20)).abs().max_element() < 0.05, "{red}");
        assert!((hyab(Vec3::new(1.0, 2.0, 3.0), Vec3::new(3.0, 5.0, -1.0)) - 7.0).abs() < 1e-6);
    }

    #[test]
    fn colours_out_of_gamut_are_clamped() {
        let spaces = ColourSpaces::new();
        let lab = spaces.hunt_lab(Vec3::new(3.0, 0.0, 0.0));
        assert!((lab - Vec3::new(100.0, 0.0, 0.0)).length() < 1e-3, "{lab}");
        assert!(spaces.hunt_lab(Vec3::new(-1.0, 0.3, -0.3)).is_finite());
    }
}
