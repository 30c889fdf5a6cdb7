//! One scene of a recipe, from its source to its folder.

use std::path::Path;

use glam::DVec3;
use mateval_image::exr_io::{self, Precision};
use mateval_image::{Picture, png_io};
use mateval_scene::camera::{Camera, Intrinsics};
use mateval_scene::dataset::{Atlas, FORMAT, Instance, Part, SceneFile, SceneSource, SourceFile, View};
use mateval_scene::glb::{self, GlbNode};
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_scene::reference::ReferenceScene;
use mateval_scene::submission::Map;
use mateval_scene::{Finding, SceneError, Severity, TriangleMesh, ViewId, json, reference_io};
use mateval_tracer::World;
use rayon::prelude::*;

use crate::atlas::{AtlasError, CHOSEN_SIZES, SizeWish, Unwrapped, unwrap};
use crate::bake::{Baked, BakedMaterial, bake};
use crate::bitterli::{self, BitterliScene};
use crate::error::PrepError;
use crate::instances::{self, InstanceEntry};
use crate::progress::Progress;
use crate::recipe::{GivenCamera, Recipe, RecipeScene};
use crate::views::{GeometryPictures, TruthPictures, ViewScene};

/// A scene, its instances numbered and its cameras placed.
struct Plan {
    scene: std::sync::Arc<ReferenceScene>,
    instances: Vec<InstanceEntry>,
    views: Vec<View>,
    findings: Vec<Finding>,
    file: String,
    id: String,
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

    let nearest = write_views(&plan, folder, progress)?;
    let atlas_size = entry.atlas_size.or(recipe.atlas_size);
    let atlases = write_materials(&mut plan, folder, atlas_size, &nearest, progress)?;
    write_geometry(&plan, folder, &atlases)?;
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
    Ok(Plan {
        scene: std::sync::Arc::new(read.scene),
        instances,
        views,
        findings: read.findings,
        file,
        id: entry.id.to_string(),
    })
}

/// The source's camera or the recipe's, at the recipe's resolution: the horizontal field of view is kept.
fn input_camera(recipe: &Recipe, entry: &RecipeScene, source: &Camera) -> Result<Camera, String> {
    let old = source.intrinsics;
    let [width, height] = entry.resolution.or(recipe.resolution).unwrap_or([old.width, old.height]);
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
fn write_views(plan: &Plan, folder: &SceneFolder, progress: Progress<'_>) -> Result<Vec<Option<f64>>, PrepError> {
    let world = World::new(plan.scene.clone())?;
    let instances: Vec<u16> = plan.instances.iter().map(|entry| entry.index.0.get()).collect();
    let parts: Vec<Vec<u16>> = plan
        .instances
        .iter()
        .map(|entry| entry.part_of_triangle.iter().map(|part| entry.parts[*part].index.0.get()).collect())
        .collect();
    let scene = ViewScene::new(&plan.scene, &world, &instances, &parts);
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

/// An instance's atlas, if it has one.
struct InstanceAtlas {
    unwrapped: Option<Unwrapped>,
    half_pixel_m: Option<f64>,
    finding: Option<Finding>,
}

/// Unwraps every instance and bakes its material; one instance a thread.
fn write_materials(
    plan: &mut Plan,
    folder: &SceneFolder,
    fixed_size: Option<u32>,
    nearest: &[Option<f64>],
    progress: Progress<'_>,
) -> Result<Vec<InstanceAtlas>, PrepError> {
    let textures = plan.scene.texture_list();
    let focal = plan.views[0].camera.intrinsics.fx;
    let done = std::sync::atomic::AtomicUsize::new(0);
    let shown: &Plan = plan;
    let atlases = shown
        .instances
        .par_iter()
        .enumerate()
        .map(|(at, instance)| {
            let surface = &shown.scene.surfaces[at];
            let material = &shown.scene.materials[surface.material.0];
            let half_pixel_m = nearest[at].map(|depth| 0.5 * depth / focal);
            let mut atlas = InstanceAtlas { unwrapped: None, half_pixel_m, finding: None };
            if material.has_appearance() {
                match unwrap_as_wished(&surface.mesh, fixed_size, half_pixel_m) {
                    Ok((unwrapped, remark)) => {
                        let baked = bake(&unwrapped, &surface.mesh, material, &textures);
                        atlas.finding = remark.map(|(code, what)| atlas_finding(shown, instance, code, &what));
                        if let Some(baked) = baked {
                            write_material(folder, instance, unwrapped.size, &baked)?;
                            atlas.finding = atlas.finding.or_else(|| clipped_finding(shown, instance, &baked));
                        }
                        atlas.unwrapped = Some(unwrapped);
                    }
                    // Nothing can hit it, so no pixel of it is valid.
                    Err(AtlasError::NoArea) => {
                        let what = AtlasError::NoArea.to_string();
                        atlas.finding = Some(atlas_finding(shown, instance, "no_atlas", &what));
                    }
                    Err(error) => {
                        let what = format!("instance '{}': {error}", instance.id);
                        return Err(PrepError::Scene { scene: shown.id.clone(), what });
                    }
                }
            }
            progress("atlases", done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1, shown.instances.len());
            Ok(atlas)
        })
        .collect::<Result<Vec<_>, PrepError>>()?;
    plan.findings.extend(atlases.iter().filter_map(|atlas| atlas.finding.clone()));
    Ok(atlases)
}

type Remark = Option<(&'static str, String)>;

/// At the recipe's size, or as fine as half a pixel; an instance that no view shows gets the least size. Where its charts
/// do not fit into the recipe's size it gets the least power of two that they fit into.
fn unwrap_as_wished(
    mesh: &TriangleMesh,
    fixed_size: Option<u32>,
    half_pixel_m: Option<f64>,
) -> Result<(Unwrapped, Remark), AtlasError> {
    // So coarse that only the charts and their gutters ask for room.
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
            "at the largest size of {} a texel is {:.5} m, half a pixel of the input view {wish:.5} m",
            CHOSEN_SIZES.1, unwrapped.texel_m
        );
        ("coarse_atlas", what)
    });
    Ok((unwrapped, remark))
}

