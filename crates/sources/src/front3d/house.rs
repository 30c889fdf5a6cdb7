//! The checked content of a 3D-FRONT house's JSON: its rooms, what they contain, and where. Every key of the JSON may
//! be missing, repeated or of the wrong type; repairs are findings.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::{DMat3, DMat4, DQuat, DVec3};
use mateval_dataset::material::UvTransform;
use mateval_dataset::{Severity, TriangleMesh};
use mateval_files::source_folder::slashed;
use mateval_files::untrusted::shortened;
use serde_json::Value;

use super::document::{Limits, boolean, id_of, kind, list, number, numbers, parse, text};
use super::house_mesh;
use crate::log::Log;
use crate::open::{Invalid, SourceError, open};
use crate::source_scene::{report_shift, shift_of, shift_transform};

/// The checked content of a house's JSON. V-Ray lights are left out, since their units are V-Ray's own.
#[derive(Clone, Debug)]
pub struct House {
    /// Its uid, or the file's stem where it has none.
    pub uid: String,
    /// Records of furniture, including those that are not valid.
    pub(crate) furniture: Vec<FurnitureRecord>,
    pub(crate) meshes: Vec<HouseMesh>,
    pub(crate) materials: Vec<HouseMaterial>,
    pub rooms: Vec<Room>,
    /// The designers' cameras in the file.
    pub cameras: Vec<DesignerCamera>,
    /// What has been subtracted from the places of rooms and cameras: whole metres far from the origin, else nothing.
    pub shift_m: DVec3,
}

/// A record of furniture, to which children of rooms refer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FurnitureRecord {
    /// The uid by which children refer to it.
    pub uid: String,
    /// The name of its model's folder.
    pub jid: String,
    pub valid: bool,
    pub category: Option<String>,
    /// The file's title, as in `lighting/pendant light`.
    pub title: Option<String>,
    /// JSON pointer to the record.
    pub place: String,
}

/// A mesh of the architecture, in the space of the child that refers to it.
#[derive(Clone, Debug)]
pub(crate) struct HouseMesh {
    /// The uid by which children refer to it.
    pub uid: String,
    /// Its type, as in `WallInner`; `Other` where the file gives none.
    pub kind: String,
    /// The triangles relative to `base`, without the file's normals, which are often wrong.
    pub mesh: TriangleMesh,
    /// What has been subtracted from the file's positions: whole metres far from the origin, else nothing.
    pub base: DVec3,
    /// Index in [`House::materials`]; absent if the file names no known material.
    pub material: Option<usize>,
    /// JSON pointer to the record.
    pub place: String,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HouseMaterial {
    /// The uid by which meshes refer to it.
    pub uid: String,
    /// The name of its texture's folder; absent if the colour counts.
    pub texture: Option<String>,
    /// The words of its content type, as in `material wallpaper`.
    pub content: Option<String>,
    /// sRGB-encoded colour, 0 to 255; absent if the file states none.
    pub color: Option<[f64; 3]>,
    /// The map from the mesh's uv to the texture's.
    pub uv: UvTransform,
    /// JSON pointer to the record.
    pub place: String,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Room {
    /// Its instanceid, as in `LivingDiningRoom-1912`.
    pub id: String,
    /// Its type, as in `LivingDiningRoom`.
    pub kind: String,
    /// The product of the scene's and the room's transforms, less the house's shift; the identity in every known file.
    pub(crate) house_from_room: DMat4,
    pub(crate) children: Vec<Child>,
    /// The number of meshes that the file puts into it.
    pub(crate) meshes: usize,
    /// The uids of those that do not exist or could not be read.
    pub(crate) lost_meshes: Vec<String>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Child {
    pub what: ChildKind,
    pub placement: Placement,
    /// JSON pointer to the child.
    pub place: String,
}

/// The record that a child refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChildKind {
    /// Index in [`House::furniture`].
    Furniture(usize),
    /// Index in [`House::meshes`].
    Mesh(usize),
}

/// Translation, rotation and scale of a child in its room, of a room in the scene, or of the scene in the house: a
/// point v moves to `T * R * S * v`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    /// Metres.
    pub position: DVec3,
    /// Unit quaternion; the file's order is x, y, z, w.
    pub rotation: DQuat,
    /// Factors along the axes; a negative one mirrors.
    pub scale: DVec3,
}

impl Placement {
    pub fn matrix(&self) -> DMat4 {
        DMat4::from_scale_rotation_translation(self.scale, self.rotation, self.position)
    }

