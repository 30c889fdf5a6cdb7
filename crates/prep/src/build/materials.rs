//! Unwraps every instance of a scene and bakes its material to the textures of its atlas.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use mateval_dataset::layout::SceneFolder;
use mateval_dataset::submission::Map;
use mateval_dataset::{Finding, Progress, Report, Severity, TriangleMesh};
use mateval_files::cache::Key;
use mateval_files::work_folder::make_folder;
use mateval_image::{Picture, Texture, png_io};
use rayon::prelude::*;

use super::baking::{Baked, BakedMaterial, bake};
use super::parts::InstanceEntry;
use super::plan::Plan;
use crate::atlas::{AtlasCache, AtlasError, SizeWish, Unwrapped, Wanted, shape_key, unwrap_copies};
use crate::error::PrepError;

/// An instance's atlas, if it has one.
pub(super) struct InstanceAtlas {
    pub(super) unwrapped: Option<Unwrapped>,
    pub(super) half_pixel_m: Option<f64>,
    findings: Vec<Finding>,
}

/// The wanted sizes of a scene's atlases.
pub(super) struct AtlasSizes<'a> {
    /// Texels a side, where the recipe states them. Otherwise a texel is at most half a pixel of the input view.
    pub(super) fixed: Option<u32>,
    /// The depth at which each instance is seen in metres; absent if no view shows it.
    pub(super) nearest: &'a [Option<f64>],
}

/// Unwraps every instance and bakes its material, in parallel.
pub(super) fn unwrap_and_bake(
    plan: &mut Plan,
    folder: &SceneFolder,
    sizes: &AtlasSizes<'_>,
    cache: Option<&AtlasCache>,
    progress: Progress<'_>,
) -> Result<Vec<InstanceAtlas>, PrepError> {
    let atlases = unwrap_all(plan, sizes, cache, progress);
    for remark in cache.map(AtlasCache::finish).unwrap_or_default() {
        progress(Report::Message(&remark));
    }
    let textures = plan.scene.texture_list();
    let (done, all) = (AtomicUsize::new(0), atlases.len());
    let shown: &Plan = plan;
    let atlases = atlases
        .into_par_iter()
        .enumerate()
        .map(|(at, atlas)| {
            let baked = bake_instance(shown, folder, at, &textures, atlas);
            progress(Report::step("textures", done.fetch_add(1, Ordering::Relaxed) + 1, all));
            baked
        })
        .collect::<Result<Vec<_>, PrepError>>()?;
    plan.findings.extend(atlases.iter().flat_map(|atlas| atlas.findings.clone()));
    Ok(atlases)
}

/// The atlas of every instance that has an appearance. Copies of a shape are unwrapped at once, and shapes with most
/// triangles first, so that none of them is left for the end.
fn unwrap_all(
    plan: &Plan,
    sizes: &AtlasSizes<'_>,
    cache: Option<&AtlasCache>,
    progress: Progress<'_>,
) -> Vec<InstanceAtlas> {
    let wishes: Vec<(SizeWish, Option<f64>)> = (0..plan.instances.len()).map(|at| wish(plan, sizes, at)).collect();
    let shapes = copies_of_shapes(plan);
    let (done, all) = (AtomicUsize::new(0), shapes.iter().map(Vec::len).sum());
    let unwrap = |copies: &Vec<usize>| {
        let wanted: Vec<Wanted<'_>> =
            copies.iter().map(|at| Wanted { mesh: &plan.scene.surfaces[*at].mesh, size: wishes[*at].0 }).collect();
        let unwrapped = unwrap_copies(shape(plan, copies[0]), &wanted, cache);
        progress(Report::step("atlases", done.fetch_add(copies.len(), Ordering::Relaxed) + copies.len(), all));
        copies.iter().copied().zip(unwrapped).collect::<Vec<_>>()
    };
    // The bridge hands out one shape after the other in order, not halves of the list.
    let mut unwrapped: BTreeMap<usize, _> = shapes.iter().par_bridge().flat_map_iter(unwrap).collect();
    let of_instance = |at: usize| {
        let half_pixel_m = wishes[at].1;
        match unwrapped.remove(&at) {
            Some(made) => instance_atlas(plan, at, wishes[at], made),
            None => InstanceAtlas { unwrapped: None, half_pixel_m, findings: Vec::new() },
        }
    };
    (0..plan.instances.len()).map(of_instance).collect()
}

/// The instances that have an appearance, by their shape; those of the shapes with most triangles first.
fn copies_of_shapes(plan: &Plan) -> Vec<Vec<usize>> {
    let has_appearance = |at: &usize| plan.scene.materials[plan.scene.surfaces[*at].material.0].has_appearance();
    let seen: Vec<usize> = (0..plan.instances.len()).filter(has_appearance).collect();
    let keys: Vec<Key> = seen.par_iter().map(|at| shape_key(shape(plan, *at))).collect();
    let mut shapes: BTreeMap<Key, Vec<usize>> = BTreeMap::new();
    for (at, key) in seen.into_iter().zip(keys) {
        shapes.entry(key).or_default().push(at);
    }
    let mut shapes: Vec<Vec<usize>> = shapes.into_values().collect();
    shapes.sort_by_key(|copies| std::cmp::Reverse(shape(plan, copies[0]).triangles.len()));
    shapes
}

/// The mesh before it was moved to its place, if it is known and still the same one; otherwise the mesh itself.
fn shape(plan: &Plan, instance: usize) -> &TriangleMesh {
    let mesh = &plan.scene.surfaces[instance].mesh;
    let is_same =
        |shape: &&TriangleMesh| shape.triangles == mesh.triangles && shape.positions.len() == mesh.positions.len();
    plan.origins[instance].shape.as_deref().filter(is_same).unwrap_or(mesh)
}

