//! Places the surfaces of a house room by room: architecture grouped by mesh type and material, then furniture.

use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3};
use mateval_scene::material::StatedParameters;
use mateval_scene::reference::{ReferenceScene, Surface};
use mateval_scene::{Role, Severity, TriangleMesh};

use super::appearance::{Appearances, MISSING};
use super::appearance_rule::AppearanceRule;
use super::classify;
use super::finish::Finish;
use super::furnished_house::{PlacedModel, PlacedSurface};
use super::house::{Child, ChildKind, House, world_from_house};
use super::house_files::HouseFiles;
use super::limits::Limits;
use super::model::{self, Library, Model, is_folder_name};
use super::model_info::{Kind, ModelInfo};
use crate::source_scene::InstanceOrigin;
use crate::source_scene::Log;
use crate::surface_mesh::parts_of_labels;
use crate::surface_mesh::{Repairs, to_world};
use crate::{coincident, missing_uv};
use mateval_scene::findings::shortened;

/// A piece with a smaller scale is left out. (ATISS drops rooms with such pieces.)
const SMALLEST_SCALE: f64 = 1e-5;

/// The super-category of lamps. (BlenderProc makes lamps also of pieces with "lamp" in their names.)
const LIGHTING: &str = "Lighting";

/// A house's scene under construction.
pub(super) struct Furnisher<'a> {
    house: &'a House,
    info: ModelInfo,
    models: Library,
    textures: Option<Library>,
    limits: Limits,
    compat: bool,
    log: Log,
    /// Models read so far. None stands for one that is missing or faulty, which has been reported.
    known_models: BTreeMap<String, Option<Rc<Model>>>,
    appearances: Appearances,
    triangles: usize,
    surfaces: Vec<Surface>,
    placed: Vec<PlacedSurface>,
}

/// The result of a [`Furnisher`].
pub(super) struct Furnished {
    /// The scene, without lights.
    pub(super) scene: ReferenceScene,
    /// Facts about each surface.
    pub(super) placed: Vec<PlacedSurface>,
    pub(super) log: Log,
    /// The folders of models and textures, which know the hashes of the files read.
    pub(super) libraries: Vec<Library>,
}

impl<'a> Furnisher<'a> {
    pub(super) fn new(
        house: &'a House,
        mut models: Library,
        textures: Option<Library>,
        limits: &Limits,
        files: &HouseFiles,
        mut log: Log,
    ) -> Self {
        Self {
            house,
            info: read_model_info(&mut models, limits, &mut log),
            models,
            textures,
            limits: *limits,
            compat: files.blenderproc_compat,
            log,
            known_models: BTreeMap::new(),
            appearances: Appearances::new(limits.texels, files.appearance),
            triangles: 0,
            surfaces: Vec::new(),
            placed: Vec::new(),
        }
    }

    /// Finishes the scene and reports the findings that concern all rooms.
    pub(super) fn finish(mut self) -> Furnished {
        self.report_private_pieces();
        self.appearances.report_untextured(&mut self.log);
        let Appearances { materials, textures, .. } = self.appearances;
        let mut scene = ReferenceScene { surfaces: self.surfaces, materials, textures, lights: Vec::new() };
        let mut origins: Vec<InstanceOrigin> = self.placed.iter().map(|placed| placed.origin.clone()).collect();
        for split in missing_uv::resolve(&mut scene, &mut origins, &mut self.log) {
            self.placed.push(self.placed[split].clone());
        }
        coincident::separate(&mut scene.surfaces, &mut origins, &mut self.log);
        self.placed.iter_mut().zip(origins).for_each(|(placed, origin)| placed.origin = origin);
        let libraries = [Some(self.models), self.textures].into_iter().flatten().collect();
        Furnished { scene, placed: self.placed, log: self.log, libraries }
    }

    /// Places all children of a room. Returns how many of them are valid pieces of furniture.
    pub(super) fn add_room(&mut self, room: usize) -> usize {
        self.add_architecture(room);
        let mut wanted = 0;
        for child in &self.house.rooms[room].children {
            if let ChildKind::Furniture(record) = child.what
                && self.house.furniture[record].valid
            {
                wanted += 1;
                self.add_piece(room, child, record);
            }
        }
        wanted
    }