    /// `T * R * diag(-1, 1, 1) * S`, which mirrors the piece along its own x axis.
    pub fn mirrored_matrix(&self) -> DMat4 {
        let mirror = DMat4::from_mat3(DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)));
        DMat4::from_rotation_translation(self.rotation, self.position) * mirror * DMat4::from_scale(self.scale)
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct DesignerCamera {
    pub number: usize,
    /// Metres.
    pub position: DVec3,
    /// A point in the middle of the picture, in metres.
    pub target: DVec3,
    pub fov_y_deg: f64,
}

impl DesignerCamera {
    /// The camera with both places moved.
    pub(super) fn moved(self, place: impl Fn(DVec3) -> DVec3) -> Self {
        Self { position: place(self.position), target: place(self.target), ..self }
    }
}

impl House {
    /// Index of the room with this id.
    pub fn room(&self, id: &str) -> Option<usize> {
        self.rooms.iter().position(|room| room.id == id)
    }
}

/// Reads the whole tree; `stem` is that of the file's name. Fails where it has no scene or exceeds `limits`.
pub(super) fn read(tree: &Value, stem: &str, limits: &Limits, log: &mut Log) -> Result<House, Invalid> {
    let materials = materials(tree, log);
    let material_of: BTreeMap<&str, usize> = materials.iter().enumerate().map(|(k, m)| (m.uid.as_str(), k)).collect();
    let meshes = meshes(tree, &material_of, limits, log)?;
    let furniture = furniture(tree, log);
    let mut rooms = rooms(tree, &furniture, &meshes, limits, log)?;
    report_unused(&rooms, &meshes, log);
    let shift_m = shift_of(place_of(&rooms, &meshes));
    report_shift(shift_m, log);
    rooms.iter_mut().for_each(|room| room.house_from_room = shift_transform(shift_m) * room.house_from_room);
    Ok(House {
        uid: text(tree, "uid").unwrap_or(stem).to_owned(),
        cameras: snapshots(tree, log).into_iter().map(|camera| camera.moved(|place| place - shift_m)).collect(),
        shift_m,
        furniture,
        meshes,
        materials,
        rooms,
    })
}

/// A corner of the first mesh that a room shows; the origin where there is none.
fn place_of(rooms: &[Room], meshes: &[HouseMesh]) -> DVec3 {
    let shown = rooms.iter().flat_map(|room| room.children.iter().map(move |child| (room, child)));
    let mut corners = shown.filter_map(|(room, child)| {
        let ChildKind::Mesh(mesh) = child.what else { return None };
        let corner = meshes[mesh].base + meshes[mesh].mesh.positions.first()?.as_dvec3();
        Some((room.house_from_room * child.placement.matrix()).transform_point3(corner))
    });
    corners.next().unwrap_or(DVec3::ZERO)
}

/// The records of the list at `key` with their index and uid. Of several with one uid, the first counts.
fn first_of_each_uid<'a>(tree: &'a Value, key: &str, log: &mut Log) -> Vec<(usize, String, &'a Value)> {
    let mut seen = BTreeSet::new();
    let mut records = Vec::new();
    for (at, record) in list(tree, key).iter().enumerate() {
        let place = format!("/{key}/{at}");
        let Some(uid) = id_of(record, "uid") else {
            let message = format!("expected an object with a uid, found {} without one", kind(record));
            log.warn("no_uid", &place, message, "left it out");
            continue;
        };
        if seen.insert(uid.clone()) {
            records.push((at, uid.into_owned(), record));
        } else {
            let message = format!("the uid '{}' is already used", shortened(&uid));
            log.note("duplicate_uid", &place, message, "kept the first record");
        }
    }
    records
}

fn furniture(tree: &Value, log: &mut Log) -> Vec<FurnitureRecord> {
    let mut records = Vec::new();
    for (at, uid, record) in first_of_each_uid(tree, "furniture", log) {
        let place = format!("/furniture/{at}");
        records.push(FurnitureRecord {
            uid,
            jid: id_of(record, "jid").unwrap_or_default().into_owned(),
            valid: is_true(record, "valid", &place, "left its pieces out", log),
            category: text(record, "category").map(str::to_owned),
            title: text(record, "title").map(str::to_owned),
            place,
        });
    }
    records
}

