//! Materials that are drawn for a class and a place: a tileable one of the private folder, or a built-in graph with
//! drawn parameters.

use std::f64::consts::{FRAC_PI_2, PI};

use mateval_dataset::material::MaterialClass;
use mateval_image::ImageError;
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{Texture, Wrap};
use mateval_procedural::evaluator::evaluate;
use mateval_procedural::graph::slots;
use mateval_procedural::library::{Class, entry};
use mateval_procedural::value::Type;
use mateval_procedural::{Graph, Program, Settings};
use mateval_sources::front3d::finish_of;
use palette::convert::FromColorUnclamped;
use palette::{LinSrgb, Oklab, Oklch};

use super::secret::{Draw, TileFiles};
use super::surfaces::Place;

/// Base colour, linear, roughness and metallic.
pub(super) type Values = [f64; 5];

/// A material at every point of a plane, in metres.
pub(super) struct Drawn {
    pattern: Pattern,
    /// Metres of the plane for a metre of the pattern.
    scale: f64,
    /// The turn of the pattern, in radians, and its shift, in metres.
    turn: f64,
    shift: [f64; 2],
}

enum Pattern {
    Constant(Values),
    Graph { program: Program, settings: Settings },
    Tile(Box<Tile>),
}

struct Tile {
    color: Texture,
    roughness: Option<Texture>,
    metalness: Option<Texture>,
    tint: [f64; 3],
    size_m: f64,
    /// Whether the picture's grain runs upwards.
    is_upright: bool,
    finish: [f64; 2],
}

impl Drawn {
    pub(super) fn constant(values: Values) -> Self {
        Self { pattern: Pattern::Constant(values), scale: 1.0, turn: 0.0, shift: [0.0; 2] }
    }

    /// One colour of a class, with its finish.
    pub(super) fn plain(class: MaterialClass, place: Place, draw: &mut Draw) -> Self {
        let [roughness, metallic] = drawn_finish(class, draw);
        let [red, green, blue] = color(class, place, draw);
        Self::constant([red, green, blue, roughness, metallic])
    }

    /// One colour of leaves.
    pub(super) fn leaf(draw: &mut Draw) -> Self {
        let [lightness, chroma, hue] = [[0.35, 0.6], [0.05, 0.11], [110.0, 145.0]].map(|range| draw.between(range));
        let [red, green, blue] = linear(Oklch::new(lightness, chroma, hue));
        Self::constant([red, green, blue, draw.between([0.4, 0.7]), 0.0])
    }

    /// A material of the class for this place: one of the `tiles` if any is of the class, or else a graph.
    pub(super) fn new(
        class: MaterialClass,
        place: Place,
        tiles: &[TileFiles],
        draw: &mut Draw,
    ) -> Result<Self, ImageError> {
        // Wallpaper is for walls, and not for ceilings and painted frames.
        let is_tiled = class != MaterialClass::Paint || place == Place::Wall;
        let of_class: Vec<&TileFiles> = tiles.iter().filter(|tile| is_tiled && tile.class == class).collect();
        let suited = |tile: &&&TileFiles| tile.is_for_floors == (place == Place::Floor);
        let best: Vec<&TileFiles> = of_class.iter().filter(suited).copied().collect();
        let choice = if best.is_empty() { of_class } else { best };
        if choice.is_empty() {
            return Ok(Self::of_graph(class, place, draw));
        }
        let files = *draw.one(&choice);
        let read = |path, encoding| read_texture(path, encoding, Wrap::Repeat);
        let color = read(&files.color, Encoding::Srgb)?;
        let tint = draw.between([0.8, 1.15]);
        let has_grain = matches!(class, MaterialClass::Wood | MaterialClass::Board | MaterialClass::Metal);
        let tile = Tile {
            is_upright: has_grain && is_upright(&color),
            color,
            roughness: files.roughness.as_deref().map(|path| read(path, Encoding::Linear)).transpose()?,
            metalness: files.metalness.as_deref().map(|path| read(path, Encoding::Linear)).transpose()?,
            tint: [(); 3].map(|()| tint * draw.between([0.93, 1.07])),
            size_m: tile_size_m(class, place),
            finish: drawn_finish(class, draw),
        };
        let shift = [(); 2].map(|()| draw.between([0.0, tile.size_m]));
        // A picture on a wall must not stand on its head.
        let turn = if place == Place::Wall { 0.0 } else { *draw.one(&[0.0, PI]) };
        let scale = draw.between([0.8, 1.25]);
        Ok(Self { pattern: Pattern::Tile(Box::new(tile)), scale, turn, shift })
    }

