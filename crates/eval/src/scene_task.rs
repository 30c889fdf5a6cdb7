//! The inputs of scoring one scene: its files, the predictions and the rules; and the regions of its views.

use std::path::Path;

use mateval_image::{LinearRgb, Mask, Picture};
use mateval_metrics::{Lpips, MetricError};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_scene::{Progress, RendererId, SceneId, TriangleMesh, ViewId};
use mateval_submission::prediction::PredictedScene;
use mateval_tracer::World;

use crate::error::EvalError;
use crate::light::lighting::LightingName;
use crate::light::reference::StoredReference;
use crate::open_scene::ViewSet;
use crate::pictures_dir::PicturesDir;
use crate::protocol::Protocol;
use crate::result::PictureValues;
use crate::result_key::{PictureKind, PictureName, Region, Surfaces};
use crate::truth::ViewTruth;

/// Everything that is needed to score submissions on one scene.
#[derive(Clone)]
pub(crate) struct SceneTask<'a> {
    /// Folder of the dataset.
    pub(crate) dataset: &'a Path,
    pub(crate) scene: &'a SceneFile,
    pub(crate) folder: &'a SceneFolder,
    pub(crate) world: &'a World,
    pub(crate) atlases: &'a [TriangleMesh],
    /// The views that are scored.
    pub(crate) views: Vec<&'a View>,
    /// The set that they are.
    pub(crate) set: ViewSet,
    pub(crate) predictions: &'a [PredictedScene],
    pub(crate) protocols: &'a [Protocol],
    pub(crate) lpips: Option<&'a Lpips>,
    /// R. Without it, light of the scene's own emitters is not scored.
    pub(crate) reference: Option<&'a StoredReference>,
    /// The photo's renderer. Without it, fitted light is not scored.
    pub(crate) renderer: Option<&'a RendererId>,
    /// Where pictures are kept for whoever recomputes the numbers.
    pub(crate) pictures: Option<&'a PicturesDir<'a>>,
    pub(crate) progress: Progress<'a>,
}

/// Pictures of base colour in every view.
pub(crate) struct BaseColors {
    /// From the true atlases.
    pub(crate) truth: Vec<Picture<LinearRgb>>,
    pub(crate) predicted: Vec<Vec<Picture<LinearRgb>>>,
}

/// A region of a view on some of its surfaces, with the mask of its pixels.
pub(crate) struct MaskedRegion {
    pub(crate) region: Region,
    pub(crate) surfaces: Surfaces,
    pub(crate) mask: Mask,
}

impl SceneTask<'_> {
    /// The same task over one set of its views; none where the set is empty.
    pub(crate) fn of(&self, set: ViewSet) -> Option<Self> {
        let views = set.of(&self.views);
        (!views.is_empty()).then(|| Self { views, set, ..self.clone() })
    }

    /// The true maps and masks of the views.
    pub(crate) fn truths(&self) -> Result<Vec<ViewTruth>, EvalError> {
        self.views.iter().map(|view| ViewTruth::read(self.folder, view)).collect()
    }

    /// The view that methods see.
    pub(crate) fn input_view(&self) -> Result<&View, EvalError> {
        self.scene.view(INPUT).ok_or_else(|| EvalError::NoInputView { scene: self.scene.id.clone() })
    }

    /// Pixels of a view.
    pub(crate) fn pixels(&self) -> u64 {
        self.views.first().map_or(0, |view| pixels(view))
    }

    /// Pixels of all views together.
    pub(crate) fn pixels_of_all_views(&self) -> u64 {
        self.views.iter().map(|view| pixels(view)).sum()
    }

    /// Adds scene and view to an error of a metric.
    pub(crate) fn locate_error<T>(&self, view: &View, found: Result<T, MetricError>) -> Result<T, EvalError> {
        found.map_err(|source| EvalError::Metric { scene: self.scene.id.clone(), view: view.id.clone(), source })
    }
}

fn pixels(view: &View) -> u64 {
    u64::from(view.camera.intrinsics.width) * u64::from(view.camera.intrinsics.height)
}

/// The regions of a view over which metrics are computed: all valid pixels first.
pub(crate) fn regions(truth: &ViewTruth) -> Vec<MaskedRegion> {
    let all = |region, mask: &Mask| MaskedRegion { region, surfaces: Surfaces::All, mask: mask.clone() };
    let mut regions = vec![all(Region::Valid, &truth.valid)];
    regions.extend(truth.unobserved.as_ref().map(|mask| all(Region::Unobserved, mask)));
    regions.extend(truth.specular.as_ref().map(|mask| MaskedRegion {
        region: Region::Valid,
        surfaces: Surfaces::Specular,
        mask: mask.clone(),
    }));
    regions
}

impl MaskedRegion {
    /// Whether it holds all valid pixels of its view, so that metrics with windows are taken over it.
    pub(crate) fn is_whole(&self) -> bool {
        (self.region, self.surfaces) == (Region::Valid, Surfaces::All)
    }

    /// A picture over this region, without values yet.
    pub(crate) fn values(
        &self,
        scene: &SceneId,
        view: &ViewId,
        kind: PictureKind,
        lighting: Option<LightingName>,
    ) -> PictureValues {
        PictureValues {
            scene: scene.clone(),
            view: view.clone(),
            picture: PictureName { kind, surfaces: self.surfaces },
            lighting,
            region: self.region,
            pixels: mateval_metrics::mask::pixel_count(&self.mask),
            values: Default::default(),
            mse_error: None,
            exact: false,
            lower_bound: false,
        }
    }
}
