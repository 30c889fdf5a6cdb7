//! A graph as a model of colours at points: what a fit does with its parameters, by the names that the built-in graphs
//! use, which of them are periods, and the colours that it shows with their derivatives.

use std::sync::Arc;

use super::Point;
use crate::evaluator::{Evaluator, Points, evaluate};
use crate::graph::{FOOTPRINT, Graph, Settings, Slot, slots};
use crate::library::Class;
use crate::program::op::{LANES, Lanes};
use crate::program::{OUTPUTS, Program};
use crate::value::Type;

/// What a parameter is to a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The turn of the pattern.
    Turn,
    /// The place of the pattern.
    Shift,
    /// A colour at places that can be predicted.
    Color,
    /// A colour at places that are random.
    RandomColor,
    /// How strong something random is; at its least value there is none of it.
    Amplitude,
    /// The size of something random, in metres or relative to another size.
    RandomSize,
    /// A length or a share of what can be predicted.
    Shape,
    /// Not visible in colours, or chosen by the fit in other ways.
    Kept,
}

/// Sizes of what is random.
const RANDOM_SIZES: [&str; 17] = [
    "grain_size",
    "stone_size",
    "cloud_size",
    "pore_size",
    "chip_size",
    "large_size",
    "small_size",
    "vein_scale",
    "warp",
    "sharpness",
    "band_period",
    "stretch",
    "pile_size",
    "cell_size",
    "streak_length",
    "streak_width",
    "ring_period",
];

pub fn role(graph: &Graph, parameter: usize) -> Role {
    let name = graph.parameters[parameter].name.as_str();
    match (name, graph.parameters[parameter].value.kind()) {
        ("theta", _) => Role::Turn,
        ("t_u" | "t_v", _) => Role::Shift,
        (FOOTPRINT | "softness" | "surface_roughness" | "row_random", _) => Role::Kept,
        (_, Type::Color3) if is_random_color(&graph.name, name) => Role::RandomColor,
        (_, Type::Color3) => Role::Color,
        // Ribs and threads are nothing but their tone.
        ("depth_tone", Type::Float) if matches!(graph.name.as_str(), "corduroy" | "weave") => Role::Shape,
        ("contrast" | "tone" | "grain" | "pile" | "clouds" | "edge_wear" | "pore_density", Type::Float)
        | ("depth_tone" | "crease_tone", Type::Float) => Role::Amplitude,
        (_, Type::Float) if RANDOM_SIZES.contains(&name) => Role::RandomSize,
        ("melange" | "coverage" | "small_share", Type::Float) => Role::RandomSize,
        (_, Type::Float) => Role::Shape,
        _ => Role::Kept,
    }
}

/// Whether a parameter is a length: graphs state units in the parameter's `doc`, the only place for them.
pub(super) fn is_length(graph: &Graph, parameter: usize) -> bool {
    graph.parameters[parameter].doc.as_ref().is_some_and(|doc| doc.contains("in metres"))
}

/// Colours of cells, chips, veins and the like.
fn is_random_color(graph: &str, name: &str) -> bool {
    match graph {
        "terrazzo" | "granite" | "marble" | "travertine" | "veneer" | "carpet" => true,
        "mosaic" => name != "joint_color",
        _ => false,
    }
}

