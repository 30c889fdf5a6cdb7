//! Houses made of the built-in one, for rehearsals of a release at full size: of another extent, in other colours and
//! wall coverings, and with some of the furniture left out. All houses share the library of models and textures.

use mateval_scene::splitmix64;
use serde_json::{Value, json};

use super::house_json::number;

/// The most that a house is longer than the built-in one, in either direction.
const STRETCH: f64 = 0.25;

/// The share of the furniture that is left out, after the pieces that a room keeps in any case.
const LEFT_OUT: f64 = 0.2;

/// The first pieces of a room, which are its largest, stay.
const KEPT: usize = 2;

/// The id of the house with this number.
pub(super) fn uid(number: u32) -> String {
    format!("cc000000-5a3b-4e00-8000-{:012}", u64::from(number) + 1_000_000)
}

/// A sequence of random numbers.
struct Draws {
    seed: u64,
    next: u64,
}

impl Draws {
    fn integer(&mut self, below: u64) -> u64 {
        self.next += 1;
        splitmix64::number(self.seed, self.next) % below
    }

    /// From 0 to 1.
    fn share(&mut self) -> f64 {
        self.integer(1 << 53) as f64 / (1_u64 << 53) as f64
    }
}

/// Changes the built-in house into the one with this number. Houses of the same seed and number are equal.
pub(super) fn vary(house: &mut Value, house_number: u32, seed: u64) {
    let mut draws = Draws { seed: splitmix64::number(seed, u64::from(house_number)), next: 0 };
    house["uid"] = uid(house_number).into();
    stretch(house, [1.0 + STRETCH * draws.share(), 1.0 + STRETCH * draws.share()]);
    recolour(house, &mut draws);
    leave_out(house, &mut draws);
}

/// Stretches rooms along x and z. Furniture keeps its size and moves with the floor.
fn stretch(house: &mut Value, [x, z]: [f64; 2]) {
    let scale = |point: &mut [Value]| {
        for (at, factor) in [(0, x), (2, z)] {
            point[at] = number(point[at].as_f64().expect("coordinates are numbers") * factor);
        }
    };
    let each = |points: &mut Value| items(points).chunks_exact_mut(3).for_each(scale);
    items(&mut house["mesh"]).iter_mut().for_each(|mesh| each(&mut mesh["xyz"]));
    items(&mut house["lights"]).iter_mut().for_each(|light| each(&mut light["src_position"]));
    for snapshot in items(&mut house["extension"]["snapshots"]) {
        each(&mut snapshot["pos"]);
        each(&mut snapshot["target"]);
    }
    let scene = &mut house["scene"];
    each(&mut scene["boundingBox"]["min"]);
    each(&mut scene["boundingBox"]["max"]);
    for room in items(&mut scene["room"]) {
        room["size"] = number(room["size"].as_f64().expect("a room's size is a number") * x * z);
        items(&mut room["children"]).iter_mut().for_each(|child| each(&mut child["pos"]));
    }
}

/// Draws the colours of painted surfaces; pictures of the others change places, each with its scale.
fn recolour(house: &mut Value, draws: &mut Draws) {
    let materials = items(&mut house["material"]);
    let mut pictured = Vec::new();
    for (at, material) in materials.iter_mut().enumerate() {
        if material["useColor"] == json!(true) {
            let bytes = [0; 3].map(|_| 150 + draws.integer(106));
            material["color"] = json!([bytes[0], bytes[1], bytes[2], 255]);
        } else {
            pictured.push(at);
        }
    }
    for (place, &at) in pictured.iter().enumerate().skip(1) {
        let other = pictured[draws.integer(place as u64 + 1) as usize];
        for key in ["jid", "UVTransform", "normalUVTransform"] {
            let [a, b] = [&materials[at][key], &materials[other][key]].map(Value::clone);
            materials[at][key] = b;
            materials[other][key] = a;
        }
    }
}

fn leave_out(house: &mut Value, draws: &mut Draws) {
    for room in items(&mut house["scene"]["room"]) {
        let children = room["children"].as_array_mut().expect("a room's children are a list");
        let is_furniture = |child: &Value| child["instanceid"].as_str().is_some_and(|id| id.starts_with("furniture/"));
        let mut pieces = 0;
        children.retain(|child| {
            pieces += usize::from(is_furniture(child));
            !is_furniture(child) || pieces <= KEPT || draws.share() >= LEFT_OUT
        });
    }
}

fn items(list: &mut Value) -> &mut Vec<Value> {
    list.as_array_mut().expect("the built-in house has lists there")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::built_in;
    use super::super::house_json::house_json;
    use super::*;

    fn varied(number: u32, seed: u64) -> Value {
        let mut house = house_json(&built_in());
        vary(&mut house, number, seed);
        house
    }

    #[test]
    fn houses_differ_by_number_and_seed_and_are_repeated() {
        let texts: BTreeSet<String> = (0..20).map(|at| varied(at, 1)["scene"].to_string()).collect();
        assert_eq!(texts.len(), 20);
        assert_eq!(varied(3, 1), varied(3, 1));
        assert_ne!(varied(3, 1), varied(3, 2));
    }

    /// Both rooms are furnished, and the furniture lies within the walls.
    #[test]
    fn every_house_has_furnished_rooms_within_its_walls() {
        for at in 0..20 {
            let mut house = varied(at, 1);
            let high = house["scene"]["boundingBox"]["max"][0].as_f64().unwrap();
            assert!((10.2..=10.2 * 1.25).contains(&high), "{high}");
            for room in items(&mut house["scene"]["room"]) {
                let pieces = items(&mut room["children"]);
                let pieces: Vec<&Value> =
                    pieces.iter().filter(|c| c["instanceid"].as_str().unwrap().starts_with("furniture")).collect();
                assert!(pieces.len() >= 2, "house {at}: {} pieces", pieces.len());
                assert!(pieces.iter().all(|piece| (0.0..high).contains(&piece["pos"][0].as_f64().unwrap())));
            }
        }
    }
}
