//! Media and phase functions at the ends of what numbers allow, and emitters beside them: hard cases 36 to 44.

use glam::{DMat4, DVec3, Vec3, dvec3, vec3};
use vdf::{
    geometry::{Segment, Triangle},
    render::{FreeFlight, Integrator, Media, PhaseFunction as _, RegionSet, Sampler},
    scene::{
        Albedo, Boundary, Bsdf, Emitter, IntegratorSettings, Medium, MediumId, Phase, Projection, Rgb, Scene, Surface,
    },
};

use crate::{
    common::{Options, add_fog, add_medium, cuboid, empty_scene, integrate, mean_and_error, options, rendered},
    room::{BACK, BOTH, bits, room, same_for_all_methods, wall},
};

/// The airlight integral along +Z with any transmittance towards the light.
fn airlight(scene: &Scene, z: (f64, f64)) -> f64 {
    let media = Media::of_scene(scene);
    let Emitter::Point { position, intensity } = scene.emitters[0].clone() else { panic!("a point light") };
    let Medium { sigma_t, albedo, phase } = scene.media[0].clone();
    let (Some(sigma_t), Albedo::Constant(albedo)) = (sigma_t.grey(), albedo) else { panic!("plain fog") };
    let outside = Segment::new(dvec3(0.0, 0.0, -99.0), DVec3::ZERO);
    assert_eq!(media.transmittance(&outside, &media.regions_at(outside.p)), 1.0, "the camera is in vacuum");
    let f = |t: f64| {
        let p = dvec3(0.0, 0.0, t);
        let d = (position - p).normalize();
        let in_scattered = phase.pdf_direction(DVec3::Z, d) * f64::from(intensity.x) / p.distance_squared(position);
        let tau = sigma_t * (t - z.0) + media.optical_depth(&Segment::new(p, position), &media.regions_at(p));
        sigma_t * f64::from(albedo.x) * in_scattered * (-tau).exp()
    };
    integrate(&f, z.0, z.1)
}

/// Lights outside the fog, in another fog, on the border between the two, behind the camera, beside its axis: single scattering is the
/// airlight integral, for any mean cosine, and for media from nearly nothing to optical depths of hundreds.
#[test]
fn case_37_and_42_airlight_from_odd_places() {
    for (i, light) in [
        dvec3(0.0, 3.0, 4.0),
        dvec3(0.5, 0.5, 9.0),
        dvec3(0.5, 0.5, 7.0),
        dvec3(0.3, -0.2, -4.0),
        dvec3(0.0, 0.05, 4.5),
        dvec3(0.5, 0.0, 3.0),
    ]
    .into_iter()
    .enumerate()
    {
        for sigma_t in [1e-9, 0.3, 200.0] {
            // In a dense medium only what is close to its border is seen, and light from far inside does not come out.
            let light = if sigma_t > 1.0 { dvec3(0.5, 0.4 + 0.1 * i as f64, 2.9) } else { light };
            let g = [0.0, 0.7, -0.7][i % 3];
            let mut scene = empty_scene(24, 64, 1e-7);
            let fog = add_medium(&mut scene, sigma_t, 0.8, Phase::HenyeyGreenstein { g });
            // It only absorbs, and not so much that the samples go there.
            let other = add_medium(&mut scene, sigma_t.min(0.2), 0.0, Phase::Isotropic);
            add_fog(&mut scene, vec3(-1.0, -1.0, 3.0), vec3(1.0, 1.0, 7.0), fog);
            add_fog(&mut scene, vec3(-9.0, -9.0, 7.0), vec3(9.0, 9.0, 10.0), other);
            scene.emitters.push(Emitter::Point { position: light, intensity: Rgb::splat(3.0) });
            scene.integrator = IntegratorSettings { max_depth: Some(2), rr_depth: 10 };
            let expected = airlight(&scene, (3.0, 7.0));
            for integrator in BOTH {
                let pixels = rendered(&scene, &Options { integrator, ..options() }).image.pixels;
                let (mean, error) = mean_and_error(&pixels);
                // So thin a medium that `volpath` hardly ever collides tells nothing.
                if sigma_t < 1e-6 && integrator == Integrator::Volpath {
                    continue;
                }
                assert!(
                    (mean - expected).abs() <= 5.0 * error + 4e-7 * expected,
                    "light at {light}, σ_t = {sigma_t}, {integrator:?}: {mean} ± {error}, expected {expected}"
                );
            }
        }
    }
}

