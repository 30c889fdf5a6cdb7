//! One scene checked: each map is read once, a few instances at a time, then judged together.

use mateval_image::Texture;
use mateval_scene::dataset::SceneFile;
use mateval_scene::submission::Map;
use mateval_scene::{Finding, SceneError, Severity};
use rayon::prelude::*;

use super::colours::{self, Decoding};
use super::copies::{CopyCount, copies};
use super::finding::{error, note};
use super::instance_facts::InstanceFacts;
use super::looks::{Look, looks, scalar_looks};
use super::plan::LintPlan;
use super::readings::{Readings, readings};
use super::sight::{InstanceSight, Sight};
use super::unobserved::fill;
use super::{map_remarks, orientation, scalars, shading, unobserved};
use crate::atlas_meshes::AtlasMeshes;
use crate::error::SubmissionError;
use crate::map_file::{self, MAX_MAP_BYTES, MapFile, MapHeader};
use crate::map_folder::MapFolder;
use crate::memory_budget::{MAX_SCENE_BYTES, MemoryBudget};
use crate::prediction::compact_texture;
use crate::submitted_file::{SubmittedFile, relative};

/// Instances whose maps are in memory at once.
const AT_ONCE: usize = 4;

/// What was found in a scene.
#[derive(Default)]
pub(super) struct SceneFindings {
    pub(super) findings: Vec<Finding>,
    /// How many maps could be decoded.
    pub(super) maps: usize,
    /// Not among the findings, since both are judged over all scenes.
    pub(super) decoding: Decoding,
    pub(super) readings: Readings,
}

/// Checks one scene. A scene that the submission leaves out has no findings here.
pub(super) fn check(plan: &LintPlan<'_>, scene: &SceneFile) -> Result<SceneFindings, SubmissionError> {
    if !plan.submission.join("scenes").join(scene.id.as_str()).is_dir() {
        return Ok(SceneFindings::default());
    }
    let sight = Sight::read(plan.dataset, scene)?;
    let order: Vec<usize> = (0..scene.instances.len()).filter(|at| scene.instances[*at].atlas.is_some()).collect();
    let atlases = AtlasMeshes::on_demand(plan.dataset, scene);
    let mut all: Vec<InstanceFacts> = Vec::new();
    for some in order.chunks(AT_ONCE) {
        let facts = some.par_iter().map(|&at| instance(plan, scene, at, &sight.instances[at], &atlases));
        all.extend(facts.collect::<Result<Vec<_>, _>>()?);
    }
    let maps = all.iter().map(|facts| facts.maps).sum();
    let mut findings: Vec<Finding> = all.iter_mut().flat_map(|facts| std::mem::take(&mut facts.findings)).collect();
    let (together, decoding, readings) = together(scene, &sight, &all);
    findings.extend(together);
    Ok(SceneFindings { findings, maps, decoding, readings })
}

fn together(scene: &SceneFile, sight: &Sight, all: &[InstanceFacts]) -> (Vec<Finding>, Decoding, Readings) {
    let place = format!("scenes/{}", scene.id);
    let mut findings = Vec::new();
    if all.iter().map(|facts| facts.bytes).sum::<usize>() > MAX_SCENE_BYTES {
        findings.push(error("scene_too_large", &place, MemoryBudget::exceeded(), "bake them smaller, or with 8 bits"));
    }
    if !sight.has_photo {
        let message = "the dataset has no input picture";
        let action = "maps were not compared with it; render the dataset (`mateval prep render`)";
        findings.push(note("no_photo", &place, message, action));
    }
    let looks: Vec<Look> = all.iter().flat_map(|facts| facts.looks.iter().copied()).collect();
    let files: Vec<&(String, bool)> = all.iter().filter_map(|facts| facts.base_color.as_ref()).collect();
    let are_png = files.iter().filter(|(_, is_png)| *is_png).count() * 2 >= files.len();
    findings.extend(orientation::check(&place, &looks));
    let exchanged = colours::exchanged(&place, &looks);
    let decoding = if exchanged.is_some() { Decoding::Unknown } else { colours::decoding(&place, &looks, are_png) };
    findings.extend(exchanged);
    findings.extend(shading::check(&place, &looks));
    findings.extend(scalars::check(&place, all));
    findings.extend(unobserved::check(&place, all.iter().filter_map(|facts| facts.fill.as_ref())));
    findings.extend(copies(&place, all.iter().map(|facts| facts.copies)));
    (findings, decoding, readings(&looks))
}

fn instance(
    plan: &LintPlan<'_>,
    scene: &SceneFile,
    at: usize,
    sight: &InstanceSight,
    atlases: &AtlasMeshes<'_>,
) -> Result<InstanceFacts, SceneError> {
    let instance = &scene.instances[at];
    let mut facts =
        InstanceFacts { folder: format!("scenes/{}/{}", scene.id, instance.id), ..InstanceFacts::default() };
    let reader = InstanceReader { plan, scene, at, atlases };
    let mut read = |map| reader.read(map, &mut facts);
    let [base_color, roughness, metallic] = [read(Map::BaseColor)?, read(Map::Roughness)?, read(Map::Metallic)?];
    if let Some(file) = &base_color {
        facts.looks = looks(at, &sight.pixels, &file.texture);
        facts.fill = Some(fill(&sight.texels, &file.texture));
        facts.base_color = Some((file.sha256.clone(), matches!(file.header, MapHeader::Png(_))));
    }
    let of = |file: &Option<MapFile>| -> Option<Texture> { file.as_ref().map(|file| file.texture.clone()) };
    facts.scalars = scalar_looks(&sight.pixels, of(&roughness), of(&metallic));
    let files = [base_color, roughness, metallic];
    facts.copies = CopyCount::of(&plan.dataset.folder(&scene.id), &instance.id, &files);
    Ok(facts)
}

/// Reads the maps of one instance.
struct InstanceReader<'a> {
    plan: &'a LintPlan<'a>,
    scene: &'a SceneFile,
    /// The instance, by its place in the scene.
    at: usize,
    atlases: &'a AtlasMeshes<'a>,
}

impl InstanceReader<'_> {
    /// A map, none if it is missing or cannot be used. Fails only where the dataset does.
    fn read(&self, map: Map, facts: &mut InstanceFacts) -> Result<Option<MapFile>, SceneError> {
        let Self { plan, scene, at, atlases } = self;
        let submission = plan.submission;
        let folder = MapFolder { submission, scene: &scene.id, instance: &scene.instances[*at].id };
        // A missing map, and two files for one map, are findings of `layout`.
        let Ok([path]) = <[_; 1]>::try_from(folder.present(map)) else { return Ok(None) };
        let name = relative(submission, &path);
        let decoded = match SubmittedFile::read(submission, &path, MAX_MAP_BYTES) {
            Ok(file) => map_file::decode(file, map, || atlases.mesh(*at))?,
            Err(fault) => Err(fault),
        };
        match decoded {
            Ok(file) => {
                facts.maps += 1;
                // A clone shares its texels.
                facts.bytes += compact_texture(file.clone(), map).bytes().len();
                let bad_texels = file.bad_texels.clone();
                facts.findings.extend(bad_texels.map(|fault| fault.into_finding(Severity::Warning, name.clone())));
                facts.findings.extend(map_remarks::remarks(&name, map, &file));
                Ok(Some(file))
            }
            Err(fault) => {
                facts.findings.push(fault.into_finding(Severity::Error, name));
                Ok(None)
            }
        }
    }
}
