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

/// Where on a surface a texture is looked up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TexturePoint {
    /// Texture coordinates.
    pub uv: Vec2,
    /// The number of the triangle in its surface; 0 where there are none.
    pub triangle: u32,
    /// The barycentric weights of its second and third corner.
    pub barycentric: [f32; 2],
}

impl From<Vec2> for TexturePoint {
    fn from(uv: Vec2) -> Self {
        Self { uv, ..Self::default() }
    }
}

/// Colours that a mesh carries beside its texture coordinates.
#[derive(Clone, Debug, PartialEq)]
pub enum Attribute {
    /// One for each triangle.
    Faces(Vec<Rgb>),
    /// One for each corner of each triangle, linear between them.
    Corners(Vec<[Rgb; 3]>),
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
    /// What the mesh itself says.
    Attribute(Arc<Attribute>),
}

impl From<Rgb> for Texture {
    /// The same everywhere.
    fn from(colour: Rgb) -> Self {
        Self::Constant(colour)
    }
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

    /// Whether a point is in the first or the last of the 2 × 2 fields of the unit square, which goes on for ever.
    #[inline]
    fn is_on_diagonal(&self, uv: Vec2) -> bool {
        let p = self.apply(uv.as_dvec2());
        let right = p - p.floor();
        (right.x > 0.5) == (right.y > 0.5)
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

    /// The colour at a point.
    #[must_use]
    pub fn at(&self, point: &TexturePoint) -> Rgb {
        match self {
            Self::Constant(colour) => *colour,
            Self::Checkerboard { first, second, to_uv } => {
                if to_uv.is_on_diagonal(point.uv) {
                    first.at(point)
                } else {
                    second.at(point)
                }
            }
            Self::Bitmap { image, filter, wrap, to_uv } => image.at(to_uv.apply(point.uv.as_dvec2()), *filter, *wrap),
            Self::Attribute(attribute) => attribute.at(point),
        }
    }

    /// The luminance at a point, where a single number is asked for: an opacity, a weight, a roughness. A checkerboard has its two colours in each other's place then,
    /// as in Mitsuba 3.9.1.
    #[must_use]
    pub fn luminance_at(&self, point: &TexturePoint) -> f32 {
        match self {
            Self::Checkerboard { first, second, to_uv } => {
                let field = if to_uv.is_on_diagonal(point.uv) { second } else { first };
                field.luminance_at(point)
            }
            _ => luminance(self.at(point)),
        }
    }

    /// How fast the luminance grows with u and with v. Zero for all but pictures with [`TextureFilter::Bilinear`]: nothing else changes but by jumps.
    #[must_use]
    pub fn luminance_gradient(&self, point: &TexturePoint) -> DVec2 {
        let Self::Bitmap { image, filter: TextureFilter::Bilinear, wrap, to_uv } = self else { return DVec2::ZERO };
        let gradient = image.luminance_gradient(to_uv.apply(point.uv.as_dvec2()), *wrap);
        // The chain rule: the map's columns are ∂(x, y)/∂u and ∂(x, y)/∂v.
        DVec2::from_array(to_uv.columns.map(|column| column.dot(gradient)))
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
            Self::Attribute(attribute) => attribute.mean(),
        }
    }
}

impl Attribute {
    fn at(&self, point: &TexturePoint) -> Rgb {
        match self {
            Self::Faces(values) => values.get(point.triangle as usize).copied().unwrap_or_default(),
            Self::Corners(values) => {
                let [a, b, c] = values.get(point.triangle as usize).copied().unwrap_or_default();
                let [wb, wc] = point.barycentric;
                // A hit's weights may be rounded below zero.
                (a * (1.0 - wb - wc) + b * wb + c * wc).max(Rgb::ZERO)
            }
        }
    }

