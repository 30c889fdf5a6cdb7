//! Submissions compared with the truth texel by texel, weighted by the texels' areas on the surface.
//!
//! Every texel counts, whether or not a view shows it.
//!
//! In: the baked truth of an instance, the maps of every submission. Out: [`InstanceTexelErrors`] for each submission.
//!
//! A [`TexelMap`], shared by all submissions, holds where each texel of the truth's atlas lies, how large it is and
//! whether the input camera sees it. One instance is in memory at a time.

use std::path::Path;

use mateval_dataset::dataset::{Instance, SceneFile};
use mateval_dataset::layout::{INPUT, SceneFolder};
use mateval_dataset::reference::SurfaceIndex;
use mateval_dataset::submission::MAP_SIZES;
use mateval_dataset::{Progress, Report};
use mateval_image::exr_io::Precision;
use mateval_image::{Texture, exr_io};
use mateval_submission::prediction::{PredictedMaterial, PredictedScene};
use mateval_submission::texel_map::TexelMap;

use crate::error::EvalError;
use crate::pictures_dir::PicturesDir;
use crate::result::{InstanceTexelErrors, TexelErrors};
use crate::truth::{OpenScene, true_material};

/// Weighted squared errors over the observed, or the unobserved, texels of one or several instances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct TexelSums {
    /// The sum of the weights: the texels' area on the surface, in square metres.
    area_m2: f64,
    /// Squared error of the base colour, linear, mean over its channels, times the weight.
    base_color: f64,
}

impl TexelSums {
    /// Adds other sums. The order of additions determines the last bits.
    fn add(&mut self, other: &Self) {
        self.area_m2 += other.area_m2;
        self.base_color += other.base_color;
    }

    fn errors(&self) -> TexelErrors {
        let base_color_mse = (self.area_m2 > 0.0).then(|| self.base_color / self.area_m2);
        TexelErrors { area_m2: self.area_m2, base_color_mse }
    }
}

/// Calls `work` for every instance that has an atlas, in the scene's order, with its place, its texels and its true
/// maps. Fails where the truth cannot be read or `scene.json` is unsound.
pub(crate) fn each_atlas(
    open: &OpenScene,
    scene: &SceneFile,
    step: &str,
    progress: Progress<'_>,
    mut work: impl FnMut(usize, &TexelMap, &PredictedMaterial) -> Result<(), EvalError>,
) -> Result<(), EvalError> {
    let input = scene.view(INPUT).ok_or_else(|| EvalError::no_input_view(&scene.id))?;
    for (at, instance) in scene.instances.iter().enumerate() {
        let Some(size) = checked_size(&open.folder, instance)? else { continue };
        progress(Report::step(&format!("{step} of {}", scene.id), at, scene.instances.len()));
        let (map, truth) = rayon::join(
            || TexelMap::new(&open.world, SurfaceIndex(at), &open.atlases[at], size, &input.camera),
            || true_material(&open.folder, &instance.id, size),
        );
        work(at, &map, &truth?)?;
    }
    Ok(())
}

/// Compares every instance that has an atlas, in the scene's order. Returns a list for each submission, in their order.
pub fn texture_space(
    open: &OpenScene,
    scene: &SceneFile,
    submissions: &[PredictedScene],
    pictures: Option<&PicturesDir>,
    progress: Progress<'_>,
) -> Result<Vec<Vec<InstanceTexelErrors>>, EvalError> {
    let mut compared = vec![Vec::new(); submissions.len()];
    each_atlas(open, scene, "texels", progress, |at, map, truth| {
        let (scene, instance) = (&scene.id, &scene.instances[at].id);
        for (number, (list, submission)) in compared.iter_mut().zip(submissions).enumerate() {
            let Some(prediction) = &submission.materials[at] else { continue };
            if let Some(pictures) = pictures {
                let path = pictures.texels(number, scene, instance)?;
                write_texels(&path, map, &prediction.base_color, &truth.base_color)?;
            }
            let [observed, unobserved] = compare(map, prediction, truth).map(|sums| sums.errors());
            list.push(InstanceTexelErrors { scene: scene.clone(), instance: instance.clone(), observed, unobserved });
        }
        Ok(())
    })?;
    Ok(compared)
}

/// The texels a side of an instance's atlas; absent if it has none. The sizes that a submission may have bound the
/// memory of the truth, too.
pub(crate) fn checked_size(folder: &SceneFolder, instance: &Instance) -> Result<Option<usize>, EvalError> {
    let Some(size) = instance.atlas.as_ref().map(|atlas| atlas.size as usize) else { return Ok(None) };
    if MAP_SIZES.contains(&size) {
        return Ok(Some(size));
    }
    let place = format!("'{}': instance '{}'", folder.scene_file().display(), instance.id);
    let expected = format!("an atlas of {} to {} texels a side", MAP_SIZES.start(), MAP_SIZES.end());
    Err(EvalError::unsound(place, expected, size.to_string()))
}

