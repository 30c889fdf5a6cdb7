//! Writes the models: for each a folder with `raw_model.obj`, `model.mtl` and `texture.png`, and `model_info.json`, which
//! lists them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use glam::DVec2;
use mateval_image::png_io::write_rgba_bytes;
use serde_json::{Value, json};

use super::models::Model;
use super::swatches::{self, Swatch};
use crate::files::{SampleError, create_folder, write_text};
use crate::solid::Solid;

/// Decimals of numbers in OBJ files, which are in metres.
const DECIMALS: usize = 5;

/// Writes a model's folder into `library`, without its texture.
pub(super) fn write_shape(library: &Path, model: &Model) -> Result<(), SampleError> {
    let folder = library.join(model.jid());
    create_folder(&folder)?;
    write_text(&folder.join("raw_model.obj"), &obj(model))?;
    write_text(&folder.join("model.mtl"), &mtl(model))
}

/// Writes a model's texture into its folder in `library`.
pub(super) fn write_picture(library: &Path, model: &Model) -> Result<(), SampleError> {
    let path = library.join(model.jid()).join("texture.png");
    Ok(write_rgba_bytes(&path, &swatches::picture(&model.swatches, model.side))?)
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
    let mut list: Value = models.iter().map(entry).collect();
    list.sort_all_objects();
    mateval_scene::json::to_text(&list)
}

/// The names of a model's OBJ groups, one for each part.
fn groups(model: &Model) -> Vec<String> {
    let (mut solids, mut glasses) = (0, 0);
    let name = |part: usize| {
        let (word, count) = if model.glass == Some(part) { ("glass", &mut glasses) } else { ("solid", &mut solids) };
        *count += 1;
        format!("{word}_{count:03}")
    };
    (0..model.parts.len()).map(name).collect()
}

/// Materials in 3ds Max's style, one for each group. As in the data, they do not describe the appearance; the texture
/// does.
fn mtl(model: &Model) -> String {
    let mut text = String::from("# made by MatEval, CC0 1.0\n");
    for group in groups(model) {
        // Writing to a String cannot fail.
        let _ = write!(
            text,
            "\nnewmtl {group}\n\tNs 10\n\tNi 1.5\n\td 1\n\tTr 0\n\tillum 2\n\tKa 0.588 0.588 0.588\n\
             \tKd 0.588 0.588 0.588\n\tKs 0 0 0\n\tTf 0 0 0\n\tKe 0 0 0\n\tmap_Kd ./texture.png\n"
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

    fn push(&self, text: &mut String, head: &str) {
        for row in &self.rows {
            text.push_str(head);
            for whole in row {
                let sign = if *whole < 0 { "-" } else { "" };
                let (units, rest) = (whole.abs() / 100_000, whole.abs() % 100_000);
                let _ = write!(text, " {sign}{units}.{rest:0DECIMALS$}");
            }
            text.push('\n');
        }
    }
}

/// The mesh as OBJ, in triangles.
fn obj(model: &Model) -> String {
    // Faces come first, since they collect the rows that they refer to.
    let (mut positions, mut uvs, mut normals) = Default::default();
    let mut faces = String::new();
    for ((part, group), field_uv) in model.parts.iter().zip(groups(model)).zip(field_uvs(model)) {
        let _ = write!(faces, "g {group}\nusemtl {group}\ns 1\n");
        push_faces(&mut faces, &part.1, field_uv, (&mut positions, &mut uvs, &mut normals));
    }
    // In the file the rows stand before the faces.
    let mut text = String::from("# made by MatEval, CC0 1.0\nmtllib ./model.mtl\n");
    positions.push(&mut text, "v");
    uvs.push(&mut text, "vt");
    normals.push(&mut text, "vn");
    text + &faces
}

/// Appends a solid's faces, each split into triangles.
fn push_faces(
    text: &mut String,
    solid: &Solid,
    field_uv: impl Fn(DVec2) -> DVec2,
    (positions, uvs, normals): (&mut Numbered<3>, &mut Numbered<2>, &mut Numbered<3>),
) {
    for face in &solid.faces {
        let corners: Vec<String> = face
            .iter()
            .map(|&i| {
                let p = positions.number(solid.positions[i].to_array());
                let uv = uvs.number(field_uv(solid.uvs[i]).to_array());
                format!("{p}/{uv}/{}", normals.number(solid.normals[i].to_array()))
            })
            .collect();
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
