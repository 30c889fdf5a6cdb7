//! Sensors. Mitsuba's camera looks along +z with +x to the left, MatEval's along -z with +x to the right.

use glam::{DMat3, DMat4, DVec3};
use mateval_dataset::{Camera, Intrinsics};
use mateval_files::untrusted::shortened;

use super::document::Element;
use super::reader::{Parameters, Reader, number};
use crate::log::Log;
use crate::open::Invalid;

/// The largest deviation of a matrix from a rotation that is not reported. Bitterli's scenes are written with six
/// digits.
const SKEW_WITHOUT_FINDING: f64 = 1e-4;

/// Mitsuba's focal length of a sensor that states none.
const DEFAULT_FOCAL_LENGTH: &str = "50mm";

/// The film's size and crop window in pixels.
struct Film {
    size: [f64; 2],
    crop_size: [f64; 2],
    crop_offset: [f64; 2],
}

impl<'a> Reader<'a> {
    /// The camera of the sensor `element`. Fails where it is no perspective camera or its `to_world` is faulty or
    /// singular.
    pub(super) fn sensor(&mut self, element: &'a Element) -> Result<Camera, Invalid> {
        let mut from = self.parameters(element, element.place());
        match element.kind() {
            "perspective" => {}
            "thinlens" => {
                let message = format!("line {}: the sensor 'thinlens'", element.line);
                self.log.warn(
                    "unsupported",
                    &from.place,
                    message,
                    "used a pinhole camera, which sees everything sharp",
                );
            }
            other => {
                let (line, kind) = (element.line, shortened(other));
                let expected = "expected 'perspective' (a pinhole camera)";
                return Err(Invalid(format!("line {line}: the sensor '{kind}' is not supported; {expected}")));
            }
        }
        let faulty = |expected: &str, found: &str| {
            let line = element.line;
            Invalid(format!("line {line}: expected {expected} to_world of the sensor, found {found}"))
        };
        let world_from_sensor = from.sound_transform("to_world", "there is no camera", &mut self.log);
        let world_from_sensor = world_from_sensor.ok_or_else(|| faulty("a readable", "one with a faulty step"))?;
        let films = from.objects("film");
        let film = match films.first() {
            Some(film) => self.film(film),
            None => Film { size: [768.0, 576.0], crop_size: [768.0, 576.0], crop_offset: [0.0; 2] },
        };
        let fov_x = self.fov_x(element.line, &mut from, film.size)?;
        let mut offset = |name| from.number_within(name, -10.0, 10.0, &mut self.log).unwrap_or(0.0);
        let principal = [offset("principal_point_offset_x"), offset("principal_point_offset_y")];
        from.objects("sampler");
        from.ignore(&["near_clip", "far_clip", "shutter_open", "shutter_close", "focus_distance", "aperture_radius"]);
        from.finish(&mut self.log);
        let camera = camera(world_from_sensor, intrinsics(&film, fov_x, principal), &element.place(), &mut self.log);
        camera.ok_or_else(|| faulty("an invertible", "a singular one"))
    }

    fn film(&mut self, element: &'a Element) -> Film {
        let mut from = self.parameters(element, element.place());
        let log = &mut self.log;
        let mut whole = |name, least, most| from.number_within(name, least, most, log).map(|v: f64| v.round());
        let size = [whole("width", 1.0, 65536.0).unwrap_or(768.0), whole("height", 1.0, 65536.0).unwrap_or(576.0)];
        let crop_offset = [
            whole("crop_offset_x", 0.0, size[0] - 1.0).unwrap_or(0.0),
            whole("crop_offset_y", 0.0, size[1] - 1.0).unwrap_or(0.0),
        ];
        let rest = [size[0] - crop_offset[0], size[1] - crop_offset[1]];
        let crop_size = [
            whole("crop_width", 1.0, rest[0]).unwrap_or(rest[0]),
            whole("crop_height", 1.0, rest[1]).unwrap_or(rest[1]),
        ];
        // The film's other parameters control how a picture is stored.
        from.take_all();
        Film { size, crop_size, crop_offset }
    }

