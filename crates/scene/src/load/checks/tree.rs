//! Which of many boxes meet another one, without a look at each.

use vdf_geometry::Bounds;

/// So many boxes are looked at one by one.
const LEAF: usize = 4;

/// A binary tree over boxes.
#[derive(Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// The boxes with their numbers, in the order of the leaves.
    items: Vec<(Bounds, usize)>,
}

#[derive(Debug)]
struct Node {
    bounds: Bounds,
    content: Content,
}

#[derive(Debug)]
enum Content {
    /// The boxes from the first up to the second.
    Leaf(usize, usize),
    Inner(usize, usize),
}

impl Tree {
    /// Cost: n log² n.
    pub(super) fn new(boxes: impl Iterator<Item = Bounds>) -> Self {
        let mut tree = Self { nodes: Vec::new(), items: boxes.enumerate().map(|(i, b)| (b, i)).collect() };
        if !tree.items.is_empty() {
            tree.build(0, tree.items.len());
        }
        tree
    }

    /// Cuts at the median of the centres, so that the depth is logarithmic.
    fn build(&mut self, from: usize, to: usize) -> usize {
        let bounds = self.items[from..to].iter().map(|(b, _)| *b).reduce(Bounds::union);
        let bounds = bounds.unwrap_or_else(|| Bounds::of_points([]));
        let at = self.nodes.len();
        self.nodes.push(Node { bounds, content: Content::Leaf(from, to) });
        if to - from > LEAF {
            let extent = bounds.extent();
            let axis = (0..3).max_by(|&i, &j| extent[i].total_cmp(&extent[j])).unwrap_or(0);
            let twice_centre = |b: &Bounds| b.min[axis] + b.max[axis];
            self.items[from..to].sort_unstable_by(|(a, _), (b, _)| twice_centre(a).total_cmp(&twice_centre(b)));
            let middle = from.midpoint(to);
            let children = (self.build(from, middle), self.build(middle, to));
            self.nodes[at].content = Content::Inner(children.0, children.1);
        }
        at
    }

    /// Appends the numbers of the boxes that touch `wanted`.
    pub(super) fn touching(&self, wanted: &Bounds, found: &mut Vec<usize>) {
        let mut open = if self.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(node) = open.pop().and_then(|i: usize| self.nodes.get(i)) {
            if !node.bounds.touches(wanted) {
                continue;
            }
            match node.content {
                Content::Inner(a, b) => open.extend([a, b]),
                Content::Leaf(from, to) => {
                    found.extend(self.items[from..to].iter().filter(|(b, _)| b.touches(wanted)).map(|(_, i)| *i));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn it_finds_what_a_look_at_each_finds() {
        let boxes: Vec<_> = (0..200)
            .map(|i| {
                let at = DVec3::new(f64::from(i * 37 % 101), f64::from(i * 53 % 97), f64::from(i % 7));
                Bounds::of_points([at, at + DVec3::splat(f64::from(i % 5))])
            })
            .collect();
        let tree = Tree::new(boxes.iter().copied());
        for wanted in &boxes {
            let mut found = Vec::new();
            tree.touching(wanted, &mut found);
            found.sort_unstable();
            let expected: Vec<_> = (0..boxes.len()).filter(|&i| boxes[i].touches(wanted)).collect();
            assert_eq!(found, expected);
        }
        Tree::new(std::iter::empty()).touching(&boxes[0], &mut Vec::new());
    }
}
