//! A graph: parameters, nodes and the three outputs of a material; and the values of its parameters.

use crate::error::ProceduralError;
use crate::node::{Kind, Signature};
use crate::value::{Type, Value, shortened, words};

/// The name of the parameter that an evaluator sets at every point to the extent of a pixel or texel in metres.
pub const FOOTPRINT: &str = "footprint";

/// An input of the graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    pub name: String,
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
    Value(Value),
    Parameter(usize),
    /// An output of an earlier node.
    Node {
        /// Its place in [`Graph::nodes`].
        node: usize,
        /// The output's place in the node's signature.
        output: usize,
    },
}

#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    pub name: String,
    /// The node of the standard library.
    pub kind: Kind,
    pub signature: Signature,
    /// One source for each input of the signature, in its order.
    pub inputs: Vec<Source>,
}

words! {
    /// An output of a material. Every graph has all of them, in the order of [`Graph::outputs`].
    pub enum Output {
        /// Linear colour from 0 to 1.
        BaseColor = "base_color",
        /// 0 to 1.
        Roughness = "roughness",
        /// 0 to 1.
        Metallic = "metallic",
    }
}

impl Output {
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
    pub parameters: Vec<Parameter>,
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

/// One scalar of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Slot {
    /// The parameter's place in the graph.
    pub parameter: usize,
    pub component: usize,
    /// Whether it is a real number, in which derivatives exist.
    pub is_real: bool,
    pub value: f64,
    pub least: Option<f64>,
    pub most: Option<f64>,
}

impl Slot {
    /// The number of its range that is nearest to this one.
    pub(crate) fn clamped(&self, number: f64) -> f64 {
        number.max(self.least.unwrap_or(number)).min(self.most.unwrap_or(f64::INFINITY))
    }
}

/// The scalars of all parameters, in the order of the settings' numbers.
pub fn slots(graph: &Graph) -> Vec<Slot> {
    let of = |(at, parameter): (usize, &Parameter)| {
        let end = |value: &Option<Value>, component: usize| value.map(|value| value.numbers()[component]);
        let (value, least, most) = (parameter.value, parameter.least, parameter.most);
        let is_real = value.kind() != Type::Integer;
        (0..value.kind().width())
            .map(|component| Slot {
                parameter: at,
                component,
                is_real,
                value: value.numbers()[component],
                least: end(&least, component),
                most: end(&most, component),
            })
            .collect::<Vec<_>>()
    };
    graph.parameters.iter().enumerate().flat_map(of).collect()
}

/// The slot of a parameter's first component in the settings.
pub(crate) fn first_slot(graph: &Graph, parameter: usize) -> usize {
    graph.parameters[..parameter].iter().map(|parameter| parameter.value.kind().width()).sum()
}

/// A value for every slot.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings(Vec<f64>);

impl Settings {
    pub fn defaults(graph: &Graph) -> Self {
        Self(graph.parameters.iter().flat_map(|parameter| parameter.value.numbers().iter().copied()).collect())
    }

    /// The numbers, in the order of [`slots`].
    pub fn numbers(&self) -> &[f64] {
        &self.0
    }

    /// The number of a slot, to be changed without a check of its range.
    pub fn number_mut(&mut self, slot: usize) -> &mut f64 {
        &mut self.0[slot]
    }

    /// A graph of this name that has these values as its defaults. A value that its parameter cannot have, such as NaN,
    /// leaves the default.
    pub fn as_defaults(&self, graph: &Graph, name: &str) -> Graph {
        let mut named = Graph { name: name.to_owned(), ..graph.clone() };
        for (at, parameter) in named.parameters.iter_mut().enumerate() {
            let kind = parameter.value.kind();
            let numbers = &self.0[first_slot(graph, at)..][..kind.width()];
            parameter.value = Value::of_numbers(kind, numbers).unwrap_or(parameter.value);
        }
        named
    }

    /// Sets a parameter from text, as in `0.2` or `0.8, 0.7, 0.6`. Fails where the parameter does not exist, or the
    /// text is no value of its type and range.
    pub fn set(&mut self, graph: &Graph, name: &str, text: &str) -> Result<(), ProceduralError> {
        let Some(at) = graph.parameter(name) else {
            let known: Vec<&str> = graph.parameters.iter().map(|parameter| parameter.name.as_str()).collect();
            return Err(ProceduralError::Unusable(format!(
                "'{}' has no parameter '{}'; expected one of: {}",
                graph.name,
                shortened(name),
                known.join(", ")
            )));
        };
        if name == FOOTPRINT {
            return Err(ProceduralError::Unusable(format!(
                "parameter '{name}' of '{}' cannot be set: it is the extent of a pixel at every point",
                graph.name
            )));
        }
        let bad = |why: String| ProceduralError::Unusable(format!("parameter '{name}' of '{}': {why}", graph.name));
        let parameter = &graph.parameters[at];
        let value = Value::parse(parameter.value.kind(), text).map_err(|reason| bad(reason.to_string()))?;
        for (slot, &found) in slots(graph).iter().filter(|slot| slot.parameter == at).zip(value.numbers()) {
            if slot.clamped(found) != found {
                let range = match (slot.least, slot.most) {
                    (Some(least), Some(most)) => format!("{least} to {most}"),
                    (Some(least), None) => format!("at least {least}"),
                    (None, Some(most)) => format!("at most {most}"),
                    (None, None) => "any number".to_owned(),
                };
                return Err(bad(format!("expected {range}, found {found}")));
            }
        }
        self.0[first_slot(graph, at)..][..value.numbers().len()].copy_from_slice(value.numbers());
        Ok(())
    }
}
