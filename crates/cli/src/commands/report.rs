//! `vdf report`: what was measured, as tables on stdout, as a page, as CSV and as JSON.
//!
//! A report makes [`Figure`]s, from which CSV and JSON follow, and a [`Page`] of tables and plots, from which the words on stdout and
//! the HTML follow.

mod bench;
mod convergence;
mod figures;
mod page;
mod plot;
mod provenance;
mod queries;
mod scaling;
#[cfg(test)]
mod tests;
mod thesis;

use std::io::Write as _;

use anyhow::Context as _;
use vdf_render::{Method, check_writable, write_atomically};

use self::{
    figures::{Figure, write_csv, write_json},
    page::Page,
    provenance::Provenance,
};
use crate::{
    args::{Methods, ReportCommand, ReportFiles},
    failure::Failure,
};

pub(crate) fn run(command: &ReportCommand) -> Result<(), Failure> {
    match command {
        ReportCommand::Queries(args) => queries::run(args),
        ReportCommand::Convergence(args) => convergence::run(args),
        ReportCommand::Scaling(args) => scaling::run(args),
        ReportCommand::Thesis(args) => thesis::run(args),
    }
}

impl ReportFiles {
    /// Fails now rather than after an hour of measuring.
    fn check(&self) -> Result<(), Failure> {
        for path in [&self.html, &self.csv, &self.json].into_iter().flatten() {
            check_writable(path).with_context(|| format!("cannot write {}", path.display())).map_err(Failure::Work)?;
        }
        Ok(())
    }

    /// Writes the files that were asked for, then the tables to stdout.
    fn write(&self, page: &Page, figures: &[Figure], provenance: &Provenance) -> Result<(), Failure> {
        let files = [
            (&self.html, page.html(provenance).map_err(Failure::Work)?),
            (&self.csv, write_csv(figures, provenance).map_err(Failure::Work)?),
            (&self.json, write_json(figures, provenance).map_err(Failure::Work)?),
        ];
        for (path, content) in files {
            if let Some(path) = path {
                write_atomically(path, |out| out.write_all(content.as_bytes()))
                    .with_context(|| format!("cannot write {}", path.display()))
                    .map_err(Failure::Work)?;
            }
        }
        let stdout = &mut std::io::stdout().lock();
        write!(stdout, "{}", page.text(provenance))?;
        for path in [&self.html, &self.csv, &self.json].into_iter().flatten() {
            writeln!(stdout, "wrote {}", path.display())?;
        }
        Ok(())
    }
}

/// The methods named, each once, without the hierarchy alone, which is always there.
fn methods(choices: &[Methods]) -> Vec<Method> {
    let mut methods: Vec<Method> = Vec::new();
    for choice in choices {
        let named = match choice {
            Methods::All => Method::ALL.to_vec(),
            Methods::One(method) => vec![*method],
        };
        for method in named {
            if method != Method::None && !methods.contains(&method) {
                methods.push(method);
            }
        }
    }
    methods
}

/// A share as a percentage of two places, which is what the thesis prints.
fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

/// Three significant digits without an exponent.
fn short(x: f64) -> String {
    let digits = if x == 0.0 || !x.is_finite() { 0 } else { (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0) as usize };
    format!("{x:.digits$}")
}

/// Seconds, or milliseconds where they are few.
fn seconds(t: f64) -> String {
    if t.abs() < 0.1 { format!("{} ms", short(1e3 * t)) } else { format!("{} s", short(t)) }
}

fn grid(resolution: [u32; 3]) -> String {
    resolution.map(|n| n.to_string()).join("×")
}