/// The wanted size of an instance's atlas, and half a pixel of the input view at its depth in metres. An instance that
/// no view shows gets the least size.
fn wish(plan: &Plan, sizes: &AtlasSizes<'_>, at: usize) -> (SizeWish, Option<f64>) {
    let focal = plan.views[0].camera.intrinsics.fx;
    let half_pixel_m = sizes.nearest[at].map(|depth| 0.5 * depth / focal);
    let wish = match (sizes.fixed, half_pixel_m) {
        (Some(size), _) => SizeWish::Fixed(size),
        (None, Some(texel_m)) => SizeWish::Texel(texel_m),
        (None, None) => SizeWish::Texel(f64::INFINITY),
    };
    (wish, half_pixel_m)
}

/// An instance with its atlas, and what is to be said of it.
fn instance_atlas(
    plan: &Plan,
    at: usize,
    (wish, half_pixel_m): (SizeWish, Option<f64>),
    made: Result<Unwrapped, AtlasError>,
) -> InstanceAtlas {
    let instance = &plan.instances[at];
    let finding = |code: &str, message: &str| atlas_finding(plan, instance, code, message);
    let unwrapped = match made {
        Ok(unwrapped) => unwrapped,
        Err(error) => {
            let findings = vec![finding("no_atlas", &error.to_string())];
            return InstanceAtlas { unwrapped: None, half_pixel_m, findings };
        }
    };
    let mut findings = Vec::new();
    match wish {
        SizeWish::Fixed(size) if unwrapped.size != size => {
            let error = AtlasError::DoesNotFit { charts: unwrapped.charts, size };
            findings.push(finding("atlas_grown", &format!("{error}; its atlas is {0}x{0}", unwrapped.size)));
        }
        SizeWish::Texel(texel_m) if unwrapped.texel_m > texel_m * COARSE => {
            let message = format!(
                "at {0}x{0} texels a texel is {1:.5} m, half a pixel of the input view {texel_m:.5} m",
                unwrapped.size, unwrapped.texel_m
            );
            findings.push(finding("coarse_atlas", &message));
        }
        _ => {}
    }
    if unwrapped.unmapped > 0 {
        let all = unwrapped.mesh.triangles.len();
        let message = format!("{} of {all} triangles have no area in its atlas", unwrapped.unmapped);
        findings.push(finding("unmapped_triangles", &message));
    }
    InstanceAtlas { unwrapped: Some(unwrapped), half_pixel_m, findings }
}

/// Bakes an instance's material to its atlas, if it has one.
fn bake_instance(
    plan: &Plan,
    folder: &SceneFolder,
    at: usize,
    textures: &[Texture],
    mut atlas: InstanceAtlas,
) -> Result<InstanceAtlas, PrepError> {
    let (instance, surface) = (&plan.instances[at], &plan.scene.surfaces[at]);
    let material = &plan.scene.materials[surface.material.0];
    if let Some(unwrapped) = &atlas.unwrapped
        && let Some(baked) = bake(unwrapped, &surface.mesh, material, textures)
    {
        write_material(folder, instance, unwrapped.size, &baked)?;
        atlas.findings.extend(clipped_finding(plan, instance, &baked));
    }
    Ok(atlas)
}

/// A texel that exceeds half a pixel by more than this factor is a finding.
const COARSE: f64 = 1.02;

fn atlas_finding(plan: &Plan, instance: &InstanceEntry, code: &str, message: &str) -> Finding {
    let action = match code {
        "no_atlas" => "left it without an atlas; it is not scored",
        "atlas_grown" => "made its atlas larger than the recipe states",
        "unmapped_triangles" => "placed each on one point of the atlas; their area is negligible",
        _ => "kept the size; the truth is as coarse as its texels",
    };
    Finding::new(
        if code == "no_atlas" { Severity::Warning } else { Severity::Note },
        code,
        plan.file.clone(),
        format!("instance '{}'", instance.id),
        message,
        action,
    )
}

fn clipped_finding(plan: &Plan, instance: &InstanceEntry, baked: &Baked) -> Option<Finding> {
    baked.clipped.then(|| {
        Finding::new(
            Severity::Warning,
            "base_color_clipped",
            plan.file.clone(),
            format!("instance '{}'", instance.id),
            "its base colour exceeds 0..1",
            "clipped it in the baked texture, but not in the truth's pictures",
        )
    })
}

fn write_material(folder: &SceneFolder, instance: &InstanceEntry, size: u32, baked: &Baked) -> Result<(), PrepError> {
    let path = folder.truth_material(&instance.id);
    make_folder(&path)?;
    let [base, rough, metal] = Map::ALL.map(|map| path.join(map.stem()).with_extension("png"));
    match &baked.material {
        BakedMaterial::Constant { base_color, roughness, metallic } => {
            let size = size as usize;
            png_io::write_rgb_words(&base, &Picture::filled(size, size, *base_color))?;
            png_io::write_ids(&rough, &Picture::filled(size, size, *roughness))?;
            png_io::write_ids(&metal, &Picture::filled(size, size, *metallic))?;
        }
        BakedMaterial::Textured { base_color, roughness, metallic } => {
            png_io::write_rgb_bytes(&base, base_color)?;
            png_io::write_grey_bytes(&rough, roughness)?;
            png_io::write_grey_bytes(&metal, metallic)?;
        }
    }
    Ok(())
}
