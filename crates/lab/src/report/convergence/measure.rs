//! The renders: references, and every method with every seed and number of samples.

use std::fmt;

use anyhow::anyhow;
use rayon::ThreadPool;
use vdf_render::{
    Acceleration, BuildReport, Image, IntegratorKind, Method, Prepared, Progress, RenderError, RenderOptions, World,
    metrics::{PIXELS_PER_DEGREE, hdr_flip, mse, rel_mse},
    render_prepared,
    scene::{PixelRect, Scene},
};

use super::{
    cache::{Cache, Key, Lookup},
    reference::{Reference, SEEDS, telling_pixels},
};
use crate::{
    commands::report::{
        bench::{has_pixels, pool, same_bits},
        queries::integrator_name,
    },
    failure::{Failure, say},
    progress::Reporter,
};

/// An integrator with its samples per segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Setting {
    Volpath,
    Raymarch(u32),
}

impl Setting {
    pub(super) const fn kind(self) -> IntegratorKind {
        match self {
            Self::Volpath => IntegratorKind::Volpath,
            Self::Raymarch(samples_per_segment) => IntegratorKind::Raymarch { samples_per_segment },
        }
    }

    /// Whether both estimate the same image: the samples per segment change the variance only.
    const fn converges_as(self, other: Self) -> bool {
        matches!((self, other), (Self::Volpath, Self::Volpath) | (Self::Raymarch(_), Self::Raymarch(_)))
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let samples = if let Self::Raymarch(n) = self { Some(*n) } else { None };
        f.write_str(&integrator_name(samples))
    }
}

/// What is to be measured.
pub(super) struct Plan {
    /// The hierarchy alone is the first.
    pub(super) methods: Vec<Method>,
    pub(super) settings: Vec<Setting>,
    /// Samples per pixel, ascending.
    pub(super) spps: Vec<u32>,
    pub(super) seeds: Vec<u64>,
    /// Samples per pixel of each half of a reference.
    pub(super) half_spp: u32,
    pub(super) voxel_size: f64,
    pub(super) threads: Option<usize>,
}

/// What was measured. Times in seconds; `[seed][spp]` are indices into those of the plan.
pub(super) struct Measured {
    pub(super) threads: usize,
    pub(super) references: Vec<Reference>,
    pub(super) settings: Vec<SettingResult>,
    /// `T_build` of each method with each seed.
    pub(super) t_build: Vec<Vec<f64>>,
}

/// An integrator. Its errors are those of all methods, for their images are the same.
pub(super) struct SettingResult {
    pub(super) setting: Setting,
    /// Number of its reference.
    pub(super) reference: usize,
    /// `[seed][spp]`.
    pub(super) errors: Vec<Vec<Errors>>,
    /// `T_render` by `[method][seed][spp]`, without `T_build`.
    pub(super) t_render: Vec<Vec<Vec<f64>>>,
    /// The images of the first seed, the fewest samples and the most.
    pub(super) first: Image,
    pub(super) last: Image,
}

/// How far an image is from its reference: as measured, with the reference's own error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Errors {
    pub(super) mse: f64,
    pub(super) rel_mse: f64,
    /// Mean of HDR-FLIP.
    pub(super) flip: f64,
}

pub(super) struct Bench<'a> {
    pub(super) plan: &'a Plan,
    pub(super) name: &'a str,
    pub(super) scene: &'a Scene,
    pub(super) world: &'a World,
    pub(super) cache: &'a Cache,
    pub(super) reporter: &'a Reporter,
}

type Built = (Acceleration, BuildReport);

/// Progress of a render as a part of the whole, which is counted in paths.
struct Paths<'a> {
    reporter: &'a Reporter,
    spp: u32,
}

impl Progress for Paths<'_> {
    fn phase(&self, _: &str) {}

    fn work_total(&self, _: u64) {}

    fn work_done(&self, pixels: u64) {
        self.reporter.work_done(pixels * u64::from(self.spp));
    }

    fn cancelled(&self) -> bool {
        self.reporter.interrupted()
    }
}

