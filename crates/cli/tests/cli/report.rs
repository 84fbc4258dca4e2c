//! `vdf report` and `vdf render --record-queries`.

use crate::sandbox::{Sandbox, TINY};

const SMALL: [&str; 6] = ["-D", "width=12", "-D", "height=12", "-D", "spp=2"];

fn json(sandbox: &Sandbox, name: &str) -> serde_json::Value {
    serde_json::from_slice(&sandbox.read(name)).unwrap()
}

/// The value of a figure of a report.
#[track_caller]
fn figure(report: &serde_json::Value, quantity: &str, method: &str, voxel_size: Option<f64>) -> f64 {
    let is = |f: &&serde_json::Value| {
        f["quantity"] == quantity && f["method"] == method && f["voxel_size"].as_f64() == voxel_size
    };
    report["figures"].as_array().unwrap().iter().find(is).unwrap()["value"].as_f64().unwrap()
}

#[test]
fn queries_are_recorded_and_replayed() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "plain.exr", "--stats", "fog.json", "--seed", "5"]);
    let out = sandbox.render(&["-o", "fog.exr", "--record-queries", "fog.vdfq", "--seed", "5"]).stdout;
    assert_eq!(sandbox.read("plain.png"), sandbox.read("fog.png"));
    assert!(out.contains(" paths in fog.vdfq"), "{out}");
    let statistics = json(&sandbox, "fog.json");
    let size = sandbox.read("fog.vdfq").len() as u64;
    assert_eq!(size, 80 + 56 * statistics["queries"].as_u64().unwrap());
    // Any number of threads records the same.
    sandbox.render(&["-o", "fog.exr", "--record-queries", "other.vdfq", "--seed", "5", "-j", "3", "--method", "none"]);
    assert_eq!(sandbox.read("fog.vdfq"), sandbox.read("other.vdfq"));

    let args = ["report", "queries", "--queries", "fog.vdfq", "--methods", "amr-sn,ndf,none", "--voxel", "16,32"];
    let files =
        ["--json", "r.json", "--csv", "r.csv", "--html", "r.html", "--export", "out", "--quiet", "--passes", "2"];
    let text = sandbox.run(&[&args[..], &files, &TINY[..4]].concat()).succeeded().stdout;
    let report = json(&sandbox, "r.json");
    assert_eq!(figure(&report, "N", "none", None), statistics["queries"].as_f64().unwrap());
    assert_eq!(figure(&report, "p_sp", "none", None), statistics["p_spatial"].as_f64().unwrap());
    for (method, voxel) in [("amr-sn", 16.0), ("amr-sn", 32.0), ("ndf", 16.0), ("ndf", 32.0)] {
        let value = |quantity: &str| figure(&report, quantity, method, Some(voxel));
        assert!((value("p_acc|sp") + value("u") - 1.0).abs() < 1e-12 && value("p_acc|sp") > 0.0);
        assert!((value("speed-up") / (value("t_query spatial") / value("t_eff")) - 1.0).abs() < 1e-9);
        assert!(text.contains(&format!("{method} at {voxel} (")), "{text}");
    }
    assert_eq!(report["provenance"]["seed"], 5);
    for name in ["command", "version", "profile", "rustc", "cpu", "cores", "os"] {
        assert!(!report["provenance"][name].is_null(), "{name}");
    }
    assert!(report["provenance"]["command"].as_str().unwrap().contains(" report queries --queries fog.vdfq"));
    // The CSV has the same figures, after lines that say where they come from.
    let csv = String::from_utf8(sandbox.read("r.csv")).unwrap();
    assert!(csv.starts_with("# command: ") && csv.contains("\n# processor: "), "{csv}");
    let rows = csv.lines().filter(|l| !l.starts_with('#')).count();
    assert_eq!(rows, 1 + report["figures"].as_array().unwrap().len());
    // The exported stream is the one that was read.
    assert_eq!(sandbox.read("out/queries.bin"), sandbox.read("fog.vdfq"));
    assert_eq!(sandbox.read("out/triangles.bin").len(), 32 + 36 * 30);
}

