//! Sheets: several triangles that together cover a rectangle of directions.
//!
//! *Idea.* All triangles are counter-clockwise as seen from the light. An edge that two of them use in opposite directions is inside a sheet:
//! who crosses it leaves one triangle and comes into the other. So the number of a component's triangles over a point of the rectangle
//! changes only at edges whose uses do not cancel. If none of these meets the rectangle, and one triangle covers one of its points,
//! every point is covered.
//!
//! *Guarantee.* Edges are the same if their vertices are, bit by bit (but for the sign of zero). T-junctions, cracks of an ulp, silhouettes,
//! where both triangles lie on one side of their edge, and borders of duplicated triangles do not cancel. Triangles whose plane holds the
//! light, or that are known to be covered by others, are left out; then their neighbours' edges do not cancel either.
//!
//! *Cost.* O(k log k) for k edges that meet the rectangle.

use glam::Vec3;
use smallvec::SmallVec;

use super::{cone::Cone, frame::Rect};

/// More triangles than this are not looked at; the rectangle is divided before.
pub(super) const MOST: usize = 24;

/// An edge of a triangle that may meet the rectangle.
#[derive(Clone, Copy)]
struct Edge<'a> {
    key: u64,
    cone: &'a Cone,
    /// Which of the triangle's edges.
    number: usize,
    /// Place of the triangle.
    member: usize,
}

impl Edge<'_> {
    fn ends(&self) -> [Vec3; 2] {
        [self.cone.corners[self.number], self.cone.corners[(self.number + 1) % 3]]
    }

    /// 1 for the same edge, −1 for the same backwards, 0 for another. (Zeros of either sign are equal.)
    fn direction(&self, other: &Self) -> i32 {
        let ([from, to], [other_from, other_to]) = (self.ends(), other.ends());
        if from == other_from && to == other_to { 1 } else { -i32::from(from == other_to && to == other_from) }
    }
}

/// The depth beyond which a sheet of these triangles certainly lies in front, in every direction of the rectangle: infinite if there is
/// none. `members` yields the cones with upper bounds of their depths in the rectangle.
pub(super) fn covered_beyond<'a>(members: impl Iterator<Item = (&'a Cone, f64)> + Clone, rect: &Rect) -> f64 {
    // Nearly always a corner shows that there is none.
    let signs = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
    let corners = signs.map(|(u, v)| (rect.u + u * rect.half_u, rect.v + v * rect.half_v));
    if corners.iter().any(|&(u, v)| !members.clone().any(|(cone, _)| cone.may_hold(u, v))) {
        return f64::INFINITY;
    }
    let mut edges: SmallVec<[Edge; 96]> = SmallVec::new();
    // Of each component, at its root: is it open, does it cover a point, how far is it.
    let mut parent: SmallVec<[usize; MOST]> = SmallVec::new();
    let mut open: SmallVec<[bool; MOST]> = SmallVec::new();
    let mut covers: SmallVec<[bool; MOST]> = SmallVec::new();
    let mut far: SmallVec<[f64; MOST]> = SmallVec::new();
    for (member, (cone, farthest)) in members.enumerate() {
        let before = edges.len();
        let met = (0..3).filter(|&number| cone.edge_meets(number, rect));
        edges.extend(met.map(|number| Edge { key: cone.keys[number], cone, number, member }));
        parent.push(member);
        open.push(false);
        // One that has no edge here covers the rectangle or misses it.
        covers.push(if edges.len() == before { cone.covers(rect) } else { covers_a_point(cone, rect) });
        far.push(farthest);
    }
    edges.sort_unstable_by_key(|e| e.key);
    for same in edges.chunk_by(|a, b| a.key == b.key) {
        let first = &same[0];
        let directions = same.iter().map(|e| first.direction(e));
        let closed = directions.clone().all(|d| d != 0) && directions.sum::<i32>() == 0;
        for edge in same {
            let (a, b) = (root(&parent, first.member), root(&parent, edge.member));
            parent[a] = b;
            open[b] |= open[a] | !closed;
        }
    }
    for member in 0..parent.len() {
        let root = root(&parent, member);
        covers[root] |= covers[member];
        far[root] = far[root].max(far[member]);
    }
    (0..parent.len())
        .filter(|&member| parent[member] == member && covers[member] && !open[member])
        .map(|member| far[member])
        .fold(f64::INFINITY, f64::min)
}