    fn of_graph(class: MaterialClass, place: Place, draw: &mut Draw) -> Self {
        let name = *draw.one(graphs(class, place));
        let entry = entry(name).expect("a test finds every graph");
        let graph = entry.graph().expect("a test reads every graph");
        if entry.class == Class::Flat {
            return Self::plain(class, place, draw);
        }
        let settings = drawn_settings(&graph, class, place, draw);
        // Random patterns may lie in any direction.
        let turn = match entry.class {
            Class::Isotropic => draw.between([0.0, 2.0 * PI]),
            _ => *draw.one(&[0.0, PI]),
        };
        let scale = match (class, place) {
            (MaterialClass::Tile, Place::Floor) => draw.between([1.4, 2.6]),
            // Rattan is a weave of canes.
            (MaterialClass::Wicker, _) => draw.between([1.5, 2.5]),
            _ => draw.between([0.85, 1.2]),
        };
        let shift = [(); 2].map(|()| draw.between([-5.0, 5.0]));
        Self { pattern: Pattern::Graph { program: Program::new(&graph), settings }, scale, turn, shift }
    }

    /// The value, if it is the same everywhere.
    pub(super) fn as_constant(&self) -> Option<Values> {
        match self.pattern {
            Pattern::Constant(values) => Some(values),
            _ => None,
        }
    }

    /// The material at places `[u, v, footprint]` in metres. Its grain runs along u, or along v if it `is_turned`.
    pub(super) fn at(&self, places: &[[f64; 3]], is_turned: bool) -> Vec<Values> {
        let (sin, cos) = libm::sincos(self.turn + if is_turned { FRAC_PI_2 } else { 0.0 });
        let own = |[u, v, footprint]: [f64; 3]| {
            let (x, y) = (cos * u + sin * v, cos * v - sin * u);
            [x / self.scale + self.shift[0], y / self.scale + self.shift[1], footprint / self.scale]
        };
        let places: Vec<[f64; 3]> = places.iter().map(|place| own(*place)).collect();
        let found = match &self.pattern {
            Pattern::Constant(values) => vec![*values; places.len()],
            Pattern::Graph { program, settings } => evaluate(program, settings, &places),
            Pattern::Tile(tile) => places.iter().map(|place| tile.at(*place)).collect(),
        };
        found.into_iter().map(|values| values.map(|value| value.clamp(0.0, 1.0))).collect()
    }
}

/// The most lookups along the side of a texel that is larger than those of the picture.
const MOST_LOOKUPS: f64 = 8.0;

impl Tile {
    /// The mean over a square of the picture.
    fn at(&self, [x, y, footprint]: [f64; 3]) -> Values {
        let texels = footprint / self.size_m * self.color.width().max(self.color.height()) as f64;
        let count = texels.ceil().clamp(1.0, MOST_LOOKUPS) as usize;
        let mut sum = [0.0; 5];
        for at in 0..count * count {
            let part = |at: usize| footprint * ((at as f64 + 0.5) / count as f64 - 0.5);
            let [u, v] = [x + part(at % count), y + part(at / count)].map(|metres| metres / self.size_m);
            // A picture whose grain runs upwards is laid on its side.
            let uv = if self.is_upright { [-v, u] } else { [u, v] }.map(|v| (v - v.floor()) as f32);
            let color = self.color.sample(uv);
            let number =
                |map: &Option<Texture>, else_: f64| map.as_ref().map_or(else_, |map| f64::from(map.sample(uv)[0]));
            (0..3).for_each(|c| sum[c] += self.tint[c] * f64::from(color[c]));
            sum[3] += number(&self.roughness, self.finish[0]);
            sum[4] += number(&self.metalness, self.finish[1]);
        }
        sum.map(|sum| sum / (count * count) as f64)
    }
}

