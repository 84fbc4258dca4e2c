//! A scene made ready to be rendered: its world, its hierarchy and the provers of a method, which belong together.

use std::{sync::Arc, time::Instant};

use vdf_geometry::Bounds;
use vdf_scene::Scene;
use vdf_visibility::{BuildReport, Method, ProverOptions, Provers, Visibility, VisibilityError};

use crate::{
    Choice, Film, FilmPart, FilmRun, LiveFilm, PrepareOptions, Progress, RenderError, RenderOptions, Rendering,
    Statistics, World,
    job::Job,
    light_shapes,
    render::{add_part, empty_film, render},
    threads::on_threads,
};

/// A scene with everything that its renders share. Immutable; renders of it build nothing.
///
/// World and provers come from one scene and cannot be exchanged, for proofs about one scene are wrong in another.
#[derive(Debug)]
pub struct PreparedScene {
    scene: Arc<Scene>,
    world: Arc<World>,
    /// Seconds that the world took.
    t_hierarchy: f64,
    method: Method,
    provers: Provers,
    build: BuildReport,
    notes: Vec<String>,
    choice: Option<Choice>,
}

impl PreparedScene {
    /// Prepares `scene`: the hierarchy over its occluders, and what the method needs.
    ///
    /// # Errors
    /// If an option or the voxel size is not usable, the voxels exceed `options.max_voxels`, or `progress` asks to stop.
    pub fn new(
        scene: impl Into<Arc<Scene>>,
        options: &PrepareOptions,
        progress: &dyn Progress,
    ) -> Result<Self, RenderError> {
        options.validate()?;
        let scene = scene.into();
        on_threads(options.threads, || {
            progress.phase("hierarchy");
            let start = Instant::now();
            let world = Arc::new(World::new(&scene));
            Self::build(scene, world, start.elapsed().as_secs_f64(), options, progress)
        })
    }

    /// The same scene with other provers; the world and its hierarchy are shared, not built again.
    ///
    /// # Errors
    /// As [`PreparedScene::new`].
    pub fn with_options(&self, options: &PrepareOptions, progress: &dyn Progress) -> Result<Self, RenderError> {
        options.validate()?;
        on_threads(options.threads, || self.with_provers(options, progress))
    }

    /// As [`PreparedScene::with_options`], on the current pool of threads.
    pub(crate) fn with_provers(&self, options: &PrepareOptions, progress: &dyn Progress) -> Result<Self, RenderError> {
        let (scene, world) = (Arc::clone(&self.scene), Arc::clone(&self.world));
        Self::build(scene, world, self.t_hierarchy, options, progress)
    }

    /// With the reason for its method.
    pub(crate) fn chosen(self, choice: Choice) -> Self {
        Self { choice: Some(choice), ..self }
    }

    fn build(
        scene: Arc<Scene>,
        world: Arc<World>,
        t_hierarchy: f64,
        options: &PrepareOptions,
        progress: &dyn Progress,
    ) -> Result<Self, RenderError> {
        if progress.cancelled() {
            return Err(RenderError::Cancelled);
        }
        let lights = light_shapes(&scene);
        let bounds = *world.grid_bounds(options.grid);
        let method = options.method.unwrap_or_else(|| Method::for_scene(&lights, world.triangles.len()));
        let build = |method, voxel_size| {
            let options = ProverOptions {
                method,
                voxel_size,
                max_voxels: options.max_voxels,
                texels: options.texels,
                ..ProverOptions::default()
            };
            Provers::build(&options, &world.triangles, bounds, &lights, progress)
        };
        let mut notes = Vec::new();
        let built = match options.voxel_size {
            Some(size) => build(method, size).map(|built| (method, built)),
            None => build_by_default(method, default_voxel_size(&bounds), build, &mut notes),
        };
        let (method, (provers, build)) = built.map_err(|error| match error {
            VisibilityError::Cancelled => RenderError::Cancelled,
            error => error.into(),
        })?;
        let over_budget = build.over_budget();
        if over_budget > 0 {
            let all = build.lights.len();
            notes.push(format!(
                "{over_budget} of {all} lights have no neighbourhood, which would take too much memory or time in all: their queries take longer"
            ));
        }
        drop(lights);
        Ok(Self { scene, world, t_hierarchy, method, provers, build, notes, choice: None })
    }

    /// Renders the scene. Builds nothing.
    ///
    /// # Errors
    /// If an option is not usable, or `progress` asks to stop.
    pub fn render(&self, options: &RenderOptions, progress: &dyn Progress) -> Result<Rendering, RenderError> {
        let job = self.job(options)?;
        on_threads(options.threads, || render(&job, progress))
    }

    /// A film without samples for a render of these options, to be rendered to by [`PreparedScene::render_part`]. `name` is the scene's, for
    /// those who will see the picture.
    ///
    /// # Errors
    /// If an option is not usable, or there is no memory for the film.
    pub fn film(&self, options: &RenderOptions, name: &str) -> Result<Film, RenderError> {
        empty_film(&self.job(options)?, name)
    }

