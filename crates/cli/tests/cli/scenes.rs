//! `vdf scene`.

use crate::sandbox::Sandbox;

#[test]
fn list() {
    let sandbox = Sandbox::new();
    let names = sandbox.run(&["scene", "list"]).succeeded().stdout;
    let names: Vec<_> = names.lines().collect();
    assert!(names.contains(&"cbox_vol2") && names.contains(&"cbox_vol4"), "{names:?}");
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
fn failures() {
    let sandbox = Sandbox::new();
    sandbox.fails(&["scene", "write", "cbox"], 2, &["no built-in scene is called 'cbox'", "cbox_vol2"]);
    sandbox.fails(&["scene", "erase"], 2, &["erase"]);
    sandbox.write("file", "");
    sandbox.fails(&["scene", "write", "cbox_vol2", "file"], 1, &["file"]);
}