/// ξ = 0 and ξ = 1 − 2⁻⁵³: a collision at the start, and one at optical depth 36.7; never a NaN, never beyond the segment.
#[test]
fn case_36_the_ends_of_the_unit_interval() {
    let scene = room(&[]);
    let media = Media::of_scene(&scene);
    let inside = dvec3(4.0, 6.0, 4.0);
    let s = Segment::new(inside, inside + DVec3::X * 2.0);
    let depth = |xi: f64| -(-xi).ln_1p();
    let fog = media.regions_at(inside);
    assert_eq!(media.medium_in(&fog), Some(MediumId(0)));
    let collision = |t| FreeFlight::Collision { t, medium: MediumId(0), regions: fog.clone() };
    assert_eq!(media.free_flight(&s, &fog, depth(0.0)), collision(0.0));
    assert_eq!(media.free_flight(&s, &fog, depth(1.0_f64.next_down())), FreeFlight::Passed(fog.clone()));
    assert!(depth(1.0_f64.next_down()) < 37.0);
    // No collision in a vacuum, not even at depth 0; the first one where the fog begins.
    let from_outside = Segment::new(dvec3(0.0, 4.0, 4.0), dvec3(4.0, 4.0, 4.0));
    assert_eq!(media.free_flight(&from_outside, &media.regions_at(from_outside.p), 0.0), collision(0.25));
    // A depth that is reached exactly at the end belongs to what comes behind.
    let tau = media.optical_depth(&s, &media.regions_at(s.p));
    assert_eq!(media.free_flight(&s, &media.regions_at(s.p), tau), FreeFlight::Passed(media.regions_at(s.q)));
    let FreeFlight::Collision { t, .. } = media.free_flight(&s, &media.regions_at(s.p), tau.next_down()) else {
        panic!("no collision")
    };
    assert!(t <= 1.0);
}

/// From no extinction at all to the largest number: nothing is refused, thin fog does not show, black thick fog is black.
#[test]
fn case_37_extinction_without_limits() {
    let make = |sigma_t: f64, albedo: f32| {
        let mut scene = room(&[dvec3(2.0, 6.0, 3.0)]);
        scene.media[0] = Medium::new(sigma_t, Rgb::splat(albedo), Phase::HenyeyGreenstein { g: 0.9 });
        scene
    };
    let vacuum = BOTH.map(|integrator| {
        let mut scene = make(0.0, 0.5);
        scene.boundaries.clear();
        scene.sensor.medium = None;
        rendered(&scene, &Options { integrator, ..options() }).image.pixels
    });
    for sigma_t in [0.0, 5e-324, 1e-300, 1e-30, 1e-20] {
        for (integrator, vacuum) in BOTH.into_iter().zip(&vacuum) {
            let fog = rendered(&make(sigma_t, 0.5), &Options { integrator, ..options() }).image.pixels;
            // `raymarch` draws numbers for fog of any thinness, so that only the first surface can be compared there.
            if integrator == Integrator::Volpath || sigma_t == 0.0 {
                assert!(bits(&fog) == bits(vacuum), "σ_t = {sigma_t}");
            }
        }
    }
    for sigma_t in [1e4, 1e30, 1e300, f64::MAX] {
        for albedo in [0.0, 1.0] {
            let mut scene = make(sigma_t, albedo);
            // In white fog without limits a path ends by its length only.
            scene.integrator.max_depth = Some(500);
            for pixels in same_for_all_methods(&format!("σ_t = {sigma_t}"), &scene, 1.0) {
                assert!(albedo > 0.0 || pixels.iter().all(|&p| p == Rgb::ZERO), "σ_t = {sigma_t}: not black");
            }
        }
    }
}

