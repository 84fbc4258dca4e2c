//! The `vdf` binary: command-line definitions and glue. Everything else is in the libraries.
//!
//! Results go to stdout, talk goes to stderr. Exit codes: 0 done, 1 failure while rendering or writing, 2 usage or scene error,
//! 130 interrupted.

mod args;
mod commands;
mod failure;
mod progress;

use std::process::ExitCode;

use clap::Parser as _;

use crate::{
    args::{Arguments, Command},
    failure::Failure,
};

fn main() -> ExitCode {
    // Clap prints its own usage errors and exits with 2.
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.command {
        Command::Render(a) => commands::render::run(a),
        Command::Scene(a) => commands::scene::run(&a.command),
        Command::Verify(a) => commands::verify::run(a),
        Command::Voxelize(a) => commands::voxelize::run(a),
        Command::Compare(a) => commands::compare::run(a),
        Command::Report(a) => commands::report::run(&a.command),
    }
}
