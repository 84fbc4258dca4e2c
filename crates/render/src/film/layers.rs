//! Layers: what else there is to know of each pixel, for denoisers, compositing and for those who look for the cost of a picture.

use std::{fmt, ops::Add, str::FromStr};

use glam::DVec3;
use serde::{Deserialize, Serialize};
use vdf_image::Channel;
use vdf_scene::Rgb;
use vdf_visibility::Counters;

/// A layer of a picture. Those of surfaces are of the first occluder along the camera ray, seen through any fog; each is the mean of a pixel's
/// samples, without the weights of the filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Reflectance of the side seen; 0 where there is no surface.
    Albedo,
    /// Unit normal of the side seen, in world space; 0 where there is no surface.
    Normal,
    /// Distance from the camera in world units, of those samples that meet a surface; 0 if none does.
    Depth,
    /// Position in world units, of those samples that meet a surface; 0 if none does.
    Position,
    /// Variance of the pixel's mean, estimated from its samples; 0 if there is only one.
    Variance,
    /// Number of samples.
    Samples,
    /// Searches of the hierarchy for a sample: rays, and queries that no proof answered. It depends on the method.
    Cost,
    /// The share of spatial queries that no proof answered; 0 if there were none. It depends on the method.
    Unknown,
}

impl Layer {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Albedo,
        Self::Normal,
        Self::Depth,
        Self::Position,
        Self::Variance,
        Self::Samples,
        Self::Cost,
        Self::Unknown,
    ];

    /// The name on the command line and in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Albedo => "albedo",
            Self::Normal => "normal",
            Self::Depth => "depth",
            Self::Position => "position",
            Self::Variance => "variance",
            Self::Samples => "samples",
            Self::Cost => "cost",
            Self::Unknown => "unknown",
        }
    }

    /// The names of its channels, as Nuke, Blender and others take them.
    #[must_use]
    pub const fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Albedo | Self::Variance => &["R", "G", "B"],
            Self::Normal | Self::Position => &["X", "Y", "Z"],
            Self::Depth => &["Z"],
            Self::Samples | Self::Cost | Self::Unknown => &["Y"],
        }
    }

    /// Where its sums are in [`Sums`].
    const fn sums(self) -> &'static [usize] {
        match self {
            Self::Variance => &[3, 4, 5],
            Self::Albedo => &[6, 7, 8],
            Self::Normal => &[9, 10, 11],
            Self::Depth => &[12, 13],
            Self::Position => &[12, 14, 15, 16],
            Self::Cost => &[17],
            Self::Unknown => &[18, 19],
            Self::Samples => &[],
        }
    }
}

impl FromStr for Layer {
    type Err = UnknownLayer;

    fn from_str(name: &str) -> Result<Self, UnknownLayer> {
        Self::ALL.into_iter().find(|layer| layer.name() == name).ok_or(UnknownLayer)
    }
}

/// A name that is none of the layers'.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown layer; the layers are {}", Layer::ALL.map(Layer::name).join(", "))]
pub struct UnknownLayer;

/// A set of layers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "Vec<String>", try_from = "Vec<String>")]
pub struct Layers(u8);

impl Layers {
    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether this one is among them.
    #[must_use]
    pub const fn contains(self, layer: Layer) -> bool {
        self.0 & (1 << layer as u8) != 0
    }

    /// Those that are among them, in the order of [`Layer::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Layer> {
        Layer::ALL.into_iter().filter(move |layer| self.contains(*layer))
    }

    /// Whether one of them depends on the method.
    #[must_use]
    pub const fn depend_on_method(self) -> bool {
        self.contains(Layer::Cost) || self.contains(Layer::Unknown)
    }

    /// Whether one of them is of surfaces.
    const fn need_surface(self) -> bool {
        let [a, n, d, p] = [Layer::Albedo, Layer::Normal, Layer::Depth, Layer::Position];
        self.contains(a) || self.contains(n) || self.contains(d) || self.contains(p)
    }

    /// Which of [`Sums`] a film keeps, in this order.
    fn kept(self) -> Vec<usize> {
        let mut kept = vec![0, 1, 2];
        for &sum in self.iter().flat_map(Layer::sums) {
            if !kept.contains(&sum) {
                kept.push(sum);
            }
        }
        kept
    }

    /// Where the first sum of a layer is among those that a film keeps, if it keeps any for it.
    pub(super) fn place_of(self, layer: Layer) -> Option<usize> {
        let first = *layer.sums().first().filter(|_| self.contains(layer))?;
        self.kept().iter().position(|&kept| kept == first)
    }

    /// With the layers of another set.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// How many sums of each pixel a film keeps.
    pub(super) fn count(self) -> usize {
        self.kept().len()
    }
}

