//! The decision: measured and expected times go in, a choice and its reason come out. Nothing here looks at a clock or at a scene.

use serde::Serialize;

/// A method that costs no more than this share of what is predicted without it is built and measured, whatever is expected of it.
const CHEAP: f64 = 0.01;

/// A build may cost this share of what its method is expected to save: all of it is lost where the expectation was wrong.
const STAKE: f64 = 0.5;

/// A method has to promise to save this share of a path to be taken instead of none. What a pilot measures is off by more, but to either side, and its build is paid.
const LEAST_GAIN: f64 = 0.005;

/// The queries of one class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct QueryCost {
    /// Queries a path.
    pub per_path: f64,
    /// Seconds that the hierarchy takes for one.
    pub seconds: f64,
}

impl QueryCost {
    /// Seconds a path that are saved if all of these queries take `seconds` each.
    #[must_use]
    pub fn saved_at(&self, seconds: f64) -> f64 {
        self.per_path * (self.seconds - seconds).max(0.0)
    }
}

/// What is to be rendered, as far as a pilot knows it without a method. Seconds are those of processors, of all threads together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plain {
    /// Paths to be rendered.
    pub(crate) paths: f64,
    /// Seconds a path.
    pub(crate) per_path: f64,
    /// The most that all paths may take.
    pub(crate) limit: f64,
}

impl Plain {
    /// Seconds that all paths take.
    pub(crate) fn seconds(&self) -> f64 {
        (self.paths * self.per_path).min(self.limit)
    }

    /// Paths there is time for.
    fn paths_rendered(&self) -> f64 {
        self.paths.min(self.limit / self.per_path)
    }

    /// Whether a build is nearly free.
    pub(crate) fn is_cheap(&self, build: f64) -> bool {
        build <= CHEAP * self.seconds()
    }

    /// Whether to build a method, to measure it: if it is nearly free, or if what it is expected to save, `saves` seconds a path, is clearly
    /// more than `build` seconds. Does without it if a render is so short that nothing pays.
    pub(crate) fn is_worth_trying(&self, build: f64, saves: f64) -> bool {
        self.is_cheap(build) && saves > 0.0 || build < STAKE * saves * self.paths_rendered()
    }
}

/// A method that was built and measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Its name.
    pub method: &'static str,
    /// Seconds of its build: paid.
    pub t_build: f64,
    /// Seconds a path, of one thread.
    pub t_path: f64,
    /// Share of the queries that it answers.
    pub answered: f64,
    /// Seconds that the hierarchy takes for one of those queries, `t_query` of what can be proved.
    pub t_query: f64,
    /// Seconds that it takes to answer or to find that it cannot, `t_acc`, over all queries that it is asked.
    pub t_acc: f64,
}

/// The number of the best of the methods that were measured; `None` if the hierarchy alone is. Builds are paid by now and count no more.
pub(crate) fn best(plain: &Plain, measured: &[Measured]) -> Option<usize> {
    let (number, fastest) = measured.iter().enumerate().min_by(|(_, a), (_, b)| a.t_path.total_cmp(&b.t_path))?;
    (fastest.t_path < (1.0 - LEAST_GAIN) * plain.per_path).then_some(number)
}

/// Why a method was not measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Declined {
    /// Its name.
    pub method: &'static str,
    /// Seconds that its build was expected to take.
    pub t_build: f64,
    /// Seconds that it was expected to save in all.
    pub saves: f64,
}

/// What a pilot chose, and what it knew. Times in seconds; those a path are of one thread.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// The method.
    pub method: &'static str,
    /// Why, in a sentence.
    pub reason: String,
    /// Paths that the pilot followed.
    pub pilot_paths: usize,
    /// What the pilot took, with the builds that were in vain but without that of the method that was chosen, on one thread.
    pub t_pilot: f64,
    /// `T_render` without a method, predicted.
    pub predicted_none: f64,
    /// `T_render` with the method that was chosen, predicted, without its build.
    pub predicted: f64,
    /// A path without a method.
    pub t_path_none: f64,
    /// Queries of a path: spatial ones, those on an area light, superficial ones.
    pub queries: [QueryCost; 3],
    /// Methods that were built and measured.
    pub measured: Vec<Measured>,
    /// Methods that were not.
    pub declined: Vec<Declined>,
}

/// Seconds in words.
fn in_words(seconds: f64) -> String {
    match seconds {
        s if s < 0.999_5e-6 => format!("{:.0} ns", 1e9 * s),
        s if s < 0.999_5e-3 => format!("{:.2} µs", 1e6 * s),
        s if s < 0.999_5 => format!("{:.1} ms", 1e3 * s),
        s => format!("{s:.1} s"),
    }
}

/// The reason for a choice, in a sentence; `threads` render.
pub(crate) fn reason(
    plain: &Plain,
    queries: &[QueryCost; 3],
    measured: &[Measured],
    chosen: Option<usize>,
    declined: &[Declined],
    threads: usize,
) -> String {
    let total = |per_path: f64| in_words((plain.paths * per_path).min(plain.limit) / threads as f64);
    if let Some(m) = chosen.and_then(|i| measured.get(i)) {
        return format!(
            "{} a path instead of {}, for {:.0} % of the queries are answered in {} that take the hierarchy {}; predicted {} instead of {}",
            in_words(m.t_path),
            in_words(plain.per_path),
            100.0 * m.answered,
            in_words(m.t_acc),
            in_words(m.t_query),
            total(m.t_path),
            total(plain.per_path),
        );
    }
    let asked: f64 = queries.iter().map(|q| q.per_path * q.seconds).sum();
    let mut reasons = vec![format!(
        "predicted {}, of which queries take {:.0} %",
        total(plain.per_path),
        (100.0 * asked / plain.per_path).min(100.0)
    )];
    reasons.extend(
        measured.iter().map(|m| {
            format!("{} takes {} a path instead of {}", m.method, in_words(m.t_path), in_words(plain.per_path))
        }),
    );
    reasons.extend(declined.iter().map(|d| {
        let of = |seconds: f64| in_words(seconds / threads as f64);
        format!("{} would take about {} to build to save about {}", d.method, of(d.t_build), of(d.saves))
    }));
    reasons.join("; ")
}
