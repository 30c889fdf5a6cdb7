//! Bridges to projects that process one object at a time.
//!
//! TEXGen (Yu and others, "TEXGen: a Generative Diffusion Model for Mesh Textures", SIGGRAPH Asia 2024) completes the
//! UV texture of an object. [`export_texgen`] writes each instance as TEXGen's loader reads objects; [`import_texgen`]
//! makes a submission of its textures. An object's folder is `<first two characters of its id>/<id>`. In pictures v
//! points up from the lower edge, as in the dataset's atlases: TEXGen flips them when it reads and again when it
//! writes.
//!
//! PartField (Liu and others, "PartField: Learning 3D Feature Fields for Part Segmentation and Beyond", 2025) splits a
//! mesh into parts. [`export_partfield`] writes the meshes. [`import_partfield`] copies PartField's labels to where
//! `part_labels` in a recipe expects them; a dataset built from that recipe has a second part set.

use std::fmt::{Display, Write as _};
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};
use mateval_dataset::dataset::Instance;
use mateval_dataset::open::Dataset;
use mateval_dataset::{Progress, Report, SceneId, TriangleMesh};
use mateval_files::untrusted::read_at_most;
use mateval_files::whole::write_whole;
use mateval_files::work_folder::{WorkFolder, make_folder};
use mateval_image::exr_io::{Precision, write_linear};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{LinearRgb, Picture, Texture, Wrap, npy_io, png_io};
use serde_json::json;

use crate::error::BaselineError;
use crate::estimate::Estimate;
use crate::estimate_source::EstimateSource;
use crate::geometry::{SceneGeometry, SeenPixels};
use crate::lift::{PartialAtlas, Texel, lift, place_of};
use crate::maps::{Maps, srgb_bytes};
use crate::nn::{NnOptions, seen_pixels};
use crate::submission::{Method, check_new_place};
use crate::{nn, submission};

/// An object's id: the scene's id and the instance's index, such as `living-00012`.
fn object_id(scene: &SceneId, instance: &Instance) -> String {
    format!("{scene}-{:05}", instance.index.0)
}

/// A mesh as OBJ, in world space; the faces are in the order of its triangles.
fn obj_text(mesh: &TriangleMesh) -> String {
    let mut text = String::new();
    let mut line = |words: std::fmt::Arguments<'_>| {
        text.write_fmt(words).expect("writing to a String cannot fail");
        text.push('\n');
    };
    for p in &mesh.positions {
        line(format_args!("v {} {} {}", p.x, p.y, p.z));
    }
    for uv in mesh.uvs.iter().flatten() {
        line(format_args!("vt {} {}", uv.x, uv.y));
    }
    for [a, b, c] in mesh.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + 1)) {
        line(format_args!("f {a}/{a} {b}/{b} {c}/{c}"));
    }
    text
}

/// Width and height of TEXGen's textures, in texels.
const TEXELS: usize = 1024;

/// The object's folder, relative to the root.
fn object_folder(id: &str) -> String {
    format!("{}/{id}", &id[..2])
}

/// Width and height, in pixels, of the picture that TEXGen is conditioned on.
const PICTURE: usize = 512;

/// Writes `objects.jsonl` and one folder per seen instance, and returns the number of folders.
///
/// A folder holds `model.obj`, `model.png` (the partial atlas, black in unseen texels), `mask.png` (texels of the
/// surface), `mask_partial.png` (seen texels), `position.exr` (places in TEXGen's own space) and `picture.png` (the
/// estimate's pixels of the instance, all others white).
pub fn export_texgen(
    dataset: &Dataset,
    out: &Path,
    source: &EstimateSource,
    progress: Progress<'_>,
) -> Result<usize, BaselineError> {
    check_new_place(dataset, out)?;
    let work = WorkFolder::start(out)?;
    let (mut lines, mut count) = (String::new(), 0);
    for scene in &dataset.scenes {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let estimate = source.read(dataset, scene, progress)?;
        estimate.needs_color(&scene.id)?;
        let seen = seen_pixels(&geometry, &estimate)?;
        for at in geometry.with_atlas() {
            let instance = &scene.instances[at];
            progress(Report::step(&format!("{} export", scene.id), at, scene.instances.len()));
            let known = lift(&geometry, &seen, &estimate, at, TEXELS);
            if known.texels.pixels().iter().all(|texel| texel.seen().is_none()) {
                continue;
            }
            let id = object_id(&scene.id, instance);
            let folder = work.path().join(object_folder(&id));
            make_folder(&folder)?;
            write_object(&folder, geometry.mesh(at), &known)?;
            png_io::write_rgb_bytes(&folder.join("picture.png"), &picture(&seen, &estimate, at))?;
            let prompt = instance.category.as_deref().unwrap_or(&instance.name);
            let line = json!({ "id": id, "result": prompt, "root_dir": "." });
            writeln!(lines, "{line}").expect("writing to a String cannot fail");
            count += 1;
        }
    }
    write_whole(&work.path().join("objects.jsonl"), lines.as_bytes())?;
    work.finish()?;
    Ok(count)
}