/// Whether the value at `key` is true; an absent one is not. Anything that is neither true nor false is reported.
fn is_true(record: &Value, key: &str, place: &str, action: &str, log: &mut Log) -> bool {
    let Some(found) = record.get(key).filter(|found| !found.is_null()) else { return false };
    boolean(found).unwrap_or_else(|| {
        let message = format!("expected true or false, found {}", kind(found));
        log.warn("bad_value", &format!("{place}/{key}"), message, action);
        false
    })
}

fn materials(tree: &Value, log: &mut Log) -> Vec<HouseMaterial> {
    let records = first_of_each_uid(tree, "material", log);
    records.into_iter().map(|(at, uid, record)| material(uid, record, format!("/material/{at}"), log)).collect()
}

/// Whether the texture or the colour counts follows Trescope's Blender renderer. Without a texture, the colour counts.
/// Otherwise `colorMode` decides if it is present, else `useColor`; the default is the texture.
fn material(uid: String, record: &Value, place: String, log: &mut Log) -> HouseMaterial {
    let by_color = match text(record, "colorMode") {
        Some(mode) => mode.eq_ignore_ascii_case("color"),
        None => is_true(record, "useColor", &place, "used the texture", log),
    };
    let jid = id_of(record, "jid").filter(|jid| !by_color && jid != "local");
    if text(record, "normaltexture").is_some() {
        let place = format!("{place}/normaltexture");
        log.note("normal_map", &place, "a normal map whose file is not public", "left it out");
    }
    HouseMaterial {
        uid,
        texture: jid.map(Cow::into_owned),
        content: content(record),
        color: color(record, &place, log),
        uv: uv_transform(record, &place, log),
        place,
    }
}

/// The content type, which is a list of words in most files.
fn content(record: &Value) -> Option<String> {
    match record.get("contentType")? {
        Value::String(words) => Some(words.clone()),
        Value::Array(words) => Some(words.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(" ")),
        _ => None,
    }
}

fn color(record: &Value, place: &str, log: &mut Log) -> Option<[f64; 3]> {
    let found = record.get("color")?;
    let all: Vec<f64> = found.as_array().into_iter().flatten().map_while(number).collect();
    // Numbers up to 1 are colours of 0 to 1, as other formats have them, or nearly black.
    let is_of_255 = |rgb: &[f64; 3]| rgb.iter().any(|v| *v > 1.0) || *rgb == [0.0; 3];
    let found = match all.first_chunk::<3>() {
        Some(rgb) if !rgb.iter().all(|v| (0.0..=255.0).contains(v)) => format!("{rgb:?}"),
        Some(rgb) if is_of_255(rgb) => return Some(*rgb),
        Some(rgb) => format!("numbers up to 1, which are probably fractions of 1: {rgb:?}"),
        None => kind(found).to_owned(),
    };
    let message = format!("expected 3 or 4 numbers of 0 to 255, found {found}");
    log.warn("bad_color", &format!("{place}/color"), message, "used white, which the file does not state");
    None
}

/// The first two rows of a row-major 3x3 matrix.
fn uv_transform(record: &Value, place: &str, log: &mut Log) -> UvTransform {
    let Some(found) = record.get("UVTransform").filter(|found| !found.is_null()) else { return UvTransform::default() };
    let Some([a, b, c, d, e, f, ..]) = numbers::<9>(record, "UVTransform").filter(|m| m.iter().all(|v| v.abs() < 1e6))
    else {
        let message = format!("expected 9 finite numbers, found {}", kind(found));
        log.warn("bad_uv_transform", &format!("{place}/UVTransform"), message, "used the identity");
        return UvTransform::default();
    };
    UvTransform([[a, b, c], [d, e, f]].map(|row| row.map(|v| v as f32)))
}

fn meshes(
    tree: &Value,
    material_of: &BTreeMap<&str, usize>,
    limits: &Limits,
    log: &mut Log,
) -> Result<Vec<HouseMesh>, Invalid> {
    let mut meshes = Vec::new();
    let mut triangles = 0;
    for (at, uid, record) in first_of_each_uid(tree, "mesh", log) {
        let place = format!("/mesh/{at}");
        let Some((mesh, base)) = house_mesh::read(record, &place, log) else { continue };
        triangles += mesh.triangles.len();
        if triangles > limits.triangles {
            let most = limits.triangles;
            return Err(Invalid(format!(
                "{place}: expected at most {most} triangles in all meshes together, found more"
            )));
        }
        let named = id_of(record, "material").unwrap_or_default();
        let material = material_of.get(&*named).copied();
        if material.is_none() {
            let message = format!("no material has the uid '{}'", shortened(&named));
            log.warn("no_material", &format!("{place}/material"), message, "used mid-grey");
        }
        let kind = text(record, "type").unwrap_or("Other").to_owned();
        meshes.push(HouseMesh { uid, kind, mesh, base, material, place });
    }
    Ok(meshes)
}

