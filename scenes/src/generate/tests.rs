//! What every generated scene must keep.

use std::io::{self, Write};

use vdf_geometry::{Bounds, Triangle};
use vdf_scene::{LoadOptions, Scene};

use super::*;
use crate::builtin;

/// FNV-1a of the bytes.
struct Checksum(u64);

impl Write for Checksum {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        for &b in bytes {
            self.0 = (self.0 ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn checksum(scene: GeneratedScene) -> u64 {
    let mut sum = Checksum(0xcbf2_9ce4_8422_2325);
    for file in scene.files() {
        sum.write_all(file.path.as_bytes()).unwrap();
        file.write(&mut sum).unwrap();
    }
    sum.0
}

fn scene(name: &str, defines: &[(&str, &str)]) -> Scene {
    let defines = defines.iter().map(|(n, v)| ((*n).to_owned(), (*v).to_owned())).collect();
    Scene::from_source(&builtin(name).unwrap(), &LoadOptions { defines, ..LoadOptions::default() }).unwrap()
}

/// The same bytes on every platform. Whoever changes a scene on purpose changes these numbers.
#[test]
fn the_bytes_are_always_the_same() {
    for (name, expected) in
        [("san-miguel", 0x293d_e416_45ec_9865), ("scape", 0x0854_a97c_83e1_c71a), ("smoke", 0x4ee4_b7e5_623d_65fd)]
    {
        let scene = generated(name).unwrap();
        let smallest = match scene.size() {
            Size::Triangles(_) => scene.with_triangles(GeneratedScene::MIN_TRIANGLES).unwrap(),
            Size::Voxels(_) => scene.with_voxels(GeneratedScene::MIN_VOXELS).unwrap(),
        };
        let sum = checksum(smallest);
        assert_eq!(sum, expected, "{name}: {sum:#018x}");
        assert_ne!(sum, checksum(generated(name).unwrap()));
    }
}

#[test]
fn the_number_of_triangles_is_met() {
    for recipe in RECIPES {
        let Size::Triangles(default) = recipe.default_size else { continue };
        for triangles in [100_000, 123_457, default, 1_000_000, 3_000_000] {
            let counts: Vec<_> = recipe.meshes.iter().map(|(_, mesh)| count(&[*mesh], triangles).unwrap()).collect();
            let made: u32 = counts.iter().sum();
            assert!(made.abs_diff(triangles) <= triangles / 200, "{}: {made} of {triangles}", recipe.name);
            assert!(counts.iter().all(|&n| n > 0), "{}, {triangles}: {counts:?}", recipe.name);
        }
    }
}

#[test]
fn sizes_out_of_range_are_refused() {
    let scene = generated("scape").unwrap();
    for n in [0, GeneratedScene::MIN_TRIANGLES - 1, GeneratedScene::MAX_TRIANGLES + 1, u32::MAX] {
        let error = scene.with_triangles(n).unwrap_err().to_string();
        assert!(error.contains("triangles must be from 100000 to 10000000"), "{error}");
    }
    let most = scene.with_triangles(GeneratedScene::MAX_TRIANGLES).unwrap();
    assert_eq!(most.size(), Size::Triangles(10_000_000));
    assert!(scene.with_voxels(1 << 20).unwrap_err().to_string().contains("write --triangles"));
    let smoke = generated("smoke").unwrap();
    assert!(smoke.with_triangles(1 << 20).unwrap_err().to_string().contains("write --voxels"));
    for n in [0, GeneratedScene::MIN_VOXELS - 1, GeneratedScene::MAX_VOXELS + 1] {
        assert!(smoke.with_voxels(n).unwrap_err().to_string().contains("voxels must be from 32768 to 100000000"));
    }
    assert_eq!(smoke.with_voxels(1 << 20).unwrap().size(), Size::Voxels(1 << 20));
    assert!(generated("cbox_vol2").is_none());
}

#[test]
fn geometry_is_inside_the_fog_and_has_area() {
    for recipe in RECIPES.into_iter().filter(|recipe| recipe.volumes.is_empty()) {
        let scene = scene(recipe.name, &[]);
        let fog = Bounds::of_triangles(&scene.boundaries[0].triangles);
        for surface in &scene.surfaces {
            for p in surface.triangles.iter().flat_map(Triangle::vertices_f64) {
                assert!(p.cmpgt(fog.min).all() && p.cmplt(fog.max).all(), "{}: {p}", recipe.name);
            }
            let flat = surface.triangles.iter().find(|t| t.area_normal() == glam::DVec3::ZERO);
            assert_eq!(flat, None, "{}", recipe.name);
        }
        assert_eq!(scene.boundaries.len(), 1);
        assert_eq!(scene.emitters.len(), 1);
    }
}

/// The volume that is written is the one that is loaded, in its box.
#[test]
fn smoke_is_a_grid_in_its_box() {
    let smoke = scene("smoke", &[]);
    assert_eq!(smoke.warnings, Vec::<String>::new());
    let vdf_scene::Extinction::Grid { volume, scale } = &smoke.media[0].sigma_t else { panic!("no grid") };
    assert_eq!((volume.grid.size(), *scale), ([96; 3], 20.0));
    let fog = Bounds::of_triangles(&smoke.boundaries[0].triangles);
    let bounds = volume.world_bounds();
    assert!((bounds.min - fog.min).abs().max_element() < 1e-12 && (bounds.max - fog.max).abs().max_element() < 1e-12);
    // Dense in the middle, nothing at the corner.
    assert!(volume.grid.max() > 0.6 && volume.at(fog.min).x == 0.0);
}
