//! The figures of a render, in words and for machines.

use std::fmt;

use serde::Serialize;
use vdf_visibility::Counters;

use crate::{Choice, Job, SegmentSamples};

/// All figures of one render. Times in seconds, sizes in bytes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// Version of this program.
    pub version: &'static str,
    /// Method of acceleration.
    pub method: &'static str,
    /// Why a pilot chose it, if one did.
    pub choice: Option<Choice>,
    /// Side of a voxel in world units, if there are voxels.
    pub voxel_size: Option<f64>,
    /// Voxels along x, y and z.
    pub grid: Option<[u32; 3]>,
    /// Share of the voxels that are free.
    pub free_share: Option<f64>,
    /// What was built for the method, in this order.
    pub build: Vec<PartSize>,
    /// Time to build the hierarchy and prepare the scene.
    pub t_hierarchy: f64,
    /// `T_build`, what the method costs before the first query: voxels, field and neighbourhoods (Sec. 2.6 in \[Houska2013\]).
    pub t_build: f64,
    /// `T_render` without `T_build`.
    pub t_render: f64,
    /// Integrator.
    pub integrator: &'static str,
    /// Samples on each path segment, for `raymarch`.
    pub samples_per_segment: Option<SegmentSamples>,
    /// Estimator of transmittance towards emitters.
    pub transmittance: &'static str,
    /// When paths were ended by chance.
    pub roulette: &'static str,
    /// How the integrator drew what leads to light.
    pub estimator: &'static str,
    /// Whether events were to be connected to paths of the lights.
    pub light_paths: &'static str,
    /// How the samples of a pixel were spread.
    pub sampler: &'static str,
    /// Width and height of the image in pixels.
    pub size: [u32; 2],
    /// Samples per pixel; the most that any has, where they differ.
    pub spp: u32,
    /// How far a limit of noise was reached.
    pub noise: Option<NoiseFigures>,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Number of threads.
    pub threads: usize,
    /// Triangles that occlude.
    pub triangles: usize,
    /// Camera paths.
    pub paths: u64,
    /// Visibility queries, N.
    pub queries: u64,
    /// Those neither of whose ends lies on an occluder.
    pub spatial: u64,
    /// Those of the spatial ones that were proved.
    pub proved: u64,
    /// spatial / N.
    pub p_spatial: Option<f64>,
    /// proved / spatial.
    pub p_accelerated_given_spatial: Option<f64>,
    /// The unknown fraction, 1 − proved / spatial.
    pub unknown_fraction: Option<f64>,
    /// Superficial queries of which only the end on an area light lies on an occluder.
    pub on_light: u64,
    /// Those of them that the neighbourhood of the light proved (4.4.1).
    pub on_light_proved: u64,
    /// on light proved / on light.
    pub p_accelerated_on_light: Option<f64>,
    /// Superficial queries, from surfaces, that light buffers answered.
    pub superficial_proved: u64,
    /// superficial proved / all other queries than those counted above.
    pub p_accelerated_superficial: Option<f64>,
    /// Of all queries that were proved those that are occluded; only light buffers say so.
    pub proved_occluded: u64,
    /// Rays cast for the first occluder.
    pub rays: u64,
    /// Segments of which it was found which parts a point light sees (`--estimator lit`).
    pub lit_segments: u64,
    /// Segments between events of camera paths and of paths from lights that were asked whether anything is in the way.
    pub connections: u64,
    /// Free flights asked for a proof (segment-first).
    pub flights: u64,
    /// Free flights proved, each a ray saved.
    pub flights_proved: u64,
    /// flights proved / flights.
    pub p_accelerated_flights: Option<f64>,
    /// For each emitter of the file, in its order: its neighbourhood, if it has one.
    pub neighbourhoods: Vec<Option<NeighbourhoodSize>>,
    /// The same for light buffers.
    pub light_buffers: Vec<Option<BufferSize>>,
    /// For each emitter why it has not what the method would keep for it; `None` if that is not so.
    pub fallbacks: Vec<Option<&'static str>>,
    /// Samples left out because they were not finite or negative; must be 0.
    pub refused: u64,
}

/// How far a limit of noise was reached.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NoiseFigures {
    /// The limit.
    pub limit: f64,
    /// The noise of the whole picture, judged as one tile; `None` with fewer than two samples.
    pub noise: Option<f64>,
    /// Tiles of 16 × 16 pixels.
    pub tiles: usize,
    /// Those whose noise is below the limit.
    pub quiet_tiles: usize,
    /// Mean number of samples of a pixel.
    pub mean_spp: f64,
}

/// The size of a light's safe neighbourhood.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NeighbourhoodSize {
    /// Voxels in it.
    pub voxels: usize,
    /// Their share of the free voxels.
    pub share_of_free: f64,
}

