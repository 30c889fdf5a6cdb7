//! `<transform>`: a product of steps, each applied after those before it.

use glam::{DMat3, DMat4, DVec3};

use super::document::Element;
use super::error::ValueError;
use super::value::{number, numbers, vector};
use crate::source_scene::Log;

/// The last row of a matrix that is no projection.
const AFFINE: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
/// The largest deviation from [`AFFINE`] that counts as noise.
const AFFINE_TOLERANCE: f64 = 1e-6;

/// Why a step of a transform is not a matrix.
#[derive(Debug, thiserror::Error)]
enum StepError {
    #[error(transparent)]
    Value(#[from] ValueError),
    #[error("{key}: {reason}")]
    Point { key: &'static str, reason: ValueError },
    #[error("expected {key}, found none")]
    MissingPoint { key: &'static str },
    #[error("expected matrix, translate, rotate, scale or lookat")]
    UnknownStep,
    #[error("expected a last row of 0 0 0 1, found a projection")]
    Projection,
    #[error("expected an axis, found a vector of length 0")]
    NoAxis,
    #[error("expected origin and target to differ")]
    NoDirection,
    #[error("expected an up vector that is not parallel to the direction of view")]
    UpAlongView,
}

/// The product of a transform's steps. A transform with a faulty step gives none and is a finding with this `action`: without
/// that step, it would put its object elsewhere.
pub(super) fn read(transform: &Element, place: &str, action: &str, log: &mut Log) -> Option<DMat4> {
    if transform.tag != "transform" {
        let tag = mateval_scene::findings::shortened(&transform.tag);
        let message = format!("line {}: expected a <transform>, found <{tag}>", transform.line);
        log.warn("bad_transform", place, message, action);
        return None;
    }
    let mut is_sound = true;
    let mut product = DMat4::IDENTITY;
    for element in &transform.children {
        match step(element) {
            Ok(matrix) => product = matrix * product,
            Err(error) => {
                let tag = mateval_scene::findings::shortened(&element.tag);
                let message = format!("line {}: <{tag}>: {error}", element.line);
                log.warn("bad_transform", place, message, action);
                is_sound = false;
            }
        }
    }
    if product.to_cols_array().iter().all(|v| v.is_finite()) {
        return is_sound.then_some(product);
    }
    log.warn("bad_transform", place, "the product of the transform's steps overflows", action);
    None
}

fn step(element: &Element) -> Result<DMat4, StepError> {
    let vector = |missing| vector(element, missing).map(DVec3::from_array);
    match element.tag.as_str() {
        "matrix" => matrix(element.attribute("value").unwrap_or("")),
        "translate" => Ok(DMat4::from_translation(vector(0.0)?)),
        "scale" => Ok(DMat4::from_scale(vector(1.0)?)),
        "rotate" => {
            let angle = number(element.attribute("angle").unwrap_or(""))?;
            let axis = vector(0.0)?.try_normalize().ok_or(StepError::NoAxis)?;
            Ok(DMat4::from_mat3(rotation(axis, angle.to_radians())))
        }
        "lookat" => look_at(element),
        _ => Err(StepError::UnknownStep),
    }
}

/// A row-major matrix of 16 numbers, or of 9 without translation.
fn matrix(text: &str) -> Result<DMat4, StepError> {
    let list = numbers(text)?;
    if let Ok(rows) = <[f64; 16]>::try_from(list.as_slice()) {
        // A matrix that was inverted elsewhere has noise in its last row.
        let miss = rows[12..].iter().zip(AFFINE).map(|(found, expected)| (found - expected).abs());
        if miss.fold(0.0, f64::max) > AFFINE_TOLERANCE {
            return Err(StepError::Projection);
        }
        let mut rows = rows;
        rows[12..].copy_from_slice(&AFFINE);
        return Ok(DMat4::from_cols_array(&rows).transpose());
    }
    match <[f64; 9]>::try_from(list.as_slice()) {
        Ok(rows) => Ok(DMat4::from_mat3(DMat3::from_cols_array(&rows).transpose())),
        Err(_) => Err(ValueError::Count { expected: "16 or 9", found: list.len() }.into()),
    }
}

/// Rotation by `angle` radians about the unit vector `axis`, by Rodrigues' formula.
pub(super) fn rotation(axis: DVec3, angle: f64) -> DMat3 {
    let (sin, cos) = libm::sincos(angle);
    let turned = |v: DVec3| v * cos + axis.cross(v) * sin + axis * axis.dot(v) * (1.0 - cos);
    DMat3::from_cols(turned(DVec3::X), turned(DVec3::Y), turned(DVec3::Z))
}

/// The transform from Mitsuba's camera space: +z towards the target, +y up, +x left.
fn look_at(element: &Element) -> Result<DMat4, StepError> {
    let given = |key| -> Result<Option<DVec3>, StepError> {
        let Some(text) = element.attribute(key) else { return Ok(None) };
        let list = numbers(text).map_err(|reason| StepError::Point { key, reason })?;
        let count = ValueError::Count { expected: "3", found: list.len() };
        let point = <[f64; 3]>::try_from(list).map_err(|_| StepError::Point { key, reason: count })?;
        Ok(Some(DVec3::from_array(point)))
    };
    let needed = |key| given(key)?.ok_or(StepError::MissingPoint { key });
    let (origin, target) = (needed("origin")?, needed("target")?);
    let forward = (target - origin).try_normalize().ok_or(StepError::NoDirection)?;
    let up = match given("up")? {
        Some(up) => up,
        None if forward.y.abs() < 0.999 => DVec3::Y,
        None => DVec3::Z,
    };
    let left = up.cross(forward).try_normalize().ok_or(StepError::UpAlongView)?;
    let rotation = DMat3::from_cols(left, forward.cross(left), forward);
    Ok(DMat4::from_translation(origin) * DMat4::from_mat3(rotation))
}

#[cfg(test)]
mod tests {
    use super::super::document::Document;
    use super::*;

    fn read_text(steps: &str) -> (DMat4, usize) {
        let (matrix, findings) = read_faulty(steps);
        (matrix.unwrap(), findings)
    }

    fn read_faulty(steps: &str) -> (Option<DMat4>, usize) {
        let mut log = Log::new("scene.xml".into(), 100);
        let text = format!("<scene version='3.0.0'><transform>{steps}</transform></scene>");
        let document = Document::parse_text(&text, &mut log).unwrap();
        let matrix = read(&document.root.children[0], "shape", "left it out", &mut log);
        (matrix, log.into_findings().len())
    }

    /// In Mitsuba 3.9.1 a rectangle under this transform has the bounding box (0, -2, -4) to (0, 2, 0).
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
    fn noise_in_the_last_row_is_dropped() {
        let noisy = read_text("<matrix value='2 0 0 1 0 2 0 2 0 0 2 3 0 -1e-9 5.9e-08 0.9999999'/>");
        assert_eq!(noisy, read_text("<matrix value='2 0 0 1 0 2 0 2 0 0 2 3 0 0 0 1'/>"));
        assert_eq!(noisy.1, 0);
    }

    #[test]
    fn faulty_steps_are_findings_and_give_no_transform() {
        for bad in [
            "<matrix value='1 2 3'/>",
            "<matrix value='1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1'/>",
            "<matrix value='1 0 0 0 0 1 0 0 0 0 1 0 0 0 2e-6 1'/>",
            "<matrix value='2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 2'/>",
            "<translate x='nan'/>",
            "<rotate angle='3'/>",
            "<rotate x='1' angle='nan'/>",
            "<skew/>",
            "<lookat origin='0 0 0' target='0 0 0'/>",
            "<scale value='1e308'/><scale value='1e308'/>",
        ] {
            assert_eq!(read_faulty(bad), (None, 1), "{bad}");
        }
    }
}
