//! How the RGB truth was rendered, and how noisy it is, from the `render.json` of each view.

use mateval_prep::render::RendererKind;
use mateval_scene::dataset::SceneFile;
use mateval_scene::open::Dataset;
use mateval_scene::render_file::{RENDER_FILE, RenderFile};
use mateval_scene::{RendererId, SceneId, ViewId, json};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ReleaseError;

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
    /// PSNR of the mean of the halves against the picture without noise, in dB: linear, with the scene's exposure, peak 1.
    /// Null where there is no noise.
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
pub(crate) fn rendered_with(dataset: &Dataset) -> Result<Vec<RenderedWith>, ReleaseError> {
    let mut all: Vec<RenderedWith> = Vec::new();
    for renderer in RendererKind::ALL.map(RendererKind::id) {
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
        (&known.renderer, &known.renderer_version, known.samples_each_half, &known.denoiser)
            == (&file.renderer, &file.renderer_version, file.samples_each_half, &file.denoiser)
    };
    let at = all.iter().position(is_same).unwrap_or(all.len());
    if at == all.len() {
        all.push(RenderedWith {
            renderer: file.renderer,
            renderer_version: file.renderer_version,
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

/// The noise of a scene's views; none where the scene is not rendered.
pub(crate) fn noise(dataset: &Dataset, scene: &SceneFile) -> Result<Option<Vec<ViewNoise>>, ReleaseError> {
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

/// The view's `render.json`; none where the renderer has not rendered it.
fn render_file(
    dataset: &Dataset,
    scene: &SceneFile,
    renderer: &RendererId,
    view: &ViewId,
) -> Result<Option<RenderFile>, ReleaseError> {
    let path = dataset.folder(&scene.id).render(renderer, view).join(RENDER_FILE);
    Ok(path.is_file().then(|| json::read(&path)).transpose()?)
}
