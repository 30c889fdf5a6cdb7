//! A scene as nerfstudio's `transforms.json`.
//!
//! Nothing is converted: our cameras have the axes of OpenGL, the convention of these files, and both count pixels from the
//! picture's upper left corner, with centres at a half. The world is that of
//! the scene's source: +Y up, metres.

use std::path::Path;

use mateval_image::{Picture, exr_io, png_io};
use mateval_scene::{Intrinsics, json};
use serde::Serialize;

use crate::error::ExportError;
use crate::shown_view::{ShownView, in_source};
use crate::sound_dataset::SoundDataset;
use crate::write_file::{copy_file, make_folder_of, write_file};

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
pub fn write_scene(sound: &SoundDataset, views: &[ShownView<'_>], out: &Path) -> Result<(), ExportError> {
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
