//! Proofs towards an area light, which is an occluder itself.
//!
//! *Idea.* A query to a sampled point on an area light is superficial: one end lies on an occluder, in an occupied
//! voxel, and no field proves anything there. But the light's own triangles, and what lies so close to it that it
//! shares its voxels (a ceiling), are few. They are tested exactly; all other occluders are proved away by the
//! neighbourhood of the light's voxel box (4.4.1 in \[Houska2013\]).
//!
//! *Definition.* The light's box holds the voxels of its triangles' bounds, widened by a thousandth of a voxel. An
//! occluder is *near* if its bounds come within a thousandth of a voxel of that box, else *far*. A segment from voxel U
//! to a point in the box is proved unoccluded if the cuboid of U and the box is free of far occluders, or hops say
//! that U sees all of the box past them, and the segment meets no near one.
//!
//! *Guarantee.* Both ends lie in the cuboid, so the segment does, and no far occluder meets it, nor one from a voxel that sees
//! all of the box; that no near one does is tested exactly. So the claim is about *all* occluders, the light's own among them: exactly what the hierarchy
//! answers.
//!
//! *The far occluders' voxels* are those of all occluders, which are known, but for those that only near ones occupy. A
//! far occluder that shares a voxel with a near one has a box of voxels that meets that one's box; there are few of
//! them. So the near ones' voxels are removed, and the voxels of those few are put back.
//!
//! *Cost.* For each light one look at the boxes of blocks of occluders, one copy of the occupied voxels, two small
//! voxelizations and one sweep. A query takes two voxels, one row, and mostly one comparison of boxes: a flat light in
//! front of a flat ceiling is disjoint from all segments that end before it.
//!
//! *Limits.* None is built if more than [`MOST_NEAR`] triangles are near: then the exact test costs what it would save.
//! *Deviation from the thesis:* it does not say what becomes of the light's own triangles, nor of others in its voxels.

use glam::DVec3;
use rayon::prelude::*;
use vdf_distfield::{ExtendedNeighbourhood, HopNeighbourhood, Neighbourhood as _, VoxelBox};
use vdf_geometry::{Bounds, Bvh, Segment, Triangle};
use vdf_voxel::{Voxel, VoxelError, VoxelGrid, VoxelSet, voxel_bounds, voxelize};

/// The largest number of near triangles.
const MOST_NEAR: usize = 64;

/// By how much the light is widened to its box, and how far from the box an occluder has to be to be far, in voxels.
/// More than the lift of sampled points and than the dilation of occupied voxels; were it less, proofs would be lost
/// but none would be wrong.
const MARGIN: f64 = 1e-3;

/// Occluders that are passed over together.
const BLOCK: usize = 256;

/// All occluders, as the neighbourhoods of all area lights look at them.
#[derive(Debug)]
pub(crate) struct Occluders<'a> {
    grid: &'a VoxelGrid,
    triangles: &'a [Triangle],
    occupied: &'a VoxelSet,
    /// The voxels around each block of triangles; `None` if all of them are off the grid.
    blocks: Vec<Option<VoxelBox>>,
}

impl<'a> Occluders<'a> {
    /// Looks at each triangle once; `occupied` are the voxels of all of them.
    pub(crate) fn new(
        grid: &'a VoxelGrid,
        triangles: &'a [Triangle],
        occupied: &'a VoxelSet,
    ) -> Result<Self, VoxelError> {
        let around =
            |block: &[Triangle]| block.iter().try_fold(None, |all, triangle| Ok(union(all, box_of(grid, triangle)?)));
        let blocks = triangles.par_chunks(BLOCK).map(around).collect::<Result<_, _>>()?;
        Ok(Self { grid, triangles, occupied, blocks })
    }

    /// The triangles whose boxes have a voxel in common with `bounds`, and maybe some others that are off the grid.
    fn touching(&self, bounds: VoxelBox) -> impl Iterator<Item = (&'a Triangle, VoxelBox)> {
        let (grid, blocks) = (self.grid, self.triangles.chunks(BLOCK).zip(&self.blocks));
        blocks
            .filter(move |(_, around)| around.is_some_and(|around| meet(around, bounds)))
            .flat_map(move |(block, _)| block.iter().filter_map(|t| Some((t, box_of(grid, t).ok()??))))
            .filter(move |&(_, own)| meet(own, bounds))
    }

