//! What the thesis has: see `data/thesis/README.md` in the folder of this crate.

use serde::{Deserialize, Deserializer, de::DeserializeOwned};
use vdf_render::Integrator;

use crate::LabError;

/// Its tables.
#[derive(Debug)]
pub(super) struct ThesisData {
    pub(super) acceleration: Vec<Acceleration>,
    pub(super) queries: Vec<Queries>,
    pub(super) proof_times: Vec<ProofTime>,
    pub(super) repeated: Vec<Repeated>,
    pub(super) measured: Vec<Measured>,
    pub(super) overheads: Vec<Overhead>,
}

/// A row of Tables 6.5 to 6.10. Times in seconds, shares in per cent.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Acceleration {
    pub(super) scene: String,
    pub(super) method: String,
    pub(super) voxel_size: f64,
    #[serde(rename = "samples_per_segment", deserialize_with = "integrator")]
    pub(super) integrator: Integrator,
    pub(super) t_render: f64,
    pub(super) t_query: f64,
    pub(super) t_build: Option<f64>,
    pub(super) p_sp: f64,
    pub(super) grid: Option<String>,
    pub(super) p_acc_sp: Option<f64>,
}

/// A row of Table 6.11.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Queries {
    pub(super) scene: String,
    #[serde(rename = "samples_per_segment", deserialize_with = "integrator")]
    pub(super) integrator: Integrator,
    pub(super) n: f64,
    pub(super) p_sp: f64,
}

/// A row of Table 6.4: `t_acc` in nanoseconds; for the method `none` it is `t_query`. The ratio is in per cent.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct ProofTime {
    pub(super) scene: String,
    pub(super) method: String,
    pub(super) voxel_size: f64,
    pub(super) t_acc: f64,
    pub(super) ratio: f64,
}

/// A run of Table 6.1.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct Repeated {
    pub(super) scene: String,
    pub(super) voxel_size: f64,
    #[serde(rename = "samples_per_segment", deserialize_with = "integrator")]
    pub(super) integrator: Integrator,
    pub(super) samples_per_pixel: u32,
    pub(super) t_build: f64,
    pub(super) t_render: f64,
    pub(super) t_query: f64,
}

/// A setting of Table 6.2, with and without a timer in the loop.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Measured {
    pub(super) scene: String,
    pub(super) voxel_size: f64,
    #[serde(rename = "samples_per_segment", deserialize_with = "integrator")]
    pub(super) integrator: Integrator,
    pub(super) samples_per_pixel: u32,
    pub(super) t_build_with: f64,
    pub(super) t_render_with: f64,
    pub(super) t_query: f64,
    pub(super) t_build_without: f64,
    pub(super) t_render_without: f64,
}

/// A row of Table 6.3, in seconds: the ray marcher with 49 samples, without acceleration, with a timer in the loop and without.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Overhead {
    pub(super) scene: String,
    pub(super) t_render_with: f64,
    pub(super) t_query: f64,
    pub(super) t_render_without: f64,
}

impl ThesisData {
    pub(super) fn load() -> Result<Self, LabError> {
        Ok(Self {
            acceleration: rows(include_str!("../../../data/thesis/acceleration.csv"))?,
            queries: rows(include_str!("../../../data/thesis/queries.csv"))?,
            proof_times: rows(include_str!("../../../data/thesis/proof_times.csv"))?,
            repeated: rows(include_str!("../../../data/thesis/repeated.csv"))?,
            measured: rows(include_str!("../../../data/thesis/measured.csv"))?,
            overheads: rows(include_str!("../../../data/thesis/overhead.csv"))?,
        })
    }

    /// The row of Tables 6.5 to 6.10, for the method `none` with any voxel size.
    pub(super) fn acceleration(
        &self,
        scene: &str,
        method: &str,
        size: f64,
        integrator: Integrator,
    ) -> Option<&Acceleration> {
        self.acceleration.iter().find(|r| {
            r.scene == scene
                && r.method == method
                && r.integrator == integrator
                && (method == "none" || r.voxel_size == size)
        })
    }

    pub(super) fn queries(&self, scene: &str, integrator: Integrator) -> Option<&Queries> {
        self.queries.iter().find(|r| r.scene == scene && r.integrator == integrator)
    }

    pub(super) fn proof_time(&self, scene: &str, method: &str, size: f64) -> Option<&ProofTime> {
        self.proof_times
            .iter()
            .find(|r| r.scene == scene && r.method == method && (method == "none" || r.voxel_size == size))
    }

    pub(super) fn overhead(&self, scene: &str) -> Option<&Overhead> {
        self.overheads.iter().find(|r| r.scene == scene)
    }

