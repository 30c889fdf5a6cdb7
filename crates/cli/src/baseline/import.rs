//! `mateval baseline import`: another method's meshes, textures or part materials as a submission.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::bail;
use mateval_baselines::import::{self, ImportOptions, ImportReport, ImportedInstance};
use mateval_baselines::submission::Method;
use mateval_scene::{PartSetId, json};

use super::places::Places;
use crate::bars::with_progress;
use crate::format::Format;
use crate::outcome::{Outcome, print, say};

/// Arguments of `import`.
#[derive(clap::Args)]
pub struct ImportArgs {
    /// Folder with `<scene>/<instance>.glb` or `<scene>.glb` (.gltf and .obj too), or with `<scene>.json`, which has one
    /// material per part.
    folder: PathBuf,
    #[command(flatten)]
    places: Places,
    /// The method's name in tables.
    #[arg(long, default_value = "imported")]
    method: String,
    /// Largest distance, in metres, between a place of an instance and the place of the mesh that its material is taken
    /// from.
    #[arg(long, default_value_t = 0.01, value_name = "METRES")]
    max_distance: f64,
    /// The part set that `<scene>.json` names parts of, such as `partfield` [default: the parts of the source].
    #[arg(long)]
    part_set: Option<PartSetId>,
    /// How to print the report.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

/// Makes the submission and reports how much of each surface the files cover.
pub fn run(args: &ImportArgs) -> anyhow::Result<Outcome> {
    let max_distance_m = args.max_distance;
    if !(max_distance_m.is_finite() && max_distance_m > 0.0) {
        bail!("--max-distance {max_distance_m}: expected more than 0 m");
    }
    let options = ImportOptions { max_distance_m, part_set: args.part_set.clone() };
    let description = format!(
        "{}'s own meshes, uv or parts, rebaked to the atlases where they lie within {max_distance_m} m",
        args.method
    );
    let (places, method) = (&args.places, Method::new(&args.method, &description));
    let dataset = places.open()?;
    let report = with_progress(|progress| {
        import::write(&dataset, &args.folder, &places.out, places.force, &method, &options, progress)
    })?;
    for file in &report.unused {
        say(&format!("warning: '{file}' matches no scene or instance of the dataset; it was not read"));
    }
    match args.format {
        Format::Json => print(&json::to_text(&report))?,
        Format::Text => print(&text(&report))?,
    }
    Ok(Outcome::Good)
}

/// A line for each scene, and one for each instance that the files do not cover whole.
fn text(report: &ImportReport) -> String {
    let mut text = String::new();
    for scene in &report.scenes {
        let totals = scene.totals();
        let share = percent(totals.texels_without, totals.texels);
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{}: {} of {} instances; {share:.2} % of their texels found no surface; mean distance {}, largest {}",
            scene.scene,
            totals.with_maps,
            scene.instances.len(),
            millimetres(totals.mean_distance_m),
            millimetres(totals.max_distance_m),
        );
        for instance in scene.instances.iter().filter(|instance| instance.texels_without > 0 || !instance.has_maps()) {
            let _ = writeln!(text, "  {}: {}", instance.instance, shortfall(instance));
        }
    }
    text
}

/// What an instance lacks, and how it will be scored.
fn shortfall(instance: &ImportedInstance) -> String {
    match &instance.file {
        None => "no file describes it; it has no maps and will score as grey".to_owned(),
        Some(file) if !instance.has_maps() => {
            format!(
                "nothing in '{file}' is near enough, the nearest is {} away; no maps",
                millimetres(instance.nearest_m)
            )
        }
        Some(file) => {
            let share = percent(instance.texels_without, instance.texels);
            format!("{share:.2} % of its texels found nothing in '{file}'; they are grey")
        }
    }
}

fn millimetres(metres: Option<f64>) -> String {
    metres.map_or("none".to_owned(), |metres| format!("{:.3} mm", metres * 1e3))
}

fn percent(count: usize, total: usize) -> f64 {
    100.0 * count as f64 / total.max(1) as f64
}
