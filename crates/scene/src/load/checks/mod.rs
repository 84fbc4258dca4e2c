//! Traps: scenes that are legal in Mitsuba but whose fog is not where the author thinks.

mod clipping;
mod closed;
mod seams;
#[cfg(test)]
mod tests;
mod tree;

use std::collections::HashMap;
use std::sync::Arc;

use vdf_geometry::{Bounds, Triangle};

use super::Loader;
use super::document::{Element, Place};
use crate::{Albedo, Extinction, FilmSettings, GridVolume, Medium, MediumId, Phase, SceneError, Sensor};

use closed::{Closed, Work};
use tree::Tree;

/// Boundaries are compared with each other until this many triangles were looked at, less than a second. It is enough for 100,000 separate boxes.
const MOST_WORK: u64 = 10_000_000;

/// The medium that the sensor and each boundary claim to be in must be the one around them; what the clip planes hide is warned about.
pub(super) fn media_are_consistent(
    loader: &Loader<'_>,
    sensor: &Sensor,
    film: &FilmSettings,
    sensor_at: &Place,
    constant_at: Option<&Place>,
) -> Result<(), SceneError> {
    let closed = closed_boundaries(loader)?;
    let camera = sensor.world_from_camera.w_axis.truncate();
    let around_camera =
        closed.iter().filter(|c| c.winding(camera).abs() > 0.5).min_by(|a, b| a.volume.total_cmp(&b.volume));
    if let Some(around) = around_camera {
        if !same(loader, around.inner, sensor.medium) {
            return Err(wrong_around_camera(around, sensor, sensor_at));
        }
    } else if let (Some(Extinction::Constant(_)), Some(constant_at)) =
        (medium(loader, sensor.medium).map(|m| &m.sigma_t), constant_at)
    {
        return Err(constant_at.error(
            "unbounded fog together with an infinite emitter: no light comes through an infinite medium",
            format!("put a closed null shape with the medium as interior around the camera (sensor at {sensor_at}), or use point or area emitters"),
        ));
    }
    let everywhere = if around_camera.is_none() { sensor.medium } else { None };
    compare(loader, &closed, everywhere, sensor_at)?;
    clipping::warn(loader, sensor, film, sensor_at);
    Ok(())
}

/// The boundaries that are closed by themselves. The others must close together: a wall between two media may be a shape of its own, with a
/// medium on each side, and the rest of each medium's surface another.
fn closed_boundaries<'a>(loader: &'a Loader<'_>) -> Result<Vec<Closed<'a>>, SceneError> {
    let mut closed = Vec::new();
    let mut open: Vec<Open<'a>> = Vec::new();
    let mut open_of_medium = HashMap::new();
    for (boundary, element) in loader.boundaries.iter().zip(&loader.boundary_elements) {
        // A surface between equal media is none.
        if same(loader, boundary.interior, boundary.exterior) {
            continue;
        }
        if boundary.curved.is_some() || seams::hole(&boundary.triangles).is_none() {
            closed.push(Closed::new(boundary, element));
            continue;
        }
        for (side, is_outer) in [(boundary.interior, false), (boundary.exterior, true)] {
            let Some(medium) = medium(loader, side) else { continue };
            let number = *open_of_medium.entry(key(medium)).or_insert(open.len());
            if number == open.len() {
                open.push(Open::default());
            }
            if let Some(open) = open.get_mut(number) {
                open.add(&boundary.triangles, is_outer, element);
            }
        }
    }
    open.iter().try_for_each(Open::check)?;
    Ok(closed)
}

/// The surfaces of one medium that are open by themselves, with the medium behind all faces.
#[derive(Default)]
struct Open<'a> {
    triangles: Vec<Triangle>,
    /// The shapes, each with the number of its first triangle.
    shapes: Vec<(usize, &'a Element)>,
}

impl<'a> Open<'a> {
    fn add(&mut self, triangles: &[Triangle], turned: bool, element: &'a Element) {
        self.shapes.push((self.triangles.len(), element));
        self.triangles.extend(triangles.iter().map(|t| {
            let [a, b, c] = t.vertices;
            Triangle { vertices: if turned { [a, c, b] } else { [a, b, c] } }
        }));
    }

    fn check(&self) -> Result<(), SceneError> {
        let Some(hole) = seams::hole(&self.triangles) else { return Ok(()) };
        let shape = self.shapes.partition_point(|(first, _)| *first <= hole.triangle);
        let Some((_, element)) = self.shapes.get(shape.saturating_sub(1)) else { return Ok(()) };
        let [a, b] = hole.edge;
        let edge = format!("the edge from ({}, {}, {}) to ({}, {}, {})", a.x, a.y, a.z, b.x, b.y, b.z);
        Err(if hole.is_border {
            let message = format!("the medium boundary is open: {edge} has a face on one side only");
            element.at.error(message, "close the surface there: fog must be inside of something")
        } else {
            let message = format!("the faces of the medium boundary are wound against each other at {edge}");
            element.at.error(message, "make all normals point outward, as by \"recalculate normals\" in a modeller")
        })
    }
}

fn wrong_around_camera(around: &Closed<'_>, sensor: &Sensor, sensor_at: &Place) -> SceneError {
    if around.inner.is_some() && sensor.medium.is_none() {
        let message =
            format!("the camera is inside the medium of the shape {}, but the sensor has no medium", around.name());
        return sensor_at.error(message, "put a <ref id=\"…\"/> to that medium into the sensor");
    }
    sensor_at.error(
        "the sensor's medium is not the one that is around the camera",
        format!("the camera is inside the shape {}: give the sensor that shape's medium", around.name()),
    )
}

