//! Pictures of submissions' maps, looked up at the truth's own first hits.

use glam::Vec2;
use mateval_image::{LinearRgb, Picture};
use mateval_scene::{Camera, TriangleMesh};
use mateval_tracer::World;
use mateval_tracer::aov::{hit_through, subpixels};
use rayon::prelude::*;

use mateval_submission::prediction::PredictedScene;

/// A submission's maps as a view shows them; each pixel is a mean over its sub-pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialPictures {
    /// Linear Rec. 709; the file of the truth is called `albedo`.
    pub base_color: Picture<LinearRgb>,
    /// Perceptual, 0 to 1.
    pub roughness: Picture<f32>,
    /// 0 to 1.
    pub metallic: Picture<f32>,
}

/// Red, green and blue of the base colour, roughness, metallic.
type Values = [f32; 5];

/// The pictures of each submission. A pixel is the mean over those of its sub-pixels that hit an instance with a predicted
/// material, and 0 if there are none (such pixels are not valid). The sub-pixels are those of the truth's pictures. Rays
/// are traced once for all submissions.
///
/// `atlases` are the meshes of `instances.glb` in the order of the world's surfaces.
pub fn material_pictures(
    world: &World,
    atlases: &[TriangleMesh],
    camera: &Camera,
    submissions: &[PredictedScene],
) -> Vec<MaterialPictures> {
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let rows: Vec<Vec<Vec<Values>>> =
        (0..height).into_par_iter().map(|y| picture_row(world, atlases, camera, submissions, width, y)).collect();
    (0..submissions.len())
        .map(|index| {
            let pixels = rows.iter().flat_map(|row| row[index].iter().copied()).collect();
            let all = Picture::new(width, height, pixels).expect("there is a row of pixels for every row");
            MaterialPictures {
                base_color: all.map(|[r, g, b, ..]| LinearRgb([r, g, b])),
                roughness: all.map(|[.., roughness, _]| roughness),
                metallic: all.map(|[.., metallic]| metallic),
            }
        })
        .collect()
}

/// Row `y` of every submission's pictures.
fn picture_row(
    world: &World,
    atlases: &[TriangleMesh],
    camera: &Camera,
    submissions: &[PredictedScene],
    width: usize,
    y: usize,
) -> Vec<Vec<Values>> {
    let mut rows = vec![Vec::with_capacity(width); submissions.len()];
    for x in 0..width {
        let lookups = subpixels(x, y).map(|place| {
            let hit = hit_through(world, camera, place)?;
            let mesh = &atlases[hit.surface.0];
            Some((hit.surface.0, hit.interpolate(&mesh.triangles, mesh.uvs.as_deref()?)))
        });
        for (row, submission) in rows.iter_mut().zip(submissions) {
            row.push(mean_values(submission, &lookups));
        }
    }
    rows
}

fn mean_values(submission: &PredictedScene, lookups: &[Option<(usize, Vec2)>]) -> Values {
    let mut sum = [0.0_f64; 5];
    let mut count = 0_usize;
    for (instance, uv) in lookups.iter().flatten() {
        let Some(material) = &submission.materials[*instance] else { continue };
        let uv = uv.to_array();
        let [r, g, b] = material.base_color.sample(uv);
        let values = [r, g, b, material.roughness.sample(uv)[0], material.metallic.sample(uv)[0]];
        for (sum, value) in sum.iter_mut().zip(values) {
            *sum += f64::from(value);
        }
        count += 1;
    }
    sum.map(|sum| if count == 0 { 0.0 } else { (sum / count as f64) as f32 })
}
