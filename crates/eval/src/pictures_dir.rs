//! The pictures behind the numbers of a result, for whoever computes them again with other tools (`eval score
//! --pictures`).
//!
//! `<folder>/<scene>/<view>/` holds `albedo`, `albedo_of_true_atlas`, `roughness` and `metallic` of the prediction, and
//! for each lighting (`rgb_true`, `rgb_relit-warm_cool`, `rgb_relit-alone_1`) a folder with `reference` (R),
//! `quarter_0` to `quarter_3` (the four m_i), `guided_0` and `guided_1` (g R + F of either half), `ratio` (r) and
//! `shown`: linear and exposed, as float EXR. `<folder>/<scene>/texels/<instance>.exr` holds what errors of texels are
//! computed from.

use std::path::{Path, PathBuf};

use mateval_dataset::lighting::LightingName;
use mateval_dataset::{InstanceId, SceneId, ViewId};
use mateval_files::FileError;
use mateval_image::exr_io::Precision;
use mateval_image::{LinearRgb, Picture, exr_io};

use crate::error::EvalError;
use crate::light::difference::{ViewGuide, guided_mean, mean_of};
use crate::materials::pictures::MaterialPictures;
use crate::protocol::Track;

pub struct PicturesDir {
    /// A folder for each submission, in the order of the plan.
    pub folders: Vec<PathBuf>,
}

impl PicturesDir {
    /// The file of an instance's texels, in a folder that exists.
    pub(crate) fn texels(
        &self,
        submission: usize,
        scene: &SceneId,
        instance: &InstanceId,
    ) -> Result<PathBuf, EvalError> {
        let folder = self.folders[submission].join(scene.as_str()).join("texels");
        std::fs::create_dir_all(&folder).map_err(FileError::io("create", &folder))?;
        Ok(folder.join(instance.as_str()).with_extension("exr"))
    }

    fn view(&self, submission: usize, scene: &SceneId, view: &ViewId) -> PathBuf {
        self.folders[submission].join(scene.as_str()).join(view.as_str())
    }

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
        (track, lighting): (Track, Option<LightingName>),
        quarters: &[Picture<LinearRgb>],
        guide: &ViewGuide<'_>,
    ) -> Result<(), EvalError> {
        let kind = track.row().picture;
        let name = lighting.map_or_else(|| kind.to_string(), |name| format!("{kind}-{name}"));
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

fn write(folder: &Path, name: &str, picture: &Picture<LinearRgb>) -> Result<(), EvalError> {
    std::fs::create_dir_all(folder).map_err(FileError::io("create", folder))?;
    Ok(exr_io::write_linear(&folder.join(name).with_extension("exr"), picture, Precision::Float)?)
}
