//! The built-in house with a third room, a library, and with every kind of fault found in 3D-FRONT and 3D-FUTURE.
//! The reader of 3D-FRONT is tested on it without a download.
//!
//! The input is a folder. Written into it is `house/`, as by `mateval_sample` except for the faults: the layout's JSON is
//! changed before it is written, models and textures are damaged afterwards. The bytes are the same on every machine.
//!
//! `library` builds the third room without faults; `faults` lists the faults and plants them. The first two rooms stay
//! sound except for the normals of two walls and, in `/material/7`, the outer walls' "local"; all other faults are in the
//! third room.

pub mod faults;
mod library;
#[cfg(test)]
mod tests;

use std::path::Path;

use mateval_sample::house::house_json::{HOUSE_ID, house_json, text};
use mateval_sample::house::plan::House;
use mateval_sample::house::{built_in, write_pictures, write_shapes};
use serde_json::Value;

/// Writes the house into the folder `out`; files of the same name are replaced.
pub fn write(out: &Path) {
    write_with(out, true);
}

/// As [`write()`], but without textures, which take most of the time: every piece and wall exists, in plain colours.
pub fn write_without_pictures(out: &Path) {
    write_with(out, false);
}

fn write_with(out: &Path, pictures: bool) {
    let house = house();
    write_shapes(&house, out).unwrap();
    if pictures {
        write_pictures(&house, out).unwrap();
    }
    let root = out.join("house");
    std::fs::write(root.join(format!("3D-FRONT/{HOUSE_ID}.json")), text(faulty_json(&house))).unwrap();
    faults::damage_files(&house, &root);
}

/// The layout's JSON with its faults, as [`write()`] writes it.
pub fn json() -> Value {
    faulty_json(&house())
}

fn faulty_json(house: &House) -> Value {
    let mut json = house_json(house);
    library::withhold_models(&mut json);
    faults::plant(&mut json);
    json
}

/// The layout's JSON of the three rooms before faults are planted.
pub fn sound_json() -> Value {
    let mut json = house_json(&house());
    library::withhold_models(&mut json);
    json
}

/// The three rooms and their models, without faults.
fn house() -> House {
    let mut house = built_in();
    // The library's own walls close the house in the south.
    let south = house.rooms[0].meshes.pop().unwrap();
    assert!(south.kind == "WallOuter" && south.positions.iter().all(|p| p.z == 4.6));
    library::add(&mut house);
    house
}
