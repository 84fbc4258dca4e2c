//! The tree in the middle, two small ones, and what grows in pots, on balustrades and round columns.

use std::io;

use glam::DVec3;

use super::{Detail, FIXED, UPPER, sides};
use crate::generate::{
    count,
    mesh::MeshSink,
    random::{Random, circle},
    shapes::{Placement, tube},
};

const BRANCH_STREAM: u64 = 0x03;
const CLUMP_STREAM: u64 = 0x04;
const LEAF_STREAM: u64 = 0x05;

/// All leaves together have this area, however many there are.
const LEAF_AREA: f64 = 1800.0;

/// One piece of a trunk or a branch.
struct Limb {
    ends: [DVec3; 2],
    radii: [f64; 2],
    /// 0 for a trunk.
    level: usize,
}

/// An ellipsoid with leaves in it.
struct Clump {
    centre: DVec3,
    radii: DVec3,
}

/// How a kind of tree branches.
struct Habit {
    foot: DVec3,
    /// Lengths of the trunk, of its boughs, of their branches, and so on.
    lengths: &'static [f64],
    /// How many each of these carries.
    children: &'static [u32],
    trunk_radius: f64,
    clump_radius: f64,
}

const TREES: [Habit; 3] = [
    Habit {
        foot: DVec3::new(0.0, 0.3, 0.0),
        lengths: &[3.6, 5.2, 3.4, 2.1],
        children: &[10, 4, 4],
        trunk_radius: 0.65,
        clump_radius: 1.3,
    },
    Habit {
        foot: DVec3::new(23.0, 0.0, -1.0),
        lengths: &[2.2, 1.3, 0.9],
        children: &[6, 4],
        trunk_radius: 0.16,
        clump_radius: 0.6,
    },
    Habit {
        foot: DVec3::new(12.5, 0.0, 2.5),
        lengths: &[2.0, 1.2, 0.8],
        children: &[6, 4],
        trunk_radius: 0.15,
        clump_radius: 0.55,
    },
];

impl Habit {
    fn grow(&self, limbs: &mut Vec<Limb>, clumps: &mut Vec<Clump>) {
        let mut random = Random::new(BRANCH_STREAM, limbs.len() as u64);
        self.grow_limb(0, self.foot, DVec3::Y, &mut random, limbs, clumps);
    }

    fn grow_limb(
        &self,
        level: usize,
        from: DVec3,
        direction: DVec3,
        random: &mut Random,
        limbs: &mut Vec<Limb>,
        clumps: &mut Vec<Clump>,
    ) {
        let thickness = |level: usize| self.trunk_radius * [1.0, 0.4, 0.16, 0.07, 0.02][level];
        let length = self.lengths[level] * random.between(0.85, 1.15);
        let bend = from + (direction + random.direction() * 0.12) * (length / 2.0);
        let to = from + direction * length;
        let radii = [thickness(level), thickness(level) * 0.75, thickness(level) * 0.55];
        limbs.push(Limb { ends: [from, bend], radii: [radii[0], radii[1]], level });
        limbs.push(Limb { ends: [bend, to], radii: [radii[1], radii[2]], level });
        if level > 0 && level + 2 >= self.lengths.len() {
            clumps.push(Clump { centre: to, radii: DVec3::new(1.0, 0.7, 1.0) * self.clump_radius });
        }
        let Some(&children) = self.children.get(level) else { return };
        let start = random.unit();
        for i in 0..children {
            // The first goes on upwards, the others go round.
            let aside = if level == 0 && i == 0 {
                random.in_ball() * 0.2
            } else {
                let [c, s] = circle(start + f64::from(i) / f64::from(children));
                // There is more room along the court than across it.
                DVec3::new(1.1 * c, 0.0, 0.8 * s) + random.in_ball() * 0.3
            };
            let upwards = DVec3::Y * if level == 0 { random.between(0.35, 1.3) } else { 0.2 };
            let forward = if level == 0 { DVec3::ZERO } else { direction * 0.75 };
            let branch = (forward + upwards + aside).normalize();
            let place = from.lerp(to, if level == 0 { random.between(0.8, 1.0) } else { random.between(0.5, 1.0) });
            self.grow_limb(level + 1, place, branch, random, limbs, clumps);
        }
    }
}

