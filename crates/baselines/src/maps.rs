//! An instance's maps in the form in which a submission holds them: of an atlas, of the medians of an estimate over the
//! pixels that show an instance or a category, or of one material per part.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_dataset::submission::{GREY, MAP_SIZES, Map};
use mateval_dataset::uv_atlas::UvAtlas;
use mateval_files::work_folder::make_folder;
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{Picture, png_io};

use crate::error::BaselineError;
use crate::estimate::{Estimate, GivenMaps, Values};
use crate::geometry::{PartTriangles, SceneGeometry, SeenPixels};
use crate::lift::{PartialAtlas, Texel};

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
        let mut maps = Self::of_values(&known.texels, |texel| texel.seen().unwrap_or(DEFAULT), given);
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
        Self::of_values(&Picture::filled(size, size, values), |values| values, given)
    }

    fn of_values<T: Copy>(texels: &Picture<T>, values: impl Fn(T) -> Values, given: GivenMaps) -> Self {
        // Texels that are filled from one point are a row of equal colours.
        let mut last = ([0.0; 3], srgb_bytes([0.0; 3]));
        let mut bytes = |color: [f32; 3]| {
            if color != last.0 {
                last = (color, srgb_bytes(color));
            }
            last.1
        };
        let color = || {
            texels.map(|texel| {
                let [r, g, b, ..] = values(texel);
                bytes([r, g, b])
            })
        };
        let scalar = |is_given: bool, channel: usize| {
            is_given.then(|| texels.map(|texel| byte_from_unit(values(texel)[channel])))
        };
        Self {
            base_color: given.base_color.then(color),
            roughness: scalar(given.roughness, 3),
            metallic: scalar(given.metallic, 4),
        }
    }

    /// Writes the maps to the instance's folder, which is created.
    pub fn write(&self, folder: &Path) -> Result<(), BaselineError> {
        make_folder(folder)?;
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

/// The values of an instance without any estimate: linear grey, and the format's default roughness and metallic.
pub const DEFAULT: Values = [GREY, GREY, GREY, 0.5, 0.0];

/// The median of each seen instance, and of each category.
pub struct Medians {
    of_instance: BTreeMap<usize, Values>,
    of_category: BTreeMap<String, Values>,
}

impl Medians {
    /// Collects the medians over the pixels that show an instance.
    pub fn new(geometry: &SceneGeometry<'_>, seen: &SeenPixels, estimate: &Estimate) -> Self {
        let mut of_instance: BTreeMap<usize, Vec<Values>> = BTreeMap::new();
        let mut of_category: BTreeMap<String, Vec<Values>> = BTreeMap::new();
        for (x, y, instance) in seen.shown_pixels() {
            let values = estimate.at(x, y);
            of_instance.entry(instance).or_default().push(values);
            if let Some(category) = &geometry.scene.instances[instance].category {
                of_category.entry(category.to_lowercase()).or_default().push(values);
            }
        }
        Self {
            of_instance: of_instance
                .into_iter()
                .map(|(instance, mut all)| (instance, lower_median(&mut all)))
                .collect(),
            of_category: of_category
                .into_iter()
                .map(|(category, mut all)| (category, lower_median(&mut all)))
                .collect(),
        }
    }

    /// The median of the instance if it is seen, else that of its category, else grey.
    pub fn of(&self, geometry: &SceneGeometry<'_>, instance: usize) -> Values {
        let category = || {
            let category = geometry.scene.instances[instance].category.as_ref()?;
            self.of_category.get(&category.to_lowercase())
        };
        self.of_instance.get(&instance).or_else(category).copied().unwrap_or(DEFAULT)
    }
}

/// The median of each value; of an even number of entries the lower of the middle two.
pub fn lower_median(all: &mut [Values]) -> Values {
    if all.is_empty() {
        return DEFAULT;
    }
    let middle = (all.len() - 1) / 2;
    std::array::from_fn(|channel| {
        let (_, value, _) = all.select_nth_unstable_by(middle, |a, b| a[channel].total_cmp(&b[channel]));
        value[channel]
    })
}

/// The values of each part.
pub struct PartColors<'a> {
    triangles: PartTriangles<'a>,
    of_part: Vec<Option<Values>>,
}

impl<'a> PartColors<'a> {
    /// Calls `color_of` for every part, with the part's index and its instance's index.
    pub fn new(triangles: PartTriangles<'a>, mut color_of: impl FnMut(usize, usize) -> Option<Values>) -> Self {
        let owners = triangles.owners.iter().enumerate();
        let of_part = owners.map(|(part, owner)| color_of(part, (*owner)?)).collect();
        Self { triangles, of_part }
    }

    /// The atlas of an instance with each texel in its part's colour; texels of parts without a colour are `Unseen`.
    pub fn paint(&self, geometry: &SceneGeometry<'_>, instance: usize, size: usize) -> PartialAtlas {
        let atlas = UvAtlas::new(geometry.mesh(instance), size);
        let known = |part: Option<usize>| self.of_part[part?];
        let parts = self.triangles.of(instance).iter();
        let of_triangle: Vec<Texel> = parts.map(|part| known(*part).map_or(Texel::Unseen, Texel::Seen)).collect();
        let texels = Picture::from_fn(size, size, |x, y| {
            atlas.owner(x, y).map_or(Texel::Unused, |(triangle, _)| of_triangle[triangle])
        });
        PartialAtlas { atlas, texels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_has_its_own_median() {
        let mut all = [[3.0, 0.0, 9.0, 0.1, 1.0], [1.0, 5.0, 7.0, 0.2, 0.0], [2.0, 4.0, 8.0, 0.3, 0.0]];
        assert_eq!(lower_median(&mut all), [2.0, 4.0, 8.0, 0.2, 0.0]);
        assert_eq!(lower_median(&mut all[..2])[0], lower_median(&mut [all[0], all[1]])[0]);
        assert_eq!(lower_median(&mut []), DEFAULT);
    }
}
