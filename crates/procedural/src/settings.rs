//! The values of a graph's parameters.

use crate::error::ProceduralError;
use crate::graph::{FOOTPRINT, Graph};
use crate::program::compile::first_slot;
use crate::value::{Type, Value};

/// One scalar of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Slot {
    /// The parameter's place in the graph.
    pub parameter: usize,
    /// The component.
    pub component: usize,
    /// Whether it is a real number, in which derivatives exist.
    pub is_real: bool,
    /// Its default.
    pub value: f64,
    /// Its least value.
    pub least: Option<f64>,
    /// Its greatest value.
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
    let of = |(at, parameter): (usize, &crate::graph::Parameter)| {
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

/// A value for every slot.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings(Vec<f64>);

impl Settings {
    /// The defaults of a graph.
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

    /// All numbers, to be changed without a check of their ranges.
    pub(crate) fn numbers_mut(&mut self) -> &mut [f64] {
        &mut self.0
    }

    /// Sets a parameter from text, as in `0.2` or `0.8, 0.7, 0.6`. Fails where the parameter does not exist, or the
    /// text is no value of its type and range.
    pub fn set(&mut self, graph: &Graph, name: &str, text: &str) -> Result<(), ProceduralError> {
        let Some(at) = graph.parameter(name) else { return Err(unknown(graph, name)) };
        if name == FOOTPRINT {
            return Err(ProceduralError::SetAtEveryPoint { graph: graph.name.clone(), name: name.to_owned() });
        }
        let parameter = &graph.parameters[at];
        let bad = |reason| ProceduralError::BadValue { graph: graph.name.clone(), name: name.to_owned(), reason };
        let value = Value::parse(parameter.value.kind(), text).map_err(bad)?;
        let slots = slots(graph);
        for (slot, &found) in slots.iter().filter(|slot| slot.parameter == at).zip(value.numbers()) {
            if slot.clamped(found) != found {
                let (graph, name, least, most) = (graph.name.clone(), name.to_owned(), slot.least, slot.most);
                return Err(ProceduralError::OutOfRange { graph, name, least, most, found });
            }
        }
        self.0[first_slot(graph, at)..][..value.numbers().len()].copy_from_slice(value.numbers());
        Ok(())
    }
}

fn unknown(graph: &Graph, name: &str) -> ProceduralError {
    let known: Vec<&str> = graph.parameters.iter().map(|parameter| parameter.name.as_str()).collect();
    ProceduralError::UnknownParameter {
        graph: graph.name.clone(),
        name: crate::value::shortened(name),
        known: known.join(", "),
    }
}
