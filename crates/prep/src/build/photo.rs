//! A photo from elsewhere, which takes the place of a rendered picture: its file, size and exposure. The photos of a
//! captured room belong to its truth, except the input photo.

use std::path::Path;

use glam::DVec2;
use mateval_dataset::camera::{Camera, Intrinsics};
use mateval_dataset::dataset::{Photo, PhotoEncoding, View};
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::lens::Lens;
use mateval_dataset::{Finding, Severity, ViewId};
use mateval_files::FileError;
use mateval_files::source_folder::{FileFault, LookedFor, SourceFolder};
use mateval_image::exr_io::{self, Precision};
use mateval_image::photo::{CameraExposure, PhotoFile};
use mateval_image::texture_io::Encoding;
use mateval_image::{LinearRgb, Picture};
use mateval_sources::source_scene::{CapturedPhoto, SourceScene};

use super::fault::{BuildFault, PhotoFault};
use crate::error::PrepError;
use crate::recipe::{CapturedRoom, RecipeScene};
use crate::views::write_preview;

/// The largest file of a photo, in bytes: one of 64 million pixels of 32-bit numbers has 805 million.
const MAX_PHOTO_BYTES: u64 = 1 << 30;

/// Where the largest number times the exposure is smaller, every byte of `rgb.png` is 0 (half of 1/255, by the linear part
/// of the curve of sRGB).
const LEAST_SHOWN: f64 = 0.5 / 255.0 / 12.92;

/// A photo at the size of the camera's picture.
pub(super) struct ScenePhoto {
    /// What `scene.json` states of it.
    pub(super) listed: Photo,
    /// Linear radiance before exposure.
    picture: Picture<LinearRgb>,
    /// Share of the file's pixels whose alpha is below 1.
    transparent_share: f64,
}

/// Reads the scene's photo, if the recipe names one, and lists its file among the source's. `source` is the folder of
/// the recipe's paths.
pub(super) fn read_photo(
    entry: &RecipeScene,
    source: &Path,
    scene: &mut SourceScene,
) -> Result<Option<ScenePhoto>, PrepError> {
    let fault = |fault| PrepError::scene(&entry.id)(BuildFault::Photo(fault));
    let photo = match (&scene.captured, &entry.photo) {
        (Some(captured), _) => captured_photo(captured, &scene.camera, entry).map_err(fault)?,
        (None, Some(path)) => {
            let root = entry.root(source);
            let mut folder = SourceFolder::new(&root, MAX_PHOTO_BYTES).map_err(FileError::io("open", &root))?;
            let photo = photo_of_file(&mut folder, &path.to_string_lossy(), &scene.camera, entry.exposure);
            let photo = photo.map_err(fault)?;
            scene.read.files.extend(folder.into_files());
            scene.read.files.hashes.dedup();
            photo
        }
        (None, None) => return Ok(None),
    };
    scene.read.findings.extend(photo.transparency());
    scene.read.findings.sort();
    Ok(Some(photo))
}

/// Reads the other photos of a captured room at the size of the input view, with their cameras, and lists their files
/// among the source's. `root` is the folder of the recipe's paths.
pub(super) fn read_novel_photos(
    entry: &RecipeScene,
    root: &Path,
    scene: &mut SourceScene,
) -> Result<Vec<(Camera, ScenePhoto)>, PrepError> {
    let fault = |fault| PrepError::scene(&entry.id)(BuildFault::Photo(fault));
    let Intrinsics { width, height, .. } = scene.camera.intrinsics;
    let input = match (&entry.capture, &scene.captured) {
        (Some(room), Some(input)) => camera_exposure(room, &room.input, input).map_err(fault)?,
        _ => None,
    };
    let named = entry.capture.iter().flat_map(|room| room.novel.iter().map(move |name| (room, name)));
    let mut all = Vec::new();
    for ((path, camera), (room, name)) in std::mem::take(&mut scene.novel).into_iter().zip(named) {
        let (captured, file) = read_captured(root, &path, camera.lens).map_err(fault)?;
        scene.read.files.extend(file);
        let intrinsics = pinhole(&captured, [width, height]).map_err(fault)?;
        let camera = Camera::from_rotation(camera.rotation, camera.position, intrinsics);
        let mut photo = captured_photo(&captured, &camera, entry).map_err(fault)?;
        let own = camera_exposure(room, name, &captured).map_err(fault)?;
        if let (Some(input), Some(own)) = (input, own) {
            photo.bring_to_exposure(own.factor() / input.factor());
        }
        scene.read.findings.extend(photo.transparency());
        all.push((camera, photo));
    }
    scene.read.files.hashes.dedup();
    scene.read.findings.sort();
    Ok(all)
}