fn rooms(
    tree: &Value,
    furniture: &[FurnitureRecord],
    meshes: &[HouseMesh],
    limits: &Limits,
    log: &mut Log,
) -> Result<Vec<Room>, Invalid> {
    let scene = tree
        .get("scene")
        .filter(|scene| scene.is_object())
        .ok_or_else(|| Invalid::new("expected an object 'scene' with rooms, found none"))?;
    let found = list(scene, "room");
    if found.len() > limits.rooms {
        let most = limits.rooms;
        return Err(Invalid(format!("/scene/room: expected at most {most} rooms, found {}", found.len())));
    }
    // The records that children may refer to.
    let house_from_scene = placement(scene, "/scene", log).matrix();
    let records = Records {
        furniture: furniture.iter().enumerate().map(|(k, record)| (record.uid.as_str(), k)).collect(),
        meshes: meshes.iter().enumerate().map(|(k, mesh)| (mesh.uid.as_str(), k)).collect(),
        listed_meshes: list(tree, "mesh").iter().filter_map(|record| id_of(record, "uid")).collect(),
    };
    // Every room, within the limit on children.
    let mut rooms: Vec<Room> = Vec::new();
    let mut child_count = 0;
    for (at, record) in found.iter().enumerate() {
        let place = format!("/scene/room/{at}");
        child_count += list(record, "children").len();
        if child_count > limits.children {
            let most = limits.children;
            return Err(Invalid(format!(
                "{place}: expected at most {most} children in all rooms together, found more"
            )));
        }
        let id = room_id(record, at, &rooms, &place, log);
        let (mut children, mut meshes, mut lost_meshes) = (Vec::new(), 0, Vec::new());
        for (at, child) in list(record, "children").iter().enumerate() {
            let place = format!("{place}/children/{at}");
            meshes += usize::from(is_mesh(child));
            match child_kind(child, &place, &records, log) {
                Some(what) => children.push(Child { what, placement: placement(child, &place, log), place }),
                None if is_mesh(child) => lost_meshes.push(id_of(child, "ref").unwrap_or_default().into_owned()),
                None => {}
            }
        }
        let kind = text(record, "type").unwrap_or("OtherRoom").to_owned();
        let house_from_room = house_from_scene * placement(record, &place, log).matrix();
        rooms.push(Room { id, kind, house_from_room, children, meshes, lost_meshes });
    }
    Ok(rooms)
}

/// A unique id for a room: its instanceid, or one made of its index where it has none, with a number appended where the
/// instanceid is already used.
fn room_id(record: &Value, at: usize, rooms: &[Room], place: &str, log: &mut Log) -> String {
    let id = text(record, "instanceid").map_or_else(|| format!("Room-{at}"), str::to_owned);
    if rooms.iter().all(|room| room.id != id) {
        return id;
    }
    let free = |other: &String| rooms.iter().all(|room| room.id != *other);
    let other = (at..).map(|number| format!("{id}-{number}")).find(free).expect("rooms are finitely many");
    let message = format!("the instanceid '{}' is already used", shortened(&id));
    log.note("duplicate_room", place, message, format!("named it '{}'", shortened(&other)));
    other
}

/// The records that children refer to, by uid.
struct Records<'a> {
    furniture: BTreeMap<&'a str, usize>,
    meshes: BTreeMap<&'a str, usize>,
    /// The uids of all meshes, including those that were left out.
    listed_meshes: BTreeSet<Cow<'a, str>>,
}

/// The record that a child refers to. In later releases half of the references to furniture are dangling, since those
/// pieces are not public.
fn child_kind(child: &Value, place: &str, records: &Records<'_>, log: &mut Log) -> Option<ChildKind> {
    let target = id_of(child, "ref").unwrap_or_default();
    let furniture = || records.furniture.get(&*target).copied().map(ChildKind::Furniture);
    let mesh = || records.meshes.get(&*target).copied().map(ChildKind::Mesh);
    let found = if is_mesh(child) { mesh().or_else(furniture) } else { furniture().or_else(mesh) };
    // A mesh that was left out has been reported already.
    if found.is_none() && !records.listed_meshes.contains(&target) {
        let message = format!("no record has the uid '{}'", shortened(&target));
        let severity = if is_mesh(child) { Severity::Warning } else { Severity::Note };
        let file = log.file().to_owned();
        log.push(severity, "dangling_ref", &file, &format!("{place}/ref"), message, "left it out");
    }
    found
}

