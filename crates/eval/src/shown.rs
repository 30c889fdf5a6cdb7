//! Pictures beside the numbers: for pages ([`scene_albedo`], [`scene_light`]), and for whoever computes the numbers again with
//! other tools ([`PicturesDir`], `eval score --pictures`).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_image::exr_io::Precision;
use mateval_image::{LinearRgb, Picture, SrgbRgb, exr_io};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::open::Dataset;
use mateval_scene::{InstanceId, Progress, SceneId, TriangleMesh, ViewId};
use mateval_submission::atlas::AtlasMeshes;
use mateval_submission::prediction::{PredictedScene, read_scene};

use crate::error::EvalError;
use crate::light::difference::{ViewGuide, guided_mean, mean_of};
use crate::light::lighting::LightingName;
use crate::light::reference::StoredReference;
use crate::light::score::compare_light;
use crate::materials::pictures::{MaterialPictures, material_pictures};
use crate::protocol::Protocol;
use crate::scene::{OpenScene, SceneTask, ViewSet, scored_views};
use crate::truth::ViewTruth;

/// The truth and every submission's albedo of one view, linear.
pub struct SceneAlbedo {
    /// The truth's pictures and masks.
    pub truth: ViewTruth,
    /// One for each submission, in the given order.
    pub predicted: Vec<Picture<LinearRgb>>,
}

/// The views of a scene that are scored, in the scene's order.
pub fn scene_albedo(
    dataset: &Dataset,
    scene: &SceneFile,
    submissions: &[&Path],
) -> Result<Vec<SceneAlbedo>, EvalError> {
    let OpenScene { folder, world, atlases } = OpenScene::read(dataset, scene)?;
    let predictions = predictions_of(submissions, scene, &atlases)?;
    let view = |view: &View| {
        let pictures = material_pictures(&world, &atlases, &view.camera, &predictions.iter().collect::<Vec<_>>());
        let predicted = pictures.into_iter().map(|pictures| pictures.base_color).collect();
        Ok(SceneAlbedo { truth: ViewTruth::read(&folder, view)?, predicted })
    };
    scored_views(dataset, scene)?.into_iter().map(view).collect()
}

fn predictions_of(
    submissions: &[&Path],
    scene: &SceneFile,
    atlases: &[TriangleMesh],
) -> Result<Vec<PredictedScene>, EvalError> {
    let atlases = AtlasMeshes::in_memory(atlases);
    Ok(submissions.iter().map(|path| read_scene(path, scene, &atlases)).collect::<Result<_, _>>()?)
}

/// The truth's light and every submission's of one view, clipped and encoded for display.
pub struct SceneLight {
    /// The truth's pictures and masks.
    pub truth: ViewTruth,
    /// What submissions are compared with.
    pub reference: Picture<SrgbRgb>,
    /// One for each submission, in the given order.
    pub predicted: Vec<Picture<SrgbRgb>>,
}

/// The views of a scene that are scored and share the input view's place, in the scene's order, in the first of the
/// protocol's tracks. Fails where the dataset has no reference for it.
pub fn scene_light(
    dataset: &Dataset,
    scene: &SceneFile,
    submissions: &[&Path],
    protocol: &Protocol,
    progress: Progress<'_>,
) -> Result<Vec<SceneLight>, EvalError> {
    let OpenScene { folder, world, atlases } = OpenScene::read(dataset, scene)?;
    let predictions = predictions_of(submissions, scene, &atlases)?;
    let reference = StoredReference::listed(dataset, scene)?;
    let task = SceneTask {
        dataset: &dataset.root,
        scene,
        folder: &folder,
        world: &world,
        atlases: &atlases,
        views: ViewSet::Turned.of(&scored_views(dataset, scene)?),
        set: ViewSet::Turned,
        predictions: &predictions,
        protocols: std::slice::from_ref(protocol),
        lpips: None,
        reference: reference.as_ref(),
        renderer: dataset.photo_renderer(scene),
        pictures: None,
        progress,
    };
    let truths = task.truths()?;
    let base_colors = task.base_colors()?;
    let first = protocol.light.tracks.first().copied();
    // By view, and by submission and view: submissions arrive in any order.
    let mut references = Vec::new();
    let mut predicted: BTreeMap<usize, Vec<Picture<SrgbRgb>>> = BTreeMap::new();
    compare_light(&task, &truths, &base_colors, protocol, &mut |submission, light| {
        if Some(light.track) == first {
            if references.is_empty() {
                references = light.references.iter().map(|reference| reference.picture.clone()).collect();
            }
            predicted.insert(submission, light.views.into_iter().map(|view| view.shown).collect());
        }
        Ok(())
    })?;
    if references.is_empty() && !submissions.is_empty() {
        return Err(EvalError::NoPhotoRenderer { dataset: dataset.root.clone() });
    }
    let rows = truths.into_iter().zip(references).enumerate();
    let row = |(at, (truth, reference)): (usize, (ViewTruth, Picture<SrgbRgb>))| SceneLight {
        truth,
        reference,
        predicted: predicted.values().map(|views| views[at].clone()).collect(),
    };
    Ok(rows.map(row).collect())
}

