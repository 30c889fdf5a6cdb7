//! The supported nodes of MaterialX' standard library: their names, and the variants of each, which MaterialX calls
//! nodedefs, with the defaults of `stdlib_defs.mtlx` of MaterialX 1.39.

use crate::value::Type::{Color3, Float, Integer, Vector2, Vector3};
use crate::value::{Type, Value, words};

words! {
    /// A node of MaterialX' standard library.
    pub enum Kind {
        Constant = "constant", Texcoord = "texcoord", Position = "position", Dot = "dot",
        Add = "add", Subtract = "subtract", Multiply = "multiply", Divide = "divide", Modulo = "modulo", Power = "power",
        SafePower = "safepower", Min = "min", Max = "max", Atan2 = "atan2",
        Absval = "absval", Sign = "sign", Floor = "floor", Ceil = "ceil", Round = "round", Fract = "fract",
        Sin = "sin", Cos = "cos", Tan = "tan", Asin = "asin", Acos = "acos", Sqrt = "sqrt", Ln = "ln", Exp = "exp",
        Clamp = "clamp", Invert = "invert", Remap = "remap", Contrast = "contrast", Smoothstep = "smoothstep", Mix = "mix",
        Luminance = "luminance", TriangleWave = "trianglewave",
        DotProduct = "dotproduct", Magnitude = "magnitude", Distance = "distance", Normalize = "normalize", Rotate2d = "rotate2d",
        Combine2 = "combine2", Combine3 = "combine3", Separate2 = "separate2", Separate3 = "separate3", Extract = "extract",
        Convert = "convert",
        IfGreater = "ifgreater", IfGreaterEq = "ifgreatereq", IfEqual = "ifequal", Switch = "switch",
        Noise2d = "noise2d", Fractal2d = "fractal2d", CellNoise2d = "cellnoise2d", WorleyNoise2d = "worleynoise2d",
    }
}

/// What an input is while a file does not set it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unset {
    Value(Value),
    /// The place in metres: the first set of texture coordinates.
    Place,
}

#[derive(Clone, Debug, PartialEq)]
pub struct InputDef {
    pub name: &'static str,
    pub kind: Type,
    /// Its value where a file does not set it.
    pub unset: Unset,
}

impl InputDef {
    pub(super) fn filled(name: &'static str, kind: Type, number: f64) -> Self {
        Self { name, kind, unset: Unset::Value(Value::filled(kind, number)) }
    }
}

/// A variant of a node.
#[derive(Clone, Debug, PartialEq)]
pub struct Signature {
    /// The inputs, in the order of the node's arguments.
    pub inputs: Vec<InputDef>,
    /// The outputs. A node with one calls it `out`.
    pub outputs: Vec<(&'static str, Type)>,
}

impl Signature {
    pub(super) fn new(inputs: Vec<InputDef>, out: Type) -> Self {
        Self { inputs, outputs: vec![("out", out)] }
    }

    /// The type that a file gives for the node: that of its output, or `multioutput`.
    pub fn type_word(&self) -> &'static str {
        match self.outputs.as_slice() {
            [(_, kind)] => kind.word(),
            _ => "multioutput",
        }
    }
}

const MATH: [Type; 4] = [Float, Color3, Vector2, Vector3];
const VECTORS: [Type; 2] = [Vector2, Vector3];
const REAL: [Type; 3] = [Float, Vector2, Vector3];
const WIDE: [Type; 3] = [Color3, Vector2, Vector3];

