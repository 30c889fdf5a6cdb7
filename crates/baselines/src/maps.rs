//! An instance's maps as a submission holds them.

use std::path::Path;

use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{Picture, png_io};
use mateval_scene::SceneError;
use mateval_scene::submission::{MAP_SIZES, Map};

use crate::error::BaselineError;
use crate::estimate::{Says, Values};
use crate::lift::{PartialAtlas, Texel};
use crate::median::DEFAULT;

/// A linear colour as PNG holds it, clipped.
pub(crate) fn srgb_bytes(linear: [f32; 3]) -> [u8; 3] {
    linear.map(|v| byte_from_unit(srgb_from_linear(v.clamp(0.0, 1.0))))
}

/// Base colour as sRGB bytes; roughness and metallic as linear bytes, where anything is said of them.
pub struct Maps {
    base_color: Option<Picture<[u8; 3]>>,
    roughness: Option<Picture<u8>>,
    metallic: Option<Picture<u8>>,
}

impl Maps {
    /// The whole atlas, its gutters filled. What is not said stays at the format's default, with no file.
    pub fn of_atlas(known: &PartialAtlas, says: Says) -> Self {
        let picture = known.texels.map(|texel| match texel {
            Texel::Seen(values) => values,
            Texel::Unused | Texel::Unseen => DEFAULT,
        });
        let mut maps = Self::of_values(&picture, says);
        if let Some(map) = &mut maps.base_color {
            known.atlas.fill_gutters(map);
        }
        for map in [&mut maps.roughness, &mut maps.metallic].into_iter().flatten() {
            known.atlas.fill_gutters(map);
        }
        maps
    }

    /// The same everywhere.
    pub fn constant(values: Values, says: Says) -> Self {
        let size = *MAP_SIZES.start();
        Self::of_values(&Picture::filled(size, size, values), says)
    }

    fn of_values(values: &Picture<Values>, says: Says) -> Self {
        let color = || values.map(|[r, g, b, ..]| srgb_bytes([r, g, b]));
        let scalar = |said: bool, channel: usize| said.then(|| values.map(|values| byte_from_unit(values[channel])));
        Self {
            base_color: says.base_color.then(color),
            roughness: scalar(says.roughness, 3),
            metallic: scalar(says.metallic, 4),
        }
    }

    /// Writes them into the instance's folder, which is made.
    pub fn write(&self, folder: &Path) -> Result<(), BaselineError> {
        std::fs::create_dir_all(folder).map_err(SceneError::io("make", folder))?;
        let path = |map: Map| folder.join(map.stem()).with_extension("png");
        if let Some(picture) = &self.base_color {
            png_io::write_rgb_bytes(&path(Map::BaseColor), picture)?;
        }
        for (map, picture) in [(Map::Roughness, &self.roughness), (Map::Metallic, &self.metallic)] {
            if let Some(picture) = picture {
                png_io::write_grey_bytes(&path(map), picture)?;
            }
        }
        Ok(())
    }
}
