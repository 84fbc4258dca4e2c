//! Segments that try to make a proof wrong.
//!
//! *Idea.* A wrong proof needs a segment that meets an occluder where the voxels say that none is. Uniform segments
//! hardly ever come near such a place, so most classes aim: at vertices and edges, along the faces of voxels, at the
//! border of the grid, one step of the last place beside all of these.
//!
//! *Definition.* Segment `index` of a class is a function of (seed, grid number, class, index), whatever the number of
//! threads. In all classes but the first two, half of the segments end on a light if there is one: those are what
//! safe neighbourhoods are asked about.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use serde::Serialize;
use vdf_geometry::{Bounds, CurvedKind, CurvedSet, Segment, Triangle};
use vdf_render::{Sampler, World, light_shapes};
use vdf_scene::Scene;
use vdf_visibility::LightShape;
use vdf_voxel::VoxelGrid;

/// Where the ends of a segment come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SegmentClass {
    /// Both ends uniform in the bounds of the scene.
    Random,
    /// From a uniform point to a sampled point of an emitter, as the integrators ask.
    Light,
    /// Through, to, or closely past a vertex of an occluder.
    Vertex,
    /// Through, to, or closely past an edge of an occluder, or along it.
    Edge,
    /// An end on an occluder, or closely beside it.
    Surface,
    /// Ends on faces, edges and corners of voxels, and segments along those.
    Lattice,
    /// From where an occluder comes close to a corner, an edge or a face of a voxel, across the occluder: only the
    /// dilation of the occupied voxels keeps a proof from being wrong there.
    Corner,
    /// Parallel to an axis, with zeros of either sign.
    Axis,
    /// Of length zero, or within a voxel or two.
    Short,
    /// Ends on the border of the grid, outside it, or very far away.
    Outside,
    /// An end in an occupied voxel or in one next to it.
    Occupied,
    /// Towards a point light along the borders and corners of the texels of its light buffer, the seams and the diagonals
    /// of its cube, from before, on and behind what is met there.
    Texel,
    /// Through, to, closely past, inside of and tangent to a curved occluder, and through its rim. No prover knows of these, but every query is tested
    /// against them. Only in scenes that have some.
    Curved,
}

impl SegmentClass {
    /// All classes.
    pub const ALL: [Self; 13] = [
        Self::Random,
        Self::Light,
        Self::Vertex,
        Self::Edge,
        Self::Surface,
        Self::Lattice,
        Self::Corner,
        Self::Axis,
        Self::Short,
        Self::Outside,
        Self::Occupied,
        Self::Texel,
        Self::Curved,
    ];

    /// Those that are asked about in a scene.
    pub(super) fn of(world: &World) -> Vec<Self> {
        Self::ALL.into_iter().filter(|class| *class != Self::Curved || world.curved().is_some()).collect()
    }

    /// The name in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Light => "light",
            Self::Vertex => "vertex",
            Self::Edge => "edge",
            Self::Surface => "surface",
            Self::Lattice => "lattice",
            Self::Corner => "corner",
            Self::Axis => "axis",
            Self::Short => "short",
            Self::Outside => "outside",
            Self::Occupied => "occupied",
            Self::Texel => "texel",
            Self::Curved => "curved",
        }
    }
}

/// A segment to ask about.
#[derive(Clone, Copy, Debug)]
pub(super) struct Query {
    pub(super) segment: Segment,
    /// The emitter that `segment.q` is a sampled point of, if it is one.
    pub(super) emitter: Option<usize>,
}

/// Distances from a target in voxels: on it, by rounding beside it, near it.
const BESIDE: [f64; 8] = [0.0, 0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0];

/// Makes segments for one scene and one grid.
#[derive(Debug)]
pub(super) struct Generator<'a> {
    world: &'a World,
    /// Numbers of the emitters, and places on them.
    lights: Vec<(usize, DVec3)>,
    grid: VoxelGrid,
    seed: u64,
    /// Tells the segments for one grid from those for another.
    number: u32,
}

