//! References kept from one run to the next.
//!
//! A reference is three files: an EXR for each half, to be looked at or compared with other images, and a JSON that
//! says what they are and has their checksums. What the name of the file and the JSON cannot tell, above all whether
//! this program would still render the same, is asked of the pixels: a few are rendered again and must have the same
//! bits (`references.rs`).

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use vdf_image::{Image, check_writable, read_exr, write_atomically, write_exr};
use vdf_render::Integrator;
use vdf_scene::{PixelRect, Scene};

use crate::LabError;

/// A folder of references.
pub(super) struct Cache {
    folder: PathBuf,
}

/// What a reference is of. Whatever changes its pixels is here, but for the program itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Key {
    /// The scene's name.
    scene: String,
    /// [`Scene::checksum`], in which the crop is not.
    checksum: u32,
    /// The pixels: x0, y0, x1 and y1.
    crop: [u32; 4],
    integrator: String,
    /// Samples per pixel of each half.
    spp: u32,
    /// Seed of each half.
    seeds: [u64; 2],
}

/// What is beside the images.
#[derive(Serialize, Deserialize)]
struct Description {
    reference: Key,
    /// CRC-32 of the files of both halves.
    crc32: [u32; 2],
}

/// What the cache has.
pub(super) enum Lookup {
    Found([Image; 2]),
    Missing,
    /// There is something, but not what is wanted.
    Unusable {
        file: PathBuf,
        why: String,
    },
}

impl Key {
    /// The reference of a scene with two halves of `spp` samples per pixel and these seeds.
    pub(super) fn new(name: &str, scene: &Scene, integrator: Integrator, spp: u32, seeds: [u64; 2]) -> Self {
        let PixelRect { x0, y0, x1, y1 } = scene.film.crop;
        Self {
            scene: name.to_owned(),
            checksum: scene.checksum(),
            crop: [x0, y0, x1, y1],
            integrator: integrator.to_string(),
            spp,
            seeds,
        }
    }

    /// A name for files that no other reference has.
    fn stem(&self) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' };
        let scene: String = self.scene.chars().map(plain).take(40).collect();
        let ([x0, y0, x1, y1], spp) = (self.crop, 2 * u64::from(self.spp));
        let integrator = self.integrator.replace(' ', "");
        format!("{scene}-{integrator}-{}x{}+{x0}+{y0}-{spp}-{:08x}", x1 - x0, y1 - y0, self.checksum)
    }
}

impl Cache {
    /// Makes the folder if need be.
    pub(super) fn open(folder: Option<&Path>) -> Result<Self, LabError> {
        let standard = || dirs::cache_dir().unwrap_or_else(std::env::temp_dir).join("vdf-references");
        let folder = folder.map_or_else(standard, Path::to_owned);
        match fs::create_dir_all(&folder).and_then(|()| check_writable(&folder.join("reference.json"))) {
            Ok(()) => Ok(Self { folder }),
            Err(source) => Err(LabError::References { folder, source }),
        }
    }

    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    fn description(&self, key: &Key) -> PathBuf {
        self.folder.join(key.stem() + ".json")
    }

    fn halves(&self, key: &Key) -> [PathBuf; 2] {
        ["a", "b"].map(|half| self.folder.join(format!("{}-{half}.exr", key.stem())))
    }

    pub(super) fn look_up(&self, key: &Key) -> Lookup {
        let file = self.description(key);
        let text = match fs::read(&file) {
            Ok(text) => text,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Lookup::Missing,
            Err(e) => return Lookup::Unusable { file, why: e.to_string() },
        };
        let Ok(description) = serde_json::from_slice::<Description>(&text) else {
            return Lookup::Unusable { file, why: "it is damaged".to_owned() };
        };
        if description.reference != *key {
            return Lookup::Unusable { file, why: "it describes another reference".to_owned() };
        }
        let [a, b] = self.halves(key);
        match (read_half(&a, key, description.crc32[0]), read_half(&b, key, description.crc32[1])) {
            (Ok(a), Ok(b)) => Lookup::Found([a, b]),
            (Err(why), _) => Lookup::Unusable { file: a, why },
            (_, Err(why)) => Lookup::Unusable { file: b, why },
        }
    }

    pub(super) fn store(&self, key: &Key, halves: &[Image; 2]) -> Result<(), LabError> {
        let fail = |path: &Path| {
            let path = path.to_owned();
            move |source| LabError::Write { path, source }
        };
        let mut crc32 = [0; 2];
        for (i, (path, image)) in self.halves(key).iter().zip(halves).enumerate() {
            let attributes = [
                ("vdf.scene", key.scene.as_str().into()),
                ("vdf.integrator", key.integrator.as_str().into()),
                ("vdf.samplesPerPixel", i64::from(key.spp).into()),
                ("vdf.seed", key.seeds[i].to_string().into()),
            ];
            write_exr(path, image, &attributes)?;
            crc32[i] = fs::read(path).map(|bytes| crc32fast::hash(&bytes)).map_err(fail(path))?;
        }
        let description = Description { reference: key.clone(), crc32 };
        let form = |e: serde_json::Error| LabError::Form { what: "the JSON of a reference", message: e.to_string() };
        let (json, path) = (serde_json::to_string_pretty(&description).map_err(form)?, self.description(key));
        // Last, so that what it describes is there.
        write_atomically(&path, |out| writeln!(out, "{json}")).map_err(fail(&path))
    }
}

