//! A whole house in world space: every room's architecture and every piece whose model is public.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use glam::{DMat4, DVec3};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::transfer::linear_from_srgb;
use mateval_image::{ImageError, Wrap};
use mateval_scene::material::{
    ColorInput, Material, MaterialModel, PrincipledFlavour, ScalarInput, TextureIndex, UvTransform,
};
use mateval_scene::reference::{MaterialIndex, ReferenceScene, SourceTexture, Surface};
use mateval_scene::{Finding, Severity, TriangleMesh};

use super::error::Front3dError;
use super::house::{Child, ChildKind, DesignerCamera, House, HouseMaterial};
use super::limits::Limits;
use super::model::{self, Library, Model, is_folder_name};
use super::model_info::ModelInfo;
use super::{cameras, document, house_reader};
use crate::source::InstanceOrigin;
use crate::source::folder::SourceFolder;
use crate::source::log::{Log, shortened};
use crate::source::surface_mesh::{Repairs, to_world};

/// What stands for a colour that cannot be read: linear mid-grey.
const MISSING: [f32; 3] = [0.5; 3];
/// Blender's default, which BlenderProc leaves: the data says nothing of roughness.
const ROUGHNESS: f32 = 0.5;
/// Below this a scale makes a piece a speck (ATISS drops such rooms).
const SMALLEST_SCALE: f64 = 1e-5;

/// Where the files of a house are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HouseFiles {
    /// Folder that the other paths are relative to.
    pub root: PathBuf,
    /// The house's JSON.
    pub house: PathBuf,
    /// 3D-FUTURE's folder: one folder a model, `model_info.json`.
    pub models: PathBuf,
    /// 3D-FRONT's textures, one folder each; without it the architecture has its colours only.
    pub textures: Option<PathBuf>,
    /// A file of designers' cameras beside the house.
    pub cameras: Option<PathBuf>,
    /// Place everything as BlenderProc does: the layout mirrored, and each piece of furniture mirrored back.
    pub blenderproc_compat: bool,
}

/// What a surface of a furnished house is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Role {
    /// Architecture of one room, one mesh type and one material.
    Architecture {
        /// As in `WallInner`.
        kind: String,
    },
    /// A piece of furniture.
    Furniture {
        /// Its model.
        jid: String,
        /// Its name as BlenderProc would give it, lower case: category, else title.
        name: String,
        /// Whether all of it was there: model and texture.
        complete: bool,
    },
}

/// A surface of a furnished house, beside its mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// A place in [`House::rooms`].
    pub room: usize,
    /// What it is.
    pub role: Role,
    /// For its instance.
    pub origin: InstanceOrigin,
    /// Linear colour that a ceiling would glow in.
    pub color: [f32; 3],
}

/// A house with its furniture, without lights.
#[derive(Clone, Debug)]
pub struct FurnishedHouse {
    /// What the JSON says.
    pub house: House,
    /// The house's file, as findings name it.
    pub file: String,
    /// Everything, room by room; without lights.
    pub scene: ReferenceScene,
    /// Of each surface.
    pub placed: Vec<Placed>,
    /// Designers' cameras, of the JSON and beside it, by number.
    pub cameras: Vec<DesignerCamera>,
    /// Valid pieces that children refer to, of each room: whether placed or not.
    pub wanted_pieces: Vec<usize>,
    /// What was wrong; sorted.
    pub findings: Vec<Finding>,
    /// Every file read, relative to the root, and its SHA-256; sorted.
    pub files: Vec<(String, String)>,
}

