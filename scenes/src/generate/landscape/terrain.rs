//! The ground: a height field, divided by what covers it, and boulders.

use std::io;

use glam::DVec3;

use crate::generate::{
    mesh::MeshSink,
    random::{Random, circle, fade, noise},
    shapes::{Placement, band},
};

const HILL_STREAM: u64 = 0x11;
const MOUNTAIN_STREAM: u64 = 0x12;
const COVER_STREAM: u64 = 0x13;
const BOULDER_STREAM: u64 = 0x14;

/// The ground reaches from −`HALF` to `HALF` along x and z.
pub(super) const HALF: f64 = 23.4;
/// The level of the lake; the ground below it is not made.
pub(super) const WATER_LEVEL: f64 = 0.0;
/// Boulders in the scene, and their share of the triangles.
const BOULDERS: u32 = 160;
const BOULDER_SHARE: f64 = 0.05;
/// The height field's share of the triangles.
const GROUND_SHARE: f64 = 0.58;

/// Height of the solid ground, also under the lake.
pub(super) fn height(x: f64, z: f64) -> f64 {
    let hills = fractal(x * 0.09, z * 0.09, HILL_STREAM);
    // The valley winds away from the camera; beside and behind it the mountains rise.
    let axis = 3.0 * noise(0.7, z * 0.06, HILL_STREAM) + 0.12 * z;
    let beside = fade(((x - axis).abs() - 3.5) / 17.0);
    let behind = fade((2.0 - z) / 25.0);
    let rise = 1.0 - (1.0 - 0.6 * beside) * (1.0 - 0.9 * behind);
    // The hill of the camera.
    let hill = fade(1.0 - ((x - 1.0).abs() + (z - 21.0).abs()) / 9.0);
    1.5 * hills - 0.9 + rise * (1.5 + 22.0 * ridges(x * 0.055, z * 0.055)) + 5.0 * hill
}

/// Sum of octaves, mostly within ±1.
fn fractal(x: f64, z: f64, stream: u64) -> f64 {
    let (mut sum, mut amplitude, mut frequency) = (0.0, 1.0, 1.0);
    for octave in 0..6 {
        sum += amplitude * noise(x * frequency, z * frequency, stream + (octave << 8));
        amplitude *= 0.48;
        frequency *= 2.03;
    }
    sum
}

/// Like [`fractal`] but with sharp crests, within 0 and about 1; crests are rougher than valleys.
fn ridges(x: f64, z: f64) -> f64 {
    let (mut sum, mut amplitude, mut frequency, mut weight) = (0.0, 0.55, 1.0, 1.0);
    for octave in 0..7 {
        let crest = 1.0 - 1.6 * noise(x * frequency, z * frequency, MOUNTAIN_STREAM + (octave << 8)).abs();
        let crest = crest.max(0.0);
        sum += amplitude * weight * crest * crest;
        weight = (crest * 1.3).min(1.0);
        amplitude *= 0.5;
        frequency *= 2.1;
    }
    sum
}

/// What covers a piece of ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cover {
    Grass,
    Rock,
    Snow,
    Water,
}

fn cover([a, b, c]: [DVec3; 3]) -> Cover {
    if [a, b, c].iter().all(|p| p.y <= WATER_LEVEL) {
        return Cover::Water;
    }
    let centre = (a + b + c) / 3.0;
    let upright = (b - a).cross(c - a).normalize().y;
    let patch = fractal(centre.x * 0.3, centre.z * 0.3, COVER_STREAM);
    if centre.y + 1.5 * patch > 8.0 && upright > 0.42 {
        Cover::Snow
    } else if upright < 0.72 + 0.08 * patch || centre.y + 1.2 * patch > 6.5 {
        Cover::Rock
    } else {
        Cover::Grass
    }
}

pub(super) fn grass(triangles: u32, sink: &mut dyn MeshSink) -> io::Result<()> {
    ground(triangles, Cover::Grass, sink)
}

/// Bare ground and boulders.
pub(super) fn rock(triangles: u32, sink: &mut dyn MeshSink) -> io::Result<()> {
    ground(triangles, Cover::Rock, sink)?;
    for number in 0..BOULDERS {
        boulder(sink, number, boulder_segments(triangles))?;
    }
    Ok(())
}

/// Cells of the height field along x and along z.
fn cells(triangles: u32) -> u32 {
    (GROUND_SHARE * f64::from(triangles) / 2.0).sqrt() as u32
}

