//! Compares pictures of light, RGB and each light group: by tiles, and by their means.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Mask, Picture};

use super::bounds::{GROUP_SUM, NOISE_OVER_BOUND, PICTURE_MEAN, STANDARD_ERRORS};
use super::file::{Check, LightComparison, MeanDifference, Quantity, State, TilesApart, TilesCompared, WorstTile};
use super::kind::MaterialKind;
use super::theirs::file_check;
use super::tiles::{Difference, Halves, Tile, allowance, difference, median, tiles};

/// The tiles of a view with the kinds of material that they show, and the pixels that count.
pub(super) struct ShownKinds {
    /// Each tile with the last kind, in the order of [`MaterialKind`], that it shows; none where it shows only background.
    tiles: Vec<(Tile, Option<MaterialKind>)>,
    /// Pixels whose mean is compared, and to which differences are relative: the valid pixels of the tiles that decide, or all
    /// of their pixels where none is valid. Lamps, sky and glass are not valid. A window that fills a tenth of the picture
    /// would otherwise dominate the mean, and no error within the room would be large in proportion to it.
    counted: Vec<(usize, usize)>,
}

impl ShownKinds {
    /// `kinds[k - 1]` is the kind of instance k. An index beyond the list, which no sound dataset contains, has no kind.
    pub(super) fn new(instance: &Picture<u16>, kinds: &[MaterialKind], valid: &Mask) -> Self {
        let kind_at = |x: usize, y: usize| kinds.get(usize::from(instance.get(x, y)).checked_sub(1)?).copied();
        let of = |tile: &Tile| tile.pixels().filter_map(|(x, y)| kind_at(x, y)).max();
        let tiles = tiles(instance.width(), instance.height());
        let tiles = tiles.into_iter().map(|tile| (tile.clone(), of(&tile))).collect();
        let mut shown = Self { tiles, counted: Vec::new() };
        let deciding: Vec<(usize, usize)> = shown.deciding().into_iter().flat_map(Tile::pixels).collect();
        shown.counted = deciding.iter().copied().filter(|&(x, y)| valid.get(x, y)).collect();
        if shown.counted.is_empty() {
            shown.counted = deciding;
        }
        shown
    }

    /// The pixels whose mean is compared, and to which differences are relative.
    pub(super) fn counted(&self) -> &[(usize, usize)] {
        &self.counted
    }

    /// Every tile, and whether it decides.
    pub(super) fn all(&self) -> impl Iterator<Item = (&Tile, bool)> {
        self.tiles.iter().map(|(tile, kind)| (tile, kind.is_none_or(MaterialKind::decides)))
    }

    fn deciding(&self) -> Vec<&Tile> {
        self.all().filter(|(_, decides)| *decides).map(|(tile, _)| tile).collect()
    }

    fn apart(&self) -> BTreeMap<MaterialKind, Vec<&Tile>> {
        let mut apart: BTreeMap<MaterialKind, Vec<&Tile>> = BTreeMap::new();
        for (tile, kind) in &self.tiles {
            if let Some(kind) = kind.filter(|kind| !kind.decides()) {
                apart.entry(kind).or_default().push(tile);
            }
        }
        apart
    }
}

/// Compares one picture of both renderers. Returns two checks, of its tiles and of its mean, and the measurements behind
/// them.
pub(super) fn compare(
    picture: &str,
    light: Option<String>,
    [ours, theirs]: [&Halves; 2],
    kinds: &ShownKinds,
    bound: f64,
) -> (LightComparison, [Check; 2]) {
    let means = [ours.means(&kinds.counted), theirs.means(&kinds.counted)];
    let scale = means[0];
    let deciding = kinds.deciding();
    let off: Vec<Difference> = deciding.iter().map(|tile| difference(ours, theirs, tile.pixels())).collect();
    let mean = difference(ours, theirs, kinds.counted.iter().copied());
    let tiles = compare_tiles(&deciding, &off, bound, scale);
    let apart = kinds.apart().into_iter().map(|(kind, tiles)| {
        let off: Vec<Difference> = tiles.iter().map(|tile| difference(ours, theirs, tile.pixels())).collect();
        apart_tiles(kind, &off, bound, scale)
    });
    let found = LightComparison {
        picture: picture.to_owned(),
        light,
        means,
        mean: (!deciding.is_empty()).then(|| relative(&mean, PICTURE_MEAN, scale)),
        tiles,
        apart: apart.collect(),
    };
    let checks = [tile_check(picture, &tiles, bound), mean_check(picture, &mean, scale, kinds.counted.len())];
    (found, checks)
}

