//! `baseline encoding`: compares a method's stored numbers with the truth of the input views, map by map, and reports
//! which encoding they fit.

use std::collections::BTreeSet;
use std::path::Path;

use glam::DVec2;
use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::submission::Map;
use mateval_dataset::submission::StoredEncoding;
use mateval_dataset::{Progress, Report};
use mateval_image::exr_io::{read_linear, read_scalar};
use mateval_image::{LinearRgb, Mask, Picture, png_io};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::adapter::{AdaptedFile, Adapter, Channel, no_estimate};
use crate::encoding_fit::{Candidate, EncodingFit, FittedEncoding, Sample, Verdict, fit};
use crate::error::BaselineError;
use crate::estimate::{Placement, other_proportions};
use crate::geometry::input_view;

/// The value of `format` for this version of the report.
pub const ENCODING_FORMAT: &str = "mateval-encoding/1";

/// Pixels whose truth is darker are not compared: bytes resolve it too coarsely.
const LEAST_TRUTH: f32 = 0.02;
/// Stored numbers nearer to 1 than this may be clipped, and are not compared.
const CLIPPED: f32 = 1.0 / 300.0;
/// The most pixels of a scene that are compared.
const MOST_PIXELS: usize = 1 << 14;
/// The most pixels of all scenes together, except that every scene has at least [`FEWEST_PIXELS`].
const MOST_PIXELS_TOGETHER: usize = 1 << 20;
/// The pixels that every scene may have, whatever the number of scenes.
const FEWEST_PIXELS: usize = 1 << 8;

/// The most paths that an error names.
const MOST_NAMED_PATHS: usize = 4;

/// Which encodings a method's numbers fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EncodingReport {
    /// Always `mateval-encoding/1`.
    pub format: String,
    /// The adapter's name.
    pub adapter: String,
    /// Whether no map contradicts the adapter.
    pub agrees: bool,
    /// The maps that the adapter describes and that have a file in a scene whose source states them.
    pub maps: Vec<MapEncoding>,
}

/// One map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MapEncoding {
    /// The map.
    pub map: Map,
    /// The adapter's encoding.
    pub adapter_encoding: StoredEncoding,
    /// Whether the method's authors state it, according to the adapter.
    pub encoding_stated: bool,
    /// Number of scenes that have a file and whose source states the map.
    pub scenes: usize,
    /// Number of instances that are compared.
    pub instances: usize,
    /// Number of pixels that are compared; those of base_color count for each channel.
    pub samples: usize,
    /// How the files must be read for the numbers to fit best; `as_stated` unless another reading is clearly better.
    pub reading: Reading,
    /// What the numbers show, read in this way.
    pub verdict: Verdict,
    /// The encodings that the numbers fit, the best first.
    pub fits: Vec<FittedEncoding>,
    /// Whether no other reading is better, and the adapter's encoding is one of `fits` or the verdict is `too_little`.
    pub agrees: bool,
    /// All encodings that were compared.
    pub candidates: Vec<Candidate>,
}

/// A way in which files are often written other than the adapter states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reading {
    /// As the adapter states.
    AsStated,
    /// The numbers -1 and 1 stand for 0 and 1, as diffusion networks put them out.
    MinusOneToOne,
    /// The numbers 0 and 255 stand for 0 and 1.
    To255,
    /// Red and blue are swapped, as OpenCV has them.
    Bgr,
    /// The last row is stored first.
    FlippedRows,
    /// The last column is stored first.
    FlippedColumns,
    /// The picture is turned by 180 degrees.
    Turned,
    /// The number is 1 minus the value, such as a glossiness.
    Inverted,
    /// The number is the square of the value, such as the alpha of a microfacet model in place of the roughness.
    Squared,
    /// The file's other channels: green in place of the stated one.
    Green,
    /// The file's other channels: blue in place of the stated one.
    Blue,
    /// The picture shows the middle of the view, in proportions of its own.
    CentreCrop,
}

impl Reading {
    /// All readings but the stated one.
    const OTHERS: [Self; 11] = [
        Self::MinusOneToOne,
        Self::To255,
        Self::Bgr,
        Self::FlippedRows,
        Self::FlippedColumns,
        Self::Turned,
        Self::Inverted,
        Self::Squared,
        Self::Green,
        Self::Blue,
        Self::CentreCrop,
    ];

    /// Whether the reading can apply to the map.
    fn applies(self, map: Map) -> bool {
        match self {
            Self::Bgr => map == Map::BaseColor,
            Self::Inverted | Self::Squared | Self::Green | Self::Blue => map != Map::BaseColor,
            _ => true,
        }
    }

    /// The place of the pixel that belongs at `(x, y)` of a picture of this size.
    fn pixel(self, (width, height): (usize, usize), (x, y): (usize, usize)) -> (usize, usize) {
        match self {
            Self::FlippedRows => (x, height - 1 - y),
            Self::FlippedColumns => (width - 1 - x, y),
            Self::Turned => (width - 1 - x, height - 1 - y),
            _ => (x, y),
        }
    }

