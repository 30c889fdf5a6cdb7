//! Makes the pictures of one view from one camera matrix: geometry for methods, and material truth for the scorer.

use std::path::Path;

use glam::DVec2;
use mateval_dataset::dataset::View;
use mateval_dataset::layout::{INPUT, SceneFolder};
use mateval_dataset::material::Appearance;
use mateval_dataset::reference::{Emission, ReferenceScene, SurfaceIndex};
use mateval_dataset::{Camera, ViewId};
use mateval_files::work_folder::make_folder;
use mateval_image::exr_io::{self, Precision};
use mateval_image::{ImageError, LinearRgb, Mask, Normal, Picture, png_io};
use mateval_tracer::World;
use mateval_tracer::aov::{PixelHit, PixelMean, appearance, flatness_values, hit_through, is_veiled, subpixel};
use rayon::prelude::*;

use crate::error::PrepError;

/// Surfaces of a lower roughness count as specular.
const SPECULAR_ROUGHNESS: f32 = 0.2;
/// Surfaces with at least this metallic count as metal.
const SPECULAR_METALLIC: f32 = 0.999;

/// A scene prepared for its pictures.
pub struct ViewScene<'a> {
    world: &'a World,
    /// The value in `instance.png` of every surface.
    instances: &'a [u16],
    scored: &'a [bool],
    glow: Vec<Glow>,
}

/// The sides on which a surface visibly emits light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Glow {
    front: bool,
    back: bool,
}

/// The pictures of a view that methods receive, except RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct GeometryPictures {
    /// Metres along the camera's axis at pixel centres; 0 where the ray hits no surface.
    pub depth: Picture<f32>,
    /// World-space shading normal towards the camera at pixel centres; 0 where the ray hits no surface.
    pub normal: Picture<Normal>,
    /// Instance index at pixel centres; 0 where the ray hits no surface.
    pub instance: Picture<u16>,
    /// The triangle at pixel centres; absent if the ray hits no surface.
    pub triangle: Picture<Option<SeenTriangle>>,
    /// Pixels whose centre and every sub-pixel show a scored surface, and not through one of fractional opacity.
    pub valid: Mask,
    /// Valid pixels whose centre the input view does not show.
    pub unobserved: Mask,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeenTriangle {
    pub surface: SurfaceIndex,
    /// Its index among the surface's triangles.
    pub triangle: usize,
}

impl SeenTriangle {
    /// Its entry in a table with a value for each triangle of each surface; 0 without a triangle.
    pub fn value_in(triangle: Option<Self>, values: &[Vec<u16>]) -> u16 {
        triangle.map_or(0, |seen| values[seen.surface.0][seen.triangle])
    }
}

/// The true material in every pixel of a view, from the true materials, as means over the sub-pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct TruthPictures {
    /// base_color, linear.
    pub albedo: Picture<LinearRgb>,
    /// base_color times (1 - metallic), linear.
    pub diffuse_albedo: Picture<LinearRgb>,
    /// Perceptual roughness.
    pub roughness: Picture<f32>,
    pub metallic: Picture<f32>,
    /// Valid pixels whose centre is metallic or has a roughness below 0.2.
    pub specular_region: Mask,
}

/// One pixel of all pictures, with the names of the pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewPixel {
    pub depth: f32,
    pub normal: [f32; 3],
    pub instance: u16,
    pub triangle: Option<SeenTriangle>,
    pub valid: bool,
    pub unobserved: bool,
    pub truth: PixelTruth,
    pub specular: bool,
}

/// Means over a pixel, with the names of [`TruthPictures`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelTruth {
    /// base_color, linear.
    pub albedo: [f32; 3],
    /// base_color times (1 - metallic), linear.
    pub diffuse_albedo: [f32; 3],
    /// Perceptual roughness.
    pub roughness: f32,
    pub metallic: f32,
}

impl<'a> ViewScene<'a> {
    /// Prepares a scene. `instances` and `scored` hold an entry for each surface.
    pub fn new(reference: &'a ReferenceScene, world: &'a World, instances: &'a [u16], scored: &'a [bool]) -> Self {
        Self { world, instances, scored, glow: glow_of_surfaces(reference) }
    }