/// The largest share of pixels that reach `white`; beyond it nothing is left to fit lights to.
const MOST_CLIPPED: f64 = 0.99;

/// The largest ratio of the exposures of a table and of EXIF data, which rounds times such as 1/60 s.
const SAME_EXPOSURE: f64 = 1.05;

/// The exposure of the photo that the recipe names `name`, where the recipe states or asks for it.
fn camera_exposure(
    room: &CapturedRoom,
    name: &str,
    captured: &CapturedPhoto,
) -> Result<Option<CameraExposure>, PhotoFault> {
    same_exposure(&captured.file, room.exposures.get(name).copied(), captured.photo.exposure(), room.exif)
}

/// The exposure of a photo by the recipe's table and by its EXIF data. If both state one, they must agree; EXIF data
/// alone counts only if it `is_wanted`.
fn same_exposure(
    file: &str,
    table: Option<CameraExposure>,
    exif: Option<CameraExposure>,
    is_wanted: bool,
) -> Result<Option<CameraExposure>, PhotoFault> {
    let file = || file.to_owned();
    match (table, exif) {
        (Some(table), Some(exif)) => {
            let ratio = table.factor() / exif.factor();
            let is_same = (1.0 / SAME_EXPOSURE..=SAME_EXPOSURE).contains(&ratio);
            is_same.then_some(Some(table)).ok_or_else(|| PhotoFault::Exposures { file: file(), table, exif })
        }
        (None, None) if is_wanted => Err(PhotoFault::NoExposure { file: file() }),
        (table, exif) => Ok(table.or(exif.filter(|_| is_wanted))),
    }
}

/// Reads the photo at `path` in the folder `root`, whose camera has this lens. Returns also the file with its hash.
pub(super) fn read_captured(root: &Path, path: &str, lens: Lens) -> Result<(CapturedPhoto, LookedFor), PhotoFault> {
    let unreadable = |error| PhotoFault::File(FileFault { code: "unreadable_file", message: format!("{error}") });
    let mut folder = SourceFolder::new(root, MAX_PHOTO_BYTES).map_err(unreadable)?;
    let (file, photo) = read_file(&mut folder, path)?;
    let found = [photo.width() as u32, photo.height() as u32];
    let stated = [lens.width, lens.height];
    if stated != [0, 0] && stated != found {
        return Err(PhotoFault::OtherSize { file, found, stated });
    }
    let [width, height] = found;
    // Cameras without a size cannot show that the photo is a thumbnail. One of half the size puts the principal point at
    // the edge; a crop seldom moves it by more than a quarter.
    let is_off = |at: f64, size: u32| (at / f64::from(size) - 0.5).abs() > 0.25;
    if stated == [0, 0] && (is_off(lens.cx, width) || is_off(lens.cy, height)) {
        return Err(PhotoFault::PrincipalPoint { file, found, point: [lens.cx, lens.cy] });
    }
    Ok((CapturedPhoto { file, photo, lens: Lens { width, height, ..lens } }, folder.into_files()))
}

/// The camera's picture of `size` that shows the photo without distortion.
pub(super) fn pinhole(captured: &CapturedPhoto, size: [u32; 2]) -> Result<Intrinsics, PhotoFault> {
    let CapturedPhoto { file, lens, .. } = captured;
    let found = [lens.width, lens.height];
    if !fits(found, size) {
        return Err(PhotoFault::Size { file: file.clone(), found, expected: size });
    }
    let fault = || PhotoFault::Lens { file: file.clone(), k: [lens.k1, lens.k2, lens.p1, lens.p2] };
    lens.undistorted(size[0], size[1]).ok_or_else(fault)
}

