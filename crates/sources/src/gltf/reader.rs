//! The state that all parts of the reader share: the file, the scene under construction, its findings, and the features
//! that it cannot represent, counted by kind: one finding a kind, however often it occurs.

use std::collections::{BTreeMap, BTreeSet};

use mateval_dataset::gltf_file::GltfFile;
use mateval_dataset::material::{StatedParameters, TextureIndex};
use mateval_dataset::reference::{Emission, EmissionMap, LightGroup, MaterialIndex, ReferenceScene};
use mateval_files::source_folder::SourceFolder;
use mateval_files::untrusted::shortened;

use super::document::Limits;
use crate::log::{Log, UniqueNames};
use crate::source_scene::InstanceOrigin;

pub(super) struct Reader<'a> {
    pub(super) file: &'a GltfFile,
    pub(super) buffers: &'a [Vec<u8>],
    pub(super) limits: Limits,
    pub(super) log: Log,
    /// The features that were left out so far, by kind.
    pub(super) omitted: BTreeMap<(Omission, String), Occurrences>,
    pub(super) source: SourceFolder,
    pub(super) scene: ReferenceScene,
    pub(super) origins: Vec<InstanceOrigin>,
    /// Every texture looked up so far. None stands for one that could not be used, which has been reported.
    pub(super) textures: BTreeMap<TextureKey, Option<TextureIndex>>,
    /// Images that could not be used.
    pub(super) faulty_images: BTreeSet<usize>,
    /// JSON pointers to references to textures without a picture.
    pub(super) without_picture: BTreeSet<&'a str>,
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
    /// Width over height that the scene's camera states.
    pub(super) aspect: Option<f64>,
}

impl<'a> Reader<'a> {
    /// Counts a feature at a JSON pointer that the scene cannot represent. `feature` begins a sentence that ends in
    /// "not represented", and `action` states what is done instead.
    pub(super) fn omit(&mut self, omission: Omission, feature: &str, action: &str, pointer: &str) {
        let first = || Occurrences { count: 0, first: pointer.to_owned(), action: action.to_owned() };
        self.omitted.entry((omission, feature.to_owned())).or_insert_with(first).count += 1;
    }

    /// Counts the extensions of an object that the scene cannot represent.
    pub(super) fn omit_extensions<'n>(&mut self, names: impl Iterator<Item = &'n String>, pointer: &str) {
        for name in names {
            self.omit(Omission::Visible, &shortened(name), LEFT_OUT, pointer);
        }
    }

    /// Adds a light, unless there are as many as the limit allows, which is reported. Returns whether it was added. A
    /// number makes its name unique.
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

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ReadMaterial {
    pub(super) index: MaterialIndex,
    /// The set of texture coordinates that its textures are looked up at; absent if it has no texture.
    pub(super) uv_set: Option<u32>,
    /// What the file states of it.
    pub(super) stated: StatedParameters,
    pub(super) glow: Option<Glow>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Glow {
    /// Linear Rec. 709 radiance.
    pub(super) radiance: [f32; 3],
    pub(super) map: Option<EmissionMap>,
    pub(super) two_sided: bool,
}

/// The aspect of an image that a texture holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Aspect {
    /// The sRGB colour, times a linear factor for each channel, given by its bits.
    Color([u32; 3]),
    /// The linear values of all channels.
    Values,
    /// One channel's linear values, times a factor, given by its bits.
    Channel(usize, u32),
    /// The alpha channel, times a factor, given by its bits.
    Alpha(u32),
    /// 1 where the alpha channel, times a factor, reaches a threshold, else 0; both are given by their bits.
    Mask(u32, u32),
}

/// The image's index in the file, a number for each wrap mode, and the aspect. Textures with equal keys are equal.
pub(super) type TextureKey = (usize, u8, Aspect);

/// What is done with most features that cannot be represented.
pub(super) const LEFT_OUT: &str = "left it out";

/// The occurrences of one kind of feature.
#[derive(Debug)]
pub(super) struct Occurrences {
    count: usize,
    /// The JSON pointer of the first.
    first: String,
    action: String,
}

/// Whether leaving a feature out changes how the scene looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Omission {
    /// It does: a warning.
    Visible,
    /// It does not, or hardly: a note.
    Slight,
}

/// Reports every kind of omitted feature with its count.
pub(super) fn report_omitted(omitted: BTreeMap<(Omission, String), Occurrences>, log: &mut Log) {
    for ((omission, feature), Occurrences { count, first, action }) in omitted {
        let times = if count == 1 { String::new() } else { format!(" ({count} times; the first is named)") };
        let message = format!("{feature}: not represented{times}");
        match omission {
            Omission::Visible => log.warn("not_represented", &first, message, action),
            Omission::Slight => log.note("not_represented", &first, message, action),
        }
    }
}
