//! 3D-FUTURE models: a model's mesh in metres, without painted shadows, and its parts; its categories and material from
//! `model_info.json`, and guesses for models that it does not list. What had to be repaired is reported.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat4, DVec3, Vec2, Vec3};
use mateval_dataset::dataset::SUPER_CATEGORIES;
use mateval_dataset::material::MaterialClass;
use mateval_dataset::mesh::bounds;
use mateval_dataset::obj::{self, Materials, ObjFault, ObjLimits, ObjMesh};
use mateval_dataset::{Severity, TriangleMesh};
use mateval_files::source_folder::{LookedFor, SourceFolder};
use mateval_files::untrusted::shortened;
use mateval_image::texture_io::{Encoding, read_with_alpha};
use mateval_image::{Texture, Wrap};
use serde_json::Value;

use super::document::{Limits, kind, parse_any, text};
use super::house::FurnitureRecord;
use super::material_class::{Finish, class_of_group};
use crate::log::Log;
use crate::surface_mesh::{has_area, labelled_parts, to_world};

/// A model larger than this is taken to be in centimetres, since no furniture is ten metres long.
const LARGEST_M: f32 = 10.0;

/// A model in object space: metres, +y up, origin on the floor under its middle.
#[derive(Clone, Debug)]
pub(super) struct Model {
    pub(super) mesh: Arc<TriangleMesh>,
    /// The part of each triangle. Parts are the connected components of each group.
    pub(super) part_of_triangle: Vec<usize>,
    /// The OBJ group of each triangle, as an index in `groups`.
    group_of_triangle: Vec<usize>,
    groups: Vec<String>,
    /// The classes of material, where [`Self::classified`] has found them.
    pub(super) finish: Option<Finish>,
}

impl Model {
    /// The model with the classes of its groups, where `class` is that of the model as a whole.
    pub(super) fn classified(mut self, class: MaterialClass, file: &str, log: &mut Log) -> Self {
        let of_groups: Vec<MaterialClass> = self.groups.iter().map(|name| class_of_group(name, class)).collect();
        let of_triangles: Vec<MaterialClass> = self.group_of_triangle.iter().map(|group| of_groups[*group]).collect();
        let mut mesh = (*self.mesh).clone();
        let finish = Finish::laid_out(&mut mesh, &of_triangles, &self.part_of_triangle).unwrap_or_else(|| {
            let message = "the texture coordinates spread too far for the classes of groups".to_owned();
            log.push(Severity::Note, "spread_uv", file, "", message, "gave all groups the class of the model");
            Finish::uniform(class, &self.part_of_triangle)
        });
        self.mesh = Arc::new(mesh);
        self.finish = Some(finish);
        self
    }
}

/// A folder of models or textures, and its name in findings and lists of files.
#[derive(Debug)]
pub(super) struct Library {
    pub(super) folder: SourceFolder,
    /// The folder's path as the recipe gives it.
    pub(super) name: String,
}

impl Library {
    /// The path of a file in it, as findings and lists of files give it.
    pub(super) fn shown(&self, relative: &str) -> String {
        if self.name.is_empty() { relative.to_owned() } else { format!("{}/{relative}", self.name) }
    }

    /// Every file that was looked for in it, with paths as [`Self::shown`] gives them.
    pub(super) fn into_files(self) -> LookedFor {
        let name = self.name;
        self.folder.into_files().renamed(|file| if name.is_empty() { file } else { format!("{name}/{file}") })
    }
}

/// Whether an id is safe as the name of a folder. Ids of the data are UUIDs.
pub(super) fn is_folder_name(id: &str) -> bool {
    (1..=64).contains(&id.len()) && id.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'-' | b'_'))
}

