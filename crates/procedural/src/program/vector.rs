//! The translation of nodes that combine components.

use super::argument::Arguments;
use super::builder::Builder;
use super::op::{Binary, Reg, Unary};
use crate::node::kind::Kind;
use crate::value::Type;

/// The components of a node's output.
pub(super) fn lower(b: &mut Builder, kind: Kind, out: Type, args: Arguments) -> Vec<Reg> {
    match kind {
        Kind::Combine2 => (0..2).map(|input| args.at(input, 0)).collect(),
        Kind::Combine3 => (0..3).map(|input| args.at(input, 0)).collect(),
        Kind::Extract => vec![args.all(0)[args.constant(1)]],
        Kind::Convert => convert(b, out, args.all(0)),
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
        _ => unreachable!("the caller passes these nodes only"),
    }
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
