//! `report.json`: what was found for each part.

use std::collections::BTreeMap;

use mateval_procedural::fit::candidate::Candidate;
use mateval_procedural::library::{Class, LIBRARY};
use mateval_scene::dataset::{Part, SceneFile};
use mateval_scene::manifest::sha256_of_bytes;
use serde::Serialize;

use super::part_frame::Chart;
use super::part_material::{PartMaterial, Reason};
use super::scene_materials::SceneMaterials;

/// The name of the file.
pub(super) const REPORT: &str = "report.json";

/// The format's name and version.
pub(super) const REPORT_FORMAT: &str = "mateval-procedural/1";

/// The whole file.
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
    pub(super) id: String,
    pub(super) parts: Vec<PartReport>,
}

/// What was found for a part.
#[derive(Serialize)]
pub(super) struct PartReport {
    pub(super) part: String,
    pub(super) instance: String,
    /// The number of pixels that show it.
    pub(super) pixels: usize,
    pub(super) reason: ReasonWord,
    /// The side of its box that was fitted.
    pub(super) side: Option<Chart>,
    /// Median base colour (linear), roughness and metallic of its pixels, or what stands for them.
    pub(super) values: [f32; 5],
    /// The chosen graph.
    pub(super) chosen: Option<GraphReport>,
    /// The error of one colour at the same held-out pixels.
    pub(super) error_of_one_color: Option<f64>,
    /// The other graphs, in the order of the fit's own score.
    pub(super) others: Vec<OtherReport>,
}

/// What decided on a part's material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum ReasonWord {
    Unseen,
    FewPixels,
    OneColor,
    Graph,
}

/// A graph with the numbers of its parameters.
#[derive(Serialize)]
pub(super) struct GraphReport {
    pub(super) graph: String,
    pub(super) class: Option<Class>,
    /// Weighted mean square of the differences of linear colours at the held-out pixels.
    pub(super) error: f64,
    /// How far its statistics are from those of the pixels.
    pub(super) distance: f64,
    pub(super) parameters: BTreeMap<String, Vec<f64>>,
}

/// A graph that was not chosen.
#[derive(Serialize)]
pub(super) struct OtherReport {
    pub(super) graph: String,
    pub(super) class: Option<Class>,
    pub(super) error: f64,
    pub(super) distance: f64,
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
    pub(super) fn runner_up(&self) -> Option<&OtherReport> {
        self.others.iter().find(|other| other.class != Some(Class::Flat))
    }

    fn new(part: String, instance: String, material: &PartMaterial) -> Self {
        let reason = match &material.reason {
            Reason::Unseen => ReasonWord::Unseen,
            Reason::FewPixels => ReasonWord::FewPixels,
            Reason::OneColor(_) => ReasonWord::OneColor,
            Reason::Graph(_) => ReasonWord::Graph,
        };
        let fit = material.fit();
        let all = || fit.into_iter().flat_map(|fit| std::iter::once(&fit.chosen).chain(&fit.others));
        let taken = material.graph.as_ref().map(|graph| graph.graph.name.as_str());
        let others = all().filter(|found| Some(found.graph.name.as_str()) != taken);
        let other = |other: &Candidate| OtherReport {
            graph: other.graph.name.clone(),
            class: other.class,
            error: other.error,
            distance: other.distance,
        };
        Self {
            part,
            instance,
            pixels: material.pixels,
            reason,
            side: material.chart,
            values: material.values,
            chosen: material.graph.as_ref().map(GraphReport::new),
            error_of_one_color: all().find(|found| found.class == Some(Class::Flat)).map(|found| found.error),
            others: others.take(MOST_OTHERS).map(other).collect(),
        }
    }
}

impl GraphReport {
    fn new(found: &Candidate) -> Self {
        let baked = found.settings.as_defaults(&found.graph, &found.graph.name);
        let parameters = baked.parameters.iter().map(|p| (p.name.clone(), p.value.numbers().to_vec()));
        Self {
            graph: found.graph.name.clone(),
            class: found.class,
            error: found.error,
            distance: found.distance,
            parameters: parameters.collect(),
        }
    }
}

/// A hash of the built-in graphs, on which the results depend.
pub(super) fn library_sha256() -> String {
    sha256_of_bytes(LIBRARY.iter().map(|entry| entry.text).collect::<String>().as_bytes())
}