#[test]
fn a_page_is_one_well_formed_file() {
    let sandbox = Sandbox::new();
    sandbox.run(&["scene", "write", "cbox_vol2"]).succeeded();
    std::fs::rename(sandbox.path().join("cbox_vol2.xml"), sandbox.path().join("a <b> & \"c\".xml")).unwrap();
    let args = [
        "report",
        "queries",
        "a <b> & \"c\".xml",
        "--methods",
        "amr-sn,ndf",
        "--voxel",
        "16,32",
        "--passes",
        "1",
        "-q",
    ];
    sandbox.run(&[&args[..], &["--html", "r.html"], &SMALL].concat()).succeeded();
    let page = String::from_utf8(sandbox.read("r.html")).unwrap();
    check_page(&page);
    assert!(page.contains("<h1>Visibility queries in a &lt;b&gt; &amp; &quot;c&quot;</h1>"), "{page}");
    assert_eq!((page.matches("<figure>").count(), page.matches("<table>").count()), (2, 2));
}

/// Well formed, nothing loaded, both colour schemes, usable on a phone.
#[track_caller]
pub(crate) fn check_page(page: &str) {
    // As XML: the doctype and the elements without an end are HTML's.
    let mut xml = page.replace("<!doctype html>", "");
    for name in ["meta", "link", "img", "input"] {
        let mut parts = xml.split(&format!("<{name} ")).map(str::to_owned).collect::<Vec<_>>();
        for part in &mut parts[1..] {
            let end = part.find('>').unwrap();
            part.insert(end, '/');
        }
        xml = parts.join(&format!("<{name} "));
    }
    let options = roxmltree::ParsingOptions { allow_dtd: false, ..Default::default() };
    let document = roxmltree::Document::parse_with_options(&xml, options).unwrap_or_else(|e| panic!("{e}\n{page}"));
    for node in document.descendants().filter(roxmltree::Node::is_element) {
        assert!(!["iframe", "object"].contains(&node.tag_name().name()), "{node:?}");
        // The only script is that of the sliders; whatever of a scene is in the page cannot get into it.
        if node.has_tag_name("script") {
            assert!(page.contains("class=\"compare\"") && node.attributes().count() == 0, "{node:?}");
            assert!(node.children().all(|c| c.is_text()), "{node:?}");
        }
        for a in node.attributes().filter(|a| ["src", "href"].contains(&a.name())) {
            assert!(a.value().starts_with("data:"), "{}", a.value());
        }
    }
    assert!(!page.contains("url(") && !page.contains("@import"));
    assert!(page.contains("prefers-color-scheme: dark") && page.contains("width=device-width"));
    // Rows are as wide as the header.
    for table in document.descendants().filter(|n| n.has_tag_name("table")) {
        let cells = |name: &'static str| {
            move |row: roxmltree::Node<'_, '_>| row.children().filter(|c| c.has_tag_name(name)).count()
        };
        let rows = || table.descendants().filter(|n| n.has_tag_name("tr"));
        let columns = rows().map(cells("th")).max().unwrap();
        assert!(rows().skip(1).count() > 0 && rows().skip(1).all(|row| cells("td")(row) == columns));
    }
    for number in document.descendants().filter(|n| n.has_tag_name("circle")).flat_map(|n| n.attributes()) {
        assert!(["class", "r"].contains(&number.name()) || number.value().parse::<f64>().unwrap().is_finite());
    }
}