/// There are no null collisions to choose by a density of zero: media are homogeneous and flights analytic. What comes nearest are
/// boundaries that change nothing, and media without extinction among others: transmittance and collisions are those of one piece.
#[test]
fn case_38_boundaries_that_change_nothing() {
    let medium = |sigma_t: f64| Medium::new(sigma_t, Rgb::ONE, Phase::Isotropic);
    let slab = |x0: f32, x1: f32, m| Boundary {
        triangles: cuboid(vec3(x0, -1.0, -1.0), vec3(x1, 1.0, 1.0)),
        interior: Some(MediumId(m)),
        exterior: None,
        ..Boundary::default()
    };
    let whole = Media::new(&[medium(0.7)], &[slab(0.0, 8.0, 0)], None);
    let pieces: Vec<_> = (0..8_u8).map(|i| slab(f32::from(i), f32::from(i) + 1.0, u32::from(i % 2))).collect();
    let cut = Media::new(&[medium(0.7), medium(0.7)], &pieces, None);
    let mut empty_between = pieces.clone();
    empty_between[3].interior = Some(MediumId(2));
    let gap = Media::new(&[medium(0.7), medium(0.7), medium(0.0)], &empty_between, None);
    for i in 0..2000 {
        let mut u = Sampler::new(71, i, 0, 0);
        let mut end = |x: f64| dvec3(x, 1.6 * u.next_1d() - 0.8, 1.6 * u.next_1d() - 0.8);
        let s = Segment::new(end(-1.0), end(9.0));
        let tau = whole.optical_depth(&s, &whole.regions_at(s.p));
        assert!((cut.optical_depth(&s, &cut.regions_at(s.p)) - tau).abs() < 1e-13 * tau);
        assert!((gap.optical_depth(&s, &gap.regions_at(s.p)) - tau * 7.0 / 8.0).abs() < 1e-13 * tau);
        let wanted = tau * u.next_1d();
        let at = |media: &Media| match media.free_flight(&s, &media.regions_at(s.p), wanted) {
            FreeFlight::Collision { t, medium, .. } => Some((t, medium)),
            FreeFlight::Passed(_) => None,
        };
        let (a, b) = (at(&whole).expect("reached"), at(&cut).expect("reached"));
        assert!((a.0 - b.0).abs() < 1e-13, "{a:?} {b:?}");
        assert_ne!(at(&gap).map(|g| g.1), Some(MediumId(2)), "a collision where there is nothing");
    }
}

/// There is no majorant to exceed. What comes nearest: a collision is never outside its medium's part of the segment, whatever rounds.
#[test]
fn case_39_collisions_stay_in_their_medium() {
    let scene = room(&[]);
    let media = Media::of_scene(&scene);
    for i in 0..20_000 {
        let mut u = Sampler::new(72, i, 0, 0);
        let mut point = || dvec3(u.next_1d(), u.next_1d(), u.next_1d()) * 10.0 - 1.0;
        let s = Segment::new(point(), point());
        let tau = media.optical_depth(&s, &media.regions_at(s.p));
        // The last depths before the end of the fog, or any.
        let wanted = if i % 2 == 0 { tau.next_down() } else { tau * u.next_1d() };
        if let FreeFlight::Collision { t, .. } = media.free_flight(&s, &media.regions_at(s.p), wanted) {
            let p = s.at(t);
            let off = (DVec3::splat(1.0) - p).max(p - DVec3::splat(7.0)).max_element();
            assert!((0.0..=1.0).contains(&t) && off < 1e-12, "{s:?}: {t}, outside by {off}");
        }
    }
}

