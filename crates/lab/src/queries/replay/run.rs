//! The passes of a replay, and the figures that follow from them.

use std::{array, collections::BTreeMap};

use rayon::prelude::*;
use vdf_geometry::Segment;
use vdf_render::{PrepareOptions, PreparedScene, Progress, default_voxel_size};
use vdf_visibility::{Method, Provers, QueryKind, ShadowQuery, Visibility};

use super::{
    ReplayOptions,
    figures::{ClassReplay, HierarchyReplay, MethodReplay, ProofReplay, Replay, TimerInfluence, Timing, WrongAnswer},
    passes::{Checked, batch_pass, check, empty_pass, look_up_shares, proof_pass, query_pass, timer_pass},
};
use crate::{
    LabError,
    progress::{Part, look},
    queries::QueryStream,
};

/// All classes, those first that most methods can prove.
const CLASSES: [QueryKind; 3] = [QueryKind::Spatial, QueryKind::OnLight, QueryKind::Superficial];

/// Queries that are asked together.
const BATCHES: [usize; 2] = [16, 256];

/// The queries of one class, in the order of the stream.
struct Class {
    kind: QueryKind,
    queries: Vec<ShadowQuery>,
    unoccluded: usize,
}

/// The queries of a stream by their class, and what the hierarchy answers.
pub(super) struct Replaying<'a> {
    stream: &'a QueryStream,
    prepared: &'a PreparedScene,
    progress: &'a dyn Progress,
    /// Those of which there are queries; the first can be proved.
    classes: Vec<Class>,
    /// For each query of the stream.
    truth: Vec<bool>,
}

/// A method that was built and checked, and its passes so far.
struct Candidate {
    method: Method,
    prepared: PreparedScene,
    checked: Checked,
    /// Nanoseconds a query of each class, for each pass: proofs alone, and whole queries.
    acc: [Vec<f64>; CLASSES.len()],
    effective: [Vec<f64>; CLASSES.len()],
    /// The same in batches of each size.
    batch: [[Vec<f64>; CLASSES.len()]; BATCHES.len()],
}

/// Passes that do not depend on a method.
#[derive(Default)]
struct Common {
    empty: Vec<f64>,
    /// Of the hierarchy, for each class.
    hierarchy: [Vec<f64>; CLASSES.len()],
    with_timer: Vec<f64>,
    timer_said: Vec<f64>,
}

impl<'a> Replaying<'a> {
    /// Asks the hierarchy once about all queries.
    pub(super) fn new(
        prepared: &'a PreparedScene,
        stream: &'a QueryStream,
        progress: &'a dyn Progress,
    ) -> Result<Self, LabError> {
        let bvh = &prepared.world().bvh;
        let truth: Vec<bool> = stream.queries.par_iter().map(|q| !bvh.occluded(&Segment::new(q.from, q.to))).collect();
        if let Some(index) = truth.iter().zip(&stream.unoccluded).position(|(a, b)| a != b) {
            return Err(wrong(Method::NONE, None, index, stream.queries[index], truth[index]));
        }
        let class = |kind| {
            let of_kind = || stream.queries.iter().zip(&truth).filter(move |(q, _)| q.kind == kind);
            let unoccluded = of_kind().filter(|(_, t)| **t).count();
            Class { kind, queries: of_kind().map(|(q, _)| *q).collect(), unoccluded }
        };
        let classes: Vec<Class> = CLASSES.map(class).into_iter().filter(|c| !c.queries.is_empty()).collect();
        Ok(Self { stream, prepared, progress, classes, truth })
    }

    pub(super) fn run(&self, options: &ReplayOptions) -> Result<Replay, LabError> {
        let sizes = match &options.voxel_sizes[..] {
            [] => vec![default_voxel_size(self.prepared.world().grid_bounds(options.grid))],
            sizes => sizes.to_vec(),
        };
        let mut methods: Vec<Method> = Vec::new();
        for &m in &options.methods {
            if m != Method::NONE && !methods.contains(&m) {
                methods.push(m);
            }
        }
        if !self.classes.iter().any(|c| methods.iter().any(|m| m.proves(c.kind))) {
            let help = "voxels prove only queries from a medium; record more, those of raymarch, or replay lb";
            return Err(LabError::NoQueries { kind: "provable", help });
        }
        self.progress.work_total(sizes.len() as u64 * (u64::from(options.passes) + 1) * methods.len() as u64);
        let mut common = Common::default();
        let mut rows = Vec::new();
        for &size in &sizes {
            let mut of_size = BTreeMap::new();
            for group in by_field(&methods) {
                for (place, row) in self.group(&group, size, options, &mut common)? {
                    of_size.insert(place, row);
                }
            }
            rows.extend(of_size.into_values());
        }
        Ok(self.report(&common, rows, options.passes))
    }