/// Reads `<jid>/raw_model.obj`. None, with a finding, where it has no usable mesh.
pub(super) fn read(jid: &str, library: &mut Library, limits: &Limits, log: &mut Log) -> Option<Model> {
    let relative = format!("{jid}/raw_model.obj");
    let file = library.shown(&relative);
    let mut warn = |code: &str, place: &str, message: String, action: &str| {
        log.push(Severity::Warning, code, &file, place, message, action);
    };
    // The file, then the OBJ in it; a fault of either is reported at its line.
    let bytes = match library.folder.read(&relative) {
        Ok(bytes) => bytes,
        Err(fault) => {
            let code = if fault.code == "missing_file" { "missing_model" } else { fault.code };
            warn(code, "", fault.message, "left its pieces out");
            return None;
        }
    };
    let limit = ObjLimits { triangles: limits.triangles, corners: 3 * limits.triangles };
    let read = match obj::read(&bytes, limit, Materials::Ignored) {
        Ok(read) => read,
        Err(error) => {
            let place = error.line.map_or(String::new(), |line| format!("line {line}"));
            let code = if matches!(error.fault, ObjFault::TooLarge(_)) { "limit" } else { "bad_model" };
            warn(code, &place, error.fault.to_string(), "left its pieces out");
            return None;
        }
    };
    if read.corners_without_normal > 0 {
        let message = format!("{} corners have no normals", read.corners_without_normal);
        warn("mixed_faces", "", message, "computed them from the adjacent faces");
    }
    let names: Vec<String> = read.groups.iter().map(|group| group.name.clone()).collect();
    // What is kept of it, in metres.
    let base = read.base;
    let (mesh, group_of_triangle) = without_shadows(read, &file, log);
    let Some((mesh, groups)) = in_metres(mesh, base, group_of_triangle, &file, log) else {
        let message = "expected a triangle with an area, found none";
        log.push(Severity::Warning, "bad_model", &file, "", message, "left its pieces out");
        return None;
    };
    let (mesh, groups) = without_painted_shadow(mesh, groups, &format!("{jid}/texture.png"), library, &file, log);
    let part_of_triangle = labelled_parts(&mesh, &groups);
    Some(Model { part_of_triangle, mesh: Arc::new(mesh), group_of_triangle: groups, groups: names, finish: None })
}

/// Drops groups named after a shadow: flat pictures on the floor that falsify a model's size (3D-FRONT-ToolBox issue
/// 7). Returns the group of each remaining triangle too.
fn without_shadows(read: ObjMesh, file: &str, log: &mut Log) -> (TriangleMesh, Vec<usize>) {
    let ObjMesh { mut mesh, groups, .. } = read;
    let (mut triangles, mut kept, mut first) = (Vec::new(), Vec::new(), 0);
    for (at, group) in groups.iter().enumerate() {
        let (name, count) = (&group.name, group.triangles);
        let own = &mesh.triangles[first..first + count];
        first += count;
        if name.to_lowercase().contains("shadow") {
            let place = format!("group '{}'", shortened(name));
            log.push(Severity::Note, "shadow_group", file, &place, "a painted shadow", "left it out");
        } else {
            triangles.extend_from_slice(own);
            kept.extend(std::iter::repeat_n(at, count));
        }
    }
    mesh.triangles = triangles;
    (mesh, kept)
}

/// Drops the shadow that is painted under a model, whatever its group is called.
fn without_painted_shadow(
    mesh: TriangleMesh,
    groups: Vec<usize>,
    texture: &str,
    library: &mut Library,
    file: &str,
    log: &mut Log,
) -> (TriangleMesh, Vec<usize>) {
    if !may_have_drop_shadow(&mesh) {
        return (mesh, groups);
    }
    // A texture that cannot be read is reported when the material is made.
    let path = library.folder.path(texture).ok();
    let read = path.and_then(|path| read_with_alpha(&path, Encoding::Linear, Wrap::Repeat).ok());
    let Some((texels, Some(opacity))) = read else { return (mesh, groups) };
    let shadow = drop_shadow(&mesh, &texels, &opacity);
    if shadow.is_empty() {
        return (mesh, groups);
    }
    let is_kept = |triangle: usize| shadow.binary_search(&triangle).is_err();
    let area: f64 = mesh.picked(|triangle| !is_kept(triangle)).area();
    let message = format!("{} black, translucent triangles of {area:.2} m2 below it: a painted shadow", shadow.len());
    log.push(Severity::Note, "drop_shadow", file, "", message, "left them out");
    let groups =
        groups.iter().enumerate().filter(|(triangle, _)| is_kept(*triangle)).map(|(_, group)| *group).collect();
    (mesh.picked(is_kept), groups)
}

