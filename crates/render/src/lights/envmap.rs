//! Environment maps: radiance from a picture of all directions.
//!
//! *Definition.* As in Mitsuba 3: the direction (sin φ sin θ, cos θ, −cos φ sin θ) of the map has the coordinates u = φ/2π, v = θ/π. Columns lie at the
//! middles of their pixels and go round; the first row lies at θ = 0 and the last at θ = π. Between four pixels the map is linear in u and v.
//!
//! *Sampling.* A cell between four pixels is drawn in proportion to the mean of their luminances times its solid angle, then a direction, uniformly in it. So
//! the density is nowhere less than a quarter of what would be ideal, and zero only where the map is.
//!
//! *Cost.* Two binary searches; four bytes a pixel.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DMat4, DVec3, dvec3};
use vdf_scene::{Pixels, Rgb, luminance};

use super::LightSample;

/// An environment map, prepared for sampling.
#[derive(Debug)]
pub(super) struct EnvmapLight {
    image: std::sync::Arc<Pixels>,
    scale: f32,
    world_from_map: DMat3,
    /// The share of all cells up to the end of each row of cells; the last is 1.
    rows: Vec<f64>,
    /// In each row of cells the share up to the end of each cell; the last is 1.
    cells: Vec<f32>,
}

impl EnvmapLight {
    pub(super) fn new(image: &std::sync::Arc<Pixels>, scale: f32, world_from_map: &DMat4) -> Self {
        let width = image.width as usize;
        let height = image.height as usize;
        let pixel = |x: usize, y: usize| f64::from(luminance(image.rgb[y * width + x % width]));
        let mut light = Self {
            image: image.clone(),
            scale,
            world_from_map: DMat3::from_mat4(*world_from_map),
            rows: Vec::with_capacity(height - 1),
            cells: Vec::with_capacity(width * (height - 1)),
        };
        let mut total = 0.0;
        for y in 0..height - 1 {
            let mut sums = Vec::with_capacity(width);
            let mut sum = 0.0;
            for x in 0..width {
                sum += pixel(x, y) + pixel(x + 1, y) + pixel(x, y + 1) + pixel(x + 1, y + 1);
                sums.push(sum);
            }
            light.cells.extend(sums.iter().map(|s| if sum > 0.0 { (s / sum) as f32 } else { 0.0 }));
            total += sum * light.solid_angle(y);
            light.rows.push(total);
        }
        if total > 0.0 && scale > 0.0 && total.is_finite() {
            light.rows.iter_mut().for_each(|r| *r /= total);
        } else {
            light.rows.iter_mut().for_each(|r| *r = 0.0);
        }
        light
    }

    /// The solid angle of a cell in this row.
    fn solid_angle(&self, y: usize) -> f64 {
        let [a, b] = self.cosines(y);
        TAU / f64::from(self.image.width) * (a - b)
    }

    /// cos θ at the upper and the lower end of a row of cells.
    fn cosines(&self, y: usize) -> [f64; 2] {
        let step = PI / f64::from(self.image.height - 1);
        [y, y + 1].map(|y| (y as f64 * step).cos())
    }

    /// The map's coordinates of a direction: cell and place in it.
    fn place(&self, direction: DVec3) -> ([usize; 2], [f64; 2]) {
        let d = self.world_from_map.transpose() * direction;
        let (width, height) = (self.image.width as usize, self.image.height as usize);
        let u = (d.x.atan2(-d.z) / TAU).rem_euclid(1.0);
        // The angle by its tangent: the arc of a cosine loses half the digits near the poles.
        let v = d.x.hypot(d.z).atan2(d.y) / PI;
        let x = u * width as f64 - 0.5;
        let x = if x < 0.0 { x + width as f64 } else { x };
        let y = v * (height - 1) as f64;
        let (i, j) = ((x as usize).min(width - 1), (y as usize).min(height - 2));
        ([i, j], [x - i as f64, y - j as f64])
    }

