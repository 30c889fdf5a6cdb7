//! Every variant of every node against the OSL of MaterialX in Cycles: graphs of a single node whose inputs are floats.

use std::collections::BTreeMap;

use mateval_procedural::graph::{Node, Parameter, Source};
use mateval_procedural::node::{Kind, Signature, signatures};
use mateval_procedural::value::{Type, Value};
use mateval_procedural::{Evaluator, Graph, Program, Settings};

use super::osl::{Input, PLACES, evaluate};

/// A graph and the values of its inputs.
pub struct Builder {
    graph: Graph,
    inputs: Vec<Input>,
}

/// Scale and offset of an input's values, which are up to 4096 multiples of the scale.
fn range(kind: Kind, input: &str) -> (usize, f64, f64) {
    match (kind, input) {
        (Kind::Noise2d | Kind::WorleyNoise2d | Kind::CellNoise2d, "texcoord") => (4096, 1.0 / 128.0, -16.0),
        (Kind::WorleyNoise2d, "jitter") | (Kind::Fractal2d, "diminish") => (4096, 1.0 / 4096.0, 0.0),
        // Few digits, so that single precision holds the places of three octaves, 193 units away, exactly.
        (Kind::Fractal2d, "texcoord") => (1024, 1.0 / 128.0, -4.0),
        (Kind::Fractal2d, "lacunarity") => (16, 1.0 / 8.0, 1.0),
        (Kind::Rotate2d, "amount") => (4096, 0.25, -512.0),
        // Steps whose low end is above the high one are not defined.
        (Kind::Smoothstep | Kind::Clamp, "low") => (4096, 1.0 / 1024.0, -4.0),
        (Kind::Smoothstep | Kind::Clamp, "high") => (4096, 1.0 / 1024.0, 0.0),
        (Kind::IfEqual, "value1" | "value2") => (4, 1.0, 0.0),
        (Kind::Switch, "which") => (4096, 1.0 / 256.0, -2.0),
        _ => (4096, 1.0 / 512.0, -4.0),
    }
}

impl Builder {
    fn new(name: String) -> Self {
        let outputs = [Source::Unset, Source::Unset, Source::Unset];
        let graph = Graph { name, doc: None, parameters: Vec::new(), nodes: Vec::new(), outputs };
        Self { graph, inputs: Vec::new() }
    }

    /// A float parameter with values of its own.
    fn parameter(&mut self, (modulus, scale, offset): (usize, f64, f64)) -> Source {
        let at = self.inputs.len();
        let name = format!("a{at}");
        // An odd step visits all multiples.
        let step = 2 * (at * at * 37 + at * 101 + 551) % PLACES + 1;
        self.inputs.push(Input { name: name.clone(), step, start: 77 * at, modulus, scale, offset });
        let value = Value::float(0.0).unwrap();
        self.graph.parameters.push(Parameter { name, value, least: None, most: None, doc: None });
        Source::Parameter(at)
    }

    fn node(&mut self, kind: Kind, signature: Signature, inputs: Vec<Source>) -> usize {
        let name = format!("n{}", self.graph.nodes.len());
        self.graph.nodes.push(Node { name, kind, signature, inputs });
        self.graph.nodes.len() - 1
    }

    /// An input out of float parameters.
    fn input(&mut self, kind: Type, range: (usize, f64, f64)) -> Source {
        let parts: Vec<Source> = (0..kind.width()).map(|_| self.parameter(range)).collect();
        match kind {
            Type::Float | Type::Integer => parts.into_iter().next().unwrap(),
            Type::Vector2 => self.made(Kind::Combine2, kind, parts),
            Type::Vector3 | Type::Color3 => self.made(Kind::Combine3, kind, parts),
        }
    }

    /// A node whose variant follows from its output.
    fn made(&mut self, kind: Kind, out: Type, inputs: Vec<Source>) -> Source {
        let signature = signatures(kind).into_iter().find(|signature| signature.outputs[0].1 == out).unwrap();
        Source::Node { node: self.node(kind, signature, inputs), output: 0 }
    }

    /// The outputs of a node as a colour.
    fn color(&mut self, node: usize, signature: &Signature) -> Source {
        let source = |output: usize| Source::Node { node, output };
        let kind = signature.outputs[0].1;
        match signature.outputs.len() {
            1 if kind == Type::Color3 => source(0),
            1 => {
                let fits = |convert: &Signature| convert.inputs[0].kind == kind && convert.outputs[0].1 == Type::Color3;
                let convert = signatures(Kind::Convert).into_iter().find(fits).unwrap();
                Source::Node { node: self.node(Kind::Convert, convert, vec![source(0)]), output: 0 }
            }
            count => {
                let parts = (0..3).map(|output| if output < count { source(output) } else { Source::Unset });
                self.made(Kind::Combine3, Type::Color3, parts.collect())
            }
        }
    }

    fn finish(mut self, color: Source) -> (Graph, Vec<Input>) {
        let half = Source::Value(Value::float(0.5).unwrap());
        let half = self.made(Kind::Constant, Type::Float, vec![half]);
        self.graph.outputs = [color, half.clone(), half];
        (self.graph, self.inputs)
    }
}

