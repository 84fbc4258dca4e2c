//! Which emitter an event asks: one that can give it much.
//!
//! *Idea.* With many lamps in a scene nearly all light at a place comes from the few that are near. So an emitter is drawn with a chance that goes with its intensity over the squared distance, by a
//! tree over the emitters that are somewhere, in which a branch counts as one emitter in the middle of its box \[Estevez2018\].
//!
//! *Definition.* The importance of a branch at a point is I/max(d², r²): I the intensity of all in it, for surfaces radiance times area; d the distance from the middle of its box, r half the
//! box's diagonal. For a part of a ray it is the integral of I/d² over it: I·Δφ/D, Δφ the angle that it subtends at the middle, which it passes at the distance D. Of up to [`WIDTH`] branches each
//! is taken in proportion. A share of [`EVEN`] of all draws takes any emitter alike: a lamp behind a wall has importance and gives nothing. An emitter that is infinitely far
//! away has the chance of one of many, as has the whole tree.
//!
//! *Guarantee.* [`Choice::chance`] is the probability with which [`Choice::draw`] takes an emitter; all of them add up to 1, and none is 0. With one emitter it is 1.
//!
//! *Cost.* In proportion to the depth of the tree, the logarithm of the number of emitters.
//!
//! *Departure from the paper.* Branches are eight, so that few emitters are weighed one by one; no cones of normals, and no bound of the cosine at the event.

use glam::DVec3;
use smallvec::SmallVec;
use vdf_geometry::Bounds;

/// The share of the draws that take any emitter in the tree alike.
const EVEN: f64 = 0.2;

/// The most branches of a node.
const WIDTH: usize = 8;

/// What an emitter shines with, and where; `None` if it is infinitely far away.
pub(super) type Shining = Option<(Bounds, f64)>;

/// An emitter that was drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Drawn {
    pub(crate) emitter: usize,
    /// What is left of the number that drew it: uniform.
    pub(crate) rest: f64,
    /// The probability with which it is drawn.
    pub(crate) chance: f64,
}

/// The emitters of a scene, to draw one of them.
#[derive(Debug)]
pub(super) struct Choice {
    nodes: Vec<Node>,
    /// The leaf of each emitter; `None` for those that are infinitely far away.
    leaves: Vec<Option<u32>>,
    /// The numbers of these, and of the others.
    far: Vec<usize>,
    near: Vec<usize>,
}

/// An emitter that is somewhere.
#[derive(Clone, Copy, Debug)]
struct Lamp {
    emitter: usize,
    bounds: Bounds,
    intensity: f64,
}

impl Lamp {
    /// Twice the middle of its box.
    fn middle(&self) -> DVec3 {
        self.bounds.min + self.bounds.max
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    middle: DVec3,
    radius2: f64,
    intensity: f64,
    parent: u32,
    content: Content,
}

#[derive(Clone, Copy, Debug)]
enum Content {
    /// The first of its children, side by side, and how many there are.
    Branches(u32, u32),
    Emitter(u32),
}

/// How important a branch is at a point.
#[inline]
pub(super) fn at(point: DVec3) -> impl Fn(&Node) -> f64 {
    move |node| node.intensity / node.middle.distance_squared(point).max(node.radius2)
}

/// How important a branch is for what may be scattered on so much of a ray.
#[inline]
pub(super) fn along(origin: DVec3, direction: DVec3, length: f64) -> impl Fn(&Node) -> f64 {
    move |node| {
        let to = node.middle - origin;
        let begin = -to.dot(direction);
        let end = begin + length;
        // A ray through a lamp counts as one that passes it.
        let gap2 = (to + direction * begin).length_squared().max(node.radius2).max(1e-14 * to.length_squared());
        let gap = gap2.sqrt();
        node.intensity * (gap * length).atan2(gap2 + begin * end) / gap
    }
}

impl Choice {
    /// Prepares the choice among these emitters, in their order.
    pub(super) fn new(shining: &[Shining]) -> Self {
        let (near, far): (Vec<_>, Vec<_>) = (0..shining.len()).partition(|&i| shining[i].is_some());
        let mut choice = Self { nodes: Vec::new(), leaves: vec![None; shining.len()], far, near };
        let lamp = |(emitter, shining): (usize, &Shining)| {
            shining.map(|(bounds, intensity)| Lamp { emitter, bounds, intensity })
        };
        let mut lamps: Vec<_> = shining.iter().enumerate().filter_map(lamp).collect();
        if !lamps.is_empty() {
            choice.nodes.push(Node::default());
            choice.build(0, 0, &mut lamps);
        }
        choice
    }

