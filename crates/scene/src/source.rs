//! Where the files of a scene come from: the disk, or a table inside the program.

use std::borrow::Cow;
use std::io::{self, BufRead, BufReader, Read as _};
use std::path::{Component, Path, PathBuf};
use std::sync::Mutex;

/// One file of an embedded scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EmbeddedFile {
    /// Path relative to the scene's folder, with `/` between its parts.
    pub path: Cow<'static, str>,
    /// The contents.
    pub bytes: Cow<'static, [u8]>,
}

/// A scene that can be loaded.
#[derive(Debug)]
pub struct SceneSource {
    main: PathBuf,
    embedded: Option<Vec<EmbeddedFile>>,
    /// The files of the disk that were opened.
    opened: Mutex<Vec<PathBuf>>,
}

impl SceneSource {
    /// A scene file on disk.
    #[must_use]
    pub fn disk(path: &Path) -> Self {
        Self { main: path.to_path_buf(), embedded: None, opened: Mutex::default() }
    }

    /// A scene in memory: the scene file, and the files that it names relative to itself. Nothing is read from disk.
    #[must_use]
    pub fn embedded(scene: EmbeddedFile, others: Vec<EmbeddedFile>) -> Self {
        let main = PathBuf::from(scene.path.as_ref());
        let mut files = vec![scene];
        files.extend(others);
        Self { main, embedded: Some(files), opened: Mutex::default() }
    }

    /// Path of the scene file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.main
    }

    /// The files of the disk that loading has opened so far: the scene file, what it includes, and its meshes. An output must not replace one.
    #[must_use]
    pub fn opened_files(&self) -> Vec<PathBuf> {
        self.opened.lock().map_or_else(|poisoned| poisoned.into_inner().clone(), |files| files.clone())
    }

    /// The embedded files, the scene file first; empty for a scene on disk. Written to a folder under these names
    /// they are the same scene.
    #[must_use]
    pub fn files(&self) -> &[EmbeddedFile] {
        self.embedded.as_deref().unwrap_or_default()
    }

    /// True if the scene has a file of that name, whatever it is.
    pub(crate) fn has(&self, path: &Path) -> bool {
        match &self.embedded {
            None => path.exists(),
            Some(_) => self.find(path).is_some(),
        }
    }

    /// True if the scene has a folder of that name.
    pub(crate) fn has_folder(&self, path: &Path) -> bool {
        match &self.embedded {
            None => path.is_dir(),
            Some(files) => {
                let wanted = normalized(path);
                files.iter().any(|file| normalized(Path::new(file.path.as_ref())).starts_with(&wanted))
            }
        }
    }

    /// Opens a file of the scene that has at most `most` bytes, and says how many. Only plain files are opened: a pipe could block forever, and a device might
    /// never end.
    pub(crate) fn open(&self, path: &Path, most: u64) -> io::Result<(Box<dyn BufRead + '_>, u64)> {
        let too_large = |size: u64| io::Error::other(format!("it has {size} bytes; at most {most} are read"));
        if self.embedded.is_some() {
            let file = self
                .find(path)
                .ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "no such file in the embedded scene"))?;
            let bytes = &*file.bytes;
            let size = bytes.len() as u64;
            return if size > most { Err(too_large(size)) } else { Ok((Box::new(bytes), size)) };
        }
        let metadata = std::fs::metadata(path)?;
        if metadata.is_dir() {
            return Err(io::Error::other("it is a folder"));
        }
        if !metadata.is_file() {
            return Err(io::Error::other("it is a pipe or a device: save its contents to a file first"));
        }
        if metadata.len() > most {
            return Err(too_large(metadata.len()));
        }
        if let Ok(mut opened) = self.opened.lock() {
            opened.push(path.to_path_buf());
        }
        // A file can grow while it is read, and some files of the system claim to be empty.
        let bounded = std::fs::File::open(path)?.take(most);
        Ok((Box::new(BufReader::with_capacity(1 << 16, bounded)), metadata.len()))
    }

    fn find(&self, path: &Path) -> Option<&EmbeddedFile> {
        let wanted = normalized(path);
        self.files().iter().find(|file| normalized(Path::new(file.path.as_ref())) == wanted)
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
