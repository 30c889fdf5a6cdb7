//! Shapes. Each becomes one surface in world space, and one light if it emits.

use glam::{DMat3, DMat4, DVec3, Vec2};
use mateval_dataset::TriangleMesh;
use mateval_dataset::material::StatedParameters;
use mateval_dataset::obj::{self, Materials, ObjFault, ObjLimits};
use mateval_dataset::reference::{Emission, LightGroup, MaterialIndex, Surface, SurfaceIndex};
use mateval_files::source_folder::FileFault;
use mateval_files::untrusted::shortened;

use super::document::Element;
use super::reader::{Parameters, Reader};
use crate::primitives;
use crate::source_scene::{shift_of, shift_transform};
use crate::surface_mesh::{smooth_normals, to_world};
use crate::uv::barycentric;

const LEFT_OUT: &str = "left the shape out";

impl<'a> Reader<'a> {
    /// Adds the shape `element` to the scene, unless it has no triangles.
    pub(super) fn shape(&mut self, element: &'a Element) {
        let name = shape_name(element);
        let place = format!("shape '{}'", shortened(&name));
        let mut from = self.parameters(element, place);
        self.report_medium(element, &mut from);
        let world_from_object = from
            .sound_transform("to_world", LEFT_OUT, &mut self.log)
            .map(|world_from_object| shift_transform(self.shift_m) * world_from_object);
        let flip = from.boolean("flip_normals", false, &mut self.log);
        let (bsdfs, emitters) = (from.objects("bsdf"), from.objects("emitter"));
        // The material of a shape that is left out is read too, so that its faults are reported.
        let material = self.shape_material(&bsdfs, &name, &from);
        let mesh = world_from_object.and_then(|matrix| self.mesh(element, &mut from, matrix, flip));
        // A primitive with a faulty parameter would be drawn elsewhere or in another size.
        let is_misplaced = mesh.is_some() && from.is_replaced(&["center", "radius", "p0", "p1"]);
        if is_misplaced {
            self.log.warn("bad_value", &from.place, "the place or size of the shape cannot be read", LEFT_OUT);
        }
        if let Some(mesh) = mesh.filter(|_| !is_misplaced) {
            let material = material.unwrap_or_else(|| {
                if emitters.is_empty() {
                    self.log.note(
                        "no_bsdf",
                        &from.place,
                        "the shape has no bsdf",
                        "used Mitsuba's default, diffuse grey 0.5",
                    );
                }
                let default = self.default_material(&name, !emitters.is_empty());
                // A reference that leads nowhere may be to the BSDF, so that even a lamp is not known to be black.
                if from.is_any_replaced() { self.stating_less(default, without_color) } else { default }
            });
            self.add_surface(name, mesh, material, &emitters);
        } else {
            self.left_out.push(name);
            // The other parameters of a shape without transform have not been read.
            if world_from_object.is_none() {
                from.take_all();
            }
        }
        from.finish(&mut self.log);
    }