/// Drops triangles that are not finite or have no area, and scales a model in centimetres. Returns the group of each
/// remaining triangle too. The positions are relative to `base`.
fn in_metres(
    mesh: TriangleMesh,
    base: DVec3,
    groups: Vec<usize>,
    file: &str,
    log: &mut Log,
) -> Option<(TriangleMesh, Vec<usize>)> {
    // Triangles without area go first, and their group numbers with them.
    let sound: Vec<bool> = (0..mesh.triangles.len()).map(|t| has_area(mesh.corners(t))).collect();
    let dropped = sound.iter().filter(|sound| !**sound).count();
    if dropped > 0 {
        let message = format!("{dropped} of {} triangles have no area or are not finite", sound.len());
        log.push(Severity::Note, "zero_area", file, "", message, "left them out");
    }
    let pick = |all: &[[u32; 3]]| all.iter().zip(&sound).filter(|(_, s)| **s).map(|(t, _)| *t).collect();
    let groups: Vec<usize> = groups.iter().zip(&sound).filter(|(_, sound)| **sound).map(|(g, _)| *g).collect();
    let mesh = TriangleMesh { triangles: pick(&mesh.triangles), ..mesh };
    // The scale follows from the size of the remaining triangles.
    let size = longest_side(&mesh);
    let centimetres = size > LARGEST_M;
    if centimetres {
        let message = format!("read in metres, the model is {size:.1} m long");
        log.push(Severity::Note, "centimetres", file, "", message, "read its numbers as centimetres");
    }
    let scale = if centimetres { 0.01 } else { 1.0 };
    let metres_from_file = DMat4::from_scale(DVec3::splat(scale));
    let matrix = if base == DVec3::ZERO { metres_from_file } else { metres_from_file * DMat4::from_translation(base) };
    let (mesh, repairs) = to_world(mesh, matrix, false);
    if repairs.normals > 0 {
        let message = format!("{} normals are zero or not finite", repairs.normals);
        log.push(Severity::Note, "bad_normals", file, "", message, "computed new normals");
    }
    if mesh.triangles.is_empty() || mesh.triangles.len() != groups.len() {
        return None;
    }
    Some((mesh, groups))
}

/// The longest side of the bounding box of all triangles, in the file's unit.
fn longest_side(mesh: &TriangleMesh) -> f32 {
    let corners = mesh.triangles.iter().flatten().map(|v| mesh.positions[*v as usize]).filter(|p| p.is_finite());
    bounds(corners).map_or(0.0, |[low, high]| (high - low).max_element())
}

/// The largest height above the model's lowest point, in metres. Models stand on y = 0 to within 4 mm, and their
/// shadows are lower than all else.
const LEVEL_M: f32 = 1e-3;
/// The smallest share of the footprint of everything else that the shadow covers. Shadows of the data cover all of it,
/// and feet a tenth.
const LEAST_COVER: f64 = 0.5;
/// Texels with no larger value in any channel, of 0 to 1 in the file, are black. Those of the data are 0.
const BLACK: f32 = 4.0 / 255.0;
/// Texels with no larger opacity are translucent. Those of the data have up to 193 of 255.
const TRANSLUCENT: f32 = 200.0 / 255.0;
/// The least mean opacity. Texels without any are an unused part of the texture, or a texture whose opacity says
/// nothing.
const LEAST_OPACITY: f32 = 1.0 / 255.0;
/// The share of places that must be black and translucent; the others may lie on the border of a neighbouring field.
const LEAST_SHARE: f32 = 0.95;
/// Places looked at on each side of a triangle.
const PLACES: usize = 32;

/// The triangles of `mesh`, in metres with +y up, that are a painted shadow; none in most models.
///
/// Of the models of later releases 11 % contain a few horizontal triangles at their lowest height, across the whole
/// footprint, whose texels are black and translucent: a picture of a shadow. Placed on a floor they lie in it exactly.
/// Read as a surface, they are a black sheet, or speckles, depending on the renderer.
///
/// `texels` holds the colours of the model's texture as its file states them, 0 to 1, and `opacity` its opacity.
fn drop_shadow(mesh: &TriangleMesh, texels: &Texture, opacity: &Texture) -> Vec<usize> {
    let Some(uvs) = &mesh.uvs else { return Vec::new() };
    let candidates = candidates(mesh);
    let is_shadow = |triangle: &usize| {
        let corners = mesh.triangles[*triangle].map(|vertex| uvs[vertex as usize]);
        is_painted_shadow(corners, texels, opacity)
    };
    let shadow: Vec<usize> = candidates.into_iter().filter(is_shadow).collect();
    if covers(mesh, &shadow) { shadow } else { Vec::new() }
}