    /// Makes a node of these lamps, by medians.
    fn build(&mut self, node: usize, parent: u32, lamps: &mut [Lamp]) {
        let bounds = lamps.iter().fold(Bounds::EMPTY, |all, lamp| all.union(lamp.bounds));
        let mut groups: SmallVec<[&mut [Lamp]; WIDTH]> = SmallVec::new();
        let first = self.nodes.len();
        let alone = if let [lamp] = lamps { Some(lamp.emitter) } else { None };
        let intensity = lamps.iter().map(|lamp| lamp.intensity).sum();
        groups.push(lamps);
        while groups.len() < WIDTH {
            // The group with the most lamps is divided at the median of its longest side.
            let Some(i) = (0..groups.len()).max_by_key(|&i| groups[i].len()).filter(|&i| groups[i].len() > 1) else {
                break;
            };
            let [low, high] = halves(std::mem::take(&mut groups[i]));
            groups[i] = low;
            groups.push(high);
        }
        let content = match alone {
            Some(emitter) => Content::Emitter(emitter as u32),
            None => Content::Branches(first as u32, groups.len() as u32),
        };
        let (middle, radius2) = (0.5 * (bounds.min + bounds.max), 0.25 * bounds.extent().length_squared());
        self.nodes[node] = Node { middle, radius2, intensity, parent, content };
        if let Some(emitter) = alone {
            self.leaves[emitter] = Some(node as u32);
            return;
        }
        self.nodes.extend(groups.iter().map(|_| Node::default()));
        for (i, group) in groups.into_iter().enumerate() {
            self.build(first + i, node as u32, group);
        }
    }

    /// An emitter. `None` if there are none.
    #[inline]
    pub(super) fn draw(&self, u: f64, importance: impl Fn(&Node) -> f64) -> Option<Drawn> {
        let (i, u) = super::choose(u, self.far.len() + usize::from(!self.near.is_empty()))?;
        if let Some(&emitter) = self.far.get(i) {
            return Some(Drawn { emitter, rest: u, chance: self.of_all() });
        }
        if u < EVEN {
            let (i, rest) = super::choose(u / EVEN, self.near.len())?;
            let emitter = self.near[i];
            return Some(Drawn { emitter, rest, chance: self.chance(emitter, importance) });
        }
        let mut u = (u - EVEN) / (1.0 - EVEN);
        let mut node = &self.nodes[0];
        let mut share = 1.0;
        loop {
            let (first, count) = match node.content {
                Content::Emitter(emitter) => {
                    return Some(Drawn { emitter: emitter as usize, rest: u, chance: self.chance_of(share) });
                }
                Content::Branches(first, count) => (first as usize, count as usize),
            };
            let (weights, sum) = self.weights(first, count, &importance);
            let (mut left, mut i) = (u * sum, 0);
            while i + 1 < count && left >= weights[i] {
                left -= weights[i];
                i += 1;
            }
            // Rounding may come to a last one without weight, of which no share is left.
            u = if weights[i] > 0.0 { (left / weights[i]).clamp(0.0, 1.0 - f64::EPSILON / 2.0) } else { 0.0 };
            share *= weights[i] / sum;
            node = &self.nodes[first + i];
        }
    }

    /// The importance of each of so many branches, and their sum; all alike where nothing is known.
    #[inline]
    fn weights(&self, first: usize, count: usize, importance: impl Fn(&Node) -> f64) -> ([f64; WIDTH], f64) {
        let mut weights = [1.0; WIDTH];
        let mut sum = 0.0;
        for (weight, node) in weights.iter_mut().zip(&self.nodes[first..first + count]) {
            *weight = importance(node);
            sum += *weight;
        }
        if sum > 0.0 && sum.is_finite() { (weights, sum) } else { ([1.0; WIDTH], count as f64) }
    }

