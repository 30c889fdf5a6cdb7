//! The translation of nodes to instructions. Each follows the definition of MaterialX 1.39 (`stdlib_ng.mtlx` and the
//! sources of its code generators).

use std::collections::BTreeMap;

use super::op::{Binary, Count, Op, Reg, Test, Unary, Worley};
use crate::node::{Kind, Signature};
use crate::noise::Channel;
use crate::value::Type;

/// A list of instructions, each after its operands.
#[derive(Default)]
pub struct Builder {
    ops: Vec<Op>,
    known: BTreeMap<Op, Reg>,
}

impl Builder {
    /// The result of an instruction.
    pub fn push(&mut self, op: Op) -> Reg {
        if let Some(&known) = self.known.get(&op) {
            return known;
        }
        let reg = Reg(u32::try_from(self.ops.len()).expect("limits keep programs below 2^32 instructions"));
        self.ops.push(op);
        self.known.insert(op, reg);
        reg
    }

    pub fn number(&mut self, number: f64) -> Reg {
        self.push(Op::Number(number.to_bits()))
    }

    /// A function of one number.
    pub fn unary(&mut self, function: Unary, x: Reg) -> Reg {
        self.push(Op::Unary(function, [x]))
    }

    /// A function of two numbers.
    pub fn binary(&mut self, function: Binary, a: Reg, b: Reg) -> Reg {
        self.push(Op::Binary(function, [a, b]))
    }

    pub fn add(&mut self, a: Reg, b: Reg) -> Reg {
        self.binary(Binary::Add, a, b)
    }

    pub fn sub(&mut self, a: Reg, b: Reg) -> Reg {
        self.binary(Binary::Sub, a, b)
    }

    pub fn mul(&mut self, a: Reg, b: Reg) -> Reg {
        self.binary(Binary::Mul, a, b)
    }

    pub fn into_ops(self) -> Vec<Op> {
        self.ops
    }
}

pub(super) enum Argument {
    /// One result for each component.
    Regs(Vec<Reg>),
    /// A whole number.
    Count(Count),
}

/// The inputs of a node, in the order of its signature.
#[derive(Clone, Copy)]
struct Arguments<'a>(&'a [Argument]);

impl Arguments<'_> {
    /// All components of an input; none for a whole number.
    fn all(&self, input: usize) -> &[Reg] {
        match &self.0[input] {
            Argument::Regs(regs) => regs,
            Argument::Count(_) => &[],
        }
    }

    /// A component of an input. A float serves as every component.
    fn at(&self, input: usize, component: usize) -> Reg {
        let regs = self.all(input);
        if regs.len() == 1 { regs[0] } else { regs[component] }
    }

    /// A whole number.
    fn count(&self, input: usize) -> Count {
        match &self.0[input] {
            Argument::Count(count) => *count,
            Argument::Regs(_) => unreachable!("signatures give these inputs the type integer"),
        }
    }

    /// A whole number that the reader has checked to be a constant.
    fn constant(&self, input: usize) -> usize {
        match self.count(input) {
            Count::Number(number) => usize::try_from(number).unwrap_or(0),
            Count::Slot(_) => unreachable!("the reader refuses parameters here"),
        }
    }
}

/// The results of a node: the components of each output.
pub(super) fn lower(b: &mut Builder, kind: Kind, signature: &Signature, arguments: &[Argument]) -> Vec<Vec<Reg>> {
    let args = Arguments(arguments);
    let out = signature.outputs[0].1;
    vec![match kind {
        Kind::Separate2 | Kind::Separate3 => return args.all(0).iter().map(|&reg| vec![reg]).collect(),
        Kind::Texcoord => vec![b.push(Op::PlaceU), b.push(Op::PlaceV)],
        Kind::Position => vec![b.push(Op::PlaceU), b.push(Op::PlaceV), b.number(0.0)],
        Kind::Convert if args.all(0).is_empty() => vec![count(b, args.count(0))],
        Kind::Convert => convert(b, out, args.all(0)),
        Kind::Combine2 => (0..2).map(|input| args.at(input, 0)).collect(),
        Kind::Combine3 => (0..3).map(|input| args.at(input, 0)).collect(),
        Kind::Extract => vec![args.all(0)[args.constant(1)]],
        Kind::Rotate2d => rotate(b, args),
        Kind::Luminance => vec![dot(b, args.all(0), args.all(1)); 3],
        Kind::DotProduct => vec![dot(b, args.all(0), args.all(1))],
        Kind::Magnitude => vec![length(b, args.all(0))],
        Kind::Distance => {
            let pairs = args.all(0).iter().zip(args.all(1));
            let between: Vec<Reg> = pairs.map(|(&p, &q)| b.sub(p, q)).collect();
            vec![length(b, &between)]
        }
        Kind::Normalize => {
            let length = length(b, args.all(0));
            args.all(0).iter().map(|&x| b.binary(Binary::Div, x, length)).collect()
        }
        Kind::Noise2d | Kind::Fractal2d | Kind::CellNoise2d | Kind::WorleyNoise2d => noise(b, kind, out, args),
        _ => (0..out.width()).map(|c| component(b, kind, |input| args.at(input, c))).collect(),
    }]
}

