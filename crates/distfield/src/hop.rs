//! Visible sets by hops, the suffix `-hop`: the "violet" voxels of 4.4.1.
//!
//! *Idea.* A voxel U from which no free cuboid leads to the light may still see all of it. Take a free box at U, on the side of the light.
//! Every segment from U to the light leaves that box through a face towards the light, within a small rectangle. If all voxels just behind
//! that rectangle are known to see all of the light, so does U.
//!
//! *Definition.* Let L be the light's box of voxels: one voxel for a point light. Merge the columns that L covers on the x axis into one, and its rows
//! and slices likewise, as for `-xsn`; distances and cubes are those of the merged grid, in which L is one voxel. Let d(U) be the greatest d such that
//! the cube of side d that has U in its corner away from L has no occupied voxel in the cuboid of U and L. U is in the set if U is
//! free and, for a side s out of d, d/2, d/4, … 1, on each axis on which U and L are s or more apart all voxels of the *footprint* are in the
//! set: those that hold a point of a segment from U to L on the plane of the cube's face on that axis, within the face, beyond the plane. No
//! footprint is asked about where L is in the cube; so all free cuboids are in the set.
//!
//! *Guarantee.* Every point of a segment from a point of U to one of L lies in a free voxel, voxels being closed. *Proof,* by the merged distance to L. Until
//! the segment leaves the cube, it is in free voxels: it is in the cuboid of U and L. Let it leave at x. If x is on one face
//! only, it is in a voxel W of that face's footprint, which is in the set. Where x is on the common border of several faces, a footprint may lack
//! a voxel at x, if all segments that reach its plane are past the border of the face, on an axis b, already: say a → b. With n the
//! distance from U to L on an axis and f that to the far end of L, both from the near face of U, the least place on b is n_b(s − 1)/(f_a − 1) ≥ s. Around a circle of
//! arrows the product of the left sides would be at least that of the right ones; but (s − 1) < s and n ≤ f − 1. So there is no circle, and one of the faces has a voxel W at x. W is nearer to L,
//! and what is left of the segment goes from a point of W to one of L. The true segment, whose ends may be off by 20uG, is nowhere further than that from
//! one between points of U and L (`docs/numerics.md`): the voxelization's dilation covers it, as it does for cuboids.
//!
//! *Cost.* A bit a voxel for each light, and 8 bytes a row for segments that are clipped. The build visits each voxel once, outwards from L, and looks at
//! some footprints of mostly one to nine voxels; meanwhile it needs a byte a voxel.
//!
//! *Limits.* Not all that is visible: footprints are rounded outwards once a hop. About segments that are clipped at the grid only cuboids
//! say something, for a clipped end is rounded outwards and is no point of the segment.

use std::borrow::Cow;

use vdf_voxel::{Resolution, Voxel, VoxelSet};

use crate::{ExtendedNeighbourhood, FieldError, Neighbourhood, VoxelBox, extended::outwards, validate};

/// What hops prove visible from a light's voxels; see the head of its source file.
#[derive(Clone, Debug)]
pub struct HopNeighbourhood {
    light: VoxelBox,
    voxels: VoxelSet,
    /// For segments that are clipped.
    cuboids: ExtendedNeighbourhood,
}

impl HopNeighbourhood {
    /// The visible set of `light` among these occupied voxels; empty if `light` holds an occupied voxel or one outside the grid. For an area
    /// light pass the voxels of the other occluders.
    #[must_use]
    pub fn new(occupied: &VoxelSet, light: VoxelBox) -> Self {
        let cuboids = ExtendedNeighbourhood::new(occupied, light);
        let mut voxels = VoxelSet::new(occupied.resolution());
        visit_free(occupied, light, |parts, side| {
            if sees(light, parts.min(), side, |v| voxels.contains(v)) {
                voxels.extend(parts.voxels());
            }
        });
        Self { light, voxels, cuboids }
    }

    /// The memory of a neighbourhood in such a grid, in bytes; `u64::MAX` if it is more.
    #[must_use]
    pub const fn bytes_of(resolution: Resolution) -> u64 {
        VoxelSet::bytes_of(resolution).saturating_add(ExtendedNeighbourhood::bytes_of(resolution))
    }

    /// The voxels whose cuboid with the light is free: what may be asked about segments that are clipped at the grid.
    #[must_use]
    pub const fn cuboids(&self) -> &ExtendedNeighbourhood {
        &self.cuboids
    }
}

