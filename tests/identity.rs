//! One image, byte for byte, whatever the method, the voxel size, the number of threads and the tiles.

mod common;

use common::{Options, all_methods, builtin, options, rendered};
use vdf::{
    render::{
        Estimator, FilmPart, Integrator, LiveFilm, PrepareOptions, PreparedScene, Quiet, RenderOptions, SamplerKind,
        TransmittanceEstimator,
    },
    scene::{LoadOptions, PixelRect, Rgb, Scene},
    visibility::Method,
};

fn bits(pixels: &[Rgb]) -> Vec<[u32; 3]> {
    pixels.iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

/// Renders with all methods and compares with `none`; both numbers of threads meet coarse and fine voxels, as their product would only
/// take longer. Returns how often anything was proved, and how many images were compared.
fn all_alike(name: &str, scene: &Scene, base: &Options, voxel_sizes: &[f64]) -> (usize, usize) {
    let reference = rendered(scene, base);
    assert!(reference.image.pixels.iter().any(|p| p.max_element() > 0.0), "{name} is black");
    let (mut proving, mut images) = (0, 0);
    for method in all_methods() {
        for (&voxel_size, threads) in voxel_sizes.iter().zip([2, 1].into_iter().cycle()) {
            let o = Options { method, voxel_size: Some(voxel_size), threads: Some(threads), ..base.clone() };
            let r = rendered(scene, &o);
            proving += usize::from(r.statistics.proved + r.statistics.on_light_proved > 0);
            images += 1;
            assert!(
                bits(&r.image.pixels) == bits(&reference.image.pixels),
                "{name} {:?} {method} voxel {voxel_size} threads {threads} differs from none",
                base.integrator
            );
        }
    }
    (proving, images)
}

const INTEGRATORS: [Integrator; 2] = [Integrator::Volpath, Integrator::raymarch(5)];

#[test]
fn images_do_not_depend_on_method_voxel_size_or_threads() {
    let size = [("width", "24"), ("height", "20"), ("spp", "2")];
    for name in ["cbox_vol2", "cbox_vol3", "cbox_vol4", "cbox_vol6"] {
        let scene = builtin(name, &size);
        for integrator in INTEGRATORS {
            let base = Options { integrator, ..options() };
            let (proving, images) = all_alike(name, &scene, &base, &[4.0, 8.0, 16.0]);
            assert_eq!(proving, images, "{name}: nothing proved");
            all_alike(name, &scene, &base, &[100.0]);
        }
    }
}

/// Curved shapes and veils, which no method knows, glass with fog inside, turned normals, lights with pictures, and media that change in space; also where
/// free flights are proved.
#[test]
fn images_of_what_methods_know_nothing_of_do_not_depend_on_them() {
    for name in ["curved", "cutouts", "glass", "turned", "grids", "colours"] {
        let path = format!("{}/tests/mitsuba/scenes/{name}.xml", env!("CARGO_MANIFEST_DIR"));
        let defines = [("width", "24"), ("height", "24"), ("spp", "2")];
        let defines = defines.map(|(k, v)| (k.to_owned(), v.to_owned())).into();
        let scene = Scene::load(path.as_ref(), &LoadOptions { defines, sensor: None }).expect("it loads");
        for integrator in INTEGRATORS {
            for segment_first in [false, true] {
                let base = Options { integrator, segment_first, ..options() };
                let (_, images) = all_alike(name, &scene, &base, &[0.2]);
                assert!(images > 0, "{name}: nothing compared");
            }
        }
    }
}

/// The 0/1 estimate of transmittance draws its random number whatever a method answers.
#[test]
fn images_of_analog_transmittance_do_not_depend_on_method() {
    let scene = builtin("cbox_vol4", &[("width", "24"), ("height", "20"), ("spp", "2")]);
    for integrator in INTEGRATORS {
        let base = Options { integrator, transmittance: TransmittanceEstimator::Analog, ..options() };
        let (proving, images) = all_alike("analog", &scene, &base, &[8.0]);
        assert_eq!(proving, images, "nothing proved");
    }
}

/// Every other estimator and sampler.
#[test]
fn images_of_each_estimator_and_sampler_do_not_depend_on_method() {
    for (name, proved) in [("cbox_vol2", true), ("cbox_vol4", true), ("cbox_light", false)] {
        let scene = builtin(name, &[("width", "24"), ("height", "20"), ("spp", "2")]);
        for integrator in INTEGRATORS {
            for estimator in Estimator::ALL {
                for sampler in SamplerKind::ALL {
                    if (estimator, sampler) == Default::default() {
                        continue;
                    }
                    let base = Options { integrator, estimator, sampler, ..options() };
                    let (proving, images) = all_alike(name, &scene, &base, &[8.0]);
                    // Where distances are drawn towards a light other questions are asked, and few: not every method proves one of them. Where it is
                    // known what is lit, none is asked.
                    let asked = proved && (integrator, estimator) != (INTEGRATORS[1], Estimator::Lit);
                    assert!(!asked || 2 * proving > images, "{name}: hardly anything proved");
                }
            }
        }
    }
}

/// Whether a free flight is asked for a proof, is cast alone, or is cut off the whole ray's answer: the events are the same.
#[test]
fn images_do_not_depend_on_segment_first() {
    for name in ["cbox_vol2", "cbox_vol4"] {
        let scene = builtin(name, &[("width", "24"), ("height", "20"), ("spp", "4")]);
        let reference = rendered(&scene, &Options { segment_first: false, ..options() });
        for method in std::iter::once(Method::NONE).chain(all_methods()) {
            for segment_first in [true, false] {
                let o = Options { method, voxel_size: Some(8.0), segment_first, ..options() };
                let r = rendered(&scene, &o);
                assert!(bits(&r.image.pixels) == bits(&reference.image.pixels), "{name} {method} {segment_first}");
            }
        }
    }
}

#[test]
fn generated_scenes_are_alike_with_all_methods() {
    for name in ["san-miguel", "scape"] {
        let scene = builtin(name, &[("width", "12"), ("height", "12"), ("spp", "1")]);
        for integrator in INTEGRATORS {
            let (proving, images) = all_alike(name, &scene, &Options { integrator, ..options() }, &[0.5]);
            // A sky has no light buffer and no neighbourhood: `lb` and `xsn` have nothing else.
            let mute = if name == "scape" { 2 } else { 0 };
            assert_eq!(proving + mute, images, "{name}: nothing proved");
        }
    }
}

#[test]
fn an_area_light_is_alike_with_all_methods() {
    let scene = builtin("cbox_light", &[("width", "24"), ("height", "20"), ("spp", "4")]);
    for integrator in INTEGRATORS {
        let (proving, images) = all_alike("ceiling light", &scene, &Options { integrator, ..options() }, &[8.0, 16.0]);
        // All 16 methods but the four plain ones, which have no neighbourhoods.
        assert_eq!(proving * 16, images * 12);
    }
}

/// A ray is cast for every flight that is not proved free: what is proved must change nothing, and save something.
#[test]
fn segment_first_saves_rays_and_nothing_else() {
    let scene = builtin("cbox_vol4", &[("width", "24"), ("height", "20"), ("spp", "2")]);
    let base = Options { method: Method::best_with_voxels(), voxel_size: Some(8.0), ..options() };
    let first = rendered(&scene, &base);
    let cast = rendered(&scene, &Options { segment_first: false, ..base });
    assert!(bits(&first.image.pixels) == bits(&cast.image.pixels));
    assert_eq!((cast.statistics.flights, cast.statistics.flights_proved), (0, 0));
    assert_eq!(first.statistics.rays + first.statistics.flights_proved, cast.statistics.rays);
    assert!(first.statistics.flights_proved * 2 > first.statistics.flights);
}

#[test]
fn a_crop_is_a_part_of_the_whole() {
    let scene = builtin("cbox_vol2", &[("width", "40"), ("height", "36"), ("spp", "2")]);
    let whole = rendered(&scene, &options()).image;
    for crop in [
        PixelRect { x0: 0, y0: 0, x1: 40, y1: 36 },
        PixelRect { x0: 7, y0: 17, x1: 33, y1: 20 },
        PixelRect { x0: 39, y0: 35, x1: 40, y1: 36 },
    ] {
        let part = rendered(&scene, &Options { crop: Some(crop), ..options() }).image;
        let mut expected = Vec::new();
        for y in crop.y0..crop.y1 {
            for x in crop.x0..crop.x1 {
                expected.push(whole.pixels[(y * whole.width + x) as usize]);
            }
        }
        assert_eq!(bits(&part.pixels), bits(&expected), "{crop:?}");
    }
}

/// However the samples of the pixels are divided and in whatever order the parts arrive.
#[test]
fn an_image_is_the_sum_of_its_parts() {
    let scene = builtin("cbox_vol2", &[("width", "12"), ("height", "9")]);
    let prepared = PreparedScene::new(scene, &PrepareOptions::default(), &Quiet).expect("a sound scene");
    for sampler in SamplerKind::ALL {
        let o = RenderOptions { spp: Some(11), sampler, ..RenderOptions::default() };
        let whole = prepared.render(&o, &Quiet).expect("usable options").image;
        let part = |samples| {
            let film = LiveFilm::new(prepared.film(&o, "box").expect("usable options"));
            prepared.render_part(&o, &film, &FilmPart::samples(samples), &Quiet).expect("usable options");
            film.into_film()
        };
        let mut film = part(3..8);
        film.merge(part(8..11)).expect("the same render");
        film.merge(part(0..3)).expect("the same render");
        let image = film.develop().expect("all samples");
        assert!(bits(&image.pixels) == bits(&whole.pixels));
        assert_eq!((image.origin, image.full_size), (whole.origin, whole.full_size));
    }
}

#[test]
fn the_seed_changes_the_noise() {
    let scene = builtin("cbox_vol2", &[("width", "8"), ("height", "8"), ("spp", "2")]);
    let a = rendered(&scene, &options()).image;
    let b = rendered(&scene, &Options { seed: Some(99), ..options() }).image;
    assert_ne!(bits(&a.pixels), bits(&b.pixels));
}
