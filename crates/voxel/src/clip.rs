//! The voxels of a segment's two ends, where an end may be outside the grid.

use glam::DVec3;

use crate::{Voxel, VoxelGrid, grid::GridPoint};

/// The part of a segment that is inside a grid, as the voxels of its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Span {
    /// All of the segment that is inside the grid lies in the cuboid spanned by these two voxels, dilated by the
    /// budget of [`VoxelGrid::dilation`].
    Inside(Voxel, Voxel),
    /// The segment does not touch the grid.
    Outside,
}

impl VoxelGrid {
    /// The voxels of the ends of the segment from `a` to `b`; an end outside the grid moves along the segment to where
    /// that enters the grid. Reversing the segment swaps the voxels and changes nothing else.
    ///
    /// A coordinate that is not finite gives the two opposite corners of the grid: the span about which least can be
    /// proved.
    ///
    /// # Guarantee
    /// Clipping is rounded outwards: ends are clipped to the grid enlarged by 128uG voxels and then move apart by as
    /// much, with G the largest of 1, the resolution and the grid coordinates of the ends. So `Outside` is certain, and
    /// the spanned cuboid holds the true part of the segment without the help of the dilation, however far away an end
    /// is. `docs/numerics.md` has the derivation.
    #[must_use]
    #[inline]
    pub fn voxel_span(&self, a: DVec3, b: DVec3) -> Span {
        match (self.voxel_containing(a), self.voxel_containing(b)) {
            (Some(a), Some(b)) => Span::Inside(a, b),
            _ => self.clipped_span(a, b),
        }
    }

    /// The voxel where the segment from `outside` to `inside`, a point of the grid, enters the grid, found by rounding outwards as in
    /// [`VoxelGrid::voxel_span`]: along each axis the part of the segment in the grid lies between this voxel and that of `inside`. `None` if a
    /// coordinate is not finite or too large for that. Cost: three divisions.
    #[must_use]
    #[inline]
    pub fn entry_voxel(&self, outside: DVec3, inside: DVec3) -> Option<Voxel> {
        let (GridPoint(from), GridPoint(to)) = (self.grid_coordinates(outside), self.grid_coordinates(inside));
        if !(can_be_clipped(from) && can_be_clipped(to)) {
            return None;
        }
        let [x, y, z] = self.resolution().sides().map(f64::from);
        let box_max = DVec3::new(x, y, z);
        let margin = 64.0 * f64::EPSILON * from.abs().max(to.abs()).max(box_max).max_element();
        let d = to - from;
        // Along an axis without extent the end inside is within the widened grid, so that both quotients are infinite, of either sign.
        let (t0, t1) = ((-margin - from) / d, (box_max + margin - from) / d);
        let enter = t0.min(t1).max_element().max(0.0);
        let outwards = DVec3::select(d.cmpge(DVec3::ZERO), DVec3::splat(margin), DVec3::splat(-margin));
        Some(self.truncated(GridPoint(from + d * enter - outwards)))
    }

    #[inline(never)]
    fn clipped_span(&self, a: DVec3, b: DVec3) -> Span {
        // One direction only, so that both directions round alike.
        if b.to_array() < a.to_array() {
            return match self.span_of(self.grid_coordinates(b), self.grid_coordinates(a)) {
                Span::Inside(b, a) => Span::Inside(a, b),
                Span::Outside => Span::Outside,
            };
        }
        self.span_of(self.grid_coordinates(a), self.grid_coordinates(b))
    }

    fn span_of(&self, GridPoint(ga): GridPoint, GridPoint(gb): GridPoint) -> Span {
        let resolution = self.resolution();
        let box_max = DVec3::new(resolution.x().into(), resolution.y().into(), resolution.z().into());
        if !(can_be_clipped(ga) && can_be_clipped(gb)) {
            return Span::Inside(Voxel::new(0, 0, 0), resolution.last());
        }
        let reach = ga.abs().max(gb.abs()).max(box_max).max_element();
        let margin = 64.0 * f64::EPSILON * reach;
        let d = gb - ga;

        let (mut enter, mut leave) = (0.0f64, 1.0f64);
        for axis in 0..3 {
            let (low, high) = (-margin - ga[axis], box_max[axis] + margin - ga[axis]);
            if d[axis] == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return Span::Outside;
                }
                continue;
            }
            let (t0, t1) = (low / d[axis], high / d[axis]);
            enter = enter.max(t0.min(t1));
            leave = leave.min(t0.max(t1));
        }
        if enter > leave {
            return Span::Outside;
        }

        let (pa, pb) = (ga + d * enter, ga + d * leave);
        let (mut from, mut to) = (pa, pb);
        for axis in 0..3 {
            let outwards = if pa[axis] <= pb[axis] { margin } else { -margin };
            from[axis] -= outwards;
            to[axis] += outwards;
        }
        // Truncation clamps to the grid: conversion of negative numbers gives 0.
        Span::Inside(self.truncated(GridPoint(from)), self.truncated(GridPoint(to)))
    }
}

/// Whether clipping a segment with this end is exact enough: beyond, and for what is not a number, it would overflow.
#[inline]
fn can_be_clipped(end: DVec3) -> bool {
    end.is_finite() && end.abs().max_element() < 1e200
}

#[cfg(test)]
mod tests;