/// A texel larger than half a pixel by this factor is worth a finding.
const COARSE: f64 = 1.05;

fn atlas_finding(plan: &Plan, instance: &InstanceEntry, code: &str, message: &str) -> Finding {
    let action = match code {
        "no_atlas" => "it has no atlas and is not scored",
        "atlas_grown" => "its atlas is larger than the recipe says",
        _ => "kept; its truth is as coarse as its texels",
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
        message: "its base colour leaves 0..1".to_owned(),
        action: "clipped where it is baked; the truth's pictures are not".to_owned(),
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

fn write_geometry(plan: &Plan, folder: &SceneFolder, atlases: &[InstanceAtlas]) -> Result<(), SceneError> {
    let meshes: Vec<TriangleMesh> = plan
        .scene
        .surfaces
        .iter()
        .zip(atlases)
        .map(|(surface, atlas)| match &atlas.unwrapped {
            Some(unwrapped) => unwrapped.mesh.clone(),
            None => TriangleMesh { uvs: None, ..surface.mesh.clone() },
        })
        .collect();
    let mut parts = Vec::new();
    for (instance, mesh) in plan.instances.iter().zip(&meshes) {
        for (at, part) in instance.parts.iter().enumerate() {
            let mesh = part_mesh(mesh, |triangle| instance.part_of_triangle[triangle] == at);
            parts.push(GlbNode { name: part.id.to_string(), mesh });
        }
    }
    glb::write(&folder.parts(), &parts)?;
    let instances: Vec<GlbNode> = plan
        .instances
        .iter()
        .zip(meshes)
        .map(|(instance, mesh)| GlbNode { name: instance.id.to_string(), mesh })
        .collect();
    glb::write(&folder.instances(), &instances)
}

/// The triangles that belong, in their order, with the vertices that they use.
fn part_mesh(mesh: &TriangleMesh, belongs: impl Fn(usize) -> bool) -> TriangleMesh {
    let mut new_place = vec![u32::MAX; mesh.positions.len()];
    let mut used = Vec::new();
    let mut triangles = Vec::new();
    for triangle in (0..mesh.triangles.len()).filter(|triangle| belongs(*triangle)) {
        triangles.push(mesh.triangles[triangle].map(|vertex| {
            let place = &mut new_place[vertex as usize];
            if *place == u32::MAX {
                *place = used.len() as u32;
                used.push(vertex as usize);
            }
            *place
        }));
    }
    TriangleMesh {
        positions: used.iter().map(|vertex| mesh.positions[*vertex]).collect(),
        normals: mesh.normals.as_ref().map(|all| used.iter().map(|vertex| all[*vertex]).collect()),
        uvs: mesh.uvs.as_ref().map(|all| used.iter().map(|vertex| all[*vertex]).collect()),
        triangles,
    }
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
        entry.bitterli.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy().into_owned()
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
