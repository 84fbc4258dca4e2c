//! `<transform>`: operations in listed order, the first acts first on the object.

use glam::{DMat3, DMat4, DVec3};

use super::Loader;
use super::document::{Element, Place};
use crate::SceneError;

/// A `rotate` axis this close to unit length is taken for a unit axis that was written with few digits.
const AXIS_TOLERANCE: f64 = 1e-3;

/// A finite number.
pub(super) fn parse(text: &str, at: &Place) -> Result<f64, SceneError> {
    let number = text.trim().parse::<f64>();
    number.ok().filter(|v| v.is_finite()).ok_or_else(|| at.error(format!("\"{text}\" is not a finite number"), ""))
}

/// The numbers of an attribute, separated by commas or spaces.
pub(super) fn numbers(element: &Element, name: &str) -> Result<Vec<f64>, SceneError> {
    let text = element.require(name)?;
    text.split(|c: char| c == ',' || c.is_whitespace())
        .filter(|part| !part.is_empty())
        .map(|part| parse(part, &element.at))
        .collect()
}

/// True for a `<transform>` of one matrix of nine numbers.
pub(super) fn is_three_by_three(element: &Element) -> bool {
    matches!(&element.children[..], [matrix] if matrix.tag == "matrix" && numbers(matrix, "value").is_ok_and(|m| m.len() == 9))
}

/// The matrix of a `<transform>`.
pub(super) fn read(loader: &Loader<'_>, element: &Element) -> Result<DMat4, SceneError> {
    let mut total = DMat4::IDENTITY;
    for child in &element.children {
        let step = match child.tag.as_str() {
            "translate" => DMat4::from_translation(xyz(child, 0.0)?),
            "scale" => DMat4::from_scale(xyz(child, 1.0)?),
            "rotate" => rotate(loader, child)?,
            "lookat" => lookat(child)?,
            "matrix" => matrix(child)?,
            other => {
                return Err(child.at.error(
                    format!("<{other}> inside <transform>"),
                    "supported: translate, scale, rotate, lookat, matrix",
                ));
            }
        };
        total = step * total;
    }
    let inverse = total.inverse();
    if !total.is_finite() || !inverse.is_finite() || total.determinant() == 0.0 {
        return Err(element.at.error("the transform cannot be inverted", "no scale factor may be 0 or overflow"));
    }
    Ok(total)
}

/// `x`, `y` and `z`, each `missing` if left out, or `value` with one or three numbers.
fn xyz(element: &Element, missing: f64) -> Result<DVec3, SceneError> {
    if element.attribute("value").is_some() {
        if element.attributes.len() > 1 {
            return Err(element.at.error("\"value\" together with other attributes", "write value, or x, y and z"));
        }
        return one_or_three(element);
    }
    components(element, missing)
}

/// `value` with one or three numbers.
fn one_or_three(element: &Element) -> Result<DVec3, SceneError> {
    match numbers(element, "value")?.as_slice() {
        [v] => Ok(DVec3::splat(*v)),
        [x, y, z] => Ok(DVec3::new(*x, *y, *z)),
        other => Err(element.at.error(format!("\"value\" has {} numbers", other.len()), "write one or three")),
    }
}

/// `x`, `y` and `z`, each `missing` if left out.
fn components(element: &Element, missing: f64) -> Result<DVec3, SceneError> {
    let axis = |name| element.attribute(name).map_or(Ok(missing), |a| parse(&a.value, &a.at));
    Ok(DVec3::new(axis("x")?, axis("y")?, axis("z")?))
}

/// Mitsuba does not normalise the axis. With another length than 1 its matrix is no rotation: a quarter turn about an axis of length 2 also
/// scales by 2. Such a matrix is what its users see, so it is ours, too, with a warning; only an axis that is a unit vector but for its digits is
/// made one.
fn rotate(loader: &Loader<'_>, element: &Element) -> Result<DMat4, SceneError> {
    let angle = parse(element.require("angle")?, &element.at)?.to_radians();
    let axis = if element.attribute("value").is_some() {
        if ["x", "y", "z"].iter().any(|name| element.attribute(name).is_some()) {
            return Err(element.at.error("\"value\" together with \"x\", \"y\" or \"z\"", "write one or the other"));
        }
        one_or_three(element)?
    } else {
        components(element, 0.0)?
    };
    let length = axis.length();
    if length == 0.0 {
        return Err(element.at.error("the rotation axis is zero", "write a unit vector, as in y=\"1\""));
    }
    if (length - 1.0).abs() <= AXIS_TOLERANCE {
        return Ok(DMat4::from_axis_angle(axis.normalize(), angle));
    }
    loader.warn(
        &element.at,
        &format!("the rotation axis has length {length}: as in Mitsuba, the matrix scales, too; a unit vector is probably meant"),
    );
    let (sin, cos) = angle.sin_cos();
    let cross = DMat3::from_cols(
        DVec3::new(0.0, axis.z, -axis.y),
        DVec3::new(-axis.z, 0.0, axis.x),
        DVec3::new(axis.y, -axis.x, 0.0),
    );
    let outer = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
    Ok(DMat4::from_mat3(DMat3::IDENTITY * cos + outer * (1.0 - cos) + cross * sin))
}

fn three(element: &Element, name: &str) -> Result<DVec3, SceneError> {
    match numbers(element, name)?.as_slice() {
        [x, y, z] => Ok(DVec3::new(*x, *y, *z)),
        other => Err(element.at.error(format!("\"{name}\" has {} numbers", other.len()), "write three")),
    }
}

fn lookat(element: &Element) -> Result<DMat4, SceneError> {
    let origin = three(element, "origin")?;
    let forward = (three(element, "target")? - origin).try_normalize();
    let forward = forward.ok_or_else(|| element.at.error("lookat: origin and target are the same point", ""))?;
    let up = if element.attribute("up").is_some() { three(element, "up")? } else { any_perpendicular(forward) };
    let left = up
        .cross(forward)
        .try_normalize()
        .filter(|left| left.is_finite() && up.normalize().cross(forward).length() > 1e-9);
    let left = left.ok_or_else(|| {
        element.at.error("lookat: \"up\" is parallel to the view direction", "choose another up vector")
    })?;
    let up = forward.cross(left);
    Ok(DMat4::from_cols(left.extend(0.0), up.extend(0.0), forward.extend(0.0), origin.extend(1.0)))
}

/// The vector that Mitsuba takes for `up` when there is none (Duff et al. 2017).
fn any_perpendicular(n: DVec3) -> DVec3 {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    DVec3::new(1.0 + sign * n.x * n.x * a, sign * n.x * n.y * a, -sign * n.x)
}

/// Row-major, acts on column vectors.
fn matrix(element: &Element) -> Result<DMat4, SceneError> {
    let values = numbers(element, "value")?;
    if let Ok(m) = <[f64; 9]>::try_from(values.as_slice()) {
        return Ok(DMat4::from_mat3(DMat3::from_cols_array(&m).transpose()));
    }
    let m = <[f64; 16]>::try_from(values.as_slice())
        .map_err(|_| element.at.error(format!("a matrix with {} numbers", values.len()), "write 16 or 9"))?;
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(element.at.error("the last row of the matrix is not 0 0 0 1", "projections are not supported"));
    }
    Ok(DMat4::from_cols_array(&m).transpose())
}