/// Channels do not mix: without Russian roulette, which looks at the brightest, each channel of a coloured scene has the very bits of a
/// grey one, and where a channel is zero it stays zero.
#[test]
fn case_40_channels_that_are_zero() {
    let colours = [Rgb::new(0.9, 0.0, 0.4), Rgb::new(0.0, 0.0, 0.7), Rgb::new(1.0, 0.5, 0.0)];
    let make = |[albedo, reflectance, intensity]: [Rgb; 3]| {
        let mut scene = room(&[dvec3(2.0, 6.0, 3.0)]);
        scene.media[0].albedo = albedo.into();
        scene.surfaces.iter_mut().for_each(|s| s.bsdf = Bsdf::lambertian(reflectance, reflectance));
        scene.emitters = vec![Emitter::Point { position: dvec3(2.0, 6.0, 3.0), intensity }];
        scene.integrator = IntegratorSettings { max_depth: Some(6), rr_depth: 100 };
        scene
    };
    for integrator in BOTH {
        let o = Options { integrator, ..options() };
        for first in 0..3 {
            let colours: [Rgb; 3] = std::array::from_fn(|i| colours[(i + first) % 3]);
            let coloured = rendered(&make(colours), &o).image.pixels;
            for channel in 0..3 {
                let grey = rendered(&make(colours.map(|c| Rgb::splat(c[channel]))), &o).image.pixels;
                for (c, g) in coloured.iter().zip(&grey) {
                    assert_eq!(
                        c[channel].to_bits(),
                        g.x.to_bits(),
                        "{integrator:?}, colours {first}, channel {channel}"
                    );
                }
            }
        }
    }
}

/// The white furnace for mean cosines up to ±0.999999: fog of albedo 1 under a uniform sky does not darken anything.
#[test]
fn case_41_peaked_phase_functions() {
    for g in [-0.999_999, -0.99, -1e-4, 1e-4, 0.99, 0.999_999, 1.0_f64.next_down(), -1.0_f64.next_down()] {
        let mut scene = empty_scene(24, 16, 0.5);
        scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
        let fog = add_medium(&mut scene, 1.0, 1.0, Phase::HenyeyGreenstein { g });
        add_fog(&mut scene, vec3(-2.0, -2.0, 1.0), vec3(2.0, 2.0, 4.0), fog);
        let (mean, error) = mean_and_error(&rendered(&scene, &options()).image.pixels);
        assert!((mean - 1.0).abs() <= 5.0 * error + 4e-6, "g = {g}: {mean} ± {error}");
        let mut lit = room(&[dvec3(2.0, 6.0, 3.0)]);
        lit.media[0].phase = Phase::HenyeyGreenstein { g };
        same_for_all_methods(&format!("g = {g}"), &lit, 1.0);
    }
}

/// A light on the very axis of the camera, in front and behind, at the camera, and beside the axis by less than rounding. The
/// expectation is infinite on the axis itself; the samples are not.
#[test]
fn case_42_a_light_on_the_camera_ray() {
    for (x, z) in [(0.0, 3.0), (0.0, 1.5), (0.0, 1.2), (1e-17, 3.0), (1e-12, 3.0), (1e-6, 6.0), (0.0, 7.0)] {
        let mut scene = room(&[dvec3(4.0 + x, 4.0, z)]);
        scene.sensor.projection =
            Projection::Perspective { tan_half_fov_x: 1e-12, lens: None, principal_point: [0.0; 2] };
        same_for_all_methods(&format!("light at {x}, {z}"), &scene, 1.0);
    }
}

