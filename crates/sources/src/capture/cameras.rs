//! The cameras of a capture: what all formats state of one, and nerfstudio's `transforms.json`.
//!
//! Poses are kept as the rotation and place of a camera that looks along its -Z with +Y up, as OpenGL's and ours do.

use std::path::Path;

use glam::{DMat3, DMat4, DVec3};
use mateval_dataset::lens::Lens;
use mateval_files::untrusted::quoted;
use serde::Deserialize;

use crate::open::{Invalid, check_json};

/// The most cameras of a capture.
pub(super) const MOST_CAMERAS: usize = 100_000;
/// Most values and most lists and objects of `transforms.json`.
const JSON_LIMITS: (usize, usize) = (40 * MOST_CAMERAS, 10 * MOST_CAMERAS);
/// Largest deviation of a stated rotation from orthonormality.
const ROTATION_SLACK: f64 = 1e-3;

/// A camera as a file states it.
#[derive(Clone, Debug, PartialEq)]
pub struct CapturedCamera {
    /// The photo that it took.
    pub photo: PhotoName,
    /// The camera's axes as columns, in the file's world.
    pub rotation: DMat3,
    /// In the file's unit.
    pub position: DVec3,
    /// Its size is 0 where the file states none: it is that of the photo.
    pub lens: Lens,
}

impl CapturedCamera {
    /// The poses of the camera if the file follows another convention than the one of its format, or if the mesh was turned
    /// and the cameras were not. Each comes with the change to the stated pose in words.
    pub fn other_poses(&self) -> impl Iterator<Item = (&'static str, Self)> {
        let posed = |rotation: DMat3, position: DVec3| Self { rotation, position, ..self.clone() };
        let half = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let inverse = self.rotation.transpose();
        let back = -(inverse * self.position);
        let quarter = DMat3::from_rotation_x(std::f64::consts::FRAC_PI_2);
        let turned = |turn: DMat3| posed(turn * self.rotation, turn * self.position);
        [
            ("the camera's y and z axes flipped", posed(self.rotation * half, self.position)),
            ("the matrix inverted", posed(inverse, back)),
            ("the matrix inverted, then the camera's y and z axes flipped", posed(inverse * half, back)),
            ("the camera's y and z axes flipped before and after inverting", posed(half * inverse * half, half * back)),
            ("their world turned by 90 degrees about x", turned(quarter)),
            ("their world turned by -90 degrees about x", turned(quarter.transpose())),
        ]
        .into_iter()
    }
}

/// How a file of cameras names the photo of a camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PhotoName {
    /// A file name or path, relative to the folder of the cameras or of the photos.
    File(String),
    /// The photo's place among all photos in the order of their names, from 0.
    Number(usize),
}

/// All cameras of a file or folder.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cameras {
    pub(super) all: Vec<CapturedCamera>,
    /// A transform that the file says was applied to its poses, and that the mesh must have had too.
    pub(super) is_transformed: bool,
}

/// The camera with the rotation and translation that take the world to OpenCV's axes (+X right, +Y down, +Z ahead).
/// `what` names it in errors.
pub(super) fn of_opencv(
    what: &str,
    photo: PhotoName,
    rotation: DMat3,
    translation: DVec3,
    lens: Lens,
) -> Result<CapturedCamera, Invalid> {
    let world_from_opencv = rotation.transpose();
    let to_ours = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    of_pose(what, photo, world_from_opencv * to_ours, -(world_from_opencv * translation), lens)
}

/// The camera with these axes and this place, if it is one.
pub(super) fn of_pose(
    what: &str,
    photo: PhotoName,
    axes: DMat3,
    position: DVec3,
    lens: Lens,
) -> Result<CapturedCamera, Invalid> {
    let invalid = |why: String| Err(Invalid(format!("{what}: {why}")));
    if !(axes.is_finite() && position.is_finite()) {
        return invalid("its pose holds numbers that are not finite".to_owned());
    }
    let is_rotation = (axes.transpose() * axes).abs_diff_eq(DMat3::IDENTITY, ROTATION_SLACK);
    if !is_rotation || axes.determinant() < 0.0 {
        let found = if is_rotation { "a mirrored one" } else { "one that is scaled or sheared" };
        return invalid(format!("expected a rotation, found {found}"));
    }
    let numbers = [lens.fx, lens.fy, lens.cx, lens.cy, lens.k1, lens.k2, lens.p1, lens.p2];
    if !(numbers.iter().all(|number| number.is_finite()) && lens.fx > 0.0 && lens.fy > 0.0) {
        let (fx, fy) = (lens.fx, lens.fy);
        return invalid(format!("expected finite numbers and focal lengths above 0, found fx {fx} and fy {fy}"));
    }
    // Stated digits are rounded; what follows needs a rotation to the last bit.
    let x = axes.x_axis.normalize();
    let y = (axes.y_axis - x * x.dot(axes.y_axis)).normalize();
    Ok(CapturedCamera { photo, rotation: DMat3::from_cols(x, y, x.cross(y)), position, lens })
}

