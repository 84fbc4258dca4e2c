//! What several benches share: scenes with recorded queries, and the voxels of a room.

use std::borrow::Cow;

use vdf::{
    distfield::VoxelBox,
    render::{
        Acceleration, IntegratorKind, Method, Progress, QueryKind, RenderOptions, Sampler, ShadowQuery, World,
        queries::record_queries,
        scene::{EmbeddedFile, LoadOptions, Scene, SceneSource, builtin, generated},
    },
    voxel::{Resolution, Voxel, VoxelSet},
};

/// As in the thesis.
pub(crate) const RAYMARCH: IntegratorKind = IntegratorKind::Raymarch { samples_per_segment: 7 };

const MAX_VOXELS: u64 = 1 << 29;

/// Reports nothing.
pub(crate) struct Quiet;

impl Progress for Quiet {
    fn phase(&self, _: &str) {}
    fn work_total(&self, _: u64) {}
    fn work_done(&self, _: u64) {}
    fn cancelled(&self) -> bool {
        false
    }
}

/// A scene, what is prepared of it, and a voxel size.
pub(crate) struct Prepared {
    pub(crate) scene: Scene,
    pub(crate) world: World,
    pub(crate) voxel_size: f64,
}

impl Prepared {
    /// A built-in scene with this width and height in pixels; `san-miguel` has 10⁵ triangles.
    pub(crate) fn new(name: &str, size: u32) -> Self {
        let (source, voxel_size) = if name == "san-miguel" { (court(), 0.25) } else { (builtin(name), 8.0) };
        let size = ["width", "height"].map(|n| (n.to_owned(), size.to_string())).to_vec();
        let source = source.expect("a built-in name");
        let scene = Scene::from_source(&source, &LoadOptions { defines: size }).expect("built-in scenes load");
        let world = World::new(&scene);
        Self { scene, world, voxel_size }
    }

    pub(crate) fn acceleration(&self, method: Method) -> Acceleration {
        let lights = self.scene.light_shapes();
        Acceleration::build(method, &self.world.triangles, self.world.bounds, &lights, self.voxel_size, MAX_VOXELS)
            .expect("a sound grid")
            .0
    }

    /// The queries of about as many paths as ask `most`, in the order of the render.
    pub(crate) fn record(&self, integrator: IntegratorKind, most: u64) -> Vec<ShadowQuery> {
        let options = RenderOptions { integrator, spp: Some(1), ..RenderOptions::default() };
        let stream = record_queries(&self.scene, &self.world, &options, most, &Quiet);
        stream.expect("usable options").queries
    }

    /// Those of them that proofs are about.
    pub(crate) fn record_spatial(&self, integrator: IntegratorKind, most: u64) -> Vec<ShadowQuery> {
        let mut queries = self.record(integrator, most);
        queries.retain(|q| q.kind == QueryKind::Spatial);
        queries
    }
}

fn court() -> Option<SceneSource> {
    let mut files = generated("san-miguel")?.with_triangles(100_000).ok()?.files().map(|file| {
        let mut text = Vec::new();
        file.write(&mut text).expect("a vector takes it");
        EmbeddedFile { path: Cow::Borrowed(file.path), text: Cow::Owned(String::from_utf8(text).expect("UTF-8")) }
    });
    Some(SceneSource::embedded(files.next()?, files.collect()))
}

/// A room of n³ voxels: its walls, 24 hollow boxes on its floor, and one voxel in 2000. Walls as in a building, and single voxels as
/// in foliage.
pub(crate) fn room(n: u32) -> VoxelSet {
    let resolution = Resolution::new(n, n, n);
    let mut set = VoxelSet::new(resolution);
    let mut hollow = |walls: VoxelBox| {
        let (a, b) = (walls.min(), walls.max());
        let on = |v: &Voxel| v.i == a.i || v.i == b.i || v.j == a.j || v.j == b.j || v.k == a.k || v.k == b.k;
        set.extend(walls.voxels().filter(on));
    };
    hollow(VoxelBox::spanning(Voxel::new(0, 0, 0), resolution.last()));
    let mut s = Sampler::new(1, 0, 0, 0);
    let mut below = move |n: u32| (s.next_1d() * f64::from(n)) as u32;
    for _ in 0..24 {
        let (i, j) = (below(n * 7 / 8), below(n * 7 / 8));
        let far = Voxel::new(i + 1 + below(n / 8), j + 1 + below(n / 8), 1 + below(n / 2));
        hollow(VoxelBox::spanning(Voxel::new(i, j, 0), far));
    }
    set.extend((0..n * n / 2000 * n).map(|_| Voxel::new(below(n), below(n), below(n))));
    set
}
