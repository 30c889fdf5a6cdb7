//! Writes instances as TEXGen's loader reads objects.

use std::fmt::Write as _;
use std::path::Path;

use glam::{DVec2, DVec3};
use mateval_image::exr_io::{Precision, write_linear};
use mateval_image::store::write_whole;
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::WorkFolder;
use mateval_scene::{Progress, Report, SceneError, TriangleMesh};
use serde_json::json;

use super::{TEXELS, object_folder};
use crate::error::BaselineError;
use crate::estimate::Estimate;
use crate::estimate_source::EstimateSource;
use crate::geometry::SceneGeometry;
use crate::lift::{PartialAtlas, Texel, lift, place_of};
use crate::maps::srgb_bytes;
use crate::nn::seen_pixels;
use crate::objects::{obj_text, object_id};
use crate::seen::SeenPixels;
use crate::submission::check_new_place;

/// Width and height, in pixels, of the picture that TEXGen is conditioned on.
const PICTURE: usize = 512;

/// Writes `objects.jsonl` and one folder per seen instance, and returns the number of folders.
///
/// A folder holds `model.obj`, `model.png` (the partial atlas, black in unseen texels), `mask.png` (texels of the
/// surface), `mask_partial.png` (seen texels), `position.exr` (places in TEXGen's own space) and `picture.png` (the
/// estimate's pixels of the instance, all others white).
pub fn export(
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
        if estimate.base_color.is_none() {
            return Err(BaselineError::NoColor(scene.id.to_string()));
        }
        let seen = seen_pixels(&geometry, &estimate)?;
        for (at, instance) in scene.instances.iter().enumerate().filter(|(_, instance)| instance.atlas.is_some()) {
            progress(Report::step(&format!("{} export", scene.id), at, scene.instances.len()));
            let known = lift(&geometry, &seen, &estimate, at, TEXELS);
            if !known.texels.pixels().iter().any(|texel| matches!(texel, Texel::Seen(_))) {
                continue;
            }
            let id = object_id(&scene.id, instance);
            let folder = work.path().join(object_folder(&id));
            std::fs::create_dir_all(&folder).map_err(SceneError::io("make", &folder))?;
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
    png_io::write_rgb_bytes(&folder.join("model.png"), &known.texels.map(shown))?;
    png_io::write_mask(&folder.join("mask.png"), &known.texels.map(|texel| texel != Texel::Unused))?;
    let is_seen = |texel| matches!(texel, Texel::Seen(_));
    png_io::write_mask(&folder.join("mask_partial.png"), &known.texels.map(is_seen))?;
    write_linear(&folder.join("position.exr"), &positions(mesh, known), Precision::Float)?;
    Ok(())
}

fn shown(texel: Texel) -> [u8; 3] {
    match texel {
        Texel::Seen([r, g, b, ..]) => srgb_bytes([r, g, b]),
        Texel::Unused | Texel::Unseen => [0; 3],
    }
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
