//! The evaluation of a program at batches of points, with derivatives in chosen parameters (forward mode), and a square
//! piece of a graph's material as pixels.

use rayon::prelude::*;

use crate::error::ProceduralError;
use crate::graph::Settings;
use crate::program::op::{Binary, LANES, Lanes, OPERANDS, Op, Outcome, run};
use crate::program::{OUTPUTS, Program};

/// The places of a batch. Fewer than [`LANES`] points are filled up with copies of any.
#[derive(Clone, Debug)]
pub struct Points {
    /// First coordinates in metres.
    pub u: Lanes,
    /// Second coordinates in metres.
    pub v: Lanes,
    /// Extents of the points' pixels or texels in metres; 0 for exact points.
    pub footprint: Lanes,
}

impl Points {
    /// At most [`LANES`] places `[u, v, footprint]`.
    pub(crate) fn of(batch: &[[f64; 3]]) -> Self {
        let at = |axis: usize| std::array::from_fn(|lane| batch[lane.min(batch.len() - 1)][axis]);
        Self { u: at(0), v: at(1), footprint: at(2) }
    }
}

/// Evaluates a program. Results that are the same at all points are computed once, when the settings are set;
/// derivatives that are known to be zero are not computed at all.
pub struct Evaluator<'p> {
    program: &'p Program,
    /// Values of parameters, by slot.
    settings: Vec<f64>,
    /// Whether each result differs between points.
    varies: Vec<bool>,
    /// Whether each result has to be computed at every point: it varies, and is not only multiplied by 0.
    runs: Vec<bool>,
    /// The chosen slots that each result depends on, as places in the list of chosen ones, ascending.
    depends: Vec<Vec<usize>>,
    /// The place of each result's first derivative.
    first: Vec<usize>,
    values: Vec<Lanes>,
    derivatives: Vec<Lanes>,
    scratch: Box<Outcome>,
}

impl<'p> Evaluator<'p> {
    /// An evaluator of a program at these settings, with derivatives in these slots of them.
    pub fn new(program: &'p Program, settings: &Settings, chosen: &[usize]) -> Self {
        let (mut varies, mut depends): (Vec<bool>, Vec<Vec<usize>>) = (Vec::new(), Vec::new());
        for op in &program.ops {
            varies.push(op.reads_the_point() || op.inputs().iter().any(|input| varies[input.index()]));
            depends.push(dependencies(op, chosen, &depends));
        }
        let mut count = 0;
        let places = depends.iter().map(|slots| {
            count += slots.len();
            count - slots.len()
        });
        let first = places.collect();
        let mut evaluator = Self {
            program,
            settings: Vec::new(),
            runs: varies.clone(),
            varies,
            depends,
            first,
            values: vec![[0.0; LANES]; program.ops.len()],
            derivatives: vec![[0.0; LANES]; count],
            scratch: Box::new(Outcome::new()),
        };
        evaluator.set(settings);
        evaluator
    }

    pub fn set(&mut self, settings: &Settings) {
        self.settings.clear();
        self.settings.extend_from_slice(settings.numbers());
        for at in 0..self.program.ops.len() {
            if !self.varies[at] {
                self.step(at);
            }
        }
        self.prune();
    }

    /// Finds what has to be computed at every point. Noise whose amplitude is 0 is not.
    fn prune(&mut self) {
        self.runs.fill(false);
        for output in self.program.outputs {
            self.runs[output.index()] = true;
        }
        for at in (0..self.program.ops.len()).rev() {
            if !self.runs[at] || !self.varies[at] {
                self.runs[at] = false;
                continue;
            }
            let op = &self.program.ops[at];
            if self.is_multiplied_by_zero(op) {
                self.runs[at] = false;
                self.values[at] = [0.0; LANES];
                self.derivatives[self.first[at]..][..self.depends[at].len()].fill([0.0; LANES]);
                continue;
            }
            op.inputs().iter().for_each(|input| self.runs[input.index()] = true);
        }
    }

    /// Whether an instruction is a product of which one operand is 0 everywhere, whatever the chosen slots are.
    fn is_multiplied_by_zero(&self, op: &Op) -> bool {
        let is_zero = |at: usize| !self.varies[at] && self.depends[at].is_empty() && self.values[at][0] == 0.0;
        matches!(op, Op::Binary(Binary::Mul, _)) && op.inputs().iter().any(|input| is_zero(input.index()))
    }