/// `transforms.json`. Unknown keys are those of other programs.
#[derive(Deserialize)]
struct Transforms {
    #[serde(flatten)]
    shared: FrameLens,
    frames: Vec<Frame>,
    applied_transform: Option<Vec<Vec<f64>>>,
}

#[derive(Deserialize)]
struct Frame {
    file_path: String,
    transform_matrix: Vec<Vec<f64>>,
    #[serde(flatten)]
    own: FrameLens,
}

/// What a frame, or the file for all frames, states of the lens.
#[derive(Clone, Default, Deserialize)]
struct FrameLens {
    camera_model: Option<String>,
    camera_angle_x: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

/// The models whose lens is a pinhole with `k1`, `k2`, `p1`, `p2`.
const MODELS: [&str; 6] = ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "PERSPECTIVE"];

impl FrameLens {
    /// The lens of a frame with these keys, where the file states others for all frames.
    fn lens(&self, shared: &Self, what: &str) -> Result<Lens, Invalid> {
        let invalid = |why: String| Invalid(format!("{what}: {why}"));
        if let Some(model) = self.camera_model.as_ref().or(shared.camera_model.as_ref())
            && !MODELS.contains(&model.as_str())
        {
            let kind = if model.to_uppercase().contains("FISHEYE") { "a fisheye" } else { "no perspective camera" };
            let action = "undistort its photos to a pinhole first";
            return Err(invalid(format!("camera_model {} is {kind}, which is not read; {action}", quoted(model))));
        }
        let of = |key: fn(&Self) -> Option<f64>| key(self).or_else(|| key(shared));
        if let Some(k) = of(|lens| lens.k3).into_iter().chain(of(|lens| lens.k4)).find(|k| *k != 0.0) {
            let expected = "expected k1, k2, p1 and p2 alone; undistort its photos first";
            return Err(invalid(format!("k3 or k4 is {k}, which is not read: {expected}")));
        }
        let size = |key: fn(&Self) -> Option<f64>| match of(key) {
            Some(side) if side.fract() != 0.0 || !(1.0..=65_536.0).contains(&side) => {
                Err(invalid(format!("expected w and h of 1 to 65536, found {side}")))
            }
            side => Ok(side.unwrap_or(0.0) as u32),
        };
        let (width, height) = (size(|lens| lens.w)?, size(|lens| lens.h)?);
        let by_angle = of(|lens| lens.camera_angle_x).filter(|_| width > 0);
        let by_angle = by_angle.map(|angle| f64::from(width) / 2.0 / libm::tan(angle / 2.0));
        let fx = of(|lens| lens.fl_x).or(by_angle);
        let fx = fx.ok_or_else(|| invalid("expected fl_x, or camera_angle_x with w, found neither".to_owned()))?;
        let middle = |side: u32| (side > 0).then(|| f64::from(side) / 2.0);
        let centre = of(|lens| lens.cx).or(middle(width)).zip(of(|lens| lens.cy).or(middle(height)));
        let (cx, cy) = centre.ok_or_else(|| invalid("expected cx and cy, or w and h, found neither".to_owned()))?;
        let distortion = |key: fn(&Self) -> Option<f64>| of(key).unwrap_or(0.0);
        Ok(Lens {
            width,
            height,
            fx,
            fy: of(|lens| lens.fl_y).unwrap_or(fx),
            cx,
            cy,
            k1: distortion(|lens| lens.k1),
            k2: distortion(|lens| lens.k2),
            p1: distortion(|lens| lens.p1),
            p2: distortion(|lens| lens.p2),
        })
    }
}

