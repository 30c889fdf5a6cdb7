//! One colour an instance, or a part: the median of an estimate under its mask.
//!
//! By instance this is how IM2CAD (Izadinia et al., CVPR 2017) colours furniture; by part it is the floor that procedural
//! methods fall back to.

use std::collections::HashMap;
use std::path::Path;

use mateval_image::Picture;
use mateval_scene::dataset::Part;
use mateval_scene::open::Dataset;
use mateval_scene::uv_atlas::UvAtlas;
use mateval_scene::{PartSetId, SceneError, glb};

use crate::error::BaselineError;
use crate::estimate::{Estimate, EstimateSource, Values};
use crate::geometry::SceneGeometry;
use crate::lift::{PartialAtlas, Texel};
use crate::maps::Maps;
use crate::median::{Medians, median};
use crate::nn::seen_pixels;
use crate::seen::view_pixel;
use crate::submission::{self, Method};

const UNSEEN: &str = "what is not seen takes the median of its category in the picture, else base colour 0.5 (linear)";

/// Writes a submission of one colour an instance. Gives the number of instances.
pub fn write_by_instance(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    source: &EstimateSource,
) -> Result<usize, BaselineError> {
    let description = format!("the median of {} under each instance's mask; {UNSEEN}", source.description());
    let method = Method { name: name("median", source), description };
    submission::write_scenes(dataset, out, force, &method, |scene, folder| {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let estimate = source.read(dataset, scene)?;
        let medians = Medians::new(&geometry, &seen_pixels(&geometry, &estimate)?, &estimate);
        let mut written = 0;
        for (at, instance) in scene.instances.iter().enumerate().filter(|(_, instance)| instance.atlas.is_some()) {
            Maps::constant(medians.of(&geometry, at), &estimate).write(&folder.join(instance.id.as_str()))?;
            written += 1;
        }
        Ok(written)
    })
}

/// Writes a submission of one colour a part of the set. A part that is not seen takes its instance's median. Gives the number
/// of instances.
pub fn write_by_part(
    dataset: &Dataset,
    out: &Path,
    force: bool,
    source: &EstimateSource,
    set: Option<&PartSetId>,
) -> Result<usize, BaselineError> {
    let parts = set.map_or("the source's own parts".to_owned(), |set| format!("the parts '{set}'"));
    let description = format!(
        "the median of {} under the mask of each of {parts}; a part that is not seen takes its instance's; {UNSEEN}",
        source.description()
    );
    let stem = set.map_or("median-part".to_owned(), |set| format!("median-part-{set}"));
    let method = Method { name: name(&stem, source), description };
    submission::write_scenes(dataset, out, force, &method, |scene, folder| {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let estimate = source.read(dataset, scene)?;
        let parts = PartColors::new(&geometry, set, &estimate)?;
        let mut written = 0;
        for (at, instance) in scene.instances.iter().enumerate() {
            let Some(atlas) = &instance.atlas else { continue };
            let known = parts.paint(&geometry, at, atlas.size as usize);
            Maps::of_atlas(&known, &estimate).write(&folder.join(instance.id.as_str()))?;
            written += 1;
        }
        Ok(written)
    })
}

/// The photo is what these take unless told otherwise, and goes without saying.
fn name(stem: &str, source: &EstimateSource) -> String {
    match source {
        EstimateSource::Input => stem.to_owned(),
        other => format!("{stem}-{}", other.name()),
    }
}

/// The colour of each part of a scene.
struct PartColors {
    /// Of each instance: its triangles' corners by their bits, and the part's colour.
    colors: Vec<HashMap<[[u32; 3]; 3], Values>>,
    medians: Medians,
}

impl PartColors {
    fn new(geometry: &SceneGeometry<'_>, set: Option<&PartSetId>, estimate: &Estimate) -> Result<Self, BaselineError> {
        let parts = parts_of(geometry, set)?;
        let picture = geometry.part_picture(set)?;
        let seen = seen_pixels(geometry, estimate)?;
        let medians = Medians::new(geometry, &seen, estimate);
        let mut pixels: Vec<Vec<Values>> = vec![Vec::new(); parts.len()];
        for (x, y, _) in seen.telling() {
            let (x_of_view, y_of_view) = view_pixel(geometry, &seen.camera, x, y);
            let index = picture.get(x_of_view, y_of_view);
            if let Some(at) = parts.iter().position(|part| part.index.0.get() == index) {
                pixels[at].push(estimate.at(x, y));
            }
        }
        let place_of: HashMap<&str, usize> =
            geometry.scene.instances.iter().enumerate().map(|(at, instance)| (instance.id.as_str(), at)).collect();
        let mut colors = vec![HashMap::new(); geometry.scene.instances.len()];
        let nodes = glb::read(&geometry.folder.parts(set))?;
        for ((part, node), mut pixels) in parts.iter().zip(nodes).zip(pixels) {
            let Some(&at) = place_of.get(part.instance.as_str()) else { continue };
            let color = if pixels.is_empty() { medians.of(geometry, at) } else { median(&mut pixels) };
            for triangle in 0..node.mesh.triangles.len() {
                colors[at].insert(node.mesh.corners(triangle).map(|corner| corner.to_array().map(f32::to_bits)), color);
            }
        }
        Ok(Self { colors, medians })
    }

    /// The atlas of an instance, each texel in its part's colour.
    fn paint(&self, geometry: &SceneGeometry<'_>, instance: usize, size: usize) -> PartialAtlas {
        let mesh = geometry.mesh(instance);
        let atlas = UvAtlas::new(mesh, size);
        let fallback = self.medians.of(geometry, instance);
        let of_triangle: Vec<Values> = (0..mesh.triangles.len())
            .map(|triangle| {
                let corners = mesh.corners(triangle).map(|corner| corner.to_array().map(f32::to_bits));
                self.colors[instance].get(&corners).copied().unwrap_or(fallback)
            })
            .collect();
        let texels = Picture::from_fn(size, size, |x, y| {
            atlas.owner(x, y).map_or(Texel::Unused, |(triangle, _)| Texel::Seen(of_triangle[triangle]))
        });
        PartialAtlas { atlas, texels }
    }
}

fn parts_of<'a>(geometry: &SceneGeometry<'a>, set: Option<&PartSetId>) -> Result<&'a [Part], BaselineError> {
    let found = geometry.scene.all_part_sets().find(|(id, _)| *id == set).map(|(_, parts)| parts);
    found.ok_or_else(|| {
        let what =
            format!("no set of parts '{}'; `part_labels` in a recipe makes one", set.map_or("", PartSetId::as_str));
        SceneError::Unsupported { path: geometry.folder.scene_file(), what }.into()
    })
}
