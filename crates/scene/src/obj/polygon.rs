//! Polygons are cut into triangles.
//!
//! A convex polygon becomes a fan from its first corner, as Mitsuba and most loaders do. Any other one loses its ears one after the other:
//! an ear is a corner whose triangle holds no other part of the outline. Decisions are exact for the polygon as it is seen along the axis
//! that is nearest to its normal, so an outline that does not cross itself is filled exactly.

use glam::{DVec2, DVec3};
use robust::{Coord, orient2d};

/// How much may still be spent. Cutting ears is quadratic in the worst case, so a whole file has a budget.
#[derive(Debug)]
pub(super) struct Work {
    /// Steps that are left.
    pub(super) left: u64,
}

impl Work {
    fn step(&mut self) -> Option<()> {
        self.left = self.left.checked_sub(1)?;
        Some(())
    }
}

/// Buffers that are used for one polygon after the other.
#[derive(Debug, Default)]
pub(super) struct Triangulator {
    points: Vec<DVec2>,
    next: Vec<usize>,
    previous: Vec<usize>,
    /// The corners that are not convex, and may lie in an ear.
    reflex: Vec<usize>,
    is_reflex: Vec<bool>,
}

impl Triangulator {
    /// Appends the n − 2 triangles of a polygon, wound as it is. `Some(true)` if the outline is simple or convex, `Some(false)` if it crosses
    /// itself or has no area, so that the triangles are only some fan; `None` if the work was used up.
    pub(super) fn triangulate(
        &mut self,
        positions: &[DVec3],
        corners: &[u32],
        triangles: &mut Vec<[u32; 3]>,
        work: &mut Work,
    ) -> Option<bool> {
        let &[first, .., last] = corners else { return Some(true) };
        let before = triangles.len();
        let fan = |triangles: &mut Vec<[u32; 3]>| {
            triangles.extend(corners.windows(2).skip(1).map(|pair| [first, pair[0], pair[1]]));
        };
        if corners.len() == 3 {
            triangles.push([first, corners[1], last]);
            return Some(true);
        }
        if !self.project(positions, corners) {
            fan(triangles);
            return Some(false);
        }
        if self.is_convex() {
            fan(triangles);
            return Some(true);
        }
        let simple = self.cut_ears(corners, triangles, work)?;
        debug_assert_eq!(triangles.len() - before, corners.len() - 2);
        Some(simple)
    }

    /// Looks at the polygon along an axis, so that it turns counterclockwise. False if it has no area.
    fn project(&mut self, positions: &[DVec3], corners: &[u32]) -> bool {
        let position = |corner: u32| positions.get(corner as usize).copied().unwrap_or_default();
        let origin = corners.first().map_or(DVec3::ZERO, |&c| position(c));
        // Newell's normal, relative to a corner: far from the origin the plain products would cancel.
        let ring = || corners.iter().zip(corners.iter().cycle().skip(1));
        let normal: DVec3 = ring().map(|(&a, &b)| (position(a) - origin).cross(position(b) - origin)).sum();
        let size = normal.abs();
        let seen: fn(DVec3) -> DVec2 = if size.x >= size.y && size.x >= size.z {
            |p| DVec2::new(p.y, p.z)
        } else if size.y >= size.z {
            |p| DVec2::new(p.z, p.x)
        } else {
            |p| DVec2::new(p.x, p.y)
        };
        let component = if size.x >= size.y && size.x >= size.z {
            normal.x
        } else if size.y >= size.z {
            normal.y
        } else {
            normal.z
        };
        self.points.clear();
        self.points.extend(corners.iter().map(|&c| {
            let p = seen(position(c));
            if component < 0.0 { DVec2::new(p.y, p.x) } else { p }
        }));
        component != 0.0 && component.is_finite()
    }

    /// True if it turns left only, and only once.
    fn is_convex(&self) -> bool {
        let n = self.points.len();
        let point = |i: usize| self.points[i % n];
        let turns_left = (0..n).all(|i| turn(point(i), point(i + 1), point(i + 2)) >= 0.0);
        // Each coordinate rises once and falls once; a star with five points does so twice.
        let changes = |coordinate: fn(DVec2) -> f64| {
            let rises = || (0..n).map(|i| coordinate(point(i + 1) - point(i))).filter(|d| *d != 0.0).map(|d| d > 0.0);
            let Some(mut last) = rises().next_back() else { return 0 };
            rises().filter(|&rise| std::mem::replace(&mut last, rise) != rise).count()
        };
        turns_left && changes(|p| p.x) <= 2 && changes(|p| p.y) <= 2
    }

