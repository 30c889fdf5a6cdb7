//! Estimates of other methods: pictures of other proportions, NumPy files, encodings that authors do not state, and
//! `baseline encoding`, which names the encoding of the numbers.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mateval_image::exr_io::{self, Precision};
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{LinearRgb, Picture, png_io};
use serde_json::{Value, json};

use super::command::{Run, baseline, mateval, run};
use super::lifting::{ROOM, base_colors, truth};
use super::sample::{json, unrendered};

/// A folder with an adapter `a.toml`, whose keys are these beside the paths, and a picture `room.exr`.
fn estimate(above: &str, keys: &str, picture: &Picture<LinearRgb>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let adapter =
        format!("name = \"a\"\n{above}\n[base_color]\nfiles = [\"{{scene}}.npy\", \"{{scene}}.exr\"]\n{keys}\n");
    std::fs::write(folder.path().join("a.toml"), adapter).unwrap();
    exr_io::write_linear(&folder.path().join("room.exr"), picture, Precision::Float).unwrap();
    folder
}

fn nn(dataset: &Path, folder: &Path, adapter: &str, out: &Path) -> Run {
    run(baseline("nn", dataset, out).arg("--estimate").arg(folder).args(["--adapter", adapter]))
}

/// `baseline nn` with the folder's adapter `a.toml`.
fn lifted(dataset: &Path, folder: &tempfile::TempDir) -> PathBuf {
    let out = folder.path().join("out");
    nn(dataset, folder.path(), &folder.path().join("a.toml").to_string_lossy(), &out).ends_with(0);
    out
}

/// Share of the base colours' numbers that differ by more than 6 of 255.
fn apart(first: &Path, second: &Path) -> f64 {
    let (mut apart, mut count) = (0, 0);
    for ((name, a), (_, b)) in base_colors(first).iter().zip(&base_colors(second)) {
        assert!(a.same_size(b), "{name}");
        for (a, b) in a.pixels().as_flattened().iter().zip(b.pixels().as_flattened()) {
            apart += usize::from(a.abs_diff(*b) > 6);
            count += 1;
        }
    }
    apart as f64 / f64::from(count)
}

#[test]
fn other_proportions_are_placed_by_the_adapters_rule() {
    let linear = "encoding = \"linear\"";
    // A smooth picture, of which the rectangle from `left` to 1 - `left` is shown, in shares of the view's width.
    let shown = |width: usize, height: usize, left: f32| {
        Picture::from_fn(width, height, |x, y| {
            let u = left + (1.0 - 2.0 * left) * (x as f32 + 0.5) / width as f32;
            LinearRgb([0.1 + 0.8 * u, 0.1 + 0.8 * (y as f32 + 0.5) / height as f32, 0.5])
        })
    };
    let as_it_is = estimate("", linear, &shown(192, 144, 0.0));
    let as_it_is = (lifted(&ROOM, &as_it_is), as_it_is);
    // Stretched to a square, and the square in the middle of 96x72 pixels.
    let (stretched, cropped) = (shown(192, 192, 0.0), shown(144, 144, 12.0 / 96.0));
    for (picture, rule, other, most) in
        [(&stretched, "stretched", "centre_crop", 0.03), (&cropped, "centre_crop", "stretched", 0.2)]
    {
        let placed = |rule: &str| {
            let folder = estimate(&format!("placement = \"{rule}\""), linear, picture);
            apart(&lifted(&ROOM, &folder), &as_it_is.0)
        };
        let (right, wrong) = (placed(rule), placed(other));
        assert!(right < most, "{rule}: {right}");
        // Twin: by the other rule the colours lie elsewhere.
        assert!(wrong > right + 0.1, "{rule}: {right}, {other}: {wrong}");
    }
}