/// Whether neighbours above each other differ less than those beside each other.
fn is_upright(picture: &Texture) -> bool {
    let (width, height) = (picture.width(), picture.height());
    let (mut beside, mut above) = (0.0, 0.0);
    for y in (0..height).step_by(height.div_ceil(256)) {
        for x in (0..width).step_by(width.div_ceil(256)) {
            let green = |x: usize, y: usize| f64::from(picture.texel(x % width, y % height)[1]);
            beside += (green(x, y) - green(x + 1, y)).abs();
            above += (green(x, y) - green(x, y + 1)).abs();
        }
    }
    above < beside
}

/// The side of a picture of the private folder, in metres: libraries state none, so it is what a class usually shows.
fn tile_size_m(class: MaterialClass, place: Place) -> f64 {
    match class {
        MaterialClass::Wood if place == Place::Floor => 1.6,
        MaterialClass::Tile | MaterialClass::Stone => 1.5,
        MaterialClass::Cloth | MaterialClass::Suede => 0.4,
        MaterialClass::Leather | MaterialClass::SmoothLeather | MaterialClass::Wicker => 0.5,
        _ => 1.0,
    }
}

/// Roughness of the class's range, and its metallic.
fn drawn_finish(class: MaterialClass, draw: &mut Draw) -> [f64; 2] {
    let (range, metallic) = finish_of(class);
    [draw.between(range.map(f64::from)), f64::from(metallic)]
}

/// The graphs of a class at a place; a name that is listed twice is drawn twice as often.
fn graphs(class: MaterialClass, place: Place) -> &'static [&'static str] {
    use MaterialClass as Is;
    match (class, place) {
        (Is::Wood | Is::Board, Place::Floor) => &["plank", "plank", "strip_parquet", "herringbone", "basket_parquet"],
        (Is::Wood, _) => &["veneer"],
        (Is::Board, _) => &["veneer", "paint"],
        (Is::Stone, Place::Floor) => &["marble", "granite", "travertine", "terrazzo", "tile"],
        (Is::Stone, _) => &["marble", "granite", "travertine"],
        (Is::Tile, Place::Floor) => &["tile", "tile", "hexagon", "terrazzo"],
        (Is::Tile, Place::Wall) => &["tile", "tile", "brick", "mosaic"],
        (Is::SmoothLeather | Is::Leather, _) => &["leather"],
        (Is::Suede, _) => &["plaster"],
        (Is::Wicker, _) => &["weave"],
        (Is::CoarseCloth, _) => &["carpet", "carpet", "weave", "corduroy"],
        (Is::Cloth, _) => {
            &["weave", "weave", "weave", "weave", "corduroy", "corduroy", "stripes", "plaid", "houndstooth", "trellis"]
        }
        (Is::Paint, Place::Wall) => &["paint", "paint", "paint", "plaster", "plaster", "stripes", "trellis"],
        (Is::Paint, _) => &["paint", "plaster"],
        (Is::Metal, _) => &["metal"],
        (Is::Glass | Is::Tile | Is::Lacquer | Is::Plastic, _) => &["paint"],
    }
}

