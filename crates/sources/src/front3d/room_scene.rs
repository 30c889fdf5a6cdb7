//! Makes a scene of one room of a house: its architecture and furniture, what the views see of other rooms, and its
//! lights, as BlenderProc sets them: ceilings and lamps emit although the camera sees their ordinary surface, and a
//! grey environment surrounds the house.

use std::collections::{BTreeMap, BTreeSet};

use mateval_dataset::ids::id_text_from;
use mateval_dataset::material::{ColorInput, MaterialModel, TextureIndex};
use mateval_dataset::reference::{
    Emission, EmissionMap, LightGroup, MaterialIndex, ReferenceScene, Surface, SurfaceIndex,
};
use mateval_dataset::{Camera, Role, SceneLights, SourceKind};
use mateval_tracer::World;
use mateval_tracer::aov::{coarse_subpixels, hit_through};
use rayon::prelude::*;

use super::furnish::FurnishedHouse;
use super::house::{ChildKind, Room};
use super::material_class::AppearanceRule;
use crate::source_scene::{FileScene, Missing, SourceScene};

/// The most characters of a name before an appended number.
const LONGEST_NAME: usize = 40;

/// The scene of room number `room`, seen from `views`, the input view first. `world` was made of `house.scene`.
///
/// Where a view sees another room, all of that room's architecture is kept, since its ceiling emits, and the furniture
/// that is seen. The rest of the house is left out.
pub fn room_scene(house: &FurnishedHouse, world: &World, room: usize, views: &[Camera]) -> SourceScene {
    let kept = kept(house, room, &seen(world, views));
    let names = names(house, room, &kept);
    let mut scene = scene_of(&house.scene, &kept);
    for (surface, name) in scene.surfaces.iter_mut().zip(&names) {
        surface.name.clone_from(name);
    }
    scene.lights = light_groups(house, &kept, &scene);
    let states = house.appearance != AppearanceRule::Constant;
    SourceScene {
        kind: SourceKind::Front3d,
        states_roughness: states,
        states_metallic: states,
        house: house.house.uid.clone(),
        file: house.file.clone(),
        read: FileScene {
            scene,
            origins: kept.iter().map(|&surface| house.placed[surface].origin.clone()).collect(),
            lights: SceneLights::Stage,
            camera: None,
            aspect: None,
            shift_m: house.shift_m,
            findings: house.findings.clone(),
            licence: None,
            files: house.files.clone(),
            missing: missing(house, room),
        },
        camera: views[0],
        captured: None,
        novel: Vec::new(),
        other_poses: Vec::new(),
    }
}

/// What is missing of the room: meshes of its architecture, all textures of these, or the models and textures of its
/// furniture, whichever share is larger.
fn missing(house: &FurnishedHouse, room: usize) -> Missing {
    let Room { meshes: wanted, lost_meshes, .. } = &house.house.rooms[room];
    let files = lost_meshes.iter().map(|uid| format!("mesh {uid}")).collect();
    let meshes = Missing { what: "meshes of the room's architecture", wanted: *wanted, files };
    let share = |missing: &Missing| missing.files.len() as f64 / missing.wanted.max(1) as f64;
    let larger = |one: Missing, other: Missing| if share(&other) > share(&one) { other } else { one };
    larger(larger(missing_furniture(house, room), meshes), missing_textures(house, room))
}

/// The textures of the room's architecture, where none of them exists: the folder is probably another. A few that are
/// missing leave base colours unstated, which is judged by what the camera sees.
fn missing_textures(house: &FurnishedHouse, room: usize) -> Missing {
    let materials = house.house.rooms[room].children.iter().filter_map(|child| match child.what {
        ChildKind::Mesh(mesh) => house.house.meshes[mesh].material,
        ChildKind::Furniture(_) => None,
    });
    let ids = materials.filter_map(|material| house.house.materials[material].texture.as_deref());
    let ends: BTreeSet<String> = ids.map(|id| format!("{id}/texture.png")).collect();
    let absent = |end: &String| house.files.absent.iter().find(|path| path.ends_with(end.as_str())).cloned();
    let (wanted, mut files) = (ends.len(), ends.iter().filter_map(absent).collect::<Vec<_>>());
    if files.len() < wanted {
        files.clear();
    }
    Missing { what: "textures of the room's architecture", wanted, files }
}

