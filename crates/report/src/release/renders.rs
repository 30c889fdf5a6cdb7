//! The pictures of a released dataset: how the photo's renderer made them and how noisy they are, and small pictures of
//! the input views, for which only files outside of `ground_truth` are read.

use std::path::Path;

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::layout::INPUT;
use mateval_dataset::open::Dataset;
use mateval_dataset::render_file::{RENDER_FILE, RenderDevice, RenderFile};
use mateval_dataset::{RendererId, SceneId, ViewId, json};
use mateval_files::whole::write_whole;
use mateval_files::work_folder::make_folder;
use mateval_image::png_io::jpeg_bytes;
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_prep::render::RendererKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ReportError;

/// The noise of one view of the photo's renderer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViewNoise {
    /// The view.
    pub view: ViewId,
    /// As in `render.json`: linear, before exposure.
    pub mean_of_halves_mse: f64,
    /// As in `render.json`: linear, before exposure; may be below 0.
    pub denoised_mse: f64,
    /// PSNR of the mean of the halves against the picture without noise, in dB: linear, with the scene's exposure, for a
    /// peak of 1. Null where there is no noise.
    pub mean_of_halves_psnr_db: Option<f64>,
}

/// The pictures that were rendered with the same settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderedWith {
    /// The renderer.
    pub renderer: RendererId,
    /// The renderer's own version; null for `builtin`.
    pub renderer_version: Option<String>,
    /// The graphics card that rendered; absent where the processor did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<RenderDevice>,
    /// Samples per pixel of each of the two halves.
    pub samples_each_half: u32,
    /// The denoiser of the pictures that are shown.
    pub denoiser: String,
    /// Number of views.
    pub views: usize,
    /// The scenes of these views, in the dataset's order.
    pub scenes: Vec<SceneId>,
}

/// The settings of all pictures, in the order of the renderers and then of the scenes.
pub(crate) fn rendered_with(dataset: &Dataset) -> Result<Vec<RenderedWith>, ReportError> {
    let mut all: Vec<RenderedWith> = Vec::new();
    for renderer in RendererKind::ALL.iter().map(|kind| kind.id()) {
        for scene in &dataset.scenes {
            for view in &scene.views {
                if let Some(file) = render_file(dataset, scene, &renderer, &view.id)? {
                    add(&mut all, &scene.id, file);
                }
            }
        }
    }
    Ok(all)
}

fn add(all: &mut Vec<RenderedWith>, scene: &SceneId, file: RenderFile) {
    let is_same = |known: &RenderedWith| {
        (&known.renderer, &known.renderer_version, &known.device, known.samples_each_half, &known.denoiser)
            == (&file.renderer, &file.renderer_version, &file.device, file.samples_each_half, &file.denoiser)
    };
    let at = all.iter().position(is_same).unwrap_or(all.len());
    if at == all.len() {
        all.push(RenderedWith {
            renderer: file.renderer,
            renderer_version: file.renderer_version,
            device: file.device,
            samples_each_half: file.samples_each_half,
            denoiser: file.denoiser,
            views: 0,
            scenes: Vec::new(),
        });
    }
    all[at].views += 1;
    if all[at].scenes.last() != Some(scene) {
        all[at].scenes.push(scene.clone());
    }
}

/// The noise of a scene's views; absent if the scene is not rendered.
pub(crate) fn noise(dataset: &Dataset, scene: &SceneFile) -> Result<Option<Vec<ViewNoise>>, ReportError> {
    let Some(renderer) = dataset.photo_renderer(scene) else { return Ok(None) };
    let mut views = Vec::new();
    for view in &scene.views {
        if let Some(file) = render_file(dataset, scene, renderer, &view.id)? {
            let mse = file.noise.mean_of_halves_mse;
            let exposed = mse * scene.exposure * scene.exposure;
            views.push(ViewNoise {
                view: view.id.clone(),
                mean_of_halves_mse: mse,
                denoised_mse: file.noise.denoised_mse,
                mean_of_halves_psnr_db: (exposed > 0.0).then(|| -10.0 * libm::log10(exposed)),
            });
        }
    }
    Ok(Some(views))
}

/// The view's `render.json`; absent if the renderer has not rendered it.
fn render_file(
    dataset: &Dataset,
    scene: &SceneFile,
    renderer: &RendererId,
    view: &ViewId,
) -> Result<Option<RenderFile>, ReportError> {
    let path = dataset.folder(&scene.id).render(renderer, view).join(RENDER_FILE);
    Ok(path.is_file().then(|| json::read(&path)).transpose()?)
}

/// The folder of the pictures in the report's folder.
const PICTURES: &str = "pictures";

/// The most pixels of a row.
const MOST_WIDTH: usize = 240;

/// The quality of JPEG: the pictures are looked at only.
const QUALITY: u8 = 85;

/// A small picture of a scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Thumbnail {
    /// Its file, relative to the report's folder.
    pub file: String,
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Writes the picture of a scene below `out`; absent if the input view has not been rendered.
pub(crate) fn write_thumbnail(
    dataset: &Dataset,
    scene: &SceneFile,
    out: &Path,
) -> Result<Option<Thumbnail>, ReportError> {
    let Some(view) = scene.view(INPUT) else { return Ok(None) };
    let path = dataset.folder(&scene.id).view(&view.id).join("rgb.png");
    if !path.is_file() {
        return Ok(None);
    }
    let small = reduced(&png_io::read_srgb(&path)?.to_linear());
    let bytes = small.map(|LinearRgb(rgb)| rgb.map(|v| byte_from_unit(srgb_from_linear(v))));
    let jpeg = jpeg_bytes(&bytes, QUALITY).expect("a picture of 1 to 240 columns has a JPEG");
    let file = format!("{PICTURES}/{}.jpg", scene.id);
    let place = out.join(&file);
    let folder = place.parent().unwrap_or(out);
    make_folder(folder)?;
    write_whole(&place, &jpeg)?;
    Ok(Some(Thumbnail { file, width: small.width(), height: small.height() }))
}

/// The means of square blocks of pixels, of at most [`MOST_WIDTH`] blocks in a row. The last column and row may be cut.
fn reduced(picture: &Picture<LinearRgb>) -> Picture<LinearRgb> {
    let side = picture.width().div_ceil(MOST_WIDTH).min(picture.height()).max(1);
    let mean = |x: usize, y: usize| {
        let pixels = (0..side * side).map(|at| picture.get(side * x + at % side, side * y + at / side).0);
        let sums = pixels.fold([0.0f64; 3], |sum, rgb| [0, 1, 2].map(|c| sum[c] + f64::from(rgb[c])));
        LinearRgb(sums.map(|sum| (sum / (side * side) as f64) as f32))
    };
    Picture::from_fn(picture.width() / side, picture.height() / side, mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_averaged() {
        let picture = Picture::from_fn(481, 7, |x, _| LinearRgb([(x % 3) as f32; 3]));
        let small = reduced(&picture);
        assert_eq!((small.width(), small.height()), (160, 2));
        assert!(small.pixels().iter().all(|pixel| *pixel == LinearRgb([1.0; 3])));
        let tiny = Picture::filled(3, 2, LinearRgb([0.5; 3]));
        assert_eq!(reduced(&tiny), tiny);
    }
}