impl Neighbourhood for HopNeighbourhood {
    #[inline]
    fn proves(&self, voxel: Voxel) -> bool {
        self.voxels.contains(voxel)
    }

    fn voxels(&self) -> Cow<'_, VoxelSet> {
        Cow::Borrowed(&self.voxels)
    }

    fn count(&self) -> usize {
        self.voxels.count()
    }

    fn bytes(&self) -> usize {
        self.voxels.bytes() + self.cuboids.bytes()
    }

    /// Checks the resolution, the cuboids, that no member is occupied, and for each free voxel that it is a member just if the definition says
    /// so of the members nearer to the light. By induction outwards that proves the whole set, in linear time.
    fn validate(&self, occupied: &VoxelSet) -> Result<(), FieldError> {
        validate::same_resolution(self.voxels.resolution(), occupied)?;
        self.cuboids.validate(occupied)?;
        let mut visited = VoxelSet::new(occupied.resolution());
        let mut first = None;
        visit_free(occupied, self.light, |parts, side| {
            let expected = sees(self.light, parts.min(), side, |v| self.voxels.contains(v));
            for voxel in parts.voxels() {
                let found = self.voxels.contains(voxel);
                if found != expected {
                    first.get_or_insert(FieldError::Member { voxel, expected, found });
                }
                visited.insert(voxel);
            }
        });
        let stray = self.voxels.iter().find(|&voxel| !visited.contains(voxel));
        let stray = stray.map(|voxel| FieldError::Member { voxel, expected: false, found: true });
        first.or(stray).map_or(Ok(()), Err)
    }
}

/// Visits all free merged voxels, those nearer to the light first, as the boxes of their parts with their d, at most 255; none if the light is
/// partly outside the grid.
fn visit_free(occupied: &VoxelSet, light: VoxelBox, mut visit: impl FnMut(VoxelBox, u8)) {
    let resolution = occupied.resolution();
    let (min, max) = (light.min(), light.max());
    if !resolution.contains(max) {
        return;
    }
    let width = resolution.x() as usize;
    let mut cubes = vec![0u8; resolution.voxel_count()];
    let row_at = |j: u32, k: u32| {
        let start = resolution.linear_index(Voxel::new(0, j, k));
        start..start + width
    };
    // The least d of the rows nearer to the light, and the d of this row.
    let (mut least, mut row) = (vec![0u8; width], vec![0u8; width]);
    for (slices, nearer_k) in outwards(min.k, max.k, resolution.z()) {
        for (lines, nearer_j) in outwards(min.j, max.j, resolution.y()) {
            let (j, k) = (*lines.start(), *slices.start());
            least.fill(u8::MAX);
            let nearer = [nearer_j.map(|j| (j, k)), nearer_k.map(|k| (j, k)), nearer_j.zip(nearer_k)];
            for (j, k) in nearer.into_iter().flatten() {
                least.iter_mut().zip(&cubes[row_at(j, k)]).for_each(|(least, &d)| *least = d.min(*least));
            }
            for (columns, nearer_i) in outwards(min.i, max.i, resolution.x()) {
                let [first, last] = [*columns.start(), *columns.end()].map(|i| i as usize);
                let parts = VoxelBox::spanning(
                    Voxel::new(*columns.start(), j, k),
                    Voxel::new(*columns.end(), *lines.end(), *slices.end()),
                );
                let free = parts.voxels().all(|part| !occupied.contains(part));
                let around = nearer_i.map_or(u8::MAX, |i| least[i as usize].min(row[i as usize])).min(least[first]);
                let side = if free { around.saturating_add(1) } else { 0 };
                row[first..=last].fill(side);
                if free {
                    visit(parts, side);
                }
            }
            for k in slices.clone() {
                lines.clone().for_each(|j| cubes[row_at(j, k)].copy_from_slice(&row));
            }
        }
    }
}

/// Where the light is on one axis, as seen from a voxel: mirrored so that the light is on the positive side, and measured from the voxel's near face.
#[derive(Clone, Copy)]
struct Reach {
    sign: i64,
    /// The near end of the light: the merged distance; 0 if the light covers the voxel on this axis.
    near: i64,
    /// The far end of the light, at least 1.
    far: i64,
}

