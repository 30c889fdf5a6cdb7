//! Predictions compared with measured colours: the mean of the predicted base colour over each measured region of a
//! view.

use std::collections::BTreeMap;

use mateval_dataset::dataset::View;
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::measured::{MeasuredFile, MeasuredRegion, color_fault};
use mateval_dataset::{SceneId, ViewId, json};
use mateval_image::transfer::linear_from_srgb_byte;
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_metrics::measured::{RegionColors, maw_mask, maw_picture, measured_difference, measurement_delta_e};
use mateval_submission::prediction::PredictedScene;

use crate::error::EvalError;
use crate::materials::pictures::{Places, material_pictures};
use crate::metric::{Measure, Metric, PictureKind};
use crate::result::key::{PictureName, Region};
use crate::result::{MeasuredValues, PictureValues};
use crate::scene::{SceneTask, ScoreSheet};
use crate::truth::sized;

/// The measured regions of a scene, with the pictures that show them.
pub(crate) struct Measured {
    regions: Vec<MeasuredRegion>,
    pictures: BTreeMap<ViewId, Picture<u16>>,
}

impl Measured {
    /// Reads the measured regions of the scene's views. Fails where a file is missing or unsound.
    fn read(folder: &SceneFolder, views: &[&View]) -> Result<Self, EvalError> {
        let MeasuredFile { format: _, regions } =
            json::read_format(&folder.measured(), mateval_dataset::dataset::FORMAT)?;
        for (at, region) in regions.iter().enumerate() {
            if let Some(found) = color_fault(&region.color, region.standard_error.as_ref()) {
                let place = format!("'{}': /regions/{at}", folder.measured().display());
                return Err(EvalError::unsound(place, "a measured colour", found));
            }
        }
        let mut pictures = BTreeMap::new();
        for view in views.iter().filter(|view| regions.iter().any(|region| region.view == view.id)) {
            let picture = sized(view, png_io::read_ids(&folder.measured_regions(&view.id))?)?;
            pictures.insert(view.id.clone(), picture);
        }
        Ok(Self { regions, pictures })
    }
}

/// Number and sum of the pixels of each value of a picture of regions.
fn sums<T: Copy>(
    regions: &Picture<u16>,
    picture: &Picture<T>,
    linear: impl Fn(T) -> [f64; 3],
) -> BTreeMap<u16, (usize, [f64; 3])> {
    let mut sums: BTreeMap<u16, (usize, [f64; 3])> = BTreeMap::new();
    for (region, pixel) in regions.pixels().iter().zip(picture.pixels()).filter(|(region, _)| **region > 0) {
        let (count, sum) = sums.entry(*region).or_default();
        *count += 1;
        sum.iter_mut().zip(linear(*pixel)).for_each(|(sum, value)| *sum += value);
    }
    sums
}

/// The colours of the regions that a view's picture shows, with their places in `regions`.
fn colors<'a>(
    regions: impl Iterator<Item = &'a MeasuredRegion>,
    sums: &BTreeMap<u16, (usize, [f64; 3])>,
) -> Vec<(&'a MeasuredRegion, RegionColors)> {
    let of = |region: &'a MeasuredRegion| {
        let (pixels, sum) = *sums.get(&region.index)?;
        let predicted = sum.map(|sum| sum / pixels as f64);
        Some((region, RegionColors { pixels, predicted, measured: region.color }))
    };
    regions.filter_map(of).collect()
}

impl SceneTask<'_> {
    /// Compares every submission with the measured colours, if the scene has any, under the `protocols` of these
    /// numbers.
    pub(crate) fn score_measured(&self, protocols: &[usize], sheets: &mut [Vec<ScoreSheet>]) -> Result<(), EvalError> {
        // A file that the manifest lists exists, since opening the scene checked it.
        if !self.open.folder.has_measured() {
            return Ok(());
        }
        let measured = Measured::read(&self.open.folder, &self.views)?;
        let predictions: Vec<&PredictedScene> = self.predictions.iter().collect();
        for view in &self.views {
            let Some(regions) = measured.pictures.get(&view.id) else { continue };
            let small = maw_mask(regions);
            let pictures = material_pictures(self.open, &view.camera, &predictions, Places::All);
            for (sheets, pictures) in sheets.iter_mut().zip(pictures) {
                let of_view = || measured.regions.iter().filter(|region| region.view == view.id);
                let whole = sums(regions, &pictures.base_color, |LinearRgb(rgb)| rgb.map(f64::from));
                let whole = colors(of_view(), &whole);
                let maw = maw_picture(&pictures.base_color);
                let maw = sums(&small, &maw, |rgb: [u8; 3]| rgb.map(|byte| f64::from(linear_from_srgb_byte(byte))));
                let maw: Vec<RegionColors> = colors(of_view(), &maw).into_iter().map(|(_, colors)| colors).collect();
                let (values, listed) = values(&self.scene.id, view, &whole, &maw);
                for &at in protocols {
                    sheets[at].score.pictures.push(values.clone());
                    sheets[at].score.measured.extend(listed.clone());
                }
            }
        }
        Ok(())
    }
}

