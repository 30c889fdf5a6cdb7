//! A view's pictures on disk: `ground_truth/renders/<renderer>/<view>/`.

use std::path::Path;

use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_scene::render_file::{RENDER_FILE, RenderFile};
use mateval_scene::{RendererId, ViewId, json};

use crate::blender::{BlenderView, LightPictures};
use crate::error::PrepError;
use crate::preview;

/// The pictures of a view that are written.
pub(super) struct ViewRender<'a> {
    pub(super) halves: [&'a LightPictures; 2],
    /// What people see: their mean, denoised.
    pub(super) shown: &'a LightPictures,
    /// Pictures that only Blender makes: base colour, ids, depth, normals.
    pub(super) passes: Option<&'a BlenderView>,
}

/// Writes the pictures. `render.json` is removed first and written last, so it never exists beside pictures of two
/// runs.
pub(super) fn write(place: &Path, render: &ViewRender<'_>, exposure: f64, file: &RenderFile) -> Result<(), PrepError> {
    std::fs::create_dir_all(place).map_err(PrepError::io("make", place))?;
    let mark = place.join(RENDER_FILE);
    if mark.exists() {
        std::fs::remove_file(&mark).map_err(PrepError::io("remove", &mark))?;
    }
    let light = |name: &str, picture: &Picture<LinearRgb>| {
        exr_io::write_linear(&place.join(format!("{name}.exr")), picture, Precision::Float)
    };
    let [a, b] = render.halves;
    light("rgb_a", &a.rgb)?;
    light("rgb_b", &b.rgb)?;
    light("rgb", &render.shown.rgb)?;
    for (at, ((a, b), shown)) in a.groups.iter().zip(&b.groups).zip(&render.shown.groups).enumerate() {
        light(&format!("group_{at:02}_a"), a)?;
        light(&format!("group_{at:02}_b"), b)?;
        light(&format!("group_{at:02}"), shown)?;
    }
    preview::write(place, &render.shown.rgb, exposure)?;
    if let Some(view) = render.passes {
        write_passes(place, view)?;
    }
    Ok(json::write(&mark, file)?)
}

fn write_passes(place: &Path, view: &BlenderView) -> Result<(), PrepError> {
    exr_io::write_linear(&place.join("base_color.exr"), &view.base_color, Precision::Float)?;
    exr_io::write_scalar(&place.join("depth.exr"), &view.depth, Precision::Float)?;
    exr_io::write_normal(&place.join("normal.exr"), &view.normal, Precision::Half)?;
    png_io::write_ids(&place.join("instance.png"), &view.instance)?;
    png_io::write_ids(&place.join("part.png"), &view.part)?;
    Ok(())
}

/// Whether the renderer has rendered the scene's input view.
pub(crate) fn can_show_input(folder: &SceneFolder, renderer: &RendererId) -> bool {
    let input = ViewId::new(INPUT).expect("'input' is a valid id");
    folder.render(renderer, &input).join(RENDER_FILE).is_file()
}

/// Copies the renderer's picture of the input view to `views/input/`, as the photo that methods see. Does nothing where
/// the renderer has not rendered that view.
pub(crate) fn show_input(folder: &SceneFolder, renderer: &RendererId) -> Result<(), PrepError> {
    let input = ViewId::new(INPUT).expect("'input' is a valid id");
    let (from, to) = (folder.render(renderer, &input), folder.view(&input));
    if !can_show_input(folder, renderer) {
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
