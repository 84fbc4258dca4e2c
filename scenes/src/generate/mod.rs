//! Scenes that are computed instead of stored: as large as one likes, and the same bytes on every platform.
//!
//! A volume is a function that writes its values in order, a mesh is a function that passes its triangles to a [`MeshSink`] as it makes them, so that writing it takes no more memory for ten million
//! triangles than for a hundred thousand. Numbers come from [`random`], which is exact on every platform.

mod court;
mod landscape;
mod mesh;
mod random;
mod shapes;
mod smoke;
#[cfg(test)]
mod tests;

use std::io::{self, Write};

use mesh::{MeshSink, ObjWriter, TriangleCounter};

use crate::ScenesError;

/// Passes the triangles of one mesh of a scene of about so many triangles.
type MeshFunction = fn(u32, &mut dyn MeshSink) -> io::Result<()>;

/// Writes a volume of about so many voxels.
type VolumeFunction = fn(u32, &mut dyn Write) -> io::Result<()>;

/// How large a scene is, and what is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Triangles of its meshes.
    Triangles(u32),
    /// Voxels of its volumes.
    Voxels(u32),
}

/// A kind of scene.
struct Recipe {
    name: &'static str,
    default_size: Size,
    /// Path and text of the scene file.
    scene: (&'static str, &'static str),
    /// Paths of the meshes and what is in them.
    meshes: &'static [(&'static str, MeshFunction)],
    /// Paths of the volumes and what is in them.
    volumes: &'static [(&'static str, VolumeFunction)],
}

static RECIPES: [&Recipe; 3] = [&court::RECIPE, &landscape::RECIPE, &smoke::RECIPE];

/// A generated scene of a certain size.
#[derive(Clone, Copy)]
pub struct GeneratedScene {
    recipe: &'static Recipe,
    size: Size,
}

/// One file of a generated scene.
#[derive(Clone, Copy)]
pub struct GeneratedFile {
    /// Path relative to the scene's folder, with `/` between its parts.
    pub path: &'static str,
    content: Content,
}

#[derive(Clone, Copy)]
enum Content {
    Text(&'static str),
    Mesh(MeshFunction, u32),
    Volume(VolumeFunction, u32),
}

/// The generated scene of that name, of its default size.
#[must_use]
pub fn generated(name: &str) -> Option<GeneratedScene> {
    let recipe = RECIPES.into_iter().find(|r| r.name == name)?;
    Some(GeneratedScene { recipe, size: recipe.default_size })
}

impl GeneratedScene {
    /// The fewest triangles that a generated scene can have.
    pub const MIN_TRIANGLES: u32 = 100_000;
    /// The most triangles that a generated scene can have.
    pub const MAX_TRIANGLES: u32 = 10_000_000;
    /// The fewest voxels that a generated volume can have.
    pub const MIN_VOXELS: u32 = 32_768;
    /// The most voxels that a generated volume can have.
    pub const MAX_VOXELS: u32 = 100_000_000;

    /// The scene with about so many triangles (within 0.5 %).
    ///
    /// # Errors
    /// If they are fewer than [`Self::MIN_TRIANGLES`] or more than [`Self::MAX_TRIANGLES`], or the scene is one of voxels.
    pub fn with_triangles(self, triangles: u32) -> Result<Self, ScenesError> {
        let (min, max) = (Self::MIN_TRIANGLES, Self::MAX_TRIANGLES);
        if !(min..=max).contains(&triangles) {
            return Err(ScenesError::Triangles { min, max, found: triangles });
        }
        match self.size {
            Size::Triangles(_) => Ok(Self { size: Size::Triangles(triangles), ..self }),
            Size::Voxels(_) => {
                Err(ScenesError::Measure { name: self.recipe.name, measure: "voxels", other: "triangles" })
            }
        }
    }

    /// The scene with about so many voxels: the largest cube that does not have more.
    ///
    /// # Errors
    /// If they are fewer than [`Self::MIN_VOXELS`] or more than [`Self::MAX_VOXELS`], or the scene is one of triangles.
    pub fn with_voxels(self, voxels: u32) -> Result<Self, ScenesError> {
        let (min, max) = (Self::MIN_VOXELS, Self::MAX_VOXELS);
        if !(min..=max).contains(&voxels) {
            return Err(ScenesError::Voxels { min, max, found: voxels });
        }
        match self.size {
            Size::Voxels(_) => Ok(Self { size: Size::Voxels(voxels), ..self }),
            Size::Triangles(_) => {
                Err(ScenesError::Measure { name: self.recipe.name, measure: "triangles", other: "voxels" })
            }
        }
    }

    /// About how large the scene is.
    #[must_use]
    pub const fn size(&self) -> Size {
        self.size
    }

    /// The files, the scene file first. Written to a folder under their paths they are the scene.
    pub fn files(&self) -> impl Iterator<Item = GeneratedFile> + use<> {
        let Self { recipe, size } = *self;
        let (Size::Triangles(size) | Size::Voxels(size)) = size;
        let (path, text) = recipe.scene;
        let meshes = recipe.meshes.iter().map(move |&(path, mesh)| (path, Content::Mesh(mesh, size)));
        let volumes = recipe.volumes.iter().map(move |&(path, volume)| (path, Content::Volume(volume, size)));
        std::iter::once((path, Content::Text(text)))
            .chain(meshes)
            .chain(volumes)
            .map(|(path, content)| GeneratedFile { path, content })
    }
}

impl GeneratedFile {
    /// Writes the content. Many small writes: `out` should be buffered. Memory does not grow with the size of the file.
    ///
    /// # Errors
    /// Only those of `out`.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        match self.content {
            Content::Text(text) => out.write_all(text.as_bytes()),
            Content::Mesh(mesh, triangles) => mesh(triangles, &mut ObjWriter::new(out)),
            Content::Volume(volume, voxels) => volume(voxels, out),
        }
    }
}

impl std::fmt::Debug for GeneratedScene {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GeneratedScene").field("name", &self.recipe.name).field("size", &self.size).finish()
    }
}

impl std::fmt::Debug for GeneratedFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GeneratedFile").field("path", &self.path).finish_non_exhaustive()
    }
}

/// How many triangles these meshes have in a scene of about `triangles`.
fn count(meshes: &[MeshFunction], triangles: u32) -> io::Result<u32> {
    let mut counter = TriangleCounter::default();
    for mesh in meshes {
        mesh(triangles, &mut counter)?;
    }
    Ok(counter.triangles)
}
