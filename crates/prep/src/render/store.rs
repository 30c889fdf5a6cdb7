//! A view's renders on disk: `ground_truth/renders/<renderer>/<view>/`.

use std::path::Path;

use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_scene::{RendererId, ViewId, json};

use super::RenderFile;
use crate::blender::BlenderView;
use crate::error::PrepError;

/// The file that says that a view's pictures are whole, and how they were made.
pub(super) const MARK: &str = "render.json";

/// What is kept of a view.
pub(super) struct ViewRender<'a> {
    pub(super) halves: [&'a Picture<LinearRgb>; 2],
    /// What people see: denoised, or the halves' mean.
    pub(super) rgb: &'a Picture<LinearRgb>,
    /// What else Blender gives.
    pub(super) passes: Option<&'a BlenderView>,
}

/// Writes the pictures; the mark goes first and comes last.
pub(super) fn write(place: &Path, render: &ViewRender<'_>, exposure: f64, file: &RenderFile) -> Result<(), PrepError> {
    std::fs::create_dir_all(place).map_err(PrepError::io("make", place))?;
    // It must not vouch for pictures that are half replaced.
    let mark = place.join(MARK);
    if mark.exists() {
        std::fs::remove_file(&mark).map_err(PrepError::io("remove", &mark))?;
    }
    let light = |name: &str, picture: &Picture<LinearRgb>| {
        exr_io::write_linear(&place.join(format!("{name}.exr")), picture, Precision::Float)
    };
    light("rgb_a", render.halves[0])?;
    light("rgb_b", render.halves[1])?;
    light("rgb", render.rgb)?;
    let exposed = render.rgb.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (f64::from(v) * exposure) as f32)));
    png_io::write_srgb(&place.join("rgb.png"), &exposed.to_srgb())?;
    if let Some(view) = render.passes {
        write_passes(place, view)?;
    }
    Ok(json::write(&mark, file)?)
}

fn write_passes(place: &Path, view: &BlenderView) -> Result<(), PrepError> {
    let light =
        |name: String, picture: &Picture<LinearRgb>| exr_io::write_linear(&place.join(name), picture, Precision::Float);
    let [a, b] = &view.halves;
    for (at, ((a, b), denoised)) in a.groups.iter().zip(&b.groups).zip(&view.denoised.groups).enumerate() {
        light(format!("group_{at:02}_a.exr"), a)?;
        light(format!("group_{at:02}_b.exr"), b)?;
        light(format!("group_{at:02}.exr"), denoised)?;
    }
    light("base_color.exr".to_owned(), &view.base_color)?;
    exr_io::write_scalar(&place.join("depth.exr"), &view.depth, Precision::Float)?;
    exr_io::write_normal(&place.join("normal.exr"), &view.normal, Precision::Half)?;
    png_io::write_ids(&place.join("instance.png"), &view.instance)?;
    png_io::write_ids(&place.join("part.png"), &view.part)?;
    Ok(())
}

/// Shows the renderer's picture as the photo that methods get, where there is one.
pub(super) fn show_input(folder: &SceneFolder, renderer: &RendererId) -> Result<(), PrepError> {
    let input = ViewId::new(INPUT).expect("our own id is an id");
    let (from, to) = (folder.render(renderer, &input), folder.view(&input));
    if !from.join(MARK).is_file() {
        return Ok(());
    }
    for name in ["rgb.exr", "rgb.png"] {
        let bytes = std::fs::read(from.join(name)).map_err(PrepError::io("read", from.join(name)))?;
        if std::fs::read(to.join(name)).is_ok_and(|found| found == bytes) {
            continue;
        }
        mateval_image::store::write_whole(&to.join(name), &bytes)?;
    }
    Ok(())
}
