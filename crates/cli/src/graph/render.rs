//! `mateval graph render`: a picture of a graph's base colour.

use std::path::PathBuf;

use anyhow::Context as _;
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_procedural::picture::{Pixel, Square, render};
use mateval_procedural::{Program, Settings};

use super::source::open;
use crate::outcome::{Outcome, print};
use crate::output_file::check_output_file;

/// Arguments of `graph render`.
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

/// Renders the graph and prints the path of the picture.
pub fn run(args: &RenderArgs) -> anyhow::Result<Outcome> {
    check_output_file(&args.out, "--out", "picture", args.force)?;
    let square = Square::new(args.size, args.resolution)?;
    let graph = open(&args.graph)?;
    let mut settings = Settings::defaults(&graph);
    args.settings.iter().try_for_each(|(name, value)| settings.set(&graph, name, value))?;

    let pixels = render(&Program::new(&graph), &settings, square).context("cannot render the graph")?;
    #[allow(clippy::cast_possible_truncation, reason = "colours are stored in single precision")]
    let color = |pixel: Pixel| LinearRgb(pixel.base_color.map(|channel| channel as f32));
    let picture = Picture::new(args.resolution, args.resolution, pixels.into_iter().map(color).collect())?;
    png_io::write_srgb(&args.out, &picture.to_srgb())?;
    print(&format!("{}\n", args.out.display()))?;
    Ok(Outcome::Good)
}
