//! What scenes of Mitsuba say that the rest of the subset does not need.

use glam::{DMat3, DVec3, Vec3};

use super::LoadOptions;
use super::tests::{FILM, FOG, HEAD, LIGHT, file, load, load_with, refused, refused_text, tan_of, with_sensor};
use crate::{
    Bsdf, ComponentFormat, Emitter, IntegratorSettings, Microfacets, Projection, ReconstructionFilter, Scene,
    SceneSource, Texture,
};

fn warned(scene: &Scene, part: &str) -> bool {
    scene.warnings.iter().any(|w| w.contains(part))
}

fn with_integrator(integrator: &str, more: &str) -> String {
    format!("<scene version='3.0.0'>{integrator}<sensor type='perspective'>{FILM}</sensor>{LIGHT}{more}</scene>")
}

#[test]
fn integrators_that_do_the_same_are_read() {
    let settings = |text: &str| load_with(&with_integrator(text, ""), &[], &[]).unwrap().integrator;
    let deep = |max_depth, rr_depth| IntegratorSettings { max_depth, rr_depth };
    let limits = "<integer name='max_depth' value='7'/><integer name='rr_depth' value='9'/>";
    for (kind, default) in [
        ("volpath", None),
        ("volpathmis", None),
        ("path", None),
        ("prb", Some(6)),
        ("prbvolpath", Some(6)),
        ("prb_basic", Some(6)),
    ] {
        assert_eq!(settings(&format!("<integrator type='{kind}'/>")), deep(default, 5), "{kind}");
        assert_eq!(settings(&format!("<integrator type='{kind}'>{limits}</integrator>")), deep(Some(7), 9), "{kind}");
    }
    assert_eq!(settings("<integrator type='direct'/>"), deep(Some(2), 5));
    let samples = "<integer name='emitter_samples' value='4'/><integer name='bsdf_samples' value='0'/>";
    assert_eq!(settings(&format!("<integrator type='direct'>{samples}</integrator>")), deep(Some(2), 5));
    let bad = |text: &str, part: &str| refused_text(&with_integrator(text, ""), &[], "s.xml:1:24", part);
    let none = samples.replace('4', "0");
    bad(&format!("<integrator type='direct'>{none}</integrator>"), "no samples");
    let fog = with_integrator("<integrator type='path'/>", FOG);
    assert!(warned(&load_with(&fog, &[], &[]).unwrap(), "ignores media in Mitsuba"));
    assert!(!warned(&load_with(&with_integrator("<integrator type='path'/>", ""), &[], &[]).unwrap(), "media"));
}

#[test]
fn integrators_around_another_are_passed_over_with_a_warning() {
    let inner = "<integrator type='path' name='img'><integer name='max_depth' value='3'/></integrator>";
    for wrapper in ["moment'>", "stokes'>", "aov'><string name='aovs' value='d:depth'/>"] {
        let loaded =
            load_with(&with_integrator(&format!("<integrator type='{wrapper}{inner}</integrator>"), ""), &[], &[])
                .unwrap();
        assert_eq!(loaded.integrator.max_depth, Some(3));
        assert!(warned(&loaded, "is passed over"));
    }
    let empty = with_integrator("<integrator type='moment'/>", "");
    refused_text(&empty, &[], "s.xml:1:24", "must hold one integrator");
    let circle = "<integrator type='moment' id='a'><integrator type='aov'><ref id='a'/></integrator></integrator>";
    refused_text(&with_integrator(circle, ""), &[], "s.xml:1:80", "cycle");
}

