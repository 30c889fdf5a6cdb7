//! The metrics agree with scikit-image and with the LPIPS authors' code, on small generated pictures and, where the
//! shared data exist, on real ones.
//!
//! LPIPS needs its weights in MatEval's cache folder. A test whose input is missing is skipped, or
//! fails (`mateval_testkit::data`).
#![allow(clippy::unwrap_used, clippy::print_stderr)] // tests may; deviations are printed

use std::path::Path;

use mateval_image::{Mask, Picture, SrgbRgb};
use mateval_metrics::mask_rule::{MaskRule, ReferenceFeatures};
use mateval_metrics::{Lpips, Net, Psnr, mse, ssim, ssim_black_fill, ssim_valid_windows};
use mateval_testkit::{lpips_weights, shared_data};
use serde::Deserialize;

/// Number of generated cases; all have a mask.
const MADE_CASES: usize = 10;
/// Number of cases of the shared data.
const SHARED_CASES: usize = 12;
/// Number of cases of the shared data with a mask.
const SHARED_MASKED_CASES: usize = 10;
/// Relative tolerance.
const MSE_TOLERANCE: f64 = 1e-9;
/// Relative tolerance for pictures that were rounded to `f32`.
const ROUNDED_MSE_TOLERANCE: f64 = 1e-7;
const SSIM_TOLERANCE: f64 = 1e-6;
const LPIPS_TOLERANCE: f64 = 2e-5;

#[derive(Deserialize)]
struct Expected {
    cases: Vec<Case>,
}

/// A pair of pictures and its values. The pairs of the LPIPS authors have no mask and no values but those of LPIPS.
#[derive(Deserialize)]
struct Case {
    reference: String,
    prediction: String,
    mask: Option<String>,
    mse: Option<f64>,
    psnr: Option<f64>,
    ssim: Option<f64>,
    lpips_alex: f64,
    lpips_vgg: f64,
    masked_mse: Option<f64>,
    masked_psnr: Option<f64>,
    masked_ssim_valid_windows: Option<f64>,
    valid_windows: Option<usize>,
    blackfill_ssim: Option<f64>,
    blackfill_lpips_alex: Option<f64>,
    blackfill_lpips_vgg: Option<f64>,
    masked_lpips_alex: Option<f64>,
    masked_lpips_vgg: Option<f64>,
}

/// A case with its pictures.
struct Loaded {
    case: Case,
    prediction: Picture<SrgbRgb>,
    reference: Picture<SrgbRgb>,
    mask: Option<Mask>,
}

/// The generated cases and those of the shared data; the latter are empty if they are skipped.
fn load_cases() -> Vec<Loaded> {
    let mut cases = vectors::load();
    assert_eq!(cases.len(), MADE_CASES);
    cases.extend(load_shared_cases());
    cases
}

fn load_shared_cases() -> Vec<Loaded> {
    let Some(path) = shared_data("metrics/expected.json") else { return Vec::new() };
    let expected: Expected = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    assert_eq!(expected.cases.len(), SHARED_CASES);
    assert_eq!(expected.cases.iter().filter(|case| case.mask.is_some()).count(), SHARED_MASKED_CASES);
    let folder = path.parent().unwrap();
    expected.cases.into_iter().map(|case| load_case(folder, case)).collect()
}

fn count_masked(cases: &[Loaded]) -> usize {
    cases.iter().filter(|loaded| loaded.mask.is_some()).count()
}

fn load_case(folder: &Path, case: Case) -> Loaded {
    let picture =
        |name: &String| read_png(&folder.join(name), |channels| SrgbRgb([channels[0], channels[1], channels[2]]));
    Loaded {
        prediction: picture(&case.prediction),
        reference: picture(&case.reference),
        mask: case.mask.as_ref().map(|name| read_png(&folder.join(name), |channels| channels[0] > 0.5)),
        case,
    }
}

/// An 8-bit PNG, its bytes divided by 255.
fn read_png<T: Copy>(path: &Path, pixel: impl Fn(&[f32]) -> T) -> Picture<T> {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut decoder = png::Decoder::new(file);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!(info.bit_depth, png::BitDepth::Eight);
    let values: Vec<f32> = bytes.iter().map(|&byte| f32::from(byte) / 255.0).collect();
    let pixels = values.chunks(info.color_type.samples()).map(pixel).collect();
    Picture::new(info.width as usize, info.height as usize, pixels).unwrap()
}

