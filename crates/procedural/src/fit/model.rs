//! A graph as a model of colours at points.

use super::points::Point;
use crate::batch::Evaluator;
use crate::graph::{FOOTPRINT, Graph};
use crate::lanes::{LANES, Points};
use crate::program::compile::Program;
use crate::settings::{Settings, Slot, slots};
use crate::value::Type;

/// The amplitudes of what is random, whose phase cannot be fitted. They are set to their least values.
const AMPLITUDES: [&str; 5] = ["tone", "grain", "pile", "clouds", "edge_wear"];

/// Other parameters that are not fitted: what belongs to something random, or is not seen in a colour.
const KEPT: [&str; 5] = ["depth_tone", "ring_period", "softness", "surface_roughness", FOOTPRINT];

/// A graph with what is needed to fit it.
pub(super) struct Model {
    pub(super) graph: Graph,
    program: Program,
    pub(super) slots: Vec<Slot>,
    /// The slots of the first channel of each colour.
    pub(super) colors: Vec<usize>,
    /// The slots of lengths, shares and the place of the pattern.
    pub(super) shape: Vec<usize>,
}

impl Model {
    pub(super) fn new(graph: Graph) -> Self {
        let slots = slots(&graph);
        let kind = |slot: &Slot| graph.parameters[slot.parameter].value.kind();
        let name = |slot: &Slot| graph.parameters[slot.parameter].name.as_str();
        let all = slots.iter().enumerate();
        let colors = all.clone().filter(|(_, slot)| kind(slot) == Type::Color3 && slot.component == 0);
        let kept = |name: &str| AMPLITUDES.contains(&name) || KEPT.contains(&name);
        let fitted = |slot: &Slot| !kept(name(slot)) || is_a_rib(&graph.name, name(slot));
        let shape = all.clone().filter(|(_, slot)| kind(slot) == Type::Float && fitted(slot));
        let (colors, shape) = (colors.map(|(at, _)| at).collect(), shape.map(|(at, _)| at).collect());
        Self { program: Program::new(&graph), graph, slots, colors, shape }
    }

    /// The defaults without what is random.
    pub(super) fn start(&self) -> Settings {
        let mut settings = Settings::defaults(&self.graph);
        for (at, slot) in self.slots.iter().enumerate() {
            if AMPLITUDES.contains(&self.graph.parameters[slot.parameter].name.as_str()) {
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
            evaluator.run(&lanes(batch));
            for (lane, point) in batch.iter().enumerate() {
                for channel in 0..3 {
                    for (at, slope) in row.iter_mut().enumerate() {
                        *slope = evaluator.derivative(channel, at).map_or(0.0, |slopes| slopes[lane]);
                    }
                    visit(point, channel, evaluator.value(channel)[lane], &row);
                }
            }
        }
    }

    /// The points with the model's colours.
    pub(super) fn shown(&self, settings: &Settings, points: &[Point]) -> Vec<Point> {
        let mut evaluator = Evaluator::new(&self.program, settings, &[]);
        let mut shown = Vec::with_capacity(points.len());
        for batch in points.chunks(LANES) {
            evaluator.run(&lanes(batch));
            shown.extend(batch.iter().enumerate().map(|(lane, point)| {
                let [red, green, blue, ..] = evaluator.outputs(lane);
                Point { albedo: [red, green, blue], ..*point }
            }));
        }
        shown
    }
}

/// Ribs and threads are nothing but their tone.
fn is_a_rib(graph: &str, parameter: &str) -> bool {
    matches!((graph, parameter), ("corduroy" | "weave", "depth_tone"))
}

fn lanes(batch: &[Point]) -> Points {
    let at = |of: fn(&Point) -> f64| std::array::from_fn(|lane| of(&batch[lane.min(batch.len() - 1)]));
    Points { u: at(|point| point.u), v: at(|point| point.v), footprint: at(|point| point.footprint) }
}