fn medium<'l>(loader: &'l Loader<'_>, id: Option<MediumId>) -> Option<&'l Medium> {
    id.and_then(|MediumId(i)| loader.media.get(i as usize))
}

/// Equal by value: two copies of one fog are one fog.
fn same(loader: &Loader<'_>, a: Option<MediumId>, b: Option<MediumId>) -> bool {
    medium(loader, a) == medium(loader, b)
}

/// The bits of a medium; of a grid, those of its place in memory.
fn key(Medium { sigma_t, albedo, phase }: &Medium) -> Vec<u64> {
    let mut key = Vec::new();
    let volume = |key: &mut Vec<u64>, GridVolume { grid, filter, wrap, grid_from_world }: &GridVolume| {
        key.extend([Arc::as_ptr(grid) as u64, *filter as u64, *wrap as u64]);
        key.extend(grid_from_world.to_cols_array().map(f64::to_bits));
    };
    match sigma_t {
        Extinction::Constant(sigma_t) => key.extend(sigma_t.to_array().map(f64::to_bits)),
        Extinction::Grid { volume: of, scale } => {
            key.push(scale.to_bits());
            volume(&mut key, of);
        }
    }
    match albedo {
        Albedo::Constant(albedo) => key.extend(albedo.to_array().map(|x| u64::from(x.to_bits()))),
        Albedo::Grid(of) => volume(&mut key, of),
    }
    // No mean cosine has the bits of 2 or more.
    match phase {
        Phase::Isotropic => key.push(2.0_f64.to_bits()),
        Phase::HenyeyGreenstein { g } => key.push(g.to_bits()),
        Phase::Rayleigh => key.push(3.0_f64.to_bits()),
        Phase::TwoLobes { weight, g } => key.extend([4.0, *weight, g[0], g[1]].map(f64::to_bits)),
    }
    key
}

/// Each boundary with those around it and those that it crosses.
fn compare(
    loader: &Loader<'_>,
    closed: &[Closed<'_>],
    everywhere: Option<MediumId>,
    sensor_at: &Place,
) -> Result<(), SceneError> {
    let tree = Tree::new(closed.iter().map(|c| c.bounds));
    let mut work = Work { left: MOST_WORK };
    let mut near = Vec::new();
    for (index, boundary) in closed.iter().enumerate() {
        let around = surrounding(closed, index, &tree, &mut near, &mut work);
        let Some(around) = around else { return given_up(loader, boundary.element) };
        let surrounding = around.map_or(everywhere, |c| c.inner);
        if !same(loader, boundary.outer, surrounding) {
            outer_is_not_around(loader, boundary, around, surrounding, sensor_at)?;
        }
        near.clear();
        tree.touching(&boundary.bounds, &mut near);
        near.sort_unstable();
        // One warning is enough for a boundary that crosses many.
        for other in near.iter().filter(|&&i| i < index).filter_map(|&i| closed.get(i)) {
            work.left = work.left.saturating_sub(1);
            if same(loader, boundary.inner, other.inner) {
                continue;
            }
            match boundary.crosses(other, &mut work) {
                None => return given_up(loader, boundary.element),
                Some(false) => {}
                Some(true) => {
                    loader.warn(
                        &boundary.element.at,
                        &format!(
                            "its medium crosses that of the shape {}: where both are, the one with the smaller volume wins, and of equal ones the later in the file",
                            other.name()
                        ),
                    );
                    break;
                }
            }
        }
    }
    Ok(())
}

fn given_up(loader: &Loader<'_>, element: &Element) -> Result<(), SceneError> {
    loader.warn(&element.at, "too many medium boundaries overlap: from here on they were not compared with each other");
    Ok(())
}

/// The smallest boundary around that with the number `index`; the outer `None` if the work is used up.
fn surrounding<'c, 'a>(
    closed: &'c [Closed<'a>],
    index: usize,
    tree: &Tree,
    near: &mut Vec<usize>,
    work: &mut Work,
) -> Option<Option<&'c Closed<'a>>> {
    let boundary = closed.get(index)?;
    near.clear();
    if let Some(point) = boundary.a_point() {
        tree.touching(&Bounds::of_points([point]), near);
    }
    work.left = work.left.checked_sub(near.len() as u64)?;
    let mut larger: Vec<_> =
        near.iter().filter_map(|&i| closed.get(i)).filter(|c| c.volume > boundary.volume).collect();
    larger.sort_by(|a, b| a.volume.total_cmp(&b.volume));
    for other in larger {
        if other.encloses(boundary, work)? {
            return Some(Some(other));
        }
    }
    Some(None)
}

fn outer_is_not_around(
    loader: &Loader<'_>,
    boundary: &Closed<'_>,
    around: Option<&Closed<'_>>,
    surrounding: Option<MediumId>,
    sensor_at: &Place,
) -> Result<(), SceneError> {
    let at = &boundary.element.at;
    if boundary.is_inverted && boundary.outer.is_some() {
        loader.warn(
            at,
            "the medium boundary is wound inwards: its interior medium is all around it, and not inside; flip_normals=true turns it",
        );
    } else if boundary.outer.is_some() {
        loader.warn(at, "the exterior medium of this boundary is not the medium that is around it");
    } else if !same(loader, boundary.inner, surrounding) {
        let place = around.map_or_else(|| format!("the sensor at {sensor_at}"), |c| format!("the shape {}", c.name()));
        return Err(at.error(
            "the medium outside this boundary is missing: the fog around it would vanish behind it",
            format!("the fog around it comes from {place}: refer to it here as the outer side too, with name=\"exterior\" (or \"interior\" if the normals point inward)"),
        ));
    }
    Ok(())
}
