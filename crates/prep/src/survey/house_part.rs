//! What was found in one house, as `.survey` keeps it, so that the house need not be searched again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_image::png_io::write_rgb_bytes;
use mateval_scene::dataset::SourceFile;
use mateval_scene::manifest::sha256_of_file;
use mateval_scene::work_folder::{WorkFolder, remove, remove_beside};
use mateval_scene::{FindingCount, json};
use mateval_sources::front3d::{self, AppearanceRule, FurnishedHouse, HouseFiles};
use serde::{Deserialize, Serialize};

use super::candidates::{HouseSurvey, search_rooms};
use super::options::SurveyOptions;
use super::survey_file::SurveyedHouse;
use super::survey_folder::{HouseName, SurveyFolder};
use crate::error::PrepError;

/// What was found in a house, and what it was made of.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct HousePart {
    /// The hash of the survey's settings.
    settings_sha256: String,
    /// Every file that was read, relative to the source's folder.
    pub(super) files: Vec<SourceFile>,
    /// Files that were looked for but do not exist.
    absent: Vec<String>,
    /// The house. The ids of its scenes may be another house's too.
    pub(super) house: SurveyedHouse,
}

/// Searches houses, or takes what an earlier run has found in them.
pub(super) struct HouseSearch<'a> {
    pub(super) options: &'a SurveyOptions,
    /// The folder that all paths are relative to.
    pub(super) source: &'a Path,
    pub(super) folder: &'a SurveyFolder,
    /// The hash of the survey's settings.
    settings_sha256: String,
    /// The hashes of files so far; none of a file that cannot be read. Houses share most of their models.
    hashes: BTreeMap<PathBuf, Option<String>>,
}

impl<'a> HouseSearch<'a> {
    pub(super) fn new(options: &'a SurveyOptions, source: &'a Path, folder: &'a SurveyFolder, tool: &str) -> Self {
        Self { options, source, folder, settings_sha256: options.sha256(tool), hashes: BTreeMap::new() }
    }

    /// Makes the part of a house; returns whether an earlier run had made it, with the same settings and files.
    pub(super) fn find(&mut self, house: &Path) -> Result<bool, PrepError> {
        let shown = shown(house);
        let name = HouseName::new(&shown);
        let path = self.folder.part(&name);
        let found = json::read::<HousePart>(&path).ok();
        if found.is_some_and(|part| part.house.file == shown && self.is_current(&part)) {
            return Ok(true);
        }
        // A part is written last, since a house without one is searched again.
        remove(&path)?;
        let (part, pictures) = self.search(house, &name);
        let thumbnails = self.folder.file(&name.thumbnails());
        remove_beside(&thumbnails)?;
        if pictures.is_empty() {
            remove(&thumbnails)?;
        } else {
            let work = WorkFolder::start(&thumbnails)?;
            for (name, picture) in &pictures {
                write_rgb_bytes(&work.path().join(name), picture)?;
            }
            work.finish()?;
        }
        json::write(&path, &part)?;
        Ok(false)
    }

    /// Whether the part was made with these settings of files that have not changed. A house that could not be read is
    /// always tried again.
    fn is_current(&mut self, part: &HousePart) -> bool {
        let cameras = part.house.rooms.iter().flat_map(|room| &room.cameras);
        part.settings_sha256 == self.settings_sha256
            && part.house.error.is_none()
            && cameras.into_iter().all(|camera| self.folder.file(&camera.thumbnail).is_file())
            && part.absent.iter().all(|file| !self.source.join(file).exists())
            && part.files.iter().all(|file| self.hash(&file.path).as_ref() == Some(&file.sha256))
    }

    fn hash(&mut self, file: &str) -> Option<String> {
        let path = self.source.join(file);
        self.hashes.entry(path.clone()).or_insert_with(|| sha256_of_file(&path).ok()).clone()
    }

    /// Searches the house. Returns also its thumbnails. A house that cannot be read is a part that states why.
    fn search(&self, house: &Path, name: &HouseName) -> (HousePart, Vec<super::candidates::NamedThumbnail>) {
        let mut part = HousePart {
            settings_sha256: self.settings_sha256.clone(),
            files: Vec::new(),
            absent: Vec::new(),
            house: SurveyedHouse {
                file: shown(house),
                uid: None,
                error: None,
                findings: Vec::new(),
                rooms: Vec::new(),
            },
        };
        match self.furnish(house) {
            Err(error) => {
                part.house.error = Some(error.to_string());
                (part, Vec::new())
            }
            Ok((HouseSurvey { mut rooms, pictures }, furnished)) => {
                for camera in rooms.iter_mut().flat_map(|room| &mut room.cameras) {
                    camera.thumbnail = format!("{}/{}", name.thumbnails(), camera.thumbnail);
                }
                part.house.uid = Some(furnished.house.uid.clone());
                part.house.findings = FindingCount::of(furnished.findings.iter());
                part.house.rooms = rooms;
                let file = |(path, sha256): (String, String)| SourceFile { path, sha256 };
                part.files = furnished.files.into_iter().map(file).collect();
                part.absent = furnished.absent;
                (part, pictures)
            }
        }
    }

    /// Reads the house and searches its rooms.
    fn furnish(&self, house: &Path) -> Result<(HouseSurvey, FurnishedHouse), PrepError> {
        let options = self.options;
        let files = HouseFiles {
            root: self.source.to_owned(),
            house: house.to_owned(),
            models: options.models.clone(),
            textures: options.textures.clone(),
            cameras: options.cameras.clone(),
            blenderproc_compat: false,
            appearance: AppearanceRule::Constant,
        };
        let furnished = front3d::furnish(&files, &front3d::Limits::default())?;
        Ok((search_rooms(options, &furnished)?, furnished))
    }
}

/// A house's file as the survey shows it.
pub(super) fn shown(house: &Path) -> String {
    house.to_string_lossy().replace('\\', "/")
}
