//! Whatever is wrong: one message, the right exit code, and no files.

use crate::sandbox::{Sandbox, TINY};

/// A tiny render with `args` fails with this code and message.
#[track_caller]
fn render_fails(args: &[&str], code: i32, parts: &[&str]) {
    Sandbox::new().fails(&[&["render"], args, &TINY].concat(), code, parts);
}

/// A scene file with this text is refused with this message.
#[track_caller]
fn scene_fails(text: &str, parts: &[&str]) {
    let sandbox = Sandbox::new();
    sandbox.write("bad.xml", text);
    sandbox.fails(&["render", "bad.xml"], 2, parts);
}

#[test]
fn missing_scene() {
    render_fails(&["nothing.xml"], 2, &["nothing.xml: no such file", "cbox_vol2"]);
    render_fails(&[""], 2, &["[SCENE]"]);
    render_fails(&["."], 2, &["."]);
}

#[test]
fn missing_mesh() {
    let text = "<scene version=\"3.0.0\">\n  <shape type=\"obj\">\n    <string name=\"filename\" value=\"no.obj\"/>\n  </shape>\n</scene>\n";
    scene_fails(text, &["no.obj"]);
}

#[test]
fn unknown_element() {
    scene_fails("<scene version=\"3.0.0\">\n  <gizmo/>\n</scene>\n", &["bad.xml:2:3: <gizmo> is not supported"]);
}

#[test]
fn broken_xml() {
    scene_fails("<scene version=\"3.0.0\">\n  <sensor\n", &["bad.xml:"]);
    scene_fails("<scene version=\"3.0.0\">\n</sensor>\n", &["bad.xml:2:"]);
    scene_fails("", &["bad.xml: the file is empty"]);
    scene_fails("\u{0}\u{1}\u{2}", &["bad.xml:"]);
}

/// An option that would do nothing is a mistake.
#[test]
fn options_without_effect() {
    for how in [&["--integrator", "raymarch"][..], &["--estimator", "thesis"]] {
        render_fails(&[&["--light-paths", "always"], how].concat(), 2, &["--light-paths always goes with"]);
    }
    for how in [&["--integrator", "raymarch"][..], &["--method", "none"]] {
        render_fails(&[&["--segment-first"], how].concat(), 2, &["--segment-first goes with"]);
    }
    render_fails(&["--light-buffer", "8", "--method", "amr"], 2, &["--light-buffer goes with --method lb or auto"]);
    let sequence = ["--sequence", "max_depth=2..3", "-D", "max_depth=4", "-o", "a#.exr"];
    render_fails(&sequence, 2, &["--sequence max_depth=2..3: -D max_depth is given as well"]);
    render_fails(&["--sequence", "rr_depth=-1..3", "-o", "a#.exr"], 2, &["frame 1: "]);
}

#[test]
fn voxel_size() {
    for size in ["0", "-1", "nan", "inf", "-inf", "-0"] {
        render_fails(&[&format!("--voxel={size}")], 2, &["--voxel must be a positive finite number, not "]);
    }
    render_fails(&["--voxel", "-1"], 2, &["--voxel must be a positive finite number, not -1"]);
    render_fails(&["--voxel", "small"], 2, &["'small'", "--voxel"]);
}

#[test]
fn voxel_size_too_small() {
    for size in ["1e-9", "1e-300", "0.01"] {
        let args = [&["render", "--method", "amr-sn", "--voxel", size], &TINY[..]].concat();
        let outcome = Sandbox::new().fails(&args, 2, &["the smallest usable voxel size is "]);
        let smallest = outcome.stderr.rsplit(' ').next().unwrap().trim().parse::<f64>().unwrap();
        assert!(smallest > size.parse().unwrap() && smallest < 10.0, "{smallest}");
    }
}

