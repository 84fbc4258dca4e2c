//! `scape`: a mountain lake with woods under an open sky, after the scene of that name in \[Houska2013\] (6.1.3), which was modelled by
//! hand and was not published.
//!
//! Its fog box has the size of the thesis's grid, 188³ voxels of 0.25, and is mostly empty. The light is the sky, outside of the box.
//!
//! The needles of the trees take what the ground leaves of the triangles. y is up; the camera looks along −z from a hill towards mountains that hide the edges of the ground.

mod plants;
mod terrain;

use super::{Recipe, Size};

pub(super) static RECIPE: Recipe = Recipe {
    name: "scape",
    default_size: Size::Triangles(130_000),
    scene: ("scape.xml", include_str!("scape.xml")),
    meshes: &[
        ("meshes/scape_grass.obj", terrain::grass),
        ("meshes/scape_rock.obj", terrain::rock),
        ("meshes/scape_snow.obj", terrain::snow),
        ("meshes/scape_water.obj", terrain::water),
        ("meshes/scape_bark.obj", plants::bark),
        ("meshes/scape_needles.obj", plants::needles),
    ],
    volumes: &[],
};
