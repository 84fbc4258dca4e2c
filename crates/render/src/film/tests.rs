use std::path::Path;

use glam::DVec3;

use super::*;
use crate::{Sampler, render::FilmPart};

/// Two tiles, the second one pixel wide.
const WIDTH: u32 = 17;
const PIXELS: usize = WIDTH as usize;

fn origin(seed: u64) -> FilmOrigin {
    FilmOrigin { seed, ..FilmOrigin::example([WIDTH, 1], 70) }
}

/// Values whose sums depend on the order: of very different sizes.
fn value(pixel: usize, sample: u32) -> DVec3 {
    let mut u = Sampler::new(3, pixel as u32, 0, sample);
    DVec3::from_array([(); 3].map(|()| u.next_1d() * (30.0 * u.next_1d()).exp()))
}

fn part(part: &FilmPart) -> Film {
    let mut film = Film::new(origin(7), Picture::default()).unwrap();
    for (tile, rect) in tile_rects(film.origin.crop).enumerate().filter(|(tile, _)| part.has_tile(*tile)) {
        let mut sums = TileSums::new();
        for (x, _) in pixels(rect) {
            let mut sum = PixelSum::new();
            part.samples.clone().for_each(|s| sum.add(s, value(x as usize, s)));
            sums.push(256, &sum, |value, numbers| numbers.extend(value.to_array()));
        }
        film.add_tile(tile, sums, &Counters { paths: 1, ..Counters::default() });
    }
    film
}

fn film(samples: Range<u32>) -> Film {
    part(&FilmPart::samples(samples))
}

/// The definition: the sum of a block is that of its halves.
fn block(pixel: usize, first: u32, size: u32) -> DVec3 {
    match size {
        1 => value(pixel, first),
        _ => block(pixel, first, size / 2) + block(pixel, first + size / 2, size / 2),
    }
}

#[test]
fn sums_are_those_of_the_tree() {
    for n in 1..70_u32 {
        let developed = film(0..n).develop().unwrap();
        for pixel in 0..PIXELS {
            let (mut total, mut first) = (DVec3::ZERO, 0);
            while first < n {
                let size = 1 << (n - first).ilog2();
                total += block(pixel, first, size);
                first += size;
            }
            assert_eq!(developed.pixels[pixel], (total / f64::from(n)).as_vec3(), "{n} samples");
        }
    }
}

#[test]
fn a_film_is_the_same_however_it_was_cut() {
    for n in [1_u32, 2, 7, 8, 64, 77] {
        let whole = film(0..n);
        for cut in 0..100 {
            let mut u = Sampler::new(11, cut, n, 0);
            let mut borders = vec![0, n];
            borders.extend((0..cut % 5).map(|_| (u.next_1d() * f64::from(n)) as u32));
            borders.sort_unstable();
            borders.dedup();
            let tiles = 1 + cut as usize % 2;
            let cuts = borders.windows(2).flat_map(|b| (0..tiles).map(|t| (b[0]..b[1], t)));
            let mut parts: Vec<Film> =
                cuts.map(|(samples, t)| part(&FilmPart { samples, tiles: (t, tiles) })).collect();
            while parts.len() > 1 {
                let part = parts.swap_remove((u.next_1d() * parts.len() as f64) as usize);
                let into = (u.next_1d() * parts.len() as f64) as usize;
                parts[into].merge(part).unwrap();
            }
            assert_eq!(parts[0].tiles, whole.tiles, "{n} samples cut at {borders:?}");
            assert_eq!(parts[0].develop(), whole.develop());
        }
    }
}

#[test]
fn shares_make_up_the_whole() {
    for (spp, count) in [(1, 1), (10, 4), (3, 8), (u32::MAX, 7), (64, 64)] {
        let parts: Vec<_> = (0..count).map(|i| FilmPart::by_samples(spp, i, count).samples).collect();
        assert_eq!((parts[0].start, parts[parts.len() - 1].end), (0, spp));
        assert!(parts.windows(2).all(|p| p[0].end == p[1].start), "{parts:?}");
        let sizes = parts.iter().map(|p| p.end - p.start);
        assert!(sizes.clone().max().unwrap() - sizes.min().unwrap() <= 1, "{parts:?}");
    }
    for tile in 0..30 {
        assert_eq!((0..7).filter(|&i| FilmPart::by_tiles(1, i, 7).has_tile(tile)).count(), 1);
    }
}