    /// The first run of each setting of Table 6.1.
    pub(super) fn repeated_settings(&self) -> Vec<&Repeated> {
        let mut first: Vec<&Repeated> = Vec::new();
        for run in &self.repeated {
            if !first.iter().any(|f| f.scene == run.scene) {
                first.push(run);
            }
        }
        first
    }
}

/// Samples per segment; a row without is about the path tracer.
fn integrator<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Integrator, D::Error> {
    Ok(Option::<u32>::deserialize(deserializer)?.map_or(Integrator::Volpath, Integrator::raymarch))
}

fn rows<T: DeserializeOwned>(text: &str) -> Result<Vec<T>, LabError> {
    let rows = csv::Reader::from_reader(text.as_bytes()).deserialize().collect::<Result<_, _>>();
    rows.map_err(|e| LabError::Form { what: "tables of the thesis's figures", message: e.to_string() })
}

#[cfg(test)]
mod tests {
    use super::{super::INTEGRATORS, super::SCENES, *};

    /// The inner relations of the thesis's own tables, and some figures as printed.
    #[test]
    fn the_data_is_complete_and_consistent() {
        let thesis = ThesisData::load().unwrap();
        for scene in SCENES {
            for integrator in INTEGRATORS {
                let queries = thesis.queries(scene.name, integrator).unwrap();
                let none = thesis.acceleration(scene.name, "none", 0.0, integrator).unwrap();
                assert_eq!(none.p_sp, queries.p_sp);
                assert!(none.t_query < none.t_render && none.t_build.is_none());
                for method in ["ndf", "amr", "amr-sn"] {
                    // The landscape has no point light.
                    let rows: Vec<_> = scene
                        .sizes
                        .iter()
                        .filter_map(|&size| thesis.acceleration(scene.name, method, size, integrator))
                        .collect();
                    assert_eq!(rows.len(), if (scene.name, method) == ("scape", "amr-sn") { 0 } else { 3 });
                    for (row, size) in rows.iter().zip(scene.sizes) {
                        assert_eq!(row.p_sp, queries.p_sp);
                        // The erratum of Table 6.8: minutes would be longer than the render.
                        assert!(row.t_query + row.t_build.unwrap() < row.t_render, "{row:?}");
                        let voxels: Vec<f64> =
                            row.grid.as_ref().unwrap().split('x').map(|n| n.parse().unwrap()).collect();
                        let first: Vec<f64> =
                            rows[0].grid.as_ref().unwrap().split('x').map(|n| n.parse().unwrap()).collect();
                        for (v, f) in voxels.iter().zip(&first) {
                            assert!((v - f * scene.sizes[0] / size).abs() <= 1.0, "{row:?}");
                        }
                    }
                    // Smaller voxels prove more.
                    assert!(rows.windows(2).all(|w| w[0].p_acc_sp > w[1].p_acc_sp));
                }
            }
        }
        for row in thesis.proof_times.iter().filter(|r| r.method != "none") {
            let t_query = thesis.proof_time(&row.scene, "none", 0.0).unwrap().t_acc;
            assert!((100.0 * row.t_acc / t_query - row.ratio).abs() < 1.0, "{row:?}");
        }
        assert_eq!(thesis.proof_time("cbox_vol6", "amr-sn", 8.0).unwrap().t_acc, 14.0);
        assert_eq!(thesis.queries("scape", Integrator::raymarch(49)).unwrap().n, 58_220_000.0);
        assert_eq!(thesis.acceleration("san-miguel", "amr", 0.5, Integrator::Volpath).unwrap().p_acc_sp, Some(9.46));
        // 6.3.1: T_query less half of the overhead, over N, is t_query of Table 6.4 but for rounding.
        for scene in SCENES.map(|s| s.name) {
            let (t, many) = (thesis.overhead(scene).unwrap(), Integrator::raymarch(49));
            let none = thesis.acceleration(scene, "none", 0.0, many).unwrap();
            assert_eq!((t.t_render_with, t.t_query), (none.t_render, none.t_query));
            let real = t.t_query - 0.5 * (t.t_render_with - t.t_render_without);
            let each = 1e9 * real / thesis.queries(scene, many).unwrap().n;
            assert!(
                (each / thesis.proof_time(scene, "none", 0.0).unwrap().t_acc - 1.0).abs() < 0.01,
                "{scene}: {each}"
            );
        }
        assert_eq!((thesis.repeated.len(), thesis.repeated_settings().len(), thesis.measured.len()), (24, 3, 3));
    }
}
