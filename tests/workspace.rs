//! The house: which crate may know which, and what the README says of the methods.

use std::{collections::BTreeSet, path::Path, process::Command};

/// Who may depend on whom: each crate, and the crates of this workspace that it may know. An arrow that is added here is a decision.
const ARROWS: [(&str, &[&str]); 12] = [
    ("vdf-geometry", &[]),
    ("vdf-voxel", &[]),
    ("vdf-distfield", &["vdf-voxel"]),
    ("vdf-visibility", &["vdf-geometry", "vdf-voxel", "vdf-distfield"]),
    ("vdf-scene", &["vdf-geometry"]),
    ("vdf-image", &[]),
    ("vdf-scenes", &["vdf-scene"]),
    ("vdf-render", &["vdf-geometry", "vdf-voxel", "vdf-distfield", "vdf-visibility", "vdf-scene", "vdf-image"]),
    (
        "vdf-lab",
        &[
            "vdf-geometry",
            "vdf-voxel",
            "vdf-distfield",
            "vdf-visibility",
            "vdf-scene",
            "vdf-image",
            "vdf-render",
            "vdf-scenes",
        ],
    ),
    ("vdf-cli", &["vdf-voxel", "vdf-visibility", "vdf-scene", "vdf-image", "vdf-render", "vdf-scenes", "vdf-lab"]),
    ("vdf-python", &["vdf-geometry", "vdf-visibility", "vdf-scene", "vdf-scenes", "vdf-image", "vdf-render"]),
    (
        "vdf",
        &[
            "vdf-geometry",
            "vdf-voxel",
            "vdf-distfield",
            "vdf-visibility",
            "vdf-scene",
            "vdf-image",
            "vdf-render",
            "vdf-scenes",
            "vdf-lab",
        ],
    ),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn metadata() -> serde_json::Value {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--format-version", "1", "--offline"])
        .current_dir(root())
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("cargo writes JSON")
}

/// Dependencies for tests only are left out: they are no arrow, for nothing that is published has them.
#[test]
fn no_arrow_is_added() {
    let metadata = metadata();
    let packages = metadata["packages"].as_array().expect("a list");
    let name = |value: &serde_json::Value| value["name"].as_str().expect("a name").to_owned();
    let ours: BTreeSet<String> = packages.iter().map(&name).collect();
    let listed: BTreeSet<String> = ARROWS.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(ours, listed, "the crates of the workspace");
    for package in packages {
        let (_, allowed) = ARROWS.iter().find(|(n, _)| *n == name(package)).expect("listed");
        for dependency in package["dependencies"].as_array().expect("a list") {
            let known = name(dependency);
            if ours.contains(&known) && dependency["kind"].as_str() != Some("dev") {
                assert!(allowed.contains(&known.as_str()), "{} must not know {known}", name(package));
            }
        }
    }
}

/// The files of Rust below a folder.
fn sources(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// What a crate includes must be in its own folder, or it cannot be packaged.
#[test]
fn crates_include_only_files_of_their_own() {
    let mut folders: Vec<_> =
        std::fs::read_dir(root().join("crates")).expect("crates").map(|e| e.expect("an entry").path()).collect();
    folders.push(root().join("scenes"));
    for folder in folders {
        let mut files = Vec::new();
        sources(&folder.join("src"), &mut files);
        for file in files {
            let text = std::fs::read_to_string(&file).expect("UTF-8");
            let depth = file.strip_prefix(&folder).expect("below").components().count() - 1;
            for line in text.lines().filter(|l| l.contains("include_str!(") || l.contains("include_bytes!(")) {
                assert!(line.matches("../").count() <= depth, "{}: {line}", file.display());
            }
        }
    }
}

#[test]
fn the_readme_has_the_table_of_methods() {
    let readme = std::fs::read_to_string(root().join("README.md")).expect("the README");
    let table = vdf::visibility::method_table();
    assert!(readme.contains(&table), "put this into README.md:\n{table}");
}

/// A table of which test covers what is worth nothing once a test has another name.
#[test]
fn the_reports_of_users_name_tests_that_exist() {
    let mut files = Vec::new();
    sources(&root().join("crates"), &mut files);
    sources(&root().join("tests"), &mut files);
    let code: Vec<String> = files.iter().map(|f| std::fs::read_to_string(f).expect("UTF-8")).collect();
    let table = std::fs::read_to_string(root().join("docs/reports-of-users.md")).expect("the table");
    let cells =
        table.lines().filter(|l| l.starts_with("| ")).filter_map(|l| l.trim_end_matches(" |").rsplit("| ").next());
    let names: Vec<&str> = cells.flat_map(|cell| cell.split('`').skip(1).step_by(2)).collect();
    assert!(names.len() > 60, "{}", names.len());
    for name in names {
        let test = format!("fn {name}()");
        assert!(code.iter().any(|text| text.contains(&test)), "there is no test {name}");
    }
}
