//! `vdf voxelize`.

use std::{
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

use anyhow::Context as _;
use vdf_image::{shown, write_atomically};
use vdf_lab::SceneVoxels;
use vdf_render::PrepareOptions;
use vdf_voxel::{VoxelGrid, VoxelSet, write_indices, write_obj};

use crate::{args::VoxelizeArgs, commands::render::load, failure::Failure, progress::Reporter};

pub(crate) fn run(args: &VoxelizeArgs) -> Result<(), Failure> {
    let named = load(args.scene.as_deref(), &args.defines, args.sensor)?;
    named.warn();
    let reporter = Reporter::new(true)?;
    let options = PrepareOptions {
        voxel_size: args.voxel,
        grid: args.grid.into(),
        threads: args.threads,
        ..PrepareOptions::with_method(args.method)
    };
    let voxels = SceneVoxels::build(named.scene, &options, &reporter)?;
    reporter.writes();

    let mut written = Vec::new();
    if let Some(folder) = &args.export {
        fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", shown(folder)))
            .map_err(Failure::Work)?;
        for (name, set) in sets(&voxels) {
            // Each file appears whole or not at all; those that are there stay.
            if reporter.interrupted() {
                return Err(Failure::InterruptedAfter { written: written.len() });
            }
            written.extend(export(folder, &name, &voxels.grid, set)?);
        }
    }
    summarize(args, &voxels, &written).map_err(Failure::from)
}

/// What there is to export, with the names of the files.
fn sets(voxels: &SceneVoxels) -> Vec<(String, &VoxelSet)> {
    let mut sets = vec![("occupied".to_owned(), &voxels.occupied)];
    for (i, neighbourhood) in voxels.neighbourhoods.iter().enumerate() {
        sets.extend(neighbourhood.as_ref().map(|n| (format!("neighbourhood{i}"), n)));
    }
    sets
}

/// Writes a set in both formats and returns the paths.
fn export(folder: &Path, name: &str, grid: &VoxelGrid, set: &VoxelSet) -> Result<[PathBuf; 2], Failure> {
    let (surface, list) = (folder.join(format!("{name}.obj")), folder.join(format!("{name}.txt")));
    write(&surface, |out| write_obj(grid, set, out))?;
    write(&list, |out| write_indices(grid, set, out))?;
    Ok([surface, list])
}

fn write(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Failure> {
    write_atomically(path, content).with_context(|| format!("cannot write {}", shown(path))).map_err(Failure::Work)
}

fn summarize(args: &VoxelizeArgs, voxels: &SceneVoxels, written: &[PathBuf]) -> io::Result<()> {
    let out = &mut io::stdout().lock();
    let (r, o) = (voxels.grid.resolution(), voxels.grid.origin());
    let (all, occupied) = (r.voxel_count(), voxels.occupied.count());
    let percent = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
    writeln!(out, "grid           {} x {} x {} voxels of {}", r.x(), r.y(), r.z(), voxels.grid.voxel_size())?;
    writeln!(out, "origin         {} {} {}", o.x, o.y, o.z)?;
    writeln!(out, "occupied       {occupied} of {all}, {:.2} % free", percent(all - occupied, all))?;
    for (i, neighbourhood) in voxels.neighbourhoods.iter().enumerate() {
        if let Some(n) = neighbourhood {
            let free = percent(n.count(), all - occupied);
            writeln!(out, "emitter {i}      neighbourhood of {} voxels, {free:.2} % of the free ones", n.count())?;
        }
    }
    let steps: Vec<_> = voxels.build.parts.iter().map(|p| format!("{} {:.4} s", p.name, p.seconds)).collect();
    writeln!(out, "{:14} {}", args.method, steps.join(", "))?;
    written.iter().try_for_each(|path| writeln!(out, "wrote          {}", shown(path)))
}
