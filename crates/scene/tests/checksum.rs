//! What changes the checksum of a scene, and what does not.

use std::collections::HashSet;

use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3};
use vdf_scene::{
    Albedo, Attribute, Bsdf, Emitter, Extinction, GridVolume, Lens, LoadOptions, MeshAttributes, Perturbation, Phase,
    Pixels, Projection, ReconstructionFilter, Rgb, Scene, Slide, Texture, VolumeFilter, VoxelGrid, Wrap,
};
use vdf_scenes::builtin;

fn loaded(name: &str, defines: &[(&str, &str)]) -> Scene {
    let defines = defines.iter().map(|&(k, v)| (k.to_owned(), v.to_owned())).collect();
    Scene::from_source(&builtin(name).expect("it is built in"), &LoadOptions { defines, sensor: None })
        .expect("it loads")
}

fn turned(by: Perturbation, flip_invalid_normals: bool, shadowing: bool) -> Bsdf {
    Bsdf::Perturbed { by, flip_invalid_normals, shadowing, of: Box::new(Bsdf::Null) }
}

fn projector(scale: f32) -> Emitter {
    let slide = Box::new(Slide { texture: Texture::grey(1.0), scale, axes: [DVec3::X, DVec3::Y] });
    Emitter::Projector { position: DVec3::ZERO, direction: DVec3::Z, slide }
}

fn grid(value: f32, wrap: Wrap) -> GridVolume {
    let grid = VoxelGrid::new([2, 1, 1], 1, vec![1.0, value], [Vec3::ZERO, Vec3::ONE]).expect("a grid");
    GridVolume { grid: Arc::new(grid), filter: VolumeFilter::Trilinear, wrap, grid_from_world: DMat4::IDENTITY }
}

