//! What builds take, tell and refuse.

use glam::{DVec3, Vec3};

use super::{
    neighbourhoods::{NEAR_BYTES, Plan, TOO_LONG},
    *,
};
use crate::{Method, Quiet};
use vdf_voxel::Voxel;

#[test]
fn nothing_takes_no_time() {
    assert_eq!(format!("{:.1}", BuildReport::default().seconds()), "0.0");
}

/// A wall in a box of 10 units.
const WALL: [Triangle; 1] =
    [Triangle::new(Vec3::new(5.0, 1.0, 1.0), Vec3::new(5.0, 9.0, 1.0), Vec3::new(5.0, 1.0, 9.0))];

fn build(options: ProverOptions, lights: &[LightShape<'_>]) -> Result<BuildReport, VisibilityError> {
    let bounds = Bounds::new(DVec3::ZERO, DVec3::splat(10.0));
    Provers::build(&options, &WALL, bounds, lights, &Quiet).map(|(_, report)| report)
}

fn options(method: &str, max_bytes: u64) -> ProverOptions {
    ProverOptions { method: method.parse().expect("a method"), voxel_size: 0.1, max_bytes, ..ProverOptions::default() }
}

/// Counts what is done in each phase, and asks to stop at some point.
struct Steps {
    told: std::sync::Mutex<Vec<(String, u64, u64)>>,
    left: std::sync::atomic::AtomicUsize,
}

impl Progress for Steps {
    fn phase(&self, name: &str) {
        self.told.lock().expect("no panic").push((name.to_owned(), 0, 0));
    }
    fn work_total(&self, n: u64) {
        self.told.lock().expect("no panic").last_mut().expect("a phase").1 = n;
    }
    fn work_done(&self, n: u64) {
        self.told.lock().expect("no panic").last_mut().expect("a phase").2 += n;
    }
    fn cancelled(&self) -> bool {
        use std::sync::atomic::Ordering::SeqCst;
        self.left.fetch_update(SeqCst, SeqCst, |left| left.checked_sub(1)).is_err()
    }
}

#[test]
fn all_that_is_built_is_told_and_can_be_stopped() {
    let lights = [LightShape::Point(DVec3::splat(2.0)), LightShape::Area(&WALL), LightShape::Infinite];
    let bounds = Bounds::new(DVec3::ZERO, DVec3::splat(10.0));
    for (method, expected) in [
        ("ndf", "voxels 1, distance field 1, neighbourhoods 3"),
        ("amr-hop", "voxels 1, distance field 8, neighbourhoods 3"),
        ("dsz-sn", "voxels 1, distance field 6, neighbourhoods 3"),
        ("dual-xsn", "voxels 1, distance field 7, neighbourhoods 3"),
        ("lb", "light buffers 1, voxels 1, neighbourhoods 2"),
    ] {
        let run = |looks: usize| {
            let steps = Steps { told: std::sync::Mutex::default(), left: looks.into() };
            let options = ProverOptions { voxel_size: 1.0, ..options(method, 1 << 30) };
            let built = Provers::build(&options, &WALL, bounds, &lights, &steps);
            (built.map(|_| ()), steps.told.into_inner().expect("no panic"), steps.left.into_inner())
        };
        let (built, told, left) = run(1000);
        built.expect("nobody asked to stop");
        let names: Vec<_> = told.iter().map(|(name, total, _)| format!("{name} {total}")).collect();
        assert_eq!(names.join(", "), expected);
        assert!(told.iter().all(|(name, total, done)| name == "voxels" || total == done), "{told:?}");
        for looks in 0..1000 - left {
            assert!(matches!(run(looks).0, Err(VisibilityError::Cancelled)), "{method}: {looks}");
        }
    }
}

#[test]
fn memory_is_as_estimated() {
    let lights = [LightShape::Point(DVec3::splat(2.0)), LightShape::Area(&WALL)];
    for method in Method::with_voxels() {
        let report = build(ProverOptions { method, ..options("none", 1 << 30) }, &lights).expect("fits");
        let estimate = shared_bytes(method.field(), Resolution::new(100, 100, 100));
        assert_eq!(estimate, (report.parts[0].bytes + report.parts[1].bytes) as u64, "{method}");
        let bytes = report.lights.iter().map(|l| l.bytes).collect::<Vec<_>>();
        match method.point_prover() {
            PointProver::Field => assert_eq!(bytes, [0, 0]),
            PointProver::Safe => assert_eq!(bytes[0], 8 * 2 * 100 * 100),
            PointProver::Extended | PointProver::Buffer => assert_eq!(bytes[0], 8 * 100 * 100),
            PointProver::Hop => assert_eq!(bytes[0], 8 * 3 * 100 * 100),
        }
        assert!(bytes[1] < bytes[0].max(8 * 100 * 100) + NEAR_BYTES as usize);
    }
}

#[test]
fn a_field_beyond_the_limit_is_an_error_that_names_what_fits() {
    for method in ["ndf", "amr", "dsz-sn", "dual-xsn"] {
        let limit = 700_000;
        let error = build(options(method, limit), &[]).expect_err("a million voxels");
        let VisibilityError::Voxel(VoxelError::TooMuchMemory { bytes, smallest, .. }) = error else {
            panic!("{error}")
        };
        assert!(bytes > 1_000_000, "{bytes}");
        let fits = build(ProverOptions { voxel_size: smallest, ..options(method, limit) }, &[]).expect("fits");
        assert!(fits.bytes() <= limit as usize);
        assert!(build(ProverOptions { voxel_size: smallest * 0.95, ..options(method, limit) }, &[]).is_err());
    }
}

#[test]
fn lights_beyond_the_limit_ask_the_field() {
    let lights: Vec<_> = (0..3_000).map(|n| LightShape::Point(DVec3::splat(0.003 * f64::from(n)))).collect();
    for (method, each) in [("amr-sn", 160_000), ("ndf-xsn", 80_000), ("ndf-hop", 240_000)] {
        let shared = build(options(method, 1 << 30), &[]).expect("fits").bytes() as u64;
        let limit = shared + 10 * each + each / 2;
        let report = build(options(method, limit), &lights).expect("fits");
        assert!(report.bytes() as u64 <= limit);
        let kept = report.lights.iter().filter(|l| l.voxels.is_some()).count();
        assert_eq!(kept, 10);
        for light in &report.lights {
            assert_eq!(light.fallback.is_some(), light.voxels.is_none());
            assert!(light.fallback.is_none_or(|reason| reason.contains("memory")), "{light:?}");
        }
        assert_eq!(report.over_budget(), 3_000 - 10);
    }
}

/// 2³⁰ visits are 1,073 safe neighbourhoods of a million voxels; those of rows take far less.
#[test]
fn lights_that_would_take_too_long_ask_the_field() {
    let grid = VoxelGrid::covering(DVec3::ZERO, DVec3::splat(10.0), 0.1, 1 << 20).expect("a million voxels");
    let occupied = VoxelSet::new(grid.resolution());
    for (point, expected) in [(PointProver::Safe, 1_073), (PointProver::Extended, 5_000), (PointProver::Hop, 33)] {
        let builder = LightBuilder { point, grid, occupied: &occupied, field: None };
        let mut plans: Vec<_> = (0..5_000).map(|_| Plan::Point(Voxel { i: 0, j: 0, k: 0 })).collect();
        builder.cut_to_budget(&mut plans, u64::MAX);
        let built = plans.iter().filter(|plan| matches!(plan, Plan::Point(_))).count();
        assert_eq!(built, expected);
        assert!(plans.iter().skip(built).all(|plan| matches!(plan, Plan::Field(Some(TOO_LONG)))));
    }
}

#[test]
fn a_fallback_says_why() {
    let many: Vec<_> = (0..65).map(|_| WALL[0]).collect();
    let outside = LightShape::Point(DVec3::splat(11.0));
    let report = build(options("amr-xsn", 1 << 30), &[outside, LightShape::Area(&[]), LightShape::Infinite]);
    let reasons = report.expect("fits").lights.iter().map(|l| l.fallback).collect::<Vec<_>>();
    assert_eq!(reasons, [Some("it is outside the grid of voxels"), Some("it has no triangles"), None]);
    let bounds = Bounds::new(DVec3::ZERO, DVec3::splat(10.0));
    let crowded = Provers::build(&options("amr-xsn", 1 << 30), &many, bounds, &[LightShape::Area(&many[..1])], &Quiet);
    assert_eq!(crowded.expect("fits").1.lights[0].fallback, Some("too many triangles are near it"));
    let plain = build(options("amr", 1 << 30), &[outside, LightShape::Area(&WALL)]).expect("fits");
    assert!(plain.lights.iter().all(|l| l.fallback.is_none()), "the method keeps nothing for any light");
}
