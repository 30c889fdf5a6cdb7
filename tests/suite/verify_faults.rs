//! `prep verify` accepts a sound dataset and names each of many planted faults.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_dataset::camera::Camera;
use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Normal, Picture, png_io};
use serde_json::Value;

use super::command::{Run, run, verify};
use super::planted::{Room, edit_json, rehash, roll};
use super::sample::{copied_dataset, dataset};

/// A fault and the finding that must report it.
struct Fault {
    /// Faults of one number are planted in one copy of the dataset.
    copy: usize,
    what: &'static str,
    /// Code and file of the finding.
    expected: (&'static str, &'static str),
    /// Damages the dataset in this folder.
    plant: fn(&Path),
}

fn fault(copy: usize, what: &'static str, code: &'static str, file: &'static str, plant: fn(&Path)) -> Fault {
    Fault { copy, what, expected: (code, file), plant }
}

fn findings(run: &Run) -> Vec<(String, String)> {
    let found: Value = serde_json::from_str(&run.stdout).unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let all = found["findings"].as_array().unwrap();
    all.iter().map(|finding| (text(&finding["code"]), text(&finding["file"]))).collect()
}

/// Plants the faults in one copy, with or without new hashes, and looks for the finding of each.
fn check(faults: &[&Fault], new_hashes: bool) {
    let copy = copied_dataset();
    faults.iter().for_each(|fault| (fault.plant)(copy.path()));
    if new_hashes {
        rehash(copy.path());
    }
    let verdict = run(&mut verify(copy.path())).ends_with(1);
    let found = findings(&verdict);
    for Fault { what, expected: (code, file), .. } in faults {
        assert!(found.iter().any(|(c, f)| c == code && f == file), "{what}: {code} {file} not in {found:?}");
    }
    if new_hashes {
        let of_hashes = ["changed_file", "missing_file", "unlisted_file", "wrong_manifest"];
        let planted: Vec<&str> = faults.iter().map(|fault| fault.what).collect();
        assert!(!found.iter().any(|(code, _)| of_hashes.contains(&code.as_str())), "{planted:?}: {found:?}");
    }
}

/// Checks `expected` faults, copy by copy. The faults of a copy have different findings, and the tables put no fault
/// where another one hides its finding or causes it too.
fn check_all(faults: &[Fault], new_hashes: bool, expected: usize) {
    assert_eq!(faults.len(), expected);
    let mut copies: BTreeMap<usize, Vec<&Fault>> = BTreeMap::new();
    for fault in faults {
        let of_copy = copies.entry(fault.copy).or_default();
        let is_own = of_copy.iter().all(|other| other.expected != fault.expected);
        assert!(is_own, "{}: another fault of its copy has the same finding", fault.what);
        of_copy.push(fault);
    }
    copies.values().for_each(|faults| check(faults, new_hashes));
}

/// The twin of all others: neither new hashes alone nor a missing ground truth are faults.
#[test]
fn sound_datasets_pass() {
    let passed = run(&mut verify(dataset())).ends_with(0);
    assert_eq!(findings(&passed), []);
    assert!(passed.stdout.contains("\"sound\": true"), "{}", passed.stdout);
    let copy = copied_dataset();
    rehash(copy.path());
    assert_eq!(findings(&run(&mut verify(copy.path())).ends_with(0)), []);
    std::fs::remove_dir_all(copy.path().join("scenes/room/ground_truth")).unwrap();
    rehash(copy.path());
    assert_eq!(findings(&run(&mut verify(copy.path())).ends_with(0)), []);
}

