//! Compares pictures of light, RGB and each light group: by tiles, and by their means.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Mask, Picture};

use super::file::{
    BOUNDS, Check, LightComparison, MaterialKind, MeanDifference, Quantity, SamplesToDecide, State, TilesApart,
    TilesCompared, WorstTile, file_check,
};
use super::tiles::{Difference, Halves, Tile, Tolerance, allowance, difference, median, raise_errors, tiles};

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

    /// Every tile, and whether it decides.
    pub(super) fn all(&self) -> impl Iterator<Item = (&Tile, bool)> {
        self.tiles.iter().map(|(tile, kind)| (tile, kind.is_none_or(MaterialKind::decides)))
    }

    fn deciding(&self) -> Vec<&Tile> {
        self.all().filter(|(_, decides)| *decides).map(|(tile, _)| tile).collect()
    }

    /// The difference of every tile, in the order of [`Self::all`], with errors that suit the light of the tiles that
    /// decide.
    pub(super) fn differences(&self, [ours, theirs]: [&Halves; 2]) -> Vec<Difference> {
        let tiles = || self.tiles.iter().map(|(tile, _)| tile);
        let mut off: Vec<Difference> = tiles().map(|tile| difference(ours, theirs, tile.pixels())).collect();
        let means: Vec<[f64; 3]> = tiles().map(|tile| ours.means(&tile.pixels().collect::<Vec<_>>())).collect();
        let decides: Vec<bool> = self.all().map(|(_, decides)| decides).collect();
        raise_errors(&mut off, &means, &decides);
        off
    }

    /// Of the differences of all tiles those of tiles that do not decide, by kind.
    fn apart(&self, all: &[Difference]) -> BTreeMap<MaterialKind, Vec<Difference>> {
        let mut apart: BTreeMap<MaterialKind, Vec<Difference>> = BTreeMap::new();
        for ((_, kind), off) in self.tiles.iter().zip(all) {
            if let Some(kind) = kind.filter(|kind| !kind.decides()) {
                apart.entry(kind).or_default().push(*off);
            }
        }
        apart
    }
}

/// Compares one picture of both renderers, whose halves have these samples per pixel. Returns two checks, of its tiles
/// and of its mean, and the measurements behind them.
pub(super) fn compare(
    picture: &str,
    light: Option<String>,
    [ours, theirs]: [&Halves; 2],
    samples: SamplesToDecide,
    kinds: &ShownKinds,
    bound: f64,
) -> (LightComparison, [Check; 2]) {
    let means = [ours.means(&kinds.counted), theirs.means(&kinds.counted)];
    let (scale, of_tile) = (means[0], Tolerance::of_tile(bound));
    let deciding = kinds.deciding();
    let all = kinds.differences([ours, theirs]);
    let off: Vec<Difference> =
        kinds.all().zip(&all).filter(|((_, decides), _)| *decides).map(|(_, off)| *off).collect();
    let mean = difference(ours, theirs, kinds.counted.iter().copied());
    let tiles = compare_tiles(&deciding, &off, of_tile, scale);
    let apart = kinds.apart(&all).into_iter().map(|(kind, off)| apart_tiles(kind, &off, of_tile, scale));
    let found = LightComparison {
        picture: picture.to_owned(),
        light,
        means,
        mean: (!deciding.is_empty()).then(|| relative(&mean, Tolerance::PICTURE, scale)),
        tiles,
        apart: apart.collect(),
    };
    let of_tiles = || tiles_to_decide(&off, of_tile, scale, samples);
    let checks = [tile_check(picture, &tiles, bound, of_tiles), mean_check(picture, &mean, scale, kinds, samples)];
    (found, checks.map(|check| with_enough(check, samples)))
}

/// The check, or that it decides nothing because a picture has too few samples.
fn with_enough(check: Check, samples: SamplesToDecide) -> Check {
    let least = BOUNDS.least_samples;
    let SamplesToDecide { ours, theirs } = samples;
    if check.state == State::Undecided || ours.min(theirs) >= least {
        return check;
    }
    let message = format!(
        "{ours} and {theirs} samples per pixel of each half, the built-in tracer's first; expected at least {least}, since \
         fewer do not state how noisy a picture is"
    );
    let to_decide = Some(SamplesToDecide { ours: ours.max(least), theirs: theirs.max(least) });
    Check { state: State::TooFew, measured: None, bound: None, to_decide, message, ..check }
}