/// Ranges of colours in Oklch: lightness, chroma and hue in degrees. Several ranges are drawn alike.
fn ranges(class: MaterialClass, place: Place) -> &'static [[[f64; 2]; 3]] {
    use MaterialClass as Is;
    const ANY: [f64; 2] = [0.0, 360.0];
    const WARM: [f64; 2] = [50.0, 95.0];
    match (class, place) {
        (Is::Wood, _) => &[[[0.38, 0.76], [0.035, 0.085], [48.0, 78.0]]],
        (Is::Board, Place::Thing) => &[[[0.38, 0.76], [0.03, 0.08], [48.0, 78.0]], [[0.75, 0.94], [0.0, 0.015], ANY]],
        (Is::Board, _) => &[[[0.38, 0.76], [0.03, 0.08], [48.0, 78.0]]],
        (Is::Stone, _) => &[[[0.4, 0.92], [0.0, 0.03], WARM]],
        (Is::Tile, _) => &[[[0.5, 0.92], [0.0, 0.03], ANY]],
        (Is::SmoothLeather | Is::Leather | Is::Suede, _) => {
            &[[[0.32, 0.65], [0.04, 0.09], [40.0, 75.0]], [[0.24, 0.9], [0.0, 0.02], WARM]]
        }
        (Is::Wicker, _) => &[[[0.5, 0.78], [0.04, 0.08], [60.0, 85.0]]],
        (Is::CoarseCloth, _) => &[[[0.4, 0.85], [0.0, 0.045], ANY]],
        (Is::Cloth, _) => &[[[0.35, 0.9], [0.0, 0.03], ANY], [[0.35, 0.8], [0.02, 0.07], ANY]],
        (Is::Paint, Place::Ceiling) => &[[[0.88, 0.96], [0.0, 0.01], WARM]],
        (Is::Paint, _) => &[[[0.75, 0.94], [0.0, 0.035], ANY], [[0.82, 0.95], [0.0, 0.015], WARM]],
        (Is::Lacquer, _) => &[[[0.8, 0.95], [0.0, 0.015], WARM], [[0.35, 0.9], [0.0, 0.04], ANY]],
        (Is::Metal, _) => &[[[0.68, 0.88], [0.0, 0.01], ANY], [[0.68, 0.84], [0.05, 0.09], [60.0, 90.0]]],
        (Is::Glass | Is::Plastic, _) => &[[[0.3, 0.92], [0.0, 0.02], ANY], [[0.4, 0.8], [0.02, 0.08], ANY]],
    }
}

/// A linear colour of the class.
fn color(class: MaterialClass, place: Place, draw: &mut Draw) -> [f64; 3] {
    let [lightness, chroma, hue] = draw.one(ranges(class, place)).map(|range| draw.between(range));
    linear(Oklch::new(lightness, chroma, hue))
}

/// A change of a picture's colours that keeps its motif.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Recoloring {
    /// Factors of Oklch's lightness and chroma.
    lightness: f64,
    chroma: f64,
    /// The turn of the hue, in degrees.
    hue: f64,
    /// What is added to Oklab's a and b, since colours without chroma have no hue to turn.
    tint: [f64; 2],
}

impl Recoloring {
    /// How far colours must change, as the mean distance in Oklab: 0.02 is hardly visible.
    const LEAST: f64 = 0.1;
    /// Draws after which the largest change is taken: bright or black pictures cannot change further.
    const MOST_DRAWS: usize = 32;
    /// Colours of a picture that the change is measured on.
    const MEASURED: usize = 4096;

    /// The first of the drawn changes that alters these linear colours enough.
    pub(super) fn drawn(colors: &[[f32; 3]], draw: &mut Draw) -> Self {
        let mut best: Option<(f64, Self)> = None;
        for _ in 0..Self::MOST_DRAWS {
            let hue = draw.between([20.0, 60.0]) * *draw.one(&[-1.0, 1.0]);
            let [lightness, chroma] = [[0.7, 1.15], [0.6, 1.2]].map(|range| draw.between(range));
            let (sin, cos) = libm::sincos(draw.between([0.0, 2.0 * PI]));
            let strength = draw.between([0.02, 0.07]);
            let drawn = Self { lightness, chroma, hue, tint: [strength * cos, strength * sin] };
            let change = drawn.change(colors);
            if best.is_none_or(|(most, _)| change > most) {
                best = Some((change, drawn));
            }
            if change >= Self::LEAST {
                break;
            }
        }
        best.expect("there was a draw").1
    }

    /// A linear colour after the change.
    pub(super) fn of(&self, rgb: [f32; 3]) -> [f32; 3] {
        let color = Oklch::from_color_unclamped(linear_rgb(rgb));
        let turned = Oklch::new(color.l * self.lightness, color.chroma * self.chroma, color.hue + self.hue);
        let mut lab = Oklab::from_color_unclamped(turned);
        (lab.a, lab.b) = (lab.a + self.tint[0], lab.b + self.tint[1]);
        linear(Oklch::from_color_unclamped(lab)).map(|value| value as f32)
    }

    /// The mean distance in Oklab between colours and what they become.
    fn change(&self, colors: &[[f32; 3]]) -> f64 {
        let measured = colors.iter().step_by(colors.len().div_ceil(Self::MEASURED).max(1));
        let distance = |rgb: &[f32; 3]| {
            let [from, to] = [*rgb, self.of(*rgb)].map(|rgb| Oklab::from_color_unclamped(linear_rgb(rgb)));
            ((from.l - to.l).powi(2) + (from.a - to.a).powi(2) + (from.b - to.b).powi(2)).sqrt()
        };
        let count = measured.len().max(1) as f64;
        measured.map(distance).sum::<f64>() / count
    }
}

