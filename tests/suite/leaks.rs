//! Looks for the truth of a hidden split in what others may see: for the hashes, sizes and bytes of its files, and for
//! windows of its pictures, which lie side by side. Pictures are decoded first, so that a crop that holds a window,
//! another bit depth or another format is found. A picture that was scaled, turned or compressed with loss is not found.

use std::collections::{BTreeSet, HashMap};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use mateval_files::untrusted::sha256_of_bytes;
use mateval_image::exr_io::{self, EXR_SIGNATURE, Precision};
use mateval_image::transfer::{linear_from_srgb, srgb_from_linear};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_testkit::files_below;

/// Pixels along a window's side.
const SIDE: usize = 16;
/// The largest difference of two pixels that count as equal, in steps of 8-bit sRGB: storing floats in 8 bits changes
/// them by up to half a step.
const MOST_DIFFERENCE: f32 = 1.01;
/// The least number of 8-bit values in a window, and its least mean distance from its mean: flat windows and edges
/// between two colours occur in unrelated pictures.
const LEAST_VALUES: usize = 8;
const LEAST_CONTRAST: f32 = 2.0;
/// The width of a bin of means, by which windows are found.
const BIN: f32 = 4.0;

/// The windows of withheld pictures.
pub struct Secrets {
    windows: Vec<Window>,
    /// By the bins of the means of a window's quarters: the windows whose means may lie there.
    by_means: HashMap<[u8; 4], Vec<usize>>,
}

struct Window {
    file: PathBuf,
    codes: Vec<f32>,
}

/// What a folder shows.
pub struct Shown {
    /// The number of pictures in its files.
    pub pictures: usize,
    /// Pairs of a file of the folder and a withheld file whose window it holds.
    pub leaks: BTreeSet<(PathBuf, PathBuf)>,
}

impl Secrets {
    /// The windows with texture of all pictures in the private folder of a split, except of the photo, which is public.
    pub fn of(private: &Path) -> Self {
        let mut secrets = Self { windows: Vec::new(), by_means: HashMap::new() };
        for file in files_below(private).into_iter().filter(|file| !is_photo(file)) {
            for plane in pictures_of(&std::fs::read(private.join(&file)).unwrap()).into_iter().flatten() {
                secrets.add(&file, &plane);
            }
        }
        assert!(!secrets.windows.is_empty(), "'{}' holds no picture with texture", private.display());
        secrets
    }

    fn add(&mut self, file: &Path, plane: &Picture<f32>) {
        let sums = Sums::new(plane);
        for (x, y) in corners(plane, SIDE) {
            let codes: Vec<f32> = window(plane, x, y).collect();
            if !has_texture(&codes) {
                continue;
            }
            for bins in bins_near(sums.quarter_means(x, y)) {
                self.by_means.entry(bins).or_default().push(self.windows.len());
            }
            self.windows.push(Window { file: file.to_owned(), codes });
        }
    }

    /// Looks for the windows in every picture of every file below a folder.
    pub fn found_in(&self, folder: &Path) -> Shown {
        let mut shown = Shown { pictures: 0, leaks: BTreeSet::new() };
        for file in files_below(folder) {
            for planes in pictures_of(&std::fs::read(folder.join(&file)).unwrap()) {
                shown.pictures += 1;
                // A picture may hold linear values where the truth is in sRGB.
                let encoded = |plane: &Picture<f32>| plane.map(|code| 255.0 * srgb_from_linear(code / 255.0));
                for plane in planes.into_iter().flat_map(|plane| [encoded(&plane), plane]) {
                    let secrets = self.files_with_a_window_of(&plane);
                    shown.leaks.extend(secrets.into_iter().map(|secret| (file.clone(), secret.to_owned())));
                }
            }
        }
        shown
    }

