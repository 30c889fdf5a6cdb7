//! `<transform>`: its elements in order, each applied after those before it.

use glam::{DMat3, DMat4, DVec3};

use super::document::Element;
use super::value::{number, numbers, vector};
use crate::log::Log;

/// The product of a transform's elements. A faulty element is a finding and counts as the identity.
pub(super) fn read(transform: &Element, place: &str, log: &mut Log) -> DMat4 {
    let mut product = DMat4::IDENTITY;
    for element in &transform.children {
        match step(element) {
            Ok(matrix) => product = matrix * product,
            Err(what) => {
                let message =
                    format!("line {}: <{}>: {what}", element.line, mateval_scene::findings::shortened(&element.tag));
                log.warn("bad_transform", place, message, "left this step out");
            }
        }
    }
    if product.to_cols_array().iter().all(|v| v.is_finite()) {
        product
    } else {
        log.warn("bad_transform", place, "the product of the transform's steps overflows", "used the identity");
        DMat4::IDENTITY
    }
}

fn step(element: &Element) -> Result<DMat4, String> {
    let sized = |missing| vector(element, missing).map(DVec3::from_array);
    match element.tag.as_str() {
        "matrix" => matrix(element.attribute("value").unwrap_or("")),
        "translate" => Ok(DMat4::from_translation(sized(0.0)?)),
        "scale" => Ok(DMat4::from_scale(sized(1.0)?)),
        "rotate" => {
            let angle = number(element.attribute("angle").unwrap_or(""))?;
            let axis = sized(0.0)?.try_normalize().ok_or("expected an axis, found a vector of length 0")?;
            Ok(DMat4::from_mat3(rotation(axis, angle.to_radians())))
        }
        "lookat" => look_at(element),
        _ => Err("expected matrix, translate, rotate, scale or lookat".to_owned()),
    }
}

/// Row-major: 16 numbers, or 9 without translation.
fn matrix(text: &str) -> Result<DMat4, String> {
    let list = numbers(text)?;
    if let Ok(rows) = <[f64; 16]>::try_from(list.as_slice()) {
        if rows[12..] != [0.0, 0.0, 0.0, 1.0] {
            return Err("expected a last row of 0 0 0 1, found a projection".to_owned());
        }
        return Ok(DMat4::from_cols_array(&rows).transpose());
    }
    match <[f64; 9]>::try_from(list.as_slice()) {
        Ok(rows) => Ok(DMat4::from_mat3(DMat3::from_cols_array(&rows).transpose())),
        Err(_) => Err(format!("expected 16 or 9 numbers, found {}", list.len())),
    }
}

/// Rotation by `angle` radians about the unit vector `axis`, by Rodrigues' formula.
pub(super) fn rotation(axis: DVec3, angle: f64) -> DMat3 {
    let (sin, cos) = libm::sincos(angle);
    let turned = |v: DVec3| v * cos + axis.cross(v) * sin + axis * axis.dot(v) * (1.0 - cos);
    DMat3::from_cols(turned(DVec3::X), turned(DVec3::Y), turned(DVec3::Z))
}

/// Mitsuba's camera space: +z towards the target, +y up, +x left.
fn look_at(element: &Element) -> Result<DMat4, String> {
    let point = |key| -> Result<Option<DVec3>, String> {
        let Some(text) = element.attribute(key) else { return Ok(None) };
        let list = numbers(text)?;
        let array = <[f64; 3]>::try_from(list.as_slice()).map_err(|_| format!("{key}: expected 3 numbers"))?;
        Ok(Some(DVec3::from_array(array)))
    };
    let (origin, target) = (point("origin")?.ok_or("no origin")?, point("target")?.ok_or("no target")?);
    let forward = (target - origin).try_normalize().ok_or("origin and target are the same point")?;
    let up = match point("up")? {
        Some(up) => up,
        None if forward.y.abs() < 0.999 => DVec3::Y,
        None => DVec3::Z,
    };
    let left = up.cross(forward).try_normalize().ok_or("up lies along the direction of view")?;
    let rotation = DMat3::from_cols(left, forward.cross(left), forward);
    Ok(DMat4::from_translation(origin) * DMat4::from_mat3(rotation))
}

#[cfg(test)]
mod tests {
    use super::super::document::Document;
    use super::super::limits::Limits;
    use super::*;

    fn read_text(steps: &str) -> (DMat4, usize) {
        let mut log = Log::new("scene.xml".into(), 100);
        let text = format!("<scene version='3.0.0'><transform>{steps}</transform></scene>");
        let document =
            Document::parse(std::path::Path::new("a"), &text, &Limits::default(), &mut log).expect("sound XML");
        let matrix = read(&document.root.children[0], "shape", &mut log);
        (matrix, log.into_findings().len())
    }

    /// Mitsuba 3.9.1 gives a rectangle under this transform the box (0, -2, -4) to (0, 2, 0).
    #[test]
    fn each_step_is_applied_after_those_before() {
        let (matrix, _) = read_text("<translate x='1'/><scale value='2'/><rotate y='1' angle='90'/>");
        let corner = |x, y| matrix.transform_point3(DVec3::new(x, y, 0.0));
        assert!((corner(1.0, 1.0) - DVec3::new(0.0, 2.0, -4.0)).length() < 1e-12);
        assert!((corner(-1.0, -1.0) - DVec3::new(0.0, -2.0, 0.0)).length() < 1e-12);
        // Twin: the other order is another transform.
        let (other, _) = read_text("<rotate y='1' angle='90'/><scale value='2'/><translate x='1'/>");
        assert!((other.transform_point3(DVec3::X) - matrix.transform_point3(DVec3::X)).length() > 0.5);
    }

    /// Mitsuba 3.9.1's matrix for the same lookat.
    #[test]
    fn look_at_as_mitsuba() {
        let expected = read_text("<matrix value='0 0 1 1 0 1 0 2 -1 0 0 3 0 0 0 1'/>").0;
        for tag in ["lookat", "look_at", "lookAt"] {
            let (matrix, findings) = read_text(&format!("<{tag} origin='1,2,3' target='4 2 3' up='0, 1, 0'/>"));
            assert_eq!((matrix, findings), (expected, 0));
        }
    }

    #[test]
    fn faulty_steps_are_findings() {
        for bad in [
            "<matrix value='1 2 3'/>",
            "<matrix value='1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1'/>",
            "<rotate angle='3'/>",
            "<rotate x='1' angle='nan'/>",
            "<skew/>",
            "<lookat origin='0 0 0' target='0 0 0'/>",
            "<scale value='1e308'/><scale value='1e308'/>",
        ] {
            assert_eq!(read_text(bad), (DMat4::IDENTITY, 1), "{bad}");
        }
    }
}
