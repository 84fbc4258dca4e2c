//! Files that are large, of another kind, or made to do harm.

use super::LoadOptions;
use super::tests::{file, load, load_with, refused, refused_text, scene};
use crate::{Scene, SceneSource};

/// The work of each of these grew with the square of its size, or faster. Here they take some seconds on a busy machine.
#[test]
fn large_files_take_linear_time() {
    let begin = std::time::Instant::now();
    let shape = "<shape type='rectangle'><transform name='to_world'><translate x='1'/></transform></shape>";
    assert_eq!(load(&shape.repeat(20_000)).surfaces.len(), 20_000);
    let parameters: String = (0..50_000).map(|i| format!("<default name='p{i}' value='{i}'/>")).collect();
    let uses = "<emitter type='point'><float name='intensity' value='$p49999'/></emitter>";
    assert_eq!(load(&(parameters + &uses.repeat(2000))).emitters.len(), 2001);
    let children = "<string name='a' value='b'/>".repeat(50_000);
    refused(&format!("<bsdf type='diffuse' id='b'>{children}</bsdf>"), "3:57", "given twice");
    let nested = "<bsdf type='diffuse'/>".repeat(100);
    let body = format!(
        "<bsdf type='twosided' id='b'>{nested}</bsdf>{}",
        "<shape type='cube'><ref id='b'/></shape>".repeat(5000)
    );
    refused(&body, "3:1", "100 nested BSDFs");
    let long = "x".repeat(100_000);
    let ids: String = (0..20).map(|i| format!("<bsdf type='diffuse' id='{long}{i}'/>")).collect();
    let message =
        load_with(&scene(&format!("{ids}<shape type='cube'><ref id='{long}'/></shape>")), &[], &[]).unwrap_err();
    assert!(message.to_string().len() < 3000);
    let namespaces: String = (0..5000).map(|i| format!("<scene xmlns:a{i}='b'>")).collect();
    refused_text(&namespaces, &[], "s.xml:1:8", "namespaces are not supported");
    let attributes: String = (0..50_000).map(|i| format!(" a{i}='b'")).collect();
    refused(&format!("<bsdf{attributes}/>"), "3:125", "more than 16 attributes");
    assert!(begin.elapsed().as_secs_f64() < 60.0, "{:?}", begin.elapsed());
}

#[test]
fn the_bytes_of_all_included_files_are_bounded() {
    let large = format!("<scene version='3.0.0'><!-- {} --></scene>", "x".repeat(8 << 20));
    let text = scene(&"<include filename='a.xml'/>\n".repeat(9));
    refused_text(&text, &[("a.xml", &large)], "s.xml:10:1", "bytes of the files before it");
}

#[test]
fn columns_do_not_count_a_byte_order_mark() {
    refused_text("\u{feff}<scene version='3.0.0'><oops/></scene>", &[], "s.xml:1:24", "<oops>");
}

#[test]
fn comments_with_dashes_are_read() {
    assert_eq!(load("<!-- a -- b ---><emitter type='constant'/><!------>").emitters.len(), 2);
    refused("<!-- é -- -->\n<!-- -- --><oops/>", "4:12", "<oops>");
}

#[test]
fn files_of_other_kinds_are_named() {
    let message = |path: &str, text: &'static str| {
        let source = SceneSource::embedded(file(path, text), vec![]);
        Scene::from_source(&source, &LoadOptions::default()).unwrap_err().to_string()
    };
    for (path, text, part) in [
        ("a.OBJ", "v 0 0 0\n", "is a mesh"),
        ("a.pbrt", "LookAt 0 0 0\n", "PBRT"),
        ("a.blend", "BLENDER-v300", "Mitsuba add-on"),
        ("a.json", "{}", "Mitsuba add-on"),
        ("a.xml", "\0\u{1}", "binary"),
        ("a.xml", "hello", "not XML"),
        ("a.xml", "", "is empty"),
    ] {
        let message = message(path, text);
        assert!(message.starts_with(path) && message.contains(part), "{message}");
    }
    assert!(message("a.obj", "<scene version='3.0.0'/>").contains("no sensor"));
}

/// A name in a file must not be able to forge a line of output or to steer the terminal.
#[test]
fn names_in_messages_are_escaped() {
    for (body, part) in [
        ("<shape type='cube'><ref id='a&#10;error: b&#9;\u{202e}c'/></shape>", "a\\nerror: b\\t\\u{202e}c"),
        ("<bsdf type='\u{9b}2J'/>", "\\u{9b}2J"),
        ("<include filename='a&#10;b'/>", "a\\nb"),
    ] {
        let message = load_with(&scene(body), &[], &[]).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
        assert!(message.lines().count() <= 2 && !message.contains(['\t', '\u{9b}', '\u{202e}']), "{message:?}");
    }
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\na\u{1b}[31mb\n";
    let text = scene("<shape type='obj'><string name='filename' value='m.obj'/></shape>");
    let warnings = load_with(&text, &[("m.obj", mesh)], &[]).unwrap().warnings;
    assert!(
        warnings.iter().any(|w| w.contains("\\u{1b}[31mb")) && !warnings.concat().contains('\u{1b}'),
        "{warnings:?}"
    );
}