/// The photo of a captured room, undistorted to the camera's picture.
fn captured_photo(captured: &CapturedPhoto, camera: &Camera, entry: &RecipeScene) -> Result<ScenePhoto, PhotoFault> {
    let CapturedPhoto { file, photo, lens } = captured;
    let Intrinsics { width, height, .. } = camera.intrinsics;
    let (columns, rows) = (width as usize, height as usize);
    let picture = match lens.is_distorted() {
        false => photo.resized(columns, rows),
        true => photo.resampled(columns, rows, |place| {
            lens.place(camera.intrinsics.direction(DVec2::from_array(place))).to_array()
        }),
    };
    let white = entry.capture.as_ref().and_then(|room| room.white);
    if white.is_some() && photo.encoding() == Encoding::Srgb {
        return Err(PhotoFault::White { file: file.clone() });
    }
    if let Some(white) = white {
        let is_clipped = |LinearRgb(rgb): &&LinearRgb| rgb.iter().any(|value| f64::from(*value) >= white);
        let clipped = picture.pixels().iter().filter(is_clipped).count();
        if clipped as f64 > MOST_CLIPPED * picture.pixels().len() as f64 {
            return Err(PhotoFault::Clipped { file: file.clone(), white });
        }
    }
    let mut found = scene_photo(file.clone(), photo, picture, Some(*lens), entry.exposure)?;
    found.listed.white = white;
    Ok(found)
}

fn read_file(folder: &mut SourceFolder, path: &str) -> Result<(String, PhotoFile), PhotoFault> {
    let file = SourceFolder::relative(path)?;
    let bytes = folder.read(&file)?;
    let photo = PhotoFile::of_bytes(Path::new(&file), bytes)?;
    Ok((file, photo))
}

fn photo_of_file(
    folder: &mut SourceFolder,
    path: &str,
    camera: &Camera,
    exposure: f64,
) -> Result<ScenePhoto, PhotoFault> {
    let (file, photo) = read_file(folder, path)?;
    let found = [photo.width() as u32, photo.height() as u32];
    let expected = [camera.intrinsics.width, camera.intrinsics.height];
    if !fits(found, expected) {
        return Err(PhotoFault::Size { file, found, expected });
    }
    let picture = photo.resized(expected[0] as usize, expected[1] as usize);
    scene_photo(file, &photo, picture, None, exposure)
}

/// The photo whose values, at the size of the camera's picture, are `picture`.
fn scene_photo(
    file: String,
    photo: &PhotoFile,
    picture: Picture<LinearRgb>,
    lens: Option<Lens>,
    exposure: f64,
) -> Result<ScenePhoto, PhotoFault> {
    let size = [photo.width() as u32, photo.height() as u32];
    let (encoding, picture) = match photo.encoding() {
        Encoding::Linear => (PhotoEncoding::Linear, picture),
        Encoding::Srgb => {
            let unexposed = |v: f32| (f64::from(v) / exposure) as f32;
            (PhotoEncoding::Srgb, picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(unexposed))))
        }
    };
    let largest = picture.pixels().iter().flat_map(|LinearRgb(rgb)| *rgb).fold(0.0, f32::max);
    if f64::from(largest) * exposure < LEAST_SHOWN {
        return Err(PhotoFault::Black { file, largest, exposure });
    }
    let transparent_share = photo.transparent_share();
    let listed = Photo { file, size, encoding, white: None, relative_exposure: None, lens };
    Ok(ScenePhoto { listed, picture, transparent_share })
}

/// Whether a photo is at least as large as the camera's picture and, reduced to its width, less than half a row higher
/// or lower.
fn fits(photo: [u32; 2], [width, height]: [u32; 2]) -> bool {
    let reduced = f64::from(photo[1]) * f64::from(width) / f64::from(photo[0]);
    photo[0] >= width && photo[1] >= height && (reduced - f64::from(height)).abs() < 0.5
}

