//! The translation of noises.

use super::argument::Arguments;
use super::builder::Builder;
use super::op::{Count, Op, Reg, Worley};
use crate::node::kind::Kind;
use crate::noise::perlin::Channel;
use crate::value::Type;

/// How far the second component of a two-dimensional fractal is from the first.
const SECOND_COMPONENT: [f64; 2] = [19.0, 193.0];

/// The components of a noise. The place is the first input of all of them.
pub(super) fn lower(b: &mut Builder, kind: Kind, out: Type, args: Arguments) -> Vec<Reg> {
    let place = [args.at(0, 0), args.at(0, 1)];
    (0..out.width())
        .map(|c| match kind {
            Kind::Noise2d => {
                let noise = b.push(Op::Perlin(channel(out, c), place));
                let scaled = b.mul(noise, args.at(2, c));
                b.add(scaled, args.at(1, 0))
            }
            Kind::Fractal2d => {
                let noise = fractal(b, out, c, args, place);
                b.mul(noise, args.at(4, c))
            }
            Kind::CellNoise2d => b.push(Op::Cell(place)),
            Kind::WorleyNoise2d => {
                let inputs = [place[0], place[1], args.at(1, 0)];
                let rank = u8::try_from(c).expect("there are at most three components");
                let noise = Worley { style: args.count(2), rank, cell: channel(out, c) };
                b.push(Op::Worley(noise, inputs))
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
pub(super) fn count(b: &mut Builder, count: Count) -> Reg {
    match count {
        Count::Number(number) => b.number(f64::from(number)),
        Count::Slot(slot) => b.push(Op::Slot(slot)),
    }
}
