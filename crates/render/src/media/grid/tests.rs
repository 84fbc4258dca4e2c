//! Against slow obvious twins: fine steps through [`GridVolume::at`], a walk that skips nothing, and inversion there and back.

use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3, dvec3};
use vdf_geometry::Segment;
use vdf_scene::{GridVolume, VolumeFilter, VoxelGrid, Wrap};

use super::{Grid, bricks::Bricks};
use crate::Sampler;

const WRAPS: [Wrap; 3] = [Wrap::Clamp, Wrap::Repeat, Wrap::Mirror];
const FILTERS: [VolumeFilter; 2] = [VolumeFilter::Trilinear, VolumeFilter::Nearest];

fn volume(size: [u32; 3], values: Vec<f32>, filter: VolumeFilter, wrap: Wrap, world_from_grid: DMat4) -> GridVolume {
    let grid = VoxelGrid::new(size, 1, values, [Vec3::ZERO, Vec3::ONE]).expect("a grid");
    GridVolume { grid: Arc::new(grid), filter, wrap, grid_from_world: world_from_grid.inverse() }
}

fn depth_of(grid: &Grid, s: &Segment, part: [f64; 2], length: f64) -> f64 {
    grid.optical_depth::<1>(s, part, length)[0]
}

fn distance_of(grid: &Grid, s: &Segment, part: [f64; 2], length: f64, tau: f64) -> Result<f64, f64> {
    grid.distance::<1>(s, part, length, tau, 0).map(|reached| reached.t).map_err(|[depth]| depth)
}

/// Values of several kinds: all, few, one and none positive.
fn values(size: [u32; 3], kind: u32, u: &mut Sampler) -> Vec<f32> {
    let n = size.iter().product::<u32>() as usize;
    let one = (u.next_1d() * n as f64) as usize;
    (0..n)
        .map(|i| match kind {
            0 => u.next_1d() as f32,
            1 if u.next_1d() < 0.003 => 3.0,
            2 if i == one => 1.0,
            4 => 0.75,
            _ => 0.0,
        })
        .collect()
}

fn placements(u: &mut Sampler) -> [DMat4; 6] {
    let axis = (dvec3(u.next_1d(), u.next_1d(), u.next_1d()) - 0.5).normalize_or(DVec3::X);
    let turned = DMat4::from_axis_angle(axis, 6.0 * u.next_1d());
    let sheared =
        DMat4::from_cols_array(&[2.0, 0.1, 0.0, 0.0, 0.7, 1.0, 0.2, 0.0, 0.0, -0.4, 0.5, 0.0, 1.0, 2.0, 3.0, 1.0]);
    [
        DMat4::IDENTITY,
        DMat4::from_translation(dvec3(-3.0, 7.0, 0.5)) * DMat4::from_scale(dvec3(2.0, 30.0, 0.1)),
        DMat4::from_scale(dvec3(-1.0, 1.0, -2.0)),
        DMat4::from_rotation_z(std::f64::consts::FRAC_PI_2),
        turned,
        sheared,
    ]
}

/// A segment in the grid's space, of those where rounding could matter more than by chance: along faces and edges of cells, through corners, an ulp beside them, along an axis
/// with zeros of either sign, from and to inside, outside and far away.
fn segment(size: [u32; 3], i: u32, u: &mut Sampler) -> Segment {
    let mut place = |far: bool| {
        let mut p = DVec3::ZERO;
        for (k, n) in size.into_iter().map(f64::from).enumerate() {
            let lattice = ((u.next_1d() * (2.0 * n + 1.0)).floor() - 0.0) * 0.5 / n;
            p[k] = match (u.next_1d() * 8.0) as u32 {
                0 => lattice,
                1 => lattice.next_up(),
                2 => lattice.next_down(),
                3 => [0.0, -0.0, 1.0, 0.5][(u.next_1d() * 4.0) as usize],
                4 if far => (u.next_1d() - 0.5) * 1e4,
                _ => u.next_1d() * 3.0 - 1.0,
            };
        }
        p
    };
    let (p, mut q) = (place(i % 3 == 0), place(i % 5 == 0));
    match i % 7 {
        0 => q = q.with_x(p.x),
        1 => q = dvec3(p.x, p.y, q.z),
        2 => q = dvec3(q.x, p.y, p.z),
        3 => q = p + (q - p) * 1e-7,
        // Through corners.
        4 => q = p + DVec3::from_array(size.map(|n| 3.0 / f64::from(n))) * if i % 2 == 0 { 1.0 } else { -1.0 },
        _ => {}
    }
    Segment::new(p, q)
}