#[test]
fn films_and_filters_are_read() {
    let film = |inner: &str| {
        let text =
            format!("{HEAD}<sensor type='perspective'><film type='hdrfilm'>{inner}</film></sensor>{LIGHT}</scene>");
        load_with(&text, &[], &[]).unwrap()
    };
    for (filter, expected) in [
        ("box'>", ReconstructionFilter::Box),
        ("gaussian'>", ReconstructionFilter::Gaussian { stddev: 0.5 }),
        ("tent'>", ReconstructionFilter::Tent { radius: 1.0 }),
        ("tent'><float name='radius' value='2'/>", ReconstructionFilter::Tent { radius: 2.0 }),
        ("mitchell'>", ReconstructionFilter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 }),
        (
            "mitchell'><float name='B' value='0'/><float name='C' value='.5'/>",
            ReconstructionFilter::Mitchell { b: 0.0, c: 0.5 },
        ),
        ("catmullrom'>", ReconstructionFilter::CatmullRom),
        ("lanczos'>", ReconstructionFilter::Lanczos { lobes: 3 }),
        ("lanczos'><integer name='lobes' value='2'/>", ReconstructionFilter::Lanczos { lobes: 2 }),
    ] {
        assert_eq!(film(&format!("<rfilter type='{filter}</rfilter>")).film.filter, expected, "{filter}");
    }
    let format =
        |value: &str| film(&format!("<string name='component_format' value='{value}'/>")).film.component_format;
    assert_eq!(film("").film.component_format, ComponentFormat::Float32);
    assert_eq!(format("float16"), ComponentFormat::Float16);
    assert_eq!(format("Float32"), ComponentFormat::Float32);
    assert!(warned(&film("<string name='pixel_format' value='rgba'/>"), "written as rgb, not as rgba"));
    assert!(warned(&film("<string name='file_format' value='pfm'/>"), "written as OpenEXR, not as pfm"));
    assert!(
        film("<string name='file_format' value='exr'/><boolean name='sample_border' value='true'/>")
            .warnings
            .is_empty()
    );
    let spectral = format!("{HEAD}<sensor type='perspective'><film type='specfilm'/></sensor></scene>");
    refused_text(&spectral, &[], "s.xml:3:34", "records a spectrum");
}

#[test]
fn spectra_that_are_constant_are_read() {
    let text = "<spectrum name='NAME' value='0.5'/>";
    let named = |name: &str| text.replace("NAME", name);
    let loaded = load(&format!(
        "<shape type='cube'><bsdf type='diffuse'>{}</bsdf></shape><emitter type='constant'>{}</emitter>\
         <medium type='homogeneous'><spectrum name='sigma_t' value='3'/>{}</medium>",
        named("reflectance"),
        named("radiance"),
        named("albedo")
    ));
    assert_eq!(loaded.surfaces[0].bsdf, Bsdf::lambertian(Vec3::splat(0.5), Vec3::ZERO));
    assert_eq!(loaded.media[0].sigma_t, 3.0.into());
    assert_eq!(loaded.media[0].albedo, Vec3::splat(0.5).into());
    // Equal energy is not white: seen in Mitsuba 3.9.1.
    let Emitter::Constant { radiance } = loaded.emitters[0].clone() else { panic!("not constant") };
    assert!((radiance - Vec3::new(0.602_397, 0.474_146, 0.454_458)).abs().max_element() < 1e-6, "{radiance}");
    let over = |value: &str| {
        format!("<shape type='cube'><bsdf type='diffuse'><spectrum name='reflectance' value='{value}'/></bsdf></shape>")
    };
    let Bsdf::Lambertian { front, .. } = load(&over("360:0.5, 830:0.5")).surfaces[0].bsdf.clone() else {
        panic!("plain")
    };
    assert!((front - 0.5).abs().max_element() < 1e-3, "{front}");
    refused(&over("500:0.5, 400:0.2"), "3:41", "do not grow");
    refused(&over("0.1, 0.2"), "3:41", "400:0.2");
    refused(&over("1.5"), "3:41", "[0, 1]");
}

#[test]
fn rotations_are_those_of_mitsuba() {
    let moved = |op: &str| {
        let text = format!(
            "<emitter type='point'><transform name='to_world'><translate x='1' y='2' z='3'/>{op}</transform></emitter>"
        );
        let loaded = load(&text);
        let Emitter::Point { position, .. } = loaded.emitters[0].clone() else { panic!("not a point") };
        (position, warned(&loaded, "rotation axis has length"))
    };
    let near = |(position, warning): (DVec3, bool), expected: DVec3, warns: bool| {
        assert!((position - expected).length() < 1e-9 && warning == warns, "{position} {warning}");
    };
    near(moved("<rotate value='0, 0, 1' angle='90'/>"), DVec3::new(-2.0, 1.0, 3.0), false);
    near(moved("<rotate z='0.9995' angle='90'/>"), DVec3::new(-2.0, 1.0, 3.0), false);
    // cos I + (1 − cos) a aᵀ + sin [a]×, with a as it is.
    near(moved("<rotate z='2' angle='90'/>"), DVec3::new(-4.0, 2.0, 12.0), true);
    near(moved("<rotate value='1' angle='180'/>"), DVec3::new(11.0, 10.0, 9.0), true);
}

