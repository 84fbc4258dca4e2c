//! The figures of a render, in words and for machines.

use std::fmt;

use serde::Serialize;

use crate::{BuildReport, Counters, IntegratorKind, RenderOptions, scene::Scene};

/// All figures of one render. Times in seconds, sizes in bytes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// Version of this program.
    pub version: &'static str,
    /// Method of acceleration.
    pub method: &'static str,
    /// Side of a voxel in world units; `None` for the method `none`.
    pub voxel_size: Option<f64>,
    /// Voxels along x, y and z.
    pub grid: Option<[u32; 3]>,
    /// Share of the voxels that are free.
    pub free_share: Option<f64>,
    /// Bytes of the occupancy bits.
    pub bytes_occupancy: usize,
    /// Bytes of the distance field.
    pub bytes_field: usize,
    /// Bytes of all neighbourhoods.
    pub bytes_neighbourhoods: usize,
    /// Time to build the hierarchy and prepare the scene.
    pub t_hierarchy: f64,
    /// Time to voxelize.
    pub t_voxelize: f64,
    /// Time to build the distance field.
    pub t_field: f64,
    /// Time to build the neighbourhoods.
    pub t_neighbourhoods: f64,
    /// `T_build`, what the method costs before the first query: voxels, field and neighbourhoods (Sec. 2.6 in \[Houska2013\]).
    pub t_build: f64,
    /// `T_render` without `T_build`.
    pub t_render: f64,
    /// Integrator.
    pub integrator: &'static str,
    /// Samples on each path segment, for `raymarch`.
    pub samples_per_segment: Option<u32>,
    /// Estimator of transmittance towards emitters.
    pub transmittance: &'static str,
    /// Width and height of the image in pixels.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub spp: u32,
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
    /// Rays cast for the first occluder.
    pub rays: u64,
    /// Free flights asked for a proof (segment-first).
    pub flights: u64,
    /// Free flights proved, each a ray saved.
    pub flights_proved: u64,
    /// flights proved / flights.
    pub p_accelerated_flights: Option<f64>,
    /// For each emitter of the file, in its order: its neighbourhood, if it has one.
    pub neighbourhoods: Vec<Option<NeighbourhoodSize>>,
    /// Samples left out because they were not finite or negative; must be 0.
    pub refused: u64,
}

/// The size of a light's safe neighbourhood.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NeighbourhoodSize {
    /// Voxels in it.
    pub voxels: usize,
    /// Their share of the free voxels.
    pub share_of_free: f64,
}

/// What happened in a render, as its parts report it.
pub(crate) struct Record<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) options: &'a RenderOptions,
    pub(crate) build: &'a BuildReport,
    pub(crate) counters: &'a Counters,
    pub(crate) t_hierarchy: f64,
    pub(crate) t_render: f64,
    pub(crate) size: [u32; 2],
    pub(crate) spp: u32,
    pub(crate) seed: u64,
    pub(crate) triangles: usize,
}

fn ratio(a: u64, b: u64) -> Option<f64> {
    (b > 0).then(|| a as f64 / b as f64)
}