#[test]
fn hashes() {
    let faults = [
        fault(1, "a changed byte", "changed_file", "scenes/room/views/input/depth.exr", |root| {
            let path = Room::of(root).file("views/input/depth.exr");
            let mut bytes = std::fs::read(&path).unwrap();
            *bytes.last_mut().unwrap() ^= 1;
            std::fs::write(path, bytes).unwrap();
        }),
        fault(1, "a missing file", "missing_file", "scenes/room/views/up_left/part.png", |root| {
            std::fs::remove_file(Room::of(root).file("views/up_left/part.png")).unwrap()
        }),
        fault(1, "an unlisted file", "unlisted_file", "scenes/room/notes.txt", |root| {
            std::fs::write(Room::of(root).file("notes.txt"), "x").unwrap()
        }),
        fault(1, "a line removed from the manifest", "wrong_manifest", "dataset.json", |root| {
            let text = super::sample::manifest(root);
            std::fs::write(root.join("MANIFEST.sha256"), text.split_once('\n').unwrap().1).unwrap();
        }),
    ];
    check_all(&faults, false, 4);
}

/// An unreadable `scene.json` hides what else is wrong with its scene, but not with `targets.json`.
#[test]
fn json_files() {
    let faults = [
        fault(1, "a string for a number", "breaks_schema", "scenes/room/scene.json", |root| {
            Room::of(root).edit_scene(|scene| scene["exposure"] = Value::from("1"))
        }),
        fault(1, "an unknown key", "breaks_schema", "targets.json", |root| {
            edit_json(&root.join("targets.json"), |file| file["target"] = Value::from(1))
        }),
        fault(2, "another version with other keys", "wrong_format", "scenes/room/scene.json", |root| {
            Room::of(root).edit_scene(|scene| {
                scene["format"] = "mateval/9".into();
                scene["novelty"] = 1.into();
            });
        }),
        fault(2, "a target that names a missing view", "dangling_reference", "targets.json", |root| {
            edit_json(&root.join("targets.json"), |file| file["targets"][1]["view"] = "upside_down".into())
        }),
        fault(2, "a duplicate target", "duplicate_target", "targets.json", |root| {
            edit_json(&root.join("targets.json"), |file| {
                let targets = file["targets"].as_array_mut().unwrap();
                targets.push(targets[0].clone());
            });
        }),
    ];
    check_all(&faults, true, 5);
}

/// A picture of another size hides the other faults of its view's pictures.
#[test]
fn cameras() {
    let faults = [
        fault(1, "one view's camera rolled", "bad_camera", "scenes/room/scene.json", |root| {
            Room::of(root).edit_scene(|scene| roll(&mut scene["views"][1], 3.0))
        }),
        fault(1, "a picture of another size", "wrong_size", "scenes/room/views/input/valid.png", |root| {
            let path = Room::of(root).file("views/input/valid.png");
            png_io::write_mask(&path, &Picture::filled(96, 71, true)).unwrap();
        }),
        fault(
            2,
            "all cameras rolled together: each is still the turned input camera",
            "not_reprojected",
            "scenes/room/views/input/instance.png",
            |root| {
                Room::of(root).edit_scene(|scene| {
                    roll(&mut scene["views"][0], 3.0);
                    let input: Camera = serde_json::from_value(scene["views"][0]["camera"].clone()).unwrap();
                    for view in scene["views"].as_array_mut().unwrap() {
                        let turned = input.turned(view["x_deg"].as_f64().unwrap(), view["y_deg"].as_f64().unwrap());
                        view["camera"] = serde_json::to_value(turned).unwrap();
                    }
                });
            },
        ),
        fault(3, "a matrix that is not a rotation", "bad_camera", "scenes/room/scene.json", |root| {
            Room::of(root).edit_scene(|s| s["views"][0]["camera"]["world_from_camera"][0][0] = Value::from(2.0));
        }),
    ];
    check_all(&faults, true, 4);
}

