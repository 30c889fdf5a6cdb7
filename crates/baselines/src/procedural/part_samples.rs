//! What an estimate of the input view shows of each part.

use std::collections::BTreeMap;

use glam::DVec3;
use mateval_dataset::{Camera, PartSetId};
use mateval_procedural::fit::Point;
use mateval_procedural::noise::cell;
use mateval_procedural::unfolding::{Chart, PartFrame, Triangle};

use crate::error::BaselineError;
use crate::estimate::{Estimate, Values};
use crate::geometry::{PartTriangles, SceneGeometry, SeenPixels, SeenPoint};

/// A pixel that shows a part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Column and row in the estimate.
    pub(super) pixel: [usize; 2],
    /// The side of the part's box that it shows.
    pub(super) chart: Chart,
    /// The place in world space.
    pub(super) position: DVec3,
    pub(super) values: Values,
    /// The same as a point of the unfolded box.
    pub(super) point: Point,
}

/// A part as it lies in the room and as the estimate shows it.
pub(super) struct PartSamples {
    /// None for a part without an area, or of an instance without an atlas.
    pub(super) frame: Option<PartFrame>,
    /// The estimate at every pixel that shows the part.
    pub(super) shown: Vec<Values>,
    /// The pixels that show a pattern, in a random order, so that any first or every n-th of them are spread over the
    /// part.
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
        let (viewer, origin) = (geometry.view.camera.position(), middle(geometry));
        let corners = corners_of_parts(geometry, triangles);
        let frames = corners.iter().map(|corners| PartFrame::new(corners, viewer, origin));
        let mut parts: Vec<Self> = frames.map(|frame| Self { frame, shown: Vec::new(), samples: Vec::new() }).collect();
        let place_of = triangles.place_of_index();
        for point in seen.points(geometry) {
            let (x, y) = seen.view_pixel(point.pixel.0, point.pixel.1);
            let Some(&at) = place_of.get(&picture.get(x, y)) else { continue };
            // The view's pixel may show another instance than that of an estimate with more pixels.
            if triangles.owners[at] != Some(point.instance) {
                continue;
            }
            let part = &mut parts[at];
            let Some(frame) = part.frame else { continue };
            let values = estimate.at(point.pixel.0, point.pixel.1);
            part.shown.push(values);
            part.samples.extend(sample(&frame, &seen.camera, &point, values));
        }
        for part in &mut parts {
            let random = |sample: &Sample| cell(sample.pixel[0] as f64 + 0.5, sample.pixel[1] as f64 + 0.5);
            part.samples.sort_by(|a, b| random(a).total_cmp(&random(b)).then(a.pixel.cmp(&b.pixel)));
        }
        Ok(parts)
    }

    /// Where the samples lie on the unfolded box, `[u, v, footprint]` in metres.
    pub(super) fn places(&self) -> Vec<[f64; 3]> {
        self.samples.iter().map(|Sample { point, .. }| [point.u, point.v, point.footprint]).collect()
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
fn sample(frame: &PartFrame, camera: &Camera, point: &SeenPoint, values: Values) -> Option<Sample> {
    let footprint = footprint(camera, point.place, point.normal)?;
    let chart = frame.chart(point.normal);
    let [u, v] = frame.place(chart, point.place);
    let albedo = [values[0], values[1], values[2]].map(f64::from);
    let pixel = [point.pixel.0, point.pixel.1];
    Some(Sample { pixel, chart, position: point.place, values, point: Point { u, v, footprint, albedo, weight: 1.0 } })
}

/// The root of the area that a pixel covers of a surface, in metres; absent if it is seen at too steep an angle.
fn footprint(camera: &Camera, place: DVec3, normal: DVec3) -> Option<f64> {
    let to_viewer = camera.position() - place;
    let (_, depth) = camera.projection().project(place)?;
    let distance = to_viewer.length();
    let cosine = to_viewer.normalize_or_zero().dot(normal).abs();
    // A pixel has the solid angle (depth / distance)^3 / (fx fy).
    let solid_angle = (depth / distance).powi(3) / (camera.intrinsics.fx * camera.intrinsics.fy);
    (cosine >= LEAST_COSINE).then(|| distance * (solid_angle / cosine).sqrt())
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

#[cfg(test)]
mod tests {
    use mateval_dataset::Intrinsics;

    use super::*;

    /// The pixels of a picture cover a wall behind it without gaps: at any place of it their area is the square of the
    /// depth over both focal lengths. The twin is the same pixel on a floor.
    #[test]
    fn footprints_are_roots_of_areas() {
        let intrinsics = Intrinsics { fx: 100.0, fy: 160.0, ..Intrinsics::from_fov_x(64, 48, 1.0) };
        let camera = Camera::look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y, intrinsics).unwrap();
        for place in [DVec3::new(0.0, 0.0, -2.0), DVec3::new(0.5, -0.2, -2.0)] {
            let found = footprint(&camera, place, DVec3::Z).unwrap();
            assert!((found / (4.0_f64 / 16_000.0).sqrt() - 1.0).abs() < 1e-9, "{place}: {found}");
        }
        let floor = footprint(&camera, DVec3::new(0.5, -0.2, -2.0), DVec3::Y).unwrap();
        // Area times cosine is the same: 0.2 m below the eye, 2 m away.
        assert!((floor / (4.0_f64 / 16_000.0 * 10.0).sqrt() - 1.0).abs() < 1e-9, "{floor}");
        assert_eq!(footprint(&camera, DVec3::new(0.0, -0.01, -2.0), DVec3::Y), None);
    }
}
