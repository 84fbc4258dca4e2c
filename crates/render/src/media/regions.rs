//! Regions: which media boundaries a point is inside of, and how that changes along a segment.
//!
//! *Idea.* Each closed boundary encloses a region. A path knows its medium by where it is: its state is the *set* of regions that it is
//! inside of, and the medium is that of the innermost. To cross a boundary inwards adds its region to the set, to cross it outwards removes
//! it. So the order of crossings at one place does not matter, boundaries that touch or coincide need no reference to each other, and
//! overlapping regions of one medium are their union.
//!
//! *Definition.* The innermost region of a set is the one of the least volume; of two that are equal, the later one in the file. Outside of
//! all regions is the ambient medium. In properly nested scenes this is what `exterior` says.
//!
//! *Guarantee.* Whether a segment meets a triangle of a boundary, and from which side, is decided exactly for the segment's two
//! double-precision ends. Each part of a path begins at the very point where the part before it ended. So the set is right at every
//! vertex of a path, however close to a boundary it lies: in the plane of a wall, beside it by rounding, or far from the origin.
//! Where a boundary is met from both sides at one place (an edge that is touched, a corner), the winding number of the boundary about a
//! point behind that place decides.
//!
//! *Cost.* A comparison of boxes for each boundary while there are few and none is met; else one query of a hierarchy. The winding number
//! takes time in proportion to the boundary's triangles, on a null set of segments.
//!
//! *Limits.* Boundaries have to be closed, each alone or together with others of the same medium (`shells.rs`); a scene file where they are not
//! is refused.

use std::ops::ControlFlow;

use glam::DVec3;
use smallvec::SmallVec;
use vdf_geometry::{Bounds, Bvh, CurvedSet, Segment, Triangle};
use vdf_scene::{Boundary, Medium, MediumId};

use super::{MediumInterval, RegionSet, extent::Extent, shells::shells};

/// More boundaries than these are not looked at one by one.
const MAX_COMPARED: usize = 8;

/// The regions of a scene, prepared for walks along segments. They are numbered from the innermost to the outermost.
#[derive(Debug)]
pub(super) struct Regions {
    /// The medium inside each region; `None` is vacuum.
    inner: Vec<Option<MediumId>>,
    /// The medium that the boundary of each region names for its outer side.
    outer: Vec<Option<MediumId>>,
    /// Where the boundary of each region is.
    extents: Vec<Extent>,
    /// The only region, if its boundary is a box with vacuum around it: a ray that leaves it meets no medium again.
    only: Option<Bounds>,
    /// The medium outside of all regions.
    ambient: Option<MediumId>,
    /// Over the triangles of all boundaries.
    bvh: Bvh,
    triangles: Vec<Triangle>,
    /// For each triangle its region, and whether its normal points inwards.
    faces: Vec<Face>,
    /// The boundaries that are spheres, and their regions.
    spheres: CurvedSet,
    region_of_sphere: Vec<u32>,
    /// Crossings closer than this are at one place, in world units: 2⁻⁴⁰ of the largest coordinate, far more than the rounding of `t`
    /// and far less than the step of single precision there.
    crossing_tolerance: f64,
}

#[derive(Clone, Copy, Debug)]
struct Face {
    region: u32,
    inwards: bool,
}

/// Where a segment crosses the boundary of a region. Two triangles that are met on their common edge give two crossings of the same
/// effect, which is that of one.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    t: f64,
    region: u32,
    enters: bool,
}

/// On the stack for all but pathological segments: no allocation in the loops of the integrators.
type Crossings = SmallVec<[Crossing; 16]>;

impl Regions {
    pub(super) fn new(media: &[Medium], boundaries: &[Boundary], ambient: Option<MediumId>) -> Self {
        let mut shells = shells(media, boundaries);
        // The least volume first; of equal ones the last in the file.
        shells.sort_by(|a, b| a.volume.total_cmp(&b.volume).then(b.place.cmp(&a.place)));
        let (mut triangles, mut faces, mut extents) = (Vec::new(), Vec::new(), Vec::new());
        let (mut inner, mut outer) = (Vec::new(), Vec::new());
        let (mut spheres, mut region_of_sphere) = (Vec::new(), Vec::new());
        for (shell, region) in shells.into_iter().zip(0..) {
            inner.push(shell.inner);
            outer.push(shell.outer);
            extents.push(shell.sphere.map_or_else(|| Extent::of(&shell.triangles), |s| Extent::of_sphere(&s)));
            if let Some(sphere) = shell.sphere {
                spheres.push(sphere);
                region_of_sphere.push(region);
            }
            faces.extend(shell.inwards.iter().map(|&inwards| Face { region, inwards }));
            triangles.extend(shell.triangles);
        }
        let bvh = Bvh::new(&triangles);
        let spheres = CurvedSet::new(spheres);
        let all = bvh.bounds().union(*spheres.bounds());
        let crossing_tolerance = all.largest_coordinate() / (1_u64 << 40) as f64;
        let mut regions = Self {
            inner,
            outer,
            extents,
            only: None,
            ambient: None,
            bvh,
            triangles,
            faces,
            spheres,
            region_of_sphere,
            crossing_tolerance,
        };
        regions.set_ambient(ambient);
        regions
    }

