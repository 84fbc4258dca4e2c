//! Whether a surface is closed, and where it is open.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use vdf_geometry::Triangle;

/// Borders that are this close, measured by the longest side of the shape, are one seam: programs compute the two sides of a seam apart.
const SEAM: f64 = 1e-5;

/// An edge at which a surface is not closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hole {
    /// The ends of the edge.
    pub(super) edge: [Vec3; 2],
    /// The number of the first triangle with that edge.
    pub(super) triangle: usize,
    /// True if the edge has a face on one side only; false if its faces are wound against each other.
    pub(super) is_border: bool,
}

type Key = [u32; 3];

/// The first edge, in the order of the triangles, that is not used as often one way as the other; `None` if the surface is closed.
pub(super) fn hole(triangles: &[Triangle]) -> Option<Hole> {
    let unbalanced = unbalanced(triangles, &HashMap::new());
    if unbalanced.is_empty() {
        return None;
    }
    // Only what is at a border can be a seam, which is little of most meshes.
    let names = weld(triangles, &unbalanced);
    let unbalanced = if names.is_empty() { unbalanced } else { self::unbalanced(triangles, &names) };
    let (edge, uses) = unbalanced.into_iter().min_by_key(|(_, uses)| uses.first)?;
    let position = |key: Key| Vec3::from_array(key.map(f32::from_bits));
    Some(Hole { edge: [position(edge.0), position(edge.1)], triangle: uses.first, is_border: uses.count == 1 })
}

#[derive(Clone, Copy, Debug, Default)]
struct Uses {
    /// Uses in one direction less those in the other.
    balance: i64,
    count: u64,
    /// The first triangle with the edge.
    first: usize,
}

fn key(v: Vec3) -> Key {
    // −0 and 0 are one place.
    (v + Vec3::ZERO).to_array().map(f32::to_bits)
}

fn unbalanced(triangles: &[Triangle], names: &HashMap<Key, Key>) -> HashMap<(Key, Key), Uses> {
    let mut edges: HashMap<_, Uses> = HashMap::with_capacity(triangles.len() * 3 / 2);
    for (index, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = triangle.vertices.map(key).map(|k| names.get(&k).copied().unwrap_or(k));
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if from == to {
                continue;
            }
            let (edge, direction) = if from < to { ((from, to), 1) } else { ((to, from), -1) };
            let uses = edges.entry(edge).or_insert(Uses { first: index, ..Uses::default() });
            uses.balance += direction;
            uses.count += 1;
        }
    }
    edges.retain(|_, uses| uses.balance != 0);
    edges
}

/// One name for all ends of borders that are within [`SEAM`] of each other. Cost: n log n, as each place looks at those in its own
/// cell and the next ones only.
fn weld(triangles: &[Triangle], edges: &HashMap<(Key, Key), Uses>) -> HashMap<Key, Key> {
    let vertices = || triangles.iter().flat_map(Triangle::vertices_f64);
    let low = vertices().fold(DVec3::INFINITY, DVec3::min);
    let high = vertices().fold(DVec3::NEG_INFINITY, DVec3::max);
    let cell = (high - low).max_element() * SEAM;
    let mut ends: Vec<Key> = edges.keys().flat_map(|(a, b)| [*a, *b]).collect();
    ends.sort_unstable();
    ends.dedup();
    let mut names = HashMap::new();
    let mut taken: HashMap<[i64; 3], Key> = HashMap::new();
    for end in ends {
        let p = (Vec3::from_array(end.map(f32::from_bits)).as_dvec3() - low) / cell;
        #[allow(clippy::cast_possible_truncation, reason = "it saturates; a cell is 1e-5 of the shape")]
        let at = p.round().to_array().map(|v| v as i64);
        let around = (0..27).map(|i| [at[0] + i % 3 - 1, at[1] + i / 3 % 3 - 1, at[2] + i / 9 - 1]);
        let near = around.filter_map(|cell| taken.get(&cell)).find(|&&other| {
            let q = (Vec3::from_array(other.map(f32::from_bits)).as_dvec3() - low) / cell;
            q.distance(p) <= 1.0
        });
        match near {
            Some(&name) => {
                names.insert(end, name);
            }
            None => {
                taken.entry(at).or_insert(end);
            }
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron.
    fn solid() -> Vec<Triangle> {
        let [a, b, c, d] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        vec![Triangle::new(a, c, b), Triangle::new(a, b, d), Triangle::new(b, c, d), Triangle::new(c, a, d)]
    }

    #[test]
    fn a_hole_is_found_where_it_is() {
        assert_eq!(hole(&solid()), None);
        let mut open = solid();
        open.pop();
        let found = hole(&open).expect("it is open");
        assert!(found.is_border && found.edge.contains(&Vec3::ZERO));
        let mut turned = solid();
        turned[3].vertices.swap(0, 1);
        assert!(!hole(&turned).expect("one face is turned").is_border);
    }

    #[test]
    fn rounding_at_a_seam_is_no_hole() {
        let mut seam = solid();
        seam[3].vertices[0].x += 1e-7;
        seam[3].vertices[1] = Vec3::new(-1e-17, 1e-8, -0.0);
        assert_eq!(hole(&seam), None);
        seam[3].vertices[0].x += 1e-3;
        assert!(hole(&seam).is_some());
    }
}
