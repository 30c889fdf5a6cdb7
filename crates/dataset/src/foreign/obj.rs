//! Reads untrusted OBJ and MTL files with tobj, after a check of every index and count, since tobj panics where an
//! index overflows.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec3, Vec2, Vec3};
use mateval_files::untrusted::{hint, mistaken_for, without_mark};

use crate::TriangleMesh;
use mateval_files::untrusted::shortened;

/// Positions farther from the origin than this are not exact enough as 32-bit floats.
const NEAR: f64 = 1000.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjLimits {
    /// Most triangles, after polygons are split.
    pub triangles: usize,
    /// Most corners of faces, which bound the number of vertices.
    pub corners: usize,
}

/// Why an OBJ or MTL file was refused.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error("{}{fault}", line.map_or(String::new(), |line| format!("line {line}: ")))]
pub struct ObjError {
    /// The line, from 1; absent if no single line is to blame.
    pub line: Option<usize>,
    /// What was expected and what was found.
    pub fault: ObjFault,
}

/// What is wrong with an OBJ or MTL file.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum ObjFault {
    /// It is too large; the rest of it is not read.
    #[error(
        "more than {} triangles or {} corners, the rest of the scene's limit", .0.triangles, .0.corners
    )]
    TooLarge(ObjLimits),
    /// What was expected and what was found.
    #[error("{0}")]
    Invalid(String),
}

impl From<tobj::LoadError> for ObjError {
    fn from(error: tobj::LoadError) -> Self {
        Self { line: None, fault: ObjFault::Invalid(error.to_string()) }
    }
}

/// A run of triangles of one object or group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObjGroup {
    pub name: String,
    /// The name after `usemtl`; none without one, and under [`Materials::Ignored`].
    pub material: Option<String>,
    pub triangles: usize,
}

/// A mesh in the file's own space, and what was left out of it.
#[derive(Debug)]
pub struct ObjMesh {
    /// The triangles, group by group, relative to `base`. Where only some corners have a uv, that of the others is NaN.
    pub mesh: TriangleMesh,
    /// What has been subtracted from the positions: whole units where the first of them is more than 1000 from the
    /// origin, else nothing.
    pub base: DVec3,
    /// Its objects and groups in their order.
    pub groups: Vec<ObjGroup>,
    /// Corners without normals where others have them; their normals are NaN.
    pub corners_without_normal: usize,
    /// The colour of each vertex (`v x y z r g b`) as the file has it; empty where no vertex has one.
    pub colors: Vec<[f32; 3]>,
}

/// The properties of an MTL file's material that are read here.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObjMaterial {
    /// Its name, which `usemtl` refers to.
    pub name: String,
    /// `Kd`, linear.
    pub diffuse: Option<[f32; 3]>,
    /// `map_Kd`: a file name.
    pub diffuse_map: Option<String>,
    /// `Pr`.
    pub roughness: Option<f32>,
    /// `map_Pr`: a file name.
    pub roughness_map: Option<String>,
    /// `Pm`.
    pub metallic: Option<f32>,
    /// `map_Pm`: a file name.
    pub metallic_map: Option<String>,
    /// Whether and how it shines by itself.
    pub glow: Glow,
}

/// Whether a material shines by itself, where some tools put colours that they have baked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Glow {
    #[default]
    None,
    /// In one colour.
    Plain,
    /// By a texture.
    Textured,
}

/// Whether groups are split where their material changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Materials {
    /// Groups are not split, and none of them names a material.
    Ignored,
    /// Groups are split, so that each has one material.
    Split,
}

/// Counts of what a file defines and of what its faces refer to.
#[derive(Debug, Default)]
struct Census {
    positions: i64,
    uvs: i64,
    normals: i64,
    triangles: usize,
    corners: usize,
    corners_with_uv: usize,
    corners_with_normal: usize,
}