    /// The horizontal field of view in radians.
    fn fov_x(&mut self, line: usize, from: &mut Parameters<'a>, [width, height]: [f64; 2]) -> Result<f64, Invalid> {
        // The tangent of half the angle, and the axis along which it is measured.
        let axis = from.string("fov_axis").unwrap_or("x");
        let focal_length = from.string("focal_length");
        let fov = from.number_within("fov", 1e-3, 179.9, &mut self.log);
        if fov.is_some() && focal_length.is_some() {
            let message = format!("line {line}: the sensor states both fov and focal_length, which Mitsuba refuses");
            self.log.warn("bad_value", &from.place, message, "used fov");
        }
        let (half_tangent, axis) = match fov {
            Some(degrees) => (libm::tan(degrees.to_radians() / 2.0), axis),
            None => {
                let text = focal_length.unwrap_or_else(|| {
                    let message = format!("line {line}: the sensor states neither fov nor focal_length");
                    let action = format!("used {DEFAULT_FOCAL_LENGTH}, as Mitsuba does");
                    self.log.warn("no_field_of_view", &from.place, message, action);
                    DEFAULT_FOCAL_LENGTH
                });
                // Mitsuba's convention: a film of 36 mm by 24 mm, measured along its diagonal.
                let faulty = |reason| Invalid(format!("line {line}: focal_length of the sensor: {reason}"));
                let millimetres = millimetres(text).map_err(faulty)?;
                ((36.0_f64 * 36.0 + 24.0 * 24.0).sqrt() / 2.0 / millimetres, "diagonal")
            }
        };
        // The same along x.
        let aspect = width / height;
        let half_width = match axis {
            "x" => half_tangent,
            "y" => half_tangent * aspect,
            "smaller" if aspect > 1.0 => half_tangent * aspect,
            "larger" if aspect < 1.0 => half_tangent * aspect,
            "smaller" | "larger" => half_tangent,
            "diagonal" => half_tangent / (1.0 + 1.0 / (aspect * aspect)).sqrt(),
            other => {
                let message = format!("the fov axis '{}' is not known", shortened(other));
                self.log.warn("bad_value", &from.place, message, "used x");
                half_tangent
            }
        };
        Ok(2.0 * libm::atan(half_width))
    }
}

/// A focal length as in `50mm`.
fn millimetres(text: &str) -> Result<f64, Invalid> {
    let found = number(text.trim().trim_end_matches("mm"))?;
    if found > 0.0 { Ok(found) } else { Err(Invalid(format!("expected a number above 0, found {found}"))) }
}

/// Intrinsics of the crop window, from the field of view of the whole film.
fn intrinsics(film: &Film, fov_x: f64, principal: [f64; 2]) -> Intrinsics {
    let focal = film.size[0] / 2.0 / libm::tan(fov_x / 2.0);
    let center = |axis: usize| film.size[axis] * (0.5 - principal[axis]) - film.crop_offset[axis];
    Intrinsics {
        width: film.crop_size[0] as u32,
        height: film.crop_size[1] as u32,
        fx: focal,
        fy: focal,
        cx: center(0),
        cy: center(1),
    }
}

