//! A proof is never wrong: segments of all kinds, and hard ones above all, against a loop over all triangles.
//!
//! `VDF_SEGMENTS=10000000 cargo test --release --test soundness -- --nocapture` is the long run (segments per scene); CI runs a small one.
//! With 0 wrong among n proofs, the chance of a wrong one is below 3/n with 95 % confidence (rule of three).

mod common;

use common::all_methods;
use glam::{DVec3, dvec3};
use rayon::prelude::*;
use vdf::{
    render::{
        Acceleration, Answer, Proofs, ProofsVisitor, Sampler, Triangle, World,
        geometry::{Segment, intersect_exact},
        scene::{Emitter, Scene},
    },
    voxel::VoxelGrid,
};

/// Where end points come from.
struct Generator<'a> {
    world: &'a World,
    lights: Vec<DVec3>,
    grid: VoxelGrid,
}

impl Generator<'_> {
    fn uniform(&self, s: &mut Sampler) -> DVec3 {
        let (min, max) = self.world.bounds;
        min + (max - min) * dvec3(s.next_1d(), s.next_1d(), s.next_1d())
    }

    fn pick(s: &mut Sampler, n: usize) -> usize {
        ((s.next_1d() * n as f64) as usize).min(n - 1)
    }

    fn triangle(&self, s: &mut Sampler) -> &Triangle {
        &self.world.triangles[Self::pick(s, self.world.triangles.len())]
    }

    /// Up to two ulps of each coordinate, and now and then a zero of either sign.
    fn nudged(s: &mut Sampler, p: DVec3) -> DVec3 {
        let nudge = |s: &mut Sampler, x: f64| match Self::pick(s, 7) {
            0 => x.next_up(),
            1 => x.next_down(),
            2 => x.next_up().next_up(),
            3 if x.abs() < 1e-9 => -0.0,
            _ => x,
        };
        dvec3(nudge(s, p.x), nudge(s, p.y), nudge(s, p.z))
    }

    /// A voxel's corner, or a point on one of its edges or faces.
    fn lattice(&self, s: &mut Sampler) -> DVec3 {
        let size = self.grid.voxel_size();
        let p = (self.uniform(s) - self.grid.origin()) / size;
        let snap = |s: &mut Sampler, x: f64| if Self::pick(s, 3) > 0 { x.round() } else { x };
        let p = dvec3(snap(s, p.x), snap(s, p.y), snap(s, p.z));
        Self::nudged(s, self.grid.origin() + p * size)
    }

    /// A vertex, a point on an edge or in the face of a triangle, on it or close to it.
    fn near_surface(&self, s: &mut Sampler) -> DVec3 {
        let t = self.triangle(s);
        let [a, b, c] = t.vertices_f64();
        let (mut v, mut w) = (s.next_1d(), s.next_1d());
        match Self::pick(s, 3) {
            0 => (v, w) = (v.round(), 0.0),
            1 => w = 0.0,
            _ => {}
        }
        let p = a + (b - a) * v + (c - a) * (w * (1.0 - v));
        let distance = [0.0, 1e-12, 1e-6, 1e-3, 0.5][Self::pick(s, 5)] * if s.next_1d() < 0.5 { -1.0 } else { 1.0 };
        Self::nudged(s, p + t.area_normal().normalize() * (distance * self.grid.voxel_size()))
    }

    fn outside(&self, s: &mut Sampler) -> DVec3 {
        let (min, max) = self.world.bounds;
        let far = [1.5, 10.0, 1e6][Self::pick(s, 3)];
        (min + max) * 0.5 + (self.uniform(s) - (min + max) * 0.5) * far
    }

    fn point(&self, s: &mut Sampler) -> DVec3 {
        match Self::pick(s, 6) {
            0 | 1 => self.uniform(s),
            2 => self.lattice(s),
            3 => self.near_surface(s),
            4 => self.outside(s),
            _ => self.lights[Self::pick(s, self.lights.len())],
        }
    }

    /// A segment; half of them end in a light, as most queries do.
    fn segment(&self, s: &mut Sampler) -> Segment {
        let p = self.point(s);
        match Self::pick(s, 12) {
            0..6 => Segment::new(p, self.lights[Self::pick(s, self.lights.len())]),
            6 => {
                // Along one axis.
                let mut q = p;
                let axis = Self::pick(s, 3);
                q[axis] = self.uniform(s)[axis];
                Segment::new(p, q)
            }
            // Within about one voxel, also of length zero.
            7 => Segment::new(p, p + (self.uniform(s) - p) * [0.0, 1e-9, 1e-2][Self::pick(s, 3)]),
            // Through a chosen point.
            8 => {
                let q = self.near_surface(s);
                Segment::new(p, p + (q - p) * (1.0 + s.next_1d()))
            }
            _ => Segment::new(p, self.point(s)),
        }
    }
}

