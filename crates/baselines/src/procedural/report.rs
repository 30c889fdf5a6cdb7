//! The report of a submission: `report.json` with what was found for each part, `materials.mtlx` with the graphs and
//! their parameters, and a page with the pictures of each room and of each part with a fit.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use mateval_dataset::dataset::{Part, SceneFile};
use mateval_dataset::ids::unused_name;
use mateval_files::FileError;
use mateval_files::untrusted::sha256_of_bytes;
use mateval_image::png_io::write_srgb;
use mateval_image::{LinearRgb, Picture, SrgbRgb};
use mateval_pages::{escaped, figure, plain};
use mateval_procedural::Graph;
use mateval_procedural::fit::candidate::Candidate;
use mateval_procedural::library::{Class, LIBRARY};
use mateval_procedural::mtlx::to_text_of_all;
use mateval_procedural::unfolding::Chart;
use serde::Serialize;

use super::materials::{PartMaterial, Reason, SceneMaterials};
use super::part_samples::PartSamples;
use crate::error::BaselineError;
use crate::estimate::{Estimate, GivenMaps, Placement};
use crate::submission::Method;

pub(super) const REPORT: &str = "report.json";

pub(super) const REPORT_FORMAT: &str = "mateval-procedural/1";

#[derive(Serialize)]
pub(super) struct ReportFile {
    pub(super) format: String,
    pub(super) method: String,
    pub(super) description: String,
    /// The hash of the texts of the built-in graphs, in their order.
    pub(super) library_sha256: String,
    pub(super) scenes: Vec<SceneReport>,
}

/// The parts of a scene.
#[derive(Serialize)]
pub(super) struct SceneReport {
    id: String,
    parts: Vec<PartReport>,
}

/// What was found for a part.
#[derive(Serialize)]
struct PartReport {
    part: String,
    instance: String,
    /// The number of pixels that show it.
    pixels: usize,
    reason: Reason,
    /// The side of its box that was fitted.
    side: Option<Chart>,
    /// Median base colour (linear), roughness and metallic of its pixels, or what stands for them.
    values: [f32; 5],
    chosen: Option<GraphReport>,
    /// The error of one colour at the same held-out pixels.
    error_of_one_color: Option<f64>,
    /// The other graphs, in the order of the fit's own score.
    others: Vec<GraphReport>,
}

#[derive(Serialize)]
struct GraphReport {
    graph: String,
    class: Option<Class>,
    /// Weighted mean square of the differences of linear colours at the held-out pixels.
    error: f64,
    /// How far its statistics are from those of the pixels.
    distance: f64,
    /// Of the chosen graph alone.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    parameters: BTreeMap<String, Vec<f64>>,
}

/// How many of the graphs that were not chosen are reported.
const MOST_OTHERS: usize = 5;

impl SceneReport {
    pub(super) fn new(scene: &SceneFile, materials: &SceneMaterials<'_>) -> Self {
        // Parts of instances without an atlas have no material.
        let has_atlas = |owner: &Option<usize>| owner.is_some_and(|owner| scene.instances[owner].atlas.is_some());
        let owners = materials.triangles.owners.iter().map(has_atlas);
        let parts = materials.triangles.parts.iter().zip(&materials.of_part);
        let baked = parts.zip(owners).filter(|(_, has_atlas)| *has_atlas);
        let report = |((part, material), _): ((&Part, &PartMaterial), bool)| {
            PartReport::new(part.id.to_string(), part.instance.to_string(), material)
        };
        Self { id: scene.id.to_string(), parts: baked.map(report).collect() }
    }
}

impl PartReport {
    /// The best graph that was not taken and is more than one colour.
    fn runner_up(&self) -> Option<&GraphReport> {
        self.others.iter().find(|other| other.class != Some(Class::Flat))
    }

    fn new(part: String, instance: String, material: &PartMaterial) -> Self {
        let all = || material.fit.iter().flat_map(|fit| std::iter::once(&fit.chosen).chain(&fit.others));
        let taken = material.graph.as_ref().map(|graph| graph.graph.name.as_str());
        let others = all().filter(|found| Some(found.graph.name.as_str()) != taken);
        Self {
            part,
            instance,
            pixels: material.pixels,
            reason: material.reason,
            side: material.chart,
            values: material.values,
            chosen: material.graph.as_ref().map(|graph| GraphReport { parameters: parameters(graph), ..graph.into() }),
            error_of_one_color: all().find(|found| found.class == Some(Class::Flat)).map(|found| found.error),
            others: others.take(MOST_OTHERS).map(GraphReport::from).collect(),
        }
    }
}