    fn files_with_a_window_of(&self, plane: &Picture<f32>) -> BTreeSet<&Path> {
        let sums = Sums::new(plane);
        let mut found = BTreeSet::new();
        for (x, y) in corners(plane, 1) {
            let near = self.by_means.get(&sums.quarter_means(x, y).map(bin)).into_iter().flatten();
            for secret in near.map(|at| &self.windows[*at]) {
                let mut pixels = secret.codes.iter().zip(window(plane, x, y));
                if pixels.all(|(secret, shown)| (secret - shown).abs() <= MOST_DIFFERENCE) {
                    found.insert(secret.file.as_path());
                }
            }
        }
        found
    }
}

/// Whether a file is the photo, which is a render and public.
fn is_photo(file: &Path) -> bool {
    file.to_string_lossy().replace('\\', "/").contains("/input/rgb.")
}

/// The upper left corners of a plane's windows.
fn corners(plane: &Picture<f32>, step: usize) -> impl Iterator<Item = (usize, usize)> {
    let [columns, rows] = [plane.width(), plane.height()].map(|side| (side + 1).saturating_sub(SIDE));
    (0..rows).step_by(step).flat_map(move |y| (0..columns).step_by(step).map(move |x| (x, y)))
}

fn window(plane: &Picture<f32>, x: usize, y: usize) -> impl Iterator<Item = f32> {
    (0..SIDE * SIDE).map(move |at| plane.get(x + at % SIDE, y + at / SIDE))
}

fn has_texture(codes: &[f32]) -> bool {
    let values: BTreeSet<u8> = codes.iter().map(|code| code.round() as u8).collect();
    let mean = codes.iter().sum::<f32>() / codes.len() as f32;
    let contrast = codes.iter().map(|code| (code - mean).abs()).sum::<f32>() / codes.len() as f32;
    values.len() >= LEAST_VALUES && contrast >= LEAST_CONTRAST
}

fn bin(mean: f32) -> u8 {
    (mean / BIN) as u8
}

/// The bins in which the means of an equal window may lie.
fn bins_near(means: [f32; 4]) -> BTreeSet<[u8; 4]> {
    let shift = |bits: usize, at: usize| if bits >> at & 1 == 1 { MOST_DIFFERENCE } else { -MOST_DIFFERENCE };
    (0..16).map(|bits| std::array::from_fn(|at| bin(means[at] + shift(bits, at)))).collect()
}

/// Sums of the pixels above and to the left of each corner of a pixel, for the means of rectangles.
struct Sums {
    width: usize,
    sums: Vec<f64>,
}

impl Sums {
    fn new(plane: &Picture<f32>) -> Self {
        let width = plane.width() + 1;
        let mut sums = vec![0.0; width * (plane.height() + 1)];
        for y in 0..plane.height() {
            let mut row = 0.0;
            for x in 0..plane.width() {
                row += f64::from(plane.get(x, y));
                sums[(y + 1) * width + x + 1] = sums[y * width + x + 1] + row;
            }
        }
        Self { width, sums }
    }

    /// The means of the quarters of the window with this corner.
    fn quarter_means(&self, x: usize, y: usize) -> [f32; 4] {
        const HALF: usize = SIDE / 2;
        let sum = |x: usize, y: usize| self.sums[y * self.width + x];
        [(x, y), (x + HALF, y), (x, y + HALF), (x + HALF, y + HALF)].map(|(x, y)| {
            let whole = sum(x + HALF, y + HALF) - sum(x, y + HALF) - sum(x + HALF, y) + sum(x, y);
            (whole / (HALF * HALF) as f64) as f32
        })
    }
}

