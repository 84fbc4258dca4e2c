//! Walls, arcades, balustrades, floors and roofs.

use std::io;

use super::{CEILING, DEPTH, Detail, HALF, Side, UPPER, furniture, sides};
use crate::generate::{
    mesh::MeshSink,
    random::{Random, circle},
    shapes::{Placement, cuboid, lathe, quad},
};

const PAVING_STREAM: u64 = 0x01;
/// Half the thickness of the wall above the arches.
const HALF_WALL: f64 = 0.25;
/// Half the width of what is left of a wall between two arches.
const HALF_PIER: f64 = 0.42;

/// Radius and height above the floor of its storey.
const LOWER_COLUMN: [[f64; 2]; 7] =
    [[0.46, 0.0], [0.46, 0.25], [0.33, 0.35], [0.27, 2.55], [0.31, 2.62], [0.42, 2.95], [0.42, 3.1]];
const UPPER_COLUMN: [[f64; 2]; 7] =
    [[0.36, 0.0], [0.36, 0.2], [0.25, 0.28], [0.2, 2.25], [0.24, 2.32], [0.36, 2.55], [0.36, 2.7]];
const BALUSTER: [[f64; 2]; 6] = [[0.07, 0.1], [0.07, 0.2], [0.045, 0.28], [0.09, 0.48], [0.05, 0.8], [0.08, 0.95]];
const BALUSTERS_A_BAY: u32 = 8;

/// Walls, ceilings and what is above the arches.
pub(super) fn plaster(triangles: u32, sink: &mut dyn MeshSink) -> io::Result<()> {
    let detail = Detail::new(triangles);
    for side in sides() {
        let Side { at, distance: d, half, .. } = side;
        // The long sides reach round the corners, the short ones fit between them.
        let (floor, wall) = if side.long { (half + DEPTH, half + DEPTH + 0.2) } else { (half - 0.3, half + DEPTH) };
        cuboid(sink, &at, [-wall, -0.1, d + DEPTH], [wall, 12.3, d + DEPTH + 0.2])?;
        cuboid(sink, &at, [-floor, UPPER - 0.3, d - 0.3], [floor, UPPER, d + DEPTH])?;
        cuboid(sink, &at, [-floor, CEILING, d - 0.3], [floor, CEILING + 0.1, d + DEPTH])?;
        for i in 0..side.bays {
            let bay = [side.column(i), side.column(i + 1)];
            arch(sink, &side, bay, [3.1, 1.6, UPPER - 0.3], detail.parts(8))?;
            arch(sink, &side, bay, [UPPER + 2.7, 1.4, CEILING], detail.parts(8))?;
        }
    }
    Ok(())
}

/// The wall above an arch: its two faces and the underside. The arch starts at the height `springing`, rises by `rise`, and the wall
/// ends at `top`.
fn arch(
    sink: &mut dyn MeshSink,
    side: &Side,
    [start, end]: [f64; 2],
    [springing, rise, top]: [f64; 3],
    segments: u32,
) -> io::Result<()> {
    let (middle, radius) = ((start + end) / 2.0, (end - start) / 2.0 - HALF_PIER);
    let mut before: Option<[u32; 4]> = None;
    for i in 0..segments + 3 {
        let (u, y) = match i {
            0 => (start, springing),
            _ if i == segments + 2 => (end, springing),
            _ => {
                let [c, s] = circle(f64::from(i - 1) / f64::from(segments) / 2.0);
                (middle - radius * c, springing + rise * s)
            }
        };
        let (front, back) = (side.distance - HALF_WALL, side.distance + HALF_WALL);
        let mut section = [0; 4];
        for (corner, (y, v)) in section.iter_mut().zip([(y, front), (top, front), (top, back), (y, back)]) {
            *corner = sink.vertex(side.at.point(u, y, v))?;
        }
        if let Some(b) = before.replace(section) {
            quad(sink, [b[0], b[1], section[1], section[0]])?;
            quad(sink, [b[2], b[3], section[3], section[2]])?;
            quad(sink, [b[3], b[0], section[0], section[3]])?;
        }
    }
    Ok(())
}

/// Columns, balustrades, the fountain and the tree's bed.
pub(super) fn stone(triangles: u32, sink: &mut dyn MeshSink) -> io::Result<()> {
    let detail = Detail::new(triangles);
    for side in sides() {
        for i in 0..side.bays {
            let column = side.at.moved(side.column(i), 0.0, side.distance);
            lathe(sink, &column, &LOWER_COLUMN, detail.parts(8))?;
            lathe(sink, &column.moved(0.0, UPPER, 0.0), &UPPER_COLUMN, detail.parts(8))?;
            balustrade(sink, &side, [side.column(i) + 0.3, side.column(i + 1) - 0.3], detail)?;
        }
    }
    furniture::fountain(sink, detail)
}

