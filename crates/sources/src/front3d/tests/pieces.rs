//! Pieces, their models and materials, and their placement: `T * R * S`, and BlenderProc's mirrored world.

use glam::{DMat3, DMat4, DQuat};
use mateval_dataset::material::{ColorInput, Material, MaterialModel, UvTransform};
use mateval_files::source_folder::SourceFolder;

use super::*;
use crate::log::Log;

const GREY: ColorInput = ColorInput::Constant([0.5; 3]);

fn color_of(material: &Material) -> &ColorInput {
    let MaterialModel::Principled { base_color, .. } = &material.model else { panic!("{:?}", material.model) };
    base_color
}

/// The colour of the architecture's material with this number, if any surface uses it.
fn architecture_color(house: &FurnishedHouse, number: usize) -> Option<&ColorInput> {
    let uid = format!("101000000003/{number:05}");
    house.scene.materials.iter().find(|material| material.name == uid).map(color_of)
}

fn texture_name<'a>(house: &'a FurnishedHouse, color: &ColorInput) -> &'a str {
    let ColorInput::Texture { texture, .. } = color else { panic!("{color:?}") };
    &house.scene.textures[texture.0].name
}

/// 31 placements, of which three have no model (one of these is valid) and one is a valid piece of almost no size.
#[test]
fn all_valid_pieces_are_placed() {
    let house = furnished();
    assert_sound(house);
    assert_eq!(house.wanted_pieces, [11, 6, 15]);
    let placed = |room| house.placed.iter().filter(|p| p.room == room && p.origin.role.is_furniture()).count();
    assert_eq!([placed(0), placed(1), placed(2)], [11, 6, 13]);
    assert_eq!(house.cameras.len(), 6);
}

/// /furniture/21 is a lounge chair; the record that repeats its uid would make a shelf of it.
#[test]
fn the_first_of_two_records_is_used() {
    let house = furnished();
    let all: Vec<&str> = house.house.furniture.iter().map(|record| record.uid.as_str()).collect();
    assert_eq!(all.len(), 33);
    assert_eq!(house.house.furniture[21].jid, jid(19));
    assert_eq!(pieces_of(house, LIBRARY, 19).len(), 1);
    // The magenta one repeats the floor's uid.
    assert_eq!(house.house.materials.len(), 13);
    assert!(matches!(architecture_color(house, 0), Some(ColorInput::Texture { .. })));
}

/// Sizes follow from the numbers in the files: the stool's are centimetres, the shelf has a shadow of six metres.
#[test]
fn models_have_their_size_in_metres() {
    let house = bare();
    let only = |number| {
        let all = pieces_of(house, LIBRARY, number);
        assert_eq!(all.len(), 1, "{number}");
        all[0]
    };
    let stool = size(&only(20).mesh);
    assert!(stool.max_element() < 0.6 && stool.min_element() > 0.3, "{stool}");
    let shelf = only(16);
    assert!(size(&shelf.mesh).max_element() < 2.5, "{}", size(&shelf.mesh));
    assert!(signed_volume(&shelf.mesh) > 0.0);
}

/// The painted shadow below the basket is left out. A mat in the floor's plane comes to lie on the floor, and the plate
/// below a sculpture, though as dark and as flat as a shadow, stays too.
#[test]
fn flat_bases_are_kept_unless_they_are_painted_shadows() {
    let of = |house: &'static FurnishedHouse, number| &pieces_of(house, LIBRARY, number)[0].mesh;
    let widest = |mesh: &TriangleMesh| size(mesh).x;
    let [with, without] = [of(bare(), 22), of(furnished(), 22)];
    assert!(widest(with) > 0.59 && widest(without) < 0.51, "{} {}", widest(with), widest(without));
    assert_eq!(with.triangles.len(), without.triangles.len() + 2);
    let mat = of(furnished(), 23);
    assert_eq!((mat.triangles.len(), bounds(mat).map(|corner| corner.y)), (2, [1e-4; 2]));
    let sculpture = of(furnished(), 24);
    assert_eq!(sculpture.triangles.len(), of(bare(), 24).triangles.len());
    let heights = (0..sculpture.triangles.len()).map(|triangle| sculpture.corners(triangle).map(|corner| corner.y));
    let flat: Vec<f32> = heights.filter(|y| y.iter().all(|v| *v == y[0] && *v < 1e-3)).map(|y| y[0]).collect();
    assert!(flat.len() > 2 && flat.iter().all(|y| (9e-5..3e-4).contains(y)), "{flat:?}");
}