/// Whether a child of a room refers to a mesh.
fn is_mesh(child: &Value) -> bool {
    text(child, "instanceid").is_some_and(|id| id.starts_with("mesh/"))
}

fn placement(record: &Value, place: &str, log: &mut Log) -> Placement {
    let mut vector = |key: &str, default: DVec3| {
        let Some(found) = record.get(key).filter(|found| !found.is_null()) else { return default };
        match numbers::<3>(record, key).filter(|v| v.iter().all(|v| v.abs() < 1e9)) {
            Some(values) => DVec3::from_array(values),
            None => {
                let message = format!("expected 3 finite numbers, found {}", kind(found));
                log.warn("bad_placement", &format!("{place}/{key}"), message, "used the default");
                default
            }
        }
    };
    let (position, scale) = (vector("pos", DVec3::ZERO), vector("scale", DVec3::ONE));
    Placement { position, rotation: rotation(record, place, log), scale }
}

/// A quaternion x, y, z, w, normalised. A length that differs from 1 by more than rounding is reported.
fn rotation(record: &Value, place: &str, log: &mut Log) -> DQuat {
    const ROUNDING: f64 = 1e-3;
    let Some(found) = record.get("rot").filter(|found| !found.is_null()) else { return DQuat::IDENTITY };
    let place = format!("{place}/rot");
    let values = numbers::<4>(record, "rot").map(DQuat::from_array).filter(|q| (1e-6..1e6).contains(&q.length()));
    let Some(quaternion) = values else {
        let message = format!("expected a quaternion x, y, z, w, found {}", kind(found));
        log.warn("bad_placement", &place, message, "used no rotation");
        return DQuat::IDENTITY;
    };
    if (quaternion.length() - 1.0).abs() > ROUNDING {
        let message = format!("expected a quaternion of length 1, found {:.3}", quaternion.length());
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
        log.note("unused_mesh", &mesh.place, "no room contains the mesh", "left it out");
    }
}

/// The designers' cameras in `extension.snapshots`, which the last release has.
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

/// A designer's camera with `pos`, `target` and a vertical `fov` in degrees; absent if one of them is missing or
/// faulty.
fn designer_camera(record: &Value, number: usize) -> Option<DesignerCamera> {
    let (position, target) = (numbers::<3>(record, "pos")?, numbers::<3>(record, "target")?);
    let fov_y_deg = record.get("fov").and_then(super::document::number).filter(|fov| (1.0..179.0).contains(fov))?;
    let (position, target) = (DVec3::from_array(position), DVec3::from_array(target));
    (position.distance(target) > 1e-6).then_some(DesignerCamera { number, position, target, fov_y_deg })
}

/// The path of a file, as findings give it, and its SHA-256.
type PathAndHash = (String, String);

/// The cameras from the file `beside` the house, relative to `root`. Without such a file, or where it has none for this
/// house, those from the house's JSON. Sorted by number. Returns the path and the hash of the file too, if it was read.
pub(super) fn designer_cameras(
    house: &House,
    root: &Path,
    beside: Option<&Path>,
    limits: &Limits,
    log: &mut Log,
) -> Result<(Vec<DesignerCamera>, Option<PathAndHash>), SourceError> {
    let Some(beside) = beside else { return Ok((house.cameras.clone(), None)) };
    let path = root.join(beside);
    let (folder, _, bytes) = open(&path, limits.json_bytes, limits.json_bytes)?;
    let tree = parse(&bytes, limits).map_err(|invalid| invalid.in_file(&path))?;
    let all = cameras_of(&tree, &house.uid);
    let all: Vec<DesignerCamera> = all.into_iter().map(|camera| camera.moved(|place| place - house.shift_m)).collect();
    if all.is_empty() {
        let message = format!("expected cameras of the house '{}', found none", house.uid);
        let action = "used the cameras in the house's JSON";
        log.push(Severity::Note, "no_camera", &slashed(beside), "", message, action);
    }
    let hash = folder.into_files().hashes.into_iter().next().map(|(_, hash)| (slashed(beside), hash));
    Ok((if all.is_empty() { house.cameras.clone() } else { all }, hash))
}

