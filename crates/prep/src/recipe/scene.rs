//! One scene of a recipe: its source, where the source's files are, its camera, and the settings of the scene.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::{Flash, View};
use mateval_dataset::lighting::LightingName;
use mateval_dataset::{PartSetId, SceneId, SourceKind};
use mateval_files::source_folder::SourceFolder;
use mateval_files::untrusted::shortened;
use mateval_image::photo::CameraExposure;
use mateval_sources::front3d::AppearanceRule;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::fault::{ATLAS_SIZES, FARTHEST_M, RESOLUTION, RecipeFault, RecipeSceneFault, ValueFault, check_sizes};

/// A scene of the dataset. It has exactly one source: `bitterli`, `front3d`, `gltf`, `blend` or `capture`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecipeScene {
    /// The scene's id.
    pub id: SceneId,
    /// The source: a Mitsuba scene, its XML. Everything that it needs lies in the same folder.
    pub bitterli: Option<PathBuf>,
    /// The source: a room of a 3D-FRONT house.
    pub front3d: Option<Front3dRoom>,
    /// The source: a glTF 2.0 file, `.glb` or `.gltf`. Everything that it needs lies in the same folder.
    pub gltf: Option<PathBuf>,
    /// The source: a Blender file, whose materials Blender bakes. Everything that it needs lies in the same folder.
    pub blend: Option<PathBuf>,
    /// The source: a real room that was scanned and photographed.
    pub capture: Option<CapturedRoom>,
    /// The house that the scene belongs to; rankings treat scenes of one house as one. If absent, the name of the XML's
    /// folder, the house's uid, the name of the glTF or Blender file without its ending, or that of the mesh's folder.
    pub house: Option<String>,
    /// The input camera: `position`, `target` and `fov_y_deg`, or for `front3d` also `seed` or `designer`. If absent,
    /// the source's own; `front3d` requires one, and `capture` has its own.
    pub camera: Option<RecipeCamera>,
    /// The input picture in place of a render, as the camera took it: a PNG, JPEG, WebP, TIFF, BMP, Radiance HDR or
    /// OpenEXR file. Rendered if absent.
    pub photo: Option<PathBuf>,
    /// Other materials for the whole room, drawn with a secret key; the source's own if absent. Not together with
    /// `photo` or `capture`.
    pub redress: Option<Redress>,
    /// Whether others have the files of the source.
    #[serde(default, rename = "source")]
    pub availability: Availability,
    /// Lightings under which the scene is shown again, as further scenes; their constancy is scored. Not together with
    /// `photo` or `capture`.
    #[serde(default)]
    pub twins: Vec<LightingName>,
    /// Further sets of parts, by name: folders with `<instance>.npy`, a label for each triangle.
    #[serde(default)]
    pub part_labels: BTreeMap<PartSetId, PathBuf>,
    /// SHA-256 of every file that the scene is made of, by its path as `scene.json` lists it under `source`. If any
    /// other byte is read, the scene is refused. Not checked if absent.
    #[serde(default)]
    pub inputs: BTreeMap<String, String>,
    /// Accept a scene that lacks more than 20 % of its models, meshes or textures.
    #[serde(default)]
    pub allow_missing: bool,
    /// Accept a scene whose source does not state the base colour of more than 5 % of the scored pixels.
    #[serde(default)]
    pub allow_unstated: bool,
    /// Width and height of its pictures in pixels; the recipe's if absent.
    #[schemars(inner(range(min = *RESOLUTION.start(), max = *RESOLUTION.end())))]
    pub resolution: Option<[u32; 2]>,
    /// Texels a side of its atlases; the recipe's if absent.
    #[schemars(range(min = *ATLAS_SIZES.start(), max = *ATLAS_SIZES.end()))]
    pub atlas_size: Option<u32>,
    /// Multiplies every RGB picture before clipping; above 0.
    #[serde(default = "default_exposure")]
    pub exposure: f64,
}

/// Whether others have the files of a scene's source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Availability {
    /// Anybody may have them, and can make the truth again.
    #[default]
    Public,
    /// Nobody else has them, so that the truth is a secret without `redress`.
    Private,
}

