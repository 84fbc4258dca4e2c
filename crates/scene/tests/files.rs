//! Files that are no plain files, or too large, are refused before they are read.

use std::path::{Path, PathBuf};

use vdf_scene::{Emitter, LoadOptions, Scene};

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).expect("the folder can be made");
    folder
}

fn message(path: &Path) -> String {
    Scene::load(path, &LoadOptions::default()).expect_err("this must be refused").to_string()
}

fn naming(folder: &Path, body: &str) -> PathBuf {
    let path = folder.join("scene.xml");
    std::fs::write(&path, format!("<scene version=\"3.0.0\">{body}</scene>")).expect("it can be written");
    path
}

#[test]
fn folders_are_refused() {
    let folder = folder("folders");
    assert!(message(&folder).contains("it is a folder"));
    assert!(message(&naming(&folder, "<include filename='.'/>")).contains("it is a folder"));
    assert!(message(&folder.join("missing.xml")).contains("cannot read"));
}

/// To open a pipe that nobody writes to blocks, and a device may never end.
#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused() {
    let folder = folder("devices");
    let pipe = folder.join("pipe.xml");
    let _ = std::fs::remove_file(&pipe);
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo runs").success());
    for special in [pipe.as_path(), Path::new("/dev/zero")] {
        let name = special.display();
        assert!(message(special).contains("a pipe or a device"), "{}", message(special));
        assert!(message(&naming(&folder, &format!("<include filename='{name}'/>"))).contains("a pipe or a device"));
        let mesh = format!("<shape type='obj'><string name='filename' value='{name}'/></shape>");
        assert!(message(&naming(&folder, &mesh)).contains("a pipe or a device"));
    }
}

/// The files have holes: they take no room on the disk.
#[test]
fn sizes_are_bounded() {
    let folder = folder("sizes");
    let large = folder.join("large.xml");
    std::fs::File::create(&large).and_then(|f| f.set_len((64 << 20) + 1)).expect("a file can have a hole");
    assert!(message(&large).contains("at most 67108864 are read"), "{}", message(&large));
    std::fs::File::create(&large).and_then(|f| f.set_len((8 << 30) + 1)).expect("a file can have a hole");
    let mesh = naming(&folder, "<shape type='obj'><string name='filename' value='large.xml'/></shape>");
    assert!(message(&mesh).contains("at most 8589934592 are read"), "{}", message(&mesh));
    let _ = std::fs::remove_file(large);
}

/// A picture may say anything; what is no light is told.
#[test]
fn values_of_pictures_that_are_no_light_are_warned_about() {
    let folder = folder("pictures");
    let pixels = image::ImageBuffer::from_fn(4, 2, |x, _| {
        image::Rgb([[0.5, f32::NAN, -1.0, f32::INFINITY][x as usize], 1.0, 1.0])
    });
    pixels.save(folder.join("sky.exr")).expect("it can be written");
    let scene = "<integrator type='volpath'/><sensor type='perspective'/>\
                 <emitter type='envmap'><string name='filename' value='sky.exr'/></emitter>";
    let path = naming(&folder, scene);
    let scene = Scene::load(&path, &LoadOptions::default()).expect("it loads");
    let told = |part: &str| scene.warnings.iter().any(|w| w.contains(part));
    assert!(told("scene.xml:1:") && told("6 values of") && told("they are taken as 0"), "{:?}", scene.warnings);
}

/// Loads a scene under the sky in that file, and gives the sky's pixels.
fn sky(folder: &Path, name: &str, bytes: &[u8]) -> Result<Vec<[f32; 3]>, String> {
    std::fs::write(folder.join(name), bytes).expect("it can be written");
    let scene = format!(
        "<integrator type='volpath'/><sensor type='perspective'/>\
         <emitter type='envmap'><string name='filename' value='{name}'/></emitter>"
    );
    let scene = Scene::load(&naming(folder, &scene), &LoadOptions::default()).map_err(|e| e.to_string())?;
    let Some(Emitter::Envmap { image, .. }) = scene.emitters.first() else { return Err("no sky".to_owned()) };
    Ok(image.rgb.iter().map(|p| p.to_array()).collect())
}

/// Radiance's own programs write the first, others the second.
#[test]
fn radiance_files_have_two_signatures() {
    let folder = folder("radiance");
    for signature in ["#?RADIANCE", "#?RGBE"] {
        let mut bytes = format!("{signature}\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 2\n").into_bytes();
        // Mantissas of eight bits, and an exponent of 128 for 2⁰.
        bytes.extend([128, 64, 0, 128].repeat(3));
        bytes.extend([128, 128, 128, 130]);
        let pixels = sky(&folder, "sky.hdr", &bytes).expect("it is read");
        assert_eq!((pixels[0], pixels[3]), ([0.5, 0.25, 0.0], [2.0; 3]), "{signature}");
    }
}

/// Its rows begin at the bottom; a file by another name is known by its first bytes.
#[test]
fn pfm_pictures_are_read() {
    let folder = folder("pfm");
    let mut bytes = b"Pf\n2 2\n-1.0\n".to_vec();
    bytes.extend([0.5_f32, 1.0, 2.0, 7.0].iter().flat_map(|v| v.to_le_bytes()));
    for name in ["sky.pfm", "sky.png"] {
        assert_eq!(sky(&folder, name, &bytes).expect("it is read"), [2.0, 7.0, 0.5, 1.0].map(|v| [v; 3]));
    }
    bytes.pop();
    let message = sky(&folder, "short.pfm", &bytes).expect_err("it is cut off");
    assert!(message.contains("short.pfm\": the file ends after 15 of 16 bytes"), "{message}");
}

#[test]
fn what_ends_too_soon_is_told_where() {
    let folder = folder("ends");
    let path = folder.join("scene.xml");
    for text in [
        "<scene version=\"3.0.0\">\n  <sensor\n",
        "<scene version=\"3.0.0\">\n  <sensor type='perspective'>\n</sensor>  ",
    ] {
        std::fs::write(&path, text).expect("it can be written");
        let line = text.trim_end().lines().count();
        assert!(message(&path).contains(&format!("scene.xml:{line}:")), "{}", message(&path));
    }
    std::fs::write(folder.join("a.ply"), "ply\nformat ascii 1.0\n").expect("it can be written");
    let mesh = naming(&folder, "<shape type='ply'><string name='filename' value='a.ply'/></shape>");
    assert!(message(&mesh).contains("the file ends before the line end_header"), "{}", message(&mesh));
    let depth = "<sensor type='perspective'/><integrator type='volpath'><integer name='max_depth' value='99999999999999999999'/></integrator>";
    assert!(message(&naming(&folder, depth)).contains("is too large for an integer"));
}
