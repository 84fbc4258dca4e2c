//! Media that change in space: what loads, what is refused, and where the message points.

use std::borrow::Cow;

use glam::{DVec3, Vec3};

use super::LoadOptions;
use super::tests::{file, scene};
use crate::{Albedo, EmbeddedFile, Extinction, Medium, Rgb, Scene, SceneError, SceneSource, VoxelGrid};

/// A file of 2 × 1 × 1 values of so many channels.
fn vol(channels: usize, values: &[f32], [min, max]: [Vec3; 2]) -> Vec<u8> {
    let grid = VoxelGrid::new([2, 1, 1], channels, values.to_vec(), [min, max]).unwrap();
    let mut bytes = Vec::new();
    grid.write_vol(&mut bytes).unwrap();
    bytes
}

/// A scene with a grey grid `a.vol` in the box from 1 to 3, a coloured `rgb.vol` of zeros, `flat.vol` without a box, and one `cut.vol` that is cut off.
fn load(body: &str) -> Result<Scene, SceneError> {
    let unit = [Vec3::ONE, Vec3::splat(3.0)];
    let grey = vol(1, &[0.25, 0.75], unit);
    let cut = grey[..50].to_vec();
    let files = [
        ("a.vol", grey),
        ("rgb.vol", vol(3, &[0.5; 6], unit)),
        ("flat.vol", vol(1, &[0.0; 2], [Vec3::ONE; 2])),
        ("large.vol", vol(1, &[1.5; 2], unit)),
        ("cut.vol", cut),
    ];
    let others = files.map(|(path, bytes)| EmbeddedFile { path: path.into(), bytes: Cow::Owned(bytes) }).to_vec();
    Scene::from_source(&SceneSource::embedded(file("s.xml", &scene(body)), others), &LoadOptions::default())
}

fn medium(body: &str) -> Medium {
    let scene = load(&format!("<medium type='heterogeneous'>{body}</medium>")).unwrap();
    scene.media[0].clone()
}

#[track_caller]
fn refused(body: &str, column: u32, part: &str) {
    let message = load(body).expect_err("this must be refused").to_string();
    assert!(message.starts_with(&format!("s.xml:3:{column}: ")), "expected column {column} in: {message}");
    assert!(message.contains(part), "expected {part:?} in: {message}");
}

fn grid(name: &str, file: &str, more: &str) -> String {
    format!("<volume type='gridvolume' name='{name}'><string name='filename' value='{file}'/>{more}</volume>")
}

#[test]
fn grids_are_where_they_say() {
    let place = "<transform name='to_world'><scale value='2'/><translate x='5'/></transform>";
    let of = |more: &str| match medium(&format!("{}<float name='scale' value='3'/>", grid("sigma_t", "a.vol", more)))
        .sigma_t
    {
        Extinction::Grid { volume, scale } => {
            assert_eq!(scale, 3.0);
            (volume.world_bounds(), volume.at(DVec3::new(5.5, 1.0, 1.0)).x)
        }
        constant => panic!("{constant:?}"),
    };
    let (bounds, _) = of("");
    assert_eq!((bounds.min, bounds.max), (DVec3::ZERO, DVec3::ONE));
    let (bounds, value) = of(place);
    assert_eq!((bounds.min, bounds.max), (DVec3::new(5.0, 0.0, 0.0), DVec3::new(7.0, 2.0, 2.0)));
    assert_eq!(value, 0.25);
    // The box of the file, moved as all else.
    let (bounds, _) = of(&format!("{place}<boolean name='use_grid_bbox' value='true'/>"));
    assert!((bounds.min - DVec3::new(7.0, 2.0, 2.0)).abs().max_element() < 1e-12, "{bounds:?}");
    assert!((bounds.max - DVec3::new(11.0, 6.0, 6.0)).abs().max_element() < 1e-12, "{bounds:?}");
    // What changes nothing is accepted.
    of("<boolean name='raw' value='true'/><boolean name='accel' value='false'/><float name='max_value' value='9'/>");
    of("<string name='filter_type' value='nearest'/><string name='wrap_mode' value='mirror'/>");
}

#[test]
fn albedos_may_be_grids() {
    let Albedo::Grid(volume) = medium(&grid("albedo", "rgb.vol", "")).albedo else { panic!("no grid") };
    assert_eq!(volume.at(DVec3::splat(0.5)), Rgb::splat(0.5));
    // Also of homogeneous media; and a constant one is just a colour.
    let scene = load(&format!("<medium type='homogeneous'>{}</medium>", grid("albedo", "a.vol", ""))).unwrap();
    assert!(matches!(scene.media[0].albedo, Albedo::Grid(_)) && scene.media[0].sigma_t == 1.0.into());
    let constant = "<volume type='constvolume' name='albedo'><rgb name='value' value='.1 .2 .3'/></volume>";
    assert_eq!(medium(constant).albedo, Vec3::new(0.1, 0.2, 0.3).into());
    assert_eq!(medium("<float name='albedo' value='0.5'/>").albedo, Vec3::splat(0.5).into());
    refused(&format!("<medium type='heterogeneous'>{}</medium>", grid("albedo", "large.vol", "")), 30, "up to 1.5");
}

