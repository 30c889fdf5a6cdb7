//! Pictures of submissions' maps, looked up at the truth's own first hits.

use std::cell::LazyCell;

use glam::Vec2;
use mateval_dataset::Camera;
use mateval_image::{LinearRgb, Picture};
use mateval_submission::prediction::PredictedScene;
use mateval_tracer::Hit;
use mateval_tracer::aov::{
    COARSE_SUBPIXELS, PixelMean, SUBPIXELS, appearance, coarse_subpixels, flatness_values, places_through, subpixel,
};
use rayon::prelude::*;

use crate::truth::OpenScene;

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

/// Which of a pixel's sub-pixels are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Places {
    /// Those of the truth's pictures: the world's own materials decide whether a few suffice.
    AsTruth,
    /// All, since the world's materials are placeholders, which decide nothing.
    All,
}

/// Red, green and blue of the base colour, roughness, metallic.
type Values = [f32; 5];

/// The pictures of each submission. A pixel is the mean over those of its sub-pixels that hit an instance with a
/// predicted material, and 0 if there are none (such pixels are not valid). The same are looked at for all submissions,
/// and rays are traced once.
pub fn material_pictures(
    OpenScene { world, atlases, .. }: &OpenScene,
    camera: &Camera,
    submissions: &[&PredictedScene],
    wanted: Places,
) -> Vec<MaterialPictures> {
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    // Absent if the instance has no atlas.
    let lookup = |hit: Hit| Some((hit.surface.0, atlases[hit.surface.0].uv_at(hit.triangle.0, hit.barycentrics)?));
    let row = |y: usize| {
        let coarse = places_through(world, camera, (0..width).flat_map(|x| coarse_subpixels(x, y)));
        let mut rows = vec![Vec::with_capacity(width); submissions.len()];
        for (x, coarse) in coarse.chunks_exact(COARSE_SUBPIXELS).enumerate() {
            let others = LazyCell::new(|| {
                places_through(world, camera, (COARSE_SUBPIXELS..SUBPIXELS).map(|at| subpixel(x, y, at)))
            });
            let hit = |at: usize| at.checked_sub(COARSE_SUBPIXELS).map_or_else(|| coarse[at], |rest| others[rest]);
            let true_values = |at: usize| {
                let hit = hit(at)?;
                Some(flatness_values(&appearance(world, hit.surface, hit.triangle.0, hit.barycentrics)?))
            };
            let looked = match wanted {
                Places::AsTruth => PixelMean::of(true_values).looked,
                Places::All => SUBPIXELS,
            };
            let places: Vec<(usize, Vec2)> = (0..looked).filter_map(|at| lookup(hit(at)?)).collect();
            for (row, submission) in rows.iter_mut().zip(submissions) {
                row.push(mean_of(places.iter().filter_map(|place| values(submission, *place))));
            }
        }
        rows
    };
    let rows: Vec<Vec<Vec<Values>>> = (0..height).into_par_iter().map(row).collect();
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

fn mean_of(all: impl Iterator<Item = Values>) -> Values {
    let (mut sum, mut count) = ([0.0_f64; 5], 0_usize);
    for values in all {
        sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += f64::from(value));
        count += 1;
    }
    sum.map(|sum| if count == 0 { 0.0 } else { (sum / count as f64) as f32 })
}

/// The values of an instance at a uv of its atlas.
fn values(submission: &PredictedScene, (instance, uv): (usize, Vec2)) -> Option<Values> {
    let material = submission.materials[instance].as_ref()?;
    let uv = uv.to_array();
    let [r, g, b] = material.base_color.sample(uv);
    Some([r, g, b, material.roughness.sample(uv)[0], material.metallic.sample(uv)[0]])
}
