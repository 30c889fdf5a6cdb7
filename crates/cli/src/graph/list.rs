//! `mateval graph list`: the built-in graphs, or the parameters of one graph.

use std::path::{Path, PathBuf};

use mateval_procedural::Graph;
use mateval_procedural::graph::Parameter;
use mateval_procedural::library::LIBRARY;
use mateval_procedural::value::Value;
use mateval_scene::json;

use super::source::open;
use crate::format::Format;
use crate::outcome::{Outcome, print};
use crate::tool::TOOL;

/// Arguments of `graph list`.
#[derive(clap::Args)]
pub struct ListArgs {
    /// A .mtlx file or a built-in graph, whose parameters are listed.
    graph: Option<PathBuf>,
    /// How to print the list.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

/// Prints the list.
pub fn run(args: &ListArgs) -> anyhow::Result<Outcome> {
    match &args.graph {
        None => graphs(args.format)?,
        Some(graph) => parameters(graph, args.format)?,
    }
    Ok(Outcome::Good)
}

fn graphs(format: Format) -> anyhow::Result<()> {
    let graphs = LIBRARY.iter().map(|entry| Ok((entry, entry.graph()?))).collect::<anyhow::Result<Vec<_>>>()?;
    let doc = |graph: &Graph| graph.doc.clone().unwrap_or_default();
    match format {
        Format::Text => {
            let line = |(entry, graph): &(&mateval_procedural::library::Entry, Graph)| {
                let count = graph.parameters.len();
                format!("{:<15} {:<9} {count:>3} parameters  {}\n", entry.name, entry.class.word(), doc(graph))
            };
            print(&graphs.iter().map(line).collect::<String>())
        }
        Format::Json => {
            let graphs = graphs.iter().map(|(entry, graph)| {
                serde_json::json!({
                    "name": entry.name,
                    "class": entry.class,
                    "doc": graph.doc,
                    "parameters": graph.parameters.iter().map(as_json).collect::<Vec<_>>(),
                })
            });
            let graphs: Vec<_> = graphs.collect();
            print(&json::to_text(&serde_json::json!({ "format": "mateval-graphs/1", "tool": TOOL, "graphs": graphs })))
        }
    }
}

fn parameters(word: &Path, format: Format) -> anyhow::Result<()> {
    let graph = open(word)?;
    match format {
        Format::Text => {
            let line = |parameter: &Parameter| {
                let range = match (&parameter.least, &parameter.most) {
                    (Some(least), Some(most)) => format!("{least} to {most}"),
                    (Some(least), None) => format!("from {least}"),
                    (None, Some(most)) => format!("up to {most}"),
                    (None, None) => "any".to_owned(),
                };
                let (kind, value) = (parameter.value.kind().word(), parameter.value.to_string());
                let doc = parameter.doc.as_deref().unwrap_or_default();
                format!("{:<18} {kind:<8} {value:<18} {range:<14} {doc}", parameter.name).trim_end().to_owned() + "\n"
            };
            print(&graph.parameters.iter().map(line).collect::<String>())
        }
        Format::Json => {
            let parameters: Vec<_> = graph.parameters.iter().map(as_json).collect();
            print(&json::to_text(&serde_json::json!({
                "format": "mateval-graph/1", "tool": TOOL, "name": graph.name, "parameters": parameters,
            })))
        }
    }
}

fn as_json(parameter: &Parameter) -> serde_json::Value {
    let numbers = |value: &Option<Value>| value.map(|value| value.numbers().to_vec());
    serde_json::json!({
        "name": parameter.name,
        "type": parameter.value.kind().word(),
        "value": parameter.value.numbers(),
        "least": numbers(&parameter.least),
        "most": numbers(&parameter.most),
        "doc": parameter.doc,
    })
}
