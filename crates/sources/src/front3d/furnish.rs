//! Reads a whole house into world space: the architecture of every room and every piece whose model is public.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use mateval_scene::Finding;
use mateval_scene::source_folder::{LookedFor, SourceFolder};

use super::furnished_house::FurnishedHouse;
use super::furnisher::{Furnished, Furnisher};
use super::house::{DesignerCamera, House, world_from_house};
use super::house_files::{HouseFiles, shown_path};
use super::limits::Limits;
use super::model::Library;
use super::{cameras, document, house_reader};
use crate::error::{InvalidSource, SourceError};
use crate::source_scene::Log;

/// Reads a house, its models and its textures.
///
/// Fails where the house cannot be read or its JSON is not that of a house. All other faults are findings.
pub fn furnish(files: &HouseFiles, limits: &Limits) -> Result<FurnishedHouse, SourceError> {
    // The JSON.
    let path = files.root.join(&files.house);
    let file = shown_path(&files.house);
    let mut log = Log::new(file.clone(), limits.findings);
    let (house, house_folder) = read_json(&path, limits, &mut log)?;

    // Its rooms, with models and textures.
    let models = library(files, &files.models, limits)?;
    let textures = files.textures.as_ref().map(|path| library(files, path, limits)).transpose()?;
    let mut furnisher = Furnisher::new(&house, models, textures, limits, files, log);
    let wanted_pieces = (0..house.rooms.len()).map(|room| furnisher.add_room(room)).collect();
    let Furnished { scene, placed, mut log, libraries } = furnisher.finish();

    // The designers' cameras, and the list of all files.
    let cameras = cameras::all(&house, files, limits, &mut log)?;
    let mut looked_for = house_folder.into_files().renamed(|_| file.clone());
    libraries.into_iter().map(Library::into_files).for_each(|files| looked_for.extend(files));
    looked_for.extend(LookedFor { hashes: cameras.hash.into_iter().collect(), absent: Vec::new() });
    Ok(FurnishedHouse {
        cameras: cameras.all.into_iter().map(|camera| mirrored(camera, files.blenderproc_compat)).collect(),
        shift_m: world_from_house(files.blenderproc_compat).transform_vector3(house.shift_m),
        house,
        file,
        scene: Arc::new(scene),
        appearance: files.appearance,
        placed,
        wanted_pieces,
        findings: log.into_findings(),
        files: looked_for.hashes,
        absent: looked_for.absent,
    })
}

/// Reads a house's JSON and nothing else. Returns its findings too.
pub fn read_house(path: &Path, limits: &Limits) -> Result<(House, Vec<Finding>), SourceError> {
    let mut log = Log::new(shown_path(path), limits.findings);
    let (house, _) = read_json(path, limits, &mut log)?;
    Ok((house, log.into_findings()))
}

fn read_json(path: &Path, limits: &Limits, log: &mut Log) -> Result<(House, SourceFolder), SourceError> {
    let (folder, _, bytes) = crate::error::open(path, limits.json_bytes, limits.json_bytes)?;
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let house = document::parse(&bytes, limits).and_then(|tree| house_reader::read(&tree, &stem, limits, log));
    let house = house.map_err(|error| SourceError::invalid(path, InvalidSource::House(error)))?;
    Ok((house, folder))
}

fn mirrored(camera: DesignerCamera, compat: bool) -> DesignerCamera {
    let place = |point: DVec3| world_from_house(compat).transform_point3(point);
    DesignerCamera { position: place(camera.position), target: place(camera.target), ..camera }
}

fn library(files: &HouseFiles, path: &Path, limits: &Limits) -> Result<Library, SourceError> {
    let at = files.root.join(path);
    let folder = SourceFolder::new(&at, limits.file_bytes).map_err(|source| SourceError::Io { path: at, source })?;
    Ok(Library { folder, name: shown_path(path) })
}