/// Reads an OBJ file: the faces of all groups as one mesh, with texture coordinates and normals. Polygons become fans
/// of triangles.
pub fn read(bytes: &[u8], limits: ObjLimits, materials: Materials) -> Result<ObjMesh, ObjError> {
    let text = text_of(bytes)?;
    let census = check(&text, limits)?;
    let base = base(&text);
    let text = if base == DVec3::ZERO { text } else { Cow::Owned(relative_to(&text, base)) };
    let missing = |with: usize| if with == 0 { 0 } else { census.corners - with };
    let (lacks_uv, without_normal) = (missing(census.corners_with_uv) > 0, missing(census.corners_with_normal));
    let read = if lacks_uv || without_normal > 0 {
        load(&with_all_indices(&text, lacks_uv, without_normal > 0), materials)?
    } else {
        load(&text, materials)?
    };
    Ok(ObjMesh { base, corners_without_normal: without_normal, ..read })
}

/// The position of a line `v x y z ...`; none of any other line.
fn position(line: &str) -> Option<DVec3> {
    let mut numbers = line.trim_start().strip_prefix("v ")?.split_whitespace().map_while(|word| word.parse().ok());
    Some(DVec3::new(numbers.next()?, numbers.next()?, numbers.next()?))
}

fn base(text: &str) -> DVec3 {
    let first = text.lines().find_map(position).filter(|first| first.is_finite());
    first.filter(|first| first.length() > NEAR).map_or(DVec3::ZERO, DVec3::round)
}

/// The text with all positions relative to `base`.
fn relative_to(text: &str, base: DVec3) -> String {
    let mut out = String::with_capacity(text.len());
    for line in text.lines() {
        match position(line) {
            Some(position) => {
                let [x, y, z] = (position - base).to_array();
                out.push_str(&format!("v {x} {y} {z}"));
                // Colours follow the position.
                for word in line.split_whitespace().skip(4) {
                    out.push(' ');
                    out.push_str(word);
                }
            }
            None => out.push_str(line),
        }
        out.push('\n');
    }
    out
}

/// The text without a byte order mark, whose lines end in LF or CRLF. Fails where the file is of another kind.
fn text_of(bytes: &[u8]) -> Result<Cow<'_, str>, ObjError> {
    match mistaken_for(bytes) {
        Some(_) if !bytes.is_empty() => {
            let what = format!("expected text of an OBJ or MTL file{}", hint(bytes));
            Err(ObjError { line: None, fault: ObjFault::Invalid(what) })
        }
        _ => {
            let text = with_line_ends(String::from_utf8_lossy(without_mark(bytes)));
            match decimal_comma(&text) {
                None => Ok(text),
                Some((line, word)) => {
                    let what = format!("expected numbers with a point, found '{}' with a comma", shortened(word));
                    Err(ObjError { line: Some(line), fault: ObjFault::Invalid(what) })
                }
            }
        }
    }
}

/// The first number that is written with a decimal comma, as programs do under some locales, and its line from 1.
fn decimal_comma(text: &str) -> Option<(usize, &str)> {
    const NUMBERS: [&str; 10] = ["v", "vt", "vn", "Kd", "Ks", "Ke", "Pr", "Pm", "Ns", "d"];
    let is_number = |word: &&str| word.contains(',') && word.replacen(',', ".", 1).parse::<f64>().is_ok();
    text.lines().enumerate().filter(|(_, line)| line.contains(',')).find_map(|(index, line)| {
        let mut words = line.split_whitespace();
        let has_numbers = NUMBERS.contains(&words.next()?);
        Some((index + 1, words.find(|word| has_numbers && is_number(word))?))
    })
}

