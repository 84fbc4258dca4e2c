//! Where a medium boundary is, and what that says of a segment without a look at triangles: the usual case of a path inside a box of fog.

use glam::DVec3;
use vdf_geometry::{Bounds, CurvedShape, Segment, Triangle};

/// Where a boundary is, and what that says without a look at its triangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) bounds: Bounds,
    /// Whether all of it lies in the faces of its bounds, so that inside them nothing of it is met.
    pub(super) shell: bool,
    /// Whether it is just the faces of its bounds, two triangles each, all of one orientation.
    pub(super) closed_box: bool,
}

impl Extent {
    pub(super) fn of(triangles: &[Triangle]) -> Self {
        let bounds = Bounds::of_triangles(triangles);
        let Bounds { min, max } = bounds;
        // A triangle lies in a face of the bounds if its vertices share an extreme coordinate.
        let in_a_face = |t: &Triangle| {
            let [a, b, c] = t.vertices_f64();
            (0..3).any(|k| a[k] == b[k] && b[k] == c[k] && (a[k] == min[k] || a[k] == max[k]))
        };
        Self { bounds, shell: triangles.iter().all(in_a_face), closed_box: is_closed_box(triangles, bounds) }
    }

    /// Of a sphere: its box says nothing of what is inside.
    pub(super) fn of_sphere(sphere: &CurvedShape) -> Self {
        Self { bounds: *sphere.bounds(), shell: false, closed_box: false }
    }

    /// True only if the segment starts inside the box and ends outside. Then it meets the boundary, and where it does it leaves: all faces
    /// there have their normals on the same side of it, so that it is more than a touch.
    #[inline]
    pub(super) fn is_left(&self, segment: &Segment) -> bool {
        let (Segment { p, q }, Bounds { min, max }) = (*segment, self.bounds);
        self.closed_box && p.cmpgt(min).all() && p.cmplt(max).all() && (q.cmplt(min).any() || q.cmpgt(max).any())
    }

    /// True only if nothing of the boundary is met. False says nothing.
    #[inline]
    pub(super) fn is_not_met(&self, segment: &Segment) -> bool {
        let Bounds { min, max } = self.bounds;
        let (low, high) = (segment.p.min(segment.q), segment.p.max(segment.q));
        (self.shell && low.cmpgt(min).all() && high.cmplt(max).all()) || low.cmpgt(max).any() || high.cmplt(min).any()
    }
}

/// Where a segment crosses the boundary of a convex region, and whether it enters; in order, at most twice.
pub(super) type BoxCrossings = [Option<(f64, bool)>; 2];

impl Extent {
    /// The crossings of a box, without a look at its triangles; `None` if it is none, or an end has a coordinate in common with it.
    ///
    /// On which sides of the box the ends lie is exact, and a box is convex: so what the segment does is certain if just one of them is inside. Else rounding may
    /// decide whether an edge is passed, and it is passed on both sides or on none.
    #[inline]
    pub(super) fn crossings(&self, segment: &Segment) -> Option<BoxCrossings> {
        if self.is_not_met(segment) {
            return Some([None; 2]);
        }
        let (Segment { p, q }, Bounds { min, max }) = (*segment, self.bounds);
        let level = [p, q].map(|end| end.cmpeq(min) | end.cmpeq(max));
        if !self.closed_box || (level[0] | level[1]).any() {
            return None;
        }
        let [starts_in, ends_in] = [p, q].map(|end| (end.cmpgt(min) & end.cmplt(max)).all());
        // Infinite where the segment is parallel to a face.
        let (low, high) = ((min - p) / (q - p), (max - p) / (q - p));
        let (enters, leaves) =
            (low.min(high).max_element().clamp(0.0, 1.0), low.max(high).min_element().clamp(0.0, 1.0));
        Some(match (starts_in, ends_in) {
            (true, true) => [None; 2],
            (true, false) => [Some((leaves, false)), None],
            (false, true) => [Some((enters, true)), None],
            (false, false) if enters < leaves => [Some((enters, true)), Some((leaves, false))],
            (false, false) => [None; 2],
        })
    }
}

/// True if the triangles are the six faces of the box, each cut along a diagonal, with all normals outwards or all inwards.
fn is_closed_box(triangles: &[Triangle], Bounds { min, max }: Bounds) -> bool {
    let mut covered = [[0_u32; 2]; 6];
    let mut outwards = 0;
    for t in triangles {
        let vertices = t.vertices_f64();
        let corner = |v: DVec3| {
            let is_max = v.cmpeq(max).bitmask() as usize;
            (is_max | v.cmpeq(min).bitmask() as usize == 7).then_some(is_max)
        };
        let [Some(a), Some(b), Some(c)] = vertices.map(corner) else { return false };
        let (fixed_low, fixed_high) = (!(a | b | c) & 7, a & b & c);
        // Three corners of one face have just one coordinate in common.
        let (fixed, high) = (fixed_low | fixed_high, usize::from(fixed_high != 0));
        let area = t.area_normal();
        let axis = match fixed {
            1 => 0,
            2 => 1,
            4 => 2,
            _ => return false,
        };
        if area[axis] == 0.0 {
            return false;
        }
        outwards += usize::from((area[axis] > 0.0) == (high == 1));
        // The corner that a triangle leaves out; the other triangle of its face leaves out the opposite one.
        let left_out = a ^ b ^ c;
        let Some(slot) = covered[2 * axis + high].iter_mut().find(|slot| **slot == 0) else { return false };
        *slot = 1 + left_out as u32;
        let [first, second] = covered[2 * axis + high];
        if second != 0 && (first - 1) ^ (second - 1) != (7 & !fixed) as u32 {
            return false;
        }
    }
    triangles.len() == 12 && min.cmplt(max).all() && (outwards == 0 || outwards == 12)
}
