use vdf_scene::{LoadOptions, Scene};
use vdf_visibility::{LightShape, Method, Quiet};

use super::{
    Choice, Declined, Measured, Places, QueryCost, Work,
    choice::{Plain, best, reason},
    median,
};
use crate::{PrepareOptions, PreparedScene, RenderOptions};

const MICROSECOND: f64 = 1e-6;

fn plain(paths: f64) -> Plain {
    Plain { paths, per_path: 2.0 * MICROSECOND, limit: f64::INFINITY }
}

fn measured(method: &'static str, t_path: f64) -> Measured {
    Measured { method, t_build: 0.3, t_path, answered: 0.9, t_query: 60e-9, t_acc: 25e-9 }
}

/// The same method, at more and more samples: a build of 0.3 s that saves a fifth of a path pays when all paths take seconds.
#[test]
fn what_is_worth_a_trial_depends_on_the_samples() {
    let saves = 0.4 * MICROSECOND;
    let tried: Vec<bool> = [1.0, 8.0, 64.0].map(|spp| plain(65_536.0 * spp).is_worth_trying(0.3, saves)).into();
    assert_eq!(tried, [false, false, true]);
    // What costs next to nothing is tried for any gain, what saves nothing never.
    assert!(plain(65_536.0 * 8.0).is_worth_trying(0.005, 1e-12));
    assert!(!plain(1e9).is_worth_trying(0.0, 0.0));
}

/// A limit of time makes a render short however many samples are asked for.
#[test]
fn a_limit_of_time_is_all_there_is() {
    let limited = Plain { limit: 0.2, ..plain(1e12) };
    assert!((limited.seconds() - 0.2).abs() < 1e-12);
    assert!(!limited.is_worth_trying(0.3, 0.4 * MICROSECOND));
    assert!(plain(1e12).is_worth_trying(0.3, 0.4 * MICROSECOND));
}

#[test]
fn the_fastest_is_taken_if_it_gains() {
    let p = plain(1e6);
    let of = |times: &[f64]| {
        let all: Vec<_> = times.iter().map(|t| measured("lb", t * MICROSECOND)).collect();
        best(&p, &all)
    };
    assert_eq!(of(&[]), None);
    assert_eq!(of(&[1.5, 1.2, 1.3]), Some(1));
    assert_eq!(of(&[2.0]), None);
    assert_eq!(of(&[1.992]), None, "less than a two-hundredth");
    assert_eq!(of(&[1.98]), Some(0));
    assert_eq!(of(&[f64::NAN, 1.5]), Some(1));
}

#[test]
fn reasons_name_what_was_measured() {
    let p = plain(5e5);
    let queries = [QueryCost { per_path: 5.0, seconds: 100e-9 }, QueryCost::default(), QueryCost::default()];
    let lb = [measured("lb", 1.5 * MICROSECOND)];
    assert_eq!(
        reason(&p, &queries, &lb, Some(0), &[], 2),
        "1.50 µs a path instead of 2.00 µs, for 90 % of the queries are answered in 25 ns that take the hierarchy 60 ns; predicted 375.0 ms instead of 500.0 ms"
    );
    let declined = [Declined { method: "lb", t_build: 3.0, saves: 0.2 }];
    assert_eq!(
        reason(&p, &queries, &[], None, &declined, 1),
        "predicted 1.0 s, of which queries take 25 %; lb would take about 3.0 s to build to save about 200.0 ms"
    );
    assert_eq!(
        reason(&p, &queries, &[measured("xsn", 2.1 * MICROSECOND)], None, &[], 1),
        "predicted 1.0 s, of which queries take 25 %; xsn takes 2.10 µs a path instead of 2.00 µs"
    );
}

#[test]
fn a_median_is_of_the_middle() {
    assert_eq!([median(&mut []), median(&mut [3.0]), median(&mut [9.0, 1.0, 2.0, 4.0])], [1.0, 3.0, 3.0]);
}