/// The size of a light buffer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BufferSize {
    /// Texels along each side of a face.
    pub texels: u32,
    /// Its memory in bytes.
    pub bytes: usize,
    /// How long it took to build, in seconds.
    pub seconds: f64,
}

/// A structure that a method built.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PartSize {
    /// What it is.
    pub name: &'static str,
    /// Its memory in bytes.
    pub bytes: usize,
    /// How long it took, in seconds.
    pub seconds: f64,
}

fn ratio(a: u64, b: u64) -> Option<f64> {
    (b > 0).then(|| a as f64 / b as f64)
}

impl Statistics {
    pub(crate) fn new(job: &Job<'_>, counters: &Counters, spp: u32, t_render: f64) -> Self {
        let (prepared, options) = (job.prepared(), job.options());
        let build = prepared.build_report();
        let free = build.voxels - build.occupied;
        let neighbourhood = |voxels: usize| NeighbourhoodSize {
            voxels,
            share_of_free: ratio(voxels as u64, free as u64).unwrap_or(0.0),
        };
        Self {
            version: env!("CARGO_PKG_VERSION"),
            method: prepared.method().name(),
            choice: prepared.choice().cloned(),
            voxel_size: build.resolution.map(|_| build.voxel_size),
            grid: build.resolution,
            free_share: ratio(free as u64, build.voxels as u64),
            build: build.parts.iter().map(|p| PartSize { name: p.name, bytes: p.bytes, seconds: p.seconds }).collect(),
            t_hierarchy: prepared.t_hierarchy(),
            t_build: build.seconds(),
            t_render,
            integrator: options.integrator.name(),
            samples_per_segment: options.integrator.samples_per_segment(),
            transmittance: options.transmittance.name(),
            roulette: options.roulette.name(),
            estimator: options.estimator.name(),
            light_paths: options.light_paths.name(),
            sampler: options.sampler.name(),
            size: job.size(),
            spp,
            noise: None,
            seed: job.seed(),
            threads: rayon::current_num_threads(),
            triangles: prepared.world().triangles.len(),
            paths: counters.paths,
            queries: counters.queries,
            spatial: counters.spatial,
            proved: counters.proved,
            p_spatial: ratio(counters.spatial, counters.queries),
            p_accelerated_given_spatial: ratio(counters.proved, counters.spatial),
            unknown_fraction: ratio(counters.spatial - counters.proved, counters.spatial),
            on_light: counters.on_light,
            on_light_proved: counters.on_light_proved,
            p_accelerated_on_light: ratio(counters.on_light_proved, counters.on_light),
            superficial_proved: counters.superficial_proved,
            p_accelerated_superficial: ratio(
                counters.superficial_proved,
                counters.queries - counters.spatial - counters.on_light,
            ),
            proved_occluded: counters.proved_occluded,
            rays: counters.rays,
            lit_segments: counters.lit_segments,
            connections: counters.connections,
            flights: counters.flights,
            flights_proved: counters.flights_proved,
            p_accelerated_flights: ratio(counters.flights_proved, counters.flights),
            neighbourhoods: build.lights.iter().map(|l| l.voxels.map(neighbourhood)).collect(),
            light_buffers: build
                .lights
                .iter()
                .map(|l| Some(BufferSize { texels: l.texels?, bytes: l.bytes, seconds: l.seconds? }))
                .collect(),
            fallbacks: build.lights.iter().map(|l| l.fallback).collect(),
            refused: counters.refused,
        }
    }
}

fn percent(x: Option<f64>) -> String {
    x.map_or_else(|| "–".to_owned(), |x| format!("{:.2} %", 100.0 * x))
}

fn mebibytes(bytes: usize) -> String {
    format!("{:.2} MiB", bytes as f64 / (1 << 20) as f64)
}

impl Statistics {
    /// Lights that are told of one by one; of more there is a summary.
    const TOLD: usize = 8;

    /// What is kept for each light.
    fn write_lights(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = self.neighbourhoods.iter().zip(&self.light_buffers).zip(&self.fallbacks);
        for (i, ((neighbourhood, buffer), fallback)) in all.take(Self::TOLD).enumerate() {
            if let Some(buffer) = buffer {
                let BufferSize { texels, bytes, seconds } = *buffer;
                let bytes = mebibytes(bytes);
                writeln!(
                    f,
                    "emitter {i}      light buffer, {texels} x {texels} texels a face, {bytes}, {seconds:.4} s"
                )?;
            }
            if let Some(reason) = fallback {
                writeln!(f, "emitter {i}      {reason}")?;
            }
            if let Some(n) = neighbourhood {
                let share = percent(Some(n.share_of_free));
                writeln!(f, "emitter {i}      neighbourhood of {} voxels, {share} of the free ones", n.voxels)?;
            }
        }
        let more = self.fallbacks.len().saturating_sub(Self::TOLD);
        if more > 0 {
            let buffers = self.light_buffers.iter().flatten().count();
            let neighbourhoods = self.neighbourhoods.iter().flatten().count();
            writeln!(
                f,
                "               and {more} more; in all {buffers} light buffers and {neighbourhoods} neighbourhoods"
            )?;
        }
        Ok(())
    }
}

