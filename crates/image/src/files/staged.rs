//! Files that appear whole or not at all.
//!
//! The content goes to a temporary file in the same directory, is flushed to the device, and is then renamed. A crash,
//! a full disk or an interrupt leaves the directory as it was. Files that belong together are all written before the
//! first is renamed, and are all renamed or none.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Seek as _, Write};
use std::path::{Path, PathBuf};

use super::place::{folder, is_special, resolve};
use super::shown;
use super::temporaries::{Temporary, name, while_moving};

/// A file that is written but has not appeared. Dropped, it is removed.
#[derive(Debug)]
pub struct StagedFile {
    /// The name as it was given.
    path: PathBuf,
    /// The place that it leads to through symbolic links.
    place: PathBuf,
    /// `None` for a device or a pipe: what is written there is gone.
    temporary: Option<Temporary<File>>,
}

/// A file that was written whole but could not be moved to its place.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", shown(path))]
pub struct PersistError {
    /// The place.
    pub path: PathBuf,
    /// The system's reason.
    pub source: io::Error,
}

impl StagedFile {
    /// Writes with `write` to a temporary file beside `path`.
    ///
    /// A symbolic link is written through: the file that it leads to is written, and the link stays. A device or a pipe
    /// at `path` is written directly, because to rename over it would destroy it.
    ///
    /// # Errors
    /// What the system says; then nothing new is left behind.
    pub fn write(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<Self> {
        let write = |file: &File| {
            let mut out = BufWriter::new(file);
            write(&mut out)?;
            out.flush()
        };
        if is_special(path) {
            write(&OpenOptions::new().write(true).open(path)?)?;
            return Ok(Self { path: path.to_owned(), place: path.to_owned(), temporary: None });
        }
        Self::write_regular(path, write)
    }

    /// As [`Self::write`] for a writer that must seek and read back. What goes to a device or a pipe is first gathered
    /// in a nameless file.
    pub(crate) fn write_seekable<E: From<io::Error>>(
        path: &Path,
        write: impl FnOnce(&File) -> Result<(), E>,
    ) -> Result<Self, E> {
        if is_special(path) {
            // Open it first, so that a place that cannot be written costs no work.
            let mut out = OpenOptions::new().write(true).open(path)?;
            let mut gathered = tempfile::tempfile()?;
            write(&gathered)?;
            gathered.rewind()?;
            io::copy(&mut gathered, &mut out)?;
            return Ok(Self { path: path.to_owned(), place: path.to_owned(), temporary: None });
        }
        Self::write_regular(path, write)
    }

    fn write_regular<E: From<io::Error>>(path: &Path, write: impl FnOnce(&File) -> Result<(), E>) -> Result<Self, E> {
        let place = resolve(path)?;
        let temporary = temporary_beside(&place)?;
        // To the bare file: the temporary's own errors would show its name.
        let file = temporary.file()?;
        write(file)?;
        // Some file systems report a full disk only here.
        file.sync_all()?;
        Ok(Self { path: path.to_owned(), place, temporary: Some(temporary) })
    }

    /// Moves the file to its place; one that is there is replaced.
    ///
    /// # Errors
    /// What the system says; then nothing new is left behind, and an older file is as it was.
    pub fn persist(self) -> io::Result<()> {
        while_moving(|| self.move_to_place())?
    }

    /// Moves all files to their places, in this order, or none: if one cannot be moved, those before it are taken back,
    /// and the older files that they had replaced are put back.
    ///
    /// Older files are kept by a second name (a hard link) until all have moved. Where the file system has no hard
    /// links, they are renamed for that time.
    ///
    /// # Errors
    /// The first that could not be moved. Should an older file not go back to its place, the message says under which
    /// name it is kept.
    pub fn persist_all(files: Vec<Self>) -> Result<(), PersistError> {
        let Some(first) = files.first().map(|file| file.path.clone()) else { return Ok(()) };
        while_moving(|| Self::move_all(files)).map_err(|source| PersistError { path: first, source })?
    }

    fn move_all(files: Vec<Self>) -> Result<(), PersistError> {
        let mut moved: Vec<Moved> = Vec::new();
        let mut files = files.into_iter().peekable();
        while let Some(file) = files.next() {
            let path = file.path.clone();
            // The last one needs no way back, because nothing can fail after it.
            let step =
                if files.peek().is_some() { file.move_reversibly() } else { file.move_to_place().map(|()| None) };
            match step {
                Ok(step) => moved.extend(step),
                Err(source) => {
                    let undone = moved.into_iter().rev().map(Moved::undo);
                    return Err(PersistError { path, source: undone.fold(source, with_undo) });
                }
            }
        }
        Ok(())
    }

    fn move_to_place(self) -> io::Result<()> {
        self.temporary.map_or(Ok(()), |temporary| temporary.persist(&self.place))
    }

    /// Moves the file and says how to take that back; `None` for what cannot be taken back.
    fn move_reversibly(self) -> io::Result<Option<Moved>> {
        let Self { place, temporary: Some(temporary), .. } = self else { return Ok(None) };
        let older = set_aside(&place)?;
        match temporary.persist(&place) {
            Ok(()) => Ok(Some(Moved { place, older })),
            // A renamed one goes back; a hard link is only removed.
            Err(error) => Err(with_undo(error, Moved { place, older }.undo_aside())),
        }
    }
}

/// The error with the name of an older file that could not be put back.
fn with_undo(error: io::Error, undone: Result<(), PathBuf>) -> io::Error {
    match undone {
        Ok(()) => error,
        Err(kept) => io::Error::new(error.kind(), format!("{error}; an older file is kept as {}", shown(&kept))),
    }
}

/// A file that has moved to its place, and how to take that back. Dropped, it is there to stay.
struct Moved {
    place: PathBuf,
    older: Older,
}

/// What was at a place before.
enum Older {
    Nothing,
    /// The older file has this second name, too.
    Linked(Temporary<()>),
    /// The older file has only this name. It is not registered: to remove it at an exit would lose it.
    Renamed(PathBuf),
}

impl Moved {
    /// Takes the move back. If the older file cannot be put back, the name that it has now is returned.
    fn undo(self) -> Result<(), PathBuf> {
        match self.older {
            // If that fails, there is nothing better to tell than the failure that led here.
            Older::Nothing => {
                drop(std::fs::remove_file(&self.place));
                Ok(())
            }
            Older::Linked(link) => link.persist_or_keep(&self.place).map_err(|(_, kept)| kept),
            Older::Renamed(kept) => std::fs::rename(&kept, &self.place).map_err(|_| kept),
        }
    }