    fn cut_ears(&mut self, corners: &[u32], triangles: &mut Vec<[u32; 3]>, work: &mut Work) -> Option<bool> {
        let n = corners.len();
        self.next.clear();
        self.next.extend((1..n).chain([0]));
        self.previous.clear();
        self.previous.extend([n - 1].into_iter().chain(0..n - 1));
        self.is_reflex.clear();
        self.is_reflex.extend(
            (0..n).map(|i| turn(self.points[(i + n - 1) % n], self.points[i], self.points[(i + 1) % n]) <= 0.0),
        );
        self.reflex.clear();
        self.reflex.extend((0..n).filter(|&i| self.is_reflex[i]));
        let (mut tip, mut left, mut missed) = (0, n, 0);
        // Corners on a straight line make ears without area. They are cut when nothing else is left.
        let mut flat_too = false;
        while left > 3 {
            work.step()?;
            if self.is_ear(tip, flat_too, work)? {
                let (a, c) = (self.previous[tip], self.next[tip]);
                triangles.push([corners[a], corners[tip], corners[c]]);
                self.remove(tip);
                // The next but one: it makes fewer slivers than to go on with the neighbour.
                tip = self.next[c];
                (left, missed, flat_too) = (left - 1, 0, false);
                continue;
            }
            tip = self.next[tip];
            missed += 1;
            if missed >= left {
                if flat_too {
                    break;
                }
                (missed, flat_too) = (0, true);
            }
        }
        let (a, mut b) = (tip, self.next[tip]);
        for _ in 2..left {
            let c = self.next[b];
            triangles.push([corners[a], corners[b], corners[c]]);
            b = c;
        }
        Some(left == 3)
    }

    fn is_ear(&mut self, tip: usize, flat_too: bool, work: &mut Work) -> Option<bool> {
        let (before, after) = (self.previous[tip], self.next[tip]);
        let ear = [before, tip, after].map(|i| self.points[i]);
        let turned = turn(ear[0], ear[1], ear[2]);
        if turned == 0.0 {
            return Some(flat_too);
        }
        if turned < 0.0 || turned.is_nan() {
            return Some(false);
        }
        let (low, high) = (ear[0].min(ear[1]).min(ear[2]), ear[0].max(ear[1]).max(ear[2]));
        let mut i = 0;
        while let Some(&other) = self.reflex.get(i) {
            if !self.is_reflex[other] {
                self.reflex.swap_remove(i);
                continue;
            }
            work.step()?;
            i += 1;
            let p = self.points[other];
            let is_near = p.cmpge(low).all() && p.cmple(high).all();
            if is_near && other != before && other != tip && other != after && self.blocks(other, ear) {
                return Some(false);
            }
        }
        Some(true)
    }

    /// True if the corner `other` lies in the triangle, or its edges go into it where both share a place.
    fn blocks(&self, other: usize, ear: [DVec2; 3]) -> bool {
        let p = self.points[other];
        let (from, to) = (self.points[self.previous[other]], self.points[self.next[other]]);
        for (i, &corner) in ear.iter().enumerate() {
            if corner == p {
                let (next, previous) = (ear[(i + 1) % 3], ear[(i + 2) % 3]);
                let within = |q: DVec2| turn(corner, next, q) > 0.0 && turn(corner, q, previous) > 0.0;
                return within(from) || within(to);
            }
        }
        (0..3).all(|i| turn(ear[i], ear[(i + 1) % 3], p) >= 0.0)
    }

    fn remove(&mut self, tip: usize) {
        let (before, after) = (self.previous[tip], self.next[tip]);
        self.next[before] = after;
        self.previous[after] = before;
        self.is_reflex[tip] = false;
        for i in [before, after] {
            let (a, b, c) = (self.points[self.previous[i]], self.points[i], self.points[self.next[i]]);
            self.is_reflex[i] = self.is_reflex[i] && turn(a, b, c) <= 0.0;
        }
    }
}

/// Positive if a, b, c turn left, negative if they turn right; the sign is exact.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    orient2d(coord(a), coord(b), coord(c))
}
