//! Files that are damaged or made to do harm: none may cause a panic, an abort or a hunger for memory.

use std::io::Cursor;
use std::path::Path;

use ::exr::prelude as openexr;
use ::exr::prelude::WritableImage as _;

use crate::exr::decode_exr;
use crate::png::decode_png;
use crate::{Image, ImageError, encode_png, read_exr, read_image};

/// A small image whose pixels differ from each other.
fn picture(width: usize, height: usize) -> Image {
    let mut image = Image::new(width as u32, height as u32);
    for (at, pixel) in image.pixels.iter_mut().enumerate() {
        *pixel = crate::Rgb::new((at % 7) as f32, 0.25, at as f32 * 1e-3);
    }
    image
}

/// An EXR with the channels A, B (half), G (float) and R (half), of any compression and shape of blocks.
fn exr_bytes(compression: openexr::Compression, blocks: openexr::Blocks, [width, height]: [usize; 2]) -> Vec<u8> {
    let half = |value: usize| openexr::f16::from_f32(value as f32);
    let channels = openexr::SpecificChannels::rgba(|position: openexr::Vec2<usize>| {
        let (x, y) = (position.x(), position.y());
        (half(x), y as f32 + 0.5, half(x * y % 5), half(1))
    });
    let line_order = openexr::LineOrder::Increasing;
    let encoding = openexr::Encoding { compression, blocks, line_order };
    let layer = openexr::Layer::new((width, height), openexr::LayerAttributes::named("all"), encoding, channels);
    let mut bytes = Cursor::new(Vec::new());
    openexr::Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn compressions() -> [openexr::Compression; 10] {
    use openexr::Compression::{B44, B44A, DWAA, DWAB, PIZ, PXR24, RLE, Uncompressed, ZIP1, ZIP16};
    [Uncompressed, RLE, ZIP1, ZIP16, PIZ, PXR24, B44, B44A, DWAA(None), DWAB(None)]
}

fn read_exr_bytes(bytes: &[u8]) -> Result<Image, ImageError> {
    decode_exr(Path::new("a.exr"), Cursor::new(bytes), bytes.len() as u64)
}

fn read_png_bytes(bytes: &[u8]) -> Result<Image, ImageError> {
    decode_png(Path::new("a.png"), Cursor::new(bytes), bytes.len() as u64)
}

/// Where the value of a header's attribute begins.
fn attribute(bytes: &[u8], name_and_type: &str) -> usize {
    let name = name_and_type.as_bytes();
    bytes.windows(name.len()).position(|window| window == name).unwrap() + name.len() + 4
}

/// Where the offsets of the blocks are; the first block follows.
fn offsets(bytes: &[u8]) -> std::ops::Range<usize> {
    let blocks = attribute(bytes, "chunkCount\0int\0");
    let size = 8 * bytes[blocks] as usize;
    let is_table = |at: &usize| bytes[*at..at + 8] == ((at + size) as u64).to_le_bytes();
    let start = (0..bytes.len() - 8).find(is_table).unwrap();
    start..start + size
}

#[test]
fn every_compression_and_shape_of_blocks_is_read() {
    let tiles = |edge| openexr::Blocks::Tiles(openexr::Vec2(edge, edge));
    for compression in compressions() {
        for blocks in [openexr::Blocks::ScanLines, tiles(16), tiles(300)] {
            for size in [[1, 1], [37, 70]] {
                let context = format!("{compression:?} {blocks:?} {size:?}");
                let image = read_exr_bytes(&exr_bytes(compression, blocks, size)).expect(&context);
                assert_eq!([image.width, image.height].map(|edge| edge as usize), size, "{context}");
                // B44 and DWA change values; the others keep half floats.
                let tolerance = match compression {
                    openexr::Compression::B44 | openexr::Compression::B44A => 1.5,
                    openexr::Compression::DWAA(_) | openexr::Compression::DWAB(_) => 1.0,
                    _ => 0.0,
                };
                for (at, pixel) in image.pixels.iter().enumerate() {
                    let (x, y) = (at % size[0], at / size[0]);
                    let expected = crate::Rgb::new(x as f32, y as f32 + 0.5, (x * y % 5) as f32);
                    assert!((pixel - expected).abs().max_element() <= tolerance, "{context} {at} {pixel}");
                }
            }
        }
    }
}

#[test]
fn an_exr_without_its_pixels_is_refused_with_the_figure() {
    for compression in compressions() {
        let mut bytes = exr_bytes(compression, openexr::Blocks::ScanLines, [8, 8]);
        let window = attribute(&bytes, "dataWindow\0box2i\0");
        let blocks = attribute(&bytes, "chunkCount\0int\0");
        let mut claim = |edge: i32| {
            bytes[window + 8..window + 12].copy_from_slice(&(edge - 1).to_le_bytes());
            bytes[window + 12..window + 16].copy_from_slice(&(edge - 1).to_le_bytes());
            let rows = compression.scan_lines_per_block() as i32;
            bytes[blocks..blocks + 4].copy_from_slice(&((edge + rows - 1) / rows).to_le_bytes());
            read_exr_bytes(&bytes).unwrap_err()
        };
        let error = claim(16_384);
        assert!(matches!(error, ImageError::Format { .. }), "{compression:?}: {error}");
        // The offsets of the few blocks of DWAB fit; there is no end to what one of its blocks can hold.
        let is_told = error.to_string().contains("which do not fit into a file of");
        assert!(is_told || compression == openexr::Compression::DWAB(None), "{compression:?}: {error}");
        let error = claim(65_536);
        assert!(matches!(error, ImageError::TooLarge { bytes: 51_539_607_552, .. }), "{compression:?}: {error}");
        assert!(error.to_string().contains("65536 x 65536 pixels need 51539607552 bytes"), "{error}");
    }
}

#[test]
fn a_tile_of_gigabytes_is_refused() {
    let mut bytes = exr_bytes(openexr::Compression::ZIP16, openexr::Blocks::Tiles(openexr::Vec2(16, 16)), [8, 8]);
    let tiles = attribute(&bytes, "tiles\0tiledesc\0");
    bytes[tiles..tiles + 8].copy_from_slice(&[0, 0, 1, 0, 0, 0, 1, 0]);
    let error = read_exr_bytes(&bytes).unwrap_err();
    assert!(error.to_string().contains("in blocks of 42949672960 bytes"), "{error}");
}

#[test]
fn a_dwa_block_that_claims_terabytes_is_refused() {
    let whole = exr_bytes(openexr::Compression::DWAA(None), openexr::Blocks::ScanLines, [40, 40]);
    // A block begins with its row and its length; then eleven counters follow.
    let start = offsets(&whole).end + 8;
    assert_eq!(whole[start..start + 8], 2_u64.to_le_bytes());
    for (counter, claim) in [(1, 1_u64 << 43), (6, 1 << 33), (7, 1 << 40), (8, 1 << 42), (9, 1 << 42), (8, u64::MAX)] {
        let mut bytes = whole.clone();
        bytes[start + 8 * counter..start + 8 * counter + 8].copy_from_slice(&claim.to_le_bytes());
        let error = read_exr_bytes(&bytes).unwrap_err();
        assert!(error.to_string().contains("a block claims to hold more than its pixels"), "{counter}: {error}");
    }
}

#[test]
fn a_block_that_comes_twice_or_never_is_an_error() {
    let bytes = exr_bytes(openexr::Compression::ZIP16, openexr::Blocks::ScanLines, [8, 40]);
    let table = offsets(&bytes).start;
    assert_eq!(offsets(&bytes).len(), 3 * 8);
    let mut twice = bytes.clone();
    twice.copy_within(table..table + 8, table + 8);
    let error = read_exr_bytes(&twice).unwrap_err();
    assert!(error.to_string().contains("a block is not where it should be"), "{error}");
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_refused_before_it_is_opened() {
    let directory = tempfile::tempdir().unwrap();
    let pipe = directory.path().join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    // To open the pipe would be to wait for a writer that never comes.
    for path in [pipe.as_path(), Path::new("/dev/zero"), directory.path()] {
        for error in [read_exr(path).unwrap_err(), read_image(path).unwrap_err()] {
            assert!(matches!(error, ImageError::Format { .. }), "{error}");
            assert!(error.to_string().contains("it is not a file but a"), "{error}");
        }
    }
}

/// Small numbers that look random and are the same in every run (Knuth's linear congruence).
struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % end
    }
}