/// The variants of a node. The first one that fits the types of a file is meant. The function is a table, hence its
/// length.
pub fn signatures(kind: Kind) -> Vec<Signature> {
    use Kind as K;
    match kind {
        K::Constant => same(&MATH, &[("value", 0.0)]),
        K::Texcoord => vec![Signature::new(vec![InputDef::filled("index", Integer, 0.0)], Vector2)],
        K::Position => vec![Signature::new(Vec::new(), Vector3)],
        K::Dot | K::Absval | K::Sign | K::Floor | K::Ceil | K::Round | K::Fract => same(&MATH, &[("in", 0.0)]),
        K::Add | K::Subtract | K::Min | K::Max => with_float(&[("in1", 0.0)], &[("in2", 0.0)]),
        K::Multiply | K::Divide | K::Modulo | K::Power | K::SafePower => with_float(&[("in1", 0.0)], &[("in2", 1.0)]),
        K::Atan2 => same(&REAL, &[("iny", 0.0), ("inx", 1.0)]),
        K::Sin | K::Cos | K::Tan | K::Asin | K::Acos | K::Sqrt | K::Exp => same(&REAL, &[("in", 0.0)]),
        K::Ln => same(&REAL, &[("in", 1.0)]),
        K::Clamp | K::Smoothstep => with_float(&[("in", 0.0)], &[("low", 0.0), ("high", 1.0)]),
        K::Invert => with_float(&[("in", 0.0)], &[("amount", 1.0)]),
        K::Remap => with_float(&[("in", 0.0)], &[("inlow", 0.0), ("inhigh", 1.0), ("outlow", 0.0), ("outhigh", 1.0)]),
        K::Contrast => with_float(&[("in", 0.0)], &[("amount", 1.0), ("pivot", 0.5)]),
        K::Mix => with_float(&[("fg", 0.0), ("bg", 0.0)], &[("mix", 0.0)]),
        K::Luminance => luminance(),
        K::TriangleWave => same(&[Float], &[("in", 0.0)]),
        K::DotProduct | K::Distance => to_float(&[("in1", 0.0), ("in2", 0.0)]),
        K::Magnitude => to_float(&[("in", 0.0)]),
        K::Normalize => same(&VECTORS, &[("in", 0.0)]),
        K::Rotate2d => vec![Signature::new(
            vec![InputDef::filled("in", Vector2, 0.0), InputDef::filled("amount", Float, 0.0)],
            Vector2,
        )],
        K::Combine2 => vec![Signature::new(floats(&["in1", "in2"]), Vector2)],
        K::Combine3 => [Color3, Vector3].map(|kind| Signature::new(floats(&["in1", "in2", "in3"]), kind)).into(),
        K::Separate2 => vec![separate(Vector2, &["outx", "outy"])],
        K::Separate3 => {
            vec![separate(Color3, &["outr", "outg", "outb"]), separate(Vector3, &["outx", "outy", "outz"])]
        }
        K::Extract => WIDE.map(extract).into(),
        K::Convert => convert(),
        K::IfGreater | K::IfGreaterEq => MATH.map(|kind| conditional(kind, 1.0)).into(),
        K::IfEqual => MATH.map(|kind| conditional(kind, 0.0)).into(),
        K::Switch => MATH.map(switch).into(),
        K::Noise2d => noise(&[place(), InputDef::filled("pivot", Float, 0.0)]),
        K::Fractal2d => noise(&[
            place(),
            InputDef::filled("octaves", Integer, 3.0),
            InputDef::filled("lacunarity", Float, 2.0),
            InputDef::filled("diminish", Float, 0.5),
        ]),
        K::CellNoise2d => vec![Signature::new(vec![place()], Float)],
        K::WorleyNoise2d => REAL.map(worley).into(),
    }
}

/// A string input that does not matter here, since a plane in object space is all that is evaluated.
pub fn is_ignored_input(kind: Kind, name: &str) -> bool {
    matches!((kind, name), (Kind::Position, "space") | (Kind::Dot, "note"))
}

