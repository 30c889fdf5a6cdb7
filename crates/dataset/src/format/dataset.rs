//! The types of a dataset's JSON files, which `dataset_spec/format` documents for readers of the files: the dataset,
//! its scenes, the roles of their instances, and how perturbed geometry differs from the true one.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::findings::Finding;
use crate::ids::{InstanceId, InstanceIndex, PartId, PartIndex, PartSetId, RendererId, SceneId, ViewId};
use crate::lens::Lens;
use crate::lighting::LightingName;
use crate::material::MaterialParameter;

/// The name of this version of the format.
pub const FORMAT: &str = "mateval/3";

/// The version before it, which `mateval prep render --only scorer` brings up to date.
pub const PREVIOUS_FORMAT: &str = "mateval/2";

/// `dataset.json`: what this dataset is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DatasetFile {
    /// Always `mateval/3`.
    pub format: String,
    /// The dataset's name, from its recipe.
    pub name: String,
    /// The dataset's own version, from its recipe.
    pub version: String,
    /// The program and version that made it, as in `mateval 0.1.0`.
    pub tool: String,
    /// Ids of its scenes, in the recipe's order; each is a folder in `scenes/`. Twins follow the scene that they show.
    pub scenes: Vec<SceneId>,
    /// Those of its scenes that are twins: another scene under another light, from whose answers only constancy is
    /// scored. Absent where there are none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub twins: BTreeMap<SceneId, Twin>,
    /// The renderer that made the input pictures (`input/rgb`); null until all scenes without a photo from elsewhere
    /// are rendered, and where all scenes have one.
    pub photo_renderer: Option<RendererId>,
    /// Licence and credit of every scene.
    pub licences: Vec<Licence>,
    /// How its geometry differs from that of the dataset on which submissions are scored; absent where it is the true
    /// one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<PerturbedGeometry>,
    /// Whether its ground truth is withheld and what that is worth; absent where it is not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub withheld: Option<Secrecy>,
    /// SHA-256 of MANIFEST.sha256, hex. The manifest holds every file but itself and this one.
    pub manifest_sha256: String,
}

/// What a twin shows.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Twin {
    /// The scene with which it shares geometry, atlases and true maps.
    pub of: SceneId,
    /// The weights of that scene's light groups in its photo.
    pub lighting: LightingName,
}

/// What it is worth that the ground truth of a dataset is withheld.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Secrecy {
    /// No scene's truth follows from public files.
    Secret,
    /// The truth of some scenes follows from public files: withheld, not secret.
    NotSecret,
}

impl Secrecy {
    /// As pages and tables say it.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Secret => "truth withheld",
            Self::NotSecret => "truth withheld, not secret",
        }
    }
}

impl DatasetFile {
    /// A dataset of these scenes. What follows from its other files is still absent: twins, photos, licences, hash.
    pub fn new(name: &str, version: &str, tool: &str, scenes: Vec<SceneId>) -> Self {
        Self {
            format: FORMAT.to_owned(),
            name: name.to_owned(),
            version: version.to_owned(),
            tool: tool.to_owned(),
            scenes,
            twins: BTreeMap::new(),
            photo_renderer: None,
            licences: Vec::new(),
            geometry: None,
            withheld: None,
            manifest_sha256: String::new(),
        }
    }

    /// `manifest_sha256` of the dataset on which submissions made from this one are scored.
    pub fn scored_manifest_sha256(&self) -> &str {
        self.geometry.as_ref().map_or(&self.manifest_sha256, |geometry| &geometry.true_manifest_sha256)
    }

    /// Every licence text once, in the order of the first scene of each.
    pub fn shared_licences(&self) -> Vec<SharedLicence> {
        let mut places: BTreeMap<&str, usize> = BTreeMap::new();
        let mut all: Vec<SharedLicence> = Vec::new();
        for licence in &self.licences {
            let at = *places.entry(&licence.text).or_insert(all.len());
            if at == all.len() {
                all.push(SharedLicence { file: licence.file.clone(), text: licence.text.clone(), scenes: Vec::new() });
            }
            all[at].scenes.push(licence.scene.clone());
        }
        all
    }

