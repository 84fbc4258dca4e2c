//! Proofs towards an area light, which is an occluder itself.
//!
//! *Idea.* A query to a sampled point on an area light is superficial: one end lies on an occluder, in an occupied voxel, and no field
//! proves anything there. But the light's own triangles, and what lies so close to it that it shares its voxels (a ceiling), are few.
//! They are tested exactly; all other occluders are proved away by the neighbourhood of the light's voxel box (4.4.1 in \[Houska2013\]).
//!
//! *Definition.* The light's box holds the voxels of its triangles' bounds, widened by a thousandth of a voxel. An occluder is *near* if
//! its bounds come within a thousandth of a voxel of that box, else *far*. A segment from voxel U to a point in the box is proved
//! unoccluded if the cuboid of U and the box is free of far occluders, and the segment meets no near one.
//!
//! *Guarantee.* Both ends lie in the cuboid, so the segment does, and no far occluder meets it; that no near one does is tested exactly.
//! So the claim is about *all* occluders, the light's own among them: exactly what the hierarchy answers.
//!
//! *Cost.* One voxelization of the far occluders and one sweep a light; a query takes two voxels, one row, and mostly one comparison of
//! boxes: a flat light in front of a flat ceiling is disjoint from all segments that end before it.
//!
//! *Limits.* None is built if more than [`MOST_NEAR`] triangles are near: then the exact test costs what it would save.
//! *Deviation from the thesis:* it does not say what becomes of the light's own triangles, nor of others in its voxels.

use glam::DVec3;
use rayon::prelude::*;
use vdf_distfield::{ExtendedNeighbourhood, Neighbourhood as _, VoxelBox};
use vdf_geometry::{Bounds, Bvh, Segment, Triangle};
use vdf_voxel::{Voxel, VoxelError, VoxelGrid, voxelize};

/// The largest number of near triangles.
const MOST_NEAR: usize = 64;

/// By how much the light is widened to its box, and how far from the box an occluder has to be to be far, in voxels. More than the lift of
/// sampled points and than the dilation of occupied voxels; were it less, proofs would be lost but none would be wrong.
const MARGIN: f64 = 1e-3;

/// The neighbourhood of one area light; see the head of its source file.
#[derive(Debug)]
pub struct AreaNeighbourhood {
    light: VoxelBox,
    far: ExtendedNeighbourhood,
    near: Bvh,
}

impl AreaNeighbourhood {
    /// The neighbourhood of the light made of the triangles `light`, which are some of the occluders `triangles`. `None` if too many
    /// triangles are near.
    ///
    /// # Errors
    /// If a vertex is not finite.
    pub fn build(grid: &VoxelGrid, triangles: &[Triangle], light: &[Triangle]) -> Result<Option<Self>, VoxelError> {
        let margin = MARGIN * grid.voxel_size();
        let resolution = grid.resolution();
        let greatest = grid.corner(Voxel::new(resolution.x(), resolution.y(), resolution.z()));
        let corner = |point: DVec3| grid.voxel_containing(point.clamp(grid.origin(), greatest));
        let Bounds { min, max } = Bounds::of_triangles(light);
        let (Some(first), Some(last)) = (corner(min - margin), corner(max + margin)) else { return Ok(None) };
        let light = VoxelBox::spanning(first, last);
        let (low, high) = (grid.corner(light.min()) - margin, grid.corner(light.max()) + (grid.voxel_size() + margin));
        let close = Bounds::new(low, high);
        let is_near = |t: &Triangle| Bounds::of_triangles([t]).touches(&close);
        let near: Vec<Triangle> = triangles.iter().copied().filter(is_near).take(MOST_NEAR + 1).collect();
        if near.len() > MOST_NEAR {
            return Ok(None);
        }
        let far = triangles.par_iter().filter(|t| !is_near(t)).map(|t| t.vertices);
        Ok(Some(Self { light, far: ExtendedNeighbourhood::new(&voxelize(grid, far)?, light), near: Bvh::new(&near) }))
    }

    /// True if no occluder meets the closed segment `from`–`to`. False says nothing.
    #[inline]
    #[must_use]
    pub fn proves(&self, grid: &VoxelGrid, from: DVec3, to: DVec3) -> bool {
        let (Some(a), Some(b)) = (grid.voxel_containing(from), grid.voxel_containing(to)) else { return false };
        self.far.proves(a) && self.light.contains(b) && !self.near.occluded(&Segment::new(from, to))
    }

    /// The number of voxels from which the light's box is free of far occluders.
    #[must_use]
    pub fn count(&self) -> usize {
        self.far.count()
    }

    /// The memory of the neighbourhood in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.far.bytes()
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

    #[test]
    fn a_proof_is_about_all_occluders() {
        for (size, many) in [(0.3, 10), (0.7, 0), (1.0, 10), (0.05, 3)] {
            let (triangles, light) = room(many);
            let (grid, bvh) = (grid(size), Bvh::new(&triangles));
            let n = AreaNeighbourhood::build(&grid, &triangles, &light).unwrap().unwrap();
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
    }

    #[test]
    fn none_is_built_where_much_is_near() {
        let (triangles, light) = room(200);
        assert!(AreaNeighbourhood::build(&grid(0.3), &triangles, &light).unwrap().is_none());
        assert!(AreaNeighbourhood::build(&grid(0.3), &triangles, &[]).unwrap().is_none());
    }
}
