//! What the input picture shows of a submission's maps: which place of which atlas each pixel sees, the values that the
//! maps hold there, also after the turns of common mistakes, and how these correlate with the picture.
//!
//! Pictures and geometry are read from the dataset's public files alone.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec2;
use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::{INPUT, SceneFolder};
use mateval_dataset::open::Dataset;
use mateval_dataset::reference::SurfaceIndex;
use mateval_dataset::{Camera, TriangleMesh, reference};
use mateval_image::{LinearRgb, Mask, Picture, Texture, exr_io, png_io};
use mateval_tracer::World;
use mateval_tracer::aov::hit_through;
use rayon::prelude::*;

use crate::error::SubmissionError;
use crate::texel_map::{SurfaceTexel, TexelMap};

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
    /// The picture's colour, linear; absent if the dataset has no picture.
    pub(super) photo: Option<[f32; 3]>,
    /// Its neighbourhood in the picture.
    pub(super) tile: usize,
}

/// A texel of a coarse atlas that lies on the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoarseTexel {
    /// Its place; v runs upwards.
    pub(super) uv: [f32; 2],
    pub(super) area_m2: f64,
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
        let view = scene.view(INPUT).ok_or_else(|| unsound(&folder, "an input view", "none"))?;
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

fn unsound(folder: &SceneFolder, expected: impl Into<String>, found: impl Into<String>) -> SubmissionError {
    let (expected, found) = (expected.into(), found.into());
    SubmissionError::UnsoundScene { scene_file: folder.scene_file(), expected, found }
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
        let mut sizes = vec![[valid.width(), valid.height()], [ids.width(), ids.height()]];
        sizes.extend(photo.as_ref().map(|photo| [photo.width(), photo.height()]));
        if let Some(found) = sizes.into_iter().find(|size| *size != expected) {
            let expected = format!("pictures of {}x{} pixels for the input view", expected[0], expected[1]);
            return Err(unsound(folder, expected, format!("one of {}x{}", found[0], found[1])));
        }
        let world = World::new(Arc::new(reference::read_plain(folder, scene)?))?;
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
            Some(mesh.uv_at(hit.triangle, hit.barycentrics)?.to_array())
        });
        let uvs = [uvs[0]?, uvs[1]?, uvs[2]?, uvs[3]?];
        Some((instance, SeenPixel { uvs, photo: self.photo.as_ref().map(|photo| photo.get(x, y).0), tile }))
    }
}

fn coarse_texels(world: &World, instance: usize, camera: &Camera) -> Vec<CoarseTexel> {
    let mesh: &TriangleMesh = &world.scene().surfaces[instance].mesh;
    let map = TexelMap::new(world, SurfaceIndex(instance), mesh, COARSE, camera);
    let texels = (0..COARSE).flat_map(|y| map.row(y).map(move |texel| (y, texel)));
    let coarse = |(y, texel): (usize, SurfaceTexel)| CoarseTexel {
        uv: map.uv(&texel, y),
        area_m2: texel.area_m2,
        observed: texel.observed,
    };
    texels.map(coarse).collect()
}

/// How an atlas may have been turned when it was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    None,
    /// Top and bottom exchanged: v counted from the other end.
    Vertical,
    /// Left and right exchanged.
    Horizontal,
    /// Both: half a turn.
    Half,
    /// Rows and columns exchanged.
    Transposed,
}

impl Turn {
    /// All of them, [`Turn::None`] first.
    pub(super) const ALL: [Self; 5] = [Self::None, Self::Vertical, Self::Horizontal, Self::Half, Self::Transposed];

    /// Where in the file the value lies that belongs at `uv`; v runs upwards.
    fn place(self, [u, v]: [f32; 2]) -> [f32; 2] {
        match self {
            Self::None => [u, v],
            Self::Vertical => [u, 1.0 - v],
            Self::Horizontal => [1.0 - u, v],
            Self::Half => [1.0 - u, 1.0 - v],
            Self::Transposed => [1.0 - v, 1.0 - u],
        }
    }
}

/// A pixel of the picture with the base colour that the submission has there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    pub(super) instance: usize,
    /// Its neighbourhood in the picture.
    pub(super) tile: usize,
    /// The picture's colour, linear.
    pub(super) photo: Option<[f32; 3]>,
    /// The base colour, linear, under each of [`Turn::ALL`].
    pub(super) base_color: [[f32; 3]; 5],
}

impl Look {
    /// The base colour as scoring reads it.
    pub(super) fn own(&self) -> [f32; 3] {
        self.base_color[0]
    }
}

/// The base colour at each pixel that shows the instance.
pub(super) fn looks(instance: usize, pixels: &[SeenPixel], base_color: &Texture) -> Vec<Look> {
    let look = |pixel: &SeenPixel| Look {
        instance,
        tile: pixel.tile,
        photo: pixel.photo,
        base_color: Turn::ALL.map(|turn| mean(base_color, pixel, turn)),
    };
    pixels.iter().map(look).collect()
}

#[derive(Clone, Copy, Debug)]
pub(super) struct ScalarLook {
    pub(super) roughness: f32,
    pub(super) metallic: f32,
}

