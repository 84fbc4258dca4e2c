//! Spheres, disks and cylinders.

use glam::{DMat3, DMat4, DVec3};
use vdf_geometry::{CurvedKind, CurvedShape};

use super::super::properties::Object;
use crate::SceneError;

/// A sphere's axes may differ by this share: digits that a file has lost.
const ROUND: f64 = 1e-4;

/// The shape, if the object is a curved one.
pub(super) fn read(object: &mut Object<'_>, to_world: DMat4, flip: bool) -> Result<Option<CurvedShape>, SceneError> {
    let positive = |v: f64| v > 0.0;
    let (kind, local) = match object.kind() {
        "sphere" => {
            let centre = object.point("center")?.unwrap_or(DVec3::ZERO);
            let radius = object.float_where("radius", 1.0, positive, "positive")?;
            (CurvedKind::Sphere, DMat4::from_translation(centre) * DMat4::from_scale(DVec3::splat(radius)))
        }
        "disk" => (CurvedKind::Disk, DMat4::IDENTITY),
        "cylinder" => {
            let (p0, p1) = (object.point("p0")?.unwrap_or(DVec3::ZERO), object.point("p1")?.unwrap_or(DVec3::Z));
            let radius = object.float_where("radius", 1.0, positive, "positive")?;
            let Some(axis) = (p1 - p0).try_normalize() else {
                return Err(object.error("p0 and p1 are one point", "they are the ends of the axis"));
            };
            let (s, t) = axis.any_orthonormal_pair();
            let frame = DMat3::from_cols(s * radius, t * radius, p1 - p0);
            (CurvedKind::Cylinder, DMat4::from_mat3_translation(frame, p0))
        }
        _ => return Ok(None),
    };
    let m = to_world * local;
    let linear = DMat3::from_mat4(m);
    if kind != CurvedKind::Disk && !is_round(kind, linear) {
        let what = if kind == CurvedKind::Sphere { "an ellipsoid" } else { "a cylinder that is not round" };
        let message = format!("to_world makes it {what}, which is not supported; nor does Mitsuba draw one");
        return Err(object.error(message, "scale all axes alike"));
    }
    let shape = CurvedShape::new(kind, linear, m.w_axis.truncate(), flip);
    shape.map(Some).ok_or_else(|| {
        object.error("its transform cannot be inverted accurately", "its axes must not differ more than a thousandfold")
    })
}

/// Whether the axes across are equal and at right angles, and those of a cylinder at right angles to its own.
fn is_round(kind: CurvedKind, m: DMat3) -> bool {
    let size = m.x_axis.length();
    let across = |a: DVec3, b: DVec3| a.dot(b).abs() <= ROUND * a.length() * b.length();
    let equal = |a: DVec3| (a.length() / size - 1.0).abs() <= ROUND;
    let right = across(m.x_axis, m.y_axis) && across(m.y_axis, m.z_axis) && across(m.z_axis, m.x_axis);
    right && equal(m.y_axis) && (kind == CurvedKind::Cylinder || equal(m.z_axis))
}
