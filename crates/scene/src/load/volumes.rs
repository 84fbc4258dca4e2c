//! Volumes: what a medium's extinction and albedo are made of.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::PathBuf;
use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3};
use vdf_geometry::Bounds;

use super::document::{Element, Place};
use super::properties::Object;
use super::{Loader, features};
use crate::{Albedo, Extinction, GridVolume, SceneError, VolumeFilter, VoxelGrid, Wrap, vol};

/// All volumes of a scene have at most this many numbers together; each takes four bytes.
const MAX_NUMBERS: u64 = 1 << 30;
/// And their files at most this many bytes.
const MAX_FILE_BYTES: u64 = 8 << 30;

/// Where a turned volume repeats itself up to its box, it has at most this many voxels with all copies.
const MAX_REPEATED: f64 = (1_u64 << 34) as f64;

/// The grids that were read, by their path.
pub(super) type Grids = HashMap<PathBuf, Arc<VoxelGrid>>;

/// A volume.
pub(super) enum Volume {
    /// The same in all of the unit cube of its space.
    Constant { value: DVec3, grid_from_world: DMat4 },
    /// A grid over it.
    Grid(GridVolume),
}

/// A volume; each file is read once.
pub(super) fn read<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<Volume, SceneError> {
    let mut object = Object::new(loader, element, features::kinds("volume"))?;
    let grid_from_world = object.world_transform(loader)?.inverse();
    let volume = if object.kind() == "constvolume" {
        Volume::Constant { value: object.extinction(loader, "value", 1.0)?, grid_from_world }
    } else {
        Volume::Grid(grid(loader, &mut object, grid_from_world)?)
    };
    object.finish()?;
    Ok(volume)
}

fn grid<'a>(loader: &Loader<'a>, object: &mut Object<'a>, grid_from_world: DMat4) -> Result<GridVolume, SceneError> {
    let filter = match object.choice("filter_type", "trilinear", &["trilinear", "nearest"])? {
        "nearest" => VolumeFilter::Nearest,
        _ => VolumeFilter::Trilinear,
    };
    let wrap = match object.choice("wrap_mode", "clamp", &["clamp", "repeat", "mirror"])? {
        "mirror" => Wrap::Mirror,
        "repeat" => Wrap::Repeat,
        _ => Wrap::Clamp,
    };
    // Of spectra, of hardware, and a bound that is not needed here: none of them changes what there is.
    object.boolean("raw", false)?;
    object.boolean("accel", true)?;
    object.float("max_value")?;
    let use_grid_bbox = object.boolean("use_grid_bbox", false)?;
    let name =
        object.string("filename")?.ok_or_else(|| object.error("no filename", "add <string name=\"filename\" …>"))?;
    let grid = voxels(loader, name, object.place_of("filename"))?;
    let grid_from_world = if use_grid_bbox {
        let [min, max] = grid.bounds().map(|corner| corner.as_dvec3());
        let extent = max - min;
        if !(extent.is_finite() && extent.cmpgt(DVec3::ZERO).all()) {
            let message = format!("the box in the file, from {min} to {max}, has no volume");
            return Err(object.place_of("use_grid_bbox").error(message, "write use_grid_bbox=false and a to_world"));
        }
        DMat4::from_scale(extent.recip()) * DMat4::from_translation(-min) * grid_from_world
    } else {
        grid_from_world
    };
    if !(grid_from_world.is_finite() && grid_from_world.inverse().is_finite()) {
        return Err(object.place_of("to_world").error("the transform of the volume overflows", "use a smaller scale"));
    }
    let volume = GridVolume { grid, filter, wrap, grid_from_world };
    if wrap != Wrap::Clamp && reach(&volume) > MAX_REPEATED {
        let help = "write wrap_mode=clamp, or distort the volume less";
        return Err(object.place_of("to_world").error("the box around the volume holds too many copies of it", help));
    }
    Ok(volume)
}

/// How many voxels there are in the box around a volume in the world, with all copies of it.
fn reach(volume: &GridVolume) -> f64 {
    let Bounds { min, max } = volume.world_bounds();
    let corners = (0..8_u8).map(|i| {
        let pick = |bit: u8, axis: usize| if i & bit == 0 { min[axis] } else { max[axis] };
        volume.grid_from_world.transform_point3(DVec3::new(pick(1, 0), pick(2, 1), pick(4, 2)))
    });
    let size = DVec3::from_array(volume.grid.size().map(f64::from));
    (Bounds::of_points(corners).extent() * size + 8.0).element_product()
}

