//! The state that all parts of the reader share: the scene under construction, its files and its findings.

use std::collections::BTreeMap;

use glam::DVec3;
use mateval_scene::Severity;
use mateval_scene::material::{StatedParameters, TextureIndex};
use mateval_scene::reference::{LightGroup, MaterialIndex, ReferenceScene};

use super::document::{Element, Ids};
use super::limits::Limits;
use super::parameters::Parameters;
use super::texture_key::TextureKey;
use crate::source_scene::Log;
use crate::source_scene::UniqueNames;
use mateval_scene::source_folder::{FileFault, SourceFolder};

/// A scene under construction.
pub(super) struct Reader<'a> {
    pub(super) ids: Ids<'a>,
    /// 0 for Mitsuba 0.5 and 0.6.
    pub(super) major_version: u32,
    pub(super) limits: Limits,
    pub(super) log: Log,
    pub(super) source: SourceFolder,
    /// Folders in which files are looked for besides the scene's own, from `<path>`.
    pub(super) search: Vec<String>,
    /// Shapes that could not be read at all.
    pub(super) left_out: Vec<String>,
    /// What is subtracted from all positions.
    pub(super) shift_m: DVec3,
    pub(super) scene: ReferenceScene,
    /// Every texture looked up so far. None stands for a file that could not be used, which has been reported.
    pub(super) textures: BTreeMap<TextureKey, Option<TextureIndex>>,
    /// Texels of all textures.
    pub(super) texels: usize,
    /// By file: whether it has an alpha channel that is not 1 everywhere.
    pub(super) alphas: BTreeMap<String, bool>,
    /// For each material of the scene, which of its parameters are stated.
    pub(super) stated: Vec<StatedParameters>,
    /// By the serial number of the BSDF's element.
    pub(super) materials: BTreeMap<usize, MaterialIndex>,
    pub(super) totals: Totals,
    pub(super) has_environment: bool,
    pub(super) light_names: UniqueNames,
}

/// Totals over the shapes read so far.
#[derive(Debug, Default)]
pub(super) struct Totals {
    pub(super) triangles: usize,
    pub(super) vertices: usize,
    pub(super) mesh_bytes: u64,
}

impl<'a> Reader<'a> {
    /// The parameters of `element`; their findings are reported at `place`.
    pub(super) fn parameters(&mut self, element: &'a Element, place: String) -> Parameters<'a> {
        Parameters::new(element, place, &self.ids, &mut self.log)
    }

    /// The file `name` relative to the scene's folder: there, or else in the first folder of `<path>` that has it.
    pub(super) fn file(&self, name: &str) -> Result<String, FileFault> {
        let own = SourceFolder::relative(name)?;
        let folders = self.search.iter().filter(|_| !self.source.contains(&own));
        let mut found = folders.filter_map(|folder| SourceFolder::relative(&format!("{folder}/{own}")).ok());
        Ok(found.find(|file| self.source.contains(file)).unwrap_or(own))
    }

    /// Reports that the file `name` could not be used. The finding names that file where the name is valid, else the XML.
    pub(super) fn report_file(&mut self, name: &str, place: &str, line: usize, fault: &FileFault, action: &str) {
        let about = SourceFolder::relative(name).unwrap_or_else(|_| self.log.file().to_owned());
        let message = format!("{} (named in '{}' line {line})", fault.message, self.log.file());
        self.log.push(Severity::Warning, fault.code, &about, place, message, action);
    }

    /// Adds a light. A number makes its name unique.
    pub(super) fn add_light(&mut self, light: LightGroup) {
        let name = self.light_names.unique(light.name);
        self.scene.lights.push(LightGroup { name, ..light });
    }
}