const SIZES: [[u32; 3]; 7] = [[1, 1, 1], [1, 1, 37], [5, 1, 1], [2, 3, 4], [17, 9, 8], [30, 41, 26], [64, 3, 33]];

/// Runs `check` on grids of all sizes, kinds, places, filters and wraps with so many segments each.
fn for_all(segments: u32, mut check: impl FnMut(&GridVolume, &Segment, [f64; 2], &mut Sampler)) {
    let mut case = 0;
    for size in SIZES {
        for kind in 0..5 {
            for placement in 0..6 {
                case += 1;
                let mut u = Sampler::new(11, case, 0, 0);
                let world_from_grid = placements(&mut u)[placement];
                let (filter, wrap) = (FILTERS[case as usize % 2], WRAPS[case as usize / 2 % 3]);
                let volume = volume(size, values(size, kind, &mut u), filter, wrap, world_from_grid);
                for i in 0..segments {
                    let mut u = Sampler::new(11, case, i, 1);
                    let s = segment(size, i, &mut u);
                    let [p, q] = [s.p, s.q].map(|p| world_from_grid.transform_point3(p));
                    let (a, b) = (u.next_1d(), u.next_1d());
                    let part = if i % 4 == 0 { [a.min(b), a.max(b)] } else { [0.0, 1.0] };
                    check(&volume, &Segment::new(p, q), part, &mut u);
                }
            }
        }
    }
}

/// True if the segment lies in a plane between values of a grid that has the nearest: there rounding decides which that is.
fn is_between_values(volume: &GridVolume, s: &Segment) -> bool {
    let size = DVec3::from_array(volume.grid.size().map(f64::from));
    let [p, q] = [s.p, s.q].map(|p| volume.grid_from_world.transform_point3(p) * size);
    let between = |k: usize| (p[k] - p[k].round()).abs() < 1e-5 && (p[k] - q[k]).abs() < 1e-5;
    volume.filter == VolumeFilter::Nearest && (0..3).any(between)
}

/// The depth of the ends of a part, by a walk that skips nothing, which takes the same grid without bricks.
#[test]
fn skipping_changes_no_bit() {
    let mut skipped = 0;
    let mut grids: Option<(GridVolume, Grid, Grid)> = None;
    for_all(150, |volume, segment, part, u| {
        if grids.as_ref().is_none_or(|(of, ..)| of != volume) {
            let (with, mut without) = (Grid::new(volume, 2.5), Grid::new(volume, 2.5));
            without.bricks = Bricks::none();
            grids = Some((volume.clone(), with, without));
        }
        let (_, with, without) = grids.as_ref().expect("made");
        let length = segment.length();
        let depth = depth_of(without, segment, part, length);
        assert_eq!(depth_of(with, segment, part, length), depth, "{segment:?} {part:?}");
        let tau = depth * u.next_1d() * 1.1;
        assert_eq!(
            distance_of(with, segment, part, length, tau),
            distance_of(without, segment, part, length, tau),
            "{segment:?} {part:?} {tau}"
        );
        skipped += u32::from(with.bricks.empty_around([0; 3]).is_some());
    });
    assert!(skipped > 1000, "{skipped}");
}

