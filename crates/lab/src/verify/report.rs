//! The figures of a verification, in words and for machines.

use std::{fmt, ops::AddAssign};

use serde::Serialize;

use super::segments::SegmentClass;

/// What a verification found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VerifyReport {
    /// Version of this program.
    pub version: &'static str,
    /// Seed of the segments.
    pub seed: u64,
    /// Number of threads.
    pub threads: usize,
    /// Triangles that occlude.
    pub triangles: usize,
    /// The grids, in the order in which they were asked.
    pub grids: Vec<GridSummary>,
    /// Time to ask and to check, in seconds; without the builds.
    pub seconds: f64,
    /// For each class of segments.
    pub classes: Vec<ClassTally>,
    /// Over all classes.
    pub total: Tally,
    /// For each method.
    pub methods: Vec<MethodTally>,
    /// What was checked by which reference.
    pub checks: Checks,
    /// The first few failures, with all it takes to repeat them.
    pub failures: Vec<Failure>,
}

/// A grid that was asked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GridSummary {
    /// Side of a voxel in world units.
    pub voxel_size: f64,
    /// Voxels along x, y and z.
    pub grid: [u32; 3],
    /// Share of the voxels that are free.
    pub free_share: f64,
    /// Occupied voxels that no triangle touches, even dilated: conservative, but wasted.
    pub excess: usize,
}

/// Counts of segments and proofs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tally {
    /// Segments that every method was asked about.
    pub segments: u64,
    /// Those that at least one method proved something of.
    pub proved: u64,
    /// Proofs, each method counted.
    pub proofs: u64,
    /// Proofs that contradict a reference. Must be 0.
    pub wrong: u64,
}

impl Tally {
    /// The rule of three: if none of n independent proofs is wrong, the chance of a wrong one, among segments so
    /// distributed, is below 3/n with 95 % confidence. Here n is the number of proved segments, since proofs of one
    /// segment by several methods are not independent. `None` without proofs or with a wrong one.
    #[must_use]
    pub fn bound(&self) -> Option<f64> {
        rule_of_three(self.proved, self.wrong)
    }
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.segments += other.segments;
        self.proved += other.proved;
        self.proofs += other.proofs;
        self.wrong += other.wrong;
    }
}

/// The figures of a class.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClassTally {
    /// The class.
    pub class: SegmentClass,
    /// Its figures.
    #[serde(flatten)]
    pub tally: Tally,
    /// [`Tally::bound`].
    pub bound: Option<f64>,
}

/// The figures of a method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MethodTally {
    /// Name of the method.
    pub method: &'static str,
    /// Its proofs.
    pub proofs: u64,
    /// Those that contradict a reference. Must be 0.
    pub wrong: u64,
    /// 3/n for n proofs; see [`Tally::bound`].
    pub bound: Option<f64>,
}

impl MethodTally {
    pub(super) fn new(method: &'static str, proofs: u64, wrong: u64) -> Self {
        Self { method, proofs, wrong, bound: rule_of_three(proofs, wrong) }
    }
}

/// What was checked by which reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Checks {
    /// Proved segments that the hierarchy was asked about: all of them.
    pub proved_by_hierarchy: u64,
    /// Proved segments that a loop over all triangles was run on, too.
    pub proved_by_loop: u64,
    /// Segments, proved or not, that both references were asked about.
    pub compared: u64,
    /// Those on which they do not agree. Must be 0.
    pub disagreements: u64,
    /// Segments that the set of curved shapes was asked about, and a loop over them in exact arithmetic.
    pub curved: u64,
    /// Those on which these two do not agree. Must be 0.
    pub curved_disagreements: u64,
}

impl AddAssign for Checks {
    fn add_assign(&mut self, other: Self) {
        self.proved_by_hierarchy += other.proved_by_hierarchy;
        self.proved_by_loop += other.proved_by_loop;
        self.compared += other.compared;
        self.disagreements += other.disagreements;
        self.curved += other.curved;
        self.curved_disagreements += other.curved_disagreements;
    }
}

