//! One scene of a recipe, from its source to its folder.

mod geometry;
mod materials;

use std::path::Path;

use glam::DVec3;
use mateval_image::exr_io::{self, Precision};
use mateval_image::png_io;
use mateval_scene::camera::{Camera, Intrinsics};
use mateval_scene::dataset::{Atlas, FORMAT, Instance, Part, SceneFile, SceneSource, SourceFile, View};
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_scene::reference::{ReferenceScene, Surface};
use mateval_scene::{Finding, ViewId, json, reference_io};
use mateval_tracer::World;

use crate::bitterli::{self, BitterliScene};
use crate::error::PrepError;
use crate::instances::{self, InstanceEntry};
use crate::recipe::{GivenCamera, RESOLUTION, Recipe, RecipeScene};
use crate::views::{GeometryPictures, TruthPictures, ViewScene};
use materials::InstanceAtlas;
use mateval_scene::Progress;

/// A scene, its instances numbered and its cameras placed.
struct Plan {
    scene: std::sync::Arc<ReferenceScene>,
    instances: Vec<InstanceEntry>,
    views: Vec<View>,
    findings: Vec<Finding>,
    file: String,
}

/// Makes the scene in `folder`, from its source below `source`. Gives the licence that came with it.
pub fn build(
    recipe: &Recipe,
    entry: &RecipeScene,
    source: &Path,
    folder: &SceneFolder,
    progress: Progress<'_>,
) -> Result<Option<bitterli::LicenceText>, PrepError> {
    progress("read the source", 0, 1);
    let read = bitterli::read(&source.join(&entry.bitterli), &bitterli::Limits::default())?;
    let files: Vec<SourceFile> = read
        .source_files
        .iter()
        .map(|(path, sha256)| SourceFile { path: path.clone(), sha256: sha256.clone() })
        .collect();
    let licence = read.licence.clone();
    let mut plan = plan(recipe, entry, read)?;
    make_folders(folder, &plan)?;

    let has_appearance = |surface: &Surface| plan.scene.materials[surface.material.0].has_appearance();
    let hoped: Vec<bool> = plan.scene.surfaces.iter().map(has_appearance).collect();
    let nearest = write_views(&plan, folder, &hoped, progress)?;
    let atlas_size = entry.atlas_size.or(recipe.atlas_size);
    let atlases = materials::write(&mut plan, folder, atlas_size, &nearest, progress)?;
    let scored: Vec<bool> = atlases.iter().map(|atlas| atlas.unwrapped.is_some()).collect();
    if scored != hoped {
        // An instance without an atlas cannot be scored: its pixels must not be valid.
        write_views(&plan, folder, &scored, progress)?;
    }
    geometry::write(&plan, folder, &atlases)?;
    reference_io::write(folder, &plan.scene)?;
    write_scene_file(plan, entry, files, &atlases, folder)?;
    Ok(licence)
}

fn plan(recipe: &Recipe, entry: &RecipeScene, read: BitterliScene) -> Result<Plan, PrepError> {
    let fault = |what: String| PrepError::Scene { scene: entry.id.to_string(), what };
    if read.scene.surfaces.is_empty() {
        let what = format!("not one surface could be read of it:{}", Finding::list(&read.findings));
        return Err(fault(what));
    }
    let instances = instances::list(&read.scene).map_err(|error| fault(error.to_string()))?;
    let camera = input_camera(recipe, entry, &read.camera).map_err(fault)?;
    let input = View { id: ViewId::new(INPUT).expect("our own id is an id"), x_deg: 0.0, y_deg: 0.0, camera };
    let turned = recipe.views.iter().map(|offset| View {
        id: offset.id.clone(),
        x_deg: offset.x_deg,
        y_deg: offset.y_deg,
        camera: camera.turned(offset.x_deg, offset.y_deg),
    });
    let views = std::iter::once(input).chain(turned).collect();
    let file = entry.bitterli.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Plan { scene: std::sync::Arc::new(read.scene), instances, views, findings: read.findings, file })
}

/// The source's camera or the recipe's, at the recipe's resolution: the horizontal field of view is kept.
fn input_camera(recipe: &Recipe, entry: &RecipeScene, source: &Camera) -> Result<Camera, String> {
    let old = source.intrinsics;
    let [width, height] = entry.resolution.or(recipe.resolution).unwrap_or([old.width, old.height]);
    if ![width, height].iter().all(|side| RESOLUTION.contains(side)) {
        return Err(format!(
            "the source's film is {width}x{height}; name a resolution of 16 to 8192 a side in the recipe"
        ));
    }
    if let Some(GivenCamera { position, target, fov_y_deg }) = entry.camera {
        let intrinsics = Intrinsics::from_fov_y(width, height, fov_y_deg.to_radians());
        let camera = Camera::look_at(DVec3::from_array(position), DVec3::from_array(target), DVec3::Y, intrinsics);
        return camera.ok_or_else(|| "camera: position and target must differ, and not only in height".to_owned());
    }
    let scale = f64::from(width) / f64::from(old.width);
    let intrinsics = Intrinsics {
        width,
        height,
        fx: old.fx * scale,
        fy: old.fy * scale,
        cx: old.cx * scale,
        cy: (old.cy - f64::from(old.height) / 2.0) * scale + f64::from(height) / 2.0,
    };
    Ok(Camera { intrinsics, ..*source })
}