/// The bytes of a NumPy file.
fn npy(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    let padded = format!("{header:<117}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(118_u16.to_le_bytes());
    bytes.extend(padded.as_bytes());
    bytes.extend(data);
    bytes
}

#[test]
fn a_numpy_file_is_read_like_the_exr() {
    let picture = truth(unrendered());
    let folder = estimate("", "encoding = \"linear\"", &picture);
    let from_exr = base_colors(&lifted(unrendered(), &folder));
    std::fs::remove_dir_all(folder.path().join("out")).unwrap();
    let data: Vec<u8> = picture.pixels().iter().flat_map(|pixel| pixel.0).flat_map(f32::to_le_bytes).collect();
    let write = |bytes: Vec<u8>| std::fs::write(folder.path().join("room.npy"), bytes).unwrap();
    write(npy("<f4", "72, 96, 3", &data));
    assert!(from_exr == base_colors(&lifted(unrendered(), &folder)));
    // Bad input: the error names the file and what was expected.
    let refused = |bytes: Vec<u8>, reason: &str| {
        write(bytes);
        let adapter = folder.path().join("a.toml");
        nn(unrendered(), folder.path(), &adapter.to_string_lossy(), &folder.path().join("bad"))
            .ends_with(2)
            .says("room.npy")
            .says(reason);
    };
    refused(npy("<f4", "72, 96, 2", &data), "expected (rows, columns)");
    refused(npy("<i4", "72, 96, 3", &data), "astype('f4')");
    refused(npy("|O", "72, 96, 3", &data), "pickled objects are never read");
    refused(npy("<f4", "8192, 8192, 3", &data), "expected 805306368 bytes of numbers, found 82944");
    refused(npy("<f4", "99999, 99999", &data), "99999x99999 pixels; expected 1 to 16384 a side");
    let mut bad = data.clone();
    bad[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    refused(npy("<f4", "72, 96, 3", &bad), "expected finite numbers");
}

#[test]
fn encodings_that_authors_do_not_state_are_in_submission_json() {
    let folder = tempfile::tempdir().unwrap();
    let room = folder.path().join("room");
    std::fs::create_dir_all(&room).unwrap();
    let bytes = truth(unrendered()).map(|LinearRgb(rgb)| rgb.map(byte_from_unit));
    for name in ["000_albedo.png", "000_roughness.png", "000_metallic.png", "base_color.png"] {
        png_io::write_rgb_bytes(&room.join(name), &bytes).unwrap();
    }
    let [marked, plain] = ["marked", "plain"].map(|name| folder.path().join(name));
    nn(unrendered(), folder.path(), "mvinverse", &marked)
        .ends_with(0)
        .says("the adapter 'mvinverse' reads base_color as linear, roughness as linear, metallic as linear");
    let file = json(&marked.join("submission.json"));
    let expected = json!({ "base_color": "linear", "roughness": "linear", "metallic": "linear" });
    assert_eq!(file["assumed_encodings"], expected);
    let said = file["description"].as_str().unwrap();
    assert!(said.contains("its authors do not state the encoding of base_color, roughness, metallic"), "{said}");
    let lint = |out: &Path| run(mateval().args(["eval", "lint"]).arg(out).arg("--dataset").arg(unrendered()));
    let found = lint(&marked);
    assert!(!found.stdout.contains("assumed_encodings"), "{}", found.stdout);
    // Twin: the encodings of `plain` are stated, and another word is an error.
    nn(unrendered(), folder.path(), "plain", &plain)
        .ends_with(0)
        .says("the adapter 'plain' reads base_color as srgb, roughness as linear, metallic as linear");
    assert!(json(&plain.join("submission.json")).get("assumed_encodings").is_none());
    let wrong = file.to_string().replace("\"linear\"", "\"log\"");
    std::fs::write(marked.join("submission.json"), wrong).unwrap();
    lint(&marked).ends_with(1).prints("gamma22");
}

/// Runs `baseline encoding`, with more words, on the truth's albedo, whose numbers are `encode` of a linear value and
/// of the instance's number.
fn encoding(adapter_encoding: &str, encode: impl Fn(f32, u16) -> f32) -> impl Fn(&[&str]) -> Run {
    let ids = png_io::read_ids(&unrendered().join("scenes/room/views/input/instance.png")).unwrap();
    let albedo = truth(unrendered());
    let picture = Picture::from_fn(albedo.width(), albedo.height(), |x, y| {
        LinearRgb(albedo.get(x, y).0.map(|value| encode(value, ids.get(x, y))))
    });
    let folder = estimate("", &format!("encoding = \"{adapter_encoding}\""), &picture);
    move |words| {
        let mut command = mateval();
        command.args(["baseline", "encoding"]).arg(folder.path()).arg("--adapter").arg(folder.path().join("a.toml"));
        run(command.arg("--dataset").arg(unrendered()).args(words))
    }
}

/// The report of a run of `encoding`, which must end with the code.
fn report(encoding: &impl Fn(&[&str]) -> Run, code: i32) -> Value {
    serde_json::from_str(&encoding(&["--format", "json"]).ends_with(code).stdout).unwrap()
}

#[test]
fn the_encoding_of_numbers_is_named() {
    type Encode = fn(f32) -> f32;
    let cases: [(&str, Encode); 4] = [
        ("linear", |value| value),
        ("srgb", srgb_from_linear),
        ("gamma22", |value| libm::powf(value, 1.0 / 2.2)),
        ("log", |value| 1.0 + libm::logf(value.max(1e-4)) / 10.0),
    ];
    let mut texts = BTreeSet::new();
    for (name, encode) in cases {
        for adapter in ["linear", "srgb", "gamma22"] {
            // A free scale for each channel, and an error of each instance.
            let run = encoding(adapter, |value, id| encode(0.7 * value * (1.0 + f32::from(id % 3) / 400.0)));
            let is_right = adapter == name;
            let code = i32::from(!is_right);
            let report = report(&run, code);
            let map = &report["maps"][0];
            assert_eq!((&map["verdict"], &map["fits"]), (&json!("fits"), &json!([name])), "{report}");
            assert_eq!((report["agrees"].as_bool(), map["agrees"].as_bool()), (Some(is_right), Some(is_right)));
            let expected = match (is_right, name) {
                (true, _) => format!("base_color: the numbers fit {name}, as the adapter states"),
                (false, "log") => "base_color: the numbers fit a logarithm, which no adapter decodes".to_owned(),
                (false, _) => format!("base_color: the numbers fit {name}; write encoding = \"{name}\" in the adapter"),
            };
            // Every text once: it does not depend on the encoding that a wrong adapter states.
            if texts.insert(expected.clone()) {
                run(&[]).ends_with(code).prints(&expected);
            }
        }
    }
    assert_eq!(texts.len(), 7, "{texts:?}");
}

#[test]
fn encodings_that_cannot_be_distinguished_are_reported() {
    // Errors of a network: each instance is too bright or too dark by up to a factor of 2.
    let noise = |id: u16| libm::exp2f(2.0 * (f32::from(id.wrapping_mul(40503) >> 8) / 255.0) - 1.0);
    let run = encoding("srgb", |value, id| libm::powf((0.5 * value * noise(id)).clamp(0.0, 1.0), 1.0 / 2.2));
    let found = report(&run, 0);
    let map = &found["maps"][0];
    assert_eq!(map["verdict"], "undecided", "{found}");
    let fits = map["fits"].as_array().unwrap();
    assert!(fits.contains(&json!("srgb")) && fits.contains(&json!("gamma22")), "{found}");
    run(&[]).ends_with(0).prints("base_color: undecided: ").prints("(mean error 0.");
    // Numbers without any relation to the truth.
    let run = encoding("srgb", |_, id| f32::from(id.wrapping_mul(40503) >> 8) / 300.0);
    let found = report(&run, 1);
    assert_eq!(found["maps"][0]["verdict"], "unrelated", "{found}");
    run(&[]).ends_with(1).prints("do not follow the truth in any encoding; check `files`");
}

#[test]
fn a_folder_without_pictures_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let report = |path: &Path| {
        let mut command = mateval();
        run(command.args(["baseline", "encoding", "--adapter", "iid"]).arg(path).arg("--dataset").arg(unrendered()))
    };
    report(folder.path()).ends_with(2).says("room_albedo.png").says("run the method");
    report(&folder.path().join("none")).ends_with(2).says("does not exist");
}