/// The models and textures of the room's pieces that are not there or cannot be read.
fn missing_furniture(house: &FurnishedHouse, room: usize) -> Missing {
    let records = house.house.rooms[room].children.iter().filter_map(|child| match child.what {
        ChildKind::Furniture(record) => Some(&house.house.furniture[record]).filter(|record| record.valid),
        ChildKind::Mesh(_) => None,
    });
    let placed: BTreeMap<&str, bool> = house
        .placed
        .iter()
        .filter(|placed| placed.room == room)
        .filter_map(|placed| placed.model.as_ref().map(|model| (model.jid.as_str(), model.complete)))
        .collect();
    let mut missing = Missing { what: "models and textures of the room's furniture", ..Missing::default() };
    for record in records {
        let lost = match placed.get(record.jid.as_str()) {
            None => Some("raw_model.obj"),
            Some(false) => Some("texture.png"),
            Some(true) => None,
        };
        missing.wanted += 1;
        // The path as findings give it, where the file does not exist at all.
        let end = lost.map(|file| format!("{}/{file}", record.jid));
        let path = end.map(|end| house.files.absent.iter().find(|path| path.ends_with(&end)).cloned().unwrap_or(end));
        missing.files.extend(path);
    }
    missing
}

/// The surfaces that any coarse sub-pixel of any view shows.
fn seen(world: &World, views: &[Camera]) -> BTreeSet<usize> {
    let rows: Vec<(&Camera, usize)> =
        views.iter().flat_map(|view| (0..view.intrinsics.height as usize).map(move |y| (view, y))).collect();
    let seen_in_row = |(view, y): (&Camera, usize)| {
        let places = (0..view.intrinsics.width as usize).flat_map(|x| coarse_subpixels(x, y));
        places.filter_map(|place| hit_through(world, view, place)).map(|hit| hit.surface.0).collect::<BTreeSet<usize>>()
    };
    rows.into_par_iter().map(seen_in_row).reduce(BTreeSet::new, |mut all, more| {
        all.extend(more);
        all
    })
}

/// The surfaces of the scene, as indices in the house.
fn kept(house: &FurnishedHouse, room: usize, seen: &BTreeSet<usize>) -> Vec<usize> {
    let rooms: BTreeSet<usize> = seen.iter().map(|&surface| house.placed[surface].room).chain([room]).collect();
    let is_kept = |surface: &usize| {
        let placed = &house.placed[*surface];
        let is_architecture = placed.origin.role.is_architecture();
        placed.room == room || seen.contains(surface) || is_architecture && rooms.contains(&placed.room)
    };
    (0..house.placed.len()).filter(is_kept).collect()
}

/// Names of the kept surfaces: the house's own, with the room's id in front for other rooms. A number makes repeated
/// names unique, also once they are turned into ids. No name is that of the environment's light.
fn names(house: &FurnishedHouse, room: usize, kept: &[usize]) -> Vec<String> {
    let mut taken = BTreeSet::from([id_text_from(WORLD_NAME, "")]);
    let mut count: BTreeMap<String, usize> = BTreeMap::new();
    let name = |surface: &usize| {
        let placed = &house.placed[*surface];
        let own = &house.scene.surfaces[*surface].name;
        let name = match placed.room == room {
            true => own.clone(),
            false => format!("{} {own}", house.house.rooms[placed.room].id),
        };
        // Ids are cut to a length, so a number behind a long name would be lost.
        let stem: String = name.chars().take(LONGEST_NAME).collect();
        let count = count.entry(id_text_from(&name, "object")).or_insert(0);
        loop {
            *count += 1;
            let name = if *count == 1 { name.clone() } else { format!("{stem} {count}") };
            if taken.insert(id_text_from(&name, "object")) {
                return name;
            }
        }
    };
    kept.iter().map(name).collect()
}