/// Meshes that do not fit hide all pictures, and each other.
#[test]
fn meshes_and_parts() {
    let faults = [
        fault(1, "a uv outside the atlas", "bad_uv", "scenes/room/geometry/instances.glb", |root| {
            let instances = "geometry/instances.glb";
            Room::of(root).edit_glb(instances, "rug", "TEXCOORD_0", |at, uv| if at == 0 { 1.5 } else { uv });
        }),
        fault(1, "a vertex moved in one file", "bad_parts", "scenes/room/geometry/parts.glb", |root| {
            let moved = |at: usize, x: f32| if at == 0 { x + 0.1 } else { x };
            Room::of(root).edit_glb("geometry/instances.glb", "rug", "POSITION", moved);
        }),
        fault(
            2,
            "the rug moved in both files",
            "wrong_geometry",
            "scenes/room/ground_truth/reference/geometry.glb",
            |root| {
                let room = Room::of(root);
                let scene = super::sample::json(&room.file("scene.json"));
                let of_rug = |part: &&Value| part["instance"] == "rug";
                let raised = |at: usize, x: f32| if at % 3 == 1 { x + 0.1 } else { x };
                room.edit_glb("geometry/instances.glb", "rug", "POSITION", raised);
                for part in scene["parts"].as_array().unwrap().iter().filter(of_rug) {
                    room.edit_glb("geometry/parts.glb", part["id"].as_str().unwrap(), "POSITION", raised);
                }
            },
        ),
        fault(3, "instances in place of parts", "wrong_nodes", "scenes/room/geometry/parts.glb", |root| {
            let room = Room::of(root);
            std::fs::copy(room.file("geometry/instances.glb"), room.file("geometry/parts.glb")).unwrap();
        }),
        fault(3, "a part of an instance that does not exist", "dangling_reference", "scenes/room/scene.json", |root| {
            Room::of(root).edit_scene(|scene| scene["parts"][0]["instance"] = "nobody".into())
        }),
    ];
    check_all(&faults, true, 5);
}

