//! Random settings of the built-in graphs, within what is usual and visible.
//!
//! Amplitudes are a quarter to all of their defaults. Plaster has nothing but its grain, of which the points show four
//! or five per grain: with the noise of [`super::view`], a contrast below the default is one colour to any observer, so
//! it is drawn from one to two defaults. Ribs of corduroy wander by a tenth of their distance; enough of them are shown
//! for their mean distance to be known to 1 %.

use mateval_procedural::fit::model::{Role, role};
use mateval_procedural::graph::{Slot, slots};
use mateval_procedural::library::{Entry, entry};
use mateval_procedural::{Graph, Settings};

use super::view::random;

/// What is known of a graph's lengths.
pub struct Lengths {
    /// The graph.
    pub graph: &'static str,
    /// Its periods; none where it is random.
    pub periods: &'static [&'static str],
    /// The length that the size of the patch follows.
    pub main: &'static str,
    /// The side of the patch in main lengths.
    pub across: f64,
    /// The range of its whole number.
    pub whole: Option<(&'static str, u32, u32)>,
}

const fn lengths(graph: &'static str, periods: &'static [&'static str], main: &'static str, across: f64) -> Lengths {
    Lengths { graph, periods, main, across, whole: None }
}

const fn with_whole(lengths: Lengths, name: &'static str, least: u32, most: u32) -> Lengths {
    Lengths { whole: Some((name, least, most)), ..lengths }
}

/// All built-in graphs.
pub const LENGTHS: [Lengths; 28] = [
    lengths("paint", &[], "", 2.0),
    with_whole(lengths("plaster", &[], "grain_size", 30.0), "octaves", 2, 4),
    lengths("roughcast", &[], "stone_size", 30.0),
    lengths("concrete", &[], "panel_u", 2.5),
    lengths("terrazzo", &[], "chip_size", 25.0),
    lengths("granite", &[], "large_size", 30.0),
    lengths("marble", &[], "vein_scale", 5.0),
    lengths("travertine", &[], "band_period", 14.0),
    lengths("veneer", &[], "ring_period", 25.0),
    lengths("plank", &["width"], "width", 14.0),
    with_whole(lengths("strip_parquet", &["width"], "width", 20.0), "strips", 2, 4),
    with_whole(lengths("herringbone", &["width"], "width", 30.0), "ratio", 3, 7),
    with_whole(lengths("basket_parquet", &["square"], "square", 6.0), "strips", 3, 6),
    lengths("tile", &["size_u", "size_v"], "size_u", 11.0),
    lengths("brick", &["size_u", "size_v"], "size_u", 7.0),
    lengths("hexagon", &["side"], "side", 17.0),
    lengths("mosaic", &["size"], "size", 22.0),
    lengths("checks", &["size_u", "size_v"], "size_u", 20.0),
    lengths("stripes", &["period"], "period", 12.0),
    lengths("plaid", &["period_u", "period_v"], "period_u", 11.0),
    lengths("houndstooth", &["size"], "size", 18.0),
    lengths("dots", &["pitch_u", "pitch_v"], "pitch_u", 11.0),
    lengths("trellis", &["pitch_u", "pitch_v"], "pitch_u", 11.0),
    with_whole(lengths("weave", &["pitch"], "pitch", 15.0), "twill", 1, 3),
    lengths("corduroy", &["rib_period"], "rib_period", 24.0),
    lengths("carpet", &[], "pile_size", 30.0),
    lengths("leather", &[], "cell_size", 30.0),
    lengths("metal", &[], "streak_width", 100.0),
];

/// A category of things that are often made of a graph; none where no category is.
pub fn category(graph: &str) -> Option<&'static str> {
    match graph {
        "paint" | "plaster" | "roughcast" | "brick" | "mosaic" => Some("wall"),
        "plank" | "strip_parquet" | "herringbone" | "basket_parquet" | "tile" | "hexagon" | "terrazzo" => Some("floor"),
        "concrete" => Some("floor"),
        "veneer" | "marble" | "travertine" | "granite" => Some("table"),
        "carpet" | "trellis" | "checks" => Some("rug"),
        "weave" | "corduroy" | "leather" | "houndstooth" => Some("sofa"),
        "plaid" | "stripes" | "dots" => Some("curtain"),
        "metal" => Some("lamp"),
        _ => None,
    }
}

/// A pattern.
pub struct Draw {
    /// What is known of its lengths.
    pub lengths: &'static Lengths,
    /// The built-in graph.
    pub entry: &'static Entry,
    /// The graph.
    pub graph: Graph,
    /// The settings.
    pub settings: Settings,
    /// The side of the patch in metres.
    pub side: f64,
}

/// A random pattern of a graph; the same for the same number.
pub fn draw(lengths: &'static Lengths, number: usize) -> Draw {
    let entry = entry(lengths.graph).unwrap();
    let graph = entry.graph().unwrap();
    let mut settings = Settings::defaults(&graph);
    let slots = slots(&graph);
    // One number scales all lengths: half to twice the defaults.
    let scale = 4.0_f64.powf(uniform(number, 0) - 0.5);
    let bright = 0.75 + 0.5 * uniform(number, 1);
    for (at, slot) in slots.iter().enumerate() {
        let found = drawn(&graph, slot, uniform(number, 10 + at as u32), scale, bright);
        *settings.number_mut(at) = found.max(slot.least.unwrap_or(found)).min(slot.most.unwrap_or(found));
    }
    if let Some((name, least, most)) = lengths.whole {
        let whole = least + (uniform(number, 2) * f64::from(most - least + 1)) as u32;
        settings.set(&graph, name, &whole.to_string()).unwrap();
    }
    let main = graph.parameter(lengths.main).map_or(1.0, |_| value(&graph, &settings, lengths.main));
    Draw { lengths, entry, graph, settings, side: lengths.across * main }
}

/// The value of a slot out of a random number of its own.
fn drawn(graph: &Graph, slot: &Slot, own: f64, scale: f64, bright: f64) -> f64 {
    let parameter = &graph.parameters[slot.parameter];
    let is_length = parameter.doc.as_ref().is_some_and(|doc| doc.contains("in metres"));
    // A fifth up or down.
    let jitter = 1.44_f64.powf(own - 0.5);
    match role(graph, slot.parameter) {
        Role::Turn => 180.0 * (own - 0.5),
        Role::Shift => own,
        Role::Color | Role::RandomColor => (slot.value * bright * jitter).min(0.9),
        Role::Amplitude if graph.name == "plaster" => slot.value * (1.0 + own),
        Role::Amplitude => slot.value * (0.25 + 0.75 * own),
        Role::Shape | Role::RandomSize if is_length => slot.value * scale * jitter,
        Role::Shape | Role::RandomSize => slot.value * jitter,
        Role::Kept => slot.value,
    }
}

fn uniform(number: usize, of: u32) -> f64 {
    random(1000 + number, 1000 + of)
}

/// The first slot of a parameter.
pub fn slot(graph: &Graph, name: &str) -> usize {
    let parameter = graph.parameter(name).unwrap();
    slots(graph).iter().position(|slot| slot.parameter == parameter).unwrap()
}

/// The number of a parameter.
pub fn value(graph: &Graph, settings: &Settings, name: &str) -> f64 {
    settings.numbers()[slot(graph, name)]
}
