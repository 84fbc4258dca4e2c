//! Renders that succeed.

use std::{collections::BTreeMap, fs};

use crate::sandbox::Sandbox;

#[test]
fn writes_image_and_statistics() {
    let sandbox = Sandbox::new();
    let outcome = sandbox.render(&["--method", "amr-sn", "-o", "fog.exr", "--stats", "fog.json"]);
    assert_eq!(sandbox.files(), ["fog.exr", "fog.json", "fog.png"]);
    assert!(sandbox.read("fog.exr").starts_with(&[0x76, 0x2f, 0x31, 0x01]));
    assert!(sandbox.read("fog.png").starts_with(b"\x89PNG"));
    for part in
        ["16 x 16, 1 spp", "method         amr-sn", "T_build", "p_acc|sp", "wrote          fog.exr and fog.png\n"]
    {
        assert!(outcome.stdout.contains(part), "no '{part}' in {}", outcome.stdout);
    }

    let json: BTreeMap<String, serde_json::Value> = serde_json::from_slice(&sandbox.read("fog.json")).unwrap();
    assert_eq!(json["method"], "amr-sn");
    assert_eq!(json["size"], serde_json::json!([16, 16]));
    assert_eq!(json["paths"], 256);
    assert_eq!(json["refused"], 0);
    assert_eq!(json["grid"].as_array().unwrap().len(), 3);
    assert_eq!(json["neighbourhoods"].as_array().unwrap().len(), 1);
    let number = |name: &str| json[name].as_f64().unwrap();
    assert!(number("voxel_size") > 0.0 && number("free_share") < 1.0);
    assert!(number("proved") <= number("spatial") && number("spatial") <= number("queries"));
    let proved = number("p_accelerated_given_spatial");
    assert_eq!(proved, number("proved") / number("spatial"));
    assert_eq!(number("unknown_fraction"), (number("spatial") - number("proved")) / number("spatial"));
    assert!(proved > 0.1, "{proved}");
}

/// The image says which scene it shows: by its content, not by its name, nor by how it was rendered.
#[test]
fn an_exr_has_the_checksum_of_its_scene() {
    let sandbox = Sandbox::new();
    sandbox.run(&["scene", "write", "cbox_vol2", "room"]).succeeded();
    let hash = |args: &[&str]| {
        sandbox.render(&[args, &["-o", "a.exr"]].concat());
        let exr = sandbox.read("a.exr");
        // The name and the type end with a zero; the length has four bytes.
        let key = b"vdf.sceneHash\0string\0\x08\0\0\0";
        let at = exr.windows(key.len()).position(|w| w == key).unwrap() + key.len();
        String::from_utf8(exr[at..at + 8].to_vec()).unwrap()
    };
    let first = hash(&[]);
    assert!(first.bytes().all(|b| b.is_ascii_hexdigit()), "{first}");
    assert_eq!(hash(&["room/cbox_vol2.xml", "--method", "none", "--seed", "7"]), first);
    assert_ne!(hash(&["cbox_vol3"]), first);
    assert_ne!(hash(&["-D", "max_depth=3"]), first);
}

#[test]
fn method_by_default() {
    let sandbox = Sandbox::new();
    let text = |options: &[&str]| sandbox.render(&[&["-o", "fog.exr"], options].concat());
    // A pilot chooses, and only the statistics tell.
    for scene in ["cbox_vol2", "cbox_light", "scape"] {
        let outcome = text(&[scene]);
        assert!(outcome.stdout.contains("\nchosen         "), "{}", outcome.stdout);
        assert!(!outcome.stderr.contains("note: method"), "{}", outcome.stderr);
    }
    // What layers show does not hang on a clock.
    let outcome = text(&["cbox_vol2", "--aov", "unknown"]);
    assert!(outcome.stdout.contains("method         lb"), "{}", outcome.stdout);
    assert!(!outcome.stdout.contains("\nchosen "), "{}", outcome.stdout);
    let outcome = text(&["cbox_light", "--segment-first"]);
    assert!(outcome.stdout.contains("method         amr-xsn"), "{}", outcome.stdout);
    assert!(!outcome.stdout.contains("\nchosen "), "{}", outcome.stdout);
}

/// A pilot says what it chose and why, in the statistics and beside them; the picture is that of any method.
#[test]
fn a_pilot_chooses_the_method() {
    let sandbox = Sandbox::new();
    let run = |method: &str, exr: &str| {
        let size = ["-D", "width=40", "-D", "height=40", "--spp", "16", "--reproducible", "--stats", "fog.json"];
        let outcome = sandbox.run(&[&["render", "--method", method, "-o", exr], &size[..]].concat());
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        let json: serde_json::Value = serde_json::from_slice(&sandbox.read("fog.json")).unwrap();
        (outcome, json)
    };
    assert!(run("none", "none.exr").1["choice"].is_null());
    let (outcome, json) = run("auto", "auto.exr");
    assert_eq!(sandbox.read("auto.exr"), sandbox.read("none.exr"));
    let reason = json["choice"]["reason"].as_str().unwrap();
    assert_eq!(json["choice"]["method"], json["method"]);
    assert!(outcome.stdout.contains(&format!("chosen         {reason}")), "{}", outcome.stdout);
    let note = format!("note: method {}: {reason}", json["method"].as_str().unwrap());
    assert!(outcome.stderr.contains(&note), "{}", outcome.stderr);
}

