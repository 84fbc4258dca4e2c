//! The scenes inside the program.

use std::borrow::Cow;

use vdf_scene::{EmbeddedFile, SceneSource};

use crate::generate::{GeneratedFile, GeneratedScene, generated};

/// The scene that is rendered when none is named.
pub const DEFAULT_SCENE: &str = "cbox_vol2";

const NAMES: [&str; 8] =
    ["cbox_vol2", "cbox_vol3", "cbox_vol4", "cbox_vol6", "cbox_light", "san-miguel", "scape", "smoke"];

macro_rules! scene_file {
    ($path:literal) => {
        EmbeddedFile { path: Cow::Borrowed($path), bytes: Cow::Borrowed(include_bytes!(concat!("../", $path))) }
    };
}

/// Names of the built-in scenes, the default first.
#[must_use]
pub const fn builtin_names() -> &'static [&'static str] {
    &NAMES
}

/// The built-in scene of that name. A generated one is made in its default size: some ten megabytes of text.
#[must_use]
pub fn builtin(name: &str) -> Option<SceneSource> {
    let scene = match name {
        "cbox_vol2" => scene_file!("cbox_vol2.xml"),
        "cbox_vol3" => scene_file!("cbox_vol3.xml"),
        "cbox_vol4" => scene_file!("cbox_vol4.xml"),
        "cbox_vol6" => scene_file!("cbox_vol6.xml"),
        "cbox_light" => scene_file!("cbox_light.xml"),
        _ => return generated(name).map(SceneSource::from),
    };
    let mut meshes = vec![
        scene_file!("meshes/cbox_white.obj"),
        scene_file!("meshes/cbox_red.obj"),
        scene_file!("meshes/cbox_green.obj"),
    ];
    // cbox_vol6 is the room without its blocks.
    if name != "cbox_vol6" {
        meshes.push(scene_file!("meshes/cbox_short_block.obj"));
        meshes.push(scene_file!("meshes/cbox_tall_block.obj"));
    }
    Some(SceneSource::embedded(scene, meshes))
}

impl From<GeneratedScene> for SceneSource {
    /// The scene in memory: some 70 bytes of text a triangle, four bytes a voxel.
    fn from(scene: GeneratedScene) -> Self {
        let embedded = |file: GeneratedFile| {
            let mut bytes = Vec::new();
            // A vector takes whatever is written.
            let _ = file.write(&mut bytes);
            EmbeddedFile { path: Cow::Borrowed(file.path), bytes: Cow::Owned(bytes) }
        };
        let mut files: Vec<_> = scene.files().map(embedded).collect();
        // The scene file is always there, and it is the first.
        Self::embedded(files.remove(0), files)
    }
}