impl Statistics {
    pub(crate) fn new(r: &Record<'_>) -> Self {
        let free = r.build.voxels - r.build.occupied;
        let [t_voxelize, t_field, t_neighbourhoods] = r.build.seconds;
        let [bytes_occupancy, bytes_field, bytes_neighbourhoods] = r.build.bytes;
        let (integrator, samples_per_segment) = match r.options.integrator {
            IntegratorKind::Volpath => ("volpath", None),
            IntegratorKind::Raymarch { samples_per_segment } => ("raymarch", Some(samples_per_segment)),
        };
        debug_assert_eq!(r.build.neighbourhoods.len(), r.scene.emitters.len(), "one entry for each emitter");
        Self {
            version: env!("CARGO_PKG_VERSION"),
            method: r.options.method.name(),
            voxel_size: r.build.resolution.map(|_| r.build.voxel_size),
            grid: r.build.resolution,
            free_share: ratio(free as u64, r.build.voxels as u64),
            bytes_occupancy,
            bytes_field,
            bytes_neighbourhoods,
            t_hierarchy: r.t_hierarchy,
            t_voxelize,
            t_field,
            t_neighbourhoods,
            t_build: t_voxelize + t_field + t_neighbourhoods,
            t_render: r.t_render,
            integrator,
            samples_per_segment,
            transmittance: r.options.transmittance.name(),
            size: r.size,
            spp: r.spp,
            seed: r.seed,
            threads: rayon::current_num_threads(),
            triangles: r.triangles,
            paths: r.counters.paths,
            queries: r.counters.queries,
            spatial: r.counters.spatial,
            proved: r.counters.proved,
            p_spatial: ratio(r.counters.spatial, r.counters.queries),
            p_accelerated_given_spatial: ratio(r.counters.proved, r.counters.spatial),
            unknown_fraction: ratio(r.counters.spatial - r.counters.proved, r.counters.spatial),
            rays: r.counters.rays,
            flights: r.counters.flights,
            flights_proved: r.counters.flights_proved,
            p_accelerated_flights: ratio(r.counters.flights_proved, r.counters.flights),
            neighbourhoods: r
                .build
                .neighbourhoods
                .iter()
                .map(|n| {
                    n.map(|voxels| NeighbourhoodSize {
                        voxels,
                        share_of_free: ratio(voxels as u64, free as u64).unwrap_or(0.0),
                    })
                })
                .collect(),
            refused: r.counters.refused,
        }
    }
}

fn percent(x: Option<f64>) -> String {
    x.map_or_else(|| "–".to_owned(), |x| format!("{:.2} %", 100.0 * x))
}

fn mebibytes(bytes: usize) -> String {
    format!("{:.2} MiB", bytes as f64 / (1 << 20) as f64)
}

impl fmt::Display for Statistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size;
        write!(f, "image          {width} x {height}, {} spp, seed {}, {}", self.spp, self.seed, self.integrator)?;
        if let Some(n) = self.samples_per_segment {
            write!(f, " with {n} samples per segment")?;
        }
        writeln!(f, ", {} transmittance, {} threads", self.transmittance, self.threads)?;
        write!(f, "method         {}", self.method)?;
        if let (Some([x, y, z]), Some(size)) = (self.grid, self.voxel_size) {
            writeln!(f, ", voxel {size}, grid {x} x {y} x {z}, {} free", percent(self.free_share))?;
            writeln!(
                f,
                "memory         occupancy {}, field {}, neighbourhoods {}",
                mebibytes(self.bytes_occupancy),
                mebibytes(self.bytes_field),
                mebibytes(self.bytes_neighbourhoods)
            )?;
        } else {
            writeln!(f)?;
        }
        for (i, n) in self.neighbourhoods.iter().enumerate() {
            if let Some(n) = n {
                writeln!(
                    f,
                    "emitter {i}      neighbourhood of {} voxels, {} of the free ones",
                    n.voxels,
                    percent(Some(n.share_of_free))
                )?;
            }
        }
        writeln!(
            f,
            "T_build        {:.4} s (voxels {:.4}, field {:.4}, neighbourhoods {:.4}); hierarchy {:.4} s over {} triangles",
            self.t_build, self.t_voxelize, self.t_field, self.t_neighbourhoods, self.t_hierarchy, self.triangles
        )?;
        writeln!(f, "T_render       {:.3} s", self.t_render)?;
        writeln!(f, "queries        N = {}, p_sp = {}", self.queries, percent(self.p_spatial))?;
        write!(
            f,
            "proofs         p_acc|sp = {}, unknown fraction u = {}",
            percent(self.p_accelerated_given_spatial),
            percent(self.unknown_fraction)
        )?;
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
        if self.refused > 0 {
            write!(f, "\nWARNING        {} samples were not finite or negative and were left out", self.refused)?;
        }
        Ok(())
    }
}
