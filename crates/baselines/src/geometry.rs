//! A scene as methods see it: the instances' meshes with their atlas uv, rays through them, which instance each pixel
//! of an estimate shows and where on its surface, and the part that each triangle belongs to.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use mateval_dataset::dataset::{Part, SceneFile, View};
use mateval_dataset::layout::{INPUT, SceneFolder, part_picture};
use mateval_dataset::submission::MAP_SIZES;
use mateval_dataset::{Camera, DatasetError, PartSetId, TriangleMesh, glb, reference};
use mateval_image::{Mask, Picture, png_io};
use mateval_tracer::World;
use mateval_tracer::aov::{COARSE_SUBPIXELS, coarse_subpixels, hit_through};
use rayon::prelude::*;

use crate::error::BaselineError;
use crate::estimate::Region;

/// The public part of a scene. The surfaces of the world have the order of the instances in `scene.json`.
pub struct SceneGeometry<'a> {
    pub scene: &'a SceneFile,
    pub view: &'a View,
    pub folder: SceneFolder,
    /// All instances, opaque and without emission.
    pub world: World,
    /// `valid.png` of the input view.
    pub valid: Mask,
    /// `instance.png` of the input view.
    pub instances: Picture<u16>,
}

impl<'a> SceneGeometry<'a> {
    /// Reads the files of a scene that methods may see, and none of its ground truth.
    pub fn read(folder: SceneFolder, scene: &'a SceneFile) -> Result<Self, BaselineError> {
        let view = input_view(&folder, scene)?;
        let shown = folder.view(&view.id);
        let sizes =
            scene.instances.iter().filter_map(|instance| Some((instance, instance.atlas.as_ref()?.size as usize)));
        if let Some((instance, size)) = { sizes }.find(|(_, size)| !MAP_SIZES.contains(size)) {
            let what = format!("instance '{}' has an atlas of {size} texels; run `mateval prep verify`", instance.id);
            return Err(DatasetError::Unsupported { path: folder.scene_file(), what }.into());
        }
        let world = World::new(Arc::new(reference::read_plain(&folder, scene)?))?;
        let valid = png_io::read_mask(&shown.join("valid.png"))?;
        let instances = png_io::read_ids(&shown.join("instance.png"))?;
        let size = (view.camera.intrinsics.width as usize, view.camera.intrinsics.height as usize);
        if (valid.width(), valid.height()) != size || (instances.width(), instances.height()) != size {
            let what =
                "valid.png or instance.png is not as large as scene.json says; run `mateval prep verify`".to_owned();
            return Err(DatasetError::Unsupported { path: shown, what }.into());
        }
        Ok(Self { scene, view, folder, world, valid, instances })
    }

    /// The places of the instances that have an atlas.
    pub fn with_atlas(&self) -> Vec<usize> {
        (0..self.scene.instances.len()).filter(|at| self.scene.instances[*at].atlas.is_some()).collect()
    }

    /// An instance's mesh, whose uv are those of the atlas.
    pub fn mesh(&self, instance: usize) -> &TriangleMesh {
        &self.world.scene().surfaces[instance].mesh
    }

    /// The input view's picture of part indices, for a part set.
    pub fn part_picture(&self, set: Option<&PartSetId>) -> Result<Picture<u16>, BaselineError> {
        let path = self.folder.view(&self.view.id).join(part_picture(set));
        let picture = png_io::read_ids(&path)?;
        if picture.same_size(&self.valid) {
            return Ok(picture);
        }
        let what = "it is not as large as scene.json says; run `mateval prep verify`".to_owned();
        Err(DatasetError::Unsupported { path, what }.into())
    }
}

/// The input view, which estimates are made for.
pub(crate) fn input_view<'a>(folder: &SceneFolder, scene: &'a SceneFile) -> Result<&'a View, BaselineError> {
    let why = "has no view 'input'; run `mateval prep verify`";
    scene.view(INPUT).ok_or_else(|| BaselineError::unusable(&folder.scene_file(), why))
}

/// The picture of a view, linear and before exposure.
pub(crate) fn photo_file(folder: &SceneFolder, view: &View) -> Result<PathBuf, BaselineError> {
    let path = folder.view(&view.id).join("rgb.exr");
    let why = "does not exist: the scene has not been rendered; run `mateval prep render`";
    if path.is_file() { Ok(path) } else { Err(BaselineError::unusable(&path, why)) }
}