fn compare_tiles(tiles: &[&Tile], off: &[Difference], bound: f64, scale: [f64; 3]) -> TilesCompared {
    let (allowed, expected_by_noise) = allowance(off, bound, scale);
    let excess = |off: &Difference| off.excess(bound, scale).into_iter().fold(0.0, f64::max);
    let worst = tiles.iter().zip(off).max_by(|a, b| excess(a.1).total_cmp(&excess(b.1)));
    TilesCompared {
        count: tiles.len(),
        over: off.iter().filter(|off| off.is_over(bound, scale)).count(),
        allowed,
        expected_by_noise,
        median: median(off.iter().filter_map(|off| largest(off, scale)).map(f64::abs).collect()),
        noise: median(off.iter().filter_map(|off| off.noise(bound, scale)).collect()),
        worst: worst.map(|(tile, off)| WorstTile {
            x: tile.columns.start,
            y: tile.rows.start,
            off: relative(off, bound, scale),
        }),
    }
}

fn apart_tiles(kind: MaterialKind, off: &[Difference], bound: f64, scale: [f64; 3]) -> TilesApart {
    let differences: Vec<f64> = off.iter().filter_map(|off| largest(off, scale)).collect();
    TilesApart {
        kind,
        count: off.len(),
        over: off.iter().filter(|off| off.is_over(bound, scale)).count(),
        median: median(differences.iter().map(|off| off.abs()).collect()),
        largest: differences.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())),
    }
}