impl Reach {
    fn new(voxel: u32, min: u32, max: u32) -> Self {
        let [voxel, min, max] = [voxel, min, max].map(i64::from);
        if voxel <= max {
            Self { sign: 1, near: (min - voxel).max(0), far: max + 1 - voxel }
        } else {
            Self { sign: -1, near: voxel - max, far: voxel + 1 - min }
        }
    }

    /// How many merged voxels the cube of side `s` has along this axis, up to the light.
    fn width(self, s: i64) -> i64 {
        s.min(self.near + 1)
    }

    fn at(self, voxel: u32, offset: i64) -> u32 {
        // Within the cuboid of the voxel and the light, so within the grid.
        (i64::from(voxel) + self.sign * offset) as u32
    }
}

/// Whether `voxel`, with a free cube of `side`, is in the set, of which `known` says what is nearer to the light.
fn sees(light: VoxelBox, voxel: Voxel, side: u8, known: impl Fn(Voxel) -> bool) -> bool {
    let (min, max) = (light.min(), light.max());
    let reach =
        [Reach::new(voxel.i, min.i, max.i), Reach::new(voxel.j, min.j, max.j), Reach::new(voxel.k, min.k, max.k)];
    let sides = std::iter::successors(Some(i64::from(side)), |s| Some(s / 2)).take_while(|&s| s > 0);
    sides.into_iter().any(|s| {
        (0..3).all(|axis| {
            reach[axis].near < s
                || footprint(reach, axis, s, |offset| {
                    let at = |a: usize, c| reach[a].at(c, offset[a]);
                    known(Voxel::new(at(0, voxel.i), at(1, voxel.j), at(2, voxel.k)))
                })
        })
    })
}

/// Whether `known` holds of all voxels of the footprint on the face of a cube of side `s` on this axis, given by how far they are from the cube's corner.
fn footprint(reach: [Reach; 3], axis: usize, s: i64, known: impl Fn([i64; 3]) -> bool) -> bool {
    let Reach { near: n, far: f, .. } = reach[axis];
    // A segment from p in [0, 1] to q in [n, f] meets the plane at t = (s − p)/(q − p): least for p = 1 and q = f, greatest for p = 0 and q = n.
    let (t0, t1) = ((s - 1, f - 1), (s, n));
    let [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
    let [bs, cs] = [b, c].map(|other| {
        let Reach { near: m, far: g, .. } = reach[other];
        // There it is at (1 − t)p + tq with p in [0, 1] and q in [m, g]: least for p = 0, q = m and t0, greatest for p = 1, q = g and t1. Where the
        // light covers the voxel, the only merged voxel is 0.
        let first = t0.0 * m / t0.1;
        let high = t1.1 + t1.0 * (g - 1);
        // Up to the voxel that the greatest is in, not only at; and within the face.
        first..((high + t1.1 - 1) / t1.1).min(reach[other].width(s))
    });
    let mut offset = [s; 3];
    for u in bs {
        for v in cs.clone() {
            (offset[b], offset[c]) = (u, v);
            if !known(offset) {
                return false;
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_wrong_member_is_found() {
        let resolution = Resolution::new(9, 6, 5);
        let mut occupied = VoxelSet::new(resolution);
        occupied.extend([Voxel::new(3, 1, 1), Voxel::new(3, 2, 1), Voxel::new(5, 3, 3), Voxel::new(6, 4, 2)]);
        for light in [
            Voxel::new(1, 1, 1).into(),
            VoxelBox::spanning(Voxel::new(0, 0, 1), Voxel::new(2, 1, 1)),
            VoxelBox::spanning(Voxel::new(2, 1, 1), Voxel::new(3, 1, 2)),
            VoxelBox::spanning(Voxel::new(2, 1, 1), Voxel::new(9, 1, 2)),
        ] {
            let mut near = HopNeighbourhood::new(&occupied, light);
            assert_eq!(near.validate(&occupied), Ok(()));
            for voxel in resolution.voxels() {
                let before = near.voxels.clone();
                if before.contains(voxel) {
                    let mut only = VoxelSet::new(resolution);
                    only.insert(voxel);
                    near.voxels.remove_all(&only).expect("the same grid");
                } else {
                    near.voxels.insert(voxel);
                }
                assert!(near.validate(&occupied).is_err(), "{light:?}: {voxel:?}");
                near.voxels = before;
            }
            near.cuboids = ExtendedNeighbourhood::new(&VoxelSet::new(resolution), light);
            assert_eq!(near.validate(&occupied).is_ok(), !resolution.contains(light.max()));
        }
    }
}