/// Where the pictures of submissions go.
pub struct PicturesDir<'a> {
    /// A folder for each submission, in the order of the plan.
    pub folders: &'a [PathBuf],
}

impl PicturesDir<'_> {
    /// The file of an instance's texels, in a folder that exists.
    pub(crate) fn texels(
        &self,
        submission: usize,
        scene: &SceneId,
        instance: &InstanceId,
    ) -> Result<PathBuf, EvalError> {
        let folder = self.folders[submission].join(scene.as_str()).join("texels");
        std::fs::create_dir_all(&folder).map_err(EvalError::io("create", &folder))?;
        Ok(folder.join(instance.as_str()).with_extension("exr"))
    }

    fn view(&self, submission: usize, scene: &SceneId, view: &ViewId) -> PathBuf {
        self.folders[submission].join(scene.as_str()).join(view.as_str())
    }
}

fn write(folder: &Path, name: &str, picture: &Picture<LinearRgb>) -> Result<(), EvalError> {
    std::fs::create_dir_all(folder).map_err(EvalError::io("create", folder))?;
    Ok(exr_io::write_linear(&folder.join(name).with_extension("exr"), picture, Precision::Float)?)
}

impl PicturesDir<'_> {
    /// Keeps the pictures of a submission's maps in one view.
    pub(crate) fn keep_maps(
        &self,
        submission: usize,
        (scene, view): (&SceneId, &ViewId),
        maps: &MaterialPictures,
        truth: &Picture<LinearRgb>,
    ) -> Result<(), EvalError> {
        let folder = self.view(submission, scene, view);
        write(&folder, "albedo", &maps.base_color)?;
        write(&folder, "albedo_of_true_atlas", truth)?;
        for (name, picture) in [("roughness", &maps.roughness), ("metallic", &maps.metallic)] {
            exr_io::write_scalar(&folder.join(name).with_extension("exr"), picture, Precision::Float)?;
        }
        Ok(())
    }

    /// Keeps what a submission's errors in one lighting of a view are computed from.
    pub(crate) fn keep_light(
        &self,
        submission: usize,
        (scene, view): (&SceneId, &ViewId),
        lighting: Option<LightingName>,
        quarters: &[Picture<LinearRgb>],
        guide: &ViewGuide<'_>,
    ) -> Result<(), EvalError> {
        let name = lighting.map_or_else(|| "true".to_owned(), |name| name.to_string());
        let folder = self.view(submission, scene, view).join(&name);
        write(&folder, "reference", guide.reference)?;
        write(&folder, "ratio", guide.ratio)?;
        for (at, quarter) in quarters.iter().enumerate() {
            write(&folder, &format!("quarter_{at}"), quarter)?;
        }
        let pair = |half: usize| [&quarters[2 * half], &quarters[2 * half + 1]];
        for half in 0..2 {
            write(&folder, &format!("guided_{half}"), &guided_mean(pair(half), guide))?;
        }
        let [a, b] = [0, 1].map(|half| mean_of(pair(half)[0], pair(half)[1]));
        write(&folder, "shown", &guided_mean([&a, &b], guide))
    }
}