impl<'a> Generator<'a> {
    pub(super) fn new(scene: &Scene, world: &'a World, grid: VoxelGrid, seed: u64, number: u32) -> Self {
        let mut lights = Vec::new();
        for (i, shape) in light_shapes(scene).iter().enumerate() {
            match shape {
                LightShape::Point(position) => lights.push((i, *position)),
                // Vertices and middles, as sampled points are: on the light, or a little beside it.
                LightShape::Area(triangles) => lights.extend(triangles.iter().take(16).flat_map(|t| {
                    let [a, b, c] = t.vertices_f64();
                    let normal = t.area_normal().normalize_or_zero() * grid.voxel_size();
                    let beside = move |p: DVec3| [0.0, 1e-9, -1e-9, 1e-4].map(|d| (i, p + normal * d));
                    [a, b, c, (a + b + c) / 3.0, (a + b) * 0.5].into_iter().flat_map(beside)
                })),
                LightShape::Infinite => {}
            }
        }
        Self { world, lights, grid, seed, number }
    }

    /// Segment `index` of a class.
    pub(super) fn query(&self, class: SegmentClass, index: u64) -> Query {
        let [low, high] = [index as u32, (index >> 32) as u32];
        let draw = &mut Draw(Sampler::new(self.seed, low, high, self.number * 16 + class as u32));
        match class {
            SegmentClass::Random => between(self.uniform(draw), self.uniform(draw)),
            SegmentClass::Light => self.to_emitter(draw),
            SegmentClass::Vertex => self.through(draw, Self::vertex),
            SegmentClass::Edge if draw.chance(0.25) => self.along_edge(draw),
            SegmentClass::Edge => self.through(draw, Self::on_edge),
            SegmentClass::Surface => {
                let p = self.near_surface(draw);
                self.onwards(draw, p)
            }
            SegmentClass::Lattice => self.along_lattice(draw),
            SegmentClass::Corner => self.across_corner(draw),
            SegmentClass::Axis => self.along_axis(draw),
            SegmentClass::Short => self.short(draw),
            SegmentClass::Outside => self.with_end_outside(draw),
            SegmentClass::Occupied => {
                let p = self.near_occupied(draw);
                self.onwards(draw, p)
            }
            SegmentClass::Texel => self.along_texels(draw),
            SegmentClass::Curved => self.at_curved(draw),
        }
    }

    fn along_texels(&self, draw: &mut Draw) -> Query {
        let Some((emitter, q)) = self.light(draw) else { return self.to_emitter(draw) };
        let step = 2.0 / draw.of(&[64.0, 128.0, 256.0, 1024.0]);
        let mut d = DVec3::from_array([(); 3].map(|()| {
            let u = 2.0 * draw.unit() - 1.0;
            if draw.chance(0.7) { (u / step).round() * step } else { u }
        }));
        d[draw.pick(3)] = draw.of(&[1.0, -1.0]);
        if draw.chance(0.3) {
            // A seam, or a diagonal of a face.
            let (i, j) = (draw.pick(3), draw.pick(3));
            d[i] = d[j].abs().copysign(d[i]);
        }
        let mut d = nudged(draw, d);
        if draw.chance(0.5) {
            // Look-ups are in single precision: by its ulps as well.
            d += DVec3::from_array([(); 3].map(|()| draw.of(&[-2.0, -1.0, 0.0, 1.0, 2.0]) / 16_777_216.0));
        }
        let reach = self.world.bounds.extent().length();
        let along = match self.world.bvh.intersect(&Segment::new(q, q + d * reach)) {
            Some(hit) => hit.t * draw.of(&[1.0, 1.0, 1.0 - 1e-12, 1.0 + 1e-12, 1.0 - 1e-4, 1.0 + 1e-4, 0.5, 1.5]),
            None => draw.unit(),
        };
        Query { segment: Segment::new(nudged(draw, q + d * (reach * along)), q), emitter: Some(emitter) }
    }

