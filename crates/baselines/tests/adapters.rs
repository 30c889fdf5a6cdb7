//! Every built-in adapter reads the files that its method writes: a known material is written with the names, sizes,
//! formats and encodings of the method's script, and found again.

#![allow(
    clippy::unwrap_used,
    reason = "tests unwrap; clippy exempts only functions marked as tests, not what they call"
)]

use std::path::Path;

use glam::DVec2;
use mateval_baselines::adapter::Adapter;
use mateval_baselines::estimate::{Estimate, Placement, Region};
use mateval_dataset::submission::StoredEncoding;
use mateval_image::exr_io::{Precision, write_grey, write_linear};
use mateval_image::transfer::srgb_from_linear;
use mateval_image::{LinearRgb, Picture};

/// Width and height of the input view.
const VIEW: (usize, usize) = (480, 270);
/// The scene's id.
const SCENE: &str = "living";

/// One file of a script.
struct File {
    path: &'static str,
    content: Content,
    encoding: StoredEncoding,
}

/// What a file shows.
#[derive(Clone, Copy)]
enum Content {
    Albedo,
    /// The albedo, each channel times a factor, as a method of unknown scale predicts it.
    Scaled([f32; 3]),
    Roughness,
    Metallic,
    /// Red: roughness, green: metallic, blue: 0.
    Packed,
}

/// The files that the script of a method writes for one scene.
struct Script {
    adapter: &'static str,
    /// Width and height of its pictures.
    size: (usize, usize),
    /// Whether it cuts a square from the middle of the view.
    is_cropped: bool,
    files: Vec<File>,
}

/// The material at a place of the view, which is given in shares of its width and height.
fn albedo(place: DVec2) -> [f32; 3] {
    [0.1 + 0.8 * place.x, 0.15 + 0.7 * place.y, 0.9 - 0.4 * place.x].map(|value| value as f32)
}

fn roughness(place: DVec2) -> f32 {
    (0.2 + 0.6 * place.y) as f32
}

fn metallic(place: DVec2) -> f32 {
    (0.1 + 0.8 * place.x) as f32
}

fn encode(encoding: StoredEncoding, linear: f32) -> f32 {
    match encoding {
        StoredEncoding::Linear => linear,
        StoredEncoding::Srgb => srgb_from_linear(linear),
        StoredEncoding::Gamma22 => libm::powf(linear, 1.0 / 2.2),
    }
}

impl Content {
    fn at(self, place: DVec2) -> [f32; 3] {
        match self {
            Self::Albedo => albedo(place),
            Self::Scaled(factors) => std::array::from_fn(|channel| factors[channel] * albedo(place)[channel]),
            Self::Roughness => [roughness(place); 3],
            Self::Metallic => [metallic(place); 3],
            Self::Packed => [roughness(place), metallic(place), 0.0],
        }
    }
}