/// The largest relative difference of any channel; none in a black picture.
fn largest(off: &Difference, scale: [f64; 3]) -> Option<f64> {
    let channels = (0..3).filter(|c| scale[*c] > 0.0).map(|c| off.mean[c] / scale[c]);
    channels.max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

fn relative(off: &Difference, bound: f64, scale: [f64; 3]) -> MeanDifference {
    let channel = off.worst_channel(bound, scale);
    let of = |value: f64| (scale[channel] > 0.0).then(|| value / scale[channel]);
    // Where both are black the difference is 0; where only ours is black it cannot be expressed as a share.
    let is_black = off.mean[channel] == 0.0 && off.error[channel] == 0.0;
    let of = |value: f64| if is_black { Some(0.0) } else { of(value) };
    MeanDifference { channel, difference: of(off.mean[channel]), standard_error: of(off.error[channel]) }
}

fn tile_check(picture: &str, tiles: &TilesCompared, bound: f64) -> Check {
    let noisy = tiles.noise.is_some_and(|noise| noise > NOISE_OVER_BOUND);
    let state = match () {
        () if tiles.count == 0 => State::Undecided,
        () if tiles.over > tiles.allowed => State::Differs,
        () if noisy => State::TooNoisy,
        () => State::Agrees,
    };
    let message = match state {
        State::Undecided => "no tile is free of materials that are known to differ".to_owned(),
        State::TooNoisy => format!(
            "three standard errors of a tile are {:.1} times the bound of {}; render with more samples",
            tiles.noise.unwrap_or_default(),
            percent(bound),
        ),
        _ => format!(
            "{} of {} tiles are off by more than {} of the mean plus {STANDARD_ERRORS} standard errors, expected at most {}{}",
            tiles.over,
            tiles.count,
            percent(bound),
            tiles.allowed,
            tiles.worst.filter(|_| state == State::Differs).map_or(String::new(), |worst| worst_text(&worst)),
        ),
    };
    let count = |number: usize| (tiles.count > 0).then_some(number as f64);
    Check {
        picture: picture.to_owned(),
        quantity: Quantity::TilesOver,
        state,
        measured: count(tiles.over),
        bound: count(tiles.allowed),
        count: tiles.count,
        message,
    }
}

fn worst_text(worst: &WorstTile) -> String {
    let (x, y) = (worst.x, worst.y);
    match worst.off.difference {
        Some(off) => format!("; the worst tile, at ({x}, {y}), is off by {:+.1} %", 100.0 * off),
        None => format!("; the worst tile, at ({x}, {y}), is black only in the built-in tracer's picture"),
    }
}

fn mean_check(picture: &str, mean: &Difference, scale: [f64; 3], pixels: usize) -> Check {
    let noisy = mean.noise(PICTURE_MEAN, scale).is_some_and(|noise| noise > NOISE_OVER_BOUND);
    let state = match () {
        () if pixels == 0 => State::Undecided,
        () if mean.is_over(PICTURE_MEAN, scale) => State::Differs,
        () if noisy => State::TooNoisy,
        () => State::Agrees,
    };
    let worst = relative(mean, PICTURE_MEAN, scale);
    let bound = worst.standard_error.map(|error| PICTURE_MEAN + STANDARD_ERRORS * error);
    let message = match (worst.difference, bound) {
        _ if state == State::Undecided => "no tile is free of materials that are known to differ".to_owned(),
        (Some(off), Some(bound)) => {
            let hint = if state == State::TooNoisy { "; render with more samples" } else { "" };
            let error = worst.standard_error.map_or(0.0, |error| 100.0 * error);
            format!(
                "the mean is off by {:+.2} %, expected at most {:.2} %, which includes three standard errors of {error:.2} %{hint}",
                100.0 * off,
                100.0 * bound,
            )
        }
        _ => "the built-in tracer's picture is black, the other is not".to_owned(),
    };
    let quantity = Quantity::MeanDifference;
    let (measured, bound) = if pixels > 0 { (worst.difference, bound) } else { (None, None) };
    Check { picture: picture.to_owned(), quantity, state, measured, bound, count: pixels, message }
}

/// A check that differs where both halves are the same picture and not black: their difference then says nothing about the
/// noise.
pub(super) fn same_halves(picture: &str, halves: &Halves) -> Option<Check> {
    let is_black = |pixel: &LinearRgb| pixel.0 == [0.0; 3];
    let same = halves.a == halves.b && !halves.a.pixels().iter().all(is_black);
    let message = "both halves are the same, pixel by pixel; render them with two seeds".to_owned();
    same.then(|| file_check(picture, State::Differs, message))
}

/// Whether the light groups of a half sum to it. A pixel's difference is relative to the pixel, since rounding grows with
/// the value, or to the half's mean where the pixel is darker, since there rounding grows with the samples added up.
pub(super) fn sum_check(picture: &str, half: &Picture<LinearRgb>, groups: &[&Picture<LinearRgb>]) -> Check {
    let values = half.pixels().iter().flat_map(|pixel| pixel.0).map(f64::from);
    let mean = values.sum::<f64>() / (3 * half.pixels().len().max(1)) as f64;
    let mut largest = (0.0_f64, 0_usize);
    for (at, pixel) in half.pixels().iter().enumerate() {
        for c in 0..3 {
            let sum: f64 = groups.iter().map(|group| f64::from(group.pixels()[at].0[c])).sum();
            let value = f64::from(pixel.0[c]);
            let off = (sum - value).abs() / value.abs().max(mean).max(f64::MIN_POSITIVE);
            if off > largest.0 {
                largest = (off, at);
            }
        }
    }
    let (off, at) = largest;
    let (x, y) = (at % half.width().max(1), at / half.width().max(1));
    let agrees = off <= GROUP_SUM;
    let place = if agrees { String::new() } else { format!(", at pixel ({x}, {y})") };
    let message = format!(
        "the sum of {} groups differs by {off:.1e} of a pixel, expected at most {GROUP_SUM:.0e}{place}",
        groups.len()
    );
    Check {
        picture: picture.to_owned(),
        quantity: Quantity::GroupSum,
        state: if agrees { State::Agrees } else { State::Differs },
        measured: Some(off),
        bound: Some(GROUP_SUM),
        count: half.pixels().len(),
        message,
    }
}

fn percent(share: f64) -> String {
    format!("{} %", 100.0 * share)
}
