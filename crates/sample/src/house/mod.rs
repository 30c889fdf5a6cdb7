//! The built-in house, under CC0, in the layout of 3D-FRONT and 3D-FUTURE: a living room and a bedroom.
//!
//! The input is a folder. Written into it is `house/` with `3D-FRONT/UID.json`, `3D-FRONT-texture/JID/texture.png`,
//! `3D-FUTURE-model/JID/` (`raw_model.obj`, `model.mtl`, `texture.png`), `model_info.json` and `LICENSE.txt`. The bytes are
//! the same on every machine.
//!
//! `plan` describes a house as data. `layout` builds and furnishes the rooms with `architecture`; their appearance is in
//! `materials`. The furniture's geometry is in `shapes`, its library in `models` and its textures in `swatches`. `font`
//! draws the letters in all textures. `house_json` makes the JSON of a house, `model_files` writes its models, and
//! `variants` makes other houses of it.
//!
//! The house is sound. The test kit's faulty house is made of the same blocks, which are public for its sake.

pub mod architecture;
pub mod font;
pub mod house_json;
pub mod layout;
pub mod materials;
mod model_files;
pub mod models;
pub mod plan;
pub mod shapes;
pub mod swatches;
mod variants;

use std::path::Path;

use mateval_image::png_io::write_rgb_bytes;

use crate::files::{SampleError, create_folder, write_text};
use house_json::HOUSE_ID;
use plan::House;

/// The house's licence file: CC0 1.0.
const LICENSE: &str = "This is 'The Sample House' by the MatEval authors, made by `mateval sample`: made up, in the layout\n\
of 3D-FRONT and 3D-FUTURE, and without anything of theirs.\n\n\
This scene was released under a CC0 license and is in the public domain.\n\
It may be copied, modified and used commercially, without permission or\n\
attribution.\n\n\
For more information about the license, please see\n\
https://creativecommons.org/publicdomain/zero/1.0/\n";

/// The built-in house.
pub fn built_in() -> House {
    House {
        rooms: vec![layout::living_room(), layout::bedroom()],
        materials: materials::materials(),
        textures: materials::textures(),
        models: models::all(),
    }
}

/// Writes the built-in house into the folder `out`; files of the same name are replaced.
pub fn write(out: &Path) -> Result<(), SampleError> {
    let house = built_in();
    write_shapes(&house, out)?;
    write_pictures(&house, out)
}

/// Writes the houses with the numbers `0..count` into the folder `out`, with the library and the textures of the built-in
/// house. Returns their files, relative to `out`.
pub fn write_variants(out: &Path, count: u32, seed: u64) -> Result<Vec<String>, SampleError> {
    write(out)?;
    let built_in = house_json::house_json(&built_in());
    (0..count)
        .map(|number| {
            let mut house = built_in.clone();
            variants::vary(&mut house, number, seed);
            let file = format!("house/3D-FRONT/{}.json", variants::uid(number));
            write_text(&out.join(&file), &house_json::text(house))?;
            Ok(file)
        })
        .collect()
}

/// Writes everything but the textures, which take most of the time.
pub fn write_shapes(house: &House, out: &Path) -> Result<(), SampleError> {
    let root = out.join("house");
    let (layouts, library) = (root.join("3D-FRONT"), root.join("3D-FUTURE-model"));
    for folder in [&layouts, &library, &root.join("3D-FRONT-texture")] {
        create_folder(folder)?;
    }
    house.models.iter().try_for_each(|model| model_files::write_shape(&library, model))?;
    write_text(&library.join("model_info.json"), &model_files::info(&house.models))?;
    let json = house_json::text(house_json::house_json(house));
    write_text(&layouts.join(format!("{HOUSE_ID}.json")), &json)?;
    write_text(&root.join("LICENSE.txt"), LICENSE)
}

/// Writes the textures of the architecture and of the models, whose folders exist.
pub fn write_pictures(house: &House, out: &Path) -> Result<(), SampleError> {
    for texture in &house.textures {
        let folder = out.join("house/3D-FRONT-texture").join(texture.jid());
        create_folder(&folder)?;
        write_rgb_bytes(&folder.join("texture.png"), &texture.file())?;
    }
    house.models.iter().try_for_each(|model| model_files::write_picture(&out.join("house/3D-FUTURE-model"), model))
}

#[cfg(test)]
mod tests;
