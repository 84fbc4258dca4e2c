//! `vdf verify`.

use crate::sandbox::Sandbox;

/// The number in the line that starts with `name`, at place `column` after it.
#[track_caller]
fn figure(text: &str, name: &str, column: usize) -> f64 {
    let line = text.lines().find(|l| l.split_whitespace().next() == Some(name)).unwrap();
    line.split_whitespace().nth(column).unwrap().parse().unwrap()
}

#[test]
fn a_sound_scene() {
    let sandbox = Sandbox::new();
    let args =
        ["verify", "--segments", "2.4e4", "--voxel", "8,16", "--grid", "scene", "--quiet", "--stats", "verify.json"];
    let out = sandbox.run(&args).succeeded().stdout;
    assert!(out.contains("voxel 8, grid 77 x 73 x 169") && out.contains("voxel 16, grid 39 x 37 x 85"), "{out}");
    for class in
        ["random", "light", "vertex", "edge", "surface", "lattice", "corner", "axis", "short", "outside", "occupied"]
    {
        assert!((figure(&out, class, 1) - 2000.0).abs() < 3.0 && figure(&out, class, 4) == 0.0, "{out}");
    }
    let proved = figure(&out, "total", 2);
    assert!(figure(&out, "total", 1) == 24_000.0 && proved > 2000.0 && figure(&out, "total", 4) == 0.0, "{out}");
    assert!((figure(&out, "total", 5) * proved - 3.0).abs() < 0.3, "{out}");
    for method in ["ndf", "amr", "ndf-sn", "amr-sn"] {
        assert!(figure(&out, method, 1) > 1000.0 && figure(&out, method, 2) == 0.0, "{out}");
    }

    let json: serde_json::Value = serde_json::from_slice(&sandbox.read("verify.json")).unwrap();
    assert_eq!(json["total"]["segments"], 24_000);
    assert_eq!(json["total"]["proved"].as_f64(), Some(proved));
    assert_eq!(json["classes"][0]["class"], "random");
    assert_eq!((json["total"]["wrong"].as_u64(), json["checks"]["disagreements"].as_u64()), (Some(0), Some(0)));
    assert_eq!(sandbox.files(), ["verify.json"]);
}

#[test]
fn one_method_and_a_scene_file() {
    let sandbox = Sandbox::new();
    sandbox.run(&["scene", "write", "cbox_vol3"]).succeeded();
    let args = ["verify", "cbox_vol3.xml", "--method", "amr-sn,ndf,amr-sn", "--segments", "5000", "-j", "1", "-q"];
    let out = sandbox.run(&args).succeeded().stdout;
    assert!(out.contains("seed 0, 1 threads, 30 triangles"), "{out}");
    assert!(figure(&out, "amr-sn", 1) > 0.0 && figure(&out, "ndf", 1) > 0.0 && !out.contains("ndf-sn"), "{out}");
    // Without a terminal progress would be lines on stderr, every few seconds.
    sandbox.run(&["verify", "--segments", "1", "--seed", "9"]).succeeded();
}

#[test]
fn failures() {
    let sandbox = Sandbox::new();
    sandbox.fails(&["verify", "nothing.xml"], 2, &["nothing.xml: no such file", "cbox_vol2"]);
    sandbox.fails(&["verify", "--segments", "0"], 2, &["--segments must be at least 1"]);
    for n in ["-1", "1.5", "x", "nan", "inf", ""] {
        sandbox.fails(&["verify", &format!("--segments={n}")], 2, &["--segments", "a whole number of at most 1e15"]);
    }
    sandbox.fails(&["verify", "--method", "none"], 2, &["--method must name methods that prove something"]);
    sandbox.fails(&["verify", "--method", "magic"], 2, &["magic", "amr-sn"]);
    sandbox.fails(&["verify", "--voxel", "8,-1"], 2, &["--voxel must be a positive finite number, not -1"]);
    sandbox.fails(&["verify", "--voxel", "1e-9"], 2, &["the smallest usable voxel size is "]);
    sandbox.fails(&["verify", "-j", "0"], 2, &["--threads must be at least 1"]);
    sandbox.fails(&["verify", "--stats", "no/x.json"], 1, &["cannot write no/x.json: No such file or directory"]);
    sandbox.fails(&["verify", "-D", "widht=3"], 2, &["-D widht: the scene does not use $widht"]);
}