/// The cameras of nerfstudio's `transforms.json`.
pub(super) fn of_transforms(bytes: &[u8]) -> Result<Cameras, Invalid> {
    check_json(bytes, JSON_LIMITS.0, JSON_LIMITS.1)?;
    let file: Transforms =
        serde_json::from_slice(bytes).map_err(|error| Invalid(format!("not nerfstudio's transforms.json: {error}")))?;
    let camera = |(at, frame): (usize, Frame)| {
        let what = format!("/frames/{at}");
        let lens = frame.own.lens(&file.shared, &what)?;
        let rows: Option<Vec<[f64; 4]>> =
            frame.transform_matrix.iter().map(|row| row.as_slice().try_into().ok()).collect();
        let matrix = match rows.as_deref() {
            Some(&[x, y, z]) | Some(&[x, y, z, [0.0, 0.0, 0.0, 1.0]]) => [x, y, z, [0.0, 0.0, 0.0, 1.0]],
            _ => {
                let expected = "expected 3 or 4 rows of 4 numbers, the last of 4 being 0, 0, 0, 1";
                return Err(Invalid(format!("{what}/transform_matrix: {expected}")));
            }
        };
        let matrix = DMat4::from_cols_array_2d(&matrix).transpose();
        of_pose(&what, PhotoName::File(frame.file_path), DMat3::from_mat4(matrix), matrix.w_axis.truncate(), lens)
    };
    let all = file.frames.into_iter().enumerate().map(camera).collect::<Result<_, _>>()?;
    let identity = |rows: &Vec<Vec<f64>>| {
        let is_one = |row: usize, column: usize, value: f64| value == if row == column { 1.0 } else { 0.0 };
        rows.iter().enumerate().all(|(row, all)| all.iter().enumerate().all(|(at, value)| is_one(row, at, *value)))
    };
    Ok(Cameras { all, is_transformed: file.applied_transform.is_some_and(|rows| !identity(&rows)) })
}

