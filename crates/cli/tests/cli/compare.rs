//! `vdf compare`.

use crate::sandbox::Sandbox;

/// The figures in their order, by name.
fn figures(stdout: &str) -> Vec<(&str, &str)> {
    stdout.lines().map(|l| l.split_once(':').map(|(name, value)| (name, value.trim())).unwrap()).collect()
}

fn figure(stdout: &str, name: &str) -> f64 {
    let (_, value) = figures(stdout).into_iter().find(|(n, _)| *n == name).unwrap();
    value.trim_end_matches(" dB").parse().unwrap()
}

#[test]
fn identical_and_different() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "a.exr", "-j", "1"]);
    sandbox.render(&["-o", "b.exr", "-j", "2", "--method", "none"]);
    sandbox.render(&["-o", "c.exr", "--seed", "1"]);
    let same = sandbox.run(&["compare", "a.exr", "b.exr"]).succeeded();
    let expected = "mse:       0.000000e0\nmae:       0.000000e0\nrelmse:    0.000000e0\npsnr:      inf dB\n\
                    ssim:      1.000000\nflip-ldr:  0.000000\nflip-hdr:  0.000000\nidentical: yes\n";
    assert_eq!(same.stdout, expected);
    let other = sandbox.run(&["compare", "a.exr", "c.exr"]).succeeded().stdout;
    for name in ["mse", "mae", "relmse", "psnr", "flip-ldr", "flip-hdr"] {
        assert!(figure(&other, name) > 0.0, "{other}");
    }
    assert!(figure(&other, "ssim") < 1.0 && other.ends_with("identical: no\n"), "{other}");
    // Values start in one column.
    assert!(other.lines().all(|l| l.as_bytes()[10] == b' ' && l.as_bytes()[11] != b' '), "{other}");
}

#[test]
fn as_json() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "a.exr"]);
    sandbox.render(&["-o", "c.exr", "--seed", "1"]);
    let text = sandbox.run(&["compare", "a.exr", "c.exr"]).succeeded().stdout;
    let json = sandbox.run(&["compare", "a.exr", "c.exr", "--json"]).succeeded().stdout;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let mut names: Vec<_> = json.as_object().unwrap().keys().map(|k| k.replace('_', "-")).collect();
    let mut expected: Vec<_> = figures(&text).into_iter().map(|(name, _)| name.to_owned()).collect();
    names.sort();
    expected.sort();
    assert_eq!(names, expected);
    let (a, b) = (json["relmse"].as_f64().unwrap(), figure(&text, "relmse"));
    assert!((a - b).abs() < 1e-6 * a, "{a} {b}");
    let same = sandbox.run(&["compare", "a.exr", "a.exr", "--json"]).succeeded().stdout;
    let same: serde_json::Value = serde_json::from_str(&same).unwrap();
    assert!(same["psnr"].is_null() && same["identical"] == true && same["flip_hdr"] == 0.0, "{same}");
}

#[test]
fn a_limit_decides_the_exit_code_and_the_figures_are_printed_still() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "a.exr"]);
    sandbox.render(&["-o", "c.exr", "--seed", "1"]);
    let figures = sandbox.run(&["compare", "a.exr", "c.exr", "--max-relmse", "1e9"]).succeeded().stdout;
    let relmse = figure(&figures, "relmse");
    let (below, above) = ((relmse * 0.999).to_string(), (relmse * 1.001).to_string());
    sandbox.run(&["compare", "a.exr", "c.exr", "--max-relmse", &above]).succeeded();
    let failed = sandbox.run(&["compare", "a.exr", "c.exr", "--max-relmse", &below, "--map", "map.png"]);
    assert_eq!((failed.code, failed.stdout.as_str()), (Some(1), figures.as_str()), "{}", failed.stderr);
    assert!(failed.stderr.starts_with("error: relmse ") && failed.stderr.contains("is more than --max-relmse"));
    assert!(sandbox.path().join("map.png").exists());
    // Equality passes.
    sandbox.run(&["compare", "a.exr", "a.exr", "--max-relmse", "0"]).succeeded();
    for bad in ["-1", "NaN", "x"] {
        sandbox.fails(&["compare", "a.exr", "a.exr", "--max-relmse", bad], 2, &["--max-relmse", "0 or more"]);
    }
}

