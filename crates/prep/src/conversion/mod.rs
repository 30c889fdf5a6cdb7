//! Converts a source's materials to the model that is scored: base colour, roughness, metallic, and nothing else.
//!
//! In: a scene with its source's materials. Out: the same scene whose materials are Blender's principled with a `specular`
//! of 0.5, two-sided and without bump maps, as every prediction is rendered; and the source's own materials, for whoever
//! wants the author's picture. Glass keeps its model; opacities and lights stay as they are.
//!
//! One rule gives every base colour: the converted material reflects the same share of uniform light as its source, channel
//! by channel. `base_color` holds the rule, `derived` applies it to textures.

mod base_color;
mod derived;
#[cfg(test)]
mod tests;

use mateval_scene::material::{
    ColorInput, ConductorIor, Material, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput,
};
use mateval_scene::reference::{Emission, MaterialIndex, ReferenceScene};
use mateval_scene::source_materials::SourceMaterials;
use mateval_scene::{Finding, Severity};
use mateval_tracer::bsdf::ReflectanceMeter;
use mateval_tracer::repaint::SPECULAR;
use mateval_tracer::{MaterialFault, SceneFault, TracerError};

use base_color::BaseColorRule;
use derived::DerivedTextures;

/// A scene with converted materials.
#[derive(Clone, Debug, PartialEq)]
pub struct Conversion {
    /// The scene; only its materials and their textures differ from the source's.
    pub scene: ReferenceScene,
    /// The source's materials; none where all of them are of the scored model already.
    pub source: Option<SourceMaterials>,
    /// What could be converted only approximately.
    pub findings: Vec<Finding>,
}

/// Converts the materials of `scene`. Findings name `file`. Fails where a parameter of a material is out of range.
pub fn convert(scene: ReferenceScene, file: &str) -> Result<Conversion, TracerError> {
    if scene.materials.iter().all(is_scored_model) {
        return Ok(Conversion { scene, source: None, findings: Vec::new() });
    }
    let mut converter = Converter {
        meter: ReflectanceMeter::default(),
        textures: DerivedTextures::new(&scene.textures),
        rules: Vec::new(),
        findings: Vec::new(),
        file,
    };
    let mut materials = Vec::with_capacity(scene.materials.len());
    for (index, material) in scene.materials.iter().enumerate() {
        let located = |fault| {
            let (material, name) = (MaterialIndex(index), material.name.clone());
            TracerError::InvalidScene(SceneFault::Material { material, name, fault })
        };
        materials.push(converter.material(material).map_err(located)?);
    }
    let mut lights = scene.lights.clone();
    for light in &mut lights {
        match &mut light.emission {
            Emission::Area { map: Some(map), .. } => map.texture = converter.textures.unchanged(map.texture),
            Emission::Environment { texture, .. } => *texture = converter.textures.unchanged(*texture),
            Emission::Area { map: None, .. } | Emission::Constant { .. } => {}
        }
    }
    let findings = converter.findings;
    let textures = converter.textures.into_list();
    let source = Some(SourceMaterials::of(&scene));
    let scene = ReferenceScene { surfaces: scene.surfaces, materials, textures, lights };
    Ok(Conversion { scene, source, findings })
}

/// Whether a prediction could be exactly this material, or it is glass, which is not predicted.
pub fn is_scored_model(material: &Material) -> bool {
    let is_model = match &material.model {
        MaterialModel::Principled { base_color, roughness, metallic, specular, flavour } => {
            let unit = |value: f32| (0.0..=1.0).contains(&value);
            let color_in_range = match base_color {
                ColorInput::Constant(rgb) => rgb.iter().all(|v| unit(*v)),
                ColorInput::Texture { .. } => true,
            };
            let numbers_in_range = [roughness, metallic].into_iter().all(|number| match number {
                ScalarInput::Constant(value) => unit(*value),
                ScalarInput::Texture { .. } => true,
            });
            let is_ours = *specular == SPECULAR && *flavour == PrincipledFlavour::Blender;
            is_ours && material.two_sided && color_in_range && numbers_in_range
        }
        MaterialModel::Dielectric { .. } | MaterialModel::ThinDielectric { .. } => true,
        MaterialModel::Diffuse { .. } | MaterialModel::Conductor { .. } | MaterialModel::Plastic { .. } => false,
    };
    is_model && material.bump.is_none()
}

/// The principled model as every prediction is rendered.
fn scored_model(base_color: ColorInput, roughness: ScalarInput, metallic: ScalarInput) -> MaterialModel {
    let (specular, flavour) = (SPECULAR, PrincipledFlavour::Blender);
    MaterialModel::Principled { base_color, roughness, metallic, specular, flavour }
}

struct Converter<'a> {
    meter: ReflectanceMeter,
    textures: DerivedTextures<'a>,
    /// The rules measured so far, by the models that they were measured on.
    rules: Vec<([MaterialModel; 2], BaseColorRule)>,
    findings: Vec<Finding>,
    file: &'a str,
}

