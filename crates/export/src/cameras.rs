//! A scene as COLMAP's text model, or as nerfstudio's `transforms.json`.
//!
//! The world is that of the scene's source: +Y up, metres. Pixels are not converted: all three count from the picture's
//! upper left corner, so that the centre of the first pixel is (0.5, 0.5), and the principal point stays the same.
//!
//! For COLMAP the axes are converted: its cameras look along +Z with +Y down (OpenCV), ours along -Z with +Y up, and it
//! stores camera-from-world where we store world-from-camera. nerfstudio's cameras have the axes of OpenGL, as ours.

use std::fmt::Write as _;
use std::path::Path;

use glam::{DMat3, DQuat, DVec2, DVec3};
use mateval_dataset::{Camera, Intrinsics, json};
use mateval_image::{Picture, exr_io, png_io};
use serde::Serialize;

use crate::dataset::{ExportError, ShownView, SoundDataset, copy_file, in_source, make_folder_of, write_file};

/// The largest number of points of a scene.
const MOST_POINTS: usize = 2000;

/// How much farther the surface that a view shows may be than a point for the view to show the point, as a share.
const DEPTH_TOLERANCE: f64 = 0.01;

/// A point on a surface, and the views that show it.
struct Point {
    world: DVec3,
    color: [u8; 3],
    /// The place of each view, and the point's place in its picture.
    seen: Vec<(usize, DVec2)>,
}

