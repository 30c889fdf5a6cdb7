//! The translation of nodes that work on each component by itself. Each follows the definition of MaterialX 1.39
//! (`stdlib_ng.mtlx` and the sources of its code generators).

use super::argument::{Argument, Arguments};
use super::builder::Builder;
use super::op::{Binary, Op, Reg, Test, Unary};
use super::{pattern, vector};
use crate::node::kind::Kind;
use crate::node::signature::Signature;
use crate::value::Type;

/// The results of a node: the components of each output.
pub(super) fn lower(b: &mut Builder, kind: Kind, signature: &Signature, arguments: &[Argument]) -> Vec<Vec<Reg>> {
    let args = Arguments(arguments);
    let out = signature.outputs[0].1;
    match kind {
        Kind::Separate2 | Kind::Separate3 => args.all(0).iter().map(|&reg| vec![reg]).collect(),
        Kind::Texcoord => vec![vec![b.push(Op::PlaceU), b.push(Op::PlaceV)]],
        Kind::Position => vec![vec![b.push(Op::PlaceU), b.push(Op::PlaceV), b.number(0.0)]],
        Kind::Convert if args.all(0).is_empty() => vec![vec![pattern::count(b, args.count(0))]],
        Kind::Convert | Kind::Rotate2d | Kind::Combine2 | Kind::Combine3 | Kind::Extract | Kind::Luminance => {
            vec![vector::lower(b, kind, out, args)]
        }
        Kind::DotProduct | Kind::Magnitude | Kind::Distance | Kind::Normalize => {
            vec![vector::lower(b, kind, out, args)]
        }
        Kind::Noise2d | Kind::Fractal2d | Kind::CellNoise2d | Kind::WorleyNoise2d => {
            vec![pattern::lower(b, kind, out, args)]
        }
        _ => vec![each_component(b, kind, out, args)],
    }
}

fn each_component(b: &mut Builder, kind: Kind, out: Type, args: Arguments) -> Vec<Reg> {
    (0..out.width()).map(|c| component(b, kind, |input| args.at(input, c))).collect()
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
