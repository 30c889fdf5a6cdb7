//! Scalar instructions: one number a point out of at most four others, what each computes, and its derivatives in the
//! operands.

use crate::noise::{Channel, cell, distance, fractal, nearest_cell, perlin};

/// The number of points that are evaluated together.
pub const LANES: usize = 64;

/// One number for each point of a batch.
pub type Lanes = [f64; LANES];

/// The result of an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Reg(pub u32);

impl Reg {
    /// Its place in the program.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A function of one number. Where mathematics leaves a value undefined, it is that of Open Shading Language.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the variants are functions known by these names")]
pub enum Unary {
    Abs,
    Sign,
    Floor,
    Ceil,
    /// Halves are rounded away from zero.
    Round,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Sqrt,
    Ln,
    Exp,
}

/// A function of two numbers. Where mathematics leaves a value undefined, it is that of Open Shading Language.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the variants are functions known by these names")]
pub enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    /// `a - b * floor(a / b)`.
    Mod,
    Pow,
    Min,
    Max,
    /// Of y and x.
    Atan2,
}

/// A comparison of the first two operands, which selects the third or the fourth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the variants are comparisons known by these names")]
pub enum Test {
    Greater,
    GreaterEq,
    Equal,
}

/// A whole number: a constant, or the value of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Count {
    Number(i32),
    /// A slot of the settings.
    Slot(u32),
}

/// What of Worley's noise is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Worley {
    /// 0 for distances, 1 for the number of the nearest point's cell.
    pub style: Count,
    /// Which distance: 0 to the nearest point, 1 to the second, 2 to the third.
    pub rank: u8,
    /// Which number of the cell.
    pub cell: Channel,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Op {
    /// A constant, as the bits of an `f64`.
    Number(u64),
    /// A component of a parameter, by its slot in the settings.
    Slot(u32),
    /// The first coordinate of the point in metres.
    PlaceU,
    /// The second coordinate of the point in metres.
    PlaceV,
    /// The extent of the point's pixel or texel in metres.
    Footprint,
    /// A function of one number.
    Unary(Unary, [Reg; 1]),
    /// A function of two numbers.
    Binary(Binary, [Reg; 2]),
    /// Selects the third operand where the test of the first two holds, else the fourth.
    Select(Test, [Reg; 4]),
    /// Hermite's step of `in`, `low`, `high`.
    Smoothstep([Reg; 3]),
    /// Perlin noise of x, y.
    Perlin(Channel, [Reg; 2]),
    /// A sum of octaves of x, y, lacunarity, diminish.
    Fractal(Channel, Count, [Reg; 4]),
    /// Cell noise of x, y.
    Cell([Reg; 2]),
    /// Worley noise of x, y, jitter.
    Worley(Worley, [Reg; 3]),
}

impl Op {
    pub fn inputs(&self) -> &[Reg] {
        match self {
            Self::Number(_) | Self::Slot(_) | Self::PlaceU | Self::PlaceV | Self::Footprint => &[],
            Self::Unary(_, inputs) => inputs,
            Self::Binary(_, inputs) | Self::Perlin(_, inputs) | Self::Cell(inputs) => inputs,
            Self::Smoothstep(inputs) | Self::Worley(_, inputs) => inputs,
            Self::Select(_, inputs) | Self::Fractal(_, _, inputs) => inputs,
        }
    }

    /// Whether the result depends on the point itself, not only through its operands.
    pub fn reads_the_point(&self) -> bool {
        matches!(self, Self::PlaceU | Self::PlaceV | Self::Footprint)
    }

    /// Whether the result is constant but for jumps, so that its derivatives are zero.
    pub fn is_piecewise_constant(&self) -> bool {
        matches!(self, Self::Cell(_) | Self::Unary(Unary::Sign | Unary::Floor | Unary::Ceil | Unary::Round, _))
    }
}

/// The most operands that an instruction has.
pub(crate) const OPERANDS: usize = 4;