fn missing(samples: Range<u64>, tiles: usize) -> MissingSamples {
    MissingSamples { samples, tiles, of: 2 }
}

#[test]
fn overlaps_and_gaps_are_told() {
    let mut a = film(0..5);
    let unchanged = a.clone();
    assert_eq!(a.merge(film(3..9)), Err(FilmError::Overlap { samples: 3..5, tiles: 2 }));
    assert_eq!(a, unchanged);
    a.merge(film(6..9)).unwrap();
    assert_eq!(a.samples(), [0..5, 6..9]);
    assert_eq!(a.develop(), Err(FilmError::Missing { missing: vec![missing(5..6, 2)] }));
    a.merge(part(&FilmPart { samples: 5..6, tiles: (1, 2) })).unwrap();
    assert_eq!(a.samples(), [0..5, 6..9]);
    assert_eq!(a.missing(0..12), [missing(5..6, 1), missing(9..12, 2)]);
    assert_eq!(a.missing(6..9), []);
    let error = FilmError::Missing { missing: a.missing(0..12) };
    assert_eq!(error.to_string(), "the film lacks sample 5 of 1 of 2 tiles, and samples 9 to 11");
    assert!(a.contains(&film(0..4)) && !a.contains(&film(4..6)));
    a.merge(part(&FilmPart { samples: 5..6, tiles: (0, 2) })).unwrap();
    assert_eq!(a.tiles, film(0..9).tiles);
    assert_eq!(film(2..4).develop(), Err(FilmError::Missing { missing: vec![missing(0..2, 2)] }));
    assert!(film(0..0).develop().is_err());
}

/// Whoever adds a field has to add it here, too.
#[test]
fn strangers_are_refused_with_the_field() {
    let with = |change: fn(&mut FilmOrigin)| {
        let mut stranger = film(5..9);
        change(&mut stranger.origin);
        stranger
    };
    let strangers = [
        ("version", with(|o| o.version = "2".to_owned())),
        ("scene", with(|o| o.scene = 2)),
        ("the integrator", with(|o| o.integrator = "raymarch 7".to_owned())),
        ("transmittance", with(|o| o.transmittance = "analog".to_owned())),
        ("roulette", with(|o| o.roulette = "thesis".to_owned())),
        ("estimator of light", with(|o| o.estimator = "equiangular".to_owned())),
        ("light paths", with(|o| o.light_paths = "never".to_owned())),
        ("sampler", with(|o| o.sampler = "sobol".to_owned())),
        ("seed", with(|o| o.seed = 8)),
        ("size", with(|o| o.full_size = [18, 1])),
        ("crop", with(|o| o.crop.y0 = 1)),
        ("layers", with(|o| o.layers = Layer::ALL.into_iter().collect())),
        ("method", with(|o| o.method = Some("lb".to_owned()))),
        ("samples per pixel", with(|o| o.spp = 9)),
    ];
    let mut film = film(0..5);
    let unchanged = film.clone();
    for (name, stranger) in strangers {
        let error = film.merge(stranger).unwrap_err();
        assert!(matches!(error, FilmError::Stranger { field, .. } if field.contains(name)), "{name}: {error}");
        assert_eq!(film, unchanged);
    }
    assert_eq!(
        film.merge(with(|o| o.seed = 8)).unwrap_err().to_string(),
        "the films are of different renders: the seed differs, 7 and 8"
    );
}

fn encoded(film: &Film) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.film");
    film.write(&path).unwrap();
    assert_eq!(Film::read(&path).unwrap(), *film);
    std::fs::read(path).unwrap()
}

fn decoded(bytes: &[u8]) -> Result<Film, FilmFileError> {
    Film::decode(Path::new("a.film"), bytes, bytes.len() as u64)
}

#[test]
fn files_keep_every_bit() {
    let mut film = film(3..10);
    film.merge(part(&FilmPart { samples: 12..13, tiles: (1, 2) })).unwrap();
    // As JSON has them, numbers of 17 digits, not all of which are read back by those who hurry.
    let world_to_camera = std::array::from_fn(|i| value(i, 0).x.sin());
    film.picture = Picture { name: "größe".to_owned(), half: true, world_to_camera };
    film.counters = Counters { queries: u64::MAX, rays: 2, refused: 3, ..Counters::default() };
    film.set_run(0, FilmRun { machine: "m".to_owned(), t_render: 0.1, ..FilmRun::default() });
    assert_eq!(decoded(&encoded(&film)).unwrap(), film);
    let empty = self::film(0..0);
    assert_eq!(decoded(&encoded(&empty)).unwrap(), empty);
}

