//! Writes the models: for each a folder with `raw_model.obj`, `model.mtl` and `texture.png`, and `model_info.json`, which
//! lists them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use glam::DVec2;
use mateval_image::png_io::{write_grey_alpha_bytes, write_rgba_bytes};
use serde_json::{Value, json};

use super::models::{Model, Quirk};
use super::swatches::{self, Swatch};
use crate::SampleError;
use crate::solid::Solid;
use crate::text_file::write_text;

/// Decimals of numbers in OBJ files, which are in metres.
const DECIMALS: usize = 5;

/// Writes a model's folder into `library`, without its texture.
pub(super) fn write_shape(library: &Path, model: &Model) -> Result<(), SampleError> {
    let folder = library.join(model.jid());
    std::fs::create_dir_all(&folder).map_err(SampleError::io("create", &folder))?;
    write_text(&folder.join("raw_model.obj"), &obj(model))?;
    write_text(&folder.join("model.mtl"), &mtl(model))
}

/// Writes a model's texture into its folder in `library`.
pub(super) fn write_picture(library: &Path, model: &Model) -> Result<(), SampleError> {
    let path = library.join(model.jid()).join("texture.png");
    let picture = swatches::picture(&model.swatches, model.side);
    match model.quirk {
        Some(Quirk::NoTexture) => return Ok(()),
        Some(Quirk::GreyTexture) => write_grey_alpha_bytes(&path, &picture.map(|[r, _, _, a]| [r, a]))?,
        Some(Quirk::ClearTexture) => write_rgba_bytes(&path, &picture.map(|[r, g, b, _]| [r, g, b, 0]))?,
        _ => write_rgba_bytes(&path, &picture)?,
    }
    if model.quirk == Some(Quirk::TruncatedTexture) {
        let bytes = std::fs::read(&path).map_err(SampleError::io("read", &path))?;
        std::fs::write(&path, &bytes[..bytes.len() / 2]).map_err(SampleError::io("write", &path))?;
    }
    Ok(())
}

/// The text of `model_info.json`.
pub(super) fn info(models: &[Model]) -> String {
    let word = |word: &str| if word.is_empty() { Value::Null } else { word.into() };
    let entry = |model: &Model| {
        let [sup, category, style, theme, material] = model.info.map(word);
        json!({
            "model_id": model.jid(), "super-category": sup, "category": category, "style": style, "theme": theme,
            "material": material,
        })
    };
    // A model without a super-category is left out of the list.
    let mut list: Value = models.iter().filter(|model| !model.info[0].is_empty()).map(entry).collect();
    list.sort_all_objects();
    mateval_scene::json::to_text(&list)
}

/// The names of a model's OBJ groups, one for each part.
fn groups(model: &Model) -> Vec<String> {
    let last = model.parts.len() - 1;
    let (mut solids, mut glasses) = (0, 0);
    let name = |part: usize| {
        if part == last && model.quirk == Some(Quirk::Shadow) {
            return "Shadow_001".to_owned();
        }
        let (word, count) = if model.glass == Some(part) { ("glass", &mut glasses) } else { ("solid", &mut solids) };
        *count += 1;
        format!("{word}_{count:03}")
    };
    (0..model.parts.len()).map(name).collect()
}

/// Materials in 3ds Max's style, one for each group. As in the data, they do not describe the appearance; the texture
/// does.
fn mtl(model: &Model) -> String {
    let values = if model.quirk == Some(Quirk::MisleadingMtl) {
        "Ka 0 0 0\n\tKd 0 0 0\n\tKs 0 0 0\n\tTf 1 1 1\n\tKe 1 1 1"
    } else {
        "Ka 0.588 0.588 0.588\n\tKd 0.588 0.588 0.588\n\tKs 0 0 0\n\tTf 0 0 0\n\tKe 0 0 0"
    };
    let mut text = String::from("# made by MatEval, CC0 1.0\n");
    for group in groups(model) {
        // Writing to a String cannot fail.
        let _ = write!(
            text,
            "\nnewmtl {group}\n\tNs 10\n\tNi 1.5\n\td 1\n\tTr 0\n\tillum 2\n\t{values}\n\tmap_Kd ./texture.png\n"
        );
    }
    text
}

/// Rows of numbers, each stored once, and their line numbers.
#[derive(Default)]
struct Numbered<const N: usize> {
    seen: BTreeMap<[i64; N], usize>,
    rows: Vec<[i64; N]>,
}