/// The text with LF for every CR that ends a line alone, as old Mac OS writes them: `str::lines` and tobj would read
/// one line.
fn with_line_ends(text: Cow<'_, str>) -> Cow<'_, str> {
    let has_bare_cr = text.ends_with('\r') || text.as_bytes().windows(2).any(|two| two[0] == b'\r' && two[1] != b'\n');
    if has_bare_cr { Cow::Owned(text.replace("\r\n", "\n").replace('\r', "\n")) } else { text }
}

fn check(text: &str, limits: ObjLimits) -> Result<Census, ObjError> {
    let mut census = Census::default();
    for (index, line) in text.lines().enumerate() {
        let refused = |fault| ObjError { line: Some(index + 1), fault };
        check_line(line, &mut census).map_err(refused)?;
        if census.triangles > limits.triangles || census.corners > limits.corners {
            return Err(refused(ObjFault::TooLarge(limits)));
        }
    }
    Ok(census)
}

fn check_line(line: &str, census: &mut Census) -> Result<(), ObjFault> {
    let mut words = line.split_whitespace();
    match words.next() {
        Some("v") => census.positions += 1,
        Some("vt") => census.uvs += 1,
        Some("vn") => census.normals += 1,
        Some("f") => {
            let mut corners = 0;
            for corner in words {
                check_corner(corner, census)?;
                corners += 1;
            }
            if corners < 3 {
                let what = format!("expected a face of 3 or more corners, found {corners}");
                return Err(ObjFault::Invalid(what));
            }
            census.corners += corners;
            census.triangles += corners - 2;
        }
        _ => {}
    }
    Ok(())
}

/// Checks `position/uv/normal`, whose indices count from 1 or, if negative, from the end. uv and normal may be missing.
fn check_corner(corner: &str, census: &mut Census) -> Result<(), ObjFault> {
    let mut parts = corner.split('/');
    let mut index = |count: i64, what: &'static str, required: bool| match parts.next() {
        None | Some("") if !required => Ok(false),
        part => {
            let part = part.unwrap_or("");
            let refused = || format!("expected an index of a {what}, found '{}'", shortened(part));
            let number: i64 = part.parse().map_err(|_| ObjFault::Invalid(refused()))?;
            let place = if number < 0 { number.saturating_add(count).saturating_add(1) } else { number };
            if (1..=count).contains(&place) {
                Ok(true)
            } else {
                let what = format!("the index {number} of a {what} is out of range: {count} came before it");
                Err(ObjFault::Invalid(what))
            }
        }
    };
    index(census.positions, "position", true)?;
    census.corners_with_uv += usize::from(index(census.uvs, "texture coordinate", false)?);
    census.corners_with_normal += usize::from(index(census.normals, "normal", false)?);
    if parts.next().is_some() {
        let what = format!("expected position/uv/normal, found '{}'", shortened(corner));
        return Err(ObjFault::Invalid(what));
    }
    Ok(())
}

/// The text with a uv or normal at every corner: NaN where the file has none. The NaN stands before all others, so that
/// indices from the start grow by one.
fn with_all_indices(text: &str, add_uvs: bool, add_normals: bool) -> String {
    let mut out = String::with_capacity(text.len() + text.len() / 4);
    out.push_str(if add_uvs { "vt nan nan\n" } else { "" });
    out.push_str(if add_normals { "vn nan nan nan\n" } else { "" });
    for line in text.lines() {
        let mut words = line.split_whitespace();
        if words.next() != Some("f") {
            out.push_str(line);
            out.push('\n');
            continue;
        }
        out.push('f');
        for corner in words {
            let mut parts = corner.split('/');
            let position = parts.next().unwrap_or("");
            let mut index = |is_added: bool| match parts.next().unwrap_or("") {
                "" if is_added => "1".to_owned(),
                // Every index has been checked.
                own if is_added && !own.starts_with('-') => format!("{}", own.parse::<u64>().map_or(1, |at| at + 1)),
                own => own.to_owned(),
            };
            let (uv, normal) = (index(add_uvs), index(add_normals));
            out.push_str(format!(" {position}/{uv}/{normal}").trim_end_matches('/'));
        }
        out.push('\n');
    }
    out
}

/// The names of the material files that an OBJ file refers to.
pub fn material_files(bytes: &[u8]) -> Vec<String> {
    let text = with_line_ends(String::from_utf8_lossy(without_mark(bytes)));
    let names: BTreeSet<&str> = text.lines().filter_map(|line| named_after("mtllib", line)).collect();
    names.into_iter().map(str::to_owned).collect()
}

