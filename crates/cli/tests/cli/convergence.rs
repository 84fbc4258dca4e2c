//! `vdf report convergence`.

use std::fs;

use crate::{
    report::check_page,
    sandbox::{Outcome, Sandbox},
};

/// Tiny, with a method that proves something; all files.
const ARGS: [&str; 12] = [
    "report",
    "convergence",
    "--size",
    "8",
    "--max-spp",
    "4",
    "--methods",
    "amr-xsn",
    "--voxel",
    "32",
    "--cache",
    "references",
];
const FILES: [&str; 7] = ["--html", "c.html", "--csv", "c.csv", "--json", "c.json", "-q"];

fn measure(sandbox: &Sandbox, more: &[&str]) -> Outcome {
    sandbox.run(&[&ARGS[..], &FILES, more].concat())
}

struct Figures(Vec<serde_json::Value>);

impl Figures {
    fn read(sandbox: &Sandbox) -> Self {
        let report: serde_json::Value = serde_json::from_slice(&sandbox.read("c.json")).unwrap();
        Self(report["figures"].as_array().unwrap().clone())
    }

    /// The value of a figure; `method` is empty for errors.
    #[track_caller]
    fn get(&self, quantity: &str, integrator: &str, method: &str, spp: Option<u64>, seed: Option<u64>) -> f64 {
        let is = |f: &&serde_json::Value| {
            f["quantity"] == quantity
                && f["integrator"] == integrator
                && f["method"] == method
                && f["spp"].as_u64() == spp
                && f["seed"].as_u64() == seed
        };
        let found =
            self.0.iter().find(is).unwrap_or_else(|| panic!("no {quantity} {integrator} {method} {spp:?} {seed:?}"));
        found["value"].as_f64().unwrap()
    }

    /// All that depends on no clock.
    fn errors(&self) -> Vec<&serde_json::Value> {
        self.0.iter().filter(|f| f["table"] != "time").collect()
    }
}