/// How the sizes of a graph are found from waves.
#[derive(Clone, Copy, Debug)]
pub(super) enum Layout {
    /// One length, by which the whole pattern scales, and its whole-number parameter, of which all values are tried.
    Similar { length: &'static str, whole: Option<(&'static str, i32, i32)> },
    /// Rows of cells that begin anywhere.
    Rows { width: &'static str, length: &'static str, whole: Option<(&'static str, i32, i32)> },
    /// A length along u and one along v, the period in lengths, and the shift from row to row.
    Axes { u: &'static str, v: &'static str, periods: f64, shift: Option<&'static str> },
}

/// The layout of a built-in graph; `None` for those that are not fitted.
pub(super) fn layout(graph: &str) -> Option<Layout> {
    let similar = |length, whole| Some(Layout::Similar { length, whole });
    let axes = |u, v, periods| Some(Layout::Axes { u, v, periods, shift: None });
    let rows = |u, v, shift| Some(Layout::Axes { u, v, periods: 1.0, shift: Some(shift) });
    match graph {
        "stripes" => similar("period", None),
        "corduroy" => similar("rib_period", None),
        "hexagon" => similar("side", None),
        "houndstooth" => similar("size", None),
        "herringbone" => similar("width", Some(("ratio", 3, 7))),
        "weave" => similar("pitch", Some(("twill", 1, 3))),
        "basket_parquet" => similar("square", Some(("strips", 2, 6))),
        "mosaic" => similar("size", None),
        "concrete" => axes("panel_u", "panel_v", 1.0),
        "plank" => Some(Layout::Rows { width: "width", length: "length", whole: None }),
        "strip_parquet" => Some(Layout::Rows { width: "width", length: "length", whole: Some(("strips", 2, 4)) }),
        "tile" => axes("size_u", "size_v", 1.0),
        "brick" => rows("size_u", "size_v", "row_shift"),
        "dots" => rows("pitch_u", "pitch_v", "stagger"),
        "trellis" => axes("pitch_u", "pitch_v", 1.0),
        "plaid" => axes("period_u", "period_v", 1.0),
        "checks" => axes("size_u", "size_v", 2.0),
        _ => None,
    }
}

/// The parameters of cells that have a tone of their own.
#[derive(Clone, Debug)]
pub(super) struct Tone {
    /// The slot of the spread of the tones.
    pub(super) slot: usize,
    /// The first slots of the cells' colours.
    pub(super) colors: Vec<usize>,
    /// The slots of the width and the length of boards whose rows begin at random.
    pub(super) boards: Option<[usize; 2]>,
}

/// A graph with what is needed to fit it.
pub(super) struct Model {
    pub(super) graph: Arc<Graph>,
    pub(super) class: Option<Class>,
    program: Program,
    pub(super) slots: Vec<Slot>,
    /// The slots of the first channel of each colour.
    pub(super) colors: Vec<usize>,
    /// The slots of lengths, shares and the place of the pattern.
    pub(super) shape: Vec<usize>,
    /// The tones of a periodic pattern of cells.
    pub(super) tone: Option<Tone>,
}

impl Model {
    pub(super) fn new(graph: Graph, class: Option<Class>) -> Self {
        let (program, slots) = (Program::new(&graph), slots(&graph));
        let (colors, shape) = (Vec::new(), Vec::new());
        let mut model = Self { program, graph: Arc::new(graph), class, slots, colors, shape, tone: None };
        model.colors = model.of_roles(&[Role::Color, Role::RandomColor]);
        model.shape = model.of_roles(&[Role::Turn, Role::Shift, Role::Shape]);
        // Panels of concrete are cells too; threads of cloth are not.
        let is_of_cells = class == Some(Class::Lattice) || class.is_some() && model.graph.name == "concrete";
        if is_of_cells && model.graph.name != "weave" {
            let is_of_cells = |at: &usize| {
                let name = &model.graph.parameters[model.slots[*at].parameter].name;
                !name.starts_with("joint") && !name.starts_with("gap")
            };
            let colors = model.colors.iter().copied().filter(is_of_cells).collect();
            let is_of_boards = matches!(model.graph.name.as_str(), "plank" | "strip_parquet");
            let boards = model.slot("width").zip(model.slot("length")).filter(|_| is_of_boards);
            let boards = boards.map(|(width, length)| [width, length]);
            model.tone = model.slot("tone").map(|slot| Tone { slot, colors, boards });
        }
        model
    }

    /// The defaults without what is random.
    pub(super) fn start(&self) -> Settings {
        let mut settings = Settings::defaults(&self.graph);
        // Colours that are scattered at random begin as one.
        let random = self.of_role(Role::RandomColor);
        for channel in 0..3 {
            let sum: f64 = random.iter().map(|at| settings.numbers()[at + channel]).sum();
            random.iter().for_each(|at| *settings.number_mut(at + channel) = sum / random.len() as f64);
        }
        for (at, slot) in self.slots.iter().enumerate() {
            if role(&self.graph, slot.parameter) == Role::Amplitude {
                *settings.number_mut(at) = slot.least.unwrap_or(slot.value);
            }
        }
        settings
    }

    /// The first slot of a parameter.
    pub(super) fn slot(&self, name: &str) -> Option<usize> {
        let parameter = self.graph.parameter(name)?;
        self.slots.iter().position(|slot| slot.parameter == parameter)
    }

    /// Sets a parameter of one number, within its range.
    pub(super) fn set(&self, settings: &mut Settings, name: &str, number: f64) {
        if let Some(at) = self.slot(name) {
            *settings.number_mut(at) = self.slots[at].clamped(number);
        }
    }

    /// The settings with other values of some parameters of one number, each within its range.
    pub(super) fn with(&self, settings: &Settings, changes: &[(&str, f64)]) -> Settings {
        let mut changed = settings.clone();
        changes.iter().for_each(|(name, number)| self.set(&mut changed, name, *number));
        changed
    }

    /// The value of a parameter of one number; 0 where the graph has none of this name.
    pub(super) fn number(&self, settings: &Settings, name: &str) -> f64 {
        self.slot(name).map_or(0.0, |at| settings.numbers()[at])
    }

    /// Calls a function for each point with the colour there and its derivatives in the chosen slots, channel by
    /// channel.
    pub(super) fn visit(
        &self,
        settings: &Settings,
        chosen: &[usize],
        points: &[Point],
        mut visit: impl FnMut(&Point, usize, f64, &[f64]),
    ) {
        let mut evaluator = Evaluator::new(&self.program, settings, chosen);
        let mut row = vec![0.0; chosen.len()];
        for batch in points.chunks(LANES) {
            evaluator.run(&Points::of(&places(batch)));
            for channel in 0..3 {
                let slopes: Vec<Option<&Lanes>> =
                    (0..chosen.len()).map(|at| evaluator.derivative(channel, at)).collect();
                for (lane, point) in batch.iter().enumerate() {
                    for (slope, of_lanes) in row.iter_mut().zip(&slopes) {
                        *slope = of_lanes.map_or(0.0, |of_lanes| of_lanes[lane]);
                    }
                    visit(point, channel, evaluator.value(channel)[lane], &row);
                }
            }
        }
    }

    /// The first slots of the parameters of some roles, in the order of the slots.
    fn of_roles(&self, wanted: &[Role]) -> Vec<usize> {
        let is_wanted = |slot: &Slot| slot.component == 0 && wanted.contains(&role(&self.graph, slot.parameter));
        (0..self.slots.len()).filter(|at| is_wanted(&self.slots[*at])).collect()
    }

    pub(super) fn of_role(&self, wanted: Role) -> Vec<usize> {
        self.of_roles(&[wanted])
    }

    /// Sets the parameters of a role to their defaults.
    pub(super) fn reset(&self, settings: &mut Settings, wanted: Role) {
        for (at, slot) in self.slots.iter().enumerate().filter(|(_, slot)| role(&self.graph, slot.parameter) == wanted)
        {
            *settings.number_mut(at) = slot.value;
        }
    }

    /// Whether a slot is a length in metres.
    pub(super) fn is_length(&self, at: usize) -> bool {
        is_length(&self.graph, self.slots[at].parameter)
    }

    /// How much of each colour is at each point: the derivatives of the first channel.
    pub(super) fn masks(&self, settings: &Settings, points: &[Point]) -> Vec<Vec<f64>> {
        self.slopes(settings, &self.colors, points)
    }

    /// The derivatives of the first channel at each point, where all colours are so dark that none is clamped.
    pub(super) fn slopes(&self, settings: &Settings, chosen: &[usize], points: &[Point]) -> Vec<Vec<f64>> {
        let mut grey = settings.clone();
        self.colors.iter().flat_map(|at| *at..at + 3).for_each(|at| *grey.number_mut(at) = 0.3);
        let mut evaluator = Evaluator::new(&self.program, &grey, chosen);
        let mut all = Vec::with_capacity(points.len());
        for batch in points.chunks(LANES) {
            evaluator.run(&Points::of(&places(batch)));
            let found: Vec<Option<&Lanes>> = (0..chosen.len()).map(|at| evaluator.derivative(0, at)).collect();
            let slopes =
                |lane: usize| found.iter().map(move |of_lanes| of_lanes.map_or(0.0, |of_lanes| of_lanes[lane]));
            all.extend((0..batch.len()).map(|lane| slopes(lane).collect()));
        }
        all
    }

    /// The points with the model's colours.
    pub(super) fn shown(&self, settings: &Settings, points: &[Point]) -> Vec<Point> {
        let outputs = evaluate(&self.program, settings, &places(points));
        let shown =
            |(point, [red, green, blue, ..]): (&Point, [f64; OUTPUTS])| Point { albedo: [red, green, blue], ..*point };
        points.iter().zip(outputs).map(shown).collect()
    }
}

fn places(points: &[Point]) -> Vec<[f64; 3]> {
    points.iter().map(|point| [point.u, point.v, point.footprint]).collect()
}
