//! A checksum of a scene, by which an image can say which scene it shows.

use glam::DVec3;
use vdf_geometry::Triangle;

use crate::{
    Boundary, Bsdf, Emitter, FilmSettings, IntegratorSettings, Medium, MediumId, PerspectiveSensor, Phase, PixelRect,
    ReconstructionFilter, Rgb, Scene, Surface,
};

impl Scene {
    /// The CRC-32 (IEEE) of the scene as it is rendered: all shapes, media, emitters, the camera, the film and the depth limits, bit by
    /// bit, with parameters and transforms resolved. So it changes with a mesh, a parameter or a number of the file, but not
    /// with its layout, its names or its place. The samples per pixel, the seed, the crop and the format of
    /// the file are left out: they say how the scene is looked at.
    ///
    /// Meant to tell scenes apart that were changed by accident; 32 bits are no protection against intent. Cost: some
    /// milliseconds for a million triangles.
    #[must_use]
    pub fn checksum(&self) -> u32 {
        // No `..`: who adds a field has to decide whether it belongs to the scene.
        let Self {
            surfaces,
            boundaries,
            media,
            emitters,
            sensor,
            film,
            integrator,
            sample_count: _,
            seed: _,
            warnings: _,
        } = self;
        let mut sum = Sum(crc32fast::Hasher::new());
        sum.count(surfaces.len());
        surfaces.iter().for_each(|surface| sum.surface(surface));
        sum.count(boundaries.len());
        boundaries.iter().for_each(|boundary| sum.boundary(boundary));
        sum.count(media.len());
        media.iter().for_each(|medium| sum.medium(medium));
        sum.count(emitters.len());
        emitters.iter().for_each(|emitter| sum.emitter(emitter));
        sum.sensor(sensor);
        sum.film(film);
        let IntegratorSettings { max_depth, rr_depth } = integrator;
        sum.option(*max_depth);
        sum.words(&[*rr_depth]);
        sum.0.finalize()
    }
}

/// Every list is preceded by its length and every choice by its number, so that different scenes are different bytes.
struct Sum(crc32fast::Hasher);

impl Sum {
    fn words(&mut self, words: &[u32]) {
        words.iter().for_each(|word| self.0.update(&word.to_le_bytes()));
    }

    fn count(&mut self, n: usize) {
        self.0.update(&(n as u64).to_le_bytes());
    }

    fn doubles(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|x| self.0.update(&x.to_bits().to_le_bytes()));
    }

    fn colour(&mut self, colour: Rgb) {
        self.words(&colour.to_array().map(f32::to_bits));
    }

    fn point(&mut self, point: DVec3) {
        self.doubles(&point.to_array());
    }

    fn option(&mut self, number: Option<u32>) {
        self.words(&[u32::from(number.is_some()), number.unwrap_or(0)]);
    }

    fn triangles(&mut self, triangles: &[Triangle]) {
        self.count(triangles.len());
        for Triangle { vertices } in triangles {
            let mut bytes = [0; 36];
            let numbers = vertices.iter().flat_map(|v| v.to_array());
            bytes.chunks_exact_mut(4).zip(numbers).for_each(|(b, x)| b.copy_from_slice(&x.to_bits().to_le_bytes()));
            self.0.update(&bytes);
        }
    }

    fn surface(&mut self, Surface { triangles, bsdf: Bsdf { front, back }, radiance }: &Surface) {
        self.triangles(triangles);
        self.colour(*front);
        self.colour(*back);
        self.words(&[u32::from(radiance.is_some())]);
        self.colour(radiance.unwrap_or_default());
    }

    fn boundary(&mut self, Boundary { triangles, interior, exterior }: &Boundary) {
        self.triangles(triangles);
        self.option(interior.map(|MediumId(n)| n));
        self.option(exterior.map(|MediumId(n)| n));
    }

    fn medium(&mut self, Medium { sigma_t, albedo, phase }: &Medium) {
        self.doubles(&[*sigma_t]);
        self.colour(*albedo);
        match *phase {
            Phase::Isotropic => self.words(&[0]),
            Phase::HenyeyGreenstein { g } => {
                self.words(&[1]);
                self.doubles(&[g]);
            }
        }
    }

    fn emitter(&mut self, emitter: &Emitter) {
        match *emitter {
            Emitter::Point { position, intensity } => {
                self.words(&[0]);
                self.point(position);
                self.colour(intensity);
            }
            Emitter::Area { surface } => {
                self.words(&[1]);
                self.count(surface);
            }
            Emitter::Constant { radiance } => {
                self.words(&[2]);
                self.colour(radiance);
            }
        }
    }

    fn sensor(&mut self, sensor: &PerspectiveSensor) {
        let PerspectiveSensor { world_from_camera, tan_half_fov_x, near_clip, far_clip, medium } = sensor;
        self.doubles(&world_from_camera.to_cols_array());
        self.doubles(&[*tan_half_fov_x, *near_clip, *far_clip]);
        self.option(medium.map(|MediumId(n)| n));
    }

    fn film(&mut self, film: &FilmSettings) {
        let FilmSettings { width, height, crop: PixelRect { .. }, filter, component_format: _ } = film;
        self.words(&[*width, *height]);
        match *filter {
            ReconstructionFilter::Box => self.words(&[0]),
            ReconstructionFilter::Gaussian { stddev } => {
                self.words(&[1]);
                self.doubles(&[stddev]);
            }
            ReconstructionFilter::Tent { radius } => {
                self.words(&[2]);
                self.doubles(&[radius]);
            }
            ReconstructionFilter::Mitchell { b, c } => {
                self.words(&[3]);
                self.doubles(&[b, c]);
            }
            ReconstructionFilter::CatmullRom => self.words(&[4]),
            ReconstructionFilter::Lanczos { lobes } => self.words(&[5, lobes]),
        }
    }
}
