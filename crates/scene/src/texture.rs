//! Textures: what a colour is made of that changes over a surface.

use std::sync::Arc;

use glam::{DVec2, Vec2};

use crate::Rgb;

/// A picture in linear RGB, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Pixels {
    /// Columns, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// `width · height` colours.
    pub rgb: Vec<Rgb>,
}

/// A colour over a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Texture {
    /// The same everywhere.
    Constant(Rgb),
    /// Two colours in a pattern of 2 × 2 fields over the unit square.
    Checkerboard {
        /// Where both halves are equal.
        first: Box<Texture>,
        /// In the other two fields.
        second: Box<Texture>,
        /// What becomes of texture coordinates before.
        to_uv: UvTransform,
    },
    /// A picture over the unit square, its first row at v = 0.
    Bitmap {
        /// The picture.
        image: Arc<Pixels>,
        /// Between the middles of pixels.
        filter: TextureFilter,
        /// Outside of the unit square.
        wrap: Wrap,
        /// What becomes of texture coordinates before.
        to_uv: UvTransform,
    },
}

/// What is between the middles of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextureFilter {
    /// Linear in u and v.
    #[default]
    Bilinear,
    /// The nearest pixel.
    Nearest,
}

/// What is outside of the unit square, or the unit cube.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The same again.
    #[default]
    Repeat,
    /// The same again, every other time mirrored.
    Mirror,
    /// The border.
    Clamp,
}

/// An affine map of texture coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvTransform {
    /// The columns of the linear part.
    pub columns: [DVec2; 2],
    /// The translation.
    pub offset: DVec2,
}

impl Default for UvTransform {
    fn default() -> Self {
        Self { columns: [DVec2::X, DVec2::Y], offset: DVec2::ZERO }
    }
}

impl UvTransform {
    #[inline]
    fn apply(&self, uv: DVec2) -> DVec2 {
        self.columns[0] * uv.x + self.columns[1] * uv.y + self.offset
    }
}

impl Default for Texture {
    fn default() -> Self {
        Self::Constant(Rgb::ONE)
    }
}

impl Texture {
    /// A grey of this value everywhere.
    #[must_use]
    pub const fn grey(value: f32) -> Self {
        Self::Constant(Rgb::splat(value))
    }

    /// The colour, if it is the same everywhere.
    #[must_use]
    pub const fn constant(&self) -> Option<Rgb> {
        match self {
            Self::Constant(colour) => Some(*colour),
            _ => None,
        }
    }

    /// The colour at texture coordinates.
    #[must_use]
    pub fn at(&self, uv: Vec2) -> Rgb {
        match self {
            Self::Constant(colour) => *colour,
            Self::Checkerboard { first, second, to_uv } => {
                let p = to_uv.apply(uv.as_dvec2());
                let right = p - p.floor();
                if (right.x > 0.5) == (right.y > 0.5) { first.at(uv) } else { second.at(uv) }
            }
            Self::Bitmap { image, filter, wrap, to_uv } => image.at(to_uv.apply(uv.as_dvec2()), *filter, *wrap),
        }
    }

    /// The luminance at texture coordinates.
    #[must_use]
    pub fn luminance_at(&self, uv: Vec2) -> f32 {
        luminance(self.at(uv))
    }

    /// The mean colour over the unit square.
    #[must_use]
    pub fn mean(&self) -> Rgb {
        match self {
            Self::Constant(colour) => *colour,
            Self::Checkerboard { first, second, .. } => 0.5 * (first.mean() + second.mean()),
            Self::Bitmap { image, .. } => {
                let sum = image.rgb.iter().fold(glam::DVec3::ZERO, |sum, p| sum + p.as_dvec3());
                (sum / image.rgb.len().max(1) as f64).as_vec3()
            }
        }
    }
}

/// The luminance of a colour with the primaries of sRGB.
#[must_use]
pub fn luminance(colour: Rgb) -> f32 {
    colour.dot(Rgb::new(0.212_671, 0.715_16, 0.072_169))
}

impl Wrap {
    /// The pixel of a row of n that stands for pixel i of an endless one.
    #[inline]
    #[must_use]
    pub fn pixel(self, i: i64, n: i64) -> i64 {
        match self {
            Self::Clamp => i.clamp(0, n - 1),
            Self::Repeat => i.rem_euclid(n),
            Self::Mirror => {
                let i = i.rem_euclid(2 * n);
                if i < n { i } else { 2 * n - 1 - i }
            }
        }
    }
}

