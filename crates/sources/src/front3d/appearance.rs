//! Materials of a house's surfaces and the textures that they use.

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
use mateval_scene::source_folder::FileFault;

/// Linear mid-grey, which replaces a colour or texture that cannot be read.
pub(super) const MISSING: [f32; 3] = [0.5; 3];
/// Blender's default, which BlenderProc does not change. The data has no roughness.
const ROUGHNESS: f32 = 0.5;

/// The materials and textures made so far, each once.
#[derive(Debug)]
pub(super) struct Appearances {
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<SourceTexture>,
    /// Texels of all textures.
    texels: usize,
    most_texels: usize,
    /// By file. None stands for a file that is missing or faulty, which has been reported.
    known_textures: BTreeMap<String, Option<TextureIndex>>,
    /// By index in [`House::materials`].
    of_architecture: BTreeMap<Option<usize>, MaterialIndex>,
    /// By model id.
    of_models: BTreeMap<String, MaterialIndex>,
    /// Number of materials that name a texture although no folder of textures was given.
    untextured: usize,
}

impl Appearances {
    /// No materials yet. All textures may have at most `most_texels` texels.
    pub(super) fn new(most_texels: usize) -> Self {
        Self {
            materials: Vec::new(),
            textures: Vec::new(),
            texels: 0,
            most_texels,
            known_textures: BTreeMap::new(),
            of_architecture: BTreeMap::new(),
            of_models: BTreeMap::new(),
            untextured: 0,
        }
    }

    /// The material of a model, and whether its texture could be read.
    pub(super) fn of_model(&mut self, jid: &str, models: &mut Library, log: &mut Log) -> (MaterialIndex, bool) {
        let texture = self.texture(jid, models, "used linear mid-grey", log);
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

    /// The material made of `house.materials[material]`, and its colour. Without a material it is mid-grey.
    pub(super) fn of_architecture(
        &mut self,
        house: &House,
        material: Option<usize>,
        textures: Option<&mut Library>,
        log: &mut Log,
    ) -> (MaterialIndex, [f32; 3]) {
        let source = material.map(|material| &house.materials[material]);
        let plain = source.map_or(MISSING, |source| source.color.map(|v| linear_from_srgb(v as f32 / 255.0)));
        if let Some(known) = self.of_architecture.get(&material) {
            return (*known, plain);
        }
        let texture = source.and_then(|source| self.architecture_texture(source, textures, log));
        let color = match (texture, source) {
            (Some(texture), Some(source)) => ColorInput::Texture { texture, uv: source.uv },
            _ => ColorInput::Constant(plain),
        };
        let name = source.map_or("none", |source| source.uid.as_str());
        let index = self.add(name.to_owned(), color);
        self.of_architecture.insert(material, index);
        (index, plain)
    }

    fn architecture_texture(
        &mut self,
        source: &HouseMaterial,
        textures: Option<&mut Library>,
        log: &mut Log,
    ) -> Option<TextureIndex> {
        let jid = source.texture.as_deref()?;
        if !is_folder_name(jid) {
            let message = format!("expected the name of a folder, found '{}'", shortened(jid));
            log.warn("bad_jid", &format!("{}/jid", source.place), message, "used the colour");
            return None;
        }
        self.untextured += usize::from(textures.is_none());
        self.texture(jid, textures?, "used the colour", log)
    }

    /// The texture `<id>/texture.png`. None where it cannot be read, which is reported once.
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
            Err(fault) => {
                log.push(Severity::Warning, fault.code, &shown, "", fault.message, action);
                None
            }
        };
        self.known_textures.insert(shown, index);
        index
    }

    /// Reads a texture of the library.
    fn read(&mut self, relative: &str, shown: &str, library: &mut Library) -> Result<SourceTexture, FileFault> {
        // The folder reads the file for its hash, which the reader of pictures does not give.
        let code = |code| if code == "missing_file" { "missing_texture" } else { code };
        library.folder.read(relative).map_err(|fault| FileFault { code: code(fault.code), ..fault })?;
        let path = library.folder.path(relative)?;
        let texture = read_texture(&path, Encoding::Srgb, Wrap::Repeat).map_err(|error| picture_fault(&error))?;
        self.texels = self.texels.saturating_add(texture.width() * texture.height());
        if self.texels > self.most_texels {
            let message = format!("all textures together have more than {} texels", self.most_texels);
            return Err(FileFault { code: "limit", message });
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

    /// Reports the materials that name a texture although no folder of textures was given.
    pub(super) fn report_untextured(&self, log: &mut Log) {
        if self.untextured > 0 {
            let message = format!("{} materials have a texture, but no folder of textures was given", self.untextured);
            log.warn("no_textures", "/material", message, "used their colours");
        }
    }
}

/// The fault of a picture. Its message leaves out the path, which the finding gives.
fn picture_fault(error: &ImageError) -> FileFault {
    let message = match error {
        ImageError::Io { source, .. } => source.to_string(),
        ImageError::Invalid { what, .. } | ImageError::Unsupported { what, .. } => what.clone(),
        ImageError::PixelCount { .. } => error.to_string(),
    };
    FileFault { code: "unreadable_texture", message }
}
