//! Starts of a fit: turn, sizes and shift of a periodic graph, from the waves of what is seen and the graph's own
//! waves.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::cells::cell_error;
use super::least_squares::project;
use super::model::{Layout, Model};
use super::waves::{Order, Signal, Wave, waves};
use super::{Point, extent, thinned};
use crate::graph::Settings;
use crate::noise::cell;

/// The number of its own waves that are kept.
const WAVES: usize = 8;

/// A graph that is ready to be fitted.
pub(super) struct Pattern {
    pub(super) model: Model,
    pub(super) layout: Layout,
    /// For a pattern of one length: for each value of its whole number, settings without a turn and their waves.
    pub(super) own: Vec<(Settings, Vec<Wave>)>,
}

impl Pattern {
    pub(super) fn new(model: Model, layout: Layout) -> Self {
        let own = match layout {
            Layout::Similar { length, whole } => own(&model, length, whole),
            Layout::Axes { .. } | Layout::Rows { .. } => Vec::new(),
        };
        Self { model, layout, own }
    }
}

fn own(model: &Model, length: &str, whole: Option<(&str, i32, i32)>) -> Vec<(Settings, Vec<Wave>)> {
    let start = model.with(&model.start(), &[("theta", 0.0)]);
    // Squares of strips have lines that are closer than their side.
    let across = if whole.is_some_and(|(name, ..)| name == "strips") { 6.0 } else { 20.0 };
    let side = across * model.slot(length).map_or(1.0, |at| start.numbers()[at]);
    let with_waves = |settings: Settings| {
        let found = waves(&model.shown(&settings, &scattered(side)), WAVES, Order::Power);
        (settings, found)
    };
    let Some((name, least, most)) = whole else { return vec![with_waves(start)] };
    (least..=most).map(|number| with_waves(model.with(&start, &[(name, f64::from(number))]))).collect()
}

/// Places scattered over a square.
fn scattered(side: f64) -> Vec<Point> {
    let place = |i: u32| Point {
        u: side * cell(f64::from(i) + 0.5, 0.5),
        v: side * cell(f64::from(i) + 0.5, 1.5),
        footprint: side / 160.0,
        albedo: [0.0; 3],
        weight: 1.0,
    };
    (0..3000).map(place).collect()
}

/// A start and the mean square that remains when its colours are fitted.
#[derive(Clone, Debug)]
pub(super) struct Start {
    pub(super) settings: Settings,
    pub(super) error: f64,
}

/// The points at which starts are judged.
const POINTS: usize = 560;

/// The points at which a graph's waves are measured: fewer would be noisy by what else is in the pattern.
const WAVE_POINTS: usize = 900;

/// The least share of the variance that a wave of the points must have in the graph too.
const LEAST_SHARE: f64 = 0.01;

/// How many settings whose waves agree best are judged by colours.
const AGREEING: usize = 56;

/// Settings whose turns in degrees, and whose lengths' logarithms, differ by less than this are the same.
const SAME: [f64; 2] = [0.1, 0.003];

/// How many shifts from row to row are tried.
const ROW_SHIFTS: usize = 4;

/// The best starts, best first.
pub(super) fn starts(pattern: &Pattern, points: &[Point], seen: &[Wave], most: usize) -> Vec<Start> {
    let (model, few) = (&pattern.model, thinned(points, POINTS));
    let basis = Basis::new(thinned(points, WAVE_POINTS), seen);
    let [width, height] = extent(points);
    let resolution = 1.0 / width.max(height).max(1e-9);
    let mut shifted: Vec<(f64, Settings)> = Vec::new();
    for settings in turned_and_scaled(pattern, seen, resolution) {
        let shifts = match pattern.layout {
            Layout::Rows { width, .. } => across_rows(model, &settings, width),
            _ => shifts(model, &settings, &basis, seen),
        };
        let at_shift = |[u, v]: [f64; 2]| model.with(&settings, &[("t_u", u), ("t_v", v)]);
        shifted.extend(shifts.into_iter().map(|(agreement, shift)| (agreement, at_shift(shift))));
    }
    // Only where waves agree are colours worth a look.
    shifted.sort_by(|a, b| b.0.total_cmp(&a.0));
    match pattern.layout {
        Layout::Rows { .. } => {}
        Layout::Similar { whole: Some(_), .. } => shifted.truncate(2 * AGREEING),
        _ => shifted.truncate(AGREEING),
    }
    let mut found: Vec<Start> = shifted.into_iter().map(|(_, settings)| judged(model, settings, &few)).collect();
    found.sort_by(|a, b| a.error.total_cmp(&b.error));
    found.truncate(most);
    found
}