    /// The pictures that `camera` sees. Pixels whose surface point `input` does not show are unobserved; the input view
    /// itself has none.
    pub fn pictures(&self, camera: &Camera, input: &Camera) -> (GeometryPictures, TruthPictures) {
        let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
        let pixels: Vec<ViewPixel> = (0..height)
            .into_par_iter()
            .flat_map_iter(|y| (0..width).map(move |x| self.pixel(camera, input, x, y)))
            .collect();
        let all = Picture::new(width, height, pixels).expect("there is a pixel for every place");
        let geometry = GeometryPictures {
            depth: all.map(|p| p.depth),
            normal: all.map(|p| Normal(p.normal)),
            instance: all.map(|p| p.instance),
            triangle: all.map(|p| p.triangle),
            valid: all.map(|p| p.valid),
            unobserved: all.map(|p| p.unobserved),
        };
        let truth = TruthPictures {
            albedo: all.map(|p| LinearRgb(p.truth.albedo)),
            diffuse_albedo: all.map(|p| LinearRgb(p.truth.diffuse_albedo)),
            roughness: all.map(|p| p.truth.roughness),
            metallic: all.map(|p| p.truth.metallic),
            specular_region: all.map(|p| p.specular),
        };
        (geometry, truth)
    }

    /// Pixel (x, y) of the pictures that `camera` sees.
    pub fn pixel(&self, camera: &Camera, input: &Camera, x: usize, y: usize) -> ViewPixel {
        let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        let hit = hit_through(self.world, camera, centre);
        let (truth, valid) = self.truth(camera, x, y);
        let at_centre = hit.as_ref().and_then(|hit| self.scored_appearance(hit));
        let specular =
            at_centre.is_some_and(|seen| seen.metallic >= SPECULAR_METALLIC || seen.roughness < SPECULAR_ROUGHNESS);
        let valid = valid && at_centre.is_some();
        let unobserved = valid && hit.as_ref().is_some_and(|hit| !self.is_seen_by(input, camera, centre, hit));
        let surface = hit.as_ref().map(|hit| hit.surface.0);
        ViewPixel {
            depth: hit.as_ref().map_or(0.0, |hit| hit.depth as f32),
            normal: hit.as_ref().map_or([0.0; 3], |hit| hit.normal.to_array()),
            instance: surface.map_or(0, |surface| self.instances[surface]),
            triangle: hit.as_ref().map(|hit| SeenTriangle { surface: hit.surface, triangle: hit.triangle }),
            valid,
            unobserved,
            truth,
            specular: valid && specular,
        }
    }

    /// The means over the sub-pixels that show a scored surface, and whether all sub-pixels do, through nothing that is
    /// partly transparent.
    fn truth(&self, camera: &Camera, x: usize, y: usize) -> (PixelTruth, bool) {
        let mut veiled = false;
        let PixelMean { mean, whole, .. } = PixelMean::of(|at| {
            let place = subpixel(x, y, at);
            veiled |= is_veiled(self.world, camera, place);
            let seen = hit_through(self.world, camera, place).and_then(|hit| self.scored_appearance(&hit))?;
            Some(flatness_values(&seen))
        });
        let [r, g, b, dr, dg, db, roughness, metallic] = mean;
        let truth = PixelTruth { albedo: [r, g, b], diffuse_albedo: [dr, dg, db], roughness, metallic };
        (truth, whole && !veiled)
    }

    /// base_color, roughness and metallic, if the hit surface is scored: it is neither glass nor visibly emits light.
    fn scored_appearance(&self, hit: &PixelHit) -> Option<Appearance> {
        let glow = self.glow[hit.surface.0];
        let glows = if hit.front { glow.front } else { glow.back };
        if glows || !self.scored[hit.surface.0] {
            return None;
        }
        appearance(self.world, hit.surface, hit.triangle, hit.barycentrics)
    }