    /// Evaluates the program at these points.
    pub fn run(&mut self, points: &Points) {
        for at in 0..self.program.ops.len() {
            match self.program.ops[at] {
                Op::PlaceU => self.values[at] = points.u,
                Op::PlaceV => self.values[at] = points.v,
                Op::Footprint => self.values[at] = points.footprint,
                _ if self.runs[at] => self.step(at),
                _ => {}
            }
        }
    }

    /// The values of an output's scalar, an index below [`OUTPUTS`].
    pub fn value(&self, output: usize) -> &Lanes {
        &self.values[self.program.outputs[output].index()]
    }

    /// The derivatives of an output's scalar in a chosen slot, by its place in the list; `None` where they are known to
    /// be zero.
    pub fn derivative(&self, output: usize, chosen: usize) -> Option<&Lanes> {
        let at = self.program.outputs[output].index();
        let place = self.depends[at].binary_search(&chosen).ok()?;
        Some(&self.derivatives[self.first[at] + place])
    }

    /// All outputs at one point of the batch.
    pub fn outputs(&self, lane: usize) -> [f64; OUTPUTS] {
        std::array::from_fn(|output| self.value(output)[lane])
    }

    fn step(&mut self, at: usize) {
        match self.program.ops[at] {
            Op::Number(bits) => self.values[at] = [f64::from_bits(bits); LANES],
            Op::Slot(slot) => {
                self.values[at] = [self.settings[slot as usize]; LANES];
                self.derivatives[self.first[at]..][..self.depends[at].len()].fill([1.0; LANES]);
            }
            ref op => {
                let inputs = op.inputs();
                let operands: [&Lanes; OPERANDS] =
                    std::array::from_fn(|operand| &self.values[inputs[operand.min(inputs.len() - 1)].index()]);
                run(op, operands, &self.settings, &mut self.scratch);
                self.values[at] = self.scratch.value;
                self.chain(at);
            }
        }
    }

    /// The chain rule: the derivatives of a result out of those of its operands.
    fn chain(&mut self, at: usize) {
        let (before, after) = self.derivatives.split_at_mut(self.first[at]);
        for (slot, sum) in self.depends[at].iter().zip(after) {
            *sum = [0.0; LANES];
            for (operand, input) in self.program.ops[at].inputs().iter().enumerate() {
                let Ok(place) = self.depends[input.index()].binary_search(slot) else { continue };
                let of_operand = &before[self.first[input.index()] + place];
                add_product(sum, &self.scratch.slopes[operand], of_operand);
            }
        }
    }
}

/// Adds where the slope is not zero, so that an infinite derivative of what is not selected does not count.
fn add_product(sum: &mut Lanes, slope: &Lanes, derivative: &Lanes) {
    for lane in 0..LANES {
        let product = slope[lane] * derivative[lane];
        sum[lane] += if slope[lane] == 0.0 { 0.0 } else { product };
    }
}

/// Which of the chosen slots a result depends on with a derivative that may differ from zero.
fn dependencies(op: &Op, chosen: &[usize], of_others: &[Vec<usize>]) -> Vec<usize> {
    if let Op::Slot(slot) = op {
        return chosen.iter().position(|&other| other == *slot as usize).into_iter().collect();
    }
    if op.is_piecewise_constant() {
        return Vec::new();
    }
    let mut all: Vec<usize> = op.inputs().iter().flat_map(|input| of_others[input.index()].iter().copied()).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// The outputs at places `[u, v, footprint]`, all in metres.
pub fn evaluate(program: &Program, settings: &Settings, places: &[[f64; 3]]) -> Vec<[f64; OUTPUTS]> {
    let mut evaluator = Evaluator::new(program, settings, &[]);
    let mut all = Vec::with_capacity(places.len());
    for batch in places.chunks(LANES) {
        evaluator.run(&Points::of(batch));
        all.extend((0..batch.len()).map(|lane| evaluator.outputs(lane)));
    }
    all
}

/// The most pixels a side: a picture of them takes 0.7 GB.
pub const MOST_PIXELS: usize = 4096;

/// A square of the domain, whose lower left corner is the origin. Its footprint is the side of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Square {
    size_metres: f64,
    resolution: usize,
}

/// The outputs of a material at a pixel's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pixel {
    /// Linear colour.
    pub base_color: [f64; 3],
    pub roughness: f64,
    pub metallic: f64,
}

