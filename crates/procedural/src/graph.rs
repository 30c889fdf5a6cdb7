//! A graph: parameters, nodes and the three outputs of a material.

use crate::node::kind::Kind;
use crate::node::signature::Signature;
use crate::value::{Type, Value};

/// The name of the parameter that an evaluator sets at every point to the extent of a pixel or texel in metres.
pub const FOOTPRINT: &str = "footprint";

/// An input of the graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// The name.
    pub name: String,
    /// Its default.
    pub value: Value,
    /// The least value of each component, from `uimin`.
    pub least: Option<Value>,
    /// The greatest value of each component, from `uimax`.
    pub most: Option<Value>,
    /// What the parameter is, with its unit; from `doc`.
    pub doc: Option<String>,
}

/// What an input of a node is connected to.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// Nothing: the default of the node's definition.
    Unset,
    /// A constant.
    Value(Value),
    /// A parameter.
    Parameter(usize),
    /// An output of an earlier node.
    Node {
        /// Its place in [`Graph::nodes`].
        node: usize,
        /// The output's place in the node's signature.
        output: usize,
    },
}

/// A node.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// The name.
    pub name: String,
    /// The node of the standard library.
    pub kind: Kind,
    /// Its variant.
    pub signature: Signature,
    /// One source for each input of the signature, in its order.
    pub inputs: Vec<Source>,
}

/// An output of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// Linear colour from 0 to 1.
    BaseColor,
    /// 0 to 1.
    Roughness,
    /// 0 to 1.
    Metallic,
}

impl Output {
    /// The outputs that every graph has, in the order of [`Graph::outputs`].
    pub const ALL: [Self; 3] = [Self::BaseColor, Self::Roughness, Self::Metallic];

    /// The name in `.mtlx` files.
    pub fn word(self) -> &'static str {
        match self {
            Self::BaseColor => "base_color",
            Self::Roughness => "roughness",
            Self::Metallic => "metallic",
        }
    }

    /// The type.
    pub fn kind(self) -> Type {
        match self {
            Self::BaseColor => Type::Color3,
            Self::Roughness | Self::Metallic => Type::Float,
        }
    }
}

/// A checked graph. Nodes follow those that they depend on.
#[derive(Clone, Debug, PartialEq)]
pub struct Graph {
    /// The name, without `NG_`.
    pub name: String,
    /// What the graph shows, from `doc`.
    pub doc: Option<String>,
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// The nodes.
    pub nodes: Vec<Node>,
    /// What the outputs of [`Output::ALL`] are connected to; never [`Source::Unset`].
    pub outputs: [Source; 3],
}

impl Graph {
    /// The place of a parameter.
    pub fn parameter(&self, name: &str) -> Option<usize> {
        self.parameters.iter().position(|parameter| parameter.name == name)
    }
}
