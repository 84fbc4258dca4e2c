//! What is true of a segment: the loop over all triangles, and the hierarchy. The same for curved shapes, which no prover knows of and every query is
//! tested against: their set, and exact arithmetic on each of them.

use vdf_geometry::{Bounds, Segment, intersect_exact};
use vdf_render::World;

/// The loop is run on every segment up to this many triangles; beyond, on a share of the segments such that it costs no
/// more.
const TRIANGLES_PER_SEGMENT: u64 = 256;

/// Of the segments without a proof only one in so many is asked about: they test the hierarchy, not the proofs.
const UNPROVED: u64 = 16;

/// The exact loop over curved shapes, which costs some microseconds each, is run on one segment in so many, times the number of shapes.
const UNCURVED: u64 = 8;

/// The two references for one scene.
#[derive(Debug)]
pub(super) struct Oracle<'a> {
    world: &'a World,
    /// Bounds of each triangle.
    bounds: Vec<Bounds>,
    /// The loop is run on one segment in so many.
    every: u64,
    /// The same for the loop over curved shapes.
    every_curved: u64,
}

/// Whether an occluder meets a segment; `None` where this reference was not asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Truth {
    pub(super) by_hierarchy: Option<bool>,
    pub(super) by_loop: Option<bool>,
    /// Whether a curved shape meets it: by any hit of their set, by its first hit, by the loop.
    pub(super) curved: Option<[bool; 3]>,
}

impl Truth {
    /// True if at least one reference says so. Where they disagree, a proof is wrong whatever it says.
    pub(super) fn says(&self, occluded: bool) -> bool {
        self.by_hierarchy == Some(occluded) || self.by_loop == Some(occluded)
    }

    pub(super) fn disagrees(&self) -> bool {
        matches!((self.by_hierarchy, self.by_loop), (Some(a), Some(b)) if a != b)
    }

    pub(super) fn disagrees_about_curved(&self) -> bool {
        self.curved.is_some_and(|[any, first, by_loop]| any != by_loop || first != by_loop)
    }
}

impl<'a> Oracle<'a> {
    pub(super) fn new(world: &'a World) -> Self {
        Self {
            world,
            bounds: world.triangles.iter().map(|t| Bounds::of_triangles([t])).collect(),
            every: (world.triangles.len() as u64).div_ceil(TRIANGLES_PER_SEGMENT).max(1),
            every_curved: world.curved().map_or(1, |curved| curved.shapes().len() as u64),
        }
    }

    /// Asks about segment `index`, which a method has `proved` something of, or none. `at_curved` says that it is made for curved shapes.
    pub(super) fn ask(&self, segment: &Segment, index: u64, proved: bool, at_curved: bool) -> Truth {
        let every = if proved { self.every } else { UNPROVED.max(self.every) };
        let by_loop = index.is_multiple_of(every).then(|| self.occluded_by_any(segment));
        let by_hierarchy = (proved || by_loop.is_some()).then(|| self.world.bvh.occluded(segment));
        let every = self.every_curved * if at_curved { 1 } else { UNCURVED };
        let curved = self.world.curved().filter(|_| index.is_multiple_of(every)).map(|curved| {
            let by_loop = curved.shapes().iter().any(|shape| shape.meets_exactly(segment));
            [curved.occluded(segment), curved.intersect(segment, f64::INFINITY).is_some(), by_loop]
        });
        Truth { by_hierarchy, by_loop, curved }
    }

    /// The slow twin of [`vdf_geometry::Bvh::occluded`]: exact predicates on every triangle. Only those are skipped
    /// whose bounds and the segment's are apart on an axis, which is a comparison of exact numbers.
    fn occluded_by_any(&self, segment: &Segment) -> bool {
        let all = self.bounds.iter().zip(&self.world.triangles);
        all.filter(|(bounds, _)| !bounds.misses(segment)).any(|(_, t)| intersect_exact(segment, t).is_some())
    }
}