fn make_folders(folder: &SceneFolder, plan: &Plan) -> Result<(), PrepError> {
    let views = plan.views.iter().flat_map(|view| [folder.view(&view.id), folder.truth_view(&view.id)]);
    let geometry = folder.path().join("geometry");
    for path in views.chain([geometry]) {
        std::fs::create_dir_all(&path).map_err(PrepError::io("make", path))?;
    }
    Ok(())
}

/// Writes the pictures of every view. Gives the nearest depth in metres at which each instance is seen: in the input view,
/// or where that does not show it in any other.
fn write_views(
    plan: &Plan,
    folder: &SceneFolder,
    scored: &[bool],
    progress: Progress<'_>,
) -> Result<Vec<Option<f64>>, PrepError> {
    let world = World::new(plan.scene.clone())?;
    let instances: Vec<u16> = plan.instances.iter().map(|entry| entry.index.0.get()).collect();
    let parts: Vec<Vec<u16>> = plan
        .instances
        .iter()
        .map(|entry| entry.part_of_triangle.iter().map(|part| entry.parts[*part].index.0.get()).collect())
        .collect();
    let scene = ViewScene::new(&plan.scene, &world, &instances, &parts, scored);
    let mut in_input = vec![None; plan.instances.len()];
    let mut elsewhere = vec![None; plan.instances.len()];
    for (at, view) in plan.views.iter().enumerate() {
        progress("views", at, plan.views.len());
        let (geometry, truth) = scene.pictures(&view.camera, &plan.views[0].camera);
        note_nearest(&geometry, if at == 0 { &mut in_input } else { &mut elsewhere });
        write_view(folder, &view.id, &geometry, &truth)?;
    }
    progress("views", plan.views.len(), plan.views.len());
    Ok(in_input.into_iter().zip(elsewhere).map(|(first, other): (Option<f64>, _)| first.or(other)).collect())
}

fn note_nearest(geometry: &GeometryPictures, nearest: &mut [Option<f64>]) {
    for (instance, depth) in geometry.instance.pixels().iter().zip(geometry.depth.pixels()) {
        if let Some(place) = usize::from(*instance).checked_sub(1) {
            let depth = f64::from(*depth);
            nearest[place] = Some(nearest[place].map_or(depth, |other: f64| other.min(depth)));
        }
    }
}

fn write_view(
    folder: &SceneFolder,
    view: &ViewId,
    geometry: &GeometryPictures,
    truth: &TruthPictures,
) -> Result<(), PrepError> {
    let shown = folder.view(view);
    exr_io::write_scalar(&shown.join("depth.exr"), &geometry.depth, Precision::Float)?;
    exr_io::write_normal(&shown.join("normal.exr"), &geometry.normal, Precision::Half)?;
    png_io::write_ids(&shown.join("instance.png"), &geometry.instance)?;
    png_io::write_ids(&shown.join("part.png"), &geometry.part)?;
    png_io::write_mask(&shown.join("valid.png"), &geometry.valid)?;
    if view.as_str() != INPUT {
        png_io::write_mask(&shown.join("unobserved.png"), &geometry.unobserved)?;
    }
    let hidden = folder.truth_view(view);
    exr_io::write_linear(&hidden.join("albedo.exr"), &truth.albedo, Precision::Float)?;
    exr_io::write_linear(&hidden.join("diffuse_albedo.exr"), &truth.diffuse_albedo, Precision::Float)?;
    exr_io::write_scalar(&hidden.join("roughness.exr"), &truth.roughness, Precision::Float)?;
    exr_io::write_scalar(&hidden.join("metallic.exr"), &truth.metallic, Precision::Float)?;
    png_io::write_mask(&hidden.join("specular_region.png"), &truth.specular_region)?;
    Ok(())
}

fn write_scene_file(
    plan: Plan,
    entry: &RecipeScene,
    files: Vec<SourceFile>,
    atlases: &[InstanceAtlas],
    folder: &SceneFolder,
) -> Result<(), PrepError> {
    let instances = plan.instances.iter().zip(&plan.scene.surfaces).zip(atlases);
    let instances = instances
        .map(|((instance, surface), atlas)| Instance {
            id: instance.id.clone(),
            index: instance.index,
            name: surface.name.clone(),
            category: None,
            super_category: None,
            triangles: surface.mesh.triangles.len(),
            atlas: atlas.unwrapped.as_ref().map(|unwrapped| Atlas {
                size: unwrapped.size,
                charts: unwrapped.charts,
                coverage: unwrapped.coverage,
                texel_m: unwrapped.texel_m,
                half_pixel_m: atlas.half_pixel_m,
            }),
        })
        .collect();
    let parts = plan
        .instances
        .iter()
        .flat_map(|instance| {
            instance.parts.iter().enumerate().map(move |(at, part)| Part {
                id: part.id.clone(),
                index: part.index,
                instance: instance.id.clone(),
                triangles: instance.part_of_triangle.iter().filter(|of| **of == at).count(),
            })
        })
        .collect();
    let house = entry.house.clone().unwrap_or_else(|| {
        let folder = entry.bitterli.parent().and_then(Path::file_name);
        folder.map_or_else(|| entry.id.to_string(), |name| name.to_string_lossy().into_owned())
    });
    let mut findings = plan.findings;
    findings.sort();
    let file = SceneFile {
        format: FORMAT.to_owned(),
        id: entry.id.clone(),
        source: SceneSource { kind: "bitterli".to_owned(), house, files },
        exposure: entry.exposure,
        views: plan.views,
        instances,
        parts,
        findings,
    };
    Ok(json::write(&folder.scene_file(), &file)?)
}
