//! `grey`, the floor: every surface is grey.

use std::path::Path;

use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{Picture, png_io};
use mateval_scene::open::Dataset;
use mateval_scene::submission::{GREY, MAP_SIZES, Map};

use crate::error::BaselineError;
use crate::submission::{self, Method};

/// Writes base colour 0.5 (linear) for every instance and returns their number. Roughness and metallic have no files, so
/// that the format's defaults hold.
pub fn write(dataset: &Dataset, out: &Path, force: bool) -> Result<usize, BaselineError> {
    let texel = [byte_from_unit(srgb_from_linear(GREY)); 3];
    let size = *MAP_SIZES.start();
    let method = Method::new("grey", "base colour 0.5 (linear) everywhere, roughness 0.5, metallic 0");
    submission::write(dataset, out, force, &method, &|_| (), |_, _, folder| {
        let path = folder.join(Map::BaseColor.stem()).with_extension("png");
        Ok(png_io::write_rgb_bytes(&path, &Picture::filled(size, size, texel))?)
    })
}