impl Bench<'_> {
    pub(super) fn measure(&self) -> Result<Measured, Failure> {
        let pool = pool(self.plan.threads)?;
        let references = self.references(&pool)?;
        let Plan { methods, settings, spps, seeds, .. } = self.plan;
        let none = || vec![Vec::with_capacity(seeds.len()); methods.len()];
        let (mut t_build, mut t_render) =
            (none(), vec![vec![vec![Vec::new(); seeds.len()]; methods.len()]; settings.len()]);
        let mut errors = vec![vec![Vec::new(); seeds.len()]; settings.len()];
        let mut images: Vec<Vec<Image>> = vec![Vec::new(); settings.len()];
        for (i, &seed) in seeds.iter().enumerate() {
            self.reporter.phase(&format!("seed {seed}: building"));
            let built = methods.iter().map(|m| self.build(*m, &pool)).collect::<Result<Vec<_>, Failure>>()?;
            for (times, (_, report)) in t_build.iter_mut().zip(&built) {
                times.push(report.seconds.iter().sum());
            }
            for (j, &spp) in spps.iter().enumerate() {
                for (k, &setting) in settings.iter().enumerate() {
                    self.reporter.phase(&format!("seed {seed}: {setting}, {spp} spp"));
                    let mut image: Option<(Method, Image)> = None;
                    // Each method is the first in its turn.
                    for m in (0..methods.len()).map(|m| (m + i + j) % methods.len()) {
                        let method = methods[m];
                        let (rendered, t) = self.render(setting, method, &built[m], seed, spp, None)?;
                        t_render[k][m][i].push(t);
                        match &image {
                            None => image = Some((method, rendered)),
                            Some((first, expected)) if !same_bits(&rendered, expected) => {
                                return Err(Failure::Work(anyhow!(
                                    "WRONG IMAGE: {setting} with {method}, voxel {}, seed {seed} and {spp} samples per pixel \
                                     differs from {first}",
                                    self.plan.voxel_size
                                )));
                            }
                            Some(_) => {}
                        }
                    }
                    let (_, image) =
                        image.ok_or_else(|| Failure::Work(anyhow!("there is no method to render with")))?;
                    let reference = &references[reference_of(&references, setting)?].image;
                    errors[k][i].push(Errors::new(&image, reference)?);
                    if i == 0 && (j == 0 || j + 1 == spps.len()) {
                        images[k].push(image);
                    }
                }
            }
        }
        let settings = settings
            .iter()
            .zip(errors)
            .zip(t_render)
            .zip(images)
            .map(|(((&setting, errors), t_render), mut images)| {
                let reference = reference_of(&references, setting)?;
                let last = images.pop().ok_or_else(|| Failure::Work(anyhow!("{setting} was not rendered")))?;
                let first = images.pop().unwrap_or_else(|| last.clone());
                Ok(SettingResult { setting, reference, errors, t_render, first, last })
            })
            .collect::<Result<_, Failure>>()?;
        Ok(Measured { threads: pool.current_num_threads(), references, settings, t_build })
    }

    fn build(&self, method: Method, pool: &ThreadPool) -> Result<Built, Failure> {
        if self.reporter.interrupted() {
            return Err(Failure::Interrupted);
        }
        let most = RenderOptions::default().max_voxels;
        let lights = self.scene.light_shapes();
        let World { triangles, bounds, .. } = self.world;
        let build = || Acceleration::build(method, triangles, *bounds, &lights, self.plan.voxel_size, most);
        Ok(pool.install(build).map_err(RenderError::from)?)
    }

    /// The image and `T_render`. A part of the film, which only checks something, is no progress.
    fn render(
        &self,
        setting: Setting,
        method: Method,
        built: &Built,
        seed: u64,
        spp: u32,
        crop: Option<PixelRect>,
    ) -> Result<(Image, f64), Failure> {
        let options = RenderOptions {
            method,
            voxel_size: Some(self.plan.voxel_size),
            integrator: setting.kind(),
            spp: Some(spp),
            seed: Some(seed),
            threads: self.plan.threads,
            crop,
            ..RenderOptions::default()
        };
        let prepared = Prepared { world: self.world, t_hierarchy: 0.0, acceleration: &built.0, build: &built.1 };
        let progress = Paths { reporter: self.reporter, spp: if crop.is_some() { 0 } else { spp } };
        let rendering = render_prepared(self.scene, &prepared, &options, &progress)?;
        Ok((rendering.image, rendering.statistics.t_render))
    }

    /// One reference for all settings that converge to it, by the hierarchy alone.
    fn references(&self, pool: &ThreadPool) -> Result<Vec<Reference>, Failure> {
        let Plan { methods, settings, spps, seeds, half_spp, .. } = self.plan;
        let built = self.build(Method::None, pool)?;
        let mut wanted: Vec<Setting> = Vec::new();
        for &setting in settings {
            // The most samples per segment have the least variance.
            match (wanted.iter_mut().find(|w| w.converges_as(setting)), setting) {
                (Some(Setting::Raymarch(most)), Setting::Raymarch(n)) => *most = n.max(*most),
                (Some(_), _) => {}
                (None, _) => wanted.push(setting),
            }
        }
        self.reporter.phase("looking for references");
        let key = |setting| Key::new(self.name, self.scene, setting, *half_spp);
        let kept = wanted.iter().map(|w| self.kept(*w, &key(*w), &built)).collect::<Result<Vec<_>, Failure>>()?;

        let crop = self.scene.film.crop;
        let pixels = u64::from(crop.x1 - crop.x0) * u64::from(crop.y1 - crop.y0);
        let samples: u64 = spps.iter().map(|s| u64::from(*s)).sum();
        let renders = samples * (settings.len() * methods.len() * seeds.len()) as u64;
        let missing = kept.iter().filter(|k| k.is_none()).count() as u64;
        self.reporter.work_total(pixels * (renders + 2 * missing * u64::from(*half_spp)));
        let mut references = Vec::new();
        for (setting, kept) in wanted.into_iter().zip(kept) {
            let cached = kept.is_some();
            let halves = match kept {
                Some(halves) => halves,
                None => {
                    self.reporter.phase(&format!("{setting}: reference"));
                    let halves = self.halves(setting, &built, None)?;
                    self.cache.store(&key(setting), &halves)?;
                    halves
                }
            };
            references.push(Reference::new(setting, 2 * half_spp, &halves, cached)?);
        }
        Ok(references)
    }

    fn halves(&self, setting: Setting, built: &Built, crop: Option<PixelRect>) -> Result<[Image; 2], Failure> {
        let half = |seed| self.render(setting, Method::None, built, seed, self.plan.half_spp, crop);
        let [(a, _), (b, _)] = [half(SEEDS[0])?, half(SEEDS[1])?];
        Ok([a, b])
    }

    /// What the cache has, if it is what this program would render.
    fn kept(&self, setting: Setting, key: &Key, built: &Built) -> Result<Option<[Image; 2]>, Failure> {
        let again = |file: String, why: &str| say(format_args!("warning: {file}: {why}; it is rendered again"));
        match self.cache.look_up(key) {
            Lookup::Missing => Ok(None),
            Lookup::Unusable { file, why } => {
                again(file.display().to_string(), &why);
                Ok(None)
            }
            Lookup::Found(halves) => {
                let crop = telling_pixels(&halves);
                let rendered = self.halves(setting, built, Some(crop))?;
                if halves.iter().zip(&rendered).all(|(kept, rendered)| has_pixels(kept, rendered)) {
                    return Ok(Some(halves));
                }
                let what = format!("the reference of {setting} in {}", self.cache.folder().display());
                again(what, "this program renders other pixels");
                Ok(None)
            }
        }
    }
}