/// Reads an MTL file. Every number must be finite; a single number after `Kd` stands for all three.
pub fn read_materials(bytes: &[u8]) -> Result<Vec<ObjMaterial>, ObjError> {
    let text = text_of(bytes)?;
    let glows = glows(&text);
    let text = with_whole_colors(&text)?;
    let (materials, _) = tobj::load_mtl_buf(&mut text.as_bytes())?;
    let not_finite = |key: &str, material: &tobj::Material| {
        let what = format!("{key} of '{}': expected finite numbers", shortened(&material.name));
        ObjError { line: None, fault: ObjFault::Invalid(what) }
    };
    let number = |material: &tobj::Material, key: &'static str| {
        let Some(word) = material.unknown_param.get(key) else { return Ok(None) };
        let value = word.trim().parse::<f32>().ok().filter(|value| value.is_finite());
        value.map(Some).ok_or_else(|| not_finite(key, material))
    };
    let read = |material: tobj::Material| {
        if material.diffuse.is_some_and(|rgb| !rgb.iter().all(|v| v.is_finite())) {
            return Err(not_finite("Kd", &material));
        }
        let (roughness, metallic) = (number(&material, "Pr")?, number(&material, "Pm")?);
        let map = |key: &str| material.unknown_param.get(key).map(|name| name.trim().to_owned());
        let (roughness_map, metallic_map) = (map("map_Pr"), map("map_Pm"));
        let (name, diffuse, diffuse_map) = (material.name, material.diffuse, material.diffuse_texture);
        let glow = glows.get(&name).copied().unwrap_or_default();
        Ok(ObjMaterial { name, diffuse, diffuse_map, roughness, roughness_map, metallic, metallic_map, glow })
    };
    materials.into_iter().map(read).collect()
}

/// The materials of an MTL file that shine: by `Ke`, or by `map_Ke` or `map_Ka`, which viewers show without light.
fn glows(text: &str) -> BTreeMap<String, Glow> {
    let (mut all, mut name) = (BTreeMap::new(), String::new());
    for line in text.lines() {
        let is_lit = |word: &str| word.parse::<f32>().is_ok_and(|value| value != 0.0);
        if let Some(new) = named_after("newmtl", line) {
            name = new.to_owned();
        } else if ["map_Ke", "map_Ka"].iter().any(|key| named_after(key, line).is_some()) {
            all.insert(name.clone(), Glow::Textured);
        } else if named_after("Ke", line).is_some_and(|rest| rest.split_whitespace().any(is_lit)) {
            all.entry(name.clone()).or_insert(Glow::Plain);
        }
    }
    all
}

/// The text of an MTL file with three numbers after every `Kd` and without the other colours. The format allows one
/// number or three, tobj panics for one.
fn with_whole_colors(text: &str) -> Result<String, ObjError> {
    let mut out = String::with_capacity(text.len());
    for (at, line) in text.lines().enumerate() {
        let words: Vec<&str> = line.split_whitespace().take(4).collect();
        match words[..] {
            ["Ka" | "Ks" | "Ke", ..] => {}
            ["Kd", grey] => out.push_str(&format!("Kd {grey} {grey} {grey}")),
            ["Kd", ref rest @ ..] if rest.len() < 3 => {
                let fault = ObjFault::Invalid(format!("Kd: expected one number or three, found {}", rest.len()));
                return Err(ObjError { line: Some(at + 1), fault });
            }
            _ => out.push_str(line),
        }
        out.push('\n');
    }
    Ok(out)
}