#[test]
fn the_thesis_in_miniature() {
    let sandbox = Sandbox::new();
    let args =
        ["report", "thesis", "--quick", "--size", "4", "--scenes", "cbox_vol2,cbox_vol6", "--methods", "amr-sn,ndf"];
    let files = ["--html", "t.html", "--csv", "t.csv", "--json", "t.json", "-q", "--threads", "3"];
    let text = sandbox.run(&[&args[..], &files].concat()).succeeded().stdout;
    for heading in [
        "Table 6.1:",
        "Table 6.2:",
        "Table 6.3",
        "Table 6.4",
        "Tables 6.5 to 6.10: cbox_vol6",
        "Table 6.11",
        "Inequality 2.7",
    ] {
        assert!(text.contains(heading), "no {heading} in {text}");
    }
    // Facts of the thesis in their places.
    for cell in ["(54.34 %)", "(170.53 M)", "(68.18 %)", "77×73×169 (77×73×169)", "(14.0 ns)", "(75.0 ns)", "(18.9 s)"]
    {
        assert!(text.contains(cell), "no {cell} in {text}");
    }
    let page = String::from_utf8(sandbox.read("t.html")).unwrap();
    check_page(&page);
    assert!(page.contains("src=\"data:image/png;base64,iVBORw0KGgo"));
    let report = json(&sandbox, "t.json");
    let figures = report["figures"].as_array().unwrap();
    // Two methods and the hierarchy, four settings.
    let count = |table: &str| figures.iter().filter(|f| f["table"] == table).count();
    assert_eq!(count("6.11"), 12);
    assert_eq!(count("6.4"), 1 + 2 * 3);
    // Times of renders and of builds on three threads too.
    assert_eq!(count("6.5-6.10"), 4 * (4 + 1 + 2 * (5 + 2)));
    assert_eq!(count("2.7"), 4 * (1 + 2 * (4 + 1)));
    assert_eq!(figures.iter().filter(|f| f["against"] == 3.0).count(), 4 * (1 + 2 * 3));
    assert_eq!((count("6.1"), count("6.2"), count("6.3")), (3, 10, 6));
    assert!(figures.iter().all(|f| f["value"].is_f64()), "a figure is not finite");
}