/// The depth by fine steps. A cubic that is sampled in the middle of n steps errs by its second derivative over 24n², where the values bend by as much in a step.
/// The bound: in each of the cells that are met the value changes by at most the largest value M, so the middle of a step that lies across a face errs by less than that; there are as many such steps
/// as faces, and in all others the error is below M/24 · (cells a step)² · 6. The values of the twin are single precision.
#[test]
fn depths_are_integrals() {
    let (mut positive, mut worst) = (0, 0.0_f64);
    let mut known: Option<(GridVolume, Grid)> = None;
    for_all(12, |volume, segment, part, _| {
        if is_between_values(volume, segment) {
            return;
        }
        if known.as_ref().is_none_or(|(of, _)| of != volume) {
            known = Some((volume.clone(), Grid::new(volume, 2.5)));
        }
        let (_, grid) = known.as_ref().expect("made");
        let length = segment.length();
        let depth = depth_of(grid, segment, part, length);
        // Only the part in the box, so that the steps are where something is.
        let bounds = volume.world_bounds();
        let along = segment.q - segment.p;
        let (mut a, mut b) = (part[0], part[1]);
        for k in 0..3 {
            if along[k] == 0.0 {
                if segment.p[k] < bounds.min[k] || segment.p[k] > bounds.max[k] {
                    b = a;
                }
                continue;
            }
            let t = [bounds.min[k], bounds.max[k]].map(|x| (x - segment.p[k]) / along[k]);
            a = a.max(t[0].min(t[1]));
            b = b.min(t[0].max(t[1]));
        }
        let most = f64::from(volume.grid.max()) * 2.5;
        let local = volume.grid_from_world.transform_vector3(along * (b - a)).abs();
        let cells = (local * DVec3::from_array(volume.grid.size().map(f64::from))).to_array();
        if a >= b || most == 0.0 {
            assert!(depth <= 1e-12 * most * length, "{segment:?} {part:?}: {depth}");
            return;
        }
        let steps = 2000_u32;
        let step = (b - a) / f64::from(steps);
        let sum: f64 =
            (0..steps).map(|i| f64::from(volume.at(segment.at(a + (f64::from(i) + 0.5) * step)).x) * 2.5).sum();
        let faces: f64 = cells.iter().map(|c| c + 2.0).sum();
        let a_step = cells.iter().sum::<f64>() / f64::from(steps);
        let jump = if volume.filter == VolumeFilter::Nearest { 1.0 } else { a_step.min(1.0) };
        let bound = most * ((faces * jump / f64::from(steps)) + 0.25 * a_step * a_step + 1e-6) * (b - a) * length;
        let expected = sum * step * length;
        assert!((depth - expected).abs() <= bound, "{segment:?} {part:?}: {depth}, not {expected} ± {bound}");
        positive += u32::from(depth > 0.0);
        if depth > 1e-3 * most * length {
            worst = worst.max((depth - expected).abs() / depth);
        }
    });
    println!("{positive} depths, {worst:.1e} from fine steps");
    assert!(positive > 200, "{positive}");
}

/// Where a depth is reached the depth is that; it is where it is reached first; and parts add up. In units of the depth of all: rounding of a sum over
/// up to 200 cells and of a cubic through four values, 10⁻¹³ with room.
#[test]
fn distances_invert_depths() {
    let mut known: Option<(GridVolume, Grid)> = None;
    let (mut reached, mut worst) = (0, 0.0_f64);
    for_all(60, |volume, segment, part, u| {
        if is_between_values(volume, segment) {
            return;
        }
        if known.as_ref().is_none_or(|(of, _)| of != volume) {
            known = Some((volume.clone(), Grid::new(volume, 0.7)));
        }
        let (_, grid) = known.as_ref().expect("made");
        let length = segment.length();
        let depth = depth_of(grid, segment, part, length);
        assert!(depth >= 0.0 && depth.is_finite());
        let tau = depth * u.next_1d();
        match distance_of(grid, segment, part, length, tau) {
            Ok(t) => {
                reached += 1;
                assert!((part[0]..=part[1]).contains(&t), "{segment:?} {part:?}: {t}");
                let [before, after] = [[part[0], t], [t, part[1]]].map(|p| depth_of(grid, segment, p, length));
                let most = f64::from(volume.grid.max()) * 0.7 * length;
                // Where it begins is rounded: by as much as the largest coordinate says, beside the length of the segment.
                let rounding = 1e-15 * most * (1.0 + segment.p.abs().max(segment.q.abs()).max_element() / length);
                let bound = 1e-13 * depth + 8.0 * rounding;
                assert!((before - tau).abs() <= bound, "{segment:?} {part:?}: {before}, not {tau} ± {bound}");
                assert!(
                    (before + after - depth).abs() <= bound,
                    "{segment:?} {part:?}: {before} + {after}, not {depth} ± {bound}"
                );
                worst = worst.max((before - tau).abs() / bound);
            }
            Err(all) => assert!(all == depth && tau >= depth, "{segment:?} {part:?}: {tau} of {depth}"),
        }
        assert_eq!(distance_of(grid, segment, part, length, depth * (1.0 + 1e-14)), Err(depth));
    });
    println!("{reached} inverted, {worst:.2} of the bound");
    assert!(reached > 1500, "{reached}");
}

