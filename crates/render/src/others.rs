//! Shapes that proofs know nothing of: curved ones, and veils, which let some light pass straight on (a mask, a thin sheet of glass).
//!
//! A proof of visibility is a statement about the opaque triangles. So whatever a prover answers, a segment is tested against these shapes as well, exactly;
//! in a scene without them that costs one comparison. What of light passes a veil is a factor of what arrives.

use glam::DVec3;
use vdf_geometry::{Bounds, Bvh, CurvedSet, Hit, Segment, Triangle};
use vdf_scene::{Rgb, Scene};

/// The shapes of a scene beside its opaque triangles.
#[derive(Debug)]
pub(crate) struct OtherShapes {
    /// Opaque curved shapes, and the surface of each.
    curved: CurvedSet,
    curved_surfaces: Vec<u32>,
    veils: Veils,
}

#[derive(Debug)]
struct Veils {
    bvh: Bvh,
    triangles: Vec<Triangle>,
    /// The surface of each triangle, and its number there.
    places: Vec<TrianglePlace>,
    curved: CurvedSet,
    curved_surfaces: Vec<u32>,
}

/// A triangle as one of its surface's.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TrianglePlace {
    pub(crate) surface: u32,
    pub(crate) number: u32,
}

/// What is met first.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Met {
    /// An opaque triangle.
    Triangle(Hit),
    /// A triangle of a veil.
    Veil(Hit, Triangle, TrianglePlace),
    /// A curved shape of the surface with this number, at this parameter.
    Curved(u32, f64),
}

impl OtherShapes {
    /// The shapes of `scene` that are no opaque triangles; `None` if there are none. `is_veil` says which surfaces let light pass.
    pub(crate) fn new(scene: &Scene, is_veil: impl Fn(usize) -> bool) -> Option<Self> {
        let (mut curved, mut curved_surfaces) = (Vec::new(), Vec::new());
        let (mut veiled, mut veiled_surfaces) = (Vec::new(), Vec::new());
        let (mut triangles, mut places) = (Vec::new(), Vec::new());
        for (i, surface) in scene.surfaces.iter().enumerate() {
            let number = i as u32;
            let veil = is_veil(i);
            if veil {
                triangles.extend(&surface.triangles);
                places
                    .extend((0..).take(surface.triangles.len()).map(|n| TrianglePlace { surface: number, number: n }));
            }
            if let Some(shape) = surface.curved {
                let (shapes, surfaces) =
                    if veil { (&mut veiled, &mut veiled_surfaces) } else { (&mut curved, &mut curved_surfaces) };
                shapes.push(shape);
                surfaces.push(number);
            }
        }
        if curved.is_empty() && veiled.is_empty() && triangles.is_empty() {
            return None;
        }
        let veils = Veils {
            bvh: Bvh::new(&triangles),
            triangles,
            places,
            curved: CurvedSet::new(veiled),
            curved_surfaces: veiled_surfaces,
        };
        Some(Self { curved: CurvedSet::new(curved), curved_surfaces, veils })
    }

    /// The veils' triangle with this number.
    pub(crate) fn veil_triangle(&self, number: usize) -> Option<&Triangle> {
        self.veils.triangles.get(number)
    }

    /// The opaque curved shapes.
    pub(crate) const fn curved(&self) -> &CurvedSet {
        &self.curved
    }

    /// Bounds of all of them.
    pub(crate) fn bounds(&self) -> Bounds {
        self.curved.bounds().union(*self.veils.bvh.bounds()).union(*self.veils.curved.bounds())
    }

    /// What the closed segment meets first, of these shapes and the first opaque triangle.
    pub(crate) fn first(&self, segment: &Segment, opaque: Option<Hit>) -> Option<Met> {
        let mut first = opaque.map(Met::Triangle);
        let mut before = opaque.map_or(f64::INFINITY, |hit| hit.t);
        if let Some(hit) = self.curved.intersect(segment, before)
            && hit.t < before
        {
            before = hit.t;
            first = Some(Met::Curved(self.curved_surfaces[hit.shape as usize], hit.t));
        }
        let veils = &self.veils;
        if veils.triangles.is_empty() && veils.curved.is_empty() {
            return first;
        }
        if let Some(hit) = veils.bvh.intersect(segment)
            && hit.t < before
        {
            before = hit.t;
            let i = hit.triangle as usize;
            first = Some(Met::Veil(hit, veils.triangles[i], veils.places[i]));
        }
        if let Some(hit) = veils.curved.intersect(segment, before)
            && hit.t < before
        {
            first = Some(Met::Curved(veils.curved_surfaces[hit.shape as usize], hit.t));
        }
        first
    }

    /// Whether an opaque one of these shapes meets the closed segment.
    pub(crate) fn occlude(&self, segment: &Segment) -> bool {
        self.curved.occluded(segment)
    }

    /// What of light passes all veils on the closed segment; `passes` says it for each place that is met.
    pub(crate) fn pass(&self, segment: &Segment, mut passes: impl FnMut(Met) -> Rgb) -> Rgb {
        let mut product = Rgb::ONE;
        if self.veils.triangles.is_empty() && self.veils.curved.is_empty() {
            return product;
        }
        self.veils.bvh.visit_hits(segment, |hit| {
            let i = hit.triangle as usize;
            product *= passes(Met::Veil(hit, self.veils.triangles[i], self.veils.places[i]));
        });
        self.veils.curved.visit_hits(segment, |hit| {
            product *= passes(Met::Curved(self.veils.curved_surfaces[hit.shape as usize], hit.t));
        });
        product
    }
}

/// A point of a curved shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CurvedPoint {
    pub(crate) point: DVec3,
    /// Unit, in front.
    pub(crate) normal: DVec3,
    /// In the shape's own space.
    pub(crate) local: DVec3,
}