    /// Renders what `film` lacks of a part of its samples, of whatever size: films can be merged, and once all samples are there the image has
    /// the bytes that [`PreparedScene::render`] gives it. Tells `progress` what is done of it, but not how much there is.
    ///
    /// If it is stopped, the film keeps the tiles that are done.
    ///
    /// # Errors
    /// If an option is not usable, the film is of another render, or `progress` asks to stop.
    pub fn render_part(
        &self,
        options: &RenderOptions,
        film: &LiveFilm,
        part: &FilmPart,
        progress: &dyn Progress,
    ) -> Result<(), RenderError> {
        let job = self.job(options)?;
        empty_film(&job, "")?.origin().check_same_samples(film.snapshot().origin())?;
        on_threads(options.threads, || add_part(&job, film, part, progress))
    }

    /// The figures of a film of `spp` whole samples per pixel, and of the last run that worked at it.
    ///
    /// # Errors
    /// If an option is not usable.
    pub fn statistics(&self, options: &RenderOptions, film: &Film, spp: u32) -> Result<Statistics, RenderError> {
        let job = self.job(options)?;
        let seconds = film.runs().iter().map(|run| run.t_render).sum();
        let noise = film.noise_figures();
        on_threads(options.threads, || Ok(Statistics { noise, ..Statistics::new(&job, film.counters(), spp, seconds) }))
    }

    /// What a film is to remember of a run that has rendered for `t_render` seconds and made `paths` paths.
    #[must_use]
    pub fn run(&self, machine: &str, threads: usize, paths: u64, t_render: f64) -> FilmRun {
        FilmRun {
            machine: machine.to_owned(),
            method: self.method.name().to_owned(),
            voxel_size: self.build.resolution.map(|_| self.build.voxel_size),
            threads,
            paths,
            t_hierarchy: self.t_hierarchy,
            t_build: self.build.seconds(),
            t_render,
        }
    }

    /// The render of these options, to be followed path by path.
    ///
    /// # Errors
    /// If an option is not usable.
    pub fn job<'a>(&'a self, options: &'a RenderOptions) -> Result<Job<'a>, RenderError> {
        options.validate(&self.scene)?;
        Ok(Job::new(self, options))
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The scene as integrators see it.
    #[must_use]
    pub fn world(&self) -> &World {
        &self.world
    }

    /// The method whose provers these are.
    #[must_use]
    pub const fn method(&self) -> Method {
        self.method
    }

    /// The provers.
    #[must_use]
    pub const fn provers(&self) -> &Provers {
        &self.provers
    }

    /// What was built for the method.
    #[must_use]
    pub const fn build_report(&self) -> &BuildReport {
        &self.build
    }

    /// What was done otherwise than by default, and why; one sentence each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Why a pilot chose its method, if one did ([`PreparedScene::with_best_method`]).
    #[must_use]
    pub const fn choice(&self) -> Option<&Choice> {
        self.choice.as_ref()
    }

    /// Seconds that the hierarchy took, with all that does not depend on the method.
    #[must_use]
    pub const fn t_hierarchy(&self) -> f64 {
        self.t_hierarchy
    }

    /// Who answers the scene's visibility queries.
    #[must_use]
    pub fn visibility(&self) -> Visibility<'_> {
        Visibility::new(&self.world.bvh, &self.provers)
    }
}

/// Builds with a voxel size that nobody asked for. So it is never the error: where it does not fit, a coarser one is taken, or no method.
fn build_by_default(
    method: Method,
    size: f64,
    build: impl Fn(Method, f64) -> Result<(Provers, BuildReport), VisibilityError>,
    notes: &mut Vec<String>,
) -> Result<(Method, (Provers, BuildReport)), VisibilityError> {
    let error = match build(method, size) {
        Ok(built) => return Ok((method, built)),
        Err(error) => error,
    };
    let smallest = match &error {
        VisibilityError::Voxel(error) => error.smallest_usable(),
        VisibilityError::NoMemory { .. } => None,
        _ => return Err(error),
    };
    if let Some(smallest) = smallest
        && let Ok(built) = build(method, smallest)
    {
        notes.push(format!("voxels are {smallest} units wide, not a 128th of the scene: {error}"));
        return Ok((method, built));
    }
    notes.push(format!("rendered without a method: {error}"));
    Ok((Method::NONE, build(Method::NONE, size)?))
}

/// A 128th of the longest side of these bounds, the side of a voxel where none is given; 1 if they are one point.
#[must_use]
pub fn default_voxel_size(bounds: &Bounds) -> f64 {
    let extent = bounds.extent().max_element();
    // A scene of one point has no extent; any size covers it with one voxel.
    if extent > 0.0 { extent / 128.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As where memory is limited: there is a picture, and a note.
    #[test]
    fn a_default_that_does_not_fit_the_memory_is_no_error() {
        let build = |method: Method, size| match method {
            Method::NONE => Ok((Provers::none(), BuildReport::default())),
            _ => Err(VisibilityError::NoMemory { size, bytes: 1 << 40 }),
        };
        let mut notes = Vec::new();
        let (method, _) = build_by_default(Method::default(), 0.5, build, &mut notes).expect("it is rendered");
        assert_eq!(method, Method::NONE);
        assert!(notes[0].starts_with("rendered without a method: a voxel size of 0.5 needs"), "{notes:?}");
    }
}