impl From<&Candidate> for GraphReport {
    fn from(found: &Candidate) -> Self {
        let Candidate { class, error, distance, .. } = *found;
        Self { graph: found.graph.name.clone(), class, error, distance, parameters: BTreeMap::new() }
    }
}

fn parameters(found: &Candidate) -> BTreeMap<String, Vec<f64>> {
    let baked = found.settings.as_defaults(&found.graph, &found.graph.name);
    baked.parameters.iter().map(|p| (p.name.clone(), p.value.numbers().to_vec())).collect()
}

/// A hash of the built-in graphs, on which the results depend.
pub(super) fn library_sha256() -> String {
    sha256_of_bytes(LIBRARY.iter().map(|entry| entry.text).collect::<String>().as_bytes())
}

/// Writes the graphs, each as a material that is named after its part. Parts of one colour have none.
pub(super) fn write_graphs(path: &Path, materials: &SceneMaterials<'_>) -> Result<(), BaselineError> {
    let mut names = BTreeSet::new();
    let mut graphs: Vec<Graph> = Vec::new();
    for (part, material) in materials.triangles.parts.iter().zip(&materials.of_part) {
        let Some(found) = &material.graph else { continue };
        let name = unused_name(&name_of(part.id.as_str()), '_', &mut names);
        let doc = format!("{} of part '{}'", found.graph.name, part.id);
        graphs.push(Graph { doc: Some(doc), ..found.settings.as_defaults(&found.graph, &name) });
    }
    std::fs::write(path, to_text_of_all(&graphs)).map_err(FileError::io("write", path))?;
    Ok(())
}

/// A name that MaterialX allows: letters, digits and underscores. The prefix keeps it apart from names of other kinds.
fn name_of(part: &str) -> String {
    let allowed = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    format!("part_{}", part.chars().map(allowed).collect::<String>())
}

/// Pixels of a margin around what shows a part.
const MARGIN: usize = 4;

/// Side of a swatch in pixels.
const SWATCH: usize = 192;

/// The colour of pixels that show no part.
const NO_PART_COLOR: LinearRgb = LinearRgb([0.2; 3]);

/// Writes `photo.png`, if there is one, `estimate.png` and `fitted.png`, and for each part with a fit the same as
/// `<part>-photo.png` and so on, with `<part>-swatch.png` if it has a graph. Returns whether it wrote the photo: not
/// where the estimate has another size or shows another part of the view.
pub(super) fn write_pictures(
    folder: &Path,
    photo: Option<&Picture<SrgbRgb>>,
    estimate: &Estimate,
    materials: &SceneMaterials<'_>,
) -> Result<bool, BaselineError> {
    let given = materials.given;
    let Some((width, height)) = estimate.size() else { return Ok(false) };
    let estimated = Picture::from_fn(width, height, |x, y| {
        let [r, g, b, ..] = estimate.at(x, y);
        LinearRgb([r, g, b].map(|v| v.clamp(0.0, 1.0)))
    });
    let mut fitted = Picture::filled(width, height, NO_PART_COLOR);
    for (part, material) in materials.samples.iter().zip(&materials.of_part) {
        paint(&mut fitted, part, material, given);
    }
    let mut all = vec![("estimate", estimated.to_srgb()), ("fitted", fitted.to_srgb())];
    let shows_all = estimate.placement.unwrap_or_default() != Placement::CentreCrop;
    let photo = photo.filter(|photo| shows_all && photo.same_size(&fitted));
    all.extend(photo.map(|photo| ("photo", photo.clone())));
    for (name, picture) in &all {
        write_srgb(&folder.join(format!("{name}.png")), picture)?;
    }
    let parts = materials.triangles.parts.iter().zip(&materials.samples);
    for ((part, samples), material) in parts.zip(&materials.of_part) {
        if material.fit.is_none() {
            continue;
        }
        for (name, picture) in &all {
            write_srgb(&folder.join(format!("{}-{name}.png", part.id)), &crop(picture, samples))?;
        }
        if let Some(swatch) = swatch(samples, material, given) {
            write_srgb(&folder.join(format!("{}-swatch.png", part.id)), &swatch)?;
        }
    }
    Ok(photo.is_some())
}

