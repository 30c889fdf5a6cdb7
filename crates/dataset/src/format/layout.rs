//! The paths of files in a dataset, and of `.build`: what `prep` keeps there to work on it and no reader of a dataset
//! needs.

use std::path::{Path, PathBuf};

use crate::ids::{InstanceId, PartSetId, RendererId, SceneId, ViewId};

pub const DATASET: &str = "dataset.json";
pub const TARGETS: &str = "targets.json";
pub const MANIFEST: &str = "MANIFEST.sha256";
/// `compare.json`: a verdict about the dataset, which its identity does not cover.
pub const COMPARE: &str = "compare.json";
/// The list of a scene's references in `ground_truth/renders/scorer`. It is written last, so its presence means that
/// the pictures are complete.
pub const SCORER_JSON: &str = "scorer.json";
/// The whole `scene.json` of a hidden split, in the scene's folder; the public one leaves out what leads to its sources.
pub const WHOLE_SCENE: &str = "ground_truth/whole_scene.json";
/// The input view's id.
pub const INPUT: &str = ViewId::INPUT;

/// The meshes of a set of parts, relative to the scene's folder: `geometry/parts.glb` for the source's own parts,
/// `geometry/parts_<set>.glb` for another set.
pub fn parts_file(set: Option<&PartSetId>) -> String {
    set.map_or("geometry/parts.glb".to_owned(), |set| format!("geometry/parts_{set}.glb"))
}

/// The picture of a set of parts, relative to the view's folder: `part.png` for the source's own parts,
/// `part_<set>.png` for another set.
pub fn part_picture(set: Option<&PartSetId>) -> String {
    set.map_or("part.png".to_owned(), |set| format!("part_{set}.png"))
}

/// Whether a path in the dataset is of the form `scenes/<scene>/ground_truth/...`.
pub fn is_ground_truth(file: &str) -> bool {
    let mut parts = file.split('/');
    parts.next() == Some("scenes") && parts.nth(1) == Some("ground_truth")
}

/// Whether a path in the dataset is that of an input picture.
pub fn is_input_picture(file: &str) -> bool {
    file.ends_with("/views/input/rgb.exr") || file.ends_with("/views/input/rgb.png")
}

/// Whether a file, by its path in the dataset or in its scene's folder, is made by rendering other files of the scene.
pub fn is_rendered(file: &str) -> bool {
    // Scenes and instances may be named `renders` too.
    file.contains("/ground_truth/renders/") || file.starts_with("ground_truth/renders/")
}

#[derive(Clone, Debug)]
pub struct SceneFolder(PathBuf);

impl SceneFolder {
    /// `DATASET/scenes/<scene>`.
    pub fn of(dataset: &Path, scene: &SceneId) -> Self {
        Self(dataset.join("scenes").join(scene.as_str()))
    }

    /// The scene in `folder`, which may lie outside a dataset.
    pub fn at(folder: PathBuf) -> Self {
        Self(folder)
    }

    pub fn path(&self) -> &Path {
        &self.0
    }

    /// `scene.json`.
    pub fn scene_file(&self) -> PathBuf {
        self.0.join("scene.json")
    }

    /// `geometry/instances.glb`.
    pub fn instances(&self) -> PathBuf {
        self.0.join("geometry/instances.glb")
    }

    pub fn parts(&self, set: Option<&PartSetId>) -> PathBuf {
        self.0.join(parts_file(set))
    }

    /// `views/<view>`: what methods may see.
    pub fn view(&self, view: &ViewId) -> PathBuf {
        self.0.join("views").join(view.as_str())
    }

    /// `ground_truth`: may be withheld as a whole.
    pub fn truth(&self) -> PathBuf {
        self.0.join("ground_truth")
    }

    /// `ground_truth/views/<view>`.
    pub fn truth_view(&self, view: &ViewId) -> PathBuf {
        self.truth().join("views").join(view.as_str())
    }

    /// `ground_truth/materials/<instance>`: the true materials baked to the atlas.
    pub fn truth_material(&self, instance: &InstanceId) -> PathBuf {
        self.truth().join("materials").join(instance.as_str())
    }

    /// `ground_truth/renders/<renderer>/<view>`.
    pub fn render(&self, renderer: &RendererId, view: &ViewId) -> PathBuf {
        self.truth().join("renders").join(renderer.as_str()).join(view.as_str())
    }

    /// `ground_truth/renders/scorer`: the scorer's own pictures of the true maps. It is no renderer of photos.
    pub fn scorer(&self) -> PathBuf {
        self.truth().join("renders/scorer")
    }

    /// `ground_truth/renders/scorer/scorer.json`.
    pub fn scorer_file(&self) -> PathBuf {
        self.scorer().join(SCORER_JSON)
    }

    /// `ground_truth/lights.json`.
    pub fn lights(&self) -> PathBuf {
        self.truth().join("lights.json")
    }

    /// `ground_truth/measured.json`: the measured colours of a captured scene.
    pub fn measured(&self) -> PathBuf {
        self.truth().join("measured.json")
    }

    /// Whether colours were measured in the scene, as far as its ground truth is here.
    pub fn has_measured(&self) -> bool {
        self.measured().exists()
    }

    /// `ground_truth/views/<view>/photo.exr`: the photo of another view of a captured scene.
    pub fn novel_photo(&self, view: &ViewId) -> PathBuf {
        self.truth_view(view).join("photo.exr")
    }

    /// `ground_truth/views/<view>/measured.png`: the regions whose colour was measured.
    pub fn measured_regions(&self, view: &ViewId) -> PathBuf {
        self.truth_view(view).join("measured.png")
    }

    /// `ground_truth/material_classes.json`: the class of material of each part, where the source's reader states it.
    pub fn material_classes(&self) -> PathBuf {
        self.truth().join("material_classes.json")
    }

    /// `ground_truth/reference`: surfaces with their source uv, materials and textures.
    pub fn reference(&self) -> PathBuf {
        self.truth().join("reference")
    }

    /// `ground_truth/reference/source`: the source's own materials, where they were converted.
    pub fn source_materials(&self) -> PathBuf {
        self.reference().join("source")
    }
}

/// The folder's name in a dataset's folder.
pub const BUILD: &str = ".build";

/// The paths of one dataset's `.build`.
#[derive(Clone, Debug)]
pub struct BuildFolder(PathBuf);

impl BuildFolder {
    /// That of the dataset in `root`, whether it exists or not.
    pub fn of(root: &Path) -> Self {
        Self(root.join(BUILD))
    }

    pub fn path(&self) -> &Path {
        &self.0
    }

    /// States that the folder was made by `prep build`.
    pub fn key(&self) -> PathBuf {
        self.0.join("key.json")
    }

    pub fn recipe(&self) -> PathBuf {
        self.0.join("recipe.toml")
    }

    /// The folder of the marks of all scenes.
    pub fn marks(&self) -> PathBuf {
        self.0.join("scenes")
    }

    /// What `prep build` notes of a scene that it has made.
    pub fn mark(&self, scene: &SceneId) -> PathBuf {
        self.marks().join(format!("{scene}.json"))
    }

    /// The hashes of a scene's files.
    pub fn hashes(&self, scene: &SceneId) -> PathBuf {
        self.0.join("hashes").join(format!("{scene}.json"))
    }

    /// What making a scene has cost.
    pub fn cost(&self, scene: &SceneId) -> PathBuf {
        self.0.join("costs").join(format!("{scene}.json"))
    }

    /// The place of a scene that was left out of the dataset.
    pub fn left_out(&self, scene: &SceneId) -> PathBuf {
        self.0.join("left_out").join(scene.as_str())
    }
}
