//! The figures of a report, one by one, for machines.

use serde::Serialize;

use super::provenance::Provenance;
use crate::LabError;

/// One number with all that says what it is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// The table it is in: of the thesis, or of this program's.
    pub table: String,
    /// The scene.
    pub scene: String,
    /// `volpath`, or `raymarch` with its samples per segment.
    pub integrator: String,
    /// The method; empty where none is concerned.
    pub method: &'static str,
    /// Side of a voxel in world units.
    pub voxel_size: Option<f64>,
    /// Samples per pixel of the render, where renders differ in it.
    pub spp: Option<u32>,
    /// Seed of the render, where the figure is about one of several.
    pub seed: Option<u64>,
    /// What the quantity was measured against, where that varies: triangles, voxels, lights or threads.
    pub against: Option<f64>,
    /// What is measured.
    pub quantity: &'static str,
    /// Unit; empty for a ratio or a count.
    pub unit: &'static str,
    /// The value.
    pub value: f64,
    /// What the thesis has for it.
    pub thesis: Option<f64>,
}

/// What the figures of a group have in common.
#[derive(Clone, Debug)]
pub(super) struct About {
    pub(super) table: &'static str,
    pub(super) scene: String,
    pub(super) integrator: String,
    pub(super) method: &'static str,
    pub(super) voxel_size: Option<f64>,
}

impl About {
    pub(super) fn figure(&self, quantity: &'static str, unit: &'static str, value: f64, thesis: Option<f64>) -> Figure {
        Figure {
            table: self.table.to_owned(),
            scene: self.scene.clone(),
            integrator: self.integrator.clone(),
            method: self.method,
            voxel_size: self.voxel_size,
            spp: None,
            seed: None,
            against: None,
            quantity,
            unit,
            value,
            thesis,
        }
    }
}

impl Figure {
    /// Of renders with so many samples per pixel.
    pub(super) fn of_spp(self, spp: u32) -> Self {
        Self { spp: Some(spp), ..self }
    }

    /// Of a measurement with so many triangles, voxels, lights or threads.
    pub(super) fn against(self, x: f64) -> Self {
        Self { against: Some(x), ..self }
    }

    /// Of the render with this seed.
    pub(super) fn of_seed(self, seed: u64) -> Self {
        Self { seed: Some(seed), ..self }
    }
}

/// The figures as CSV after lines that begin with `#` and say where they come from.
pub(super) fn csv(figures: &[Figure], provenance: &Provenance) -> Result<String, LabError> {
    let fail = |message: String| LabError::Form { what: "the CSV", message };
    let mut text = Vec::new();
    for (name, value) in provenance.entries() {
        text.extend_from_slice(format!("# {name}: {}\n", value.replace(['\n', '\r'], " ")).as_bytes());
    }
    let mut writer = csv::Writer::from_writer(text);
    for figure in figures {
        writer.serialize(figure).map_err(|e| fail(e.to_string()))?;
    }
    let text = writer.into_inner().map_err(|e| fail(e.to_string()))?;
    String::from_utf8(text).map_err(|e| fail(e.to_string()))
}

/// The figures as JSON: `provenance` and `figures`. What is not finite is null.
pub(super) fn json(figures: &[Figure], provenance: &Provenance) -> Result<String, LabError> {
    #[derive(Serialize)]
    struct Report<'a> {
        provenance: &'a Provenance,
        figures: &'a [Figure],
    }
    let json = serde_json::to_string_pretty(&Report { provenance, figures });
    json.map(|json| json + "\n").map_err(|e| LabError::Form { what: "the JSON", message: e.to_string() })
}
