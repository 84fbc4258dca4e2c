//! Fountain, tables and chairs, benches, doors, lanterns and pots.

use std::io;

use glam::DVec3;

use super::{DEPTH, Detail, HALF, UPPER, plants, sides};
use crate::generate::{
    mesh::MeshSink,
    random::Random,
    shapes::{Placement, cuboid, lathe, tube},
};

const TABLE_STREAM: u64 = 0x02;

/// Where the fountain stands.
const FOUNTAIN: [f64; 2] = [-14.0, 0.8];
const BASIN: [[f64; 2]; 8] =
    [[2.5, 0.0], [2.5, 0.15], [2.2, 0.25], [2.25, 0.7], [2.45, 0.75], [2.45, 0.85], [2.1, 0.85], [2.05, 0.35]];
const BOWLS: [[f64; 2]; 13] = [
    [0.5, 0.3],
    [0.3, 0.6],
    [0.25, 1.4],
    [1.2, 1.7],
    [1.25, 1.8],
    [1.1, 1.8],
    [0.2, 1.6],
    [0.16, 2.3],
    [0.6, 2.5],
    [0.65, 2.6],
    [0.5, 2.6],
    [0.1, 2.5],
    [0.0, 3.1],
];
/// The wall round the foot of the tree.
const TREE_BED: [[f64; 2]; 5] = [[1.9, 0.0], [1.9, 0.55], [1.6, 0.55], [1.6, 0.4], [0.0, 0.45]];

pub(super) fn fountain(sink: &mut dyn MeshSink, detail: Detail) -> io::Result<()> {
    let [x, z] = FOUNTAIN;
    let at = Placement::at(x, 0.0, z);
    lathe(sink, &at, &BASIN, detail.parts(12))?;
    lathe(sink, &at, &[[2.1, 0.6], [0.0, 0.61]], detail.parts(12))?;
    lathe(sink, &at, &BOWLS, detail.parts(10))?;
    lathe(sink, &Placement::at(0.0, 0.0, 0.0), &TREE_BED, detail.parts(12))
}

const POT: [[f64; 2]; 6] = [[0.0, 0.0], [0.24, 0.0], [0.38, 0.5], [0.42, 0.6], [0.36, 0.6], [0.0, 0.55]];

pub(super) fn pots(sink: &mut dyn MeshSink, detail: Detail) -> io::Result<()> {
    for pot in plants::pots() {
        lathe(sink, &pot, &POT, detail.parts(6))?;
    }
    Ok(())
}

/// All that is made of wood.
pub(super) fn wood(triangles: u32, sink: &mut dyn MeshSink) -> io::Result<()> {
    let detail = Detail::new(triangles);
    for side in sides() {
        for i in 0..side.bays {
            let middle = (side.column(i) + side.column(i + 1)) / 2.0;
            for floor in [0.0, UPPER] {
                door(sink, &side.at.moved(middle, floor, side.distance + DEPTH))?;
                lantern(sink, &side.at.moved(middle, floor, side.distance + DEPTH / 2.0), detail)?;
            }
            if i % 2 == 0 {
                bench(sink, &side.at.moved(side.column(i) + 0.6, 0.0, side.distance + DEPTH - 0.4))?;
            }
        }
    }
    for (number, [x, z]) in (0..).zip(table_places()) {
        table_with_chairs(sink, [x, z], number, detail)?;
    }
    for x in CORDS {
        cord(sink, x, detail)?;
    }
    plants::branches(sink, detail)
}

/// A double door in a wall at z = 0, with panels.
fn door(sink: &mut dyn MeshSink, at: &Placement) -> io::Result<()> {
    cuboid(sink, at, [-0.95, 0.0, -0.08], [0.95, 2.75, 0.0])?;
    for leaf in [-0.42, 0.42] {
        for [low, high] in [[0.15, 1.15], [1.3, 2.5]] {
            cuboid(sink, at, [leaf - 0.33, low, -0.12], [leaf + 0.33, high, -0.08])?;
        }
    }
    Ok(())
}

const LANTERN: [[f64; 2]; 6] = [[0.0, 3.55], [0.1, 3.6], [0.2, 3.95], [0.24, 3.97], [0.05, 4.15], [0.02, 4.9]];

