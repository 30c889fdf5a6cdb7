//! Synthetic pictures: how often noise alone counts as a difference, which differences are found, how pictures are divided.

use mateval_image::{LinearRgb, Mask, Normal, Picture};
use mateval_scene::splitmix64;

use super::bounds::{GROUP_SUM, LAMBERT_TILE};
use super::file::{Quantity, State};
use super::kind::MaterialKind;
use super::light::{ShownKinds, compare, same_halves, sum_check};
use super::tiles::{Halves, difference, median, tiles};

const SIZE: (usize, usize) = (96, 72);

/// A deviate of mean 0 and variance 1, one-sided and long-tailed as light is: the exponential distribution minus 1.
fn deviate(seed: u64) -> f64 {
    -libm::log((splitmix64::number(0, seed) >> 11) as f64 / (1_u64 << 53) as f64 + 1e-300) - 1.0
}

/// Two halves of a gradient with relative noise of this standard deviation per pixel; `factor` scales the expected value.
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
    let (_, checks) = compare("rgb", None, [ours, theirs], &all_lambert(), LAMBERT_TILE);
    checks.map(|check| check.state)
}

#[test]
fn a_picture_is_divided_without_gaps_and_slivers() {
    for (width, height, expected) in
        [(96, 72, 30), (480, 270, 510), (103, 71, 24), (104, 72, 35), (5, 3, 1), (1, 40, 3)]
    {
        let tiles = tiles(width, height);
        assert_eq!(tiles.len(), expected, "{width}x{height}");
        let mut covered = vec![0; width * height];
        for tile in &tiles {
            assert!(tile.columns.len() >= width.min(8) && tile.rows.len() >= height.min(8), "{tile:?}");
            for (x, y) in tile.pixels() {
                covered[y * width + x] += 1;
            }
        }
        assert!(covered.iter().all(|count| *count == 1), "{width}x{height}");
    }
}

/// The standard error computed from the halves equals the spread of 400 draws within 10 %, in a tile and over the picture.
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

/// Pure noise, 1000 pictures at each of three levels: three standard errors of a tile at 1, 4 and 20 times the bound. By
/// design at most one picture in 1000 counts as different by its tiles (5 in 1000 would have a probability of 6e-4). By its
/// mean, 8 in 1000 do where the bound is negligible: three channels at three standard errors. Allowing only 1 % of the
/// tiles, which is none of 30, would give 21 false alarms at the second level.
#[test]
#[allow(clippy::print_stderr, reason = "shows how close the counts are to their limits")]
fn noise_alone_rarely_counts_as_a_difference() {
    for (noise, most_by_mean, is_noisy) in [(0.05, 0, false), (0.2, 0, false), (1.0, 20, true)] {
        let (mut by_tiles, mut by_mean, mut noisy, mut by_share_alone) = (0, 0, 0, 0);
        for draw in 0..1000 {
            let (ours, theirs) = (plain(2 * draw, noise), plain(2 * draw + 1, noise));
            let (found, checks) = compare("rgb", None, [&ours, &theirs], &all_lambert(), LAMBERT_TILE);
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

/// An error of 3 % everywhere is found, and one of 8 % in one tile of 30, where 1 % of the tiles is none. The twins, errors
/// of 0.3 % and 1 %, agree.
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

/// A window fills a tenth of the picture and is a hundred times brighter than the room. An error of 3 % in the room's light
/// is found, since the window is not valid and does not contribute to the mean.
#[test]
fn a_bright_window_hides_nothing() {
    let is_window = |x: usize, y: usize| x < 32 && y < 24;
    let bright = |room: f64| move |x: usize, y: usize| if is_window(x, y) { 100.0 } else { room };
    let (ours, theirs) = (halves(1, 0.01, bright(1.0)), halves(2, 0.01, bright(1.03)));
    let valid = Picture::from_fn(SIZE.0, SIZE.1, |x, y| !is_window(x, y));
    let states = |valid: &Mask| {
        let shown = ShownKinds::new(&Picture::filled(SIZE.0, SIZE.1, 1), &[MaterialKind::Lambert], valid);
        compare("rgb", None, [&ours, &theirs], &shown, LAMBERT_TILE).1.map(|check| check.state)
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

/// The left third shows glass, the middle a metal beside Lambert. These tiles do not count for the verdict, whatever they
/// contain, and are reported apart.
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
    let (found, checks) = compare("rgb", None, [&plain(1, 0.01), &theirs], &shown, LAMBERT_TILE);
    assert_eq!(checks.map(|check| check.state), [State::Agrees; 2]);
    let apart: Vec<_> = found.apart.iter().map(|apart| (apart.kind, apart.count, apart.over)).collect();
    assert_eq!(apart, [(MaterialKind::Conductor, 10, 0), (MaterialKind::Dielectric, 10, 10)]);
    assert_eq!(found.tiles.count, 10);
    assert!(found.apart[1].largest.is_some_and(|off| off > 0.2), "{:?}", found.apart);
    // The twin: where the same tiles count, the pictures differ.
    assert_eq!(states(&plain(1, 0.01), &theirs), [State::Differs; 2]);
    // Where no tile counts, the state is `undecided`.
    let glass = ShownKinds::new(&Picture::filled(SIZE.0, SIZE.1, 3), &kinds, &all_valid());
    let (_, checks) = compare("rgb", None, [&plain(1, 0.01), &theirs], &glass, LAMBERT_TILE);
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
    assert_eq!([off(0.9 * GROUP_SUM as f32), off(1.1 * GROUP_SUM as f32)], [State::Agrees, State::Differs]);
}

/// Halves rendered with the same seed are reported; halves of two seeds, and black halves, are not.
#[test]
fn halves_of_one_seed() {
    let twice = |Halves { a, .. }: Halves| Halves { a: a.clone(), b: a };
    assert_eq!(same_halves("rgb", &twice(plain(1, 0.1))).map(|check| check.state), Some(State::Differs));
    assert_eq!(same_halves("rgb", &plain(1, 0.1)), None);
    assert_eq!(same_halves("rgb", &twice(halves(1, 0.1, |_, _| 0.0))), None);
}

#[test]
fn medians_and_angles() {
    assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
    assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), Some(2.5));
    assert_eq!(median(Vec::new()), None);
    let angle = |a, b| super::geometry::angle_deg(Normal(a), Normal(b));
    assert!((angle([1.0, 0.0, 0.0], [1.0, 1.0, 0.0]) - 45.0).abs() < 1e-9);
    assert_eq!(angle([1.0, 0.0, 0.0], [0.0; 3]), 180.0);
}
