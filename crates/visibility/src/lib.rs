//! Who answers a visibility query: proofs where there are any, an exact hierarchy for the rest.
//!
//! A [`Method`] is a recipe: which distance field is built, and which [`LightProver`] each light gets. [`Provers`] holds what was
//! built; [`Visibility`] asks it, then the hierarchy, and counts. A proof is a statement about the exact geometry and the hierarchy is
//! exact, so the answer is the same with every method.
//!
//! ```
//! use glam::{DVec3, Vec3};
//! use vdf_geometry::{Bounds, Bvh, Triangle};
//! use vdf_visibility::{Counters, LightShape, Method, ProverOptions, Provers, QueryKind, Quiet, ShadowQuery, Visibility};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A wall, and a light on its right.
//! let wall = [Triangle::new(Vec3::new(0.5, 0.0, 0.0), Vec3::new(0.5, 1.0, 0.0), Vec3::new(0.5, 0.0, 1.0))];
//! let light = DVec3::new(0.9, 0.5, 0.5);
//! let options = ProverOptions { method: "amr-xsn".parse()?, voxel_size: 0.1, ..ProverOptions::default() };
//! let (provers, report) =
//!     Provers::build(&options, &wall, Bounds::new(DVec3::ZERO, DVec3::ONE), &[LightShape::Point(light)], &Quiet)?;
//! assert!(report.lights[0].voxels.is_some_and(|n| n > 0));
//!
//! let bvh = Bvh::new(&wall);
//! let visibility = Visibility::new(&bvh, &provers);
//! let mut counters = Counters::default();
//! let from = DVec3::new(0.7, 0.9, 0.1);
//! let query = ShadowQuery { from, to: light, emitter: 0, kind: QueryKind::Spatial };
//! assert!(visibility.unoccluded(&query, &mut counters));
//! assert_eq!(counters.proved, 1);
//! # Ok(())
//! # }
//! ```

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod build;
mod counters;
mod error;
mod light;
mod lit;
mod method;
mod progress;
mod prover;
mod query;

pub use build::{BuildReport, BuiltPart, LightReport, ProverOptions};
pub use counters::Counters;
pub use error::VisibilityError;
pub use light::LightShape;
pub use lit::{LitIntervals, MOST_TRIANGLES};
pub use method::{FieldKind, Method, PointProver, UnknownMethod, method_table};
pub use progress::{Progress, Quiet};
pub use prover::{
    Answer, AreaNeighbourhood, DistanceField, FieldProver, LightBuffer, LightProver, LookUp, Provers, Refusal,
};
pub use query::{NoRecorder, QueryKind, Recorder, ShadowQuery, Visibility};
