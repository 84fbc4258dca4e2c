//! Building what a method needs: light buffers, voxels, a distance field, a prover for each light; within a limit of memory.
//!
//! Point lights get their buffers first, if the method has any. Voxels are built if a field or a light needs them; they and the field must
//! fit, or nothing is built. Then lights get their neighbourhoods in the order of their list, as long as these fit; the
//! lights that are left ask the field, if there is one. All sizes but those of buffers are known before anything is allocated.

use std::time::Instant;

use rayon::prelude::*;
use vdf_distfield::{ExtendedNeighbourhood, HopNeighbourhood, SafeNeighbourhood, VoxelBox};
use vdf_geometry::{Bounds, Triangle};
use vdf_voxel::{Resolution, Voxel, VoxelError, VoxelGrid, VoxelSet, voxelize};

use crate::{
    AreaNeighbourhood, DistanceField, FieldKind, FieldProver, LightBuffer, LightProver, LightShape, Method,
    PointProver, Progress, Provers, Refusal, VisibilityError,
    prover::{Occluders, Site, each_field},
};

/// What to build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProverOptions {
    /// The method.
    pub method: Method,
    /// Side of a voxel in world units; positive. Of no matter where the method needs no voxels for these lights.
    pub voxel_size: f64,
    /// The largest number of voxels that may be built; `amr` takes 8 bytes for each.
    pub max_voxels: u64,
    /// The most memory in bytes that the voxels, the field and what is kept for lights may take together. Building takes
    /// some more for a while: for each thread that builds the neighbourhood of an area light three bits a voxel, and by hops a byte
    /// for that of any light.
    pub max_bytes: u64,
    /// Texels along each side of a face of a light buffer, rounded up to a power of two of at least 64; `None` chooses.
    pub texels: Option<u32>,
}

impl Default for ProverOptions {
    /// `lb` with voxels of 1 unit where it needs any, at most 2²⁹ of them and 4 GiB.
    fn default() -> Self {
        Self { method: Method::default(), voxel_size: 1.0, max_voxels: 1 << 29, max_bytes: 4 << 30, texels: None }
    }
}

impl ProverOptions {
    /// Texels along each side of a face of a light buffer, for so many occluding triangles and point lights. Where none are asked for there are about as
    /// many in all as triangles, and no more than fit. With more than four lights a buffer is asked less often, and half as many along each side have to do.
    #[must_use]
    pub fn texels_for(&self, triangles: usize, lights: usize) -> u32 {
        let bytes_for_each = self.max_bytes.min(LIGHTS_BYTES) / (lights as u64).max(1);
        self.texels.unwrap_or_else(|| {
            let few = (triangles as f64).sqrt() as u32;
            let one = few.next_power_of_two().clamp(128, 1024);
            let mut side = if lights > 4 { one / 2 } else { one };
            // Lists and records take about as much as texels.
            while side > 64 && LightBuffer::texel_bytes(side) * 2 > bytes_for_each {
                side /= 2;
            }
            side
        })
    }
}

/// What was built, how large it is and how long it took.
#[derive(Clone, Debug, Default)]
pub struct BuildReport {
    /// Voxels along x, y and z; `None` if the method needs none for these lights.
    pub resolution: Option<[u32; 3]>,
    /// Side of a voxel in world units.
    pub voxel_size: f64,
    /// Occupied voxels.
    pub occupied: usize,
    /// All voxels.
    pub voxels: usize,
    /// What was built, in this order.
    pub parts: Vec<BuiltPart>,
    /// For each emitter what its prover keeps.
    pub lights: Vec<LightReport>,
}

/// One step of a build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuiltPart {
    /// What was built: "light buffers", "voxels", "field" or "neighbourhoods".
    pub name: &'static str,
    /// Its memory in bytes.
    pub bytes: usize,
    /// How long it took, in seconds.
    pub seconds: f64,
}

