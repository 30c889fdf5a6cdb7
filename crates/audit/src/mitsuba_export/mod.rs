//! Writes a scene for Mitsuba 3 that means the same there as to the built-in tracer.
//!
//! In: a [`ReferenceScene`], a [`Camera`] and [`RenderSettings`], or a view of a dataset. Out: a folder with `scene.xml`
//! (version 3.0.0), `meshes/*.ply` and `textures/*`; and findings, with a warning for everything that Mitsuba cannot express.
//! The scene contains the nearest that it can.
//!
//! Between: `sensor` converts the camera, `ply` meshes, `bsdf` materials (with `texture`) and `emitter` lights (with
//! `texture` and `unfolded`); `element` writes the XML. Names of the source appear in comments of the XML only, so that no
//! name can become a path or markup.

mod bsdf;
mod element;
mod emitter;
mod ply;
mod remarks;
mod sensor;
#[cfg(test)]
mod tests;
mod texture;
mod unfolded;

use std::path::{Path, PathBuf};

use mateval_image::Texture;
use mateval_image::store::write_whole;
use mateval_scene::dataset::View;
use mateval_scene::material::Material;
use mateval_scene::open::Dataset;
use mateval_scene::reference::{ReferenceScene, Surface};
use mateval_scene::work_folder::{WorkFolder, check_free};
use mateval_scene::{Camera, Finding, SceneId, ViewId, reference_io};
use mateval_tracer::RenderSettings;

use crate::AuditError;
use element::Element;
use emitter::Glow;
use mateval_prep::recipe;
use mateval_prep::recipe::RECIPE;
use ply::Sheet;
use remarks::{Remarks, SCENE_FILE};
use texture::TextureFiles;

/// Distance of the second sheet of a lamp that emits on both sides behind the first, as a share of the mesh's extent.
const SHEET_DISTANCE: f32 = 1e-4;

/// The view of a dataset to export.
#[derive(Clone, Debug)]
pub struct ExportOptions {
    /// The dataset's folder, which must contain the ground truth.
    pub dataset: PathBuf,
    /// The scene.
    pub scene: SceneId,
    /// The view.
    pub view: ViewId,
    /// Samples per pixel; the recipe's number where absent.
    pub samples: Option<u32>,
    /// The folder to write.
    pub out: PathBuf,
    /// Replace a folder that already exists.
    pub force: bool,
}

/// Writes a view of a dataset. Returns the findings of [`export`].
///
/// Fails where the dataset, the scene or the view does not exist, or the output does.
pub fn export_view(options: &ExportOptions) -> Result<Vec<Finding>, AuditError> {
    check_free(&options.out, options.force, "folder")?;
    let dataset = Dataset::open(&options.dataset)?;
    let view = find_view(&dataset, options)?;
    let samples = match options.samples {
        Some(samples) => samples,
        None => recipe::read(&options.dataset.join(RECIPE))?.0.samples,
    };
    let concerns = |path: &str| path.starts_with("ground_truth/reference/") || path == "ground_truth/lights.json";
    dataset.check_files(&options.scene, concerns)?;
    let scene = reference_io::read(&dataset.folder(&options.scene))?;
    export(&scene, &view.camera, &RenderSettings { samples, ..Default::default() }, &options.out)
}

fn find_view<'d>(dataset: &'d Dataset, options: &ExportOptions) -> Result<&'d View, AuditError> {
    let view = dataset.scene(&options.scene)?.views.iter().find(|view| view.id == options.view);
    view.ok_or_else(|| AuditError::NoView {
        path: options.dataset.clone(),
        scene: options.scene.clone(),
        view: options.view.clone(),
    })
}

/// Writes the scene to the folder `out`, replacing one that exists. After a failure no partial folder is left.
///
/// Of the settings it uses samples, seed and `max_bounces`. A warning reports what means something else in Mitsuba. Fails
/// where a file cannot be written.
pub fn export(
    scene: &ReferenceScene,
    camera: &Camera,
    settings: &RenderSettings,
    out: &Path,
) -> Result<Vec<Finding>, AuditError> {
    let work = WorkFolder::start(out)?;
    let mut remarks = Remarks::default();
    let document = write_scene(scene, camera, settings, work.path(), &mut remarks)?;
    write_whole(&work.path().join(SCENE_FILE), document.document().as_bytes())?;
    work.finish()?;
    Ok(remarks.sorted())
}

