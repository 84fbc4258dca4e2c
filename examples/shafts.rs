//! What proofs from voxels can reach: of the spatial queries of a render in the grid towards point lights the share that is unoccluded, that `amr-xsn` and `amr-hop` prove, and that a free
//! shaft between two voxels would prove, which nothing that knows only voxels can exceed.
//!
//! Usage: `shafts SCENE VOXEL [QUERIES]`; a scene is a built-in name or a file. Cost: each voxel with a query is compared with all occupied ones between it and the light.

use std::{collections::HashMap, path::Path};

use anyhow::{Context as _, anyhow};
use rayon::prelude::*;
use vdf::{
    lab::{SceneVoxels, queries::record_queries},
    render::{Integrator, PrepareOptions, PreparedScene, Quiet, RenderOptions},
    scene::{Emitter, LoadOptions, Scene, SceneSource},
    scenes::builtin,
    visibility::{Answer, Method, QueryKind},
    voxel::{Voxel, VoxelSet},
};

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, voxel, rest @ ..] = &arguments[..] else { return Err(anyhow!("usage: shafts SCENE VOXEL [QUERIES]")) };
    let most = rest.first().map_or(Ok(100_000), |text| text.parse()).context("QUERIES is a whole number")?;
    let source = builtin(name).unwrap_or_else(|| SceneSource::disk(Path::new(name)));
    let scene = Scene::from_source(&source, &LoadOptions::default())?;
    let voxel_size = Some(voxel.parse().context("VOXEL is a number")?);
    let with = |method: &str| -> anyhow::Result<PrepareOptions> {
        Ok(PrepareOptions { method: Some(method.parse::<Method>()?), voxel_size, ..PrepareOptions::default() })
    };
    let cuboids = PreparedScene::new(scene.clone(), &with("amr-xsn")?, &Quiet)?;
    let hops = cuboids.with_options(&with("amr-hop")?, &Quiet)?;
    let SceneVoxels { grid, occupied, .. } = SceneVoxels::build(scene, &with("amr-xsn")?, &Quiet)?;

    let render = RenderOptions { integrator: Integrator::raymarch(7), ..RenderOptions::thesis() };
    let stream = record_queries(&cuboids, &render, most, &Quiet)?;
    let emitters = &cuboids.scene().emitters;
    let towards_points = (stream.queries.iter().zip(&stream.unoccluded))
        .filter(|(q, _)| q.kind == QueryKind::Spatial && matches!(emitters[q.emitter], Emitter::Point { .. }));
    // Those that leave the grid are proved from where they enter it, which is another question.
    let ends = |from, to| Some([grid.voxel_containing(from)?, grid.voxel_containing(to)?]);
    let mut asked = Vec::new();
    let mut pairs: HashMap<[Voxel; 2], usize> = HashMap::new();
    for (query, unoccluded) in towards_points {
        if let Some(pair) = ends(query.from, query.to) {
            asked.push((query, unoccluded));
            *pairs.entry(pair).or_default() += 1;
        }
    }
    let free = pairs.par_iter().filter(|([u, light], _)| is_free(*u, *light, &occupied)).map(|(_, n)| n).sum();
    let proved =
        |by: &PreparedScene| asked.iter().filter(|(q, _)| by.provers().answer(q) == Answer::Unoccluded).count();
    let unoccluded = asked.iter().filter(|(_, unoccluded)| **unoccluded).count();
    let share = |n: usize| 100.0 * n as f64 / asked.len() as f64;
    println!("{} spatial queries in the grid towards point lights", asked.len());
    println!("| unoccluded | `-xsn` | `-hop` | free shaft |\n| --- | --- | --- | --- |");
    let shares = [unoccluded, proved(&cuboids), proved(&hops), free].map(share);
    println!("| {:.1} % | {:.1} % | {:.1} % | {:.1} % |", shares[0], shares[1], shares[2], shares[3]);
    Ok(())
}

/// Whether no segment between points of two voxels meets an occupied one. Only those in their bounding box can be met.
fn is_free(u: Voxel, light: Voxel, occupied: &VoxelSet) -> bool {
    let [u, light] = [u, light].map(|v| [v.i, v.j, v.k]);
    let range = |axis: usize| u[axis].min(light[axis])..=u[axis].max(light[axis]);
    !range(2).any(|k| {
        range(1).any(|j| {
            let row = range(0).map(|i| Voxel::new(i, j, k));
            row.into_iter().any(|o| occupied.contains(o) && can_meet(u, light, [o.i, o.j, o.k]))
        })
    })
}

/// Whether for some t in [0, 1] the box (1 − t)u + t·light meets the voxel o. On each axis that is an open interval of t, whose ends are fractions.
fn can_meet(u: [u32; 3], light: [u32; 3], o: [u32; 3]) -> bool {
    if o == u || o == light {
        return true;
    }
    // Numerators and positive denominators of its ends; it has to meet [0, 1].
    let (mut low, mut high) = ((-1, 1), (2, 1));
    for axis in 0..3 {
        let [u, light, o] = [u, light, o].map(|v| i64::from(v[axis]));
        // t·c < e: by the lower end of the box against the upper face of o, and by the upper end against the lower face.
        for (c, e) in [(light - u, o + 1 - u), (u - light, u + 1 - o)] {
            match c {
                0 if e <= 0 => return false,
                0 => {}
                1.. if e * high.1 < high.0 * c => high = (e, c),
                ..0 if -e * low.1 > low.0 * -c => low = (-e, -c),
                _ => {}
            }
        }
    }
    low.0 * high.1 < high.0 * low.1 && low.0 < low.1 && high.0 > 0
}