    /// Puts the older file back although nothing has moved to its place.
    fn undo_aside(self) -> Result<(), PathBuf> {
        match self.older {
            Older::Renamed(kept) => std::fs::rename(&kept, &self.place).map_err(|_| kept),
            Older::Nothing | Older::Linked(_) => Ok(()),
        }
    }
}

/// Keeps the file at `place` under another name beside it.
fn set_aside(place: &Path) -> io::Result<Older> {
    match place.symlink_metadata() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Older::Nothing),
        Err(error) => return Err(error),
        Ok(metadata) if metadata.is_dir() => {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a directory"));
        }
        Ok(_) => {}
    }
    // A hard link leaves the older file in its place, so that there is a whole file at any moment.
    if let Ok(link) = Temporary::create(folder(place), |path| std::fs::hard_link(place, path)) {
        return Ok(Older::Linked(link));
    }
    let renamed = name().make_in(folder(place), |path| {
        if path.symlink_metadata().is_ok() {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        std::fs::rename(place, path)
    })?;
    let ((), kept) = renamed.keep().map_err(|error| error.error)?;
    Ok(Older::Renamed(kept))
}

/// Writes a file with `write` and moves it to `path`; an existing file is replaced, a symbolic link is written
/// through. A device or a pipe at `path` is written directly.
///
/// # Errors
/// What the system says; then nothing new is left behind.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    StagedFile::write(path, write)?.persist()
}

/// Tells, without leaving a trace, whether [`write_atomically`] could write `path` now. A pipe is not tried: its reader
/// would see an end.
///
/// # Errors
/// What the system says.
pub fn check_writable(path: &Path) -> io::Result<()> {
    if path.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a directory"));
    }
    if is_special(path) {
        return if is_pipe(path) { Ok(()) } else { OpenOptions::new().write(true).open(path).map(drop) };
    }
    temporary_beside(&resolve(path)?).map(drop)
}