/// A second run takes what the first has measured, all but the cells that are missing or damaged; other options share nothing with it.
#[test]
fn the_thesis_goes_on_where_it_was_stopped() {
    let sandbox = Sandbox::new();
    let figures = |seed: &str, name: &str| {
        let args =
            ["report", "thesis", "--quick", "--size", "4", "--scenes", "cbox_vol2,cbox_vol6", "--methods", "ndf"];
        let rest = ["--threads", "1", "--resume", "cells", "--seed", seed, "--json", name, "-q"];
        sandbox.run(&[&args[..], &rest].concat()).succeeded();
        json(&sandbox, name)["figures"].as_array().unwrap().clone()
    };
    let first = figures("0", "a.json");
    let cells = || {
        let entries = std::fs::read_dir(sandbox.path().join("cells")).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    let kept = cells();
    // Tables 6.1 to 6.3; for each integrator the hierarchy, its image, its turn, and a method.
    assert_eq!(kept.len(), 3 + 4 * 4, "{kept:?}");
    assert_eq!(figures("0", "b.json"), first, "times, too, come from the cells");
    assert_eq!(cells(), kept);

    let path = |end: &str| {
        let name = kept.iter().find(|name| name.ends_with(end)).unwrap();
        sandbox.path().join("cells").join(name)
    };
    std::fs::remove_file(path("-volpath-ndf-8.json")).unwrap();
    let damaged = path("-raymarch-7-ndf-8.json");
    let text = std::fs::read_to_string(&damaged).unwrap();
    std::fs::write(&damaged, &text[..text.len() / 2]).unwrap();
    let again = figures("0", "c.json");
    assert_eq!(cells(), kept);
    assert_ne!(again, first, "no two measurements are the same");
    let measured_again =
        |f: &serde_json::Value| f["method"] == "ndf" && ["volpath", "raymarch 7"].iter().any(|i| f["integrator"] == *i);
    for (a, b) in again.iter().zip(&first).filter(|(a, _)| !measured_again(a)) {
        assert_eq!(a, b);
    }
    let n = |figures: &[serde_json::Value]| figures.iter().find(|f| f["quantity"] == "N").unwrap()["value"].clone();
    assert_ne!(n(&figures("1", "d.json")), n(&first), "another seed is another run");
}

#[test]
fn scaling_in_miniature() {
    let sandbox = Sandbox::new();
    let small = ["--repetitions", "1", "--size", "8", "--max-voxels-per-side", "64", "--max-lights", "4"];
    let files = ["--html", "s.html", "--csv", "s.csv", "--json", "s.json", "-q", "--max-threads", "3"];
    let args = ["report", "scaling", "--quick", "--max-triangles", "2e5"];
    let text = sandbox.run(&[&args[..], &small, &files].concat()).succeeded().stdout;
    for word in [
        "## Triangles\n",
        "## Triangles of the same shapes",
        "## Voxels",
        "## Lights",
        "## Threads",
        "slope of the last step",
        "Efficiency",
    ] {
        assert!(text.contains(word), "no {word} in {text}");
    }
    let page = String::from_utf8(sandbox.read("s.html")).unwrap();
    check_page(&page);
    assert_eq!((page.matches("<svg viewBox=\"0 0 480").count(), page.matches("<table>").count()), (15, 19));

    let report = json(&sandbox, "s.json");
    let figures = report["figures"].as_array().unwrap();
    let values = |table: &str, quantity: &str| -> Vec<(Option<f64>, f64)> {
        let chosen = figures.iter().filter(|f| f["table"] == table && f["quantity"] == quantity);
        chosen.map(|f| (f["against"].as_f64(), f["value"].as_f64().unwrap())).collect()
    };
    // What does not depend on the clock.
    let hierarchy = values("triangles: Memory", "hierarchy");
    assert!(hierarchy.len() == 2 && hierarchy[0].1 > 36.0 * 1e5 && hierarchy[1].1 > 1.9 * hierarchy[0].1);
    let (sizes, occupied): (Vec<_>, Vec<_>) =
        values("refined: Occupied voxels, and p_acc|sp", "occupied").into_iter().unzip();
    assert_eq!(sizes, [Some(7680.0), Some(30_720.0), Some(122_880.0)]);
    // Rounded middles of edges leave a few voxels or touch a few more.
    assert!(occupied.iter().all(|p| (p / occupied[0] - 1.0).abs() < 1e-3), "{occupied:?}");
    let per_voxel = |name| values("voxels: Memory", name).iter().map(|(x, y)| y / x.unwrap()).collect::<Vec<_>>();
    for (bytes, least) in [(per_voxel("ndf"), 1.0), (per_voxel("amr"), 8.0)] {
        assert!(bytes.len() == 2 && bytes.iter().all(|b| (least..1.2 * least).contains(b)), "{bytes:?}");
    }
    for (x, cube) in values("voxels: Memory", "ndf").iter().zip([32.0_f64, 64.0]) {
        assert!((x.0.unwrap() / cube.powi(3) - 1.0).abs() < 0.15, "{x:?}");
    }
    let exponent = values("voxels: Memory, exponent", "ndf");
    assert!(exponent.len() == 1 && (exponent[0].1 - 1.0).abs() < 0.05, "{exponent:?}");
    assert!(values("voxels: Memory, standard error", "ndf").is_empty(), "two points have none");
    let lights = values("lights: Memory of all neighbourhoods", "xsn");
    assert_eq!(lights.iter().map(|l| l.0.unwrap()).collect::<Vec<_>>(), [1.0, 2.0, 4.0]);
    assert!((lights[2].1 / lights[0].1 - 4.0).abs() < 1e-9, "{lights:?}");
    let threads = values("threads: Time", "render, none");
    assert_eq!(threads.iter().map(|t| t.0.unwrap()).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
    assert!(figures.iter().all(|f| f["value"].is_f64()), "a figure is not finite");
    let csv = String::from_utf8(sandbox.read("s.csv")).unwrap();
    assert!(csv.contains("\ntriangles: Memory,san-miguel,"), "{csv}");
}

#[test]
fn failures() {
    let sandbox = Sandbox::new();
    sandbox.fails(&["report", "queries", "nothing.xml"], 2, &["nothing.xml: no such file", "cbox_vol2"]);
    sandbox.fails(&["report", "queries", "--methods", "none"], 2, &["--methods must name a method"]);
    sandbox.fails(&["report", "queries", "--methods", "magic"], 2, &["magic", "amr-sn"]);
    sandbox.fails(&["report", "queries", "--passes", "0"], 2, &["--passes must be at least 1"]);
    sandbox.fails(&["report", "queries", "--voxel", "8,-1"], 2, &["--voxel must be a positive finite number, not -1"]);
    sandbox.fails(&["report", "queries", "--max-queries", "0"], 2, &["--max-queries must be at least 1"]);
    sandbox.fails(&["report", "queries", "--html", "no/x.html"], 1, &["cannot write no/x.html: No such file"]);
    for (args, part) in [
        (&["--html", "x", "--csv", "./x"][..], "--html and --csv both write ./x"),
        (&["--csv", "x", "--json", "x"], "--csv and --json both write x"),
        (&["--queries", "a.vdfq", "--html", "a.vdfq"], "--queries and --html both write a.vdfq"),
        (&["--export", "out", "--json", "out/queries.bin"], "--export and --json both write out/queries.bin"),
    ] {
        sandbox.fails(&[&["report", "queries"], args].concat(), 2, &[part, "give one of them another name"]);
    }
    sandbox.fails(&["report", "scaling", "--html", "x", "--json", "x"], 2, &["--html and --json both write x"]);
    sandbox.fails(&["report", "queries", "--queries", "no.vdfq"], 2, &["no.vdfq: No such file or directory"]);
    sandbox.fails(&["report", "queries", "--queries", "a", "--spp", "1"], 2, &["cannot be used with"]);
    sandbox.fails(&["report", "thesis", "--scenes", "moon"], 2, &["moon", "san-miguel"]);
    sandbox.fails(&["report", "thesis", "--size", "0"], 2, &["--size must be from 1 to 4096, not 0"]);
    sandbox.fails(&["report", "thesis", "--threads", "0"], 2, &["--threads must be from 1 to 1024, not 0"]);
    sandbox.fails(&["report", "scaling", "--only", "stars"], 2, &["stars", "triangles"]);
    for (option, value, must) in [
        ("max-triangles", "99999", "from 100000 to 10000000, not 99999"),
        ("max-voxels-per-side", "513", "from 32 to 512, not 513"),
        ("max-lights", "0", "from 1 to 1024, not 0"),
        ("max-threads", "0", "from 1 to 1024, not 0"),
        ("repetitions", "0", "from 1 to 1000, not 0"),
        ("size", "0", "from 1 to 4096, not 0"),
        ("threads", "0", "from 1 to 1024"),
    ] {
        let named = format!("--{option}");
        sandbox.fails(&["report", "scaling", &named, value], 2, &[&format!("{named} must be {must}")]);
    }
    sandbox.fails(&["report", "scaling", "--csv", "no/x.csv"], 1, &["cannot write no/x.csv: No such file"]);
    sandbox.fails(&["render", "--record-queries", "no/x.vdfq"], 1, &["cannot write no/x.vdfq: No such file"]);
    sandbox.fails(
        &["render", "--record-queries", "a.exr", "-o", "a.exr"],
        2,
        &["--output and --record-queries both write a.exr"],
    );
    sandbox.fails(&["render", "--record-queries", "a", "--max-queries", "0"], 2, &["--max-queries must be at least 1"]);
    sandbox.fails(&["render", "--max-queries", "9"], 2, &["--record-queries"]);

    // Queries of another scene, and damaged ones.
    sandbox.render(&["--record-queries", "fog.vdfq", "-q"]);
    sandbox.fails(
        &["report", "queries", "cbox_vol3", "--queries", "fog.vdfq"],
        2,
        &["fog.vdfq: recorded in another scene", "name the scene that it was recorded in"],
    );
    let mut bytes = sandbox.read("fog.vdfq");
    bytes[80] ^= 1;
    std::fs::write(sandbox.path().join("fog.vdfq"), &bytes).unwrap();
    sandbox.fails(&["report", "queries", "--queries", "fog.vdfq"], 2, &["fog.vdfq: damaged"]);
}

/// An answer in the file that the hierarchy contradicts is a wrong answer: exit code 1, no report.
#[test]
fn a_wrong_answer_fails() {
    let sandbox = Sandbox::new();
    sandbox.render(&["--record-queries", "fog.vdfq", "-q"]);
    let mut bytes = sandbox.read("fog.vdfq");
    bytes[80 + 56 * 3 + 52] ^= 2;
    let crc = crc32fast::hash(&bytes[80..]);
    bytes[72..76].copy_from_slice(&crc.to_le_bytes());
    std::fs::write(sandbox.path().join("fog.vdfq"), &bytes).unwrap();
    let args = ["report", "queries", "--queries", "fog.vdfq", "--json", "r.json", "-q"];
    sandbox.fails(&[&args[..], &TINY[..4]].concat(), 1, &["WRONG ANSWER: none says", "of query 3, from ["]);
}

#[test]
fn a_report_takes_the_sensor_that_it_is_told() {
    let sandbox = Sandbox::new();
    for report in ["queries", "convergence"] {
        sandbox.fails(&["report", report, "cbox_vol6", "--sensor", "7"], 2, &["the scene has no sensor 7"]);
    }
}
