//! Cells of a report that are kept, so that a run of many hours can be stopped and gone on with.
//!
//! *Idea.* Whatever is measured is one cell, a file of its own, written as soon as it is measured. A later run with the same options takes
//! the cell and measures what is missing.
//!
//! *Guarantee.* A cell appears whole or not at all. It names all that its figures depend on but the machine: version of the program,
//! options, scene, method. A cell of something else, or one that cannot be read, is measured again. What was measured and what was kept go
//! the same way into the report: through the file.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use vdf_image::{Image, read_exr, write_atomically, write_exr};

use super::super::bench::same_bits;
use crate::LabError;

/// Where cells are kept, if they are.
#[derive(Debug)]
pub(super) struct Store {
    folder: Option<PathBuf>,
    /// What all cells of this run depend on.
    run: String,
}

/// A cell as it is written.
#[derive(Serialize, Deserialize)]
struct Kept<T> {
    /// What it is of.
    of: String,
    cell: T,
}

impl Store {
    /// Keeps cells in `folder`, which is made if there is none. `run` says what they depend on beside their names.
    pub(super) fn new(folder: Option<&Path>, run: String) -> Result<Self, LabError> {
        if let Some(folder) = folder {
            fs::create_dir_all(folder).map_err(|source| LabError::Write { path: folder.to_owned(), source })?;
        }
        Ok(Self { folder: folder.map(Path::to_owned), run: format!("vdf {}, {run}", env!("CARGO_PKG_VERSION")) })
    }

    /// The cell of that name if there is one.
    pub(super) fn find<T: DeserializeOwned>(&self, name: &str) -> Option<T> {
        let text = fs::read_to_string(self.path(name, "json")?).ok()?;
        let kept: Kept<T> = serde_json::from_str(&text).ok()?;
        (kept.of == self.of(name)).then_some(kept.cell)
    }

    /// The cell of that name, measured and written if there is none.
    pub(super) fn cell<T: Serialize + DeserializeOwned>(
        &self,
        name: &str,
        measure: impl FnOnce() -> Result<T, LabError>,
    ) -> Result<T, LabError> {
        if let Some(found) = self.find(name) {
            return Ok(found);
        }
        let kept = Kept { of: self.of(name), cell: measure()? };
        let Some(path) = self.path(name, "json") else { return Ok(kept.cell) };
        let form = |e: serde_json::Error| LabError::Form { what: "a cell", message: e.to_string() };
        let text = serde_json::to_string_pretty(&kept).map_err(form)?;
        let written = write_atomically(&path, |out| out.write_all(text.as_bytes()));
        written.map_err(|source| LabError::Write { path, source })?;
        serde_json::from_str(&text).map(|kept: Kept<T>| kept.cell).map_err(form)
    }

    /// The image of that name; `None` if there is none.
    pub(super) fn image(&self, name: &str) -> Option<Image> {
        read_exr(&self.path(name, "exr")?).ok()
    }

    /// Keeps an image, and makes sure that it is read as it was written.
    pub(super) fn keep_image(&self, name: &str, image: &Image) -> Result<(), LabError> {
        let Some(path) = self.path(name, "exr") else { return Ok(()) };
        write_exr(&path, image, &[])?;
        if self.image(name).is_some_and(|read| same_bits(&read, image)) {
            return Ok(());
        }
        let source = io::Error::other("the image is not what was written");
        Err(LabError::Write { path, source })
    }

    fn of(&self, name: &str) -> String {
        format!("{name}, {}", self.run)
    }

    fn path(&self, name: &str, extension: &str) -> Option<PathBuf> {
        let plain: String =
            name.chars().map(|c| if c.is_ascii_alphanumeric() || "._-".contains(c) { c } else { '-' }).collect();
        self.folder.as_ref().map(|folder| folder.join(format!("{plain}.{extension}")))
    }
}

/// Methods by their names.
pub(super) mod by_name {
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};
    use vdf_visibility::Method;

    pub(in super::super) fn serialize<S: Serializer>(method: &Method, s: S) -> Result<S::Ok, S::Error> {
        s.serialize_str(method.name())
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(d: D) -> Result<Method, D::Error> {
        String::deserialize(d)?.parse().map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_measured_once_and_only_for_their_run() {
        let folder = tempfile::tempdir().unwrap();
        let store = |run: &str| Store::new(Some(&folder.path().join("a/b")), run.to_owned()).unwrap();
        let never = || -> Result<[f64; 2], LabError> { panic!("it is kept") };
        let value = [1.0 / 3.0, f64::MIN_POSITIVE];
        let first = store("size 8");
        assert_eq!(first.find::<[f64; 2]>("box volpath"), None);
        assert_eq!(first.cell("box volpath", || Ok(value)).unwrap(), value);
        assert_eq!(first.cell("box volpath", never).unwrap(), value);
        assert_eq!(store("size 8").cell("box volpath", never).unwrap(), value);
        // Another run, another cell, one that was damaged, one of another kind: measured again.
        assert_eq!(store("size 9").find::<[f64; 2]>("box volpath"), None);
        assert_eq!(store("size 8").find::<[f64; 2]>("box volpath2"), None);
        assert_eq!(store("size 8").find::<String>("box volpath"), None);
        let path = folder.path().join("a/b/box-volpath.json");
        let whole = fs::read_to_string(&path).unwrap();
        for cut in [0, 1, whole.len() / 2, whole.len() - 2] {
            fs::write(&path, &whole[..cut]).unwrap();
            assert_eq!(store("size 8").find::<[f64; 2]>("box volpath"), None, "{cut}");
        }
        assert_eq!(store("size 8").cell("box volpath", || Ok([2.0; 2])).unwrap(), [2.0; 2]);
        // What fails is not kept; without a folder nothing is.
        let failed = store("size 8").cell::<f64>("bad", || Err(LabError::UnknownScene("bad".to_owned())));
        assert!(failed.is_err() && store("size 8").find::<f64>("bad").is_none());
        let nowhere = Store::new(None, String::new()).unwrap();
        assert_eq!(nowhere.cell("x", || Ok(3.0)).unwrap(), 3.0);
        assert_eq!(nowhere.find::<f64>("x"), None);
    }

    #[test]
    fn images_keep_their_bits() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(Some(folder.path()), String::new()).unwrap();
        let mut image = Image::new(3, 2);
        for (i, p) in image.pixels.iter_mut().enumerate() {
            p.x = 1.0 / (i as f32 + 3.0);
        }
        assert!(store.image("fog raymarch 7").is_none());
        store.keep_image("fog raymarch 7", &image).unwrap();
        assert!(same_bits(&store.image("fog raymarch 7").unwrap(), &image));
    }
}