    /// The scenes for which no licence is stated.
    pub fn without_licence(&self) -> Vec<SceneId> {
        let has = |id: &SceneId| self.licences.iter().any(|licence| licence.scene == *id);
        self.scenes.iter().filter(|id| !has(id)).cloned().collect()
    }

    pub fn perturbation(&self) -> Option<Perturbation> {
        self.geometry.as_ref().map(|geometry| geometry.perturbation)
    }

    /// What other files name it by.
    pub fn named(&self) -> DatasetVersion {
        let Self { name, version, manifest_sha256, .. } = self;
        DatasetVersion { name: name.clone(), version: version.clone(), manifest_sha256: manifest_sha256.clone() }
    }
}

/// The dataset that a file is about.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DatasetVersion {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SHA-256 of its manifest, in hexadecimal.
    pub manifest_sha256: String,
}

impl fmt::Display for DatasetVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "'{}' {} with manifest {}", self.name, self.version, self.manifest_sha256)
    }
}

/// A licence text and the scenes that it is about.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SharedLicence {
    /// Its file, relative to the source of the first of these scenes, or `recipe.toml`.
    pub file: String,
    /// The whole text.
    pub text: String,
    /// The scenes, in the dataset's order.
    pub scenes: Vec<SceneId>,
}

/// A scene's licence text, as it came with its source or as the recipe states it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Licence {
    /// The scene that it holds for.
    pub scene: SceneId,
    /// The file that it came from, relative to the source, or `recipe.toml`.
    pub file: String,
    /// The whole text.
    pub text: String,
}

/// `targets.json`: exactly what is scored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TargetsFile {
    /// Always `mateval/3`.
    pub format: String,
    /// One entry for each picture.
    pub targets: Vec<Target>,
}

/// One picture that is scored.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// The scene's id.
    pub scene: SceneId,
    /// The view's id, as in `scene.json`.
    pub view: ViewId,
}

/// `scenes/<scene>/scene.json`: the content of the scene and its views.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// Always `mateval/3`.
    pub format: String,
    /// The name of its folder, too.
    pub id: SceneId,
    /// Where it came from.
    pub source: SceneSource,
    /// The lights whose radiances track `fitted` fits: the scene's own, or a light stage's.
    pub lights: SceneLights,
    /// The materials of which the truth is made.
    pub materials: TrueMaterials,
    /// Multiplies every RGB picture before clipping.
    pub exposure: f64,
    /// The file of the input picture, where that came from elsewhere; absent where it is rendered. The light of such a
    /// picture is not known, so the scene has no renders, and its light is scored in captured rooms only, under lights
    /// that are fitted to the photo.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub photo: Option<Photo>,
    /// By view, the other photos of a captured room, with which renders are compared:
    /// `ground_truth/views/<view>/photo.exr`. Each has an exposure of its own, which is known where `relative_exposure`
    /// states it. Absent where there are none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub novel_photos: BTreeMap<ViewId, Photo>,
    /// The flash beside the cameras of a captured room; absent where none was fired.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flash: Option<Flash>,
    /// What is public of the truth, where materials were replaced by others that were drawn with a secret key; absent
    /// where the truth has the source's materials.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub redressed: Option<Redressed>,
    /// The input view first, then the novel ones.
    pub views: Vec<View>,
    /// In the order of their index.
    pub instances: Vec<Instance>,
    /// In the order of their index.
    pub parts: Vec<Part>,
    /// Other ways to split the instances into parts, from external labels.
    pub part_sets: Vec<PartSet>,
    /// What was wrong with the source and what was done instead, sorted.
    pub findings: Vec<Finding>,
}

/// Where a scene came from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneSource {
    pub kind: SourceKind,
    /// Scenes of one house (or one Bitterli scene) are not independent of each other: rankings treat them as one.
    pub house: String,
    /// Whether the recipe states that the source's files are not public, so that the truth does not follow from public
    /// ones.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub private: bool,
    /// Whether the source states the roughness of its materials. Otherwise that of the truth is a constant of the
    /// reader, and predictions of roughness are not scored.
    pub states_roughness: bool,
    /// Whether the source states which materials are metallic. Otherwise metallic is not scored.
    pub states_metallic: bool,
    /// What was subtracted from the source's positions: whole metres for a source far from the origin, else zero.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub shift_m: [f64; 3],
    /// Every file that was read, sorted by path.
    pub files: Vec<SourceFile>,
}