/// A real room: its scan, the cameras and photos that were taken of it, and the colours that were measured in it. Mesh
/// and cameras share one world.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CapturedRoom {
    /// The scan: a `.ply`, `.obj`, `.glb` or `.gltf` file.
    pub mesh: PathBuf,
    /// The file or folder of the cameras: format/capture.md, "Cameras".
    pub cameras: PathBuf,
    /// The folder of the photos.
    pub photos: PathBuf,
    /// The name of the input photo, with or without its ending.
    pub input: String,
    /// The names of photos of other views, with which renders of submissions are compared. They belong to the truth,
    /// and no method sees them.
    #[serde(default)]
    pub novel: Vec<String>,
    /// The measured colours: a `.json` file, or with any other ending a table of MAW's; format/capture.md, "Measured
    /// colours". If absent, the room is scored by its photos alone, and `novel` is required.
    pub measured: Option<PathBuf>,
    /// A NumPy file with an integer for each triangle of the mesh, the number of its instance; polygons are fans of
    /// triangles. If absent, the instances are those that the mesh names, or its connected pieces.
    pub labels: Option<PathBuf>,
    /// Metres for each unit of mesh and cameras; above 0.
    #[serde(default = "default_scale")]
    pub scale: f64,
    /// The direction up in the world of mesh and cameras, `[0, 0, 1]` for most scans.
    #[serde(default = "default_up")]
    pub up: [f64; 3],
    /// The names of the instances that belong to the building. `baseline delight` lets those glow whose name contains
    /// `ceiling`.
    #[serde(default)]
    pub architecture: Vec<String>,
    /// The number at which floating-point numbers of photos are clipped; integers are clipped at their largest one.
    pub white: Option<f64>,
    /// The exposures of photos, by their names in `input` and `novel`.
    #[serde(default)]
    pub exposures: BTreeMap<String, CameraExposure>,
    /// Whether the exposures of all other photos are those that their EXIF data states.
    #[serde(default)]
    pub exif: bool,
    /// A flash beside the camera.
    pub flash: Option<CapturedFlash>,
}

/// A flash that was fixed beside the camera.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CapturedFlash {
    /// Its place from each camera, in metres, at most 2 away: to the right, up, and back from what the camera looks at.
    pub offset_m: [f64; 3],
    /// Its radiant intensity, linear Rec. 709, in the unit of the input photo's radiance before exposure times square
    /// metres. Fitted if absent.
    pub intensity: Option<[f64; 3]>,
    /// The photos that were taken with it, as `input` and `novel` name them; all if absent.
    pub photos: Option<Vec<String>>,
    /// Whether it was the only light of all photos.
    #[serde(default)]
    pub only_light: bool,
}

impl CapturedFlash {
    /// Whether the photo of this name was taken with it.
    fn lit(&self, photo: &str) -> bool {
        self.photos.as_ref().is_none_or(|photos| photos.iter().any(|name| name == photo))
    }
}

fn default_scale() -> f64 {
    1.0
}

fn default_up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

impl CapturedRoom {
    /// What `scene.json` states of the flash. `views` are those of the input photo and of the novel ones, in order.
    pub(crate) fn flash_of(&self, views: &[View]) -> Option<Flash> {
        let flash = self.flash.as_ref()?;
        let &CapturedFlash { offset_m, intensity, only_light, .. } = flash;
        let lit = self.photo_names().zip(views).filter(|(photo, _)| flash.lit(photo));
        Some(Flash { offset_m, intensity, views: lit.map(|(_, view)| view.id.clone()).collect(), only_light })
    }

    /// The input photo and the novel ones.
    fn photo_names(&self) -> impl Iterator<Item = &String> {
        std::iter::once(&self.input).chain(&self.novel)
    }

    fn check_exposures(&self, faults: &mut Vec<RecipeSceneFault>) {
        for (photo, exposure) in &self.exposures {
            let key = format!("exposures.{photo}");
            if !self.photo_names().any(|known| known == photo) {
                let expected = "the name of a photo, as `input` and `novel` have it";
                faults.push(ValueFault::new(key, exposure.to_string(), expected).into());
            } else if !exposure.is_sound() {
                let [time, iso, f] = CameraExposure::RANGES.map(|(least, most)| format!("{least} to {most}"));
                let expected = format!("time_s of {time}, iso of {iso} and f_number of {f}");
                faults.push(ValueFault::new(key, format!("{exposure:?}"), expected).into());
            }
        }
        if !self.exif && !self.exposures.is_empty() && !self.exposures.contains_key(&self.input) {
            let expected = "that of the input photo too, to which the others are brought";
            faults.push(ValueFault::new("exposures", format!("{:?}", self.exposures.keys()), expected).into());
        }
    }