/// A start by the error of its cells, if it has any; otherwise by that of its colours.
fn judged(model: &Model, mut settings: Settings, few: &[Point]) -> Start {
    let error = cell_error(model, &settings, few).unwrap_or_else(|| project(model, &mut settings, few));
    Start { settings, error }
}

fn turned_and_scaled(pattern: &Pattern, seen: &[Wave], resolution: f64) -> Vec<Settings> {
    match pattern.layout {
        Layout::Similar { length, .. } => {
            let of = |(start, own): &(Settings, Vec<Wave>)| similar(&pattern.model, length, start, own, seen);
            pattern.own.iter().flat_map(of).collect()
        }
        Layout::Rows { width, length, whole } => rows(&pattern.model, [width, length], whole, seen, resolution),
        Layout::Axes { u, v, periods, shift } => axes(&pattern.model, [u, v], periods, shift, seen, resolution),
    }
}

/// Matches each strong wave with each strong wave of the graph itself: the angle between them is the turn, and the
/// ratio of their periods the scale.
fn similar(model: &Model, length: &str, start: &Settings, own: &[Wave], seen: &[Wave]) -> Vec<Settings> {
    let (Some(length_at), Some(theta_at)) = (model.slot(length), model.slot("theta")) else { return Vec::new() };
    let is_same = |a: &Settings, b: &Settings| {
        let turn = (a.numbers()[theta_at] - b.numbers()[theta_at]).abs();
        turn < SAME[0] && libm::log(a.numbers()[length_at] / b.numbers()[length_at]).abs() < SAME[1]
    };
    // Patterns of cells are the same after half a turn.
    let flips: &[f64] = if model.tone.is_some() { &[0.0] } else { &[0.0, 180.0] };
    let mut all: Vec<Settings> = Vec::new();
    let most = if model.slots.iter().any(|slot| !slot.is_real) { 5 } else { 8 };
    for (wave, own) in seen.iter().take(most).flat_map(|wave| own.iter().map(move |own| (wave, own))) {
        for flip in flips {
            // Its lines scale with the length that the pattern is made of.
            let scale = wave.period() / own.period();
            let scaled = [length, "gap", "joint"].map(|name| (name, model.number(start, name) * scale));
            let turn = degrees(wave.direction() - own.direction()) + flip;
            let settings = model.with(&model.with(start, &[("theta", turn)]), &scaled);
            if !all.iter().any(|other| is_same(other, &settings)) {
                all.push(settings);
            }
        }
    }
    all
}

/// Rows along every turn that the waves suggest, of every width across it.
fn rows(
    model: &Model,
    [width, length]: [&str; 2],
    whole: Option<(&str, i32, i32)>,
    seen: &[Wave],
    resolution: f64,
) -> Vec<Settings> {
    let start = model.start();
    let [width_at, length_at] = [width, length].map(|name| model.slot(name).map_or(1.0, |at| start.numbers()[at]));
    let mut all = Vec::new();
    for turn in row_turns(seen) {
        for period in periods(seen, turn + FRAC_PI_2, resolution) {
            for number in whole.map_or(0..=0, |(_, least, most)| least..=most) {
                // Only every few rows may have a gap.
                let across = period / f64::from(number.max(1));
                let mut changes = vec![("theta", turn.to_degrees()), (width, across)];
                changes.push((length, across * length_at / width_at));
                changes.extend(whole.map(|(name, ..)| (name, f64::from(number))));
                all.push(model.with(&start, &changes));
            }
        }
    }
    all
}

