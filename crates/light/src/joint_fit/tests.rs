//! Three lights over four parts, of which everything is known.

use mateval_tracer::LightBasis;

use super::*;

const SIZE: [usize; 2] = [64, 48];
const RADIANCES: [[f64; 3]; 3] = [[2.0, 1.8, 1.5], [0.5, 0.5, 0.4], [6.0, 5.0, 4.0]];
const COLORS: [[f64; 3]; 4] = [[0.8, 0.7, 0.6], [0.3, 0.5, 0.2], [0.1, 0.1, 0.1], [0.5, 0.2, 0.6]];

fn grey(value: impl Fn(f64, f64) -> f64) -> Picture<LinearRgb> {
    let [width, height] = SIZE;
    Picture::from_fn(width, height, |x, y| {
        LinearRgb([value((x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64) as f32; 3])
    })
}

/// Lights near three places, and light that the photo holds, which grows to the right.
fn split() -> SplitLight {
    let near = |at: [f64; 2]| grey(move |x, y| 0.3 / (0.1 + (x - at[0]).powi(2) + (y - at[1]).powi(2)));
    let diffuse = vec![near([0.1, 0.2]), near([0.9, 0.3]), near([0.5, 0.9]), grey(|x, _| 0.3 + 0.8 * x)];
    let gloss = diffuse.iter().map(|picture| picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| 0.04 * v)))).collect();
    let basis = |pictures| LightBasis::new(SIZE[0], SIZE[1], pictures).unwrap();
    SplitLight { diffuse: basis(diffuse), gloss: basis(gloss) }
}

/// Quarters of the picture.
fn parts() -> Picture<u16> {
    Picture::from_fn(SIZE[0], SIZE[1], |x, y| u16::from(x >= SIZE[0] / 2) + 2 * u16::from(y >= SIZE[1] / 2))
}

fn photo(split: &SplitLight) -> Picture<LinearRgb> {
    let weights: Vec<[f64; 3]> = RADIANCES.into_iter().chain([[1.0; 3]]).collect();
    let [diffuse, gloss] = [&split.diffuse, &split.gloss].map(|basis| basis.weighted(&weights).unwrap());
    let parts = parts();
    Picture::from_fn(SIZE[0], SIZE[1], |x, y| {
        let color = COLORS[usize::from(parts.get(x, y))];
        LinearRgb([0, 1, 2].map(|c| color[c] as f32 * diffuse.get(x, y).0[c] + gloss.get(x, y).0[c]))
    })
}

/// Priors too weak to move exact data.
fn rules() -> JointFitRules {
    JointFitRules { color_prior: 1e-5, light_prior: 1e-5, light_color_prior: 1e-5, ..Default::default() }
}

fn fitted(photo: &Picture<LinearRgb>, shown: &[Option<[f64; 3]>]) -> JointFit {
    fitted_under(&rules(), photo, shown)
}

fn fitted_under(rules: &JointFitRules, photo: &Picture<LinearRgb>, shown: &[Option<[f64; 3]>]) -> JointFit {
    let (light, valid, parts) = ([split()], photo.map(|_| true), parts());
    fit_jointly(rules, &JointTarget { photo, valid: &valid, parts: &parts, light: &light, shown })
}

/// The largest error of radiances and of colours, as shares.
fn errors(fit: &JointFit) -> [f64; 2] {
    let largest = |pairs: Vec<(f64, f64)>| pairs.iter().map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
    let flat = |values: &[[f64; 3]]| values.iter().flatten().copied().collect::<Vec<_>>();
    let colors: Vec<[f64; 3]> = fit.colors.values().copied().collect();
    let pairs = |found: &[[f64; 3]], truth: &[[f64; 3]]| flat(found).into_iter().zip(flat(truth)).collect();
    [largest(pairs(&fit.radiances, &RADIANCES)), largest(pairs(&colors, &COLORS))]
}

/// The scale of exact data is that of the light which the photo holds, whatever colours are usual.
#[test]
fn radiances_and_colours_are_separated() {
    let fit = fitted(&photo(&split()), &[]);
    let [radiances, colors] = errors(&fit);
    assert!(radiances < 1e-3 && colors < 1e-3, "{radiances} {colors}");
}

/// Squares here and there, an eighth of the picture, that are five times as bright as all lights explain.
#[test]
fn outliers_count_little() {
    let plain = photo(&split());
    let photo = Picture::from_fn(SIZE[0], SIZE[1], |x, y| {
        let factor = if (x / 8 + 3 * (y / 8)) % 8 == 0 { 5.0 } else { 1.0 };
        LinearRgb(plain.get(x, y).0.map(|v| factor * v))
    });
    // The usual colour holds the scale, to which the outliers' light would be a hint.
    let rules = JointFitRules { color_prior: 1.0, ..rules() };
    let [before, after] = [&plain, &photo].map(|photo| fitted_under(&rules, photo, &[]).colors);
    for (part, color) in &before {
        let ratios = [0, 1, 2].map(|c| after[part][c] / color[c]);
        assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.3), "part {part}: {ratios:?}");
    }
}

/// What the photo shows of a light counts, even where it is wrong.
#[test]
fn a_shown_radiance_is_kept() {
    let shown = [None, Some([1.0; 3]), None];
    let fit = fitted(&photo(&split()), &shown);
    assert!(fit.radiances[1].iter().all(|v| (v - 1.0).abs() < 0.05), "{:?}", fit.radiances);
}

/// Nothing to fit, and lights that light nothing: finite radiances, and no colour where nothing is lit.
#[test]
fn a_black_photo_and_dark_lights_have_finite_radiances() {
    let black = photo(&split()).map(|_| LinearRgb::default());
    let fit = fitted(&black, &[]);
    assert!(fit.radiances.iter().flatten().all(|v| v.is_finite() && *v > 0.0) && fit.colors.is_empty());

    let dark = LightBasis::new(SIZE[0], SIZE[1], vec![grey(|_, _| 0.0); 4]).unwrap();
    let light = [SplitLight { diffuse: dark.clone(), gloss: dark }];
    let (photo, parts) = (photo(&split()), parts());
    let valid = photo.map(|_| true);
    let target = JointTarget { photo: &photo, valid: &valid, parts: &parts, light: &light, shown: &[] };
    let fit = fit_jointly(&JointFitRules::default(), &target);
    assert!(fit.radiances.iter().flatten().all(|v| v.is_finite()) && fit.colors.is_empty());
}