/// A scene of the kept surfaces with the materials and textures that they use.
fn scene_of(scene: &ReferenceScene, kept: &[usize]) -> ReferenceScene {
    let mut part = ReferenceScene::default();
    let (mut materials, mut textures) = (BTreeMap::new(), BTreeMap::new());
    for &surface in kept {
        let source = &scene.surfaces[surface];
        let material = *materials.entry(source.material.0).or_insert_with(|| {
            let mut material = scene.materials[source.material.0].clone();
            for texture in material.texture_indices_mut() {
                let index = *textures.entry(texture.0).or_insert_with(|| {
                    part.textures.push(scene.textures[texture.0].clone());
                    TextureIndex(part.textures.len() - 1)
                });
                *texture = index;
            }
            part.materials.push(material);
            MaterialIndex(part.materials.len() - 1)
        });
        part.surfaces.push(Surface { material, ..source.clone() });
    }
    part
}

/// Radiance of ceilings, times their colour.
const CEILING: f32 = 0.8;
/// Radiance of lamps, times their base colour.
const LAMP: f32 = 7.0;
/// The name of the environment's light group.
const WORLD_NAME: &str = "world";
const WORLD: f32 = 0.05;

/// The light groups of the house's surfaces `kept`, which are the surfaces of `scene` in this order. As in Blender,
/// both sides emit.
fn light_groups(house: &FurnishedHouse, kept: &[usize], scene: &ReferenceScene) -> Vec<LightGroup> {
    let mut groups: Vec<LightGroup> = Vec::new();
    let mut ceilings: Vec<((usize, [f32; 3]), usize)> = Vec::new();
    for (at, surface) in kept.iter().enumerate() {
        let placed = &house.placed[*surface];
        let (radiance, map) = match &placed.origin.role {
            // A ceiling joins the group of its room and radiance, if that exists.
            role if role.is_ceiling() => {
                let radiance = placed.color.map(|v| v * CEILING);
                if radiance == [0.0; 3] {
                    continue;
                }
                let key = (placed.room, radiance);
                let known = ceilings.iter().find(|(known, _)| *known == key).map(|(_, group)| *group);
                if let Some(Emission::Area { surfaces, .. }) = known.map(|group| &mut groups[group].emission) {
                    surfaces.push(SurfaceIndex(at));
                    continue;
                }
                ceilings.push((key, groups.len()));
                (radiance, None)
            }
            Role::LightFixture {} => lamp(scene, at),
            Role::Architecture { .. } | Role::Furniture {} | Role::Other {} => continue,
        };
        let emission = Emission::Area { surfaces: vec![SurfaceIndex(at)], radiance, map, two_sided: true };
        groups.push(LightGroup { name: scene.surfaces[at].name.clone(), emission, camera_visible: false });
    }
    let emission = Emission::Constant { radiance: [WORLD; 3] };
    groups.push(LightGroup { name: WORLD_NAME.to_owned(), emission, camera_visible: true });
    groups
}

/// The emission of a lamp, whose base colour is the emission's map or factor.
fn lamp(scene: &ReferenceScene, surface: usize) -> ([f32; 3], Option<EmissionMap>) {
    let material = &scene.materials[scene.surfaces[surface].material.0];
    match material.model {
        MaterialModel::Principled { base_color: ColorInput::Texture { texture, uv }, .. } => {
            ([LAMP; 3], Some(EmissionMap { texture, uv }))
        }
        MaterialModel::Principled { base_color: ColorInput::Constant(color), .. } => (color.map(|v| LAMP * v), None),
        _ => ([LAMP; 3], None),
    }
}
