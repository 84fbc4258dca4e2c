//! The same tree on any number of threads, bounded work and depth on hard inputs, and leaves that are the cheapest.

use std::time::{Duration, Instant};

use glam::{Vec3, Vec3A};

use super::{super::space::TreeBox, *};
use crate::Bounds;

fn build(triangles: &[Triangle]) -> Tree {
    Tree::build(triangles, TreeSpace::new(&Bounds::of_triangles(triangles)))
}

fn number(i: usize) -> f32 {
    f32::from(u16::try_from(i % 60_000).unwrap_or(0))
}

/// Inputs that ruin one builder or another.
fn hard(n: usize) -> Vec<(&'static str, Vec<Triangle>)> {
    let mut noise = fastrand::Rng::with_seed(9);
    let mut point = |size: f32| Vec3::new(noise.f32() - 0.5, noise.f32() - 0.5, noise.f32() - 0.5) * size;
    let rim = |i: usize| {
        let angle = number(i) * 1e-4;
        Vec3::new(angle.cos(), angle.sin(), 0.3 * (3.0 * angle).sin())
    };
    let corners = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.3), Vec3::new(0.0, 1.0, 0.5)];
    let of =
        |f: &mut dyn FnMut(usize) -> [Vec3; 3]| -> Vec<_> { (0..n).map(|i| Triangle { vertices: f(i) }).collect() };
    vec![
        ("equal", of(&mut |_| corners)),
        ("fan", of(&mut |i| [Vec3::ZERO, rim(i), rim(i + 1)])),
        ("nested", of(&mut |i| corners.map(|v| v * (1.0 + number(i) * 1e-3)))),
        ("nested by powers", of(&mut |i| corners.map(|v| v * 0.999_f32.powf(number(i))))),
        (
            "equal centres",
            of(&mut |_| {
                let [a, b] = [point(1.0), point(1.0)];
                [a, b, -(a + b)]
            }),
        ),
        ("on a line", of(&mut |i| [Vec3::X, Vec3::X * 2.0, Vec3::Y].map(|v| v + Vec3::X * number(i)))),
        (
            "huge and tiny",
            of(&mut |i| {
                let size = 10.0_f32.powf(30.0 - number(i) / number(n - 1) * 60.0);
                [point(size), point(size), point(size)]
            }),
        ),
        ("without extent", of(&mut |_| [Vec3::ONE; 3])),
        ("not finite", of(&mut |i| [point(1.0), point(1.0), Vec3::splat([f32::NAN, f32::INFINITY, 1.0][i % 3])])),
    ]
}

/// The depth of the tree, and whether its boxes hold what is below them.
fn depth(tree: &Tree, triangles: &[Triangle], space: TreeSpace) -> usize {
    let mut seen = vec![false; triangles.len()];
    let mut deepest = 0;
    let everything = TreeBox { min: Vec3A::NEG_INFINITY, max: Vec3A::INFINITY };
    let mut pending: Vec<_> = tree.root.into_iter().map(|root| (root, everything, 1)).collect();
    while let Some((child, bounds, depth)) = pending.pop() {
        deepest = deepest.max(depth);
        let holds = |b: TreeBox| !b.min.cmplt(bounds.min).any() && !b.max.cmpgt(bounds.max).any();
        if child.triangles() > 0 {
            let leaf = &tree.leaves[child.index()];
            for &number in &leaf.numbers[..child.triangles() as usize] {
                assert!(!std::mem::replace(&mut seen[number as usize], true), "twice: {number}");
                assert!(holds(space.padded_box(&triangles[number as usize])) || !bounds.min.is_finite());
            }
            continue;
        }
        let node = &tree.nodes[child.index()];
        for (i, &child) in node.children.iter().enumerate() {
            let side =
                |upper: usize| Vec3A::from_array([0, 1, 2].map(|axis| node.planes[axis][upper][i / WIDTH][i % WIDTH]));
            let inner = TreeBox { min: side(0), max: side(1) };
            if inner.min.cmpgt(inner.max).all() {
                continue;
            }
            assert!(holds(inner));
            pending.push((child, inner, depth + 1));
        }
    }
    assert!(seen.iter().all(|&seen| seen));
    deepest
}

/// No input makes a deep tree or takes long: of a hundred thousand triangles a tenth of a second, with a wide
/// margin here for busy machines. (One after the other, obvhs took 26 s for the fan.)
#[test]
fn hard_inputs_take_neither_long_nor_deep_trees() {
    for (name, triangles) in hard(60_000).into_iter().chain([("none", vec![]), ("one", vec![hard(1)[0].1[0]])]) {
        let start = Instant::now();
        let tree = build(&triangles);
        assert!(start.elapsed() < Duration::from_secs(6), "{name}: {:?}", start.elapsed());
        if name != "not finite" {
            let depth = depth(&tree, &triangles, TreeSpace::new(&Bounds::of_triangles(&triangles)));
            assert!(depth <= 40, "{name}: {depth}");
        }
    }
    assert!(build(&vec![hard(1)[0].1[0]; 1_000_000]).nodes.len() < 200_000);
}

#[test]
fn the_tree_does_not_depend_on_the_number_of_threads() {
    let mut noise = fastrand::Rng::with_seed(2);
    let mut point = |size: f32| Vec3::new(noise.f32(), noise.f32(), noise.f32()) * size;
    let mut inputs = hard(10_000);
    let scattered = (0..150_000).map(|_| (point(1.0), point(0.02), point(0.02)));
    inputs.push(("scattered", scattered.map(|(o, a, b)| Triangle::new(o, o + a, o + b)).collect()));
    for (name, triangles) in inputs {
        if name == "scattered" {
            // So many that several threads divide them together.
            let space = TreeSpace::new(&Bounds::of_triangles(&triangles));
            assert!(depth(&build(&triangles), &triangles, space) <= 12);
        }
        let trees = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let tree = pool.install(|| build(&triangles));
            let nodes = tree.nodes.iter().map(|node| {
                (
                    node.planes.map(|p| p.map(|p| p.map(|v| v.to_array()))),
                    node.children.map(|c| (c.index(), c.triangles())),
                )
            });
            let nodes: Vec<_> = nodes.collect();
            (format!("{nodes:?}"), tree.leaves.iter().map(|leaf| leaf.numbers).collect::<Vec<_>>())
        });
        assert!(trees[0] == trees[1] && trees[0] == trees[2], "{name}");
    }
}

#[test]
fn few_triangles_become_the_cheapest_leaves() {
    let flat = |z: f32| Triangle::new(Vec3::Z * z, Vec3::X + Vec3::Z * z, Vec3::Y + Vec3::Z * z);
    // Two pairs far apart are two leaves, four together are one.
    assert_eq!(build(&[flat(0.0), flat(9.0), flat(0.01), flat(9.01)]).leaves.len(), 2);
    assert_eq!(build(&[flat(0.0), flat(0.02), flat(0.01), flat(0.03)]).leaves.len(), 1);
}