#[test]
fn flights_are_asked_for_on_demand() {
    let sandbox = Sandbox::new();
    // Here the camera is in the fog.
    let flights = |option: &[&str]| {
        sandbox.render(&[&["cbox_light", "--stats", "fog.json"], option].concat());
        let json: serde_json::Value = serde_json::from_slice(&sandbox.read("fog.json")).unwrap();
        json["flights"].as_u64().unwrap()
    };
    assert_eq!(flights(&[]), 0);
    assert!(flights(&["--segment-first"]) > 100);
}

#[test]
fn statistics_of_the_plain_method() {
    let sandbox = Sandbox::new();
    sandbox.render(&["--method", "none", "--stats", "fog.json"]);
    let json: serde_json::Value = serde_json::from_slice(&sandbox.read("fog.json")).unwrap();
    assert!(json["grid"].is_null() && json["voxel_size"].is_null());
    assert_eq!(json["proved"], 0);
}

#[test]
fn default_name_is_the_scene_in_the_current_folder() {
    let sandbox = Sandbox::new();
    sandbox.render(&[]);
    assert_eq!(sandbox.files(), ["cbox_vol2.exr", "cbox_vol2.png"]);

    fs::create_dir(sandbox.path().join("folder")).unwrap();
    sandbox.run(&["scene", "write", "cbox_vol4", "folder"]).succeeded();
    fs::rename(sandbox.path().join("folder/cbox_vol4.xml"), sandbox.path().join("folder/my room.xml")).unwrap();
    sandbox.render(&["folder/my room.xml"]);
    assert_eq!(sandbox.files(), ["cbox_vol2.exr", "cbox_vol2.png", "folder", "my room.exr", "my room.png"]);
}

#[test]
fn quiet_says_nothing() {
    let sandbox = Sandbox::new();
    let outcome = sandbox.render(&["--quiet", "--stats", "fog.json"]);
    assert_eq!(outcome.stdout, "");
    assert_eq!(sandbox.files(), ["cbox_vol2.exr", "cbox_vol2.png", "fog.json"]);
}

#[test]
fn results_are_replaced() {
    let sandbox = Sandbox::new();
    sandbox.write("fog.exr", "old");
    sandbox.write("fog.png", "old");
    sandbox.render(&["-o", "fog.exr"]);
    assert_eq!(sandbox.files(), ["fog.exr", "fog.png"]);
    assert!(sandbox.read("fog.exr").len() > 100 && sandbox.read("fog.png").len() > 10);
}

#[test]
fn crop_and_raymarch() {
    let sandbox = Sandbox::new();
    let outcome = sandbox.render(&["--crop", "2, 3,10,16", "--integrator", "raymarch", "--samples-per-segment", "3"]);
    assert!(outcome.stdout.contains("8 x 13, 1 spp"), "{}", outcome.stdout);
    assert!(outcome.stdout.contains("raymarch with 3 samples per segment"), "{}", outcome.stdout);
}

#[test]
fn transmittance_is_analytic_unless_asked_for() {
    let sandbox = Sandbox::new();
    for (name, args) in [
        ("default", &[][..]),
        ("analytic", &["--transmittance", "analytic"]),
        ("analog", &["--transmittance", "analog"]),
    ] {
        let used = if name == "analog" { "analog" } else { "analytic" };
        let (exr, json) = (format!("{name}.exr"), format!("{name}.json"));
        let outcome = sandbox.render(&[args, &["-o", &exr, "--stats", &json]].concat());
        assert!(outcome.stdout.contains(&format!("volpath, {used} transmittance")), "{}", outcome.stdout);
        let json: serde_json::Value = serde_json::from_slice(&sandbox.read(&json)).unwrap();
        assert_eq!(json["transmittance"], used);
    }
    let png = |name: &str| sandbox.read(&format!("{name}.png"));
    assert_eq!(png("default"), png("analytic"));
    assert_ne!(png("default"), png("analog"));
}

#[test]
fn estimator_and_sampler_are_those_asked_for() {
    let sandbox = Sandbox::new();
    for (name, args, estimator, sampler) in [
        ("default", &[][..], "equiangular", "sobol"),
        ("thesis", &["--estimator", "thesis", "--sampler", "independent"], "thesis", "independent"),
        ("equiangular", &["--sampler", "independent"], "equiangular", "independent"),
        ("lit", &["--estimator", "lit"], "lit", "sobol"),
        ("sobol", &["--estimator", "thesis"], "thesis", "sobol"),
    ] {
        let (exr, json) = (format!("{name}.exr"), format!("{name}.json"));
        let outcome = sandbox.render(&[args, &["--integrator", "raymarch", "-o", &exr, "--stats", &json]].concat());
        assert!(outcome.stdout.contains(&format!("{estimator} estimator, {sampler} sampler")), "{}", outcome.stdout);
        let json: serde_json::Value = serde_json::from_slice(&sandbox.read(&json)).unwrap();
        assert_eq!((&json["estimator"], &json["sampler"]), (&estimator.into(), &sampler.into()));
    }
    let png = |name: &str| sandbox.read(&format!("{name}.png"));
    assert_ne!(png("default"), png("thesis"));
    assert_ne!(png("default"), png("equiangular"));
    assert_ne!(png("default"), png("sobol"));
}

#[test]
fn failure_keeps_old_results() {
    let sandbox = Sandbox::new();
    sandbox.write("fog.exr", "old");
    sandbox.fails(&["render", "-o", "fog.exr", "--stats", "no/fog.json"], 1, &["no/fog.json"]);
    assert_eq!(sandbox.read("fog.exr"), b"old");
}