impl Square {
    /// A square of this side in metres and in pixels. Fails unless the size is finite and above 0, and the
    /// resolution is 1 to [`MOST_PIXELS`].
    pub fn new(size_metres: f64, resolution: usize) -> Result<Self, ProceduralError> {
        let fits = size_metres.is_finite() && size_metres > 0.0 && (1..=MOST_PIXELS).contains(&resolution);
        let found = format!("{size_metres} metres and {resolution} pixels");
        let expected = format!("expected a size above 0 metres and 1 to {MOST_PIXELS} pixels a side, found {found}");
        if fits { Ok(Self { size_metres, resolution }) } else { Err(ProceduralError::Unusable(expected)) }
    }

    /// The places of a row of pixels.
    fn places(self, row: usize) -> Vec<[f64; 3]> {
        let pixel = self.size_metres / self.resolution as f64;
        let v = ((self.resolution - 1 - row) as f64 + 0.5) * pixel;
        (0..self.resolution).map(|column| [(column as f64 + 0.5) * pixel, v, pixel]).collect()
    }
}

/// Evaluates a graph at every pixel, row by row from the top. The same on any number of threads. Fails where a value is
/// not finite.
pub fn render(program: &Program, settings: &Settings, square: Square) -> Result<Vec<Pixel>, ProceduralError> {
    let pixels = |row: usize| -> Result<Vec<Pixel>, ProceduralError> {
        let places = square.places(row);
        let outputs = evaluate(program, settings, &places);
        places.iter().zip(outputs).map(|(place, outputs)| pixel(program, outputs, *place)).collect()
    };
    let rows: Vec<_> = (0..square.resolution).into_par_iter().map(pixels).collect();
    // The first row that fails, on any number of threads.
    Ok(rows.into_iter().collect::<Result<Vec<_>, _>>()?.concat())
}

fn pixel(program: &Program, outputs: [f64; OUTPUTS], [u, v, _]: [f64; 3]) -> Result<Pixel, ProceduralError> {
    const NAMES: [&str; OUTPUTS] = ["red", "green", "blue", "roughness", "metallic"];
    if let Some(at) = outputs.iter().position(|value| !value.is_finite()) {
        return Err(ProceduralError::Unusable(format!(
            "'{}' is not finite at ({u}, {v}) metres: its {} is {}; choose other parameters",
            program.name, NAMES[at], outputs[at]
        )));
    }
    let [red, green, blue, roughness, metallic] = outputs;
    Ok(Pixel { base_color: [red, green, blue], roughness, metallic })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::entry;

    fn points() -> Points {
        let along = |step: f64| std::array::from_fn(|lane| step * lane as f64);
        Points { u: along(0.013), v: along(0.007), footprint: [0.001; LANES] }
    }

    /// What is only multiplied by 0 is left out, which changes neither values nor derivatives.
    #[test]
    fn noise_of_no_amplitude_is_not_computed() {
        let graph = entry("plank").unwrap().graph().unwrap();
        let program = Program::new(&graph);
        let mut settings = Settings::defaults(&graph);
        let first = |name: &str| crate::graph::first_slot(&graph, graph.parameter(name).unwrap());
        let (grain, width) = (first("grain"), first("width"));
        let all = Evaluator::new(&program, &settings, &[]).runs.iter().filter(|runs| **runs).count();
        *settings.number_mut(grain) = 1e-12;
        let mut nearly = Evaluator::new(&program, &settings, &[width]);
        *settings.number_mut(grain) = 0.0;
        let mut without = Evaluator::new(&program, &settings, &[width]);
        assert!(without.runs.iter().filter(|runs| **runs).count() < all - 10);
        nearly.run(&points());
        without.run(&points());
        for lane in 0..LANES {
            assert!((nearly.value(0)[lane] - without.value(0)[lane]).abs() < 1e-9);
            let [a, b] = [&nearly, &without].map(|evaluator| evaluator.derivative(0, 0).unwrap()[lane]);
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
        // The twin: where the amplitude's own derivative is wanted, the noise is needed.
        let mut of_grain = Evaluator::new(&program, &settings, &[grain]);
        of_grain.run(&points());
        assert!(of_grain.derivative(0, 0).unwrap().iter().any(|slope| slope.abs() > 0.01));
        // Settings that are changed later count.
        *settings.number_mut(grain) = 0.3;
        without.set(&settings);
        without.run(&points());
        assert!((0..LANES).any(|lane| (nearly.value(0)[lane] - without.value(0)[lane]).abs() > 0.01));
    }
}