impl Errors {
    fn new(image: &Image, reference: &Image) -> Result<Self, RenderError> {
        Ok(Self {
            mse: mse(image, reference)?,
            rel_mse: rel_mse(image, reference)?,
            flip: hdr_flip(image, reference, PIXELS_PER_DEGREE)?.map.mean(),
        })
    }
}

fn reference_of(references: &[Reference], setting: Setting) -> Result<usize, Failure> {
    let found = references.iter().position(|r| r.setting.converges_as(setting));
    found.ok_or_else(|| Failure::Work(anyhow!("{setting} has no reference")))
}

#[cfg(test)]
mod tests {
    use vdf_render::Rgb;

    use super::*;

    #[test]
    fn a_part_lies_where_it_lies() {
        let mut image = Image::cropped([20, 20], PixelRect { x0: 10, y0: 5, x1: 14, y1: 8 });
        for (i, p) in image.pixels.iter_mut().enumerate() {
            *p = Rgb::splat(i as f32);
        }
        let part = |x0, y0, x1, y1| {
            let mut part = Image::cropped([20, 20], PixelRect { x0, y0, x1, y1 });
            for (i, p) in part.pixels.iter_mut().enumerate() {
                let (x, y) = (i as u32 % part.width + x0 - 10, i as u32 / part.width + y0 - 5);
                *p = Rgb::splat((4 * y + x) as f32);
            }
            part
        };
        assert!(has_pixels(&image, &part(10, 5, 14, 8)) && has_pixels(&image, &part(11, 6, 13, 8)));
        let mut moved = part(11, 6, 13, 8);
        moved.origin = [12, 6];
        assert!(!has_pixels(&image, &moved));
        moved.origin = [9, 6];
        assert!(!has_pixels(&image, &moved));
        // Rows that run over the edge are not the next row.
        assert!(!has_pixels(&image, &part(13, 5, 15, 6)) && !has_pixels(&image, &part(10, 7, 12, 9)));
        let mut other = part(11, 6, 13, 8);
        other.pixels[3].y += 1.0;
        assert!(!has_pixels(&image, &other));
    }

    #[test]
    fn the_samples_of_a_segment_do_not_change_where_it_converges() {
        assert!(
            Setting::Raymarch(1).converges_as(Setting::Raymarch(49)) && Setting::Volpath.converges_as(Setting::Volpath)
        );
        assert!(!Setting::Raymarch(7).converges_as(Setting::Volpath));
        assert_eq!([Setting::Volpath, Setting::Raymarch(7)].map(|s| s.to_string()), ["volpath", "raymarch 7"]);
    }
}