    /// Whether the input view shows the surface point at `pixel` of `camera`: it is within the frame and not hidden.
    fn is_seen_by(&self, input: &Camera, camera: &Camera, pixel: DVec2, hit: &PixelHit) -> bool {
        let Some((place, depth)) = input.project(camera.unproject(pixel, hit.depth)) else {
            return false;
        };
        if !input.holds(place) {
            return false;
        }
        // From the same centre, the same ray hits the same point.
        camera.position() == input.position()
            || hit_through(self.world, input, place).is_some_and(|first| first.depth >= depth * (1.0 - OCCLUSION_SLACK))
    }
}

/// Linear base_color at pixel centres, also of surfaces that emit light; 0 where the surface has none.
pub fn base_color_at_centres(world: &World, camera: &Camera) -> Picture<LinearRgb> {
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let base_color = |x: usize, y: usize| {
        let hit = hit_through(world, camera, DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
        let seen = hit.and_then(|hit| appearance(world, hit.surface, hit.triangle, hit.barycentrics));
        LinearRgb(seen.map_or([0.0; 3], |seen| seen.base_color))
    };
    let base_color = &base_color;
    let pixels = (0..height).into_par_iter().flat_map_iter(|y| (0..width).map(move |x| base_color(x, y)));
    Picture::new(width, height, pixels.collect()).expect("there is a pixel for every place")
}

/// A point counts as hidden if a surface is nearer by more than this share of its depth.
const OCCLUSION_SLACK: f64 = 1e-3;

fn glow_of_surfaces(reference: &ReferenceScene) -> Vec<Glow> {
    let mut glow = vec![Glow::default(); reference.surfaces.len()];
    for group in reference.lights.iter().filter(|group| group.camera_visible) {
        // Even where a map is black, the surface counts as a lamp.
        if let Emission::Area { surfaces, radiance, two_sided, map: _ } = &group.emission
            && radiance.iter().any(|v| *v > 0.0)
        {
            for SurfaceIndex(surface) in surfaces {
                glow[*surface].front = true;
                glow[*surface].back |= *two_sided;
            }
        }
    }
    glow
}

/// Writes `rgb.png` in `folder`: linear radiance times exposure, clipped to 0..1, sRGB.
pub(crate) fn write_preview(folder: &Path, radiance: &Picture<LinearRgb>, exposure: f64) -> Result<(), PrepError> {
    let exposed = radiance.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (f64::from(v) * exposure) as f32)));
    Ok(png_io::write_srgb(&folder.join("rgb.png"), &exposed.to_srgb())?)
}

/// Reads a map of a view. Fails if it has not the size of the camera's picture.
pub(crate) fn map_of<T: Copy>(
    view: &View,
    path: &Path,
    read: fn(&Path) -> Result<Picture<T>, ImageError>,
) -> Result<Picture<T>, PrepError> {
    let map = read(path)?;
    let k = view.camera.intrinsics;
    let (expected, found) = ([k.width as usize, k.height as usize], [map.width(), map.height()]);
    if found == expected {
        return Ok(map);
    }
    let (picture, hint) = (format!("'{}'", path.display()), "; run `prep build` again");
    Err(PrepError::PictureSize { picture, expected, found, hint })
}

/// What the pictures of all views show.
pub(crate) struct Shown {
    /// The nearest depth in metres at which the input view shows each instance, or where it does not, any other view.
    pub(crate) nearest: Vec<Option<f64>>,
    /// The share of the valid pixels of each view that the input view does not show.
    pub(crate) unseen_shares: Vec<f64>,
}

/// Makes the pictures of every view, the input view first, and writes those of geometry. `parts` holds for each set of
/// parts the name of its picture and its value for every triangle of every instance. `each` is called with the number of
/// the view and its pictures.
pub(crate) fn write_views(
    folder: &SceneFolder,
    scene: &ViewScene<'_>,
    views: &[View],
    parts: &[(String, Vec<Vec<u16>>)],
    mut each: impl FnMut(usize, &GeometryPictures, &TruthPictures) -> Result<(), PrepError>,
) -> Result<Shown, PrepError> {
    let mut nearest = [vec![None; scene.instances.len()], vec![None; scene.instances.len()]];
    let mut unseen_shares = Vec::new();
    for (at, view) in views.iter().enumerate() {
        let (geometry, truth) = scene.pictures(&view.camera, &views[0].camera);
        note_nearest(&geometry, &mut nearest[usize::from(at > 0)]);
        unseen_shares.push(unseen_share(&geometry));
        let shown = folder.view(&view.id);
        make_folder(&shown)?;
        write_geometry(&shown, &view.id, &geometry)?;
        write_parts(&shown, &geometry, parts)?;
        each(at, &geometry, &truth)?;
    }
    let [input, others] = nearest;
    let nearest = input.into_iter().zip(others).map(|(first, other)| first.or(other)).collect();
    Ok(Shown { nearest, unseen_shares })
}