    /// Adds one surface for each mesh type and material of the room; the meshes merged into it are its parts.
    fn add_architecture(&mut self, room: usize) {
        // The meshes in world space, grouped.
        let house = self.house;
        let mut groups: Vec<((&str, Option<usize>), Merged)> = Vec::new();
        for child in &house.rooms[room].children {
            let ChildKind::Mesh(mesh) = child.what else { continue };
            let source = &house.meshes[mesh];
            if !self.fits_limit(&source.mesh, &source.place) {
                continue;
            }
            let own = child.placement.matrix() * DMat4::from_translation(source.base);
            let matrix = world_from_house(self.compat) * house.rooms[room].house_from_room * own;
            let (mesh, repairs) = to_world(source.mesh.clone(), matrix, false);
            if self.is_too_far(&repairs, &child.place) {
                continue;
            }
            let key = (source.kind.as_str(), source.material);
            let at = groups.iter().position(|(other, _)| *other == key).unwrap_or_else(|| {
                groups.push((key, Merged::default()));
                groups.len() - 1
            });
            groups[at].1.append(&mesh);
        }
        // A surface for each group.
        for ((kind, material), merged) in groups {
            let parts = parts_of_labels(&merged.mesh, &merged.mesh_of_triangle);
            let finish = self.architecture_finish(material, kind, room, &parts);
            let class = finish.as_ref().map(|finish| finish.classes[0]);
            let textures = self.textures.as_mut();
            let (index, color) = self.appearances.of_architecture(house, material, class, textures, &mut self.log);
            let has_textures = self.textures.is_some();
            let states_color =
                material.is_some_and(|at| self.appearances.states_color(&house.materials[at], index, has_textures));
            let origin = InstanceOrigin {
                role: Role::Architecture { kind: kind.to_owned() },
                part_of_triangle: Some(parts),
                class_of_part: finish.map(|finish| finish.of_parts),
                stated: self.stated(states_color),
                ..InstanceOrigin::default()
            };
            self.surfaces.push(Surface { name: kind.to_owned(), mesh: merged.mesh, material: index });
            self.placed.push(PlacedSurface { room, origin, model: None, color });
        }
    }

    /// The class of architecture of one material and type; none where classes are not asked for.
    fn architecture_finish(&self, material: Option<usize>, kind: &str, room: usize, parts: &[usize]) -> Option<Finish> {
        if self.appearances.rule == AppearanceRule::Constant {
            return None;
        }
        let content = material.and_then(|material| self.house.materials[material].content.as_deref());
        let class = classify::of_architecture(content, kind, &self.house.rooms[room].kind);
        Some(Finish::uniform(class, 1 + parts.iter().max().copied().unwrap_or(0)))
    }

    /// What the data states of a surface. It has no roughness and metallic; those of a rule are stated by the recipe. Only
    /// lights emit.
    fn stated(&self, base_color: bool) -> StatedParameters {
        let by_rule = self.appearances.rule != AppearanceRule::Constant;
        StatedParameters { base_color, roughness: by_rule, metallic: by_rule, emission: true }
    }

    /// Counts the mesh's triangles and reports whether they are within the limit on triangles.
    fn fits_limit(&mut self, mesh: &TriangleMesh, place: &str) -> bool {
        self.triangles += mesh.triangles.len();
        let fits = self.triangles <= self.limits.triangles;
        if !fits {
            let message = format!("the house has more than {} triangles", self.limits.triangles);
            self.log.warn("limit", place, message, "left it out");
        }
        fits
    }

    /// Whether the transforms of a child move its triangles beyond any sensible position, which is reported.
    fn is_too_far(&mut self, repairs: &Repairs, place: &str) -> bool {
        if repairs.not_finite > 0 {
            let message = format!("{} triangles are too far away or not finite", repairs.not_finite);
            self.log.warn("bad_placement", place, message, "left it out");
        }
        repairs.not_finite > 0
    }

    /// Adds a piece of furniture, unless it has no model or an impossible placement.
    fn add_piece(&mut self, room: usize, child: &Child, record: usize) {
        // Its mesh in world space.
        let house = self.house;
        let record = &house.furniture[record];
        if child.placement.scale.abs().min_element() < SMALLEST_SCALE {
            let message = format!("expected a scale of at least {SMALLEST_SCALE}, found {}", child.placement.scale);
            return self.log.warn("scale_tiny", &format!("{}/scale", child.place), message, "left the piece out");
        }
        let kind = self.info.kind(record);
        let Some(model) = self.model(&record.jid, &kind, &record.place) else { return };
        if !self.fits_limit(&model.mesh, &child.place) {
            return;
        }
        let own = if self.compat { child.placement.mirrored_matrix() } else { child.placement.matrix() };
        let matrix = world_from_house(self.compat) * house.rooms[room].house_from_room * own;
        let (mesh, repairs) = to_world((*model.mesh).clone(), matrix, false);
        if self.is_too_far(&repairs, &child.place) {
            return;
        }
        // Two negative factors are a rotation by 180 degrees, one or three mirror the piece.
        if child.placement.scale.element_product() < 0.0 {
            let message = format!("the scale {} mirrors the piece", child.placement.scale);
            let place = format!("{}/scale", child.place);
            self.log.note("mirrored_piece", &place, message, "mirrored it and kept its front sides outside");
        }
        // Its material, categories and names.
        let finish = model.finish.as_ref();
        let (material, complete) = self.appearances.of_model(&record.jid, finish, &mut self.models, &mut self.log);
        if !kind.known {
            let message = format!("model_info.json does not list '{}'", shortened(&record.jid));
            let action = format!("guessed the super-category '{}'", kind.super_category);
            self.log.note("unlisted_model", &record.place, message, action);
        }
        let name = kind.category.clone().unwrap_or_else(|| kind.super_category.clone());
        // model_info.json first: in later releases one of four pieces has neither category nor title.
        let title = || record.title.as_deref().and_then(|title| title.split('/').next()).map(str::to_owned);
        let listed = if kind.known { kind.category.clone() } else { None };
        let named = listed.or_else(|| record.category.clone()).or_else(title);
        let blenderproc_name = named.unwrap_or_else(|| "others".to_owned()).to_lowercase();
        let gives_light = kind.super_category == LIGHTING || blenderproc_name.contains("lamp");
        self.surfaces.push(Surface { name, mesh, material });
        self.placed.push(PlacedSurface {
            room,
            model: Some(PlacedModel { jid: record.jid.clone(), name: blenderproc_name, complete }),
            origin: InstanceOrigin {
                role: if gives_light { Role::LightFixture {} } else { Role::Furniture {} },
                category: kind.category,
                super_category: Some(kind.super_category),
                part_of_triangle: Some(model.part_of_triangle.clone()),
                class_of_part: finish.map(|finish| finish.of_parts.clone()),
                stated: self.stated(complete),
                shape: is_rigid(matrix, child.placement.scale).then(|| scaled(&model.mesh, child.placement.scale)),
            },
            color: MISSING,
        });
    }

