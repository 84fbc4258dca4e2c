//! Through which face a segment leaves the voxel that it starts in.
//!
//! *Definition.* With a and b the grid coordinates of the ends and A the voxel of a, the segment leaves A through its face towards b on an
//! axis if the point of the segment on that face's plane is in A, edges and corners included.
//!
//! *Guarantee.* Let the answer be true for an axis, say x, and b be greater there; let G be as in `docs/numerics.md`. Then every point of
//! the true segment lies within 20uG of A, or within 20uG of a voxel of the cuboid of A and B whose x is greater than A's. *Proof.* The
//! computed ends are within 4uG of the true ones, so at equal parameters are the points of both segments, on each axis. The computed
//! parameter t of the face has three roundings, so at t the computed segment is off the plane by 3u of less than 1 + 16uX voxels; its other
//! two coordinates are evaluated with errors below 5uG and found in A. So the true point at t lies within 10uG of A, and so does, by
//! convexity and with the 20uG of the start, all that comes before it. What comes after has an x that is greater than the face's less
//! 5uG, and lies, like all of the segment, within 20uG of the cuboid of A and B. The dilation pays 20uG for ends in any case.
//!
//! *Limits.* Both ends must be points of the grid. False says nothing.

use glam::DVec3;

use crate::{VoxelGrid, grid::GridPoint};

impl VoxelGrid {
    /// For x, y and z whether the segment from `from` to `to`, both in the grid, leaves the voxel of `from` through the face towards `to`
    /// on that axis; up to rounding errors that [`VoxelGrid::dilation`] covers. Through an edge it leaves by more than one. An axis along
    /// which the segment does not move, or whose face it does not reach, is false.
    #[must_use]
    #[inline]
    pub fn leaves_through(&self, from: DVec3, to: DVec3) -> [bool; 3] {
        let (at, GridPoint(b)) = (self.grid_coordinates(from), self.grid_coordinates(to));
        let GridPoint(a) = at;
        let voxel = self.truncated(at);
        let low = DVec3::new(voxel.i.into(), voxel.j.into(), voxel.k.into());
        let high = low + DVec3::ONE;
        let d = b - a;
        // One that does not move on an axis gives NaN or infinity there, and no comparison holds.
        let t = (DVec3::select(d.cmpgt(DVec3::ZERO), high, low) - a) / d;
        let inside = |axis: usize, t: f64| {
            let at = a[axis] + t * d[axis];
            (low[axis] <= at) & (at <= high[axis])
        };
        let leaves = |t: f64, u: usize, v: usize| (0.0..=1.0).contains(&t) && inside(u, t) && inside(v, t);
        [leaves(t.x, 1, 2), leaves(t.y, 2, 0), leaves(t.z, 0, 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ends are eighths of voxels, so that all is decided exactly in integers: 8·(b − a) times the point on the face's plane.
    #[test]
    fn faces_are_those_of_integers() {
        const SIDE: i64 = 5;
        let grid = VoxelGrid::covering(DVec3::ZERO, DVec3::splat(SIDE as f64), 1.0, 1 << 20).unwrap();
        let mut rng = fastrand::Rng::with_seed(8);
        let (mut left, mut edges, mut open) = (0, 0, 0);
        for _ in 0..200_000 {
            let coarse = rng.bool();
            let mut end = || {
                [0; 3].map(
                    |_: i64| if coarse { 8 * rng.i64(0..=SIDE) + 4 * rng.i64(0..2) } else { rng.i64(0..=8 * SIDE) },
                )
            };
            let (a, b) = (end().map(|c| c.min(8 * SIDE)), end().map(|c| c.min(8 * SIDE)));
            let point = |p: [i64; 3]| DVec3::from_array(p.map(|c| c as f64 / 8.0));
            let found = grid.leaves_through(point(a), point(b));
            let voxel = a.map(|c| (c / 8).min(SIDE - 1));
            let mut exact = [false; 3];
            let mut clearly = [false; 3];
            for axis in 0..3 {
                let d = b[axis] - a[axis];
                let face = 8 * if d > 0 { voxel[axis] + 1 } else { voxel[axis] };
                // The parameter of the plane is n / |d|.
                let n = (face - a[axis]) * d.signum();
                if d == 0 || n < 0 || n > d.abs() {
                    continue;
                }
                let at = |o: usize| d.abs() * a[o] + n * (b[o] - a[o]);
                let within = |o: usize, slack: i64| {
                    (d.abs() * 8 * voxel[o] + slack..=d.abs() * 8 * (voxel[o] + 1) - slack).contains(&at(o))
                };
                exact[axis] = (0..3).filter(|&o| o != axis).all(|o| within(o, 0));
                clearly[axis] = (0..3).filter(|&o| o != axis).all(|o| within(o, 1));
            }
            for axis in 0..3 {
                assert!(found[axis] || !clearly[axis], "{a:?} {b:?} leaves by axis {axis}");
                assert!(exact[axis] || !found[axis], "{a:?} {b:?} does not leave by axis {axis}");
            }
            left += usize::from(found.contains(&true));
            edges += usize::from(found.iter().filter(|&&f| f).count() > 1);
            open += usize::from(exact != clearly);
        }
        assert!(left > 100_000 && edges > 1000 && open > 1000, "{left} {edges} {open}");
    }
}
