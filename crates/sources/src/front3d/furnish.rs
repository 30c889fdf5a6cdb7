//! A whole house in world space: every room's architecture and every piece whose model is public.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};
use mateval_scene::Finding;
use mateval_scene::reference::ReferenceScene;

use super::furnisher::{Furnished, Furnisher};
use super::house::{DesignerCamera, House};
use super::limits::Limits;
use super::model::Library;
use super::{cameras, document, house_reader};
use crate::error::SourceError;
use crate::log::Log;
use crate::source_scene::InstanceOrigin;
use mateval_scene::source_folder::{LookedFor, SourceFolder};

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
    /// Every file that was looked for and was not there; sorted.
    pub absent: Vec<String>,
}

/// Reads a house, its models and its textures.
///
/// Fails where the house cannot be read or is none; whatever else is wrong is a finding.
pub fn furnish(files: &HouseFiles, limits: &Limits) -> Result<FurnishedHouse, SourceError> {
    let path = files.root.join(&files.house);
    let file = shown_path(&files.house);
    let mut log = Log::new(file.clone(), limits.findings);
    let (house, house_folder) = read_json(&path, limits, &mut log)?;

    let models = library(files, &files.models, limits)?;
    let textures = files.textures.as_ref().map(|path| library(files, path, limits)).transpose()?;
    let mut furnisher = Furnisher::new(&house, models, textures, limits, files.blenderproc_compat, log);
    let wanted_pieces = (0..house.rooms.len()).map(|room| furnisher.room(room)).collect();
    let Furnished { scene, placed, mut log, libraries } = furnisher.finish();
    let cameras = cameras::all(&house, files, limits, &mut log)?;
    let mut looked_for = house_folder.into_files().renamed(|_| file.clone());
    libraries.into_iter().map(Library::into_files).for_each(|files| looked_for.extend(files));
    looked_for.extend(LookedFor { hashes: cameras.hash.into_iter().collect(), absent: Vec::new() });
    Ok(FurnishedHouse {
        cameras: cameras.all.into_iter().map(|camera| mirrored(camera, files.blenderproc_compat)).collect(),
        house,
        file,
        scene,
        placed,
        wanted_pieces,
        findings: log.into_findings(),
        files: looked_for.hashes,
        absent: looked_for.absent,
    })
}

/// What a house's JSON says, and its findings; nothing else is read.
pub fn read_house(path: &Path, limits: &Limits) -> Result<(House, Vec<Finding>), SourceError> {
    let mut log = Log::new(shown_path(path), limits.findings);
    let (house, _) = read_json(path, limits, &mut log)?;
    Ok((house, log.into_findings()))
}

fn read_json(path: &Path, limits: &Limits, log: &mut Log) -> Result<(House, SourceFolder), SourceError> {
    let (folder, _, bytes) = crate::source_scene::open(path, limits.json_bytes, limits.json_bytes)?;
    let invalid = |what: String| SourceError::Invalid { path: path.to_owned(), what };
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let tree = document::parse(&bytes, limits).map_err(invalid)?;
    let house = house_reader::read(&tree, &stem, limits, log).map_err(invalid)?;
    Ok((house, folder))
}

/// BlenderProc's world, in our axes: its swap of y and z instead of a rotation mirrors the third axis.
pub(super) fn world_from_layout(compat: bool) -> DMat4 {
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

fn library(files: &HouseFiles, path: &Path, limits: &Limits) -> Result<Library, SourceError> {
    let at = files.root.join(path);
    let folder = SourceFolder::new(&at, limits.file_bytes).map_err(|source| SourceError::Io { path: at, source })?;
    Ok(Library { folder, name: shown_path(path) })
}