fn write_object(folder: &Path, mesh: &TriangleMesh, known: &PartialAtlas) -> Result<(), BaselineError> {
    write_whole(&folder.join("model.obj"), obj_text(mesh).as_bytes())?;
    let shown = |texel: Texel| texel.seen().map_or([0; 3], |[r, g, b, ..]| srgb_bytes([r, g, b]));
    png_io::write_rgb_bytes(&folder.join("model.png"), &known.texels.map(shown))?;
    png_io::write_mask(&folder.join("mask.png"), &known.texels.map(|texel| texel != Texel::Unused))?;
    png_io::write_mask(&folder.join("mask_partial.png"), &known.texels.map(|texel| texel.seen().is_some()))?;
    write_linear(&folder.join("position.exr"), &positions(mesh, known), Precision::Float)?;
    Ok(())
}

/// The place of each texel in TEXGen's space: (x, -z, y), centred, with the longest side 1; 0 outside the surface.
fn positions(mesh: &TriangleMesh, known: &PartialAtlas) -> Picture<LinearRgb> {
    let turned = |p: DVec3| DVec3::new(p.x, -p.z, p.y);
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let bounds =
        mesh.positions.iter().map(|p| turned(p.as_dvec3())).fold(start, |(low, high), p| (low.min(p), high.max(p)));
    let (centre, scale) = ((bounds.0 + bounds.1) / 2.0, 1.0 / (bounds.1 - bounds.0).max_element().max(1e-6));
    Picture::from_fn(TEXELS, TEXELS, |x, y| {
        let Some((triangle, _)) = known.atlas.owner(x, y) else { return LinearRgb([0.0; 3]) };
        let place = place_of(&known.atlas, mesh, triangle, DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
        LinearRgb(((turned(place) - centre) * scale).as_vec3().to_array())
    })
}

/// The smallest square that contains the instance's pixels, with all other pixels white.
fn picture(seen: &SeenPixels, estimate: &Estimate, instance: usize) -> Picture<[u8; 3]> {
    let pixels: Vec<(usize, usize)> =
        seen.shown_pixels().filter(|(_, _, of)| *of == instance).map(|(x, y, _)| (x, y)).collect();
    let range =
        |all: &mut dyn Iterator<Item = usize>| all.fold((usize::MAX, 0), |(low, high), v| (low.min(v), high.max(v)));
    let (columns, rows) =
        (range(&mut pixels.iter().map(|pixel| pixel.0)), range(&mut pixels.iter().map(|pixel| pixel.1)));
    let side = (columns.1.saturating_sub(columns.0)).max(rows.1.saturating_sub(rows.0)) + 1;
    let corner = |(low, high): (usize, usize)| (low + high + 1) as f64 / 2.0 - side as f64 / 2.0;
    let (left, top) = (corner(columns), corner(rows));
    Picture::from_fn(PICTURE, PICTURE, |x, y| {
        let place = |corner: f64, at: usize| corner + (at as f64 + 0.5) * side as f64 / PICTURE as f64;
        let (px, py) = (place(left, x), place(top, y));
        let inside = seen.camera.holds(DVec2::new(px, py)) && seen.shows(instance, px as usize, py as usize);
        if !inside {
            return [255; 3];
        }
        let [r, g, b, ..] = estimate.at(px as usize, py as usize);
        srgb_bytes([r, g, b])
    })
}

/// Writes a submission. Seen texels hold the estimate; the base colour of all others is that of `results/<id>.png`
/// (sRGB, any square size) at their uv. An instance without such a file, and roughness and metallic everywhere, are as
/// `nn` with its defaults makes them from the same estimate. Fails where no file exists for any instance.
/// Returns the number of instances in the submission, and of those with a texture by TEXGen.
pub fn import_texgen(
    dataset: &Dataset,
    results: &Path,
    out: &Path,
    force: bool,
    source: &EstimateSource,
    progress: Progress<'_>,
) -> Result<(usize, usize), BaselineError> {
    let textured = dataset.scenes.iter().flat_map(|scene| scene.instances.iter().map(move |i| object_id(&scene.id, i)));
    let textured = textured.filter(|id| file(results, id).is_file()).count();
    if textured == 0 {
        let why = "holds no <id>.png for any object of this dataset, such as living-00012.png; expected TEXGen's results \
                   for the objects of `baseline texgen-export`";
        return Err(BaselineError::unusable(results, why));
    }
    let description = format!(
        "TEXGen's textures where the input view shows nothing, {} where it does; {textured} textures; the rest as nn",
        source.description(dataset)
    );
    let assumed_encodings = source.assumed_encodings();
    let name = format!("texgen-{}", source.name());
    let method = Method { name, description, assumed_encodings, is_oracle: source.is_truth() };
    let instances = submission::write_scenes(dataset, out, force, &method, progress, |scene, folder| {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let estimate = source.read(dataset, scene, progress)?;
        estimate.needs_color(&scene.id)?;
        let (seen, options) = (nn::seen_pixels(&geometry, &estimate)?, NnOptions::default());
        nn::lift_scene(&geometry, &estimate, &seen, &options, progress, |at, known, medians| {
            let instance = &geometry.scene.instances[at];
            let path = file(results, &object_id(&scene.id, instance));
            let texture = path.is_file().then(|| read_texture(&path, Encoding::Srgb, Wrap::Clamp)).transpose()?;
            let maps = match known {
                Some(mut lifted) => {
                    texture.iter().for_each(|texture| composite(&mut lifted, texture));
                    lifted.maps
                }
                None => Maps::constant(medians.of(&geometry, at), estimate.given_maps()),
            };
            maps.write(&folder.join(instance.id.as_str()))
        })
    })?;
    Ok((instances, textured))
}

fn file(results: &Path, id: &str) -> PathBuf {
    results.join(format!("{id}.png"))
}

/// Replaces the colour of every texel that was not seen by the texture's.
fn composite(lifted: &mut nn::Lifted, texture: &Texture) {
    let size = lifted.atlas.size();
    for (at, color) in lifted.maps.base_color.iter_mut().flat_map(Picture::pixels_mut).enumerate() {
        if lifted.atlas.owner(at % size, at / size).is_some() && !lifted.seen.pixels()[at] {
            let uv = [at % size, size - 1 - at / size].map(|v| (v as f32 + 0.5) / size as f32);
            *color = srgb_bytes(texture.sample(uv));
        }
    }
    lifted.maps.fill_gutters(&lifted.atlas);
}

/// Largest file of labels that is read, in bytes.
const MAX_LABEL_BYTES: u64 = 1 << 28;

/// Writes `<id>.obj` for every instance that has an atlas, and returns their number.
pub fn export_partfield(dataset: &Dataset, out: &Path) -> Result<usize, BaselineError> {
    check_new_place(dataset, out)?;
    let work = WorkFolder::start(out)?;
    let mut count = 0;
    for scene in &dataset.scenes {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        for at in geometry.with_atlas() {
            let path = work.path().join(object_id(&scene.id, &scene.instances[at])).with_extension("obj");
            write_whole(&path, obj_text(geometry.mesh(at)).as_bytes())?;
            count += 1;
        }
    }
    work.finish()?;
    Ok(count)
}

/// Copies `<id>_0_<parts>.npy`, PartField's labels of an instance that is split into `parts` parts, from `clusters` to
/// `<scene>/<instance>.npy`. PartField writes no such file for an instance with fewer triangles than parts; the file
/// with the next smaller number of parts is taken then. An instance without any such file keeps its own parts. Returns
/// the number of instances with labels.
pub fn import_partfield(dataset: &Dataset, clusters: &Path, parts: u8, out: &Path) -> Result<usize, BaselineError> {
    check_new_place(dataset, out)?;
    let work = WorkFolder::start(out)?;
    let mut count = 0;
    for scene in &dataset.scenes {
        let folder = work.path().join(scene.id.as_str());
        make_folder(&folder)?;
        for instance in &scene.instances {
            let Some(path) = labels_of(clusters, &scene.id, instance, parts) else { continue };
            let bytes = checked_labels(&path, instance)?;
            write_whole(&folder.join(instance.id.as_str()).with_extension("npy"), &bytes)?;
            count += 1;
        }
    }
    if count == 0 {
        let why = format!(
            "holds no <id>_0_{parts:02}.npy for any instance, such as living-00012_0_{parts:02}.npy, nor one with fewer \
             parts; expected PartField's results for the meshes of `baseline partfield-export`"
        );
        return Err(BaselineError::unusable(clusters, why));
    }
    work.finish()?;
    Ok(count)
}

fn labels_of(clusters: &Path, scene: &SceneId, instance: &Instance, parts: u8) -> Option<PathBuf> {
    let id = object_id(scene, instance);
    let mut candidates = (1..=parts).rev().map(|count| clusters.join(format!("{id}_0_{count:02}.npy")));
    candidates.find(|path| path.is_file())
}

/// The file's bytes, if it holds one label per triangle.
fn checked_labels(path: &Path, instance: &Instance) -> Result<Vec<u8>, BaselineError> {
    let bad = |reason: &dyn Display| {
        let advice = "export the instances again and run PartField on them";
        BaselineError::Unusable(format!("'{}': {reason}; {advice}", path.display()))
    };
    let bytes = read_at_most(path, MAX_LABEL_BYTES).map_err(|error| bad(&error))?;
    let labels = npy_io::whole_numbers(&bytes).map_err(|error| bad(&error))?.len();
    if labels != instance.triangles {
        return Err(bad(&format!("{labels} labels; '{}' has {} triangles", instance.id, instance.triangles)));
    }
    Ok(bytes)
}