fn scene(name: &str, defines: &[(&str, &str)]) -> PreparedScene {
    let source = vdf_scenes::builtin(name).expect("it is built in");
    let defines = defines.iter().map(|&(n, v)| (n.to_owned(), v.to_owned())).collect();
    let scene = Scene::from_source(&source, &LoadOptions { defines, sensor: None }).expect("it loads");
    PreparedScene::new(scene, &PrepareOptions::with_method(Method::NONE), &Quiet).expect("nothing is built")
}

/// All over the crop, in it, and each path once.
#[test]
fn places_are_all_over_the_crop() {
    let prepared = scene("cbox_vol2", &[("width", "40"), ("height", "30")]);
    let crop = vdf_scene::PixelRect { x0: 7, y0: 3, x1: 39, y1: 29 };
    for spp in [1, 2, 3, 64] {
        let options = RenderOptions { spp: Some(spp), crop: Some(crop), ..RenderOptions::default() };
        let mut places = Places::new(&prepared.job(&options).expect("usable"));
        let all = [places.next(100), places.next(101)].concat();
        assert_eq!(all.len(), 201);
        assert!(all.iter().all(|&(x, y, s)| (7..39).contains(&x) && (3..29).contains(&y) && s < spp));
        let quarter = |x: u32, y: u32| all.iter().filter(|p| (p.0 >= 23, p.1 >= 16) == (x == 1, y == 1)).count();
        assert!([(0, 0), (0, 1), (1, 0), (1, 1)].iter().all(|&(x, y)| (35..70).contains(&quarter(x, y))), "{all:?}");
    }
}

/// Whatever it chooses, here and on any machine, the image is the same; and it says how it came to that.
#[test]
fn images_are_those_of_any_method() {
    for (name, spp) in [("cbox_vol2", 1), ("cbox_vol2", 40), ("cbox_light", 8)] {
        let plain = scene(name, &[("width", "32"), ("height", "32")]);
        let render = RenderOptions { spp: Some(spp), threads: Some(2), ..RenderOptions::default() };
        // As if the picture were larger, so that methods are built.
        let work = Work { paths: 1024 * 1024 * u64::from(spp), seconds: None };
        let auto = plain.with_best_method(&PrepareOptions::default(), &render, work, &Quiet).expect("it is rendered");
        let choice: Choice = auto.choice().expect("a pilot chose").clone();
        assert_eq!(choice.method, auto.method().name());
        assert!(choice.predicted <= choice.predicted_none && choice.predicted > 0.0, "{choice:?}");
        // Which is tried depends on the machine.
        assert!(choice.measured.len() + choice.declined.len() > 0, "{choice:?}");
        let images = [&plain, &auto].map(|p| p.render(&render, &Quiet).expect("it is rendered"));
        assert!(images[0].image == images[1].image, "{name}");
        assert_eq!(images[1].statistics.choice.as_ref(), Some(&choice));
        assert!(images[1].statistics.to_string().contains(&format!("chosen         {}", choice.reason)));
    }
}

/// Where no light is near there is nothing to build, and where little is to be rendered nothing is.
#[test]
fn nothing_is_built_for_nothing() {
    let sky = scene("scape", &[("width", "16"), ("height", "16")]);
    assert!(crate::light_shapes(sky.scene()).iter().all(|l| matches!(l, LightShape::Infinite)));
    let work = Work { paths: 1 << 30, seconds: None };
    let auto =
        sky.with_best_method(&PrepareOptions::default(), &RenderOptions::default(), work, &Quiet).expect("it runs");
    assert_eq!((auto.method(), auto.choice().expect("a pilot").measured.len()), (Method::NONE, 0));
    let boxes = scene("cbox_vol2", &[]);
    let work = Work { paths: 16, seconds: None };
    let auto =
        boxes.with_best_method(&PrepareOptions::default(), &RenderOptions::default(), work, &Quiet).expect("it runs");
    assert_eq!((auto.method(), auto.choice().expect("a pilot").measured.len()), (Method::NONE, 0));
}