    fn add_surface(&mut self, name: String, mut mesh: TriangleMesh, material: MaterialIndex, emitters: &[&'a Element]) {
        let surface = SurfaceIndex(self.scene.surfaces.len());
        let mut states_emission = true;
        for emitter in emitters {
            states_emission &= self.area_light(emitter, surface, &name);
        }
        let without_emission = |stated| StatedParameters { emission: false, ..stated };
        let material = if states_emission { material } else { self.stating_less(material, without_emission) };
        // Texture coordinates matter where there is a texture.
        let has_map = |light: &LightGroup| match &light.emission {
            Emission::Area { surfaces, map: Some(_), .. } => surfaces.contains(&surface),
            _ => false,
        };
        if !self.scene.materials[material.0].lookups().is_empty() || self.scene.lights.iter().any(has_map) {
            let all = mesh.triangles.len();
            let count = barycentric(&mut mesh);
            if count > 0 {
                let message = format!("{count} of {all} faces have no texture coordinates");
                let place = format!("shape '{}'", shortened(&name));
                self.log.warn("no_uv", &place, message, "used barycentric coordinates, as Mitsuba does");
            }
        }
        for uv in mesh.uvs.iter_mut().flatten().filter(|uv| !uv.is_finite()) {
            *uv = Vec2::ZERO;
        }
        self.totals.triangles += mesh.triangles.len();
        self.totals.vertices += mesh.positions.len();
        self.scene.surfaces.push(Surface { name, mesh, material });
    }

    fn shape_material(&mut self, bsdfs: &[&'a Element], name: &str, from: &Parameters<'a>) -> Option<MaterialIndex> {
        if bsdfs.len() > 1 {
            let message = format!("{} bsdfs on one shape", bsdfs.len());
            self.log.warn("unsupported", &from.place, message, "used the first one");
        }
        let material = bsdfs.first().map(|bsdf| self.material(bsdf, name));
        let is_one_of_several = bsdfs.len() > 1;
        material.map(|index| if is_one_of_several { self.stating_less(index, without_color) } else { index })
    }

    fn report_medium(&mut self, element: &Element, from: &mut Parameters<'a>) {
        if !from.objects("medium").is_empty() {
            let message = format!("line {}: a medium in the shape", element.line);
            self.log.warn("unsupported", &from.place, message, "ignored it: the inside is clear");
        }
    }

    /// The shape's triangles in world space. A shape without triangles, or one that exceeds a limit, is reported and
    /// gives none.
    fn mesh(
        &mut self,
        element: &'a Element,
        from: &mut Parameters<'a>,
        world_from_object: DMat4,
        flip: bool,
    ) -> Option<TriangleMesh> {
        // Normals of the file are dropped where flat ones are wanted.
        let (object, base) = self.object_mesh(element, from)?;
        let world_from_object =
            if base == DVec3::ZERO { world_from_object } else { world_from_object * DMat4::from_translation(base) };
        let smooth = from.boolean("face_normals", false, &mut self.log);
        let mirrored = DMat3::from_mat4(world_from_object).determinant() < 0.0;
        let (object, smooth) = (TriangleMesh { normals: object.normals.filter(|_| !smooth), ..object }, !smooth);
        if mirrored && object.normals.is_none() {
            let message = "a mirroring transform of a mesh without normals";
            self.log.note("mirrored", &from.place, message, "kept its front side; Mitsuba swaps front and back");
        }
        // In world space, impossible triangles are gone and missing normals are made.
        let (mut mesh, repairs) = to_world(object, world_from_object, flip);
        repairs.report(&from.place, &mesh, &mut self.log);
        if mesh.triangles.is_empty() {
            self.log.warn("empty_mesh", &from.place, "expected triangles, found none", LEFT_OUT);
            return None;
        }
        if smooth && mesh.normals.is_none() {
            mesh.normals = Some(smooth_normals(&mesh));
        }
        let over = self.totals.triangles + mesh.triangles.len() > self.limits.triangles
            || self.totals.vertices + mesh.positions.len() > self.limits.vertices;
        if over {
            self.log.warn("limit", &from.place, "the scene has more triangles or vertices than the limit", LEFT_OUT);
        }
        (!over).then_some(mesh)
    }

    /// The shape's triangles in its own space, and what has been subtracted from their positions far from the origin.
    fn object_mesh(&mut self, element: &'a Element, from: &mut Parameters<'a>) -> Option<(TriangleMesh, DVec3)> {
        match element.kind() {
            "obj" => self.obj_mesh(element, from),
            "rectangle" => Some((primitives::rectangle(), DVec3::ZERO)),
            "cube" => Some((primitives::cube(), DVec3::ZERO)),
            "disk" => {
                self.tessellated(from);
                Some((primitives::disk(), DVec3::ZERO))
            }
            "sphere" => {
                self.tessellated(from);
                let center = from.vector("center", &mut self.log).unwrap_or([0.0; 3]);
                let radius = self.radius(from);
                let center = DVec3::from_array(center);
                let base = shift_of(center);
                Some((primitives::sphere(center - base, radius), base))
            }
            "cylinder" => {
                self.tessellated(from);
                let start = from.vector("p0", &mut self.log).unwrap_or([0.0; 3]);
                let end = from.vector("p1", &mut self.log).unwrap_or([0.0, 0.0, 1.0]);
                let radius = self.radius(from);
                let (start, end) = (DVec3::from_array(start), DVec3::from_array(end));
                let base = shift_of(start);
                Some((primitives::cylinder(start - base, end - base, radius), base))
            }
            other => {
                let message = format!("line {}: the shape '{}' is not known", element.line, shortened(other));
                self.log.warn("unknown_plugin", &from.place, message, LEFT_OUT);
                from.take_all();
                None
            }
        }
    }

    fn radius(&mut self, from: &mut Parameters<'a>) -> f64 {
        from.number_within("radius", 1e-9, 1e9, &mut self.log).unwrap_or(1.0)
    }

    fn tessellated(&mut self, from: &Parameters<'a>) {
        let message = "a round shape";
        let action = format!("approximated it with {} segments per circle", primitives::SEGMENTS);
        self.log.note("tessellated", &from.place, message, action);
    }

    fn obj_mesh(&mut self, element: &'a Element, from: &mut Parameters<'a>) -> Option<(TriangleMesh, DVec3)> {
        let name = from.string("filename").unwrap_or("");
        let flip_v = !from.boolean("flip_tex_coords", true, &mut self.log);
        from.ignore(&["collapse", "max_smooth_angle"]);
        match self.read_obj(name) {
            Ok(obj) => {
                let mut mesh = obj.mesh;
                if obj.corners_without_normal > 0 {
                    let message = format!("only some faces of '{}' have normals", shortened(name));
                    self.log.warn("mixed_faces", &from.place, message, "computed the others from the adjacent faces");
                }
                if flip_v {
                    mesh.uvs.iter_mut().flatten().for_each(|uv| uv.y = 1.0 - uv.y);
                }
                Some((mesh, obj.base))
            }
            Err(fault) => {
                self.report_file(name, &from.place, element.line, &fault, LEFT_OUT);
                // Without a mesh, the other parameters have no effect and are not reported.
                from.take_all();
                None
            }
        }
    }

    fn read_obj(&mut self, name: &str) -> Result<obj::ObjMesh, FileFault> {
        let relative = self.file(name)?;
        if self.totals.mesh_bytes > self.limits.mesh_bytes {
            let message = format!("the OBJ files read so far have more than {} bytes", self.limits.mesh_bytes);
            return Err(FileFault { code: "limit", message });
        }
        let bytes = self.source.read(&relative)?;
        self.totals.mesh_bytes = self.totals.mesh_bytes.saturating_add(bytes.len() as u64);
        let triangles = self.limits.triangles.saturating_sub(self.totals.triangles);
        let limits = ObjLimits { triangles, corners: triangles.saturating_mul(3) };
        obj::read(&bytes, limits, Materials::Ignored).map_err(|error| {
            let message = format!("'{}': {error}", shortened(&relative));
            FileFault { code: if matches!(error.fault, ObjFault::TooLarge(_)) { "limit" } else { "bad_mesh" }, message }
        })
    }
}

fn without_color(stated: StatedParameters) -> StatedParameters {
    StatedParameters { base_color: false, ..stated }
}

/// The shape's id, or else its file's name without folder and extension, or else its type.
fn shape_name(element: &Element) -> String {
    if let Some(id) = element.attribute("id") {
        return id.to_owned();
    }
    let file = element.children.iter().find(|c| c.name() == "filename").and_then(|c| c.attribute("value"));
    let base = file.map(|name| name.rsplit(['/', '\\']).next().unwrap_or(name));
    let stem = base.map(|base| base.rsplit_once('.').map_or(base, |(stem, _)| stem)).filter(|stem| !stem.is_empty());
    stem.unwrap_or(element.kind()).to_owned()
}