fn root(parent: &[usize], mut member: usize) -> usize {
    while parent[member] != member {
        member = parent[member];
    }
    member
}

/// True only if the triangle covers one of five points of the rectangle. Where no edge of a component is open, one point is as good as
/// another.
fn covers_a_point(cone: &Cone, rect: &Rect) -> bool {
    let (u, v) = (0.5 * rect.half_u, 0.5 * rect.half_v);
    [(0.0, 0.0), (u, v), (-u, v), (u, -v), (-u, -v)].iter().any(|(du, dv)| cone.holds(rect.u + du, rect.v + dv))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use vdf_geometry::Triangle;

    use super::{super::frame::Face, *};

    const RECT: Rect = Rect { u: 0.01, v: 0.02, half_u: 0.1, half_v: 0.1 };

    /// The depth beyond which these triangles, given by corners (x, y, z), cover the rectangle for a light in the origin.
    fn beyond(triangles: &[[[f32; 3]; 3]]) -> f64 {
        let face = Face::of(DVec3::Z);
        let cones: Vec<_> = triangles
            .iter()
            .filter_map(|t| Cone::new(&Triangle { vertices: t.map(Vec3::from_array) }, DVec3::ZERO))
            .map(|cone| cone.on(face).with_keys())
            .collect();
        let members = cones.iter().filter_map(|c| c.depths(&RECT).filter(|_| c.may_meet(&RECT)).map(|d| (c, d[1])));
        covered_beyond(members, &RECT)
    }

    const A: [f32; 3] = [-0.5, -0.5, 1.0];
    const B: [f32; 3] = [0.5, -0.5, 1.0];
    const C: [f32; 3] = [0.5, 0.5, 1.0];
    const D: [f32; 3] = [-0.5, 0.5, 1.0];
    const MIDDLE: [f32; 3] = [0.0, 0.0, 1.25];

    #[test]
    fn a_fan_is_a_sheet_whatever_its_winding() {
        let fan = [[A, B, MIDDLE], [C, B, MIDDLE], [MIDDLE, C, D], [A, MIDDLE, D]];
        let depth = beyond(&fan);
        assert!((1.2..1.26).contains(&depth), "{depth}");
        assert_eq!(beyond(&[fan[0], fan[1], fan[3]]), f64::INFINITY, "one is missing");
        let mut doubled = fan.to_vec();
        doubled.extend(fan);
        assert!((1.2..1.26).contains(&beyond(&doubled)), "two-sided stacks cancel twice");
        assert_eq!(beyond(&[fan[0], fan[1], fan[2], fan[3], fan[0]]), f64::INFINITY, "one twice: its border is open");
        let negative_zero = [0.0, -0.0, 1.25];
        assert!(beyond(&[fan[0], [C, B, negative_zero], fan[2], fan[3]]) < 1.26);
    }

    #[test]
    fn cracks_and_t_junctions_are_open() {
        let beside = [0.0, f32::from_bits(1), 1.25];
        let fan = [[A, B, MIDDLE], [B, C, MIDDLE], [C, D, MIDDLE], [D, A, beside]];
        assert_eq!(beyond(&fan), f64::INFINITY);
        // The edge from A to C has a vertex in its middle on one side only.
        let (half, whole) = ([0.0, 0.0, 1.0], [A, C, D]);
        assert_eq!(beyond(&[whole, [A, B, half], [B, C, half]]), f64::INFINITY);
        assert!(beyond(&[whole, [A, B, C]]) < 1.01);
    }

    #[test]
    fn silhouettes_are_open_and_the_nearer_of_two_sheets_counts() {
        // A roof: both triangles of its ridge lie on the same side of it.
        let (left, right) = ([-0.05, -1.0, 2.0], [-0.05, 1.0, 2.0]);
        let roof = [[left, right, [4.0, 0.0, 8.0]], [left, right, [4.0, 0.1, 3.0]]];
        assert_eq!(beyond(&roof), f64::INFINITY);
        let far = [[A, B, C], [A, C, D]].map(|t| t.map(|v| v.map(|x| 4.0 * x)));
        let near = [[A, B, C], [A, C, D]];
        assert!((4.0..4.01).contains(&beyond(&far)));
        assert!((1.0..1.01).contains(&beyond(&[far[0], near[0], near[1], far[1]])));
    }
}
