//! Whether two names mean the same file.

use std::path::{Path, PathBuf};

use super::place::{folder, is_special, resolve};
use super::shown;

/// A file that would be written although it is also read, or would be written twice.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Conflict {
    /// An output would replace an input.
    #[error("{output} would overwrite the input {}; give it another name", shown(path))]
    Input {
        /// The name of the output, as the caller gave it.
        output: String,
        /// The input's path, as the caller gave it.
        path: PathBuf,
    },
    /// Two outputs would be the same file.
    #[error("{first} and {second} both write {}; give one of them another name", shown(path))]
    Outputs {
        /// The name of the one output, as the caller gave it.
        first: String,
        /// The name of the other.
        second: String,
        /// The path of the second, as the caller gave it.
        path: PathBuf,
    },
}

/// Whether `a` and `b` lead to the same file, or would once it is written.
///
/// Files that exist are compared by device and inode (elsewhere than on Unix by their canonical paths), so symbolic and
/// hard links and `sub/..` make no difference. Names without a file are compared by the folder and the name that they
/// lead to. Cost: a few calls to the system.
#[must_use]
pub fn same_file(a: &Path, b: &Path) -> bool {
    match (identity(a), identity(b)) {
        (Some(a), Some(b)) => a == b,
        (None, None) => future_place(a) == future_place(b),
        _ => false,
    }
}

/// Refuses outputs that would replace an input or each other. Each output is a name for the message (what the user
/// knows it by) and its path.
///
/// Devices and pipes are not files that could be lost: any number of outputs may go there. Call it before anything is
/// written. Cost: each output is compared with each input and each other output.
///
/// # Errors
/// The first conflict, in the order of the outputs.
pub fn check_distinct(outputs: &[(&str, &Path)], inputs: &[&Path]) -> Result<(), Conflict> {
    for (at, &(name, path)) in outputs.iter().enumerate() {
        if is_special(path) {
            continue;
        }
        if let Some(input) = inputs.iter().find(|input| same_file(path, input)) {
            return Err(Conflict::Input { output: name.to_owned(), path: (*input).to_owned() });
        }
        if let Some((first, _)) = outputs[..at].iter().find(|(_, other)| same_file(path, other)) {
            return Err(Conflict::Outputs {
                first: (*first).to_owned(),
                second: name.to_owned(),
                path: path.to_owned(),
            });
        }
    }
    Ok(())
}

#[cfg(unix)]
fn identity(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt as _;
    path.metadata().ok().map(|metadata| (metadata.dev(), metadata.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path) -> Option<PathBuf> {
    path.canonicalize().ok()
}

/// Where a file would appear that is not there yet.
fn future_place(path: &Path) -> PathBuf {
    let place = resolve(path).unwrap_or_else(|_| path.to_owned());
    match (folder(&place).canonicalize(), place.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        // Nothing can be written there; the plain names are as good as any.
        _ => std::path::absolute(&place).unwrap_or(place),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_file_is_known_by_every_name() {
        use std::os::unix::fs::symlink;
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        std::fs::create_dir(at("sub")).unwrap();
        std::fs::write(at("a"), "a").unwrap();
        std::fs::write(at("b"), "a").unwrap();
        std::fs::hard_link(at("a"), at("hard")).unwrap();
        symlink("a", at("soft")).unwrap();
        symlink(at("soft"), at("sub/soft")).unwrap();
        symlink("../future", at("sub/dangling")).unwrap();
        symlink(".", at("loop")).unwrap();
        for name in ["a", "sub/../a", "hard", "soft", "sub/soft", "loop/a", "./a"] {
            assert!(same_file(&at("a"), &at(name)), "{name}");
            assert!(!same_file(&at("b"), &at(name)), "{name}");
            assert!(!same_file(&at("future"), &at(name)), "{name}");
        }
        for name in ["future", "sub/../future", "loop/future", "sub/dangling"] {
            assert!(same_file(&at("future"), &at(name)), "{name}");
            assert!(!same_file(&at("sub/future"), &at(name)), "{name}");
        }
        assert!(same_file(&at("no/x"), &at("no/x")) && !same_file(&at("no/x"), &at("no/y")));
    }

    #[cfg(unix)]
    #[test]
    fn conflicts_name_the_output_and_the_file() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        let (scene, picture, link) = (at("scene.xml"), at("a.exr"), at("link.json"));
        std::fs::write(&scene, "x").unwrap();
        std::os::unix::fs::symlink(&scene, &link).unwrap();
        let inputs = [scene.as_path()];
        assert_eq!(check_distinct(&[("picture", &picture), ("report", &at("b"))], &inputs), Ok(()));
        let error = check_distinct(&[("picture", &picture), ("statistics", &link)], &inputs).unwrap_err();
        assert_eq!(error, Conflict::Input { output: "statistics".to_owned(), path: scene.clone() });
        assert!(error.to_string().contains("statistics would overwrite the input"), "{error}");
        let error = check_distinct(&[("picture", &picture), ("report", &at("./a.exr"))], &inputs).unwrap_err();
        assert!(error.to_string().starts_with("picture and report both write"), "{error}");
        let null = Path::new("/dev/null");
        assert_eq!(check_distinct(&[("picture", null), ("report", null)], &[null]), Ok(()));
    }
}
