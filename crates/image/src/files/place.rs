//! Where a path leads: through symbolic links, to a file, a device or nothing yet.

use std::io;
use std::path::{Path, PathBuf};

/// Most symbolic links that are followed, as on Linux.
const MOST_LINKS: usize = 40;

/// True if there is something at `path` that is neither a regular file nor a directory.
pub(super) fn is_special(path: &Path) -> bool {
    path.metadata().is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}

/// The place that is written when `path` is written: the end of a chain of symbolic links, whether there is a file yet
/// or not.
pub(super) fn resolve(path: &Path) -> io::Result<PathBuf> {
    let mut place = path.to_owned();
    for _ in 0..MOST_LINKS {
        // `EINVAL` says that it is no link; whatever else is wrong is better told by the call that opens it.
        let Ok(target) = std::fs::read_link(&place) else { return Ok(place) };
        // A relative target is seen from the folder of the link; an absolute one replaces all.
        place = folder(&place).join(target);
    }
    Err(io::Error::other("there are too many symbolic links"))
}

/// The folder that `path` lies in.
pub(super) fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}