/// An even number s; a boulder has s·(s − 2) triangles.
fn boulder_segments(triangles: u32) -> u32 {
    let share = BOULDER_SHARE * f64::from(triangles) / f64::from(BOULDERS);
    2 * ((share.sqrt() / 2.0) as u32) + 2
}

/// How many triangles ground and boulders have in a scene of so many.
pub(super) fn count(triangles: u32) -> u32 {
    let (cells, segments) = (cells(triangles), boulder_segments(triangles));
    2 * cells * cells + BOULDERS * segments * (segments - 2)
}

pub(super) fn snow(triangles: u32, sink: &mut dyn MeshSink) -> io::Result<()> {
    ground(triangles, Cover::Snow, sink)
}

pub(super) fn water(triangles: u32, sink: &mut dyn MeshSink) -> io::Result<()> {
    ground(triangles, Cover::Water, sink)
}

/// A point of a row of the height field, and its number in the mesh once it has one.
#[derive(Clone, Copy)]
struct Node {
    p: DVec3,
    number: Option<u32>,
}

/// The part of the ground with this cover, row by row.
fn ground(triangles: u32, wanted: Cover, sink: &mut dyn MeshSink) -> io::Result<()> {
    let cells = cells(triangles);
    let coordinate = |i: u32| HALF * (2.0 * f64::from(i) / f64::from(cells) - 1.0);
    let row = |k: u32| -> Vec<Node> {
        let z = coordinate(k);
        let point = |i| DVec3::new(coordinate(i), height(coordinate(i), z).max(WATER_LEVEL), z);
        (0..=cells).map(|i| Node { p: point(i), number: None }).collect()
    };
    let mut rows = [row(0), Vec::new()];
    for k in 1..=cells {
        rows[1] = row(k);
        for i in 0..cells as usize {
            for corners in [[(0, i), (1, i), (1, i + 1)], [(0, i), (1, i + 1), (0, i + 1)]] {
                if cover(corners.map(|(r, i)| rows[r][i].p)) != wanted {
                    continue;
                }
                let mut numbers = [0; 3];
                for (number, (r, i)) in numbers.iter_mut().zip(corners) {
                    let node = &mut rows[r][i];
                    *number = match node.number {
                        Some(n) => n,
                        None => sink.vertex(node.p)?,
                    };
                    node.number = Some(*number);
                }
                sink.triangle(numbers)?;
            }
        }
        rows.swap(0, 1);
    }
    Ok(())
}

/// A dented ball, half in the ground.
fn boulder(sink: &mut dyn MeshSink, number: u32, segments: u32) -> io::Result<()> {
    let mut random = Random::new(BOULDER_STREAM, u64::from(number));
    let (mut x, mut z) = (0.0, 0.0);
    // Boulders lie on dry ground; if none is found, the last place will do.
    for _ in 0..64 {
        x = random.between(-HALF + 1.5, HALF - 1.5);
        z = random.between(-HALF + 1.5, HALF - 1.5);
        let h = height(x, z);
        if h > WATER_LEVEL - 0.1 && h < 6.0 {
            break;
        }
    }
    let size = 0.12 + 0.5 * random.unit() * random.unit();
    let flat = random.between(0.6, 0.9);
    let at = Placement::new(DVec3::new(x, height(x, z), z), random.unit());
    let dent = random.between(0.0, 100.0);
    let rings = segments / 2;
    let vertex = |ring: u32, segment: u32| {
        let [c, s] = circle(f64::from(ring) / f64::from(rings) / 2.0);
        let [cu, su] = circle(f64::from(segment) / f64::from(segments));
        let d = DVec3::new(s * cu, -c, s * su);
        let r = size
            * (1.0
                + 0.5 * noise(d.x * 1.3 + dent, d.z * 1.3 + d.y, BOULDER_STREAM)
                + 0.25 * noise(d.x * 3.1 + dent, d.z * 3.1 - d.y * 2.0, BOULDER_STREAM));
        at.point(d.x * r, d.y * r * flat, d.z * r)
    };
    let mut below = vec![sink.vertex(vertex(0, 0))?];
    for ring in 1..=rings {
        let count = if ring == rings { 1 } else { segments };
        let mut above = Vec::with_capacity(count as usize);
        for i in 0..count {
            above.push(sink.vertex(vertex(ring, i))?);
        }
        band(sink, &below, &above)?;
        below = above;
    }
    Ok(())
}
