//! Compares pictures of light, RGB and each light group: by tiles, and by their means.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Mask, Picture};

use super::file::{
    BOUNDS, Check, LightComparison, MaterialKind, MeanDifference, Quantity, State, TilesApart, TilesCompared,
    WorstTile, file_check,
};
use super::tiles::{Difference, Halves, Tile, allowance, difference, median, tiles};

/// The tiles of a view with the kinds of material that they show, and the pixels that count.
pub(super) struct ShownKinds {
    /// Each tile with the last kind, in the order of [`MaterialKind`], that it shows; absent if it shows only
    /// background.
    tiles: Vec<(Tile, Option<MaterialKind>)>,
    /// Pixels whose mean is compared, and to which differences are relative: the valid pixels of the tiles that decide,
    /// or all of their pixels where none is valid. Lamps, sky and glass are not valid. A window that fills a tenth of
    /// the picture would otherwise dominate the mean, and no error within the room would be large in proportion to it.
    counted: Vec<(usize, usize)>,
}

impl ShownKinds {
    /// `kinds[k - 1]` is the kind of instance k. An index beyond the list, which no sound dataset contains, has no
    /// kind.
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

/// Compares one picture of both renderers. Returns two checks, of its tiles and of its mean, and the measurements
/// behind them.
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
        mean: (!deciding.is_empty()).then(|| relative(&mean, BOUNDS.picture_mean, scale)),
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
    let noisy = tiles.noise.is_some_and(|noise| noise > BOUNDS.noise_over_bound);
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
            "{} of {} tiles are off by more than {} of the mean plus {} standard errors, expected at most {}{}",
            tiles.over,
            tiles.count,
            percent(bound),
            BOUNDS.standard_errors,
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
    let noisy = mean.noise(BOUNDS.picture_mean, scale).is_some_and(|noise| noise > BOUNDS.noise_over_bound);
    let state = match () {
        () if pixels == 0 => State::Undecided,
        () if mean.is_over(BOUNDS.picture_mean, scale) => State::Differs,
        () if noisy => State::TooNoisy,
        () => State::Agrees,
    };
    let worst = relative(mean, BOUNDS.picture_mean, scale);
    let bound = worst.standard_error.map(|error| BOUNDS.picture_mean + BOUNDS.standard_errors * error);
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

/// A check that differs where both halves are the same picture and not black: their difference then says nothing about
/// the noise.
pub(super) fn same_halves(picture: &str, halves: &Halves) -> Option<Check> {
    let is_black = |pixel: &LinearRgb| pixel.0 == [0.0; 3];
    let same = halves.a == halves.b && !halves.a.pixels().iter().all(is_black);
    let message = "both halves are the same, pixel by pixel; render them with two seeds".to_owned();
    same.then(|| file_check(picture, State::Differs, message))
}

/// Whether the light groups of a half sum to it. A pixel's difference is relative to the pixel, since rounding grows
/// with the value, or to the half's mean where the pixel is darker, since there rounding grows with the samples added
/// up.
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
    let agrees = off <= BOUNDS.group_sum;
    let place = if agrees { String::new() } else { format!(", at pixel ({x}, {y})") };
    let message = format!(
        "the sum of {} groups differs by {off:.1e} of a pixel, expected at most {:.0e}{place}",
        groups.len(),
        BOUNDS.group_sum
    );
    Check {
        picture: picture.to_owned(),
        quantity: Quantity::GroupSum,
        state: if agrees { State::Agrees } else { State::Differs },
        measured: Some(off),
        bound: Some(BOUNDS.group_sum),
        count: half.pixels().len(),
        message,
    }
}

