//! Materials of a house's surfaces and the textures that they use.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_dataset::Severity;
use mateval_dataset::material::MaterialClass;
use mateval_dataset::material::{
    ColorInput, Material, MaterialModel, PrincipledFlavour, ScalarInput, TextureIndex, UvTransform,
};
use mateval_dataset::reference::{MaterialIndex, SourceTexture};
use mateval_files::source_folder::FileFault;
use mateval_files::untrusted::shortened;
use mateval_image::texture_io::{Encoding, texture_and_alpha_of_bytes};
use mateval_image::transfer::linear_from_srgb;
use mateval_image::{Texels, Texture, Wrap};

use super::house::{House, HouseMaterial};
use super::material_class::{AppearanceRule, BLOCK, Finish, drawn};
use super::model::{Library, is_folder_name};
use crate::log::Log;
use crate::source_scene::{picture_fault, report_turned};

/// Linear mid-grey, which replaces a colour or texture that cannot be read.
pub(super) const MISSING: [f32; 3] = [0.5; 3];
/// The colour of a material that states none.
const WHITE: [f64; 3] = [255.0; 3];
/// Blender's default, which BlenderProc does not change. The data has no roughness.
const ROUGHNESS: f32 = 0.5;
const METALLIC: f32 = 0.0;

/// The materials and textures made so far, each once.
#[derive(Debug, Default)]
pub(super) struct Appearances {
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<SourceTexture>,
    texels: usize,
    most_texels: usize,
    /// Where roughness and metallic come from.
    pub(super) rule: AppearanceRule,
    /// By file. None stands for a file that is missing or faulty, which has been reported.
    known_textures: BTreeMap<String, Option<TextureIndex>>,
    /// By index in [`House::materials`] and by class.
    of_architecture: BTreeMap<(Option<usize>, Option<MaterialClass>), MaterialIndex>,
    of_models: BTreeMap<String, MaterialIndex>,
    /// Number of materials that name a texture although no folder of textures was given.
    untextured: usize,
}

impl Appearances {
    /// No materials yet. All textures may have at most `most_texels` texels.
    pub(super) fn new(most_texels: usize, rule: AppearanceRule) -> Self {
        Self { most_texels, rule, ..Self::default() }
    }

    /// The material of a model, whose classes `finish` states, and whether its texture could be read.
    pub(super) fn of_model(
        &mut self,
        jid: &str,
        finish: Option<&Finish>,
        models: &mut Library,
        log: &mut Log,
    ) -> (MaterialIndex, bool) {
        let texture = self.texture(jid, models, "used linear mid-grey", log);
        if let Some(known) = self.of_models.get(jid) {
            return (*known, texture.is_some());
        }
        let color = match texture {
            Some(texture) => ColorInput::Texture { texture, uv: UvTransform::default() },
            None => ColorInput::Constant(MISSING),
        };
        let numbers = self.numbers(jid, finish.map_or(&[], |finish| &finish.classes), finish.map(|finish| finish.uv));
        let index = self.add(jid.to_owned(), color, numbers);
        self.of_models.insert(jid.to_owned(), index);
        (index, texture.is_some())
    }

    /// The material made of `house.materials[material]` in a class, and its colour. Without a material it is mid-grey.
    pub(super) fn of_architecture(
        &mut self,
        house: &House,
        material: Option<usize>,
        class: Option<MaterialClass>,
        textures: Option<&mut Library>,
        log: &mut Log,
    ) -> (MaterialIndex, [f32; 3]) {
        let source = material.map(|material| &house.materials[material]);
        let plain =
            source.map_or(MISSING, |source| source.color.unwrap_or(WHITE).map(|v| linear_from_srgb(v as f32 / 255.0)));
        if let Some(known) = self.of_architecture.get(&(material, class)) {
            return (*known, plain);
        }
        let texture = source.and_then(|source| self.architecture_texture(source, textures, log));
        let color = match (texture, source) {
            (Some(texture), Some(source)) => ColorInput::Texture { texture, uv: source.uv },
            _ => ColorInput::Constant(plain),
        };
        let name = source.map_or("none", |source| source.uid.as_str());
        let numbers = self.numbers(name, class.as_slice(), None);
        let index = self.add(name.to_owned(), color, numbers);
        self.of_architecture.insert((material, class), index);
        (index, plain)
    }

    /// Whether a material of the house states its base colour: by a texture that could be read, or by a colour. The
    /// colour of a material whose texture is lost is the white that the texture multiplies; it counts only where the
    /// maker has given no textures at all.
    pub(super) fn states_color(&self, source: &HouseMaterial, index: MaterialIndex, has_textures: bool) -> bool {
        let MaterialModel::Principled { base_color, .. } = self.materials[index.0].model else { return false };
        let is_lost = has_textures && source.texture.is_some();
        matches!(base_color, ColorInput::Texture { .. }) || source.color.is_some() && !is_lost
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
        let index = match self.read(&relative, &shown, library, log) {
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
    fn read(
        &mut self,
        relative: &str,
        shown: &str,
        library: &mut Library,
        log: &mut Log,
    ) -> Result<SourceTexture, FileFault> {
        let code = |code| if code == "missing_file" { "missing_texture" } else { code };
        let bytes = library.folder.read(relative).map_err(|fault| FileFault { code: code(fault.code), ..fault })?;
        report_turned(&bytes, shown, "", log);
        let (texture, _) = texture_and_alpha_of_bytes(Path::new(shown), bytes, Encoding::Srgb, Wrap::Repeat)
            .map_err(|error| picture_fault("unreadable_texture", &error))?;
        self.texels = self.texels.saturating_add(texture.width() * texture.height());
        if self.texels > self.most_texels {
            let message = format!("all textures together have more than {} texels", self.most_texels);
            return Err(FileFault { code: "limit", message });
        }
        let sha256 = library.folder.hash(relative);
        Ok(SourceTexture { name: shown.to_owned(), sha256, texture: texture.collapsed() })
    }

    /// Roughness and metallic of the material `id`: constants, or for several classes a texture that is looked up at
    /// `uv`.
    fn numbers(&mut self, id: &str, classes: &[MaterialClass], uv: Option<UvTransform>) -> [ScalarInput; 2] {
        let drawn: Vec<[f32; 2]> = match self.rule {
            AppearanceRule::Constant => vec![[ROUGHNESS, METALLIC]],
            AppearanceRule::Stated { seed } => classes.iter().map(|class| drawn(*class, id, seed)).collect(),
        };
        if let [one] = drawn[..] {
            return one.map(ScalarInput::Constant);
        }
        let texels: Vec<[f32; 3]> =
            drawn.iter().flat_map(|[roughness, metallic]| [[*roughness, *metallic, 0.0]; BLOCK]).collect();
        let texture = Texture::new(texels.len(), 1, Texels::Linear(texels), Wrap::Clamp);
        let texture = texture.expect("a row of texels is a texture");
        self.textures.push(SourceTexture { name: format!("classes of {id}"), sha256: None, texture });
        let (texture, uv) = (TextureIndex(self.textures.len() - 1), uv.unwrap_or_default());
        [0, 1].map(|channel| ScalarInput::Texture { texture, channel, uv })
    }

    fn add(&mut self, name: String, base_color: ColorInput, [roughness, metallic]: [ScalarInput; 2]) -> MaterialIndex {
        let flavour = PrincipledFlavour::Blender;
        let model = MaterialModel::Principled { base_color, roughness, metallic, specular: 0.5, flavour };
        self.materials.push(Material::new(name, model));
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