    /// The number after this reading of a channel of three.
    fn number(self, stored: [f32; 3], channel: usize) -> f32 {
        match self {
            Self::MinusOneToOne => (stored[channel] + 1.0) / 2.0,
            Self::To255 => stored[channel] / 255.0,
            Self::Bgr => stored[2 - channel],
            Self::Inverted => 1.0 - stored[channel],
            Self::Squared => stored[channel].max(0.0).sqrt(),
            Self::Green => stored[1],
            Self::Blue => stored[2],
            _ => stored[channel],
        }
    }
}

/// Another reading is reported if it leaves at most this share of the error of the stated one.
const CLEARLY_BETTER: f64 = 0.5;

/// Compares the files below `folder` with the truth. Fails where nothing can be compared: no scene has a file, or none
/// of the scenes that have one states the map.
pub fn report(
    dataset: &Dataset,
    folder: &Path,
    adapter: &Adapter,
    progress: Progress<'_>,
) -> Result<EncodingReport, BaselineError> {
    let mut maps = Vec::new();
    let (mut searched, mut unstated) = (Vec::new(), BTreeSet::new());
    for (map, file, channel) in adapter.maps() {
        let others = Reading::OTHERS.into_iter().filter(|reading| reading.applies(map));
        let readings: Vec<Reading> = std::iter::once(Reading::AsStated).chain(others).collect();
        let mut samples: Vec<Samples> = readings.iter().map(|_| Samples::default()).collect();
        for (done, scene) in dataset.scenes.iter().enumerate() {
            progress(Report::step(&format!("{} encoding", map.stem()), done, dataset.scenes.len()));
            match file.path(folder, scene.id.as_str()) {
                Err(paths) => searched.extend(paths),
                Ok(_) if !is_stated(scene, map) => {
                    unstated.insert(map.stem());
                }
                Ok(_) => {
                    let Some(stored) = file.stored(folder, scene.id.as_str(), map, None)? else { continue };
                    let view = InputView::read(dataset, scene, map)?;
                    let most = (MOST_PIXELS_TOGETHER / dataset.scenes.len().max(1)).clamp(FEWEST_PIXELS, MOST_PIXELS);
                    let picture = ScenePicture { map, channel, stored: stored.numbers, view, most };
                    for (samples, reading) in samples.iter_mut().zip(&readings) {
                        samples.add(scene, &picture, adapter.placement, *reading)?;
                    }
                }
            }
        }
        progress(Report::step(&format!("{} encoding", map.stem()), dataset.scenes.len(), dataset.scenes.len()));
        if samples[0].scenes > 0 {
            maps.push(map_encoding(map, file, &readings, &samples));
        }
    }
    if maps.is_empty() && !unstated.is_empty() {
        let maps: Vec<&str> = unstated.into_iter().collect();
        return Err(BaselineError::Unusable(format!(
            "cannot compare {}: no scene that has such a picture has a source that states it; expected source.states_{} = \
             true in the dataset; use another dataset, or compare base_color",
            maps.join(" and "),
            maps.join(" or source.states_")
        )));
    }
    if maps.is_empty() {
        searched.truncate(MOST_NAMED_PATHS);
        return Err(no_estimate(&searched));
    }
    let agrees = maps.iter().all(|map| map.agrees);
    Ok(EncodingReport { format: ENCODING_FORMAT.to_owned(), adapter: adapter.name.clone(), agrees, maps })
}

/// Whether the scene's source states the map, so that its truth is more than a default.
fn is_stated(scene: &SceneFile, map: Map) -> bool {
    match map {
        Map::BaseColor => true,
        Map::Roughness => scene.source.states_roughness,
        Map::Metallic => scene.source.states_metallic,
    }
}

/// The result of the best reading: the stated one, unless another is clearly better.
fn map_encoding(map: Map, file: &AdaptedFile, readings: &[Reading], samples: &[Samples]) -> MapEncoding {
    // The error of a reading by its best encoding; infinite where the numbers do not follow the truth. The line of a
    // logarithm has a free slope, so its error counts only where nothing else fits.
    let error = |found: &EncodingFit| {
        let best = |error: f64, candidate: &Candidate| {
            if candidate.correlation > 0.5 { error.min(candidate.error) } else { error }
        };
        let is_log = found.fits == [FittedEncoding::Log];
        found.candidates.iter().filter(|c| is_log || c.encoding.stored().is_some()).fold(f64::INFINITY, best)
    };
    let fitted: Vec<EncodingFit> = samples.iter().map(|samples| fit(&samples.all)).collect();
    let is_comparable = |at: &usize| 2 * samples[*at].all.len() >= samples[0].all.len() && samples[*at].scenes > 0;
    let compared = (1..fitted.len()).filter(is_comparable).filter(|at| fitted[*at].verdict != Verdict::TooLittle);
    let best = compared.min_by(|a, b| error(&fitted[*a]).total_cmp(&error(&fitted[*b])));
    let is_better = |at: &usize| error(&fitted[*at]) < CLEARLY_BETTER * error(&fitted[0]);
    let at = best.filter(|_| fitted[0].verdict != Verdict::TooLittle).filter(is_better).unwrap_or(0);
    let found = fitted[at].clone();
    let is_named = found.fits.iter().any(|fitted| fitted.stored() == Some(file.encoding));
    MapEncoding {
        map,
        adapter_encoding: file.encoding,
        encoding_stated: file.encoding_stated,
        scenes: samples[at].scenes,
        instances: found.instances,
        samples: samples[at].all.len(),
        reading: readings[at],
        verdict: found.verdict,
        agrees: at == 0 && (is_named || found.verdict == Verdict::TooLittle),
        fits: found.fits,
        candidates: found.candidates,
    }
}