    fn check_flash(&self, faults: &mut Vec<RecipeSceneFault>) {
        let Some(flash) = &self.flash else { return };
        let &CapturedFlash { offset_m, intensity, only_light, .. } = flash;
        let fault = Flash { offset_m, intensity, views: Vec::new(), only_light }.fault();
        if let Some((key, found, expected)) = fault {
            faults.push(ValueFault::new(format!("flash.{key}"), found, expected).into());
        }
        if let Some(photos) = &flash.photos {
            let is_known = |photo: &String| self.photo_names().any(|known| known == photo);
            if photos.is_empty() || !photos.iter().all(is_known) {
                let expected = "names of photos, as `input` and `novel` have them";
                faults.push(ValueFault::new("flash.photos", format!("{photos:?}"), expected).into());
            }
        }
        if only_light && !self.photo_names().all(|photo| flash.lit(photo)) {
            let expected = "false, since photos that `photos` does not name have another light";
            faults.push(ValueFault::new("flash.only_light", "true", expected).into());
        }
        if intensity.is_none() && !flash.lit(&self.input) {
            let expected = "an intensity, since the input photo, to which it would be fitted, is without the flash";
            faults.push(ValueFault::new("flash.intensity", "none", expected).into());
        }
    }

    /// Its paths with their keys, and whether each must be a folder.
    fn paths(&self) -> impl Iterator<Item = (&'static str, &Path, bool)> {
        // Of cameras, COLMAP and Objects With Lighting have a folder, all others a file with an ending.
        let has_ending = self.cameras.extension().is_some();
        let measured = self.measured.as_deref().map(|measured| ("measured", measured, false));
        let labels = self.labels.as_deref().map(|labels| ("labels", labels, false));
        let all: [(&'static str, &Path, bool); 3] =
            [("mesh", &self.mesh, false), ("cameras", &self.cameras, !has_ending), ("photos", &self.photos, true)];
        all.into_iter().chain(measured).chain(labels)
    }
}

/// What a scene is redressed with. Both paths must lead out of the folder that the recipe's paths are relative to.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Redress {
    /// A file of at least 32 random bytes.
    pub key: PathBuf,
    /// A folder of tileable materials; if absent, materials are built-in procedural ones.
    pub materials: Option<PathBuf>,
}

/// A room of a 3D-FRONT house, and the paths of everything that it needs.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Front3dRoom {
    /// The house's JSON, of any release.
    pub house: PathBuf,
    /// The room's `instanceid`, as in `LivingDiningRoom-1912`.
    pub room: String,
    /// 3D-FUTURE's folder: `<jid>/raw_model.obj`, `<jid>/texture.png`, `model_info.json`.
    pub models: PathBuf,
    /// The folder of 3D-FRONT's textures, `<jid>/texture.png`; if absent, the architecture has colours only.
    pub textures: Option<PathBuf>,
    /// A file of designers' cameras: by `<uid>_<number>.jpg` an object whose `camera` has `pos`, `target` and `fov`,
    /// the vertical field of view in degrees. If absent, those in the house's JSON, which the last release has.
    pub cameras: Option<PathBuf>,
    /// Mirror the layout, and each piece of furniture back, as BlenderProc's loader does.
    #[serde(default)]
    pub blenderproc_compat: bool,
    /// Where roughness and metallic come from.
    #[serde(default)]
    pub appearance: AppearanceWord,
    /// The seed of the roughnesses that `appearance = "stated"` draws; 0 if absent.
    pub appearance_seed: Option<u64>,
}

/// The rule for the roughness and metallic of a 3D-FRONT room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AppearanceWord {
    /// 0.5 and 0 everywhere, as in BlenderProc.
    #[default]
    Constant,
    /// By the class of material that the data states.
    Stated,
}