#[test]
fn camera_matrices_with_few_digits_become_rotations() {
    let camera = |matrix: &str| {
        let sensor = format!("<transform name='to_world'><matrix value='{matrix}'/></transform>");
        load_with(&with_sensor("", &sensor), &[], &[])
    };
    let digits = |digits: usize, turn: DMat3| {
        let rows = turn.transpose().to_cols_array();
        let row = |i: usize| rows[3 * i..3 * i + 3].iter().map(|v| format!("{v:.digits$} ")).collect::<String>();
        camera(&format!("{}7 {}8 {}9 0 0 0 1", row(0), row(1), row(2)))
    };
    for i in 1..60 {
        let turn =
            DMat3::from_axis_angle(DVec3::new(f64::from(i).sin(), f64::from(i).cos(), 0.3).normalize(), f64::from(i));
        for count in [3, 4] {
            let loaded = digits(count, turn).unwrap();
            let m = loaded.sensor.world_from_camera;
            let linear = DMat3::from_mat4(m);
            assert!((linear.transpose() * linear).abs_diff_eq(DMat3::IDENTITY, 1e-14));
            assert!(linear.abs_diff_eq(turn, 2e-3) && linear.determinant() > 0.0);
            assert_eq!(m.w_axis.truncate(), DVec3::new(7.0, 8.0, 9.0));
            assert!(warned(&loaded, "orthonormal"));
        }
        assert!(digits(9, turn).unwrap().warnings.is_empty());
    }
    let mirrored = camera("-0.9995 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1").unwrap();
    let mirroring = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    assert!(DMat3::from_mat4(mirrored.sensor.world_from_camera).abs_diff_eq(mirroring, 1e-14));
    for scaled in ["1.002 0 0 0 1.002 0 0 0 1.002", "1 0 0.01 0 1 0 0 0 1", "2 0 0 0 2 0 0 0 2", "1 0 0 0 1 0 0 0 0.99"]
    {
        assert!(camera(scaled).unwrap_err().to_string().contains("scales"), "{scaled}");
    }
}

#[test]
fn one_of_several_sensors_is_chosen() {
    let sensor = |fov: u32| format!("<sensor type='perspective'><float name='fov' value='{fov}'/>{FILM}</sensor>");
    let text = format!("{HEAD}{}{}{LIGHT}</scene>", sensor(90), sensor(60));
    let chosen = |sensor| {
        let source = SceneSource::embedded(file("s.xml", &text), vec![]);
        Scene::from_source(&source, &LoadOptions { sensor, ..LoadOptions::default() })
    };
    let first = chosen(None).unwrap();
    assert!((tan_of(&first) - 1.0).abs() < 1e-12 && warned(&first, "the scene has 2 sensors: the first"));
    assert!(chosen(Some(0)).unwrap().warnings.is_empty());
    assert!((tan_of(&chosen(Some(1)).unwrap()) - 30_f64.to_radians().tan()).abs() < 1e-12);
    let message = chosen(Some(2)).unwrap_err().to_string();
    assert!(message.contains("no sensor 2") && message.contains("it has 2"), "{message}");
}

/// Of `perspective` only, as in Mitsuba.
#[test]
fn the_axis_may_meet_the_film_off_its_middle() {
    let text = |kind: &str, inner: &str| {
        format!(
            "{HEAD}<shape type='cube'/><sensor type='{kind}'>{FILM}<float name='fov' value='40'/>{inner}\
             <float name='principal_point_offset_x' value='0.25'/><float name='principal_point_offset_y' value='-0.5'/></sensor>{LIGHT}</scene>"
        )
    };
    let sensor = load_with(&text("perspective", ""), &[], &[]).unwrap().sensor;
    let Projection::Perspective { principal_point, .. } = sensor.projection else { panic!("{sensor:?}") };
    assert_eq!(principal_point, [0.25, -0.5]);
    let lens = text("thinlens", "<float name='aperture_radius' value='1'/>");
    assert!(load_with(&lens, &[], &[]).unwrap_err().to_string().contains("principal_point_offset_x"));
}