impl ScenePhoto {
    /// Divides the picture by its exposure `relative` to that of the input photo.
    fn bring_to_exposure(&mut self, relative: f64) {
        self.listed.relative_exposure = Some(relative);
        self.picture = self.picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (f64::from(v) / relative) as f32)));
    }

    pub(super) fn picture(&self) -> &Picture<LinearRgb> {
        &self.picture
    }

    fn transparency(&self) -> Option<Finding> {
        let message = format!("{:.1} % of its pixels have an alpha below 1", 100.0 * self.transparent_share);
        let action = "used their colours as they are stored";
        let file = self.listed.file.clone();
        (self.transparent_share > 0.0)
            .then(|| Finding::new(Severity::Warning, "transparent_photo", file, "", message, action))
    }

    /// Writes `photo.exr` of a view other than the input view into the ground truth.
    pub(super) fn write_truth(&self, folder: &SceneFolder, view: &ViewId) -> Result<(), PrepError> {
        Ok(exr_io::write_linear(&folder.novel_photo(view), &self.picture, Precision::Float)?)
    }

    /// Writes `rgb.exr` and `rgb.png` of the input view.
    pub(super) fn write(&self, folder: &SceneFolder, input: &View, exposure: f64) -> Result<(), PrepError> {
        let place = folder.view(&input.id);
        exr_io::write_linear(&place.join("rgb.exr"), &self.picture, Precision::Float)?;
        write_preview(&place, &self.picture, exposure)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// In a file of floats, whose numbers the exposure multiplies, and in one of integers, which are shown as they are.
    #[test]
    fn black_photos_are_refused_and_transparent_ones_counted() {
        let folder = tempfile::tempdir().unwrap();
        let intrinsics = Intrinsics::from_fov_y(8, 6, 1.0);
        let camera = Camera::look_at(DVec3::ZERO, DVec3::Z, DVec3::Y, intrinsics).unwrap();
        let read = |file: &str, exposure: f64| {
            let mut source = SourceFolder::new(folder.path(), 1 << 20).unwrap();
            photo_of_file(&mut source, file, &camera, exposure)
        };
        let tiny = Picture::from_fn(8, 6, |x, _| LinearRgb([1e-30 * x as f32 / 7.0; 3]));
        exr_io::write_linear(&folder.path().join("a.exr"), &tiny, Precision::Float).unwrap();
        let said = read("a.exr", 1.0).err().unwrap().to_string();
        assert!(said.contains("'a.exr' is black: its largest number is 1e-30, with the exposure 1"), "{said}");
        assert_eq!(read("a.exr", 1e30).ok().unwrap().transparent_share, 0.0);
        let write = |pixel: [u8; 4]| {
            let picture = Picture::from_fn(8, 6, |x, _| if x < 4 { pixel } else { [0, 0, 0, 255] });
            mateval_image::png_io::write_rgba_bytes(&folder.path().join("a.png"), &picture).unwrap();
        };
        write([0, 0, 0, 255]);
        assert!(matches!(read("a.png", 1e9), Err(PhotoFault::Black { .. })));
        write([1, 0, 0, 7]);
        assert_eq!(read("a.png", 1e-9).ok().unwrap().transparent_share, 0.5);
    }

    /// A table and EXIF data that agree up to the rounding of a time. In the twins they contradict each other, or one
    /// of them or both are missing.
    #[test]
    fn an_exposure_is_that_of_the_table_unless_exif_data_contradicts_it() {
        let of = |time_s: f64| CameraExposure { time_s, iso: 100.0, f_number: 2.0 };
        let found = |table: Option<f64>, in_file: Option<f64>, exif: bool| {
            same_exposure("a.jpg", table.map(of), in_file.map(of), exif).map(|found| found.map(|found| found.time_s))
        };
        assert_eq!(found(Some(0.0167), Some(1.0 / 60.0), false).unwrap(), Some(0.0167));
        assert_eq!(found(Some(0.02), None, true).unwrap(), Some(0.02));
        assert_eq!(found(None, Some(0.02), true).unwrap(), Some(0.02));
        // Without a word of the recipe, every photo keeps an exposure of its own.
        assert_eq!(found(None, Some(0.02), false).unwrap(), None);
        assert_eq!(found(None, None, false).unwrap(), None);
        let said = found(Some(0.02), Some(0.04), true).unwrap_err().to_string();
        assert!(said.contains("'a.jpg': `exposures` states 0.02 s at ISO 100 and f/2"), "{said}");
        assert!(said.contains("the EXIF data of the photo 0.04 s at ISO 100 and f/2"), "{said}");
        let said = found(None, None, true).unwrap_err().to_string();
        assert!(said.contains("'a.jpg' states no exposure in its EXIF data"), "{said}");
    }

    #[test]
    fn a_photo_has_the_proportions_of_the_picture_and_at_least_its_size() {
        assert!(fits([64, 48], [64, 48]));
        assert!(fits([4000, 3000], [64, 48]));
        // A sensor of odd proportions, less than half a row off.
        assert!(fits([4032, 3024 + 20], [64, 48]));
        for wrong in [[64, 49], [1920, 1080], [48, 64], [32, 24]] {
            assert!(!fits(wrong, [64, 48]), "{wrong:?}");
        }
    }
}