/// One component of a node, whose inputs are `x(0)`, `x(1)`, ...
fn component(b: &mut Builder, kind: Kind, x: impl Fn(usize) -> Reg) -> Reg {
    if let Some(function) = unary(kind) {
        return b.unary(function, x(0));
    }
    if let Some(function) = binary(kind) {
        return b.binary(function, x(0), x(1));
    }
    match kind {
        Kind::Fract => fract(b, x(0)),
        Kind::SafePower => {
            let (sign, size) = (b.unary(Unary::Sign, x(0)), b.unary(Unary::Abs, x(0)));
            let power = b.binary(Binary::Pow, size, x(1));
            b.mul(sign, power)
        }
        Kind::Clamp => {
            let raised = b.binary(Binary::Max, x(0), x(1));
            b.binary(Binary::Min, raised, x(2))
        }
        Kind::Invert => b.sub(x(1), x(0)),
        Kind::Remap => remap(b, [x(0), x(1), x(2), x(3), x(4)]),
        Kind::Contrast => {
            let (centred, amount) = (b.sub(x(0), x(2)), x(1));
            let scaled = b.mul(centred, amount);
            b.add(scaled, x(2))
        }
        Kind::Smoothstep => b.push(Op::Smoothstep([x(0), x(1), x(2)])),
        Kind::Mix => mix(b, x(0), x(1), x(2)),
        Kind::TriangleWave => triangle_wave(b, x(0)),
        Kind::IfGreater => b.push(Op::Select(Test::Greater, [x(0), x(1), x(2), x(3)])),
        Kind::IfGreaterEq => b.push(Op::Select(Test::GreaterEq, [x(0), x(1), x(2), x(3)])),
        Kind::IfEqual => b.push(Op::Select(Test::Equal, [x(0), x(1), x(2), x(3)])),
        Kind::Switch => switch(b, x),
        // Constant and dot; the others do not come here.
        _ => x(0),
    }
}

fn unary(kind: Kind) -> Option<Unary> {
    Some(match kind {
        Kind::Absval => Unary::Abs,
        Kind::Sign => Unary::Sign,
        Kind::Floor => Unary::Floor,
        Kind::Ceil => Unary::Ceil,
        Kind::Round => Unary::Round,
        Kind::Sin => Unary::Sin,
        Kind::Cos => Unary::Cos,
        Kind::Tan => Unary::Tan,
        Kind::Asin => Unary::Asin,
        Kind::Acos => Unary::Acos,
        Kind::Sqrt => Unary::Sqrt,
        Kind::Ln => Unary::Ln,
        Kind::Exp => Unary::Exp,
        _ => return None,
    })
}

fn binary(kind: Kind) -> Option<Binary> {
    Some(match kind {
        Kind::Add => Binary::Add,
        Kind::Subtract => Binary::Sub,
        Kind::Multiply => Binary::Mul,
        Kind::Divide => Binary::Div,
        Kind::Modulo => Binary::Mod,
        Kind::Power => Binary::Pow,
        Kind::Min => Binary::Min,
        Kind::Max => Binary::Max,
        Kind::Atan2 => Binary::Atan2,
        _ => return None,
    })
}

fn fract(b: &mut Builder, x: Reg) -> Reg {
    let floor = b.unary(Unary::Floor, x);
    b.sub(x, floor)
}

fn remap(b: &mut Builder, [x, in_low, in_high, out_low, out_high]: [Reg; 5]) -> Reg {
    let (above, range) = (b.sub(x, in_low), b.sub(in_high, in_low));
    let share = b.binary(Binary::Div, above, range);
    let out_range = b.sub(out_high, out_low);
    let scaled = b.mul(out_range, share);
    b.add(out_low, scaled)
}

fn mix(b: &mut Builder, front: Reg, back: Reg, share: Reg) -> Reg {
    let one = b.number(1.0);
    let rest = b.sub(one, share);
    let (front, back) = (b.mul(front, share), b.mul(back, rest));
    b.add(front, back)
}

/// `0.5 - |fract(|x|) - 0.5|`.
fn triangle_wave(b: &mut Builder, x: Reg) -> Reg {
    let size = b.unary(Unary::Abs, x);
    let share = fract(b, size);
    let half = b.number(0.5);
    let centred = b.sub(share, half);
    let away = b.unary(Unary::Abs, centred);
    b.sub(half, away)
}