/// Gives the pixels that show a part its material.
fn paint(picture: &mut Picture<LinearRgb>, part: &PartSamples, material: &PartMaterial, given: GivenMaps) {
    for (sample, [r, g, b, ..]) in part.samples.iter().zip(material.at(&part.places(), given)) {
        picture.set(sample.pixel[0], sample.pixel[1], LinearRgb([r, g, b]));
    }
}

/// The smallest rectangle around a part's pixels, with a margin.
fn crop(picture: &Picture<SrgbRgb>, part: &PartSamples) -> Picture<SrgbRgb> {
    let range = |axis: usize, size: usize| {
        let places = || part.samples.iter().map(|sample| sample.pixel[axis]);
        let first = places().min().unwrap_or(0).saturating_sub(MARGIN);
        let last = (places().max().unwrap_or(0) + MARGIN).min(size - 1);
        (first, last + 1 - first)
    };
    let ((x, width), (y, height)) = (range(0, picture.width()), range(1, picture.height()));
    Picture::from_fn(width, height, |dx, dy| picture.get(x + dx, y + dy))
}

/// The graph seen from the front: a square around what was fitted, whose pixels are no finer than the estimate's.
fn swatch(part: &PartSamples, material: &PartMaterial, given: GivenMaps) -> Option<Picture<SrgbRgb>> {
    material.graph.as_ref()?;
    let (_, samples) = part.of_main_chart()?;
    let range = |axis: fn(&[f64; 2]) -> f64| {
        let places = samples.iter().map(|sample| axis(&[sample.point.u, sample.point.v]));
        places.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
    };
    let ((left, right), (bottom, top)) = (range(|place| place[0]), range(|place| place[1]));
    let footprints = samples.iter().map(|sample| sample.point.footprint);
    let finest = footprints.fold(f64::INFINITY, f64::min);
    let side = (right - left).max(top - bottom).max(finest * SWATCH as f64);
    let pixel = side / SWATCH as f64;
    let middle = [0.5 * (left + right), 0.5 * (bottom + top)];
    let place = |k: usize| {
        let (x, y) = ((k % SWATCH) as f64 + 0.5, (k / SWATCH) as f64 + 0.5);
        [middle[0] - 0.5 * side + x * pixel, middle[1] + 0.5 * side - y * pixel, pixel]
    };
    let places: Vec<[f64; 3]> = (0..SWATCH * SWATCH).map(place).collect();
    let values = material.at(&places, given);
    Some(
        Picture::from_fn(SWATCH, SWATCH, |x, y| {
            let [r, g, b, ..] = values[y * SWATCH + x];
            LinearRgb([r, g, b])
        })
        .to_srgb(),
    )
}

/// The page of the scenes, each with whether it has a photo. Ids and names of graphs contain no characters that are special in HTML, save those of a user's files.
pub(super) fn html(method: &Method, scenes: &[(SceneReport, bool)]) -> String {
    let introduction = format!(
        "<strong>{}</strong>: {}. Parts are sorted by the number of pixels that show them. Errors are mean squares of \
         differences of linear colours at pixels that took no part in the fit.",
        escaped(&method.name),
        escaped(&method.description)
    );
    plain("Procedural materials", &introduction, &scenes.iter().map(section).collect::<String>(), "")
}

fn section((scene, has_photo): &(SceneReport, bool)) -> String {
    let id = &scene.id;
    let mut text = format!("<section><h2>{id}</h2><div class=\"row\">\n");
    for (name, caption) in pictures(*has_photo) {
        text.push_str(&figure(&format!("{id}/{name}.png"), id, caption));
    }
    text.push_str("</div>\n");
    let mut parts: Vec<&PartReport> = scene.parts.iter().collect();
    parts.sort_by(|a, b| b.pixels.cmp(&a.pixels).then(a.part.cmp(&b.part)));
    let count = |reason: Reason| parts.iter().filter(|part| part.reason == reason).count();
    let (graphs, colors) = (count(Reason::Graph), count(Reason::OneColor));
    let (few, unseen) = (count(Reason::FewPixels), count(Reason::Unseen));
    writeln!(
        text,
        "<p>Parts with a graph: {graphs}; of one colour: {colors}; with too few pixels: {few}; not seen: {unseen}. The \
         graphs with their parameters: <a href=\"{id}/materials.mtlx\">materials.mtlx</a></p>"
    )
    .expect("writing to a String cannot fail");
    text.extend(parts.iter().filter_map(|part| Some(with_graph(id, *has_photo, part, part.chosen.as_ref()?))));
    text.push_str(&table(&parts));
    text.push_str("</section>\n");
    text
}