/// The cuts of a ray: in order, the depths those of the walk, the extinction positive only between cuts of different depth.
#[test]
fn cuts_hold_all_that_there_is() {
    let mut known: Option<(GridVolume, Grid)> = None;
    for_all(20, |volume, segment, part, u| {
        if known.as_ref().is_none_or(|(of, _)| of != volume) {
            known = Some((volume.clone(), Grid::new(volume, 0.7)));
        }
        let (_, grid) = known.as_ref().expect("made");
        let length = segment.length();
        let knots = grid.knots(segment, part, length);
        let depth = depth_of(grid, segment, part, length);
        assert_eq!(knots.last().map_or(0.0, |k| k.depth), depth, "{segment:?} {part:?}");
        assert!(knots.windows(2).all(|k| k[0].t <= k[1].t && k[0].depth <= k[1].depth), "{knots:?}");
        assert!(knots.len() <= 8 * super::KNOTS, "{}", knots.len());
        let rounding = 1e-12 * (1.0 + segment.p.abs().max(segment.q.abs()).max_element() / length);
        for pair in knots.windows(2) {
            let t = pair[0].t + (pair[1].t - pair[0].t) * u.next_1d();
            let value = f64::from(volume.at(segment.at(t)).x) * 0.7;
            let there = grid.sigma_t(segment, t);
            if volume.filter == VolumeFilter::Trilinear && volume.wrap == Wrap::Clamp {
                let bound = 1e-6 + rounding * 1e3 * f64::from(volume.grid.max());
                assert!((there - value).abs() <= bound, "{segment:?} {t}: {there}, not {value}");
            }
        }
    });
}

/// Three channels at once have the bits of each by itself; a flight of one channel ends where it does alone, and has the depths of all there.
#[test]
fn channels_are_each_by_itself() {
    let mut case = 0;
    for size in SIZES {
        case += 1;
        let mut u = Sampler::new(23, case, 0, 0);
        let n = size.iter().product::<u32>() as usize;
        let channels: [Vec<f32>; 3] = [0, 1, 0].map(|kind| values(size, kind, &mut u));
        let together = (0..n).flat_map(|i| [0, 1, 2].map(|c| channels[c][i])).collect();
        let grid = VoxelGrid::new(size, 3, together, [Vec3::ZERO, Vec3::ONE]).expect("a grid");
        let mut all =
            volume(size, vec![0.0; n], VolumeFilter::Trilinear, Wrap::Clamp, placements(&mut u)[case as usize % 6]);
        let single = channels.map(|values| {
            let grid = VoxelGrid::new(size, 1, values, [Vec3::ZERO, Vec3::ONE]).expect("a grid");
            Grid::new(&GridVolume { grid: Arc::new(grid), ..all.clone() }, 1.5)
        });
        all.grid = Arc::new(grid);
        let world_from_grid = all.grid_from_world.inverse();
        let all = Grid::new(&all, 1.5);
        for i in 0..200 {
            let s = segment(size, i, &mut u);
            let s = Segment::new(world_from_grid.transform_point3(s.p), world_from_grid.transform_point3(s.q));
            let length = s.length();
            let depths = all.optical_depth::<3>(&s, [0.0, 1.0], length);
            for (c, alone) in single.iter().enumerate() {
                assert_eq!(depths[c], depth_of(alone, &s, [0.0, 1.0], length), "{s:?}");
                let tau = 0.7 * depths[c];
                let Ok(reached) = all.distance::<3>(&s, [0.0, 1.0], length, tau, c) else { continue };
                assert_eq!(Ok(reached.t), distance_of(alone, &s, [0.0, 1.0], length, tau), "{s:?}");
                for (k, alone) in single.iter().enumerate() {
                    let depth = depth_of(alone, &s, [0.0, reached.t], length);
                    let bound = 1e-12 * (1.0 + depths[k]) + 1e-13 * s.p.abs().max(s.q.abs()).max_element();
                    assert!((reached.depth[k] - depth).abs() <= bound, "{s:?}: {} not {depth}", reached.depth[k]);
                }
            }
        }
    }
}