/// The cameras of the entries `<uid>_<number>.jpg`, sorted by number.
fn cameras_of(tree: &Value, uid: &str) -> Vec<DesignerCamera> {
    let entries = tree.as_object().into_iter().flatten();
    let mut all: Vec<DesignerCamera> = entries
        .filter_map(|(key, entry)| {
            let number = key.strip_prefix(uid)?.strip_prefix('_')?.split('.').next()?.parse().ok()?;
            designer_camera(entry.get("camera")?, number)
        })
        .collect();
    all.sort_by_key(|camera| camera.number);
    all
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn read_tree(tree: &Value) -> (House, Vec<String>) {
        let mut log = Log::new("house.json".to_owned(), 100);
        let house = read(tree, "small", &Limits::default(), &mut log).unwrap();
        (house, log.into_findings().into_iter().map(|finding| format!("{} {}", finding.code, finding.place)).collect())
    }

    #[test]
    fn ids_and_truth_values_of_other_types_count() {
        let piece = |uid: Value, valid: Value| json!({"uid": uid, "jid": 12, "valid": valid});
        let child = |of: Value| json!({"ref": of, "instanceid": "furniture/1"});
        let tree = json!({
            "furniture": [
                piece(json!(7), json!("true")), piece(json!("8"), json!(1)), piece(json!("9"), json!("no")),
                piece(json!("10"), Value::Null),
            ],
            "material": [
                {"uid": 3, "jid": "t", "useColor": "True"}, {"uid": "4", "jid": "t", "useColor": 0},
                {"uid": "5", "jid": "t"},
            ],
            "scene": {"room": [{"instanceid": "R", "children": [child(json!("7")), child(json!(8)), child(json!(9))]}]}
        });
        let (house, findings) = read_tree(&tree);
        assert_eq!(house.furniture.iter().map(|piece| piece.valid).collect::<Vec<_>>(), [true, true, false, false]);
        assert_eq!((house.furniture[0].jid.as_str(), house.rooms[0].children.len()), ("12", 3));
        let textures: Vec<_> = house.materials.iter().map(|material| material.texture.as_deref()).collect();
        assert_eq!(textures, [None, Some("t"), Some("t")]);
        assert_eq!(findings, ["bad_value /furniture/2/valid"]);
    }

    #[test]
    fn meshes_that_rooms_lack_are_counted() {
        let mesh = json!({"uid": "a", "xyz": [0, 0, 0, 1, 0, 0, 0, 1, 0], "faces": [0, 1, 2]});
        let child = |of: &str, what: &str| json!({"ref": of, "instanceid": what});
        let children = [child("a", "mesh/1"), child("b", "mesh/2"), child("c", "mesh/3"), child("d", "furniture/1")];
        let (house, findings) =
            read_tree(&json!({"mesh": [mesh], "scene": {"room": [{"instanceid": "R", "children": children}]}}));
        assert_eq!(
            (house.rooms[0].meshes, house.rooms[0].lost_meshes.as_slice()),
            (3, &["b".to_owned(), "c".to_owned()][..])
        );
        let dangling = findings.iter().filter(|finding| finding.starts_with("dangling_ref")).count();
        assert_eq!(dangling, 3, "{findings:?}");
    }

    #[test]
    fn numbers_up_to_1_are_no_colours_of_255() {
        for (color, expected) in [
            (json!([1, 1, 1]), None),
            (json!([1, 0, 0, 1]), None),
            (json!([0.5, 0.25, 1]), None),
            (json!([0, 0, 0]), Some([0.0; 3])),
            (json!([2, 1, 0]), Some([2.0, 1.0, 0.0])),
            (json!(["255", "128", "0"]), Some([255.0, 128.0, 0.0])),
        ] {
            let mut log = Log::new("house.json".to_owned(), 100);
            let found = super::color(&json!({ "color": color }), "/material/0", &mut log);
            assert_eq!((found, log.into_findings().len()), (expected, usize::from(expected.is_none())), "{color}");
        }
    }

    #[test]
    fn only_cameras_of_the_house_sorted_by_number() {
        let camera = |x: f64| json!({"camera": {"pos": [x, 1, 0], "target": [0, 1, 0], "fov": 60}});
        let tree = json!({"u_10.jpg": camera(10.0), "u_2.jpg": camera(2.0), "v_1.jpg": camera(1.0), "u_x.jpg": camera(3.0),
            "u_3.jpg": {"camera": {"pos": [1, 1], "target": [0, 1, 0], "fov": 60}}});
        let numbers: Vec<usize> = cameras_of(&tree, "u").iter().map(|camera| camera.number).collect();
        assert_eq!(numbers, [2, 10]);
    }
}
