//! Loading a scene: a strict subset of Mitsuba 3 XML. Everything that is not in the subset is an error.

mod camera;
mod checks;
mod document;
mod features;
mod film;
mod integrator;
mod lines;
mod materials;
mod metals;
mod names;
mod objects;
mod parameters;
mod plugins;
mod properties;
mod reader;
mod search;
mod shapes;
mod spectra;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_hostile;
#[cfg(test)]
mod tests_mitsuba;
#[cfg(test)]
mod tests_surfaces;
#[cfg(test)]
mod tests_tolerance;
#[cfg(test)]
mod tests_volumes;
mod textures;
mod transform;
mod volumes;
mod xml;

use std::cell::RefCell;
use std::cmp::Ordering;
use std::collections::{HashMap, HashSet};
use std::path::Path;

use document::{Element, Ids, OBJECT_TAGS, Place};
use parameters::Parameters;
use reader::Document;
use search::Search;

use crate::mesh::Attributes;
use crate::text::shown;
use crate::{Boundary, Emitter, Medium, MediumId, Scene, SceneError, SceneSource, Surface};

/// More warnings are not kept.
const MAX_WARNINGS: usize = 100;

/// What the user adds to a scene file.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Values of the scene's `$name` parameters, stronger than its `<default>`s. One that the scene does not use is
    /// an error.
    pub defines: Vec<(String, String)>,
    /// Which of the scene's sensors is the camera, counted from 0 in the order of the file. `None` is the first, with a warning if there are
    /// several.
    pub sensor: Option<usize>,
}

impl Scene {
    /// Loads a scene file from disk. Its includes are looked up beside the including file, beside the scene file, and in the folders of its
    /// `<path>` elements; its meshes in those folders, and beside the scene file.
    ///
    /// # Errors
    /// [`SceneError`] if a file cannot be read, or says what is wrong or not supported. So that a file from anywhere can be tried, only plain files
    /// are opened (no pipes, no devices), and there are limits: 64 MiB and a million elements of XML with all includes, 8 GiB of meshes, 2²⁸
    /// triangles, 2²⁸ pixels of pictures, 2³⁰ numbers of volumes, 32 levels of elements, 15 of includes, 16 attributes an element. Polygons that are not convex may take 2²⁸ steps in each mesh,
    /// about two seconds; more have to be cut into triangles beforehand.
    ///
    /// # Cost
    /// Linear in the size of the files, about 100 ns a byte of XML and 20 ns a byte of a mesh. Meshes are read in a stream; in memory a triangle
    /// takes 36 bytes, and 80 more while its mesh is read.
    pub fn load(path: &Path, options: &LoadOptions) -> Result<Self, SceneError> {
        Self::from_source(&SceneSource::disk(path), options)
    }

    /// Loads a scene from disk or from memory, with the errors and the cost of [`Scene::load`].
    pub fn from_source(source: &SceneSource, options: &LoadOptions) -> Result<Self, SceneError> {
        let mut parameters = Parameters::new(&options.defines)?;
        let Document { root, search, warnings } = reader::read(source, &mut parameters)?;
        parameters.check_all_used()?;
        features::check(&root, options.sensor.unwrap_or(0))?;
        let loader = Loader {
            source,
            search,
            ids: Ids::collect(&root)?,
            warnings: RefCell::default(),
            pictures: RefCell::default(),
            grids: RefCell::default(),
            mesh_bytes: 0,
            triangles: 0,
            copies: 0,
            attributes: None,
            media: Vec::new(),
            medium_of_element: HashMap::new(),
            surfaces: Vec::new(),
            boundaries: Vec::new(),
            boundary_elements: Vec::new(),
            emitters: Vec::new(),
            area_emitters: HashSet::new(),
        };
        for (at, message) in &warnings {
            loader.warn(at, message);
        }
        loader.scene(&root, options.sensor)
    }
}

/// The scene while it is being put together.
#[derive(Debug)]
struct Loader<'a> {
    source: &'a SceneSource,
    search: Search,
    ids: Ids<'a>,
    warnings: RefCell<Vec<String>>,
    pictures: RefCell<textures::Pictures>,
    grids: RefCell<volumes::Grids>,
    /// Bytes of meshes that were read so far.
    mesh_bytes: u64,
    /// Triangles of mesh files so far.
    triangles: usize,
    /// Shapes that instances have made so far.
    copies: usize,
    /// What the mesh carries whose BSDF is being read; `None` where a BSDF stands by itself.
    attributes: Option<Attributes>,
    media: Vec<Medium>,
    medium_of_element: HashMap<usize, MediumId>,
    surfaces: Vec<Surface>,
    boundaries: Vec<Boundary>,
    /// The shape of each boundary.
    boundary_elements: Vec<&'a Element>,
    emitters: Vec<Emitter>,
    /// The elements of the area emitters that a shape has.
    area_emitters: HashSet<usize>,
}