/// The network; none where its weights are missing and not required.
fn load_lpips(net: Net) -> Option<Lpips> {
    let lpips = Lpips::load(net, &lpips_weights(net.file_name())?).unwrap();
    assert_eq!((lpips.net(), lpips.sha256()), (net, net.expected_sha256()));
    Some(lpips)
}

/// Compares values, and keeps the largest deviation and the number of values.
struct Check {
    what: &'static str,
    tolerance: f64,
    largest: f64,
    seen: usize,
}

impl Check {
    fn new(what: &'static str, tolerance: f64) -> Self {
        Self { what, tolerance, largest: 0.0, seen: 0 }
    }

    fn value(&mut self, name: &str, found: f64, expected: f64) {
        self.deviation(name, (found - expected).abs());
    }

    fn relative(&mut self, name: &str, found: f64, expected: f64) {
        self.deviation(name, (found / expected - 1.0).abs());
    }

    fn deviation(&mut self, name: &str, deviation: f64) {
        assert!(deviation <= self.tolerance, "{} of {name} is off by {deviation:e}", self.what);
        self.largest = self.largest.max(deviation);
        self.seen += 1;
    }

    fn finish(self, expected: usize) {
        eprintln!("{}: {} values, largest deviation {:.2e}", self.what, self.seen, self.largest);
        assert_eq!(self.seen, expected);
    }
}

/// The expected values come from value/255 in `f64`, which a picture of `f32` rounds by up to 3e-8. So the metric
/// itself is tested on integers, which `f32` holds exactly, and its result is divided by 255².
#[test]
fn mse_and_psnr_of_whole_numbers() {
    check_mse_and_psnr(MSE_TOLERANCE, |value| (value * 255.0).round(), |mse| mse / (255.0 * 255.0));
}

/// Pictures are scored as value/255 in `f32`; the wider tolerance allows for that rounding only.
#[test]
fn mse_and_psnr_of_values_in_f32() {
    check_mse_and_psnr(ROUNDED_MSE_TOLERANCE, |value| value, |mse| mse);
}

fn check_mse_and_psnr(tolerance: f64, value: impl Fn(f32) -> f32, unit: impl Fn(f64) -> f64) {
    let cases = load_cases();
    let (mut mses, mut psnrs) = (Check::new("mse", tolerance), Check::new("psnr", tolerance));
    for Loaded { case, prediction, reference, mask } in cases.iter().filter(|loaded| loaded.mask.is_some()) {
        let change = |picture: &Picture<SrgbRgb>| picture.map(|SrgbRgb(rgb)| SrgbRgb(rgb.map(&value)));
        let (prediction, reference) = (change(prediction), change(reference));
        let whole = unit(mse(&prediction, &reference, None).unwrap().unwrap());
        let masked = unit(mse(&prediction, &reference, mask.as_ref()).unwrap().unwrap());
        mses.relative(&case.prediction, whole, case.mse.unwrap());
        mses.relative(&case.prediction, masked, case.masked_mse.unwrap());
        psnrs.relative(&case.prediction, Psnr::from_mse(whole).unwrap().db, case.psnr.unwrap());
        psnrs.relative(&case.prediction, Psnr::from_mse(masked).unwrap().db, case.masked_psnr.unwrap());
        // The twin: a missing mask is detected.
        assert!((whole / case.masked_mse.unwrap() - 1.0).abs() > tolerance);
    }
    mses.finish(2 * count_masked(&cases));
    psnrs.finish(2 * count_masked(&cases));
}