#[cfg(unix)]
fn is_pipe(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt as _;
    path.metadata().is_ok_and(|metadata| metadata.file_type().is_fifo())
}

#[cfg(not(unix))]
fn is_pipe(_path: &Path) -> bool {
    false
}

fn temporary_beside(place: &Path) -> io::Result<Temporary<File>> {
    // `tempfile_in` would make the file private and hide the system's message behind the temporary name; the result
    // should be as readable as any other new file, and the message say what is wrong.
    Temporary::create(folder(place), |path| OpenOptions::new().read(true).write(true).create_new(true).open(path))
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

    #[test]
    fn a_failed_set_keeps_the_older_files() {
        let directory = tempfile::tempdir().unwrap();
        let [png, json, exr] = ["a.png", "b.json", "c.exr"].map(|name| directory.path().join(name));
        let stage = |path: &Path| StagedFile::write(path, |out| out.write_all(b"new")).unwrap();
        std::fs::write(&png, "old").unwrap();
        std::fs::create_dir(&exr).unwrap();
        // `json` is new, so that it must vanish; the set names one file twice, so that the order of undoing matters.
        let set = || vec![stage(&png), stage(&json), stage(&png), stage(&exr), stage(&json)];
        assert_eq!(StagedFile::persist_all(set()).unwrap_err().path, exr);
        assert_eq!(std::fs::read(&png).unwrap(), b"old");
        let mut left = names(directory.path());
        left.sort();
        assert_eq!(left, ["a.png", "c.exr"]);
        std::fs::remove_dir(&exr).unwrap();
        StagedFile::persist_all(set()).unwrap();
        assert!([&png, &json, &exr].iter().all(|path| std::fs::read(path).unwrap() == b"new"));
        assert_eq!(names(directory.path()).len(), 3);
    }

    #[test]
    fn an_older_file_that_was_renamed_goes_back() {
        let directory = tempfile::tempdir().unwrap();
        let place = directory.path().join("a");
        let aside = directory.path().join("aside");
        let older = |aside: &Path| Moved { place: place.clone(), older: Older::Renamed(aside.to_owned()) };
        std::fs::write(&aside, "old").unwrap();
        older(&aside).undo_aside().unwrap();
        assert_eq!(std::fs::read(&place).unwrap(), b"old");
        std::fs::rename(&place, &aside).unwrap();
        std::fs::write(&place, "new").unwrap();
        older(&aside).undo().unwrap();
        assert_eq!(std::fs::read(&place).unwrap(), b"old");
        assert_eq!(older(&aside).undo().unwrap_err(), aside);
    }

    #[cfg(unix)]
    #[test]
    fn a_symbolic_link_is_written_through() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        std::fs::create_dir(at("real")).unwrap();
        std::os::unix::fs::symlink("real/a", at("one")).unwrap();
        std::os::unix::fs::symlink(at("one"), at("two")).unwrap();
        // At first the chain leads to no file.
        for content in ["first", "second"] {
            check_writable(&at("two")).unwrap();
            write_atomically(&at("two"), |out| out.write_all(content.as_bytes())).unwrap();
            assert_eq!(std::fs::read(at("real/a")).unwrap(), content.as_bytes());
            assert!(["one", "two"].iter().all(|name| at(name).is_symlink()));
            assert_eq!(names(&at("real")), ["a"]);
        }
        std::os::unix::fs::symlink("round", at("round")).unwrap();
        assert!(write_atomically(&at("round"), |out| out.write_all(b"x")).is_err());
        assert!(check_writable(&at("round")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_not_opened_to_check_it() {
        let directory = tempfile::tempdir().unwrap();
        let pipe = directory.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        // Without a reader this would wait for ever.
        check_writable(&pipe).unwrap();
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || std::fs::read(pipe).unwrap()
        });
        StagedFile::write_seekable(&pipe, |mut file| {
            file.write_all(b"xyz")?;
            file.rewind()?;
            file.write_all(b"a")
        })
        .unwrap()
        .persist()
        .unwrap();
        assert_eq!(reader.join().unwrap(), b"ayz");
        assert_eq!(names(directory.path()), ["pipe"]);
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
