//! A checksum of a scene, by which an image can say which scene it shows.

use std::collections::HashMap;

use glam::DVec3;
use vdf_geometry::{CurvedKind, CurvedShape, Triangle};

use crate::{
    Albedo, Attribute, Boundary, Bsdf, Emitter, Extinction, FilmSettings, GridVolume, IntegratorSettings, Lens, Medium,
    MediumId, MeshAttributes, Microfacets, Perturbation, Phase, PixelRect, Pixels, Projection, ReconstructionFilter,
    Rgb, Roughness, Scene, Sensor, Slide, Surface, Texture, TextureFilter, UvTransform, VolumeFilter, Wrap,
};

impl Scene {
    /// The CRC-32 (IEEE) of the scene as it is rendered: all shapes, media, emitters, the camera, the film and the depth limits, bit by
    /// bit, with parameters and transforms resolved. So it changes with a mesh, a parameter or a number of the file, but not
    /// with its layout, its names or its place. The samples per pixel, the seed, the crop and the format of
    /// the file are left out: they say how the scene is looked at.
    ///
    /// Meant to tell scenes apart that were changed by accident; 32 bits are no protection against intent. Cost: some
    /// milliseconds for a million triangles; each picture is read once.
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
        let mut sum = Sum::default();
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
        sum.hasher.finalize()
    }
}

/// Every list is preceded by its length and every choice by its number, so that different scenes are different bytes.
#[derive(Default)]
struct Sum {
    hasher: crc32fast::Hasher,
    /// Of pictures that were met before, by their addresses: many shapes may share a large one.
    pictures: HashMap<*const Pixels, u32>,
}

impl Sum {
    fn words(&mut self, words: &[u32]) {
        // Many at once: a call takes longer than what it does for a word.
        for words in words.chunks(16) {
            let mut bytes = [0; 64];
            bytes.chunks_exact_mut(4).zip(words).for_each(|(b, word)| b.copy_from_slice(&word.to_le_bytes()));
            self.hasher.update(&bytes[..4 * words.len()]);
        }
    }

    fn count(&mut self, n: usize) {
        self.hasher.update(&(n as u64).to_le_bytes());
    }

