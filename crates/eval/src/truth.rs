//! A scene of a dataset, opened and checked for scoring, and its ground truth: its maps, read as a prediction's would
//! be, and the pictures and masks of its views.

use std::path::PathBuf;
use std::sync::Arc;

use mateval_dataset::dataset::{Instance, SceneFile, View};
use mateval_dataset::layout::{INPUT, SceneFolder, is_rendered};
use mateval_dataset::open::Dataset;
use mateval_dataset::reference::{self, Surface};
use mateval_dataset::submission::Map;
use mateval_dataset::{DatasetError, InstanceId, RendererId, TriangleMesh};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{LinearRgb, Mask, Normal, Picture, Texture, Wrap, exr_io, png_io};
use mateval_submission::prediction::{PredictedMaterial, PredictedScene, one_texel, scattering_key};
use mateval_tracer::World;

use crate::error::EvalError;

/// The views of the scene that `targets.json` names, in the scene's order; at least one.
pub fn scored_views<'a>(dataset: &Dataset, scene: &'a SceneFile) -> Result<Vec<&'a View>, EvalError> {
    let targets = &dataset.targets.targets;
    let is_target = |view: &&View| targets.iter().any(|t| t.scene == scene.id && t.view == view.id);
    let views: Vec<&View> = scene.views.iter().filter(is_target).collect();
    if views.is_empty() {
        return Err(EvalError::unsound(format!("scene '{}'", scene.id), "a view of it in targets.json", "none"));
    }
    Ok(views)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ViewSet {
    /// The input view and the turned ones, which share their paths. In captured rooms also the views of other photos.
    Turned,
    Wide,
}

impl ViewSet {
    pub(crate) fn of<'a>(self, views: &[&'a View]) -> Vec<&'a View> {
        views.iter().filter(|view| view.id.is_wide() == (self == Self::Wide)).copied().collect()
    }

    /// The name of a pass over the set, part of its seeds.
    pub(crate) fn pass(self, name: &str) -> String {
        match self {
            Self::Turned => name.to_owned(),
            Self::Wide => format!("{name}_wide"),
        }
    }
}

pub struct OpenScene {
    pub folder: SceneFolder,
    /// Its true geometry, materials and lights, ready for ray tracing.
    pub world: World,
    /// The meshes of `instances.glb`, one with the same triangles for each surface of the world.
    pub atlases: Vec<TriangleMesh>,
}

impl OpenScene {
    /// Fails if a file differs from the dataset's manifest or does not fit the others: numbers carry the dataset's
    /// fingerprint, so they must come from the files that it covers. Renders are not checked here: references
    /// are when they are opened.
    pub fn read(dataset: &Dataset, scene: &SceneFile) -> Result<Self, EvalError> {
        // The input picture is a copy of a photo renderer's, which may have been renewed since.
        let is_needed = |file: &str| !is_rendered(file) && !file.starts_with("views/input/rgb.");
        dataset.check_files(&scene.id, is_needed)?;
        let folder = dataset.folder(&scene.id);
        let world = World::new(Arc::new(reference::read(&folder)?))?;
        let atlases = reference::read_plain(&folder, scene)?.surfaces;
        let triangles = |surface: &Surface| surface.mesh.triangles.len();
        if !atlases.iter().map(triangles).eq(world.scene().surfaces.iter().map(triangles)) {
            let what = "it does not fit ground_truth/reference/geometry.glb; run `mateval prep verify`".to_owned();
            return Err(DatasetError::Unsupported { path: folder.instances(), what }.into());
        }
        Ok(Self { folder, world, atlases: atlases.into_iter().map(|surface| surface.mesh).collect() })
    }
}

/// A view's true maps and its masks.
#[derive(Clone)]
pub struct ViewTruth {
    pub albedo: Picture<LinearRgb>,
    /// Perceptual, 0 to 1.
    pub roughness: Picture<f32>,
    /// 0 to 1.
    pub metallic: Picture<f32>,
    pub valid: Mask,
    /// Valid pixels that the input view does not see; none for the input view.
    pub unobserved: Option<Mask>,
    /// Valid pixels that are metal or smooth in truth; none if there are no such pixels.
    pub specular: Option<Mask>,
    /// Instance index of each pixel's centre, 0 for nothing.
    pub instances: Picture<u16>,
    /// Normal at each pixel's centre, in world space.
    pub normals: Picture<Normal>,
}