fn references(sandbox: &Sandbox) -> Vec<String> {
    let entries = fs::read_dir(sandbox.path().join("references")).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn speed_against_error_in_miniature() {
    let sandbox = Sandbox::new();
    let settings = ["--samples-per-segment", "1,3", "--reference-spp", "4096"];
    let text = measure(&sandbox, &settings).succeeded().stdout;
    for part in ["## volpath", "## raymarch 1", "## raymarch 3", "## Samples per segment", "## Verdict", "93.75 %"] {
        assert!(text.contains(part), "no {part} in {text}");
    }
    let page = String::from_utf8(sandbox.read("c.html")).unwrap();
    check_page(&page);
    // A slider for the fewest samples and one for the most, in each setting; two plots each and one of raymarch.
    assert_eq!((page.matches("type=\"range\"").count(), page.matches("<script>").count()), (6, 1));
    assert_eq!((page.matches("role=\"img\"").count(), page.matches("class=\"band\"").count()), (7, 2 * 6 + 2));

    let figures = Figures::read(&sandbox);
    for (integrator, reference) in [("volpath", "volpath"), ("raymarch 1", "raymarch 3"), ("raymarch 3", "raymarch 3")]
    {
        let floor = figures.get("relMSE floor", reference, "none", Some(4096), None);
        assert!(floor > 0.0 && figures.get("relMSE floor bound", reference, "none", Some(4096), None) > floor);
        for spp in [1, 2, 4].map(Some) {
            let mut errors: Vec<f64> =
                (0..5).map(|seed| figures.get("relMSE with floor", integrator, "", spp, Some(seed)) - floor).collect();
            errors.sort_by(f64::total_cmp);
            let value = |quantity| figures.get(quantity, integrator, "", spp, None);
            let found = ["relMSE low", "relMSE", "relMSE high"].map(value);
            for (found, expected) in found.into_iter().zip([errors[0], errors[2], errors[4]]) {
                assert!((found - expected).abs() <= 1e-12 * (expected.abs() + floor), "{found} {expected}");
            }
            assert!(value("MSE") > 0.0 && value("FLIP") > 0.0 && value("FLIP") < 1.0);
            for method in ["none", "amr-xsn"] {
                let time = |quantity| figures.get(quantity, integrator, method, spp, None);
                let both = ["T_build + T_render low", "T_build + T_render", "T_build + T_render high"].map(time);
                assert!(time("T_render") > 0.0 && both.is_sorted() && both[0] >= time("T_render low"), "{both:?}");
            }
        }
        let value = |quantity, method| figures.get(quantity, integrator, method, None, None);
        assert_eq!((value("gain", "none"), value("T_build", "none")), (1.0, 0.0));
        assert!(value("T_build", "amr-xsn") > 0.0 && value("efficiency", "amr-xsn") > 0.0);
    }
    let csv = String::from_utf8(sandbox.read("c.csv")).unwrap();
    assert!(
        csv.contains("\ntable,scene,integrator,method,voxel_size,spp,seed,against,quantity,unit,value,thesis\n"),
        "{csv}"
    );
    assert_eq!(csv.lines().filter(|l| !l.starts_with('#')).count(), 1 + figures.0.len());

    // The second run takes the same references from the folder and finds the same errors, whatever the number of threads.
    assert_eq!(references(&sandbox).len(), 6);
    let again = measure(&sandbox, &[&settings[..], &["-j", "3"]].concat()).succeeded().stdout;
    assert_eq!((text.matches("kept and checked").count(), again.matches("kept and checked").count()), (0, 2));
    assert_eq!(figures.errors(), Figures::read(&sandbox).errors());
}

/// Whatever is wrong with a reference, it is rendered again, and the errors are what they were.
#[test]
fn references_that_are_not_what_they_should_be_are_rendered_again() {
    let sandbox = Sandbox::new();
    let settings = ["--integrator", "volpath", "--reference-spp", "16"];
    measure(&sandbox, &settings).succeeded();
    let expected = Figures::read(&sandbox);
    let names = references(&sandbox);
    let path = |end: &str| sandbox.path().join("references").join(names.iter().find(|n| n.ends_with(end)).unwrap());
    let check = |why: &str| {
        let outcome = measure(&sandbox, &settings);
        assert_eq!(outcome.code, Some(0));
        assert!(outcome.stderr.starts_with("warning: ") && outcome.stderr.contains(why), "{}", outcome.stderr);
        assert!(outcome.stderr.contains("rendered again") && outcome.stderr.lines().count() == 1, "{}", outcome.stderr);
        assert_eq!(expected.errors(), Figures::read(&sandbox).errors());
        assert_eq!(references(&sandbox), names);
        measure(&sandbox, &settings).succeeded();
    };
    let mut bytes = fs::read(path("-b.exr")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(path("-b.exr"), &bytes).unwrap();
    check("-b.exr: it is damaged");
    fs::remove_file(path("-a.exr")).unwrap();
    check("-a.exr: ");
    fs::write(path(".json"), "{}").unwrap();
    check(".json: it is damaged");
    // Whole and well described, but not what this program renders: the halves change places.
    let (a, b) = (fs::read(path("-a.exr")).unwrap(), fs::read(path("-b.exr")).unwrap());
    fs::write(path("-a.exr"), &b).unwrap();
    fs::write(path("-b.exr"), &a).unwrap();
    let mut description: serde_json::Value = serde_json::from_slice(&fs::read(path(".json")).unwrap()).unwrap();
    description["crc32"].as_array_mut().unwrap().reverse();
    fs::write(path(".json"), description.to_string()).unwrap();
    check("this program renders other pixels");
}

/// Two samples are no reference for four: what is not four times its bound is not claimed, and nothing is made of it.
#[test]
fn what_a_poor_reference_cannot_tell_is_not_claimed() {
    let sandbox = Sandbox::new();
    let text = measure(&sandbox, &["--integrator", "volpath", "--reference-spp", "2"]).succeeded().stdout;
    check_page(&String::from_utf8(sandbox.read("c.html")).unwrap());
    let figures = Figures::read(&sandbox);
    let claimed = [1, 2, 4].map(|spp| {
        let above = |error: &str, bound: &str| {
            let of = |seed| figures.get(error, "volpath", "", Some(spp), Some(seed));
            let mut errors: Vec<f64> = (0..5).map(of).collect();
            errors.sort_by(f64::total_cmp);
            errors[2] >= 4.0 * figures.get(bound, "volpath", "none", Some(2), None)
        };
        let claimed = above("relMSE with floor", "relMSE floor bound") && above("MSE with floor", "MSE floor bound");
        assert_eq!(figures.get("claimed", "volpath", "", Some(spp), None), f64::from(u8::from(claimed)), "{spp}");
        claimed
    });
    assert!(!claimed[2]);
    let refused = claimed.iter().filter(|c| !**c).count();
    assert_eq!(text.matches("no, too near the reference's own").count(), refused);
    assert_eq!(text.contains("No error can be told from that of the reference: it needs more samples"), refused == 3);
    let of_claims = |f: &serde_json::Value| f["quantity"].as_str().unwrap().contains("to relMSE");
    assert_eq!(figures.0.iter().any(of_claims), refused < 3);
}

#[test]
fn failures() {
    let sandbox = Sandbox::new();
    let fails = |args: &[&str], code: i32, parts: &[&str]| {
        sandbox.fails(&[&["report", "convergence", "--quick", "--cache", "references"], args].concat(), code, parts);
    };
    fails(&["nothing.xml"], 2, &["nothing.xml: no such file", "cbox_vol2"]);
    fails(&["--methods", "magic"], 2, &["magic", "amr-sn"]);
    fails(&["--size", "0"], 2, &["--size must be from 1 to 4096, not 0"]);
    fails(&["--max-spp", "0"], 2, &["--max-spp must be from 1 to 16777216, not 0"]);
    fails(&["--reference-spp", "1"], 2, &["--reference-spp must be from 2 to 16777216, not 1"]);
    fails(&["--seeds", "4"], 2, &["--seeds must be from 5 to 1000, not 4"]);
    fails(&["--seed", "18446744073709551612"], 2, &["--seed must be from 0 to 18446744073709551609"]);
    fails(&["--voxel", "-1"], 2, &["--voxel must be a positive finite number, not -1"]);
    fails(&["--threads", "0"], 2, &["--threads must be at least 1"]);
    fails(&["--samples-per-segment", "3,0"], 2, &["--samples-per-segment must be at least 1"]);
    let volpath = ["--integrator", "volpath", "--samples-per-segment", "3"];
    fails(&volpath, 2, &["--samples-per-segment goes with --integrator raymarch only"]);
    fails(&["--html", "no/x.html"], 1, &["cannot write no/x.html: No such file"]);
    // A folder of references that cannot be.
    sandbox.write("file", "");
    let args = ["report", "convergence", "--quick", "--cache", "file/references"];
    sandbox.fails(&args, 1, &["cannot keep references in file/references; choose another folder as the cache"]);
}