fn write_scene(
    scene: &ReferenceScene,
    camera: &Camera,
    settings: &RenderSettings,
    folder: &Path,
    remarks: &mut Remarks,
) -> Result<Element, AuditError> {
    for name in ["meshes", "textures"] {
        let path = folder.join(name);
        std::fs::create_dir(&path).map_err(AuditError::io("make", &path))?;
    }
    let textures = scene.texture_list();
    let mut document = Element::new("scene")
        .attribute("version", "3.0.0")
        .child(sensor::integrator(settings))
        .child(sensor::sensor(scene, camera, settings, remarks));
    for material in write_materials(scene, folder, &textures, remarks)? {
        document = document.child(material);
    }
    let glows = emitter::glows(folder, scene, &textures, remarks)?;
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let glow = glows.get(&mateval_scene::reference::SurfaceIndex(index));
        for shape in write_surface(folder, index, surface, glow, remarks)? {
            document = document.child(shape);
        }
    }
    Ok(match emitter::distant(folder, scene, &textures, remarks)? {
        Some(light) => document.child(light),
        None => document,
    })
}

/// The materials that surfaces use, each with an id.
fn write_materials(
    scene: &ReferenceScene,
    folder: &Path,
    textures: &[Texture],
    remarks: &mut Remarks,
) -> Result<Vec<Element>, AuditError> {
    let mut files = TextureFiles::new(folder, textures);
    let used = |index: &usize| scene.surfaces.iter().any(|surface| surface.material.0 == *index);
    let mut write = |index: usize| {
        let material: &Material = &scene.materials[index];
        let place = format!("material {index} '{}'", material.name);
        let bsdf = bsdf::bsdf(material, &place, &mut files, remarks)?;
        Ok(bsdf.attribute("id", material_id(index)).remark(&material.name))
    };
    (0..scene.materials.len()).filter(used).map(&mut write).collect()
}

fn material_id(index: usize) -> String {
    format!("material_{index}")
}

/// The shapes of a surface: usually one, two where it emits on both sides, none where it has no triangles.
fn write_surface(
    folder: &Path,
    index: usize,
    surface: &Surface,
    glow: Option<&Glow>,
    remarks: &mut Remarks,
) -> Result<Vec<Element>, AuditError> {
    if surface.mesh.triangles.is_empty() {
        return Ok(Vec::new());
    }
    let place = format!("surface {index} '{}'", surface.name);
    let bent = ply::bent_triangles(&surface.mesh);
    if bent > 0 && glow.is_none() {
        let message = format!("{bent} triangles have a vertex normal behind their front");
        remarks.note(
            "bent_normals",
            &place,
            &message,
            "wrote them; Mitsuba shades them differently near the silhouette",
        );
    }
    let mut sheets = vec![(format!("meshes/{index}.ply"), if glow.is_some() { Sheet::Flat } else { Sheet::Whole })];
    if glow.is_some_and(|glow| glow.two_sided) {
        let distance = SHEET_DISTANCE * extent(surface);
        let message = "the surface emits on both sides; Mitsuba's surfaces emit on one";
        let action = format!("wrote a second sheet {distance} m behind it");
        remarks.note("two_sided_light", &place, message, &action);
        sheets.push((format!("meshes/{index}_back.ply"), Sheet::Behind(distance)));
    }
    if glow.is_some() && surface.mesh.normals.is_some() {
        let message = "the surface emits; Mitsuba's emitters use its vertex normals as if they were the triangles' own";
        remarks.note("flat_light", &place, message, "wrote it without vertex normals");
    }
    let mut shapes = Vec::new();
    for (file, sheet) in sheets {
        let (bytes, normals) = ply::bytes(&surface.mesh, sheet);
        write_whole(&folder.join(&file), &bytes)?;
        let shape = Element::plugin("shape", "ply")
            .remark(&surface.name)
            .string("filename", file)
            .boolean("face_normals", !normals)
            .boolean("flip_tex_coords", false)
            .child(Element::new("ref").attribute("id", material_id(surface.material.0)));
        shapes.push(glow.map_or(shape.clone(), |glow| shape.child(glow.element.clone())));
    }
    Ok(shapes)
}

/// The diagonal of the surface's bounding box, in metres.
fn extent(surface: &Surface) -> f32 {
    let positions = || surface.mesh.positions.iter().copied();
    let low = positions().reduce(glam::Vec3::min).unwrap_or_default();
    let high = positions().reduce(glam::Vec3::max).unwrap_or_default();
    (high - low).length()
}