/// All inputs and the output of one type.
fn same(kinds: &[Type], inputs: &[(&'static str, f64)]) -> Vec<Signature> {
    let of = |&kind: &Type| Signature::new(filled(inputs, kind), kind);
    kinds.iter().map(of).collect()
}

/// As [`same`], and with the last inputs as floats beside wider first ones.
fn with_float(first: &[(&'static str, f64)], last: &[(&'static str, f64)]) -> Vec<Signature> {
    let mut all = same(&MATH, &[first, last].concat());
    let narrow = WIDE.map(|kind| Signature::new([filled(first, kind), filled(last, Float)].concat(), kind));
    all.extend(narrow);
    all
}

fn to_float(inputs: &[(&'static str, f64)]) -> Vec<Signature> {
    VECTORS.map(|kind| Signature::new(filled(inputs, kind), Float)).into()
}

fn filled(inputs: &[(&'static str, f64)], kind: Type) -> Vec<InputDef> {
    inputs.iter().map(|(name, number)| InputDef::filled(name, kind, *number)).collect()
}

fn floats(names: &[&'static str]) -> Vec<InputDef> {
    names.iter().map(|name| InputDef::filled(name, Float, 0.0)).collect()
}

fn place() -> InputDef {
    InputDef { name: "texcoord", kind: Vector2, unset: Unset::Place }
}

fn luminance() -> Vec<Signature> {
    let acescg = Value::parse(Color3, "0.2722287, 0.6740818, 0.0536895").expect("a literal colour");
    let weights = InputDef { name: "lumacoeffs", kind: Color3, unset: Unset::Value(acescg) };
    vec![Signature::new(vec![InputDef::filled("in", Color3, 0.0), weights], Color3)]
}

fn separate(kind: Type, outputs: &[&'static str]) -> Signature {
    let outputs = outputs.iter().map(|name| (*name, Float)).collect();
    Signature { inputs: vec![InputDef::filled("in", kind, 0.0)], outputs }
}

fn extract(kind: Type) -> Signature {
    Signature::new(vec![InputDef::filled("in", kind, 0.0), InputDef::filled("index", Integer, 0.0)], Float)
}

fn convert() -> Vec<Signature> {
    let pairs = [
        (Float, Color3),
        (Float, Vector2),
        (Float, Vector3),
        (Color3, Vector2),
        (Color3, Vector3),
        (Vector2, Color3),
        (Vector2, Vector3),
        (Vector3, Color3),
        (Vector3, Vector2),
        (Integer, Float),
    ];
    pairs.map(|(from, to)| Signature::new(vec![InputDef::filled("in", from, 0.0)], to)).into()
}

fn conditional(kind: Type, value1: f64) -> Signature {
    let values = [InputDef::filled("value1", Float, value1), InputDef::filled("value2", Float, 0.0)];
    let inputs = [InputDef::filled("in1", kind, 0.0), InputDef::filled("in2", kind, 0.0)];
    Signature::new([values, inputs].concat(), kind)
}

fn switch(kind: Type) -> Signature {
    const NAMES: [&str; 10] = ["in1", "in2", "in3", "in4", "in5", "in6", "in7", "in8", "in9", "in10"];
    let mut inputs: Vec<InputDef> = NAMES.iter().map(|name| InputDef::filled(name, kind, 0.0)).collect();
    inputs.push(InputDef::filled("which", Float, 0.0));
    Signature::new(inputs, kind)
}

/// The variants of a Perlin noise: its amplitude is as wide as the output, or a float.
fn noise(others: &[InputDef]) -> Vec<Signature> {
    let variant = |amplitude: Type, out: Type| {
        Signature::new([others, &[InputDef::filled("amplitude", amplitude, 1.0)]].concat(), out)
    };
    let full = [(Float, Float), (Vector3, Color3), (Vector2, Vector2), (Vector3, Vector3)];
    full.into_iter().chain(WIDE.map(|kind| (Float, kind))).map(|(amplitude, out)| variant(amplitude, out)).collect()
}

fn worley(kind: Type) -> Signature {
    let inputs = vec![place(), InputDef::filled("jitter", Float, 1.0), InputDef::filled("style", Integer, 0.0)];
    Signature::new(inputs, kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_node_has_variants_with_distinct_inputs() {
        let mut variants = 0;
        for &kind in Kind::ALL {
            let all = signatures(kind);
            assert!(!all.is_empty(), "{}", kind.word());
            for signature in &all {
                let mut names: Vec<_> = signature.inputs.iter().map(|input| input.name).collect();
                names.sort_unstable();
                names.dedup();
                assert_eq!(names.len(), signature.inputs.len(), "{}", kind.word());
            }
            variants += all.len();
        }
        assert!(variants > 200, "{variants}");
        assert!(Kind::ALL.len() >= 45);
    }
}