/// Quads are split into fans: the side table, which is closed, still has the volume of its parts and faces outwards.
/// Shades of lamps are open and therefore have no volume.
#[test]
fn closed_models_look_outwards() {
    let house = bare();
    let mut seen = 0;
    for (placed, surface) in house.placed.iter().zip(&house.scene.surfaces) {
        let Some(PlacedModel { jid, .. }) = &placed.model else { continue };
        let has_flat_base = [22, 23, 24].map(self::jid).contains(jid);
        if placed.origin.role == (Role::LightFixture {}) || has_flat_base {
            continue;
        }
        let volume = signed_volume(&surface.mesh);
        assert!(volume > 1e-5, "{jid} {volume}");
        let box_volume = f64::from(size(&surface.mesh).element_product());
        assert!(volume < box_volume * 1.0001, "{jid} {volume} {box_volume}");
        seen += 1;
    }
    assert_eq!(seen, 24);
    let table = &pieces_of(house, LIBRARY, 18)[0].mesh;
    assert!(table.uvs.is_some() && table.normals.is_some() && table.triangles.len() > 20);
}

/// The picture on the library's wall is scaled by -1 along x. It has the same box as its unmirrored twin, mirrored
/// letters, the same front, and normals that agree with its triangles.
#[test]
fn a_mirrored_piece_is_mirrored_and_looks_outwards() {
    let disk = Disk::bare();
    let mut json = disk.json.clone();
    json["scene"]["room"][2]["children"][33]["scale"] = json!([1, 1, 1]);
    let straight = disk.furnish_json(&json).unwrap();
    let [one, other] = [bare(), &straight].map(|house| &pieces_of(house, LIBRARY, 8)[0].mesh);
    assert!((size(one) - size(other)).length() < 1e-5);
    assert!((signed_volume(one) - signed_volume(other)).abs() < 1e-5 && signed_volume(one) > 0.0);
    for mesh in [one, other] {
        let normals = mesh.normals.as_ref().unwrap();
        for (at, triangle) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = mesh.corners(at);
            assert!((b - a).cross(c - a).dot(normals[triangle[0] as usize]) > 0.0);
        }
    }
    // The direction of u along z is reversed: the picture faces west, so its own x is the room's z.
    assert!(slope_of_u(one) * slope_of_u(other) < 0.0);
}

/// Positive if u grows with z on the triangle with the largest area in uv.
fn slope_of_u(mesh: &TriangleMesh) -> f32 {
    let uvs = mesh.uvs.as_ref().unwrap();
    let largest = |t: &&[u32; 3]| {
        let [a, b, c] = t.map(|v| uvs[v as usize]);
        ((b - a).perp_dot(c - a).abs() * 1e6) as i64
    };
    let [a, b, c] = mesh.triangles.iter().max_by_key(largest).unwrap().map(|v| v as usize);
    let gradient = |p: usize, q: usize| (uvs[q].x - uvs[p].x) * (mesh.positions[q].z - mesh.positions[p].z);
    gradient(a, b) + gradient(b, c) + gradient(a, c)
}

/// children/24 is the bookcase, scaled by 1.3 in width and 0.9 in depth; it faces north, so its width is along x.
#[test]
fn uneven_scales_act_along_the_models_axes() {
    let disk = Disk::bare();
    let mut json = disk.json.clone();
    let child = json.pointer_mut("/scene/room/2/children/24").unwrap();
    let record = child["ref"].clone();
    child["scale"] = json!([1, 1, 1]);
    let record = json["furniture"].as_array().unwrap().iter().find(|r| r["uid"] == record).unwrap();
    let number: u32 = record["jid"].as_str().unwrap().rsplit('-').next().unwrap().parse().unwrap();
    let even = disk.furnish_json(&json).unwrap();
    let [uneven, even] = [bare(), &even].map(|house| size(&pieces_of(house, LIBRARY, number)[0].mesh));
    let ratio = uneven / even;
    assert!((ratio - Vec3::new(1.3, 1.0, 0.9)).length() < 1e-4, "{ratio}");
}

/// children/27: a quaternion of length 1.58 turns but does not stretch.
#[test]
fn quaternions_are_made_unit() {
    let house = bare();
    let child = house.house.rooms[LIBRARY].children.iter().find(|c| c.place.ends_with("/27")).unwrap();
    let turn = child.placement.rotation;
    assert!((turn.length() - 1.0).abs() < 1e-12);
    assert!((turn.y / turn.w - 1.0 / 3.0).abs() < 1e-12);
    let ChildKind::Furniture(record) = child.what else { panic!() };
    let number: u32 = house.house.furniture[record].jid.rsplit('-').next().unwrap().parse().unwrap();
    let mesh = &pieces_of(house, LIBRARY, number)[0].mesh;
    assert!(size(mesh).y < 1.5, "{}", size(mesh));
}