    fn doubles(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|x| self.hasher.update(&x.to_bits().to_le_bytes()));
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
            self.hasher.update(&bytes);
        }
    }

    fn surface(&mut self, Surface { triangles, curved, attributes, bsdf, radiance }: &Surface) {
        self.triangles(triangles);
        self.curved(curved.as_ref());
        let MeshAttributes { normals, uvs } = &**attributes;
        // What a scene without them is, it always was.
        if !normals.is_empty() || !uvs.is_empty() {
            self.count(normals.len());
            normals.iter().flatten().for_each(|n| self.colour(*n));
            self.count(uvs.len());
            uvs.iter().flatten().for_each(|uv| self.words(&uv.to_array().map(f32::to_bits)));
        }
        match bsdf {
            Bsdf::Lambertian { front, back } => {
                self.colour(*front);
                self.colour(*back);
            }
            other => self.bsdf(other),
        }
        match radiance {
            Some(Texture::Constant(radiance)) => {
                self.words(&[1]);
                self.colour(*radiance);
            }
            Some(texture) => {
                self.words(&[2]);
                self.texture(texture);
            }
            None => {
                self.words(&[0]);
                self.colour(Rgb::ZERO);
            }
        }
    }

    fn curved(&mut self, shape: Option<&CurvedShape>) {
        let Some(shape) = shape else { return };
        let kind = match shape.kind() {
            CurvedKind::Sphere => 1,
            CurvedKind::Disk => 2,
            CurvedKind::Cylinder => 3,
        };
        self.words(&[kind, u32::from(shape.is_flipped())]);
        let (linear, origin) = shape.placement();
        self.doubles(&linear.to_cols_array());
        self.point(origin);
    }

    fn bsdf(&mut self, bsdf: &Bsdf) {
        match bsdf {
            Bsdf::Lambertian { front, back } => {
                self.words(&[0]);
                self.colour(*front);
                self.colour(*back);
            }
            Bsdf::Diffuse { .. } => self.words(&[1]),
            Bsdf::Conductor { eta, k, roughness, .. } => {
                self.words(&[2]);
                self.colour(*eta);
                self.colour(*k);
                self.roughness(roughness.as_ref());
            }
            Bsdf::Dielectric { eta, roughness, .. } => {
                self.words(&[3]);
                self.doubles(&[*eta]);
                self.roughness(roughness.as_ref());
            }
            Bsdf::ThinDielectric { eta, .. } => {
                self.words(&[4]);
                self.doubles(&[*eta]);
            }
            Bsdf::Plastic { eta, nonlinear, roughness, .. } => {
                self.words(&[5, u32::from(*nonlinear)]);
                self.doubles(&[*eta]);
                self.roughness(roughness.as_ref());
            }
            Bsdf::TwoSided(of) => {
                self.words(&[6]);
                of.iter().for_each(|bsdf| self.bsdf(bsdf));
            }
            Bsdf::Blend { of, .. } => {
                self.words(&[7]);
                of.iter().for_each(|bsdf| self.bsdf(bsdf));
            }
            Bsdf::Mask { of, .. } => {
                self.words(&[8]);
                self.bsdf(of);
            }
            Bsdf::Null => self.words(&[9]),
            Bsdf::Perturbed { by, flip_invalid_normals, shadowing, of } => {
                let scale = match by {
                    Perturbation::Normals(_) => 0.0,
                    Perturbation::Heights { scale, .. } => *scale,
                };
                let is_normals = matches!(by, Perturbation::Normals(_));
                self.words(&[10, is_normals.into(), (*flip_invalid_normals).into(), (*shadowing).into()]);
                self.doubles(&[scale]);
                self.bsdf(of);
            }
            Bsdf::Principled(p) => {
                self.words(&[11]);
                self.doubles(&[p.eta]);
            }
            Bsdf::PrincipledThin(_) => self.words(&[12]),
            Bsdf::PolarizedPlastic { eta, roughness, .. } => {
                self.words(&[13]);
                self.doubles(&[*eta]);
                self.roughness(Some(roughness));
            }
            Bsdf::Filter { share, .. } => self.words(&[14, share.to_bits()]),
        }
        // Those of nested models once more, which does no harm.
        bsdf.textures().into_iter().for_each(|texture| self.texture(texture));
    }

    fn roughness(&mut self, roughness: Option<&Roughness>) {
        self.words(&[match roughness.map(|r| r.distribution) {
            None => 0,
            Some(Microfacets::Beckmann) => 1,
            Some(Microfacets::Ggx) => 2,
        }]);
    }

    fn texture(&mut self, texture: &Texture) {
        match texture {
            Texture::Constant(colour) => {
                self.words(&[0]);
                self.colour(*colour);
            }
            Texture::Checkerboard { first, second, to_uv } => {
                self.words(&[1]);
                self.texture(first);
                self.texture(second);
                self.uv_transform(to_uv);
            }
            Texture::Bitmap { image, filter, wrap, to_uv } => {
                let filter = match filter {
                    TextureFilter::Bilinear => 0,
                    TextureFilter::Nearest => 1,
                };
                self.words(&[2, filter, wrap_number(*wrap)]);
                self.pixels(image);
                self.uv_transform(to_uv);
            }
            Texture::Attribute(attribute) => match &**attribute {
                Attribute::Faces(values) => {
                    self.words(&[3]);
                    self.count(values.len());
                    values.iter().for_each(|v| self.colour(*v));
                }
                Attribute::Corners(values) => {
                    self.words(&[4]);
                    self.count(values.len());
                    values.iter().flatten().for_each(|v| self.colour(*v));
                }
            },
        }
    }

    fn uv_transform(&mut self, UvTransform { columns: [u, v], offset }: &UvTransform) {
        self.doubles(&[u.x, u.y, v.x, v.y, offset.x, offset.y]);
    }

    fn pixels(&mut self, pixels: &Pixels) {
        let Pixels { width, height, rgb } = pixels;
        let sum = *self.pictures.entry(pixels).or_insert_with(|| {
            let mut hasher = crc32fast::Hasher::new();
            for pixels in rgb.chunks(1 << 10) {
                let bytes: Vec<u8> = pixels.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect();
                hasher.update(&bytes);
            }
            hasher.finalize()
        });
        self.words(&[*width, *height, sum]);
    }

    fn boundary(&mut self, Boundary { triangles, curved, interior, exterior }: &Boundary) {
        self.triangles(triangles);
        self.curved(curved.as_ref());
        self.option(interior.map(|MediumId(n)| n));
        self.option(exterior.map(|MediumId(n)| n));
    }

    fn medium(&mut self, Medium { sigma_t, albedo, phase }: &Medium) {
        // What a grey medium that is the same everywhere is, it always was; no other begins with a negative extinction.
        match (sigma_t.grey(), sigma_t) {
            (Some(grey), _) => self.doubles(&[grey]),
            (None, Extinction::Constant(sigma_t)) => {
                self.doubles(&[-1.0]);
                self.point(*sigma_t);
            }
            (None, Extinction::Grid { volume, scale }) => {
                self.doubles(&[-2.0, *scale]);
                self.volume(volume);
            }
        }
        match albedo {
            Albedo::Constant(albedo) => self.colour(*albedo),
            Albedo::Grid(volume) => {
                self.colour(-Rgb::ONE);
                self.volume(volume);
            }
        }
        match *phase {
            Phase::Isotropic => self.words(&[0]),
            Phase::HenyeyGreenstein { g } => {
                self.words(&[1]);
                self.doubles(&[g]);
            }
            Phase::Rayleigh => self.words(&[2]),
            Phase::TwoLobes { weight, g } => {
                self.words(&[3]);
                self.doubles(&[weight, g[0], g[1]]);
            }
        }
    }

    fn volume(&mut self, GridVolume { grid, filter, wrap, grid_from_world }: &GridVolume) {
        let filter = match filter {
            VolumeFilter::Trilinear => 0,
            VolumeFilter::Nearest => 1,
        };
        self.words(&grid.size());
        self.words(&[grid.channels() as u32, filter, wrap_number(*wrap)]);
        self.doubles(&grid_from_world.to_cols_array());
        for values in grid.values().chunks(1 << 10) {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_bits().to_le_bytes()).collect();
            self.hasher.update(&bytes);
        }
    }

    fn emitter(&mut self, emitter: &Emitter) {
        match emitter {
            Emitter::Point { position, intensity } => {
                self.words(&[0]);
                self.point(*position);
                self.colour(*intensity);
            }
            Emitter::Area { surface } => {
                self.words(&[1]);
                self.count(*surface);
            }
            Emitter::Constant { radiance } => {
                self.words(&[2]);
                self.colour(*radiance);
            }
            Emitter::Spot { position, direction, intensity, beam, cutoff, slide } => {
                self.words(&[3]);
                self.point(*position);
                self.point(*direction);
                self.colour(*intensity);
                self.doubles(&[*beam, *cutoff]);
                if let Some(slide) = slide {
                    self.slide(slide);
                }
            }
            Emitter::Projector { position, direction, slide } => {
                self.words(&[6]);
                self.point(*position);
                self.point(*direction);
                self.slide(slide);
            }
            Emitter::Directional { direction, irradiance } => {
                self.words(&[4]);
                self.point(*direction);
                self.colour(*irradiance);
            }
            Emitter::Envmap { image, scale, world_from_map } => {
                self.words(&[5, scale.to_bits()]);
                self.pixels(image);
                self.doubles(&world_from_map.to_cols_array());
            }
        }
    }

    fn slide(&mut self, Slide { texture, scale, axes }: &Slide) {
        self.texture(texture);
        self.words(&[scale.to_bits()]);
        axes.iter().for_each(|axis| self.point(*axis));
    }

    fn sensor(&mut self, Sensor { world_from_camera, projection, near_clip, far_clip, medium }: &Sensor) {
        self.doubles(&world_from_camera.to_cols_array());
        match projection {
            Projection::Perspective { tan_half_fov_x, lens, principal_point } => {
                self.doubles(&[*tan_half_fov_x, *near_clip, *far_clip]);
                self.doubles(principal_point);
                if let Some(Lens { radius, focus_distance }) = lens {
                    self.doubles(&[*radius, *focus_distance]);
                }
            }
            // No tangent is negative.
            Projection::Orthographic { half_width, half_height } => {
                self.doubles(&[-1.0, *near_clip, *far_clip, *half_width, *half_height]);
            }
        }
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

const fn wrap_number(wrap: Wrap) -> u32 {
    match wrap {
        Wrap::Repeat => 0,
        Wrap::Mirror => 1,
        Wrap::Clamp => 2,
    }
}
