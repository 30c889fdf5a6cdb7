//! A graph as a list of scalar instructions. Only nodes that the outputs depend on are translated, and equal
//! instructions become one.

mod lower;
pub mod op;

use crate::graph::{FOOTPRINT, Graph, Node, Source, first_slot};
use crate::node::{InputDef, Unset};
use crate::value::{Type, Value};
use lower::{Argument, Builder, lower};
use op::{Count, Op, Reg};

/// The number of scalars that the outputs of a graph have: red, green and blue of the base colour, roughness, metallic.
pub const OUTPUTS: usize = 5;

/// A graph that can be evaluated.
#[derive(Clone, Debug)]
pub struct Program {
    pub(crate) name: String,
    /// The instructions, each after its operands.
    pub(crate) ops: Vec<Op>,
    /// The results that are the outputs.
    pub(crate) outputs: [Reg; OUTPUTS],
}

impl Program {
    pub fn new(graph: &Graph) -> Self {
        let mut compiler = Compiler { graph, builder: Builder::default(), done: vec![Vec::new(); graph.nodes.len()] };
        let needed = needed(graph);
        for (at, node) in graph.nodes.iter().enumerate().filter(|(at, _)| needed[*at]) {
            compiler.done[at] = compiler.node(node);
        }
        let outputs: Vec<Reg> = graph.outputs.iter().flat_map(|source| compiler.source(source)).collect();
        Self {
            name: graph.name.clone(),
            ops: compiler.builder.into_ops(),
            outputs: outputs.try_into().expect("a checked graph has outputs of three, one and one components"),
        }
    }
}

/// Which nodes the outputs depend on.
fn needed(graph: &Graph) -> Vec<bool> {
    let mut needed = vec![false; graph.nodes.len()];
    let mark = |source: &Source, needed: &mut Vec<bool>| {
        if let Source::Node { node, .. } = source {
            needed[*node] = true;
        }
    };
    graph.outputs.iter().for_each(|source| mark(source, &mut needed));
    for at in (0..graph.nodes.len()).rev() {
        if needed[at] {
            graph.nodes[at].inputs.iter().for_each(|source| mark(source, &mut needed));
        }
    }
    needed
}

struct Compiler<'g> {
    graph: &'g Graph,
    builder: Builder,
    /// The results of each output of the nodes translated so far.
    done: Vec<Vec<Vec<Reg>>>,
}

impl Compiler<'_> {
    fn node(&mut self, node: &Node) -> Vec<Vec<Reg>> {
        let pairs = node.signature.inputs.iter().zip(&node.inputs);
        let arguments: Vec<Argument> = pairs.map(|(def, source)| self.argument(def, source)).collect();
        lower(&mut self.builder, node.kind, &node.signature, &arguments)
    }

    fn argument(&mut self, def: &InputDef, source: &Source) -> Argument {
        let source = match (source, def.unset) {
            (Source::Unset, Unset::Place) => {
                return Argument::Regs(vec![self.builder.push(Op::PlaceU), self.builder.push(Op::PlaceV)]);
            }
            (Source::Unset, Unset::Value(value)) => Source::Value(value),
            (source, _) => source.clone(),
        };
        match source {
            Source::Value(value) if def.kind == Type::Integer => Argument::Count(Count::Number(whole(&value))),
            Source::Parameter(at) if def.kind == Type::Integer => Argument::Count(Count::Slot(slot(self.graph, at))),
            source => Argument::Regs(self.source(&source)),
        }
    }

    fn source(&mut self, source: &Source) -> Vec<Reg> {
        match source {
            Source::Unset => Vec::new(),
            Source::Value(value) => value.numbers().iter().map(|&number| self.builder.number(number)).collect(),
            Source::Parameter(at) if self.graph.parameters[*at].name == FOOTPRINT => {
                vec![self.builder.push(Op::Footprint)]
            }
            Source::Parameter(at) => {
                let first = slot(self.graph, *at);
                let width = self.graph.parameters[*at].value.numbers().len();
                (first..).take(width).map(|slot| self.builder.push(Op::Slot(slot))).collect()
            }
            Source::Node { node, output } => self.done[*node][*output].clone(),
        }
    }
}

fn slot(graph: &Graph, parameter: usize) -> u32 {
    u32::try_from(first_slot(graph, parameter)).expect("limits keep parameters below 2^32")
}

/// A checked integer as one.
fn whole(value: &Value) -> i32 {
    #[allow(clippy::cast_possible_truncation, reason = "integers are parsed as 32 bits")]
    let number = value.numbers()[0] as i32;
    number
}