/// What the prover of one light keeps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LightReport {
    /// Voxels of its neighbourhood, if it has one.
    pub voxels: Option<usize>,
    /// Texels along each side of a face of its light buffer, if it has one.
    pub texels: Option<u32>,
    /// Its memory in bytes.
    pub bytes: usize,
    /// How long its light buffer took to build, in seconds, if it has one.
    pub seconds: Option<f64>,
    /// Why it has not what the method would keep for it; `None` if that is not so. A light without a buffer gets a neighbourhood, one without
    /// a neighbourhood asks the field, if there is one.
    pub fallback: Option<&'static str>,
}

impl BuildReport {
    /// `T_build` in seconds (Sec. 2.6 in \[Houska2013\]).
    #[must_use]
    pub fn seconds(&self) -> f64 {
        // An empty sum of floating-point numbers would be −0, which is printed with its sign.
        self.parts.iter().fold(0.0, |sum, p| sum + p.seconds)
    }

    /// The memory of all that was built, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.parts.iter().map(|p| p.bytes).sum()
    }

    /// Lights that have no neighbourhood of their own because those of the lights before them take all memory or time that there is.
    #[must_use]
    pub fn over_budget(&self) -> usize {
        self.lights
            .iter()
            .filter(|light| light.fallback.is_some_and(|why| [TOO_LARGE, TOO_LONG].contains(&why)))
            .count()
    }

    /// Does a step and writes down what it took.
    fn step<T>(
        &mut self,
        name: &'static str,
        work: impl FnOnce() -> Result<T, VisibilityError>,
        bytes: impl FnOnce(&T) -> usize,
    ) -> Result<T, VisibilityError> {
        let start = Instant::now();
        let built = work()?;
        self.parts.push(BuiltPart { name, bytes: bytes(&built), seconds: start.elapsed().as_secs_f64() });
        Ok(built)
    }
}