/// Writes `images/<view>.png` and `sparse/0/{cameras,images,points3D}.txt` of a scene to `out`.
pub fn write_colmap(sound: &SoundDataset, views: &[ShownView<'_>], out: &Path) -> Result<(), ExportError> {
    let mut depths = Vec::new();
    for shown in views {
        let name = format!("images/{}.png", shown.view.id);
        copy_file(&sound.dataset.root.join(&shown.picture), &out.join(name))?;
        let folder = sound.dataset.folder(&shown.scene.id).view(&shown.view.id);
        depths.push(exr_io::read_scalar(&folder.join("depth.exr"))?);
    }
    let cameras: Vec<Camera> = views.iter().map(in_source).collect();
    let points = match views.first() {
        Some(first) => points(&cameras, &depths, &png_io::read_rgb_bytes(&sound.dataset.root.join(&first.picture))?),
        None => Vec::new(),
    };
    let mut lenses: Vec<Intrinsics> = Vec::new();
    for camera in &cameras {
        if !lenses.contains(&camera.intrinsics) {
            lenses.push(camera.intrinsics);
        }
    }
    let model = out.join("sparse/0");
    write_file(&model.join("cameras.txt"), cameras_text(&lenses).as_bytes())?;
    write_file(&model.join("images.txt"), images_text(views, &lenses, &points).as_bytes())?;
    write_file(&model.join("points3D.txt"), points_text(&points).as_bytes())
}

/// Points under pixels of the first view's picture, on a regular grid.
fn points(cameras: &[Camera], depths: &[Picture<f32>], colors: &Picture<[u8; 3]>) -> Vec<Point> {
    let (first, depth) = (&cameras[0], &depths[0]);
    let mut step = 1;
    while depth.width().div_ceil(step) * depth.height().div_ceil(step) > MOST_POINTS {
        step += 1;
    }
    let mut points = Vec::new();
    for y in (step / 2..depth.height()).step_by(step) {
        for x in (step / 2..depth.width()).step_by(step).filter(|&x| depth.get(x, y) > 0.0) {
            let world = first.unproject(DVec2::new(x as f64 + 0.5, y as f64 + 0.5), f64::from(depth.get(x, y)));
            let seen = (0..cameras.len()).filter_map(|at| Some((at, place(&cameras[at], &depths[at], world)?)));
            points.push(Point { world, color: colors.get(x, y), seen: seen.collect() });
        }
    }
    points
}

/// The place of a point in a view's picture; absent if the view does not show it.
fn place(camera: &Camera, depth: &Picture<f32>, world: DVec3) -> Option<DVec2> {
    let (pixel, distance) = camera.project(world)?;
    let inside = pixel.min_element() >= 0.0 && pixel.x < depth.width() as f64 && pixel.y < depth.height() as f64;
    // The casts cut the fraction off: pixel (x, y) reaches from x to x + 1.
    let surface = inside.then(|| f64::from(depth.get(pixel.x as usize, pixel.y as usize)))?;
    ((surface - distance).abs() <= DEPTH_TOLERANCE * distance).then_some(pixel)
}

/// The rotation and translation that take a point of the world to OpenCV's camera axes.
fn camera_from_world(camera: &Camera) -> (DQuat, DVec3) {
    let from_ours = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let rotation = from_ours * camera.rotation().transpose();
    let turn = DQuat::from_mat3(&rotation).normalize();
    // Both signs are the same rotation.
    let turn = if turn.w < 0.0 { -turn } else { turn };
    (turn, -(turn * camera.position()))
}

/// `CAMERA_ID MODEL WIDTH HEIGHT fx fy cx cy`.
fn cameras_text(lenses: &[Intrinsics]) -> String {
    let mut text = "# CAMERA_ID MODEL WIDTH HEIGHT fx fy cx cy\n".to_owned();
    for (at, k) in lenses.iter().enumerate() {
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(text, "{} PINHOLE {} {} {} {} {} {}", at + 1, k.width, k.height, k.fx, k.fy, k.cx, k.cy);
    }
    text
}

/// Two lines a view: `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`, then `X Y POINT3D_ID` for each point that it
/// shows.
fn images_text(views: &[ShownView<'_>], lenses: &[Intrinsics], points: &[Point]) -> String {
    let mut text = "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# X Y POINT3D_ID of each point\n".to_owned();
    for (at, shown) in views.iter().enumerate() {
        let camera = in_source(shown);
        let (q, t) = camera_from_world(&camera);
        let lens = lenses.iter().position(|lens| *lens == camera.intrinsics).map_or(0, |place| place + 1);
        let _ = write!(text, "{} {} {} {} {} {} {} {}", at + 1, q.w, q.x, q.y, q.z, t.x, t.y, t.z);
        let _ = writeln!(text, " {lens} {}.png", shown.view.id);
        let mut places = Vec::new();
        for (id, point) in points.iter().enumerate() {
            let own = point.seen.iter().filter(|(view, _)| *view == at);
            places.extend(own.map(|(_, pixel)| format!("{} {} {}", pixel.x, pixel.y, id + 1)));
        }
        text.push_str(&places.join(" "));
        text.push('\n');
    }
    text
}

/// `POINT3D_ID X Y Z R G B ERROR`, then `IMAGE_ID POINT2D_IDX` for each view that shows the point. The error is 0: the
/// points were projected, not measured.
fn points_text(points: &[Point]) -> String {
    let mut text = "# POINT3D_ID X Y Z R G B ERROR, IMAGE_ID POINT2D_IDX of each view\n".to_owned();
    let mut shown = std::collections::BTreeMap::<usize, usize>::new();
    for (id, point) in points.iter().enumerate() {
        let (world, [r, g, b]) = (point.world, point.color);
        let _ = write!(text, "{} {} {} {} {r} {g} {b} 0", id + 1, world.x, world.y, world.z);
        for (view, _) in &point.seen {
            let next = shown.entry(*view).or_default();
            let _ = write!(text, " {} {next}", view + 1);
            *next += 1;
        }
        text.push('\n');
    }
    text
}

/// `transforms.json`, as nerfstudio documents it.
#[derive(Debug, Serialize)]
struct Transforms {
    camera_model: &'static str,
    /// Stated once where all views agree; nerfstudio then ignores those of the frames.
    #[serde(flatten)]
    lens: Option<Lens>,
    frames: Vec<Frame>,
}

#[derive(Debug, Serialize)]
struct Lens {
    fl_x: f64,
    fl_y: f64,
    cx: f64,
    cy: f64,
    w: u32,
    h: u32,
    k1: f64,
    k2: f64,
    p1: f64,
    p2: f64,
}

#[derive(Debug, Serialize)]
struct Frame {
    file_path: String,
    depth_file_path: String,
    transform_matrix: [[f64; 4]; 4],
    #[serde(flatten)]
    lens: Option<Lens>,
}

impl Lens {
    fn new(k: &Intrinsics) -> Self {
        let [k1, k2, p1, p2] = [0.0; 4];
        Self { fl_x: k.fx, fl_y: k.fy, cx: k.cx, cy: k.cy, w: k.width, h: k.height, k1, k2, p1, p2 }
    }
}

/// Writes `transforms.json`, `images/<view>.png` and `depths/<view>.png` of a scene to `out`.
pub fn write_nerfstudio(sound: &SoundDataset, views: &[ShownView<'_>], out: &Path) -> Result<(), ExportError> {
    let dataset = &sound.dataset;
    let mut frames = Vec::new();
    let intrinsics = |shown: &ShownView<'_>| shown.view.camera.intrinsics;
    let same = views.windows(2).all(|pair| intrinsics(&pair[0]) == intrinsics(&pair[1]));
    for shown in views {
        let (file_path, depth_file_path) =
            (format!("images/{}.png", shown.view.id), format!("depths/{}.png", shown.view.id));
        copy_file(&dataset.root.join(&shown.picture), &out.join(&file_path))?;
        let depth = exr_io::read_scalar(&dataset.folder(&shown.scene.id).view(&shown.view.id).join("depth.exr"))?;
        make_folder_of(&out.join(&depth_file_path))?;
        png_io::write_ids(&out.join(&depth_file_path), &millimetres(&depth))?;
        frames.push(Frame {
            file_path,
            depth_file_path,
            transform_matrix: in_source(shown).world_from_camera,
            lens: (!same).then(|| Lens::new(&intrinsics(shown))),
        });
    }
    let lens = views.first().filter(|_| same).map(|shown| Lens::new(&intrinsics(shown)));
    let transforms = Transforms { camera_model: "OPENCV", lens, frames };
    write_file(&out.join("transforms.json"), json::to_text(&transforms).as_bytes())
}

/// Depth along the camera's axis in whole millimetres, the unit that nerfstudio expects; 0, its word for unknown, where
/// nothing is hit and from 65.536 m on.
fn millimetres(depth: &Picture<f32>) -> Picture<u16> {
    depth.map(|metres| {
        let rounded = (metres * 1000.0).round();
        // The cast is exact: the value is a whole number in the range.
        if rounded <= f32::from(u16::MAX) { rounded as u16 } else { 0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_are_rounded_to_millimetres_and_never_wrap() {
        let depth = Picture::new(5, 1, vec![0.0, 2.707_697_9, 65.535, 65.536, 1e9]).unwrap();
        assert_eq!(millimetres(&depth).pixels(), [0, 2708, 65535, 0, 0]);
    }
}