/// The faults of a copy change different files, and none of them makes a picture unreadable that the finding of another
/// one needs.
#[test]
fn pictures() {
    let faults = [
        fault(1, "depth times 1.01", "not_reprojected", "scenes/room/views/up_right/depth.exr", |root| {
            let path = Room::of(root).file("views/up_right/depth.exr");
            let scaled = exr_io::read_scalar(&path).unwrap().map(|depth| depth * 1.01);
            exr_io::write_scalar(&path, &scaled, Precision::Float).unwrap();
        }),
        fault(1, "an instance beyond the list", "bad_id", "scenes/room/views/input/instance.png", |root| {
            Room::of(root).edit_ids("views/input/instance.png", |id| if id == 1 { 60_000 } else { id })
        }),
        fault(
            1,
            "unobserved pixels where nothing is valid",
            "bad_mask",
            "scenes/room/views/up_left/unobserved.png",
            |root| {
                let room = Room::of(root);
                let valid = png_io::read_mask(&room.file("views/up_left/valid.png")).unwrap();
                room.edit_mask("views/up_left/unobserved.png", |x, y, counts| counts || !valid.get(x, y));
            },
        ),
        fault(1, "normals that all point up", "not_reprojected", "scenes/room/views/input/normal.exr", |root| {
            let path = Room::of(root).file("views/input/normal.exr");
            let normals = exr_io::read_normal(&path).unwrap();
            let up = normals.map(|normal| if normal.0 == [0.0; 3] { normal } else { Normal([0.0, 1.0, 0.0]) });
            exr_io::write_normal(&path, &up, Precision::Half).unwrap();
        }),
        fault(1, "normals of length 0", "bad_normal", "scenes/room/views/down_left/normal.exr", |root| {
            let path = Room::of(root).file("views/down_left/normal.exr");
            let zero = exr_io::read_normal(&path).unwrap().map(|_| Normal::default());
            exr_io::write_normal(&path, &zero, Precision::Half).unwrap();
        }),
        fault(
            1,
            "a baked map of another size",
            "wrong_size",
            "scenes/room/ground_truth/materials/sofa/base_color.png",
            |root| {
                let path = Room::of(root).file("ground_truth/materials/sofa/base_color.png");
                png_io::write_rgb_bytes(&path, &Picture::filled(64, 64, [9; 3])).unwrap();
            },
        ),
        fault(
            1,
            "an albedo of another view",
            "not_reprojected",
            "scenes/room/ground_truth/views/input/albedo.exr",
            |root| {
                let other = Room::of(root).file("ground_truth/views/up_left/albedo.exr");
                std::fs::copy(other, Room::of(root).file("ground_truth/views/input/albedo.exr")).unwrap();
            },
        ),
        fault(1, "a metallic above one", "out_of_range", "scenes/room/ground_truth/views/input/metallic.exr", |root| {
            let path = Room::of(root).file("ground_truth/views/input/metallic.exr");
            let raised = exr_io::read_scalar(&path).unwrap().map(|value| value + 0.5);
            exr_io::write_scalar(&path, &raised, Precision::Float).unwrap();
        }),
        fault(1, "an input picture that is another view's", "wrong_input", "scenes/room/views/input/rgb.exr", |root| {
            let room = Room::of(root);
            let other = room.file("ground_truth/renders/builtin/up_left/rgb.exr");
            std::fs::copy(other, room.file("views/input/rgb.exr")).unwrap();
        }),
        fault(
            1,
            "a view that another device rendered",
            "mixed_devices",
            "scenes/room/ground_truth/renders/builtin/up_left/render.json",
            |root| {
                edit_json(&Room::of(root).file("ground_truth/renders/builtin/up_left/render.json"), |file| {
                    file["device"] = serde_json::json!({"kind": "cuda", "name": "a card", "driver": null});
                });
            },
        ),
        fault(
            1,
            "a missing render",
            "unreadable",
            "scenes/room/ground_truth/renders/builtin/down_right/rgb_b.exr",
            |root| {
                std::fs::remove_file(Room::of(root).file("ground_truth/renders/builtin/down_right/rgb_b.exr")).unwrap();
            },
        ),
        fault(2, "shuffled parts", "bad_id", "scenes/room/views/input/part.png", |root| {
            Room::of(root).edit_ids("views/input/part.png", |id| if id < 2 { id } else { id - 1 })
        }),
        fault(
            2,
            "unobserved pixels that the input view shows",
            "not_reprojected",
            "scenes/room/views/up_left/unobserved.png",
            |root| {
                let room = Room::of(root);
                let valid = png_io::read_mask(&room.file("views/up_left/valid.png")).unwrap();
                room.edit_mask("views/up_left/unobserved.png", |x, y, _| valid.get(x, y));
            },
        ),
        fault(2, "no valid pixel", "not_reprojected", "scenes/room/views/input/valid.png", |root| {
            Room::of(root).edit_mask("views/input/valid.png", |_, _, _| false)
        }),
        fault(
            3,
            "shuffled parts of one instance",
            "not_reprojected",
            "scenes/room/views/input/part.png",
            shuffle_the_sofa,
        ),
        fault(3, "no unobserved pixel", "not_reprojected", "scenes/room/views/up_left/unobserved.png", |root| {
            Room::of(root).edit_mask("views/up_left/unobserved.png", |_, _, _| false)
        }),
        fault(
            3,
            "an albedo that is not a number",
            "unreadable",
            "scenes/room/ground_truth/views/input/albedo.exr",
            |root| {
                let path = Room::of(root).file("ground_truth/views/input/albedo.exr");
                let mut albedo = exr_io::read_linear(&path).unwrap();
                albedo.set(5, 5, LinearRgb([f32::NAN; 3]));
                exr_io::write_linear(&path, &albedo, Precision::Float).unwrap();
            },
        ),
    ];
    check_all(&faults, true, 17);
}

/// Exchanges the ids of the sofa's parts in the input view.
fn shuffle_the_sofa(root: &Path) {
    let room = Room::of(root);
    let scene = super::sample::json(&room.file("scene.json"));
    let parts = scene["parts"].as_array().unwrap();
    let own = parts.iter().filter(|part| part["instance"] == "sofa");
    let ids: Vec<u16> = own.map(|part| part["index"].as_u64().unwrap() as u16).collect();
    assert!(ids.len() > 1, "the sofa has {} parts", ids.len());
    let next = |id: u16| ids.iter().position(|own| *own == id).map_or(id, |at| ids[(at + 1) % ids.len()]);
    room.edit_ids("views/input/part.png", next);
}
