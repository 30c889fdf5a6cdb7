//! 3D-FUTURE models: reads a model's mesh in metres and its parts, and reports what had to be repaired.

use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3};
use mateval_image::Wrap;
use mateval_image::texture_io::read_texture_and_alpha;
use mateval_scene::{Severity, TriangleMesh};

use super::finish::Finish;
use super::limits::Limits;
use super::{classify, drop_shadow};
use crate::source_scene::Log;
use crate::surface_mesh::labelled_parts;
use crate::surface_mesh::{has_area, to_world};
use mateval_scene::findings::shortened;
use mateval_scene::material_class::MaterialClass;
use mateval_scene::obj::{self, Materials, ObjFault, ObjLimits, ObjMesh};
use mateval_scene::source_folder::{LookedFor, SourceFolder};

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
    /// The names of the OBJ groups.
    groups: Vec<String>,
    /// The classes of material, where [`Self::classified`] has found them.
    pub(super) finish: Option<Finish>,
}

impl Model {
    /// The model with the classes of its groups, where `class` is that of the model as a whole.
    pub(super) fn classified(mut self, class: MaterialClass, file: &str, log: &mut Log) -> Self {
        let of_groups: Vec<MaterialClass> = self.groups.iter().map(|name| classify::of_group(name, class)).collect();
        let of_triangles: Vec<MaterialClass> = self.group_of_triangle.iter().map(|group| of_groups[*group]).collect();
        let mut mesh = (*self.mesh).clone();
        let finish = Finish::laid_out(&mut mesh, &of_triangles, &self.part_of_triangle).unwrap_or_else(|| {
            let message = "the texture coordinates spread too far for the classes of groups".to_owned();
            log.push(Severity::Note, "spread_uv", file, "", message, "gave all groups the class of the model");
            Finish::uniform(class, 1 + self.part_of_triangle.iter().max().copied().unwrap_or(0))
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
            warn(missing_model(fault.code), "", fault.message, "left its pieces out");
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

fn missing_model(code: &'static str) -> &'static str {
    if code == "missing_file" { "missing_model" } else { code }
}

/// Drops groups named after a shadow: flat pictures on the floor that falsify a model's size (3D-FRONT-ToolBox issue 7).
/// Returns the group of each remaining triangle too.
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
    if !drop_shadow::is_possible(&mesh) {
        return (mesh, groups);
    }
    // A texture that cannot be read is reported when the material is made.
    let read = library.folder.path(texture).ok().and_then(|path| read_texture_and_alpha(&path, Wrap::Repeat).ok());
    let Some((texels, Some(opacity))) = read else { return (mesh, groups) };
    let shadow = drop_shadow::triangles(&mesh, &texels, &opacity);
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
    let corners = || mesh.triangles.iter().flatten().map(|v| mesh.positions[*v as usize]).filter(|p| p.is_finite());
    let low = corners().reduce(Vec3::min).unwrap_or_default();
    let high = corners().reduce(Vec3::max).unwrap_or_default();
    (high - low).max_element()
}
