//! What the end-to-end tests share: scenes made in code and a quiet way to render them.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses its own part")]

pub mod statistics;

use vdf::{
    geometry::Triangle,
    render::{
        Estimator, Integrator, LightPaths, PrepareOptions, PreparedScene, Quiet, RenderError, RenderOptions, Rendering,
        Roulette, SamplerKind, TransmittanceEstimator,
    },
    scene::{
        Boundary, Bsdf, ComponentFormat, Emitter, FilmSettings, IntegratorSettings, LoadOptions, Medium, MediumId,
        Phase, PixelRect, Projection, ReconstructionFilter, Rgb, Scene, Sensor, Surface,
    },
    visibility::Method,
};

use glam::{DMat4, DVec3, Vec3, dvec3, vec3};

/// How to prepare a scene and how to render it, for tests that are about both.
#[derive(Clone, Debug)]
pub struct Options {
    pub method: Method,
    pub voxel_size: Option<f64>,
    pub integrator: Integrator,
    pub transmittance: TransmittanceEstimator,
    pub roulette: Roulette,
    pub estimator: Estimator,
    /// Whether they pay or not, they are to be right.
    pub light_paths: LightPaths,
    pub sampler: SamplerKind,
    pub spp: Option<u32>,
    pub seed: Option<u64>,
    pub threads: Option<usize>,
    pub crop: Option<PixelRect>,
    pub segment_first: bool,
}

/// `volpath` without acceleration; the tests change what they are about.
pub fn options() -> Options {
    Options {
        method: Method::NONE,
        voxel_size: None,
        integrator: Integrator::Volpath,
        transmittance: TransmittanceEstimator::Analytic,
        roulette: Roulette::Standard,
        estimator: Estimator::Thesis,
        light_paths: LightPaths::Always,
        sampler: SamplerKind::Independent,
        spp: None,
        seed: None,
        threads: Some(2),
        crop: None,
        segment_first: true,
    }
}

/// Prepares and renders.
pub fn render(scene: &Scene, o: &Options) -> Result<Rendering, RenderError> {
    let prepare = PrepareOptions {
        voxel_size: o.voxel_size,
        max_voxels: 1 << 30,
        threads: o.threads,
        ..PrepareOptions::with_method(o.method)
    };
    let Options { integrator, transmittance, roulette, estimator, light_paths, sampler, .. } = *o;
    let Options { spp, seed, threads, crop, segment_first, .. } = *o;
    let options = RenderOptions {
        integrator,
        transmittance,
        roulette,
        estimator,
        sampler,
        spp,
        seed,
        threads,
        crop,
        segment_first,
        light_paths,
        ..RenderOptions::default()
    };
    PreparedScene::new(scene.clone(), &prepare, &Quiet)?.render(&options, &Quiet)
}

/// Renders and requires that no sample was refused.
pub fn rendered(scene: &Scene, options: &Options) -> Rendering {
    let rendering = render(scene, options).expect("the scene is sound");
    assert_eq!(rendering.statistics.refused, 0, "non-finite or negative samples");
    rendering
}

/// An empty scene: the camera at the origin looks along +Z with a field of view of `tan_half_fov`.
pub fn empty_scene(size: u32, spp: u32, tan_half_fov: f64) -> Scene {
    Scene {
        surfaces: vec![],
        boundaries: vec![],
        media: vec![],
        emitters: vec![],
        sensor: Sensor {
            world_from_camera: DMat4::IDENTITY,
            projection: Projection::Perspective { tan_half_fov_x: tan_half_fov, lens: None, principal_point: [0.0; 2] },
            near_clip: 1e-9,
            far_clip: 1e6,
            medium: None,
        },
        film: FilmSettings {
            width: size,
            height: size,
            crop: PixelRect { x0: 0, y0: 0, x1: size, y1: size },
            filter: ReconstructionFilter::Box,
            component_format: ComponentFormat::Float32,
        },
        integrator: IntegratorSettings { max_depth: None, rr_depth: 5 },
        sample_count: spp,
        seed: 1,
        warnings: vec![],
    }
}

/// Adds a medium and returns its number.
pub fn add_medium(scene: &mut Scene, sigma_t: f64, albedo: f32, phase: Phase) -> MediumId {
    scene.media.push(Medium::new(sigma_t, Rgb::splat(albedo), phase));
    MediumId(u32::try_from(scene.media.len()).expect("few") - 1)
}

/// The box from `min` to `max`, normals outwards.
pub fn cuboid(min: Vec3, max: Vec3) -> Vec<Triangle> {
    let corner = |i: u8| {
        vec3(
            if i & 1 == 0 { min.x } else { max.x },
            if i & 2 == 0 { min.y } else { max.y },
            if i & 4 == 0 { min.z } else { max.z },
        )
    };
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        .iter()
        .flat_map(|&[a, b, c, d]| {
            let [a, b, c, d] = [a, b, c, d].map(corner);
            [Triangle::new(a, b, c), Triangle::new(a, c, d)]
        })
        .collect()
}