    /// Builds methods of one kind of field, lets them and the hierarchy take turns, and drops them.
    fn group(
        &self,
        group: &[(usize, Method)],
        size: f64,
        options: &ReplayOptions,
        common: &mut Common,
    ) -> Result<Vec<(usize, MethodReplay)>, LabError> {
        self.progress.phase("checking");
        let mut candidates = Vec::new();
        for &(_, method) in group {
            candidates.push(self.candidate(method, size, options)?);
            self.progress.work_done(1);
        }
        self.progress.phase("replaying");
        let before: [usize; CLASSES.len()] = array::from_fn(|c| common.hierarchy[c].len());
        for pass in 0..options.passes {
            self.common_passes(common, options.passes)?;
            self.method_passes(&mut candidates, pass % 2 == 1)?;
        }
        let here = array::from_fn(|c| Timing::of(&common.hierarchy[c][before[c]..]));
        let rows = group.iter().zip(&candidates).map(|(&(place, _), c)| (place, self.summary(c, size, &here)));
        Ok(rows.collect())
    }

    /// Builds a method and compares each of its answers with the hierarchy's.
    fn candidate(&self, method: Method, size: f64, options: &ReplayOptions) -> Result<Candidate, LabError> {
        look(self.progress)?;
        let options = PrepareOptions {
            method: Some(method),
            voxel_size: Some(size),
            grid: options.grid,
            max_voxels: options.max_voxels,
            threads: options.threads,
            ..PrepareOptions::default()
        };
        let prepared = self.prepared.with_options(&options, &Part(self.progress))?;
        let checked = check(&prepared.visibility(), &self.stream.queries, &self.truth)
            .map_err(|index| wrong(method, Some(size), index, self.stream.queries[index], !self.truth[index]))?;
        Ok(Candidate {
            method,
            prepared,
            checked,
            acc: array::from_fn(|_| vec![]),
            effective: array::from_fn(|_| vec![]),
            batch: array::from_fn(|_| array::from_fn(|_| vec![])),
        })
    }

    /// The classes that a method can prove; those before come first.
    fn provable(&self, method: Method) -> impl Iterator<Item = (usize, &Class)> {
        self.classes.iter().enumerate().filter(move |(_, class)| method.proves(class.kind))
    }

    fn common_passes(&self, common: &mut Common, passes: u32) -> Result<(), LabError> {
        let none = Provers::none();
        let hierarchy = Visibility::new(&self.prepared.world().bvh, &none);
        for (class, times) in self.classes.iter().zip(&mut common.hierarchy) {
            look(self.progress)?;
            times.push(class.per_query(Method::NONE, query_pass(&hierarchy, &class.queries))?);
        }
        // Nothing is compared with these, so they need not alternate with every group.
        if let Some(first) = self.classes.first().filter(|_| common.empty.len() < passes as usize) {
            common.empty.push(empty_pass(&first.queries));
            let (pass, said) = timer_pass(&hierarchy, &first.queries);
            common.with_timer.push(first.per_query(Method::NONE, pass)?);
            common.timer_said.push(1e9 * said / first.queries.len() as f64);
        }
        Ok(())
    }

    fn method_passes(&self, candidates: &mut [Candidate], backwards: bool) -> Result<(), LabError> {
        let turn = |c: &mut Candidate| {
            let Candidate { method, prepared, checked, acc, effective, batch } = c;
            for (i, class) in self.provable(*method) {
                look(self.progress)?;
                let (seconds, proved) = proof_pass(prepared.provers(), &class.queries);
                agrees(*method, proved, checked.proved(class.kind))?;
                acc[i].push(1e9 * seconds / class.queries.len() as f64);
                let pass = query_pass(&prepared.visibility(), &class.queries);
                effective[i].push(class.per_query(*method, pass)?);
                for (size, times) in BATCHES.into_iter().zip(&mut *batch) {
                    let pass = batch_pass(&prepared.visibility(), &class.queries, size);
                    times[i].push(class.per_query(*method, pass)?);
                }
            }
            self.progress.work_done(1);
            Ok(())
        };
        if backwards {
            candidates.iter_mut().rev().try_for_each(turn)
        } else {
            candidates.iter_mut().try_for_each(turn)
        }
    }

