//! What surfaces of a house look like: textures by folder, and the materials that use them.

use std::collections::BTreeMap;

use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::transfer::linear_from_srgb;
use mateval_image::{ImageError, Wrap};
use mateval_scene::Severity;
use mateval_scene::material::{
    ColorInput, Material, MaterialModel, PrincipledFlavour, ScalarInput, TextureIndex, UvTransform,
};
use mateval_scene::reference::{MaterialIndex, SourceTexture};

use super::house::{House, HouseMaterial};
use super::model::{Library, is_folder_name};
use crate::log::Log;
use mateval_scene::findings::shortened;

/// What stands for a colour that cannot be read: linear mid-grey.
pub(super) const MISSING: [f32; 3] = [0.5; 3];
/// Blender's default, which BlenderProc leaves: the data says nothing of roughness.
const ROUGHNESS: f32 = 0.5;

/// Materials and textures so far, each once.
#[derive(Debug)]
pub(super) struct Appearances {
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<SourceTexture>,
    /// Texels of all textures together, and the most there may be.
    texels: usize,
    most_texels: usize,
    /// By file; none: it is not there or not sound, and that has been told.
    known_textures: BTreeMap<String, Option<TextureIndex>>,
    /// By their place in the house.
    of_layout: BTreeMap<Option<usize>, MaterialIndex>,
    /// By model.
    of_models: BTreeMap<String, MaterialIndex>,
    /// Materials with a texture, where no folder of textures was given.
    untextured: usize,
}

impl Appearances {
    /// None yet; `most_texels` may come.
    pub(super) fn new(most_texels: usize) -> Self {
        Self {
            materials: Vec::new(),
            textures: Vec::new(),
            texels: 0,
            most_texels,
            known_textures: BTreeMap::new(),
            of_layout: BTreeMap::new(),
            of_models: BTreeMap::new(),
            untextured: 0,
        }
    }

    /// The material of a model, and whether its texture was there.
    pub(super) fn of_model(&mut self, jid: &str, models: &mut Library, log: &mut Log) -> (MaterialIndex, bool) {
        let texture = self.texture(jid, models, "took linear mid-grey", log);
        if let Some(known) = self.of_models.get(jid) {
            return (*known, texture.is_some());
        }
        let color = match texture {
            Some(texture) => ColorInput::Texture { texture, uv: UvTransform::default() },
            None => ColorInput::Constant(MISSING),
        };
        let index = self.add(jid.to_owned(), color);
        self.of_models.insert(jid.to_owned(), index);
        (index, texture.is_some())
    }

    /// The material at this place in the house, and its plain colour.
    pub(super) fn of_layout(
        &mut self,
        house: &House,
        place: Option<usize>,
        textures: Option<&mut Library>,
        log: &mut Log,
    ) -> (MaterialIndex, [f32; 3]) {
        let source = place.map(|place| &house.materials[place]);
        let plain = source.map_or(MISSING, |source| source.color.map(|v| linear_from_srgb(v as f32 / 255.0)));
        if let Some(known) = self.of_layout.get(&place) {
            return (*known, plain);
        }
        let texture = source.and_then(|source| self.layout_texture(source, textures, log));
        let color = match (texture, source) {
            (Some(texture), Some(source)) => ColorInput::Texture { texture, uv: source.uv },
            _ => ColorInput::Constant(plain),
        };
        let name = source.map_or("none", |source| source.uid.as_str());
        let index = self.add(name.to_owned(), color);
        self.of_layout.insert(place, index);
        (index, plain)
    }

    fn layout_texture(
        &mut self,
        source: &HouseMaterial,
        textures: Option<&mut Library>,
        log: &mut Log,
    ) -> Option<TextureIndex> {
        let jid = source.texture.as_deref()?;
        if !is_folder_name(jid) {
            let message = format!("'{}' is no folder's name", shortened(jid));
            log.warn("bad_jid", &format!("{}/jid", source.place), message, "took the colour");
            return None;
        }
        self.untextured += usize::from(textures.is_none());
        self.texture(jid, textures?, "took the colour", log)
    }

    /// `<id>/texture.png`; none, after one finding, where it cannot be read.
    fn texture(&mut self, id: &str, library: &mut Library, action: &str, log: &mut Log) -> Option<TextureIndex> {
        let relative = format!("{id}/texture.png");
        let shown = library.shown(&relative);
        if let Some(known) = self.known_textures.get(&shown) {
            return *known;
        }
        let index = match self.read(&relative, &shown, library) {
            Ok(texture) => {
                self.textures.push(texture);
                Some(TextureIndex(self.textures.len() - 1))
            }
            Err((code, message)) => {
                log.push(Severity::Warning, code, &shown, "", message, action);
                None
            }
        };
        self.known_textures.insert(shown, index);
        index
    }

    /// A texture; or the code and the words of what is wrong with it.
    fn read(
        &mut self,
        relative: &str,
        shown: &str,
        library: &mut Library,
    ) -> Result<SourceTexture, (&'static str, String)> {
        // Read for its hash first: the reader of pictures tells none.
        library.folder.read(relative).map_err(|fault| (missing_texture(fault.code), fault.message))?;
        let path = library.folder.path(relative).map_err(|fault| (fault.code, fault.message))?;
        let texture = read_texture(&path, Encoding::Srgb, Wrap::Repeat);
        let texture = texture.map_err(|error| ("unreadable_texture", told(&error)))?;
        self.texels = self.texels.saturating_add(texture.width() * texture.height());
        if self.texels > self.most_texels {
            return Err(("limit", format!("more than {} texels in all", self.most_texels)));
        }
        let sha256 = library.folder.hash(relative);
        Ok(SourceTexture { name: shown.to_owned(), sha256, texture: texture.collapsed() })
    }

    fn add(&mut self, name: String, base_color: ColorInput) -> MaterialIndex {
        self.materials.push(Material {
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
        MaterialIndex(self.materials.len() - 1)
    }

    /// Tells once of all materials that have a texture where no folder of textures was given.
    pub(super) fn note_untextured(&self, log: &mut Log) {
        if self.untextured > 0 {
            let message = format!("{} materials have a texture, and no folder of textures was given", self.untextured);
            log.warn("no_textures", "/material", message, "took their colours");
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