/// Changes one to eight places: bits, bytes, numbers at the edges of their range, and what is cut out, repeated or lost
/// at the end.
fn mutate(bytes: &mut Vec<u8>, random: &mut Random) {
    const NUMBERS: [u32; 12] =
        [0, 1, 2, 0x7f, 0xff, 0x100, 0x7fff, 0xffff, 0x7fff_ffff, 0x8000_0000, 0xffff_fffe, 0xffff_ffff];
    for _ in 0..=random.below(8) {
        if bytes.len() < 16 {
            return;
        }
        let (at, end) = (random.below(bytes.len() - 8), bytes.len());
        match random.below(10) {
            0..=2 => bytes[at] ^= 1 << random.below(8),
            3 | 4 => bytes[at] = random.below(256) as u8,
            5 | 6 => bytes[at..at + 4].copy_from_slice(&NUMBERS[random.below(12)].to_le_bytes()),
            7 => bytes[at..at + 4].copy_from_slice(&NUMBERS[random.below(12)].to_be_bytes()),
            8 => {
                let length = random.below(16.min(end - at));
                let target = random.below(end - length);
                bytes.copy_within(at..at + length, target);
            }
            _ if random.below(4) == 0 => bytes.truncate(at),
            _ => drop(bytes.drain(at..at + random.below(8))),
        }
    }
}

