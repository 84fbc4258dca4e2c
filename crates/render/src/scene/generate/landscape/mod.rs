//! `scape`: a mountain lake with woods under an open sky, after the scene of that name in \[Houska2013\] (6.1.3), which was modelled by
//! hand and was not published.
//!
//! Its fog box has the size of the thesis's grid, 188³ voxels of 0.25, and is mostly empty. The light is the sky, outside of the box.
//!
//! y is up; the camera looks along −z from a hill towards mountains that hide the edges of the ground.

mod plants;
mod terrain;

use super::{MeshFunction, Recipe};

const GRASS: MeshFunction = terrain::grass;
const ROCK: MeshFunction = terrain::rock;
const SNOW: MeshFunction = terrain::snow;
const WATER: MeshFunction = terrain::water;
const BARK: MeshFunction = plants::bark;
/// All but the needles, which take what is left of the budget.
const FIXED: [MeshFunction; 5] = [GRASS, ROCK, SNOW, WATER, BARK];

pub(super) static RECIPE: Recipe = Recipe {
    name: "scape",
    default_triangles: 130_000,
    scene: ("scape.xml", include_str!("scape.xml")),
    meshes: &[
        ("meshes/scape_grass.obj", GRASS),
        ("meshes/scape_rock.obj", ROCK),
        ("meshes/scape_snow.obj", SNOW),
        ("meshes/scape_water.obj", WATER),
        ("meshes/scape_bark.obj", BARK),
        ("meshes/scape_needles.obj", plants::needles),
    ],
};