fn pictures(has_photo: bool) -> Vec<(&'static str, &'static str)> {
    let photo = has_photo.then_some(("photo", "The photo"));
    photo.into_iter().chain([("estimate", "The estimate's base colour"), ("fitted", "The fitted materials")]).collect()
}

/// A part with its pictures and parameters.
fn with_graph(id: &str, has_photo: bool, part: &PartReport, chosen: &GraphReport) -> String {
    let name = &part.part;
    let mut text = format!("<h3>{name}: {}</h3><div class=\"row\">\n", escaped(&chosen.graph));
    for (picture, caption) in pictures(has_photo).into_iter().chain([("swatch", "The graph from the front")]) {
        text.push_str(&figure(&format!("{id}/{name}-{picture}.png"), name, caption));
    }
    text.push_str("</div><p>");
    text.push_str(&errors(part, chosen));
    text.push_str("</p><details><summary>Parameters</summary><div class=\"wide\"><table><tbody>\n");
    for (parameter, numbers) in &chosen.parameters {
        let numbers: Vec<String> = numbers.iter().map(|number| format!("{number:.4}")).collect();
        writeln!(text, "<tr><th scope=\"row\">{}</th><td>{}</td></tr>", escaped(parameter), numbers.join(", "))
            .expect("writing to a String cannot fail");
    }
    text.push_str("</tbody></table></div></details>\n");
    text
}

/// The errors of the graph, of one colour, and of the graph that came next.
fn errors(part: &PartReport, chosen: &GraphReport) -> String {
    let mut text = format!("{} pixels, error {:.5}", part.pixels, chosen.error);
    if let Some(error) = part.error_of_one_color {
        write!(text, "; one colour {error:.5}").expect("writing to a String cannot fail");
    }
    if let Some(next) = part.runner_up() {
        let name = escaped(&next.graph);
        write!(text, "; runner-up {name} {:.5}", next.error).expect("writing to a String cannot fail");
    }
    text
}

/// All parts that are seen, in a table.
fn table(parts: &[&PartReport]) -> String {
    let mut text = String::from(
        "<details><summary>All seen parts</summary><div class=\"wide\"><table><thead><tr><th>Part</th><th>Pixels</th>\
         <th>Material</th><th>Error</th><th>One colour</th><th>Runner-up</th></tr></thead><tbody>\n",
    );
    let number = |error: Option<f64>| error.map_or("-".to_owned(), |error| format!("{error:.5}"));
    for part in parts.iter().filter(|part| part.pixels > 0) {
        let material = match (&part.chosen, part.reason) {
            (Some(chosen), _) => escaped(&chosen.graph),
            (None, Reason::FewPixels) => "one colour: few pixels".to_owned(),
            (None, _) => "one colour".to_owned(),
        };
        let runner_up = part.runner_up().map_or("-".to_owned(), |other| escaped(&other.graph));
        let (error, flat) = (part.chosen.as_ref().map(|chosen| chosen.error), part.error_of_one_color);
        writeln!(
            text,
            "<tr><th scope=\"row\">{}</th><td>{}</td><td>{material}</td><td>{}</td><td>{}</td><td>{runner_up}</td></tr>",
            part.part,
            part.pixels,
            number(error),
            number(flat)
        )
        .expect("writing to a String cannot fail");
    }
    text.push_str("</tbody></table></div></details>\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_allowed_and_distinct() {
        let mut taken = BTreeSet::new();
        let named: Vec<String> =
            ["floor-p0", "floor.p0", "floor_p0"].map(|part| unused_name(&name_of(part), '_', &mut taken)).into();
        assert_eq!(named, ["part_floor_p0", "part_floor_p0_2", "part_floor_p0_3"]);
    }
}