fn read_half(path: &Path, key: &Key, crc32: u32) -> Result<Image, String> {
    let bytes = fs::read(path).map_err(|e| e.to_string())?;
    if crc32fast::hash(&bytes) != crc32 {
        return Err("it is damaged".to_owned());
    }
    let image = read_exr(path).map_err(|e| e.to_string())?;
    let [x0, y0, x1, y1] = key.crop;
    let sound = [image.width, image.height] == [x1 - x0, y1 - y0] && image.pixels.iter().all(|p| p.is_finite());
    if sound { Ok(image) } else { Err("it has another size, or pixels that are not finite".to_owned()) }
}

#[cfg(test)]
mod tests {
    use vdf_image::Rgb;
    use vdf_scene::LoadOptions;
    use vdf_scenes::builtin;

    use super::*;

    const SEEDS: [u64; 2] = [8, 9];

    fn scene(defines: &[(&str, &str)]) -> Scene {
        let defines = defines.iter().map(|(n, v)| ((*n).to_owned(), (*v).to_owned())).collect();
        Scene::from_source(&builtin("cbox_vol2").unwrap(), &LoadOptions { defines, ..LoadOptions::default() }).unwrap()
    }

    fn why(lookup: Lookup) -> String {
        match lookup {
            Lookup::Unusable { why, .. } => why,
            Lookup::Found(_) => "found".to_owned(),
            Lookup::Missing => "missing".to_owned(),
        }
    }

    #[test]
    fn keys_tell_references_apart() {
        let small = [("width", "8"), ("height", "8")];
        let key = |scene: &Scene, setting, spp| Key::new("a/b <c>", scene, setting, spp, SEEDS);
        let first = key(&scene(&small), Integrator::Volpath, 4);
        assert!(first.stem().starts_with("a-b--c--volpath-8x8+0+0-8-"), "{}", first.stem());
        // The scene's own samples and seed are not used.
        assert_eq!(first, key(&scene(&[small[0], small[1], ("spp", "7"), ("seed", "9")]), Integrator::Volpath, 4));
        let mut moved = scene(&small);
        moved.surfaces[3].triangles[1].vertices[2].x += 1e-4;
        let mut dimmed = scene(&small);
        let sigma_t = dimmed.media[0].sigma_t.grey().expect("grey fog");
        dimmed.media[0].sigma_t = (sigma_t * (1.0 + f64::EPSILON)).into();
        let others = [
            key(&scene(&[("width", "9"), ("height", "8")]), Integrator::Volpath, 4),
            key(&scene(&[small[0], small[1], ("max_depth", "3")]), Integrator::Volpath, 4),
            key(&scene(&small), Integrator::raymarch(7), 4),
            key(&scene(&small), Integrator::raymarch(8), 4),
            key(&scene(&small), Integrator::Volpath, 5),
            key(&moved, Integrator::Volpath, 4),
            key(&dimmed, Integrator::Volpath, 4),
        ];
        let mut stems: Vec<String> = others.iter().chain([&first]).map(Key::stem).collect();
        stems.sort();
        stems.dedup();
        assert_eq!(stems.len(), 8);
    }

    #[test]
    fn what_is_stored_is_found_and_what_is_damaged_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::open(Some(&folder.path().join("new"))).unwrap();
        let key = Key::new("fog", &scene(&[("width", "3"), ("height", "2")]), Integrator::Volpath, 4, SEEDS);
        assert_eq!(why(cache.look_up(&key)), "missing");
        let mut halves = [Image::new(3, 2), Image::new(3, 2)];
        halves[0].pixels[4] = Rgb::new(1.0, 1e-30, 3e30);
        cache.store(&key, &halves).unwrap();
        assert!(matches!(cache.look_up(&key), Lookup::Found(found) if found == halves));

        // Every byte of an image counts, and every file.
        for path in cache.halves(&key) {
            let good = fs::read(&path).unwrap();
            for at in [0, good.len() / 2, good.len() - 1] {
                let mut bad = good.clone();
                bad[at] ^= 4;
                fs::write(&path, bad).unwrap();
                assert_eq!(why(cache.look_up(&key)), "it is damaged");
            }
            fs::remove_file(&path).unwrap();
            assert!(why(cache.look_up(&key)).contains("No such file"));
            fs::write(&path, good).unwrap();
        }
        assert_eq!(why(cache.look_up(&key)), "found");
        let path = cache.description(&key);
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replace("volpath", "magic")).unwrap();
        assert_eq!(why(cache.look_up(&key)), "it describes another reference");
        fs::write(&path, &text[..text.len() / 2]).unwrap();
        assert_eq!(why(cache.look_up(&key)), "it is damaged");
        // Whole files, but not of this reference.
        cache.store(&key, &[Image::new(2, 3), Image::new(2, 3)]).unwrap();
        assert!(why(cache.look_up(&key)).contains("another size"));
    }
}
