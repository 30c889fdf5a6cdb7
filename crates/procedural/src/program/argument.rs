//! What the inputs of a node are while it is translated.

use super::op::{Count, Reg};

/// An input.
pub(super) enum Argument {
    /// One result for each component.
    Regs(Vec<Reg>),
    /// A whole number.
    Count(Count),
}

/// The inputs of a node, in the order of its signature.
#[derive(Clone, Copy)]
pub(super) struct Arguments<'a>(pub(super) &'a [Argument]);

impl Arguments<'_> {
    /// All components of an input; none for a whole number.
    pub(super) fn all(&self, input: usize) -> &[Reg] {
        match &self.0[input] {
            Argument::Regs(regs) => regs,
            Argument::Count(_) => &[],
        }
    }

    /// A component of an input. A float serves as every component.
    pub(super) fn at(&self, input: usize, component: usize) -> Reg {
        let regs = self.all(input);
        if regs.len() == 1 { regs[0] } else { regs[component] }
    }

    /// A whole number.
    pub(super) fn count(&self, input: usize) -> Count {
        match &self.0[input] {
            Argument::Count(count) => *count,
            Argument::Regs(_) => unreachable!("signatures give these inputs the type integer"),
        }
    }

    /// A whole number that the reader has checked to be a constant.
    pub(super) fn constant(&self, input: usize) -> usize {
        match self.count(input) {
            Count::Number(number) => usize::try_from(number).unwrap_or(0),
            Count::Slot(_) => unreachable!("the reader refuses parameters here"),
        }
    }
}