/// The squared errors of a prediction, weighted by area: of observed texels, then of unobserved ones.
///
/// Both are looked up at the texels' places, bilinearly, whatever the prediction's size: at a centre the truth is its
/// texel itself. Both are linear; nothing is clipped. The sums are the same for any number of threads.
fn compare(map: &TexelMap, prediction: &PredictedMaterial, truth: &PredictedMaterial) -> [TexelSums; 2] {
    let row = |y: usize| {
        let mut sums = [TexelSums::default(); 2];
        for texel in map.row(y) {
            let [p, t] = [prediction, truth].map(|maps| map.value(&maps.base_color, &texel, y));
            let [r, g, b] = [0, 1, 2].map(|c| (f64::from(p[c]) - f64::from(t[c])).powi(2));
            let area_m2 = texel.area_m2;
            sums[usize::from(!texel.observed)].add(&TexelSums { area_m2, base_color: area_m2 * (r + g + b) / 3.0 });
        }
        sums
    };
    let mut sums = [TexelSums::default(); 2];
    for row in &map.of_rows(row) {
        sums.iter_mut().zip(row).for_each(|(sum, row)| sum.add(row));
    }
    sums
}

/// Writes what the errors of an instance are computed from: for each texel of the atlas its area on the surface (0 off
/// it), 1 where the input view sees it, and the base colours of prediction and truth at its place.
fn write_texels(path: &Path, map: &TexelMap, prediction: &Texture, truth: &Texture) -> Result<(), EvalError> {
    let size = map.size();
    let mut planes = vec![vec![0.0; size * size]; 8];
    for y in 0..size {
        for texel in map.row(y) {
            let at = y * size + texel.column;
            let [p, t] = [prediction, truth].map(|texture| map.value(texture, &texel, y));
            let seen = if texel.observed { 1.0 } else { 0.0 };
            let values = [texel.area_m2 as f32, seen, p[0], p[1], p[2], t[0], t[1], t[2]];
            planes.iter_mut().zip(values).for_each(|(plane, value)| plane[at] = value);
        }
    }
    let names = ["area", "observed", "prediction.R", "prediction.G", "prediction.B", "truth.R", "truth.G", "truth.B"];
    Ok(exr_io::write_channels(path, size, size, names.into_iter().zip(planes).collect(), Precision::Float)?)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DVec3, Vec2};
    use mateval_dataset::material::{ColorInput, Material, MaterialModel};
    use mateval_dataset::reference::{MaterialIndex, ReferenceScene, Surface};
    use mateval_dataset::{Camera, Intrinsics, TriangleMesh};
    use mateval_image::{Picture, Texels, Wrap, png_io};
    use mateval_tracer::World;

    use super::*;

    /// Two triangles in one plane, all seen, of `areas` square metres. In the atlas they are alike, one in its left
    /// half and one as far in its right half.
    fn mesh(areas: [f32; 2]) -> TriangleMesh {
        let corners = |at: usize| {
            let side = (2.0 * areas[at]).sqrt();
            [Vec2::ZERO, Vec2::X, Vec2::Y].map(|p| (p * side + Vec2::X * (4.0 * at as f32 - 4.0)).extend(-8.0))
        };
        let uvs = |left: f32| [[0.0, 0.0], [0.4, 0.0], [0.0, 0.8]].map(|[u, v]| Vec2::new(u + left, v));
        TriangleMesh {
            positions: [corners(0), corners(1)].concat(),
            normals: None,
            uvs: Some([uvs(0.0), uvs(0.5)].concat()),
            triangles: vec![[0, 1, 2], [3, 4, 5]],
        }
    }

    fn world(mesh: &TriangleMesh) -> World {
        let model = MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.5; 3]), alpha: None };
        let material = Material { name: String::new(), model, two_sided: true, opacity: None, bump: None };
        let surface = Surface { name: String::new(), mesh: mesh.clone(), material: MaterialIndex(0) };
        let scene = ReferenceScene { surfaces: vec![surface], materials: vec![material], ..Default::default() };
        World::new(Arc::new(scene)).unwrap()
    }

    fn camera() -> Camera {
        let intrinsics = Intrinsics::from_fov_x(64, 64, std::f64::consts::FRAC_PI_2);
        Camera::look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y, intrinsics).unwrap()
    }

    fn map(areas: [f32; 2], size: usize) -> TexelMap {
        TexelMap::new(&world(&mesh(areas)), SurfaceIndex(0), &mesh(areas), size, &camera())
    }

    fn greys(size: usize, value: impl Fn(usize, usize) -> f32) -> Texture {
        let texels = Texels::Grey((0..size * size).map(|at| value(at % size, at / size)).collect());
        Texture::new(size, size, texels, Wrap::Clamp).unwrap()
    }

    fn truth(size: usize) -> PredictedMaterial {
        let base_color = greys(size, |x, y| ((7 * x + 13 * y) % 31) as f32 / 31.0);
        let [roughness, metallic] = [5, 11].map(|step| greys(size, |x, y| ((step * x + y) % 17) as f32 / 17.0));
        PredictedMaterial { base_color, roughness, metallic }
    }

    /// At any size, powers of two or not; and off by one texel it is not exact.
    #[test]
    fn truth_is_exact() {
        for size in [64, 100, 129] {
            let (map, truth) = (map([1.0, 3.0], size), truth(size));
            let [observed, unobserved] = compare(&map, &truth, &truth);
            assert!(observed.area_m2 > 3.0 && unobserved == TexelSums::default());
            assert_eq!((observed.errors().base_color_mse, unobserved.errors().base_color_mse), (Some(0.0), None));
            let moved = PredictedMaterial { base_color: greys(size, |x, _| x as f32), ..truth.clone() };
            assert!(compare(&map, &moved, &truth)[0].base_color > 0.0);
        }
    }

    /// The left triangle right, the right one a quarter off: half of the area, half of 1/16. At any size of the
    /// prediction.
    #[test]
    fn half_of_the_area_wrong() {
        let [grey, white] = [0.5, 1.0].map(|value| greys(1, |_, _| value));
        let truth = PredictedMaterial { base_color: grey.clone(), roughness: grey, metallic: white };
        for size in [64, 256, 320] {
            let half_wrong = greys(size, |x, _| if x < size * 15 / 32 { 0.5 } else { 0.75 });
            let prediction = PredictedMaterial { base_color: half_wrong, ..truth.clone() };
            let [observed, _] = compare(&map([2.0, 2.0], 64), &prediction, &truth);
            let found = observed.errors().base_color_mse.unwrap();
            assert!((found - 1.0 / 32.0).abs() < 1e-8, "{size}: {found}");
        }
    }

    /// The right triangle has as many texels as the left one and three times its area. By hand: 3/4 of 0.2 squared,
    /// where the mean over texels would be 1/2 of it.
    #[test]
    fn area_is_what_counts() {
        let zero = greys(1, |_, _| 0.0);
        let truth = PredictedMaterial { base_color: zero.clone(), roughness: zero.clone(), metallic: zero };
        let wrong = greys(64, |x, _| if x < 30 { 0.0 } else { 0.2 });
        let prediction = PredictedMaterial { base_color: wrong, ..truth.clone() };
        let map = map([1.0, 3.0], 64);
        let [observed, _] = compare(&map, &prediction, &truth);
        let square = f64::from(0.2_f32).powi(2);
        assert!((observed.errors().base_color_mse.unwrap() / square - 0.75).abs() < 1e-6);
        let texels: Vec<_> = (0..64).flat_map(|y| map.row(y)).collect();
        let wrong_texels = texels.iter().filter(|texel| texel.column >= 30).count();
        assert_eq!(2 * wrong_texels, texels.len());
    }

    /// Red is 0.3 off, green and blue are not: a third of 0.09. Nothing is clipped.
    #[test]
    fn colours_are_the_mean_over_channels_and_as_they_are() {
        let color = |rgb: [f32; 3]| Texture::new(1, 1, Texels::Linear(vec![rgb]), Wrap::Clamp).unwrap();
        let zero = greys(1, |_, _| 0.0);
        let truth = PredictedMaterial { base_color: color([1.0, 0.5, 0.0]), roughness: zero.clone(), metallic: zero };
        let prediction = PredictedMaterial { base_color: color([1.3, 0.5, 0.0]), ..truth.clone() };
        let [observed, _] = compare(&map([1.0, 1.0], 64), &prediction, &truth);
        assert!((observed.errors().base_color_mse.unwrap() - 0.03).abs() < 1e-7);
    }

    /// By the scene of the published examples.
    #[test]
    fn an_unsound_truth_is_an_error_that_says_which() {
        let example = include_str!("../../../../dataset_spec/examples/scene.json");
        let mut scene: SceneFile = serde_json::from_str(example).unwrap();
        let root = tempfile::tempdir().unwrap();
        let folder = SceneFolder::of(root.path(), &scene.id);
        let instance = scene.instances[0].id.clone();
        let maps = folder.truth_material(&instance);
        std::fs::create_dir_all(&maps).unwrap();
        png_io::write_rgb_bytes(&maps.join("base_color.png"), &Picture::filled(64, 64, [9; 3])).unwrap();
        for (map, size) in [("roughness", 128), ("metallic", 64)] {
            let path = maps.join(map).with_extension("png");
            png_io::write_grey_bytes(&path, &Picture::filled(size, size, 9)).unwrap();
        }
        let refused = || true_material(&folder, &instance, 64).unwrap_err().to_string();
        let text = refused();
        assert!(text.contains("roughness.png': expected 64x64 texels, as scene.json states, found 128x128"), "{text}");
        std::fs::remove_file(maps.join("roughness.png")).unwrap();
        assert!(refused().contains("roughness.png"));
        scene.instances[0].atlas.as_mut().unwrap().size = 1 << 20;
        let text = checked_size(&folder, &scene.instances[0]).unwrap_err().to_string();
        let expected = format!("instance '{instance}': expected an atlas of 64 to 4096 texels a side, found 1048576");
        assert!(text.contains(&expected), "{text}");
        scene.views.clear();
        let open = OpenScene { folder: folder.clone(), world: world(&mesh([1.0; 2])), atlases: Vec::new() };
        let found = texture_space(&open, &scene, &[], None, &|_| ());
        assert!(found.unwrap_err().to_string().contains("expected an input view"));
    }
}
