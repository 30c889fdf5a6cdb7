//! The built-in house, under CC0, in the layout of 3D-FRONT and 3D-FUTURE and with one of each fault that their files
//! show. The reader of 3D-FRONT is tested on it without a download.
//!
//! The input is a folder. Written into it is `house/` with `3D-FRONT/UID.json`, `3D-FRONT-texture/JID/texture.png`,
//! `3D-FUTURE-model/JID/` (`raw_model.obj`, `model.mtl`, `texture.png`), `model_info.json`, `LICENSE.txt` and
//! `FAULTS.txt`. The bytes are the same on every machine.
//!
//! `layout` defines the rooms and builds them with `surfaces`; their appearance is in `materials` and `textures`. The
//! furniture's geometry is in `shapes`, its library in `models`, its textures in `swatches`, and `pieces` places it.
//! `font` draws the letters in all textures. `house_json` makes the JSON of a sound house, `faults` plants the faults,
//! `variants` makes other houses of it, and `model_files` writes the models.
//!
//! The first two rooms are sound except for the normals of two walls. All other faults are in the third room.

pub mod faults;
mod font;
mod house_json;
mod json_number;
mod layout;
mod materials;
mod model_files;
mod models;
mod pieces;
mod shapes;
mod surfaces;
mod swatches;
mod textures;
mod uids;
mod variants;

use std::path::Path;

use mateval_image::png_io::write_rgb_bytes;

use crate::SampleError;
use crate::text_file::write_text;

/// The house's licence file: CC0 1.0.
const LICENSE: &str = "This is 'The Sample House' by the MatEval authors, made by `mateval sample`: made up, in the layout\n\
of 3D-FRONT and 3D-FUTURE, and without anything of theirs.\n\n\
This scene was released under a CC0 license and is in the public domain.\n\
It may be copied, modified and used commercially, without permission or\n\
attribution.\n\n\
For more information about the license, please see\n\
https://creativecommons.org/publicdomain/zero/1.0/\n";

/// Writes the house into the folder `out`; files of the same name are replaced.
pub fn write(out: &Path) -> Result<(), SampleError> {
    let (models, textures) = (models::all(), textures::all());
    for texture in &textures {
        let folder = out.join("house/3D-FRONT-texture").join(uids::texture(texture.number));
        std::fs::create_dir_all(&folder).map_err(SampleError::io("create", &folder))?;
        write_rgb_bytes(&folder.join("texture.png"), &texture.file())?;
    }
    write_shapes(out, &models, &textures)?;
    models.iter().try_for_each(|model| model_files::write_picture(&out.join("house/3D-FUTURE-model"), model))
}

/// Writes the houses with the numbers `0..count` into the folder `out`, with the library and the textures of the built-in
/// house. Returns their files, relative to `out`.
pub fn write_variants(out: &Path, count: u32, seed: u64) -> Result<Vec<String>, SampleError> {
    write(out)?;
    let (models, textures) = (models::all(), textures::all());
    (0..count)
        .map(|number| {
            let mut house = house_json::house(&models, &textures);
            variants::vary(&mut house, &models, number, seed);
            let file = format!("house/3D-FRONT/{}.json", variants::uid(number));
            write_text(&out.join(&file), &house_json::text(house))?;
            Ok(file)
        })
        .collect()
}

/// As [`write()`], but without textures, which take most of the time.
pub fn write_without_pictures(out: &Path) -> Result<(), SampleError> {
    write_shapes(out, &models::all(), &textures::all())
}

fn write_shapes(
    out: &Path,
    models: &[models::Model],
    textures: &[textures::ArchitectureTexture],
) -> Result<(), SampleError> {
    let house = out.join("house");
    let (layouts, library) = (house.join("3D-FRONT"), house.join("3D-FUTURE-model"));
    for folder in [&layouts, &library, &house.join("3D-FRONT-texture")] {
        std::fs::create_dir_all(folder).map_err(SampleError::io("create", folder))?;
    }
    models.iter().try_for_each(|model| model_files::write_shape(&library, model))?;
    write_text(&library.join("model_info.json"), &model_files::info(models))?;
    let json = house_json::text(with_faults(models, textures));
    write_text(&layouts.join(format!("{}.json", uids::HOUSE)), &json)?;
    write_text(&house.join("FAULTS.txt"), &faults::text())?;
    write_text(&house.join("LICENSE.txt"), LICENSE)
}

/// The house's JSON without the faults that [`faults`] plants.
pub fn sound_house() -> serde_json::Value {
    house_json::house(&models::all(), &textures::all())
}

/// The house's JSON with its faults, as [`write()`] writes it.
pub fn faulty_house() -> serde_json::Value {
    with_faults(&models::all(), &textures::all())
}

fn with_faults(models: &[models::Model], textures: &[textures::ArchitectureTexture]) -> serde_json::Value {
    let mut house = house_json::house(models, textures);
    faults::plant(&mut house);
    house
}

#[cfg(test)]
mod tests;
