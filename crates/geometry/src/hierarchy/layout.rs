//! What the tree is made of: nodes of eight boxes, leaves of up to four triangles.
//!
//! *Idea:* a node has eight children \[Ylitie2017\], but their boxes stay in single precision and lie side by side:
//! four are tested at once with the registers that every x86-64 has, and nothing is unpacked. The triangles of a leaf
//! lie side by side too.
//!
//! *Guarantee:* every child's box holds the padded boxes of all triangles below it.
//!
//! *Cost:* a node is four cache lines, a leaf two and a half.
//!
//! *Limits:* 2²⁹ triangles; over more, and up to 2³² − 1, there are no nodes, and all triangles are tested.

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4};

use super::{space::TreeBox, table::Table};
use crate::Triangle;

/// Triangles of a leaf: as many as a register holds numbers in single precision.
pub(super) const WIDTH: usize = 4;

/// Registers for the children of a node.
pub(super) const REGISTERS: usize = 2;

/// Children of a node.
pub(super) const CHILDREN: usize = WIDTH * REGISTERS;

/// As many triangles, or more, are held without nodes: a [`Child`] cannot number their leaves.
pub(super) const TOO_MANY: usize = 1 << 29;

/// Eight boxes, side by side.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// For each axis the lower planes of the boxes and the upper ones, in tree coordinates. Where there is no child the
    /// lower is +∞ and the upper −∞.
    pub(super) planes: [[[Vec4; REGISTERS]; 2]; 3],
    pub(super) children: [Child; CHILDREN],
    /// The rest of the cache line.
    rest: [u32; 8],
}

impl Node {
    /// Without children.
    pub(super) const EMPTY: Self = Self {
        planes: [[[Vec4::INFINITY; REGISTERS], [Vec4::NEG_INFINITY; REGISTERS]]; 3],
        children: [Child(0); CHILDREN],
        rest: [0; 8],
    };

    /// A node with these boxes, at most eight; its children are not known yet.
    pub(super) fn new(boxes: impl Iterator<Item = TreeBox>) -> Self {
        let mut node = Self::EMPTY;
        boxes.take(CHILDREN).enumerate().for_each(|(i, bounds)| node.set_box(i, bounds));
        node
    }

    /// Gives a child its box.
    #[inline(always)]
    pub(super) fn set_box(&mut self, i: usize, TreeBox { min, max }: TreeBox) {
        let planes: &mut [[[f32; CHILDREN]; 2]; 3] = bytemuck::cast_mut(&mut self.planes);
        let i = i & (CHILDREN - 1);
        for (axis, [lower, upper]) in planes.iter_mut().enumerate() {
            (lower[i], upper[i]) = (min[axis], max[axis]);
        }
    }
}

/// A node, or a leaf and how many triangles it has.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(transparent)]
pub(super) struct Child(u32);

impl Child {
    pub(super) fn node(index: usize) -> Self {
        Self(low_bits(index) << 3)
    }

    pub(super) fn leaf(index: usize, count: usize) -> Self {
        Self(low_bits(index) << 3 | low_bits(count))
    }

    #[inline]
    pub(super) fn bits(self) -> u32 {
        self.0
    }

    #[inline]
    pub(super) fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    #[inline]
    pub(super) fn index(self) -> usize {
        (self.0 >> 3) as usize
    }

    /// The same child where the nodes before it are so many more, and the leaves.
    pub(super) fn shifted(self, [nodes, leaves]: [usize; 2]) -> Self {
        match self.triangles() {
            0 => Self::node(self.index() + nodes),
            count => Self::leaf(self.index() + leaves, count as usize),
        }
    }

    /// 0 for a node.
    #[inline]
    pub(super) fn triangles(self) -> u32 {
        self.0 & 7
    }
}

#[allow(clippy::cast_possible_truncation, reason = "there are less than 2^29 triangles")]
fn low_bits(index: usize) -> u32 {
    index as u32
}

/// The triangles of a leaf, side by side, in world coordinates.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(32))]
pub(super) struct Leaf {
    /// By axis, vertex and triangle.
    pub(super) vertices: [[[f32; WIDTH]; 3]; 3],
    /// The triangles' numbers; [`NONE`] where there is none.
    pub(super) numbers: [u32; WIDTH],
}

/// The number of no triangle.
pub(super) const NONE: u32 = u32::MAX;

impl Leaf {
    /// The leaf of these triangles, at most four.
    pub(super) fn new(triangles: &[Triangle], numbers: &[u32]) -> Self {
        let mut all = [NONE; WIDTH];
        all.iter_mut().zip(numbers).for_each(|(place, &number)| *place = number);
        let mut leaf = [Self::zeroed()];
        Self::fill(&mut leaf, triangles, &[all]);
        leaf[0]
    }

    /// The leaves of the triangles with these numbers.
    pub(super) fn fill(leaves: &mut [Self], triangles: &[Triangle], numbers: &[[u32; WIDTH]]) {
        // Some leaves at once: what is loaded from anywhere is only copied at first, so that many loads wait side by side.
        const SOME: usize = 8;
        for (leaves, numbers) in leaves.chunks_mut(SOME).zip(numbers.chunks(SOME)) {
            let mut near = [[Triangle { vertices: [Vec3::ZERO; 3] }; WIDTH]; SOME];
            for (near, numbers) in near.iter_mut().zip(numbers) {
                for (triangle, &number) in near.iter_mut().zip(numbers) {
                    if number != NONE {
                        *triangle = triangles[number as usize];
                    }
                }
            }
            for ((leaf, near), &numbers) in leaves.iter_mut().zip(&near).zip(numbers) {
                for axis in 0..3 {
                    for v in 0..3 {
                        leaf.vertices[axis][v] = [0, 1, 2, 3].map(|i| near[i].vertices[v][axis]);
                    }
                }
                leaf.numbers = numbers;
            }
        }
    }

    /// How many triangles it has.
    pub(super) fn count(&self) -> u32 {
        self.numbers.iter().map(|&number| u32::from(number != NONE)).sum()
    }

    #[inline]
    pub(super) fn triangle(&self, i: usize) -> Triangle {
        let i = i & (WIDTH - 1);
        let [x, y, z] = &self.vertices;
        Triangle { vertices: [0, 1, 2].map(|v| Vec3::new(x[v][i], y[v][i], z[v][i])) }
    }
}

/// The nodes and leaves.
pub(super) struct Tree {
    /// None if there are no nodes; then all leaves are visited.
    pub(super) root: Option<Child>,
    pub(super) nodes: Table<Node>,
    pub(super) leaves: Table<Leaf>,
}

impl Tree {
    /// Leaves only.
    pub(super) fn without_nodes(triangles: &[Triangle]) -> Self {
        let number = |i: usize| u32::try_from(i).unwrap_or(NONE);
        let leaf = |i: usize| {
            let numbers = [0, 1, 2, 3].map(|k| number(WIDTH * i + k));
            Leaf::new(triangles, &numbers[..WIDTH.min(triangles.len() - WIDTH * i)])
        };
        let leaves = Table::new(triangles.len().div_ceil(WIDTH), leaf);
        Self { root: None, nodes: Table::Small(Vec::new()), leaves }
    }

    /// Bytes of nodes and leaves.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.leaves[..])
    }

    /// All triangles with their numbers.
    pub(super) fn all(&self) -> impl Iterator<Item = (Triangle, u32)> {
        self.leaves.iter().flat_map(|leaf| {
            let used = (0..WIDTH).filter(|&i| leaf.numbers[i] != NONE);
            used.map(|i| (leaf.triangle(i), leaf.numbers[i]))
        })
    }
}