impl Script {
    /// Writes the files as the method's script does: it resizes the view, or crops it to a square first.
    fn write(&self, folder: &Path) {
        let view = DVec2::new(VIEW.0 as f64, VIEW.1 as f64);
        let shown = if self.is_cropped { DVec2::splat(view.min_element()) } else { view };
        for file in &self.files {
            let picture = Picture::from_fn(self.size.0, self.size.1, |x, y| {
                let share = (DVec2::new(x as f64, y as f64) + 0.5) / DVec2::new(self.size.0 as f64, self.size.1 as f64);
                let place = ((view - shown) / 2.0 + share * shown) / view;
                file.content.at(place).map(|value| encode(file.encoding, value))
            });
            let path = folder.join(file.path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            match file.content {
                // As Mitsuba and others write a scalar.
                Content::Roughness | Content::Metallic if file.path.ends_with(".exr") => {
                    write_grey(&path, &picture.map(|rgb| rgb[0]), Precision::Float).unwrap();
                }
                _ => write_picture(&path, &picture),
            }
        }
    }
}

/// Writes the numbers in the format that the path's ending names.
fn write_picture(path: &Path, picture: &Picture<[f32; 3]>) {
    if path.extension().is_some_and(|ending| ending == "exr") {
        write_linear(path, &picture.map(LinearRgb), Precision::Float).unwrap();
        return;
    }
    let bytes = picture.pixels().iter().flatten().map(|value| (value * 255.0).round() as u8).collect();
    let picture = image::RgbImage::from_raw(picture.width() as u32, picture.height() as u32, bytes).unwrap();
    match path.extension().unwrap().to_str().unwrap() {
        "jpg" => {
            let file = std::fs::File::create(path).unwrap();
            image::codecs::jpeg::JpegEncoder::new_with_quality(file, 85).encode_image(&picture).unwrap();
        }
        _ => picture.save(path).unwrap(),
    }
}

fn file(path: &'static str, content: Content, encoding: StoredEncoding) -> File {
    File { path, content, encoding }
}

/// The scripts, as `adapters/README.md` describes them.
fn scripts() -> Vec<Script> {
    use Content::{Albedo, Metallic, Packed, Roughness, Scaled};
    use StoredEncoding::{Gamma22, Linear, Srgb};
    let script = |adapter, size, files| Script { adapter, size, is_cropped: false, files };
    let straight = |albedo, roughness, metallic, encoding| {
        let scalars = [file(roughness, Roughness, Linear), file(metallic, Metallic, Linear)];
        [file(albedo, Albedo, encoding)].into_iter().chain(scalars).collect::<Vec<_>>()
    };
    vec![
        script("colorful-shading", (480, 272), vec![file("living/hr_alb.exr", Scaled([3.0; 3]), Linear)]),
        script("crefnet", (480, 270), vec![file("living_r.png", Scaled([0.8; 3]), Gamma22)]),
        script(
            "diffusion-renderer",
            (960, 512),
            straight(
                "living/0000.0000.basecolor.png",
                "living/0000.0000.roughness.png",
                "living/0000.0000.metallic.png",
                Srgb,
            ),
        ),
        script(
            "diffusion-renderer",
            (1280, 704),
            straight(
                "living/0000.0000.basecolor.jpg",
                "living/0000.0000.roughness.jpg",
                "living/0000.0000.metallic.jpg",
                Srgb,
            ),
        ),
        script(
            "dnf-intrinsic",
            (640, 480),
            straight("living_albedo.png", "living_roughness.png", "living_metallic.png", Srgb),
        ),
        script("iid", (640, 480), straight("living_albedo.png", "living_roughness.png", "living_metal.png", Linear)),
        script(
            "iid",
            (640, 480),
            vec![file("albedo/living.exr", Albedo, Linear), file("material/living.exr", Packed, Linear)],
        ),
        script("intrinsic", (480, 270), vec![file("living/albedo.png", Scaled([0.7; 3]), Gamma22)]),
        script(
            "marigold",
            (480, 270),
            vec![file("living/albedo.png", Albedo, Gamma22), file("living/material.png", Packed, Gamma22)],
        ),
        // The lighting model, by the authors' own script.
        script("marigold", (480, 270), vec![file("living/rgb_albedo.png", Albedo, Gamma22)]),
        Script {
            adapter: "materialist",
            size: (512, 512),
            is_cropped: true,
            files: straight(
                "living/best_results/albedo.exr",
                "living/best_results/roughness.exr",
                "living/best_results/metallic.exr",
                Linear,
            ),
        },
        Script {
            adapter: "mvinverse",
            size: (476, 266),
            is_cropped: false,
            files: vec![
                file("living/000_albedo.png", Scaled([0.9, 0.6, 0.4]), Linear),
                file("living/000_roughness.png", Roughness, Linear),
                file("living/000_metallic.png", Metallic, Linear),
            ],
        },
        script(
            "ouroboros",
            (480, 264),
            straight(
                "living/albedo/albedo.png",
                "living/roughness/roughness.png",
                "living/metallicity/metallicity.png",
                Gamma22,
            ),
        ),
        script(
            "delight",
            (480, 270),
            straight("living/base_color.exr", "living/roughness.exr", "living/metallic.exr", Linear),
        ),
        script(
            "plain",
            (480, 270),
            straight("living/base_color.png", "living/roughness.png", "living/metallic.png", Srgb),
        ),
        script(
            "rgbx",
            (480, 270),
            straight("living/albedo.webp", "living/roughness.webp", "living/metallic.webp", Gamma22),
        ),
    ]
}

/// Largest difference between the estimate's base colour and the known one. Where `is_known` is false the estimate's
/// scale is unknown: each channel is divided by its mean first.
fn color_error(estimate: &Estimate, region: Region, is_known: bool) -> f32 {
    let picture = estimate.base_color.as_ref().unwrap();
    let expected = Picture::from_fn(picture.width(), picture.height(), |x, y| albedo(place(picture, region, x, y)));
    let mean = |values: &mut dyn Iterator<Item = f32>| {
        let values: Vec<f64> = values.map(f64::from).collect();
        (values.iter().sum::<f64>() / values.len() as f64) as f32
    };
    let errors = (0..3).flat_map(|channel| {
        let found = || picture.pixels().iter().map(move |pixel| pixel.0[channel]);
        let known = || expected.pixels().iter().map(move |pixel| pixel[channel]);
        let factor = if is_known { 1.0 } else { mean(&mut known()) / mean(&mut found()) };
        found().zip(known()).map(move |(a, b)| (factor * a - b).abs()).collect::<Vec<_>>()
    });
    errors.fold(0.0, f32::max)
}

/// The place that a pixel shows, in shares of the view.
fn place<T: Copy>(picture: &Picture<T>, region: Region, x: usize, y: usize) -> DVec2 {
    region.place((picture.width(), picture.height()), x, y) / DVec2::new(VIEW.0 as f64, VIEW.1 as f64)
}

fn scalar_error(picture: &Picture<f32>, region: Region, known: fn(DVec2) -> f32) -> f32 {
    let places = (0..picture.height()).flat_map(|y| (0..picture.width()).map(move |x| (x, y)));
    places.map(|(x, y)| (picture.get(x, y) - known(place(picture, region, x, y))).abs()).fold(0.0, f32::max)
}

fn read(adapter: &Adapter, folder: &Path) -> (Estimate, Region) {
    let estimate = adapter.read(folder, SCENE).unwrap();
    let region = estimate.region("a", VIEW).unwrap();
    (estimate, region)
}

#[test]
fn every_adapter_finds_the_material_in_the_files_of_its_method() {
    let scripts = scripts();
    for name in Adapter::names() {
        assert!(scripts.iter().any(|script| script.adapter == name), "{name}");
    }
    for script in &scripts {
        let name = script.adapter;
        let folder = tempfile::tempdir().unwrap();
        script.write(folder.path());
        let adapter = Adapter::find(name).unwrap();
        let (estimate, region) = read(&adapter, folder.path());
        let is_known = !script.files.iter().any(|file| matches!(file.content, Content::Scaled(_)));
        // A byte of a power of 2.2 is up to 0.009 wide, and JPEG rounds further: up to 0.035.
        let error = color_error(&estimate, region, is_known);
        assert!(error < 0.04, "{name}: base colour is off by {error}");
        let scalars = script.files.iter().map(|file| file.content);
        let has_scalars = scalars.into_iter().any(|content| matches!(content, Content::Roughness | Content::Packed));
        assert_eq!((estimate.roughness.is_some(), estimate.metallic.is_some()), (has_scalars, has_scalars), "{name}");
        if let (Some(a), Some(b)) = (&estimate.roughness, &estimate.metallic) {
            let errors = [scalar_error(a, region, roughness), scalar_error(b, region, metallic)];
            assert!(errors.into_iter().all(|error| error < 0.04), "{name}: {errors:?}");
        }
        // Twin: with every other encoding that is far from the method's, the base colour is off.
        for &other in StoredEncoding::ALL {
            let mut wrong = adapter.clone();
            let file = wrong.base_color.as_mut().unwrap();
            if (file.encoding == StoredEncoding::Linear) == (other == StoredEncoding::Linear) {
                continue;
            }
            file.encoding = other;
            let (estimate, region) = read(&wrong, folder.path());
            let error = color_error(&estimate, region, is_known);
            assert!(error > 0.1, "{name} read as {other}: base colour is off by {error} only");
        }
    }
}

/// A method that resizes is not a method that crops: with the other rule the material lies elsewhere, or is refused.
#[test]
fn the_rule_of_placement_matters() {
    let mut seen = 0;
    for script in scripts().into_iter().filter(|script| script.size.0 * VIEW.1 != script.size.1 * VIEW.0) {
        let folder = tempfile::tempdir().unwrap();
        script.write(folder.path());
        let mut adapter = Adapter::find(script.adapter).unwrap();
        if adapter.placement == Placement::Whole {
            continue;
        }
        seen += 1;
        let is_known = !script.files.iter().any(|file| matches!(file.content, Content::Scaled(_)));
        let (estimate, region) = read(&adapter, folder.path());
        let error = color_error(&estimate, region, is_known);
        let other = if script.is_cropped { Placement::Stretched } else { Placement::CentreCrop };
        adapter.placement = other;
        let (estimate, region) = read(&adapter, folder.path());
        let wrong = color_error(&estimate, region, is_known);
        let stretch = (script.size.0 * VIEW.1) as f64 / (script.size.1 * VIEW.0) as f64;
        if (stretch - 1.0).abs() > 0.1 {
            assert!(wrong > error + 0.05, "{}: {error} {wrong}", script.adapter);
        }
        // Whole pictures have the view's proportions.
        let is_whole = Placement::Whole.region(script.size, VIEW).is_some();
        assert_eq!(is_whole, (stretch - 1.0).abs() <= 0.05, "{}", script.adapter);
    }
    assert_eq!(seen, 8);
}

/// Encodings that the authors do not state are marked, and no others.
#[test]
fn encodings_that_are_not_stated_are_marked() {
    let marked = |name: &str| Adapter::find(name).unwrap().assumed_encodings().len();
    let counts: Vec<(&str, usize)> = Adapter::names().iter().map(|name| (*name, marked(name))).collect();
    let expected = [("crefnet", 1), ("diffusion-renderer", 3), ("dnf-intrinsic", 3), ("iid", 3), ("mvinverse", 3)];
    assert_eq!(counts.into_iter().filter(|(_, count)| *count > 0).collect::<Vec<_>>(), expected);
}

/// Floats from 0 to 255 are not taken for linear values; with the range that the error names they are read.
#[test]
fn numbers_of_another_range_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let picture = Picture::from_fn(VIEW.0, VIEW.1, |x, y| LinearRgb([x as f32 / 2.0, y as f32 / 2.0, 128.0]));
    write_linear(&folder.path().join("living.exr"), &picture, Precision::Float).unwrap();
    let file = folder.path().join("floats.toml");
    let read = |range: &str| {
        let text =
            format!("name = \"floats\"\n[base_color]\nfiles = [\"{{scene}}.exr\"]\nencoding = \"linear\"\n{range}");
        std::fs::write(&file, text).unwrap();
        Adapter::find(file.to_str().unwrap()).unwrap().read(folder.path(), SCENE)
    };
    let refused = read("").unwrap_err().to_string();
    assert!(refused.contains("128") && refused.contains("range = [0, 255]"), "{refused}");
    let blue = read("range = [0, 255]\n").unwrap().base_color.unwrap().get(0, 0).0[2];
    assert!((blue - 128.0 / 255.0).abs() < 1e-6, "{blue}");
}