impl<const N: usize> Numbered<N> {
    /// The line number, from 1, of the row with these values.
    fn number(&mut self, values: [f64; N]) -> usize {
        let whole = values.map(|value| (value * 1e5).round() as i64);
        *self.seen.entry(whole).or_insert_with(|| {
            self.rows.push(whole);
            self.rows.len()
        })
    }

    fn push(&self, text: &mut String, head: &str, tail: &str) {
        for row in &self.rows {
            text.push_str(head);
            for whole in row {
                let sign = if *whole < 0 { "-" } else { "" };
                let (units, rest) = (whole.abs() / 100_000, whole.abs() % 100_000);
                let _ = write!(text, " {sign}{units}.{rest:0DECIMALS$}");
            }
            text.push_str(tail);
        }
    }
}

/// The mesh as OBJ, in one of the two dialects found in the data.
fn obj(model: &Model) -> String {
    let other = model.quirk == Some(Quirk::OtherDialect);
    let scale = if model.quirk == Some(Quirk::Centimetres) { 100.0 } else { 1.0 };
    // Faces come first, since they collect the rows that they refer to.
    let (mut positions, mut uvs, mut normals) = Default::default();
    let mut faces = String::new();
    for ((part, group), field_uv) in model.parts.iter().zip(groups(model)).zip(field_uvs(model)) {
        let name = if other { String::new() } else { format!("usemtl {group}\ns 1\n") };
        let _ = write!(faces, "g {group}\n{name}");
        push_faces(&mut faces, &part.1, scale, other, field_uv, (&mut positions, &mut uvs, &mut normals));
    }
    // In the file the rows stand before the faces.
    let mut text = String::from("# made by MatEval, CC0 1.0\n");
    if !other {
        text.push_str("mtllib ./model.mtl\n");
    }
    positions.push(&mut text, if other { "v " } else { "v" }, "\n");
    uvs.push(&mut text, "vt", if other { " 0.00000\n" } else { "\n" });
    normals.push(&mut text, "vn", "\n");
    text.push_str(&faces);
    if other { text.replace('\n', "\r\n") } else { text }
}

/// Appends a solid's faces. The other dialect keeps quads; the usual one splits them into triangles.
fn push_faces(
    text: &mut String,
    solid: &Solid,
    scale: f64,
    other: bool,
    field_uv: impl Fn(DVec2) -> DVec2,
    (positions, uvs, normals): (&mut Numbered<3>, &mut Numbered<2>, &mut Numbered<3>),
) {
    for face in &solid.faces {
        let corners: Vec<String> = face
            .iter()
            .map(|&i| {
                let p = positions.number((solid.positions[i] * scale).to_array());
                let uv = uvs.number(field_uv(solid.uvs[i]).to_array());
                format!("{p}/{uv}/{}", normals.number(solid.normals[i].to_array()))
            })
            .collect();
        if other {
            let _ = writeln!(text, "f  {}", corners.join(" "));
            continue;
        }
        for pair in corners[1..].windows(2) {
            let _ = writeln!(text, "f {} {} {}", corners[0], pair[0], pair[1]);
        }
    }
}

/// For each part the map from its own texture coordinates into its field of the texture. Letters fill their field. All
/// parts of any other field share one scale, so that grain is as wide on small parts as on large ones.
fn field_uvs(model: &Model) -> Vec<impl Fn(DVec2) -> DVec2 + use<>> {
    let bounds = |solid: &Solid| {
        let low = solid.uvs.iter().fold(DVec2::MAX, |low, uv| low.min(*uv));
        (low, solid.uvs.iter().fold(DVec2::MIN, |high, uv| high.max(*uv)) - low)
    };
    let largest = |field: usize| {
        let parts = model.parts.iter().filter(|(other, _)| *other == field);
        parts.fold(0.0_f64, |most, (_, solid)| most.max(bounds(solid).1.max_element()))
    };
    let into_field = |(field, solid): &(usize, Solid)| {
        let (low, size) = bounds(solid);
        let letters = matches!(model.swatches[*field], Swatch::Text { .. });
        let span = if letters { size } else { DVec2::splat(largest(*field)) };
        let (corner, width) = swatches::field(*field, model.side);
        move |uv: DVec2| DVec2::from(corner) + (uv - low) / span * width
    };
    model.parts.iter().map(into_field).collect()
}