#[test]
fn extinctions_may_be_coloured() {
    let Extinction::Grid { volume, .. } = medium(&grid("sigma_t", "rgb.vol", "")).sigma_t else { panic!("no grid") };
    assert_eq!(volume.grid.channels(), 3);
    let constant = "<volume type='constvolume' name='sigma_t'><rgb name='value' value='.1 .2 .4'/></volume>";
    let Extinction::Grid { volume, scale } = medium(constant).sigma_t else { panic!("no grid") };
    let value = volume.at(DVec3::splat(0.5)).as_dvec3() * scale;
    assert!((value - DVec3::new(0.1, 0.2, 0.4)).abs().max_element() < 1e-7, "{value}");
}

/// As in Mitsuba, where even one value ends at the unit cube.
#[test]
fn a_heterogeneous_medium_of_one_value_is_a_cube() {
    for (body, value, end) in [
        ("", 1.0, 1.0),
        ("<float name='sigma_t' value='7'/>", 7.0, 1.0),
        (
            "<volume type='constvolume' name='sigma_t'><float name='value' value='7'/><transform name='to_world'><scale value='2'/></transform></volume>",
            7.0,
            2.0,
        ),
    ] {
        let Extinction::Grid { volume, scale } = medium(body).sigma_t else { panic!("{body}: no grid") };
        assert_eq!((f64::from(volume.at(DVec3::splat(0.3)).x) * scale, volume.world_bounds().max.x), (value, end));
    }
    let scene = load("<medium type='heterogeneous'/>").unwrap();
    assert!(scene.warnings.iter().any(|w| w.contains("ends at the unit cube")), "{:?}", scene.warnings);
}

#[test]
fn volumes_are_shared() {
    let volume = "<volume type='gridvolume' id='v'><string name='filename' value='a.vol'/></volume>";
    let medium = "<medium type='heterogeneous'><ref name='sigma_t' id='v'/><ref name='albedo' id='v'/></medium>";
    let scene = load(&format!("{volume}{medium}")).unwrap();
    let (Extinction::Grid { volume, .. }, Albedo::Grid(albedo)) = (&scene.media[0].sigma_t, &scene.media[0].albedo)
    else {
        panic!("no grids")
    };
    assert!(std::sync::Arc::ptr_eq(&volume.grid, &albedo.grid));
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    let heterogeneous = |body: &str| format!("<medium type='heterogeneous'>{body}</medium>");
    let sigma_t = |file: &str, more: &str| heterogeneous(&grid("sigma_t", file, more));
    refused(&sigma_t("cut.vol", ""), 71, "cut.vol: the file ends after 0 of its 2 numbers");
    refused(&sigma_t("s.xml", ""), 71, "s.xml: byte 0: the file does not begin with VOL");
    refused(&sigma_t("none.vol", ""), 71, "cannot read \"none.vol\"");
    refused(&sigma_t("a.vol", "<string name='wrap_mode' value='border'/>"), 110, "wrap_mode \"border\"");
    refused(&sigma_t("flat.vol", "<boolean name='use_grid_bbox' value='true'/>"), 113, "has no volume");
    let sheared = "<string name='wrap_mode' value='repeat'/><transform name='to_world'><matrix value='1 1e9 0 0 0 1 0 0 0 0 1 0 0 0 0 1'/></transform>";
    refused(&sigma_t("a.vol", sheared), 151, "too many copies");
    refused(&heterogeneous("<volume type='gridvolume' name='sigma_t'/>"), 30, "no filename");
    refused(&sigma_t("a.vol", "<integer name='oops' value='1'/>"), 110, "no property \"oops\"");
    refused(&heterogeneous("<volume type='sdfgrid' name='sigma_t'/>"), 38, "supported: gridvolume, constvolume");
    refused(&heterogeneous("<float name='sigma_t' value='-1'/>"), 30, "at least 0");
    let fog = grid("sigma_t", "a.vol", "");
    refused(&format!("<medium type='homogeneous'>{fog}</medium>"), 28, "write <medium type=\"heterogeneous\">");
    let huge = "<float name='scale' value='1e308'/><float name='sigma_t' value='1e300'/>";
    refused(&heterogeneous(huge), 65, "must be finite");
    // A texture in space is none of ours, nor is a volume elsewhere.
    refused(&format!("<bsdf type='diffuse'>{}</bsdf>", grid("reflectance", "a.vol", "")), 22, "takes no <volume>");
}