fn percent(share: f64) -> String {
    format!("{} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mateval_dataset::splitmix64;

    const SIZE: (usize, usize) = (96, 72);

    /// A deviate of mean 0 and variance 1, one-sided and long-tailed as light is: the exponential distribution minus 1.
    fn deviate(seed: u64) -> f64 {
        -libm::log((splitmix64::number(0, seed) >> 11) as f64 / (1_u64 << 53) as f64 + 1e-300) - 1.0
    }

    /// Two halves of a gradient with relative noise of this standard deviation per pixel; `factor` scales the expected
    /// value.
    fn halves(seed: u64, noise: f64, factor: impl Fn(usize, usize) -> f64) -> Halves {
        let half = |half: u64| {
            Picture::from_fn(SIZE.0, SIZE.1, |x, y| {
                let level = (0.2 + x as f64 / 96.0 + (y % 7) as f64 / 10.0) * factor(x, y);
                let at = (((seed * 2 + half) * SIZE.1 as u64 + y as u64) * SIZE.0 as u64 + x as u64) * 4;
                LinearRgb([0, 1, 2].map(|c| (level * (1.0 + noise * deviate(at + c))) as f32))
            })
        };
        Halves { a: half(0), b: half(1) }
    }

    fn plain(seed: u64, noise: f64) -> Halves {
        halves(seed, noise, |_, _| 1.0)
    }

    fn all_valid() -> Mask {
        Picture::filled(SIZE.0, SIZE.1, true)
    }

    fn all_lambert() -> ShownKinds {
        ShownKinds::new(&Picture::filled(SIZE.0, SIZE.1, 1), &[MaterialKind::Lambert], &all_valid())
    }

    fn states(ours: &Halves, theirs: &Halves) -> [State; 2] {
        let (_, checks) = compare("rgb", None, [ours, theirs], &all_lambert(), BOUNDS.lambert_tile);
        checks.map(|check| check.state)
    }

    /// The standard error computed from the halves equals the spread of 400 draws within 10 %, in a tile and over the
    /// picture.
    #[test]
    fn the_standard_error_is_the_spread() {
        let all = tiles(SIZE.0, SIZE.1);
        for tiles in [&all[..1], &all[..]] {
            let pixels: Vec<_> = tiles.iter().flat_map(|tile| tile.pixels()).collect();
            let drawn: Vec<_> =
                (0..400).map(|k| difference(&plain(2 * k, 0.3), &plain(2 * k + 1, 0.3), pixels.clone())).collect();
            let spread = (drawn.iter().map(|d| d.mean[1] * d.mean[1]).sum::<f64>() / 400.0).sqrt();
            let estimated = (drawn.iter().map(|d| d.error[1] * d.error[1]).sum::<f64>() / 400.0).sqrt();
            assert!((spread / estimated - 1.0).abs() < 0.1, "{spread} {estimated}");
        }
    }

    /// Pure noise, 1000 pictures at each of three levels: three standard errors of a tile at 1, 4 and 20 times the
    /// bound. By design at most one picture in 1000 counts as different by its tiles (5 in 1000 would have a
    /// probability of 6e-4). By its mean, 8 in 1000 do where the bound is negligible: three channels at three standard
    /// errors. Allowing only 1 % of the tiles, which is none of 30, would give 21 false alarms at the second level.
    #[test]
    #[allow(clippy::print_stderr, reason = "shows how close the counts are to their limits")]
    fn noise_alone_rarely_counts_as_a_difference() {
        for (noise, most_by_mean, is_noisy) in [(0.05, 0, false), (0.2, 0, false), (1.0, 20, true)] {
            let (mut by_tiles, mut by_mean, mut noisy, mut by_share_alone) = (0, 0, 0, 0);
            for draw in 0..1000 {
                let (ours, theirs) = (plain(2 * draw, noise), plain(2 * draw + 1, noise));
                let (found, checks) = compare("rgb", None, [&ours, &theirs], &all_lambert(), BOUNDS.lambert_tile);
                let [tiles, mean] = checks.map(|check| check.state);
                by_tiles += usize::from(tiles == State::Differs);
                by_mean += usize::from(mean == State::Differs);
                noisy += usize::from(tiles == State::TooNoisy);
                by_share_alone += usize::from(found.tiles.over as f64 > 0.01 * found.tiles.count as f64);
            }
            eprintln!(
                "noise {noise}: {by_tiles} by tiles ({by_share_alone} by 1 % of tiles alone), {by_mean} by the mean, {noisy} too noisy"
            );
            assert!(by_tiles <= 5 && by_mean <= most_by_mean, "{noise}: {by_tiles} {by_mean}");
            assert_eq!(noisy, if is_noisy { 1000 - by_tiles } else { 0 }, "{noise}");
        }
    }

    /// An error of 3 % everywhere is found, and one of 8 % in one tile of 30, where 1 % of the tiles is none. The
    /// twins, errors of 0.3 % and 1 %, agree.
    #[test]
    fn planted_differences_are_found() {
        for draw in 0..100 {
            let ours = plain(2 * draw, 0.05);
            let states_at = |factor: &dyn Fn(usize, usize) -> f64| states(&ours, &halves(2 * draw + 1, 0.05, factor));
            let tile = |x: usize, y: usize| x / 16 == 2 && y / 16 == 3;
            assert_eq!(states_at(&|_, _| 1.03)[1], State::Differs, "{draw}");
            assert_eq!(states_at(&|x, y| if tile(x, y) { 1.08 } else { 1.0 })[0], State::Differs, "{draw}");
            assert_eq!(states_at(&|_, _| 1.003), [State::Agrees; 2], "{draw}");
            assert_eq!(states_at(&|x, y| if tile(x, y) { 1.01 } else { 1.0 }), [State::Agrees; 2], "{draw}");
        }
    }

    #[test]
    fn a_very_noisy_picture_can_only_differ() {
        let (ours, theirs) = (plain(1, 1.5), plain(2, 1.5));
        assert_eq!(states(&ours, &theirs)[0], State::TooNoisy);
        assert_eq!(states(&ours, &halves(2, 1.5, |_, _| 2.0)), [State::Differs; 2]);
        // Equal pictures without any noise agree.
        assert_eq!(states(&plain(1, 0.0), &plain(2, 0.0)), [State::Agrees; 2]);
    }

    /// A window fills a tenth of the picture and is a hundred times brighter than the room. An error of 3 % in the
    /// room's light is found, since the window is not valid and does not contribute to the mean.
    #[test]
    fn a_bright_window_hides_nothing() {
        let is_window = |x: usize, y: usize| x < 32 && y < 24;
        let bright = |room: f64| move |x: usize, y: usize| if is_window(x, y) { 100.0 } else { room };
        let (ours, theirs) = (halves(1, 0.01, bright(1.0)), halves(2, 0.01, bright(1.03)));
        let valid = Picture::from_fn(SIZE.0, SIZE.1, |x, y| !is_window(x, y));
        let states = |valid: &Mask| {
            let shown = ShownKinds::new(&Picture::filled(SIZE.0, SIZE.1, 1), &[MaterialKind::Lambert], valid);
            compare("rgb", None, [&ours, &theirs], &shown, BOUNDS.lambert_tile).1.map(|check| check.state)
        };
        assert_eq!(states(&valid), [State::Differs; 2]);
        // The twin: relative to the mean of the whole picture the error is a third of a percent.
        assert_eq!(states(&all_valid()), [State::Agrees; 2]);
        // Where no pixel is valid, all pixels count.
        assert_eq!(states(&Picture::filled(SIZE.0, SIZE.1, false)), [State::Agrees; 2]);
    }

    #[test]
    fn black_is_black() {
        let black = || halves(1, 0.0, |_, _| 0.0);
        assert_eq!(states(&black(), &black()), [State::Agrees; 2]);
        assert_eq!(states(&black(), &plain(2, 0.1)), [State::Differs; 2]);
        assert_eq!(states(&plain(2, 0.1), &black()), [State::Differs; 2]);
        // Red alone: no difference is divided by the mean of green, which is 0.
        let red = |seed| {
            let Halves { a, b } = plain(seed, 0.1);
            let [a, b] = [a, b].map(|half| half.map(|LinearRgb([r, _, _])| LinearRgb([r, 0.0, 0.0])));
            Halves { a, b }
        };
        assert_eq!(states(&red(1), &red(2)), [State::Agrees; 2]);
        assert_eq!(states(&red(1), &plain(2, 0.1)), [State::Differs; 2]);
    }

    /// The left third shows glass, the middle a metal beside Lambert. These tiles do not count for the verdict,
    /// whatever they contain, and are reported apart.
    #[test]
    fn materials_that_are_known_to_differ_do_not_count() {
        let kinds = [MaterialKind::Lambert, MaterialKind::Conductor, MaterialKind::Dielectric];
        let instance = Picture::from_fn(SIZE.0, SIZE.1, |x, _| {
            if x < 32 {
                3
            } else if x % 16 == 0 && x < 64 {
                2
            } else {
                1
            }
        });
        let shown = ShownKinds::new(&instance, &kinds, &all_valid());
        let theirs = halves(2, 0.01, |x, _| if x < 32 { 1.5 } else { 1.0 });
        let (found, checks) = compare("rgb", None, [&plain(1, 0.01), &theirs], &shown, BOUNDS.lambert_tile);
        assert_eq!(checks.map(|check| check.state), [State::Agrees; 2]);
        let apart: Vec<_> = found.apart.iter().map(|apart| (apart.kind, apart.count, apart.over)).collect();
        assert_eq!(apart, [(MaterialKind::Conductor, 10, 0), (MaterialKind::Dielectric, 10, 10)]);
        assert_eq!(found.tiles.count, 10);
        assert!(found.apart[1].largest.is_some_and(|off| off > 0.2), "{:?}", found.apart);
        // The twin: where the same tiles count, the pictures differ.
        assert_eq!(states(&plain(1, 0.01), &theirs), [State::Differs; 2]);
        // Where no tile counts, the state is `undecided`.
        let glass = ShownKinds::new(&Picture::filled(SIZE.0, SIZE.1, 3), &kinds, &all_valid());
        let (_, checks) = compare("rgb", None, [&plain(1, 0.01), &theirs], &glass, BOUNDS.lambert_tile);
        assert_eq!(checks.map(|check| check.state), [State::Undecided; 2]);
    }

    /// Rounding passes in bright and in dark pixels; a larger difference does not.
    #[test]
    fn sums_of_groups() {
        let half = Picture::from_fn(8, 8, |x, y| LinearRgb([if x == 0 { 500.0 } else { 1e-4 * (y + 1) as f32 }; 3]));
        let part = |share: f32| half.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| share * v)));
        let (a, b) = (part(0.3), part(0.7));
        let check = sum_check("rgb_a", &half, &[&a, &b]);
        assert_eq!((check.state, check.quantity), (State::Agrees, Quantity::GroupSum));
        assert!(check.measured.is_some_and(|off| off < 1e-6), "{check}");
        assert_eq!(sum_check("rgb_a", &half, &[&a]).state, State::Differs);
        let off = |share: f32| sum_check("rgb_a", &half, &[&a, &part(0.7 + share)]).state;
        assert_eq!(
            [off(0.9 * BOUNDS.group_sum as f32), off(1.1 * BOUNDS.group_sum as f32)],
            [State::Agrees, State::Differs]
        );
    }

    /// Halves rendered with the same seed are reported; halves of two seeds, and black halves, are not.
    #[test]
    fn halves_of_one_seed() {
        let twice = |Halves { a, .. }: Halves| Halves { a: a.clone(), b: a };
        assert_eq!(same_halves("rgb", &twice(plain(1, 0.1))).map(|check| check.state), Some(State::Differs));
        assert_eq!(same_halves("rgb", &plain(1, 0.1)), None);
        assert_eq!(same_halves("rgb", &twice(halves(1, 0.1, |_, _| 0.0))), None);
    }
}
