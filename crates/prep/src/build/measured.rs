//! The measured colours of a captured room: `ground_truth/measured.json` and the picture of their regions.
//!
//! Regions are marked in the photo. A pixel of the camera's picture belongs to the region that the photo shows at the
//! pixel's centre, through the lens, and only if it is valid.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::DVec2;
use mateval_dataset::dataset::{FORMAT, View};
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::lens::Lens;
use mateval_dataset::measured::{MeasuredFile, MeasuredRegion};
use mateval_dataset::{Finding, SceneId, Severity, json};
use mateval_files::FileError;
use mateval_files::source_folder::SourceFolder;
use mateval_files::untrusted::quoted;
use mateval_image::{Picture, png_io};
use mateval_sources::capture::measured::{self, MaskValue, Measurement};
use mateval_sources::source_scene::SourceScene;

use super::fault::{BuildFault, RegionFault};
use crate::error::PrepError;
use crate::recipe::RecipeScene;

/// The largest file of measurements and the largest mask, in bytes.
const FILE_BYTES: u64 = 1 << 28;
/// The most names of photos in a message.
const MOST_NAMES: usize = 5;

/// The measured regions of the input view.
pub(super) struct SceneRegions {
    /// Their file, which findings refer to.
    file: String,
    measurements: Vec<Measurement>,
    /// In each pixel the place of its region in `measurements`, from 1.
    picture: Picture<u16>,
}

/// Reads the measured colours of the input photo, if the scene is captured and has any, and lists their files among the
/// source's. `root` is the folder of the recipe's paths.
pub(super) fn read_regions(
    entry: &RecipeScene,
    root: &Path,
    scene: &mut SourceScene,
    input: &View,
) -> Result<Option<SceneRegions>, PrepError> {
    let measured = entry.capture.as_ref().and_then(|room| room.measured.as_ref());
    let (Some(measured), Some(captured)) = (measured, &scene.captured) else { return Ok(None) };
    let mut folder = SourceFolder::new(root, FILE_BYTES).map_err(FileError::io("open", root))?;
    let file = measured.to_string_lossy().into_owned();
    let measurements = measured::read(&mut folder, &file)?;
    let of_photo = regions_of(measurements, &captured.file);
    let picture = of_photo.and_then(|own| Ok((regions_picture(&mut folder, &own, &captured.lens, input)?, own)));
    let (picture, measurements) = picture.map_err(|fault| PrepError::scene(&entry.id)(BuildFault::Measured(fault)))?;
    scene.read.files.extend(folder.into_files());
    scene.read.files.hashes.dedup();
    Ok(Some(SceneRegions { file, measurements, picture }))
}

/// Those of the measurements that are of the photo in `file`.
fn regions_of(all: Vec<Measurement>, file: &str) -> Result<Vec<Measurement>, RegionFault> {
    let name = file.rsplit('/').next().unwrap_or(file).to_owned();
    let stem = |name: &str| name.rsplit_once('.').map_or(name.to_owned(), |(stem, _)| stem.to_owned());
    let is_own = |photo: &str| {
        let photo = photo.rsplit('/').next().unwrap_or(photo);
        photo == name || photo == stem(&name)
    };
    let (own, others): (Vec<Measurement>, Vec<Measurement>) = all.into_iter().partition(|region| is_own(&region.photo));
    if own.is_empty() {
        let known: BTreeSet<String> = others.iter().map(|region| quoted(&region.photo)).collect();
        let more = if known.len() > MOST_NAMES { " and others" } else { "" };
        let known = known.into_iter().take(MOST_NAMES).collect::<Vec<_>>().join(", ") + more;
        return Err(RegionFault::OtherPhotos { photo: name, known });
    }
    match own.len() <= usize::from(u16::MAX) {
        true => Ok(own),
        false => Err(RegionFault::TooMany { count: own.len() }),
    }
}