    fn at_curved(&self, draw: &mut Draw) -> Query {
        let Some(shapes) = self.world.curved().map(CurvedSet::shapes) else { return self.to_emitter(draw) };
        let shape = &shapes[draw.pick(shapes.len())];
        // Poles, rims and quarters as often as anything between.
        let angle = if draw.chance(0.3) { draw.of(&[0.0, 0.25, 0.5, 0.75]) } else { draw.unit() } * TAU;
        let along = if draw.chance(0.3) { draw.of(&[0.0, 1.0]) } else { draw.unit() };
        let local = match shape.kind() {
            CurvedKind::Sphere => {
                DVec2::from_angle(angle).extend(0.0) * (1.0 - along * along).sqrt() + DVec3::Z * along
            }
            CurvedKind::Disk => DVec2::from_angle(angle).extend(0.0) * along,
            CurvedKind::Cylinder => DVec2::from_angle(angle).extend(along),
        };
        let local = if shape.kind() == CurvedKind::Sphere && draw.chance(0.5) { -local } else { local };
        let size = shape.bounds().extent().max_element();
        let normal = shape.normal(local);
        let beside = normal * (draw.of(&BESIDE) * draw.of(&[0.1, -0.1]) * size);
        let point = nudged(draw, shape.to_world(local) + beside);
        match draw.pick(3) {
            // Tangent.
            0 => {
                let (along, across) = normal.any_orthonormal_pair();
                let direction = along.lerp(across, draw.unit()) * size;
                let [before, behind] = [(); 2].map(|()| draw.of(&[0.0, 1e-9, 0.1, 1.0, 3.0]));
                between(point - direction * before, nudged(draw, point + direction * behind))
            }
            1 => self.onwards(draw, point),
            _ => self.through(draw, |_, _| point),
        }
    }

    fn to_emitter(&self, draw: &mut Draw) -> Query {
        let from = self.uniform(draw);
        let (choice, u) = (draw.unit(), draw.0.next_2d());
        match self.world.lights.sample(from, choice, u) {
            Some(light) => Query { segment: Segment::new(from, light.point), emitter: Some(light.emitter) },
            None => between(from, self.uniform(draw)),
        }
    }

    /// A place on a light in half of the cases.
    fn light(&self, draw: &mut Draw) -> Option<(usize, DVec3)> {
        (!self.lights.is_empty() && draw.chance(0.5)).then(|| draw.of(&self.lights))
    }

    /// From `p` to a light or to anywhere.
    fn onwards(&self, draw: &mut Draw, p: DVec3) -> Query {
        match self.light(draw) {
            Some((emitter, q)) => Query { segment: Segment::new(p, q), emitter: Some(emitter) },
            None => between(p, self.anywhere(draw)),
        }
    }

    /// Through a target, or just to it.
    fn through(&self, draw: &mut Draw, target: impl Fn(&Self, &mut Draw) -> DVec3) -> Query {
        let mut target = target(self, draw);
        let direction = DVec3::from_array([(); 3].map(|()| draw.unit() - 0.5));
        target += direction * (draw.of(&BESIDE) * self.grid.voxel_size());
        let beyond = draw.of(&[0.0, 1e-12, 1e-3, 0.1, 1.0]);
        match self.light(draw) {
            Some((emitter, q)) => {
                Query { segment: Segment::new(q + (target - q) * (1.0 + beyond), q), emitter: Some(emitter) }
            }
            None => {
                let p = self.anywhere(draw);
                between(p, p + (target - p) * (1.0 + beyond))
            }
        }
    }

    fn along_edge(&self, draw: &mut Draw) -> Query {
        let [a, b] = self.edge(draw);
        let (t0, t1) = (draw.unit() * 3.0 - 1.0, draw.unit() * 3.0 - 1.0);
        let beside = DVec3::from_array([(); 3].map(|()| draw.unit() - 0.5))
            * (draw.of(&[0.0, 1e-12, 1e-6, 1e-2]) * self.grid.voxel_size());
        between(nudged(draw, a + (b - a) * t0) + beside, nudged(draw, a + (b - a) * t1) + beside)
    }

    fn along_lattice(&self, draw: &mut Draw) -> Query {
        let p = self.lattice(draw);
        let mut q = match draw.pick(3) {
            0 => return self.onwards(draw, p),
            1 => self.lattice(draw),
            _ => self.uniform(draw),
        };
        // In the plane of faces, or along an edge.
        for axis in 0..3 {
            if draw.chance(0.4) {
                q[axis] = p[axis];
            }
        }
        between(p, nudged(draw, q))
    }

