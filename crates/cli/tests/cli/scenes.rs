//! `vdf scene`.

use std::{fs, path::Path};

use crate::sandbox::Sandbox;

#[test]
fn list() {
    let sandbox = Sandbox::new();
    let names = sandbox.run(&["scene", "list"]).succeeded().stdout;
    assert!(names.contains("\nscape       generated, 130000 triangles by default\n"), "{names}");
    assert!(names.contains("\nsmoke       generated, 884736 voxels by default\n"), "{names}");
    let names: Vec<_> = names.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(["cbox_vol2", "cbox_vol4", "san-miguel"].iter().all(|name| names.contains(name)), "{names:?}");
    for name in names {
        sandbox.render(&[name, "-o", "fog.exr"]);
    }
}

#[test]
fn written_scene_renders_the_same() {
    let sandbox = Sandbox::new();
    let written = sandbox.run(&["scene", "write", "cbox_vol2", "a/b"]).succeeded().stdout;
    assert!(written.starts_with("a/b/cbox_vol2.xml\n"), "{written}");
    assert!(written.lines().all(|path| sandbox.path().join(path).is_file()), "{written}");
    assert_eq!(sandbox.files(), ["a"]);

    sandbox.render(&["a/b/cbox_vol2.xml", "-o", "disk.exr"]);
    sandbox.render(&["cbox_vol2", "-o", "builtin.exr"]);
    let compared = sandbox.run(&["compare", "disk.exr", "builtin.exr"]).succeeded().stdout;
    assert!(compared.contains("identical: yes\n"), "{compared}");
}

#[test]
fn a_scene_that_was_edited_is_not_replaced() {
    let sandbox = Sandbox::new();
    let write = ["scene", "write", "cbox_vol2", "s"];
    sandbox.run(&write).succeeded();
    // The same bytes once more are no loss.
    sandbox.run(&write).succeeded();
    let original = sandbox.read("s/cbox_vol2.xml");
    for edited in [&original[..original.len() - 1], &[&original[..], b"\n"].concat(), b""] {
        fs::write(sandbox.path().join("s/cbox_vol2.xml"), edited).unwrap();
        sandbox.fails(&write, 2, &["s/cbox_vol2.xml is there and differs", "--force"]);
        assert_eq!(sandbox.read("s/cbox_vol2.xml"), edited);
    }
    sandbox.run(&[&write[..], &["--force"]].concat()).succeeded();
    assert_eq!(sandbox.read("s/cbox_vol2.xml"), original);
}

/// Lines of all files of a folder that start with `f `.
fn faces(folder: &Path) -> usize {
    let text = |entry: std::io::Result<fs::DirEntry>| fs::read_to_string(entry.unwrap().path()).unwrap();
    fs::read_dir(folder).unwrap().map(|entry| text(entry).lines().filter(|line| line.starts_with("f ")).count()).sum()
}

#[test]
fn generated_scene_in_another_size() {
    let sandbox = Sandbox::new();
    let written = sandbox.run(&["scene", "write", "scape", "--triangles", "1.1e5", "a"]).succeeded().stdout;
    assert!(written.starts_with("a/scape.xml\na/meshes/"), "{written}");
    assert!(written.lines().all(|path| sandbox.path().join(path).is_file()), "{written}");
    let faces = faces(&sandbox.path().join("a/meshes"));
    assert!(faces.abs_diff(110_000) < 2200, "{faces}");
    // Its light is the sky: no method would pay.
    let text = sandbox.render(&["a/scape.xml", "-o", "fog.exr"]).stdout;
    assert!(text.contains("method         none\n"), "{text}");
    let text = sandbox.render(&["a/scape.xml", "-o", "fog.exr", "--segment-first"]).stdout;
    assert!(text.contains("method         amr-xsn"), "{text}");
}

#[test]
fn generated_scene_renders_the_same_from_disk() {
    let sandbox = Sandbox::new();
    sandbox.run(&["scene", "write", "san-miguel"]).succeeded();
    sandbox.render(&["san-miguel.xml", "-o", "disk.exr"]);
    sandbox.render(&["san-miguel", "-o", "builtin.exr"]);
    let compared = sandbox.run(&["compare", "disk.exr", "builtin.exr"]).succeeded().stdout;
    assert!(compared.contains("identical: yes\n"), "{compared}");
}

#[test]
fn sizes_of_generated_scenes() {
    let sandbox = Sandbox::new();
    for n in ["0", "1", "99999", "10000001", "4294967295"] {
        let message = format!("--triangles must be from 100000 to 10000000, not {n}");
        sandbox.fails(&["scene", "write", "san-miguel", "--triangles", n], 2, &[&message]);
    }
    for n in ["-1", "many", "4294967296", "1.5"] {
        sandbox.fails(&["scene", "write", "san-miguel", &format!("--triangles={n}")], 2, &["--triangles", n]);
    }
    let message = "--voxels must be from 32768 to 100000000, not 1000";
    sandbox.fails(&["scene", "write", "smoke", "--voxels", "1000"], 2, &[message]);
    let message = "triangles is not the size of smoke: write --voxels";
    sandbox.fails(&["scene", "write", "smoke", "--triangles", "100000"], 2, &[message]);
    let message = "--triangles is for generated scenes; cbox_vol2 always has the same triangles";
    sandbox.fails(&["scene", "write", "cbox_vol2", "--triangles", "100000"], 2, &[message]);
}

#[test]
fn failures() {
    let sandbox = Sandbox::new();
    sandbox.fails(&["scene", "write", "cbox"], 2, &["no built-in scene is called 'cbox'", "cbox_vol2"]);
    sandbox.fails(&["scene", "erase"], 2, &["erase"]);
    sandbox.write("file", "");
    for name in ["cbox_vol2", "scape"] {
        sandbox.fails(&["scene", "write", name, "file"], 1, &["file"]);
    }
    sandbox.fails(&["scene", "write", "scapes", "--triangles", "100000"], 2, &["called 'scapes'", "scape"]);
}