/// Trunks and branches.
pub(super) fn branches(sink: &mut dyn MeshSink, detail: Detail) -> io::Result<()> {
    let mut limbs = Vec::new();
    for habit in &TREES {
        habit.grow(&mut limbs, &mut Vec::new());
    }
    for limb in &limbs {
        let segments = if limb.level == 0 { 12 } else { 4 };
        tube(sink, limb.ends, limb.radii, detail.parts(segments))?;
    }
    Ok(())
}

/// Where flower pots stand: inside every other column.
pub(super) fn pots() -> impl Iterator<Item = Placement> {
    sides().into_iter().flat_map(|side| {
        let columns = (1..side.bays).filter(|i| i % 2 == 1);
        columns.map(move |i| side.at.moved(side.column(i), 0.0, side.distance - 0.9))
    })
}

/// Everything that bears leaves.
fn clumps() -> Vec<Clump> {
    let mut clumps = Vec::new();
    let mut limbs = Vec::new();
    for habit in &TREES {
        habit.grow(&mut limbs, &mut clumps);
    }
    for (i, pot) in (0..).zip(pots()) {
        let mut random = Random::new(CLUMP_STREAM, i);
        let height = random.between(0.9, 1.4);
        clumps.push(Clump { centre: pot.point(0.0, height, 0.0), radii: DVec3::new(0.6, height - 0.6, 0.6) });
    }
    for (k, side) in (1..).zip(sides()) {
        for i in 0..side.bays {
            let mut random = Random::new(CLUMP_STREAM, 1000 * k + u64::from(i));
            // Flowers hang from most balustrades, and ivy climbs some columns.
            if random.unit() < 0.6 {
                let u = side.column(i) + random.between(0.8, 3.0);
                let centre = side.at.point(u, UPPER + 0.85, side.distance - 0.25);
                clumps.push(Clump { centre, radii: DVec3::new(0.5, 0.6, 0.5) });
            }
            if random.unit() < 0.3 {
                for step in 0..4 {
                    let y = 0.9 + 1.2 * f64::from(step);
                    let centre = side.at.point(side.column(i), y, side.distance - 0.1);
                    clumps.push(Clump { centre, radii: DVec3::new(0.5, 0.7, 0.5) });
                }
            }
        }
    }
    clumps
}

/// As many leaves of two triangles as the budget has room for.
pub(super) fn leaves(triangles: u32, sink: &mut dyn MeshSink) -> io::Result<()> {
    let leaves = triangles.saturating_sub(count(&FIXED, triangles)?) / 2;
    let length = 2.0 * (LEAF_AREA / f64::from(leaves.max(1))).sqrt();
    let clumps = clumps();
    // Foliage is a shell: its leaves go with the surface.
    let weight = |clump: &Clump| clump.radii.x * clump.radii.y;
    let total: f64 = clumps.iter().map(weight).sum();
    let (mut sum, mut made) = (0.0, 0);
    for clump in &clumps {
        sum += weight(clump);
        let until = (f64::from(leaves) * (sum / total)).round() as u32;
        for number in made..until.min(leaves) {
            leaf(sink, clump, length, number)?;
        }
        made = until;
    }
    Ok(())
}

/// A leaf, folded along its rib.
fn leaf(sink: &mut dyn MeshSink, clump: &Clump, length: f64, number: u32) -> io::Result<()> {
    let mut random = Random::new(LEAF_STREAM, u64::from(number));
    let inside = random.in_ball();
    // Drawn towards the shell, where the light is.
    let mut base = clump.centre + clump.radii * inside * random.between(0.9, 1.15);
    // None grows into the ground.
    base.y = base.y.max(length + 0.05);
    let along = (random.direction() + inside * 0.7 - DVec3::Y * 0.25).normalize();
    let across = (along.cross(DVec3::Y) + random.in_ball() * 0.3).cross(along).cross(along).normalize();
    let fold = along.cross(across) * (length * 0.08);
    let length = length * random.between(0.75, 1.25);
    let rib = [base, base + along * length];
    let middle = base + along * (0.45 * length) + fold;
    let half = across * (0.25 * length);
    let [a, b] = [sink.vertex(rib[0])?, sink.vertex(rib[1])?];
    let [c, d] = [sink.vertex(middle + half)?, sink.vertex(middle - half)?];
    sink.triangle([a, c, b])?;
    sink.triangle([a, b, d])
}