/// Whether a model has flat triangles at its lowest height that could be a shadow, whatever its texture shows.
fn may_have_drop_shadow(mesh: &TriangleMesh) -> bool {
    mesh.uvs.is_some() && covers(mesh, &candidates(mesh))
}

/// The horizontal triangles at the model's lowest height.
fn candidates(mesh: &TriangleMesh) -> Vec<usize> {
    let all = || (0..mesh.triangles.len()).map(|triangle| (triangle, mesh.corners(triangle)));
    let lowest = all().flat_map(|(_, corners)| corners).fold(f32::INFINITY, |low, corner| low.min(corner.y));
    let is_lowest = |corners: &[Vec3; 3]| corners.iter().all(|corner| corner.y <= lowest + LEVEL_M);
    all().filter(|(_, corners)| is_lowest(corners)).map(|(triangle, _)| triangle).collect()
}

/// Whether these triangles, seen from above, cover enough of the footprint of all others.
fn covers(mesh: &TriangleMesh, chosen: &[usize]) -> bool {
    let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    // Both are sorted.
    let others = (0..mesh.triangles.len()).filter(|triangle| chosen.binary_search(triangle).is_err());
    for corner in others.flat_map(|triangle| mesh.corners(triangle)) {
        let place = Vec2::new(corner.x, corner.z);
        (low, high) = (low.min(place), high.max(place));
    }
    let size = (high - low).as_dvec2();
    let area = |triangle: &usize| {
        let [a, b, c] = mesh.corners(*triangle).map(|corner| Vec2::new(corner.x, corner.z).as_dvec2());
        ((b - a).perp_dot(c - a) / 2.0).abs()
    };
    // A model of nothing but flat triangles has no footprint, and no shadow.
    size.is_finite() && chosen.iter().map(area).sum::<f64>() >= LEAST_COVER * size.x * size.y && !chosen.is_empty()
}

/// Whether the texels below a triangle are a picture of a shadow.
fn is_painted_shadow([a, b, c]: [Vec2; 3], texels: &Texture, opacity: &Texture) -> bool {
    let (mut shadowy, mut places, mut sum) = (0, 0, 0.0);
    for row in 0..PLACES {
        for column in 0..PLACES - row {
            let along = |step: usize| (step as f32 + 1.0 / 3.0) / PLACES as f32;
            let uv = a + (b - a) * along(column) + (c - a) * along(row);
            let [color, [alpha, ..]] = [texels, opacity].map(|texture| nearest(texture, uv));
            shadowy += usize::from(color.iter().all(|v| *v <= BLACK) && alpha <= TRANSLUCENT);
            sum += alpha;
            places += 1;
        }
    }
    let places = places as f32;
    shadowy as f32 >= LEAST_SHARE * places && sum >= LEAST_OPACITY * places
}

/// The texel at a place of a texture that repeats, v upwards.
fn nearest(texture: &Texture, uv: Vec2) -> [f32; 3] {
    let at = |coordinate: f32, count: usize| ((coordinate.rem_euclid(1.0) * count as f32) as usize).min(count - 1);
    texture.texel(at(uv.x, texture.width()), at(1.0 - uv.y, texture.height()))
}

/// Words in categories and titles, and the super-categories that they imply. The first match counts.
const WORDS: [(&str, &str); 22] = [
    ("lamp", "Lighting"),
    ("light", "Lighting"),
    ("chandelier", "Lighting"),
    ("footstool", "Pier/Stool"),
    ("stool", "Pier/Stool"),
    ("pier", "Pier/Stool"),
    ("bench", "Pier/Stool"),
    ("sofa", "Sofa"),
    ("couch", "Sofa"),
    ("nightstand", "Cabinet/Shelf/Desk"),
    ("side table", "Cabinet/Shelf/Desk"),
    ("coffee table", "Table"),
    ("cabinet", "Cabinet/Shelf/Desk"),
    ("shelf", "Cabinet/Shelf/Desk"),
    ("desk", "Cabinet/Shelf/Desk"),
    ("wardrobe", "Cabinet/Shelf/Desk"),
    ("bookcase", "Cabinet/Shelf/Desk"),
    ("stand", "Cabinet/Shelf/Desk"),
    ("chair", "Chair"),
    ("table", "Table"),
    ("bed", "Bed"),
    ("mattress", "Bed"),
];

/// Rows of `model_info.json` by model id.
#[derive(Clone, Debug, Default)]
pub(super) struct ModelInfo {
    rows: BTreeMap<String, Row>,
}

