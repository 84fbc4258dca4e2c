//! Conifers on the lower slopes.

use std::io;

use glam::DVec3;

use super::terrain;
use crate::generate::{
    mesh::MeshSink,
    random::{Random, circle, noise},
    shapes::tube,
};

const PLACE_STREAM: u64 = 0x21;
const FOREST_STREAM: u64 = 0x22;
const NEEDLE_STREAM: u64 = 0x23;

const TREES: usize = 1100;
/// More places than this are not tried.
const CANDIDATES: u64 = 60_000;
const TRUNK_SEGMENTS: u32 = 4;

struct Conifer {
    foot: DVec3,
    height: f64,
    radius: f64,
    number: u64,
}

/// The trees of the scene: on grass that is not too steep, in groups.
fn conifers() -> Vec<Conifer> {
    let mut trees = Vec::with_capacity(TREES);
    for number in 0..CANDIDATES {
        let mut random = Random::new(PLACE_STREAM, number);
        let reach = terrain::HALF - 1.0;
        let (x, z) = (random.between(-reach, reach), random.between(-reach, reach));
        let y = terrain::height(x, z);
        let slope = [(0.2, 0.0), (0.0, 0.2)].map(|(dx, dz)| (terrain::height(x + dx, z + dz) - y) / 0.2);
        let steep = slope[0] * slope[0] + slope[1] * slope[1] > 0.7;
        let wood = noise(x * 0.16, z * 0.16, FOREST_STREAM) + 0.4 * noise(x * 0.5, z * 0.5, FOREST_STREAM);
        let dry = y > terrain::WATER_LEVEL + 0.15 && y + 2.0 * wood < 5.5;
        if steep || !dry || wood < random.between(-0.15, 0.25) {
            continue;
        }
        let height = random.between(0.7, 1.6);
        trees.push(Conifer {
            foot: DVec3::new(x, y - 0.05, z),
            height,
            radius: height * random.between(0.2, 0.28),
            number,
        });
        if trees.len() == TREES {
            break;
        }
    }
    trees
}

/// Trunks.
pub(super) fn bark(_: u32, sink: &mut dyn MeshSink) -> io::Result<()> {
    for tree in conifers() {
        let top = tree.foot + DVec3::Y * (tree.height * 0.9);
        tube(sink, [tree.foot - DVec3::Y * 0.1, top], [tree.height * 0.035, tree.height * 0.008], TRUNK_SEGMENTS)?;
    }
    Ok(())
}

/// Skirts of needles: a tree has more and finer ones the more triangles are left for it.
pub(super) fn needles(triangles: u32, sink: &mut dyn MeshSink) -> io::Result<()> {
    let trees = conifers();
    let others = terrain::count(triangles) + 2 * TRUNK_SEGMENTS * trees.len() as u32;
    let mut left = f64::from(triangles.saturating_sub(others));
    for (i, tree) in trees.iter().enumerate() {
        let share = left / (trees.len() - i) as f64;
        let layers = ((share / 3.0).sqrt() as u32).clamp(3, 18);
        let tips = ((share / f64::from(2 * layers)).round() as u32).max(3);
        for layer in 0..layers {
            skirt(sink, tree, [layer, layers], tips)?;
        }
        left -= f64::from(2 * layers * tips);
    }
    Ok(())
}

/// A cone with a jagged rim: two triangles for each tip.
fn skirt(sink: &mut dyn MeshSink, tree: &Conifer, [layer, layers]: [u32; 2], tips: u32) -> io::Result<()> {
    let mut random = Random::new(NEEDLE_STREAM, tree.number * 32 + u64::from(layer));
    let share = f64::from(layer) / f64::from(layers);
    let thickness = 0.85 / f64::from(layers);
    let low = tree.height * (0.15 + 0.85 * share);
    let high = (low + tree.height * thickness * 1.9).min(tree.height);
    let radius = tree.radius * (1.0 - share * 0.92);
    let turned = random.unit();
    let apex = sink.vertex(tree.foot + DVec3::Y * high)?;
    let mut rim = Vec::with_capacity(2 * tips as usize);
    for i in 0..2 * tips {
        let [c, s] = circle(turned + f64::from(i) / f64::from(2 * tips));
        // Tips hang lower than the notches between them.
        let (r, drop) = if i % 2 == 0 { (random.between(0.85, 1.15), 0.12) } else { (0.6, 0.0) };
        let y = low - drop * radius;
        rim.push(sink.vertex(tree.foot + DVec3::new(c * radius * r, y, s * radius * r))?);
    }
    for i in 0..rim.len() {
        sink.triangle([rim[i], apex, rim[(i + 1) % rim.len()]])?;
    }
    Ok(())
}