/// The channels ([`planes`]) of each picture in a file. A picture may be a file in a tar, a cell of a table or a
/// `data:` address in a page.
fn pictures_of(bytes: &[u8]) -> Vec<Vec<Picture<f32>>> {
    let is_packed = [&b"PK\x03\x04"[..], b"\x1f\x8b", b"\x28\xb5\x2f\xfd"].iter().any(|start| bytes.starts_with(start));
    assert!(!is_packed, "a compressed archive; let `pictures_of` unpack it");
    let mut found = Vec::new();
    if bytes.get(257..262) == Some(b"ustar") {
        let mut archive = tar::Archive::new(bytes);
        for entry in archive.entries().unwrap() {
            let mut inner = Vec::new();
            entry.unwrap().read_to_end(&mut inner).unwrap();
            found.extend(pictures_of(&inner));
        }
        return found;
    }
    for at in 0..bytes.len() {
        let rest = &bytes[at..];
        let is_exr = rest.starts_with(EXR_SIGNATURE) && rest.get(4) == Some(&2);
        let is_jpeg = at == 0 && rest.starts_with(b"\xff\xd8\xff");
        if is_exr || is_jpeg || rest.starts_with(b"\x89PNG\r\n\x1a\n") {
            found.push(planes(rest));
        }
        if let Some(text) = rest.strip_prefix(b"base64,") {
            let is_outside = |byte: &u8| !byte.is_ascii_alphanumeric() && !b"+/=".contains(byte);
            let encoded = text.split(is_outside).next().unwrap_or_default();
            found.extend(pictures_of(&base64::decode(encoded).unwrap()));
        }
    }
    found
}

/// The channels of a picture that starts with these bytes, as 8-bit sRGB without rounding; those that differ, and are
/// not constant.
fn planes(bytes: &[u8]) -> Vec<Picture<f32>> {
    let mut planes: Vec<Picture<f32>> = if bytes.starts_with(EXR_SIGNATURE) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.exr");
        std::fs::write(&path, bytes).unwrap();
        let code = |linear: f32| if linear.is_nan() { 0.0 } else { 255.0 * srgb_from_linear(linear.clamp(0.0, 1.0)) };
        exr_io::read_channels(&path).unwrap().into_values().map(|channel| channel.map(code)).collect()
    } else {
        let picture = image::load_from_memory(bytes).unwrap().into_rgba32f();
        let plane = |channel: usize| {
            let codes = picture.pixels().map(|pixel| 255.0 * pixel.0[channel]).collect();
            Picture::new(picture.width() as usize, picture.height() as usize, codes).unwrap()
        };
        (0..4).map(plane).collect()
    };
    planes.dedup();
    planes.retain(|plane| plane.pixels().iter().any(|code| *code != plane.pixels()[0]));
    planes
}

/// The bytes of every file below a folder.
pub fn contents(root: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    files_below(root).into_iter().map(|file| (file.clone(), std::fs::read(root.join(file)).unwrap())).collect()
}

pub fn holds(text: &[u8], part: &[u8]) -> bool {
    text.windows(part.len()).any(|window| window == part)
}

/// Panics if the public folder of a split holds a withheld file, its hash, the size of a map or a piece of one that an
/// unrelated dataset does not hold. Returns the number of pieces that were looked for.
pub fn check_bytes(public: &Path, private: &Path, unrelated: &Path) -> usize {
    let (public, unrelated) = (contents(public), contents(unrelated));
    let texts: Vec<u8> = public
        .iter()
        .filter(|(file, _)| file.extension().is_none_or(|ending| ending == "json" || ending == "sha256"))
        .flat_map(|(_, bytes)| bytes.clone())
        .collect();
    let mut pieces = 0;
    for (file, bytes) in contents(private).into_iter().filter(|(file, _)| !is_photo(file)) {
        assert!(!public.iter().any(|(_, other)| *other == bytes), "{file:?} is public");
        assert!(!holds(&texts, sha256_of_bytes(&bytes).as_bytes()), "the hash of {file:?} is public");
        let is_map = file.ends_with("base_color.png");
        assert!(!is_map || !holds(&texts, format!(": {}", bytes.len()).as_bytes()), "the size of {file:?} is public");
        // From the middle of each map, past what all PNG files begin with.
        let piece = &bytes[bytes.len() / 2..][..16.min(bytes.len() / 2)];
        if is_map && piece.len() == 16 && !unrelated.iter().any(|(_, other)| holds(other, piece)) {
            pieces += 1;
            assert!(!public.iter().any(|(_, other)| holds(other, piece)), "a piece of {file:?} is public");
        }
    }
    pieces
}