/// Makes the checksums of a PNG right again, so that changes reach the decoder.
fn mend_checksums(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(length) = bytes.get(at..at + 4) {
        let length = u32::from_be_bytes([length[0], length[1], length[2], length[3]]) as usize;
        let (start, end) = (at + 4, at.saturating_add(8).saturating_add(length));
        if end.saturating_add(4) > bytes.len() {
            return;
        }
        let sum = !bytes[start..end].iter().fold(!0_u32, |sum, &byte| {
            (0..8).fold(sum ^ u32::from(byte), |sum, _| (sum >> 1) ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 })
        });
        bytes[end..end + 4].copy_from_slice(&sum.to_be_bytes());
        at = end + 4;
    }
}

/// Files of every kind that is read, small so that most changes matter.
fn seeds() -> (Vec<Vec<u8>>, Vec<Vec<u8>>) {
    let tiles = openexr::Blocks::Tiles(openexr::Vec2(8, 8));
    let exrs = compressions().into_iter().flat_map(|compression| {
        [openexr::Blocks::ScanLines, tiles].map(|blocks| exr_bytes(compression, blocks, [13, 35]))
    });
    let mut pngs = vec![encode_png(&picture(13, 9)).unwrap()];
    for (colour, depth) in [
        (png::ColorType::Indexed, png::BitDepth::Two),
        (png::ColorType::GrayscaleAlpha, png::BitDepth::Sixteen),
        (png::ColorType::Grayscale, png::BitDepth::One),
    ] {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 12, 10);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        if colour == png::ColorType::Indexed {
            encoder.set_palette((0..12).collect::<Vec<u8>>());
        }
        let mut writer = encoder.write_header().unwrap();
        let row = (12 * colour.samples() * depth as usize).div_ceil(8);
        writer.write_image_data(&(0..row * 10).map(|i| (i * 37) as u8).collect::<Vec<u8>>()).unwrap();
        writer.finish().unwrap();
        pngs.push(bytes);
    }
    (exrs.collect(), pngs)
}

/// What the fuzzer starts from and what it has found; nothing in a packaged crate.
fn corpus() -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/exr");
    let mut paths: Vec<_> =
        std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

/// Panics of the decoder are caught where they are expected; nobody should have to read them in the log of a test.
fn silence_the_decoder() {
    let tell = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        let is_decoder = info.location().is_some_and(|location| location.file().contains("/exr-"));
        if !is_decoder {
            tell(info);
        }
    }));
}

/// Reads `count` mutations; returns how many were images still.
fn run(count: u64, first: u64) -> u64 {
    silence_the_decoder();
    let (mut exrs, pngs) = seeds();
    exrs.extend(corpus());
    let mut images = 0;
    for case in first..first + count {
        let mut random = Random(case);
        // The first numbers of neighbouring seeds are alike.
        let _ = random.below(2);
        let is_exr = random.below(4) != 0;
        let seeds = if is_exr { &exrs } else { &pngs };
        let mut bytes = seeds[random.below(seeds.len())].clone();
        mutate(&mut bytes, &mut random);
        let result = std::panic::catch_unwind(|| {
            if is_exr {
                read_exr_bytes(&bytes)
            } else {
                let mut bytes = bytes.clone();
                if case % 4 != 0 {
                    mend_checksums(&mut bytes);
                }
                read_png_bytes(&bytes)
            }
        });
        let result = result.unwrap_or_else(|_| panic!("case {case} panics"));
        images += u64::from(result.is_ok());
    }
    images
}

/// The most memory that this process has had, in kilobytes.
fn peak_kilobytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse().ok())
}

#[test]
fn ten_thousand_mutations_do_no_harm() {
    let images = run(10_000, 0);
    // Otherwise the mutations are too strong to reach the decoders, or too weak to matter.
    assert!((500..9_000).contains(&images), "{images}");
}

/// Some minutes. `VDF_MUTATIONS` says how many.
#[test]
#[ignore = "takes minutes"]
fn a_million_mutations_do_no_harm() {
    let count = std::env::var("VDF_MUTATIONS").ok().and_then(|count| count.parse().ok()).unwrap_or(1_000_000);
    let images = run(count, 1 << 32);
    let peak = peak_kilobytes().unwrap_or(0);
    println!("{count} mutations, {images} of them images still; peak {peak} kB");
    assert!(peak < 1 << 20, "{peak}");
}
