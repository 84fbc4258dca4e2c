//! `vdf scene`.

use std::{io::Write as _, path::Path};

use anyhow::{Context as _, anyhow};
use vdf_render::{
    scene::{builtin, builtin_names},
    write_atomically,
};

use crate::{args::SceneCommand, failure::Failure};

pub(crate) fn run(command: &SceneCommand) -> Result<(), Failure> {
    match command {
        SceneCommand::List => {
            for name in builtin_names() {
                writeln!(std::io::stdout(), "{name}")?;
            }
            Ok(())
        }
        SceneCommand::Write { name, folder } => write(name, folder),
    }
}

fn write(name: &str, folder: &Path) -> Result<(), Failure> {
    let names = builtin_names().join(", ");
    let source = builtin(name)
        .ok_or_else(|| Failure::Usage(anyhow!("no built-in scene is called '{name}'; there are {names}")))?;
    for file in source.files() {
        let path = folder.join(&*file.path);
        let parent = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(parent)
            .with_context(|| format!("cannot make the folder {}", parent.display()))
            .map_err(Failure::Work)?;
        write_atomically(&path, |w| w.write_all(file.text.as_bytes()))
            .with_context(|| format!("cannot write {}", path.display()))
            .map_err(Failure::Work)?;
        writeln!(std::io::stdout(), "{}", path.display())?;
    }
    Ok(())
}
