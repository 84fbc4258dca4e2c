//! Which proofs a question may use.

use glam::{DVec3, Vec3, dvec3};
use vdf_geometry::{Bounds, Triangle};

use super::*;
use crate::{LightShape, Method, ProverOptions};

/// Provers of a scene without the occluder that the hierarchy knows: whoever believes them can be told by a wrong answer.
fn liars(method: Method, light: LightShape<'_>, others: &[Triangle]) -> Provers {
    let bounds = Bounds::new(DVec3::splat(-2.0), DVec3::splat(2.0));
    let options = ProverOptions { method, voxel_size: 0.25, ..ProverOptions::default() };
    Provers::build(&options, others, bounds, &[light]).expect("a sound grid").0
}

/// Of queries by their kind, of free flights only from a point in space, and if asked for.
#[test]
fn each_question_uses_its_own_proofs() {
    let wall = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);
    let lamp = Triangle::new(Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 1.0, 1.0));
    let bvh = Bvh::new(&[wall]);
    let (from, to) = (dvec3(0.25, 0.25, -1.0), dvec3(0.25, 0.25, 0.999));
    let method = "amr-xsn".parse().expect("a method");
    let point = liars(method, LightShape::Point(to), &[]);
    let buffer = liars(Method::default(), LightShape::Point(to), &[]);
    let area = liars(method, LightShape::Area(&[lamp]), &[lamp]);
    for (provers, spatial_proof, on_light_proof, any_proof) in [
        (&Provers::none(), false, false, false),
        (&point, true, false, false),
        (&area, false, true, false),
        (&buffer, true, true, true),
    ] {
        let visibility = Visibility::new(&bvh, provers);
        for (kind, believed) in [
            (QueryKind::Spatial, spatial_proof),
            (QueryKind::OnLight, on_light_proof),
            (QueryKind::Superficial, any_proof),
        ] {
            let mut counters = Counters::default();
            let query = ShadowQuery { from, to, emitter: 0, kind };
            assert_eq!(visibility.unoccluded(&query, &mut counters), believed, "{kind:?}");
            let proved = counters.proved + counters.on_light_proved + counters.superficial_proved;
            assert_eq!((proved, counters.proved_occluded), (u64::from(believed), 0), "{kind:?}");
            assert_eq!(counters.spatial, u64::from(kind == QueryKind::Spatial), "{kind:?}");
        }
        for (segment_first, spatial) in [(false, false), (true, false), (false, true), (true, true)] {
            let mut counters = Counters::default();
            let visibility = Visibility::new(&bvh, provers).segment_first(segment_first);
            let hit = visibility.intersect_flight(&Segment::new(from, to), spatial, &mut counters);
            let flight_proof = spatial_proof && !any_proof;
            assert_eq!(hit.is_none(), flight_proof && segment_first && spatial, "{segment_first} {spatial}");
            assert_eq!(counters.flights, u64::from(segment_first && spatial));
        }
    }
}