impl FromIterator<Layer> for Layers {
    fn from_iter<I: IntoIterator<Item = Layer>>(layers: I) -> Self {
        Self(layers.into_iter().fold(0, |set, layer| set | (1 << layer as u8)))
    }
}

impl fmt::Display for Layers {
    /// Their names with commas, or `none`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = self.iter().map(Layer::name).collect();
        f.write_str(if names.is_empty() { "none".to_owned() } else { names.join(",") }.as_str())
    }
}

impl From<Layers> for Vec<String> {
    fn from(layers: Layers) -> Self {
        layers.iter().map(|layer| layer.name().to_owned()).collect()
    }
}

impl TryFrom<Vec<String>> for Layers {
    type Error = UnknownLayer;

    fn try_from(names: Vec<String>) -> Result<Self, UnknownLayer> {
        names.iter().map(|name| name.parse::<Layer>()).collect()
    }
}

/// What a camera ray meets first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Feature {
    pub(crate) albedo: Rgb,
    pub(crate) normal: DVec3,
    pub(crate) position: DVec3,
    /// Distance from the camera.
    pub(crate) depth: f64,
}

/// All that can be summed of a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sums([f64; 20]);

impl Add for Sums {
    type Output = Self;

    fn add(mut self, other: Self) -> Self {
        self.0.iter_mut().zip(other.0).for_each(|(a, b)| *a += b);
        self
    }
}

/// Makes the sums that some layers need, sample by sample.
#[derive(Clone, Debug)]
pub(crate) struct LayerSums {
    layers: Layers,
    kept: Vec<usize>,
}

impl LayerSums {
    pub(crate) fn new(layers: Layers) -> Self {
        Self { layers, kept: layers.kept() }
    }

    /// Whether [`LayerSums::sample`] wants the surface.
    pub(crate) const fn need_surface(&self) -> bool {
        self.layers.need_surface()
    }

    /// The sums of one sample, whose queries took the counters from `before` to `after`.
    pub(crate) fn sample(
        &self,
        radiance: DVec3,
        feature: Option<Feature>,
        before: &Counters,
        after: &Counters,
    ) -> Sums {
        let mut sums = [0.0; 20];
        sums[0..3].copy_from_slice(&radiance.to_array());
        sums[3..6].copy_from_slice(&(radiance * radiance).to_array());
        if let Some(Feature { albedo, normal, position, depth }) = feature {
            sums[6..9].copy_from_slice(&albedo.as_dvec3().to_array());
            sums[9..12].copy_from_slice(&normal.to_array());
            sums[12] = 1.0;
            sums[13] = depth;
            sums[14..17].copy_from_slice(&position.to_array());
        }
        let answered = |c: &Counters| c.proved + c.on_light_proved + c.superficial_proved;
        let searches = |c: &Counters| c.rays + c.queries - answered(c);
        sums[17] = (searches(after) - searches(before)) as f64;
        let (spatial, proved) = (after.spatial - before.spatial, after.proved - before.proved);
        sums[18] = spatial as f64;
        sums[19] = (spatial - proved) as f64;
        Sums(sums)
    }

    /// Appends those numbers that the film keeps.
    pub(crate) fn keep(&self, sums: Sums, numbers: &mut Vec<f64>) {
        numbers.extend(self.kept.iter().map(|&i| sums.0[i]));
    }

