//! Collects instructions: equal ones become one.

use std::collections::BTreeMap;

use super::op::{Binary, Op, Reg, Unary};

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

    /// A constant.
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

    /// The sum.
    pub fn add(&mut self, a: Reg, b: Reg) -> Reg {
        self.binary(Binary::Add, a, b)
    }

    /// The difference.
    pub fn sub(&mut self, a: Reg, b: Reg) -> Reg {
        self.binary(Binary::Sub, a, b)
    }

    /// The product.
    pub fn mul(&mut self, a: Reg, b: Reg) -> Reg {
        self.binary(Binary::Mul, a, b)
    }

    /// The instructions.
    pub fn into_ops(self) -> Vec<Op> {
        self.ops
    }
}
