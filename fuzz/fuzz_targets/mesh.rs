//! An OBJ file from anywhere, as the only shape of a scene: any answer will do, a panic will not.
#![no_main]

use std::borrow::Cow;

use libfuzzer_sys::fuzz_target;
use vdf_scene::{EmbeddedFile, LoadOptions, Scene, SceneSource};

const SCENE: &str = "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'/></sensor>\
    <shape type='obj'><string name='filename' value='m.obj'/></shape></scene>";

fuzz_target!(|text: &str| {
    let file = |path: &'static str, text: &str| EmbeddedFile { path: Cow::Borrowed(path), bytes: Cow::Owned(text.as_bytes().to_owned()) };
    let source = SceneSource::embedded(file("s.xml", SCENE), vec![file("m.obj", text)]);
    if let Ok(scene) = Scene::from_source(&source, &LoadOptions::default()) {
        assert!(scene.surfaces.iter().flat_map(|s| &s.triangles).all(|t| t.is_finite()));
    }
});
