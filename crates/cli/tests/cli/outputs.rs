//! An output never replaces an input or another output, by whatever name; and what hides nothing.

use std::fs;

use crate::sandbox::{Sandbox, TINY};

/// A scene of files in the folder `s`.
fn with_scene() -> Sandbox {
    let sandbox = Sandbox::new();
    sandbox.run(&["scene", "write", "cbox_vol6", "s"]).succeeded();
    sandbox
}

#[test]
fn no_output_replaces_a_file_of_the_scene() {
    let sandbox = with_scene();
    fs::copy(sandbox.path().join("s/cbox_vol6.xml"), sandbox.path().join("s/s.png")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("s/cbox_vol6.xml", sandbox.path().join("link.json")).unwrap();
    let before = fs::read(sandbox.path().join("s/cbox_vol6.xml")).unwrap();
    let mut cases = vec![
        vec!["render", "s/cbox_vol6.xml", "--stats", "s/cbox_vol6.xml"],
        vec!["render", "s/cbox_vol6.xml", "--stats", "s/meshes/../cbox_vol6.xml"],
        vec!["render", "s/cbox_vol6.xml", "--record-queries", "s/meshes/cbox_white.obj"],
        vec!["render", "s/s.png", "-o", "s/s.exr"],
        vec!["verify", "s/cbox_vol6.xml", "--stats", "s/cbox_vol6.xml"],
        vec!["report", "queries", "s/cbox_vol6.xml", "--html", "s/cbox_vol6.xml"],
        vec!["report", "convergence", "s/cbox_vol6.xml", "--csv", "s/meshes/cbox_red.obj"],
    ];
    if cfg!(unix) {
        cases.push(vec!["render", "s/cbox_vol6.xml", "--stats", "link.json"]);
    }
    for args in cases {
        sandbox.fails(&args, 2, &["would overwrite the input"]);
    }
    assert_eq!(fs::read(sandbox.path().join("s/cbox_vol6.xml")).unwrap(), before);
}

#[test]
fn a_folder_hides_no_built_in_scene() {
    let sandbox = Sandbox::new();
    fs::create_dir(sandbox.path().join("cbox_vol6")).unwrap();
    sandbox.render(&["cbox_vol6", "-q"]);
    assert_eq!(sandbox.files(), ["cbox_vol6", "cbox_vol6.exr", "cbox_vol6.png"]);
    fs::create_dir(sandbox.path().join("mine")).unwrap();
    sandbox.fails(&["render", "mine"], 2, &["mine: a folder; name the scene file in it"]);
}

#[test]
fn counts_have_one_limit() {
    let sandbox = Sandbox::new();
    for count in ["1e16", "18446744073709551615", "1.5"] {
        let outcome = sandbox.run(&["verify", "--segments", count]);
        assert_eq!(outcome.code, Some(2), "{count}: {}", outcome.stderr);
    }
}

/// A voxel size that nobody asked for is never the error; one that somebody did is.
#[test]
fn a_scene_far_from_the_origin_renders_by_default() {
    let sandbox = with_scene();
    let path = sandbox.path().join("s/cbox_vol6.xml");
    let text = fs::read_to_string(&path).unwrap();
    sandbox.write("far.obj", "v 100000 0 0\nv 100001 0 0\nv 100000 1 0\nf 1 2 3\n");
    let shape = "<shape type=\"obj\"><string name=\"filename\" value=\"far.obj\"/>\
                 <boolean name=\"face_normals\" value=\"true\"/><bsdf type=\"diffuse\"/></shape></scene>";
    sandbox.write("far.xml", &text.replace("meshes/", "s/meshes/").replace("</scene>", shape));
    let outcome = sandbox.run(&[&["render", "far.xml", "-q"][..], &TINY].concat());
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    sandbox.fails(
        &["render", "far.xml", "--method", "amr", "--voxel", "1e-4"],
        2,
        &["the smallest usable voxel size is"],
    );
}

#[cfg(target_os = "linux")]
#[test]
fn help_that_does_not_arrive_is_a_failure() {
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut command = Sandbox::new().command(&["--help"]);
    assert_eq!(command.current_dir("/").stdout(full).status().unwrap().code(), Some(1));
}
