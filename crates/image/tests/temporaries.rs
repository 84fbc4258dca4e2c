//! What is left behind when a process ends early. Each test runs itself again in a process of its own.

#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "helpers of tests may fail, too")]

use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};

use vdf_image::{Image, ImageError, Rgb, StagedFile, remove_temporaries, stage_exr, write_exr, write_png};

/// The variable that names the folder that the second process works in.
const FOLDER: &str = "VDF_IMAGE_TEST_FOLDER";

fn folder() -> Option<PathBuf> {
    std::env::var_os(FOLDER).map(PathBuf::from)
}

/// Runs `test` of this program again, in `folder`, by a shell after `before`.
fn again(test: &str, folder: &Path, before: &str) -> ExitStatus {
    Command::new("sh")
        .arg("-c")
        .arg(format!("{before} exec \"$0\" --exact {test} --nocapture"))
        .arg(std::env::current_exe().unwrap())
        .env(FOLDER, folder)
        // A limit to the size of files would also hold for a log that the output goes to.
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .unwrap()
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// An image that no compression makes small.
fn noise() -> Image {
    let mut image = Image::new(100, 100);
    let mut random = 1_u32;
    for value in image.pixels.iter_mut().flat_map(|pixel: &mut Rgb| AsMut::<[f32; 3]>::as_mut(pixel)) {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *value = (random >> 8) as f32 / (1 << 24) as f32;
    }
    image
}

#[test]
fn an_exit_after_removal_leaves_nothing() {
    let Some(folder) = folder() else {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("done"), "old").unwrap();
        assert_eq!(again("an_exit_after_removal_leaves_nothing", directory.path(), "").code(), Some(7));
        assert_eq!(names(directory.path()), ["done"]);
        assert_eq!(std::fs::read(directory.path().join("done")).unwrap(), b"old");
        return;
    };
    let stage = |name: &str| StagedFile::write(&folder.join(name), |out| out.write_all(b"new"));
    // A relative path must be found although the directory changes.
    std::env::set_current_dir(&folder).unwrap();
    let relative = stage_exr(Path::new("a.exr"), &noise(), &[]).unwrap();
    std::env::set_current_dir("/").unwrap();
    let set = vec![stage("done").unwrap(), stage("other").unwrap()];
    assert_eq!(names(&folder).len(), 4);
    remove_temporaries();
    assert_eq!(names(&folder), ["done"]);
    // Other threads may go on for a moment, and must leave nothing either.
    assert!(stage("late").is_err());
    assert!(StagedFile::persist_all(set).is_err());
    assert!(relative.persist().is_err());
    remove_temporaries();
    // No destructor runs.
    std::process::exit(7);
}

#[test]
fn a_limit_to_the_size_of_files_leaves_nothing() {
    let Some(folder) = folder() else {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("a.exr"), "old").unwrap();
        // Eight blocks of 512 bytes; the signal is ignored, so that the system says EFBIG instead.
        let before = "trap '' XFSZ; ulimit -f 8;";
        assert!(again("a_limit_to_the_size_of_files_leaves_nothing", directory.path(), before).success());
        assert_eq!(names(directory.path()), ["a.exr"]);
        assert_eq!(std::fs::read(directory.path().join("a.exr")).unwrap(), b"old");
        return;
    };
    for result in [write_exr(&folder.join("a.exr"), &noise(), &[]), write_png(&folder.join("b.png"), &noise())] {
        let Err(ImageError::Write { path, source }) = result else { panic!("{result:?}") };
        assert_eq!(source.kind(), std::io::ErrorKind::FileTooLarge, "{}: {source}", path.display());
    }
}
