//! The inputs of scoring one scene: its files, the predictions and the rules; and the regions of its views.

use mateval_image::Mask;
use mateval_metrics::{Lpips, MetricError};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::SceneFolder;
use mateval_scene::{Progress, RendererId, TriangleMesh};
use mateval_submission::prediction::PredictedScene;
use mateval_tracer::World;

use crate::companion_store::MadeIn;
use crate::error::EvalError;
use crate::protocol::Protocol;
use crate::result_key::{Region, Surfaces};
use crate::truth::{ViewTruth, intersection};
use crate::view_set::ViewSet;

/// Everything that is needed to score submissions on one scene.
#[derive(Clone)]
pub(crate) struct SceneTask<'a> {
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
    /// The renderer whose pictures predicted renders are compared with. Without one, light is not scored.
    pub(crate) renderer: Option<&'a RendererId>,
    /// Where converged pictures of companions are made that the dataset does not hold.
    pub(crate) companions_made_in: MadeIn<'a>,
    /// SHA-256, hex, of the scene's files that light depends on.
    pub(crate) inputs_sha256: String,
    pub(crate) progress: Progress<'a>,
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

    /// Adds scene and view to an error of a metric.
    pub(crate) fn locate_error<T>(&self, view: &View, found: Result<T, MetricError>) -> Result<T, EvalError> {
        found.map_err(|source| EvalError::Metric { scene: self.scene.id.clone(), view: view.id.clone(), source })
    }
}

/// The regions of a view over which metrics are computed.
pub(crate) fn regions(truth: &ViewTruth) -> Vec<MaskedRegion> {
    let mut regions = vec![MaskedRegion { region: Region::Valid, surfaces: Surfaces::All, mask: truth.valid.clone() }];
    let unobserved = truth.unobserved.as_ref();
    regions.extend(unobserved.map(|mask| MaskedRegion {
        region: Region::Unobserved,
        surfaces: Surfaces::All,
        mask: mask.clone(),
    }));
    if let Some(specular) = &truth.specular {
        regions.push(MaskedRegion { region: Region::Valid, surfaces: Surfaces::Specular, mask: specular.clone() });
        regions.extend(unobserved.map(|mask| MaskedRegion {
            region: Region::Unobserved,
            surfaces: Surfaces::Specular,
            mask: intersection(mask, specular),
        }));
    }
    regions
}
