//! How much memory it takes to write and to read an image. In a program of its own, because the peak is that of a
//! process.

#![cfg(target_os = "linux")]

use vdf_image::{Image, read_exr, read_image, write_exr, write_png};

/// The most memory that this process has had, in bytes.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux has it");
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("Linux has it");
    let kilobytes: u64 = line.trim().trim_end_matches("kB").trim().parse().expect("it is a number");
    1024 * kilobytes
}

/// An image of noise, which compression makes little smaller.
fn noise(edge: u32) -> Image {
    let mut image = Image::try_new(edge, edge).expect("there is memory for a test");
    let mut random = 1_u32;
    for value in image.pixels.iter_mut().flat_map(AsMut::<[f32; 3]>::as_mut) {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *value = (random >> 8) as f32 / (1 << 24) as f32;
    }
    image
}

#[test]
fn an_exr_is_written_and_read_without_a_second_copy() {
    let directory = tempfile::tempdir().expect("a folder");
    let path = directory.path().join("a.exr");
    // 17 MB.
    let image = noise(1200);
    let before = peak();
    write_exr(&path, &image, &[]).expect("it is written");
    assert!(peak() - before < 8 << 20, "{} {before}", peak());
    drop(image);
    let image = read_exr(&path).expect("it is read");
    assert!(peak() - before < 12 << 20, "{} {before}", peak());
    assert_eq!(image.width, 1200);
    // A PNG has a quarter of that, once as bytes; packed, where noise is as large, in a buffer that doubles and is copied: 4.3 + 3 × 4.3 MB.
    let path = path.with_extension("png");
    write_png(&path, &image).expect("it is written");
    assert!(peak() - before < 18 << 20, "{} {before}", peak());
}

#[test]
#[ignore = "takes a minute and 1.6 GB of disk"]
fn a_film_of_8000_squared_stays_under_two_gigabytes() {
    let directory = tempfile::tempdir().expect("a folder");
    let image = noise(8000);
    let made = peak();
    write_exr(&directory.path().join("a.exr"), &image, &[]).expect("it is written");
    let exr = peak();
    write_png(&directory.path().join("a.png"), &image).expect("it is written");
    let png = peak();
    drop(image);
    for name in ["a.exr", "a.png"] {
        let (image, _) = read_image(&directory.path().join(name)).expect("it is read");
        assert_eq!(image.width, 8000);
    }
    let read = peak();
    println!("peak in MB: image {}, EXR {}, PNG {}, read {}", made >> 20, exr >> 20, png >> 20, read >> 20);
    assert!(read < 2_000_000_000, "{read}");
}
