//! The closed surfaces that regions are made of: a boundary that is closed by itself, or the open ones that a medium has in common.
//!
//! Two media that share a wall may be given as two open shells and the wall between them, which names a medium for either of its sides. So
//! each medium that an open boundary names gets one closed surface, of all open boundaries that have it on one side only, turned so that
//! their normals point out of it. Media that are equal by value are one.

use std::collections::HashMap;

use glam::Vec3;
use vdf_geometry::{Bounds, CurvedShape, Triangle};
use vdf_scene::{Boundary, Medium, MediumId};

/// A closed surface around a region.
pub(super) struct Shell {
    /// The volume that it encloses, at least 0.
    pub(super) volume: f64,
    /// Number of its first boundary in the file.
    pub(super) place: usize,
    /// The medium inside.
    pub(super) inner: Option<MediumId>,
    /// The medium that its boundary names for the other side.
    pub(super) outer: Option<MediumId>,
    pub(super) triangles: Vec<Triangle>,
    /// In place of triangles.
    pub(super) sphere: Option<CurvedShape>,
    /// For each triangle whether its normal points inwards.
    pub(super) inwards: Vec<bool>,
}

impl Shell {
    /// Of triangles with the side that is said to be inside: behind the normal, or before it.
    fn new(
        place: usize,
        [inside, outside]: [Option<MediumId>; 2],
        parts: impl IntoIterator<Item = (Triangle, bool)>,
    ) -> Self {
        let (triangles, mut inwards): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        let volume = signed_volume(&triangles, &inwards);
        // Wound the other way round: what is said to be inside is outside.
        let turned = volume < 0.0;
        inwards.iter_mut().for_each(|inwards| *inwards ^= turned);
        let [inner, outer] = if turned { [outside, inside] } else { [inside, outside] };
        Self { volume: volume.abs(), place, inner, outer, triangles, sphere: None, inwards }
    }

    /// Of a sphere.
    fn of_sphere(place: usize, sphere: CurvedShape, [inner, outer]: [Option<MediumId>; 2]) -> Self {
        let volume = 4.0 / 3.0 * std::f64::consts::PI * sphere.placement().0.determinant().abs();
        let (triangles, inwards) = (Vec::new(), Vec::new());
        Self { volume, place, inner, outer, triangles, sphere: Some(sphere), inwards }
    }
}

/// The closed surfaces of these boundaries.
pub(super) fn shells(media: &[Medium], boundaries: &[Boundary]) -> Vec<Shell> {
    let (closed, open): (Vec<_>, Vec<_>) = boundaries.iter().enumerate().partition(|(_, b)| is_closed(&b.triangles));
    let mut shells: Vec<Shell> = closed
        .into_iter()
        .map(|(place, b)| match b.curved {
            Some(sphere) => Shell::of_sphere(place, sphere, [b.interior, b.exterior]),
            None => Shell::new(place, [b.interior, b.exterior], b.triangles.iter().map(|t| (*t, false))),
        })
        .collect();
    // The first medium of each value stands for all that are equal to it.
    let first_equal = |id: MediumId| {
        let medium = media.get(id.0 as usize);
        (0..).zip(media).find(|(_, m)| Some(*m) == medium).map_or(id, |(i, _)| MediumId(i))
    };
    let sides = |b: &Boundary| [b.interior, b.exterior].map(|side| side.map(first_equal));
    let mut named: Vec<MediumId> = open.iter().flat_map(|(_, b)| sides(b)).flatten().collect();
    named.sort_unstable_by_key(|id| id.0);
    named.dedup();
    for medium in named {
        let of_medium = || open.iter().filter(|(_, b)| (sides(b)[0] == Some(medium)) != (sides(b)[1] == Some(medium)));
        let Some((place, _)) = of_medium().next() else { continue };
        let parts = of_medium().flat_map(|(_, b)| {
            let before = sides(b)[1] == Some(medium);
            b.triangles.iter().map(move |t| (*t, before))
        });
        shells.push(Shell::new(*place, [Some(medium), None], parts));
    }
    shells
}

/// True if each edge is used as often one way as the other, so that the surface has no border.
fn is_closed(triangles: &[Triangle]) -> bool {
    // −0 and 0 are one place.
    let key = |v: Vec3| (v + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut balance: HashMap<_, i64> = HashMap::new();
    for triangle in triangles {
        let [a, b, c] = triangle.vertices.map(key);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if from < to {
                *balance.entry((from, to)).or_default() += 1;
            } else if to < from {
                *balance.entry((to, from)).or_default() -= 1;
            }
        }
    }
    balance.values().all(|&n| n == 0)
}

/// The volume that closed triangles enclose, negative if their normals point inwards: a sum of signed tetrahedra.
fn signed_volume(triangles: &[Triangle], inwards: &[bool]) -> f64 {
    let Bounds { min, max } = Bounds::of_triangles(triangles);
    let centre = (min + max) * 0.5;
    let volume = |(t, inwards): (&Triangle, &bool)| {
        let volume = t.area_normal().dot(t.vertices_f64()[0] - centre) / 6.0;
        if *inwards { -volume } else { volume }
    };
    triangles.iter().zip(inwards).map(volume).sum()
}