/// The result of an instruction at every point, and its derivative in each operand.
pub(crate) struct Outcome {
    pub(crate) value: Lanes,
    pub(crate) slopes: [Lanes; OPERANDS],
}

impl Outcome {
    pub(crate) fn new() -> Self {
        Self { value: [0.0; LANES], slopes: [[0.0; LANES]; OPERANDS] }
    }

    /// Sets value and derivatives at every point from a function of the operands there.
    fn map<const N: usize>(&mut self, x: [&Lanes; OPERANDS], f: impl Fn([f64; N]) -> (f64, [f64; N])) {
        for lane in 0..LANES {
            let (value, slopes) = f(std::array::from_fn(|operand| x[operand][lane]));
            self.value[lane] = value;
            for (all, slope) in self.slopes.iter_mut().zip(slopes) {
                all[lane] = slope;
            }
        }
    }
}

/// Carries out an instruction that has operands. `settings` are the values of the parameters.
pub(crate) fn run(op: &Op, x: [&Lanes; OPERANDS], settings: &[f64], out: &mut Outcome) {
    match *op {
        Op::Number(_) | Op::Slot(_) | Op::PlaceU | Op::PlaceV | Op::Footprint => {}
        Op::Unary(function, _) => unary(function, x, out),
        Op::Binary(function, _) => binary(function, x, out),
        Op::Select(test, _) => select(test, x, out),
        Op::Smoothstep(_) => out.map(x, smoothstep),
        Op::Perlin(channel, _) => out.map(x, |[x, y]| {
            let [value, dx, dy] = perlin(x, y, channel);
            (value, [dx, dy])
        }),
        Op::Fractal(channel, octaves, _) => {
            let octaves = whole(octaves, settings);
            out.map(x, |[x, y, lacunarity, diminish]| {
                let [value, slopes @ ..] = fractal(x, y, octaves, lacunarity, diminish, channel);
                (value, slopes)
            });
        }
        Op::Cell(_) => out.map(x, |[x, y]| (cell(x, y), [0.0; 2])),
        Op::Worley(Worley { cell, style, .. }, _) if whole(style, settings) == 1 => {
            out.map(x, |[x, y, jitter]| (nearest_cell(x, y, jitter, cell), [0.0; 3]));
        }
        Op::Worley(Worley { rank, .. }, _) => out.map(x, |[x, y, jitter]| {
            let [value, slopes @ ..] = distance(x, y, jitter, usize::from(rank));
            (value, slopes)
        }),
    }
}

fn whole(count: Count, settings: &[f64]) -> i32 {
    match count {
        Count::Number(number) => number,
        #[allow(clippy::cast_possible_truncation, reason = "settings of integers are checked to be 32 bits")]
        Count::Slot(slot) => settings[slot as usize] as i32,
    }
}

/// Exactly representable results are the same on every machine; `libm` computes the others.
fn unary(function: Unary, x: [&Lanes; OPERANDS], out: &mut Outcome) {
    match function {
        Unary::Abs => out.map(x, |[x]| (x.abs(), [sign(x)])),
        Unary::Sign => out.map(x, |[x]| (sign(x), [0.0])),
        Unary::Floor => out.map(x, |[x]| (x.floor(), [0.0])),
        Unary::Ceil => out.map(x, |[x]| (x.ceil(), [0.0])),
        Unary::Round => out.map(x, |[x]| (x.round(), [0.0])),
        Unary::Sin => out.map(x, |[x]| (libm::sin(x), [libm::cos(x)])),
        Unary::Cos => out.map(x, |[x]| (libm::cos(x), [-libm::sin(x)])),
        Unary::Tan => out.map(x, |[x]| {
            let tan = libm::tan(x);
            (tan, [1.0 + tan * tan])
        }),
        Unary::Asin => out.map(x, |[x]| (libm::asin(x.clamp(-1.0, 1.0)), [arc_slope(x)])),
        Unary::Acos => out.map(x, |[x]| (libm::acos(x.clamp(-1.0, 1.0)), [-arc_slope(x)])),
        Unary::Sqrt => out.map(x, |[x]| {
            let root = x.max(0.0).sqrt();
            (root, [if root > 0.0 { 0.5 / root } else { 0.0 }])
        }),
        Unary::Ln => out.map(x, |[x]| {
            let raised = x.max(f64::from(f32::MIN_POSITIVE));
            (libm::log(raised), [if x == raised { 1.0 / x } else { 0.0 }])
        }),
        Unary::Exp => out.map(x, |[x]| (libm::exp(x), [libm::exp(x)])),
    }
}

