//! Files that are no plain files, or too large, are refused before they are read.

use std::path::{Path, PathBuf};

use vdf_scene::{LoadOptions, Scene};

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).expect("the folder can be made");
    folder
}

fn message(path: &Path) -> String {
    Scene::load(path, &LoadOptions::default()).expect_err("this must be refused").to_string()
}

fn naming(folder: &Path, body: &str) -> PathBuf {
    let path = folder.join("scene.xml");
    std::fs::write(&path, format!("<scene version=\"3.0.0\">{body}</scene>")).expect("it can be written");
    path
}

#[test]
fn folders_are_refused() {
    let folder = folder("folders");
    assert!(message(&folder).contains("it is a folder"));
    assert!(message(&naming(&folder, "<include filename='.'/>")).contains("it is a folder"));
    assert!(message(&folder.join("missing.xml")).contains("cannot read"));
}

/// To open a pipe that nobody writes to blocks, and a device may never end.
#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused() {
    let folder = folder("devices");
    let pipe = folder.join("pipe.xml");
    let _ = std::fs::remove_file(&pipe);
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo runs").success());
    for special in [pipe.as_path(), Path::new("/dev/zero")] {
        let name = special.display();
        assert!(message(special).contains("a pipe or a device"), "{}", message(special));
        assert!(message(&naming(&folder, &format!("<include filename='{name}'/>"))).contains("a pipe or a device"));
        let mesh = format!("<shape type='obj'><string name='filename' value='{name}'/></shape>");
        assert!(message(&naming(&folder, &mesh)).contains("a pipe or a device"));
    }
}

/// The files have holes: they take no room on the disk.
#[test]
fn sizes_are_bounded() {
    let folder = folder("sizes");
    let large = folder.join("large.xml");
    std::fs::File::create(&large).and_then(|f| f.set_len((64 << 20) + 1)).expect("a file can have a hole");
    assert!(message(&large).contains("at most 67108864 are read"), "{}", message(&large));
    std::fs::File::create(&large).and_then(|f| f.set_len((8 << 30) + 1)).expect("a file can have a hole");
    let mesh = naming(&folder, "<shape type='obj'><string name='filename' value='large.xml'/></shape>");
    assert!(message(&mesh).contains("at most 8589934592 are read"), "{}", message(&mesh));
    let _ = std::fs::remove_file(large);
}
