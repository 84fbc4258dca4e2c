//! A scene file from anywhere: any answer will do, a panic will not. `@@@` begins a second file, `m.obj`, or an include, `i.xml`.
#![no_main]

use std::borrow::Cow;

use libfuzzer_sys::fuzz_target;
use vdf_scene::{EmbeddedFile, LoadOptions, Scene, SceneSource};

fuzz_target!(|text: &str| {
    let mut parts = text.split("@@@");
    let mut file = |path: &'static str| EmbeddedFile {
        path: Cow::Borrowed(path),
        bytes: Cow::Owned(parts.next().unwrap_or_default().as_bytes().to_owned()),
    };
    let (scene, others) = (file("s.xml"), vec![file("m.obj"), file("i.xml")]);
    match Scene::from_source(&SceneSource::embedded(scene, others), &LoadOptions::default()) {
        Ok(scene) => assert!(scene.surfaces.iter().flat_map(|s| &s.triangles).all(|t| t.is_finite())),
        // At most a message and a help, whatever the file holds.
        Err(error) => assert!(!error.to_string().chars().any(|c| c.is_control() && c != '\n')),
    }
});
