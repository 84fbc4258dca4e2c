//! Making the upper part of the tree cheaper before it is collapsed to wide nodes.
//!
//! *Idea:* a division of a set sends each triangle to the side where its centre is; a large triangle among small ones
//! makes the boxes of its side as large as itself. So branches are taken out, largest first, and put back where the sum
//! of all surfaces becomes the least \[Meister2018\].
//!
//! *Guarantee:* the result depends on the tree alone, not on the number of threads. If it is deeper than [`DEEPEST`],
//! the tree stays as it was.
//!
//! *Cost:* bounded for every input: a search looks at [`LOOKS`] branches at most, and all searches together start from
//! no more than some tenths of them; all moves together go up at most [`STEPS`] steps a branch.

use rayon::prelude::*;

use super::slices::Hull;

/// A node of a binary tree. Children lie side by side, at odd places and the even ones behind them; the root is at 0.
#[derive(Clone, Copy)]
pub(super) struct Branch {
    pub(super) hull: Hull,
    /// Half the surface of the hull.
    pub(super) area: f32,
    pub(super) parent: u32,
    /// The first of two children, or 0.
    pub(super) first: u32,
    /// For branches without children; it moves with the branch.
    pub(super) leaf: u32,
}

impl Branch {
    /// Without children.
    pub(super) fn new(hull: Hull, parent: u32) -> Self {
        Self { hull, area: hull.area(), parent, first: 0, leaf: 0 }
    }
}

/// How many rounds there are.
const ROUNDS: usize = 16;

/// How many of all branches the first round tries to move; the later ones try a third, a fifth and so on.
const SHARE: usize = 10;

/// Most branches that a search looks at.
const LOOKS: u32 = 300;

/// Most steps up the tree, for each branch, that all moves together take to bring boxes up to date.
const STEPS: usize = 64;

/// A tree that is deeper is not taken.
const DEEPEST: u32 = 96;

/// A branch that would be better off elsewhere.
#[derive(Clone, Copy)]
struct Move {
    from: usize,
    to: usize,
    gain: f32,
}

fn sibling(i: usize) -> usize {
    ((i - 1) ^ 1) + 1
}

/// Moves branches to where they cost less.
pub(super) fn reinsert(branches: &mut Vec<Branch>) {
    let before = branches.clone();
    let mut touched = vec![0_u32; branches.len()];
    // None are left at the end if boxes may be out of date.
    let mut steps = STEPS * branches.len();
    // The largest, as they are at first; moves change few of them.
    let mut order: Vec<usize> = (1..branches.len()).collect();
    let larger = |&i: &usize, &j: &usize| branches[j].area.total_cmp(&branches[i].area).then(i.cmp(&j));
    let most = branches.len() / SHARE;
    if most == 0 {
        return;
    }
    order.select_nth_unstable_by(most.min(branches.len() - 2), larger);
    order.truncate(most);
    order.sort_unstable_by(larger);
    for round in 0..ROUNDS {
        order.truncate(most / (2 * round + 1));
        if order.is_empty() {
            break;
        }
        let mut moves: Vec<Move> = order.par_iter().filter_map(|&i| search(branches, i)).collect();
        moves.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.from.cmp(&b.from)));
        let mark = u32::try_from(round + 1).unwrap_or(u32::MAX);
        for &Move { from, to, .. } in &moves {
            let parent = |i: usize| branches[i].parent as usize;
            let places = [to, from, sibling(from), parent(to), parent(from)];
            if places.iter().any(|&place| touched[place] == mark) {
                continue;
            }
            if steps == 0 {
                break;
            }
            places.iter().for_each(|&place| touched[place] = mark);
            apply(branches, from, to, &mut steps);
        }
    }
    if steps == 0 || is_deep(branches) {
        *branches = before;
    }
}

/// Where a branch is best off, if not where it is.
///
/// Taking it out puts its sibling in the place of their parent and shrinks all boxes above; putting it beside another
/// makes a box around both and enlarges all above. Below a branch the sum can only grow by what
/// is already enlarged, which ends most searches.
fn search(branches: &[Branch], from: usize) -> Option<Move> {
    let Branch { hull, area, parent, .. } = branches[from];
    let parent = parent as usize;
    let (mut best, mut to) = (0.0, 0);
    let mut saved = branches[parent].area;
    let mut beside = sibling(from);
    let mut rest = branches[beside].hull;
    let mut pivot = parent;
    let mut looks = 0;
    let mut waiting: Vec<(f32, usize)> = Vec::with_capacity(64);
    loop {
        waiting.push((saved, beside));
        while let Some((saved, i)) = waiting.pop() {
            looks += 1;
            if saved - area <= best {
                continue;
            }
            let branch = &branches[i];
            let gain = saved - branch.hull.union(hull).area();
            if gain > best {
                (best, to) = (gain, i);
            }
            if branch.first != 0 && looks < LOOKS {
                let saved = gain + branch.area;
                waiting.extend([(saved, branch.first as usize), (saved, branch.first as usize + 1)]);
            }
        }
        if pivot != parent {
            rest = rest.union(branches[beside].hull);
            saved += branches[pivot].area - rest.area();
        }
        if pivot == 0 || looks >= LOOKS {
            break;
        }
        beside = sibling(pivot);
        pivot = branches[pivot].parent as usize;
    }
    (to != 0 && to != sibling(from) && to != parent).then_some(Move { from, to, gain: best })
}

