//! Tells the crate which compiler and which commit it is built from, so that a report can name both.

use std::{env, fs, path::Path, process::Command};

/// Where this crate lies in its own repository.
const PLACE: &str = "crates/lab/";

fn main() {
    let rustc = env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    export("VDF_RUSTC", output(Command::new(rustc).arg("--version")));
    export("VDF_PROFILE", env::var("PROFILE").ok());
    println!("cargo:rerun-if-changed=build.rs");
    // A package that was unpacked or vendored may lie in another project's repository, whose commit says nothing about
    // it.
    if git(&["rev-parse", "--show-prefix"]).as_deref() == Some(PLACE) {
        let changed = git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|s| !s.is_empty());
        let commit = git(&["rev-parse", "--short=12", "HEAD"]);
        export("VDF_COMMIT", commit.map(|c| if changed { format!("{c}, with changes") } else { c }));
        watch();
    } else {
        println!("cargo:rerun-if-changed=.cargo_vcs_info.json");
        export("VDF_COMMIT", fs::read_to_string(".cargo_vcs_info.json").ok().as_deref().and_then(packaged_commit));
    }
}

/// Asks again after each commit and each change of what is measured. The command line is only glue: to watch it would
/// compile this crate again for each change there.
fn watch() {
    let siblings = fs::read_dir("..").into_iter().flatten().flatten().map(|entry| entry.path());
    for folder in siblings.filter(|path| !path.ends_with("cli")) {
        println!("cargo:rerun-if-changed={}", folder.display());
    }
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]).filter(|log| Path::new(log).exists()) {
        println!("cargo:rerun-if-changed={log}");
    }
}

/// The commit that Cargo writes down in a package: `"sha1": "0123..."`.
fn packaged_commit(info: &str) -> Option<String> {
    let sha = info.split("\"sha1\"").nth(1)?.split('"').nth(1)?;
    sha.chars().all(|c| c.is_ascii_hexdigit()).then(|| sha.chars().take(12).collect())
}

/// Without a value the variable is not set, and the report says "unknown".
fn export(name: &str, value: Option<String>) {
    if let Some(value) = value {
        println!("cargo:rustc-env={name}={value}");
    }
}

fn git(args: &[&str]) -> Option<String> {
    output(Command::new("git").args(args))
}

fn output(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|o| o.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
