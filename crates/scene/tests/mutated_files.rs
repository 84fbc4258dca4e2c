//! Scenes and meshes with random changes: any answer will do, a panic will not.

use std::borrow::Cow;

use proptest::prelude::*;
use vdf_scene::{EmbeddedFile, LoadOptions, Scene, SceneSource};
use vdf_scenes::builtin;

fn file(path: &str, text: &str) -> EmbeddedFile {
    EmbeddedFile { path: Cow::Owned(path.to_owned()), text: Cow::Owned(text.to_owned()) }
}

fn builtin_text() -> String {
    builtin("cbox_vol2").unwrap().files()[0].text.to_string()
}

fn try_builtin(text: &str, mesh: Option<&str>) {
    let source = builtin("cbox_vol2").unwrap();
    let mut others = source.files()[1..].to_vec();
    if let Some(mesh) = mesh {
        others[0].text = Cow::Owned(mesh.to_owned());
    }
    // Any answer will do, a panic will not.
    let _ = Scene::from_source(&SceneSource::embedded(file("s.xml", text), others), &LoadOptions::default());
}

fn mutate(text: &str, cuts: &[(prop::sample::Index, usize, String)]) -> String {
    let mut chars: Vec<char> = text.chars().collect();
    for (at, length, insert) in cuts {
        let at = at.index(chars.len() + 1);
        let end = (at + length).min(chars.len());
        chars.splice(at..end, insert.chars());
    }
    chars.into_iter().collect()
}

fn cuts(insert: &'static str) -> impl Strategy<Value = Vec<(prop::sample::Index, usize, String)>> {
    prop::collection::vec((any::<prop::sample::Index>(), 0_usize..30, insert), 1..4)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn mutated_scenes_never_panic(cuts in cuts("[<>/$\\\\\"a-z0-9 .é-]{0,8}")) {
        try_builtin(&mutate(&builtin_text(), &cuts), None);
    }

    #[test]
    fn truncated_scenes_never_load(at in any::<prop::sample::Index>()) {
        let text = builtin_text();
        let at = at.index(text.trim_end().len());
        let cut: String = text.bytes().take(at).map(char::from).collect();
        prop_assert!(Scene::from_source(&SceneSource::embedded(file("s.xml", &cut), vec![]), &LoadOptions::default()).is_err());
    }

    #[test]
    fn mutated_meshes_never_panic(cuts in cuts("[vf/0-9 .en\n-]{0,12}")) {
        let mesh = builtin("cbox_vol2").unwrap().files()[1].text.to_string();
        try_builtin(&builtin_text(), Some(&mutate(&mesh, &cuts)));
    }
}