    /// The mean over the triangles, as if they were of equal size.
    fn mean(&self) -> Rgb {
        let mean = |sum: glam::DVec3, count: usize| (sum / count.max(1) as f64).as_vec3();
        match self {
            Self::Faces(values) => mean(values.iter().map(|v| v.as_dvec3()).sum(), values.len()),
            Self::Corners(values) => mean(values.iter().flatten().map(|v| v.as_dvec3()).sum(), 3 * values.len()),
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
        // Nearly always, and without a division.
        if (0..n).contains(&i) {
            return i;
        }
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
    /// A pixel, and the next to the right, below, and both.
    #[inline]
    fn four(&self, [x, y]: [i64; 2], wrap: Wrap) -> [Rgb; 4] {
        let (width, height) = (i64::from(self.width), i64::from(self.height));
        let [left, right] = [x, x + 1].map(|x| wrap.pixel(x, width));
        let [above, below] = [y, y + 1].map(|y| wrap.pixel(y, height) * width);
        [above + left, above + right, below + left, below + right].map(|i| self.pixel(i))
    }

    #[inline]
    fn pixel(&self, i: i64) -> Rgb {
        self.rgb.get(i as usize).copied().unwrap_or_default()
    }

    /// A place in pixels.
    #[inline]
    fn place(&self, uv: DVec2) -> (f64, f64) {
        // Far outside nothing but the fraction counts, and no conversion may saturate.
        let place = |x: f64, n: u32| if x.is_finite() { x.clamp(-1e9, 1e9) * f64::from(n) } else { 0.0 };
        (place(uv.x, self.width), place(uv.y, self.height))
    }

    /// How fast the luminance grows over the width and over the height of the picture, where it is linear between pixels.
    fn luminance_gradient(&self, uv: DVec2, wrap: Wrap) -> DVec2 {
        let (x, y) = self.place(uv);
        let ((i, fx), (j, fy)) = (floor(x - 0.5), floor(y - 0.5));
        let [a, b, c, d] = self.four([i, j], wrap).map(|colour| f64::from(luminance(colour)));
        let by_pixel = DVec2::new((b - a) * (1.0 - fy) + (d - c) * fy, (c - a) * (1.0 - fx) + (d - b) * fx);
        by_pixel * DVec2::new(self.width.into(), self.height.into())
    }

    fn at(&self, uv: DVec2, filter: TextureFilter, wrap: Wrap) -> Rgb {
        let (x, y) = self.place(uv);
        match filter {
            TextureFilter::Nearest => self.four([floor(x).0, floor(y).0], wrap)[0],
            TextureFilter::Bilinear => {
                let ((i, fx), (j, fy)) = (floor(x - 0.5), floor(y - 0.5));
                let (fx, fy) = (fx as f32, fy as f32);
                let [a, b, c, d] = self.four([i, j], wrap);
                (a * (1.0 - fx) + b * fx) * (1.0 - fy) + (c * (1.0 - fx) + d * fx) * fy
            }
        }
    }
}

/// The largest integer that is not above x, and what is left: for |x| < 2⁶³. `f64::floor` would be a call where the processor may be an old one.
#[inline]
fn floor(x: f64) -> (i64, f64) {
    let towards_zero = x as i64;
    let whole = towards_zero - i64::from(x < towards_zero as f64);
    (whole, x - whole as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Arc<Pixels> {
        let rgb = [1.0, 2.0, 3.0, 4.0].map(Rgb::splat).to_vec();
        Arc::new(Pixels { width: 2, height: 2, rgb })
    }

    /// The same numbers as the library's, and pixels as by division.
    #[test]
    fn floors_and_wraps_are_those_of_the_definition() {
        for x in
            [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 1e-300, -1e-300, 2.999_999_9, -7.25, 1e17, -1e17, f64::from(u32::MAX)]
        {
            assert_eq!(floor(x), (x.floor() as i64, x - x.floor()), "{x}");
        }
        for n in [1, 2, 7] {
            for i in -30..30 {
                let mirrored = i64::rem_euclid(i, 2 * n);
                assert_eq!(Wrap::Repeat.pixel(i, n), i.rem_euclid(n));
                assert_eq!(Wrap::Clamp.pixel(i, n), i.clamp(0, n - 1));
                assert_eq!(Wrap::Mirror.pixel(i, n), mirrored.min(2 * n - 1 - mirrored));
            }
        }
    }

    /// Values that Mitsuba 3.9.1 gives for the same picture.
    #[test]
    fn pixels_lie_as_in_mitsuba() {
        let texture = |filter, wrap| Texture::Bitmap { image: picture(), filter, wrap, to_uv: UvTransform::default() };
        let at = |t: &Texture, u: f32, v: f32| t.at(&Vec2::new(u, v).into()).x;
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

    /// The gradient is what the values grow by, also through a map that turns and where the picture begins again.
    #[test]
    fn gradients_are_differences() {
        let to_uv =
            UvTransform { columns: [DVec2::new(0.6, 1.1), DVec2::new(-0.8, 0.9)], offset: DVec2::new(0.2, -0.7) };
        let rgb = (0..15).map(|i| Rgb::new((i * 7 % 5) as f32, (i % 4) as f32, (i * i % 7) as f32)).collect();
        let image = Arc::new(Pixels { width: 5, height: 3, rgb });
        let picture = |filter, wrap| Texture::Bitmap { image: image.clone(), filter, wrap, to_uv };
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let texture = picture(TextureFilter::Bilinear, wrap);
            let value = |p: DVec2| f64::from(texture.luminance_at(&p.as_vec2().into()));
            let mut compared = 0;
            for i in 0..100 {
                let p = DVec2::new(f64::from(i) * 0.0371 - 1.5, f64::from(i * i % 97) * 0.0293);
                let h = 1.0 / 256.0;
                let gradient = texture.luminance_gradient(&p.as_vec2().into());
                // Where the differences to both sides differ a border of pixels is near.
                for (axis, got) in [(DVec2::X * h, gradient.x), (DVec2::Y * h, gradient.y)] {
                    let (left, right) = ((value(p) - value(p - axis)) / h, (value(p + axis) - value(p)) / h);
                    if (left - right).abs() < 0.3 {
                        compared += 1;
                        assert!((got - 0.5 * (left + right)).abs() < 0.3, "{wrap:?} {p}: {got}, {left}, {right}");
                    }
                }
            }
            assert!(compared > 120, "{wrap:?} {compared}");
            assert_eq!(picture(TextureFilter::Nearest, wrap).luminance_gradient(&Vec2::ONE.into()), DVec2::ZERO);
        }
    }

    #[test]
    fn attributes_are_linear_in_triangles_or_equal_in_each() {
        let point = TexturePoint { triangle: 1, barycentric: [0.25, 0.5], ..TexturePoint::default() };
        let corners = [[Rgb::ZERO; 3], [Rgb::splat(4.0), Rgb::splat(8.0), Rgb::ZERO]].to_vec();
        let texture = Texture::Attribute(Arc::new(Attribute::Corners(corners)));
        assert_eq!((texture.at(&point), texture.mean()), (Rgb::splat(3.0), Rgb::splat(2.0)));
        let texture = Texture::Attribute(Arc::new(Attribute::Faces([Rgb::ZERO, Rgb::X].to_vec())));
        assert_eq!((texture.at(&point), texture.mean()), (Rgb::X, Rgb::X * 0.5));
        let beyond = TexturePoint { triangle: 2, ..point };
        assert_eq!(texture.at(&beyond), Rgb::ZERO);
    }

    #[test]
    fn a_checkerboard_has_four_fields() {
        let to_uv = UvTransform { columns: [DVec2::X * 2.0, DVec2::Y], offset: DVec2::ZERO };
        let board = |to_uv| Texture::Checkerboard {
            first: Box::new(Texture::grey(0.4)),
            second: Box::new(Texture::grey(0.2)),
            to_uv,
        };
        let at = |t: &Texture, u: f32, v: f32| t.at(&Vec2::new(u, v).into()).x;
        let plain = board(UvTransform::default());
        assert_eq!([at(&plain, 0.25, 0.25), at(&plain, 0.75, 0.25), at(&plain, 0.75, 0.75)], [0.4, 0.2, 0.4]);
        assert_eq!([at(&board(to_uv), 0.3, 0.25), at(&board(to_uv), 0.6, 0.25)], [0.2, 0.4]);
        assert!((plain.mean().x - 0.3).abs() < 1e-7);
        // Mitsuba 3.9.1 looks single numbers up in the other two fields.
        let number = |u: f32, v: f32| plain.luminance_at(&Vec2::new(u, v).into());
        assert!((number(0.25, 0.25) - 0.2).abs() < 1e-6 && (number(0.75, 0.25) - 0.4).abs() < 1e-6);
    }
}