/// Puts a branch beside another. The pair takes that one's place, and the sibling that is left takes the place of the
/// parent.
fn apply(branches: &mut [Branch], from: usize, to: usize, steps: &mut usize) {
    let (left, parent) = (sibling(from), branches[from].parent as usize);
    let (stays, target) = (branches[left], branches[to]);
    let pair = from.min(left);
    let place = |branches: &mut [Branch], i: usize, branch: Branch, parent: u32| {
        branches[i] = Branch { parent, ..branch };
        if branch.first != 0 {
            for child in [branch.first as usize, branch.first as usize + 1] {
                branches[child].parent = low_bits(i);
            }
        }
    };
    let (above_to, above_parent) = (branches[to].parent, branches[parent].parent);
    place(branches, left, target, low_bits(to));
    branches[from].parent = low_bits(to);
    branches[to] = Branch { parent: above_to, first: low_bits(pair), leaf: 0, ..target };
    place(branches, parent, stays, above_parent);
    for start in [to, parent] {
        update(branches, start, steps);
    }
}

#[allow(clippy::cast_possible_truncation, reason = "there are less than 2^32 branches")]
pub(super) fn low_bits(i: usize) -> u32 {
    i as u32
}

/// Brings the boxes from here upwards up to date.
fn update(branches: &mut [Branch], mut i: usize, steps: &mut usize) {
    while *steps > 0 {
        let first = branches[i].first as usize;
        if first != 0 {
            let hull = branches[first].hull.union(branches[first + 1].hull);
            (branches[i].hull, branches[i].area) = (hull, hull.area());
        }
        if i == 0 {
            return;
        }
        *steps -= 1;
        i = branches[i].parent as usize;
    }
}

/// True if the tree is deeper than [`DEEPEST`].
fn is_deep(branches: &[Branch]) -> bool {
    let mut pending = vec![(0_usize, 0)];
    while let Some((i, depth)) = pending.pop() {
        if depth > DEEPEST {
            return true;
        }
        let first = branches[i].first as usize;
        if first != 0 {
            pending.extend([(first, depth + 1), (first + 1, depth + 1)]);
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use glam::Vec4;

    use super::*;

    fn hull(min: Vec4, max: Vec4) -> Hull {
        Hull { min, max }
    }

    /// A balanced tree over boxes in no order at all.
    fn random_tree(leaves: u32) -> Vec<Branch> {
        let mut noise = fastrand::Rng::with_seed(4);
        let mut hulls: Vec<_> = (0..leaves)
            .map(|_| {
                let min = Vec4::new(noise.f32(), noise.f32(), noise.f32(), 0.0);
                hull(min, min + noise.f32() * 0.1)
            })
            .map(|hull| Branch { hull, area: hull.area(), parent: 0, first: 0, leaf: 0 })
            .collect();
        hulls.iter_mut().zip(0..).for_each(|(branch, leaf)| branch.leaf = leaf);
        // Pairs from the front to the back, level by level; the root comes last, so that all is turned around at the
        // end.
        let mut tree: Vec<Branch> = Vec::new();
        let mut level = hulls;
        while level.len() > 1 {
            let start = low_bits(tree.len());
            tree.extend(&level);
            level = (0..low_bits(level.len() / 2))
                .map(|i| {
                    let hull = level[2 * i as usize].hull.union(level[2 * i as usize + 1].hull);
                    Branch { hull, area: hull.area(), parent: 0, first: start + 2 * i, leaf: 0 }
                })
                .collect();
        }
        tree.extend(level);
        let last = low_bits(tree.len() - 1);
        tree.reverse();
        for i in 0..tree.len() {
            let first = tree[i].first;
            // The branches with children come first.
            if i + 1 < leaves as usize {
                tree[i].first = last - first - 1;
                for child in [tree[i].first, tree[i].first + 1] {
                    tree[child as usize].parent = low_bits(i);
                }
            }
        }
        tree
    }

    /// The leaves of a tree whose boxes and links are right, and the surface of all its branches.
    fn check(tree: &[Branch]) -> (Vec<u32>, f32) {
        let (mut leaves, mut surface) = (Vec::new(), 0.0);
        let mut pending = vec![0];
        while let Some(i) = pending.pop() {
            let branch = tree[i];
            surface += branch.area;
            assert_eq!(branch.area, branch.hull.area());
            let first = branch.first as usize;
            if first == 0 {
                leaves.push(branch.leaf);
                continue;
            }
            let union = tree[first].hull.union(tree[first + 1].hull);
            assert!(union.min == branch.hull.min && union.max == branch.hull.max);
            assert!(tree[first].parent as usize == i && tree[first + 1].parent as usize == i);
            pending.extend([first, first + 1]);
        }
        leaves.sort_unstable();
        (leaves, surface)
    }

    #[test]
    fn a_cheaper_tree_with_the_same_leaves() {
        let mut tree = random_tree(1024);
        let (leaves, before) = check(&tree);
        assert_eq!(leaves, (0..1024).collect::<Vec<_>>());
        // Each time it moves a few of the largest.
        let mut surface = before;
        for _ in 0..30 {
            reinsert(&mut tree);
            let (same, after) = check(&tree);
            assert!(same == leaves && after <= surface, "{surface} {after}");
            surface = after;
        }
        assert!(surface < 0.95 * before, "{before} {surface}");
    }

    #[test]
    fn small_trees_stay() {
        for leaves in [1, 2, 4] {
            let mut tree = random_tree(leaves);
            let before = check(&tree);
            reinsert(&mut tree);
            assert_eq!(check(&tree).0, before.0);
        }
    }
}
