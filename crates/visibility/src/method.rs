//! The methods: which field is built, and what answers queries towards a light. The one table that all lists of methods come from.

use std::{fmt, str::FromStr};

use crate::{LightShape, QueryKind};

/// A distance field with safe zones; the definitions are those of \[Houska2013\].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldKind {
    /// One chessboard distance a voxel (Def. 8).
    Ndf,
    /// Anisotropic macro-regions: a chessboard distance for each octant (Def. 9, 10).
    Amr,
    /// Directed safe zones: a Manhattan distance for each face (Def. 11, 12).
    Dsz,
    /// Dual extents: one Manhattan distance, and six extents (Def. 13, corrected).
    Dual,
}

/// What answers queries to a point light; all other queries ask the field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointProver {
    /// The field, or nothing if there is none.
    Field,
    /// `-sn`: the answers of the field, kept for each light (Def. 14).
    Safe,
    /// `-xsn`: all that free cuboids prove (4.4.1).
    Extended,
    /// `-hop`: all that free cubes one after the other prove.
    Hop,
    /// `lb`: a light buffer; where there can be none, all that free cuboids prove.
    Buffer,
}

/// A row of the table.
struct Recipe {
    name: &'static str,
    field: Option<FieldKind>,
    point: PointProver,
    /// What is stored, in the words of the README.
    stores: &'static str,
    /// What a query costs, in the words of the README.
    query: &'static str,
}

const fn recipe(
    name: &'static str,
    field: FieldKind,
    point: PointProver,
    stores: &'static str,
    query: &'static str,
) -> Recipe {
    Recipe { name, field: Some(field), point, stores, query }
}

/// All methods, the plainest first. A new one is a row here, and where it needs a new prover a file in `prover/`.
static RECIPES: [Recipe; 17] = {
    use FieldKind::{Amr, Dsz, Dual, Ndf};
    use PointProver::{Buffer, Extended, Field, Hop, Safe};
    const SAFE: &str = "as above, and 1 bit a voxel for each point light: its safe neighbourhood";
    const EXTENDED: &str = "as above, but 8 bytes a row of voxels for each point light: all free cuboids";
    // Over any field they prove the same; these two are the smallest and the one that proves the most elsewhere.
    const HOP: &str =
        "as above, and 1 bit a voxel for each point light: all that hops from one free cube to the next reach";
    [
        Recipe { name: "none", field: None, point: Field, stores: "nothing", query: "the hierarchy" },
        recipe("ndf", Ndf, Field, "1 byte a voxel: chessboard distance to the nearest occupied voxel", "two loads"),
        recipe("ndf-sn", Ndf, Safe, SAFE, "one bit"),
        recipe("ndf-xsn", Ndf, Extended, EXTENDED, "one row"),
        recipe("ndf-hop", Ndf, Hop, HOP, "one bit"),
        recipe("amr", Amr, Field, "8 bytes a voxel: the distance in each octant", "two loads"),
        recipe("amr-sn", Amr, Safe, SAFE, "one bit"),
        recipe("amr-xsn", Amr, Extended, EXTENDED, "one row"),
        recipe("amr-hop", Amr, Hop, HOP, "one bit"),
        recipe(
            "dsz",
            Dsz,
            Field,
            "6 bytes a voxel: Manhattan distances beyond each face",
            "up to eight loads, the face by the ray",
        ),
        recipe("dsz-sn", Dsz, Safe, SAFE, "one bit"),
        recipe("dsz-xsn", Dsz, Extended, EXTENDED, "one row"),
        recipe("dual", Dual, Field, "7 bytes a voxel: one Manhattan distance and six extents", "up to eight loads"),
        recipe("dual-sn", Dual, Safe, SAFE, "one bit"),
        recipe("dual-xsn", Dual, Extended, EXTENDED, "one row"),
        Recipe {
            name: "xsn",
            field: None,
            point: Extended,
            stores: "only the 8 bytes a row of voxels for each light: all free cuboids",
            query: "one row",
        },
        Recipe {
            name: "lb",
            field: None,
            point: Buffer,
            stores: "a cube map around each point light: 8 bytes a texel, and the triangles that decide where depths do not",
            query: "one texel, or a short list",
        },
    ]
};

/// How visibility queries are accelerated: a row of the table of methods. All methods give the same image.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Method(u8);

impl Method {
    /// Every query goes to the hierarchy.
    pub const NONE: Self = Self(0);

    /// `lb`, which answers nearly everything.
    const STANDARD: Self = Self(16);

    /// `xsn`, which proves of queries towards lights all that free cuboids do, and is built in a moment.
    pub const NEIGHBOURHOODS: Self = Self(15);

    /// All methods, the plainest first.
    pub fn all() -> impl DoubleEndedIterator<Item = Self> + Clone {
        (0..RECIPES.len() as u8).map(Self)
    }

    /// All methods that prove something, the plainest first.
    pub fn proving() -> impl DoubleEndedIterator<Item = Self> + Clone {
        Self::all().filter(|&m| m != Self::NONE)
    }