fn compare_tiles(tiles: &[&Tile], off: &[Difference], allowed: Tolerance, scale: [f64; 3]) -> TilesCompared {
    let (most, expected_by_noise) = allowance(off, allowed, scale);
    let excess = |off: &Difference| off.excess(allowed, scale).into_iter().fold(0.0, f64::max);
    let worst = tiles.iter().zip(off).max_by(|a, b| excess(a.1).total_cmp(&excess(b.1)));
    TilesCompared {
        count: tiles.len(),
        over: off.iter().filter(|off| off.is_over(allowed, scale)).count(),
        allowed: most,
        expected_by_noise,
        median: median(off.iter().filter_map(|off| largest(off, scale)).map(f64::abs).collect()),
        open: off.iter().filter(|off| hides(off, allowed, scale)).count(),
        noise: median(off.iter().filter_map(|off| off.noise(allowed.bound, scale)).collect()),
        worst: worst.map(|(tile, off)| WorstTile {
            x: tile.columns.start,
            y: tile.rows.start,
            off: relative(off, allowed, scale),
        }),
    }
}

/// Whether a tile may hide a fault: it is within the bound, but too noisy to state that it has none.
fn hides(off: &Difference, allowed: Tolerance, scale: [f64; 3]) -> bool {
    !off.is_over(allowed, scale) && off.is_open(allowed, scale)
}

/// The number of tiles that may hide a fault where the check agrees.
fn most_open(tiles: usize) -> usize {
    (BOUNDS.tile_share_open * tiles as f64) as usize
}

/// The samples with which enough tiles would be decided to decide the check. The tiles that need the least are first.
fn tiles_to_decide(
    off: &[Difference],
    allowed: Tolerance,
    scale: [f64; 3],
    samples: SamplesToDecide,
) -> Option<SamplesToDecide> {
    let open = off.iter().filter(|off| hides(off, allowed, scale));
    let mut needed: Vec<SamplesToDecide> = open.clone().filter_map(|o| o.to_decide(allowed, scale, samples)).collect();
    needed.sort_by_key(|needed| (needed.theirs, needed.ours));
    let wanted = open.count().checked_sub(most_open(off.len()))?;
    let decided = needed.get(..wanted).filter(|decided| !decided.is_empty())?;
    let most = |of: fn(&SamplesToDecide) -> u32| decided.iter().map(of).max().unwrap_or_default();
    Some(SamplesToDecide { ours: most(|needed| needed.ours), theirs: most(|needed| needed.theirs) })
}

fn apart_tiles(kind: MaterialKind, off: &[Difference], allowed: Tolerance, scale: [f64; 3]) -> TilesApart {
    let differences: Vec<f64> = off.iter().filter_map(|off| largest(off, scale)).collect();
    TilesApart {
        kind,
        count: off.len(),
        over: off.iter().filter(|off| off.is_over(allowed, scale)).count(),
        median: median(differences.iter().map(|off| off.abs()).collect()),
        largest: differences.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())),
    }
}