impl Converter<'_> {
    fn material(&mut self, source: &Material) -> Result<Material, MaterialFault> {
        let kept = Material { bump: None, ..source.clone() };
        let Some(model) = self.model(source)? else {
            return Ok(self.textures.unchanged_material(kept));
        };
        let opacity = kept.opacity.map(|opacity| self.textures.scalar(opacity, None));
        Ok(Material { model, two_sided: true, opacity, ..kept })
    }

    /// The scored model of a material; none for glass.
    fn model(&mut self, source: &Material) -> Result<Option<MaterialModel>, MaterialFault> {
        let white = |color: &ColorInput| matches!(color, ColorInput::Constant(rgb) if *rgb == [1.0; 3]);
        let model = match source.model {
            MaterialModel::Diffuse { reflectance, alpha } => {
                let alpha = alpha.map(|alpha| ScalarInput::Constant(self.constant_alpha(alpha, source)));
                let even = |reflectance| MaterialModel::Diffuse { reflectance, alpha };
                let rule = self.rule(even, 1.0, 0.0)?;
                let base_color = self.color(reflectance, &rule, source);
                scored_model(base_color, ScalarInput::Constant(1.0), ScalarInput::Constant(0.0))
            }
            MaterialModel::Plastic { eta, nonlinear, diffuse_reflectance, specular_reflectance, microfacets } => {
                let (roughness, microfacets) = self.facets(microfacets, source);
                let tint = self.mean_color(specular_reflectance, source);
                let even = |diffuse_reflectance| MaterialModel::Plastic {
                    eta,
                    nonlinear,
                    diffuse_reflectance,
                    specular_reflectance: ColorInput::Constant(tint),
                    microfacets,
                };
                let rule = self.rule(even, even_roughness(microfacets), 0.0)?;
                let base_color = self.color(diffuse_reflectance, &rule, source);
                scored_model(base_color, roughness, ScalarInput::Constant(0.0))
            }
            MaterialModel::Conductor { ior: ConductorIor::PerfectMirror, specular_reflectance, microfacets: None }
                if white(&specular_reflectance) =>
            {
                scored_model(ColorInput::Constant([1.0; 3]), ScalarInput::Constant(0.0), ScalarInput::Constant(1.0))
            }
            MaterialModel::Conductor { ior, specular_reflectance, microfacets } => {
                let (roughness, microfacets) = self.facets(microfacets, source);
                let even = |specular_reflectance| MaterialModel::Conductor { ior, specular_reflectance, microfacets };
                let rule = self.rule(even, even_roughness(microfacets), 1.0)?;
                let base_color = self.color(specular_reflectance, &rule, source);
                scored_model(base_color, roughness, ScalarInput::Constant(1.0))
            }
            MaterialModel::Principled { base_color, roughness, metallic, .. } => {
                let base_color = self.color(base_color, &BaseColorRule::identity(), source);
                let mut unit = |number| self.textures.scalar(number, Some(|value| value.clamp(0.0, 1.0)));
                scored_model(base_color, unit(roughness), unit(metallic))
            }
            MaterialModel::Dielectric { .. } | MaterialModel::ThinDielectric { .. } => return Ok(None),
        };
        Ok(Some(model))
    }

    /// The rule for models that differ only in their colour, which `even` makes; `roughness` and `metallic` are those of
    /// the converted material.
    fn rule(
        &mut self,
        even: impl Fn(ColorInput) -> MaterialModel,
        roughness: f32,
        metallic: f32,
    ) -> Result<BaseColorRule, MaterialFault> {
        let numbers = [roughness, metallic].map(ScalarInput::Constant);
        let scored = |base_color| scored_model(base_color, numbers[0], numbers[1]);
        let key = [even(ColorInput::Constant([0.5; 3])), scored(ColorInput::Constant([0.5; 3]))];
        if let Some((_, rule)) = self.rules.iter().find(|(known, _)| *known == key) {
            return Ok(rule.clone());
        }
        let rule = BaseColorRule::measure(&mut self.meter, even, scored, metallic)?;
        self.rules.push((key, rule.clone()));
        Ok(rule)
    }

    /// The base colour of a source's colour.
    fn color(&mut self, color: ColorInput, rule: &BaseColorRule, material: &Material) -> ColorInput {
        let (base_color, clipped) = self.textures.color(color, rule);
        if clipped {
            let message = "its colour exceeds 0..1";
            self.finding(material, Severity::Warning, "base_color_clipped", message, "clipped it");
        }
        base_color
    }

    /// The roughness of facets, and the facets with an even alpha for the measurement.
    fn facets(&mut self, microfacets: Option<Microfacets>, material: &Material) -> (ScalarInput, Option<Microfacets>) {
        let Some(microfacets) = microfacets else { return (ScalarInput::Constant(0.0), None) };
        let roughness = self.textures.scalar(microfacets.alpha, Some(|alpha| alpha.clamp(0.0, 1.0).sqrt()));
        let alpha = ScalarInput::Constant(self.constant_alpha(microfacets.alpha, material));
        (roughness, Some(Microfacets { alpha, ..microfacets }))
    }

    fn constant_alpha(&mut self, alpha: ScalarInput, material: &Material) -> f32 {
        let (mean, textured) = self.textures.mean_scalar(alpha);
        if textured {
            self.mean_finding(material, "alpha");
        }
        mean
    }

    fn mean_color(&mut self, color: ColorInput, material: &Material) -> [f32; 3] {
        let (mean, textured) = self.textures.mean_color(color);
        if textured {
            self.mean_finding(material, "specular reflectance");
        }
        mean
    }

    fn mean_finding(&mut self, material: &Material, parameter: &str) {
        let message = format!("its {parameter} varies over the surface, and its base colour depends on it");
        self.finding(material, Severity::Note, "converted_by_mean", &message, "converted its base colour for the mean");
    }

    fn finding(&mut self, material: &Material, severity: Severity, code: &str, message: &str, action: &str) {
        self.findings.push(Finding {
            severity,
            code: code.to_owned(),
            file: self.file.to_owned(),
            place: format!("material '{}'", mateval_scene::findings::shortened(&material.name)),
            message: message.to_owned(),
            action: action.to_owned(),
        });
    }
}

/// The perceptual roughness of facets with an even alpha.
fn even_roughness(microfacets: Option<Microfacets>) -> f32 {
    match microfacets.map(|microfacets| microfacets.alpha) {
        Some(ScalarInput::Constant(alpha)) => alpha.clamp(0.0, 1.0).sqrt(),
        _ => 0.0,
    }
}
