//! What no run of the program shows: odd figures, and that the data of the thesis is what it should be.

use super::{page::*, plot::*, *};

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