pub(crate) fn sign(x: f64) -> f64 {
    f64::from(u8::from(x > 0.0)) - f64::from(u8::from(x < 0.0))
}

/// The derivative of the arc sine; 0 at and beyond its ends.
fn arc_slope(x: f64) -> f64 {
    if x.abs() < 1.0 { 1.0 / (1.0 - x * x).sqrt() } else { 0.0 }
}

fn binary(function: Binary, x: [&Lanes; OPERANDS], out: &mut Outcome) {
    match function {
        Binary::Add => out.map(x, |[a, b]| (a + b, [1.0, 1.0])),
        Binary::Sub => out.map(x, |[a, b]| (a - b, [1.0, -1.0])),
        Binary::Mul => out.map(x, |[a, b]| (a * b, [b, a])),
        Binary::Div => out.map(x, |[a, b]| {
            let quotient = divided(a, b);
            (quotient, [divided(1.0, b), -divided(quotient, b)])
        }),
        Binary::Mod => out.map(x, |[a, b]| {
            let times = divided(a, b).floor();
            (a - b * times, [1.0, -times])
        }),
        Binary::Pow => out.map(x, |[a, b]| power(a, b)),
        Binary::Min => out.map(x, |[a, b]| if b < a { (b, [0.0, 1.0]) } else { (a, [1.0, 0.0]) }),
        Binary::Max => out.map(x, |[a, b]| if b > a { (b, [0.0, 1.0]) } else { (a, [1.0, 0.0]) }),
        Binary::Atan2 => out.map(x, |[y, x]| {
            let square = x * x + y * y;
            (libm::atan2(y, x), [divided(x, square), -divided(y, square)])
        }),
    }
}

/// The quotient; 0 where the divisor is.
fn divided(a: f64, b: f64) -> f64 {
    if b == 0.0 { 0.0 } else { a / b }
}

/// A power and its derivatives in base and exponent. That of 0 is 0 and that of a negative base needs a whole exponent,
/// or is 0.
fn power(base: f64, exponent: f64) -> (f64, [f64; 2]) {
    if exponent == 0.0 {
        return (1.0, [0.0, if base > 0.0 { libm::log(base) } else { 0.0 }]);
    }
    if base == 0.0 || (base < 0.0 && exponent != exponent.floor()) {
        return (0.0, [if base == 0.0 && exponent == 1.0 { 1.0 } else { 0.0 }, 0.0]);
    }
    let value = libm::pow(base, exponent);
    (value, [exponent * value / base, if base > 0.0 { value * libm::log(base) } else { 0.0 }])
}

fn select(test: Test, x: [&Lanes; OPERANDS], out: &mut Outcome) {
    out.map(x, |[a, b, then, otherwise]| {
        let holds = match test {
            Test::Greater => a > b,
            Test::GreaterEq => a >= b,
            Test::Equal => a == b,
        };
        if holds { (then, [0.0, 0.0, 1.0, 0.0]) } else { (otherwise, [0.0, 0.0, 0.0, 1.0]) }
    });
}

/// `t²(3 - 2t)` of `t = (x - low) / (high - low)`.
fn smoothstep([x, low, high]: [f64; 3]) -> (f64, [f64; 3]) {
    if x >= high || x <= low {
        return (if x >= high { 1.0 } else { 0.0 }, [0.0; 3]);
    }
    let range = high - low;
    let t = (x - low) / range;
    let slope = 6.0 * t * (1.0 - t) / range;
    (t * t * (3.0 - 2.0 * t), [slope, slope * (t - 1.0), -slope * t])
}