    /// The emitters that are infinitely far away.
    pub(super) fn far(&self) -> &[usize] {
        &self.far
    }

    /// The probability with which [`Choice::draw`] takes this emitter.
    #[inline]
    pub(super) fn chance(&self, emitter: usize, importance: impl Fn(&Node) -> f64) -> f64 {
        let Some(leaf) = self.leaves[emitter] else { return self.of_all() };
        let (mut share, mut number) = (1.0, leaf as usize);
        while number != 0 {
            let parent = self.nodes[number].parent as usize;
            if let Content::Branches(first, count) = self.nodes[parent].content {
                let (weights, sum) = self.weights(first as usize, count as usize, &importance);
                share *= weights[number - first as usize] / sum;
            }
            number = parent;
        }
        self.chance_of(share)
    }

    /// The probability of an emitter in the tree that is drawn there with this one.
    #[inline]
    fn chance_of(&self, share: f64) -> f64 {
        self.of_all() * (EVEN / self.near.len() as f64 + (1.0 - EVEN) * share)
    }

    /// The probability of one that is infinitely far away, and of the tree.
    #[inline]
    fn of_all(&self) -> f64 {
        1.0 / (self.far.len() + usize::from(!self.near.is_empty())) as f64
    }
}

impl Default for Node {
    fn default() -> Self {
        Self { middle: DVec3::ZERO, radius2: 0.0, intensity: 0.0, parent: 0, content: Content::Emitter(0) }
    }
}

/// Two halves of several lamps, by the median along the longest side of their middles.
fn halves(lamps: &mut [Lamp]) -> [&mut [Lamp]; 2] {
    let spread = Bounds::of_points(lamps.iter().map(Lamp::middle)).extent();
    let axis = if spread.x >= spread.y.max(spread.z) { 0 } else { 1 + usize::from(spread.z > spread.y) };
    lamps.sort_by(|a, b| a.middle()[axis].total_cmp(&b.middle()[axis]));
    let (low, high) = lamps.split_at_mut(lamps.len() / 2);
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Sampler, chi_squared::assert_drawn_from};

    fn lamp(x: f64, y: f64, z: f64, intensity: f64) -> Shining {
        Some((Bounds::of_points([DVec3::new(x, y, z)]), intensity))
    }

    /// Lamps side by side, at one place, without light, of any size, and the sky.
    fn scenes() -> Vec<Vec<Shining>> {
        let grid = |n: u32| (0..n).map(|i| lamp(f64::from(i % 7), f64::from(i / 7), 0.5, 1.0 + f64::from(i % 3)));
        let large = Some((Bounds::new(DVec3::splat(-3.0), DVec3::splat(2.0)), 5.0));
        vec![
            vec![lamp(1.0, 2.0, 3.0, 4.0)],
            vec![None],
            vec![None, None],
            vec![lamp(0.0, 0.0, 0.0, 1.0), lamp(1.0, 0.0, 0.0, 1.0)],
            vec![lamp(0.0, 0.0, 0.0, 1.0), lamp(0.0, 0.0, 0.0, 3.0), lamp(0.0, 0.0, 0.0, 0.0)],
            vec![lamp(0.0, 0.0, 0.0, 0.0), lamp(5.0, 0.0, 0.0, 0.0)],
            vec![lamp(0.0, 0.0, 0.0, 1e-300), None, lamp(1e9, 0.0, 0.0, 1e300), large],
            grid(50).chain([None, large]).collect(),
        ]
    }

    /// At lamps, between them and far away.
    fn points() -> Vec<DVec3> {
        let mut sampler = Sampler::new(3, 1, 4, 1);
        let mut number = || 12.0 * sampler.next_1d() - 4.0;
        let mut points: Vec<_> = (0..20).map(|_| DVec3::new(number(), number(), number())).collect();
        points.extend([DVec3::ZERO, DVec3::X, DVec3::new(3.0, 2.0, 0.5), DVec3::splat(1e12), DVec3::splat(-1e-200)]);
        points
    }

