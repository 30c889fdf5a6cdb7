//! Unwraps every instance and bakes its material.

use std::sync::atomic::{AtomicUsize, Ordering};

use mateval_image::{Picture, Texture, png_io};
use mateval_scene::layout::SceneFolder;
use mateval_scene::submission::Map;
use mateval_scene::{Finding, Progress, Severity, TriangleMesh};
use rayon::prelude::*;

use super::plan::Plan;
use crate::atlas::{AtlasError, SizeWish, Unwrapped, unwrap};
use crate::bake::{Baked, BakedMaterial, bake};
use crate::error::PrepError;
use crate::instances::InstanceEntry;

/// An instance's atlas, if it has one.
pub(super) struct InstanceAtlas {
    pub(super) unwrapped: Option<Unwrapped>,
    pub(super) half_pixel_m: Option<f64>,
    findings: Vec<Finding>,
}

/// Unwraps every instance and bakes its material, in parallel. `nearest` holds the depth at which each instance is seen.
pub(super) fn write(
    plan: &mut Plan,
    folder: &SceneFolder,
    fixed_size: Option<u32>,
    nearest: &[Option<f64>],
    progress: Progress<'_>,
) -> Result<Vec<InstanceAtlas>, PrepError> {
    let textures = plan.scene.texture_list();
    let focal = plan.views[0].camera.intrinsics.fx;
    let (done, all) = (AtomicUsize::new(0), plan.instances.len());
    let shown: &Plan = plan;
    let atlases = (0..all)
        .into_par_iter()
        .map(|at| {
            let half_pixel_m = nearest[at].map(|depth| 0.5 * depth / focal);
            let atlas = write_instance(shown, folder, at, &textures, fixed_size, half_pixel_m);
            progress("atlases", done.fetch_add(1, Ordering::Relaxed) + 1, all);
            atlas
        })
        .collect::<Result<Vec<_>, PrepError>>()?;
    plan.findings.extend(atlases.iter().flat_map(|atlas| atlas.findings.clone()));
    Ok(atlases)
}

fn write_instance(
    plan: &Plan,
    folder: &SceneFolder,
    at: usize,
    textures: &[Texture],
    fixed_size: Option<u32>,
    half_pixel_m: Option<f64>,
) -> Result<InstanceAtlas, PrepError> {
    let (instance, surface) = (&plan.instances[at], &plan.scene.surfaces[at]);
    let material = &plan.scene.materials[surface.material.0];
    let mut atlas = InstanceAtlas { unwrapped: None, half_pixel_m, findings: Vec::new() };
    if !material.has_appearance() {
        return Ok(atlas);
    }
    let (unwrapped, remark) = match unwrap_at_wanted_size(&surface.mesh, fixed_size, half_pixel_m) {
        Ok(unwrapped) => unwrapped,
        Err(error) => {
            atlas.findings.push(atlas_finding(plan, instance, "no_atlas", &error.to_string()));
            return Ok(atlas);
        }
    };
    atlas.findings.extend(remark.map(|(code, what)| atlas_finding(plan, instance, code, &what)));
    if unwrapped.unmapped > 0 {
        let what =
            format!("{} of {} triangles have no area in its atlas", unwrapped.unmapped, surface.mesh.triangles.len());
        atlas.findings.push(atlas_finding(plan, instance, "unmapped_triangles", &what));
    }
    if let Some(baked) = bake(&unwrapped, &surface.mesh, material, textures) {
        write_material(folder, instance, unwrapped.size, &baked)?;
        atlas.findings.extend(clipped_finding(plan, instance, &baked));
    }
    atlas.unwrapped = Some(unwrapped);
    Ok(atlas)
}

type Remark = Option<(&'static str, String)>;

/// Unwraps at the recipe's size, or so that a texel is at most half a pixel of the input view. An instance that no view shows
/// gets the least size. If its charts do not fit into the recipe's size, it gets the least power of two that they fit into.
fn unwrap_at_wanted_size(
    mesh: &TriangleMesh,
    fixed_size: Option<u32>,
    half_pixel_m: Option<f64>,
) -> Result<(Unwrapped, Remark), AtlasError> {
    // So coarse that only the number of charts and their gutters decide the size.
    let least = SizeWish::Texel(mesh.area().sqrt().max(f64::MIN_POSITIVE));
    let unwrapped = match fixed_size {
        Some(size) => match unwrap(mesh, SizeWish::Fixed(size)) {
            Err(error @ AtlasError::DoesNotFit { .. }) => {
                let unwrapped = unwrap(mesh, least)?;
                let remark = ("atlas_grown", format!("{error}; its atlas is {0}x{0}", unwrapped.size));
                return Ok((unwrapped, Some(remark)));
            }
            other => other?,
        },
        None => unwrap(mesh, half_pixel_m.map_or(least, SizeWish::Texel))?,
    };
    let coarse = fixed_size.is_none() && half_pixel_m.is_some_and(|wish| unwrapped.texel_m > wish * COARSE);
    let remark = coarse.then(|| {
        let wish = half_pixel_m.unwrap_or_default();
        let what = format!(
            "at {0}x{0} texels a texel is {1:.5} m, half a pixel of the input view {wish:.5} m",
            unwrapped.size, unwrapped.texel_m
        );
        ("coarse_atlas", what)
    });
    Ok((unwrapped, remark))
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
    Finding {
        severity: if code == "no_atlas" { Severity::Warning } else { Severity::Note },
        code: code.to_owned(),
        file: plan.file.clone(),
        place: format!("instance '{}'", instance.id),
        message: message.to_owned(),
        action: action.to_owned(),
    }
}

fn clipped_finding(plan: &Plan, instance: &InstanceEntry, baked: &Baked) -> Option<Finding> {
    baked.clipped.then(|| Finding {
        severity: Severity::Warning,
        code: "base_color_clipped".to_owned(),
        file: plan.file.clone(),
        place: format!("instance '{}'", instance.id),
        message: "its base colour exceeds 0..1".to_owned(),
        action: "clipped it in the baked texture, but not in the truth's pictures".to_owned(),
    })
}

fn write_material(folder: &SceneFolder, instance: &InstanceEntry, size: u32, baked: &Baked) -> Result<(), PrepError> {
    let path = folder.truth_material(&instance.id);
    std::fs::create_dir_all(&path).map_err(PrepError::io("make", &path))?;
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
