//! A house that the program makes itself, under CC0, in the layout of 3D-FRONT and 3D-FUTURE and with one of each fault
//! that those show: what their reader can be tried on without a download.
//!
//! In: a folder. Out: in it `house/` with `3D-FRONT/UID.json`, `3D-FRONT-texture/JID/texture.png`,
//! `3D-FUTURE-model/JID/` (`raw_model.obj`, `model.mtl`, `texture.png`), `model_info.json`, `LICENSE.txt`, `FAULTS.txt`.
//! The bytes are the same on every machine.
//!
//! Between: `layout` says which rooms there are and builds them of `surfaces`; `materials` and `textures` are what they
//! show. `shapes` and `models` are the furniture, `swatches` what covers it, `font` the letters on everything; `pieces`
//! says what stands where. `house_json` writes a house without a fault, `faults` spoils it, `model_files` writes the rest.
//!
//! Two rooms are sound, but for some normals; what is wrong is in the third and in what stands there.

pub mod faults;
mod font;
mod house_json;
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

use std::path::Path;

use mateval_image::png_io::write_rgb_bytes;

use super::write_text;
use crate::SampleError;

/// CC0 1.0, and what it covers.
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

/// As [`write`], without pictures, which take most of the time.
pub fn write_without_pictures(out: &Path) -> Result<(), SampleError> {
    write_shapes(out, &models::all(), &textures::all())
}

fn write_shapes(out: &Path, models: &[models::Model], textures: &[textures::LayoutTexture]) -> Result<(), SampleError> {
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

/// The house's JSON with its faults, as it is on disk.
pub fn faulty_house() -> serde_json::Value {
    with_faults(&models::all(), &textures::all())
}

fn with_faults(models: &[models::Model], textures: &[textures::LayoutTexture]) -> serde_json::Value {
    let mut house = house_json::house(models, textures);
    faults::plant(&mut house);
    house
}

#[cfg(test)]
mod tests;