/// Intervals without length, and those that have lost it: everything between is as if they were not there.
#[test]
fn case_43_intervals_without_length() {
    let medium = |sigma_t: f64| Medium::new(sigma_t, Rgb::ONE, Phase::Isotropic);
    let closed = |min: Vec3, max: Vec3| Boundary {
        triangles: cuboid(min, max),
        interior: Some(MediumId(0)),
        exterior: None,
        ..Boundary::default()
    };
    let large = Vec3::splat(1e4);
    let s = Segment::new(dvec3(0.3, 0.2, -50.0), dvec3(1.0, 2.0, 70.0));
    for thickness in [0.0, 1e-30, 1e-12, 1e-9, 1e-8] {
        // Thinner than the place of a crossing is known beside coordinates of 10⁴.
        let slab = closed(-large * vec3(1.0, 1.0, 0.0), large * vec3(1.0, 1.0, 0.0) + Vec3::Z * thickness);
        let media = Media::new(&[medium(1.0)], &[slab], None);
        let tau = media.optical_depth(&s, &media.regions_at(s.p));
        assert!(tau <= 1.1e-8, "a slab of {thickness} has the optical depth {tau}");
        assert_eq!(
            media.free_flight(&s, &media.regions_at(s.p), 1.0),
            FreeFlight::Passed(RegionSet::default()),
            "a slab of {thickness}"
        );
    }
    let unit = closed(Vec3::ZERO, Vec3::ONE);
    let media = Media::new(&[medium(1.0)], std::slice::from_ref(&unit), None);
    let through = |p: DVec3, q: DVec3| {
        let there = media.optical_depth(&Segment::new(p, q), &media.regions_at(p));
        let back = media.optical_depth(&Segment::new(q, p), &media.regions_at(q));
        assert!((there - back).abs() < 1e-15, "{p} {q}: {there} there, {back} back");
        there
    };
    // Touching an edge or a corner from outside; passing through edges and corners.
    assert_eq!(through(dvec3(0.5, 1.5, 0.3), dvec3(1.5, 0.5, 0.3)), 0.0);
    assert_eq!(through(dvec3(0.0, 2.0, 1.0), dvec3(2.0, 0.0, 1.0)), 0.0);
    assert_eq!(through(dvec3(0.5, 1.5, 0.9), dvec3(1.5, 0.5, 1.1)), 0.0);
    assert_eq!(through(dvec3(0.0, 2.0, 0.0), dvec3(2.0, 0.0, 2.0)), 0.0);
    let diagonal = 3.0_f64.sqrt();
    assert!((through(DVec3::splat(-1.0), DVec3::splat(2.0)) - diagonal).abs() < 1e-15);
    assert!((through(dvec3(-1.0, -1.0, 0.25), dvec3(2.0, 2.0, 0.25)) - 2.0_f64.sqrt()).abs() < 1e-15);
    // No length at all, on a corner, inside, outside; zero optical depth, and no collision unless in fog.
    for p in [DVec3::ZERO, DVec3::splat(0.5), DVec3::splat(9.0)] {
        let point = Segment::new(p, p);
        assert_eq!(media.optical_depth(&point, &media.regions_at(point.p)), 0.0);
        assert_eq!(media.transmittance(&point, &media.regions_at(point.p)), 1.0);
        assert_eq!(media.free_flight(&point, &media.regions_at(p), 0.0), FreeFlight::Passed(media.regions_at(p)));
        assert!(media.short_flight(&point, MediumId(0), 1.0).collision().is_none());
    }
    // Each face twice, and once more the other way round: it winds around the inside as one face does.
    let mut folded = unit;
    let turned = folded.triangles.iter().map(|t| Triangle::new(t.vertices[0], t.vertices[2], t.vertices[1]));
    folded.triangles = folded.triangles.iter().copied().chain(turned).chain(folded.triangles.iter().copied()).collect();
    let s = Segment::new(dvec3(0.3, 0.4, -1.0), dvec3(0.4, 0.3, 2.0));
    let folded = Media::new(&[medium(1.0)], &[folded], None);
    let (outside, expected) = (RegionSet::default(), media.optical_depth(&s, &RegionSet::default()));
    assert!(expected > 1.0 && folded.optical_depth(&s, &outside) == expected);
    // A length beyond all measure.
    let far = Segment::new(DVec3::ZERO, DVec3::X * 1e150);
    assert_eq!(Media::new(&[medium(1e-300)], &[], Some(MediumId(0))).transmittance(&far, &RegionSet::default()), 1.0);
    assert_eq!(Media::new(&[medium(1.0)], &[], Some(MediumId(0))).transmittance(&far, &RegionSet::default()), 0.0);
}