fn is_zero(shift_m: &[f64; 3]) -> bool {
    *shift_m == [0.0; 3]
}

/// What is public of the truth of a scene whose materials were replaced by others, drawn with a secret key.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Redressed {
    /// The share of the area of all surfaces with a base colour that `weak` lists, 0 to 1.
    pub weak_area_share: f64,
    /// The surfaces whose truth follows, at least in part, from public files; in the order of the instances.
    pub weak: Vec<WeakSecret>,
}

/// An instance whose truth follows, at least in part, from public files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WeakSecret {
    /// The instance's id.
    pub instance: InstanceId,
    /// Why its material could not be replaced.
    pub reason: WeakReason,
    /// Its share of the area of all surfaces with a base colour, 0 to 1.
    pub area_share: f64,
}

/// Why a material could not be replaced by another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WeakReason {
    /// Its picture is its point, as that of a painting, a book, a plant or a rug with a motif: it has other colours.
    Motif,
    /// Its picture also cuts out its shape: it has other colours.
    CutOut,
    /// Opaque glass: it has the source's mean colour.
    Glass,
    /// A mirror: it has the source's material.
    Kept,
}

/// A photo from elsewhere, in the place of a rendered picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Photo {
    /// Its path, which `source.files` lists with its hash.
    pub file: String,
    /// Its columns and rows before it was reduced to the size of the camera's picture.
    pub size: [u32; 2],
    /// How its values were read.
    pub encoding: PhotoEncoding,
    /// The number at which floating-point numbers are clipped; absent where it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub white: Option<f64>,
    /// The exposure of a photo of another view divided by that of the input photo; the written picture is the photo
    /// divided by it. Absent where it is not known, and for the input photo.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative_exposure: Option<f64>,
    /// The lens that it was undistorted from: `lens` shows the direction (x, y) of the camera's picture at its place in
    /// the file. Absent where the photo was only reduced.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens: Option<Lens>,
}

/// A flash that was fixed beside the camera while photos of a captured room were taken. It shines in all directions
/// alike, so that its light falls off with the square of the distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Flash {
    /// Its place from each camera, in metres: to the right, up, and back from what the camera looks at.
    pub offset_m: [f64; 3],
    /// Its radiant intensity, linear Rec. 709, in the unit of the photos' radiance before exposure times square metres:
    /// a white diffuse surface that faces it a metre away has this radiance divided by pi. Absent where it is not
    /// known; it is then fitted with the other lights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intensity: Option<[f64; 3]>,
    /// The views whose photos were taken with it.
    pub views: Vec<ViewId>,
    /// Whether it was the only light, so that no others are fitted.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub only_light: bool,
}

impl Flash {
    /// The farthest that a flash may be from its camera, in metres.
    pub const FARTHEST_M: f64 = 2.0;
    /// Beyond these a flash lights nothing, or renders overflow.
    const INTENSITIES: (f64, f64) = (1e-6, 1e6);

    /// The key of the first value that is out of range, what was found and what was expected.
    pub fn fault(&self) -> Option<(&'static str, String, String)> {
        let distance_m = self.offset_m.iter().map(|v| v * v).sum::<f64>().sqrt();
        // NaN is in no range.
        if !(0.0..=Self::FARTHEST_M).contains(&distance_m) {
            let expected = format!("a place of at most {} m from the camera", Self::FARTHEST_M);
            return Some(("offset_m", format!("{:?}", self.offset_m), expected));
        }
        let (least, most) = Self::INTENSITIES;
        let is_sound = |rgb: &[f64; 3]| rgb.iter().all(|v| *v == 0.0 || (least..=most).contains(v)) && *rgb != [0.0; 3];
        let found = self.intensity.as_ref().filter(|rgb| !is_sound(rgb))?;
        let expected = format!("numbers of {least} to {most}, or 0 of a channel without light");
        Some(("intensity", format!("{found:?}"), expected))
    }
}