/// Along an axis, in closed form: a ramp of values is a ramp between the first and the last, and even beyond them.
#[test]
fn a_ramp_has_its_closed_form() {
    let ramp = volume([4, 1, 1], vec![0.0, 1.0, 2.0, 3.0], VolumeFilter::Trilinear, Wrap::Clamp, DMat4::IDENTITY);
    let grid = Grid::new(&ramp, 2.0);
    for (p, q) in [(dvec3(-1.0, 0.5, 0.5), dvec3(2.0, 0.5, 0.5)), (dvec3(2.0, 0.1, 0.9), dvec3(-1.0, 0.1, 0.9))] {
        let s = Segment::new(p, q);
        // Half a cell of 0, three of 0.5, 1.5, 2.5 and half a cell of 3, each a quarter long.
        assert!((depth_of(&grid, &s, [0.0, 1.0], s.length()) - 2.0 * (4.5 + 1.5) / 4.0).abs() < 1e-14);
    }
    // From where it is 0 on the depth is 2·4·x²/2.
    let s = Segment::new(dvec3(0.125, 0.5, 0.5), dvec3(0.875, 0.5, 0.5));
    for tau in [1e-9, 0.01, 0.5, 1.7] {
        let t = distance_of(&grid, &s, [0.0, 1.0], 0.75, tau).expect("it is reached") * 0.75;
        assert!((4.0 * t * t / tau - 1.0).abs() < 1e-12, "{tau}: {t}");
    }
    let none = Grid::new(&ramp, 0.0);
    assert_eq!(depth_of(&none, &s, [0.0, 1.0], 0.75), 0.0);
}

/// What is no place, and grids a long way off: nothing panics, hangs, or is NaN.
#[test]
fn odd_segments_have_a_depth() {
    let mut u = Sampler::new(1, 0, 0, 0);
    for offset in [0.0, 1e9, 1e15, 1e300] {
        let place = DMat4::from_translation(DVec3::splat(offset));
        for filter in FILTERS {
            let of = volume([17, 9, 8], values([17, 9, 8], 0, &mut u), filter, Wrap::Clamp, place);
            let grid = Grid::new(&of, 1.0);
            for reach in [1e-300, 1.0, 1e9, 1e300] {
                let p = DVec3::splat(offset) + dvec3(0.4, 0.5, 0.6);
                for direction in [DVec3::X, DVec3::NEG_Y, DVec3::ONE, dvec3(1.0, 1e-320, -0.0), DVec3::ZERO] {
                    let s = Segment::new(p, p + direction * reach);
                    let depth = depth_of(&grid, &s, [0.0, 1.0], s.length());
                    assert!(depth >= 0.0 || !s.length().is_finite(), "{s:?}: {depth}");
                    let _ = distance_of(&grid, &s, [0.0, 1.0], s.length(), 0.5 * depth);
                }
            }
        }
    }
}
