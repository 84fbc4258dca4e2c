//! All provers of one scene: a prover for each light, and the field that they share.

use glam::DVec3;
use pulp::Arch;
use vdf_distfield::Neighbourhood;
use vdf_voxel::{VoxelGrid, VoxelSet};

use super::{Answer, DistanceField, FieldProver, LightProver};
use crate::{QueryKind, ShadowQuery, VisibilityError};

/// What neighbourhoods of a point light at `to`, in the grid, say of a segment: the first of one that begins in the grid. One that comes from
/// outside is clipped to the grid: along each axis its part inside lies between the voxel where it enters, which is found by rounding outwards, and
/// the light's own. So it lies in the cuboid of the two, and outside of the grid there is nothing to be met; but no end of it need be in
/// the voxel where it enters, so `cuboids` has to be of free cuboids.
#[inline]
fn by_neighbourhood(
    grid: &VoxelGrid,
    neighbourhood: &impl Neighbourhood,
    cuboids: &impl Neighbourhood,
    from: DVec3,
    to: DVec3,
) -> Answer {
    if let Some(voxel) = grid.voxel_containing(from) {
        return Answer::unoccluded_if(neighbourhood.proves(voxel));
    }
    Answer::unoccluded_if(grid.entry_voxel(from, to).is_some_and(|entry| cuboids.proves(entry)))
}

/// So many queries are answered one by one where a batch mixes lights.
const FEW: usize = 32;

/// What a method built for a scene.
#[derive(Debug)]
pub struct Provers {
    grid: Option<VoxelGrid>,
    field: Option<FieldProver>,
    lights: Vec<LightProver>,
}

impl Provers {
    /// The provers of the method `none`: they prove nothing.
    #[must_use]
    pub const fn none() -> Self {
        Self { grid: None, field: None, lights: Vec::new() }
    }

    pub(crate) const fn new(grid: Option<VoxelGrid>, field: Option<FieldProver>, lights: Vec<LightProver>) -> Self {
        Self { grid, field, lights }
    }

    /// The field, if there is one.
    #[must_use]
    pub const fn field(&self) -> Option<&FieldProver> {
        self.field.as_ref()
    }

    /// The grid of the voxels, if there are any.
    #[must_use]
    pub const fn grid(&self) -> Option<&VoxelGrid> {
        self.grid.as_ref()
    }

    /// The prover of light `emitter`, a number in the list that they were built for.
    #[must_use]
    pub fn light(&self, emitter: usize) -> Option<&LightProver> {
        self.lights.get(emitter)
    }

    /// What is known of the query's closed segment. Never wrong; about a superficial query only light buffers know anything.
    #[inline]
    #[must_use]
    pub fn answer(&self, query: &ShadowQuery) -> Answer {
        if let Some(LightProver::Buffer(buffer)) = self.lights.get(query.emitter)
            && query.to == buffer.position()
        {
            // The same answer either way.
            return match query.kind {
                QueryKind::Spatial => buffer.answer_in_space(query.from),
                _ => buffer.answer(query.from),
            };
        }
        self.answer_by_field(query)
    }

    /// The same where there is no light buffer.
    #[inline(never)]
    fn answer_by_field(&self, query: &ShadowQuery) -> Answer {
        match query.kind {
            QueryKind::Spatial => self.answer_spatial(query.emitter, query.from, query.to),
            QueryKind::OnLight => self.answer_on_light(query.emitter, query.from, query.to),
            QueryKind::Superficial => Answer::Unknown,
        }
    }

    /// The answers to all of `queries`, each as [`Provers::answer`] gives it; `answers` must be as long. Cheaper where many one after the other are
    /// about one light with a light buffer: asked one by one, each waits for its own texel.
    #[inline]
    pub fn answer_all(&self, queries: &[ShadowQuery], answers: &mut [Answer]) {
        let arch = Arch::new();
        let mut done = 0;
        while let Some(first) = queries.get(done) {
            if let Some(LightProver::Buffer(buffer)) = self.lights.get(first.emitter) {
                done += buffer.answer_run(arch, first.emitter, &queries[done..], &mut answers[done..]);
            }
            // A few one by one, then there may be a run again.
            let end = (done + FEW).min(queries.len());
            for (query, answer) in queries[done..end].iter().zip(&mut answers[done..end]) {
                *answer = self.answer(query);
            }
            done = end;
        }
    }

    /// What is known of the closed segment between any two points.
    #[inline]
    #[must_use]
    pub fn answer_between(&self, a: DVec3, b: DVec3) -> Answer {
        self.field.as_ref().map_or(Answer::Unknown, |field| field.answer(a, b))
    }

    #[inline]
    fn answer_spatial(&self, emitter: usize, from: DVec3, to: DVec3) -> Answer {
        let (Some(grid), Some(light)) = (&self.grid, self.lights.get(emitter)) else { return Answer::Unknown };
        match light {
            LightProver::Safe(n) => by_neighbourhood(grid, n, n, from, to),
            LightProver::Extended(n) => by_neighbourhood(grid, n, n, from, to),
            LightProver::Hop(n) => by_neighbourhood(grid, n, n.cuboids(), from, to),
            LightProver::Field | LightProver::Area(_) | LightProver::Buffer(_) => self.answer_between(from, to),
        }
    }

    #[inline]
    fn answer_on_light(&self, emitter: usize, from: DVec3, to: DVec3) -> Answer {
        match (&self.grid, self.lights.get(emitter)) {
            (Some(grid), Some(LightProver::Area(area))) => Answer::unoccluded_if(area.proves(grid, from, to)),
            _ => Answer::Unknown,
        }
    }

    /// Checks the field and the neighbourhoods of point lights against the occupied voxels that they were built from. The neighbourhoods
    /// of area lights, built from fewer occluders, and light buffers, built from triangles, are not looked at.
    ///
    /// # Errors
    /// The first value that is wrong.
    pub fn validate(&self, occupied: &VoxelSet) -> Result<(), VisibilityError> {
        self.field().map(FieldProver::field).map_or(Ok(()), |f: &DistanceField| f.validate(occupied))?;
        for light in &self.lights {
            match light {
                LightProver::Safe(n) => n.validate(occupied)?,
                LightProver::Extended(n) => n.validate(occupied)?,
                LightProver::Hop(n) => n.validate(occupied)?,
                LightProver::Field | LightProver::Area(_) | LightProver::Buffer(_) => {}
            }
        }
        Ok(())
    }
}
