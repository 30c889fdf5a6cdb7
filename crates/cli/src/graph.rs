//! `mateval graph`: procedural materials as graphs of MaterialX nodes.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use mateval_dataset::json;
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_procedural::error::Finding;
use mateval_procedural::evaluator::{Pixel, Square, render};
use mateval_procedural::graph::Parameter;
use mateval_procedural::library::{LIBRARY, entry};
use mateval_procedural::mtlx::read_file;
use mateval_procedural::value::Value;
use mateval_procedural::{Graph, ProceduralError, Program, Settings};

use crate::TOOL;
use crate::arguments::{Format, check_output_file};
use crate::terminal::{Outcome, print, say};

/// Subcommands of `graph`.
#[derive(clap::Subcommand)]
pub enum Command {
    /// Lists the built-in graphs, or the parameters of one graph.
    List(ListArgs),
    /// Checks .mtlx files and reports every fault with its line. Exit code 1: a file has one.
    Check(CheckArgs),
    /// Writes a picture of a graph's base colour.
    Render(RenderArgs),
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::List(args) => args.run(),
        Command::Check(args) => args.run(),
        Command::Render(args) => args.run(),
    }
}

#[derive(clap::Args)]
pub struct ListArgs {
    /// A .mtlx file or a built-in graph, whose parameters are listed.
    graph: Option<PathBuf>,
    /// How to print the list.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

impl ListArgs {
    pub fn run(&self) -> anyhow::Result<Outcome> {
        match &self.graph {
            None => print_graphs(self.format)?,
            Some(graph) => print_parameters(graph, self.format)?,
        }
        Ok(Outcome::Good)
    }
}

fn print_graphs(format: Format) -> anyhow::Result<()> {
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

fn print_parameters(word: &Path, format: Format) -> anyhow::Result<()> {
    let graph = open_graph(word)?;
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

#[derive(clap::Args)]
pub struct CheckArgs {
    /// The .mtlx files.
    #[arg(required = true, value_name = "FILE.mtlx")]
    files: Vec<PathBuf>,
    /// How to print the findings.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

impl CheckArgs {
    /// Checks the files; the answer is no where one has a fault.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let checked = self.files.iter().map(|file| Ok((file.as_path(), findings(file)?)));
        let checked = checked.collect::<anyhow::Result<Vec<(&Path, Vec<Finding>)>>>()?;
        print(&match self.format {
            Format::Text => checked.iter().map(|(file, findings)| text(file, findings)).collect(),
            Format::Json => {
                let files = checked.iter().map(
                    |(file, findings)| serde_json::json!({ "file": file.display().to_string(), "findings": findings }),
                );
                let files: Vec<_> = files.collect();
                json::to_text(&serde_json::json!({ "format": "mateval-graph-check/1", "tool": TOOL, "files": files }))
            }
        })?;
        let good = checked.iter().all(|(_, findings)| findings.is_empty());
        Ok(if good { Outcome::Good } else { Outcome::No })
    }
}

/// A file that is refused is a result of the check; one that cannot be read is a failure to check.
fn findings(file: &Path) -> anyhow::Result<Vec<Finding>> {
    match read_file(file) {
        Ok(_) => Ok(Vec::new()),
        Err(ProceduralError::Invalid { findings, .. }) => Ok(findings),
        Err(other) => Err(other.into()),
    }
}

fn text(file: &Path, findings: &[Finding]) -> String {
    let file = file.display();
    match findings {
        [] => format!("{file}: good\n"),
        findings => findings.iter().map(|finding| format!("{file}: {finding}\n")).collect(),
    }
}

#[derive(clap::Args)]
pub struct RenderArgs {
    /// A .mtlx file, or the name of a built-in graph.
    graph: PathBuf,
    /// Value of a parameter, as in `width=0.1` or `color=0.5,0.4,0.3`; may be given several times.
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    settings: Vec<(String, String)>,
    /// PNG file for the picture.
    #[arg(long, value_name = "FILE.png")]
    out: PathBuf,
    /// Side of the square that is shown, in metres.
    #[arg(long, value_name = "METRES", default_value_t = 1.0)]
    size: f64,
    /// Side of the picture, in pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 512)]
    resolution: usize,
    /// Replace a picture that already exists.
    #[arg(long)]
    force: bool,
}

fn assignment(word: &str) -> anyhow::Result<(String, String)> {
    let (name, value) = word.split_once('=').context("expected NAME=VALUE")?;
    Ok((name.trim().to_owned(), value.to_owned()))
}

impl RenderArgs {
    /// Renders the graph and prints the path of the picture.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        check_output_file(&self.out, "--out", "picture", self.force)?;
        let square = Square::new(self.size, self.resolution)?;
        let graph = open_graph(&self.graph)?;
        let mut settings = Settings::defaults(&graph);
        self.settings.iter().try_for_each(|(name, value)| settings.set(&graph, name, value))?;

        let pixels = render(&Program::new(&graph), &settings, square).context("cannot render the graph")?;
        #[allow(clippy::cast_possible_truncation, reason = "colours are stored in single precision")]
        let color = |pixel: Pixel| LinearRgb(pixel.base_color.map(|channel| channel as f32));
        let picture = Picture::new(self.resolution, self.resolution, pixels.into_iter().map(color).collect())?;
        png_io::write_srgb(&self.out, &picture.to_srgb())?;
        print(&format!("{}\n", self.out.display()))?;
        Ok(Outcome::Good)
    }
}

/// Reads a `.mtlx` file, or takes the built-in graph of this name. Prints all findings about a file that is refused.
fn open_graph(word: &Path) -> anyhow::Result<Graph> {
    if word.extension().is_some_and(|extension| extension == "mtlx") {
        let read = read_file(word);
        if let Err(ProceduralError::Invalid { name, findings }) = &read {
            findings.iter().for_each(|finding| say(&format!("{name}: {finding}")));
        }
        return Ok(read?);
    }
    match word.to_str().and_then(entry) {
        Some(entry) => Ok(entry.graph()?),
        None => {
            let names: Vec<&str> = LIBRARY.iter().map(|entry| entry.name).collect();
            bail!("'{}' is neither a .mtlx file nor a built-in graph; those are {}", word.display(), names.join(", "))
        }
    }
}
