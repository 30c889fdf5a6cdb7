//! From a house's JSON to a [`House`]: every key may be missing, doubled or odd; what was mended is a finding.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DMat4, DQuat, DVec3};
use mateval_scene::material::UvTransform;
use serde_json::Value;

use super::document::{kind, list, numbers, text};
use super::house::{
    Child, ChildKind, DesignerCamera, FurnitureRecord, House, HouseMaterial, HouseMesh, Placement, Release, Room,
};
use super::house_mesh;
use super::limits::Limits;
use crate::log::Log;
use mateval_scene::findings::shortened;

/// Reads the whole tree. Fails, in words, where it has more rooms or children than `limits` allow.
pub(super) fn read(tree: &Value, stem: &str, limits: &Limits, log: &mut Log) -> Result<House, String> {
    let release = release(tree);
    let materials = materials(tree, log);
    let material_of: BTreeMap<&str, usize> = materials.iter().enumerate().map(|(k, m)| (m.uid.as_str(), k)).collect();
    let meshes = meshes(tree, &material_of, limits, log)?;
    let furniture = furniture(tree, log);
    let rooms = rooms(tree, &furniture, &meshes, limits, log)?;
    report_unused(&rooms, &meshes, log);
    Ok(House {
        uid: text(tree, "uid").unwrap_or(stem).to_owned(),
        release,
        cameras: snapshots(tree, log),
        lights: list(tree, "lights").len(),
        furniture,
        meshes,
        materials,
        rooms,
    })
}

fn release(tree: &Value) -> Release {
    match (tree.get("version"), tree.get("lights"), tree.get("materialList")) {
        (None, None, None) => Release::R1,
        (_, None, None) => Release::R2,
        _ => Release::R3,
    }
}

/// The first record of each uid, by its place in the list.
fn first_of_each_uid<'a>(tree: &'a Value, key: &str, log: &mut Log) -> Vec<(usize, String, &'a Value)> {
    let mut seen = BTreeSet::new();
    let mut records = Vec::new();
    for (at, record) in list(tree, key).iter().enumerate() {
        let place = format!("/{key}/{at}");
        let Some(uid) = text(record, "uid") else {
            let message = format!("expected an object with a uid, found {} without one", kind(record));
            log.warn("no_uid", &place, message, "left it out");
            continue;
        };
        if seen.insert(uid) {
            records.push((at, uid.to_owned(), record));
        } else {
            let message = format!("the uid '{}' is there already", shortened(uid));
            log.note("duplicate_uid", &place, message, "kept the first one");
        }
    }
    records
}

fn furniture(tree: &Value, log: &mut Log) -> Vec<FurnitureRecord> {
    let record = |(at, uid, record): (usize, String, &Value)| FurnitureRecord {
        uid,
        jid: text(record, "jid").unwrap_or("").to_owned(),
        valid: record.get("valid").and_then(Value::as_bool) == Some(true),
        category: text(record, "category").map(str::to_owned),
        title: text(record, "title").map(str::to_owned),
        place: format!("/furniture/{at}"),
    };
    first_of_each_uid(tree, "furniture", log).into_iter().map(record).collect()
}

fn materials(tree: &Value, log: &mut Log) -> Vec<HouseMaterial> {
    let records = first_of_each_uid(tree, "material", log);
    records.into_iter().map(|(at, uid, record)| material(uid, record, format!("/material/{at}"), log)).collect()
}

/// Which of texture and colour counts is the rule of Trescope's Blender renderer: without a texture the colour; else
/// what `colorMode` says, if it is there; else the colour if `useColor` is true; else the texture.
fn material(uid: String, record: &Value, place: String, log: &mut Log) -> HouseMaterial {
    let by_color = match text(record, "colorMode") {
        Some(mode) => mode.eq_ignore_ascii_case("color"),
        None => record.get("useColor").and_then(Value::as_bool) == Some(true),
    };
    let jid = text(record, "jid").filter(|jid| !by_color && *jid != "local");
    if text(record, "normaltexture").is_some() {
        let place = format!("{place}/normaltexture");
        log.note("normal_map", &place, "a normal map, whose file is not public", "left it out");
    }
    HouseMaterial {
        uid,
        texture: jid.map(str::to_owned),
        color: color(record, &place, log),
        uv: uv_transform(record, &place, log),
        place,
    }
}

fn color(record: &Value, place: &str, log: &mut Log) -> [f64; 3] {
    let Some(found) = record.get("color") else { return [255.0; 3] };
    let all: Vec<f64> = found.as_array().into_iter().flatten().map_while(Value::as_f64).collect();
    match all.first_chunk::<3>() {
        Some(rgb) if rgb.iter().all(|v| (0.0..=255.0).contains(v)) => *rgb,
        _ => {
            let message = format!("expected 3 or 4 numbers of 0 to 255, found {}", kind(found));
            log.warn("bad_color", &format!("{place}/color"), message, "took white");
            [255.0; 3]
        }
    }
}

