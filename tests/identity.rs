//! One image, byte for byte, whatever the method, the voxel size, the number of threads and the tiles.

mod common;

use common::{all_methods, builtin, options, rendered};
use vdf::render::{IntegratorKind, RenderOptions, Rgb, TransmittanceEstimator, scene::PixelRect};

fn bits(pixels: &[Rgb]) -> Vec<[u32; 3]> {
    pixels.iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

#[test]
fn images_do_not_depend_on_method_voxel_size_or_threads() {
    let size = [("width", "24"), ("height", "20"), ("spp", "2")];
    for name in ["cbox_vol2", "cbox_vol3", "cbox_vol4", "cbox_vol6"] {
        let scene = builtin(name, &size);
        for integrator in [IntegratorKind::Volpath, IntegratorKind::Raymarch { samples_per_segment: 5 }] {
            let base = RenderOptions { integrator, ..options() };
            let reference = rendered(&scene, &base);
            assert!(reference.image.pixels.iter().any(|p| p.max_element() > 0.0), "{name} is black");
            for method in all_methods() {
                // Both numbers of threads meet coarse and fine voxels; their product would only take longer.
                for (voxel_size, threads) in [(4.0, 2), (8.0, 1), (16.0, 2), (100.0, 1)] {
                    let o =
                        RenderOptions { method, voxel_size: Some(voxel_size), threads: Some(threads), ..base.clone() };
                    let r = rendered(&scene, &o);
                    assert!(
                        r.statistics.proved > 0 || voxel_size == 100.0,
                        "{name} {method} {voxel_size}: nothing proved"
                    );
                    assert!(
                        bits(&r.image.pixels) == bits(&reference.image.pixels),
                        "{name} {integrator:?} {method} voxel {voxel_size} threads {threads} differs from none"
                    );
                }
            }
        }
    }
}

/// The 0/1 estimate of transmittance draws its random number whatever a method answers.
#[test]
fn images_of_analog_transmittance_do_not_depend_on_method() {
    let scene = builtin("cbox_vol4", &[("width", "24"), ("height", "20"), ("spp", "2")]);
    for integrator in [IntegratorKind::Volpath, IntegratorKind::Raymarch { samples_per_segment: 5 }] {
        let base = RenderOptions { integrator, transmittance: TransmittanceEstimator::Analog, ..options() };
        let reference = rendered(&scene, &base);
        for method in all_methods() {
            let r = rendered(&scene, &RenderOptions { method, voxel_size: Some(8.0), ..base.clone() });
            assert!(r.statistics.proved > 0, "{method}: nothing proved");
            assert!(
                bits(&r.image.pixels) == bits(&reference.image.pixels),
                "{integrator:?} {method} differs from none"
            );
        }
    }
}

/// Whether a free flight is asked for a proof, is cast alone, or is cut off the whole ray's answer: the events are the same.
#[test]
fn images_do_not_depend_on_segment_first() {
    for name in ["cbox_vol2", "cbox_vol4"] {
        let scene = builtin(name, &[("width", "24"), ("height", "20"), ("spp", "4")]);
        let reference = rendered(&scene, &RenderOptions { segment_first: false, ..options() });
        for method in std::iter::once(vdf::render::Method::None).chain(all_methods()) {
            for segment_first in [true, false] {
                let o = RenderOptions { method, voxel_size: Some(8.0), segment_first, ..options() };
                let r = rendered(&scene, &o);
                assert!(bits(&r.image.pixels) == bits(&reference.image.pixels), "{name} {method} {segment_first}");
            }
        }
    }
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
        let part = rendered(&scene, &RenderOptions { crop: Some(crop), ..options() }).image;
        let mut expected = Vec::new();
        for y in crop.y0..crop.y1 {
            for x in crop.x0..crop.x1 {
                expected.push(whole.pixels[(y * whole.width + x) as usize]);
            }
        }
        assert_eq!(bits(&part.pixels), bits(&expected), "{crop:?}");
    }
}

#[test]
fn the_seed_changes_the_noise() {
    let scene = builtin("cbox_vol2", &[("width", "8"), ("height", "8"), ("spp", "2")]);
    let a = rendered(&scene, &options()).image;
    let b = rendered(&scene, &RenderOptions { seed: Some(99), ..options() }).image;
    assert_ne!(bits(&a.pixels), bits(&b.pixels));
}