    /// Radiance from a direction.
    pub(super) fn radiance(&self, direction: DVec3) -> Rgb {
        let ([x, y], [fx, fy]) = self.place(direction);
        let width = self.image.width as usize;
        let row = |y: usize| {
            let at = |x: usize| self.image.rgb[y * width + x % width];
            at(x) * (1.0 - fx) as f32 + at(x + 1) * fx as f32
        };
        (row(y) * (1.0 - fy) as f32 + row(y + 1) * fy as f32) * self.scale
    }

    /// The density per steradian with which a direction is drawn.
    pub(super) fn pdf(&self, direction: DVec3) -> f64 {
        let ([x, y], _) = self.place(direction);
        self.share(x, y) / self.solid_angle(y)
    }

    /// The probability of a cell.
    fn share(&self, x: usize, y: usize) -> f64 {
        let row = self.rows[y] - if y == 0 { 0.0 } else { self.rows[y - 1] };
        let cells = &self.cells[y * self.image.width as usize..];
        row * (f64::from(cells[x]) - if x == 0 { 0.0 } else { f64::from(cells[x - 1]) })
    }

    /// A direction and its density; `None` if the map is black.
    pub(super) fn sample_direction(&self, [u, v]: [f64; 2]) -> Option<(DVec3, f64)> {
        let width = self.image.width as usize;
        if self.rows.last().is_none_or(|last| *last <= 0.0) {
            return None;
        }
        let y = self.rows.partition_point(|&end| end <= v).min(self.rows.len() - 1);
        let begin = if y == 0 { 0.0 } else { self.rows[y - 1] };
        let fy = ((v - begin) / (self.rows[y] - begin)).clamp(0.0, 1.0);
        let cells = &self.cells[y * width..(y + 1) * width];
        let x = cells.partition_point(|&end| f64::from(end) <= u).min(width - 1);
        let begin = if x == 0 { 0.0 } else { f64::from(cells[x - 1]) };
        let fx = ((u - begin) / (f64::from(cells[x]) - begin)).clamp(0.0, 1.0);
        let [above, below] = self.cosines(y);
        let cos = above + (below - above) * fy;
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (TAU * (x as f64 + 0.5 + fx) / width as f64).sin_cos();
        let d = dvec3(sin_phi * sin, cos, -cos_phi * sin);
        Some((self.world_from_map * d, self.share(x, y) / self.solid_angle(y)))
    }