impl ViewTruth {
    /// Reads a view's maps and masks. Fails where one is missing, unreadable or not of the camera's size.
    pub fn read(folder: &SceneFolder, view: &View) -> Result<Self, EvalError> {
        let (shown, hidden) = (folder.view(&view.id), folder.truth_view(&view.id));
        let mask = |path: PathBuf| sized(view, png_io::read_mask(&path)?);
        let scalar = |name: &str| sized(view, exr_io::read_scalar(&hidden.join(name))?);
        let valid = mask(shown.join("valid.png"))?;
        // Masks of untrusted datasets may hold more than the valid pixels.
        let of_valid = |path| {
            let all = mask(path)?;
            Ok::<_, EvalError>(Mask::from_fn(all.width(), all.height(), |x, y| all.get(x, y) && valid.get(x, y)))
        };
        let is_input = view.id.as_str() == INPUT;
        let specular = of_valid(hidden.join("specular_region.png"))?;
        Ok(Self {
            albedo: sized(view, exr_io::read_linear(&hidden.join("albedo.exr"))?)?,
            roughness: scalar("roughness.exr")?,
            metallic: scalar("metallic.exr")?,
            unobserved: (!is_input).then(|| of_valid(shown.join("unobserved.png"))).transpose()?,
            specular: specular.pixels().contains(&true).then_some(specular),
            instances: sized(view, png_io::read_ids(&shown.join("instance.png"))?)?,
            normals: sized(view, exr_io::read_normal(&shown.join("normal.exr"))?)?,
            valid,
        })
    }
}

/// The picture of a view that the photo's renderer made, linear, before exposure.
pub fn photo_of_renderer(
    folder: &SceneFolder,
    renderer: &RendererId,
    view: &View,
) -> Result<Picture<LinearRgb>, EvalError> {
    sized(view, exr_io::read_linear(&folder.render(renderer, &view.id).join("rgb.exr"))?)
}

/// The picture; fails where it is not of the camera's size.
pub(crate) fn sized<T: Copy>(view: &View, picture: Picture<T>) -> Result<Picture<T>, EvalError> {
    let (k, width, height) = (view.camera.intrinsics, picture.width(), picture.height());
    if (width, height) == (k.width as usize, k.height as usize) {
        return Ok(picture);
    }
    let expected = format!("pictures of {}x{} pixels, the camera's size", k.width, k.height);
    Err(EvalError::unsound(format!("view '{}'", view.id), expected, format!("{width}x{height}")))
}

/// The true maps of an instance: its source's material baked to its atlas of `size` times `size` texels, with the
/// texels that a submission of the same files would have.
///
/// Fails where a file of `ground_truth/materials/<instance>/` is missing, unsound or of another size.
pub fn true_material(folder: &SceneFolder, instance: &InstanceId, size: usize) -> Result<PredictedMaterial, EvalError> {
    let read = |map: Map| {
        let encoding = if map == Map::BaseColor { Encoding::Srgb } else { Encoding::Linear };
        let png = folder.truth_material(instance).join(map.stem()).with_extension("png");
        let texture = read_texture(&png, encoding, Wrap::Clamp)?;
        let (width, height) = (texture.width(), texture.height());
        if (width, height) == (size, size) {
            return Ok(texture.collapsed());
        }
        let expected = format!("{size}x{size} texels, as scene.json states");
        Err(EvalError::unsound(format!("'{}'", png.display()), expected, format!("{width}x{height}")))
    };
    // A submission's constant scalar is one float.
    let compact = |map: Texture| if map.width() == 1 { one_texel(map.texel(0, 0)[0]) } else { map };
    let ((base_color, roughness), metallic) =
        rayon::join(|| rayon::join(|| read(Map::BaseColor), || read(Map::Roughness)), || read(Map::Metallic));
    Ok(PredictedMaterial { base_color: base_color?, roughness: compact(roughness?), metallic: compact(metallic?) })
}

/// All true maps of a scene.
pub(crate) fn true_maps(folder: &SceneFolder, scene: &SceneFile) -> Result<PredictedScene, EvalError> {
    let of = |instance: &Instance| {
        let atlas = instance.atlas.as_ref();
        atlas.map(|atlas| true_material(folder, &instance.id, atlas.size as usize)).transpose()
    };
    let materials = scene.instances.iter().map(of).collect::<Result<Vec<_>, _>>()?;
    let scattering_key = scattering_key(&materials);
    Ok(PredictedScene { materials, scattering_key, findings: Vec::new(), files: Vec::new() })
}