/// Turns of rows, in radians: along the crests of the strongest waves.
fn row_turns(seen: &[Wave]) -> Vec<f64> {
    let mut all: Vec<f64> = Vec::new();
    for turn in seen.iter().take(5).map(|wave| wave.direction() - FRAC_PI_2) {
        let apart = |other: &f64| turn - other - PI * ((turn - other) / PI).round();
        if all.iter().all(|other| apart(other).abs() > SAME[0].to_radians()) {
            all.push(turn);
        }
    }
    all
}

/// Shifts across rows, in sixths of a row, which no wave distinguishes.
fn across_rows(model: &Model, settings: &Settings, width: &str) -> Vec<(f64, [f64; 2])> {
    let (sin, cos) = libm::sincos(model.number(settings, "theta").to_radians());
    (0..6)
        .map(|k| model.number(settings, width) * f64::from(k) / 6.0)
        .map(|shift| (0.0, [-sin * shift, cos * shift]))
        .collect()
}

/// The angle in degrees, from -90 to 90.
fn degrees(angle: f64) -> f64 {
    let turned = angle.to_degrees();
    turned - 180.0 * (turned / 180.0).round()
}

/// Every turn that the waves suggest, with every pair of periods along the turned axes, and every shift of rows.
fn axes(
    model: &Model,
    names: [&str; 2],
    per_length: f64,
    shift: Option<&str>,
    seen: &[Wave],
    resolution: f64,
) -> Vec<Settings> {
    let mut all = Vec::new();
    // Where the axes are alike, a quarter turn swaps their periods, all pairs of which are tried.
    let are_alike = shift.is_none() && names[0].starts_with("size") || names[0].starts_with("panel");
    for turn in turns(seen, if are_alike { FRAC_PI_2 } else { PI }) {
        let [along_u, along_v] = [0.0, FRAC_PI_2].map(|quarter| periods(seen, turn + quarter, resolution));
        for (&period_u, &period_v) in along_u.iter().flat_map(|u| along_v.iter().map(move |v| (u, v))) {
            let sizes = [period_u, period_v].map(|period| period / per_length);
            let changes = [("theta", turn.to_degrees()), (names[0], sizes[0]), (names[1], sizes[1])];
            let settings = model.with(&model.start(), &changes);
            match shift {
                None => all.push(settings),
                Some(name) => {
                    let shares = row_shifts(seen, turn, [period_u, period_v], resolution);
                    all.extend(shares.into_iter().map(|share| model.with(&settings, &[(name, share)])));
                }
            }
        }
    }
    all
}

/// Shifts from row to row in periods: a half, and those that explain most of the waves. Rows that are shifted by s turn
/// a wave that repeats m times along a length by m s periods a row.
fn row_shifts(seen: &[Wave], turn: f64, [period_u, period_v]: [f64; 2], resolution: f64) -> Vec<f64> {
    let (sin, cos) = libm::sincos(turn);
    let mut waves: Vec<(f64, f64, f64)> = Vec::new();
    for wave in seen {
        let [fu, fv] = wave.frequency;
        let (along, across) = (fu * cos + fv * sin, fv * cos - fu * sin);
        let repeats = (along.abs() * period_u).round();
        if (1.0..=6.0).contains(&repeats) && (along.abs() - repeats / period_u).abs() < 0.3 * resolution {
            waves.push((repeats, across * along.signum() * period_v, wave.share));
        }
    }
    let explained = |shift: f64| -> f64 {
        let off = |(repeats, rows): (f64, f64)| (rows - repeats * shift - (rows - repeats * shift).round()).abs();
        let is_explained = |wave: &&(f64, f64, f64)| off((wave.0, wave.1)) < 0.4 * resolution * period_v;
        waves.iter().filter(is_explained).map(|(.., share)| share).sum()
    };
    let shifts = |(repeats, rows, _): &(f64, f64, f64)| {
        let (repeats, rows) = (*repeats, *rows);
        (0..repeats as u32).map(move |add| (rows + f64::from(add)) / repeats).map(|share| share - share.floor())
    };
    let mut tried: Vec<(f64, f64)> = waves.iter().flat_map(shifts).map(|shift| (explained(shift), shift)).collect();
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut all = vec![0.5];
    for (_, shift) in tried {
        if all.len() < ROW_SHIFTS && all.iter().all(|other| (other - shift).abs() > 0.01) {
            all.push(shift);
        }
    }
    all
}

