//! Reads a whole house into world space, room by room: the architecture, grouped by mesh type and material, and every
//! piece whose model is public.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3};
use mateval_dataset::material::StatedParameters;
use mateval_dataset::reference::{ReferenceScene, Surface};
use mateval_dataset::{Finding, Role, Severity, TriangleMesh};
use mateval_files::FileError;
use mateval_files::source_folder::{LookedFor, SourceFolder, slashed};
use mateval_files::untrusted::shortened;

use super::appearance::{Appearances, MISSING};
use super::document::Limits;
use super::house::{Child, ChildKind, DesignerCamera, House};
use super::material_class::{AppearanceRule, Finish, class_of_architecture, class_of_model};
use super::model::{Kind, Library, Model, ModelInfo, is_folder_name};
use super::{document, house, model};
use crate::log::Log;
use crate::open::{SourceError, open};
use crate::source_scene::InstanceOrigin;
use crate::surface_mesh::{Repairs, parts_of_labels, to_world};
use crate::{coincident, uv};

/// The model of a piece of furniture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlacedModel {
    pub jid: String,
    /// The name that BlenderProc would give the piece, in lower case: category, else title.
    pub name: String,
    /// Whether both model and texture could be read.
    pub complete: bool,
}

/// Facts about a surface of the house besides its mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedSurface {
    /// Index in [`House::rooms`].
    pub room: usize,
    /// Role, categories and parts of its instance.
    pub origin: InstanceOrigin,
    /// The model of a piece of furniture; none for architecture.
    pub model: Option<PlacedModel>,
    /// Linear colour, in which a ceiling emits.
    pub color: [f32; 3],
}

/// A house with its furniture, without lights.
#[derive(Clone, Debug)]
pub struct FurnishedHouse {
    pub house: House,
    /// The house's file, as findings name it.
    pub file: String,
    /// All surfaces, room by room, without lights. It is shared with the [`World`](mateval_tracer::World) made of it.
    pub scene: Arc<ReferenceScene>,
    /// Where the roughness and metallic of its materials come from.
    pub appearance: AppearanceRule,
    /// Facts about each surface, in the order of `scene.surfaces`.
    pub placed: Vec<PlacedSurface>,
    /// What has been subtracted from all positions in world space, in metres.
    pub shift_m: DVec3,
    /// Designers' cameras by number, from the file beside the house or else from the JSON.
    pub cameras: Vec<DesignerCamera>,
    /// For each room the number of valid pieces that its children refer to, whether they could be placed or not.
    pub wanted_pieces: Vec<usize>,
    /// Faults of the input; sorted.
    pub findings: Vec<Finding>,
    /// The files, relative to the root.
    pub files: LookedFor,
}

/// Paths of a house and its library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HouseFiles {
    /// The folder that the other paths are relative to.
    pub root: PathBuf,
    pub house: PathBuf,
    /// 3D-FUTURE's folder, with `model_info.json` and a folder for each model.
    pub models: PathBuf,
    /// 3D-FRONT's folder of textures. Without it the architecture shows its colours only.
    pub textures: Option<PathBuf>,
    /// A file of designers' cameras beside the house.
    pub cameras: Option<PathBuf>,
    /// Whether to place everything as BlenderProc does: the architecture mirrored, and each piece of furniture mirrored
    /// back.
    pub blenderproc_compat: bool,
    /// Where roughness and metallic come from.
    pub appearance: AppearanceRule,
}

