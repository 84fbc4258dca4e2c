//! Files that appear whole or not at all.
//!
//! The content goes to a temporary file in the same directory, is flushed to the device, and is then renamed. A crash,
//! a full disk or an interrupt leaves the directory as it was. Files that belong together are all written before the first is renamed.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};

use crate::ImageError;

/// A file that is written but has not appeared. Dropped, it is removed.
#[derive(Debug)]
pub struct StagedFile {
    path: PathBuf,
    /// `None` for a device or a pipe: what is written there is gone.
    temporary: Option<NamedTempFile<File>>,
}

/// A file that was written whole but could not be moved to its place.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", path.display())]
pub struct PersistError {
    /// The place.
    pub path: PathBuf,
    /// The system's reason.
    pub source: io::Error,
}

impl StagedFile {
    /// Writes with `write` to a temporary file beside `path`.
    ///
    /// A device or a pipe at `path` is written directly: to rename over it would destroy it.
    ///
    /// # Errors
    /// What the system says; then nothing new is left behind.
    pub fn write(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<Self> {
        if is_special(path) {
            let mut out = BufWriter::new(OpenOptions::new().write(true).open(path)?);
            write(&mut out)?;
            out.flush()?;
            return Ok(Self { path: path.to_owned(), temporary: None });
        }
        let temporary = temporary_beside(path)?;
        // To the bare file: the temporary's own errors would show its name.
        let mut out = BufWriter::new(temporary.as_file());
        write(&mut out)?;
        out.flush()?;
        drop(out);
        // Some file systems report a full disk only here.
        temporary.as_file().sync_all()?;
        Ok(Self { path: path.to_owned(), temporary: Some(temporary) })
    }

    /// Moves the file to its place; one that is there is replaced.
    ///
    /// # Errors
    /// What the system says; then nothing new is left behind.
    pub fn persist(self) -> io::Result<()> {
        let Self { path, temporary } = self;
        temporary.map_or(Ok(()), |temporary| temporary.persist(path).map(drop).map_err(|error| error.error))
    }

    /// Moves all files to their places, in this order. If one cannot be moved, those before it are removed again: no part of the
    /// results passes for all of them.
    ///
    /// # Errors
    /// The first that could not be moved.
    pub fn persist_all(files: Vec<Self>) -> Result<(), PersistError> {
        let mut done = Vec::new();
        for file in files {
            let (path, is_new) = (file.path.clone(), file.temporary.is_some());
            if let Err(source) = file.persist() {
                // If that fails, too, there is nothing better to tell than the first failure.
                done.iter().for_each(|path: &PathBuf| drop(std::fs::remove_file(path)));
                return Err(PersistError { path, source });
            }
            if is_new {
                done.push(path);
            }
        }
        Ok(())
    }
}

/// Writes a file with `write` and moves it to `path`; an existing file is replaced. A device or a pipe at `path` is written directly.
///
/// # Errors
/// What the system says; then nothing new is left behind.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    StagedFile::write(path, write)?.persist()
}

/// Tells, without leaving a trace, whether [`write_atomically`] could write `path` now.
///
/// # Errors
/// What the system says.
pub fn check_writable(path: &Path) -> io::Result<()> {
    if path.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a directory"));
    }
    if is_special(path) {
        return OpenOptions::new().write(true).open(path).map(drop);
    }
    temporary_beside(path).map(drop)
}

/// True if there is something at `path` that is neither a regular file nor a directory.
fn is_special(path: &Path) -> bool {
    path.metadata().is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}

pub(crate) fn stage_bytes(path: &Path, bytes: &[u8]) -> Result<StagedFile, ImageError> {
    StagedFile::write(path, |out| out.write_all(bytes))
        .map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

pub(crate) fn persist(path: &Path, file: StagedFile) -> Result<(), ImageError> {
    file.persist().map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

fn temporary_beside(path: &Path) -> io::Result<NamedTempFile<File>> {
    let directory = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    // `tempfile_in` would make the file private and hide the system's message behind the temporary name; the result
    // should be as readable as any other new file, and the message say what is wrong.
    let create = |path: &Path| OpenOptions::new().write(true).create_new(true).open(path);
    Builder::new().prefix(".vdf-").suffix(".tmp").make_in(directory, create)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(directory: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(directory).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_failed_write_keeps_the_old_file_and_nothing_else() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.txt");
        write_atomically(&path, |out| out.write_all(b"old")).unwrap();
        let result = write_atomically(&path, |out| {
            out.write_all(b"new")?;
            Err(io::Error::other("stop"))
        });
        assert!(result.is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(names(directory.path()), ["a.txt"]);
    }

    #[test]
    fn files_that_belong_together_appear_together() {
        let directory = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| directory.path().join(name));
        let stage = |path: &Path| StagedFile::write(path, |out| out.write_all(b"x")).unwrap();
        drop((stage(&a), stage(&b)));
        assert!(names(directory.path()).is_empty());
        // A directory cannot be replaced by a file.
        std::fs::create_dir(&b).unwrap();
        let error = StagedFile::persist_all(vec![stage(&a), stage(&b)]).unwrap_err();
        assert_eq!(error.path, b);
        assert_eq!(names(directory.path()), ["b"]);
        std::fs::remove_dir(&b).unwrap();
        StagedFile::persist_all(vec![stage(&a), stage(&b)]).unwrap();
        assert_eq!(names(directory.path()).len(), 2);
    }

    #[test]
    fn checking_leaves_no_trace() {
        let directory = tempfile::tempdir().unwrap();
        check_writable(&directory.path().join("a.txt")).unwrap();
        assert!(names(directory.path()).is_empty());
        assert!(check_writable(directory.path()).is_err());
        let error = check_writable(&directory.path().join("missing/a.txt")).unwrap_err();
        assert!(!error.to_string().contains(".vdf-"), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_is_not_replaced() {
        let device = Path::new("/dev/full");
        let error = write_atomically(device, |out| out.write_all(b"x")).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        assert!(!device.metadata().unwrap().is_file());
    }
}