/// A black block between the camera and the fog behind it, and a light of each kind: an area, a point and the surroundings.
pub fn add_block_and_lights(scene: &mut Scene) {
    let black = |triangles, radiance| Surface {
        triangles,
        bsdf: Bsdf::lambertian(Rgb::ZERO, Rgb::ZERO),
        radiance,
        ..Surface::default()
    };
    scene.surfaces.push(black(cuboid(vec3(-0.9, -0.8, 1.5), vec3(-0.2, 0.1, 2.2)), None));
    let light = Triangle::new(vec3(-1.2, 1.9, 1.2), vec3(0.8, 1.9, 1.2), vec3(0.8, 1.9, 2.4));
    let lamp = scene.surfaces.len();
    scene.surfaces.push(black(vec![light], Some(Rgb::splat(2.0).into())));
    scene.emitters.push(Emitter::Area { surface: lamp });
    scene.emitters.push(Emitter::Point { position: dvec3(2.6, 1.2, 0.6), intensity: Rgb::splat(5.0) });
    scene.emitters.push(Emitter::Constant { radiance: Rgb::splat(0.3) });
}

/// Fills the box from `min` to `max` with a medium, vacuum outside.
pub fn add_fog(scene: &mut Scene, min: Vec3, max: Vec3, medium: MediumId) {
    scene.boundaries.push(Boundary {
        triangles: cuboid(min, max),
        interior: Some(medium),
        exterior: None,
        ..Boundary::default()
    });
}

/// Mean and standard error of the first channel over all pixels, which must share one expectation.
pub fn mean_and_error(pixels: &[Rgb]) -> (f64, f64) {
    let n = pixels.len() as f64;
    let mean = pixels.iter().map(|p| f64::from(p.x)).sum::<f64>() / n;
    let variance = pixels.iter().map(|p| (f64::from(p.x) - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// ∫ f over [a, b] by adaptive Simpson's rule to a relative tolerance of about 10⁻⁹.
pub fn integrate(f: &dyn Fn(f64) -> f64, a: f64, b: f64) -> f64 {
    fn simpson(fa: f64, fm: f64, fb: f64, h: f64) -> f64 {
        h / 6.0 * (fa + 4.0 * fm + fb)
    }
    #[allow(clippy::too_many_arguments, reason = "the values of the whole interval are passed down")]
    fn refine(
        f: &dyn Fn(f64) -> f64,
        a: f64,
        b: f64,
        fa: f64,
        fm: f64,
        fb: f64,
        whole: f64,
        tol: f64,
        depth: u32,
    ) -> f64 {
        let m = 0.5 * (a + b);
        let (fl, fr) = (f(0.5 * (a + m)), f(0.5 * (m + b)));
        let (left, right) = (simpson(fa, fl, fm, m - a), simpson(fm, fr, fb, b - m));
        let delta = left + right - whole;
        // Below the rounding of the values nothing is gained by halving; exp(−τ) of an optical depth of hundreds rounds to 10⁻¹³.
        if depth == 0 || delta.abs() <= 15.0 * tol.max(1e-12 * whole.abs()) {
            return left + right + delta / 15.0;
        }
        refine(f, a, m, fa, fl, fm, left, 0.5 * tol, depth - 1)
            + refine(f, m, b, fm, fr, fb, right, 0.5 * tol, depth - 1)
    }
    // Pieces first, so that a narrow peak is not overlooked.
    let pieces = 256;
    let h = (b - a) / f64::from(pieces);
    let rough: f64 = (0..pieces).map(|i| f(a + (f64::from(i) + 0.5) * h) * h).sum::<f64>().abs();
    (0..pieces)
        .map(|i| {
            let (a, b) = (a + f64::from(i) * h, a + f64::from(i + 1) * h);
            let (fa, fm, fb) = (f(a), f(0.5 * (a + b)), f(b));
            refine(f, a, b, fa, fm, fb, simpson(fa, fm, fb, b - a), 1e-10 * rough / f64::from(pieces), 40)
        })
        .sum()
}

/// The camera's position.
pub fn eye(scene: &Scene) -> DVec3 {
    scene.sensor.world_from_camera.w_axis.truncate()
}

/// A built-in scene with `-D` definitions.
pub fn builtin(name: &str, defines: &[(&str, &str)]) -> Scene {
    let source = vdf::scenes::builtin(name).expect("a built-in name");
    let defines = defines.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    Scene::from_source(&source, &LoadOptions { defines, ..LoadOptions::default() }).expect("built-in scenes load")
}

/// The methods that prove something.
pub fn all_methods() -> Vec<Method> {
    Method::proving().collect()
}
