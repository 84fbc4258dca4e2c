//! `vdf scene`.

use std::{
    fs::File,
    io::{self, BufRead as _, BufReader, Write},
    path::Path,
};

use anyhow::{Context as _, anyhow};
use vdf_image::{shown, write_atomically};
use vdf_scene::EmbeddedFile;
use vdf_scenes::{GeneratedFile, Size, builtin, builtin_names, generated};

use crate::{
    args::SceneCommand,
    failure::{Failure, tell},
    progress::Reporter,
};

pub(crate) fn run(command: &SceneCommand) -> Result<(), Failure> {
    match command {
        SceneCommand::List => list(),
        SceneCommand::Write { name, folder, force, triangles, voxels } => match generated(name) {
            Some(scene) => {
                let scene = triangles.map_or(Ok(scene), |n| scene.with_triangles(n))?;
                let scene = voxels.map_or(Ok(scene), |n| scene.with_voxels(n))?;
                write(&scene.files().map(SceneFile::Generated).collect::<Vec<_>>(), folder, *force)
            }
            None => {
                let names = builtin_names().join(", ");
                let source = builtin(name).ok_or_else(|| {
                    Failure::Usage(anyhow!("no built-in scene is called '{name}'; there are {names}"))
                })?;
                if triangles.is_some() || voxels.is_some() {
                    let option = if triangles.is_some() { "triangles" } else { "voxels" };
                    let message = anyhow!("--{option} is for generated scenes; {name} always has the same {option}");
                    return Err(Failure::Usage(message));
                }
                write(&source.files().iter().map(SceneFile::Embedded).collect::<Vec<_>>(), folder, *force)
            }
        },
    }
}

/// A name a line, and after those of generated scenes what they are.
fn list() -> Result<(), Failure> {
    let stdout = &mut io::stdout();
    for name in builtin_names() {
        match generated(name) {
            Some(scene) => {
                let size = match scene.size() {
                    Size::Triangles(n) => format!("{n} triangles"),
                    Size::Voxels(n) => format!("{n} voxels"),
                };
                writeln!(stdout, "{name:<12}generated, {size} by default")?;
            }
            None => writeln!(stdout, "{name}")?,
        }
    }
    Ok(())
}

enum SceneFile<'a> {
    Embedded(&'a EmbeddedFile),
    Generated(GeneratedFile),
}

impl SceneFile<'_> {
    fn path(&self) -> &str {
        match self {
            Self::Embedded(file) => &file.path,
            Self::Generated(file) => file.path,
        }
    }

    fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        match self {
            Self::Embedded(file) => out.write_all(&file.bytes),
            Self::Generated(file) => file.write(out),
        }
    }
}

fn write(files: &[SceneFile<'_>], folder: &Path, force: bool) -> Result<(), Failure> {
    // It only listens for Ctrl-C: large files take a while, and an unfinished one must not stay behind.
    let reporter = Reporter::new(true)?;
    reporter.writes();
    for file in files.iter().filter(|_| !force) {
        let path = folder.join(file.path());
        if path.exists() && !is_in(file, &path) {
            return Err(Failure::Usage(anyhow!(
                "{} is there and differs: name another folder, or replace it with --force",
                shown(&path)
            )));
        }
    }
    for (written, file) in files.iter().enumerate() {
        let path = folder.join(file.path());
        let parent = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(parent)
            .with_context(|| format!("cannot make the folder {}", shown(parent)))
            .map_err(Failure::Work)?;
        let result = write_atomically(&path, |out| file.write(&mut Interruptible { out, reporter: &reporter }));
        if result.is_err() && reporter.interrupted() {
            return Err(Failure::InterruptedAfter { written });
        }
        result.with_context(|| format!("cannot write {}", shown(&path))).map_err(Failure::Work)?;
        tell(format_args!("{}", path.display()));
    }
    Ok(())
}

/// Whether the file at `path` has just these bytes.
fn is_in(file: &SceneFile<'_>, path: &Path) -> bool {
    let same = || -> io::Result<bool> {
        let mut expected = Expected { found: BufReader::new(File::open(path)?) };
        file.write(&mut expected)?;
        Ok(expected.found.fill_buf()?.is_empty())
    };
    same().unwrap_or(false)
}

/// A writer that fails at the first byte that is not the one that is found.
struct Expected {
    found: BufReader<File>,
}

impl Write for Expected {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let found = self.found.fill_buf()?;
        let n = bytes.len().min(found.len());
        if bytes[..n] != found[..n] || (n == 0 && !bytes.is_empty()) {
            return Err(io::Error::other("another file"));
        }
        self.found.consume(n);
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A writer that fails once Ctrl-C was pressed.
struct Interruptible<'a> {
    out: &'a mut dyn Write,
    reporter: &'a Reporter,
}

impl Write for Interruptible<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.reporter.interrupted() {
            // Not `ErrorKind::Interrupted`, which callers take as a request to try again.
            return Err(io::Error::other("interrupted"));
        }
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