/// A piece with a truncated or missing picture is mid-grey; black, emitting .mtl files are ignored.
#[test]
fn materials_of_models_are_their_pictures() {
    let house = furnished();
    let color = |number: u32| {
        let name = jid(number);
        color_of(house.scene.materials.iter().find(|material| material.name == name).unwrap())
    };
    for number in [15, 21] {
        assert_eq!(*color(number), GREY, "{number}");
    }
    for number in (1..=14).chain(16..=20) {
        let name = format!("house/3D-FUTURE-model/{}/texture.png", jid(number));
        // Every other name belongs to the model's own file.
        assert_eq!(texture_name(house, color(number)), name);
        let texture = house.scene.textures.iter().find(|texture| texture.name == name).unwrap();
        assert_eq!(texture.sha256.as_ref().map(String::len), Some(64));
        assert!(house.files.hashes.contains(&(name, texture.sha256.clone().unwrap())));
    }
}

/// Materials of the architecture: the effects of `useColor`, `local`, "" and a missing folder; colours are decoded as
/// sRGB.
#[test]
fn materials_of_the_architecture_follow_the_rules() {
    let house = furnished();
    // 255, 244, 214 is 1, 0.9047, 0.6724 in linear light (IEC 61966-2-1, by hand); 8 is the light band's.
    let Some(ColorInput::Constant(band)) = architecture_color(house, 8) else { panic!() };
    for (found, by_hand) in band.iter().zip([1.0, 0.904_66, 0.672_44]) {
        assert!((found - by_hand).abs() < 2e-4, "{band:?}");
    }
    for plain in [5, 6, 7, 8, 10, 11, 12] {
        assert!(matches!(architecture_color(house, plain), Some(ColorInput::Constant(_))), "{plain}");
    }
    for textured in [0, 1, 2, 3, 4, 9] {
        let color = architecture_color(house, textured).unwrap();
        assert!(texture_name(house, color).starts_with("house/3D-FRONT-texture/"), "{textured}");
        let ColorInput::Texture { uv, .. } = color else { unreachable!() };
        assert_ne!(*uv, UvTransform::default());
        assert_eq!(*uv, house.house.materials[textured].uv);
    }
    // The material of the mesh that names none.
    let none = house.scene.materials.iter().find(|material| material.name == "none").unwrap();
    assert_eq!(*color_of(none), GREY);
}

/// Each rule alone. As in Trescope, colorMode takes precedence over useColor, and only if there is a texture.
#[test]
fn each_material_rule_alone() {
    let read = |change: Value| {
        let mut json = small_house();
        let own = json["material"][0].as_object_mut().unwrap();
        own.insert("jid".into(), "t".into());
        own.extend(change.as_object().unwrap().clone());
        let (house, findings) = read_house(&json);
        (house.unwrap().materials.remove(0), findings)
    };
    for (change, texture) in [
        (json!({}), Some("t")),
        (json!({"useColor": false}), Some("t")),
        (json!({"useColor": true}), None),
        (json!({"useColor": true, "colorMode": "texture"}), Some("t")),
        (json!({"useColor": false, "colorMode": "color"}), None),
        (json!({"jid": "local"}), None),
        (json!({"jid": ""}), None),
        (json!({"jid": null}), None),
        (json!({"texture": {"value": ""}}), Some("t")),
        (json!({"texture": ""}), Some("t")),
    ] {
        let (material, findings) = read(change.clone());
        assert_eq!((material.texture.as_deref(), findings.len()), (texture, 0), "{change}");
    }
    let (material, _) = read(json!({"UVTransform": [2, 0, 0.25, 0, -3, 0.5, 0, 0, 1]}));
    assert_eq!(material.uv, UvTransform([[2.0, 0.0, 0.25], [0.0, -3.0, 0.5]]));
    let (material, _) = read(json!({"color": [10, 20, 30]}));
    assert_eq!(material.color, Some([10.0, 20.0, 30.0]));
    for (bad, code) in [
        (json!({"UVTransform": [1, 2]}), "bad_uv_transform"),
        (json!({"UVTransform": [1e9, 0, 0, 0, 1, 0, 0, 0, 1]}), "bad_uv_transform"),
        (json!({"color": [1, 2]}), "bad_color"),
        (json!({"color": [0, 0, 256]}), "bad_color"),
        (json!({"color": [0.5, 0.4, 0.3, 1]}), "bad_color"),
        (json!({"color": "red"}), "bad_color"),
    ] {
        let (material, findings) = read(bad);
        assert_eq!((findings.len(), findings[0].code.as_str()), (1, code));
        assert_eq!((material.uv, material.color.is_none()), (UvTransform::default(), code == "bad_color"));
    }
}