/// The picture of the regions as the input camera shows them. Where regions of several masks overlap, the first counts.
fn regions_picture(
    folder: &mut SourceFolder,
    regions: &[Measurement],
    lens: &Lens,
    input: &View,
) -> Result<Picture<u16>, RegionFault> {
    let mut masks: BTreeMap<&str, Picture<u16>> = BTreeMap::new();
    for region in regions {
        if !masks.contains_key(region.mask.as_str()) {
            let mask = png_io::numbers_of_bytes(Path::new(&region.mask), folder.read(&region.mask)?)?;
            let (found, expected) = ([mask.width() as u32, mask.height() as u32], [lens.width, lens.height]);
            if found != expected {
                return Err(RegionFault::Size { mask: region.mask.clone(), found, expected });
            }
            masks.insert(&region.mask, mask);
        }
    }
    let numbers: BTreeMap<&str, BTreeSet<u16>> =
        masks.iter().map(|(file, mask)| (*file, mask.pixels().iter().copied().collect())).collect();
    // For each mask, the region of each of its numbers.
    let mut region_of: BTreeMap<&str, BTreeMap<u16, u16>> = BTreeMap::new();
    for (region, place) in regions.iter().zip(1_u16..) {
        let numbers = &numbers[region.mask.as_str()];
        let found = match region.value {
            MaskValue::Exactly(value) => numbers.get(&value),
            MaskValue::Place(place) => numbers.iter().nth(place),
        };
        let absent = || RegionFault::Absent {
            mask: region.mask.clone(),
            name: region.name.clone(),
            value: match region.value {
                MaskValue::Exactly(value) => value.to_string(),
                MaskValue::Place(place) => format!("number {place} of those that it holds, from 0"),
            },
        };
        let value = found.ok_or_else(absent)?;
        region_of.entry(&region.mask).or_default().entry(*value).or_insert(place);
    }
    let k = &input.camera.intrinsics;
    Ok(Picture::from_fn(k.width as usize, k.height as usize, |x, y| {
        let place = lens.place(k.direction(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)));
        let inside =
            place.x >= 0.0 && place.y >= 0.0 && place.x < f64::from(lens.width) && place.y < f64::from(lens.height);
        let shown = |(file, regions): (&&str, &BTreeMap<u16, u16>)| {
            regions.get(&masks[*file].get(place.x as usize, place.y as usize)).copied()
        };
        if inside { region_of.iter().filter_map(shown).min().unwrap_or(0) } else { 0 }
    }))
}

impl SceneRegions {
    /// Writes the regions that valid pixels of the input view show. Returns a finding for each of the others.
    pub(super) fn write(self, id: &SceneId, folder: &SceneFolder, input: &View) -> Result<Vec<Finding>, PrepError> {
        let valid = png_io::read_mask(&folder.view(&input.id).join("valid.png"))?;
        let (width, height) = (valid.width(), valid.height());
        let shown = Picture::from_fn(width, height, |x, y| if valid.get(x, y) { self.picture.get(x, y) } else { 0 });
        let seen: BTreeSet<u16> = shown.pixels().iter().copied().collect();
        let (mut regions, mut findings) = (Vec::new(), Vec::new());
        let mut index_of = vec![0_u16; self.measurements.len() + 1];
        for (region, place) in self.measurements.iter().zip(1_u16..) {
            if !seen.contains(&place) {
                let message = format!("no valid pixel of the input view shows the region {}", quoted(&region.name));
                let action = "left it out";
                findings.push(Finding::new(Severity::Warning, "unseen_region", &self.file, "", message, action));
                continue;
            }
            let index = regions.len() as u16 + 1;
            index_of[usize::from(place)] = index;
            regions.push(MeasuredRegion {
                name: region.name.clone(),
                view: input.id.clone(),
                index,
                color: region.color,
                standard_error: region.standard_error,
            });
        }
        if regions.is_empty() {
            let fault = RegionFault::NoneSeen { count: self.measurements.len() };
            return Err(PrepError::scene(id)(BuildFault::Measured(fault)));
        }
        let picture = shown.map(|place| index_of[usize::from(place)]);
        png_io::write_ids(&folder.measured_regions(&input.id), &picture)?;
        json::write(&folder.measured(), &MeasuredFile { format: FORMAT.to_owned(), regions })?;
        Ok(findings)
    }
}