/// The largest relative difference of any channel; none in a black picture.
fn largest(off: &Difference, scale: [f64; 3]) -> Option<f64> {
    let channels = (0..3).filter(|c| scale[*c] > 0.0).map(|c| off.mean[c] / scale[c]);
    channels.max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

fn relative(off: &Difference, allowed: Tolerance, scale: [f64; 3]) -> MeanDifference {
    let channel = off.worst_channel(allowed, scale);
    let of = |value: f64| (scale[channel] > 0.0).then(|| value / scale[channel]);
    // Where both are black the difference is 0; where only ours is black it cannot be expressed as a share.
    let is_black = off.mean[channel] == 0.0 && off.error[channel] == 0.0;
    let of = |value: f64| if is_black { Some(0.0) } else { of(value) };
    MeanDifference { channel, difference: of(off.mean[channel]), standard_error: of(off.error[channel]) }
}

fn tile_check(
    picture: &str,
    tiles: &TilesCompared,
    bound: f64,
    to_decide: impl FnOnce() -> Option<SamplesToDecide>,
) -> Check {
    let state = match () {
        () if tiles.count == 0 => State::Undecided,
        () if tiles.over > tiles.allowed => State::Differs,
        () if tiles.open > most_open(tiles.count) => State::TooNoisy,
        () => State::Agrees,
    };
    let message = match state {
        State::Undecided => "no tile is free of materials that are known to differ".to_owned(),
        State::TooNoisy => format!(
            "{} of {} tiles are so noisy that a fault of {} of the mean may hide in them, expected at most {}; three \
             standard errors of a tile are {:.1} times the bound of {}",
            tiles.open,
            tiles.count,
            percent(BOUNDS.tile_fault * bound),
            most_open(tiles.count),
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
        to_decide: if state == State::TooNoisy { to_decide() } else { None },
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

fn mean_check(
    picture: &str,
    mean: &Difference,
    scale: [f64; 3],
    kinds: &ShownKinds,
    samples: SamplesToDecide,
) -> Check {
    let (pixels, allowed) = (kinds.counted.len(), Tolerance::PICTURE);
    let state = match () {
        () if pixels == 0 => State::Undecided,
        () if mean.is_over(allowed, scale) => State::Differs,
        () if mean.is_open(allowed, scale) => State::TooNoisy,
        () => State::Agrees,
    };
    let worst = relative(mean, allowed, scale);
    let bound = worst.standard_error.map(|error| allowed.bound + allowed.errors * error);
    let message = match (worst.difference, worst.standard_error) {
        _ if state == State::Undecided => "no tile is free of materials that are known to differ".to_owned(),
        (Some(off), Some(error)) if state == State::TooNoisy => format!(
            "the mean is off by {:+.2} %, with a standard error of {:.2} %, so that a fault of {} may hide",
            100.0 * off,
            100.0 * error,
            percent(allowed.fault),
        ),
        (Some(off), Some(error)) => format!(
            "the mean is off by {:+.2} %, expected at most {} and {} standard errors of {:.2} %",
            100.0 * off,
            percent(allowed.bound),
            allowed.errors,
            100.0 * error,
        ),
        _ => "the built-in tracer's picture is black, the other is not".to_owned(),
    };
    let (measured, bound) = if pixels > 0 { (worst.difference, bound) } else { (None, None) };
    let to_decide = (state == State::TooNoisy).then(|| mean.to_decide(allowed, scale, samples)).flatten();
    let quantity = Quantity::MeanDifference;
    Check { picture: picture.to_owned(), quantity, state, measured, bound, count: pixels, to_decide, message }
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
        to_decide: None,
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

    /// Enough samples for a verdict; how noisy pictures are is stated by each test.
    const SAMPLES: SamplesToDecide = SamplesToDecide { ours: 64, theirs: 64 };

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

    fn checks(ours: &Halves, theirs: &Halves) -> [Check; 2] {
        compare("rgb", None, [ours, theirs], SAMPLES, &all_lambert(), BOUNDS.lambert_tile).1
    }

    fn states(ours: &Halves, theirs: &Halves) -> [State; 2] {
        checks(ours, theirs).map(|check| check.state)
    }

    /// The standard error computed from the halves equals the spread of 400 draws within 10 %, in a tile and over the
    /// picture.
    #[test]
    fn the_standard_error_is_the_spread() {
        let all = tiles(SIZE.0, SIZE.1);
        let pixels = [&all[..1], &all[..]].map(|tiles| tiles.iter().flat_map(|tile| tile.pixels()).collect::<Vec<_>>());
        let mut drawn = [Vec::new(), Vec::new()];
        for k in 0..400 {
            let (ours, theirs) = (plain(2 * k, 0.3), plain(2 * k + 1, 0.3));
            for (drawn, pixels) in drawn.iter_mut().zip(&pixels) {
                drawn.push(difference(&ours, &theirs, pixels.iter().copied()));
            }
        }
        for drawn in drawn {
            let spread = (drawn.iter().map(|d| d.mean[1] * d.mean[1]).sum::<f64>() / 400.0).sqrt();
            let estimated = (drawn.iter().map(|d| d.error[1] * d.error[1]).sum::<f64>() / 400.0).sqrt();
            assert!((spread / estimated - 1.0).abs() < 0.1, "{spread} {estimated}");
        }
    }

    /// Pure noise, 1000 pictures at each of four levels: three standard errors of a tile at 1, 2, 8 and 20 times the
    /// bound. By design at most one picture in 10,000 counts as different by its tiles, and one in 5,000 by its mean: 3
    /// in 1000 would have a probability of 1e-3. At the first two levels every picture agrees otherwise, and at the last
    /// two none does by its tiles.
    #[test]
    #[allow(clippy::print_stderr, reason = "shows how close the counts are to their limits")]
    fn noise_alone_rarely_counts_as_a_difference() {
        for (noise, is_noisy) in [(0.05, false), (0.1, false), (0.4, true), (1.0, true)] {
            let mut counts = BTreeMap::new();
            for draw in 0..1000 {
                let [tiles, mean] = states(&plain(2 * draw, noise), &plain(2 * draw + 1, noise));
                for (name, state) in [("tiles", tiles), ("mean", mean)] {
                    *counts.entry((name, state.word())).or_insert(0) += 1;
                }
            }
            eprintln!("noise {noise}: {counts:?}");
            let count = |name, state: State| counts.get(&(name, state.word())).copied().unwrap_or(0);
            let wrong = ["tiles", "mean"].map(|name| count(name, State::Differs));
            assert!(wrong.iter().all(|wrong| *wrong < 3), "{noise}: {counts:?}");
            let expected = if is_noisy { State::TooNoisy } else { State::Agrees };
            assert_eq!(count("tiles", expected), 1000 - wrong[0], "{noise}: {counts:?}");
        }
    }

    /// A light that is 3 % too bright never agrees, however noisy the pictures are: it differs, or nothing is decided.
    /// With little noise it differs. The twins, equal lights, never differ.
    #[test]
    fn noise_hides_no_light_of_another_strength() {
        for (noise, is_decided) in [(0.05, true), (0.2, true), (0.4, false), (0.7, false), (1.5, false)] {
            for draw in 0..200 {
                let ours = plain(2 * draw, noise);
                let [_, wrong] = states(&ours, &halves(2 * draw + 1, noise, |_, _| 1.03));
                let [_, right] = states(&ours, &plain(2 * draw + 1, noise));
                assert_ne!(wrong, State::Agrees, "{noise} {draw}");
                assert_ne!(right, State::Differs, "{noise} {draw}");
                assert!(!is_decided || (wrong, right) == (State::Differs, State::Agrees), "{noise} {draw}");
            }
        }
    }

    /// Halves of mean 1 whose pixels are black but for this share of them.
    fn rare(seed: u64, share: f64) -> Halves {
        let half = |half: u64| {
            Picture::from_fn(SIZE.0, SIZE.1, |x, y| {
                let at = ((seed * 2 + half) * SIZE.1 as u64 + y as u64) * SIZE.0 as u64 + x as u64;
                let draw = (splitmix64::number(1, at) >> 11) as f64 / (1_u64 << 53) as f64;
                LinearRgb([if draw < share { (1.0 / share) as f32 } else { 0.0 }; 3])
            })
        };
        Halves { a: half(0), b: half(1) }
    }

    /// Ten rare bright paths a tile: tiles that got few are dark and look precise, which is no difference. The twin, a
    /// third of the picture without light, is one.
    #[test]
    fn rare_paths_are_no_difference() {
        for draw in 0..100 {
            let ours = rare(2 * draw, 0.9);
            assert_ne!(states(&ours, &rare(2 * draw + 1, 0.02))[0], State::Differs, "{draw}");
            let Halves { mut a, mut b } = rare(2 * draw + 1, 0.1);
            for (x, y) in (0..32).flat_map(|x| (0..SIZE.1).map(move |y| (x, y))) {
                a.set(x, y, LinearRgb::default());
                b.set(x, y, LinearRgb::default());
            }
            assert_eq!(states(&ours, &Halves { a, b })[0], State::Differs, "{draw}");
        }
    }

    /// Looking again and again while samples are added, and stopping at the first verdict, finds the fault and no other:
    /// of 200 pictures at most one that is right differs and at most one that is wrong agrees.
    #[test]
    fn many_looks_lead_to_the_same_verdict() {
        let verdict = |draw: u64, factor: f64| {
            let theirs = halves(1_000_000 + draw, 0.2, |_, _| factor);
            (0..8).find_map(|look| {
                let noise = 1.5 / f64::from(1 << look).sqrt();
                let [_, mean] = states(&plain(8 * draw + look, noise), &theirs);
                (!mean.is_open()).then_some(mean)
            })
        };
        for (factor, expected) in [(1.0, State::Agrees), (1.03, State::Differs)] {
            let verdicts: Vec<_> = (0..200).map(|draw| verdict(draw, factor)).collect();
            let right = verdicts.iter().filter(|verdict| **verdict == Some(expected)).count();
            assert!(right >= 199, "{factor}: {right} of 200");
        }
    }

    /// The samples that would decide: the noise falls as they say, and most pictures are then decided. Where ours alone
    /// are noisy, more of ours are enough; where theirs are, none of ours would do.
    #[test]
    fn stated_samples_decide() {
        for (own, other) in [(0.8, 0.8), (0.8, 0.05), (0.05, 0.8)] {
            let (mut open, mut decided) = (0, 0);
            for draw in 0..40 {
                let first = checks(&plain(4 * draw, own), &plain(4 * draw + 1, other));
                for (at, check) in first.iter().enumerate().filter(|(_, check)| check.state == State::TooNoisy) {
                    let needed = check.to_decide.expect("some number of samples decides");
                    assert!(needed.ours >= SAMPLES.ours && needed.theirs >= SAMPLES.theirs, "{needed:?}");
                    assert!((needed.theirs > SAMPLES.theirs) == (other > 0.1), "{own} {other}: {needed:?}");
                    let with = |noise: f64, before: u32, now: u32| noise * (f64::from(before) / f64::from(now)).sqrt();
                    let own = with(own, SAMPLES.ours, needed.ours);
                    let other = with(other, SAMPLES.theirs, needed.theirs);
                    let then = states(&plain(4 * draw + 2, own), &plain(4 * draw + 3, other))[at];
                    open += 1;
                    decided += usize::from(!then.is_open());
                }
            }
            assert!(open >= 40 && 3 * decided >= 2 * open, "{own} {other}: {decided} of {open}");
        }
    }

    /// Fewer than 16 samples decide nothing, not even that the pictures differ; the twin of 16 does.
    #[test]
    fn a_least_number_of_samples() {
        let with = |ours, theirs| {
            let pictures = [&plain(1, 0.05), &halves(2, 0.05, |_, _| 1.5)];
            let samples = SamplesToDecide { ours, theirs };
            compare("rgb", None, pictures, samples, &all_lambert(), BOUNDS.lambert_tile).1
        };
        for (ours, theirs) in [(64, 15), (15, 64)] {
            for check in with(ours, theirs) {
                assert_eq!((check.state, check.measured), (State::TooFew, None), "{check}");
                assert_eq!(check.to_decide, Some(SamplesToDecide { ours: ours.max(16), theirs: theirs.max(16) }));
            }
        }
        assert_eq!(with(16, 16).map(|check| check.state), [State::Differs; 2]);
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
            let (_, checks) = compare("rgb", None, [&ours, &theirs], SAMPLES, &shown, BOUNDS.lambert_tile);
            checks.map(|check| check.state)
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
        let (found, checks) = compare("rgb", None, [&plain(1, 0.01), &theirs], SAMPLES, &shown, BOUNDS.lambert_tile);
        assert_eq!(checks.map(|check| check.state), [State::Agrees; 2]);
        let apart: Vec<_> = found.apart.iter().map(|apart| (apart.kind, apart.count, apart.over)).collect();
        assert_eq!(apart, [(MaterialKind::Conductor, 10, 0), (MaterialKind::Dielectric, 10, 10)]);
        assert_eq!(found.tiles.count, 10);
        assert!(found.apart[1].largest.is_some_and(|off| off > 0.2), "{:?}", found.apart);
        // The twin: where the same tiles count, the pictures differ.
        assert_eq!(states(&plain(1, 0.01), &theirs), [State::Differs; 2]);
        // Where no tile counts, the state is `undecided`.
        let glass = ShownKinds::new(&Picture::filled(SIZE.0, SIZE.1, 3), &kinds, &all_valid());
        let (_, checks) = compare("rgb", None, [&plain(1, 0.01), &theirs], SAMPLES, &glass, BOUNDS.lambert_tile);
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