/// The name of a file, and what writes it.
type Planted<'a> = (&'a str, &'a dyn Fn(&Path));

/// A crop of a map is found in every form that files are written in, and another texture is not.
#[test]
fn planted_leaks_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let [private, site] = ["private", "site"].map(|name| folder.path().join(name));
    for place in [&private, &site] {
        std::fs::create_dir(place).unwrap();
    }
    // Textures of bent waves, in sRGB: equal windows need equal widths.
    let texture = |width: f32| {
        move |x: usize, y: usize| {
            let (x, y) = (x as f32, y as f32);
            let wave = |across: f32| 0.5 + 0.3 * (across / width).sin();
            [wave(x + y * y / 29.0), wave(y - x * x / 41.0), wave(x + x * y / 37.0)]
        }
    };
    let bytes_of = |map: &dyn Fn(usize, usize) -> [f32; 3], size: usize| {
        Picture::from_fn(size, size, |x, y| map(x, y).map(|code| (255.0 * code).round() as u8))
    };
    let secret = texture(3.1);
    png_io::write_rgb_bytes(&private.join("base_color.png"), &bytes_of(&secret, 64)).unwrap();
    let secrets = Secrets::of(&private);
    // The crop of 40 pixels that starts at (5, 9), in another picture.
    let other = texture(4.3);
    let cropped = |x: usize, y: usize| match (x.checked_sub(11), y.checked_sub(3)) {
        (Some(x), Some(y)) if x < 40 && y < 40 => secret(x + 5, y + 9),
        _ => other(x, y),
    };
    let linear = |map: &dyn Fn(usize, usize) -> [f32; 3]| {
        Picture::from_fn(60, 60, |x, y| LinearRgb(map(x, y).map(linear_from_srgb)))
    };
    let png = |path: &Path| png_io::write_rgb_bytes(path, &bytes_of(&cropped, 60)).unwrap();
    let exr = |path: &Path| exr_io::write_linear(path, &linear(&cropped), Precision::Half).unwrap();
    let leaks: [Planted<'_>; 6] = [
        ("bytes.png", &png),
        ("half.exr", &exr),
        ("words.png", &|path: &Path| {
            let words = linear(&cropped).map(|LinearRgb(rgb)| rgb.map(|value| (65535.0 * value).round() as u16));
            png_io::write_rgb_words(path, &words).unwrap();
        }),
        ("one_channel.png", &|path: &Path| {
            let grey = Picture::from_fn(60, 60, |x, y| (65535.0 * cropped(x, y)[2]).round() as u16);
            png_io::write_ids(path, &grey).unwrap();
        }),
        ("packed.tar", &|path: &Path| {
            let inner = folder.path().join("inner.exr");
            exr(&inner);
            let mut tar = tar::Builder::new(std::fs::File::create(path).unwrap());
            tar.append_path_with_name(&inner, "picture").unwrap();
            tar.finish().unwrap();
        }),
        ("page.html", &|path: &Path| {
            let inner = folder.path().join("inner.png");
            png(&inner);
            let encoded = base64::encode(std::fs::read(&inner).unwrap());
            std::fs::write(path, format!("<img src=\"data:image/png;base64,{encoded}\">")).unwrap();
        }),
    ];
    for (name, write) in leaks {
        let path = site.join(name);
        write(&path);
        let shown = secrets.found_in(&site);
        let expected = BTreeSet::from([(PathBuf::from(name), PathBuf::from("base_color.png"))]);
        assert_eq!((shown.pictures, shown.leaks), (1, expected), "{name}");
        std::fs::remove_file(&path).unwrap();
    }
    png_io::write_rgb_bytes(&site.join("other.png"), &bytes_of(&other, 60)).unwrap();
    exr_io::write_linear(&site.join("other.exr"), &linear(&other), Precision::Half).unwrap();
    let shown = secrets.found_in(&site);
    assert_eq!((shown.pictures, shown.leaks), (2, BTreeSet::new()));
}
