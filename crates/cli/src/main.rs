//! The `vdf` binary: command-line definitions and glue. Everything else is in the libraries.
//!
//! Results go to stdout, talk goes to stderr. Exit codes: 0 done, 1 failure while rendering or writing, 2 usage or scene error,
//! 3 samples are missing, 130 interrupted.

mod args;
mod commands;
mod failure;
mod progress;
mod signals;

use std::process::ExitCode;

use anyhow::anyhow;
use clap::Parser as _;

use crate::{
    args::{Arguments, Command},
    failure::{Failure, said, say_end, speak_json},
};

fn main() -> ExitCode {
    survive_limits();
    let json = asks_for_json();
    if json {
        speak_json();
    }
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        // Help and version go to stdout, usage errors to stderr; clap knows which, but not whether they arrived.
        Err(message) => {
            let code = u8::try_from(message.exit_code()).unwrap_or(2);
            if json && message.use_stderr() {
                let text = message.to_string();
                let text = text.strip_prefix("error: ").unwrap_or(&text).trim_end();
                return Failure::Usage(anyhow!("{text}")).report();
            }
            return if message.print().is_ok() { code.into() } else { ExitCode::FAILURE };
        }
    };
    match run(&arguments).and_then(|()| said()) {
        Ok(()) => {
            say_end(0);
            ExitCode::SUCCESS
        }
        Err(failure) => failure.report(),
    }
}

/// Beyond the limit of a file's size a write shall fail, as on a full disk, so that what was begun is cleaned up. By default the signal that
/// comes with it ends the program on the spot.
fn survive_limits() {
    #[cfg(unix)]
    {
        // If that cannot be had, the program still works, and ends as it did.
        drop(signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default()));
    }
}

/// Whether a program reads stderr: known before the arguments are understood, for it shall understand that they were not.
fn asks_for_json() -> bool {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    arguments.iter().any(|a| a == "--progress=json")
        || arguments.windows(2).any(|pair| pair[0] == "--progress" && pair[1] == "json")
}

fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.command {
        Command::Render(a) => commands::render::run(a),
        Command::Merge(a) => commands::merge::run(a),
        Command::Scene(a) => commands::scene::run(&a.command),
        Command::Verify(a) => commands::verify::run(a),
        Command::Voxelize(a) => commands::voxelize::run(a),
        Command::Compare(a) => commands::compare::run(a),
        Command::Report(a) => commands::report::run(&a.command),
    }
}