/// Marks pixels that show no instance.
const NO_INSTANCE: u16 = u16::MAX;

/// The instance that covers most of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Owner {
    instance: u16,
    /// Whether the instance covers the whole pixel.
    whole: bool,
}

/// The surface point that a pixel shows.
#[derive(Clone, Copy, Debug)]
pub struct SeenPoint {
    pub instance: usize,
    /// Column and row of the pixel.
    pub pixel: (usize, usize),
    /// World space, in metres.
    pub place: DVec3,
    /// Normal of the triangle, of unit length.
    pub normal: DVec3,
}

/// Which instance each pixel of a picture shows, at the picture's own size.
///
/// Only valid pixels count. A pixel on the edge between two instances mixes the colours of both, so it counts only for
/// instances that cover no whole pixel.
pub struct SeenPixels {
    /// The camera whose picture this is.
    pub camera: Camera,
    /// The part of the view that the picture shows.
    region: Region,
    owners: Picture<Owner>,
    /// For each instance, whether it covers a whole pixel.
    has_whole: Vec<bool>,
}

impl SeenPixels {
    /// Traces 16 rays through every pixel of the input view at this width and height.
    pub fn new(geometry: &SceneGeometry<'_>, size: (usize, usize)) -> Self {
        Self::of_region(geometry, size, Region::whole((geometry.valid.width(), geometry.valid.height())))
    }

    /// The same for a picture of this width and height that shows a part of the input view.
    pub fn of_region(geometry: &SceneGeometry<'_>, (width, height): (usize, usize), region: Region) -> Self {
        let camera = geometry.view.camera.cropped(region.corner, region.size, width as u32, height as u32);
        let rows: Vec<Vec<Owner>> = (0..height)
            .into_par_iter()
            .map(|y| (0..width).map(|x| owner(geometry, &camera, region, x, y)).collect())
            .collect();
        let owners = Picture::from_fn(width, height, |x, y| rows[y][x]);
        let mut has_whole = vec![false; geometry.scene.instances.len()];
        for owner in owners.pixels().iter().filter(|owner| owner.whole && owner.instance != NO_INSTANCE) {
            has_whole[usize::from(owner.instance)] = true;
        }
        Self { camera, region, owners, has_whole }
    }

    /// Whether the pixel's colour is that of the instance.
    pub fn shows(&self, instance: usize, x: usize, y: usize) -> bool {
        let owner = self.owners.get(x, y);
        usize::from(owner.instance) == instance && (owner.whole || !self.has_whole[instance])
    }

    /// The surface point of every pixel that shows an instance: the one nearest to the pixel's centre.
    pub fn points(&self, geometry: &SceneGeometry<'_>) -> Vec<SeenPoint> {
        let shown: Vec<(usize, usize, usize)> = self.shown_pixels().collect();
        let point = |(x, y, instance): (usize, usize, usize)| {
            let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let mut places = coarse_subpixels(x, y);
            places.sort_by(|a, b| a.distance_squared(centre).total_cmp(&b.distance_squared(centre)));
            let hits = std::iter::once(centre).chain(places);
            let mut hits = hits.filter_map(|place| hit_through(&geometry.world, &self.camera, place));
            let hit = hits.find(|hit| hit.surface.0 == instance)?;
            let corners = geometry.mesh(instance).corners(hit.triangle).map(|corner| corner.as_dvec3());
            let weights = hit.barycentrics.as_dvec3();
            let place = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
            let normal = geometry.mesh(instance).geometric_normal(hit.triangle);
            Some(SeenPoint { instance, pixel: (x, y), place, normal })
        };
        shown.into_par_iter().filter_map(point).collect()
    }

    /// The pixel of the input view that contains the centre of pixel (`x`, `y`).
    pub fn view_pixel(&self, x: usize, y: usize) -> (usize, usize) {
        view_pixel(self.region, (self.owners.width(), self.owners.height()), x, y)
    }

    /// Column, row and instance of every pixel that shows an instance.
    pub fn shown_pixels(&self) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        let (width, height) = (self.owners.width(), self.owners.height());
        let places = (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)));
        places.filter_map(|(x, y)| {
            let instance = usize::from(self.owners.get(x, y).instance);
            (instance < self.has_whole.len() && self.shows(instance, x, y)).then_some((x, y, instance))
        })
    }
}

