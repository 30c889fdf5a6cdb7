//! What an estimate of the input view shows of each part.

use std::collections::BTreeMap;

use glam::DVec3;
use mateval_procedural::fit::points::Point;
use mateval_procedural::noise::cell::cell;
use mateval_scene::PartSetId;

use super::part_frame::{Chart, PartFrame, Triangle};
use crate::error::BaselineError;
use crate::estimate::{Estimate, Values};
use crate::geometry::SceneGeometry;
use crate::part_triangles::PartTriangles;
use crate::seen::{SeenPixels, SeenPoint};

/// A pixel that shows a part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Column and row in the estimate.
    pub(super) pixel: [usize; 2],
    /// The side of the part's box that it shows.
    pub(super) chart: Chart,
    /// The place in world space.
    pub(super) position: DVec3,
    /// The estimate.
    pub(super) values: Values,
    /// The same as a point of the unfolded box.
    pub(super) point: Point,
}

/// A part as it lies in the room and as the estimate shows it.
pub(super) struct PartSamples {
    /// None for a part without an area, or of an instance without an atlas.
    pub(super) frame: Option<PartFrame>,
    /// In a random order, so that any first or every n-th of them are spread over the part.
    pub(super) samples: Vec<Sample>,
}

/// The least cosine between a surface's normal and the direction to the viewer: what is seen at a steeper angle is too
/// blurred to show a pattern.
const LEAST_COSINE: f64 = 0.05;

impl PartSamples {
    /// The parts of a set in its order.
    pub(super) fn of_parts(
        geometry: &SceneGeometry<'_>,
        set: Option<&PartSetId>,
        triangles: &PartTriangles<'_>,
        estimate: &Estimate,
        seen: &SeenPixels,
    ) -> Result<Vec<Self>, BaselineError> {
        let picture = geometry.part_picture(set)?;
        let viewer = geometry.view.camera.position();
        let origin = middle(geometry);
        let frames = corners_of_parts(geometry, triangles);
        let frames = frames.iter().map(|corners| PartFrame::new(corners, viewer, origin));
        let mut parts: Vec<Self> = frames.map(|frame| Self { frame, samples: Vec::new() }).collect();
        let place_of: BTreeMap<u16, usize> =
            triangles.parts.iter().enumerate().map(|(at, part)| (part.index.0.get(), at)).collect();
        for point in seen.points(geometry) {
            let (x, y) = seen.view_pixel(point.pixel.0, point.pixel.1);
            let Some(part) = place_of.get(&picture.get(x, y)).map(|at| &mut parts[*at]) else { continue };
            let Some(frame) = part.frame else { continue };
            let values = estimate.at(point.pixel.0, point.pixel.1);
            part.samples.extend(sample(&frame, seen, viewer, &point, values));
        }
        for part in &mut parts {
            let random = |sample: &Sample| cell(sample.pixel[0] as f64 + 0.5, sample.pixel[1] as f64 + 0.5);
            part.samples.sort_by(|a, b| random(a).total_cmp(&random(b)).then(a.pixel.cmp(&b.pixel)));
        }
        Ok(parts)
    }

    /// The side that most samples show, and those samples.
    pub(super) fn of_main_chart(&self) -> Option<(Chart, Vec<Sample>)> {
        let mut counts: BTreeMap<Chart, usize> = BTreeMap::new();
        self.samples.iter().for_each(|sample| *counts.entry(sample.chart).or_default() += 1);
        let most = counts.values().copied().max()?;
        let chart = counts.into_iter().find(|(_, count)| *count == most)?.0;
        Some((chart, self.samples.iter().filter(|sample| sample.chart == chart).copied().collect()))
    }
}

/// None for what is seen at too steep an angle.
fn sample(frame: &PartFrame, seen: &SeenPixels, viewer: DVec3, point: &SeenPoint, values: Values) -> Option<Sample> {
    let to_viewer = viewer - point.place;
    let cosine = (to_viewer.normalize_or_zero().dot(point.normal)).abs();
    if cosine < LEAST_COSINE {
        return None;
    }
    let chart = frame.chart(point.normal);
    let [u, v] = frame.place(chart, point.place);
    // The root of the pixel's area on the surface.
    let footprint = to_viewer.length() / seen.camera.intrinsics.fx / cosine.sqrt();
    let albedo = [values[0], values[1], values[2]].map(f64::from);
    let pixel = [point.pixel.0, point.pixel.1];
    let position = point.place;
    Some(Sample { pixel, chart, position, values, point: Point { u, v, footprint, albedo, weight: 1.0 } })
}

/// The middle of the box around all instances.
fn middle(geometry: &SceneGeometry<'_>) -> DVec3 {
    let corners = geometry.world.scene().surfaces.iter().flat_map(|surface| &surface.mesh.positions);
    let (least, most) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(least, most), corner| {
        (least.min(corner.as_dvec3()), most.max(corner.as_dvec3()))
    });
    if least.is_finite() && most.is_finite() { 0.5 * (least + most) } else { DVec3::ZERO }
}

/// The triangles of each part; none for parts of instances without an atlas.
fn corners_of_parts(geometry: &SceneGeometry<'_>, triangles: &PartTriangles<'_>) -> Vec<Vec<Triangle>> {
    let mut all = vec![Vec::new(); triangles.parts.len()];
    let with_atlas = geometry.scene.instances.iter().enumerate().filter(|(_, instance)| instance.atlas.is_some());
    for (instance, _) in with_atlas {
        let mesh = geometry.mesh(instance);
        for (triangle, part) in triangles.of(instance).iter().enumerate() {
            if let Some(part) = *part {
                all[part].push(mesh.corners(triangle).map(|corner| corner.as_dvec3()));
            }
        }
    }
    all
}