/// What the camera's scale stretches is what it sees; the near plane moves with it, and the far one stays as far behind.
#[test]
fn an_orthographic_camera_sees_what_its_scale_says() {
    let text = |transform: &str, inner: &str| {
        format!(
            "{HEAD}<shape type='cube'/>\n<sensor type='orthographic'><transform name='to_world'>{transform}</transform>\
             <float name='near_clip' value='2'/><float name='far_clip' value='7'/>{FILM}{inner}</sensor>{LIGHT}</scene>"
        )
    };
    let moved = "<scale x='8' y='6' z='3'/><lookat origin='-9, 0, 0' target='0, 0, 0' up='0, 0, 1'/>";
    let scene = load_with(&text(moved, ""), &[], &[]).unwrap();
    assert_eq!(scene.warnings, Vec::<String>::new());
    let sensor = scene.sensor;
    assert_eq!(sensor.projection, Projection::Orthographic { half_width: 8.0, half_height: 4.5 });
    assert_eq!((sensor.near_clip, sensor.far_clip), (6.0, 11.0));
    assert!((sensor.world_from_camera.z_axis.truncate() - DVec3::X).length() < 1e-12);
    let far = load_with(&text(&moved.replace("-9", "-90"), ""), &[], &[]).unwrap();
    assert!(warned(&far, "nothing of the scene lies between near_clip (6) and far_clip (11)"), "{:?}", far.warnings);
    let sheared = "<matrix value='1 0.5 0 0  0 1 0 0  0 0 1 0  0 0 0 1'/>";
    refused_text(&text(sheared, ""), &[], "s.xml:4:29", "shears");
    refused_text(&text(moved, "<float name='fov' value='30'/>"), &[], "s.xml:4:242", "no property \"fov\"");
    // Fog that begins before the near plane, above the camera, where only rays of the film's border pass.
    let fog = "<medium type='homogeneous' id='fog'/><shape type='cube'><transform name='to_world'><scale value='0.5'/>\
        <translate x='-7' z='4'/></transform><bsdf type='null'/><ref id='fog' name='interior'/></shape>";
    let jumped =
        load_with(&text(moved, "").replace("<shape type='cube'/>", &format!("<shape type='cube'/>{fog}")), &[], &[]);
    assert!(warned(&jumped.unwrap(), "jumps over the medium boundary"));
}

#[test]
fn properties_of_the_sensor_without_effect_are_warned_about() {
    let loaded = load_with(
        &with_sensor("", "<float name='focus_distance' value='3'/><float name='shutter_close' value='1'/>"),
        &[],
        &[],
    );
    let loaded = loaded.unwrap();
    assert!(warned(&loaded, "\"shutter_close\""));
    // All cameras of Mitsuba have one, whether or not they have a lens.
    assert!(!warned(&loaded, "\"focus_distance\""));
    refused_text(&with_sensor("", "<string name='fov_axis' value='x'/>"), &[], "s.xml:4:50", "without \"fov\"");
    let lens = "<string name='fov_axis' value='x'/><string name='focal_length' value='50mm'/>";
    refused_text(&with_sensor("", lens), &[], "s.xml:4:50", "without \"fov\"");
}

#[test]
fn area_lights_may_be_referred_to() {
    let light = "<emitter type='area' id='l'><rgb name='radiance' value='2'/></emitter>";
    let shape = "<shape type='cube'><ref id='l'/></shape>";
    let loaded = load(&format!("{light}{shape}"));
    assert_eq!(loaded.surfaces[0].radiance, Some(Vec3::splat(2.0).into()));
    assert_eq!(loaded.emitters[0], Emitter::Area { surface: 0 });
    assert!(loaded.warnings.is_empty());
    assert!(warned(&load(&format!("{light}{shape}{shape}")), "several shapes share this emitter"));
    assert!(warned(&load(light), "no shape refers to this area emitter"));
    refused("<emitter type='area'/>", "3:1", "no shape");
    refused("<emitter type='area' id='l'><float name='radiance' value='-1'/></emitter>", "3:29", "at least 0");
}

/// Mitsuba 3.9.1 gives the same mean, 0.0481, with a null BSDF and without a BSDF for a lamp above a floor.
#[test]
fn an_area_light_with_a_null_bsdf_is_a_black_one() {
    let loaded = load("<shape type='rectangle'><bsdf type='null'/><emitter type='area'/></shape>");
    assert_eq!(loaded.surfaces[0].bsdf, Bsdf::default());
    assert_eq!(loaded.emitters[0], Emitter::Area { surface: 0 });
    assert!(warned(&loaded, "opaque and black") && loaded.boundaries.is_empty());
}

