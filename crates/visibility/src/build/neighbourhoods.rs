//! The neighbourhoods of lights, as many as memory and time allow.

use rayon::prelude::*;
use vdf_distfield::{ExtendedNeighbourhood, HopNeighbourhood, SafeNeighbourhood, VoxelBox};
use vdf_geometry::Triangle;
use vdf_voxel::{Voxel, VoxelError, VoxelGrid, VoxelSet};

use super::{begin, next, report::Kept};
use crate::{
    AreaNeighbourhood, DistanceField, LightProver, LightShape, PointProver, Progress, VisibilityError,
    prover::{Occluders, Site, each_field},
};

/// Neighbourhoods are built as long as they visit no more voxels or rows than this; each takes a few nanoseconds. It is enough for 500 lights in a
/// grid of 128³ voxels with safe neighbourhoods, and for 60,000 with extended ones.
const MOST_VISITS: u64 = 1 << 30;

/// A voxel takes hops as long as so many visits.
const HOP_VISITS: u64 = 32;

pub(super) const TOO_LARGE: &str = "its neighbourhood does not fit into the limit of memory";
pub(super) const TOO_LONG: &str = "the neighbourhoods of so many lights would take too long";

/// What the hierarchy of an area light's near triangles takes at most, in bytes.
pub(super) const NEAR_BYTES: u64 = 32 << 10;

/// What is to be built for a light.
pub(super) enum Plan {
    /// The field answers, for a reason if a neighbourhood could be expected.
    Field(Option<&'static str>),
    /// A neighbourhood of a point light's voxel.
    Point(Voxel),
    /// A neighbourhood of an area light's box, with the triangles that are near.
    Area(VoxelBox, Vec<Triangle>),
}

/// Chooses and builds the prover of each light.
pub(super) struct LightBuilder<'a> {
    pub(super) point: PointProver,
    pub(super) grid: VoxelGrid,
    pub(super) occupied: &'a VoxelSet,
    pub(super) field: Option<&'a DistanceField>,
}

impl LightBuilder<'_> {
    /// Builds neighbourhoods for the lights that have nothing yet, in parallel over lights: how many bytes they take.
    pub(super) fn build_wanting(
        &self,
        triangles: &[Triangle],
        lights: &[LightShape<'_>],
        kept: &mut [Kept],
        free: u64,
        progress: &dyn Progress,
    ) -> Result<usize, VisibilityError> {
        let any_area = self.point != PointProver::Field && lights.iter().any(|l| matches!(l, LightShape::Area(_)));
        let occluders = Occluders::new(&self.grid, if any_area { triangles } else { &[] }, self.occupied)?;
        let mut wanting: Vec<_> = lights.iter().zip(kept).filter(|(_, kept)| kept.prover.is_none()).collect();
        let mut plans: Vec<_> = wanting.par_iter().map(|(light, _)| self.plan(&occluders, light)).collect();
        self.cut_to_budget(&mut plans, free);
        begin(progress, "neighbourhoods", plans.len() as u64)?;
        let build = |plan| {
            next(progress)?;
            Ok::<_, VisibilityError>(self.build(&occluders, plan)?)
        };
        let built: Vec<_> = plans.into_par_iter().map(build).collect::<Result<_, _>>()?;
        let mut bytes = 0;
        for ((_, kept), (prover, fallback)) in wanting.iter_mut().zip(built) {
            bytes += prover.bytes();
            kept.prover = Some(prover);
            // The first reason is the one that names the method's own structure.
            kept.fallback = kept.fallback.or(fallback);
        }
        Ok(bytes)
    }

    fn plan(&self, occluders: &Occluders<'_>, light: &LightShape<'_>) -> Plan {
        match light {
            _ if self.point == PointProver::Field => Plan::Field(None),
            LightShape::Infinite => Plan::Field(None),
            LightShape::Point(position) => self
                .grid
                .voxel_containing(*position)
                .map_or(Plan::Field(Some("it is outside the grid of voxels")), Plan::Point),
            LightShape::Area(light) => match occluders.site(light) {
                Site::Nowhere => Plan::Field(Some("it has no triangles")),
                Site::Crowded => Plan::Field(Some("too many triangles are near it")),
                Site::Found { light, near } => Plan::Area(light, near),
            },
        }
    }

    /// The first lights have what they want, as long as memory and time allow.
    pub(super) fn cut_to_budget(&self, plans: &mut [Plan], mut free: u64) {
        let mut visits = MOST_VISITS;
        for plan in plans {
            match (free.checked_sub(self.bytes(plan)), visits.checked_sub(self.visits(plan))) {
                (Some(rest), Some(left)) => (free, visits) = (rest, left),
                (None, _) => *plan = Plan::Field(Some(TOO_LARGE)),
                (_, None) => *plan = Plan::Field(Some(TOO_LONG)),
            }
        }
    }

    /// The voxels or rows that are visited to build what is planned.
    fn visits(&self, plan: &Plan) -> u64 {
        let r = self.grid.resolution();
        match (plan, self.point) {
            (Plan::Field(_), _) => 0,
            (Plan::Point(_), PointProver::Safe) => r.voxel_count() as u64,
            (_, PointProver::Hop) => HOP_VISITS.saturating_mul(r.voxel_count() as u64),
            _ => u64::from(r.y()) * u64::from(r.z()),
        }
    }

    /// The memory of what is planned, in bytes, at most.
    fn bytes(&self, plan: &Plan) -> u64 {
        let resolution = self.grid.resolution();
        let extended = ExtendedNeighbourhood::bytes_of(resolution);
        match (plan, self.point) {
            (Plan::Field(_), _) | (Plan::Point(_), PointProver::Field) => 0,
            (Plan::Point(_), PointProver::Safe) => VoxelSet::bytes_of(resolution),
            (Plan::Point(_), PointProver::Hop) => HopNeighbourhood::bytes_of(resolution),
            (Plan::Area(..), PointProver::Hop) => HopNeighbourhood::bytes_of(resolution).saturating_add(NEAR_BYTES),
            (Plan::Point(_), PointProver::Extended | PointProver::Buffer) => extended,
            (Plan::Area(..), _) => extended.saturating_add(NEAR_BYTES),
        }
    }

    fn build(&self, occluders: &Occluders<'_>, plan: Plan) -> Result<(LightProver, Option<&'static str>), VoxelError> {
        Ok(match plan {
            Plan::Field(fallback) => (LightProver::Field, fallback),
            Plan::Point(voxel) => (self.point_prover(voxel), None),
            Plan::Area(light, near) => {
                let hops = self.point == PointProver::Hop;
                (LightProver::Area(AreaNeighbourhood::build(occluders, light, &near, hops)?), None)
            }
        })
    }

    fn point_prover(&self, light: Voxel) -> LightProver {
        match (self.point, self.field) {
            (PointProver::Safe, Some(field)) => {
                LightProver::Safe(each_field!(field, field => SafeNeighbourhood::new(field, self.occupied, light)))
            }
            (PointProver::Hop, _) => LightProver::Hop(HopNeighbourhood::new(self.occupied, light.into())),
            (PointProver::Extended | PointProver::Buffer, _) => {
                LightProver::Extended(ExtendedNeighbourhood::new(self.occupied, light.into()))
            }
            (PointProver::Field, _) | (PointProver::Safe, None) => LightProver::Field,
        }
    }
}
