//! A scene for Mitsuba 3, that means there what it means to our tracer.
//!
//! In: a [`ReferenceScene`], a [`Camera`], [`RenderSettings`]; or a view of a dataset. Out: a folder with `scene.xml`
//! (version 3.0.0), `meshes/*.ply` and `textures/*`; and findings: a warning for all that Mitsuba cannot say, which
//! stands in the scene as the nearest that it can.
//!
//! Between: `sensor` turns the camera, `ply` writes meshes, `bsdf` materials (with `texture`), `emitter` lights
//! (with `texture` and `unfolded`), `element` the XML. Names of the source are remarks in the XML and nothing else, so they cannot lead anywhere.

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
use mateval_prep::build::RECIPE;
use mateval_prep::recipe;
use ply::Sheet;
use remarks::{Remarks, SCENE_FILE};
use texture::TextureFiles;

/// The second sheet of a lamp that glows on both sides lies this far behind the first, as a part of the mesh's extent.
const SHEET_DISTANCE: f32 = 1e-4;

/// A view of a dataset that is to be exported.
#[derive(Clone, Debug)]
pub struct ExportOptions {
    /// The dataset's folder; its ground truth must be there.
    pub dataset: PathBuf,
    /// Which scene.
    pub scene: SceneId,
    /// Which view.
    pub view: ViewId,
    /// Samples a pixel; the recipe's where absent.
    pub samples: Option<u32>,
    /// The folder to be made.
    pub out: PathBuf,
    /// Replace what is there.
    pub force: bool,
}

/// Writes a view of a dataset. Gives the findings of [`export`].
///
/// Fails where the dataset, the scene or the view is not there, or the output is.
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

/// Writes the scene into the folder `out`, which is there whole or not at all; one that is there is replaced.
///
/// Of the settings it takes samples, seed and `max_bounces`. Warnings tell what means something else in Mitsuba. Fails
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

/// Materials that surfaces use, each under an id.
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

/// The surface's shape; two for one that glows on both sides, none where it has no triangles.
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
        remarks.note("bent_normals", &place, &message, "wrote them; Mitsuba shades them otherwise near the edge");
    }
    let mut sheets = vec![(format!("meshes/{index}.ply"), if glow.is_some() { Sheet::Flat } else { Sheet::Whole })];
    if glow.is_some_and(|glow| glow.two_sided) {
        let distance = SHEET_DISTANCE * extent(surface);
        let message = "the surface glows on both sides; Mitsuba's glow on one";
        let action = format!("wrote a second sheet {distance} m behind it");
        remarks.note("two_sided_light", &place, message, &action);
        sheets.push((format!("meshes/{index}_back.ply"), Sheet::Behind(distance)));
    }
    if glow.is_some() && surface.mesh.normals.is_some() {
        let message = "the surface glows; Mitsuba's emitters confuse vertex normals with the shape";
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

/// The diagonal of the box around the surface, in metres.
fn extent(surface: &Surface) -> f32 {
    let positions = || surface.mesh.positions.iter().copied();
    let low = positions().reduce(glam::Vec3::min).unwrap_or_default();
    let high = positions().reduce(glam::Vec3::max).unwrap_or_default();
    (high - low).length()
}
