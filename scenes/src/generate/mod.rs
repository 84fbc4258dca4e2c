//! Scenes that are computed instead of stored: as large as one likes, and the same bytes on every platform.
//!
//! A mesh is a function that passes its triangles to a [`MeshSink`] as it makes them, so that writing it takes no more memory for ten million
//! triangles than for a hundred thousand. Numbers come from [`random`], which is exact on every platform.

mod court;
mod landscape;
mod mesh;
mod random;
mod shapes;
#[cfg(test)]
mod tests;

use std::io::{self, Write};

use mesh::{MeshSink, ObjWriter, TriangleCounter};

use crate::ScenesError;

/// Passes the triangles of one mesh of a scene of about so many triangles.
type MeshFunction = fn(u32, &mut dyn MeshSink) -> io::Result<()>;

/// A kind of scene.
struct Recipe {
    name: &'static str,
    default_triangles: u32,
    /// Path and text of the scene file.
    scene: (&'static str, &'static str),
    /// Paths of the meshes and what is in them.
    meshes: &'static [(&'static str, MeshFunction)],
}

static RECIPES: [&Recipe; 2] = [&court::RECIPE, &landscape::RECIPE];

/// A generated scene of a certain size.
#[derive(Clone, Copy)]
pub struct GeneratedScene {
    recipe: &'static Recipe,
    triangles: u32,
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
}

/// The generated scene of that name, of its default size.
#[must_use]
pub fn generated(name: &str) -> Option<GeneratedScene> {
    let recipe = RECIPES.into_iter().find(|r| r.name == name)?;
    Some(GeneratedScene { recipe, triangles: recipe.default_triangles })
}

impl GeneratedScene {
    /// The fewest triangles that a generated scene can have.
    pub const MIN_TRIANGLES: u32 = 100_000;
    /// The most triangles that a generated scene can have.
    pub const MAX_TRIANGLES: u32 = 10_000_000;

    /// The scene with about so many triangles (within 0.5 %).
    ///
    /// # Errors
    /// If they are fewer than [`Self::MIN_TRIANGLES`] or more than [`Self::MAX_TRIANGLES`].
    pub fn with_triangles(self, triangles: u32) -> Result<Self, ScenesError> {
        let (min, max) = (Self::MIN_TRIANGLES, Self::MAX_TRIANGLES);
        if !(min..=max).contains(&triangles) {
            return Err(ScenesError::Triangles { min, max, found: triangles });
        }
        Ok(Self { triangles, ..self })
    }

    /// About how many triangles the scene has.
    #[must_use]
    pub const fn triangles(&self) -> u32 {
        self.triangles
    }

    /// The files, the scene file first. Written to a folder under their paths they are the scene.
    pub fn files(&self) -> impl Iterator<Item = GeneratedFile> + use<> {
        let Self { recipe, triangles } = *self;
        let (path, text) = recipe.scene;
        let meshes = recipe.meshes.iter();
        std::iter::once(GeneratedFile { path, content: Content::Text(text) })
            .chain(meshes.map(move |&(path, mesh)| GeneratedFile { path, content: Content::Mesh(mesh, triangles) }))
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
        }
    }
}

impl std::fmt::Debug for GeneratedScene {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GeneratedScene").field("name", &self.recipe.name).field("triangles", &self.triangles).finish()
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