fn balustrade(sink: &mut dyn MeshSink, side: &Side, [start, end]: [f64; 2], detail: Detail) -> io::Result<()> {
    let at = side.at.moved(0.0, UPPER, side.distance);
    cuboid(sink, &at, [start, 0.0, -0.1], [end, 0.1, 0.1])?;
    cuboid(sink, &at, [start, 0.95, -0.12], [end, 1.05, 0.12])?;
    for i in 0..BALUSTERS_A_BAY {
        let u = start + (end - start) * (f64::from(i) + 0.5) / f64::from(BALUSTERS_A_BAY);
        lathe(sink, &at.moved(u, 0.0, 0.0), &BALUSTER, detail.parts(5))?;
    }
    Ok(())
}

/// The ground, and uneven slabs on it inside the court.
pub(super) fn paving(triangles: u32, sink: &mut dyn MeshSink) -> io::Result<()> {
    let detail = Detail::new(triangles);
    let at = Placement::at(0.0, 0.0, 0.0);
    let (x, z) = (HALF[0] + DEPTH, HALF[1] + DEPTH);
    cuboid(sink, &at, [-x, -0.15, -z], [x, 0.0, z])?;
    let (columns, rows) = (detail.parts(40), detail.parts(12));
    let (dx, dz) = (2.0 * (HALF[0] - 0.6) / f64::from(columns), 2.0 * (HALF[1] - 0.6) / f64::from(rows));
    for j in 0..rows {
        for i in 0..columns {
            let height = Random::new(PAVING_STREAM, u64::from(j * columns + i)).between(0.02, 0.05);
            let (x, z) = (0.6 - HALF[0] + dx * f64::from(i), 0.6 - HALF[1] + dz * f64::from(j));
            slab(sink, [x + 0.02 * dx, z + 0.02 * dz], [x + 0.98 * dx, z + 0.98 * dz], height)?;
        }
    }
    Ok(())
}

/// A box on the floor, without its bottom: 10 triangles.
fn slab(sink: &mut dyn MeshSink, [x0, z0]: [f64; 2], [x1, z1]: [f64; 2], height: f64) -> io::Result<()> {
    let mut rings = [[0; 4]; 2];
    for (ring, y) in rings.iter_mut().zip([0.0, height]) {
        for (corner, (x, z)) in ring.iter_mut().zip([(x0, z0), (x0, z1), (x1, z1), (x1, z0)]) {
            *corner = sink.vertex(glam::DVec3::new(x, y, z))?;
        }
    }
    let [below, above] = rings;
    quad(sink, above)?;
    for i in 0..4 {
        let j = (i + 1) % 4;
        quad(sink, [below[i], below[j], above[j], above[i]])?;
    }
    Ok(())
}

/// Tiled roofs, and flower pots.
pub(super) fn terracotta(triangles: u32, sink: &mut dyn MeshSink) -> io::Result<()> {
    let detail = Detail::new(triangles);
    for side in sides() {
        roof(sink, &side, detail)?;
    }
    furniture::pots(sink, detail)
}

/// Height of the roof at the eave, and at the outer wall.
const ROOF: [f64; 2] = [CEILING + 0.1, CEILING + 2.0];
const TILE_RADIUS: f64 = 0.19;

/// A roof that slopes inwards, mitred at its ends, with rows of half-round tiles.
fn roof(sink: &mut dyn MeshSink, side: &Side, detail: Detail) -> io::Result<()> {
    let (eave, outer) = (side.distance - 0.7, side.distance + DEPTH + 0.2);
    let (half_eave, half_outer) = (side.half - 0.7, side.half + DEPTH + 0.2);
    let slope = (ROOF[1] - ROOF[0]) / (outer - eave);
    let height = |v: f64| ROOF[0] + (v - eave) * slope;
    let mut deck = [0; 4];
    for (corner, (u, v)) in
        deck.iter_mut().zip([(-half_eave, eave), (-half_outer, outer), (half_outer, outer), (half_eave, eave)])
    {
        *corner = sink.vertex(side.at.point(u, height(v), v))?;
    }
    quad(sink, [deck[3], deck[2], deck[1], deck[0]])?;

    let strips = (half_outer / (2.1 * TILE_RADIUS)) as u32;
    let rows = detail.parts(2) - 1;
    let sides = detail.parts(3);
    for strip in 0..2 * strips {
        let u = (f64::from(strip) + 0.5 - f64::from(strips)) * 2.1 * TILE_RADIUS;
        let start = eave + (u.abs() + TILE_RADIUS - half_eave).max(0.0);
        let step = (outer - start) / f64::from(rows);
        if step < 0.02 {
            continue;
        }
        for row in 0..rows {
            let v = start + step * f64::from(row);
            // A tile is wider below than above, to lie over the next one down the slope.
            let mut before: Option<Vec<u32>> = None;
            for (v, radius) in [(v, TILE_RADIUS), (v + step, 0.8 * TILE_RADIUS)] {
                let mut ring = Vec::with_capacity(sides as usize + 1);
                for i in 0..=sides {
                    let [c, s] = circle(f64::from(i) / f64::from(sides) / 2.0);
                    ring.push(sink.vertex(side.at.point(u - radius * c, height(v) + 0.01 + radius * s, v))?);
                }
                if let Some(lower) = before.replace(ring.clone()) {
                    for i in 0..sides as usize {
                        quad(sink, [lower[i], ring[i], ring[i + 1], lower[i + 1]])?;
                    }
                }
            }
        }
    }
    Ok(())
}