#[test]
fn ssim_by_all_three_rules() {
    let cases = load_cases();
    let mut check = Check::new("ssim", SSIM_TOLERANCE);
    for Loaded { case, prediction, reference, mask } in &cases {
        let Some(mask) = mask else { continue };
        let whole = ssim(prediction, reference).unwrap();
        let black_fill = ssim_black_fill(prediction, reference, mask).unwrap().unwrap();
        let valid = ssim_valid_windows(prediction, reference, mask).unwrap().unwrap();
        check.value(&case.prediction, whole, case.ssim.unwrap());
        check.value(&case.prediction, black_fill, case.blackfill_ssim.unwrap());
        check.value(&case.prediction, valid.ssim, case.masked_ssim_valid_windows.unwrap());
        assert_eq!(valid.windows, case.valid_windows.unwrap());
        // The twin: the wrong mask rule is detected.
        assert!((whole - case.blackfill_ssim.unwrap()).abs() > SSIM_TOLERANCE);
        assert!((black_fill - case.masked_ssim_valid_windows.unwrap()).abs() > SSIM_TOLERANCE);
    }
    check.finish(3 * count_masked(&cases));
}

#[test]
fn lpips_alex() {
    check_lpips(Net::Alex, |case| (case.lpips_alex, case.blackfill_lpips_alex, case.masked_lpips_alex));
}

#[test]
fn lpips_vgg() {
    check_lpips(Net::Vgg, |case| (case.lpips_vgg, case.blackfill_lpips_vgg, case.masked_lpips_vgg));
}

fn check_lpips(net: Net, expected: impl Fn(&Case) -> (f64, Option<f64>, Option<f64>)) {
    let Some(lpips) = load_lpips(net) else { return };
    let mut cases = load_cases();
    if net == Net::Vgg {
        // A second per picture: every third of the cases, which include each size and a mask.
        cases = cases.into_iter().step_by(3).collect();
    }
    let mut check = Check::new(net.key(), LPIPS_TOLERANCE);
    for Loaded { case, prediction, reference, mask } in &cases {
        let (whole, black_fill, masked) = expected(case);
        check.value(&case.prediction, lpips.whole(prediction, reference).unwrap(), whole);
        let Some(mask) = mask else { continue };
        let found = MaskRule::BlackFill
            .lpips(&lpips, prediction, reference, &ReferenceFeatures::default(), mask)
            .unwrap()
            .unwrap();
        check.value(&case.prediction, found, black_fill.unwrap());
        // The file's value also counts what spills out of the mask; unit tests hold the definition.
        let (found, spilt) = (
            MaskRule::Inside
                .lpips(&lpips, prediction, reference, &ReferenceFeatures::default(), mask)
                .unwrap()
                .unwrap(),
            masked.unwrap(),
        );
        assert!(found > 0.1 * spilt && found < spilt + LPIPS_TOLERANCE, "{}: {found} {spilt}", case.prediction);
    }
    check.finish(cases.len() + count_masked(&cases));
    // The twin: channels in the wrong order are detected.
    let swap = |picture: &Picture<SrgbRgb>| picture.map(|SrgbRgb([r, g, b])| SrgbRgb([b, g, r]));
    let Loaded { case, prediction, reference, .. } = &cases[0];
    let swapped = lpips.whole(&swap(prediction), &swap(reference)).unwrap();
    assert!((swapped - expected(case).0).abs() > LPIPS_TOLERANCE);
}

/// One thread and two threads give the same bits with the real weights.
#[test]
fn the_thread_count_changes_no_bit_of_lpips() {
    let Some(lpips) = load_lpips(Net::Alex) else { return };
    let Loaded { prediction, reference, .. } = &vectors::load()[0];
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| lpips.whole(prediction, reference).unwrap().to_bits())
    };
    assert_eq!(with(1), with(2));
}

/// Small pictures made from integers, and the values that scikit-image and lpips compute for them: `vectors.json`,
/// which `make_vectors.py` writes from the same pictures.
mod vectors {
    use mateval_dataset::splitmix64::number;
    use mateval_files::untrusted::sha256_of_bytes;
    use mateval_image::{Mask, Picture, SrgbRgb};
    use serde::Deserialize;

    use super::{Case, Loaded};

    type Bytes = Picture<[u8; 3]>;

    #[derive(Deserialize)]
    struct Vectors {
        cases: Vec<Vector>,
    }

    #[derive(Deserialize)]
    struct Vector {
        /// SHA-256 of the bytes of prediction, reference and mask (0 and 1).
        sha256: [String; 3],
        #[serde(flatten)]
        case: Case,
    }

