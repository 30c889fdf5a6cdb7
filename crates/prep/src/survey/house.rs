//! Searches the houses one by one, and keeps what was found in each.
//!
//! What was found in a house is kept in `.survey`, so that the house need not be searched again where a survey is
//! resumed, and so that several processes can search different houses. `survey.json` is written last: a folder without
//! it holds a survey that is not finished.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::SourceFile;
use mateval_dataset::{FindingCount, ids, json};
use mateval_files::FileError;
use mateval_files::lease::{Lease, LeaseSet};
use mateval_files::source_folder::slashed;
use mateval_files::untrusted::{sha256_of_bytes, sha256_of_file};
use mateval_files::work_folder::{WorkFolder, check_free, make_folder, remove, remove_beside};
use mateval_image::png_io::write_rgb_bytes;
use mateval_sources::front3d::{self, AppearanceRule, FurnishedHouse, HouseFiles};
use serde::{Deserialize, Serialize};

use super::candidates::{HouseSurvey, search_rooms};
use super::rules::SurveyOptions;
use super::survey_file::{SURVEY, SurveyedHouse, THUMBNAILS};
use crate::build::start::holds_only;
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
        let shown = slashed(house);
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
                file: slashed(house),
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
                part.files = furnished.files.hashes.into_iter().map(file).collect();
                part.absent = furnished.files.absent;
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

/// The name of the folder that only the survey itself reads.
const WORK: &str = ".survey";

const KEY_FORMAT: &str = "mateval-survey-work/1";

/// States that a `.survey` is ours.
#[derive(Serialize, Deserialize)]
struct WorkKey {
    format: String,
}

/// The paths of a survey's folder.
#[derive(Clone, Debug)]
pub(super) struct SurveyFolder(PathBuf);

impl SurveyFolder {
    /// Begins a survey in the folder, or resumes one. Fails where it holds something else, or a finished survey that
    /// may not be replaced.
    pub(super) fn begin(out: &Path, force: bool) -> Result<Self, PrepError> {
        let folder = Self(out.to_owned());
        folder.check_place(force)?;
        let work = folder.0.join(WORK);
        for path in [folder.parts(), folder.0.join(THUMBNAILS)] {
            make_folder(&path)?;
        }
        json::write(&work.join("key.json"), &WorkKey { format: KEY_FORMAT.to_owned() })?;
        Ok(folder)
    }

    fn check_place(&self, force: bool) -> Result<(), PrepError> {
        let out = &self.0;
        // A survey that was killed before it wrote its key has written nothing but `.survey`.
        let is_new = !out.exists() || holds_only(out, &[WORK, THUMBNAILS]);
        let key = json::read::<WorkKey>(&out.join(WORK).join("key.json"));
        if !is_new && !key.is_ok_and(|key| key.format == KEY_FORMAT) {
            return Err(PrepError::unusable(
                out,
                "exists and is not a survey; it is not replaced: choose another --out",
            ));
        }
        // What is not finished is resumed.
        if self.file(SURVEY).exists() {
            check_free(out, force, "--out")?;
        }
        Ok(())
    }

    /// A file or folder of the survey.
    pub(super) fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// The folder of what was found in each house.
    fn parts(&self) -> PathBuf {
        self.0.join(WORK).join("houses")
    }

    /// What was found in a house.
    pub(super) fn part(&self, house: &HouseName) -> PathBuf {
        self.parts().join(format!("{}.json", house.0))
    }

    /// The right to search a house. Fails where another process does, or makes the whole survey.
    pub(super) fn lease_of_house(&self, house: &HouseName) -> Result<Lease, FileError> {
        self.leases().part(&house.0)
    }

    /// The right to make the whole survey. Fails where another process does, or searches a house.
    pub(super) fn lease_of_whole(&self) -> Result<Lease, FileError> {
        self.leases().whole([])
    }

    fn leases(&self) -> LeaseSet {
        LeaseSet { folder: self.0.join(WORK).join("leases"), part: "house", whole: "the survey" }
    }

    /// Marks the survey as not finished, since what was found in a house may change. For the holder of a lease.
    pub(super) fn reopen(&self, force: bool) -> Result<(), PrepError> {
        // Another process may have finished it while this one waited for its turn.
        self.check_place(force)?;
        Ok(remove(&self.file(SURVEY))?)
    }

    /// Removes what was found in houses that are no longer searched.
    pub(super) fn keep_only(&self, houses: &[HouseName]) -> Result<(), PrepError> {
        let parts = self.parts();
        let entries = std::fs::read_dir(&parts).map_err(FileError::io("list", &parts))?;
        for entry in entries.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let Some(house) = name.strip_suffix(".json").map(|name| HouseName(name.to_owned())) else { continue };
            if !houses.contains(&house) {
                remove(&self.file(&house.thumbnails()))?;
                remove(&entry.path())?;
            }
        }
        Ok(())
    }
}

/// The name that a house has in the survey's folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct HouseName(String);

impl HouseName {
    /// That of a house's file, relative to the source's folder. Houses of one name in different folders differ.
    pub(super) fn new(file: &str) -> Self {
        let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
        let hash = sha256_of_bytes(file.as_bytes());
        Self(format!("{}-{}", ids::id_text_from(&stem, "house"), &hash[..8]))
    }

    /// The folder of its thumbnails, relative to the survey's.
    pub(super) fn thumbnails(&self) -> String {
        format!("{THUMBNAILS}/{}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn houses_of_one_name_differ_by_their_folders() {
        let [one, other] = ["a/x.json", "b/x.json"].map(HouseName::new);
        assert!(one != other && one.0.starts_with("x-") && other.thumbnails().starts_with("thumbnails/x-"));
        assert_eq!(one, HouseName::new("a/x.json"));
    }

    #[test]
    fn only_surveys_are_resumed_and_finished_ones_with_force_alone() {
        let place = tempfile::tempdir().unwrap();
        let out = place.path().join("out");
        SurveyFolder::begin(&out, false).unwrap();
        let folder = SurveyFolder::begin(&out, false).unwrap();
        std::fs::write(folder.file(SURVEY), "{}").unwrap();
        assert!(SurveyFolder::begin(&out, false).unwrap_err().to_string().contains("--force"));
        SurveyFolder::begin(&out, true).unwrap().reopen(true).unwrap();
        assert!(!folder.file(SURVEY).exists());
        let other = place.path().join("other");
        std::fs::create_dir(&other).unwrap();
        std::fs::write(other.join("notes.txt"), "mine").unwrap();
        assert!(SurveyFolder::begin(&other, true).unwrap_err().to_string().contains("choose another --out"));
    }
}
