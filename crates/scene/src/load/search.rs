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
        let beside = sibling(includer, name);
        let others = std::iter::once(sibling(source.path(), name)).chain(self.folders.iter().map(|f| f.join(name)));
        existing(source, beside, others)
    }

    /// The path of a mesh: in a folder of a `<path>`, or beside the scene file.
    pub(super) fn mesh(&self, source: &SceneSource, name: &str) -> PathBuf {
        let beside = sibling(source.path(), name);
        self.folders.iter().map(|f| f.join(name)).find(|path| source.has(path)).unwrap_or(beside)
    }
}

/// The first path that is there, or else `first`, so that a message names the most likely place.
fn existing(source: &SceneSource, first: PathBuf, others: impl Iterator<Item = PathBuf>) -> PathBuf {
    if source.has(&first) {
        return first;
    }
    let mut others = others;
    others.find(|path| source.has(path)).unwrap_or(first)
}

/// `name` relative to the folder of `file`.
pub(super) fn sibling(file: &Path, name: &str) -> PathBuf {
    file.parent().unwrap_or_else(|| Path::new("")).join(name)
}