impl Pixels {
    #[inline]
    fn pixel(&self, x: i64, y: i64, wrap: Wrap) -> Rgb {
        let (x, y) = (wrap.pixel(x, self.width.into()), wrap.pixel(y, self.height.into()));
        self.rgb.get((y * i64::from(self.width) + x) as usize).copied().unwrap_or_default()
    }

    fn at(&self, uv: DVec2, filter: TextureFilter, wrap: Wrap) -> Rgb {
        // Far outside nothing but the fraction counts, and no conversion may saturate.
        let place = |x: f64, n: u32| if x.is_finite() { x.clamp(-1e9, 1e9) * f64::from(n) } else { 0.0 };
        let (x, y) = (place(uv.x, self.width), place(uv.y, self.height));
        match filter {
            TextureFilter::Nearest => self.pixel(x.floor() as i64, y.floor() as i64, wrap),
            TextureFilter::Bilinear => {
                let (x, y) = (x - 0.5, y - 0.5);
                let (left, top) = (x.floor(), y.floor());
                let (fx, fy) = ((x - left) as f32, (y - top) as f32);
                let (i, j) = (left as i64, top as i64);
                let row = |j| self.pixel(i, j, wrap) * (1.0 - fx) + self.pixel(i + 1, j, wrap) * fx;
                row(j) * (1.0 - fy) + row(j + 1) * fy
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Arc<Pixels> {
        let rgb = [1.0, 2.0, 3.0, 4.0].map(Rgb::splat).to_vec();
        Arc::new(Pixels { width: 2, height: 2, rgb })
    }

    /// Values that Mitsuba 3.9.1 gives for the same picture.
    #[test]
    fn pixels_lie_as_in_mitsuba() {
        let texture = |filter, wrap| Texture::Bitmap { image: picture(), filter, wrap, to_uv: UvTransform::default() };
        let at = |t: &Texture, u: f32, v: f32| t.at(Vec2::new(u, v)).x;
        let nearest = texture(TextureFilter::Nearest, Wrap::Repeat);
        assert_eq!([at(&nearest, 0.2, 0.2), at(&nearest, 0.7, 0.2), at(&nearest, 0.2, 0.7)], [1.0, 2.0, 3.0]);
        assert_eq!([at(&nearest, 1.2, -0.3), at(&nearest, -0.2, 0.2)], [3.0, 2.0]);
        let smooth = texture(TextureFilter::Bilinear, Wrap::Repeat);
        assert_eq!([at(&smooth, 0.25, 0.25), at(&smooth, 0.5, 0.25), at(&smooth, 0.0, 0.25)], [1.0, 1.5, 1.5]);
        assert!((at(&smooth, 1.1, 0.75) - 3.3).abs() < 1e-6);
        let clamped = texture(TextureFilter::Bilinear, Wrap::Clamp);
        assert_eq!([at(&clamped, 0.0, 0.25), at(&clamped, 7.0, -3.0)], [1.0, 2.0]);
        let mirrored = texture(TextureFilter::Nearest, Wrap::Mirror);
        assert_eq!([at(&mirrored, 1.2, 0.2), at(&mirrored, -0.2, 0.2), at(&mirrored, 2.2, 0.2)], [2.0, 1.0, 1.0]);
        for odd in [f32::NAN, f32::INFINITY, 1e38, -1e38] {
            assert!(at(&smooth, odd, odd) > 0.0);
        }
        assert_eq!(smooth.mean(), Rgb::splat(2.5));
    }

    #[test]
    fn a_checkerboard_has_four_fields() {
        let to_uv = UvTransform { columns: [DVec2::X * 2.0, DVec2::Y], offset: DVec2::ZERO };
        let board = |to_uv| Texture::Checkerboard {
            first: Box::new(Texture::grey(0.4)),
            second: Box::new(Texture::grey(0.2)),
            to_uv,
        };
        let at = |t: &Texture, u: f32, v: f32| t.at(Vec2::new(u, v)).x;
        let plain = board(UvTransform::default());
        assert_eq!([at(&plain, 0.25, 0.25), at(&plain, 0.75, 0.25), at(&plain, 0.75, 0.75)], [0.4, 0.2, 0.4]);
        assert_eq!([at(&board(to_uv), 0.3, 0.25), at(&board(to_uv), 0.6, 0.25)], [0.2, 0.4]);
        assert!((plain.mean().x - 0.3).abs() < 1e-7);
    }
}
