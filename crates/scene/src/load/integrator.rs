//! The integrator, under all the names that Mitsuba has for one that does what ours does.

use super::document::Element;
use super::properties::Object;
use super::{Loader, features};
use crate::{IntegratorSettings, SceneError};

/// What only asks for a second result next to the picture.
const WRAPPERS: [&str; 3] = ["moment", "aov", "stokes"];
/// The integrators that differentiate have this limit by default.
const MAX_DEPTH_OF_PRB: i64 = 6;
/// So many wrappers may be around an integrator.
const MOST_WRAPPERS: usize = 4;
const MOST: i64 = u32::MAX as i64;

/// Depth from which Russian roulette is played.
const RR_DEPTH: u32 = 5;

/// What a scene without an integrator has: `volpath` with its defaults.
pub(super) fn default() -> IntegratorSettings {
    IntegratorSettings { max_depth: None, rr_depth: RR_DEPTH }
}

/// Reads the integrator.
pub(super) fn read<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<IntegratorSettings, SceneError> {
    read_within(loader, element, 0)
}

fn read_within<'a>(loader: &Loader<'a>, element: &'a Element, depth: usize) -> Result<IntegratorSettings, SceneError> {
    let mut object = Object::new(loader, element, features::kinds("integrator"))?;
    // How Mitsuba cuts up its work and what it differentiates; no meaning here.
    object.integer("block_size", 0, 0..=i64::MAX)?;
    object.integer("samples_per_pass", 0, 0..=i64::MAX)?;
    object.float_where("timeout", -1.0, |v| v <= 0.0, "-1: no time limit")?;
    object.without_effect(loader, &["use_radiance"])?;
    if WRAPPERS.contains(&object.kind()) {
        return wrapped(loader, object, depth);
    }
    if object.boolean("hide_emitters", false)? {
        loader.warn(
            object.place_of("hide_emitters"),
            "\"hide_emitters\" has no effect here: the camera sees the emitters",
        );
    }
    if matches!(object.kind(), "path" | "direct" | "prb" | "prb_basic" | "ptracer") && !loader.media.is_empty() {
        let message = format!("{} ignores media in Mitsuba; vdf renders them, as volpath does", object.describe());
        loader.warn(&element.at, &message);
    }
    let settings = if object.kind() == "direct" {
        // Light that meets one surface: a path of two parts. The samples are spread over pixels here, not over one point.
        let both = object.integer("shading_samples", 1, 1..=MOST)?;
        let emitter = object.integer("emitter_samples", both, 0..=MOST)?;
        if emitter + object.integer("bsdf_samples", both, 0..=MOST)? == 0 {
            return Err(object.error("no samples", "emitter_samples or bsdf_samples must be positive"));
        }
        IntegratorSettings { max_depth: Some(2), rr_depth: RR_DEPTH }
    } else {
        if object.kind() == "volpathmis" {
            object.boolean("use_spectral_mis", true)?;
        }
        let default = if object.kind().starts_with("prb") { MAX_DEPTH_OF_PRB } else { -1 };
        let max_depth = u32::try_from(object.integer("max_depth", default, -1..=MOST)?).ok();
        let rr_depth = object.integer("rr_depth", RR_DEPTH.into(), 1..=MOST)?;
        IntegratorSettings { max_depth, rr_depth: u32::try_from(rr_depth).unwrap_or(u32::MAX) }
    };
    object.finish()?;
    Ok(settings)
}

fn wrapped<'a>(loader: &Loader<'a>, mut object: Object<'a>, depth: usize) -> Result<IntegratorSettings, SceneError> {
    object.string("aovs")?;
    let [inner] = object.nested("integrator")[..] else {
        return Err(object.error("it must hold one integrator", "write the integrator of the picture inside it"));
    };
    let message = format!("{} is passed over: only the picture of the integrator in it is rendered", object.describe());
    loader.warn(&object.element.at, &message);
    object.finish()?;
    // Two wrappers may refer to each other.
    if depth == MOST_WRAPPERS {
        return Err(inner.at.error(format!("integrators nest more than {MOST_WRAPPERS} deep"), ""));
    }
    read_within(loader, inner.object, depth + 1)
}
