//! Where the files of a scene come from: the disk, or a table inside the program.

use std::borrow::Cow;
use std::io;
use std::path::{Component, Path, PathBuf};

/// One file of an embedded scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EmbeddedFile {
    /// Path relative to the scene's folder, with `/` between its parts.
    pub path: Cow<'static, str>,
    /// The contents.
    pub text: Cow<'static, str>,
}

/// A scene that can be loaded.
#[derive(Clone, Debug)]
pub struct SceneSource {
    main: PathBuf,
    embedded: Option<Vec<EmbeddedFile>>,
}

impl SceneSource {
    /// A scene file on disk.
    #[must_use]
    pub fn disk(path: &Path) -> Self {
        Self { main: path.to_path_buf(), embedded: None }
    }

    /// A scene in memory: the scene file, and the files that it names relative to itself. Nothing is read from disk.
    #[must_use]
    pub fn embedded(scene: EmbeddedFile, others: Vec<EmbeddedFile>) -> Self {
        let main = PathBuf::from(scene.path.as_ref());
        let mut files = vec![scene];
        files.extend(others);
        Self { main, embedded: Some(files) }
    }

    /// Path of the scene file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.main
    }

    /// The embedded files, the scene file first; empty for a scene on disk. Written to a folder under these names
    /// they are the same scene.
    #[must_use]
    pub fn files(&self) -> &[EmbeddedFile] {
        self.embedded.as_deref().unwrap_or_default()
    }

    /// Reads a file of the scene.
    pub(super) fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        let Some(files) = &self.embedded else { return std::fs::read(path) };
        let wanted = normalized(path);
        files
            .iter()
            .find(|file| normalized(Path::new(file.path.as_ref())) == wanted)
            .map(|file| file.text.as_bytes().to_vec())
            .ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "no such file in the embedded scene"))
    }
}

/// `a/./b/../c` → `a/c`, without looking at the disk.
fn normalized(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}