fn linear_rgb(rgb: [f32; 3]) -> LinSrgb<f64> {
    let [red, green, blue] = rgb.map(f64::from);
    LinSrgb::new(red, green, blue)
}

pub(super) fn linear(color: Oklch<f64>) -> [f64; 3] {
    let LinSrgb { red, green, blue, .. } = LinSrgb::from_color_unclamped(color);
    [red, green, blue].map(|value: f64| value.clamp(0.01, 0.95))
}

/// How far numbers of a graph are drawn from their usual values, as a power of e.
const SPREAD: f64 = 0.3;

/// Sizes and contrasts near their usual values, and colours of the class: the first is drawn, the others keep their
/// ratio to it, except those of the second threads or stripes of textiles and wallpapers, which are drawn too.
fn drawn_settings(graph: &Graph, class: MaterialClass, place: Place, draw: &mut Draw) -> Settings {
    const FIRST: [&str; 5] = ["color", "color_a", "warp_color", "ground_color", "matrix_color"];
    const OTHER_THREADS: [&str; 6] = ["stripes", "plaid", "houndstooth", "trellis", "checks", "dots"];
    let mut settings = Settings::defaults(graph);
    let usual = settings.numbers().to_vec();
    let slots = slots(graph);
    let name = |at: usize| graph.parameters[slots[at].parameter].name.as_str();
    let first = (0..slots.len()).find(|at| FIRST.contains(&name(*at))).expect("a test finds the first colour");
    let main = color(class, place, draw);
    for (at, slot) in slots.iter().enumerate() {
        let is_color = graph.parameters[slot.parameter].value.kind() == Type::Color3;
        let number = match name(at) {
            "surface_roughness" => drawn_finish(class, draw)[0],
            _ if is_color || !slot.is_real => continue,
            "theta" | "t_u" | "t_v" | "footprint" | "softness" | "row_shift" | "row_random" | "stagger" => continue,
            _ => usual[at] * libm::exp(draw.between([-SPREAD, SPREAD])),
        };
        *settings.number_mut(at) = number.clamp(slot.least.unwrap_or(number), slot.most.unwrap_or(number));
    }
    let colors = (0..slots.len())
        .filter(|at| slots[*at].component == 0 && graph.parameters[slots[*at].parameter].value.kind() == Type::Color3);
    for at in colors {
        let own: [f64; 3] = std::array::from_fn(|c| usual[at + c]);
        let found = match name(at) {
            "joint_color" | "gap_color" | "pore_color" => {
                let gain = draw.between([0.8, 1.25]);
                own.map(|value| value * gain)
            }
            _ if at == first => main,
            _ if OTHER_THREADS.contains(&graph.name.as_str()) => {
                // Not too far from the first, as of one cloth.
                let other = color(class, place, draw);
                std::array::from_fn(|c| 0.5 * (main[c] + other[c]))
            }
            _ => std::array::from_fn(|c| main[c] * own[c] / usual[first + c].max(0.02)),
        };
        (0..3).for_each(|c| *settings.number_mut(at + c) = found[c].clamp(0.01, 0.95));
    }
    settings
}

#[cfg(test)]
mod tests {
    use mateval_dataset::SceneId;
    use mateval_image::Texels;

    use super::super::secret::RedressKey;
    use super::*;

