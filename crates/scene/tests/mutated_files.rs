//! Scenes and meshes with random changes: any answer will do, a panic will not.

use std::borrow::Cow;

use proptest::prelude::*;
use vdf_scene::{EmbeddedFile, LoadOptions, Scene, SceneSource};
use vdf_scenes::builtin;

fn file(path: &str, text: &str) -> EmbeddedFile {
    EmbeddedFile { path: Cow::Owned(path.to_owned()), bytes: Cow::Owned(text.as_bytes().to_owned()) }
}

fn text_of(file: &EmbeddedFile) -> String {
    String::from_utf8_lossy(&file.bytes).into_owned()
}

fn builtin_text() -> String {
    text_of(&builtin("cbox_vol2").expect("it is built in").files()[0])
}

fn try_builtin(text: &str, mesh: Option<&str>) {
    let source = builtin("cbox_vol2").expect("it is built in");
    let mut others = source.files()[1..].to_vec();
    if let Some(mesh) = mesh {
        others[0].bytes = Cow::Owned(mesh.as_bytes().to_owned());
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
    fn mutated_meshes_never_panic(cuts in cuts("[vflpnt/0-9 .,e#\\\\\r\n-]{0,12}")) {
        let mesh = text_of(&builtin("cbox_vol2").expect("it is built in").files()[1]);
        try_builtin(&builtin_text(), Some(&mutate(&mesh, &cuts)));
    }
}

/// Files of the corpus of the fuzzer, changed at random but always in the same way: bytes replaced, parts moved, doubled and cut out, words of the
/// formats put in. The fuzzer itself finds more, but needs another compiler.
#[test]
fn mutated_files_of_the_corpus_never_panic() {
    const WORDS: [&str; 16] = [
        "-1",
        "0",
        "1e308",
        "nan",
        "4294967296",
        "9223372036854775807",
        "f 1 2 3 1 2",
        "v 0 0 0",
        "\\\n",
        "\u{feff}",
        "<!-- -- -->",
        "$s",
        "<ref id=\"b\"/>",
        "<shape type=\"cube\"/>",
        "&#0;",
        "/",
    ];
    let mut state = 7_u64;
    let mut below = |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(state >> 33).unwrap() % n.max(1)
    };
    let corpus = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus");
    let mut files: Vec<_> = ["scene", "mesh"]
        .iter()
        .flat_map(|kind| std::fs::read_dir(corpus.join(kind)).unwrap())
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    assert!(files.len() >= 4);
    for path in files {
        let original = std::fs::read(&path).unwrap();
        for _ in 0..1500 {
            let mut bytes = original.clone();
            for _ in 0..=below(4) {
                let (from, length) = (below(bytes.len()), below(40));
                let part: Vec<u8> = bytes[from..(from + length).min(bytes.len())].to_vec();
                let at = below(bytes.len() + 1);
                match below(4) {
                    0 => drop(bytes.splice(at..at, part)),
                    1 => drop(bytes.drain(from..from + part.len())),
                    2 => drop(bytes.splice(at..at, WORDS[below(WORDS.len())].bytes())),
                    _ if at < bytes.len() => bytes[at] = u8::try_from(below(256)).unwrap(),
                    _ => {}
                }
            }
            let text = String::from_utf8_lossy(&bytes);
            if path.extension().is_some_and(|e| e == "obj") {
                try_builtin(&builtin_text(), Some(&text));
            } else {
                let parts: Vec<&str> = text.splitn(3, "@@@").collect();
                let others = ["m.obj", "i.xml"].iter().zip(&parts[1..]).map(|(name, text)| file(name, text)).collect();
                let source = SceneSource::embedded(file("s.xml", parts[0]), others);
                // Any answer will do, a panic will not.
                let _ = Scene::from_source(&source, &LoadOptions::default());
            }
        }
    }
}