fn lantern(sink: &mut dyn MeshSink, at: &Placement, detail: Detail) -> io::Result<()> {
    lathe(sink, at, &LANTERN, detail.parts(4))
}

/// Where cords are hung across the court, from balustrade to balustrade.
const CORDS: [f64; 5] = [-26.0, -18.0, 12.0, 18.0, 25.0];
const PAPER_LANTERN: [[f64; 2]; 6] = [[0.0, -0.5], [0.12, -0.48], [0.2, -0.3], [0.12, -0.12], [0.03, -0.1], [0.0, 0.0]];

/// A sagging cord with lanterns.
fn cord(sink: &mut dyn MeshSink, x: f64, detail: Detail) -> io::Result<()> {
    let pieces = 18;
    let place = |i: u32| {
        let t = 2.0 * f64::from(i) / f64::from(pieces) - 1.0;
        DVec3::new(x + 1.5 * t, UPPER + 0.9 - 1.5 * (1.0 - t * t), (HALF[1] - 0.12) * t)
    };
    for i in 0..pieces {
        tube(sink, [place(i), place(i + 1)], [0.015, 0.015], 3)?;
        if i % 2 == 1 {
            let [x, y, z] = place(i).to_array();
            lathe(sink, &Placement::at(x, y, z), &PAPER_LANTERN, detail.parts(5))?;
        }
    }
    Ok(())
}

fn bench(sink: &mut dyn MeshSink, at: &Placement) -> io::Result<()> {
    cuboid(sink, at, [-0.8, 0.42, -0.22], [0.8, 0.47, 0.22])?;
    cuboid(sink, at, [-0.8, 0.6, 0.18], [0.8, 0.95, 0.22])?;
    for x in [-0.7, 0.65] {
        cuboid(sink, at, [x, 0.0, -0.18], [x + 0.05, 0.42, 0.18])?;
    }
    Ok(())
}

/// Two rows of tables along the court, with room for the tree and the fountain.
fn table_places() -> impl Iterator<Item = [f64; 2]> {
    let places = (0..13_u32).flat_map(|i| [-6.4, -3.2, 3.2, 6.4].map(|z| [-25.2 + 4.2 * f64::from(i), z]));
    places.filter(|&[x, z]| (x * x + z * z > 20.0) && ((x - FOUNTAIN[0]).abs() > 4.0 || z.abs() > 5.0))
}

const TABLE: [[f64; 2]; 7] =
    [[0.3, 0.03], [0.28, 0.07], [0.05, 0.12], [0.05, 0.68], [0.56, 0.7], [0.56, 0.74], [0.0, 0.745]];

fn table_with_chairs(sink: &mut dyn MeshSink, [x, z]: [f64; 2], number: u64, detail: Detail) -> io::Result<()> {
    let mut random = Random::new(TABLE_STREAM, number);
    let centre = DVec3::new(x + random.between(-0.6, 0.6), 0.05, z + random.between(-0.4, 0.4));
    let turns = random.unit();
    let table = Placement::new(centre, turns);
    lathe(sink, &table, &TABLE, detail.parts(7))?;
    for k in 0..4 {
        let turned = turns + 0.25 * f64::from(k) + random.between(-0.04, 0.04);
        let at = Placement::new(centre, turned).moved(0.0, 0.0, random.between(0.55, 0.95));
        chair(sink, &at)?;
    }
    Ok(())
}

/// A chair that looks towards −z.
fn chair(sink: &mut dyn MeshSink, at: &Placement) -> io::Result<()> {
    cuboid(sink, at, [-0.21, 0.42, -0.21], [0.21, 0.46, 0.21])?;
    for x in [-0.21, 0.17] {
        cuboid(sink, at, [x, 0.0, -0.21], [x + 0.04, 0.42, -0.17])?;
        cuboid(sink, at, [x, 0.0, 0.17], [x + 0.04, 0.95, 0.21])?;
    }
    for y in [0.6, 0.8] {
        cuboid(sink, at, [-0.17, y, 0.18], [0.17, y + 0.1, 0.2])?;
    }
    Ok(())
}