    /// `hierarchy` are the passes that alternated with those of the method, for each class.
    fn summary(&self, c: &Candidate, size: f64, hierarchy: &[Timing; CLASSES.len()]) -> MethodReplay {
        let build = c.prepared.build_report();
        let t_build = build.seconds();
        let proofs: Vec<_> = self
            .provable(c.method)
            .map(|(i, class)| {
                let (t_acc, t_effective, t_hierarchy) =
                    (Timing::of(&c.acc[i]), Timing::of(&c.effective[i]), hierarchy[i]);
                let proved = c.checked.proved(class.kind);
                let p = proved as f64 / class.queries.len() as f64;
                let gain = t_hierarchy.median - t_effective.median;
                ProofReplay {
                    kind: class.kind,
                    proved,
                    p_accelerated: p,
                    unknown_fraction: 1.0 - p,
                    t_acc,
                    t_effective,
                    t_batch: Timing::of(&c.batch[1][i]),
                    t_batch_16: Timing::of(&c.batch[0][i]),
                    look_ups: look_up_shares(c.prepared.provers(), &class.queries),
                    t_acc_derived: t_effective.median - (1.0 - p) * t_hierarchy.median,
                    t_hierarchy,
                    speed_up: t_hierarchy.median / t_effective.median,
                    threshold: t_acc.median / t_hierarchy.median,
                    pays_from: (gain > 0.0).then(|| 1e9 * t_build / gain),
                }
            })
            .collect();
        let alone = self.mixed(|i| hierarchy[i].median);
        let with = self.mixed(|i| proofs.get(i).map_or(hierarchy[i].median, |p| p.t_effective.median));
        let in_batches = self.mixed(|i| proofs.get(i).map_or(hierarchy[i].median, |p| p.t_batch.median));
        MethodReplay {
            method: c.method.name(),
            voxel_size: size,
            grid: build.resolution.unwrap_or_default(),
            bytes: build.bytes(),
            t_build,
            proofs,
            speed_up_all: alone / with,
            speed_up_batches: alone / in_batches,
        }
    }

    /// The mean over all queries of the stream of the time that each class takes.
    fn mixed(&self, time: impl Fn(usize) -> f64) -> f64 {
        let weighted = |(i, class): (usize, &Class)| class.queries.len() as f64 * time(i);
        self.classes.iter().enumerate().map(weighted).sum::<f64>() / self.stream.queries.len() as f64
    }

    fn report(&self, common: &Common, methods: Vec<MethodReplay>, passes: u32) -> Replay {
        let times: Vec<Timing> = common.hierarchy.iter().map(|times| Timing::of(times)).collect();
        let classes = self.classes.iter().zip(&times).map(|(class, &time)| ClassReplay {
            kind: class.kind,
            queries: class.queries.len(),
            unoccluded: class.unoccluded,
            time,
        });
        let queries = self.stream.queries.len();
        Replay {
            queries,
            p_spatial: self.stream.spatial() as f64 / queries as f64,
            estimated_total: self.stream.estimated_total(),
            triangles: self.prepared.world().triangles.len(),
            passes,
            t_loop: Timing::of(&common.empty),
            hierarchy: HierarchyReplay { classes: classes.collect(), t_query: self.mixed(|i| times[i].median) },
            timer: TimerInfluence { time: Timing::of(&common.with_timer), said: Timing::of(&common.timer_said) },
            methods,
        }
    }
}

impl Class {
    /// Nanoseconds a query, if the pass found as many unoccluded as there are.
    fn per_query(&self, method: Method, (seconds, unoccluded): (f64, usize)) -> Result<f64, LabError> {
        agrees(method, unoccluded, self.unoccluded)?;
        Ok(1e9 * seconds / self.queries.len() as f64)
    }
}

/// The methods with their places in the list, grouped by the kind of their field: the structures of one group exist at
/// a time.
fn by_field(methods: &[Method]) -> Vec<Vec<(usize, Method)>> {
    let mut groups: Vec<Vec<(usize, Method)>> = Vec::new();
    for (place, &method) in methods.iter().enumerate() {
        match groups.iter_mut().find(|group| group.iter().any(|(_, m)| m.field() == method.field())) {
            Some(group) => group.push((place, method)),
            None => groups.push(vec![(place, method)]),
        }
    }
    groups
}

/// The pass that is timed must answer as the one that was checked.
fn agrees(method: Method, found: usize, expected: usize) -> Result<(), LabError> {
    if found == expected {
        return Ok(());
    }
    Err(LabError::UnstableAnswers { method: method.name(), found, expected })
}

fn wrong(method: Method, voxel_size: Option<f64>, index: usize, query: ShadowQuery, unoccluded: bool) -> LabError {
    LabError::WrongAnswer(Box::new(WrongAnswer { method: method.name(), voxel_size, index, query, unoccluded }))
}

#[cfg(test)]
mod tests {
    use vdf_visibility::FieldKind;

    use super::*;

    #[test]
    fn methods_are_grouped_by_field() {
        let methods: Vec<Method> =
            ["amr-xsn", "ndf", "amr", "dual", "ndf-sn"].iter().map(|m| m.parse().unwrap()).collect();
        let groups = by_field(&methods);
        let places: Vec<Vec<usize>> = groups.iter().map(|g| g.iter().map(|m| m.0).collect()).collect();
        assert_eq!(places, [vec![0, 2], vec![1, 4], vec![3]]);
        assert_eq!(groups[0][1].1.field(), Some(FieldKind::Amr));
        let all: Vec<Method> = Method::proving().collect();
        assert_eq!(by_field(&all).len(), 5, "those without a field, too");
    }
}
