//! Voxel sets as files to look at and to compare: a surface, and a list of linear coordinates (5.3 in \[Houska2013\]).
//!
//! Both writers stream: beyond the set they hold at most one bit and a sixty-fourth of a number for each corner of the
//! grid.

use std::io::{self, Write};

use crate::{Resolution, Voxel, VoxelGrid, VoxelSet};

/// Writes the surface of a set as Wavefront OBJ: the faces between a voxel of the set and one that is not, or the
/// outside.
///
/// Faces are squares in world units, counter-clockwise seen from outside the set. Vertices are shared by all faces at a
/// corner, so the surface is closed: each edge has as many faces in one direction as in the other. Where voxels touch
/// along an edge only, it has four.
///
/// Cost: O(voxels) and the text, about 30 bytes a vertex and 25 a face.
///
/// # Errors
/// What `out` says.
pub fn write_obj(grid: &VoxelGrid, set: &VoxelSet, out: &mut (impl Write + ?Sized)) -> io::Result<()> {
    describe(grid, set, out)?;
    let corners = Corners::of(set);
    for corner in corners.set.iter() {
        let p = grid.corner(corner);
        writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
    }
    for voxel in set.iter() {
        for (axis, beyond) in FACES {
            if neighbour(voxel, axis, beyond).is_some_and(|n| set.contains(n)) {
                continue;
            }
            let [a, b, c, d] = face(voxel, axis, beyond).map(|corner| corners.number(corner));
            writeln!(out, "f {a} {b} {c} {d}")?;
        }
    }
    Ok(())
}

/// Writes the linear coordinates i + j·X + k·X·Y (Def. 6 in \[Houska2013\]) of a set's voxels, one a line in ascending
/// order, after comments that say what the grid is.
///
/// # Errors
/// What `out` says.
pub fn write_indices(grid: &VoxelGrid, set: &VoxelSet, out: &mut (impl Write + ?Sized)) -> io::Result<()> {
    describe(grid, set, out)?;
    writeln!(out, "# linear index = a + b*X + c*X*Y")?;
    set.iter().try_for_each(|voxel| writeln!(out, "{}", grid.linear_index(voxel)))
}

/// The grid as comments that both formats know.
fn describe(grid: &VoxelGrid, set: &VoxelSet, out: &mut (impl Write + ?Sized)) -> io::Result<()> {
    let (r, o) = (grid.resolution(), grid.origin());
    debug_assert_eq!(r, set.resolution());
    writeln!(out, "# {} of {} voxels", set.count(), r.voxel_count())?;
    let [x, y, z] = r.sides();
    writeln!(out, "# resolution {x} {y} {z}")?;
    writeln!(out, "# origin {} {} {}", o.x, o.y, o.z)?;
    writeln!(out, "# voxel size {}", grid.voxel_size())
}

/// Axis and direction of the six faces.
const FACES: [(usize, bool); 6] = [(0, false), (0, true), (1, false), (1, true), (2, false), (2, true)];

/// The voxel behind a face; `None` for negative coordinates. Beyond the upper end it is one that no set contains.
fn neighbour(voxel: Voxel, axis: usize, beyond: bool) -> Option<Voxel> {
    let mut c = [voxel.i, voxel.j, voxel.k];
    c[axis] = if beyond { c[axis].checked_add(1)? } else { c[axis].checked_sub(1)? };
    Some(Voxel::new(c[0], c[1], c[2]))
}

/// The corners of a face, counter-clockwise seen from the other side of it.
fn face(voxel: Voxel, axis: usize, beyond: bool) -> [Voxel; 4] {
    let mut ring = [[0, 0], [1, 0], [1, 1], [0, 1]];
    if !beyond {
        ring.reverse();
    }
    ring.map(|[u, v]| {
        let mut c = [voxel.i, voxel.j, voxel.k];
        c[axis] += u32::from(beyond);
        c[(axis + 1) % 3] += u;
        c[(axis + 2) % 3] += v;
        Voxel::new(c[0], c[1], c[2])
    })
}

/// The corners of the grid that are on the surface of a set, numbered from 1 in the order of their linear coordinates.
struct Corners {
    /// Over the corners of the grid: one more than voxels along each axis.
    set: VoxelSet,
    /// The number of corners before each row.
    before: Vec<u64>,
}

impl Corners {
    fn of(set: &VoxelSet) -> Self {
        let [x, y, z] = set.resolution().sides();
        let set = VoxelSet::from_rows(Resolution::new(x + 1, y + 1, z + 1), |j, k, row| {
            // The four rows of voxels around this row of corners; those beyond the grid have no words.
            let around =
                [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dj, dk)| match (j.checked_sub(dj), k.checked_sub(dk)) {
                    (Some(j), Some(k)) if j < y && k < z => set.row(j, k),
                    _ => &[],
                });
            let word = |row: &[u64], w: usize| row.get(w).copied().unwrap_or(0);
            let (mut any_last, mut all_last) = (0, 0);
            for (w, corners) in row.iter_mut().enumerate() {
                let any = around.iter().fold(0, |any, row| any | word(row, w));
                let all = around.iter().fold(u64::MAX, |all, row| all & word(row, w));
                // Corner i is between the voxels i − 1 and i. It is on the surface if some of its eight voxels are in
                // the set and others are not: then two of them that share a face differ.
                let (any_before, all_before) = (any << 1 | any_last >> 63, all << 1 | all_last >> 63);
                *corners = (any | any_before) & !(all & all_before);
                (any_last, all_last) = (any, all);
            }
        });
        let count = |(j, k)| set.row(j, k).iter().map(|word| u64::from(word.count_ones())).sum::<u64>();
        let rows = (0..=z).flat_map(|k| (0..=y).map(move |j| (j, k)));
        let before = rows.scan(0, |sum, row| {
            let before = *sum;
            *sum += count(row);
            Some(before)
        });
        Self { before: before.collect(), set }
    }

    fn number(&self, corner: Voxel) -> u64 {
        let row = self.set.row(corner.j, corner.k);
        let row_number = corner.j as usize + self.set.resolution().y() as usize * corner.k as usize;
        let (word, bit) = ((corner.i / 64) as usize, corner.i % 64);
        let in_words: u64 = row.iter().take(word).map(|w| u64::from(w.count_ones())).sum();
        let in_word = row.get(word).map_or(0, |w| (w & ((1 << bit) - 1)).count_ones());
        1 + self.before.get(row_number).copied().unwrap_or(0) + in_words + u64::from(in_word)
    }
}

#[cfg(test)]
mod tests;