impl fmt::Display for Statistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size;
        write!(f, "image          {width} x {height}, {} spp, seed {}, {}", self.spp, self.seed, self.integrator)?;
        if let Some(n) = self.samples_per_segment {
            write!(f, " with {n} samples per segment")?;
        }
        writeln!(
            f,
            ", {} transmittance, {} estimator, {} sampler, {} threads",
            self.transmittance, self.estimator, self.sampler, self.threads
        )?;
        if let Some(NoiseFigures { limit, noise, tiles, quiet_tiles, mean_spp }) = self.noise {
            let noise = noise.map_or_else(|| "unknown".to_owned(), |noise| format!("{noise:.4}"));
            writeln!(
                f,
                "noise          {noise}, {quiet_tiles} of {tiles} tiles at most {limit}, {mean_spp:.1} samples per pixel in the mean"
            )?;
        }
        write!(f, "method         {}", self.method)?;
        if let (Some([x, y, z]), Some(size)) = (self.grid, self.voxel_size) {
            write!(f, ", voxel {size}, grid {x} x {y} x {z}, {} free", percent(self.free_share))?;
        }
        writeln!(f)?;
        if let Some(choice) = &self.choice {
            let Choice { reason, pilot_paths, t_pilot, .. } = choice;
            writeln!(f, "chosen         {reason} (pilot of {pilot_paths} paths, {t_pilot:.4} s)")?;
        }
        if !self.build.is_empty() {
            let sizes = self.build.iter().map(|p| format!("{} {}", p.name, mebibytes(p.bytes)));
            writeln!(f, "memory         {}", sizes.collect::<Vec<_>>().join(", "))?;
        }
        self.write_lights(f)?;
        let steps: Vec<_> = self.build.iter().map(|p| format!("{} {:.4}", p.name, p.seconds)).collect();
        let steps = if steps.is_empty() { String::new() } else { format!(" ({})", steps.join(", ")) };
        writeln!(
            f,
            "T_build        {:.4} s{steps}; hierarchy {:.4} s over {} triangles",
            self.t_build, self.t_hierarchy, self.triangles
        )?;
        writeln!(f, "T_render       {:.3} s", self.t_render)?;
        writeln!(f, "queries        N = {}, p_sp = {}", self.queries, percent(self.p_spatial))?;
        write!(
            f,
            "proofs         p_acc|sp = {}, unknown fraction u = {}",
            percent(self.p_accelerated_given_spatial),
            percent(self.unknown_fraction)
        )?;
        if self.on_light > 0 {
            write!(
                f,
                "\narea lights    {} superficial queries with only the light's end on an occluder, {} proved ({})",
                self.on_light,
                self.on_light_proved,
                percent(self.p_accelerated_on_light)
            )?;
        }
        if self.superficial_proved > 0 {
            write!(
                f,
                "\nsurfaces       {} of the queries from surfaces answered ({})",
                self.superficial_proved,
                percent(self.p_accelerated_superficial)
            )?;
        }
        if self.light_buffers.iter().any(Option::is_some) {
            let answered = self.proved + self.on_light_proved + self.superficial_proved;
            let of_all = |n: u64| percent(ratio(n, self.queries));
            write!(
                f,
                "\nanswers        {} unoccluded, {} occluded, {} by the hierarchy",
                of_all(answered - self.proved_occluded),
                of_all(self.proved_occluded),
                of_all(self.queries - answered)
            )?;
        }
        write!(f, "\nrays           {} cast", self.rays)?;
        if self.flights > 0 {
            write!(
                f,
                ", {} saved by proof, {} of the {} free flights asked",
                self.flights_proved,
                percent(self.p_accelerated_flights),
                self.flights
            )?;
        }
        if self.lit_segments > 0 {
            write!(f, "\nlit            {} segments divided into lit and dark parts", self.lit_segments)?;
        }
        if self.connections > 0 {
            write!(f, "\nconnections    {} to paths from lights", self.connections)?;
        }
        if self.refused > 0 {
            write!(f, "\nWARNING        {} samples were not finite or negative and were left out", self.refused)?;
        }
        Ok(())
    }
}