/// Reads a house, its models and its textures.
///
/// Fails where the house cannot be read or its JSON is not that of a house. All other faults are findings.
pub fn furnish(files: &HouseFiles, limits: &Limits) -> Result<FurnishedHouse, SourceError> {
    // The JSON.
    let path = files.root.join(&files.house);
    let file = slashed(&files.house);
    let mut log = Log::new(file.clone(), limits.findings);
    let (house, house_folder) = read_json(&path, limits, &mut log)?;

    // Its rooms, with models and textures.
    let mut models = library(files, &files.models, limits)?;
    let textures = files.textures.as_ref().map(|path| library(files, path, limits)).transpose()?;
    let mut furnisher = Furnisher {
        house: &house,
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
    };
    let wanted_pieces = (0..house.rooms.len()).map(|room| furnisher.add_room(room)).collect();

    // Findings and repairs that concern all rooms: faces without uv become surfaces of their own (`uv`), and sheets that
    // coincide move apart by 0.1 mm a layer (`coincident`). Nothing later moves a vertex.
    furnisher.report_private_pieces();
    let Furnisher { mut log, appearances, surfaces, mut placed, models, textures: texture_library, .. } = furnisher;
    appearances.report_untextured(&mut log);
    let Appearances { materials, textures, .. } = appearances;
    let mut scene = ReferenceScene { surfaces, materials, textures, lights: Vec::new() };
    let mut origins: Vec<InstanceOrigin> = placed.iter_mut().map(|placed| std::mem::take(&mut placed.origin)).collect();
    for split in uv::resolve(&mut scene, &mut origins, &mut log) {
        placed.push(placed[split].clone());
    }
    uv::report_coarse(&scene, &mut log);
    coincident::separate(&mut scene.surfaces, &mut origins, &mut log);
    placed.iter_mut().zip(origins).for_each(|(placed, origin)| placed.origin = origin);

    // The designers' cameras, and the list of all files.
    let (cameras, hash) = house::designer_cameras(&house, &files.root, files.cameras.as_deref(), limits, &mut log)?;
    let mut looked_for = house_folder.into_files().renamed(|_| file.clone());
    [Some(models), texture_library].into_iter().flatten().for_each(|library| looked_for.extend(library.into_files()));
    looked_for.extend(LookedFor { hashes: hash.into_iter().collect(), absent: Vec::new() });
    let world = world_from_house(files.blenderproc_compat);
    Ok(FurnishedHouse {
        cameras: cameras.into_iter().map(|camera| camera.moved(|at| world.transform_point3(at))).collect(),
        shift_m: world.transform_vector3(house.shift_m),
        house,
        file,
        scene: Arc::new(scene),
        appearance: files.appearance,
        placed,
        wanted_pieces,
        findings: log.into_findings(),
        files: looked_for,
    })
}

/// Reads a house's JSON and nothing else. Returns its findings too.
pub fn read_house(path: &Path, limits: &Limits) -> Result<(House, Vec<Finding>), SourceError> {
    let mut log = Log::new(slashed(path), limits.findings);
    let (house, _) = read_json(path, limits, &mut log)?;
    Ok((house, log.into_findings()))
}

fn read_json(path: &Path, limits: &Limits, log: &mut Log) -> Result<(House, SourceFolder), SourceError> {
    let (folder, _, bytes) = open(path, limits.json_bytes, limits.json_bytes)?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let house = document::parse(&bytes, limits).and_then(|tree| house::read(&tree, &stem, limits, log));
    let house = house.map_err(|invalid| invalid.in_file(path))?;
    Ok((house, folder))
}

fn library(files: &HouseFiles, path: &Path, limits: &Limits) -> Result<Library, SourceError> {
    let at = files.root.join(path);
    let folder = SourceFolder::new(&at, limits.file_bytes).map_err(FileError::io("read", &at))?;
    Ok(Library { folder, name: slashed(path) })
}

/// A piece with a smaller scale is left out. (ATISS drops rooms with such pieces.)
const SMALLEST_SCALE: f64 = 1e-5;

/// The super-category of lamps. (BlenderProc makes lamps also of pieces with "lamp" in their names.)
const LIGHTING: &str = "Lighting";

struct Furnisher<'a> {
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

impl Furnisher<'_> {
    /// Places all children of a room. Returns how many of them are valid pieces of furniture.
    fn add_room(&mut self, room: usize) -> usize {
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

    /// The class of architecture of one material and type; absent if classes are not asked for.
    fn architecture_finish(&self, material: Option<usize>, kind: &str, room: usize, parts: &[usize]) -> Option<Finish> {
        if self.appearances.rule == AppearanceRule::Constant {
            return None;
        }
        let content = material.and_then(|material| self.house.materials[material].content.as_deref());
        let class = class_of_architecture(content, kind, &self.house.rooms[room].kind);
        Some(Finish::uniform(class, parts))
    }

    /// What the data states of a surface. It has no roughness and metallic; those of a rule are stated by the recipe.
    /// Only lights emit.
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
            let class = class_of_model(kind.material.as_deref(), &kind.super_category);
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

/// From the house's space to world space: the identity, or with `compat` the mirror that BlenderProc applies, since it
/// swaps y and z instead of rotating.
fn world_from_house(compat: bool) -> DMat4 {
    DMat4::from_scale(DVec3::new(1.0, 1.0, if compat { -1.0 } else { 1.0 }))
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