/// Emitters that fill a ten-millionth of a degree, and one that fills nearly half of the sphere: the light on a wall that faces them.
#[test]
fn case_44_tiny_and_huge_emitters() {
    for half in [1e-6_f32, 1e-3, 1.0, 4e3] {
        let mut scene = empty_scene(24, if half > 1e-2 { 256 } else { 1 }, 1e-9);
        scene.sensor.world_from_camera = DMat4::from_translation(dvec3(0.0, 0.0, -1.0));
        scene.surfaces.push(wall(0.0));
        let z = -2.0;
        let [a, b, c, d] =
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]: [f32; 2]| vec3(x * half, y * half, z));
        scene.surfaces.push(Surface {
            triangles: vec![Triangle::new(a, b, c), Triangle::new(a, c, d)],
            bsdf: Bsdf::lambertian(Rgb::ZERO, Rgb::ZERO),
            radiance: Some(Rgb::splat(0.5 / (half * half).min(1.0)).into()),
            ..Surface::default()
        });
        scene.emitters.push(Emitter::Area { surface: 1 });
        scene.integrator.max_depth = Some(2);
        // The form factor of a square of side 2a at distance h, parallel to the point's plane: 4/π·x/√(1 + x²)·atan(x/√(1 + x²)), x = a/h.
        let x = f64::from(half) / 2.0;
        let root = (1.0 + x * x).sqrt();
        let form = 2.0 / std::f64::consts::PI * x / root * (x / root).atan() * 2.0;
        let radiance = f64::from(0.5 / (half * half).min(1.0));
        let expected = f64::from(BACK) * radiance * form;
        let (mean, error) = mean_and_error(&rendered(&scene, &options()).image.pixels);
        assert!(
            (mean - expected).abs() <= 5.0 * error + 2e-6 * expected,
            "half side {half}: {mean} ± {error}, expected {expected}"
        );
    }
}

/// A hundred thousand bounces at albedo 1, and still as bright as the sky. A sum of n single-precision terms that add up to 1 errs by
/// up to n·2⁻²⁴ = 0.6 %.
#[test]
fn a_hundred_thousand_bounces() {
    let mut scene = empty_scene(4, 2, 0.5);
    scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
    let fog = add_medium(&mut scene, 160.0, 1.0, Phase::Isotropic);
    add_fog(&mut scene, vec3(-1.0, -1.0, -1.0), vec3(1.0, 1.0, 1.0), fog);
    scene.sensor.medium = Some(fog);
    scene.integrator = IntegratorSettings { max_depth: None, rr_depth: u32::MAX };
    let rendering = rendered(&scene, &options());
    let bounces = rendering.statistics.queries as f64 / rendering.statistics.paths as f64;
    assert!(bounces > 1e4, "only {bounces} bounces a path");
    let (mean, error) = mean_and_error(&rendering.image.pixels);
    assert!((mean - 1.0).abs() <= 5.0 * error + 6e-3, "{mean} ± {error}");
    // And exactly so many that a limit is met: no path is longer than it says.
    scene.integrator.max_depth = Some(100_000);
    scene.media[0].sigma_t = 1e5.into();
    let rendering = rendered(
        &scene,
        &Options { spp: Some(1), crop: Some(vdf::scene::PixelRect { x0: 0, y0: 0, x1: 2, y1: 2 }), ..options() },
    );
    assert_eq!(rendering.statistics.queries, 4 * 99_999);
}