    pub(super) fn set_ambient(&mut self, ambient: Option<MediumId>) {
        self.ambient = ambient;
        self.only = match self.extents.as_slice() {
            [only] if only.closed_box && ambient.is_none() => Some(only.bounds),
            _ => None,
        };
    }

    /// The medium of a point in these regions; `None` is vacuum.
    #[inline]
    pub(super) fn medium(&self, regions: &RegionSet) -> Option<MediumId> {
        regions.innermost().map_or(self.ambient, |region| self.inner[region as usize])
    }

    /// Whether there are no regions and no medium outside.
    #[inline]
    pub(super) fn are_none(&self) -> bool {
        self.extents.is_empty() && self.ambient.is_none()
    }

    /// The medium that the outermost of these regions has outside, by its boundary.
    pub(super) fn around(&self, regions: &RegionSet) -> Option<MediumId> {
        regions.outermost().and_then(|region| self.outer[region as usize])
    }

    /// The regions that `point` is inside of. Cost: that of all triangles whose boundary's bounds hold the point.
    pub(super) fn at(&self, point: DVec3) -> RegionSet {
        let inside = (0..).zip(&self.extents).filter(|(r, e)| e.bounds.contains(point) && self.winds_about(*r, point));
        inside.map(|(region, _)| region).collect()
    }

    /// True if the segment crosses no boundary, so that its ends are in the same regions.
    #[inline]
    pub(super) fn are_not_crossed(&self, segment: &Segment) -> bool {
        if self.extents.len() <= MAX_COMPARED {
            if self.extents.iter().any(|e| e.is_left(segment)) {
                return false;
            }
            if self.extents.iter().all(|e| e.is_not_met(segment)) {
                return true;
            }
        }
        let mut met = false;
        self.bvh.visit_hits(segment, |_| met = true);
        !met && !self.spheres.occluded(segment)
    }

    /// A box in whose inside no boundary is met: a segment between two of its points is in the same regions everywhere, which [`Regions::walk`] sees
    /// without a look at triangles. Empty where none is known.
    pub(super) fn clear(&self) -> Bounds {
        if self.extents.len() > MAX_COMPARED || self.extents.iter().any(|e| !e.shell) {
            return Bounds::EMPTY;
        }
        let all = Bounds::new(DVec3::NEG_INFINITY, DVec3::INFINITY);
        self.extents
            .iter()
            .fold(all, |clear, Extent { bounds, .. }| Bounds::new(clear.min.max(bounds.min), clear.max.min(bounds.max)))
    }

    /// True only if a segment from `p` to `q` starts in the only region, a box in vacuum, and ends outside of it by more than the crossing
    /// tolerance. False says nothing.
    #[inline]
    pub(super) fn are_left_for_good(&self, p: DVec3, q: DVec3) -> bool {
        let Some(Bounds { min, max }) = self.only else { return false };
        p.cmpgt(min).all()
            && p.cmplt(max).all()
            && (q.cmplt(min - self.crossing_tolerance).any() || q.cmpgt(max + self.crossing_tolerance).any())
    }

    /// Visits the intervals of the segment in order with the regions that they are in, until the visitor breaks. The regions at the end; `None`
    /// if they are those of the start.
    #[inline]
    pub(super) fn walk<B>(
        &self,
        segment: &Segment,
        start: &RegionSet,
        mut visit: impl FnMut(MediumInterval, &RegionSet) -> ControlFlow<B>,
    ) -> ControlFlow<B, Option<RegionSet>> {
        if self.extents.len() <= MAX_COMPARED && self.extents.iter().all(|e| e.is_not_met(segment)) {
            visit(MediumInterval { medium: self.medium(start), t0: 0.0, t1: 1.0 }, start)?;
            return ControlFlow::Continue(None);
        }
        let (mut regions, mut t0) = (start.clone(), 0.0);
        let mut crossings = Crossings::new();
        self.find_crossings(segment, &mut crossings);
        for Crossing { t, region, enters } in crossings {
            if enters != regions.contains(region) {
                visit(MediumInterval { medium: self.medium(&regions), t0, t1: t }, &regions)?;
                regions.set(region, enters);
                t0 = t;
            }
        }
        visit(MediumInterval { medium: self.medium(&regions), t0, t1: 1.0 }, &regions)?;
        ControlFlow::Continue(Some(regions))
    }

    /// The regions at the end of a segment that starts in `start`.
    #[inline]
    pub(super) fn at_end(&self, segment: &Segment, start: &RegionSet) -> RegionSet {
        match self.walk(segment, start, |_, _| ControlFlow::<std::convert::Infallible>::Continue(())) {
            ControlFlow::Continue(regions) => regions.unwrap_or_else(|| start.clone()),
            ControlFlow::Break(never) => match never {},
        }
    }

