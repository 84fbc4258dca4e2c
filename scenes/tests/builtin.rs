//! The built-in scenes load, from memory and from disk.

use glam::{DVec3, Vec3};
use vdf_scene::{Emitter, LoadOptions, MediumId, Phase, Projection, ReconstructionFilter, Scene};
use vdf_scenes::{builtin, builtin_names};

#[test]
fn the_builtin_boxes_load_and_say_what_the_design_says() {
    for name in builtin_names().iter().filter(|name| name.starts_with("cbox")) {
        let scene = Scene::from_source(&builtin(name).unwrap(), &LoadOptions::default()).unwrap();
        assert_eq!(scene.warnings, Vec::<String>::new(), "{name}");
        assert_eq!((scene.film.width, scene.film.height), (512, 512));
        assert_eq!(scene.film.filter, ReconstructionFilter::Box);
        // The fog of `cbox_light`, which is not the thesis's, reaches to the camera.
        let of_thesis = *name != "cbox_light";
        assert_eq!(scene.sensor.medium, (!of_thesis).then_some(MediumId(0)));
        assert_eq!(scene.sensor.world_from_camera.w_axis.truncate(), DVec3::new(278.0, 273.0, -789.0));
        let Projection::Perspective { tan_half_fov_x, lens: None, .. } = scene.sensor.projection else {
            panic!("{:?}", scene.sensor)
        };
        assert!((tan_half_fov_x - (39.3_f64 / 2.0).to_radians().tan()).abs() < 1e-12);
        assert_eq!(scene.media[0].phase, Phase::Isotropic);
        assert_eq!(scene.boundaries[0].interior, Some(MediumId(0)));
        let sigma_t = match *name {
            "cbox_vol4" => 0.01,
            "cbox_light" => 0.0005,
            _ => 0.001,
        };
        assert!((scene.media[0].sigma_t.grey().unwrap() - sigma_t).abs() < 1e-12);
        assert_eq!(scene.emitters.len(), if *name == "cbox_vol3" { 2 } else { 1 });
        assert_eq!(
            scene.surfaces.len(),
            match *name {
                "cbox_vol6" => 3,
                "cbox_light" => 6,
                _ => 5,
            }
        );
        let corner = |pick: fn(Vec3, Vec3) -> Vec3| {
            scene.boundaries[0].triangles.iter().flat_map(|t| t.vertices).reduce(pick).unwrap()
        };
        let (min, max) = if of_thesis {
            (Vec3::new(-32.0, -16.0, -16.0), Vec3::new(578.0, 566.0, 560.0))
        } else {
            (Vec3::new(-26.0, -16.0, -790.0), Vec3::new(584.0, 566.0, 560.0))
        };
        assert_eq!((corner(Vec3::min), corner(Vec3::max)), (min, max), "{name}");
        if of_thesis {
            let light = |e: &Emitter| matches!(e, Emitter::Point { position, .. } if *position == DVec3::new(94.0, 301.0, 202.0));
            assert!(scene.emitters.iter().any(light), "{name}");
        }
    }
    assert!(builtin("nosuch").is_none());
}

#[test]
fn a_builtin_scene_written_to_disk_loads_from_there() {
    let folder = tempfile::tempdir().unwrap();
    let source = builtin("cbox_vol2").unwrap();
    for file in source.files() {
        let path = folder.path().join(file.path.as_ref());
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, &file.bytes).unwrap();
    }
    let options = LoadOptions::default();
    let disk = Scene::load(&folder.path().join("cbox_vol2.xml"), &options).unwrap();
    let memory = Scene::from_source(&source, &options).unwrap();
    assert_eq!(format!("{disk:?}"), format!("{memory:?}"));
    let missing = Scene::load(&folder.path().join("none.xml"), &options).unwrap_err();
    assert!(missing.to_string().contains("none.xml"), "{missing}");
}
