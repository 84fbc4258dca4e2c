//! Shapes without a file.

use glam::DVec3;

use super::placement::Placement;

/// [−1, 1]³, normals outward.
pub(super) fn cube(placed: &mut Placement) {
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let corner = |u: f64, v: f64| {
                let mut p = [0.0; 3];
                p[axis] = sign;
                // (u, v, axis) is right-handed; for the lower face u is turned round to look outward.
                p[(axis + 1) % 3] = u * sign;
                p[(axis + 2) % 3] = v;
                DVec3::from_array(p)
            };
            let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            placed.push([a, b, c]);
            placed.push([a, c, d]);
        }
    }
}

/// [−1, 1]² at z = 0, normal +Z.
pub(super) fn rectangle(placed: &mut Placement) {
    let [a, b, c, d] = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 0.0));
    placed.push([a, b, c]);
    placed.push([a, c, d]);
}
