//! Scalar instructions: one number a point out of at most four others.

use crate::noise::perlin::Channel;

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
    /// A constant.
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

/// An instruction.
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
    /// The operands.
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