#[derive(Clone, Debug)]
struct Row {
    super_category: String,
    category: Option<String>,
    material: Option<String>,
}

/// The categories and the material of a piece of furniture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Kind {
    pub(super) super_category: String,
    pub(super) category: Option<String>,
    /// Its main material, as in `Solid Wood`.
    pub(super) material: Option<String>,
    pub(super) known: bool,
}

impl ModelInfo {
    /// Parses the file's text. Rows without a known super-category are skipped; a file that is not a list is a finding.
    pub(super) fn parse(bytes: &[u8], file: &str, limits: &Limits, log: &mut Log) -> Self {
        let mut warn = |message: String| {
            let action = "guessed categories from names";
            log.push(Severity::Warning, "bad_model_info", file, "", message, action);
        };
        let tree = match parse_any(bytes, limits) {
            Ok(tree) => tree,
            Err(error) => {
                warn(error.to_string());
                return Self::default();
            }
        };
        let Some(all) = tree.as_array() else {
            warn(format!("expected a list of rows with model_id and super-category, found {}", kind(&tree)));
            return Self::default();
        };
        let row = |row: &Value| {
            let known = text(row, "super-category")?;
            let super_category = SUPER_CATEGORIES.iter().find(|one| one.eq_ignore_ascii_case(known))?;
            let category = text(row, "category").map(tidy);
            let material = text(row, "material").map(str::to_owned);
            let super_category = (*super_category).to_owned();
            Some((text(row, "model_id")?.to_owned(), Row { super_category, category, material }))
        };
        // Rows are collected in reverse, so that the first of two rows for one model counts.
        let rows = all.iter().rev().filter_map(row).collect();
        Self { rows }
    }

    /// The categories of the piece that `record` describes.
    pub(super) fn kind(&self, record: &FurnitureRecord) -> Kind {
        let named = record.category.as_deref().map(tidy).or_else(|| {
            let title = record.title.as_deref()?;
            Some(tidy(title.rsplit('/').next().unwrap_or(title)))
        });
        if let Some(row) = self.rows.get(&record.jid) {
            let category = row.category.clone().or(named);
            let material = row.material.clone();
            return Kind { super_category: row.super_category.clone(), category, material, known: true };
        }
        let words = [record.category.as_deref(), record.title.as_deref()];
        let words = words.into_iter().flatten().collect::<Vec<_>>().join(" ").to_lowercase();
        let guess = WORDS.iter().find(|(word, _)| words.contains(word)).map_or("Others", |(_, kind)| kind);
        Kind { super_category: guess.to_owned(), category: named, material: None, known: false }
    }
}

