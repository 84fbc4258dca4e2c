//! Transmittance through boxes of fog, exp(−Σσ_t d) [Houska2013, Sec. 2.1]: along rays, and along arbitrary segments, tangents above all.

use glam::{DMat4, DVec3, Vec3, dvec3, vec3};
use vdf::{
    geometry::Segment,
    render::{FreeFlight, Media, Sampler},
    scene::{Boundary, Emitter, MediumId, Phase, Rgb, Scene},
};

use crate::{
    check::{Check, RAYMARCH, VOLPATH},
    common::{add_medium, cuboid, empty_scene},
    fog::{Fog, add_fogs, optical_depth, optical_depth_to},
};

/// A bright background behind fogs, seen from `eye` along `direction` through next to no angle.
fn view(fogs: &[Fog], eye: DVec3, direction: DVec3) -> Scene {
    let mut scene = empty_scene(32, 1, 1e-12);
    scene.sensor.world_from_camera = DMat4::from_translation(eye)
        * DMat4::from_quat(glam::DQuat::from_rotation_arc(DVec3::Z, direction.normalize()));
    scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
    add_fogs(&mut scene, fogs);
    scene
}

#[test]
fn of_rays_is_beer_lambert() {
    let slab = |z0: f32, z1: f32, sigma| Fog::absorbing(vec3(-90.0, -90.0, z0), vec3(90.0, 90.0, z1), sigma);
    let cube = Fog::absorbing(vec3(-1.0, -1.0, 1.0), vec3(1.0, 1.0, 3.0), 0.8);
    // Media in sequence: touching, apart, touching again; the last one thin.
    let sequence = [slab(1.0, 1.5, 0.3), slab(1.5, 2.75, 1.1), slab(3.0, 3.25, 2.0), slab(3.25, 9.0, 1e-4)];
    let cases: &[(&'static str, &[Fog], DVec3, DVec3)] = &[
        ("transmittance, slab", &[slab(1.0, 2.0, 0.0)], DVec3::ZERO, DVec3::Z),
        ("transmittance, slab", &[slab(1.0, 2.0, 1e-9)], DVec3::ZERO, DVec3::Z),
        ("transmittance, slab", &[slab(1.0, 3.0, 0.3)], DVec3::ZERO, DVec3::Z),
        ("transmittance, slab", &[slab(1.0, 6.0, 1.0)], DVec3::ZERO, dvec3(0.3, -0.2, 1.0)),
        ("transmittance, slab", &[slab(-1.0, 6.0, 0.2)], DVec3::ZERO, dvec3(1.0, 2.0, 0.5)),
        // Nothing comes through that single precision could express.
        ("transmittance, slab", &[slab(1.0, 41.0, 30.0)], DVec3::ZERO, DVec3::Z),
        ("transmittance, box", &[cube], dvec3(0.3, -0.4, 0.0), DVec3::Z),
        ("transmittance, box", &[cube], dvec3(-3.0, 2.0, -1.0), dvec3(3.1, -2.3, 2.7)),
        ("transmittance, box", &[cube], dvec3(0.9, 0.1, 2.9), dvec3(-1.0, 0.4, -0.3)),
        ("transmittance, sequence", &sequence, DVec3::ZERO, DVec3::Z),
        ("transmittance, sequence", &sequence, dvec3(0.1, 0.2, 2.0), dvec3(-1.0, 0.3, 1.5)),
        ("transmittance, sequence", &sequence, dvec3(0.1, 0.2, 20.0), dvec3(0.5, 0.3, -4.0)),
        // Along a face, just inside and just outside; across an edge, 10⁻⁶ of the way inside; and past it.
        ("transmittance, tangent", &[cube], dvec3(1.0 - 1e-9, 0.2, 0.0), DVec3::Z),
        ("transmittance, tangent", &[cube], dvec3(1.0 + 1e-9, 0.2, 0.0), DVec3::Z),
        ("transmittance, tangent", &[cube], dvec3(1.0 - 1e-9, 1.0 - 1e-9, 0.0), DVec3::Z),
        ("transmittance, tangent", &[cube], dvec3(-2.0, 1e-6, 2.0), dvec3(1.0, 1.0, 0.0)),
        ("transmittance, tangent", &[cube], dvec3(-2.0, -1e-6, 2.0), dvec3(1.0, 1.0, 0.0)),
        ("transmittance, tangent", &[cube], dvec3(-2.0, 1.0 - 1e-6, 2.0 + 1e-7), dvec3(1.0, 1.0, 0.0)),
    ];
    let mut checks: Vec<(Check, Check)> = vec![];
    for &(form, fogs, eye, direction) in cases {
        if checks.last().is_none_or(|(c, _)| c.form() != form) {
            checks.push((Check::new(form, RAYMARCH), Check::new(form, VOLPATH)));
        }
        let (marched, traced) = checks.last_mut().expect("just pushed");
        let scene = view(fogs, eye, direction);
        let expected = (-optical_depth(fogs, eye, eye + direction.normalize() * 1e3)).exp();
        let case = format!("from {eye} along {direction}");
        marched.exact(&case, &marched.render(&scene, 1), if expected < 1e-60 { 0.0 } else { expected });
        traced.share(&case, &traced.render(&scene, 256), 256, expected);
    }
}

/// Leaving fog into another that surrounds it.
#[test]
fn of_nested_media_changes_at_their_boundaries() {
    let mut scene = empty_scene(16, 1, 1e-9);
    let outer = add_medium(&mut scene, 0.2, 0.0, Phase::Isotropic);
    let inner = add_medium(&mut scene, 1.0, 0.0, Phase::Isotropic);
    scene.sensor.medium = Some(outer);
    let triangles = cuboid(Vec3::splat(-5.0), Vec3::splat(5.0));
    scene.boundaries.push(Boundary { triangles, interior: Some(outer), exterior: None, ..Boundary::default() });
    let triangles = cuboid(vec3(-1.0, -1.0, 1.0), vec3(1.0, 1.0, 2.0));
    scene.boundaries.push(Boundary { triangles, interior: Some(inner), exterior: Some(outer), ..Boundary::default() });
    scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
    let expected = (-(0.2 * 4.0 + 1.0_f64)).exp();
    let mut marched = Check::new("transmittance, nested", RAYMARCH);
    marched.exact("", &marched.render(&scene, 1), expected);
    let mut traced = Check::new("transmittance, nested", VOLPATH);
    traced.share("", &traced.render(&scene, 256), 256, expected);
}

/// Random segments past, through and along random boxes, most of them on a coarse grid, where they run in faces, touch edges and
/// meet corners; some a few ulps beside. A box is closed: what runs in its face is inside.
#[test]
fn of_segments_is_that_of_clipping_to_slabs() {
    let (mut met, mut touched, mut flights) = (0, 0, 0);
    for i in 0..60_000 {
        let mut random = Random(Sampler::new(5, i, 0, 0));
        let fogs = random.fogs();
        let media: Vec<_> = fogs.iter().map(|f| vdf::scene::Medium::new(f.sigma_t, Rgb::ZERO, f.phase)).collect();
        let boundaries: Vec<_> = (0..)
            .zip(&fogs)
            .map(|(k, f)| Boundary {
                triangles: cuboid(f.min, f.max),
                interior: Some(MediumId(k)),
                exterior: None,
                ..Boundary::default()
            })
            .collect();
        let media = Media::new(&media, &boundaries, None);
        for _ in 0..8 {
            let (a, b) = (random.point(), random.point());
            // The medium of a start on a boundary, or of a way along a common face, is a matter of taste.
            let on_boundary = |p: DVec3| fogs.iter().any(|f| f.clip(p, p).is_some() && !f.holds(p));
            let in_faces = (0..3).any(|k| {
                a[k] == b[k]
                    && fogs.iter().filter(|f| f64::from(f.min[k]) == a[k] || f64::from(f.max[k]) == a[k]).count() > 1
            });
            if a == b || on_boundary(a) || in_faces {
                continue;
            }
            let start = (0..).zip(&fogs).find(|(_, f)| f.holds(a)).map(|(k, _)| MediumId(k));
            let segment = Segment::new(a, b);
            let expected = optical_depth(&fogs, a, b);
            // Crossings within 2⁻⁴⁰ of the largest coordinate are one place; a box has at most two, sigma is at most 2.
            let tolerance = 4.0 * fogs.len() as f64 * 4.0 / (1_u64 << 40) as f64;
            let tau = media.optical_depth(&segment, &media.regions_at(segment.p));
            assert!((tau - expected).abs() <= tolerance, "{i}: {tau} for {expected}, {segment:?} through {fogs:?}");
            met += u32::from(expected > 0.0);
            touched += u32::from(expected == 0.0 && fogs.iter().any(|f| f.clip(a, b).is_some()));

            let depth = random.0.next_1d() * 1.5 * expected;
            match media.free_flight(&segment, &media.regions_at(segment.p), depth) {
                FreeFlight::Collision { t, medium, .. } => {
                    flights += 1;
                    let reached = optical_depth_to(&fogs, a, b, t);
                    assert!(
                        (reached - depth).abs() <= tolerance,
                        "{i}: {reached} for {depth}, {segment:?} through {fogs:?}"
                    );
                    let fog = &fogs[medium.0 as usize];
                    let inside = segment.at(t).clamp(fog.min.as_dvec3(), fog.max.as_dvec3());
                    assert!(segment.at(t).distance(inside) <= tolerance, "{i}: {} is not in {medium:?}", segment.at(t));
                }
                FreeFlight::Passed(_) => assert!(depth >= tau, "{i}: passed {depth} of {tau}, {segment:?}"),
            }
            if let Some(medium) = start
                && let Some(flight) = media.short_flight(&segment, medium, depth).collision()
            {
                let FreeFlight::Collision { t, medium: there, .. } =
                    media.free_flight(&segment, &media.regions_at(segment.p), depth)
                else {
                    panic!("{i}: a short flight that passes, {segment:?}");
                };
                assert!(there == medium && segment.at(t).distance(flight.q) <= 1e-12, "{i}: {flight:?} but {t}");
            }
        }
    }
    println!("{met} segments through fog, {touched} only touch some, {flights} collisions");
    assert!(met > 50_000 && touched > 1_000 && flights > 20_000);
}

struct Random(Sampler);

impl Random {
    fn below(&mut self, n: u32) -> u32 {
        (self.0.next_1d() * f64::from(n)) as u32
    }

    /// One to three boxes within [−4, 4]³ with corners on a grid of side 1, in a row along an axis: they touch or leave gaps.
    fn fogs(&mut self) -> Vec<Fog> {
        let axis = self.below(3) as usize;
        let mut from = -4.0 + self.below(3) as f32;
        let mut fogs = vec![];
        for _ in 0..=self.below(3) {
            let (mut min, mut max) = (Vec3::ZERO, Vec3::ZERO);
            for k in 0..3 {
                min[k] = self.below(4) as f32 - 3.0;
                max[k] = min[k] + 1.0 + self.below(3) as f32;
            }
            min[axis] = from;
            max[axis] = from + 1.0 + self.below(2) as f32;
            from = max[axis] + self.below(2) as f32;
            fogs.push(Fog::absorbing(min, max, 0.25 * f64::from(1 + self.below(8))));
        }
        // The order in which boundaries are listed has no meaning.
        if self.below(2) == 0 {
            fogs.reverse();
        }
        fogs
    }

    fn point(&mut self) -> DVec3 {
        let mut p = DVec3::ZERO;
        let kind = self.below(4);
        for k in 0..3 {
            let on_grid = f64::from(self.below(21)) * 0.5 - 5.0;
            p[k] = match kind {
                0 => 10.0 * self.0.next_1d() - 5.0,
                1 => on_grid + (f64::from(self.below(5)) - 2.0) * f64::EPSILON,
                _ => on_grid,
            };
        }
        p
    }
}