impl Front3dRoom {
    /// The rule for its roughness and metallic. A room `is_redressed` by the classes of the stated ones.
    pub(crate) fn appearance_rule(&self, is_redressed: bool) -> AppearanceRule {
        match self.appearance {
            AppearanceWord::Constant if is_redressed => AppearanceRule::Stated { seed: 0 },
            AppearanceWord::Constant => AppearanceRule::Constant,
            AppearanceWord::Stated => AppearanceRule::Stated { seed: self.appearance_seed.unwrap_or(0) },
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RecipeSource<'a> {
    Bitterli(&'a Path),
    /// A room of a 3D-FRONT house.
    Front3d(&'a Front3dRoom),
    Gltf(&'a Path),
    Blend(&'a Path),
    Capture(&'a CapturedRoom),
}

/// A path that a scene's source needs.
pub(crate) struct SourcePath {
    pub(crate) key: &'static str,
    /// The path as the recipe states it.
    pub(crate) path: PathBuf,
    /// Whether the path must be a folder; otherwise it must be an ordinary file.
    pub(crate) is_folder: bool,
}

fn default_exposure() -> f64 {
    1.0
}

impl RecipeSource<'_> {
    pub fn kind(self) -> SourceKind {
        match self {
            Self::Bitterli(_) => SourceKind::Bitterli,
            Self::Front3d(_) => SourceKind::Front3d,
            Self::Gltf(_) => SourceKind::Gltf,
            Self::Blend(_) => SourceKind::Blend,
            Self::Capture(_) => SourceKind::Capture,
        }
    }
}

impl RecipeScene {
    /// The source of the scene. Fails unless the recipe names exactly one.
    pub fn source(&self) -> Result<RecipeSource<'_>, RecipeSceneFault> {
        let bitterli = self.bitterli.as_deref().map(RecipeSource::Bitterli);
        let front3d = self.front3d.as_ref().map(RecipeSource::Front3d);
        let gltf = self.gltf.as_deref().map(RecipeSource::Gltf);
        let blend = self.blend.as_deref().map(RecipeSource::Blend);
        let capture = self.capture.as_ref().map(RecipeSource::Capture);
        let mut named = [bitterli, front3d, gltf, blend, capture].into_iter().flatten();
        match (named.next(), named.next()) {
            (Some(source), None) => Ok(source),
            _ => Err(RecipeSceneFault::NotOneSource),
        }
    }

    /// The folder that the paths of the scene's files are relative to: the folder of the XML, glTF or .blend file, or
    /// else `source`, the folder that the recipe's paths are relative to.
    pub fn root(&self, source: &Path) -> PathBuf {
        match self.main_files().next() {
            Some((_, file, _)) => source.join(file).parent().map(Path::to_owned).unwrap_or_default(),
            None => source.to_owned(),
        }
    }

    /// The main files that the scene names, an XML, glTF or .blend file: key, path, and the name of its folder in messages.
    /// A valid scene has at most one.
    fn main_files(&self) -> impl Iterator<Item = (&'static str, &Path, &'static str)> {
        let all = [
            ("bitterli", &self.bitterli, "the XML's folder"),
            ("gltf", &self.gltf, "the glTF's folder"),
            ("blend", &self.blend, "the .blend file's folder"),
        ];
        all.into_iter().filter_map(|(key, file, folder)| Some((key, file.as_deref()?, folder)))
    }

    /// The paths that the source needs, relative to the folder of the recipe's paths.
    pub(crate) fn source_paths(&self) -> Vec<SourcePath> {
        let path = |key, path: &Path, is_folder| SourcePath { key, path: path.to_owned(), is_folder };
        let mut paths: Vec<SourcePath> = self.main_files().map(|(key, file, _)| path(key, file, false)).collect();
        if let Some(room) = &self.front3d {
            paths.push(path("house", &room.house, false));
            paths.push(path("models", &room.models, true));
            paths.extend(room.textures.as_deref().map(|textures| path("textures", textures, true)));
            paths.extend(room.cameras.as_deref().map(|cameras| path("cameras", cameras, false)));
        }
        if let Some(room) = &self.capture {
            paths.extend(room.paths().map(|(key, file, is_folder)| path(key, file, is_folder)));
        }
        paths
    }

    /// The paths that `scene.json` records, with their keys. They must be relative to the folder of the recipe's paths.
    pub(crate) fn recorded_paths(&mut self) -> Vec<(&'static str, &mut PathBuf)> {
        if let Some(room) = &mut self.capture {
            let files = [("mesh", &mut room.mesh), ("cameras", &mut room.cameras), ("photos", &mut room.photos)];
            let measured = room.measured.as_mut().map(|measured| ("measured", measured));
            let labels = room.labels.as_mut().map(|labels| ("labels", labels));
            return files.into_iter().chain(measured).chain(labels).collect();
        }
        let Some(room) = &mut self.front3d else { return Vec::new() };
        let optional = [("textures", room.textures.as_mut()), ("cameras", room.cameras.as_mut())];
        let mut paths = vec![("house", &mut room.house), ("models", &mut room.models)];
        paths.extend(optional.into_iter().filter_map(|(key, path)| Some((key, path?))));
        paths
    }

    /// Adds a [`RecipeFault`] for everything that is wrong with the scene.
    pub(super) fn check(&self, faults: &mut Vec<RecipeFault>) {
        check_sizes(&format!("scene '{}'", self.id), self.resolution, self.atlas_size, faults);
        let mut own = Vec::new();
        own.extend(self.check_source().err());
        if let Some(Front3dRoom { appearance: AppearanceWord::Constant, appearance_seed: Some(_), .. }) = self.front3d {
            own.push(RecipeSceneFault::UnusedSeed);
        }
        self.check_label_folders(&mut own);
        if let Some(photo) =
            self.photo.as_ref().filter(|photo| SourceFolder::relative(&photo.to_string_lossy()).is_err())
        {
            let expected = format!("a file below {}, relative to it", self.root_name());
            own.push(ValueFault::new("photo", format!("'{}'", photo.display()), expected).into());
        }
        if self.redress.is_some() && self.photo.is_some() {
            own.push(RecipeSceneFault::RedressedPhoto);
        }
        self.check_twins(&mut own);
        if let Some(room) = &self.capture {
            self.check_capture(room, &mut own);
        }
        if !(self.exposure > 0.0 && self.exposure.is_finite()) {
            own.push(ValueFault::new("exposure", self.exposure.to_string(), "a number above 0").into());
        }
        self.check_inputs(&mut own);
        if !self.camera.as_ref().is_none_or(RecipeCamera::is_in_range) {
            own.push(RecipeSceneFault::CameraRange);
        }
        faults.extend(own.into_iter().map(|fault| RecipeFault::Scene { scene: self.id.clone(), fault }));
    }

    /// A captured room has its own camera and photo, and no materials that others could replace.
    fn check_capture(&self, room: &CapturedRoom, faults: &mut Vec<RecipeSceneFault>) {
        let others = [
            ("camera", self.camera.is_some()),
            ("photo", self.photo.is_some()),
            ("redress", self.redress.is_some()),
            ("twins", !self.twins.is_empty()),
        ];
        let stated = others.into_iter().filter(|(_, is_stated)| *is_stated);
        faults.extend(stated.map(|(key, _)| RecipeSceneFault::NotOfCaptures { key }));
        if !(room.scale > 0.0 && room.scale.is_finite()) {
            faults.push(ValueFault::new("scale", room.scale.to_string(), "a number above 0").into());
        }
        let length = room.up.iter().map(|axis| axis * axis).sum::<f64>().sqrt();
        if !(length > 1e-6 && length.is_finite()) {
            faults.push(ValueFault::new("up", format!("{:?}", room.up), "a direction, as in [0, 0, 1]").into());
        }
        let is_white = |white: &f64| *white > 0.0 && white.is_finite();
        if let Some(white) = room.white.filter(|white| !is_white(white)) {
            faults.push(ValueFault::new("white", white.to_string(), "a number above 0").into());
        }
        if room.measured.is_none() && room.novel.is_empty() {
            let expected =
                "`measured`, or photos in `novel`; light is fitted to the input photo, which alone says little";
            faults.push(ValueFault::new("measured", "none", expected).into());
        }
        room.check_exposures(faults);
        room.check_flash(faults);
    }

    /// The scene has one source, and a camera that the source can provide.
    fn check_source(&self) -> Result<(), RecipeSceneFault> {
        match (self.source()?, &self.camera) {
            (RecipeSource::Front3d(_), None) => Err(RecipeSceneFault::NoCamera),
            (
                RecipeSource::Bitterli(_) | RecipeSource::Gltf(_) | RecipeSource::Blend(_),
                Some(RecipeCamera::Seed { .. } | RecipeCamera::Designer(_)),
            ) => Err(RecipeSceneFault::CameraOfRooms),
            _ => Ok(()),
        }
    }

    /// [`Self::root`], as messages name it.
    fn root_name(&self) -> &'static str {
        self.main_files().next().map_or("the folder that the recipe's paths are relative to", |(.., folder)| folder)
    }

    /// Twins need known light groups, ids, and each lighting once.
    fn check_twins(&self, faults: &mut Vec<RecipeSceneFault>) {
        if self.photo.is_some() && !self.twins.is_empty() {
            faults.push(RecipeSceneFault::PhotoTwins);
        }
        for (at, lighting) in self.twins.iter().enumerate() {
            if self.twins[..at].contains(lighting) {
                faults.push(ValueFault::new("twins", format!("'{lighting}' twice"), "each lighting once").into());
            }
            if lighting.twin_of(&self.id).is_err() {
                let expected =
                    format!("an `id` of the scene that leaves space for '--{lighting}' within 64 characters");
                faults.push(ValueFault::new("twins", format!("'{lighting}'"), expected).into());
            }
        }
    }

    fn check_label_folders(&self, faults: &mut Vec<RecipeSceneFault>) {
        for (set, folder) in &self.part_labels {
            if SourceFolder::relative(&folder.to_string_lossy()).is_err() {
                let expected = format!("a folder below {}, relative to it", self.root_name());
                let key = format!("part_labels.{set}");
                faults.push(ValueFault::new(key, format!("'{}'", folder.display()), expected).into());
            }
        }
    }

    fn check_inputs(&self, faults: &mut Vec<RecipeSceneFault>) {
        for (file, hash) in &self.inputs {
            if SourceFolder::relative(file).is_err() {
                faults.push(RecipeSceneFault::InputPath { file: file.clone() });
            }
            if hash.len() != 64 || !hash.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f')) {
                let expected = "a SHA-256, 64 lower-case hexadecimal digits";
                faults.push(
                    ValueFault::new(format!("inputs: '{file}'"), format!("'{}'", shortened(hash)), expected).into(),
                );
            }
        }
    }
}

/// The input camera of a scene.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "CameraWords")]
#[schemars(with = "CameraWords")]
pub enum RecipeCamera {
    /// Placed by hand.
    Given(GivenCamera),
    /// Found by drawing cameras in the room until one sees enough. The same seed finds the same camera.
    Seed {
        seed: u64,
        /// Vertical field of view in degrees; if absent, that of the recipe's camera rules.
        fov_y_deg: Option<f64>,
    },
    /// A designer's camera, by its number. It keeps its field of view.
    Designer(usize),
}

/// A camera that was placed by hand.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenCamera {
    /// Its position, in metres.
    pub position: [f64; 3],
    /// A point in the middle of the picture, in metres.
    pub target: [f64; 3],
    /// Vertical field of view in degrees.
    pub fov_y_deg: f64,
}

/// A camera's keys as they are in the file.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CameraWords {
    /// The place of a camera that is set by hand, in metres.
    #[schemars(inner(range(min = -FARTHEST_M, max = FARTHEST_M)))]
    position: Option<[f64; 3]>,
    /// The point in the middle of its picture, in metres; the camera is level with respect to +Y.
    #[schemars(inner(range(min = -FARTHEST_M, max = FARTHEST_M)))]
    target: Option<[f64; 3]>,
    /// The vertical field of view of a camera that is set by hand or drawn, above 0 and below 179; if absent, for a
    /// drawn one that of the `camera_rules`.
    fov_y_deg: Option<f64>,
    /// Cameras are drawn in the room until one keeps the `camera_rules`. The same seed finds the same camera.
    seed: Option<u64>,
    /// The number of a designer's camera, which keeps its field of view.
    designer: Option<usize>,
}

/// The keys of a camera fit together in none of the three ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "camera: expected {{ position, target, fov_y_deg }}, {{ seed }} (with or without fov_y_deg), or {{ designer }}"
)]
struct UnfitKeys;

