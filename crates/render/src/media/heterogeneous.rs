//! Media that change in space, or take more of one colour than of another: an extinction on a grid or of three numbers, an albedo on a grid.

use glam::{DVec3, Vec3};
use smallvec::SmallVec;
use vdf_geometry::{Bounds, Segment};
use vdf_scene::{Albedo, Extinction, Medium, Phase, Rgb};

use super::grid::{Grid, Knot, Reached};

/// A medium that is no plain fog, prepared for rendering.
#[derive(Debug)]
pub(crate) struct Heterogeneous {
    extinction: Local,
    albedo: Albedo,
    /// Phase function.
    pub(crate) phase: Phase,
}

#[derive(Debug)]
enum Local {
    Constant(DVec3),
    Grid(Box<Grid>),
}

impl Heterogeneous {
    pub(super) fn new(medium: &Medium) -> Self {
        let extinction = match &medium.sigma_t {
            Extinction::Constant(sigma_t) => Local::Constant(*sigma_t),
            Extinction::Grid { volume, scale } => Local::Grid(Box::new(Grid::new(volume, *scale))),
        };
        Self { extinction, albedo: medium.albedo.clone(), phase: medium.phase }
    }

    /// Whether it takes more of one colour than of another.
    pub(super) fn is_chromatic(&self) -> bool {
        match &self.extinction {
            Local::Constant(sigma_t) => *sigma_t != DVec3::splat(sigma_t.x),
            Local::Grid(grid) => grid.channels() > 1,
        }
    }

    /// The albedo at a point.
    #[inline(never)]
    pub(crate) fn albedo(&self, point: DVec3) -> Rgb {
        match &self.albedo {
            Albedo::Constant(albedo) => *albedo,
            // A value of 1 may be interpolated to a little more.
            Albedo::Grid(volume) => volume.at(point).min(Vec3::ONE),
        }
    }

    /// Where it ends, if it does.
    pub(super) fn bounds(&self) -> Option<Bounds> {
        match &self.extinction {
            Local::Constant(_) => None,
            Local::Grid(grid) => Some(*grid.bounds()),
        }
    }

    /// A typical extinction coefficient.
    pub(super) fn typical(&self) -> f64 {
        match &self.extinction {
            Local::Constant(sigma_t) => sigma_t.element_sum() / 3.0,
            Local::Grid(grid) => grid.typical(),
        }
    }

    /// The optical depth of a segment between two of its parameters, for all colours if it is the same, else for red; `length` is that of all of it.
    #[inline(never)]
    pub(crate) fn optical_depth(&self, segment: &Segment, [t0, t1]: [f64; 2], length: f64) -> f64 {
        match &self.extinction {
            Local::Constant(sigma_t) => sigma_t.x * ((t1 - t0) * length),
            Local::Grid(grid) => grid.optical_depth::<1>(segment, [t0, t1], length)[0],
        }
    }

    /// The parameter between two others at which the optical depth from the first on is `tau`, or else the optical depth of all; for all colours if it is the
    /// same, else for red.
    #[inline(never)]
    pub(crate) fn distance(&self, segment: &Segment, [t0, t1]: [f64; 2], length: f64, tau: f64) -> Result<f64, f64> {
        match &self.extinction {
            Local::Constant(sigma_t) => {
                constant(*sigma_t, [t0, t1], length, tau, 0).map(|reached| reached.t).map_err(|depth| depth.x)
            }
            Local::Grid(grid) => {
                grid.distance::<1>(segment, [t0, t1], length, tau, 0).map(|reached| reached.t).map_err(|[depth]| depth)
            }
        }
    }

    /// As [`Self::optical_depth`], for red, green and blue.
    #[inline(never)]
    pub(super) fn optical_depths(&self, segment: &Segment, [t0, t1]: [f64; 2], length: f64) -> DVec3 {
        match &self.extinction {
            Local::Constant(sigma_t) => *sigma_t * ((t1 - t0) * length),
            Local::Grid(grid) if grid.channels() == 1 => {
                DVec3::splat(grid.optical_depth::<1>(segment, [t0, t1], length)[0])
            }
            Local::Grid(grid) => grid.optical_depth::<3>(segment, [t0, t1], length).into(),
        }
    }

    /// As [`Self::distance`], where one channel has the depth `tau`, with what all channels have there.
    #[inline(never)]
    pub(super) fn distance_of(
        &self,
        segment: &Segment,
        [t0, t1]: [f64; 2],
        length: f64,
        tau: f64,
        channel: usize,
    ) -> Result<Reached<3>, DVec3> {
        match &self.extinction {
            Local::Constant(sigma_t) => constant(*sigma_t, [t0, t1], length, tau, channel),
            Local::Grid(grid) if grid.channels() == 1 => {
                let reached = grid.distance::<1>(segment, [t0, t1], length, tau, 0);
                let all = |[one]: [f64; 1]| [one; 3];
                reached
                    .map(|r| Reached { t: r.t, depth: all(r.depth), sigma_t: all(r.sigma_t) })
                    .map_err(|[depth]| DVec3::splat(depth))
            }
            Local::Grid(grid) => grid.distance::<3>(segment, [t0, t1], length, tau, channel).map_err(DVec3::from),
        }
    }

    /// The part of a segment between two of its parameters, cut into parts in which the extinction changes little; see [`Grid::knots`].
    pub(crate) fn knots(&self, segment: &Segment, [t0, t1]: [f64; 2], length: f64) -> SmallVec<[Knot; 2]> {
        match &self.extinction {
            Local::Constant(sigma_t) => {
                let depth = sigma_t.x * ((t1 - t0) * length);
                SmallVec::from_buf([Knot { t: t0, depth: 0.0 }, Knot { t: t1, depth }])
            }
            Local::Grid(grid) => grid.knots(segment, [t0, t1], length),
        }
    }

    /// The extinction coefficient at a parameter of a segment.
    pub(crate) fn sigma_t(&self, segment: &Segment, t: f64) -> f64 {
        match &self.extinction {
            Local::Constant(sigma_t) => sigma_t.x,
            Local::Grid(grid) => grid.sigma_t(segment, t),
        }
    }
}

/// Where between two parameters the depth of a channel of an extinction that is the same everywhere is `tau`; or else the depth of all.
pub(super) fn constant(
    sigma_t: DVec3,
    [t0, t1]: [f64; 2],
    length: f64,
    tau: f64,
    channel: usize,
) -> Result<Reached<3>, DVec3> {
    let depth = sigma_t * ((t1 - t0) * length);
    if tau < depth[channel] {
        let way = tau / (sigma_t[channel] * length);
        let (t, depth) = ((t0 + way).min(t1), sigma_t * (way * length));
        return Ok(Reached { t, depth: depth.to_array(), sigma_t: sigma_t.to_array() });
    }
    Err(depth)
}