    /// The methods that prove from voxels: those of the thesis, and hops.
    pub fn with_voxels() -> impl DoubleEndedIterator<Item = Self> + Clone {
        Self::all().filter(|m| m.field().is_some())
    }

    /// `amr-xsn`, which proves the most of those whose neighbourhoods are built in a moment.
    #[must_use]
    pub fn best_with_voxels() -> Self {
        Self::of(FieldKind::Amr, PointProver::Extended)
    }

    /// The method with this field and this prover for point lights; [`Self::NONE`] if there is none.
    #[must_use]
    pub fn of(field: FieldKind, point: PointProver) -> Self {
        Self::all().find(|m| (m.field(), m.point_prover()) == (Some(field), point)).unwrap_or(Self::NONE)
    }

    fn recipe(self) -> &'static Recipe {
        &RECIPES[usize::from(self.0)]
    }

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.recipe().name
    }

    /// The distance field that is built.
    #[must_use]
    pub fn field(self) -> Option<FieldKind> {
        self.recipe().field
    }

    /// What answers queries to a point light.
    #[must_use]
    pub fn point_prover(self) -> PointProver {
        self.recipe().point
    }

    /// Whether it ever proves queries of this kind.
    #[must_use]
    pub fn proves(self, kind: QueryKind) -> bool {
        self != Self::NONE && (kind != QueryKind::Superficial || self.point_prover() == PointProver::Buffer)
    }

    /// The method for a scene with such emitters and so many occluding triangles where none is asked for. A scene without a light that a
    /// buffer or a neighbourhood can be kept for gets [`Self::NONE`]: towards an infinite emitter there is only the field, which takes
    /// longer than it saves wherever it was measured (`docs/performance.md`). Light buffers of large meshes or of many lights take seconds to
    /// build and do not fit the caches, so beyond 10,000 triangles or 256 lights it is [`Self::best_with_voxels`], else [`Self::default`].
    #[must_use]
    pub fn for_scene(lights: &[LightShape<'_>], triangles: usize) -> Self {
        let placed = lights.iter().filter(|light| !matches!(light, LightShape::Infinite)).count();
        match placed {
            0 => Self::NONE,
            _ if triangles > MANY_TRIANGLES || placed > MANY_LIGHTS => Self::best_with_voxels(),
            _ => Self::default(),
        }
    }
}

/// Light buffers of so many triangles are built in some hundredths of a second.
const MANY_TRIANGLES: usize = 10_000;

/// A light buffer of a few triangles takes some thousandths of a second, a neighbourhood a tenth of that.
const MANY_LIGHTS: usize = 256;

/// The table of methods in Markdown, as the README has it: name, what is stored, what a query costs.
#[must_use]
pub fn method_table() -> String {
    let rows = RECIPES.iter().map(|r| format!("| `{}` | {} | {} |\n", r.name, r.stores, r.query));
    let head = "| method | what it stores | a query |\n| --- | --- | --- |\n";
    std::iter::once(head.to_owned()).chain(rows).collect()
}

impl Default for Method {
    /// `lb`.
    fn default() -> Self {
        Self::STANDARD
    }
}

impl fmt::Debug for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Method({})", self.name())
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that is none of the methods'.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown method; the methods are {}", names())]
pub struct UnknownMethod;

fn names() -> String {
    Method::all().map(Method::name).collect::<Vec<_>>().join(", ")
}

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        Self::all().find(|m| m.name() == name).ok_or(UnknownMethod)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for m in Method::all() {
            assert_eq!(m.to_string().parse(), Ok(m));
            assert_eq!(Method::all().filter(|other| other.name() == m.name()).count(), 1);
            assert!(UnknownMethod.to_string().contains(m.name()));
            assert!(method_table().contains(&format!("| `{}` |", m.name())));
            if let Some(field) = m.field() {
                assert_eq!(Method::of(field, m.point_prover()), m);
            }
        }
        assert_eq!("AMR".parse::<Method>(), Err(UnknownMethod));
        assert_eq!((Method::default().name(), Method::NONE.name()), ("lb", "none"));
        assert_eq!(Method::best_with_voxels().name(), "amr-xsn");
        assert_eq!(Method::NEIGHBOURHOODS.name(), "xsn");
    }

    #[test]
    fn a_scene_with_a_light_somewhere_has_a_method() {
        let (point, sky) = (LightShape::Point(glam::DVec3::ZERO), LightShape::Infinite);
        assert_eq!(Method::for_scene(&[sky, point], 30), Method::default());
        assert_eq!(Method::for_scene(&[LightShape::Area(&[])], MANY_TRIANGLES), Method::default());
        assert_eq!(Method::for_scene(&[point], MANY_TRIANGLES + 1), Method::best_with_voxels());
        assert_eq!(Method::for_scene(&[point; MANY_LIGHTS], 30), Method::default());
        assert_eq!(Method::for_scene(&[point; MANY_LIGHTS + 1], 30), Method::best_with_voxels());
        for none in [&[][..], &[sky]] {
            assert_eq!(Method::for_scene(none, 30), Method::NONE);
        }
    }
}