    /// By how much of the segment's length places are one.
    #[inline]
    pub(super) fn tolerance(&self, segment: &Segment) -> f64 {
        self.crossing_tolerance / segment.length()
    }

    /// All crossings in order; of those of a region at one place all have the same effect.
    fn find_crossings(&self, segment: &Segment, crossings: &mut Crossings) {
        if !self.cross_boxes(segment, crossings) {
            crossings.clear();
            self.cross_all(segment, crossings);
        }
    }

    /// The same of boundaries of any shape.
    fn cross_all(&self, segment: &Segment, crossings: &mut Crossings) {
        self.bvh.visit_hits(segment, |hit| {
            let Face { region, inwards } = self.faces[hit.triangle as usize];
            let from_front = self.triangles[hit.triangle as usize].is_entered_by(segment);
            crossings.push(Crossing { t: hit.t, region, enters: from_front != inwards });
        });
        if !self.spheres.is_empty() {
            self.cross_spheres(segment, crossings);
        }
        if crossings.len() > 1 {
            crossings.sort_unstable_by(|a, b| a.t.total_cmp(&b.t).then(a.region.cmp(&b.region)));
            self.settle(crossings, segment);
        }
    }

    /// The same if there are but few boundaries, each of them a box or not met; else false, and what was found is not all.
    #[inline]
    fn cross_boxes(&self, segment: &Segment, crossings: &mut Crossings) -> bool {
        if self.extents.len() > MAX_COMPARED {
            return false;
        }
        for (extent, region) in self.extents.iter().zip(0..) {
            let Some(of_box) = extent.crossings(segment) else { return false };
            for (t, enters) in of_box.into_iter().flatten() {
                crossings.push(Crossing { t, region, enters });
            }
        }
        if self.extents.len() > 1 {
            crossings.sort_unstable_by(|a, b| a.t.total_cmp(&b.t).then(a.region.cmp(&b.region)));
        }
        true
    }

    /// A sphere is convex, so that on which sides of it the ends lie says which crossings there are: exactly.
    fn cross_spheres(&self, segment: &Segment, crossings: &mut Crossings) {
        self.spheres.visit_hits(segment, |hit| {
            let (sphere, region) =
                (&self.spheres.shapes()[hit.shape as usize], self.region_of_sphere[hit.shape as usize]);
            let [starts_in, ends_in] = [segment.p, segment.q].map(|end| sphere.side(end).is_lt());
            match (starts_in, ends_in) {
                (false, true) => crossings.push(Crossing { t: hit.t, region, enters: true }),
                (true, false) => crossings.push(Crossing { t: hit.t, region, enters: false }),
                // An end on the sphere is outside.
                (true, true) => {}
                (false, false) => {
                    let [Some(first), Some(second)] = sphere.hits(segment) else { return };
                    if first < second {
                        crossings.push(Crossing { t: hit.t, region, enters: hit.t == first });
                    }
                }
            }
        });
    }

    /// Where a boundary is met from both sides at one place, the point half-way to its next crossing tells on which side the segment goes on.
    fn settle(&self, crossings: &mut Crossings, segment: &Segment) {
        let tolerance = self.tolerance(segment);
        for i in 0..crossings.len() {
            let Crossing { t, region, enters } = crossings[i];
            let here = |c: &Crossing| c.region == region && (c.t - t).abs() <= tolerance;
            if crossings.iter().all(|c| !here(c) || c.enters == enters) {
                continue;
            }
            let next = crossings.iter().filter(|c| c.region == region && c.t > t + tolerance).map(|c| c.t);
            let behind = 0.5 * (t + next.fold(1.0, f64::min));
            let inside = self.winds_about(region, segment.at(behind));
            crossings.iter_mut().filter(|c| here(c)).for_each(|c| c.enters = inside);
        }
    }

    /// Whether the boundary of a region winds around `p`: the sum of the solid angles of its triangles over 4π is ±1 inside and 0 outside.
    /// Unlike the parity of the crossings of a ray it has no unlucky direction.
    #[cold]
    fn winds_about(&self, region: u32, p: DVec3) -> bool {
        if let Some(sphere) = self.region_of_sphere.iter().position(|r| *r == region) {
            return self.spheres.shapes()[sphere].side(p).is_lt();
        }
        let of_region = self.faces.iter().zip(&self.triangles).filter(|(face, _)| face.region == region);
        let half_angles: f64 = of_region
            .map(|(face, t)| {
                let half = half_solid_angle(t.vertices_f64().map(|v| v - p));
                if face.inwards { -half } else { half }
            })
            .sum();
        half_angles.abs() > std::f64::consts::PI
    }

    #[cfg(test)]
    pub(super) fn is_one_box(&self) -> bool {
        self.only.is_some()
    }
}

/// Half the signed solid angle of a triangle seen from the origin (van Oosterom and Strackee 1983).
fn half_solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    a.dot(b.cross(c)).atan2(denominator)
}

#[cfg(test)]
mod tests;