/// The first two rows of a row-major 3x3.
fn uv_transform(record: &Value, place: &str, log: &mut Log) -> UvTransform {
    let Some(found) = record.get("UVTransform").filter(|found| !found.is_null()) else { return UvTransform::default() };
    let Some([a, b, c, d, e, f, ..]) = numbers::<9>(record, "UVTransform").filter(|m| m.iter().all(|v| v.abs() < 1e6))
    else {
        let message = format!("expected 9 finite numbers, found {}", kind(found));
        log.warn("bad_uv_transform", &format!("{place}/UVTransform"), message, "took the identity");
        return UvTransform::default();
    };
    UvTransform([[a, b, c], [d, e, f]].map(|row| row.map(|v| v as f32)))
}

fn meshes(
    tree: &Value,
    material_of: &BTreeMap<&str, usize>,
    limits: &Limits,
    log: &mut Log,
) -> Result<Vec<HouseMesh>, String> {
    let mut meshes = Vec::new();
    let mut triangles = 0;
    for (at, uid, record) in first_of_each_uid(tree, "mesh", log) {
        let place = format!("/mesh/{at}");
        let Some(mesh) = house_mesh::read(record, &place, log) else { continue };
        triangles += mesh.triangles.len();
        if triangles > limits.triangles {
            return Err(format!("{place}: expected at most {} triangles in all", limits.triangles));
        }
        let named = text(record, "material");
        let material = named.and_then(|uid| material_of.get(uid)).copied();
        if material.is_none() {
            let message = format!("there is no material '{}'", shortened(named.unwrap_or("")));
            log.warn("no_material", &format!("{place}/material"), message, "took mid-grey");
        }
        let kind = text(record, "type").unwrap_or("Other").to_owned();
        meshes.push(HouseMesh { uid, kind, mesh, material, place });
    }
    Ok(meshes)
}

fn rooms(
    tree: &Value,
    furniture: &[FurnitureRecord],
    meshes: &[HouseMesh],
    limits: &Limits,
    log: &mut Log,
) -> Result<Vec<Room>, String> {
    let Some(scene) = tree.get("scene").filter(|scene| scene.is_object()) else {
        return Err("expected an object 'scene' with rooms, found none".to_owned());
    };
    let found = list(scene, "room");
    if found.len() > limits.rooms {
        return Err(format!("/scene/room: expected at most {} rooms, found {}", limits.rooms, found.len()));
    }
    let world_from_scene = placement(scene, "/scene", log).matrix();
    let things = Things {
        furniture: furniture.iter().enumerate().map(|(k, record)| (record.uid.as_str(), k)).collect(),
        meshes: meshes.iter().enumerate().map(|(k, mesh)| (mesh.uid.as_str(), k)).collect(),
        listed_meshes: list(tree, "mesh").iter().filter_map(|record| text(record, "uid")).collect(),
    };
    let mut rooms: Vec<Room> = Vec::new();
    let mut children = 0;
    for (at, record) in found.iter().enumerate() {
        let place = format!("/scene/room/{at}");
        children += list(record, "children").len();
        if children > limits.children {
            return Err(format!("{place}: expected at most {} children in all", limits.children));
        }
        let id = room_id(record, at, &rooms, &place, log);
        rooms.push(room(record, id, place, world_from_scene, &things, log));
    }
    Ok(rooms)
}

/// The instanceid, or a number where there is none; a number behind it where it is taken.
fn room_id(record: &Value, at: usize, rooms: &[Room], place: &str, log: &mut Log) -> String {
    let id = text(record, "instanceid").map_or_else(|| format!("Room-{at}"), str::to_owned);
    if rooms.iter().all(|room| room.id != id) {
        return id;
    }
    let free = |other: &String| rooms.iter().all(|room| room.id != *other);
    let other = (at..).map(|number| format!("{id}-{number}")).find(free).expect("rooms are finitely many");
    let message = format!("the instanceid '{}' is there already", shortened(&id));
    log.note("duplicate_room", place, message, format!("named it '{}'", shortened(&other)));
    other
}

/// Where uids lead.
struct Things<'a> {
    furniture: BTreeMap<&'a str, usize>,
    meshes: BTreeMap<&'a str, usize>,
    /// Those that were left out, too.
    listed_meshes: BTreeSet<&'a str>,
}