    /// Where the light made of the triangles `light` is, which are some of the occluders.
    pub(crate) fn site(&self, light: &[Triangle]) -> Site {
        let Bounds { min, max } = Bounds::of_triangles(light);
        if !(min.is_finite() && max.is_finite()) {
            return Site::Nowhere;
        }
        let margin = MARGIN * self.grid.voxel_size();
        let light = VoxelBox::spanning(self.grid.nearest_voxel(min - margin), self.grid.nearest_voxel(max + margin));
        let close = self.close_to(light);
        // What is near is in a voxel of the box or in one beside it.
        let beside = VoxelBox::spanning(
            Voxel::new(
                light.min().i.saturating_sub(1),
                light.min().j.saturating_sub(1),
                light.min().k.saturating_sub(1),
            ),
            Voxel::new(light.max().i + 1, light.max().j + 1, light.max().k + 1),
        );
        let near = self.touching(beside).map(|(t, _)| *t).filter(|t| is_near(t, &close));
        let near: Vec<Triangle> = near.take(MOST_NEAR + 1).collect();
        if near.len() > MOST_NEAR { Site::Crowded } else { Site::Found { light, near } }
    }

    /// The box `light` in world units, widened by the margin.
    fn close_to(&self, light: VoxelBox) -> Bounds {
        let (size, margin) = (self.grid.voxel_size(), MARGIN * self.grid.voxel_size());
        Bounds::new(self.grid.corner(light.min()) - margin, self.grid.corner(light.max()) + (size + margin))
    }

    /// The voxels of all occluders that are far from the box `light`; `near` are the others.
    fn far_voxels(&self, light: VoxelBox, near: &[Triangle]) -> Result<VoxelSet, VoxelError> {
        let (grid, close) = (self.grid, self.close_to(light));
        let boxes = near.iter().filter_map(|t| box_of(grid, t).transpose()).collect::<Result<Vec<_>, _>>()?;
        let mut far = self.occupied.clone();
        let Some(around) = boxes.iter().fold(None, |all, &own| union(all, Some(own))) else { return Ok(far) };
        far.remove_all(&voxelize(grid, near.par_iter().map(|t| t.vertices))?)?;
        let beside =
            self.touching(around).filter(|&(t, own)| !is_near(t, &close) && boxes.iter().any(|&b| meet(own, b)));
        let beside: Vec<_> = beside.map(|(t, _)| t.vertices).collect();
        if !beside.is_empty() {
            far.insert_all(&voxelize(grid, beside)?)?;
        }
        Ok(far)
    }
}

/// The box of voxels that a triangle may occupy.
fn box_of(grid: &VoxelGrid, triangle: &Triangle) -> Result<Option<VoxelBox>, VoxelError> {
    Ok(voxel_bounds(grid, triangle.vertices)?.map(|[first, last]| VoxelBox::spanning(first, last)))
}

fn union(a: Option<VoxelBox>, b: Option<VoxelBox>) -> Option<VoxelBox> {
    let (Some(a), Some(b)) = (a, b) else { return a.or(b) };
    let least = |a: Voxel, b: Voxel| Voxel::new(a.i.min(b.i), a.j.min(b.j), a.k.min(b.k));
    let greatest = |a: Voxel, b: Voxel| Voxel::new(a.i.max(b.i), a.j.max(b.j), a.k.max(b.k));
    Some(VoxelBox::spanning(least(a.min(), b.min()), greatest(a.max(), b.max())))
}

fn is_near(triangle: &Triangle, close: &Bounds) -> bool {
    Bounds::of_triangles([triangle]).touches(close)
}

/// True if two boxes have a voxel in common.
fn meet(a: VoxelBox, b: VoxelBox) -> bool {
    let below = |a: Voxel, b: Voxel| a.i <= b.i && a.j <= b.j && a.k <= b.k;
    below(a.min(), b.max()) && below(b.min(), a.max())
}

/// Where an area light is.
#[derive(Debug)]
pub(crate) enum Site {
    /// It has no triangle, or none with finite vertices.
    Nowhere,
    /// More than [`MOST_NEAR`] triangles are near.
    Crowded,
    /// Its box and the triangles that are near.
    Found { light: VoxelBox, near: Vec<Triangle> },
}

/// The neighbourhood of one area light; see the head of its source file.
#[derive(Debug)]
pub struct AreaNeighbourhood {
    light: VoxelBox,
    far: Far,
    near: Bvh,
}

/// From where all of the light's box is seen past the far occluders.
#[derive(Debug)]
enum Far {
    Cuboids(ExtendedNeighbourhood),
    Hops(HopNeighbourhood),
}