#[test]
fn all_features_that_a_scene_lacks_are_named_at_once() {
    let body = "<emitter type='sunsky'><string name='filename' value='a.exr'/></emitter>\n\
         <shape type='hair'><string name='filename' value='none.hair'/><bsdf type='twosided'><bsdf type='measured'>\
         <texture type='wood' name='diffuse_reflectance'/></bsdf></bsdf></shape>\n\
         <shape type='hair'><string name='filename' value='none.hair'/></shape>\n\
         <bsdf type='diffuse' id='b'><spectrum name='reflectance' type='laser'><float name='scale' value='1'/></spectrum></bsdf>\n\
         <phase type='sggx'/>";
    let list = "6 features of this scene are not supported: emitter \"sunsky\" (s.xml:3), shape \"hair\" (s.xml:4 and 1 more), \
                bsdf \"measured\" (s.xml:4), texture \"wood\" (s.xml:4), \
                spectrum \"laser\" (s.xml:6), phase \"sggx\" (s.xml:7)\n";
    refused(body, "3:1", list);
    refused(
        body,
        "3:1",
        "principled, principledthin, null; emitter point, constant, area, envmap, spot, projector, directional; phase isotropic, hg, rayleigh, blendphase; shape obj",
    );
    // One alone has its own message, before any file is looked for.
    let hair = "<shape type='obj'><string name='filename' value='none.obj'/></shape><shape type='hair'/>";
    refused(hair, "3:76", "shape type \"hair\" is not supported\n  help: supported: obj");
    refused(
        "<bsdf type='diffuse'><spectrum name='reflectance' type='laser'/></bsdf>",
        "3:51",
        "spectrum type \"laser\" is not",
    );
    // A camera that is not used needs nothing.
    let cameras = format!("{LIGHT}<sensor type='irradiancemeter'/><sensor type='perspective'>{FILM}</sensor></scene>");
    let text = format!("{HEAD}{cameras}");
    refused_text(&text, &[], "s.xml:3:32", "sensor type \"irradiancemeter\"");
    let options = LoadOptions { sensor: Some(1), ..LoadOptions::default() };
    assert!(Scene::from_source(&SceneSource::embedded(file("s.xml", &text), vec![]), &options).is_ok());
}

#[test]
fn emitters_that_should_be_hidden_are_seen_and_a_warning_says_so() {
    let text = with_integrator("<integrator type='path'><boolean name='hide_emitters' value='true'/></integrator>", "");
    assert!(warned(&load_with(&text, &[], &[]).unwrap(), "\"hide_emitters\" has no effect"));
}

/// A group is nothing by itself; each instance moves all that is in it, after its own transform.
#[test]
fn instances_move_the_shapes_of_their_group() {
    let moved = |axis: &str| format!("<transform name='to_world'><translate {axis}='3'/></transform>");
    let group = format!(
        "<shape type='shapegroup' id='g'><shape type='rectangle'>{}</shape><shape type='sphere'/></shape>",
        moved("x")
    );
    assert!(load(&group).surfaces.is_empty());
    let loaded = load(&format!("{group}<shape type='instance'><ref id='g'/>{}</shape>", moved("y")));
    assert_eq!(loaded.surfaces.len(), 2);
    assert_eq!(loaded.surfaces[0].triangles[0].vertices[0], Vec3::new(2.0, 2.0, 0.0));
    assert_eq!(loaded.surfaces[1].curved.map(|c| c.placement().1), Some(DVec3::Y * 3.0));
    refused("<shape type='instance'/>", "3:1", "no shapegroup");
    let nested = format!(
        "{group}<shape type='shapegroup' id='h'><ref id='g'/></shape><shape type='instance'><ref id='h'/></shape>"
    );
    refused(&nested, "3:1", "do not nest");
    let many = format!("<shape type='shapegroup' id='m'>{}</shape>", "<shape type='rectangle'/>".repeat(1000));
    let one = "<shape type='instance'><ref id='m'/></shape>";
    let place = format!("3:{}", many.len() + 100 * one.len() + 1);
    refused(&format!("{many}{}", one.repeat(101)), &place, "make more than 100000 shapes");
}