/// Reads a house, its models and its textures.
///
/// Fails where the house cannot be read or is none; whatever else is wrong is a finding.
pub fn furnish(files: &HouseFiles, limits: &Limits) -> Result<FurnishedHouse, Front3dError> {
    let path = files.root.join(&files.house);
    let file = shown_path(&files.house);
    let mut log = Log::new(file.clone(), limits.findings);
    let (house, house_folder) = read_json(&path, limits, &mut log)?;

    let models = library(files, &files.models, limits)?;
    let textures = files.textures.as_ref().map(|path| library(files, path, limits)).transpose()?;
    let mut furnisher = Furnisher {
        info: ModelInfo::default(),
        models,
        textures,
        limits: *limits,
        compat: files.blenderproc_compat,
        log,
        known_models: BTreeMap::new(),
        known_textures: BTreeMap::new(),
        layout_materials: BTreeMap::new(),
        furniture_materials: BTreeMap::new(),
        texels: 0,
        triangles: 0,
        untextured: 0,
        scene: ReferenceScene::default(),
        placed: Vec::new(),
    };
    furnisher.read_model_info();
    let wanted_pieces = (0..house.rooms.len()).map(|room| furnisher.room(&house, room)).collect();
    furnisher.note_private_pieces(&house);
    furnisher.note_missing_textures();
    let cameras = cameras::all(&house, files, limits, &mut furnisher.log)?;
    let Furnisher { models, textures, log, scene, placed, .. } = furnisher;
    let libraries = [Some(models), textures].into_iter().flatten();
    let mut hashes: Vec<(String, String)> = libraries.flat_map(Library::into_hashes).collect();
    hashes.extend(house_folder.into_hashes().into_iter().map(|(_, hash)| (file.clone(), hash)));
    hashes.extend(cameras.hash);
    hashes.sort();
    Ok(FurnishedHouse {
        cameras: cameras.all.into_iter().map(|camera| mirrored(camera, files.blenderproc_compat)).collect(),
        house,
        file,
        scene,
        placed,
        wanted_pieces,
        findings: log.into_findings(),
        files: hashes,
    })
}

/// What a house's JSON says, and its findings; nothing else is read.
pub fn read_house(path: &Path, limits: &Limits) -> Result<(House, Vec<Finding>), Front3dError> {
    let mut log = Log::new(shown_path(path), limits.findings);
    let (house, _) = read_json(path, limits, &mut log)?;
    Ok((house, log.into_findings()))
}

fn read_json(path: &Path, limits: &Limits, log: &mut Log) -> Result<(House, SourceFolder), Front3dError> {
    let (bytes, folder) = read_house_file(path, limits)?;
    let invalid = |what: String| Front3dError::Invalid { path: path.to_owned(), what };
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let tree = document::parse(&bytes, limits).map_err(invalid)?;
    let house = house_reader::read(&tree, &stem, limits, log).map_err(invalid)?;
    Ok((house, folder))
}

/// BlenderProc's world, in our axes: its swap of y and z instead of a rotation mirrors the third axis.
fn world_from_layout(compat: bool) -> DMat4 {
    DMat4::from_scale(DVec3::new(1.0, 1.0, if compat { -1.0 } else { 1.0 }))
}

fn mirrored(camera: DesignerCamera, compat: bool) -> DesignerCamera {
    let place = |point: DVec3| world_from_layout(compat).transform_point3(point);
    DesignerCamera { position: place(camera.position), target: place(camera.target), ..camera }
}

/// A path as findings and hashes tell it: forward slashes.
pub(super) fn shown_path(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}

/// A folder and the one file read of it.
pub(super) fn read_house_file(path: &Path, limits: &Limits) -> Result<(Vec<u8>, SourceFolder), Front3dError> {
    let io = |source| Front3dError::Io { path: path.to_owned(), source };
    let invalid = |what: String| Front3dError::Invalid { path: path.to_owned(), what };
    let name = path.file_name().ok_or_else(|| invalid("expected the path of a file".to_owned()))?;
    let size = std::fs::metadata(path).map_err(io)?.len();
    if size > limits.json_bytes {
        return Err(invalid(format!(
            "expected at most {} bytes, found {size}: no house is that large",
            limits.json_bytes
        )));
    }
    let mut folder = SourceFolder::new(path.parent().unwrap_or(Path::new("")), limits.json_bytes).map_err(io)?;
    let bytes = folder.read(&name.to_string_lossy()).map_err(|fault| invalid(fault.message))?;
    Ok((bytes, folder))
}

fn library(files: &HouseFiles, path: &Path, limits: &Limits) -> Result<Library, Front3dError> {
    let at = files.root.join(path);
    let folder = SourceFolder::new(&at, limits.file_bytes).map_err(|source| Front3dError::Io { path: at, source })?;
    Ok(Library { folder, name: shown_path(path) })
}