/// Without the folder of textures the architecture has its colours, which one finding reports.
#[test]
fn textures_may_be_missing_altogether() {
    let disk = Disk::new();
    let house = furnish(&HouseFiles { textures: None, ..disk.files() }, &Limits::default()).unwrap();
    assert!(house.scene.textures.iter().all(|texture| texture.name.contains("3D-FUTURE-model")));
    let messages: Vec<&str> =
        house.findings.iter().filter(|f| f.code == "no_textures").map(|f| f.message.as_str()).collect();
    assert_eq!(messages, ["7 materials have a texture, but no folder of textures was given"]);
    assert_sound(&house);
    // The twin: with the folder there is no such finding.
    assert!(furnished().findings.iter().all(|finding| finding.code != "no_textures"));
}

/// The white of a material whose texture is lost is no statement, unless the maker has no textures at all.
#[test]
fn a_lost_texture_leaves_the_color_unstated() {
    let disk = Disk::new();
    let unstated_in = |house: &FurnishedHouse| {
        house.placed.iter().filter(|placed| placed.model.is_none() && !placed.origin.stated.base_color).count()
    };
    let unstated = |textures: Option<PathBuf>| {
        unstated_in(&furnish(&HouseFiles { textures, ..disk.files() }, &Limits::default()).unwrap())
    };
    let sound = unstated_in(furnished());
    assert!(unstated(None) <= sound);
    std::fs::create_dir(disk.files().root.join("house/empty")).unwrap();
    assert!(unstated(Some("house/empty".into())) > sound);
}

/// The linear map that takes one list of points to another, by least squares about their middles.
fn linear_map(from: &[Vec3], to: &[Vec3]) -> DMat3 {
    assert_eq!(from.len(), to.len());
    let middle = |all: &[Vec3]| all.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / all.len() as f64;
    let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
    let (from_middle, to_middle) = (middle(from), middle(to));
    let (mut cross, mut own) = (DMat3::ZERO, DMat3::ZERO);
    for (p, q) in from.iter().zip(to) {
        let (p, q) = (p.as_dvec3() - from_middle, q.as_dvec3() - to_middle);
        cross += outer(q, p);
        own += outer(p, p);
    }
    cross * own.inverse()
}

fn assert_near(a: DMat3, b: DMat3) {
    assert!((a - b).to_cols_array().iter().all(|v| v.abs() < 1e-4), "{a} {b}");
}

/// Quaternions are x, y, z, w and the scale is applied first; computed by hand. The rotation takes x to y, y to z, z to
/// x.
#[test]
fn world_is_translation_rotation_scale() {
    let record =
        json!({"ref": "f", "instanceid": "mesh/1", "pos": [1, 2, 3], "rot": [0.5, 0.5, 0.5, 0.5], "scale": [2, 3, 4]});
    let mut json = small_house();
    json["scene"]["room"][0]["children"][0] = record;
    let house = read_house(&json).0.unwrap();
    let placement = house.rooms[0].children[0].placement;
    let place = placement.matrix().transform_point3(DVec3::ONE);
    assert!((place - DVec3::new(5.0, 4.0, 6.0)).length() < 1e-12, "{place}");
    let place = placement.mirrored_matrix().transform_point3(DVec3::ONE);
    assert!((place - DVec3::new(5.0, 0.0, 6.0)).length() < 1e-12, "{place}");
    // Twin: x, y, z, w read as w, x, y, z, for a rotation where this matters.
    let turn = DQuat::from_xyzw(0.0, 0.6, 0.0, 0.8);
    let misread = DQuat::from_xyzw(0.6, 0.0, 0.8, 0.0);
    assert!((turn * DVec3::X - misread * DVec3::X).length() > 0.1);
}