/// Lowers the nearest depth of every instance that the view shows.
fn note_nearest(geometry: &GeometryPictures, nearest: &mut [Option<f64>]) {
    for (instance, depth) in geometry.instance.pixels().iter().zip(geometry.depth.pixels()) {
        if let Some(place) = usize::from(*instance).checked_sub(1) {
            let depth = f64::from(*depth);
            nearest[place] = Some(nearest[place].map_or(depth, |other: f64| other.min(depth)));
        }
    }
}

/// The share of the valid pixels that the input view does not show.
fn unseen_share(geometry: &GeometryPictures) -> f64 {
    let count = |mask: &Mask| mask.pixels().iter().filter(|&&holds| holds).count() as f64;
    // Without valid pixels the share is 0.
    count(&geometry.unobserved) / count(&geometry.valid).max(1.0)
}

/// Writes the pictures of geometry that methods see, except those of parts.
fn write_geometry(shown: &Path, view: &ViewId, geometry: &GeometryPictures) -> Result<(), PrepError> {
    exr_io::write_scalar(&shown.join("depth.exr"), &geometry.depth, Precision::Float)?;
    exr_io::write_normal(&shown.join("normal.exr"), &geometry.normal, Precision::Half)?;
    png_io::write_ids(&shown.join("instance.png"), &geometry.instance)?;
    png_io::write_mask(&shown.join("valid.png"), &geometry.valid)?;
    if view.as_str() != INPUT {
        png_io::write_mask(&shown.join("unobserved.png"), &geometry.unobserved)?;
    }
    Ok(())
}

/// Writes the picture of each set of parts. `parts` holds the name of its file and its value for every triangle.
fn write_parts(shown: &Path, geometry: &GeometryPictures, parts: &[(String, Vec<Vec<u16>>)]) -> Result<(), PrepError> {
    for (file, values) in parts {
        let picture = geometry.triangle.map(|seen| SeenTriangle::value_in(seen, values));
        png_io::write_ids(&shown.join(file), &picture)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use mateval_dataset::TriangleMesh;
    use mateval_dataset::material::TextureIndex;
    use mateval_dataset::reference::{EmissionMap, LightGroup, MaterialIndex, Surface};

    use super::*;

    /// A lamp with a map emits on the same sides as one without; a lamp without radiance, or hidden from the camera, on
    /// none.
    #[test]
    fn maps_do_not_change_the_sides_that_emit() {
        let glow = |radiance: f32, mapped: bool, two_sided: bool, camera_visible: bool| {
            let map = mapped.then(|| EmissionMap { texture: TextureIndex(0), uv: Default::default() });
            let emission = Emission::Area { surfaces: vec![SurfaceIndex(0)], radiance: [radiance; 3], map, two_sided };
            let mesh = TriangleMesh::default();
            let scene = ReferenceScene {
                surfaces: vec![Surface { name: String::new(), mesh, material: MaterialIndex(0) }],
                lights: vec![LightGroup { name: String::new(), emission, camera_visible }],
                ..Default::default()
            };
            let glow = glow_of_surfaces(&scene)[0];
            (glow.front, glow.back)
        };
        for mapped in [false, true] {
            assert_eq!(glow(1.0, mapped, false, true), (true, false));
            assert_eq!(glow(1.0, mapped, true, true), (true, true));
            assert_eq!(glow(0.0, mapped, true, true), (false, false));
            assert_eq!(glow(1.0, mapped, true, false), (false, false));
        }
    }
}