/// The grid in a file.
fn voxels(loader: &Loader<'_>, name: &str, at: &Place) -> Result<Arc<VoxelGrid>, SceneError> {
    let path = loader.search.mesh(loader.source, name);
    let mut grids = loader.grids.borrow_mut();
    let used: u64 = grids.values().map(|grid| grid.values().len() as u64).sum();
    match grids.entry(path) {
        Entry::Occupied(entry) => Ok(Arc::clone(entry.get())),
        Entry::Vacant(entry) => {
            let path = entry.key().display().to_string();
            let opened = loader.source.open(entry.key(), MAX_FILE_BYTES);
            let (mut input, _) = opened.map_err(|e| {
                let help = "the path is relative to the folder of the scene file, or to a folder of a <path>";
                at.error(format!("cannot read \"{path}\": {e}"), help)
            })?;
            let grid = vol::read(&mut *input, MAX_NUMBERS.saturating_sub(used))
                .map_err(|e| at.error(format!("{path}: {}", e.message), e.help))?;
            Ok(Arc::clone(entry.insert(Arc::new(grid))))
        }
    }
}

/// The albedo that a volume is.
pub(super) fn albedo<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<Albedo, SceneError> {
    let (albedo, most) = match read(loader, element)? {
        Volume::Constant { value, .. } => (Albedo::Constant(value.as_vec3()), value.max_element()),
        Volume::Grid(volume) => {
            let most = volume.grid.max();
            (Albedo::Grid(volume), most.into())
        }
    };
    if most > 1.0 {
        return Err(element.at.error(format!("the albedo is up to {most}"), "it must be in [0, 1] everywhere"));
    }
    Ok(albedo)
}

/// The extinction of a medium, which is a value or a volume, times `scale`.
pub(super) fn extinction<'a>(
    loader: &Loader<'a>,
    object: &mut Object<'a>,
    scale: f64,
) -> Result<Extinction, SceneError> {
    let is_homogeneous = object.kind() == "homogeneous";
    let element = object.volume_element("sigma_t")?;
    let at = element.map_or_else(|| object.place_of("sigma_t"), |element| &element.at);
    let volume = match element {
        Some(element) => read(loader, element)?,
        None => {
            let value = object.extinction(loader, "sigma_t", 1.0)?;
            if !is_homogeneous {
                loader.warn(
                    at,
                    "as in Mitsuba, a heterogeneous medium whose sigma_t is one value ends at the unit cube; homogeneous media do not",
                );
            }
            Volume::Constant { value, grid_from_world: DMat4::IDENTITY }
        }
    };
    let most = match &volume {
        Volume::Constant { value, .. } => value.max_element(),
        Volume::Grid(volume) => volume.grid.max().into(),
    };
    if !(most * scale).is_finite() {
        let help = "sigma_t × scale must be finite and at least 0";
        return Err(at.error(format!("the extinction is {}", most * scale), help));
    }
    match volume {
        Volume::Constant { value, .. } if is_homogeneous => Ok(Extinction::Constant(value * scale)),
        Volume::Constant { value, grid_from_world } => Ok(in_a_cube(value, grid_from_world, scale)),
        Volume::Grid(_) if is_homogeneous => Err(at.error(
            "the extinction of a homogeneous medium is a grid",
            "write <medium type=\"heterogeneous\">; only its albedo may be a grid",
        )),
        Volume::Grid(volume) => Ok(Extinction::Grid { volume, scale }),
    }
}

/// One value in the unit cube of its space, and nothing outside.
fn in_a_cube(value: DVec3, grid_from_world: DMat4, scale: f64) -> Extinction {
    let most = value.max_element();
    let share = if most > 0.0 { (value / most).as_vec3() } else { Vec3::ZERO };
    let values = if share == Vec3::splat(share.x) { vec![share.x] } else { share.to_array().to_vec() };
    match VoxelGrid::new([1; 3], values.len(), values, [Vec3::ZERO, Vec3::ONE]) {
        Some(grid) => {
            let (filter, wrap) = (VolumeFilter::Nearest, Wrap::Clamp);
            let volume = GridVolume { grid: Arc::new(grid), filter, wrap, grid_from_world };
            Extinction::Grid { volume, scale: most * scale }
        }
        None => Extinction::Constant(DVec3::ZERO),
    }
}