fn load(text: &str, materials: Materials) -> Result<ObjMesh, ObjError> {
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    let names = match materials {
        Materials::Ignored => Vec::new(),
        Materials::Split => material_names(text),
    };
    // Material files are not opened here, since their names are untrusted. tobj keeps only names that a material file
    // defines, so it is given one file that defines all of them.
    let defined = |_: &std::path::Path| {
        let materials = names.iter().map(|name| tobj::Material { name: name.clone(), ..Default::default() }).collect();
        Ok((materials, names.iter().enumerate().map(|(at, name)| (name.clone(), at)).collect()))
    };
    let with_materials = (!names.is_empty()).then(|| format!("mtllib any\n{}", without_material_files(text)));
    let text = with_materials.as_deref().unwrap_or(text);
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, defined)?;
    let mut mesh = TriangleMesh { uvs: Some(Vec::new()), normals: Some(Vec::new()), ..Default::default() };
    let (mut groups, mut colors) = (Vec::new(), Vec::new());
    for model in models.iter().filter(|model| !model.mesh.indices.is_empty()) {
        append(&mut mesh, &model.mesh);
        colors.extend(model.mesh.vertex_color.as_chunks::<3>().0);
        let material = model.mesh.material_id.and_then(|at| names.get(at).cloned());
        groups.push(ObjGroup { name: model.name.clone(), material, triangles: model.mesh.indices.len() / 3 });
    }
    let count = mesh.positions.len();
    mesh.uvs = mesh.uvs.filter(|uvs| uvs.len() == count);
    mesh.normals = mesh.normals.filter(|normals| normals.len() == count);
    // tobj has the colours of a group where each of its vertices has one.
    colors.truncate(if colors.len() == count { count } else { 0 });
    Ok(ObjMesh { mesh, base: DVec3::ZERO, groups, colors, corners_without_normal: 0 })
}

fn without_material_files(text: &str) -> String {
    let mut kept = String::with_capacity(text.len());
    for line in text.lines().filter(|line| named_after("mtllib", line).is_none()) {
        kept.push_str(line);
        kept.push('\n');
    }
    kept
}

/// The rest of a line whose first word is `word`.
fn named_after<'a>(word: &str, line: &'a str) -> Option<&'a str> {
    let rest = line.trim().strip_prefix(word)?;
    rest.starts_with(char::is_whitespace).then(|| rest.trim())
}

/// The names after `usemtl`, without duplicates, sorted.
fn material_names(text: &str) -> Vec<String> {
    let names: BTreeSet<&str> = text.lines().filter_map(|line| named_after("usemtl", line)).collect();
    names.into_iter().map(str::to_owned).collect()
}