/// A method's picture of a scene and the truth.
struct ScenePicture {
    map: Map,
    channel: Option<Channel>,
    /// All channels of the file, in the adapter's range.
    stored: Picture<[f32; 3]>,
    view: InputView,
    most: usize,
}

/// The samples of one map in one reading.
#[derive(Default)]
struct Samples {
    all: Vec<Sample>,
    scenes: usize,
    groups: usize,
    instances: usize,
}

impl Samples {
    /// Adds those of a scene. Fails where the stated placement does not allow the picture's proportions.
    fn add(
        &mut self,
        scene: &SceneFile,
        picture: &ScenePicture,
        placement: Placement,
        reading: Reading,
    ) -> Result<(), BaselineError> {
        let ScenePicture { map, channel, stored, view, most } = picture;
        let (size, view_size) = ((stored.width(), stored.height()), (view.valid.width(), view.valid.height()));
        let placement = if reading == Reading::CentreCrop { Placement::CentreCrop } else { placement };
        let region = placement.region(size, view_size);
        let region = region.ok_or_else(|| other_proportions(scene.id.as_str(), size, view_size, true))?;
        let scalar = [channel.unwrap_or(Channel::R) as usize];
        let channels = if *map == Map::BaseColor { &[0, 1, 2][..] } else { &scalar };
        for (x, y) in view.pixels(*most) {
            let Some(at) = region.pixel(size, DVec2::new(x as f64, y as f64) + 0.5) else { continue };
            let (sx, sy) = reading.pixel(size, at);
            let (truth, stored) = (view.truth.get(x, y).0, stored.get(sx, sy));
            let instance = self.instances + usize::from(view.instances.get(x, y));
            for (number, channel) in channels.iter().enumerate() {
                let (truth, stored) = (truth[*channel], reading.number(stored, *channel));
                if truth >= LEAST_TRUTH && stored.is_finite() && (stored - 1.0).abs() > CLIPPED {
                    let ln_truth = libm::log(f64::from(truth));
                    let group = self.groups + number;
                    self.all.push(Sample { ln_truth, stored: f64::from(stored), group, instance });
                }
            }
        }
        self.scenes += 1;
        self.groups += channels.len();
        // Ids begin at 1.
        self.instances += scene.instances.len() + 1;
        Ok(())
    }
}

/// The truth of one map in the input view of a scene.
struct InputView {
    truth: Picture<LinearRgb>,
    valid: Mask,
    instances: Picture<u16>,
}

impl InputView {
    fn read(dataset: &Dataset, scene: &SceneFile, map: Map) -> Result<Self, BaselineError> {
        scene.check_materials_known()?;
        let folder = dataset.folder(&scene.id);
        let view = input_view(&folder, scene)?;
        let (shown, known) = (folder.view(&view.id), folder.truth_view(&view.id));
        let scalar = |name: &str| Ok::<_, BaselineError>(read_scalar(&known.join(name))?.map(|v| LinearRgb([v; 3])));
        let truth = match map {
            Map::BaseColor => read_linear(&known.join("albedo.exr"))?,
            Map::Roughness => scalar("roughness.exr")?,
            Map::Metallic => scalar("metallic.exr")?,
        };
        let (valid, instances) =
            (png_io::read_mask(&shown.join("valid.png"))?, png_io::read_ids(&shown.join("instance.png"))?);
        if truth.same_size(&valid) && instances.same_size(&valid) {
            return Ok(Self { truth, valid, instances });
        }
        let what = "its pictures differ in size; run `mateval prep verify`".to_owned();
        Err(mateval_dataset::DatasetError::Unsupported { path: shown, what }.into())
    }

    /// Valid pixels whose eight neighbours are valid and show the same instance: at most `most`, evenly spaced in
    /// reading order.
    fn pixels(&self, most: usize) -> Vec<(usize, usize)> {
        let (width, height) = (self.valid.width(), self.valid.height());
        let is_inside = |&(x, y): &(usize, usize)| {
            let id = self.instances.get(x, y);
            let around = (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| (x, y)));
            id > 0 && { around }.all(|(x, y)| self.valid.get(x, y) && self.instances.get(x, y) == id)
        };
        let inner = (1..height.saturating_sub(1)).flat_map(|y| (1..width.saturating_sub(1)).map(move |x| (x, y)));
        let all: Vec<(usize, usize)> = inner.filter(is_inside).collect();
        let step = all.len().div_ceil(most).max(1);
        all.into_iter().step_by(step).collect()
    }
}
