//! What several benches share: scenes with recorded queries, and the voxels of a room.

use std::borrow::Cow;

use vdf::{
    distfield::VoxelBox,
    lab::queries::record_queries,
    render::{Integrator, PrepareOptions, PreparedScene, Quiet, RenderOptions, Sampler},
    scene::{EmbeddedFile, LoadOptions, Scene, SceneSource},
    scenes::{builtin, generated},
    visibility::{Method, QueryKind, ShadowQuery},
    voxel::{Resolution, Voxel, VoxelSet},
};

/// As in the thesis.
pub(crate) const RAYMARCH: Integrator = Integrator::raymarch(7);

/// A scene without a method, and a voxel size for those that it gets.
pub(crate) struct Bench {
    pub(crate) none: PreparedScene,
    pub(crate) voxel_size: f64,
}

impl Bench {
    /// A built-in scene with this width and height in pixels; `san-miguel` has 10⁵ triangles.
    pub(crate) fn new(name: &str, size: u32) -> Self {
        let (source, voxel_size) = if name == "san-miguel" { (court(), 0.25) } else { (builtin(name), 8.0) };
        let size = ["width", "height"].map(|n| (n.to_owned(), size.to_string())).to_vec();
        let source = source.expect("a built-in name");
        let scene = Scene::from_source(&source, &LoadOptions { defines: size, ..LoadOptions::default() })
            .expect("built-in scenes load");
        let none = PreparedScene::new(scene, &PrepareOptions::with_method(Method::NONE), &Quiet);
        Self { none: none.expect("nothing is built"), voxel_size }
    }

    /// The scene with a method.
    pub(crate) fn with(&self, method: Method) -> PreparedScene {
        let options = PrepareOptions { voxel_size: Some(self.voxel_size), ..PrepareOptions::with_method(method) };
        self.none.with_options(&options, &Quiet).expect("a sound grid")
    }

    /// The queries of about as many paths as ask `most`, in the order of the render.
    pub(crate) fn record(&self, integrator: Integrator, most: u64) -> Vec<ShadowQuery> {
        let options = RenderOptions { integrator, spp: Some(1), ..RenderOptions::thesis() };
        record_queries(&self.none, &options, most, &Quiet).expect("usable options").queries
    }

    /// Those of them that proofs are about.
    pub(crate) fn record_spatial(&self, integrator: Integrator, most: u64) -> Vec<ShadowQuery> {
        let mut queries = self.record(integrator, most);
        queries.retain(|q| q.kind == QueryKind::Spatial);
        queries
    }
}

fn court() -> Option<SceneSource> {
    let mut files = generated("san-miguel")?.with_triangles(100_000).ok()?.files().map(|file| {
        let mut text = Vec::new();
        file.write(&mut text).expect("a vector takes it");
        EmbeddedFile { path: Cow::Borrowed(file.path), bytes: Cow::Owned(text) }
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
