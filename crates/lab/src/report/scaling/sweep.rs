//! What a sweep measured: lines of medians against what was varied.

use super::{super::bench::median, fit::PowerLaw};

/// One thing varied, several quantities measured against it.
#[derive(Clone, Debug)]
pub(super) struct Sweep {
    /// As on the command line.
    pub(super) name: &'static str,
    pub(super) heading: &'static str,
    /// What is varied, how and in what scene.
    pub(super) paragraphs: Vec<String>,
    /// What the first column counts.
    pub(super) against: &'static str,
    pub(super) scene: &'static str,
    pub(super) integrator: String,
    pub(super) groups: Vec<Group>,
}

/// Quantities of one unit: a table and a plot.
#[derive(Clone, Debug)]
pub(super) struct Group {
    pub(super) title: &'static str,
    pub(super) unit: Unit,
    pub(super) lines: Vec<Line>,
}

/// What a group's numbers are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    Seconds,
    Nanoseconds,
    Bytes,
    /// A probability: no exponent is fitted, and nothing is plotted.
    Share,
    /// A ratio to the first point: no exponent is fitted.
    Ratio,
}

/// One quantity.
#[derive(Clone, Debug)]
pub(super) struct Line {
    /// The column's heading.
    pub(super) name: &'static str,
    /// The method, if one is concerned, and its voxels in the figures.
    pub(super) method: &'static str,
    pub(super) points: Vec<Point>,
}

/// A quantity in one place, over the repetitions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    pub(super) x: f64,
    pub(super) median: f64,
    pub(super) least: f64,
    pub(super) most: f64,
}

impl Group {
    /// A group whose lines have these names and methods, without points.
    pub(super) fn new(title: &'static str, unit: Unit, lines: &[(&'static str, &'static str)]) -> Self {
        let lines = lines.iter().map(|&(name, method)| Line { name, method, points: vec![] }).collect();
        Self { title, unit, lines }
    }

    /// Adds the values of a repeated measurement at `x` to the line of that name.
    pub(super) fn push(&mut self, name: &str, x: f64, values: &[f64]) {
        let line = self.lines.iter_mut().find(|l| l.name == name);
        debug_assert!(line.is_some(), "no line {name}");
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        if let (Some(line), [least, .., most] | [least @ most]) = (line, &sorted[..]) {
            let median = median(values);
            line.points.push(Point { x, median, least: *least, most: *most });
        }
    }

    /// The same quantities as how many times better the first point is divided by x / first x: 1 if all threads help
    /// fully.
    pub(super) fn efficiency(&self, title: &'static str) -> Self {
        let line = |line: &Line| {
            let point = |p: &Point| {
                let first = line.points[0];
                let of = |t: f64| first.median * first.x / (t * p.x);
                Point { x: p.x, median: of(p.median), least: of(p.most), most: of(p.least) }
            };
            Line { points: line.points.iter().map(point).collect(), ..*line }
        };
        Self { title, unit: Unit::Ratio, lines: self.lines.iter().map(line).collect() }
    }

    /// All x, in order.
    pub(super) fn xs(&self) -> Vec<f64> {
        let mut xs: Vec<f64> = self.lines.iter().flat_map(|l| l.points.iter().map(|p| p.x)).collect();
        xs.sort_by(f64::total_cmp);
        xs.dedup();
        xs
    }
}

impl Line {
    pub(super) fn at(&self, x: f64) -> Option<&Point> {
        self.points.iter().find(|p| p.x == x)
    }

    pub(super) fn fit(&self) -> Option<PowerLaw> {
        PowerLaw::fit(&self.points.iter().map(|p| (p.x, p.median)).collect::<Vec<_>>())
    }
}

impl Unit {
    /// Whether an exponent says something.
    pub(super) const fn fitted(self) -> bool {
        matches!(self, Self::Seconds | Self::Nanoseconds | Self::Bytes)
    }

    pub(super) const fn symbol(self) -> &'static str {
        match self {
            Self::Seconds => "s",
            Self::Nanoseconds => "ns",
            Self::Bytes => "B",
            Self::Share | Self::Ratio => "",
        }
    }
}

/// `most` and its halves, quarters, … that are at least `least`, the smallest first.
pub(super) fn halvings(least: u64, most: u64) -> Vec<u64> {
    let mut sizes: Vec<u64> =
        std::iter::successors(Some(most), |n| Some(n / 2)).take_while(|&n| n >= least.max(1)).collect();
    sizes.reverse();
    sizes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_double_up_to_the_largest() {
        assert_eq!(halvings(100_000, 1_000_000), [125_000, 250_000, 500_000, 1_000_000]);
        assert_eq!(halvings(32, 32), [32]);
        assert_eq!(halvings(0, 6), [1, 3, 6]);
    }

    #[test]
    fn medians_and_efficiencies() {
        let mut group = Group::new("t", Unit::Seconds, &[("a", ""), ("b", "amr")]);
        group.push("a", 1.0, &[9.0, 7.0, 8.0]);
        group.push("a", 2.0, &[5.0, 4.0]);
        group.push("b", 2.0, &[]);
        group.push("b", 4.0, &[1.0]);
        assert_eq!(group.xs(), [1.0, 2.0, 4.0]);
        let a = &group.lines[0];
        assert_eq!(a.points[0], Point { x: 1.0, median: 8.0, least: 7.0, most: 9.0 });
        assert_eq!(a.at(2.0), Some(&Point { x: 2.0, median: 4.5, least: 4.0, most: 5.0 }));
        let efficiency = group.efficiency("e");
        let p = efficiency.lines[0].points[1];
        assert_eq!((p.median, p.least, p.most), (8.0 / 9.0, 0.8, 1.0));
        assert_eq!(efficiency.lines[1].points[0].median, 1.0);
    }
}
