//! Makes a submission of TEXGen's textures.

use std::path::Path;

use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{Texture, Wrap};
use mateval_scene::Progress;
use mateval_scene::open::Dataset;

use crate::error::BaselineError;
use crate::estimate_source::EstimateSource;
use crate::geometry::SceneGeometry;
use crate::lift::{PartialAtlas, Texel};
use crate::maps::Maps;
use crate::nn::{self, NnOptions};
use crate::objects::object_id;
use crate::submission::{self, Method};

/// Counts of an import.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Imported {
    /// Number of instances in the submission.
    pub instances: usize,
    /// Number of those with a texture by TEXGen.
    pub textured: usize,
}

/// Writes a submission. Seen texels hold the estimate; the base colour of all others is that of `results/<id>.png` (sRGB,
/// any square size) at their uv. An instance without such a file, and roughness and metallic everywhere, are as `nn` with
/// its defaults makes them from the same estimate. Fails where no file exists for any instance.
pub fn import(
    dataset: &Dataset,
    results: &Path,
    out: &Path,
    force: bool,
    source: &EstimateSource,
    progress: Progress<'_>,
) -> Result<Imported, BaselineError> {
    let textured = dataset.scenes.iter().flat_map(|scene| scene.instances.iter().map(move |i| object_id(&scene.id, i)));
    let textured = textured.filter(|id| file(results, id).is_file()).count();
    if textured == 0 {
        return Err(BaselineError::NoTextures(results.to_owned()));
    }
    let description = format!(
        "TEXGen's textures where the input view shows nothing, {} where it does; {textured} textures; the rest as nn",
        source.description(dataset)
    );
    let assumed_encodings = source.assumed_encodings();
    let method = Method { name: format!("texgen-{}", source.name()), description, assumed_encodings };
    let instances = submission::write_scenes(dataset, out, force, &method, progress, |scene, folder| {
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let estimate = source.read(dataset, scene, progress)?;
        if estimate.base_color.is_none() {
            return Err(BaselineError::NoColor(scene.id.to_string()));
        }
        let (seen, options) = (nn::seen_pixels(&geometry, &estimate)?, NnOptions::default());
        nn::lift_scene(&geometry, &estimate, &seen, &options, progress, |at, known, medians| {
            let instance = &geometry.scene.instances[at];
            let path = file(results, &object_id(&scene.id, instance));
            let texture = path.is_file().then(|| read_texture(&path, Encoding::Srgb, Wrap::Clamp)).transpose()?;
            let maps = match (known, texture) {
                (Some(mut lifted), Some(texture)) => {
                    composite(&mut lifted, &texture);
                    Maps::of_atlas(&lifted.whole, estimate.given_maps())
                }
                (Some(lifted), None) => Maps::of_atlas(&lifted.whole, estimate.given_maps()),
                (None, _) => Maps::constant(medians.of(&geometry, at), estimate.given_maps()),
            };
            maps.write(&folder.join(instance.id.as_str()))
        })
    })?;
    Ok(Imported { instances, textured })
}

fn file(results: &Path, id: &str) -> std::path::PathBuf {
    results.join(format!("{id}.png"))
}

/// Replaces the colour of every texel that was not seen by the texture's.
fn composite(lifted: &mut nn::Lifted, texture: &Texture) {
    let PartialAtlas { atlas, texels } = &mut lifted.whole;
    let size = atlas.size();
    for (at, texel) in texels.pixels_mut().iter_mut().enumerate() {
        if let (Texel::Seen(values), false) = (texel, lifted.seen[at]) {
            let uv = [at % size, size - 1 - at / size].map(|v| (v as f32 + 0.5) / size as f32);
            values[..3].copy_from_slice(&texture.sample(uv));
        }
    }
}
