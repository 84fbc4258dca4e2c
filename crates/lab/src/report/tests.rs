//! What no run of the program shows: odd figures, and that the data of the thesis is what it should be.

use vdf_render::{Integrator, PrepareOptions, PreparedScene, Quiet, RenderOptions};

use super::{page::*, plot::*, *};
use crate::queries::{ReplayOptions, record_queries, tests::lamp};

fn series(points: &[(f64, f64)]) -> Series {
    Series { name: "a <b>".to_owned(), points: points.to_vec(), colour: 1, dash: 0 }
}

fn page(plots: Vec<Plot>) -> String {
    let section = Section { heading: "h".to_owned(), plots, ..Section::default() };
    let page = Page { title: "t".to_owned(), lead: vec![], sections: vec![section] };
    page.html(&Provenance::here(0)).unwrap()
}

#[test]
fn odd_figures_are_plotted_or_left_out() {
    let plot = |points: &[(f64, f64)]| Plot::logarithmic("p & q".to_owned(), "x", "y", vec![series(points)]);
    for none in [&[][..], &[(0.0, 1.0)], &[(1.0, -1.0)], &[(f64::NAN, 1.0)], &[(1.0, f64::INFINITY)]] {
        assert!(plot(none).is_none(), "{none:?}");
    }
    let odd: [&[(f64, f64)]; 5] = [
        &[(1.0, 1.0)],
        &[(3.0, 5.0), (3.0, 5.0)],
        &[(1e-300, 1e-300), (1e300, 1e300)],
        &[(1.0, f64::NAN), (2.0, 3.0)],
        &[(1e6, 20.0), (1e6 + 1.0, 20.000_000_1)],
    ];
    for points in odd {
        let html = page(plot(points).into_iter().collect());
        assert!(html.contains("p &amp; q") && html.contains("a &lt;b&gt;"));
        assert!(!html.contains("NaN") && !html.contains("inf"), "{html}");
        assert!(html.matches("class=\"tick\"").count() < 40);
        for place in html.split("<circle").skip(1).map(|c| c.split('"').nth(3).unwrap().parse::<f64>().unwrap()) {
            assert!((56.0..=468.0).contains(&place), "{place}");
        }
    }
}

#[test]
fn text_is_aligned_and_has_the_figures_of_the_thesis() {
    let rows = vec![
        Row::new(vec!["a".into(), Cell::beside("1.0".to_owned(), Some("2.0".to_owned())).marked(true)]),
        Row::new(vec!["longer".into(), "×".into()]),
    ];
    let table = Table { caption: "c".to_owned(), columns: vec!["name", "n"], rows };
    let section = Section { heading: "h".to_owned(), tables: vec![table], ..Section::default() };
    let page = Page { title: "t".to_owned(), lead: vec![], sections: vec![section] };
    let text = page.text(&Provenance::here(0));
    assert!(text.ends_with("## h\n\nc\nname            n\na       1.0 (2.0)\nlonger          ×\n"), "{text}");
}

/// A report as another program makes it. Where only an area light lights fog there are no spatial queries; those on the light have their
/// own names.
#[test]
fn a_report_without_a_command_line() {
    let prepared = PreparedScene::new(lamp(), &PrepareOptions::with_method(Method::NONE), &Quiet).unwrap();
    let integrator = Integrator::raymarch(3);
    let recorded = RenderOptions { integrator, spp: Some(2), ..RenderOptions::thesis() };
    let stream = record_queries(&prepared, &recorded, 2000, &Quiet).unwrap();
    let options = ReplayOptions { methods: vec![Method::best_with_voxels()], passes: 1, ..ReplayOptions::default() };
    let report = queries::run("lamp", &prepared, &stream, &options, &Quiet).unwrap();
    let value = |quantity: &str, method: &str| {
        let is = |f: &&Figure| f.quantity == quantity && f.method == method;
        report.figures.iter().find(is).map(|f| f.value)
    };
    assert!(value("p_acc on light", "amr-xsn").is_some_and(|p| p > 0.0 && p < 1.0));
    assert!(value("t_query on light", "none").is_some_and(|t| t > 0.0));
    assert_eq!((value("p_acc|sp", "amr-xsn"), value("t_query spatial", "none")), (None, None));
    let text = report.text();
    assert!(text.contains("hierarchy, on an area light") && text.contains("Queries on an area light"), "{text}");
    assert!(!text.contains("command ") && report.warnings.is_empty(), "{text}");
    let json: serde_json::Value = serde_json::from_str(&report.json().unwrap()).unwrap();
    assert_eq!(json["figures"].as_array().unwrap().len(), report.figures.len());
    assert!(json["provenance"]["command"].is_null());
    let csv = report.csv().unwrap();
    assert_eq!(csv.lines().filter(|l| !l.starts_with('#')).count(), 1 + report.figures.len());
    assert!(report.html().unwrap().contains("<h1>Visibility queries in lamp</h1>"));
}

#[test]
fn reports_have_names_of_their_own() {
    for (i, report) in REPORTS.iter().enumerate() {
        assert!(!report.about.is_empty() && REPORTS[..i].iter().all(|r| r.name != report.name), "{report:?}");
    }
}
