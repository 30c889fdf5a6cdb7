//! An instance's maps in the form in which a submission holds them: of an atlas, of the medians of an estimate over the
//! pixels that show an instance or a category, or of one material per part.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_dataset::submission::{GREY, MAP_SIZES, Map};
use mateval_dataset::uv_atlas::UvAtlas;
use mateval_files::work_folder::make_folder;
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{Picture, png_io};
use rayon::prelude::*;

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
        let size = known.atlas.size();
        let mut maps = Self::filled(size, DEFAULT, given);
        let rows = maps.rows(size).into_par_iter().zip(known.texels.pixels().par_chunks(size));
        rows.for_each(|(mut row, texels)| row.set(texels));
        maps.fill_gutters(&known.atlas);
        maps
    }

    /// Maps with the same values everywhere.
    pub fn constant(values: Values, given: GivenMaps) -> Self {
        Self::filled(*MAP_SIZES.start(), values, given)
    }

    /// Maps of `size` x `size` texels with the same values everywhere.
    pub(crate) fn filled(size: usize, values: Values, given: GivenMaps) -> Self {
        let [r, g, b, roughness, metallic] = values;
        let scalar = |is_given: bool, value: f32| is_given.then(|| Picture::filled(size, size, byte_from_unit(value)));
        Self {
            base_color: given.base_color.then(|| Picture::filled(size, size, srgb_bytes([r, g, b]))),
            roughness: scalar(given.roughness, roughness),
            metallic: scalar(given.metallic, metallic),
        }
    }

    /// The rows of maps of `size` x `size` texels, from the top, to be changed in place.
    pub(crate) fn rows(&mut self, size: usize) -> Vec<MapsRow<'_>> {
        let mut base_color = rows_of(&mut self.base_color);
        let (mut roughness, mut metallic) = (rows_of(&mut self.roughness), rows_of(&mut self.metallic));
        let next =
            |_| MapsRow { base_color: base_color.next(), roughness: roughness.next(), metallic: metallic.next() };
        (0..size).map(next).collect()
    }

    /// Gives every texel without an owner the values of an owned one nearby.
    pub(crate) fn fill_gutters(&mut self, atlas: &UvAtlas) {
        let mut base_color = self.base_color.as_mut().map(Picture::pixels_mut);
        let mut scalars = [&mut self.roughness, &mut self.metallic].map(|map| map.as_mut().map(Picture::pixels_mut));
        atlas.each_gutter_texel(|to, from| {
            if let Some(pixels) = &mut base_color {
                pixels[to] = pixels[from];
            }
            scalars.iter_mut().flatten().for_each(|pixels| pixels[to] = pixels[from]);
        });
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

fn rows_of<T: Copy>(map: &mut Option<Picture<T>>) -> impl Iterator<Item = &mut [T]> {
    map.iter_mut().flat_map(|map| {
        let width = map.width();
        map.pixels_mut().chunks_mut(width)
    })
}

/// A row of each map that is given.
pub(crate) struct MapsRow<'a> {
    base_color: Option<&'a mut [[u8; 3]]>,
    roughness: Option<&'a mut [u8]>,
    metallic: Option<&'a mut [u8]>,
}

impl MapsRow<'_> {
    /// Writes the values of a row of texels; those of texels without any are [`DEFAULT`].
    pub(crate) fn set(&mut self, texels: &[Texel]) {
        let values = |texel: &Texel| texel.seen().unwrap_or(DEFAULT);
        if let Some(row) = &mut self.base_color {
            // Texels that are filled from one point are a row of equal colours.
            let mut last = ([0.0; 3], srgb_bytes([0.0; 3]));
            for (bytes, texel) in row.iter_mut().zip(texels) {
                let [r, g, b, ..] = values(texel);
                if [r, g, b] != last.0 {
                    last = ([r, g, b], srgb_bytes([r, g, b]));
                }
                *bytes = last.1;
            }
        }
        for (row, channel) in [(&mut self.roughness, 3), (&mut self.metallic, 4)] {
            let bytes = row.iter_mut().flat_map(|row| row.iter_mut());
            bytes.zip(texels).for_each(|(byte, texel)| *byte = byte_from_unit(values(texel)[channel]));
        }
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