/// Directions of the strongest waves and of the bisectors of their pairs, and those at right angles to them, in
/// radians, as far as they differ by other than multiples of `repeat`.
fn turns(seen: &[Wave], repeat: f64) -> Vec<f64> {
    let strong: Vec<f64> = seen.iter().take(3).map(Wave::direction).collect();
    let mut all = strong.clone();
    for (at, first) in strong.iter().enumerate() {
        all.extend(strong[at + 1..].iter().map(|second| 0.5 * (first + second)));
    }
    let both = all.iter().flat_map(|turn| [*turn, turn + FRAC_PI_2]);
    let mut distinct: Vec<f64> = Vec::new();
    for turn in both {
        let apart = |other: &f64| ((turn - other) / repeat).round() * repeat - (turn - other);
        if !distinct.iter().any(|other| apart(other).abs() < 0.01) {
            distinct.push(turn);
        }
    }
    distinct
}

/// Periods along a direction of whose frequency the waves' components are multiples, the best explanations first.
fn periods(seen: &[Wave], direction: f64, resolution: f64) -> Vec<f64> {
    let (sin, cos) = libm::sincos(direction);
    let along = |wave: &Wave| (wave.frequency[0] * cos + wave.frequency[1] * sin).abs();
    let parts: Vec<(f64, f64)> =
        seen.iter().map(|wave| (along(wave), wave.share)).filter(|(f, _)| *f > resolution).collect();
    let divided = parts.iter().flat_map(|(f, _)| (1..=4).map(move |k| f / f64::from(k)));
    let apart = parts.iter().flat_map(|(f, _)| parts.iter().map(move |(g, _)| (f - g).abs()));
    let mut scored: Vec<(f64, f64)> = Vec::new();
    for base in divided.chain(apart).filter(|base| *base > 1.5 * resolution) {
        let is_multiple = |f: f64| (f - base * (f / base).round()).abs() < 0.2 * resolution;
        let explained: f64 = parts.iter().filter(|(f, _)| is_multiple(*f)).map(|(_, share)| share).sum();
        // A lower frequency has more multiples, which explain some waves by chance.
        let score = explained * libm::pow(base / resolution, 0.1);
        if !scored.iter().any(|(_, other)| (other / base - 1.0).abs() < 0.02) {
            scored.push((score, base));
        }
    }
    scored.sort_by(|a, b| b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1)));
    scored.truncate(4);
    scored.into_iter().map(|(_, base)| 1.0 / base).collect()
}

/// Up to how many periods of a wave a shift is sought: the strongest wave may be that harmonic of the pattern.
const HARMONICS: u32 = 6;

/// The number of shifts that are kept.
const SHIFTS: usize = 2;

/// The points at which a graph's waves are measured, with `exp(-i TAU f . x)` there for each wave.
struct Basis {
    points: Vec<Point>,
    turned: Vec<Vec<[f64; 2]>>,
}

impl Basis {
    fn new(points: Vec<Point>, seen: &[Wave]) -> Self {
        let turned = seen.iter().map(|wave| points.iter().map(|point| wave.turned([point.u, point.v])).collect());
        Self { turned: turned.collect(), points }
    }
}

/// A wave of the points with the graph's amplitude at its frequency.
struct Pair<'a> {
    seen: &'a Wave,
    own: [f64; 2],
}