/// The whole numbers with which a variant is tried.
fn whole_numbers(kind: Kind, signature: &Signature) -> Vec<i32> {
    match kind {
        Kind::Fractal2d => vec![1, 3],
        Kind::WorleyNoise2d => vec![0, 1],
        Kind::Extract => (0..signature.inputs[0].kind.width()).map(|at| i32::try_from(at).unwrap()).collect(),
        Kind::Convert => vec![-3],
        _ => Vec::new(),
    }
}

/// A node with these variant and whole number, all other inputs being parameters.
fn case(kind: Kind, signature: &Signature, name: String, whole: Option<i32>) -> (Graph, Vec<Input>) {
    let mut builder = Builder::new(name);
    let sources = signature.inputs.iter().map(|def| match whole {
        Some(number) if def.kind == Type::Integer => {
            Source::Value(Value::parse(Type::Integer, &number.to_string()).unwrap())
        }
        _ => builder.input(def.kind, range(kind, def.name)),
    });
    let sources = sources.collect();
    let node = builder.node(kind, signature.clone(), sources);
    let color = builder.color(node, signature);
    builder.finish(color)
}

/// Every variant of every node, except for the place itself: texture coordinates and position.
pub fn all() -> Vec<(Kind, Graph, Vec<Input>)> {
    let mut cases = Vec::new();
    for &kind in Kind::ALL.iter().filter(|kind| !matches!(kind, Kind::Texcoord | Kind::Position)) {
        for signature in &signatures(kind) {
            let has_whole = signature.inputs.iter().any(|def| def.kind == Type::Integer);
            let numbers = if has_whole { whole_numbers(kind, signature) } else { Vec::new() };
            let choices: Vec<Option<i32>> =
                if has_whole { numbers.into_iter().map(Some).collect() } else { vec![None] };
            for whole in choices {
                let name = format!("{}_{}", kind.word(), cases.len());
                let (graph, inputs) = case(kind, signature, name, whole);
                cases.push((kind, graph, inputs));
            }
        }
    }
    cases
}

/// How much a number may differ, relative to it where it is above 1.
const TOLERANCE: f64 = 1e-4;

/// The base colours of a graph by this crate.
fn ours(graph: &Graph, inputs: &[Input]) -> Vec<[f64; 3]> {
    let program = Program::new(graph);
    let mut settings = Settings::defaults(graph);
    let mut evaluator = Evaluator::new(&program, &settings, &[]);
    let mut at = |place: usize| {
        for (slot, input) in inputs.iter().enumerate() {
            *settings.number_mut(slot) = input.at(place);
        }
        // Nothing depends on the point, so setting the parameters evaluates everything.
        evaluator.set(&settings);
        let [red, green, blue, ..] = evaluator.outputs(0);
        [red, green, blue]
    };
    (0..PLACES).map(&mut at).collect()
}

/// The greatest difference, relative where numbers are above 1; infinite where one is not a number.
fn difference(ours: &[f64; 3], osl: &[f32; 3]) -> f64 {
    let of = |(a, b): (&f64, &f32)| (a - f64::from(*b)).abs() / a.abs().max(1.0);
    let differences = ours.iter().zip(osl).map(of);
    // The maximum of two numbers ignores NaN.
    differences.map(|difference| if difference.is_nan() { f64::INFINITY } else { difference }).fold(0.0, f64::max)
}

#[test]
fn nodes_are_those_of_osl() {
    let cases = all();
    let graphs: Vec<(Graph, Vec<Input>)> = cases.iter().map(|(_, g, inputs)| (g.clone(), inputs.clone())).collect();
    let osl = evaluate(&graphs);
    let mut worst: BTreeMap<&str, f64> = BTreeMap::new();
    let mut wrong = Vec::new();
    for ((kind, graph, inputs), osl) in cases.iter().zip(&osl) {
        let ours = ours(graph, inputs);
        let differences: Vec<f64> = ours.iter().zip(osl).map(|(ours, osl)| difference(ours, osl)).collect();
        let greatest = differences.iter().copied().fold(0.0, f64::max);
        let known = worst.entry(kind.word()).or_default();
        *known = known.max(greatest);
        let beyond = differences.iter().filter(|&&difference| difference > TOLERANCE).count();
        if beyond > 0 {
            let first = differences.iter().position(|&d| d > TOLERANCE).unwrap();
            let values: Vec<f64> = inputs.iter().map(|input| input.at(first)).collect();
            wrong.push(format!("{}: {beyond} places, as {values:?}: {:?} {:?}", graph.name, ours[first], osl[first]));
        }
        // The twin: colours of the next place. A converted whole number is the same everywhere.
        let shifted = ours.iter().skip(1).zip(osl).filter(|(ours, osl)| difference(ours, osl) > TOLERANCE).count();
        assert!(shifted > 0 || inputs.is_empty(), "{} does not depend on its inputs", graph.name);
    }
    for (word, difference) in &worst {
        eprintln!("{word}: {difference:.1e}");
    }
    eprintln!("{} variants of {} nodes at {PLACES} places", cases.len(), worst.len());
    assert_eq!(wrong, [""; 0]);
    assert!(cases.len() > 200 && worst.len() > 45);
}
