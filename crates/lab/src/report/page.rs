//! A report as something to read: on a terminal, or as one HTML file that needs nothing else.

use std::fmt::Write as _;

use minijinja::{Environment, context, syntax::SyntaxConfig, value::Serde};
use serde::Serialize;
use vdf_image::{Image, encode_png};

use super::{plot::Plot, provenance::Provenance};
use crate::LabError;

/// A report.
#[derive(Clone, Debug, Serialize)]
pub struct Page {
    /// The title.
    pub title: String,
    /// What it is about, a paragraph each.
    pub lead: Vec<String>,
    /// Its parts.
    pub sections: Vec<Section>,
}

/// A part of a report under one heading.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Section {
    /// The heading.
    pub heading: String,
    /// What it says.
    pub paragraphs: Vec<String>,
    /// Images, in the page only.
    pub images: Vec<Picture>,
    /// Pairs of images, in the page only.
    pub comparisons: Vec<Comparison>,
    /// Plots, in the page only.
    pub plots: Vec<Plot>,
    /// Tables.
    pub tables: Vec<Table>,
}

/// An image inside the page.
#[derive(Clone, Debug, Serialize)]
pub struct Picture {
    /// The image as a data URI.
    uri: String,
    caption: String,
    width: u32,
    height: u32,
}

/// Two images of one size, one over the other, with a slider that moves the border between them; side by side without a
/// script.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// What they show.
    pub caption: String,
    /// The lower one, with its own caption.
    pub left: Picture,
    /// The one over it, with its own caption.
    pub right: Picture,
}

/// A table; the first column names the rows.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Table {
    /// What it shows; may be empty under a heading that says so.
    pub caption: String,
    /// Headings of the columns.
    pub columns: Vec<&'static str>,
    /// The rows, each with as many cells as there are columns.
    pub rows: Vec<Row>,
}

/// A row of a table.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The cells.
    pub cells: Vec<Cell>,
    /// The first of a group, set apart from the row above.
    pub first: bool,
}

/// A cell of a table.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Cell {
    /// What it says.
    pub text: String,
    /// What the thesis has in this place.
    pub thesis: Option<String>,
    /// Whether that is good or bad, where it is either.
    pub mark: Option<Mark>,
}

/// What is to be seen at a glance; the text says it, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Mark {
    /// Green.
    Good,
    /// Red.
    Bad,
}

impl Picture {
    /// This image as a PNG.
    ///
    /// # Errors
    /// [`LabError::Form`] if the image has no pixels.
    pub fn new(image: &Image, caption: String) -> Result<Self, LabError> {
        use base64::{Engine as _, prelude::BASE64_STANDARD};
        let png = encode_png(image).map_err(|message| LabError::Form { what: "a picture for the page", message })?;
        let uri = format!("data:image/png;base64,{}", BASE64_STANDARD.encode(png));
        Ok(Self { uri, caption, width: image.width, height: image.height })
    }
}

impl Row {
    /// A row of the group of the row above.
    #[must_use]
    pub fn new(cells: Vec<Cell>) -> Self {
        Self { cells, first: false }
    }
}

impl Cell {
    /// Beside the figure of the thesis.
    #[must_use]
    pub fn beside(text: String, thesis: Option<String>) -> Self {
        Self { text, thesis, mark: None }
    }

    /// Marked as good or bad.
    #[must_use]
    pub fn marked(self, good: bool) -> Self {
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
    pub(super) fn html(&self, provenance: &Provenance) -> Result<String, LabError> {
        let mut environment = Environment::new();
        let syntax = SyntaxConfig::builder().trim_blocks(true).lstrip_blocks(true).build();
        let fail = |e: minijinja::Error| LabError::Form { what: "the page", message: e.to_string() };
        environment.set_syntax(syntax.map_err(fail)?);
        environment
            .add_template("report.html", include_str!("../../templates/report.html"))
            .and_then(|()| environment.get_template("report.html"))
            .and_then(|template| {
                template.render(context! { page => Serde(self), provenance => Serde(provenance.entries()) })
            })
            .map_err(fail)
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
