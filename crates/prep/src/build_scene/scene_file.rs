//! Writes the `scene.json` of a scene.

use mateval_scene::dataset::{Atlas, FORMAT, Instance, PartSet, SceneFile, SceneSource, SourceFile};
use mateval_scene::json;
use mateval_scene::layout::SceneFolder;

use super::materials::InstanceAtlas;
use super::plan::Plan;
use crate::error::PrepError;
use crate::recipe::{Recipe, RecipeScene};

/// Writes `scene.json`.
pub(super) fn write(
    plan: Plan,
    recipe: &Recipe,
    entry: &RecipeScene,
    atlases: &[InstanceAtlas],
    folder: &SceneFolder,
) -> Result<(), PrepError> {
    let instances = plan.instances.iter().zip(&plan.scene.surfaces).zip(atlases).zip(&plan.stated);
    let instances = instances
        .map(|(((instance, surface), atlas), stated)| Instance {
            id: instance.id.clone(),
            index: instance.index,
            name: surface.name.clone(),
            role: instance.role.clone(),
            category: instance.category.clone(),
            super_category: instance.super_category.clone(),
            triangles: surface.mesh.triangles.len(),
            unstated: stated.unstated(),
            atlas: atlas.unwrapped.as_ref().map(|unwrapped| Atlas {
                size: unwrapped.size,
                charts: unwrapped.charts,
                coverage: unwrapped.coverage,
                texel_m: unwrapped.texel_m,
                half_pixel_m: atlas.half_pixel_m,
            }),
        })
        .collect();
    let mut parts = Vec::new();
    let mut part_sets = Vec::new();
    for split in &plan.part_splits {
        match &split.id {
            None => parts = split.listed(&plan.instances),
            Some(id) => part_sets.push(PartSet { id: id.clone(), parts: split.listed(&plan.instances) }),
        }
    }
    let files = plan.files.into_iter().map(|(path, sha256)| SourceFile { path, sha256 }).collect();
    let mut findings = plan.findings;
    findings.sort();
    let file = SceneFile {
        format: FORMAT.to_owned(),
        id: entry.id.clone(),
        source: SceneSource {
            kind: plan.kind,
            house: plan.house,
            states_roughness: plan.states_roughness,
            states_metallic: plan.states_metallic,
            shift_m: plan.shift_m.to_array(),
            files,
        },
        lights: plan.lights,
        materials: recipe.materials,
        exposure: entry.exposure,
        photo: plan.photo.map(|photo| photo.listed),
        views: plan.views,
        instances,
        parts,
        part_sets,
        findings,
    };
    Ok(json::write(&folder.scene_file(), &file)?)
}
