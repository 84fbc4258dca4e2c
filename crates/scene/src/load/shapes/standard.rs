//! Shapes without a file.

use glam::{DVec3, Vec2};

use super::placement::Placement;

/// [−1, 1]³, normals outward. Texture coordinates as Mitsuba 3.9.1 has them.
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
            let uv = |p: DVec3| {
                let (u, v) = match axis {
                    0 => (p.y, -sign * p.z),
                    1 if sign > 0.0 => (-p.x, -p.z),
                    1 => (p.z, p.x),
                    _ => (sign * p.y, p.x),
                };
                unit_square(u, v)
            };
            placed.push_quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], uv);
        }
    }
}

/// [−1, 1]² at z = 0, normal +Z.
pub(super) fn rectangle(placed: &mut Placement) {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 0.0));
    placed.push_quad(corners, |p| unit_square(p.x, p.y));
}

/// From [−1, 1]² to [0, 1]².
fn unit_square(u: f64, v: f64) -> Vec2 {
    Vec2::new((0.5 * (u + 1.0)) as f32, (0.5 * (v + 1.0)) as f32)
}
