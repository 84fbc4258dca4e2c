//! Transmittance, free flights, phase functions and boundaries against references of 200 bits: the bounds of `docs/numerics.md`.
//!
//! The cases are random with fixed seeds, and the bounds are proved there, not fitted here; each test prints how much of its bound was used.

mod common;

use common::cuboid;
use dashu_float::{FBig, round::mode::HalfEven};
use glam::{DVec3, dvec3, vec3};
use vdf::{
    geometry::{Bvh, Segment},
    render::{FreeFlight, Media, PhaseFunction as _, Sampler},
    scene::{Boundary, Medium, MediumId, Phase, Rgb},
};

type Big = FBig<HalfEven, 2>;

/// Unit roundoff of double precision.
const U: f64 = f64::EPSILON / 2.0;

fn big(x: f64) -> Big {
    Big::try_from(x).expect("finite").with_precision(200).value()
}

/// (x − reference) in units of `U`·reference.
fn error(x: f64, reference: &Big) -> f64 {
    ((big(x) - reference) / reference).to_f64().value().abs() / U
}

fn dot(a: DVec3, b: DVec3) -> Big {
    big(a.x) * big(b.x) + big(a.y) * big(b.y) + big(a.z) * big(b.z)
}

/// |q − p|, exact up to 200 bits.
fn length(s: &Segment) -> Big {
    let [x, y, z] = [0, 1, 2].map(|k| big(s.q[k]) - big(s.p[k]));
    (&x * &x + &y * &y + &z * &z).sqrt()
}

fn fog(sigma_t: f64, boundaries: &[Boundary]) -> Media {
    Media::new(&[Medium::new(sigma_t, Rgb::ONE, Phase::Isotropic)], boundaries, boundaries.is_empty().then_some(FOG))
}

const FOG: MediumId = MediumId(0);

/// 10 to a power between `low` and `high`.
fn log_uniform(u: &mut Sampler, low: f64, high: f64) -> f64 {
    10.0_f64.powf(low + (high - low) * u.next_1d())
}

/// Keeps the largest error and the largest share of a bound that was used, and fails beyond it.
struct Bound {
    name: &'static str,
    used: f64,
    /// In units of u of the value; an ulp is between u and 2u.
    error: f64,
}

impl Bound {
    const fn new(name: &'static str) -> Self {
        Self { name, used: 0.0, error: 0.0 }
    }

    #[track_caller]
    fn check(&mut self, error: f64, bound: f64, case: &dyn Fn() -> String) {
        self.used = self.used.max(error / bound);
        self.error = self.error.max(error);
        assert!(error <= bound, "{}: error {error}, bound {bound}: {}", self.name, case());
    }
}

impl Drop for Bound {
    fn drop(&mut self) {
        println!("{}: largest error {:.2}u, {:.0} % of the bound", self.name, self.error, 100.0 * self.used);
    }
}

/// T to (5τ + 3)u and 1 − T to 8u of their values, for optical depths from 10⁻¹² to 10⁴, in any unit and direction.
#[test]
fn transmittance_and_what_it_lacks_of_one() {
    let (mut depth, mut one_minus_t) = (Bound::new("τ"), Bound::new("1 − T"));
    // An error of τ is one of itself in T, so T is worth a look by the size of τ.
    let [mut thin, mut thick, mut opaque] = ["T, τ < 1", "T, τ from 1 to 30", "T, τ from 30 to 690"].map(Bound::new);
    for i in 0..4000 {
        let mut u = Sampler::new(61, i, 0, 0);
        let tau = log_uniform(&mut u, -12.0, 4.0);
        let sigma_t = log_uniform(&mut u, -9.0, 9.0);
        let to = Phase::Isotropic.sample_direction(DVec3::Z, u.next_2d());
        let p = dvec3(u.next_1d(), u.next_1d(), u.next_1d()) * if i % 2 == 0 { 0.0 } else { tau / sigma_t };
        let s = Segment::new(p, p + to * (tau / sigma_t));
        let exact = big(sigma_t) * length(&s);
        let media = fog(sigma_t, &[]);
        let computed = media.optical_depth(&s, &media.regions_at(s.p));
        let case = || format!("σ_t = {sigma_t}, {s:?}");
        depth.check(error(computed, &exact), 5.0, &case);
        let transmittance = media.transmittance(&s, &media.regions_at(s.p));
        let minus = -exact;
        if tau < 690.0 {
            let t = match tau {
                ..1.0 => &mut thin,
                1.0..30.0 => &mut thick,
                _ => &mut opaque,
            };
            t.check(error(transmittance, &minus.exp()), 5.0 * tau + 3.0, &case);
        } else {
            // The normal numbers end at exp(−708).
            assert!((0.0..1e-299).contains(&transmittance), "{}", case());
        }
        one_minus_t.check(error(-(-computed).exp_m1(), &-minus.exp_m1()), 8.0, &case);
    }
}