/// A house on its way to [`FurnishedHouse`].
struct Furnisher {
    info: ModelInfo,
    models: Library,
    textures: Option<Library>,
    limits: Limits,
    compat: bool,
    log: Log,
    /// None: it is not there or not sound, and that has been told.
    known_models: BTreeMap<String, Option<Rc<Model>>>,
    known_textures: BTreeMap<String, Option<TextureIndex>>,
    /// By their place in the house.
    layout_materials: BTreeMap<Option<usize>, MaterialIndex>,
    furniture_materials: BTreeMap<String, MaterialIndex>,
    texels: usize,
    triangles: usize,
    /// Materials with a texture, where no folder of textures was given.
    untextured: usize,
    scene: ReferenceScene,
    placed: Vec<Placed>,
}

impl Furnisher {
    fn read_model_info(&mut self) {
        const FILE: &str = "model_info.json";
        let shown = self.models.shown(FILE);
        match self.models.folder.read(FILE) {
            Ok(bytes) => self.info = ModelInfo::parse(&bytes, &shown, &self.limits, &mut self.log),
            Err(fault) => {
                let action = "guessed categories from names";
                self.log.push(Severity::Warning, fault.code, &shown, "", fault.message, action);
            }
        }
    }

    /// Places all that is in a room. Gives how many valid pieces it should have.
    fn room(&mut self, house: &House, room: usize) -> usize {
        self.architecture(house, room);
        let mut wanted = 0;
        for child in &house.rooms[room].children {
            if let ChildKind::Furniture(record) = child.what
                && house.furniture[record].valid
            {
                wanted += 1;
                self.piece(house, room, child, record);
            }
        }
        wanted
    }