/// Every single bit, and every length.
#[test]
fn damaged_files_are_refused_with_the_reason() {
    let bytes = encoded(&film(3..6));
    for at in 0..bytes.len() {
        for bit in 0..8 {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1 << bit;
            let error = decoded(&flipped).map(drop).expect_err("a flipped bit");
            assert!(matches!(error, FilmFileError::Damaged { .. }), "{error}");
        }
    }
    for length in 0..bytes.len() {
        let error = decoded(&bytes[..length]).map(drop).unwrap_err().to_string();
        assert!(error.contains("cut off") || length < 8, "{length}: {error}");
    }
    let longer = [bytes.as_slice(), b"x"].concat();
    assert!(decoded(&longer).unwrap_err().to_string().contains("1 bytes follow its end"));
    let mut pixel = bytes.clone();
    let last = pixel.len() - 10;
    pixel[last] ^= 1;
    assert!(decoded(&pixel).unwrap_err().to_string().contains("tile 1 is damaged: its checksum is"));
    assert!(decoded(b"VDFQUERY12345678").unwrap_err().to_string().contains("it is no film of vdf"));
}

/// Headers that lie, with a checksum that fits, must not cost memory or time either.
#[test]
fn headers_that_lie_are_refused() {
    let bytes = encoded(&film(3..6));
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let header = std::str::from_utf8(&bytes[16..16 + length]).unwrap();
    let with = |from: &str, to: &str| {
        assert!(header.contains(from), "{header}");
        let changed = header.replacen(from, to, 1);
        let mut lying = [&bytes[..12], &(changed.len() as u32).to_le_bytes(), changed.as_bytes()].concat();
        lying.extend(crc32fast::hash(&lying).to_le_bytes());
        lying.extend(&bytes[20 + length..]);
        decoded(&lying)
    };
    let same = with("\"seed\":7", "\"seed\": 7").unwrap();
    assert_eq!(same, film(3..6));
    let huge = "4294967295,4294967295]";
    for (from, to, reason) in [
        ("\"crop\":[0,0,17,1]", "\"crop\":[0,0,18,1]", "the crop is larger than the film"),
        ("\"crop\":[0,0,17,1]", "\"crop\":[9,0,9,1]", "the crop has no pixels"),
        ("\"crop\":[0,0,17,1]", "\"crop\":[0,0,16,1]", "bytes follow its end"),
        ("\"crop\":[0,0,17,1]", "\"crop\":[2,0,17,1]", "its tile 0 is damaged"),
        ("17,1],\"crop\":[0,0,17,1]", &format!("{huge},\"crop\":[0,0,{huge}"), "the file is cut off"),
        ("\"layers\":[", "\"layers\":[\"colour\"", "its header: "),
        ("\"seed\":7", "\"seed\":-7", "its header: "),
        ("\"seed\":7", "\"sead\":7", "missing field `seed`"),
    ] {
        let error = with(from, to).map(drop).expect_err(to).to_string();
        assert!(error.contains(reason), "{to}: {error}");
    }
}

#[test]
fn blocks_in_another_order_or_twice_are_refused() {
    let change = |change: fn(&mut FilmTile)| {
        let mut film = film(3..6);
        change(&mut film.tiles[1]);
        let mut bytes = Vec::new();
        film.encode(&mut bytes).unwrap();
        decoded(&bytes).map(drop)
    };
    change(|_| {}).unwrap();
    let wrongs: [fn(&mut FilmTile); 2] = [|t| t.blocks.swap(0, 1), |t| t.blocks[1] = t.blocks[0].clone()];
    for wrong in wrongs {
        let error = change(wrong).unwrap_err().to_string();
        assert!(error.contains("its tile 1 is damaged: its blocks are not in order"), "{error}");
    }
    let error = change(|tile| tile.blocks[1].0.level = 33).unwrap_err().to_string();
    assert!(error.contains("its tile 1 is damaged"), "{error}");
}

#[test]
fn a_pixel_without_samples_is_black_so_far() {
    let film = part(&FilmPart { samples: 1..3, tiles: (0, 2) });
    let image = film.develop_so_far().unwrap();
    assert_eq!(image.pixels[16], Rgb::ZERO);
    assert_eq!(image.pixels[2], ((value(2, 1) + value(2, 2)) / 2.0).as_vec3());
}