impl AreaNeighbourhood {
    /// The neighbourhood of the light in the box `light`, of which `near` are the near triangles; by `hops` or by cuboids only.
    pub(crate) fn build(
        occluders: &Occluders<'_>,
        light: VoxelBox,
        near: &[Triangle],
        hops: bool,
    ) -> Result<Self, VoxelError> {
        let occupied = occluders.far_voxels(light, near)?;
        let far = match hops {
            true => Far::Hops(HopNeighbourhood::new(&occupied, light)),
            false => Far::Cuboids(ExtendedNeighbourhood::new(&occupied, light)),
        };
        Ok(Self { light, far, near: Bvh::new(near) })
    }

    /// True if no occluder meets the closed segment `from`–`to`. False says nothing.
    #[inline]
    #[must_use]
    pub fn proves(&self, grid: &VoxelGrid, from: DVec3, to: DVec3) -> bool {
        let (Some(a), Some(b)) = (grid.voxel_containing(from), grid.voxel_containing(to)) else { return false };
        let far = match &self.far {
            Far::Cuboids(n) => n.proves(a),
            Far::Hops(n) => n.proves(a),
        };
        far && self.light.contains(b) && !self.near.occluded(&Segment::new(from, to))
    }

    /// The number of voxels from which all of the light's box is seen past the far occluders.
    #[must_use]
    pub fn count(&self) -> usize {
        match &self.far {
            Far::Cuboids(n) => n.count(),
            Far::Hops(n) => n.count(),
        }
    }

