//! Plots, laid out in numbers; the template draws them as SVG.

use serde::Serialize;
use vdf_visibility::{FieldKind, Method, PointProver};

/// Lines over logarithmic axes, ready to draw.
#[derive(Clone, Debug, Serialize)]
pub struct Plot {
    title: String,
    x_label: String,
    y_label: String,
    /// Places and labels of the ticks.
    x_ticks: Vec<(f64, String)>,
    y_ticks: Vec<(f64, String)>,
    series: Vec<DrawnSeries>,
    /// Frame of the data: left, top, right, bottom.
    frame: [f64; 4],
    size: [f64; 2],
}

/// A line to plot, and between which lines it might lie as well; these have as many points, one for each of the line's
/// own.
#[derive(Clone, Debug)]
pub struct Banded {
    /// The line.
    pub series: Series,
    /// One edge of the band.
    pub low: Vec<(f64, f64)>,
    /// The other edge.
    pub high: Vec<(f64, f64)>,
}

impl From<Series> for Banded {
    fn from(series: Series) -> Self {
        Self { series, low: vec![], high: vec![] }
    }
}

/// A line to plot.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// Its points, from left to right.
    pub points: Vec<(f64, f64)>,
    /// Number of its colour.
    pub colour: usize,
    /// 0 is solid, others are dashed in different ways.
    pub dash: usize,
}

#[derive(Clone, Debug, Serialize)]
struct DrawnSeries {
    name: String,
    points: Vec<(f64, f64)>,
    /// The outline of the band; empty if there is none.
    band: Vec<(f64, f64)>,
    colour: usize,
    dash: usize,
}

const SIZE: [f64; 2] = [480.0, 300.0];
const FRAME: [f64; 4] = [56.0, 12.0, 468.0, 254.0];

/// Number of colours in the template.
pub(super) const COLOURS: usize = 6;

impl Series {
    /// A line without points in the style of a method, by its name: a colour for the field, a dash for the
    /// neighbourhood.
    pub(super) fn in_style_of(method: &str) -> Self {
        let method: Method = method.parse().unwrap_or(Method::NONE);
        let colour = match method.field() {
            Some(FieldKind::Ndf) => 0,
            Some(FieldKind::Amr) => 1,
            Some(FieldKind::Dsz) => 2,
            Some(FieldKind::Dual) => 3,
            None => 4,
        };
        let dash = match method.point_prover() {
            PointProver::Field => 0,
            PointProver::Safe => 1,
            _ => 2,
        };
        Self { name: String::new(), points: vec![], colour, dash }
    }
}

impl Plot {
    /// Lines over axes that are both logarithmic. What is not positive and finite is left out; `None` if nothing
    /// remains.
    #[must_use]
    pub fn logarithmic<S: Into<Banded>>(title: String, x_label: &str, y_label: &str, series: Vec<S>) -> Option<Self> {
        let series: Vec<Banded> = series
            .into_iter()
            .map(|s| {
                let Banded { mut series, mut low, mut high } = s.into();
                for points in [&mut series.points, &mut low, &mut high] {
                    points.retain(|(x, y)| *x > 0.0 && *y > 0.0 && x.is_finite() && y.is_finite());
                }
                Banded { series, low, high }
            })
            .filter(|s| !s.series.points.is_empty())
            .collect();
        if series.is_empty() {
            return None;
        }
        let [left, top, right, bottom] = FRAME;
        let points = || series.iter().flat_map(|s| s.series.points.iter().chain(&s.low).chain(&s.high));
        let x = Axis::covering(points().map(|p| p.0), left, right);
        let y = Axis::covering(points().map(|p| p.1), bottom, top);
        let place = |p: &(f64, f64)| (x.place(p.0), y.place(p.1));
        let drawn = series
            .iter()
            .map(|s| DrawnSeries {
                name: s.series.name.clone(),
                points: s.series.points.iter().map(place).collect(),
                band: s.low.iter().chain(s.high.iter().rev()).map(place).collect(),
                colour: s.series.colour % COLOURS,
                dash: s.series.dash,
            })
            .collect();
        Some(Self {
            title,
            x_label: x_label.to_owned(),
            y_label: y_label.to_owned(),
            x_ticks: x.ticks(),
            y_ticks: y.ticks(),
            series: drawn,
            frame: FRAME,
            size: SIZE,
        })
    }
}

/// A logarithmic axis.
struct Axis {
    /// Decimal logarithms of the ends.
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn covering(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let (low, high) =
            values.map(f64::log10).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let margin = (0.05 * (high - low)).max(0.05);
        Self { low: low - margin, high: high + margin, from, to }
    }

    fn place(&self, value: f64) -> f64 {
        let share = (value.log10() - self.low) / (self.high - self.low);
        let place = self.from + share * (self.to - self.from);
        (10.0 * place).round() / 10.0
    }

    /// Ticks at 1, 2 and 5 times powers of ten, at powers of ten alone where those would be many, at more where they
    /// would be few.
    fn ticks(&self) -> Vec<(f64, String)> {
        let steps: &[f64] = match self.high - self.low {
            decades if decades < 0.5 => &[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
            decades if decades < 2.0 => &[1.0, 2.0, 5.0],
            _ => &[1.0],
        };
        let stride = ((self.high - self.low) / 6.0).ceil().max(1.0) as i32;
        let exponents = self.low.floor() as i32..=self.high.ceil() as i32;
        exponents
            .filter(|e| e.rem_euclid(stride) == 0)
            .flat_map(|e| steps.iter().map(move |s| s * 10f64.powi(e)))
            .filter(|v| (self.low..=self.high).contains(&v.log10()))
            .map(|v| (self.place(v), label(v)))
            .collect()
    }
}

fn label(v: f64) -> String {
    let whole = |x: f64| format!("{}", (1000.0 * x).round() / 1000.0);
    match v {
        v if v >= 1e9 => format!("{} G", whole(v / 1e9)),
        v if v >= 1e6 => format!("{} M", whole(v / 1e6)),
        v if v >= 1e4 => format!("{} k", whole(v / 1e3)),
        v if v >= 1e-3 => whole(v),
        v => format!("{v:.0e}"),
    }
}