/// The name without blanks around its slashes, in which the data's spellings differ.
fn tidy(name: &str) -> String {
    name.split('/').map(str::trim).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use mateval_image::Texels;

    use super::*;

    /// A box from 10 to 50 cm above a horizontal square of `side` at `height`, with the texture's left half on the box
    /// and the right half on the square.
    fn boxed(side: f32, height: f32) -> TriangleMesh {
        let corner = |x: f32, y: f32, z: f32| Vec3::new(x - 0.5, y, z - 0.5);
        let mut positions = Vec::new();
        for y in [0.1, 0.5] {
            positions.extend([corner(0.0, y, 0.0), corner(1.0, y, 0.0), corner(1.0, y, 1.0), corner(0.0, y, 1.0)]);
        }
        let flat = |x: f32, z: f32| Vec3::new((x - 0.5) * side, height, (z - 0.5) * side);
        positions.extend([flat(0.0, 0.0), flat(1.0, 0.0), flat(1.0, 1.0), flat(0.0, 1.0)]);
        let uv = |u: f32, v: f32| Vec2::new(u, v);
        let mut uvs = [[uv(0.1, 0.1), uv(0.4, 0.1), uv(0.4, 0.9), uv(0.1, 0.9)]; 2].concat();
        uvs.extend([uv(0.6, 0.1), uv(0.9, 0.1), uv(0.9, 0.9), uv(0.6, 0.9)]);
        let quads =
            [[0, 1, 2, 3], [4, 7, 6, 5], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0], [8, 11, 10, 9]];
        let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        TriangleMesh { positions, normals: None, uvs: Some(uvs), triangles }
    }

    /// The triangles found under a texture whose right half has this grey and this opacity, in bytes.
    fn found(mesh: &TriangleMesh, grey: u8, opacity: impl Fn(usize) -> u8) -> Vec<usize> {
        let texture = |right: &dyn Fn(usize) -> u8, left: u8| {
            let texel = |at: usize| if at % 64 < 32 { left } else { right(at) };
            Texture::new(64, 64, Texels::Grey8((0..64 * 64).map(texel).collect()), Wrap::Repeat).unwrap()
        };
        drop_shadow(mesh, &texture(&|_| grey, 90), &texture(&opacity, 255))
    }

    #[test]
    fn a_painted_shadow_is_found() {
        for (side, height) in [(1.0, 0.0), (1.3, 0.0), (0.8, 0.0996), (1.0, -0.004)] {
            let mesh = boxed(side, height);
            assert!(may_have_drop_shadow(&mesh));
            assert_eq!(found(&mesh, 0, |_| 45), [12, 13], "{side} {height}");
            // Soft: transparent at one end, 193 of 255 at the other.
            assert_eq!(found(&mesh, 0, |at| (at / 64 * 3) as u8), [12, 13]);
        }
    }

    #[test]
    fn other_flat_bases_stay() {
        let mesh = boxed(1.0, 0.0);
        assert_eq!(found(&mesh, 0, |_| 255), [0; 0], "black and opaque");
        assert_eq!(found(&mesh, 20, |_| 45), [0; 0], "dark grey");
        assert_eq!(found(&mesh, 0, |_| 0), [0; 0], "an opacity of 0 says nothing");
        assert_eq!(found(&boxed(0.6, 0.0), 0, |_| 45), [0; 0], "smaller than half the footprint");
        assert_eq!(found(&boxed(1.0, 0.2), 0, |_| 45), [0; 0], "a shelf");
        let alone = mesh.picked(|triangle| triangle >= 12);
        assert_eq!(found(&alone, 0, |_| 45), [0; 0], "nothing stands on it");
        let plain = TriangleMesh { uvs: None, ..mesh };
        assert!(!may_have_drop_shadow(&plain));
    }

    fn record(jid: &str, category: Option<&str>, title: Option<&str>) -> FurnitureRecord {
        FurnitureRecord {
            uid: "u".into(),
            jid: jid.into(),
            valid: true,
            category: category.map(str::to_owned),
            title: title.map(str::to_owned),
            place: String::new(),
        }
    }

    #[test]
    fn the_list_takes_precedence_over_words() {
        let text = br#"[{"model_id": "a", "super-category": "Sofa", "category": "Three-Seat / Multi-seat Sofa", "material": "Suede"},
            {"model_id": "a", "super-category": "Bed"}, {"model_id": "b", "super-category": "chair", "category": null}, 7]"#;
        let mut log = Log::new("h".into(), 10);
        let info = ModelInfo::parse(text, "model_info.json", &Limits::default(), &mut log);
        assert!(log.into_findings().is_empty());
        let kind = |jid, category, title| {
            let kind = info.kind(&record(jid, category, title));
            (kind.super_category, kind.category.unwrap_or_default(), kind.known)
        };
        assert_eq!(kind("a", None, None), ("Sofa".into(), "Three-Seat/Multi-seat Sofa".into(), true));
        assert_eq!(kind("b", Some("Dining Chair"), None), ("Chair".into(), "Dining Chair".into(), true));
        assert_eq!(kind("c", Some("Floor Lamp"), None), ("Lighting".into(), "Floor Lamp".into(), false));
        assert_eq!(kind("c", None, Some("lighting/pendant")), ("Lighting".into(), "pendant".into(), false));
        assert_eq!(kind("c", Some("植物"), None), ("Others".into(), "植物".into(), false));
        assert_eq!(kind("c", None, None), ("Others".into(), String::new(), false));
        let materials = ["a", "b", "c"].map(|jid| info.kind(&record(jid, None, None)).material);
        assert_eq!(materials, [Some("Suede".to_owned()), None, None]);
    }

    #[test]
    fn a_file_that_is_not_a_list_is_reported() {
        let small = Limits { json_containers: 3, ..Limits::default() };
        for bad in [&b"{"[..], b"{}", b"7", b"[[],[],[]]"] {
            let mut log = Log::new("h".into(), 10);
            ModelInfo::parse(bad, "model_info.json", &small, &mut log);
            assert_eq!(log.into_findings()[0].code, "bad_model_info");
        }
    }
}
