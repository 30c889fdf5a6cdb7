//! Which place of which atlas each pixel of the input picture shows, and in what colour. Read from public files alone.

use std::sync::Arc;

use glam::DVec2;
use mateval_image::{LinearRgb, Mask, Picture, exr_io, png_io};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_scene::open::Dataset;
use mateval_scene::reference::SurfaceIndex;
use mateval_scene::{Camera, TriangleMesh, plain_instances};
use mateval_tracer::World;
use mateval_tracer::aov::hit_through;
use rayon::prelude::*;

use crate::error::{SceneFault, SubmissionError};
use crate::texel_map::TexelMap;

/// Most pixels of the picture that are used.
const MOST_PIXELS: usize = 100_000;
/// Side of a neighbourhood in which light hardly changes, in pixels.
const TILE: usize = 16;
/// Side of the coarse atlas that is divided into observed and unobserved texels.
const COARSE: usize = 64;

/// A pixel that shows a single instance.
#[derive(Clone, Copy, Debug)]
pub(super) struct SeenPixel {
    /// The places of the atlas that four places of the pixel show; v runs upwards.
    pub(super) uvs: [[f32; 2]; 4],
    /// The picture's colour, linear; none where the dataset has no picture.
    pub(super) photo: Option<[f32; 3]>,
    /// Its neighbourhood in the picture.
    pub(super) tile: usize,
}

/// A texel of a coarse atlas that lies on the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoarseTexel {
    /// Its place; v runs upwards.
    pub(super) uv: [f32; 2],
    /// On the surface.
    pub(super) area_m2: f64,
    /// Whether the input picture shows it.
    pub(super) observed: bool,
}

/// The pixels that show an instance, and its texels, observed or not.
#[derive(Clone, Debug, Default)]
pub(super) struct InstanceSight {
    pub(super) pixels: Vec<SeenPixel>,
    pub(super) texels: Vec<CoarseTexel>,
}

/// A scene as the input camera sees it.
pub(super) struct Sight {
    /// In the scene's order; empty for instances without an atlas.
    pub(super) instances: Vec<InstanceSight>,
    /// Whether the dataset has an input picture.
    pub(super) has_photo: bool,
}

impl Sight {
    /// Reads a scene's geometry and pictures. Fails where a file is missing or differs from the manifest.
    pub(super) fn read(dataset: &Dataset, scene: &SceneFile) -> Result<Self, SubmissionError> {
        dataset.check_files(&scene.id, |file| {
            file == "geometry/instances.glb"
                || (file.starts_with("views/input/") && file.ends_with(".png"))
                || file == "views/input/rgb.exr"
        })?;
        let folder = dataset.folder(&scene.id);
        let view = scene.view(INPUT).ok_or_else(|| unsound(&folder, SceneFault::NoInputView))?;
        let eye = Eye::read(&folder, scene, view)?;
        let mut instances = vec![InstanceSight::default(); scene.instances.len()];
        for (instance, pixel) in eye.pixels() {
            instances[instance].pixels.push(pixel);
        }
        for at in (0..instances.len()).filter(|at| scene.instances[*at].atlas.is_some()) {
            instances[at].texels = coarse_texels(&eye.world, at, &view.camera);
        }
        Ok(Self { instances, has_photo: eye.photo.is_some() })
    }
}

fn unsound(folder: &SceneFolder, fault: SceneFault) -> SubmissionError {
    SubmissionError::UnsoundScene { scene_file: folder.scene_file(), fault }
}

/// The input view: its camera, its pictures and the scene in front of it.
struct Eye<'a> {
    world: World,
    scene: &'a SceneFile,
    camera: &'a Camera,
    valid: Mask,
    ids: Picture<u16>,
    photo: Option<Picture<LinearRgb>>,
}

impl<'a> Eye<'a> {
    fn read(folder: &SceneFolder, scene: &'a SceneFile, view: &'a View) -> Result<Self, SubmissionError> {
        let shown = folder.view(&view.id);
        let (valid, ids) =
            (png_io::read_mask(&shown.join("valid.png"))?, png_io::read_ids(&shown.join("instance.png"))?);
        let rgb = shown.join("rgb.exr");
        let photo = if rgb.exists() { Some(exr_io::read_linear(&rgb)?) } else { None };
        let expected = [view.camera.intrinsics.width as usize, view.camera.intrinsics.height as usize];
        let sizes = [Some([valid.width(), valid.height()]), Some([ids.width(), ids.height()])]
            .into_iter()
            .chain([photo.as_ref().map(|photo| [photo.width(), photo.height()])])
            .flatten();
        if let Some(found) = sizes.into_iter().find(|size| *size != expected) {
            return Err(unsound(folder, SceneFault::PictureSize { expected, found }));
        }
        let world = World::new(Arc::new(plain_instances::read(folder, scene)?))?;
        Ok(Self { world, scene, camera: &view.camera, valid, ids, photo })
    }

    /// The pixels that show a single instance. If the picture has too many, only every second, third... row and column
    /// is used.
    fn pixels(&self) -> Vec<(usize, SeenPixel)> {
        let (width, height) = (self.ids.width(), self.ids.height());
        let step = (1..).find(|step| (width / step) * (height / step) <= MOST_PIXELS).unwrap_or(1);
        let rows: Vec<usize> = (0..height).step_by(step).collect();
        let row = |y: usize| {
            let columns = (0..width).step_by(step);
            columns.filter_map(move |x| self.pixel(x, y, (y / step / TILE) * width + x / step / TILE))
        };
        rows.into_par_iter().flat_map_iter(row).collect()
    }

    fn pixel(&self, x: usize, y: usize, tile: usize) -> Option<(usize, SeenPixel)> {
        let instance = usize::from(self.ids.get(x, y)).checked_sub(1)?;
        if !self.valid.get(x, y) || self.scene.instances.get(instance)?.atlas.is_none() {
            return None;
        }
        let corner = DVec2::new(x as f64, y as f64);
        let mesh = &self.world.scene().surfaces[instance].mesh;
        let uvs = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]].map(|place| {
            let hit = hit_through(&self.world, self.camera, corner + DVec2::from(place))?;
            (hit.surface.0 == instance).then_some(())?;
            Some(hit.interpolate(&mesh.triangles, mesh.uvs.as_deref()?).to_array())
        });
        let uvs = [uvs[0]?, uvs[1]?, uvs[2]?, uvs[3]?];
        Some((instance, SeenPixel { uvs, photo: self.photo.as_ref().map(|photo| photo.get(x, y).0), tile }))
    }
}

fn coarse_texels(world: &World, instance: usize, camera: &Camera) -> Vec<CoarseTexel> {
    let mesh: &TriangleMesh = &world.scene().surfaces[instance].mesh;
    let map = TexelMap::new(world, SurfaceIndex(instance), mesh, COARSE, camera);
    let along = |at: usize| (at as f32 + 0.5) / COARSE as f32;
    let texels = (0..COARSE).flat_map(|y| map.row(y).map(move |texel| (y, texel)));
    let coarse = |(y, texel): (usize, crate::texel_map::SurfaceTexel)| CoarseTexel {
        uv: texel.off_centre.unwrap_or([along(texel.column), 1.0 - along(y)]),
        area_m2: texel.area_m2,
        observed: texel.observed,
    };
    texels.map(coarse).collect()
}
