//! An instance's maps in the form in which a submission holds them.

use std::path::Path;

use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{Picture, png_io};
use mateval_scene::SceneError;
use mateval_scene::submission::{MAP_SIZES, Map};

use crate::error::BaselineError;
use crate::estimate::{GivenMaps, Values};
use crate::lift::{PartialAtlas, Texel};
use crate::median::DEFAULT;

/// A linear colour as sRGB bytes, clipped to 0 to 1.
pub(crate) fn srgb_bytes(linear: [f32; 3]) -> [u8; 3] {
    linear.map(|v| byte_from_unit(srgb_from_linear(v.clamp(0.0, 1.0))))
}

/// The maps of an instance; `None` for maps that are not given.
pub struct Maps {
    /// sRGB.
    pub base_color: Option<Picture<[u8; 3]>>,
    /// Linear.
    pub roughness: Option<Picture<u8>>,
    /// Linear.
    pub metallic: Option<Picture<u8>>,
}

impl Maps {
    /// The maps of an atlas, with filled gutters. Maps that are not given have no file.
    pub fn of_atlas(known: &PartialAtlas, given: GivenMaps) -> Self {
        let picture = known.texels.map(|texel| match texel {
            Texel::Seen(values) => values,
            Texel::Unused | Texel::Unseen => DEFAULT,
        });
        let mut maps = Self::of_values(&picture, given);
        if let Some(map) = &mut maps.base_color {
            known.atlas.fill_gutters(map);
        }
        for map in [&mut maps.roughness, &mut maps.metallic].into_iter().flatten() {
            known.atlas.fill_gutters(map);
        }
        maps
    }

    /// Maps with the same values everywhere.
    pub fn constant(values: Values, given: GivenMaps) -> Self {
        let size = *MAP_SIZES.start();
        Self::of_values(&Picture::filled(size, size, values), given)
    }

    fn of_values(values: &Picture<Values>, given: GivenMaps) -> Self {
        let color = || values.map(|[r, g, b, ..]| srgb_bytes([r, g, b]));
        let scalar =
            |is_given: bool, channel: usize| is_given.then(|| values.map(|values| byte_from_unit(values[channel])));
        Self {
            base_color: given.base_color.then(color),
            roughness: scalar(given.roughness, 3),
            metallic: scalar(given.metallic, 4),
        }
    }

    /// Writes the maps to the instance's folder, which is created.
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