fn room(
    record: &Value,
    id: String,
    place: String,
    world_from_scene: DMat4,
    things: &Things<'_>,
    log: &mut Log,
) -> Room {
    let children = list(record, "children").iter().enumerate();
    let children = children
        .filter_map(|(at, child)| {
            let place = format!("{place}/children/{at}");
            let what = child_kind(child, &place, things, log)?;
            let id = text(child, "instanceid").unwrap_or("").to_owned();
            Some(Child { what, id, placement: placement(child, &place, log), place })
        })
        .collect();
    Room {
        kind: text(record, "type").unwrap_or("OtherRoom").to_owned(),
        world_from_room: world_from_scene * placement(record, &place, log).matrix(),
        id,
        children,
        place,
    }
}

/// What a child refers to. Half of all furniture references of later releases lead nowhere: those pieces are not public.
fn child_kind(child: &Value, place: &str, things: &Things<'_>, log: &mut Log) -> Option<ChildKind> {
    let target = text(child, "ref").unwrap_or("");
    let furniture = || things.furniture.get(target).copied().map(ChildKind::Furniture);
    let mesh = || things.meshes.get(target).copied().map(ChildKind::Mesh);
    let is_mesh = text(child, "instanceid").is_some_and(|id| id.starts_with("mesh/"));
    let found = if is_mesh { mesh().or_else(furniture) } else { furniture().or_else(mesh) };
    // Why a mesh was left out has been told at the mesh.
    if found.is_none() && !things.listed_meshes.contains(target) {
        let message = format!("there is no record '{}'", shortened(target));
        log.note("dangling_ref", &format!("{place}/ref"), message, "left it out");
    }
    found
}

fn placement(record: &Value, place: &str, log: &mut Log) -> Placement {
    let mut vector = |key: &str, default: DVec3| {
        let Some(found) = record.get(key).filter(|found| !found.is_null()) else { return default };
        match numbers::<3>(record, key).filter(|v| v.iter().all(|v| v.abs() < 1e5)) {
            Some(values) => DVec3::from_array(values),
            None => {
                let message = format!("expected 3 finite numbers, found {}", kind(found));
                log.warn("bad_placement", &format!("{place}/{key}"), message, "took the default");
                default
            }
        }
    };
    let (position, scale) = (vector("pos", DVec3::ZERO), vector("scale", DVec3::ONE));
    Placement { position, rotation: rotation(record, place, log), scale }
}

/// x, y, z, w. A length that is off by more than a rounding is told.
fn rotation(record: &Value, place: &str, log: &mut Log) -> DQuat {
    const ROUNDING: f64 = 1e-3;
    let Some(found) = record.get("rot").filter(|found| !found.is_null()) else { return DQuat::IDENTITY };
    let place = format!("{place}/rot");
    let values = numbers::<4>(record, "rot").map(DQuat::from_array).filter(|q| (1e-6..1e6).contains(&q.length()));
    let Some(quaternion) = values else {
        let message = format!("expected a quaternion x, y, z, w, found {}", kind(found));
        log.warn("bad_placement", &place, message, "took no rotation");
        return DQuat::IDENTITY;
    };
    if (quaternion.length() - 1.0).abs() > ROUNDING {
        let message = format!("a quaternion of length {:.3}, expected 1", quaternion.length());
        log.note("rotation_not_unit", &place, message, "scaled it to unit length");
    }
    quaternion.normalize()
}

fn report_unused(rooms: &[Room], meshes: &[HouseMesh], log: &mut Log) {
    let used: BTreeSet<usize> = rooms
        .iter()
        .flat_map(|room| &room.children)
        .filter_map(|child| match child.what {
            ChildKind::Mesh(mesh) => Some(mesh),
            ChildKind::Furniture(_) => None,
        })
        .collect();
    for (_, mesh) in meshes.iter().enumerate().filter(|(at, _)| !used.contains(at)) {
        log.note("unused_mesh", &mesh.place, "no room holds it", "left it out");
    }
}

/// `extension.snapshots`: designers' cameras of the last release.
fn snapshots(tree: &Value, log: &mut Log) -> Vec<DesignerCamera> {
    let all = tree.get("extension").map_or(&[][..], |extension| list(extension, "snapshots"));
    let camera = |(at, record): (usize, &Value)| {
        let found = designer_camera(record, at);
        if found.is_none() {
            let place = format!("/extension/snapshots/{at}");
            log.note("bad_camera", &place, "expected pos, target and a fov of 1 to 179 degrees", "left it out");
        }
        found
    };
    all.iter().enumerate().filter_map(camera).collect()
}

/// A camera with `pos`, `target` and a vertical `fov` in degrees.
pub(super) fn designer_camera(record: &Value, number: usize) -> Option<DesignerCamera> {
    let (position, target) = (numbers::<3>(record, "pos")?, numbers::<3>(record, "target")?);
    let fov_y_deg = record.get("fov")?.as_f64().filter(|fov| (1.0..179.0).contains(fov))?;
    let (position, target) = (DVec3::from_array(position), DVec3::from_array(target));
    (position.distance(target) > 1e-6).then_some(DesignerCamera { number, position, target, fov_y_deg })
}