/// How the values of a photo's file state radiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PhotoEncoding {
    /// Integers: radiance times the scene's exposure, clipped to 0..1, sRGB.
    Srgb,
    /// Floating-point numbers: linear radiance before exposure.
    Linear,
}

/// The materials of which a scene's truth is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TrueMaterials {
    /// The source's, converted to the model of every prediction, so that the maps describe a surface completely.
    #[default]
    Converted,
    /// The source's own.
    Source,
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SourceFile {
    /// Relative to the source's folder, forward slashes.
    pub path: String,
    /// SHA-256 of its bytes, hex.
    pub sha256: String,
}

/// One view: a folder in `views/` and `ground_truth/views/`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// `input`, or the offset's name; begins with `wide_` for views from another place, and for no others; `novel_1` and
    /// so on for the other photos of a captured room.
    pub id: ViewId,
    /// Degrees about the input camera's own X axis, up is positive; 0 for wide views and other photos.
    pub x_deg: f64,
    /// Degrees about the camera's own Y axis, after X; left is positive; 0 for wide views and other photos.
    pub y_deg: f64,
    /// The camera of every picture of the view.
    pub camera: Camera,
    /// How far a wide view is from the input view; absent for all others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wide: Option<WideView>,
}

/// How far a view from another place is from the input view.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WideView {
    /// Metres between both cameras.
    pub distance_m: f64,
    /// The share of the view's valid pixels that the input view does not show, 0 to 1.
    pub unseen_share: f64,
}

/// One object that methods provide textures for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Instance {
    /// Its folder in a submission and its node in `instances.glb`.
    pub id: InstanceId,
    /// Its value in `instance.png`.
    pub index: InstanceIndex,
    /// Its name in the source.
    pub name: String,
    pub role: Role,
    /// Its category; null where the source does not state it.
    pub category: Option<String>,
    /// The benchmark's broader category; null where the source does not state it.
    pub super_category: Option<String>,
    /// Triangles in `instances.glb`.
    pub triangles: usize,
    /// Parameters of its material that the source does not state; the truth has the default of the format or reader.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unstated: Vec<MaterialParameter>,
    /// Its uv atlas; null for glass and for shapes without area.
    pub atlas: Option<Atlas>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Atlas {
    /// Texels a side of the baked truth.
    pub size: u32,
    /// Number of charts.
    pub charts: u32,
    /// Share of the square that charts cover, 0 to 1.
    pub coverage: f64,
    /// Length of a texel's side on the surface in metres, averaged over the area.
    pub texel_m: f64,
    /// Length of half a pixel of the input view where the instance is nearest, in metres; null where no view shows it.
    /// A finer texel adds no visible detail.
    pub half_pixel_m: Option<f64>,
}

/// A piece of an instance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Its node in its set's `parts.glb`.
    pub id: PartId,
    /// Its value in its set's `part.png`.
    pub index: PartIndex,
    /// The instance that it belongs to.
    pub instance: InstanceId,
    /// Triangles in its set's `parts.glb`.
    pub triangles: usize,
}

/// A way to split all instances into parts other than the source's own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartSet {
    /// Its name, in `parts_<id>.glb` and `part_<id>.png`.
    pub id: PartSetId,
    /// In the order of their index.
    pub parts: Vec<Part>,
}

impl Instance {
    /// The category under which results list the instance: the source's, or for architecture its kind.
    pub fn listed_category(&self) -> Option<&str> {
        self.role.architecture_kind().or(self.category.as_deref())
    }

    /// The broader category under which results list the instance: the source's, or for architecture `Architecture`.
    pub fn listed_super_category(&self) -> Option<&str> {
        if self.role.is_architecture() { Some("Architecture") } else { self.super_category.as_deref() }
    }
}

impl SceneFile {
    /// The indices of the instances that belong to the building.
    pub fn architecture(&self) -> Vec<usize> {
        (0..self.instances.len()).filter(|&at| self.instances[at].role.is_architecture()).collect()
    }