/// The way to a collision to 8u of itself, for every random number, those next to 0 and 1 included, by either function.
#[test]
fn sampled_distances() {
    let (mut bound, mut short) = (Bound::new("distance"), Bound::new("short flight"));
    for i in 0..4000 {
        let mut u = Sampler::new(62, i, 0, 0);
        let sigma_t = log_uniform(&mut u, -9.0, 9.0);
        // Multiples of 2⁻⁵³, as the generator makes them; half of them close to 0 or 1.
        let small = (log_uniform(&mut u, 0.0, 15.0)).floor() * U;
        let xi = [u.next_1d(), small, 1.0 - small, small][i as usize % 4];
        if xi == 0.0 {
            continue;
        }
        let to = Phase::Isotropic.sample_direction(DVec3::Z, u.next_2d());
        let s = Segment::new(DVec3::ZERO, to * (log_uniform(&mut u, 0.0, 3.0) * 40.0 / sigma_t));
        let tau = -(-xi).ln_1p();
        let exact = -(big(1.0) - big(xi)).ln() / (big(sigma_t) * length(&s));
        let media = fog(sigma_t, &[]);
        let case = || format!("σ_t = {sigma_t}, ξ = {xi}, {s:?}");
        let FreeFlight::Collision { t, medium: FOG, .. } = media.free_flight(&s, &media.regions_at(s.p), tau) else {
            panic!("{}", case())
        };
        bound.check(error(t, &exact), 8.0, &case);
        let flight = media.short_flight(&s, FOG, tau).collision().expect("nothing in the way");
        let way = length(&flight) / length(&s);
        short.check(((way - &exact) / &exact).to_f64().value().abs() / U, 10.0, &case);
    }
}

/// Henyey–Greenstein of the angle between the vectors as they are, to 40u, for every g and angle.
#[test]
fn phase_functions() {
    let mut bound = Bound::new("phase function");
    for i in 0..6000 {
        let mut u = Sampler::new(63, i, 0, 0);
        let a = [1.0 - log_uniform(&mut u, -6.0, 0.0), log_uniform(&mut u, -300.0, 0.0).min(0.9)][i as usize % 2];
        let g = if i % 4 < 2 { a } else { -a };
        let phase = Phase::HenyeyGreenstein { g };
        let from = Phase::Isotropic.sample_direction(DVec3::Z, u.next_2d());
        // In the peak, beside it, and anywhere.
        let drawn = phase.sample_direction(from, u.next_2d());
        let to = if i % 3 == 0 { Phase::Isotropic.sample_direction(DVec3::Z, u.next_2d()) } else { drawn };
        let cos_theta = dot(from, to) / (dot(from, from) * dot(to, to)).sqrt();
        let (one, g_big) = (big(1.0), big(g));
        let d = &one + &g_big * &g_big - big(2.0) * &g_big * cos_theta;
        let exact = (&one - &g_big * &g_big) / (big(4.0) * pi() * &d * d.sqrt());
        bound.check(error(phase.pdf_direction(from, to), &exact), 40.0, &|| format!("g = {g}, {from} {to}"));
    }
}

/// π by Machin's formula.
fn pi() -> Big {
    let arctan_of_inverse = |n: f64| {
        let (mut sum, mut power) = (big(0.0), big(1.0) / big(n));
        for k in 0..200 {
            let term = &power / big(f64::from(2 * k + 1));
            sum = if k % 2 == 0 { sum + term } else { sum - term };
            power /= big(n * n);
        }
        sum
    };
    big(16.0) * arctan_of_inverse(5.0) - big(4.0) * arctan_of_inverse(239.0)
}

/// The angle from the peak of a drawn direction is that of the exact inversion of its random number to 16u of itself and 16u of a radian,
/// which is what the components of a direction can say.
#[test]
fn drawn_angles() {
    let mut bound = Bound::new("drawn angle");
    for i in 0..6000 {
        let mut u = Sampler::new(64, i, 0, 0);
        let a = [1.0 - log_uniform(&mut u, -6.0, 0.0), log_uniform(&mut u, -300.0, 0.0).min(0.9)][i as usize % 2];
        let g = if i % 4 < 2 { a } else { -a };
        let axis = Phase::Isotropic.sample_direction(DVec3::Z, u.next_2d());
        let xi = [u.next_1d(), 1.0 - log_uniform(&mut u, -12.0, -1.0)][i as usize / 4 % 2];
        let to = Phase::HenyeyGreenstein { g }.sample_direction(axis, [xi, u.next_1d()]);
        // The textbook's inversion with s = 2ξ − 1, solved for what cos θ lacks of the peak's ±1.
        let (one, two, g_big, s) = (big(1.0), big(2.0), big(g), big(2.0) * big(xi) - big(1.0));
        let e = &one + &g_big * &s;
        let numerator = &two * &s + &g_big * (&s * &s + big(3.0) + &g_big * (&two * &s + &g_big * (&s * &s - &one)));
        let cos_theta = numerator / (two * &e * e);
        let lacks = if g >= 0.0 { one - cos_theta } else { one + cos_theta };
        let chord = (big(2.0) * lacks).sqrt();
        // The direction is compared with the exact unit vector along the axis.
        let norm = (dot(axis, axis) * dot(to, to)).sqrt();
        let cosine = dot(axis, to) / norm;
        let drawn = (big(2.0) * if g >= 0.0 { big(1.0) - cosine } else { big(1.0) + cosine }).sqrt();
        let off = (drawn - &chord).to_f64().value().abs() / U;
        bound.check(off, 16.0 * chord.to_f64().value() + 16.0, &|| format!("g = {g}, ξ = {xi}, {axis}"));
    }
}