/// A wrong proof, or a disagreement of the references.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Failure {
    /// The methods whose proof is wrong; none if only the references disagree.
    pub methods: Vec<&'static str>,
    /// Side of a voxel in world units.
    pub voxel_size: f64,
    /// Class of the segment.
    pub class: SegmentClass,
    /// Number of the segment in its class and grid.
    pub index: u64,
    /// The emitter that the segment ends in, if it was asked about as a query towards one.
    pub emitter: Option<usize>,
    /// Start.
    pub from: [f64; 3],
    /// End.
    pub to: [f64; 3],
    /// Whether the hierarchy finds an occluder, if it was asked.
    pub occluded_by_hierarchy: Option<bool>,
    /// Whether the loop finds an occluder, if it was run.
    pub occluded_by_loop: Option<bool>,
    /// Whether a curved shape meets it, by any hit of their set, by its first hit and by a loop, if these were asked.
    pub meets_curved: Option<[bool; 3]>,
}

impl VerifyReport {
    /// Whether no proof is wrong and the references agree.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.total.wrong == 0 && self.checks.disagreements == 0 && self.checks.curved_disagreements == 0
    }
}

fn rule_of_three(n: u64, wrong: u64) -> Option<f64> {
    (n > 0 && wrong == 0).then(|| 3.0 / n as f64)
}

fn shown(bound: Option<f64>) -> String {
    bound.map_or_else(|| "–".to_owned(), |b| format!("{b:.1e}"))
}

fn line(f: &mut fmt::Formatter<'_>, name: &str, t: &Tally) -> fmt::Result {
    let bound = shown(t.bound());
    writeln!(f, "{name:12} {:>12} {:>12} {:>13} {:>7} {bound:>10}", t.segments, t.proved, t.proofs, t.wrong)
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let said = |occluded: Option<bool>| match occluded {
            Some(true) => "occluded",
            Some(false) => "unoccluded",
            None => "not asked",
        };
        let methods = if self.methods.is_empty() { "references disagree".to_owned() } else { self.methods.join(", ") };
        let [from, to] = [self.from, self.to];
        // `Debug` of a number is as short as possible but exact, and keeps the sign of zero.
        write!(f, "{methods}: voxel {:?}, {} {}", self.voxel_size, self.class.name(), self.index)?;
        if let Some(emitter) = self.emitter {
            write!(f, ", to emitter {emitter}")?;
        }
        // Its Euclidean length (3.4.1): what is a voxel long fails for other reasons than what is a thousand long.
        let [x, y, z] = [0, 1, 2].map(|axis| (to[axis] - from[axis]) / self.voxel_size);
        write!(f, ": from {from:?} to {to:?}, {:.3e} voxels long", x.hypot(y).hypot(z))?;
        write!(f, "; hierarchy: {}, loop: ", said(self.occluded_by_hierarchy))?;
        f.write_str(said(self.occluded_by_loop))?;
        match self.meets_curved {
            Some(met) => {
                let [any, first, by_loop] = met.map(|met| said(Some(met)));
                write!(f, "; by curved shapes: any hit {any}, first hit {first}, loop {by_loop}")
            }
            None => Ok(()),
        }
    }
}

impl fmt::Display for VerifyReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for g in &self.grids {
            let [x, y, z] = g.grid;
            writeln!(
                f,
                "voxel {}, grid {x} x {y} x {z}, {:.2} % free; all structures valid, {} voxels occupied in excess",
                g.voxel_size,
                100.0 * g.free_share,
                g.excess
            )?;
        }
        let per_second = self.total.segments as f64 / self.seconds;
        writeln!(
            f,
            "{} segments in {:.1} s, {per_second:.1e} a second; seed {}, {} threads, {} triangles\n",
            self.total.segments, self.seconds, self.seed, self.threads, self.triangles
        )?;
        writeln!(f, "class            segments       proved        proofs   wrong 95 % bound")?;
        for c in &self.classes {
            line(f, c.class.name(), &c.tally)?;
        }
        line(f, "total", &self.total)?;
        writeln!(f, "\nmethod                                     proofs   wrong 95 % bound")?;
        for m in &self.methods {
            writeln!(f, "{:38} {:>13} {:>7} {:>10}", m.method, m.proofs, m.wrong, shown(m.bound))?;
        }
        let c = self.checks;
        writeln!(
            f,
            "\nof {} proved segments the hierarchy checked {}, a loop over all triangles {}",
            self.total.proved, c.proved_by_hierarchy, c.proved_by_loop
        )?;
        write!(
            f,
            "the two were compared on {} segments, proved or not; they disagree on {}",
            c.compared, c.disagreements
        )?;
        if c.curved > 0 {
            write!(
                f,
                "\ncurved shapes were compared with exact arithmetic on {} segments; they disagree on {}",
                c.curved, c.curved_disagreements
            )?;
        }
        for failure in &self.failures {
            write!(f, "\nWRONG {failure}")?;
        }
        Ok(())
    }
}