    /// Every way to split the instances into parts: the source's own, which has no id, then those of `part_sets`.
    pub fn all_part_sets(&self) -> impl Iterator<Item = (Option<&PartSetId>, &[Part])> {
        let others = self.part_sets.iter().map(|set| (Some(&set.id), set.parts.as_slice()));
        std::iter::once((None, self.parts.as_slice())).chain(others)
    }

    /// Whether its truth is meant to be a secret: it was redressed, or its source is private.
    pub fn is_secret(&self) -> bool {
        self.redressed.is_some() || self.source.private
    }

    /// The exposure at which every clipped channel of a view's photo is at least 1: the scene's, or a larger one if the
    /// photo states a lower white. The scene's for a view without a photo.
    pub fn clipping_exposure(&self, view: &ViewId) -> f64 {
        let photo = if view.as_str() == ViewId::INPUT { self.photo.as_ref() } else { self.novel_photos.get(view) };
        let Some(photo) = photo else { return self.exposure };
        let of_file = photo.white.map_or(self.exposure, |white| self.exposure.max(1.0 / white));
        of_file * photo.relative_exposure.unwrap_or(1.0)
    }

    pub fn view(&self, id: &str) -> Option<&View> {
        self.views.iter().find(|view| view.id.as_str() == id)
    }
}

/// The role of an instance in its scene. The reader of the source states it, since only the source knows it.
// Variants without fields have braces, with which serde refuses unknown fields.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Role {
    /// A wall, a floor or another fixed surface of the building.
    Architecture {
        /// The source's type of mesh, as in `WallInner`.
        kind: String,
    },
    /// A piece of furniture that gives no light.
    Furniture {},
    /// A piece of furniture that gives light, such as a lamp.
    LightFixture {},
    /// Any other object, and every object of a source that does not state roles.
    Other {},
}

/// A source that does not state roles leaves them at this one.
impl Default for Role {
    fn default() -> Self {
        Self::Other {}
    }
}

impl Role {
    /// Whether the instance belongs to the building.
    pub fn is_architecture(&self) -> bool {
        matches!(self, Self::Architecture { .. })
    }

    /// Whether the instance is furniture, with or without light.
    pub fn is_furniture(&self) -> bool {
        matches!(self, Self::Furniture {} | Self::LightFixture {})
    }

    /// Whether the instance is a ceiling, by the source's type of mesh.
    pub fn is_ceiling(&self) -> bool {
        self.architecture_kind().is_some_and(|kind| kind.to_lowercase().contains("ceiling"))
    }

    /// The source's type of mesh, where the instance belongs to the building.
    pub fn architecture_kind(&self) -> Option<&str> {
        match self {
            Self::Architecture { kind } => Some(kind),
            _ => None,
        }
    }
}

/// The kind of source that a scene came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SourceKind {
    /// One of Bitterli's scenes, as Mitsuba XML.
    Bitterli,
    /// A room of a 3D-FRONT house.
    Front3d,
    Gltf,
    /// A Blender file, which Blender baked.
    Blend,
    /// A real room, scanned and photographed, whose materials nobody knows.
    Capture,
}

impl SourceKind {
    pub const ALL: [Self; 5] = [Self::Bitterli, Self::Front3d, Self::Gltf, Self::Blend, Self::Capture];

    /// The name in tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::Front3d => "3D-FRONT",
            Self::Bitterli => "Bitterli",
            Self::Gltf => "glTF",
            Self::Blend => "Blender",
            Self::Capture => "Captures",
        }
    }

    /// The datasets that such scenes come from, in lower case without punctuation. Files of the other kinds belong to no known
    /// dataset.
    pub fn datasets(self) -> &'static [&'static str] {
        match self {
            // 3D-FRONT's furniture is 3D-FUTURE's.
            Self::Front3d => &["3dfront", "3dfuture"],
            Self::Bitterli => &["bitterli"],
            Self::Gltf | Self::Blend | Self::Capture => &[],
        }
    }

    /// Whether the source states what its surfaces are made of. Otherwise the materials of `ground_truth` are
    /// placeholders: they are no truth, and only measured colours and photos are scored.
    pub fn states_materials(self) -> bool {
        self != Self::Capture
    }
}

/// The word that JSON files use.
impl fmt::Display for SourceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