/// Where a segment from inside leaves a box, down to grazing angles of 10⁻⁹: the optical depth errs by no more than the crossing, which is
/// 2¹¹um³/det off, with m the farthest corner of the bounds and det twice the triangle's area as seen along the segment.
#[test]
fn crossings_at_any_angle() {
    let mut bound = Bound::new("crossing");
    let triangles = cuboid(vec3(-8.0, -6.0, -4.0), vec3(8.0, 10.0, 12.0));
    let boundary =
        Boundary { triangles: triangles.clone(), interior: Some(FOG), exterior: None, ..Boundary::default() };
    let sigma_t = 0.125;
    let media = fog(sigma_t, &[boundary]);
    let bvh = Bvh::new(&triangles);
    for i in 0..4000 {
        let mut u = Sampler::new(65, i, 0, 0);
        let graze = log_uniform(&mut u, -9.0, 0.0);
        let to = (dvec3(1.0 + u.next_1d(), u.next_1d() - 0.5, -graze)).normalize();
        let reach = [30.0, 1e3, 1e7][i as usize % 3] / graze;
        // So close above the face z = −4 that this is where the segment leaves.
        let p = dvec3(-7.0 + u.next_1d(), 0.0, 0.0) + DVec3::Z * (-4.0 + 4.0 * graze * u.next_1d());
        let s = Segment::new(p, p + to * reach);
        if s.q.z >= -4.0 || p.z <= -4.0 {
            continue;
        }
        let d = s.q - s.p;
        let t = (big(p.z) + big(4.0)) / (big(s.p.z) - big(s.q.z));
        let exact = big(sigma_t) * &t * length(&s);
        let m = (dvec3(8.0, 10.0, 12.0) - p).abs().max((dvec3(-8.0, -6.0, -4.0) - p).abs()).max_element();
        let det = 256.0 * d.z.abs() / d.abs().max_element();
        let allowed = 5.0 * U * exact.to_f64().value() + sigma_t * 2048.0 * U * m * m * m / det;
        let off = (big(media.optical_depth(&s, &media.regions_at(s.p))) - exact).to_f64().value().abs();
        bound.check(off, allowed, &|| format!("{s:?}, {:?}", bvh.intersect(&s)));
    }
}

/// The same where only exact predicates can tell that the segment meets the face: on the diagonal that its two triangles share.
#[test]
fn crossings_on_a_shared_edge() {
    let mut bound = Bound::new("crossing on an edge");
    let triangles = cuboid(vec3(-8.0, -8.0, -8.0), vec3(8.0, 8.0, 8.0));
    let sigma_t = 0.125;
    let media = fog(sigma_t, &[Boundary { triangles, interior: Some(FOG), exterior: None, ..Boundary::default() }]);
    for i in 0..400 {
        let mut u = Sampler::new(66, i, 0, 0);
        let reach = [32.0, 1e4, 1e8][i as usize % 3];
        let (x, slope) = (u.next_1d(), u.next_1d() - 0.5);
        // In the plane x = ±y, in which both diagonals of the face z = 8 lie, exactly.
        let mirror = if i % 2 == 0 { 1.0 } else { -1.0 };
        let s = Segment::new(dvec3(x, mirror * x, 0.0), dvec3(slope * reach, mirror * slope * reach, reach));
        let exact = big(sigma_t) * big(8.0) / big(reach) * length(&s);
        if 8.0 / reach * (slope * reach - x) + x > 7.9 {
            continue;
        }
        let m = 17.0;
        let det = 256.0;
        let allowed = 5.0 * U * exact.to_f64().value() + sigma_t * 2048.0 * U * m * m * m / det;
        let off = (big(media.optical_depth(&s, &media.regions_at(s.p))) - exact).to_f64().value().abs();
        bound.check(off, allowed, &|| format!("{s:?}"));
    }
}