/// Both maps at each pixel that shows the instance; absent if a map is missing.
pub(super) fn scalar_looks(
    pixels: &[SeenPixel],
    roughness: Option<Texture>,
    metallic: Option<Texture>,
) -> Vec<ScalarLook> {
    let (Some(roughness), Some(metallic)) = (roughness, metallic) else { return Vec::new() };
    let look = |pixel: &SeenPixel| {
        let [roughness, metallic] = [&roughness, &metallic].map(|map| mean(map, pixel, Turn::None)[0]);
        ScalarLook { roughness, metallic }
    };
    pixels.iter().map(look).collect()
}

/// The mean of a map over a pixel.
fn mean(texture: &Texture, pixel: &SeenPixel, turn: Turn) -> [f32; 3] {
    let sum = pixel.uvs.iter().fold([0.0; 3], |sum: [f32; 3], uv| {
        let value = texture.sample(turn.place(*uv));
        std::array::from_fn(|c| sum[c] + value[c])
    });
    sum.map(|sum| sum / pixel.uvs.len() as f32)
}

/// Sums over pairs of numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pairs {
    count: f64,
    x: f64,
    y: f64,
    xx: f64,
    yy: f64,
    xy: f64,
}

impl Pairs {
    pub(super) fn add(&mut self, x: f64, y: f64) {
        self.count += 1.0;
        self.x += x;
        self.y += y;
        self.xx += x * x;
        self.yy += y * y;
        self.xy += x * y;
    }

    /// The sums of all pairs after the mean of each pair's group has been subtracted.
    pub(super) fn within<K: Ord>(pairs: impl IntoIterator<Item = (K, f64, f64)>) -> Self {
        let mut groups: BTreeMap<K, Self> = BTreeMap::new();
        pairs.into_iter().for_each(|(group, x, y)| groups.entry(group).or_default().add(x, y));
        groups.values().fold(Self::default(), |sum, group| {
            let [xx, yy, xy] = group.centred();
            Self { count: sum.count + group.count, xx: sum.xx + xx, yy: sum.yy + yy, xy: sum.xy + xy, ..sum }
        })
    }

    pub(super) fn count(&self) -> f64 {
        self.count
    }

    /// The standard deviations of x and of y.
    pub(super) fn deviations(&self) -> [f64; 2] {
        let [xx, yy, _] = self.centred();
        [xx, yy].map(|sum| (sum / self.count.max(1.0)).sqrt())
    }

    /// The correlation, -1 to 1; 0 where x or y is constant.
    pub(super) fn correlation(&self) -> f64 {
        let [xx, yy, xy] = self.centred();
        if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
    }

    /// Squares and products about the means, summed.
    fn centred(&self) -> [f64; 3] {
        let count = self.count.max(1.0);
        let about = |sum: f64, a: f64, b: f64| sum - a * b / count;
        let [xx, yy] = [about(self.xx, self.x, self.x), about(self.yy, self.y, self.y)].map(|sum| sum.max(0.0));
        [xx, yy, about(self.xy, self.x, self.y)]
    }
}

#[cfg(test)]
mod tests {
    use mateval_image::{Texels, Wrap};

    use super::*;

    /// Four different texels, turned when they were written: each turn finds the one that belongs at the upper left.
    #[test]
    fn turns_find_the_texel_that_was_moved() {
        let written = |texels: [f32; 4]| Texture::new(2, 2, Texels::Grey(texels.into()), Wrap::Clamp).unwrap();
        let upper_left = SeenPixel { uvs: [[0.25, 0.75]; 4], photo: None, tile: 0 };
        let files = [[1.0, 2.0, 3.0, 4.0], [3.0, 4.0, 1.0, 2.0], [2.0, 1.0, 4.0, 3.0], [4.0, 3.0, 2.0, 1.0]];
        for (turn, file) in Turn::ALL.into_iter().zip(files) {
            assert_eq!(mean(&written(file), &upper_left, turn)[0], 1.0, "{turn:?}");
        }
        let upper_right = SeenPixel { uvs: [[0.75, 0.75]; 4], ..upper_left };
        assert_eq!(mean(&written([1.0, 3.0, 2.0, 4.0]), &upper_right, Turn::Transposed)[0], 2.0);
    }

    #[test]
    fn a_line_and_groups_on_lines() {
        let mut line = Pairs::default();
        (0..5).for_each(|x| line.add(f64::from(x), 3.0 - 2.0 * f64::from(x)));
        assert!((line.correlation() + 1.0).abs() < 1e-12);
        let [x, y] = line.deviations();
        assert!((x - 2.0_f64.sqrt()).abs() < 1e-12 && (y - 2.0 * x).abs() < 1e-12);
        // Two groups, each rising, the later far below: within them it rises, over all it falls.
        let groups = (0..10).map(|k| (k / 5, f64::from(k), f64::from(k % 5) - 100.0 * f64::from(k / 5)));
        let mut all = Pairs::default();
        groups.clone().for_each(|(_, x, y)| all.add(x, y));
        assert!(all.correlation() < -0.5 && (Pairs::within(groups).correlation() - 1.0).abs() < 1e-12);
    }
}