/// The first input below whose number `which` is; zero from 10 on.
fn switch(b: &mut Builder, x: impl Fn(usize) -> Reg) -> Reg {
    const INPUTS: usize = 10;
    let which = x(INPUTS);
    let mut found = b.number(0.0);
    for input in (0..INPUTS).rev() {
        let bound = b.number((input + 1) as f64);
        found = b.push(Op::Select(Test::Greater, [bound, which, x(input), found]));
    }
    found
}

/// A float fills all components; a longer vector is cut, a shorter one is filled with zeros.
fn convert(b: &mut Builder, out: Type, from: &[Reg]) -> Vec<Reg> {
    let zero = b.number(0.0);
    let at = |c: usize| if from.len() == 1 { from[0] } else { from.get(c).copied().unwrap_or(zero) };
    (0..out.width()).map(at).collect()
}

/// Clockwise for a positive angle in degrees, which turns what is drawn counterclockwise.
fn rotate(b: &mut Builder, args: Arguments) -> Vec<Reg> {
    let (x, y) = (args.at(0, 0), args.at(0, 1));
    let radians_per_degree = b.number(std::f64::consts::PI / 180.0);
    let angle = b.mul(args.at(1, 0), radians_per_degree);
    let (sin, cos) = (b.unary(Unary::Sin, angle), b.unary(Unary::Cos, angle));
    let (cos_x, sin_y) = (b.mul(cos, x), b.mul(sin, y));
    let (cos_y, sin_x) = (b.mul(cos, y), b.mul(sin, x));
    vec![b.add(cos_x, sin_y), b.sub(cos_y, sin_x)]
}

fn dot(b: &mut Builder, p: &[Reg], q: &[Reg]) -> Reg {
    let products: Vec<Reg> = p.iter().zip(q).map(|(&p, &q)| b.mul(p, q)).collect();
    products[1..].iter().fold(products[0], |sum, &product| b.add(sum, product))
}

fn length(b: &mut Builder, p: &[Reg]) -> Reg {
    let square = dot(b, p, p);
    b.unary(Unary::Sqrt, square)
}

/// How far the second component of a two-dimensional fractal is from the first.
const SECOND_COMPONENT: [f64; 2] = [19.0, 193.0];

/// The components of a noise. The place is the first input of all of them.
fn noise(b: &mut Builder, kind: Kind, out: Type, args: Arguments) -> Vec<Reg> {
    let place = [args.at(0, 0), args.at(0, 1)];
    (0..out.width())
        .map(|c| match kind {
            Kind::Noise2d => {
                let perlin = b.push(Op::Perlin(channel(out, c), place));
                let scaled = b.mul(perlin, args.at(2, c));
                b.add(scaled, args.at(1, 0))
            }
            Kind::Fractal2d => {
                let sum = fractal(b, out, c, args, place);
                b.mul(sum, args.at(4, c))
            }
            Kind::CellNoise2d => b.push(Op::Cell(place)),
            Kind::WorleyNoise2d => {
                let inputs = [place[0], place[1], args.at(1, 0)];
                let rank = u8::try_from(c).expect("there are at most three components");
                let worley = Worley { style: args.count(2), rank, cell: channel(out, c) };
                b.push(Op::Worley(worley, inputs))
            }
            _ => unreachable!("the caller passes these nodes only"),
        })
        .collect()
}

/// Floats have a noise of their own; vectors and colours share one.
fn channel(out: Type, component: usize) -> Channel {
    match out {
        Type::Float | Type::Integer => Channel::Scalar,
        _ => Channel::Component(u8::try_from(component).expect("there are at most three components")),
    }
}

/// A component of a fractal. Those of `vector2` are floats' fractals at two places.
fn fractal(b: &mut Builder, out: Type, component: usize, args: Arguments, place: [Reg; 2]) -> Reg {
    let (channel, place) = match (out, component) {
        (Type::Vector2, 0) => (Channel::Scalar, place),
        (Type::Vector2, _) => {
            let offsets = SECOND_COMPONENT.map(|offset| b.number(offset));
            (Channel::Scalar, [b.add(place[0], offsets[0]), b.add(place[1], offsets[1])])
        }
        _ => (channel(out, component), place),
    };
    b.push(Op::Fractal(channel, args.count(1), [place[0], place[1], args.at(2, 0), args.at(3, 0)]))
}

/// A whole number as a result.
fn count(b: &mut Builder, count: Count) -> Reg {
    match count {
        Count::Number(number) => b.number(f64::from(number)),
        Count::Slot(slot) => b.push(Op::Slot(slot)),
    }
}
