//! Where the files are that a scene names.

use std::path::{Path, PathBuf};

use crate::SceneSource;

/// The folders that a scene adds with `<path>`, the newest first. Mitsuba forgets those of an included file behind it; here they stay.
#[derive(Debug, Default)]
pub(super) struct Search {
    folders: Vec<PathBuf>,
}

impl Search {
    /// Adds a folder; it is asked before the earlier ones.
    pub(super) fn add(&mut self, folder: PathBuf) {
        self.folders.insert(0, folder);
    }

    /// How many folders were added.
    pub(super) fn len(&self) -> usize {
        self.folders.len()
    }

    /// The path of an included file: beside the including file, beside the scene file, or in a folder of a `<path>`.
    pub(super) fn include(&self, source: &SceneSource, includer: &Path, name: &str) -> PathBuf {
        self.first(source, includer, name, SceneSource::has)
    }

    /// A folder, found as an include is.
    pub(super) fn folder(&self, source: &SceneSource, includer: &Path, name: &str) -> PathBuf {
        self.first(source, includer, name, SceneSource::has_folder)
    }

    /// The first place at which something is, or else beside the including file, so that a message names the most likely place.
    fn first(
        &self,
        source: &SceneSource,
        includer: &Path,
        name: &str,
        is_there: fn(&SceneSource, &Path) -> bool,
    ) -> PathBuf {
        let beside = [includer, source.path()].map(|file| sibling(file, name));
        let mut all = beside.into_iter().chain(self.folders.iter().map(|f| f.join(name)));
        all.find(|path| is_there(source, path)).unwrap_or_else(|| sibling(includer, name))
    }

    /// The path of a mesh: in a folder of a `<path>`, or beside the scene file.
    pub(super) fn mesh(&self, source: &SceneSource, name: &str) -> PathBuf {
        let beside = sibling(source.path(), name);
        self.folders.iter().map(|f| f.join(name)).find(|path| source.has(path)).unwrap_or(beside)
    }
}

/// `name` relative to the folder of `file`.
pub(super) fn sibling(file: &Path, name: &str) -> PathBuf {
    file.parent().unwrap_or_else(|| Path::new("")).join(name)
}