/// A camera with the position and direction of view of a sensor's matrix, and its up vector as far as it is
/// perpendicular to the direction. None where the matrix is singular.
fn camera(world_from_sensor: DMat4, intrinsics: Intrinsics, place: &str, log: &mut Log) -> Option<Camera> {
    let sensor = DMat3::from_mat4(world_from_sensor);
    let back = (-sensor.z_axis).try_normalize()?;
    let up = (sensor.y_axis - back * back.dot(sensor.y_axis)).try_normalize()?;
    let rotation = DMat3::from_cols(up.cross(back), up, back);
    let wanted = DMat3::from_cols(-sensor.x_axis, sensor.y_axis, -sensor.z_axis);
    let miss = (rotation - wanted).to_cols_array().iter().fold(0.0_f64, |worst, v| worst.max(v.abs()));
    if miss > SKEW_WITHOUT_FINDING {
        let message =
            format!("expected a to_world of rotation and translation only, found one that deviates by {miss:.6}");
        log.warn("camera_not_rigid", place, message, "kept position, direction of view and up vector");
    }
    let position: DVec3 = world_from_sensor.w_axis.truncate();
    Some(Camera::from_rotation(rotation, position, intrinsics))
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::bitterli::tests::read_xml;

    fn sensor_camera(parameters: &str, film: &str) -> (Camera, Vec<String>) {
        let film = format!("<integer name='width' value='100'/><integer name='height' value='50'/>{film}");
        let scene = read_xml(&format!(
            "<scene version='3.0.0'><sensor type='perspective'>{parameters}<film type='hdrfilm'>{film}</film></sensor></scene>"
        ));
        let scene = scene.unwrap();
        (scene.camera.unwrap(), scene.findings.into_iter().map(|f| f.code).collect())
    }

    fn fov_x_degrees(camera: &Camera) -> f64 {
        2.0 * (f64::from(camera.intrinsics.width) / 2.0 / camera.intrinsics.fx).atan().to_degrees()
    }

    /// Values that Mitsuba 3.9.1 computes for a film of 100x50.
    #[test]
    fn fields_of_view_as_mitsuba() {
        for (axis, expected) in
            [("x", 60.0), ("y", 98.21321), ("smaller", 98.21321), ("larger", 60.0), ("diagonal", 54.623459)]
        {
            let (camera, findings) =
                sensor_camera(&format!("<float name='fov' value='60'/><string name='fovAxis' value='{axis}'/>"), "");
            assert!((fov_x_degrees(&camera) - expected).abs() < 1e-4, "{axis}");
            assert!(findings.is_empty());
        }
        let (camera, _) = sensor_camera("<string name='focal_length' value='50mm'/>", "");
        assert!((fov_x_degrees(&camera) - 42.311714).abs() < 1e-4);
    }

    /// Rays that Mitsuba 3.9.1 generates for an identity to_world, so +x is left and the view is along +z.
    #[test]
    fn rays_as_mitsuba() {
        let fov = "<float name='fov' value='90'/>";
        let (camera, _) = sensor_camera(fov, "");
        let half = std::f64::consts::FRAC_1_SQRT_2;
        assert!((camera.direction(DVec2::new(0.0, 25.0)) - DVec3::new(half, 0.0, half)).length() < 1e-6);
        assert!((camera.direction(DVec2::new(50.0, 0.0)) - DVec3::new(0.0, 0.447214, 0.894427)).length() < 1e-6);
        let offsets = "<float name='principal_point_offset_x' value='.1'/>\
                       <float name='principal_point_offset_y' value='.2'/>";
        let (camera, _) = sensor_camera(&format!("{fov}{offsets}"), "");
        let expected = DVec3::new(-0.19245, -0.19245, 0.96225);
        assert!((camera.direction(DVec2::new(50.0, 25.0)) - expected).length() < 1e-5);
        let crop = "<integer name='crop_width' value='50'/><integer name='crop_height' value='25'/>\
                    <integer name='crop_offset_x' value='10'/><integer name='crop_offset_y' value='5'/>";
        let (camera, _) = sensor_camera(fov, crop);
        assert_eq!((camera.intrinsics.width, camera.intrinsics.height), (50, 25));
        let expected = DVec3::new(0.596285, 0.298142, 0.745356);
        assert!((camera.direction(DVec2::ZERO) - expected).length() < 1e-6);
    }

    #[test]
    fn the_camera_is_a_rotation_even_if_the_sensor_is_not() {
        let scaled = "<float name='fov' value='60'/>\
                      <transform name='toWorld'><scale x='-1' y='2' z='3'/><translate x='4'/></transform>";
        let (camera, findings) = sensor_camera(scaled, "");
        assert_eq!(findings, ["camera_not_rigid"]);
        let rotation = camera.rotation();
        assert!((rotation.determinant() - 1.0).abs() < 1e-12);
        assert!((rotation * rotation.transpose() - DMat3::IDENTITY).to_cols_array().iter().all(|v| v.abs() < 1e-12));
        assert_eq!(camera.position(), DVec3::new(4.0, 0.0, 0.0));
        // Twin: without the scale there is no finding.
        let (_, findings) = sensor_camera("<float name='fov' value='60'/>", "");
        assert!(findings.is_empty());
    }

    /// Mitsuba 3.9.1 has an x_fov of 38.18 degrees for a film of 4:3.
    #[test]
    fn a_sensor_without_fov_has_50_mm() {
        let (camera, findings) = sensor_camera("", "");
        assert!((fov_x_degrees(&camera) - 42.311714).abs() < 1e-4);
        assert_eq!(findings, ["no_field_of_view"]);
        let four_to_three = "<scene version='3.0.0'><sensor type='perspective'/></scene>";
        assert!((fov_x_degrees(&read_xml(four_to_three).unwrap().camera.unwrap()) - 38.18).abs() < 5e-3);
    }

    #[test]
    fn two_statements_of_the_field_of_view_are_a_finding() {
        let both = "<float name='fov' value='60'/><string name='focal_length' value='35mm'/>";
        let (camera, findings) = sensor_camera(both, "");
        assert!((fov_x_degrees(&camera) - 60.0).abs() < 1e-4);
        assert_eq!(findings, ["bad_value"]);
    }

    #[test]
    fn other_sensors_are_named() {
        let error = read_xml("<scene version='3.0.0'><sensor type='orthographic'/></scene>").unwrap_err();
        assert!(error.to_string().contains("'orthographic' is not supported"), "{error}");
    }

    #[test]
    fn without_a_usable_camera_there_is_no_scene() {
        for sensor in [
            "",
            "<sensor type='perspective'><float name='fov' value='50'/>\
             <transform name='toWorld'><scale value='0'/></transform></sensor>",
            "<sensor type='perspective'><float name='fov' value='50'/>\
             <transform name='toWorld'><translate x='nan'/></transform></sensor>",
        ] {
            assert!(read_xml(&format!("<scene version='0.6.0'>{sensor}</scene>")).is_err());
        }
    }
}