impl<'a> Loader<'a> {
    fn warn(&self, at: &Place, message: &str) {
        let mut warnings = self.warnings.borrow_mut();
        let text = shown(&format!("{at}: {message}"));
        // A BSDF is read again for each shape that refers to it.
        if warnings.contains(&text) {
            return;
        }
        match warnings.len().cmp(&MAX_WARNINGS) {
            Ordering::Less => warnings.push(text),
            Ordering::Equal => warnings.push("more warnings are not shown".to_owned()),
            Ordering::Greater => {}
        }
    }

    fn scene(mut self, root: &'a Element, chosen: Option<usize>) -> Result<Scene, SceneError> {
        let (mut sensors, mut integrator, mut constant) = (Vec::new(), None, None);
        for element in &root.children {
            match element.tag.as_str() {
                "shape" => shapes::read(&mut self, element)?,
                "medium" => drop(objects::medium(&mut self, element)?),
                // Read where they are used; here only checked, so that an unused one cannot hide a mistake.
                "bsdf" => drop(materials::bsdf(&self, element)?),
                "texture" => drop(textures::read(&self, element)?),
                "volume" => drop(volumes::read(&self, element)?),
                "phase" => drop(objects::phase(&self, element)?),
                "emitter" => {
                    let Some(emitter) = objects::emitter(&self, element)? else { continue };
                    if matches!(emitter, Emitter::Constant { .. } | Emitter::Envmap { .. }) {
                        only_one(&mut constant, element, "environment emitter")?;
                    }
                    self.emitters.push(emitter);
                }
                "sensor" => sensors.push(element),
                "integrator" => only_one(&mut integrator, element, "integrator")?,
                "alias" => {}
                "spectrum" if element.attribute("type").is_some() => {
                    plugins::spectrum(&self, element, spectra::Weighed::ByDaylight)?;
                }
                // Whoever refers to it reads it.
                "film" | "rfilter" if element.attribute("id").is_some() => {}
                "sampler" => {
                    self.warn(
                        &element.at,
                        "a <sampler> directly inside <scene> has no effect: it belongs inside <sensor>",
                    );
                }
                tag => {
                    let help = if OBJECT_TAGS.contains(&tag) {
                        "film and sampler belong inside <sensor>, rfilter inside <film>"
                    } else {
                        "a property belongs inside an object; supported here: integrator, sensor, shape, emitter, medium, phase, bsdf, texture, volume, default, include, alias"
                    };
                    return Err(element.at.error(format!("<{tag}> directly inside <scene>"), help));
                }
            }
        }
        if sensors.is_empty() {
            return Err(root.at.error("the scene has no sensor", "add <sensor type=\"perspective\">"));
        }
        let Some(&sensor) = sensors.get(chosen.unwrap_or(0)) else {
            let message = format!("the scene has no sensor {}", chosen.unwrap_or(0));
            return Err(root.at.error(message, format!("it has {}, counted from 0", sensors.len())));
        };
        if chosen.is_none() && sensors.len() > 1 {
            self.warn(&sensor.at, &format!("the scene has {} sensors: the first is used", sensors.len()));
        }
        let camera = camera::read(&mut self, sensor)?;
        let integrator = match integrator {
            Some(element) => integrator::read(&self, element)?,
            None => {
                self.warn(&root.at, "the scene has no integrator: rendered as volpath");
                integrator::default()
            }
        };
        let unused = root.children.iter().find(|e| {
            e.tag == "emitter"
                && e.attribute("type").is_some_and(|kind| kind.value == "area")
                && !self.area_emitters.contains(&e.serial)
        });
        if let Some(unused) = unused {
            self.warn(&unused.at, "no shape refers to this area emitter: it does not shine");
        }
        if self.emitters.is_empty() {
            self.warn(&root.at, "the scene has no emitter: the image will be black");
        }
        checks::media_are_consistent(
            &self,
            &camera.sensor,
            &camera.film,
            &sensor.at,
            constant.map(|e: &Element| &e.at),
        )?;
        Ok(Scene {
            surfaces: self.surfaces,
            boundaries: self.boundaries,
            media: self.media,
            emitters: self.emitters,
            sensor: camera.sensor,
            film: camera.film,
            integrator,
            sample_count: camera.sample_count,
            seed: camera.seed,
            warnings: self.warnings.into_inner(),
        })
    }
}

fn only_one<'a>(slot: &mut Option<&'a Element>, element: &'a Element, what: &str) -> Result<(), SceneError> {
    if let Some(first) = slot.replace(element) {
        let message = format!("a second {what}");
        return Err(element.at.error(message, format!("the first is at {}; only one is supported", first.at)));
    }
    Ok(())
}