/// The scores of a view, and the values of its regions.
fn values(
    scene: &SceneId,
    view: &View,
    whole: &[(&MeasuredRegion, RegionColors)],
    maw: &[RegionColors],
) -> (PictureValues, Vec<MeasuredValues>) {
    let colors: Vec<RegionColors> = whole.iter().map(|(_, colors)| *colors).collect();
    let pixels = colors.iter().map(|region| region.pixels).sum();
    let name = PictureName::whole(PictureKind::Measured);
    let mut values = PictureValues::new(scene.clone(), view.id.clone(), name, Region::Valid, pixels);
    for metric in Metric::of(PictureKind::Measured) {
        let value = match metric.row().measure {
            Measure::Regions(measure) => measure(&colors),
            Measure::MawRegions(measure) => measure(maw),
            _ => None,
        };
        values.values.extend(value.map(|value| (metric, value)));
    }
    let listed = whole.iter().map(|(region, colors)| MeasuredValues {
        scene: scene.clone(),
        view: view.id.clone(),
        region: region.name.clone(),
        pixels: colors.pixels,
        predicted: colors.predicted,
        measured: colors.measured,
        delta_e: measured_difference(colors.predicted, colors.measured),
        measurement_delta_e: region.standard_error.map(|error| measurement_delta_e(region.color, error)),
    });
    (values, listed.collect())
}

#[cfg(test)]
mod tests {
    use mateval_dataset::Camera;
    use mateval_dataset::camera::Intrinsics;

    use super::*;

    fn region(name: &str, index: u16, color: [f64; 3]) -> MeasuredRegion {
        let view = ViewId::new("input").unwrap();
        MeasuredRegion { name: name.to_owned(), view, index, color, standard_error: None }
    }

    fn view() -> View {
        let camera =
            Camera::look_at(glam::DVec3::ZERO, -glam::DVec3::Z, glam::DVec3::Y, Intrinsics::from_fov_x(4, 2, 1.0));
        View { id: ViewId::new("input").unwrap(), x_deg: 0.0, y_deg: 0.0, camera: camera.unwrap(), wide: None }
    }

    /// A left half of 0.25 and a right half of 0.75, by hand.
    #[test]
    fn a_region_is_the_mean_of_its_pixels() {
        let regions = Picture::from_fn(4, 2, |x, y| if y == 0 { 1 + x as u16 / 2 } else { 0 });
        let picture = Picture::from_fn(4, 2, |x, _| LinearRgb([0.25, 0.5, x as f32 / 4.0]));
        let sums = sums(&regions, &picture, |LinearRgb(rgb)| rgb.map(f64::from));
        let listed = [region("a", 1, [0.25, 0.5, 0.125]), region("b", 2, [0.25, 0.5, 0.5]), region("c", 3, [0.0; 3])];
        let found = colors(listed.iter(), &sums);
        let means: Vec<[f64; 3]> = found.iter().map(|(_, colors)| colors.predicted).collect();
        assert_eq!(means, [[0.25, 0.5, 0.125], [0.25, 0.5, 0.625]]);
        let scene = SceneId::new("s").unwrap();
        let (values, listed) = values(&scene, &view(), &found, &[]);
        assert_eq!((listed[0].delta_e, values.pixels), (0.0, 4));
        assert!(listed[1].delta_e > 1.0);
        let mean = values.values[&Metric::RegionDeltaE];
        assert!((mean - listed[1].delta_e / 2.0).abs() < 1e-12);
        assert!(!values.values.contains_key(&Metric::MawIntensity));
    }
}
