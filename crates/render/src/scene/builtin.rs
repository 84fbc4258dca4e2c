//! The scenes inside the program.

use std::borrow::Cow;

use super::source::{EmbeddedFile, SceneSource};

/// The scene that is rendered when none is named.
pub const DEFAULT_SCENE: &str = "cbox_vol2";

const NAMES: [&str; 4] = ["cbox_vol2", "cbox_vol3", "cbox_vol4", "cbox_vol6"];

macro_rules! scene_file {
    ($path:literal) => {
        EmbeddedFile {
            path: Cow::Borrowed($path),
            text: Cow::Borrowed(include_str!(concat!("../../../../scenes/", $path))),
        }
    };
}

/// Names of the built-in scenes, the default first.
#[must_use]
pub const fn builtin_names() -> &'static [&'static str] {
    &NAMES
}

/// The built-in scene of that name.
#[must_use]
pub fn builtin(name: &str) -> Option<SceneSource> {
    let scene = match name {
        "cbox_vol2" => scene_file!("cbox_vol2.xml"),
        "cbox_vol3" => scene_file!("cbox_vol3.xml"),
        "cbox_vol4" => scene_file!("cbox_vol4.xml"),
        "cbox_vol6" => scene_file!("cbox_vol6.xml"),
        _ => return None,
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