/// Curved shapes stay what they are, with Mitsuba's parameters; what they cannot be is refused.
#[test]
fn curved_shapes_are_placed_and_never_tessellated() {
    let loaded = load(
        "<shape type='sphere'><point name='center' x='1' y='2' z='3'/><float name='radius' value='0.5'/></shape>\
         <shape type='disk'/><shape type='cylinder'><point name='p1' value='0 0 4'/><float name='radius' value='2'/></shape>",
    );
    assert!(loaded.surfaces.iter().all(|s| s.triangles.is_empty()));
    let shape = |i: usize| loaded.surfaces[i].curved.expect("curved");
    assert_eq!(shape(0).to_world(DVec3::X), DVec3::new(1.5, 2.0, 3.0));
    assert_eq!(shape(1).normal(DVec3::ZERO), DVec3::Z);
    assert!((shape(2).to_world(DVec3::new(0.0, 1.0, 0.5)) - DVec3::new(0.0, 2.0, 2.0)).length() < 1e-12);
    let scaled = "<transform name='to_world'><scale x='2'/></transform>";
    refused(&format!("<shape type='sphere'>{scaled}</shape>"), "3:1", "an ellipsoid");
    refused(&format!("<shape type='cylinder'>{scaled}</shape>"), "3:1", "not round");
    refused("<shape type='sphere'><float name='radius' value='0'/></shape>", "3:22", "positive");
    refused("<shape type='cylinder'><point name='p1' value='0 0 0'/></shape>", "3:1", "one point");
    let fog = format!("{FOG}<shape type='disk'><bsdf type='null'/><ref id='fog' name='interior'/></shape>");
    refused(&fog, "3:38", "rims");
    let ball = load(&format!(
        "{FOG}<shape type='sphere'><point name='center' x='0' y='0' z='5'/><bsdf type='dielectric'/><ref id='fog' name='interior'/></shape>"
    ));
    assert_eq!((ball.surfaces.len(), ball.boundaries.len()), (1, 1));
}

/// What of a scene's materials has a default, and what is refused.
#[test]
fn materials_have_mitsubas_defaults() {
    let bsdf = |text: &str| load(&format!("<shape type='cube'>{text}</shape>")).surfaces[0].bsdf.clone();
    let Bsdf::Dielectric { eta, .. } = bsdf("<bsdf type='dielectric'/>") else { panic!("glass") };
    assert!((eta - 1.5046 / 1.000_277).abs() < 1e-12);
    let Bsdf::Plastic { eta, nonlinear: false, roughness: Some(rough), .. } = bsdf("<bsdf type='roughplastic'/>")
    else {
        panic!("plastic")
    };
    assert!((eta - 1.49 / 1.000_277).abs() < 1e-12);
    assert_eq!((rough.distribution, rough.alpha_u), (Microfacets::Beckmann, Texture::grey(0.1)));
    let mirror = Bsdf::Conductor { eta: Vec3::ZERO, k: Vec3::ONE, specular: Texture::grey(1.0), roughness: None };
    assert_eq!(bsdf("<bsdf type='conductor'/>"), mirror);
    assert_eq!(bsdf("<bsdf type='conductor'><string name='material' value='none'/></bsdf>"), mirror);
    let twosided = "<bsdf type='twosided'><bsdf type='diffuse'/></bsdf>";
    assert_eq!(bsdf(twosided), Bsdf::lambertian(Vec3::splat(0.5), Vec3::splat(0.5)));
    let material = |name: &str| format!("<bsdf type='conductor'><string name='material' value='{name}'/></bsdf>");
    assert!(matches!(bsdf(&material("Cu")), Bsdf::Conductor { eta, .. } if eta.y > 0.9));
    refused(&material("Cooper"), "3:24", "\"Cooper\" is not a metal");
    refused("<bsdf type='dielectric'><string name='int_ior' value='watre'/></bsdf>", "3:25", "did you mean \"water\"");
    refused("<bsdf type='twosided'><bsdf type='dielectric'/></bsdf>", "3:23", "transmits light");
    let alpha = |value: &str| match bsdf(&format!(
        "<bsdf type='roughconductor'><float name='alpha' value='{value}'/></bsdf>"
    )) {
        Bsdf::Conductor { roughness: Some(rough), .. } => rough.alpha_u,
        other => panic!("{other:?}"),
    };
    assert_eq!([alpha("0"), alpha("1.5")], [Texture::grey(0.0), Texture::grey(1.5)]);
    let Bsdf::Conductor { k, .. } = bsdf("<bsdf type='conductor'><rgb name='eta' value='1.5'/></bsdf>") else {
        panic!("a metal without k")
    };
    assert_eq!(k, Vec3::ONE);
    for (kind, share) in [("polarizer", 0.5), ("circular", 0.5), ("retarder", 1.0)] {
        assert_eq!(bsdf(&format!("<bsdf type='{kind}'/>")), Bsdf::Filter { transmittance: Texture::grey(1.0), share });
    }
    assert!(
        matches!(bsdf("<bsdf type='pplastic'/>"), Bsdf::PolarizedPlastic { eta, .. } if (eta - 1.49 / 1.000_277).abs() < 1e-12)
    );
    refused("<bsdf type='mask'/>", "3:1", "must hold one BSDF");
    refused("<bsdf type='blendbsdf'><bsdf type='diffuse'/></bsdf>", "3:1", "must hold two");
}