    /// The channels of the layers, black.
    pub(super) fn channels(&self, pixels: usize) -> Vec<Channel> {
        let name = |layer: Layer| layer.channels().iter().map(move |channel| format!("{}.{channel}", layer.name()));
        self.layers.iter().flat_map(name).map(|name| Channel { name, values: vec![0.0; pixels] }).collect()
    }

    /// Sets pixel `at` of the channels by the sums that the film keeps of `n` samples.
    pub(super) fn develop(&self, at: usize, n: f64, kept: &[f64], channels: &mut [Channel]) {
        let sum = |i: usize| self.kept.iter().position(|&k| k == i).map_or(0.0, |place| kept[place]);
        let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
        let mut channels = channels.iter_mut();
        let mut set = |values: &[f64]| {
            // In this order: the values end first, and a channel that was taken without one would be lost.
            for (value, channel) in values.iter().zip(&mut channels) {
                channel.values[at] = *value as f32;
            }
        };
        for layer in self.layers.iter() {
            match layer {
                Layer::Albedo | Layer::Normal => {
                    let [a, b, c] = [0, 1, 2].map(|i| sum(layer.sums()[i]) / n);
                    set(&[a, b, c]);
                }
                Layer::Depth => set(&[ratio(sum(13), sum(12))]),
                Layer::Position => set(&[14, 15, 16].map(|i| ratio(sum(i), sum(12)))),
                Layer::Variance => set(&[0, 1, 2].map(|i| {
                    // The difference may round below zero where all samples are alike.
                    let of_samples = (sum(3 + i) - sum(i) * sum(i) / n).max(0.0);
                    ratio(of_samples, n * (n - 1.0))
                })),
                Layer::Samples => set(&[n]),
                Layer::Cost => set(&[sum(17) / n]),
                Layer::Unknown => set(&[ratio(sum(19), sum(18))]),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        let all: Layers = Layer::ALL.into_iter().collect();
        assert_eq!(Layers::try_from(Vec::<String>::from(all)), Ok(all));
        assert_eq!(all.to_string(), "albedo,normal,depth,position,variance,samples,cost,unknown");
        assert_eq!(Layers::default().to_string(), "none");
        assert_eq!("Albedo".parse::<Layer>(), Err(UnknownLayer));
        assert_eq!((all.count(), Layers::default().count()), (20, 3));
    }

    #[test]
    fn figures_are_those_of_the_samples() {
        let sums = LayerSums::new(Layer::ALL.into_iter().collect());
        let feature = |depth| Feature {
            albedo: Rgb::new(0.5, 0.25, 1.0),
            normal: DVec3::X,
            position: DVec3::new(depth, 0.0, 2.0 * depth),
            depth,
        };
        let zero = Counters::default();
        let after = Counters { queries: 5, spatial: 4, proved: 3, on_light_proved: 1, rays: 2, ..zero };
        let samples = [
            sums.sample(DVec3::splat(1.0), Some(feature(10.0)), &zero, &after),
            sums.sample(DVec3::splat(3.0), None, &after, &after),
            sums.sample(DVec3::splat(2.0), Some(feature(20.0)), &zero, &zero),
            sums.sample(DVec3::splat(2.0), None, &zero, &zero),
        ];
        let mut kept = Vec::new();
        sums.keep(samples.into_iter().reduce(Add::add).unwrap(), &mut kept);
        let mut channels = sums.channels(1);
        sums.develop(0, 4.0, &kept, &mut channels);
        let value = |name: &str| channels.iter().find(|c| c.name == name).unwrap().values[0];
        assert_eq!([value("albedo.R"), value("albedo.B"), value("normal.X")], [0.25, 0.5, 0.5]);
        // Of the two samples that met a surface.
        assert_eq!([value("depth.Z"), value("position.X"), value("position.Z")], [15.0, 15.0, 30.0]);
        // The squares of the deviations are 1, 1, 0 and 0.
        assert_eq!(value("variance.G"), 2.0 / 3.0 / 4.0);
        assert_eq!([value("samples.Y"), value("cost.Y"), value("unknown.Y")], [4.0, 0.75, 0.25]);
    }
}
