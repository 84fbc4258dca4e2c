//! Reports: what was measured, as words, as a page, as CSV and as JSON.
//!
//! A report makes [`Figure`]s, from which CSV and JSON follow, and a [`Page`] of tables and plots, from which the words
//! and the HTML follow. Each report is one module with its options and a function `run`; [`REPORTS`] is the list of
//! all.
//!
//! *Guarantee.* Whatever is timed is checked in the same run: answers against the hierarchy's, images bit by bit.

mod bench;
pub mod convergence;
mod figures;
mod page;
mod plot;
mod provenance;
pub mod queries;
pub mod scaling;
#[cfg(test)]
mod tests;
pub mod thesis;
mod words;

pub use bench::MAX_THREADS;
pub use figures::Figure;
pub use page::{Cell, Comparison, Mark, Page, Picture, Row, Section, Table};
pub use plot::{Banded, Plot, Series};
pub use provenance::Provenance;

use vdf_visibility::Method;

use crate::LabError;

/// A report by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReportKind {
    /// The name on the command line.
    pub name: &'static str,
    /// What it does, in one sentence.
    pub about: &'static str,
}

const fn kind(name: &'static str, about: &'static str) -> ReportKind {
    ReportKind { name, about }
}

/// All reports. A new one is a module beside this one, a row here, and its options and their names in the command line.
pub const REPORTS: [ReportKind; 4] = [
    kind(
        "queries",
        "Replay the visibility queries of a render, per method: what a query and a proof cost, and what that gains",
    ),
    kind(
        "convergence",
        "Measure speed against error: how far from a converged reference a render is after so much time, per method",
    ),
    kind("scaling", "Measure how costs grow with triangles, voxels, lights and threads, and fit exponents"),
    kind(
        "thesis",
        "Repeat the measurements of the thesis that the method comes from (chapter 6), each figure beside its own",
    ),
];

/// What was measured.
#[derive(Clone, Debug)]
pub struct Report {
    /// Tables and plots.
    pub page: Page,
    /// Every figure, one by one.
    pub figures: Vec<Figure>,
    /// Where the figures come from.
    pub provenance: Provenance,
    /// What went otherwise than expected, a sentence each; nothing that is measured is wrong for it.
    pub warnings: Vec<String>,
}

impl Report {
    fn new(page: Page, figures: Vec<Figure>, seed: u64) -> Self {
        Self { page, figures, provenance: Provenance::here(seed), warnings: vec![] }
    }

    /// The tables for a terminal.
    #[must_use]
    pub fn text(&self) -> String {
        self.page.text(&self.provenance)
    }

    /// The page in one file: nothing is loaded from elsewhere, and the only script is that of the sliders.
    ///
    /// # Errors
    /// [`LabError::Form`], which is a bug.
    pub fn html(&self) -> Result<String, LabError> {
        self.page.html(&self.provenance)
    }

    /// The figures as CSV, after lines that begin with `#` and say where they come from.
    ///
    /// # Errors
    /// [`LabError::Form`], which is a bug.
    pub fn csv(&self) -> Result<String, LabError> {
        figures::csv(&self.figures, &self.provenance)
    }

    /// The figures as JSON: `provenance` and `figures`. What is not finite is null.
    ///
    /// # Errors
    /// [`LabError::Form`], which is a bug.
    pub fn json(&self) -> Result<String, LabError> {
        figures::json(&self.figures, &self.provenance)
    }
}

/// These methods, each once, without [`Method::NONE`].
fn proving(methods: &[Method]) -> Vec<Method> {
    let mut proving = Vec::new();
    for &method in methods {
        if method != Method::NONE && !proving.contains(&method) {
            proving.push(method);
        }
    }
    proving
}