    fn across_corner(&self, draw: &mut Draw) -> Query {
        let (origin, size) = (self.grid.origin(), self.grid.voxel_size());
        let mut p = (self.touching(draw) - origin) / size;
        for axis in 0..3 {
            if draw.chance(0.8) {
                p[axis] = p[axis].round();
            }
        }
        let p = nudged(draw, origin + p * size);
        if draw.chance(0.5) {
            return self.onwards(draw, p);
        }
        let length = draw.of(&[1e-9, 1e-3, 0.3, 1.0, 2.0]) * size;
        let d = DVec3::from_array([(); 3].map(|()| 2.0 * draw.unit() - 1.0));
        between(p, p + d * length)
    }

    fn along_axis(&self, draw: &mut Draw) -> Query {
        let light = self.light(draw);
        let q = light.map_or_else(|| self.anywhere(draw), |(_, q)| q);
        let mut p = q;
        let axis = draw.pick(3);
        p[axis] = self.anywhere(draw)[axis];
        if draw.chance(0.2) {
            // In a plane across an axis.
            let axis = (axis + 1) % 3;
            p[axis] = self.anywhere(draw)[axis];
        }
        for k in 0..3 {
            if p[k] == 0.0 && draw.chance(0.5) {
                p[k] = -p[k];
            }
        }
        Query { segment: Segment::new(p, q), emitter: light.map(|(emitter, _)| emitter) }
    }

    fn short(&self, draw: &mut Draw) -> Query {
        let light = self.light(draw);
        let q = light.map_or_else(|| self.anywhere(draw), |(_, q)| q);
        let length = draw.of(&[0.0, 1e-12, 1e-6, 0.1, 1.0, 2.0]) * self.grid.voxel_size();
        let d = DVec3::from_array([(); 3].map(|()| 2.0 * draw.unit() - 1.0));
        Query { segment: Segment::new(q + d * length, q), emitter: light.map(|(emitter, _)| emitter) }
    }

    fn with_end_outside(&self, draw: &mut Draw) -> Query {
        let p = self.outside(draw);
        match draw.pick(3) {
            0 => self.onwards(draw, p),
            // Through a place inside, to the other side.
            1 => {
                let middle = self.anywhere(draw);
                between(p, middle + (middle - p) * draw.of(&[1e-9, 1e-3, 0.5, 1.0]))
            }
            _ => between(p, self.outside(draw)),
        }
    }

    /// A point of any kind.
    fn anywhere(&self, draw: &mut Draw) -> DVec3 {
        match draw.pick(6) {
            0 | 1 => self.uniform(draw),
            2 => self.lattice(draw),
            3 => self.near_surface(draw),
            4 => self.outside(draw),
            _ => self.near_occupied(draw),
        }
    }

    fn uniform(&self, draw: &mut Draw) -> DVec3 {
        let Bounds { min, max } = self.world.bounds;
        min + (max - min) * DVec3::from_array([(); 3].map(|()| draw.unit()))
    }

    /// A voxel's corner, or a point on one of its edges or faces.
    fn lattice(&self, draw: &mut Draw) -> DVec3 {
        let (origin, size) = (self.grid.origin(), self.grid.voxel_size());
        let mut p = (self.uniform(draw) - origin) / size;
        for axis in 0..3 {
            if draw.chance(2.0 / 3.0) {
                p[axis] = p[axis].round();
            }
        }
        nudged(draw, origin + p * size)
    }

    fn triangle(&self, draw: &mut Draw) -> Option<&Triangle> {
        let n = self.world.triangles.len();
        self.world.triangles.get(draw.pick(n))
    }

    fn vertex(&self, draw: &mut Draw) -> DVec3 {
        let k = draw.pick(3);
        self.triangle(draw).map_or_else(|| self.uniform(draw), |t| t.vertices_f64()[k])
    }