/// The number of the camera whose photo has this name: its whole path, its file name, or that without its ending.
/// `photos` are the names of all photos in their order, for cameras that are only numbered.
pub(super) fn find(cameras: &[CapturedCamera], photos: &[String], wanted: &str) -> Result<usize, Invalid> {
    let stem = |name: &str| Path::new(name).file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let is_wanted =
        |name: &str| name == wanted || name.rsplit('/').next() == Some(wanted) || stem(name).as_deref() == Some(wanted);
    let name = |camera: &CapturedCamera| match &camera.photo {
        PhotoName::File(name) => Some(name.clone()),
        PhotoName::Number(number) => photos.get(*number).cloned(),
    };
    let numbers = cameras.iter().filter(|camera| matches!(camera.photo, PhotoName::Number(_))).count();
    if numbers > 0 && photos.len() != numbers {
        return Err(Invalid(format!(
            "{numbers} cameras are numbered, and the folder holds {} photos; expected as many",
            photos.len()
        )));
    }
    let mut found = (0..cameras.len()).filter(|at| name(&cameras[*at]).is_some_and(|name| is_wanted(&name)));
    match (found.next(), found.next()) {
        (Some(at), None) => Ok(at),
        (Some(_), Some(_)) => Err(Invalid(format!("several cameras took a photo {}; name its path", quoted(wanted)))),
        (None, _) => {
            let known: Vec<String> = cameras.iter().take(8).filter_map(name).map(|name| quoted(&name)).collect();
            let more = if cameras.len() > 8 { format!(" and {} more", cameras.len() - 8) } else { String::new() };
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            Err(Invalid(format!("no camera took a photo {}; there are those of {known}{more}", quoted(wanted))))
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use serde_json::json;

    use super::*;

    pub(in crate::capture) fn lens() -> Lens {
        Lens { width: 64, height: 48, fx: 50.0, fy: 51.0, cx: 31.0, cy: 25.0, k1: 0.0, k2: 0.0, p1: 0.0, p2: 0.0 }
    }

    /// A pose without any symmetry.
    pub(in crate::capture) fn pose() -> (DMat3, DVec3) {
        (DMat3::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0), DVec3::new(1.5, -0.25, 3.0))
    }

    fn frame(extra: serde_json::Value) -> serde_json::Value {
        let (axes, position) = pose();
        let row = |at: usize| [axes.row(at).x, axes.row(at).y, axes.row(at).z, position[at]];
        let mut frame = json!({ "file_path": "images/0001.png",
            "transform_matrix": [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]] });
        let (frame_map, extra) = (frame.as_object_mut().unwrap(), extra.as_object().unwrap().clone());
        frame_map.extend(extra);
        frame
    }

    fn read(file: &serde_json::Value) -> Result<Cameras, String> {
        of_transforms(file.to_string().as_bytes()).map_err(|fault| fault.0)
    }

    #[test]
    fn frames_have_the_lens_of_the_file_or_their_own() {
        let of_all = json!({ "fl_x": 50.0, "fl_y": 51.0, "cx": 31.0, "cy": 25.0, "w": 64, "h": 48, "k1": -0.2 });
        let mut file = of_all;
        file["frames"] = json!([frame(json!({})), frame(json!({ "file_path": "b/2.png", "fl_x": 60.0, "k1": 0.1 }))]);
        let cameras = read(&file).unwrap();
        let (axes, position) = pose();
        let [a, b] = &cameras.all[..] else { panic!() };
        assert!(a.rotation.abs_diff_eq(axes, 1e-12) && a.position == position && !cameras.is_transformed);
        assert_eq!(a.lens, Lens { k1: -0.2, ..lens() });
        assert_eq!((b.lens, &b.photo), (Lens { fx: 60.0, k1: 0.1, ..lens() }, &PhotoName::File("b/2.png".to_owned())));
        assert_eq!(find(&cameras.all, &[], "0001").unwrap(), 0);
        assert_eq!(find(&cameras.all, &[], "2.png").unwrap(), 1);
        assert!(find(&cameras.all, &[], "3").unwrap_err().0.contains("'images/0001.png', 'b/2.png'"));
    }

    /// 64 columns at 90 degrees: 32 pixels of focal length.
    #[test]
    fn an_angle_is_a_focal_length() {
        let angle = std::f64::consts::FRAC_PI_2;
        let cameras =
            read(&json!({ "camera_angle_x": angle, "w": 64, "h": 48, "frames": [frame(json!({}))] })).unwrap();
        let Lens { fx, fy, cx, cy, .. } = cameras.all[0].lens;
        assert!((fx - 32.0).abs() < 1e-12 && fx == fy && (cx, cy) == (32.0, 24.0));
    }

    #[test]
    fn what_is_no_pinhole_is_refused_by_name() {
        let refused = |extra: serde_json::Value, words: &str| {
            let mut whole = json!({ "fl_x": 50.0, "cx": 31.0, "cy": 25.0 });
            whole.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
            let found = read(&json!({ "frames": [frame(whole)] })).unwrap_err();
            assert!(found.contains("/frames/0") && found.contains(words), "{found}");
        };
        refused(json!({ "camera_model": "OPENCV_FISHEYE" }), "'OPENCV_FISHEYE' is a fisheye");
        refused(json!({ "camera_model": "EQUIRECTANGULAR" }), "no perspective camera");
        refused(json!({ "k3": 0.01 }), "k3 or k4 is 0.01");
        refused(json!({ "w": 64.5 }), "found 64.5");
        refused(json!({ "fl_x": -50.0 }), "focal lengths above 0");
        refused(json!({ "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0]] }), "3 or 4 rows");
        refused(json!({ "transform_matrix": [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]] }), "scaled or sheared");
        refused(json!({ "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0]] }), "mirrored");
        assert!(read(&json!({ "frames": [frame(json!({}))] })).unwrap_err().contains("fl_x"));
        assert!(of_transforms(b"{\"frames\": 3}").unwrap_err().0.contains("transforms.json"));
    }

    #[test]
    fn numbered_cameras_need_as_many_photos() {
        let (axes, position) = pose();
        let numbered = |at| of_pose("", PhotoName::Number(at), axes, position, lens()).unwrap();
        let cameras = [numbered(0), numbered(1)];
        let photos = ["a.png".to_owned(), "b.png".to_owned()];
        assert_eq!(find(&cameras, &photos, "b").unwrap(), 1);
        assert!(find(&cameras, &photos[..1], "a").unwrap_err().0.contains("2 cameras are numbered"));
    }
}
