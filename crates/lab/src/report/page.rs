//! A report as something to read: on a terminal, or as one HTML file that needs nothing else.

use std::fmt::Write as _;

use anyhow::Context as _;
use minijinja::{Environment, context, syntax::SyntaxConfig, value::Serde};
use serde::Serialize;

use super::{plot::Plot, provenance::Provenance};

/// A report.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Page {
    pub(super) title: String,
    /// What it is about, a paragraph each.
    pub(super) lead: Vec<String>,
    pub(super) sections: Vec<Section>,
}

/// A part of a report under one heading.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Section {
    pub(super) heading: String,
    pub(super) paragraphs: Vec<String>,
    pub(super) images: Vec<Picture>,
    pub(super) comparisons: Vec<Comparison>,
    pub(super) plots: Vec<Plot>,
    pub(super) tables: Vec<Table>,
}

/// An image inside the page.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Picture {
    /// The image as a data URI.
    uri: String,
    caption: String,
    width: u32,
    height: u32,
}

/// Two images of one size, one over the other, with a slider that moves the border between them; side by side without a script.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Comparison {
    pub(super) caption: String,
    /// Each with its own caption.
    pub(super) left: Picture,
    pub(super) right: Picture,
}

/// A table; the first column names the rows.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Table {
    pub(super) caption: String,
    pub(super) columns: Vec<&'static str>,
    pub(super) rows: Vec<Row>,
}

/// A row of a table.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    pub(super) cells: Vec<Cell>,
    /// The first of a group, set apart from the row above.
    pub(super) first: bool,
}

/// A cell of a table.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub(super) struct Cell {
    pub(super) text: String,
    /// What the thesis has in this place.
    pub(super) thesis: Option<String>,
    pub(super) mark: Option<Mark>,
}

/// What is to be seen at a glance; the text says it, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Mark {
    Good,
    Bad,
}

impl Picture {
    /// A PNG of this size in pixels.
    pub(super) fn png(bytes: &[u8], [width, height]: [u32; 2], caption: String) -> Self {
        use base64::{Engine as _, prelude::BASE64_STANDARD};
        Self { uri: format!("data:image/png;base64,{}", BASE64_STANDARD.encode(bytes)), caption, width, height }
    }
}

impl Row {
    pub(super) fn new(cells: Vec<Cell>) -> Self {
        Self { cells, first: false }
    }
}

impl Cell {
    /// Beside the figure of the thesis.
    pub(super) fn beside(text: String, thesis: Option<String>) -> Self {
        Self { text, thesis, mark: None }
    }

    pub(super) fn marked(self, good: bool) -> Self {
        Self { mark: Some(if good { Mark::Good } else { Mark::Bad }), ..self }
    }

    fn plain(&self) -> String {
        match &self.thesis {
            Some(thesis) => format!("{} ({thesis})", self.text),
            None => self.text.clone(),
        }
    }
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self { text: text.into(), ..Self::default() }
    }
}

impl Page {
    /// The page in one file: nothing loaded from elsewhere, no script but that of the sliders.
    pub(super) fn html(&self, provenance: &Provenance) -> anyhow::Result<String> {
        let mut environment = Environment::new();
        let syntax = SyntaxConfig::builder().trim_blocks(true).lstrip_blocks(true).build();
        environment.set_syntax(syntax.context("cannot make the page")?);
        environment
            .add_template("report.html", include_str!("../../../templates/report.html"))
            .and_then(|()| environment.get_template("report.html"))
            .and_then(|template| {
                template.render(context! { page => Serde(self), provenance => Serde(provenance.entries()) })
            })
            .context("cannot make the page")
    }

    /// The tables for a terminal.
    pub(super) fn text(&self, provenance: &Provenance) -> String {
        let mut text = format!("{}\n", self.title);
        for (name, value) in provenance.entries() {
            let _ = writeln!(text, "{name:10} {value}");
        }
        for paragraph in &self.lead {
            let _ = writeln!(text, "\n{paragraph}");
        }
        for section in &self.sections {
            let _ = writeln!(text, "\n## {}", section.heading);
            for paragraph in &section.paragraphs {
                let _ = writeln!(text, "{paragraph}");
            }
            for table in &section.tables {
                let _ = write!(text, "\n{}", table.text());
            }
        }
        text
    }
}

impl Table {
    fn text(&self) -> String {
        let mut lines: Vec<Vec<String>> = vec![self.columns.iter().map(|c| (*c).to_owned()).collect()];
        lines.extend(self.rows.iter().map(|row| row.cells.iter().map(Cell::plain).collect()));
        let width =
            |column: usize| lines.iter().filter_map(|l| l.get(column)).map(|c| c.chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let mut text = if self.caption.is_empty() { String::new() } else { format!("{}\n", self.caption) };
        for line in &lines {
            let padded =
                line.iter().zip(&widths).enumerate().map(|(i, (cell, &width))| {
                    if i == 0 { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
                });
            text.push_str(padded.collect::<Vec<_>>().join("  ").trim_end());
            text.push('\n');
        }
        text
    }
}