    fn edge(&self, draw: &mut Draw) -> [DVec3; 2] {
        let k = draw.pick(3);
        match self.triangle(draw) {
            Some(t) => [t.vertices_f64()[k], t.vertices_f64()[(k + 1) % 3]],
            None => [self.uniform(draw), self.uniform(draw)],
        }
    }

    fn on_edge(&self, draw: &mut Draw) -> DVec3 {
        let [a, b] = self.edge(draw);
        a + (b - a) * draw.unit()
    }

    fn on_surface(&self, draw: &mut Draw) -> DVec3 {
        let (v, w) = (draw.unit(), draw.unit());
        match self.triangle(draw).map(Triangle::vertices_f64) {
            Some([a, b, c]) => a + (b - a) * (v * (1.0 - w)) + (c - a) * w,
            None => self.uniform(draw),
        }
    }

    /// A vertex, a point on an edge or in the face of a triangle.
    fn touching(&self, draw: &mut Draw) -> DVec3 {
        match draw.pick(3) {
            0 => self.vertex(draw),
            1 => self.on_edge(draw),
            _ => self.on_surface(draw),
        }
    }

    /// The same, or a point beside it.
    fn near_surface(&self, draw: &mut Draw) -> DVec3 {
        let p = self.touching(draw);
        let beside = DVec3::from_array([(); 3].map(|()| draw.unit() - 0.5));
        let distance = draw.of(&BESIDE) * self.grid.voxel_size();
        nudged(draw, p + beside * distance)
    }

    /// A point in a voxel that an occluder touches, or in one up to two voxels away.
    fn near_occupied(&self, draw: &mut Draw) -> DVec3 {
        let p = self.on_surface(draw);
        let Some(v) = self.grid.voxel_containing(p) else { return p };
        let away = DVec3::from_array([(); 3].map(|()| draw.of(&[0.0, 0.0, 1.0, -1.0, 2.0, -2.0])));
        let within = DVec3::from_array([(); 3].map(|()| if draw.chance(0.3) { 0.0 } else { draw.unit() }));
        nudged(draw, self.grid.corner(v) + (away + within) * self.grid.voxel_size())
    }

    /// On the border of the bounds or of the grid, or outside: near, far and absurdly far.
    fn outside(&self, draw: &mut Draw) -> DVec3 {
        let Bounds { min, max } = self.world.bounds;
        let mut p = self.uniform(draw);
        if draw.chance(0.4) {
            let axis = draw.pick(3);
            let r = self.grid.resolution();
            let end =
                self.grid.origin() + DVec3::new(r.x().into(), r.y().into(), r.z().into()) * self.grid.voxel_size();
            p[axis] = draw.of(&[min[axis], max[axis], end[axis]]);
            return nudged(draw, p);
        }
        let middle = (min + max) * 0.5;
        middle + (p - middle) * draw.of(&[1.5, 10.0, 1e6, 1e12, 1e15])
    }
}

fn between(p: DVec3, q: DVec3) -> Query {
    Query { segment: Segment::new(p, q), emitter: None }
}

/// The point itself in half of the cases, else up to two steps of the last place away on each axis.
fn nudged(draw: &mut Draw, mut p: DVec3) -> DVec3 {
    if draw.chance(0.5) {
        return p;
    }
    for axis in 0..3 {
        let x = p[axis];
        p[axis] = match draw.pick(7) {
            // Next to 0 steps are denormal, and where products underflow the predicates are not exact.
            k @ (0..=2) if x == 0.0 => [1e-60, -1e-60, -0.0][k],
            0 => x.next_up(),
            1 => x.next_down(),
            2 => x.next_up().next_up(),
            _ => x,
        };
    }
    p
}

/// Random choices.
struct Draw(Sampler);

impl Draw {
    /// Uniform in [0, 1).
    fn unit(&mut self) -> f64 {
        self.0.next_1d()
    }

    /// Uniform in 0..n; 0 if `n` is 0.
    fn pick(&mut self, n: usize) -> usize {
        ((self.unit() * n as f64) as usize).min(n.saturating_sub(1))
    }

    fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// One of `choices`, of which there is at least one.
    fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.pick(choices.len())]
    }
}
