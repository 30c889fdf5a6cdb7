//! `mateval baseline import`.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::bail;
use mateval_baselines::import::{self, ImportOptions, ImportReport};
use mateval_baselines::submission::Method;
use mateval_scene::{PartSetId, json};

use super::{Places, open};
use crate::bars::Bars;
use crate::outcome::{Outcome, print, say};
use crate::prep::Format;

/// What it is given.
#[derive(clap::Args)]
pub struct ImportArgs {
    /// Folder with `<scene>/<instance>.glb`, or `<scene>.glb` (or .gltf, .obj), or `<scene>.json` with one material a
    /// part.
    folder: PathBuf,
    #[command(flatten)]
    places: Places,
    /// The method's name, as tables show it.
    #[arg(long, default_value = "imported")]
    method: String,
    /// Metres: what is further away from an instance's surface is not taken for it.
    #[arg(long, default_value_t = 0.01, value_name = "METRES")]
    max_distance: f64,
    /// The set of parts that `<scene>.json` names, as in `partfield`; the source's own if absent.
    #[arg(long)]
    part_set: Option<PartSetId>,
    /// How to print how well it went.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

/// Makes the submission, and tells how well the surfaces were found.
pub fn run(args: &ImportArgs) -> anyhow::Result<Outcome> {
    let max_distance_m = args.max_distance;
    if !(max_distance_m.is_finite() && max_distance_m > 0.0) {
        bail!("--max-distance {max_distance_m}; expected more than 0 m");
    }
    let options = ImportOptions { max_distance_m, part_set: args.part_set.clone() };
    let description = format!(
        "{}'s own meshes, uv or parts, rebaked to the atlases where they lie within {max_distance_m} m",
        args.method
    );
    let (places, method) = (&args.places, Method::new(&args.method, &description));
    let bars = Bars::new();
    let progress = |step: &str, done: usize, all: usize| bars.step(step, done, all);
    let report = import::write(&open(places)?, &args.folder, &places.out, places.force, &method, &options, &progress)?;
    drop(bars);
    for file in &report.unused {
        say(&format!("warning: '{file}' is for no scene or instance of the dataset; it was not read"));
    }
    match args.format {
        Format::Json => print(&json::to_text(&report))?,
        Format::Text => print(&text(&report))?,
    }
    Ok(Outcome::Good)
}

fn text(report: &ImportReport) -> String {
    let mut text = String::new();
    for scene in &report.scenes {
        let totals = scene.totals();
        let mm = |metres: Option<f64>| metres.map_or("none".to_owned(), |metres| format!("{:.3} mm", metres * 1e3));
        let share = 100.0 * totals.texels_without as f64 / totals.texels.max(1) as f64;
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{}: {} of {} instances; {share:.2} % of their texels found no surface; distance {} in the mean, {} at most",
            scene.scene,
            totals.with_maps,
            scene.instances.len(),
            mm(totals.mean_distance_m),
            mm(totals.max_distance_m),
        );
        for instance in scene.instances.iter().filter(|instance| instance.texels_without > 0 || !instance.has_maps()) {
            let _ = match &instance.file {
                None => writeln!(
                    text,
                    "  {}: nothing tells of it; it has no maps and will score as grey",
                    instance.instance
                ),
                Some(file) if !instance.has_maps() => {
                    let (nearest, instance) = (mm(instance.nearest_m), &instance.instance);
                    writeln!(
                        text,
                        "  {instance}: nothing in {file} is near enough, the nearest {nearest} away; no maps"
                    )
                }
                Some(file) => {
                    let share = 100.0 * instance.texels_without as f64 / instance.texels as f64;
                    writeln!(
                        text,
                        "  {}: {share:.2} % of its texels found nothing in {file}; they are grey",
                        instance.instance
                    )
                }
            };
        }
    }
    text
}