// The words are listed once, in `dataset_spec/format/recipe.md`, so that a new source changes no schema.
impl JsonSchema for SourceKind {
    fn schema_name() -> Cow<'static, str> {
        "SourceKind".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "The kind of source that a scene came from; format/recipe.md lists the words.",
            "type": "string",
            "pattern": "^[a-z0-9_]+$"
        })
    }
}

/// The lights whose radiances are fitted to the input view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SceneLights {
    /// The scene's own lights, which the source describes.
    Own,
    /// A light stage, since the source does not describe the scene's lights.
    Stage,
}

crate::word_enum! {
    /// A way in which the furniture that methods see differs from the true one.
    PerturbationKind, a "kind of perturbation":
    /// Every piece is moved in the plane of the floor and turned about the vertical.
    Pose = "pose",
    /// Every piece is enlarged or reduced.
    Scale = "scale",
    /// The surface of every piece is bent.
    Shape = "shape",
}

impl PerturbationKind {
    /// The highest level; the lowest is 1.
    pub fn most_level(self) -> u32 {
        match self {
            Self::Pose | Self::Shape => 3,
            Self::Scale => 2,
        }
    }
}

/// A kind and a level, as in `pose 2`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Perturbation {
    pub kind: PerturbationKind,
    /// The level, from 1. True geometry has no perturbation.
    #[schemars(range(min = 1))]
    pub level: u32,
}

impl fmt::Display for Perturbation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.kind, self.level)
    }
}

/// Of a dataset with perturbed geometry: the perturbation, and the dataset on which submissions made from it are
/// scored.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PerturbedGeometry {
    /// How its geometry differs from the true one.
    pub perturbation: Perturbation,
    /// `manifest_sha256` of the dataset with true geometry.
    pub true_manifest_sha256: String,
}

/// 3D-FUTURE's eight super-categories, those with the most models first.
pub const SUPER_CATEGORIES: [&str; 8] =
    ["Cabinet/Shelf/Desk", "Sofa", "Lighting", "Chair", "Others", "Bed", "Table", "Pier/Stool"];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roles_have_one_spelling() {
        let wall = Role::Architecture { kind: "WallInner".to_owned() };
        let spellings = [
            (wall, r#"{"type":"architecture","kind":"WallInner"}"#),
            (Role::Furniture {}, r#"{"type":"furniture"}"#),
            (Role::LightFixture {}, r#"{"type":"light_fixture"}"#),
            (Role::Other {}, r#"{"type":"other"}"#),
        ];
        for (role, text) in spellings {
            assert_eq!(serde_json::to_string(&role).unwrap(), text);
            assert_eq!(serde_json::from_str::<Role>(text).unwrap(), role);
        }
        for unknown in [r#"{"type":"wall"}"#, r#"{"type":"architecture"}"#, r#"{"type":"furniture","kind":"Bed"}"#] {
            assert!(serde_json::from_str::<Role>(unknown).is_err(), "{unknown}");
        }
    }

    #[test]
    fn a_flash_is_near_its_camera_and_shines() {
        let flash = |offset_m: [f64; 3], intensity: Option<[f64; 3]>| {
            let views = vec![ViewId::new("input").unwrap()];
            Flash { offset_m, intensity, views, only_light: false }.fault().map(|(key, ..)| key)
        };
        for sound in [None, Some([0.0, 2.0, 0.0]), Some([1e-6; 3])] {
            assert_eq!(flash([0.0, 2.0, 0.0], sound), None);
        }
        for far in [[1.5, 1.5, 0.0], [f64::NAN, 0.0, 0.0], [f64::INFINITY, 0.0, 0.0]] {
            assert_eq!(flash(far, None), Some("offset_m"));
        }
        for dark in [[0.0; 3], [-1.0, 1.0, 1.0], [f64::NAN, 1.0, 1.0], [f64::INFINITY; 3]] {
            assert_eq!(flash([0.0; 3], Some(dark)), Some("intensity"));
        }
    }

    #[test]
    fn kinds_print_as_in_json() {
        assert_eq!(SourceKind::Front3d.to_string(), "front3d");
        assert_eq!(Perturbation { kind: PerturbationKind::Pose, level: 2 }.to_string(), "pose 2");
    }
}