    /// The model with this id, read at its first use. `kind` is that of the piece.
    fn model(&mut self, jid: &str, kind: &Kind, place: &str) -> Option<Rc<Model>> {
        if !is_folder_name(jid) {
            let message = format!("expected the name of a folder, found '{}'", shortened(jid));
            self.log.warn("bad_jid", &format!("{place}/jid"), message, "left its pieces out");
            return None;
        }
        if let Some(known) = self.known_models.get(jid) {
            return known.clone();
        }
        let left = self.limits.triangles.saturating_sub(self.triangles);
        let limits = Limits { triangles: left, ..self.limits };
        let mut model = model::read(jid, &mut self.models, &limits, &mut self.log);
        if self.appearances.rule != AppearanceRule::Constant {
            let class = classify::of_model(kind.material.as_deref(), &kind.super_category);
            let file = self.models.shown(&format!("{jid}/raw_model.obj"));
            model = model.map(|model| model.classified(class, &file, &mut self.log));
        }
        let model = model.map(Rc::new);
        self.known_models.insert(jid.to_owned(), model.clone());
        model
    }

    /// Reports pieces whose models are not public, such as windows, doors and cabinets, in one finding.
    fn report_private_pieces(&mut self) {
        let house = self.house;
        let is_private = |child: &&Child| matches!(child.what, ChildKind::Furniture(k) if !house.furniture[k].valid);
        let count = house.rooms.iter().flat_map(|room| &room.children).filter(is_private).count();
        if count > 0 {
            let message = format!("{count} children refer to furniture whose model is not public");
            self.log.note("not_public", "/furniture", message, "left them out");
        }
    }
}

/// Whether the placement is a scale and then a motion that keeps lengths and does not mirror.
fn is_rigid(world_from_model: DMat4, scale: DVec3) -> bool {
    let motion = DMat3::from_mat4(world_from_model) * DMat3::from_diagonal(scale.recip());
    (motion.transpose() * motion).abs_diff_eq(DMat3::IDENTITY, 1e-6)
        && DMat3::from_mat4(world_from_model).determinant() > 0.0
}

fn scaled(mesh: &Arc<TriangleMesh>, scale: DVec3) -> Arc<TriangleMesh> {
    if scale == DVec3::ONE {
        return Arc::clone(mesh);
    }
    let positions = mesh.positions.iter().map(|p| (p.as_dvec3() * scale).as_vec3()).collect();
    Arc::new(TriangleMesh { positions, triangles: mesh.triangles.clone(), ..TriangleMesh::default() })
}

fn read_model_info(models: &mut Library, limits: &Limits, log: &mut Log) -> ModelInfo {
    const FILE: &str = "model_info.json";
    let shown = models.shown(FILE);
    match models.folder.read(FILE) {
        Ok(bytes) => ModelInfo::parse(&bytes, &shown, limits, log),
        Err(fault) => {
            let action = "guessed categories from names";
            log.push(Severity::Warning, fault.code, &shown, "", fault.message, action);
            ModelInfo::default()
        }
    }
}

/// Meshes merged into one, and the index of the source mesh of each triangle.
#[derive(Default)]
struct Merged {
    mesh: TriangleMesh,
    mesh_of_triangle: Vec<usize>,
    meshes: usize,
}

impl Merged {
    fn append(&mut self, mesh: &TriangleMesh) {
        self.mesh.append(mesh);
        self.mesh_of_triangle.extend(std::iter::repeat_n(self.meshes, mesh.triangles.len()));
        self.meshes += 1;
    }
}