    /// A sample of the map, one of `choices` emitters, whose directions are followed for `reach` world units.
    pub(super) fn sample(
        &self,
        emitter: usize,
        from: DVec3,
        u: [f64; 2],
        choices: f64,
        reach: f64,
    ) -> Option<LightSample> {
        let (direction, pdf) = self.sample_direction(u)?;
        // By its place, as a scattered ray would find it: next to a border it may be in another cell than the one that was drawn.
        let pdf = pdf / choices;
        (pdf > 0.0).then(|| LightSample {
            emitter,
            point: from + direction * reach,
            direction,
            weight: self.radiance(direction) * (1.0 / pdf) as f32,
            pdf,
            on_surface: false,
            choices,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Sampler, chi_squared::assert_drawn_from};

    fn light(width: u32, height: u32) -> EnvmapLight {
        let value = |i: u32| ((i * 7919) % 23) as f32 * if i.is_multiple_of(5) { 0.0 } else { 1.0 };
        let rgb = (0..width * height).map(|i| Rgb::new(value(i), value(i + 1), 0.5)).collect();
        let rotation = DMat4::from_rotation_y(0.7) * DMat4::from_rotation_x(-0.4);
        EnvmapLight::new(&std::sync::Arc::new(Pixels { width, height, rgb }), 2.0, &rotation)
    }

    /// χ² over the cells of the map; directions found again where they were drawn, with the same density; and the density over the sphere adds up to 1.
    #[test]
    fn directions_are_drawn_with_their_density() {
        let (width, height) = (8, 5);
        let light = light(width, height);
        let n = 60_000;
        let mut cells = vec![0_u64; (width * (height - 1)) as usize];
        let mut moved = 0;
        for i in 0..n {
            let (d, pdf) = light.sample_direction(Sampler::new(3, i, 0, 0).next_2d()).expect("it shines");
            assert!((d.length() - 1.0).abs() < 1e-12);
            let ([x, y], _) = light.place(d);
            cells[y * width as usize + x] += 1;
            moved += u32::from((light.pdf(d) / pdf - 1.0).abs() > 1e-9);
        }
        assert!(moved < 10, "{moved}: only at borders a direction may round into another cell");
        let shares: Vec<f64> = (0..cells.len()).map(|i| light.share(i % width as usize, i / width as usize)).collect();
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-6);
        let total: f64 = shares.iter().sum();
        let shares: Vec<f64> = shares.iter().map(|s| s / total).collect();
        assert_drawn_from("map", &cells, &shares);
    }

    /// The estimate of the light of the whole sphere by samples is the integral by the midpoint rule, within five standard errors.
    #[test]
    fn samples_are_worth_what_the_map_is() {
        let light = light(16, 9);
        let n = 40_000_u32;
        let (mut sum, mut squares) = (0.0, 0.0);
        for i in 0..n {
            let s = light.sample(0, DVec3::ZERO, Sampler::new(9, i, 0, 0).next_2d(), 1.0, 10.0).expect("it shines");
            let value = f64::from(luminance(s.weight));
            sum += value;
            squares += value * value;
        }
        let (mean, count) = (sum / f64::from(n), f64::from(n));
        let error = ((squares / count - mean * mean) / count).sqrt();
        let (rows, columns) = (400, 800);
        let mut integral = 0.0;
        for i in 0..rows {
            let cos = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(rows);
            for j in 0..columns {
                let (s, c) = (TAU * (f64::from(j) + 0.5) / f64::from(columns)).sin_cos();
                let r = (1.0 - cos * cos).sqrt();
                integral += f64::from(luminance(light.radiance(dvec3(r * c, cos, r * s))));
            }
        }
        integral *= 4.0 * PI / f64::from(rows * columns);
        assert!((mean - integral).abs() < 5.0 * error + 1e-3 * integral, "{mean} ± {error}, {integral}");
    }

    /// Values that Mitsuba 3.9.1 gives: the middle of the picture is +Z, and a quarter to its left +X's other side.
    #[test]
    fn the_map_lies_as_in_mitsuba() {
        let rgb = (0..8 * 5).map(|i| Rgb::splat((i % 8) as f32)).collect();
        let image = std::sync::Arc::new(Pixels { width: 8, height: 5, rgb });
        let light = EnvmapLight::new(&image, 1.0, &DMat4::IDENTITY);
        // u = ½ is between columns 3 and 4, u = ¼ between 1 and 2.
        assert!((light.radiance(DVec3::Z).x - 3.5).abs() < 1e-6);
        assert!((light.radiance(DVec3::X).x - 1.5).abs() < 1e-6);
        assert!((light.radiance(-DVec3::X).x - 5.5).abs() < 1e-6);
        // u = 0 is between the last column and the first.
        assert!((light.radiance(-DVec3::Z).x - 3.5).abs() < 1e-6);
        for pole in [DVec3::Y, -DVec3::Y] {
            assert!(light.radiance(pole).is_finite() && light.pdf(pole).is_finite());
        }
        let black = EnvmapLight::new(
            &std::sync::Arc::new(Pixels { width: 2, height: 2, rgb: vec![Rgb::ZERO; 4] }),
            1.0,
            &DMat4::IDENTITY,
        );
        assert!(black.sample_direction([0.5, 0.5]).is_none());
        assert_eq!(black.pdf(DVec3::X), 0.0);
    }
}