    fn draw(part: &str) -> Draw {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("key"), [3; 32]).unwrap();
        let secret = RedressKey::open(&folder.path().join("key"), None, &[]).unwrap();
        secret.draw(&SceneId::new("a").unwrap(), part)
    }

    /// Every class has a material everywhere, whose finish is that of the class.
    #[test]
    fn every_class_is_dressed_within_its_finish() {
        let places: Vec<[f64; 3]> =
            (0..400).map(|at| [0.031 * f64::from(at % 20), 0.047 * f64::from(at / 20), 0.002]).collect();
        for class in MaterialClass::ALL {
            for place in [Place::Floor, Place::Wall, Place::Ceiling, Place::Thing] {
                for number in 0..4 {
                    let part = format!("{class} {place:?} {number}");
                    let drawn = || Drawn::new(class, place, &[], &mut draw(&part)).unwrap().at(&places, false);
                    let shown = drawn();
                    assert_eq!(shown, drawn());
                    let mean = shown.iter().map(|values| values[1]).sum::<f64>() / 400.0;
                    assert!(mean > 0.01 && mean < 0.95, "{part}: {mean}");
                    let ([least, most], metallic) = finish_of(class);
                    let [least, most] = [least, most].map(f64::from);
                    // Streaks of brushed metal vary its roughness.
                    assert!(shown.iter().all(|v| v[3] > 0.7 * least && v[3] < 1.4 * most), "{part}");
                    assert!(shown.iter().all(|v| v[4] == f64::from(metallic)), "{part}");
                }
            }
        }
    }

    /// Also those of a grey picture, which have no hue, and of a white one; motifs stay.
    #[test]
    fn recoloured_pictures_look_different() {
        let pictures: [&[[f32; 3]]; 4] = [
            &[[0.2, 0.2, 0.2], [0.5, 0.5, 0.5]],
            &[[0.9, 0.9, 0.9]],
            &[[0.35, 0.3, 0.25], [0.1, 0.08, 0.07], [0.6, 0.55, 0.5]],
            &[[0.5, 0.05, 0.02], [0.02, 0.1, 0.4]],
        ];
        for colors in pictures {
            for number in 0..20 {
                let found = Recoloring::drawn(colors, &mut draw(&format!("picture {number}")));
                assert!(found.change(colors) >= Recoloring::LEAST, "{colors:?} {found:?}");
                let luminance = |rgb: [f32; 3]| 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
                if let [first, second, ..] = colors {
                    let order = |a: [f32; 3], b: [f32; 3]| luminance(a) > luminance(b);
                    let is_far = (luminance(*first) - luminance(*second)).abs() > 0.1;
                    assert!(!is_far || order(*first, *second) == order(found.of(*first), found.of(*second)));
                }
            }
        }
        // Black cannot change much: the most is taken.
        let black = Recoloring::drawn(&[[0.0; 3]], &mut draw("black"));
        assert!(black.change(&[[0.0; 3]]) < 0.3);
    }

    /// A picture of vertical stripes of 1/8 of its side: after `size_m * scale` metres the pattern is there again, and
    /// grain runs along u, or along v for a part that is longer there.
    #[test]
    fn pictures_repeat_by_metres_and_grain_runs_along_u() {
        let texels = (0..64 * 64).map(|at| if at % 8 < 4 { [255; 3] } else { [0; 3] }).collect();
        let color = Texture::new(64, 64, Texels::Srgb8(texels), Wrap::Repeat).unwrap();
        let is_upright = is_upright(&color);
        assert!(is_upright);
        let (roughness, metalness) = (None, None);
        let tile = Tile { color, roughness, metalness, tint: [1.0; 3], size_m: 1.6, is_upright, finish: [0.5, 0.0] };
        let drawn = Drawn { pattern: Pattern::Tile(Box::new(tile)), scale: 0.5, turn: 0.0, shift: [0.0; 2] };
        let red = |u: f64, v: f64, is_turned: bool| drawn.at(&[[u, v, 0.001]], is_turned)[0][0];
        for at in 0..100 {
            let along = 0.0123 * f64::from(at);
            // A stripe and its gap take a tenth of a metre: an eighth of 1.6 m times 0.5.
            assert!((red(0.3, along, false) - red(0.3, along + 0.1, false)).abs() < 1e-3);
            assert!((red(along, 0.3, false) - red(0.0, 0.3, false)).abs() < 1e-3, "constant along the grain");
            assert!((red(0.3, along, true) - red(0.3, 0.0, true)).abs() < 1e-3, "turned");
        }
        let spread = |step: f64| {
            (0..100)
                .map(|at| red(0.3, step * f64::from(at), false))
                .fold([1.0, 0.0], |[a, b]: [f64; 2], v| [a.min(v), b.max(v)])
        };
        let [least, most] = spread(0.0123);
        assert!(least < 0.05 && most > 0.95, "{least} {most}");
    }
}
