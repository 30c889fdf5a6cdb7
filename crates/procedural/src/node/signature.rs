//! The inputs and outputs of a variant of a node: what MaterialX calls a nodedef.

use crate::value::{Type, Value};

/// What an input is while a file does not set it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unset {
    /// A constant.
    Value(Value),
    /// The place in metres: the first set of texture coordinates.
    Place,
}

/// An input.
#[derive(Clone, Debug, PartialEq)]
pub struct InputDef {
    /// The name.
    pub name: &'static str,
    /// The type.
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