impl Provers {
    /// Builds what `options.method` needs for the occluders `triangles` and these lights, in a grid that covers
    /// `bounds`, which must hold all occluders. Runs on the current rayon pool. `progress` hears of each step, and in it of light buffers,
    /// planes of the field and neighbourhoods.
    ///
    /// # Errors
    /// If `progress` asks to stop, which is looked at before each of these; if voxels are needed and their size is not usable for these bounds,
    /// or the grid exceeds `options.max_voxels`, or its voxels and field `options.max_bytes`. What is kept for a light and exceeds `max_bytes`, or 1 GiB
    /// together with the others', is no error: see [`LightReport::fallback`].
    pub fn build(
        options: &ProverOptions,
        triangles: &[Triangle],
        bounds: Bounds,
        lights: &[LightShape<'_>],
        progress: &dyn Progress,
    ) -> Result<(Self, BuildReport), VisibilityError> {
        let mut report = BuildReport::default();
        let method = options.method;
        let mut kept: Vec<Kept> = lights.iter().map(|_| Kept::default()).collect();
        let (mut max_bytes, mut lights_bytes) = (options.max_bytes, options.max_bytes.min(LIGHTS_BYTES));
        if method.point_prover() == PointProver::Buffer {
            if !triangles.par_iter().all(Triangle::is_finite) {
                return Err(VoxelError::NonFiniteTriangle.into());
            }
            report.step("light buffers", || build_buffers(options, triangles, lights, &mut kept, progress), |()| 0)?;
            let bytes = kept.iter().map(Kept::bytes).sum();
            report.parts[0].bytes = bytes;
            max_bytes = max_bytes.saturating_sub(bytes as u64);
            lights_bytes = lights_bytes.saturating_sub(bytes as u64);
        }
        let wanting = |(light, kept): (&LightShape<'_>, &Kept)| *light != LightShape::Infinite && kept.prover.is_none();
        let needs_voxels = match method.point_prover() {
            PointProver::Buffer | PointProver::Extended if method.field().is_none() => {
                lights.iter().zip(&kept).any(wanting)
            }
            _ => method.field().is_some(),
        };
        if !needs_voxels {
            return Ok((report.finished(None, None, kept), report));
        }
        let kind = method.field();
        let bytes = |resolution| shared_bytes(kind, resolution);
        let grid = VoxelGrid::covering_within(
            bounds.min,
            bounds.max,
            options.voxel_size,
            options.max_voxels,
            max_bytes,
            bytes,
        )?;
        let free = max_bytes.saturating_sub(bytes(grid.resolution())).min(lights_bytes);
        begin(progress, "voxels", 1)?;
        let occupied = report.step(
            "voxels",
            || Ok(voxelize(&grid, triangles.par_iter().map(|t| t.vertices))?),
            VoxelSet::bytes,
        )?;
        let r = grid.resolution();
        report.resolution = Some(r.sides());
        report.voxel_size = options.voxel_size;
        (report.occupied, report.voxels) = (occupied.count(), r.voxel_count());
        let field = match kind {
            Some(kind) => {
                begin(progress, "distance field", DistanceField::planes(kind))?;
                let next = || next(progress).is_ok();
                let build = || DistanceField::build_while(kind, &occupied, &next).ok_or(VisibilityError::Cancelled);
                Some(report.step("field", build, DistanceField::bytes)?)
            }
            None => None,
        };
        let builder = LightBuilder { point: method.point_prover(), grid, occupied: &occupied, field: field.as_ref() };
        let neighbourhoods = || builder.build_wanting(triangles, lights, &mut kept, free, progress);
        report.step("neighbourhoods", neighbourhoods, |&bytes| bytes)?;
        let field = field.map(|field| FieldProver::new(grid, field));
        Ok((report.finished(Some(grid), field, kept), report))
    }
}

impl BuildReport {
    /// The provers of what was built, and the lights' part of this report.
    fn finished(&mut self, grid: Option<VoxelGrid>, field: Option<FieldProver>, kept: Vec<Kept>) -> Provers {
        let lights = kept.into_iter().map(|kept| {
            let prover = kept.prover.unwrap_or(LightProver::Field);
            self.lights.push(LightReport {
                voxels: prover.voxels(),
                texels: prover.texels(),
                bytes: prover.bytes(),
                seconds: kept.seconds,
                fallback: kept.fallback,
            });
            prover
        });
        let lights = lights.collect();
        Provers::new(grid, field, lights)
    }
}

/// A step begins that has so many parts.
fn begin(progress: &dyn Progress, name: &str, parts: u64) -> Result<(), VisibilityError> {
    progress.phase(name);
    progress.work_total(parts);
    if progress.cancelled() { Err(VisibilityError::Cancelled) } else { Ok(()) }
}

/// A part of a step begins, and counts as done: parts are told apart by when they begin.
fn next(progress: &dyn Progress) -> Result<(), VisibilityError> {
    progress.work_done(1);
    if progress.cancelled() { Err(VisibilityError::Cancelled) } else { Ok(()) }
}

/// What is kept for a light so far.
#[derive(Default)]
struct Kept {
    prover: Option<LightProver>,
    /// How long its light buffer took.
    seconds: Option<f64>,
    /// Why it is not what the method would keep.
    fallback: Option<&'static str>,
}

impl Kept {
    fn bytes(&self) -> usize {
        self.prover.as_ref().map_or(0, LightProver::bytes)
    }
}

/// What light buffers and neighbourhoods together may take at most: with more lights each gets too few queries to pay for its own.
const LIGHTS_BYTES: u64 = 1 << 30;

/// Builds the buffers of all point lights, one after the other, each on all threads, as long as they fit.
fn build_buffers(
    options: &ProverOptions,
    triangles: &[Triangle],
    lights: &[LightShape<'_>],
    kept: &mut [Kept],
    progress: &dyn Progress,
) -> Result<(), VisibilityError> {
    let count = lights.iter().filter(|l| matches!(l, LightShape::Point(_))).count();
    begin(progress, "light buffers", count as u64)?;
    let mut free = options.max_bytes.min(LIGHTS_BYTES);
    let mut side = options.texels_for(triangles.len(), count);
    for (light, kept) in lights.iter().zip(kept) {
        let LightShape::Point(position) = light else { continue };
        next(progress)?;
        let start = Instant::now();
        let mut built = LightBuffer::build(triangles, *position, side, free);
        if matches!(built, Err(Refusal::Memory)) && options.texels.is_none() && side > 64 {
            // Those that come after it have no better chance.
            side = 64;
            built = LightBuffer::build(triangles, *position, side, free);
        }
        match built {
            Ok(buffer) => {
                free -= buffer.bytes() as u64;
                kept.seconds = Some(start.elapsed().as_secs_f64());
                kept.prover = Some(LightProver::Buffer(Box::new(buffer)));
            }
            Err(refusal) => kept.fallback = Some(refusal.reason()),
        }
    }
    Ok(())
}

/// The memory of the voxels and of a field over them, in bytes.
fn shared_bytes(kind: Option<FieldKind>, resolution: Resolution) -> u64 {
    let planes = kind.map_or(0, DistanceField::planes);
    (resolution.voxel_count() as u64).saturating_mul(planes).saturating_add(VoxelSet::bytes_of(resolution))
}

/// Neighbourhoods are built as long as they visit no more voxels or rows than this; each takes a few nanoseconds. It is enough for 500 lights in a
/// grid of 128³ voxels with safe neighbourhoods, and for 60,000 with extended ones.
const MOST_VISITS: u64 = 1 << 30;
/// A voxel takes hops as long as so many visits.
const HOP_VISITS: u64 = 32;
const TOO_LARGE: &str = "its neighbourhood does not fit into the limit of memory";
const TOO_LONG: &str = "the neighbourhoods of so many lights would take too long";

/// What the hierarchy of an area light's near triangles takes at most, in bytes.
const NEAR_BYTES: u64 = 32 << 10;

/// What is to be built for a light.
enum Plan {
    /// The field answers, for a reason if a neighbourhood could be expected.
    Field(Option<&'static str>),
    /// A neighbourhood of a point light's voxel.
    Point(Voxel),
    /// A neighbourhood of an area light's box, with the triangles that are near.
    Area(VoxelBox, Vec<Triangle>),
}

/// Chooses and builds the prover of each light.
struct LightBuilder<'a> {
    point: PointProver,
    grid: VoxelGrid,
    occupied: &'a VoxelSet,
    field: Option<&'a DistanceField>,
}

impl LightBuilder<'_> {
    /// Builds neighbourhoods for the lights that have nothing yet, in parallel over lights: how many bytes they take.
    fn build_wanting(
        &self,
        triangles: &[Triangle],
        lights: &[LightShape<'_>],
        kept: &mut [Kept],
        free: u64,
        progress: &dyn Progress,
    ) -> Result<usize, VisibilityError> {
        let any_area = self.point != PointProver::Field && lights.iter().any(|l| matches!(l, LightShape::Area(_)));
        let occluders = Occluders::new(&self.grid, if any_area { triangles } else { &[] }, self.occupied)?;
        let mut wanting: Vec<_> = lights.iter().zip(kept).filter(|(_, kept)| kept.prover.is_none()).collect();
        let mut plans: Vec<_> = wanting.par_iter().map(|(light, _)| self.plan(&occluders, light)).collect();
        self.cut_to_budget(&mut plans, free);
        begin(progress, "neighbourhoods", plans.len() as u64)?;
        let build = |plan| {
            next(progress)?;
            Ok::<_, VisibilityError>(self.build(&occluders, plan)?)
        };
        let built: Vec<_> = plans.into_par_iter().map(build).collect::<Result<_, _>>()?;
        let mut bytes = 0;
        for ((_, kept), (prover, fallback)) in wanting.iter_mut().zip(built) {
            bytes += prover.bytes();
            kept.prover = Some(prover);
            // The first reason is the one that names the method's own structure.
            kept.fallback = kept.fallback.or(fallback);
        }
        Ok(bytes)
    }

    fn plan(&self, occluders: &Occluders<'_>, light: &LightShape<'_>) -> Plan {
        match light {
            _ if self.point == PointProver::Field => Plan::Field(None),
            LightShape::Infinite => Plan::Field(None),
            LightShape::Point(position) => self
                .grid
                .voxel_containing(*position)
                .map_or(Plan::Field(Some("it is outside the grid of voxels")), Plan::Point),
            LightShape::Area(light) => match occluders.site(light) {
                Site::Nowhere => Plan::Field(Some("it has no triangles")),
                Site::Crowded => Plan::Field(Some("too many triangles are near it")),
                Site::Found { light, near } => Plan::Area(light, near),
            },
        }
    }

    /// The first lights have what they want, as long as memory and time allow.
    fn cut_to_budget(&self, plans: &mut [Plan], mut free: u64) {
        let mut visits = MOST_VISITS;
        for plan in plans {
            match (free.checked_sub(self.bytes(plan)), visits.checked_sub(self.visits(plan))) {
                (Some(rest), Some(left)) => (free, visits) = (rest, left),
                (None, _) => *plan = Plan::Field(Some(TOO_LARGE)),
                (_, None) => *plan = Plan::Field(Some(TOO_LONG)),
            }
        }
    }

    /// The voxels or rows that are visited to build what is planned.
    fn visits(&self, plan: &Plan) -> u64 {
        let r = self.grid.resolution();
        match (plan, self.point) {
            (Plan::Field(_), _) => 0,
            (Plan::Point(_), PointProver::Safe) => r.voxel_count() as u64,
            (_, PointProver::Hop) => HOP_VISITS.saturating_mul(r.voxel_count() as u64),
            _ => u64::from(r.y()) * u64::from(r.z()),
        }
    }

    /// The memory of what is planned, in bytes, at most.
    fn bytes(&self, plan: &Plan) -> u64 {
        let resolution = self.grid.resolution();
        let extended = ExtendedNeighbourhood::bytes_of(resolution);
        match (plan, self.point) {
            (Plan::Field(_), _) | (Plan::Point(_), PointProver::Field) => 0,
            (Plan::Point(_), PointProver::Safe) => VoxelSet::bytes_of(resolution),
            (Plan::Point(_), PointProver::Hop) => HopNeighbourhood::bytes_of(resolution),
            (Plan::Area(..), PointProver::Hop) => HopNeighbourhood::bytes_of(resolution).saturating_add(NEAR_BYTES),
            (Plan::Point(_), PointProver::Extended | PointProver::Buffer) => extended,
            (Plan::Area(..), _) => extended.saturating_add(NEAR_BYTES),
        }
    }

    fn build(&self, occluders: &Occluders<'_>, plan: Plan) -> Result<(LightProver, Option<&'static str>), VoxelError> {
        Ok(match plan {
            Plan::Field(fallback) => (LightProver::Field, fallback),
            Plan::Point(voxel) => (self.point_prover(voxel), None),
            Plan::Area(light, near) => {
                let hops = self.point == PointProver::Hop;
                (LightProver::Area(AreaNeighbourhood::build(occluders, light, &near, hops)?), None)
            }
        })
    }

    fn point_prover(&self, light: Voxel) -> LightProver {
        match (self.point, self.field) {
            (PointProver::Safe, Some(field)) => {
                LightProver::Safe(each_field!(field, field => SafeNeighbourhood::new(field, self.occupied, light)))
            }
            (PointProver::Hop, _) => LightProver::Hop(HopNeighbourhood::new(self.occupied, light.into())),
            (PointProver::Extended | PointProver::Buffer, _) => {
                LightProver::Extended(ExtendedNeighbourhood::new(self.occupied, light.into()))
            }
            (PointProver::Field, _) | (PointProver::Safe, None) => LightProver::Field,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::Quiet;

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
        ProverOptions {
            method: method.parse().expect("a method"),
            voxel_size: 0.1,
            max_bytes,
            ..ProverOptions::default()
        }
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
        let crowded =
            Provers::build(&options("amr-xsn", 1 << 30), &many, bounds, &[LightShape::Area(&many[..1])], &Quiet);
        assert_eq!(crowded.expect("fits").1.lights[0].fallback, Some("too many triangles are near it"));
        let plain = build(options("amr", 1 << 30), &[outside, LightShape::Area(&WALL)]).expect("fits");
        assert!(plain.lights.iter().all(|l| l.fallback.is_none()), "the method keeps nothing for any light");
    }
}