    /// The memory of the neighbourhood in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let far = match &self.far {
            Far::Cuboids(n) => n.bytes(),
            Far::Hops(n) => n.bytes(),
        };
        far + self.near.bytes()
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, dvec3, vec3};

    use super::*;

    fn quad([a, b, c, d]: [Vec3; 4]) -> [Triangle; 2] {
        [Triangle::new(a, b, c), Triangle::new(a, c, d)]
    }

    /// A horizontal square, facing down.
    fn square(centre: Vec3, half: f32) -> [Triangle; 2] {
        let v = |x: f32, z: f32| centre + vec3(x * half, 0.0, z * half);
        quad([v(-1.0, -1.0), v(1.0, -1.0), v(1.0, 1.0), v(-1.0, 1.0)])
    }

    /// A light just under a ceiling, a table, and a lamp of `many` triangles at one side.
    fn room(many: usize) -> (Vec<Triangle>, [Triangle; 2]) {
        let light = square(vec3(5.0, 9.999, 5.0), 1.0);
        let mut triangles = [square(vec3(5.0, 10.0, 5.0), 5.0), light, square(vec3(4.5, 4.0, 5.0), 1.5)].concat();
        let needle = |i: usize| vec3(5.9 + i as f32 * 1e-3, 9.95, 5.0);
        triangles.extend((0..many).map(|i| Triangle::new(needle(i), needle(i + 1), needle(i) - Vec3::Y)));
        (triangles, light)
    }

    fn grid(size: f64) -> VoxelGrid {
        VoxelGrid::covering(DVec3::ZERO, DVec3::splat(10.0), size, 1 << 24).unwrap()
    }

    fn voxels(grid: &VoxelGrid, triangles: &[Triangle]) -> VoxelSet {
        voxelize(grid, triangles.par_iter().map(|t| t.vertices)).unwrap()
    }

    /// What a build makes of a light.
    fn build(grid: &VoxelGrid, triangles: &[Triangle], light: &[Triangle], hops: bool) -> Option<AreaNeighbourhood> {
        let occupied = voxels(grid, triangles);
        let occluders = Occluders::new(grid, triangles, &occupied).unwrap();
        match occluders.site(light) {
            Site::Found { light, near } => Some(AreaNeighbourhood::build(&occluders, light, &near, hops).unwrap()),
            Site::Nowhere | Site::Crowded => None,
        }
    }

    #[test]
    fn a_proof_is_about_all_occluders() {
        let mut counts = vec![];
        for (size, many, hops) in [
            (0.3, 10, false),
            (0.7, 0, false),
            (1.0, 10, false),
            (0.05, 3, false),
            (0.3, 10, true),
            (0.7, 0, true),
            (1.0, 10, true),
        ] {
            let (triangles, light) = room(many);
            let (grid, bvh) = (grid(size), Bvh::new(&triangles));
            let n = build(&grid, &triangles, &light, hops).unwrap();
            counts.push(n.count());
            let (mut proved, mut free) = (0, 0);
            for i in 0..40_000_u32 {
                let mut s = fastrand::Rng::with_seed(u64::from(i));
                let mut unit = || s.f64();
                let from = dvec3(unit(), unit(), unit()) * 10.0;
                // On the light, lifted off it as sampled points are, behind it, and at its very edge.
                let x = if i % 5 == 0 { 1.0 } else { unit() };
                let lift = [1e-9, 1e-9, 0.0, -1e-9, 1e-3][i as usize % 5];
                let mut to = dvec3(4.0 + 2.0 * x, f64::from(9.999_f32) - lift, 4.0 + 2.0 * unit());
                if i % 7 == 0 {
                    // No point of the light: what is free towards its box may be occluded here.
                    to = dvec3(unit(), unit(), unit()) * 10.0;
                }
                let occluded = bvh.occluded(&Segment::new(from, to));
                free += u32::from(!occluded);
                if n.proves(&grid, from, to) {
                    proved += 1;
                    assert!(!occluded, "{from} {to}, voxel {size}");
                }
            }
            assert!(proved * 4 > free, "voxel {size}: {proved} of {free}");
        }
        assert!(counts[0] < counts[4] && counts[1] < counts[5], "hops prove more: {counts:?}");
    }

    #[test]
    fn none_is_built_where_much_is_near() {
        let (triangles, light) = room(200);
        assert!(build(&grid(0.3), &triangles, &light, false).is_none());
        assert!(build(&grid(0.3), &triangles, &[], false).is_none());
    }

    /// The voxels of the far occluders are those of a voxelization of the far ones alone, the slow twin, wherever the
    /// light is.
    #[test]
    fn far_voxels_equal_those_of_the_far_occluders() {
        let mut put_back = 0;
        for seed in 0..300 {
            let mut s = fastrand::Rng::with_seed(seed);
            let mut point = |reach: f32| vec3(s.f32(), s.f32(), s.f32()) * reach;
            let mut triangles: Vec<_> = (0..700)
                .map(|n| {
                    // Small ones, and some across the room.
                    let (at, size) = (point(10.0), if n % 100 == 7 { 10.0 } else { 0.6 });
                    Triangle::new(at, at + point(size), at + point(size))
                })
                .collect();
            let quad = square(point(9.0), 0.4);
            triangles.extend(quad);
            let max = Bounds::of_triangles(&triangles).max;
            let grid = VoxelGrid::covering(DVec3::ZERO, max, [0.3, 0.5, 1.0][seed as usize % 3], 1 << 24).unwrap();
            let occupied = voxels(&grid, &triangles);
            let occluders = Occluders::new(&grid, &triangles, &occupied).unwrap();
            let Site::Found { light, near } = occluders.site(&quad) else { continue };
            assert!(near.len() >= 2, "the light itself is near");
            let close = occluders.close_to(light);
            let far: Vec<_> = triangles.iter().filter(|t| !is_near(t, &close)).copied().collect();
            assert_eq!(far.len() + near.len(), triangles.len());
            let expected = voxels(&grid, &far);
            assert!(occluders.far_voxels(light, &near).unwrap() == expected, "seed {seed}");
            let near = voxels(&grid, &near);
            put_back += near.iter().filter(|&v| expected.contains(v)).count();
        }
        assert!(put_back > 1000, "the test is about voxels that near and far occluders share: {put_back}");
    }

    /// A light on the upper face of the grid, where rounding decides whether the grid's corner is in the grid.
    #[test]
    fn proofs_do_not_depend_on_the_place() {
        for voxels in 20..40_u32 {
            let size = 10.0 / f64::from(voxels) * (1.0 + 1e-9);
            let count = |offset: f32| {
                let moved = |t: Triangle| Triangle { vertices: t.vertices.map(|v| v + offset) };
                let light = square(vec3(5.1875, 10.0, 5.1875), 1.0).map(moved);
                let table = square(vec3(4.5625, 4.1875, 4.5625), 1.5).map(moved);
                let corner = DVec3::splat(offset.into());
                let grid = VoxelGrid::covering(corner, corner + 10.0, size, 1 << 24).unwrap();
                build(&grid, &[light, table].concat(), &light, false).map(|n| n.count())
            };
            let expected = count(0.0);
            assert!(expected > Some(0));
            for offset in [1e5, -1e5, 7e5, 9e5, 1e6] {
                assert_eq!(count(offset), expected, "{voxels} voxels at {offset}");
            }
        }
    }
}
