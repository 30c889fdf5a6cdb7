//! Materials of `KHR_materials_pbrSpecularGlossiness`, which writers used before 2021.

use gltf::material::PbrSpecularGlossiness;
use mateval_image::texture_io::Encoding;
use mateval_image::{Texels, Texture};
use mateval_scene::material::{ColorInput, ScalarInput, TextureIndex};
use mateval_scene::reference::SourceTexture;
use mateval_scene::specular_glossiness::{SpecularGlossiness, SpecularTextures, textures};

use super::lookup::{Lookup, wraps};
use super::omitted::Omission;
use super::reader::Reader;

impl Reader<'_> {
    /// Base colour, roughness and metallic of the material at `pointer`, whose textures are looked up as `diffuse` and
    /// `specular` state. `states_specular` is whether the file has a specular colour.
    pub(super) fn specular_glossiness(
        &mut self,
        material: &PbrSpecularGlossiness<'_>,
        states_specular: bool,
        diffuse: Option<&Lookup<'_>>,
        specular: Option<&Lookup<'_>>,
        pointer: &str,
    ) -> (ColorInput, [ScalarInput; 2]) {
        let factors = SpecularGlossiness::of(material, states_specular);
        self.omit(
            Omission::Slight,
            "specular-glossiness (KHR_materials_pbrSpecularGlossiness)",
            "converted it to base colour, roughness and metallic",
            pointer,
        );
        // Two textures are combined texel by texel, which needs one lookup.
        let same = |one: &Lookup<'_>, other: &Lookup<'_>| (one.set, one.uv) == (other.set, other.uv);
        if let (Some(one), Some(other)) = (diffuse, specular)
            && !same(one, other)
        {
            let feature = "a specular texture that is looked up elsewhere than the diffuse one";
            self.omit(Omission::Visible, feature, "looked it up where the diffuse one is", pointer);
        }
        let read = |reader: &mut Self, lookup: Option<&Lookup<'_>>| {
            let lookup = lookup?;
            let wrap = wraps(&lookup.texture)[0];
            reader.decoded(&lookup.texture.source(), Encoding::Srgb, wrap)
        };
        let (diffuse_texture, specular_texture) = (read(self, diffuse), read(self, specular));
        let Some(uv) = diffuse.or(specular).filter(|_| diffuse_texture.is_some() || specular_texture.is_some()) else {
            let constant = factors.converted();
            let numbers = [constant.roughness, constant.metallic].map(ScalarInput::Constant);
            return (ColorInput::Constant(constant.base_color), numbers);
        };
        let grey = |alpha: &Texture| {
            let texels = (0..alpha.height()).flat_map(|y| (0..alpha.width()).map(move |x| (x, y)));
            let texels = texels.map(|(x, y)| alpha.texel(x, y)[0]).collect();
            Texture::new(alpha.width(), alpha.height(), Texels::Grey(texels), alpha.wrap()).ok()
        };
        let glossiness = specular_texture.as_ref().and_then(|texture| grey(texture.alpha.as_ref()?));
        let from = SpecularTextures {
            diffuse: diffuse_texture.as_ref().map(|decoded| &decoded.color),
            specular: specular_texture.as_ref().map(|decoded| &decoded.color),
            glossiness: glossiness.as_ref(),
        };
        match textures(factors, from) {
            Ok([base, numbers]) => {
                let base = self.computed(format!("{pointer} base colour"), base);
                let numbers = self.computed(format!("{pointer} roughness and metallic"), numbers);
                let scalar = |channel| ScalarInput::Texture { texture: numbers, channel, uv: uv.uv };
                (ColorInput::Texture { texture: base, uv: uv.uv }, [scalar(1), scalar(2)])
            }
            Err(error) => {
                self.log.warn("bad_value", pointer, error.to_string(), "used the factors without textures");
                let constant = factors.converted();
                let numbers = [constant.roughness, constant.metallic].map(ScalarInput::Constant);
                (ColorInput::Constant(constant.base_color), numbers)
            }
        }
    }

    fn computed(&mut self, name: String, texture: Texture) -> TextureIndex {
        self.scene.textures.push(SourceTexture { name, sha256: None, texture });
        TextureIndex(self.scene.textures.len() - 1)
    }
}