impl TryFrom<CameraWords> for RecipeCamera {
    type Error = UnfitKeys;

    fn try_from(words: CameraWords) -> Result<Self, UnfitKeys> {
        match words {
            CameraWords {
                position: Some(position),
                target: Some(target),
                fov_y_deg: Some(fov_y_deg),
                seed: None,
                designer: None,
            } => Ok(Self::Given(GivenCamera { position, target, fov_y_deg })),
            CameraWords { position: None, target: None, fov_y_deg, seed: Some(seed), designer: None } => {
                Ok(Self::Seed { seed, fov_y_deg })
            }
            CameraWords { position: None, target: None, fov_y_deg: None, seed: None, designer: Some(number) } => {
                Ok(Self::Designer(number))
            }
            _ => Err(UnfitKeys),
        }
    }
}

impl RecipeCamera {
    /// Whether coordinates and field of view are in range.
    fn is_in_range(&self) -> bool {
        let has_sound_field = |fov_y_deg: f64| fov_y_deg > 0.0 && fov_y_deg < 179.0;
        match self {
            Self::Given(camera) => {
                let mut coordinates = camera.position.iter().chain(&camera.target);
                coordinates.all(|v| v.abs() <= FARTHEST_M) && has_sound_field(camera.fov_y_deg)
            }
            Self::Seed { fov_y_deg, .. } => fov_y_deg.is_none_or(has_sound_field),
            Self::Designer(_) => true,
        }
    }
}