/// BlenderProc's `Front3DLoader`, step by step in Blender's axes: location `.xzy`, a quarter turn back about x, x, y,
/// z, w read as w, x, y, z, the scale as it is.
#[test]
fn compat_is_blenderprocs_matrix() {
    let ours_in_blender = DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2);
    for angle in [-2.8_f64, -1.0, 0.0, 0.4, 1.6, 3.1] {
        let [x, y, z, w] = [0.0, (angle / 2.0).sin(), 0.0, (angle / 2.0).cos()];
        let (position, scale) = (DVec3::new(1.5, 0.2, -4.0), DVec3::new(2.0, 1.0, 3.0));
        let own = Placement { position, rotation: DQuat::from_xyzw(x, y, z, w), scale };
        // Its first number is read as w, its last as z.
        let misread = DQuat::from_xyzw(y, z, w, x);
        let turn = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2) * misread;
        let theirs = DMat4::from_scale_rotation_translation(scale, turn, DVec3::new(1.5, -4.0, 0.2));
        let mirror = DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
        let ours = ours_in_blender * mirror * own.mirrored_matrix();
        assert!(theirs.abs_diff_eq(ours, 1e-12), "{angle}: {theirs} {ours}");
        // Twin: without mirroring the piece, the matrix differs.
        assert!(!theirs.abs_diff_eq(ours_in_blender * mirror * own.matrix(), 0.1), "{angle}");
    }
}

/// The L-sofa stands with its back to the north in the living room. In the source's world its long seat is in the west;
/// under compat it is in the east of a room whose x is unchanged, which contradicts the architecture, as in
/// BlenderProc's pictures.
#[test]
fn compat_mirrors_the_architecture_and_not_the_sofa() {
    let (disk, normal, compat) = (Disk::bare(), bare(), compat());
    assert_sound(compat);
    let folder = SourceFolder::new(&disk.folder.path().join("house/3D-FUTURE-model"), 1 << 30).unwrap();
    let mut library = model::Library { folder, name: String::new() };
    let source = model::read(&jid(1), &mut library, &Limits::default(), &mut Log::new("h".into(), 10)).unwrap().mesh;
    let sofa = |house| &pieces_of(house, LIVING, 1)[0].mesh;
    let wall = |house: &'static FurnishedHouse| {
        let at = house.placed.iter().position(|p| p.room == LIVING && is_kind(p, "WallInner"));
        &house.scene.surfaces[at.unwrap()].mesh
    };

    // The sofa relative to its source: half a turn; with compat half a turn, M_z and the mirror of its own x.
    assert_near(
        linear_map(&source.positions, &sofa(normal).positions),
        DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0)),
    );
    assert_near(linear_map(&source.positions, &sofa(compat).positions), DMat3::IDENTITY);
    // The architecture: M_z.
    assert_near(
        linear_map(&wall(normal).positions, &wall(compat).positions),
        DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)),
    );
    // Both face outwards, and nothing else changed.
    let volumes = [sofa(normal), sofa(compat)].map(signed_volume);
    assert!((volumes[0] - volumes[1]).abs() < 1e-4 && volumes[0] > 0.0, "{volumes:?}");

    // The long seat is where the sofa extends far from the north wall; its x in the room is compared.
    let long_seat = |mesh: &TriangleMesh, south: f32| {
        let [low, high] = bounds(mesh);
        let front = if south > 0.0 { high.z } else { low.z };
        let at_front: Vec<f32> = mesh.positions.iter().filter(|p| (p.z - front).abs() < 0.3).map(|p| p.x).collect();
        at_front.iter().sum::<f32>() / at_front.len() as f32 - (low.x + high.x) / 2.0
    };
    // It faces north: its front is at the smallest z, and at the largest if mirrored.
    let (one, other) = (long_seat(sofa(normal), -1.0), long_seat(sofa(compat), 1.0));
    assert!(one < -0.5 && other > 0.5, "{one} {other}");
    assert!((one + other).abs() < 1e-3);
}

/// The designers' cameras are mirrored with the architecture, so that they see the same walls.
#[test]
fn compat_mirrors_cameras_too() {
    assert_eq!(compat().cameras.len(), 6);
    for (one, other) in bare().cameras.iter().zip(&compat().cameras) {
        assert_eq!(
            (one.position.x, one.position.y, one.position.z),
            (other.position.x, other.position.y, -other.position.z)
        );
        assert_eq!((one.target.z, one.fov_y_deg, one.number), (-other.target.z, other.fov_y_deg, other.number));
    }
}

/// Two negative factors are half a turn, three and one a mirror.
#[test]
fn only_mirrors_are_reported() {
    let disk = Disk::bare();
    for (scale, is_reported) in [(json!([-1, 1, -1]), false), (json!([-1, -1, -1]), true), (json!([1, 1, -1]), true)] {
        let mut json = disk.json.clone();
        json["scene"]["room"][2]["children"][33]["scale"] = scale.clone();
        let house = disk.furnish_json(&json).unwrap();
        assert_eq!(house.findings.iter().any(|f| f.code == "mirrored_piece"), is_reported, "{scale}");
        assert!(signed_volume(&pieces_of(&house, LIBRARY, 8)[0].mesh) > 0.0);
    }
}