#[test]
fn every_change_of_the_scene_changes_it_and_nothing_else_does() {
    let scene = loaded("cbox_vol3", &[]);
    let same: [fn(&mut Scene); 4] =
        [|s| s.seed += 1, |s| s.sample_count += 1, |s| s.film.crop.x0 += 1, |s| s.warnings.push("a warning".into())];
    for change in same {
        let mut changed = scene.clone();
        change(&mut changed);
        assert_eq!(changed.checksum(), scene.checksum());
    }
    let other: [fn(&mut Scene); 43] = [
        |_| {},
        |s| s.surfaces[0].triangles[0].vertices[1].z = s.surfaces[0].triangles[0].vertices[1].z.next_up(),
        |s| s.surfaces[0].triangles.swap(0, 1),
        |s| s.surfaces[0].bsdf = Bsdf::lambertian(Vec3::splat(0.125), Vec3::ZERO),
        |s| s.surfaces[0].bsdf = Bsdf::lambertian(Vec3::ZERO, Vec3::splat(0.125)),
        |s| s.surfaces[0].radiance = Some(Rgb::ZERO.into()),
        |s| drop(s.surfaces.pop()),
        |s| s.boundaries[0].interior = None,
        |s| s.boundaries[0].exterior = s.boundaries[0].interior,
        |s| s.media[0].sigma_t = 1.5.into(),
        |s| s.media[0].sigma_t = Extinction::Constant(glam::dvec3(1.5, 1.5, 1.0)),
        |s| s.media[0].sigma_t = Extinction::Grid { volume: grid(1.0, Wrap::Clamp), scale: 1.0 },
        |s| s.media[0].sigma_t = Extinction::Grid { volume: grid(1.0, Wrap::Clamp), scale: 2.0 },
        |s| s.media[0].sigma_t = Extinction::Grid { volume: grid(0.5, Wrap::Clamp), scale: 1.0 },
        |s| s.media[0].sigma_t = Extinction::Grid { volume: grid(1.0, Wrap::Repeat), scale: 1.0 },
        |s| s.media[0].albedo = Albedo::Grid(grid(1.0, Wrap::Clamp)),
        |s| s.media[0].phase = Phase::HenyeyGreenstein { g: 0.0 },
        |s| s.emitters.reverse(),
        |s| {
            s.sensor.projection = Projection::Perspective { tan_half_fov_x: 1.5, lens: None, principal_point: [0.0; 2] }
        },
        |s| {
            s.sensor.projection =
                Projection::Perspective { tan_half_fov_x: 1.5, lens: None, principal_point: [0.5, 0.0] }
        },
        |s| {
            s.sensor.projection =
                Projection::Perspective { tan_half_fov_x: 1.5, lens: None, principal_point: [0.0, 0.5] }
        },
        |s| s.sensor.projection = Projection::Orthographic { half_width: 1.5, half_height: 1.0 },
        |s| s.sensor.projection = Projection::Orthographic { half_width: 1.0, half_height: 1.5 },
        |s| s.sensor.world_from_camera.w_axis.x += 1.0,
        |s| s.film.width += 1,
        |s| s.film.filter = ReconstructionFilter::Gaussian { stddev: 0.625 },
        |s| s.integrator.max_depth = Some(77),
        |s| s.surfaces[0].bsdf = Bsdf::Diffuse { reflectance: Texture::grey(0.125) },
        |s| s.surfaces[0].bsdf = Bsdf::Null,
        |s| s.surfaces[0].attributes = Arc::new(MeshAttributes { normals: vec![[Vec3::X; 3]], uvs: vec![] }),
        |s| {
            let lens = Some(Lens { radius: 1.0, focus_distance: 2.0 });
            s.sensor.projection = Projection::Perspective { tan_half_fov_x: 1.5, lens, principal_point: [0.0; 2] };
        },
        |s| s.surfaces[0].bsdf = turned(Perturbation::Normals(Texture::grey(0.5)), true, true),
        |s| s.surfaces[0].bsdf = turned(Perturbation::Heights { texture: Texture::grey(0.5), scale: 0.0 }, true, true),
        |s| s.surfaces[0].bsdf = turned(Perturbation::Heights { texture: Texture::grey(0.5), scale: 2.0 }, true, true),
        |s| s.surfaces[0].bsdf = turned(Perturbation::Normals(Texture::grey(0.5)), false, true),
        |s| s.surfaces[0].bsdf = turned(Perturbation::Normals(Texture::grey(0.5)), true, false),
        |s| {
            s.surfaces[0].bsdf =
                Bsdf::Diffuse { reflectance: Texture::Attribute(Arc::new(Attribute::Faces(vec![Rgb::ONE; 3]))) }
        },
        |s| {
            let corners = Attribute::Corners(vec![[Rgb::ONE; 3]]);
            s.surfaces[0].bsdf = Bsdf::Diffuse { reflectance: Texture::Attribute(Arc::new(corners)) };
        },
        |s| s.emitters.push(projector(1.0)),
        |s| s.emitters.push(projector(2.0)),
        |s| s.emitters.push(Emitter::Directional { direction: glam::DVec3::X, irradiance: Rgb::ONE }),
        |s| {
            let image = Arc::new(Pixels { width: 2, height: 2, rgb: vec![Rgb::ONE; 4] });
            s.emitters.push(Emitter::Envmap { image, scale: 1.0, world_from_map: DMat4::IDENTITY });
        },
        |s| {
            let image = Arc::new(Pixels { width: 2, height: 2, rgb: vec![Rgb::ONE, Rgb::ONE, Rgb::ONE, Rgb::ZERO] });
            s.emitters.push(Emitter::Envmap { image, scale: 1.0, world_from_map: DMat4::IDENTITY });
        },
    ];
    let sums: HashSet<_> = other
        .iter()
        .map(|change| {
            let mut changed = scene.clone();
            change(&mut changed);
            changed.checksum()
        })
        .collect();
    assert_eq!(sums.len(), other.len());
}

#[test]
fn it_is_that_of_the_resolved_scene() {
    let scene = loaded("cbox_vol2", &[]).checksum();
    assert_eq!(loaded("cbox_vol2", &[("spp", "3")]).checksum(), scene);
    assert_ne!(loaded("cbox_vol2", &[("width", "33")]).checksum(), scene);
    assert_ne!(loaded("cbox_vol3", &[]).checksum(), scene);
}