impl Pair<'_> {
    /// By how many periods the wave of the points is shifted against the graph's.
    fn turns(&self) -> f64 {
        let own = Wave { amplitude: self.own, ..*self.seen };
        (own.phase() - self.seen.phase()) / TAU
    }

    /// The agreement of both once the graph is shifted.
    fn agreement(&self, [u, v]: [f64; 2]) -> f64 {
        let (sin, cos) = libm::sincos(TAU * (self.seen.frequency[0] * u + self.seen.frequency[1] * v));
        let ([a, b], [c, d]) = (self.own, self.seen.amplitude);
        (a * c + b * d) * cos + (b * c - a * d) * sin
    }
}

/// The shifts at which the graph's phases agree best with those of the points. The strongest wave and the strongest one
/// across it give the shifts that are tried, and all waves judge them: the greater the number, the better the waves
/// agree. As colours may be swapped, so may the sign.
/// None where the graph does not have the strongest wave.
fn shifts(model: &Model, settings: &Settings, basis: &Basis, seen: &[Wave]) -> Vec<(f64, [f64; 2])> {
    let own = Signal::without_mean(&model.shown(settings, &basis.points));
    let variance = own.variance().max(1e-12);
    let share = |[a, b]: [f64; 2]| 2.0 * (a * a + b * b) / variance;
    let waves = seen.iter().zip(&basis.turned);
    let pairs: Vec<Pair> = waves.map(|(seen, turned)| Pair { seen, own: own.along(turned) }).collect();
    // The joints of cells have many harmonics, the first of which need not be the strongest.
    let strong = if model.tone.is_some() { 4 } else { 1 };
    let Some(first) = pairs.iter().take(strong).find(|first| share(first.own) > LEAST_SHARE) else { return Vec::new() };
    let second = pairs.iter().find(|pair| is_across(first.seen, pair.seen) && share(pair.own) > LEAST_SHARE);
    // Blocks repeat after several of their widths.
    let harmonics = if model.slots.iter().any(|slot| !slot.is_real) { 2 * HARMONICS } else { HARMONICS };
    let tried = second.map_or_else(|| along(first), |second| between(first, second, harmonics));
    // The correlation of both, up to a factor that all settings share.
    let agreement =
        |shift: &[f64; 2]| pairs.iter().map(|pair| pair.agreement(*shift)).sum::<f64>().abs() / variance.sqrt();
    let mut judged: Vec<(f64, [f64; 2])> = tried.into_iter().map(|shift| (agreement(&shift), shift)).collect();
    judged.sort_by(|a, b| b.0.total_cmp(&a.0));
    judged.truncate(SHIFTS);
    judged
}

/// Whether the directions of two waves differ by more than 12 degrees.
fn is_across(first: &Wave, second: &Wave) -> bool {
    let ([fu, fv], [gu, gv]) = (first.frequency, second.frequency);
    (fu * gv - fv * gu).abs() > 0.2 / (first.period() * second.period())
}

/// Half and whole periods.
fn halves(harmonics: u32) -> impl Iterator<Item = f64> {
    (0..2 * harmonics).map(|halves| 0.5 * f64::from(halves))
}

/// Shifts across stripes.
fn along(first: &Pair) -> Vec<[f64; 2]> {
    let [fu, fv] = first.seen.frequency;
    let square = fu * fu + fv * fv;
    halves(HARMONICS).map(|add| (first.turns() + add) / square).map(|length| [length * fu, length * fv]).collect()
}

/// Shifts that turn two waves as far as those of the points.
fn between(first: &Pair, second: &Pair, harmonics: u32) -> Vec<[f64; 2]> {
    let ([fu, fv], [gu, gv]) = (first.seen.frequency, second.seen.frequency);
    let determinant = fu * gv - fv * gu;
    let pairs = halves(harmonics).flat_map(|m| halves(harmonics).map(move |n| (m, n)));
    let shift = |(m, n): (f64, f64)| {
        let (p, q) = (first.turns() + m, second.turns() + n);
        [(p * gv - q * fv) / determinant, (q * fu - p * gu) / determinant]
    };
    pairs.map(shift).collect()
}