#[test]
fn output_cannot_be_written() {
    render_fails(&["-o", "no/fog.exr"], 1, &["cannot write no/fog.exr: No such file or directory"]);
    render_fails(&["--stats", "no/fog.json"], 1, &["cannot write no/fog.json: No such file or directory"]);
    render_fails(&["--stats", "."], 1, &["cannot write .: it is a directory"]);
    let sandbox = Sandbox::new();
    std::fs::create_dir(sandbox.path().join("fog.png")).unwrap();
    sandbox.fails(&["render", "-o", "fog.exr"], 1, &["cannot write fog.png: it is a directory"]);
}

#[test]
fn output_of_another_format() {
    for name in ["fog", "fog.png", "exr", ".exr", "fog.exr.gz"] {
        render_fails(&["-o", name], 2, &["the output must end in .exr"]);
    }
}

#[test]
fn outputs_collide() {
    for stats in ["fog.exr", "./fog.png"] {
        render_fails(&["-o", "fog.exr", "--stats", stats], 2, &["--stats", "both write", "another name"]);
    }
}

#[test]
fn options_out_of_range() {
    let sandbox = Sandbox::new();
    sandbox.fails(&["render", "--spp", "0"], 2, &["--spp must be at least 1"]);
    sandbox.fails(&["render", "--spp", "-1"], 2, &["-1"]);
    sandbox.fails(&["render", "--spp", "4294967296"], 2, &["4294967296"]);
    render_fails(&["-j", "0"], 2, &["--threads must be at least 1"]);
    render_fails(&["-j", "70000"], 2, &["--threads must be at most 4096"]);
    render_fails(&["--seed", "x"], 2, &["--seed"]);
    render_fails(&["--method", "magic"], 2, &["magic", "amr-sn"]);
    render_fails(&["--integrator", "magic"], 2, &["magic", "volpath"]);
    render_fails(&["--transmittance", "magic"], 2, &["magic", "analytic, analog"]);
    render_fails(&["--estimator", "magic"], 2, &["magic", "thesis, equiangular"]);
    render_fails(&["--sampler", "magic"], 2, &["magic", "independent, sobol"]);
    render_fails(&["--samples-per-segment", "7"], 2, &["--samples-per-segment", "--integrator raymarch"]);
    render_fails(
        &["--integrator", "raymarch", "--samples-per-segment", "0"],
        2,
        &["--samples-per-segment must be at least 1"],
    );
}

#[test]
fn unknown_arguments() {
    render_fails(&["--sppp", "1"], 2, &["--sppp"]);
    render_fails(&["cbox_vol2", "cbox_vol4"], 2, &["cbox_vol4"]);
    Sandbox::new().fails(&["paint"], 2, &["paint"]);
    Sandbox::new().fails(&["compare", "a.exr"], 2, &["<B>"]);
}

#[test]
fn crop() {
    for (crop, message) in [
        ("1,2,3", "expected four numbers"),
        ("1,2,3,4,5", "expected four numbers"),
        ("a,2,3,4", "'a' is not a number of pixels"),
        ("", "not a number of pixels"),
        ("-1,0,4,4", "not a number of pixels"),
        ("0,0,17,16", "0 ≤ x0 < x1 ≤ 16"),
        ("0,0,16,17", "0 ≤ y0 < y1 ≤ 16"),
        ("4,4,4,8", "must be x0,y0,x1,y1"),
        ("8,4,4,8", "must be x0,y0,x1,y1"),
    ] {
        render_fails(&[&format!("--crop={crop}")], 2, &["--crop", message]);
    }
}

#[test]
fn defines() {
    let sandbox = Sandbox::new();
    sandbox.fails(&["render", "-D", "width"], 2, &["expected NAME=VALUE"]);
    sandbox.fails(&["render", "-D", "=3"], 2, &["expected NAME=VALUE"]);
    sandbox.fails(&["render", "-D", "widht=3"], 2, &["-D widht: the scene does not use $widht", "width"]);
    sandbox.fails(&["render", "-D", "width=wide"], 2, &["cbox_vol2.xml:", "wide"]);
    sandbox.fails(&["render", "-D", "width=0"], 2, &["cbox_vol2.xml:"]);
    sandbox.fails(&["render", "-D", "width=-4"], 2, &["cbox_vol2.xml:"]);
}