fn count() -> u32 {
    std::env::var("VDF_SEGMENTS").ok().and_then(|n| n.parse().ok()).unwrap_or(40_000)
}

/// Asks the method about each segment; returns proofs made and proofs wrong.
struct Check<'a> {
    generator: &'a Generator<'a>,
    emitters: &'a [Emitter],
    segments: u32,
    seed: u64,
}

impl ProofsVisitor for Check<'_> {
    type Output = (u64, u64);

    fn visit<P: Proofs>(self, proofs: &P) -> (u64, u64) {
        check_proofs(proofs, self.generator, self.emitters, self.segments, self.seed)
    }
}

fn check_proofs<P: Proofs>(
    proofs: &P,
    generator: &Generator,
    emitters: &[Emitter],
    segments: u32,
    seed: u64,
) -> (u64, u64) {
    (0..segments)
        .into_par_iter()
        .map(|i| {
            let segment = generator.segment(&mut Sampler::new(seed, i, 0, 0));
            // A neighbourhood may only be asked about segments that end in its light; all others go to the field.
            let light = |e: &Emitter| matches!(e, Emitter::Point { position, .. } if *position == segment.q);
            let Some(emitter) = emitters
                .iter()
                .position(light)
                .or_else(|| emitters.iter().position(|e| matches!(e, Emitter::Constant { .. })))
            else {
                return (0, 0);
            };
            if proofs.answer(emitter, segment.p, segment.q) != Answer::Unoccluded {
                return (0, 0);
            }
            let wrong = generator.world.triangles.iter().any(|t| intersect_exact(&segment, t).is_some())
                || generator.world.bvh.occluded(&segment);
            if wrong {
                println!("wrong: {segment:?}");
            }
            (1, u64::from(wrong))
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
}

#[test]
fn no_proof_is_wrong() {
    for name in ["cbox_vol2", "cbox_vol3", "cbox_vol4", "cbox_vol6"] {
        let mut scene: Scene = common::builtin(name, &[]);
        // A last emitter without a neighbourhood, through which segments between any two points are asked.
        scene.emitters.push(Emitter::Constant { radiance: glam::Vec3::ONE });
        let world = World::new(&scene);
        let lights = scene
            .emitters
            .iter()
            .filter_map(|e| if let Emitter::Point { position, .. } = e { Some(*position) } else { None });
        let lights: Vec<DVec3> = lights.collect();
        let configurations: Vec<_> =
            all_methods().into_iter().flat_map(|m| [4.0, 8.0, 16.0, 100.0].map(|s| (m, s))).collect();
        let share = count() / u32::try_from(configurations.len()).expect("few") + 1;
        let (mut proofs, mut asked) = (0, 0);
        for (k, (method, size)) in configurations.into_iter().enumerate() {
            let (acceleration, _) =
                Acceleration::build(method, &world.triangles, world.bounds, &scene.emitters, size, 1 << 30)
                    .expect("a sound grid");
            let grid = VoxelGrid::covering(world.bounds.0, world.bounds.1, size, 1 << 30).expect("a sound grid");
            let generator = Generator { world: &world, lights: lights.clone(), grid };
            let check = Check { generator: &generator, emitters: &scene.emitters, segments: share, seed: k as u64 };
            let (made, wrong) = acceleration.accept(check);
            assert_eq!(wrong, 0, "{name}, {method}, voxel {size}: {wrong} of {made} proofs are wrong");
            proofs += made;
            asked += u64::from(share);
        }
        println!("{name}: {asked} segments, {proofs} proofs, 0 wrong, 95 % bound {:.1e}", 3.0 / proofs.max(1) as f64);
        assert!(proofs * 20 > asked, "hardly anything was proved: {proofs} of {asked}");
    }
}
