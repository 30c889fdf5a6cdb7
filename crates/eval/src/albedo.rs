//! Pictures of what submissions predict, seen through the truth's own first hits.

use glam::Vec2;
use mateval_image::{LinearRgb, Picture};
use mateval_scene::{Camera, TriangleMesh};
use mateval_tracer::World;
use mateval_tracer::aov::{hit_through, subpixels};
use rayon::prelude::*;

use crate::prediction::PredictedScene;

/// The albedo picture of each submission: the mean of its base colour over the same sub-pixels as the truth's. Rays are
/// traced once for all of them.
///
/// `atlases` are the meshes of `instances.glb` in the order of the world's surfaces. Black where nothing is predicted
/// (such pixels are not valid).
pub fn albedo_pictures(
    world: &World,
    atlases: &[TriangleMesh],
    camera: &Camera,
    submissions: &[PredictedScene],
) -> Vec<Picture<LinearRgb>> {
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let rows: Vec<Vec<Vec<LinearRgb>>> =
        (0..height).into_par_iter().map(|y| albedo_row(world, atlases, camera, submissions, width, y)).collect();
    (0..submissions.len())
        .map(|index| {
            let pixels = rows.iter().flat_map(|row| row[index].iter().copied()).collect();
            Picture::new(width, height, pixels).expect("there is a row of pixels for every row")
        })
        .collect()
}

/// Row `y` of every submission's picture.
fn albedo_row(
    world: &World,
    atlases: &[TriangleMesh],
    camera: &Camera,
    submissions: &[PredictedScene],
    width: usize,
    y: usize,
) -> Vec<Vec<LinearRgb>> {
    let mut rows = vec![Vec::with_capacity(width); submissions.len()];
    for x in 0..width {
        let lookups = subpixels(x, y).map(|place| {
            let hit = hit_through(world, camera, place)?;
            let mesh = &atlases[hit.surface.0];
            Some((hit.surface.0, hit.interpolate(&mesh.triangles, mesh.uvs.as_deref()?)))
        });
        for (row, submission) in rows.iter_mut().zip(submissions) {
            row.push(mean_base_color(submission, &lookups));
        }
    }
    rows
}

fn mean_base_color(submission: &PredictedScene, lookups: &[Option<(usize, Vec2)>]) -> LinearRgb {
    let mut sum = [0.0_f64; 3];
    let mut count = 0_usize;
    for (instance, uv) in lookups.iter().flatten() {
        let Some(material) = &submission.materials[*instance] else { continue };
        let color = material.base_color.sample(uv.to_array());
        for (sum, value) in sum.iter_mut().zip(color) {
            *sum += f64::from(value);
        }
        count += 1;
    }
    LinearRgb(sum.map(|sum| if count == 0 { 0.0 } else { (sum / count as f64) as f32 }))
}
