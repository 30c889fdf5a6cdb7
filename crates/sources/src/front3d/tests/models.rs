//! Untrusted models: faulty OBJ files, ids that are paths, and the parts of a sound model.

use super::*;

const SOUND: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

/// The small house with a piece of the model `jid` on its floor.
fn with_piece(jid: &str) -> Value {
    let mut json = small_house();
    json["furniture"] = json!([{"uid": "p", "jid": jid, "valid": true}]);
    let children = json["scene"]["room"][0]["children"].as_array_mut().unwrap();
    children.push(json!({"ref": "p", "instanceid": "furniture/1", "pos": [2, 0, 2]}));
    json
}

fn furnished_with(jid: &str, obj: &[u8]) -> FurnishedHouse {
    let folder = tempfile::tempdir().unwrap();
    let files = lone_house(folder.path(), with_piece(jid).to_string().as_bytes());
    std::fs::create_dir(folder.path().join("models/x")).unwrap();
    std::fs::write(folder.path().join("models/x/raw_model.obj"), obj).unwrap();
    // Outside the models' folder, where no id may lead.
    std::fs::create_dir(folder.path().join("y")).unwrap();
    std::fs::write(folder.path().join("y/raw_model.obj"), SOUND).unwrap();
    let house = furnish(&files, &Limits::default()).unwrap();
    assert_sound(&house);
    house
}

fn pieces(house: &FurnishedHouse) -> Vec<&TriangleMesh> {
    let all = house.placed.iter().zip(&house.scene.surfaces);
    all.filter(|(placed, _)| placed.origin.role.is_furniture()).map(|(_, surface)| &surface.mesh).collect()
}

#[test]
fn faulty_models_are_findings() {
    for obj in [
        &b""[..],
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\n",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -99999999999999999999\n",
        b"v 0 0 0\nv 1e30 0 0\nv 0 1e30 0\nf 1 2 3\n",
        b"v 0 0 0\nv nan 0 0\nv 0 inf 0\nf 1 2 3\n",
        b"v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n",
        b"v a b c\nf 1 1 1\n",
        b"v 0 0\nf 1 1 1\n",
        b"g Shadow\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        b"\x89PNG\r\n\x1a\n\0\0\0\xff",
    ] {
        let house = furnished_with("x", obj);
        let text = String::from_utf8_lossy(obj).into_owned();
        assert!(pieces(&house).is_empty(), "{text:?}");
        let found = house.findings.iter().find(|finding| finding.code == "bad_model");
        assert_eq!(found.map(|finding| finding.file.as_str()), Some("models/x/raw_model.obj"), "{text:?}");
        assert_eq!(house.wanted_pieces, [1]);
    }
    // Twin.
    let house = furnished_with("x", SOUND.as_bytes());
    assert_eq!(pieces(&house).len(), 1);
    assert!(house.findings.iter().all(|finding| finding.code != "bad_model"));
}

/// One vertex that is far away does not cause the others' metres to be read as centimetres.
#[test]
fn a_wild_vertex_does_not_shrink_a_model() {
    for wild in ["1e30 0 0", "0 -1e20 0", "nan 0 0"] {
        let house = furnished_with("x", format!("{SOUND}v {wild}\nf 1 2 5\n").as_bytes());
        let [mesh] = pieces(&house)[..] else { panic!("{wild}") };
        assert!((size(mesh) - Vec3::ONE).length() < 1e-6, "{wild} {}", size(mesh));
        assert!(house.findings.iter().any(|finding| finding.code == "zero_area"), "{wild}");
    }
    // Twin: a model that is large as a whole is in centimetres.
    let large: String = SOUND
        .lines()
        .map(|line| {
            let line = if line.starts_with('v') { line.replace(" 1", " 100") } else { line.to_owned() };
            line + "\n"
        })
        .collect();
    let house = furnished_with("x", large.as_bytes());
    assert!((size(pieces(&house)[0]) - Vec3::ONE).length() < 1e-6);
}

#[test]
fn ids_are_no_paths() {
    let long = "x".repeat(100);
    for jid in ["../y", "../../etc", "/etc", "..", ".", "x/../../y", "x/", "C:x", "x\0", "\\\\y", "", "植物", &long] {
        let house = furnished_with(jid, SOUND.as_bytes());
        assert!(pieces(&house).is_empty(), "{jid:?}");
        assert!(house.findings.iter().any(|f| f.code == "bad_jid" && f.place == "/furniture/0/jid"), "{jid:?}");
        assert!(house.findings.iter().all(|f| !f.message.contains('\0') && f.message.len() < 500));
        let read: Vec<&str> = house.files.iter().map(|(file, _)| file.as_str()).collect();
        assert_eq!(read, ["h.json"], "{jid:?}");
    }
    let house = furnished_with("x", SOUND.as_bytes());
    assert!(house.files.iter().any(|(file, _)| file == "models/x/raw_model.obj"));
}

/// Ids of textures are as untrusted as those of models.
#[test]
fn ids_of_textures_are_no_paths() {
    for jid in ["../y", "/etc", "..", "x\0", "a/b"] {
        let mut json = small_house();
        json["material"][0]["jid"] = jid.into();
        let folder = tempfile::tempdir().unwrap();
        let files = lone_house(folder.path(), json.to_string().as_bytes());
        let house = furnish(&HouseFiles { textures: Some("models".into()), ..files }, &Limits::default()).unwrap();
        assert!(house.findings.iter().any(|f| f.code == "bad_jid" && f.place == "/material/0/jid"), "{jid:?}");
        assert_sound(&house);
    }
}

#[cfg(unix)]
#[test]
fn links_do_not_lead_out() {
    let folder = tempfile::tempdir().unwrap();
    let files = lone_house(folder.path(), with_piece("x").to_string().as_bytes());
    std::fs::create_dir(folder.path().join("y")).unwrap();
    std::fs::write(folder.path().join("y/raw_model.obj"), SOUND).unwrap();
    std::os::unix::fs::symlink(folder.path().join("y"), folder.path().join("models/x")).unwrap();
    let house = furnish(&files, &Limits::default()).unwrap();
    assert!(pieces(&house).is_empty());
    assert!(house.findings.iter().any(|f| f.code == "path_escapes"));
}

/// Two groups, of which the first has two components: three parts, the largest first.
#[test]
fn parts_are_the_connected_components_of_groups() {
    let quad = |x: f64, size: f64, first: usize| {
        let (a, b, c, d) = (first, first + 1, first + 2, first + 3);
        let corner = |u: f64, v: f64| format!("v {} {} 0\n", x + u * size, v * size);
        let corners: String = [corner(0., 0.), corner(1., 0.), corner(1., 1.), corner(0., 1.)].concat();
        (corners, format!("f {a} {b} {c} {d}\n"))
    };
    let quads = [quad(0.0, 0.5, 1), quad(2.0, 1.0, 5), quad(2.0, 1.0, 9)];
    let corners: String = quads.iter().map(|(corners, _)| corners.as_str()).collect();
    let obj = format!("{corners}g one\n{}{}g two\n{}", quads[0].1, quads[1].1, quads[2].1);
    let house = furnished_with("x", obj.as_bytes());
    let at = house.placed.iter().position(|placed| placed.origin.role.is_furniture()).unwrap();
    // Group two lies where the second quad of group one does, but is a separate part.
    assert_eq!(house.placed[at].origin.part_of_triangle.as_deref(), Some(&[2, 2, 0, 0, 1, 1][..]));
}