    /// All cases with their pictures, whose bytes equal those of the script.
    pub fn load() -> Vec<Loaded> {
        let vectors: Vectors = serde_json::from_str(include_str!("vectors/vectors.json")).unwrap();
        vectors.cases.into_iter().map(loaded).collect()
    }

    fn loaded(Vector { sha256, case }: Vector) -> Loaded {
        let reference = reference(&case.reference);
        let prediction = predicted(&reference, &case.prediction);
        let mask = mask(reference.width(), reference.height());
        let bits: Vec<u8> = mask.pixels().iter().map(|counts| u8::from(*counts)).collect();
        let bytes = [prediction.pixels().as_flattened(), reference.pixels().as_flattened(), &bits];
        assert_eq!(
            bytes.map(sha256_of_bytes),
            sha256,
            "{} {}: not the script's pictures",
            case.reference,
            case.prediction
        );
        let encoded = |picture: &Bytes| picture.map(|rgb| SrgbRgb(rgb.map(|byte| f32::from(byte) / 255.0)));
        Loaded { prediction: encoded(&prediction), reference: encoded(&reference), mask: Some(mask), case }
    }

    fn picture(width: usize, height: usize, value: impl Fn(usize, usize, usize) -> u64) -> Bytes {
        Picture::from_fn(width, height, |x, y| [0, 1, 2].map(|c| u8::try_from(value(x, y, c)).unwrap()))
    }

    fn reference(name: &str) -> Bytes {
        match name {
            "tiles" => picture(80, 72, tiles),
            "waves" => picture(64, 67, waves),
            other => panic!("no picture '{other}'"),
        }
    }

    /// Flat tiles with a gradient and a fine grain.
    fn tiles(x: usize, y: usize, c: usize) -> u64 {
        let tile = (y / 9) * 16 + x / 10;
        let [flat, grain] = [number(7, (3 * tile + c) as u64) % 200, number(8, ((y * 128 + x) * 3 + c) as u64) % 16];
        flat + (3 * x as u64 + 2 * y as u64) % 40 + grain
    }

    /// Slanted waves, slightly shifted in each channel.
    fn waves(x: usize, y: usize, c: usize) -> u64 {
        (2 * triangle_wave(3 * x + 2 * y, 64 + 8 * c) + triangle_wave(5 * y + 2 * x, 37)) / 3
    }

    /// 0 to 255 and back over `period`.
    fn triangle_wave(at: usize, period: usize) -> u64 {
        let within = at % period;
        (within.min(period - within) * 510 / period) as u64
    }

    /// The reference with errors as a method might make them.
    fn predicted(reference: &Bytes, kind: &str) -> Bytes {
        let (width, height) = (reference.width(), reference.height());
        let clamped = |at: usize, by: i64, side: usize| (at as i64 + by).clamp(0, side as i64 - 1) as usize;
        let at = |x, y, c: usize, dx, dy| u64::from(reference.get(clamped(x, dx, width), clamped(y, dy, height))[c]);
        let noise = |x, y, c| number(9, ((y * 128 + x) * 3 + c) as u64) % 81;
        let around = || (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
        match kind {
            "noise" => {
                picture(width, height, |x, y, c| (at(x, y, c, 0, 0) + noise(x, y, c)).saturating_sub(40).min(255))
            }
            "shift" => picture(width, height, |x, y, c| at(x, y, c, -3, 2)),
            "blur" => picture(width, height, |x, y, c| around().map(|(dx, dy)| at(x, y, c, dx, dy)).sum::<u64>() / 9),
            "darker" => picture(width, height, |x, y, c| at(x, y, c, 0, 0) * (2 + c as u64) / 5),
            "grey" => Picture::filled(width, height, [128; 3]),
            other => panic!("no prediction '{other}'"),
        }
    }

    /// A disc and a bar.
    fn mask(width: usize, height: usize) -> Mask {
        let from_centre = |at: usize, side: usize| at.abs_diff(side / 2).pow(2);
        Picture::from_fn(width, height, |x, y| {
            from_centre(x, width) + from_centre(y, height) < 30 * 30 || (3..17).contains(&x)
        })
    }
}