/// The pixel of the input view that contains the centre of pixel (`x`, `y`) of a picture.
fn view_pixel(region: Region, size: (usize, usize), x: usize, y: usize) -> (usize, usize) {
    let place = region.place(size, x, y);
    (place.x as usize, place.y as usize)
}

fn owner(geometry: &SceneGeometry<'_>, camera: &Camera, region: Region, x: usize, y: usize) -> Owner {
    let none = Owner { instance: NO_INSTANCE, whole: false };
    let size = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let of_view = view_pixel(region, size, x, y);
    if !geometry.valid.get(of_view.0, of_view.1) {
        return none;
    }
    let hits = coarse_subpixels(x, y).map(|place| hit_through(&geometry.world, camera, place).map(|hit| hit.surface.0));
    let count = |instance: usize| hits.iter().filter(|hit| **hit == Some(instance)).count();
    let Some((most, instance)) = hits.iter().flatten().map(|&instance| (count(instance), instance)).max() else {
        return none;
    };
    let whole = most == COARSE_SUBPIXELS;
    // The dataset's own picture shows another instance where the ray hit a cut-out texel, which does not cover it.
    let shown = geometry.instances.get(of_view.0, of_view.1);
    if whole && geometry.scene.instances[instance].index.0.get() != shown {
        return none;
    }
    Owner { instance: instance as u16, whole }
}

/// The parts of a set, triangle by triangle.
pub struct PartTriangles<'a> {
    /// The parts, in the order of `scene.json`.
    pub parts: &'a [Part],
    /// For each part the index of its instance.
    pub owners: Vec<Option<usize>>,
    of_instance: Vec<Vec<Option<usize>>>,
}

/// The bits of a triangle's corners, which are the same in `instances.glb` and in the file of a part set.
type Corners = [[u32; 3]; 3];

impl<'a> PartTriangles<'a> {
    /// Reads the meshes of a part set; `None` stands for the parts of the source.
    pub fn read(geometry: &SceneGeometry<'a>, set: Option<&PartSetId>) -> Result<Self, BaselineError> {
        let parts = parts_of(geometry, set)?;
        let instances = &geometry.scene.instances;
        let place_of: HashMap<&str, usize> =
            instances.iter().enumerate().map(|(at, instance)| (instance.id.as_str(), at)).collect();
        let owners: Vec<Option<usize>> =
            parts.iter().map(|part| place_of.get(part.instance.as_str()).copied()).collect();
        let mut known: Vec<HashMap<Corners, usize>> = vec![HashMap::new(); instances.len()];
        for (part, node) in glb::read(&geometry.folder.parts(set))?.iter().enumerate().take(parts.len()) {
            let Some(owner) = owners[part] else { continue };
            let triangles = 0..node.mesh.triangles.len();
            known[owner].extend(triangles.map(|triangle| (corners(&node.mesh, triangle), part)));
        }
        let of_instance = known.iter().enumerate().map(|(at, known)| {
            let mesh = geometry.mesh(at);
            (0..mesh.triangles.len()).map(|triangle| known.get(&corners(mesh, triangle)).copied()).collect()
        });
        Ok(Self { parts, of_instance: of_instance.collect(), owners })
    }

    /// The place of each part by its index in pictures.
    pub(crate) fn place_of_index(&self) -> BTreeMap<u16, usize> {
        self.parts.iter().enumerate().map(|(at, part)| (part.index.0.get(), at)).collect()
    }

    /// The index of the part of each triangle of an instance.
    pub fn of(&self, instance: usize) -> &[Option<usize>] {
        &self.of_instance[instance]
    }
}

fn corners(mesh: &TriangleMesh, triangle: usize) -> Corners {
    mesh.corners(triangle).map(|corner| corner.to_array().map(f32::to_bits))
}

/// The parts of a set; `None` stands for the parts of the source.
pub fn parts_of<'a>(geometry: &SceneGeometry<'a>, set: Option<&PartSetId>) -> Result<&'a [Part], BaselineError> {
    let found = geometry.scene.all_part_sets().find(|(id, _)| *id == set).map(|(_, parts)| parts);
    found.ok_or_else(|| {
        let what = format!("no part set '{}'; `part_labels` in a recipe makes one", set.map_or("", PartSetId::as_str));
        DatasetError::Unsupported { path: geometry.folder.scene_file(), what }.into()
    })
}