    /// One surface for each mesh type and material of the room, its meshes as parts.
    fn architecture(&mut self, house: &House, room: usize) {
        let mut groups: Vec<((&str, Option<usize>), Merged)> = Vec::new();
        for child in &house.rooms[room].children {
            let ChildKind::Mesh(mesh) = child.what else { continue };
            let source = &house.meshes[mesh];
            if !self.has_room_for(&source.mesh, &source.place) {
                continue;
            }
            let matrix = world_from_layout(self.compat) * house.rooms[room].world_from_room * child.placement.matrix();
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
        for ((kind, material), merged) in groups {
            let (index, color) = self.layout_material(house, material);
            let parts = crate::parts::parts_of_labels(&merged.mesh, &merged.mesh_of_triangle);
            let origin = InstanceOrigin { part_of_triangle: Some(parts), ..InstanceOrigin::default() };
            let role = Role::Architecture { kind: kind.to_owned() };
            self.scene.surfaces.push(Surface { name: kind.to_owned(), mesh: merged.mesh, material: index });
            self.placed.push(Placed { room, role, origin, color });
        }
    }

    fn has_room_for(&mut self, mesh: &TriangleMesh, place: &str) -> bool {
        self.triangles += mesh.triangles.len();
        let fits = self.triangles <= self.limits.triangles;
        if !fits {
            let message = format!("the house has more than {} triangles", self.limits.triangles);
            self.log.warn("limit", place, message, "left it out");
        }
        fits
    }

    /// Whether its room's and its own transform lead to no place at all; that is told.
    fn is_too_far(&mut self, repairs: &Repairs, place: &str) -> bool {
        if repairs.not_finite > 0 {
            let message = format!("{} triangles lie absurdly far away", repairs.not_finite);
            self.log.warn("bad_placement", place, message, "left it out");
        }
        repairs.not_finite > 0
    }

    fn piece(&mut self, house: &House, room: usize, child: &Child, record: usize) {
        let record = &house.furniture[record];
        if child.placement.scale.abs().min_element() < SMALLEST_SCALE {
            let message = format!("a scale of {}", child.placement.scale);
            return self.log.warn("scale_tiny", &format!("{}/scale", child.place), message, "left the piece out");
        }
        let Some(model) = self.model(&record.jid, &record.place) else { return };
        if !self.has_room_for(&model.mesh, &child.place) {
            return;
        }
        let own = if self.compat { child.placement.mirrored_matrix() } else { child.placement.matrix() };
        let matrix = world_from_layout(self.compat) * house.rooms[room].world_from_room * own;
        let (mesh, repairs) = to_world(model.mesh.clone(), matrix, false);
        if self.is_too_far(&repairs, &child.place) {
            return;
        }
        // Two negative signs are half a turn.
        if child.placement.scale.element_product() < 0.0 {
            let message = format!("a scale of {}", child.placement.scale);
            let place = format!("{}/scale", child.place);
            self.log.note("mirrored_piece", &place, message, "mirrored it, its front sides outwards");
        }
        let (material, complete) = self.furniture_material(&record.jid);
        let kind = self.info.kind(record);
        if !kind.known {
            let message = format!("model_info.json does not list '{}'", shortened(&record.jid));
            let action = format!("took it for '{}'", kind.super_category);
            self.log.note("unlisted_model", &record.place, message, action);
        }
        let name = kind.category.clone().unwrap_or_else(|| kind.super_category.clone());
        let title = || record.title.as_deref().and_then(|title| title.split('/').next()).map(str::to_owned);
        let blenderproc_name = record.category.clone().or_else(title).unwrap_or_else(|| "others".to_owned());
        self.scene.surfaces.push(Surface { name, mesh, material });
        self.placed.push(Placed {
            room,
            role: Role::Furniture { jid: record.jid.clone(), name: blenderproc_name.to_lowercase(), complete },
            origin: InstanceOrigin {
                category: kind.category,
                super_category: Some(kind.super_category),
                part_of_triangle: Some(model.part_of_triangle.clone()),
            },
            color: MISSING,
        });
    }

    fn model(&mut self, jid: &str, place: &str) -> Option<Rc<Model>> {
        if !is_folder_name(jid) {
            let message = format!("'{}' is no folder's name", shortened(jid));
            self.log.warn("bad_jid", &format!("{place}/jid"), message, "left its pieces out");
            return None;
        }
        if let Some(known) = self.known_models.get(jid) {
            return known.clone();
        }
        let left = self.limits.triangles.saturating_sub(self.triangles);
        let limits = Limits { triangles: left, ..self.limits };
        let model = model::read(jid, &mut self.models, &limits, &mut self.log).map(Rc::new);
        self.known_models.insert(jid.to_owned(), model.clone());
        model
    }

    /// The material of a model, and whether its texture was there.
    fn furniture_material(&mut self, jid: &str) -> (MaterialIndex, bool) {
        let texture = self.texture(jid, true);
        if let Some(known) = self.furniture_materials.get(jid) {
            return (*known, texture.is_some());
        }
        let color = match texture {
            Some(texture) => ColorInput::Texture { texture, uv: UvTransform::default() },
            None => ColorInput::Constant(MISSING),
        };
        let index = self.add_material(jid.to_owned(), color);
        self.furniture_materials.insert(jid.to_owned(), index);
        (index, texture.is_some())
    }

    /// The material at this place in the house, and its plain colour.
    fn layout_material(&mut self, house: &House, place: Option<usize>) -> (MaterialIndex, [f32; 3]) {
        let source = place.map(|place| &house.materials[place]);
        let plain = source.map_or(MISSING, |source| source.color.map(|v| linear_from_srgb(v as f32 / 255.0)));
        if let Some(known) = self.layout_materials.get(&place) {
            return (*known, plain);
        }
        let texture = source.and_then(|source| self.layout_texture(source));
        let color = match (texture, source) {
            (Some(texture), Some(source)) => ColorInput::Texture { texture, uv: source.uv },
            _ => ColorInput::Constant(plain),
        };
        let name = source.map_or("none", |source| source.uid.as_str());
        let index = self.add_material(name.to_owned(), color);
        self.layout_materials.insert(place, index);
        (index, plain)
    }

    fn layout_texture(&mut self, source: &HouseMaterial) -> Option<TextureIndex> {
        let jid = source.texture.as_deref()?;
        let place = format!("{}/jid", source.place);
        if !is_folder_name(jid) {
            let message = format!("'{}' is no folder's name", shortened(jid));
            self.log.warn("bad_jid", &place, message, "took the colour");
            return None;
        }
        self.untextured += usize::from(self.textures.is_none());
        self.texture(jid, false)
    }

    /// `<id>/texture.png` of the models or of the layout's textures; none, after one finding, where it cannot be read.
    fn texture(&mut self, id: &str, of_model: bool) -> Option<TextureIndex> {
        let library = if of_model { &mut self.models } else { self.textures.as_mut()? };
        let relative = format!("{id}/texture.png");
        let shown = library.shown(&relative);
        if let Some(known) = self.known_textures.get(&shown) {
            return *known;
        }
        // Read for its hash first: the reader of pictures tells none.
        let read = library.folder.read(&relative).map_err(|fault| (missing_texture(fault.code), fault.message));
        let texture = read.and_then(|_| {
            let path = library.folder.path(&relative).map_err(|fault| (fault.code, fault.message))?;
            read_texture(&path, Encoding::Srgb, Wrap::Repeat).map_err(|error| ("unreadable_texture", told(&error)))
        });
        let sha256 = library.folder.hash(&relative);
        let texture = texture.and_then(|texture| {
            self.texels = self.texels.saturating_add(texture.width() * texture.height());
            let what = || format!("more than {} texels in all", self.limits.texels);
            if self.texels > self.limits.texels { Err(("limit", what())) } else { Ok(texture.collapsed()) }
        });
        let index = match texture {
            Ok(texture) => {
                self.scene.textures.push(SourceTexture { name: shown.clone(), sha256, texture });
                Some(TextureIndex(self.scene.textures.len() - 1))
            }
            Err((code, message)) => {
                let action = if of_model { "took linear mid-grey" } else { "took the colour" };
                self.log.push(Severity::Warning, code, &shown, "", message, action);
                None
            }
        };
        self.known_textures.insert(shown, index);
        index
    }

    fn add_material(&mut self, name: String, base_color: ColorInput) -> MaterialIndex {
        self.scene.materials.push(Material {
            name,
            model: MaterialModel::Principled {
                base_color,
                roughness: ScalarInput::Constant(ROUGHNESS),
                metallic: ScalarInput::Constant(0.0),
                specular: 0.5,
                flavour: PrincipledFlavour::Blender,
            },
            two_sided: true,
            opacity: None,
            bump: None,
        });
        MaterialIndex(self.scene.materials.len() - 1)
    }

    fn note_missing_textures(&mut self) {
        if self.untextured > 0 {
            let message = format!("{} materials have a texture, and no folder of textures was given", self.untextured);
            self.log.warn("no_textures", "/material", message, "took their colours");
        }
    }

    /// Windows, doors and cabinets whose models are not public are no fault of anybody: one finding for all.
    fn note_private_pieces(&mut self, house: &House) {
        let is_private = |child: &&Child| matches!(child.what, ChildKind::Furniture(k) if !house.furniture[k].valid);
        let count = house.rooms.iter().flat_map(|room| &room.children).filter(is_private).count();
        if count > 0 {
            let message = format!("{count} children are pieces that are not valid: their models are not public");
            self.log.note("not_public", "/furniture", message, "left them out");
        }
    }
}

fn missing_texture(code: &'static str) -> &'static str {
    if code == "missing_file" { "missing_texture" } else { code }
}

/// What is wrong with a picture, without its path, which is the finding's own.
fn told(error: &ImageError) -> String {
    match error {
        ImageError::Io { source, .. } => source.to_string(),
        ImageError::Invalid { what, .. } | ImageError::Unsupported { what, .. } => what.clone(),
        ImageError::PixelCount { .. } => error.to_string(),
    }
}

/// Meshes one behind the other.
#[derive(Default)]
struct Merged {
    mesh: TriangleMesh,
    mesh_of_triangle: Vec<usize>,
    meshes: usize,
}

impl Merged {
    fn append(&mut self, mesh: &TriangleMesh) {
        let first = self.mesh.positions.len() as u32;
        self.mesh.positions.extend_from_slice(&mesh.positions);
        self.mesh.triangles.extend(mesh.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first)));
        let zeros = || vec![glam::Vec2::ZERO; mesh.positions.len()];
        let own = mesh.uvs.clone().unwrap_or_else(zeros);
        self.mesh.uvs.get_or_insert_default().extend(own);
        self.mesh_of_triangle.extend(std::iter::repeat_n(self.meshes, mesh.triangles.len()));
        self.meshes += 1;
    }
}