#[test]
fn the_map_is_a_picture_of_the_same_size() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "a.exr", "--crop", "0,0,12,5"]);
    sandbox.render(&["-o", "c.exr", "--crop", "0,0,12,5", "--seed", "1"]);
    sandbox.run(&["compare", "a.exr", "c.exr", "--map", "map.png"]).succeeded();
    let png = sandbox.read("map.png");
    assert_eq!(png[1..4], *b"PNG");
    assert_eq!((png[16..20].to_vec(), png[20..24].to_vec()), (vec![0, 0, 0, 12], vec![0, 0, 0, 5]));
    let text = sandbox.run(&["compare", "a.exr", "c.exr"]).succeeded().stdout;
    assert!(text.contains("\nssim:      none, an image of less than 11 x 11 pixels\n"), "{text}");
    // An image is not a place for the map.
    sandbox.fails(&["compare", "a.exr", "c.exr", "--map", "./c.exr"], 2, &["--map ./c.exr: that is one of the images"]);
    sandbox.fails(&["compare", "a.exr", "c.exr", "--map", "no/map.png"], 1, &["cannot write no/map.png"]);
}

#[test]
fn pngs_have_no_hdr_flip_and_go_with_pngs_only() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "a.exr"]);
    sandbox.render(&["-o", "c.exr", "--seed", "1"]);
    let png = sandbox.run(&["compare", "a.png", "c.png"]).succeeded().stdout;
    let exr = sandbox.run(&["compare", "a.exr", "c.exr"]).succeeded().stdout;
    assert!(!png.contains("flip-hdr") && figure(&png, "relmse") > 0.0, "{png}");
    // A PNG is the EXR, clamped and rounded to 1/510 at most.
    assert!((figure(&png, "flip-ldr") - figure(&exr, "flip-ldr")).abs() < 0.01, "{png} {exr}");
    assert!((figure(&png, "psnr") - figure(&exr, "psnr")).abs() < 0.5, "{png} {exr}");
    for (a, b) in [("a.exr", "c.png"), ("c.png", "a.exr")] {
        sandbox.fails(
            &["compare", a, b],
            2,
            &["a.exr is an EXR and c.png a PNG", "compare EXR with EXR or PNG with PNG"],
        );
    }
}

#[test]
fn flip_depends_on_the_observer() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "a.exr"]);
    sandbox.render(&["-o", "c.exr", "--seed", "1"]);
    let flip = |ppd| figure(&sandbox.run(&["compare", "a.exr", "c.exr", "--ppd", ppd]).succeeded().stdout, "flip-hdr");
    // From afar noise averages out.
    assert!(flip("200") < flip("20"));
    sandbox.fails(&["compare", "a.exr", "c.exr", "--ppd", "-3"], 2, &["--ppd must be from 1 to 1000 pixels, not -3"]);
}

#[test]
fn sizes_differ() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "a.exr"]);
    sandbox.render(&["-o", "b.exr", "--crop", "0,0,8,4"]);
    sandbox.fails(&["compare", "a.exr", "b.exr"], 2, &["differ in size: 16 x 16 and 8 x 4"]);
}

#[test]
fn pixels_that_are_not_finite_are_named() {
    let sandbox = Sandbox::new();
    let mut image = vdf_image::Image::new(5, 4);
    vdf_image::write_exr(&sandbox.path().join("good.exr"), &image, &[]).unwrap();
    image.pixels[13].y = f32::NAN;
    vdf_image::write_exr(&sandbox.path().join("bad.exr"), &image, &[]).unwrap();
    let message = "cannot compare: bad.exr is (0, NaN, 0) at pixel (3, 2), counted from the top left";
    sandbox.fails(&["compare", "good.exr", "bad.exr"], 2, &[message]);
    sandbox.fails(&["compare", "bad.exr", "good.exr", "--map", "map.png"], 2, &[message]);
}

#[test]
fn unreadable() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "a.exr"]);
    sandbox.fails(&["compare", "a.exr", "no.exr"], 2, &["cannot read no.exr: No such file"]);
    sandbox.fails(&["compare", ".", "a.exr"], 2, &["cannot read ."]);
    std::fs::write(sandbox.path().join("text.exr"), "not an image").unwrap();
    sandbox.fails(&["compare", "text.exr", "a.exr"], 2, &["cannot read text.exr: it is neither an OpenEXR nor a PNG"]);
    for (name, whole) in [("cut.exr", "a.exr"), ("cut.png", "a.png")] {
        std::fs::write(sandbox.path().join(name), &sandbox.read(whole)[..200]).unwrap();
        sandbox.fails(&["compare", name, whole], 2, &[&format!("cannot read {name}")]);
    }
}
