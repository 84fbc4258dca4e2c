//! The temporary files of this process, so that none of them outlives it.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::{Builder, NamedTempFile, PersistError};

/// All temporary files that exist now. It is locked only to add, to remove and to clear.
static REGISTRY: Mutex<Registry> = Mutex::new(Registry { paths: BTreeSet::new(), is_closed: false });

/// Held while files move to their places, so that an exit never comes between two that belong together.
static MOVING: Mutex<()> = Mutex::new(());

struct Registry {
    paths: BTreeSet<PathBuf>,
    is_closed: bool,
}

/// A temporary file: `.vdf-` and some letters. Dropped, it is removed.
#[derive(Debug)]
pub(super) struct Temporary<F> {
    /// It is `None` only while the value is taken apart.
    file: Option<NamedTempFile<F>>,
    registered: PathBuf,
}

impl<F> Temporary<F> {
    /// Makes a temporary file in `folder` with `create`, which must fail if there is a file of that name.
    pub(super) fn create(folder: &Path, create: impl FnMut(&Path) -> io::Result<F>) -> io::Result<Self> {
        // The lock is held over both steps, because a file that is not yet registered would stay behind.
        let mut registry = lock(&REGISTRY);
        if registry.is_closed {
            return Err(about_to_exit());
        }
        let file = name().make_in(folder, create)?;
        // The process may change its directory before the file is removed.
        let registered = std::path::absolute(file.path())?;
        registry.paths.insert(registered.clone());
        Ok(Self { file: Some(file), registered })
    }

    pub(super) fn file(&self) -> io::Result<&F> {
        self.file.as_ref().map(NamedTempFile::as_file).ok_or_else(|| io::Error::other("the file has moved"))
    }

    /// Moves the file to `place`; a file that is there is replaced. If that fails, the temporary file is removed.
    pub(super) fn persist(mut self, place: &Path) -> io::Result<()> {
        let Some(file) = self.file.take() else { return Ok(()) };
        file.persist(place).map(drop).map_err(|PersistError { error, .. }| error)
    }

    /// As [`Self::persist`], but if that fails the file stays, and its path comes with the error.
    pub(super) fn persist_or_keep(mut self, place: &Path) -> Result<(), (io::Error, PathBuf)> {
        let Some(file) = self.file.take() else { return Ok(()) };
        file.persist(place).map(drop).map_err(|PersistError { error, mut file }| {
            file.disable_cleanup(true);
            (error, file.path().to_owned())
        })
    }
}

impl<F> Drop for Temporary<F> {
    fn drop(&mut self) {
        // Remove first: what is no longer registered would stay behind.
        drop(self.file.take());
        lock(&REGISTRY).paths.remove(&self.registered);
    }
}

/// The pattern of the names of temporary files.
pub(super) fn name() -> Builder<'static, 'static> {
    let mut builder = Builder::new();
    builder.prefix(".vdf-").suffix(".tmp");
    builder
}

/// Runs `action`, which moves files, unless [`remove_temporaries`] came before. It cannot come in between.
pub(super) fn while_moving<T>(action: impl FnOnce() -> T) -> io::Result<T> {
    let _moving = lock(&MOVING);
    // An older file that is set aside now might not come back before the exit.
    if lock(&REGISTRY).is_closed { Err(about_to_exit()) } else { Ok(action()) }
}

fn about_to_exit() -> io::Error {
    io::Error::new(io::ErrorKind::Interrupted, "the program is about to exit")
}

/// Removes all temporary files of this process and refuses new ones: files that are being written never appear.
///
/// It is meant for a thread that handles signals, just before the process exits: an exit runs no destructors. Files
/// that are being moved to their places by [`StagedFile::persist_all`](crate::StagedFile::persist_all) arrive first,
/// all of them. Not for a signal handler itself, since it takes locks and allocates. Later calls do nothing. Cost: one
/// call to the system a file.
pub fn remove_temporaries() {
    let _moving = lock(&MOVING);
    let mut registry = lock(&REGISTRY);
    registry.is_closed = true;
    for path in std::mem::take(&mut registry.paths) {
        // There is nobody left to tell if it fails.
        drop(std::fs::remove_file(path));
    }
}

/// A panic elsewhere leaves nothing half done here, so poison does not matter.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
