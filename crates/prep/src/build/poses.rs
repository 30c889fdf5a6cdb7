//! Whether the camera of a captured room stands where its photo was taken: edges of the mesh, seen from there, must
//! fall on edges of the photo.
//!
//! Programs disagree about the axes of cameras and the direction of matrices, and exporters turn meshes. Where the pose
//! of another convention fits the photo, and clearly better than the stated one, a finding names that convention.

use glam::{DVec2, Vec3};
use mateval_dataset::camera::{Camera, Intrinsics};
use mateval_dataset::{Finding, Severity};
use mateval_image::{LinearRgb, Picture};
use mateval_tracer::World;
use mateval_tracer::aov::hit_through;
use rayon::prelude::*;

/// The most columns of the reduced pictures that are compared.
const MOST_COLUMNS: u32 = 240;
/// Neighbouring pixels are at an edge if the cosine between their normals is smaller.
const EDGE_COSINE: f32 = 0.8;
/// Neighbouring pixels are also at an edge if one is farther than the other by more than this factor.
const EDGE_DEPTH: f64 = 1.1;
/// A pose is judged only if at least these shares of the pixels are at an edge and see the mesh.
const LEAST_EDGES: f64 = 0.01;
const LEAST_SEEN: f64 = 0.3;
/// The least correlation of the photo's edges with the mesh's with which a pose fits, and the least ratio of it to that
/// with the stated pose. In six rooms of the sample the right pose has 0.38 to 0.51, and every other one at most 0.18.
const FITS_FROM: f64 = 0.25;
const BETTER_BY: f64 = 1.5;

/// A finding where a pose of another convention fits the photo, and clearly better than the stated one. `file` is that
/// of the cameras.
pub(super) fn other_convention(
    world: &World,
    photo: &Picture<LinearRgb>,
    stated: &Camera,
    others: impl Iterator<Item = (&'static str, Camera)>,
    file: &str,
) -> Option<Finding> {
    let edges = PhotoEdges::new(photo, &stated.intrinsics);
    let own = edges.fit(world, stated);
    let fits = others.filter_map(|(what, camera)| Some((edges.fit(world, &camera)?, what)));
    let (best, what) = fits.max_by(|(a, _), (b, _)| a.total_cmp(b))?;
    if best < FITS_FROM || own.is_some_and(|own| best < BETTER_BY * own) {
        return None;
    }
    let own = own.map_or("the camera sees too little of the mesh".to_owned(), |own| format!("by {own:.2}"));
    let message =
        format!("the photo's edges correlate with the mesh's by {best:.2} with {what}; with the stated pose {own}");
    let action =
        "used the poses as they are stated; if the pictures of the input view do not fit the photo, change them so";
    Some(Finding::new(Severity::Warning, "pose_convention", file, "", message, action))
}

/// The strength of a photo's edges, at a reduced size.
struct PhotoEdges {
    intrinsics: Intrinsics,
    strength: Picture<f64>,
}

impl PhotoEdges {
    fn new(photo: &Picture<LinearRgb>, k: &Intrinsics) -> Self {
        let step = k.width.div_ceil(MOST_COLUMNS) as usize;
        let (width, height) = (photo.width() / step, photo.height() / step);
        let scale = 1.0 / step as f64;
        let intrinsics = Intrinsics {
            width: width as u32,
            height: height as u32,
            fx: k.fx * scale,
            fy: k.fy * scale,
            cx: k.cx * scale,
            cy: k.cy * scale,
        };
        // The cube root, near the eye's lightness, so that edges in shadow count.
        let light = Picture::from_fn(width, height, |x, y| {
            let all = (0..step * step).map(|at| photo.get(x * step + at % step, y * step + at / step).luminance());
            libm::cbrt(all.sum::<f64>() * scale * scale)
        });
        let strength = Picture::from_fn(width, height, |x, y| {
            let at = |x: usize, y: usize| light.get(x.min(width - 1), y.min(height - 1));
            let [x0, y0] = [x, y].map(|v| v.saturating_sub(1));
            (at(x + 1, y) - at(x0, y)).abs() + (at(x, y + 1) - at(x, y0)).abs()
        });
        Self { intrinsics, strength }
    }

    /// The correlation, -1 to 1, of the strength of the photo's edges with the mesh's edges over all pixels. The few
    /// edges of a bare wall may lie on strong edges of the photo by chance; a correlation also counts the photo's edges
    /// that they do not explain. Absent if the camera sees too little of the mesh or too few of its edges, or the photo
    /// has no edges.
    fn fit(&self, world: &World, camera: &Camera) -> Option<f64> {
        let (width, height) = (self.strength.width(), self.strength.height());
        let small = Camera { intrinsics: self.intrinsics, ..*camera };
        let see = |at: usize| {
            let place = DVec2::new((at % width) as f64 + 0.5, (at / width) as f64 + 0.5);
            hit_through(world, &small, place).map(|hit| (hit.depth, hit.normal))
        };
        let seen: Vec<Option<(f64, Vec3)>> = (0..width * height).into_par_iter().map(see).collect();
        let is_edge = |a: &Option<(f64, Vec3)>, b: &Option<(f64, Vec3)>| match (a, b) {
            (Some((a, m)), Some((b, n))) => a.max(*b) > EDGE_DEPTH * a.min(*b) || m.dot(*n) < EDGE_COSINE,
            (None, None) => false,
            _ => true,
        };
        let (mut at_edges, mut edges, mut sum, mut squares) = (0.0, 0_usize, 0.0, 0.0);
        for (at, strength) in self.strength.pixels().iter().enumerate() {
            sum += strength;
            squares += strength * strength;
            let beside = |next: usize, exists: bool| exists && is_edge(&seen[at], &seen[next]);
            if beside(at + 1, at % width + 1 < width) || beside(at + width, at / width + 1 < height) {
                at_edges += strength;
                edges += 1;
            }
        }
        let share = |count: usize| count as f64 / seen.len() as f64;
        let mean = sum / seen.len() as f64;
        let variance = squares / seen.len() as f64 - mean * mean;
        let is_judged =
            share(edges) >= LEAST_EDGES && share(seen.iter().flatten().count()) >= LEAST_SEEN && variance > 0.0;
        // Pearson's coefficient where one variable is 0 or 1. The last pixel is at no edge, so the share is below 1.
        let odds = share(edges) / (1.0 - share(edges));
        is_judged.then(|| (at_edges / edges as f64 - mean) * (odds / variance).sqrt())
    }
}
