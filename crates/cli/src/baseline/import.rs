//! `mateval baseline import`: another method's meshes, textures or part materials as a submission.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::bail;
use mateval_baselines::import::{self, FlatMaterial, ImportOptions, ImportReport, ImportedFrame, ImportedInstance};
use mateval_baselines::submission::Method;
use mateval_dataset::material::MaterialParameter;
use mateval_dataset::{PartSetId, json};

use crate::arguments::{Format, Places, open_with_twins};
use crate::terminal::{Outcome, print, say, with_progress};

#[derive(clap::Args)]
pub struct ImportArgs {
    /// Folder with `<scene>/<instance>.glb` or `<scene>.glb` (.gltf and .obj too), or with `<scene>.json`, which has
    /// one material per part.
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

impl ImportArgs {
    /// Makes the submission and reports how much of each surface the files cover.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let max_distance_m = self.max_distance;
        if !(max_distance_m.is_finite() && max_distance_m > 0.0) {
            bail!("--max-distance {max_distance_m}: expected more than 0 m");
        }
        let options = ImportOptions { max_distance_m, part_set: self.part_set.clone() };
        let description = format!(
            "{}'s own meshes, uv or parts, rebaked to the atlases where they lie within {max_distance_m} m",
            self.method
        );
        let (places, method) = (&self.places, Method::new(&self.method, &description));
        let dataset = open_with_twins(&places.dataset)?;
        let report = with_progress(|progress| {
            import::write(&dataset, &self.folder, &places.out, places.force, &method, &options, progress)
        })?;
        for file in &report.unused {
            say(&format!("warning: '{file}' matches no scene or instance of the dataset; it was not read"));
        }
        for note in report.scenes.iter().flat_map(|scene| moves(&scene.instances)) {
            say(&note);
        }
        match self.format {
            Format::Json => print(&json::to_text(&report))?,
            Format::Text => print(&text(&report))?,
        }
        Ok(Outcome::Good)
    }
}

/// A line for each file whose mesh was moved.
fn moves(instances: &[ImportedInstance]) -> Vec<String> {
    let mut notes: Vec<String> = Vec::new();
    for instance in instances {
        let (Some(file), Some(ImportedFrame::Moved { scale, rotation, shift_m, residual_m, other_turns, .. })) =
            (&instance.file, &instance.frame)
        else {
            continue;
        };
        let symmetric = match other_turns {
            0 => String::new(),
            count => format!("; it is symmetric: {count} other turns fit as well"),
        };
        let note = format!(
            "note: '{file}' was moved to the dataset's world space: {}, scale {scale:.6}, shift ({}) m; {} remain{symmetric}",
            turn(rotation),
            shift_m.map(|metres| format!("{metres:.4}")).join(", "),
            millimetres(Some(*residual_m)),
        );
        // A mesh of the whole scene is listed by each instance that uses it.
        if !notes.contains(&note) {
            notes.push(note);
        }
    }
    notes
}

/// The axes of the world in those of the mesh, such as `axes (x, z, -y)`, or the angle. A mirror image that is not such
/// an exchange of axes is given as the point reflection and the turn that make it up.
fn turn(rotation: &[[f64; 3]; 3]) -> String {
    let axis = |row: &[f64; 3]| {
        let at = row.iter().position(|share| (share.abs() - 1.0).abs() < 1e-6)?;
        Some(format!("{}{}", if row[at] < 0.0 { "-" } else { "" }, ["x", "y", "z"][at]))
    };
    let axes: Option<Vec<String>> = rotation.iter().map(axis).collect();
    if let Some(axes) = axes {
        return format!("axes ({})", axes.join(", "));
    }
    let [[a, b, c], [d, e, f], [g, h, i]] = *rotation;
    let determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
    let (sign, mirrored) = if determinant < 0.0 { (-1.0, "mirrored and ") } else { (1.0, "") };
    let trace = sign * (a + e + i);
    let degrees = ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees();
    format!("{mirrored}turned by {degrees:.2} degrees")
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
        for instance in scene.instances.iter().filter(|instance| instance.has_maps()) {
            text.extend(values(instance).map(|values| format!("  {}: {values}\n", instance.instance)));
        }
        for instance in scene.instances.iter().filter(|instance| instance.texels_without > 0 || !instance.has_maps()) {
            let _ = writeln!(text, "  {}: {}", instance.instance, shortfall(instance));
        }
    }
    text
}

/// The mean of what was read for an instance, and what the file does not state.
fn values(instance: &ImportedInstance) -> Option<String> {
    let FlatMaterial { base_color: [red, green, blue], roughness, metallic } = instance.mean?;
    let number = |value: Option<f32>, parameter| match value.filter(|_| !instance.unstated.contains(&parameter)) {
        Some(value) => format!("{value:.2}"),
        None => "not stated, not submitted".to_owned(),
    };
    let mut text = format!(
        "mean base colour {red:.2} {green:.2} {blue:.2} (linear), roughness {}, metallic {}",
        number(roughness, MaterialParameter::Roughness),
        number(metallic, MaterialParameter::Metallic)
    );
    if instance.unstated.contains(&MaterialParameter::BaseColor) {
        text.push_str("; some of its materials state no base colour and are the format's default");
    }
    if instance.faces_without_uv > 0 {
        let _ = write!(text, "; {} faces of the file have no texture coordinates", instance.faces_without_uv);
    }
    Some(text)
}

/// What an instance lacks, and how it will be scored.
fn shortfall(instance: &ImportedInstance) -> String {
    match &instance.file {
        None => "no file describes it; it has no maps and will score as grey".to_owned(),
        Some(file) if !instance.has_maps() => {
            format!(
                "nothing in '{file}' is near enough, the nearest is {} away{}; no maps",
                millimetres(instance.nearest_m),
                tried(instance)
            )
        }
        Some(file) => {
            let share = percent(instance.texels_without, instance.texels);
            format!("{share:.2} % of its texels found nothing in '{file}'; they are grey")
        }
    }
}

/// What was tried to bring the mesh of this instance alone to its place.
fn tried(instance: &ImportedInstance) -> String {
    match &instance.frame {
        Some(ImportedFrame::Unexplained { best_residual_m, limit_m }) if instance.own_file => {
            let best = best_residual_m.map_or("no box has the right proportions".to_owned(), |best| {
                format!("the best leaves {}, the most is {}", millimetres(Some(best)), millimetres(Some(*limit_m)))
            });
            format!(", and no scale, turn and shift brings it there: {best}")
        }
        _ => String::new(),
    }
}

fn millimetres(metres: Option<f64>) -> String {
    metres.map_or("none".to_owned(), |metres| format!("{:.3} mm", metres * 1e3))
}

fn percent(count: usize, total: usize) -> f64 {
    100.0 * count as f64 / total.max(1) as f64
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;

    #[test]
    fn turns_and_mirror_images_are_distinguished() {
        let rows = |matrix: DMat3| matrix.transpose().to_cols_array_2d();
        let turned = DMat3::from_axis_angle(glam::DVec3::new(0.6, 0.0, 0.8), 0.7);
        assert_eq!(turn(&rows(turned)), "turned by 40.11 degrees");
        assert_eq!(turn(&rows(-turned)), "mirrored and turned by 40.11 degrees");
        assert_eq!(turn(&rows(DMat3::from_rotation_x(std::f64::consts::FRAC_PI_2))), "axes (x, -z, y)");
    }
}