    #[test]
    fn chances_add_up_to_one() {
        for shining in scenes() {
            let choice = Choice::new(&shining);
            for (k, point) in points().into_iter().enumerate() {
                let length = [1.0, 1e-9, 1e9, 30.0][k % 4];
                let chances: Vec<f64> = match k % 2 {
                    0 => (0..shining.len()).map(|i| choice.chance(i, at(point))).collect(),
                    _ => (0..shining.len()).map(|i| choice.chance(i, along(point, DVec3::Y, length))).collect(),
                };
                assert!(chances.iter().all(|&c| c > 0.0), "{point}: {chances:?}");
                assert!((chances.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{point}: {chances:?}");
            }
        }
        assert!(Choice::new(&[]).draw(0.5, at(DVec3::ZERO)).is_none());
    }

    /// χ² over the emitters, and over 16 cells of what is left of the number, bounds as in `chi_squared`.
    #[test]
    fn emitters_are_drawn_with_their_chances() {
        for (k, shining) in scenes().into_iter().enumerate() {
            let choice = Choice::new(&shining);
            for (j, point) in points().into_iter().enumerate() {
                let mut drawn = vec![0_u64; shining.len()];
                let mut rests = [0_u64; 16];
                for i in 0..20_000 {
                    let u = Sampler::new(17, i, j as u32, k as u32).next_1d();
                    let drawn_by = match j % 2 {
                        0 => choice.draw(u, at(point)),
                        _ => choice.draw(u, along(point, DVec3::X, 3.0)),
                    };
                    let Drawn { emitter, rest, chance } = drawn_by.expect("there are some");
                    let expected = match j % 2 {
                        0 => choice.chance(emitter, at(point)),
                        _ => choice.chance(emitter, along(point, DVec3::X, 3.0)),
                    };
                    // Products in two orders.
                    assert!((chance / expected - 1.0).abs() < 1e-14, "{chance} {expected}");
                    assert!((0.0..1.0).contains(&rest), "{rest}");
                    drawn[emitter] += 1;
                    rests[(rest * 16.0) as usize] += 1;
                }
                let chance = |i| match j % 2 {
                    0 => choice.chance(i, at(point)),
                    _ => choice.chance(i, along(point, DVec3::X, 3.0)),
                };
                let chances: Vec<f64> = (0..shining.len()).map(chance).collect();
                if shining.len() > 1 {
                    assert_drawn_from(&format!("scene {k}, {point}"), &drawn, &chances);
                }
                assert_drawn_from(&format!("rests of scene {k}, {point}"), &rests, &[1.0 / 16.0; 16]);
            }
        }
    }

    /// A lamp close by is asked for more often than one far away, and the stronger of two more often.
    #[test]
    fn what_is_near_or_strong_is_drawn_more_often() {
        let choice = Choice::new(&[lamp(0.0, 0.0, 0.0, 1.0), lamp(10.0, 0.0, 0.0, 1.0), lamp(0.0, 10.0, 0.0, 4.0)]);
        let chances = |x: f64| [0, 1, 2].map(|i| choice.chance(i, at(DVec3::new(x, 0.0, 0.0))));
        let [here, there, strong] = chances(1.0);
        assert!(here > 0.7 && strong > there, "{here} {there} {strong}");
        assert!(chances(9.0)[1] > 0.7);
        // By a ray at this height, and by how near a part of it comes.
        let strong = |y: f64, length: f64| choice.chance(2, along(DVec3::new(-5.0, y, 0.0), DVec3::X, length));
        assert!(strong(9.5, 1e6) > 0.8 && strong(0.5, 1e6) < 0.4);
        assert!(strong(5.0, 1.0) > strong(5.0, 8.0), "the other lamp comes nearer");
    }

    /// The importance for a part of a ray is the integral of that at its points, of lamps that are points.
    #[test]
    fn what_a_ray_passes_is_summed_up() {
        let node = Node { middle: DVec3::new(1.0, 2.0, -0.5), intensity: 3.0, ..Node::default() };
        let (origin, direction) = (DVec3::new(-2.0, 0.3, 0.1), DVec3::new(2.0, 1.0, 0.5).normalize());
        let n = 20_000;
        let step = 9.0 / f64::from(n);
        let sum: f64 = (0..n).map(|i| at(origin + direction * ((f64::from(i) + 0.5) * step))(&node) * step).sum();
        let whole = along(origin, direction, 9.0)(&node);
        assert!((sum / whole - 1.0).abs() < 1e-6, "{sum} {whole}");
    }
}
