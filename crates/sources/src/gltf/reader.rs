//! The state that all parts of the reader share: the file, the scene under construction and its findings.

use std::collections::{BTreeMap, BTreeSet};

use mateval_scene::findings::shortened;
use mateval_scene::gltf_file::GltfFile;
use mateval_scene::material::TextureIndex;
use mateval_scene::reference::{Emission, LightGroup, ReferenceScene};
use mateval_scene::source_folder::SourceFolder;

use super::limits::Limits;
use super::omitted::{LEFT_OUT, Omission, Omitted};
use super::read_material::ReadMaterial;
use super::texture_key::TextureKey;
use crate::log::Log;
use crate::source_scene::InstanceOrigin;
use crate::unique_names::UniqueNames;

/// A scene under construction.
pub(super) struct Reader<'a> {
    pub(super) file: &'a GltfFile,
    pub(super) buffers: &'a [Vec<u8>],
    pub(super) limits: Limits,
    pub(super) log: Log,
    pub(super) omitted: Omitted,
    pub(super) source: SourceFolder,
    pub(super) scene: ReferenceScene,
    /// Facts about each surface.
    pub(super) origins: Vec<InstanceOrigin>,
    /// Every texture looked up so far. None stands for one that could not be used, which has been reported.
    pub(super) textures: BTreeMap<TextureKey, Option<TextureIndex>>,
    /// Images that could not be used.
    pub(super) faulty_images: BTreeSet<usize>,
    /// JSON pointers to references to textures without a picture.
    pub(super) without_picture: BTreeSet<&'a str>,
    /// Texels of all textures.
    pub(super) texels: usize,
    /// By index in the file; none for the material of primitives without one.
    pub(super) materials: BTreeMap<Option<usize>, ReadMaterial>,
    /// Primitives of all nodes so far.
    pub(super) primitives: usize,
    /// Triangles of all instances, with those that turned out to be faulty.
    pub(super) triangles: usize,
    /// Vertices of all instances, with those that turned out to be faulty.
    pub(super) vertices: usize,
    pub(super) light_names: UniqueNames,
}

impl<'a> Reader<'a> {
    /// A reader of a file with these buffers.
    pub(super) fn new(
        file: &'a GltfFile,
        buffers: &'a [Vec<u8>],
        limits: &Limits,
        log: Log,
        source: SourceFolder,
    ) -> Self {
        Self {
            file,
            buffers,
            limits: *limits,
            log,
            omitted: Omitted::default(),
            source,
            scene: ReferenceScene::default(),
            origins: Vec::new(),
            textures: BTreeMap::new(),
            faulty_images: BTreeSet::new(),
            without_picture: file.without_picture.iter().map(String::as_str).collect(),
            texels: 0,
            materials: BTreeMap::new(),
            primitives: 0,
            triangles: 0,
            vertices: 0,
            light_names: UniqueNames::default(),
        }
    }

    /// Counts a feature that the scene cannot represent.
    pub(super) fn omit(&mut self, omission: Omission, feature: &str, action: &str, pointer: &str) {
        self.omitted.add(omission, feature, action, pointer);
    }

    /// Counts the extensions of an object that the scene cannot represent.
    pub(super) fn omit_extensions<'n>(&mut self, names: impl Iterator<Item = &'n String>, pointer: &str) {
        for name in names {
            self.omit(Omission::Visible, &shortened(name), LEFT_OUT, pointer);
        }
    }

    /// Adds a light, unless there are as many as the limit allows, which is reported. Returns whether it was added. A number
    /// makes its name unique.
    pub(super) fn add_light(&mut self, name: &str, emission: Emission, camera_visible: bool, pointer: &str) -> bool {
        if self.scene.lights.len() >= self.limits.lights {
            let feature = format!("lights beyond {}", self.limits.lights);
            self.omit(Omission::Visible, &feature, LEFT_OUT, pointer);
            return false;
        }
        let name = self.light_names.unique(name.to_owned());
        self.scene.lights.push(LightGroup { name, emission, camera_visible });
        true
    }
}