/// Spectra with a type, nested or as a texture; those over wavelengths have the colour of the same values written in line.
#[test]
fn spectra_may_be_objects() {
    let surface = |text: &str| {
        let loaded = load(&format!("<shape type='cube'><bsdf type='diffuse'>{text}</bsdf></shape>"));
        match &loaded.surfaces[0].bsdf {
            Bsdf::Lambertian { front, .. } => *front,
            other => panic!("{other:?}"),
        }
    };
    let colour = "<rgb name='color' value='0.1, 0.2, 0.3'/>";
    for kind in ["spectrum", "texture"] {
        let of =
            |name: &str, inner: &str| surface(&format!("<{kind} name='reflectance' type='{name}'>{inner}</{kind}>"));
        assert_eq!(of("uniform", "<float name='value' value='0.25'/>"), Vec3::splat(0.25));
        assert_eq!(of("srgb", colour), Vec3::new(0.1, 0.2, 0.3));
        assert_eq!(of("d65", "<float name='scale' value='0.5'/>"), Vec3::splat(0.5));
        let steps = "<float name='wavelength_min' value='400'/><float name='wavelength_max' value='700'/><string name='values' value='0.1, 0.5, 0.9, 0.3'/>";
        let written = surface("<spectrum name='reflectance' value='400:0.1, 500:0.5, 600:0.9, 700:0.3'/>");
        assert_eq!(of("regular", steps), written);
        let listed =
            "<string name='wavelengths' value='400, 500 600,700'/><string name='values' value='0.1 0.5 0.9, 0.3'/>";
        assert_eq!(of("irregular", listed), written);
    }
    // A star of 6500 K is nearly as white as daylight, which the air makes 6 % less red and blue; which the air makes 6 % less red and blue; a lamp of 2800 K is red; ∫ȳ B over ∫ȳ in W/(m² sr nm).
    let light = |temperature: &str| {
        let radiance = format!(
            "<spectrum type='blackbody' name='radiance'><float name='temperature' value='{temperature}'/></spectrum>"
        );
        load(&format!("<shape type='sphere'><emitter type='area'>{radiance}</emitter></shape>")).surfaces[0]
            .radiance
            .as_ref()
            .and_then(Texture::constant)
            .unwrap()
    };
    let (star, lamp) = (light("6500"), light("2800"));
    assert!((star / star.y - 1.0).abs().max_element() < 0.07, "{star}");
    assert!(lamp.x > 2.0 * lamp.y && lamp.y > 3.0 * lamp.z, "{lamp}");
    // Planck's law at 555 nm: 1.1910e20 / 555⁵ / (e^(14387769/(555 · 6500)) − 1) = 42,706; it is 1 % less over all that is seen.
    assert!((crate::luminance(star) / 42_706.0 - 1.0).abs() < 0.03, "{star}");
    refused("<bsdf type='diffuse'><spectrum name='reflectance' type='regular'/></bsdf>", "3:22", "no \"values\"");
}

/// A light that is not the same everywhere keeps its texture and what it is looked up by.
#[test]
fn area_lights_may_have_textures() {
    let light =
        "<shape type='rectangle'><emitter type='area'><texture type='checkerboard' name='radiance'/></emitter></shape>";
    let surface = load(light).surfaces[0].clone();
    assert!(matches!(surface.radiance, Some(Texture::Checkerboard { .. })));
    assert_eq!(surface.attributes.uvs.len(), 2);
    let grey = "<texture type='uniform' name='radiance'><float name='value' value='7'/></texture>";
    let plain = load(&format!("<shape type='rectangle'><emitter type='area'>{grey}</emitter></shape>"));
    assert_eq!(plain.surfaces[0].radiance, Some(Vec3::splat(7.0).into()));
}