fn append(mesh: &mut TriangleMesh, group: &tobj::Mesh) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(group.positions.chunks_exact(3).map(Vec3::from_slice));
    mesh.triangles.extend(group.indices.chunks_exact(3).map(|t| [first + t[0], first + t[1], first + t[2]]));
    if let Some(uvs) = &mut mesh.uvs {
        uvs.extend(group.texcoords.chunks_exact(2).map(Vec2::from_slice));
    }
    if let Some(normals) = &mut mesh.normals {
        normals.extend(group.normals.chunks_exact(3).map(Vec3::from_slice));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: ObjLimits = ObjLimits { triangles: 100, corners: 300 };
    const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n";

    fn read_text(faces: &str) -> Result<ObjMesh, ObjError> {
        read(format!("{CORNERS}{faces}").as_bytes(), LIMITS, Materials::Ignored)
    }

    #[test]
    fn decimal_commas_are_named() {
        let refused = |text: &str| read(text.as_bytes(), LIMITS, Materials::Ignored).unwrap_err().to_string();
        let said = refused("# a, b\nv 0 0 0\nv 1,5 0 0\n");
        assert_eq!(said, "line 3: expected numbers with a point, found '1,5' with a comma");
        let materials = read_materials(b"newmtl a, 1,5\nKd 0,5 0,2 0,1\n").unwrap_err().to_string();
        assert!(materials.starts_with("line 2: ") && materials.contains("'0,5'"), "{materials}");
    }

    #[test]
    fn polygons_groups_and_negative_indices() {
        let read = read_text("g a\nf 1/1/1 2/2/1 3/3/1 4/4/1\nusemtl x\ng b\nf  -4/-4/-1 -3/-3/-1 -2/-2/-1\n").unwrap();
        let group = |name: &str, triangles| ObjGroup { name: name.to_owned(), material: None, triangles };
        assert_eq!(read.groups, [group("a", 2), group("b", 1)]);
        let mesh = read.mesh;
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (3, 7));
        assert_eq!(mesh.uvs.as_ref().map(Vec::len), Some(7));
        assert_eq!(mesh.corners(2), mesh.corners(0));
    }

    /// OBJ's origin of uv is the lower left corner, as ours.
    #[test]
    fn texture_coordinates_stay_as_they_are() {
        let mesh = read_text("f 1/1 2/2 3/3").unwrap().mesh;
        assert_eq!(mesh.uvs.unwrap()[2], Vec2::new(1.0, 1.0));
        assert!(mesh.normals.is_none());
    }

    #[test]
    fn faulty_indices_name_their_line() {
        for bad in [
            "f 1 2 5",
            "f 0 1 2",
            "f 1 2 -5",
            "f 1/5 2/1 3/1",
            "f 1//2 2//1 3//1",
            "f 1 2",
            "f 1 2 x",
            "f 1/1/1/1 2 3",
            "f 1 2 9223372036854775807",
            "f 1 2 -9223372036854775808",
            "f 1/9223372036854775807 2/1 3/1",
            "f 1 2 99999999999999999999999",
        ] {
            let fault = read_text(bad).unwrap_err();
            assert!(fault.line == Some(10) && !matches!(fault.fault, ObjFault::TooLarge(_)), "{bad}: {fault:?}");
        }
        // Twin.
        assert!(read_text("f 1 2 4").is_ok());
    }

    #[test]
    fn faces_without_uv_are_marked_and_others_keep_theirs() {
        for with_uv in ["f 1/1/1 2/2/1 3/3/1", "f -4/-4/-1 -3/-3/-1 -2/-2/-1"] {
            let read = read_text(&format!("{with_uv}\nf 1//1 3//1 4//1")).unwrap();
            assert_eq!((read.corners_without_normal, read.mesh.triangles.len()), (0, 2));
            let uvs = read.mesh.uvs.unwrap();
            assert_eq!(uvs[read.mesh.triangles[0][2] as usize], Vec2::ONE);
            let is_without = |vertex: &u32| uvs[*vertex as usize].is_nan();
            let marked: Vec<bool> = read.mesh.triangles.as_flattened().iter().map(is_without).collect();
            assert_eq!(marked, [false, false, false, true, true, true]);
            assert!(read.mesh.normals.unwrap().iter().all(|normal| *normal == Vec3::Z));
        }
        let read = read_text("f 1//1 2//1 3//1\nf 1 3 4").unwrap();
        assert_eq!((read.corners_without_normal, read.mesh.uvs), (3, None));
        let normals = read.mesh.normals.unwrap();
        assert!(read.mesh.triangles[1].iter().all(|vertex| normals[*vertex as usize].is_nan()));
    }

    #[test]
    fn far_positions_are_relative_to_whole_units() {
        let text = "v 448231.251 120.125 -354123.5 1 0 0\nv 448232.251 120.125 -354123.5 0 1 0\nv 448231.251 121.125 -354123.5 0 0 1\nf 1 2 3\n";
        let read = read(text.as_bytes(), LIMITS, Materials::Ignored).unwrap();
        assert_eq!(read.base, DVec3::new(448_231.0, 120.0, -354_124.0));
        assert_eq!((read.mesh.positions[1], read.colors[1]), (Vec3::new(1.251, 0.125, 0.5), [0.0, 1.0, 0.0]));
    }

    #[test]
    fn marks_are_skipped_colours_are_read_and_other_files_named() {
        let text = "\u{feff}v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n";
        let mesh = read(text.as_bytes(), LIMITS, Materials::Ignored).unwrap();
        assert_eq!((mesh.mesh.triangles.len(), mesh.colors[1]), (1, [0.0, 1.0, 0.0]));
        assert_eq!(read_materials("\u{feff}newmtl a\nKd 1 0 0\n".as_bytes()).unwrap()[0].name, "a");
        let other = read(b"\xff\xfev\0", LIMITS, Materials::Ignored).unwrap_err();
        assert!(other.to_string().contains("UTF-16"), "{other}");
    }

    #[test]
    fn all_line_ends_are_read() {
        let text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\n";
        for end in ["\n", "\r\n", "\r"] {
            let bytes = text.replace('\n', end).into_bytes();
            let read = read(&bytes, LIMITS, Materials::Split).unwrap();
            assert_eq!((read.mesh.triangles.len(), read.groups[0].material.as_deref()), (1, Some("x")), "{end:?}");
            assert_eq!(material_files(&bytes), ["a.mtl"], "{end:?}");
            let materials = read_materials(format!("newmtl x{end}Kd 1 0 0{end}newmtl y{end}").as_bytes()).unwrap();
            assert_eq!((materials.len(), materials[0].diffuse), (2, Some([1.0, 0.0, 0.0])), "{end:?}");
            let fault = read_bad(end);
            assert_eq!(fault.line, Some(3), "{end:?}");
        }
    }

    /// The fault of an index in line 3.
    fn read_bad(end: &str) -> ObjError {
        let text = format!("v 0 0 0{end}v 1 0 0{end}f 1 2 9{end}");
        read(text.as_bytes(), LIMITS, Materials::Ignored).unwrap_err()
    }

    #[test]
    fn too_many_triangles_are_refused_before_they_are_made() {
        let fault = read_text(&format!("f {}", "1 2 3 ".repeat(40))).unwrap_err();
        assert_eq!(fault.fault, ObjFault::TooLarge(LIMITS));
    }

    #[test]
    fn rubbish_is_a_fault_or_nothing() {
        assert!(read(b"v 1 2\nf 1 1 1", LIMITS, Materials::Ignored).is_err());
        assert!(read(b"v a b c", LIMITS, Materials::Ignored).is_err());
        assert!(read(b"\xff\x00 v", LIMITS, Materials::Ignored).unwrap().mesh.triangles.is_empty());
        assert!(read(b"", LIMITS, Materials::Ignored).unwrap().mesh.triangles.is_empty());
    }

    #[test]
    fn groups_name_their_materials_where_asked() {
        let text = format!("{CORNERS}g a\nusemtl x\nf 1 2 3\nusemtl y z\nf 1 3 4\nmtllib some where.mtl\nf 1 2 4\n");
        let read = read(text.as_bytes(), LIMITS, Materials::Split).unwrap();
        let named: Vec<_> = read.groups.iter().map(|group| (group.material.as_deref(), group.triangles)).collect();
        assert_eq!(named, [(Some("x"), 1), (Some("y z"), 2)]);
        assert_eq!(material_files(text.as_bytes()), ["some where.mtl"]);
    }

    #[test]
    fn materials_are_read() {
        let text = "newmtl x\nKd 0.1 0.2 0.3\nmap_Kd a b.png\nPr 0.4\nmap_Pm m.png\nnewmtl y\n";
        let read = read_materials(text.as_bytes()).unwrap();
        assert_eq!(read[0].diffuse, Some([0.1, 0.2, 0.3]));
        assert_eq!((read[0].diffuse_map.as_deref(), read[0].metallic_map.as_deref()), (Some("a b.png"), Some("m.png")));
        assert_eq!((read[0].roughness, read[0].metallic), (Some(0.4), None));
        assert_eq!(read[1], ObjMaterial { name: "y".to_owned(), ..Default::default() });
        for bad in ["newmtl x\nKd a b c", "newmtl x\nPr inf", "newmtl x\nPm -", "newmtl x\nKd nan 0 0"] {
            assert!(read_materials(bad.as_bytes()).is_err(), "{bad}");
        }
    }

    /// Found by fuzzing: tobj panics for fewer than three numbers.
    #[test]
    fn a_color_has_one_number_or_three() {
        let read = read_materials(b"newmtl x\nKa 1\nKs\nKe 1 2\nKd 0.25\n").unwrap();
        assert_eq!(read[0].diffuse, Some([0.25; 3]));
        for (bad, line) in [("newmtl x\nKd 0.1 0.2", 2), ("newmtl x\n\nKd", 3)] {
            assert_eq!(read_materials(bad.as_bytes()).unwrap_err().line, Some(line), "{bad}");
        }
    }
}
