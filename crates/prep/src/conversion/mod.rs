//! Converts a source's materials to the model that is scored: base colour, roughness, metallic, and nothing else.
//!
//! In: a scene with its source's materials. Out: the same scene whose materials are Blender's principled with a
//! `specular` of 0.5, two-sided and without bump maps, as every prediction is rendered; and the source's own materials,
//! for whoever wants the author's picture. Glass keeps its model; opacities and lights stay as they are.
//!
//! One rule gives every base colour: the converted material reflects the same share of uniform light as its source,
//! channel by channel. `base_color` holds the rule and applies it to textures.

mod base_color;

use mateval_dataset::material::{
    ColorInput, ConductorIor, Material, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput,
};
use mateval_dataset::reference::SourceMaterials;
use mateval_dataset::reference::{Emission, MaterialIndex, ReferenceScene};
use mateval_dataset::{Finding, Severity};
use mateval_tracer::bsdf::ReflectanceMeter;
use mateval_tracer::repaint::SPECULAR;
use mateval_tracer::{ElementFault, MaterialFault, TracerError};

use base_color::{BaseColorRule, DerivedTextures};

/// A scene with converted materials.
#[derive(Clone, Debug, PartialEq)]
pub struct Conversion {
    /// The scene; only its materials and their textures differ from the source's.
    pub scene: ReferenceScene,
    /// The source's materials; absent if all of them are of the scored model already.
    pub source: Option<SourceMaterials>,
    /// What could be converted only approximately.
    pub findings: Vec<Finding>,
}

/// Converts the materials of `scene`. Findings name `file`. Fails where a parameter of a material is out of range.
pub fn convert_materials(scene: ReferenceScene, file: &str) -> Result<Conversion, TracerError> {
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
            TracerError::InvalidScene(ElementFault::Material { material, name, fault })
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

    /// The rule for models that differ only in their colour, which `even` makes; `roughness` and `metallic` are those
    /// of the converted material.
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
        self.findings.push(Finding::new(
            severity,
            code,
            self.file,
            format!("material '{}'", mateval_files::untrusted::shortened(&material.name)),
            message,
            action,
        ));
    }
}

/// The perceptual roughness of facets with an even alpha.
fn even_roughness(microfacets: Option<Microfacets>) -> f32 {
    match microfacets.map(|microfacets| microfacets.alpha) {
        Some(ScalarInput::Constant(alpha)) => alpha.clamp(0.0, 1.0).sqrt(),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use mateval_dataset::TriangleMesh;
    use mateval_dataset::material::{BumpMap, Distribution, TextureIndex, UvTransform};
    use mateval_dataset::reference::{LightGroup, SourceTexture, Surface};
    use mateval_image::{Texels, Texture, Wrap};

    use super::*;

    const WHITE: ColorInput = ColorInput::Constant([1.0; 3]);

    fn grey(value: f32) -> ColorInput {
        ColorInput::Constant([value; 3])
    }

    fn ggx(alpha: f32) -> Option<Microfacets> {
        (alpha > 0.0).then_some(Microfacets { distribution: Distribution::Ggx, alpha: ScalarInput::Constant(alpha) })
    }

    fn material(model: MaterialModel) -> Material {
        Material { name: "m".to_owned(), model, two_sided: false, opacity: None, bump: None }
    }

    fn plastic(eta: f32, nonlinear: bool, base: f32, alpha: f32) -> MaterialModel {
        let (diffuse_reflectance, microfacets) = (grey(base), ggx(alpha));
        MaterialModel::Plastic { eta, nonlinear, diffuse_reflectance, specular_reflectance: WHITE, microfacets }
    }

    fn conductor(ior: ConductorIor, tint: [f32; 3], alpha: f32) -> MaterialModel {
        let (specular_reflectance, microfacets) = (ColorInput::Constant(tint), ggx(alpha));
        MaterialModel::Conductor { ior, specular_reflectance, microfacets }
    }

    fn scene(materials: Vec<Material>, textures: Vec<SourceTexture>) -> ReferenceScene {
        ReferenceScene { materials, textures, ..ReferenceScene::default() }
    }

    fn converted(model: MaterialModel) -> MaterialModel {
        convert_materials(scene(vec![material(model)], Vec::new()), "scene.xml").unwrap().scene.materials[0].model
    }

    /// The largest difference between the shares of uniform light that two models reflect.
    fn off(a: &MaterialModel, b: &MaterialModel) -> f64 {
        let mut meter = ReflectanceMeter::default();
        let [a, b] = [a, b].map(|model| meter.uniform(model).unwrap());
        (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f64::max)
    }

    /// The scored model with the source's own colour and roughness, as without the rule.
    fn unconverted(color: [f32; 3], alpha: f32, metallic: f32) -> MaterialModel {
        let numbers = [alpha.sqrt(), metallic].map(ScalarInput::Constant);
        scored_model(ColorInput::Constant(color), numbers[0], numbers[1])
    }

    /// Within a thousandth, over colour, width, index of refraction and both kinds of internal scattering. The twin,
    /// the base colour without the rule, is off by up to a quarter.
    #[test]
    fn plastic_keeps_its_energy() {
        let mut worst_of_twin = 0.0_f64;
        let mut compared = 0;
        for eta in [1.4, 1.9] {
            for nonlinear in [false, true] {
                for alpha in [0.0, 0.05, 0.3] {
                    for base in [0.2, 0.8] {
                        let source = plastic(eta, nonlinear, base, alpha);
                        let found = off(&source, &converted(source));
                        assert!(found < 1e-3, "eta {eta}, nonlinear {nonlinear}, alpha {alpha}, base {base}: {found}");
                        worst_of_twin = worst_of_twin.max(off(&source, &unconverted([base; 3], alpha, 0.0)));
                        compared += 1;
                    }
                }
            }
        }
        assert_eq!(compared, 24);
        assert!(worst_of_twin > 0.2, "{worst_of_twin}");
    }

    /// A dark plastic with more reflection than the scored model's is brighter by a base; with less it keeps its
    /// textures.
    #[test]
    fn dark_plastic() {
        for eta in [1.3, 1.5, 1.9] {
            let bases: Vec<f32> = [0.0, 0.01, 0.02, 0.05]
                .map(|base| {
                    let source = plastic(eta, true, base, 0.05);
                    let model = converted(source);
                    // At most what the facets reflect beyond the source's coat, 0.03 for an index of 1.3.
                    assert!(off(&source, &model) < 0.035, "{eta} {base}");
                    let MaterialModel::Principled { base_color: ColorInput::Constant([r, ..]), .. } = model else {
                        panic!()
                    };
                    r
                })
                .to_vec();
            assert!(bases.windows(2).all(|pair| pair[0] < pair[1]), "{eta}: {bases:?}");
        }
    }

    /// Matt surfaces are exact above twice the facets' 2 %, and no colour below is off by more than those.
    #[test]
    fn diffuse_keeps_its_energy() {
        for alpha in [None, Some(0.4)] {
            for value in [0.0, 0.01, 0.03, 0.05, 0.2, 0.5, 0.8, 1.0] {
                let source =
                    MaterialModel::Diffuse { reflectance: grey(value), alpha: alpha.map(ScalarInput::Constant) };
                let found = off(&source, &converted(source));
                let bound = if value < 0.05 { 0.0225 } else { 1e-3 };
                assert!(found < bound, "{alpha:?} {value}: {found}");
            }
        }
        // The twin: the reflectance itself as the base colour.
        let source = MaterialModel::Diffuse { reflectance: grey(0.2), alpha: None };
        assert!(off(&source, &unconverted([0.2; 3], 1.0, 0.0)) > 0.015);
    }

    /// Coloured metals of all widths are exact. The twin, F0 as the base colour, is 2 % too bright for smooth chromium,
    /// since Schlick's curve rises where the metal's falls, and much more for a rough one, whose facets Mitsuba lets
    /// lose light.
    #[test]
    fn conductors_keep_their_energy() {
        let copper = ConductorIor::EtaK { eta: [0.2004, 0.9240, 1.1022], k: [3.9129, 2.4528, 2.1421] };
        let chromium = ConductorIor::EtaK { eta: [4.369, 2.917, 1.655], k: [5.206, 4.231, 3.755] };
        for ior in [copper, chromium, ConductorIor::PerfectMirror] {
            for alpha in [0.0, 0.01, 0.1, 0.3] {
                for tint in [[1.0; 3], [0.9, 0.5, 0.2]] {
                    let source = conductor(ior, tint, alpha);
                    let found = off(&source, &converted(source));
                    assert!(found < 1e-3, "{ior:?} {alpha} {tint:?}: {found}");
                }
            }
        }
        let f0 = chromium.reflectance_at_normal();
        let twin = |alpha| off(&conductor(chromium, [1.0; 3], alpha), &unconverted(f0, alpha, 1.0));
        assert!(twin(0.0) > 0.02 && twin(0.3) > 0.08, "{} {}", twin(0.0), twin(0.3));
    }

    /// Mitsuba 3.9.1's own materials in uniform light (65,536 samples of each `bsdf.sample`, by a script of its Python
    /// package): a smooth and a rough plastic of index 1.5, smooth and rough chromium. The converted materials reflect
    /// the same.
    #[test]
    fn converted_materials_reflect_what_mitsubas_do() {
        let base = ColorInput::Constant([0.2, 0.5, 0.8]);
        let coated = |alpha: f32| {
            let (eta, nonlinear, microfacets) = (1.5, true, ggx(alpha));
            MaterialModel::Plastic {
                eta,
                nonlinear,
                diffuse_reflectance: base,
                specular_reflectance: WHITE,
                microfacets,
            }
        };
        let chromium = ConductorIor::EtaK { eta: [4.369, 2.917, 1.655], k: [5.206, 4.231, 3.755] };
        let mut meter = ReflectanceMeter::default();
        for (source, expected) in [
            (coated(0.0), [0.17462, 0.35274, 0.65291]),
            (coated(0.2), [0.14644, 0.30937, 0.55009]),
            (conductor(chromium, [1.0; 3], 0.0), [0.66485, 0.63380, 0.67866]),
            (conductor(chromium, [1.0; 3], 0.25), [0.59116, 0.56032, 0.59696]),
        ] {
            let found = meter.uniform(&converted(source)).unwrap();
            let worst = (0..3).map(|c| (found[c] - expected[c]).abs()).fold(0.0, f64::max);
            assert!(worst < 2.5e-3, "{source:?}: {found:?}, expected {expected:?}");
        }
    }

    /// A conductor of eta 0 reflects everything, whatever its k.
    #[test]
    fn a_conductor_without_a_real_index_is_a_mirror() {
        for k in [1.0, 0.3] {
            let source = conductor(ConductorIor::EtaK { eta: [0.0; 3], k: [k; 3] }, [1.0; 3], 0.0);
            let MaterialModel::Principled { base_color: ColorInput::Constant(rgb), roughness, metallic, .. } =
                converted(source)
            else {
                panic!()
            };
            assert!(rgb.iter().all(|v| (0.999..=1.0).contains(v)), "{rgb:?}");
            assert_eq!([roughness, metallic], [0.0, 1.0].map(ScalarInput::Constant));
        }
    }

    fn texture(name: &str, texels: Texels) -> SourceTexture {
        let texture = Texture::new(2, 2, texels, Wrap::Mirror).unwrap();
        SourceTexture { name: name.to_owned(), sha256: Some("0a".repeat(32)), texture }
    }

    fn lookup(texture: usize) -> ColorInput {
        ColorInput::Texture { texture: TextureIndex(texture), uv: UvTransform([[2.0, 0.0, 0.1], [0.0, -1.0, 0.2]]) }
    }

    fn number(texture: usize, channel: usize) -> ScalarInput {
        ScalarInput::Texture { texture: TextureIndex(texture), channel, uv: UvTransform::default() }
    }

    /// Each texel of a textured plastic is converted as a constant of its colour; wrapping, uv, opacity, glass, lights
    /// and the name of the file stay; bumps and one-sidedness go. The source's materials are kept as they were.
    #[test]
    fn a_scene_with_textures() {
        let bytes = [[10, 200, 90], [255, 0, 30], [128, 64, 1], [77, 78, 79]];
        let textures = vec![
            texture("unused.png", Texels::Grey8(vec![1; 4])),
            texture("wood.jpg", Texels::Srgb8(bytes.to_vec())),
            texture("leaf.png", Texels::Grey8(vec![0, 255, 255, 0])),
            texture("bump.png", Texels::Grey8(vec![0, 9, 9, 0])),
            texture("width.exr", Texels::Grey(vec![0.04, 0.09, 0.16, 0.25])),
            texture("lamp.exr", Texels::Linear(vec![[7.0; 3]; 4])),
        ];
        let MaterialModel::Plastic { eta, nonlinear, specular_reflectance, .. } = plastic(1.5, true, 0.0, 0.0) else {
            panic!()
        };
        let wood = Material {
            opacity: Some(number(2, 1)),
            bump: Some(BumpMap { height: number(3, 0), scale: 0.01 }),
            ..material(MaterialModel::Plastic {
                eta,
                nonlinear,
                specular_reflectance,
                diffuse_reflectance: lookup(1),
                microfacets: ggx(0.04),
            })
        };
        let brushed = material(MaterialModel::Conductor {
            ior: ConductorIor::PerfectMirror,
            specular_reflectance: lookup(1),
            microfacets: Some(Microfacets { distribution: Distribution::Ggx, alpha: number(4, 2) }),
        });
        let glass = material(MaterialModel::ThinDielectric {
            eta: 1.5,
            specular_reflectance: WHITE,
            specular_transmittance: lookup(1),
        });
        let lamp =
            Emission::Environment { texture: TextureIndex(5), scale: 1.0, world_from_environment: [[0.0; 3]; 3] };
        let lights = vec![LightGroup { name: "l".to_owned(), emission: lamp, camera_visible: true }];
        let surfaces =
            vec![Surface { name: "s".to_owned(), mesh: TriangleMesh::default(), material: MaterialIndex(0) }];
        let source = ReferenceScene {
            surfaces: surfaces.clone(),
            lights,
            ..scene(vec![wood.clone(), brushed.clone(), glass.clone(), wood.clone()], textures)
        };
        let Conversion { scene: found, source: kept, findings } =
            convert_materials(source.clone(), "scene.xml").unwrap();

        assert!(found.materials.iter().all(is_scored_model));
        assert_eq!((found.surfaces, found.materials.len()), (surfaces, 4));
        assert_eq!(found.materials[0], found.materials[3]);
        let MaterialModel::Principled { base_color: ColorInput::Texture { texture, uv }, .. } =
            found.materials[0].model
        else {
            panic!()
        };
        assert_eq!(uv, UvTransform([[2.0, 0.0, 0.1], [0.0, -1.0, 0.2]]));
        let wood_map = &found.textures[texture.0];
        assert_eq!((wood_map.name.as_str(), wood_map.texture.wrap()), ("wood.jpg", Wrap::Mirror));
        for at in 0..4 {
            let (x, y) = (at % 2, at / 2);
            for c in 0..3 {
                let color = source.textures[1].texture.texel(x, y)[c];
                let MaterialModel::Principled { base_color: ColorInput::Constant([expected, ..]), .. } =
                    converted(plastic(1.5, true, color, 0.04))
                else {
                    panic!()
                };
                let found = wood_map.texture.texel(x, y)[c];
                let [found, expected] = [found, expected].map(mateval_image::transfer::srgb_from_linear);
                assert!((found - expected).abs() <= 0.51 / 255.0, "{at} {c}: {found} {expected}");
            }
        }
        let MaterialModel::Principled { roughness: ScalarInput::Texture { texture, channel, .. }, .. } =
            found.materials[1].model
        else {
            panic!()
        };
        assert_eq!((found.textures[texture.0].texture.texel(1, 1), channel), ([0.5; 3], 0));
        assert_eq!(findings.iter().map(|f| f.code.as_str()).collect::<Vec<_>>(), ["converted_by_mean"]);
        let MaterialModel::ThinDielectric { specular_transmittance: ColorInput::Texture { texture, .. }, .. } =
            found.materials[2].model
        else {
            panic!()
        };
        assert_eq!(found.textures[texture.0], source.textures[1]);
        let Emission::Environment { texture, .. } = found.lights[0].emission else { panic!() };
        assert_eq!(found.textures[texture.0], source.textures[5]);
        assert!(!found.textures.iter().any(|t| ["unused.png", "bump.png"].contains(&t.name.as_str())));

        // The source's materials show the same texels as before, in any scene that they are put into.
        let kept = kept.unwrap();
        assert!(!kept.textures.iter().any(|t| ["unused.png", "lamp.exr"].contains(&t.name.as_str())));
        let shown = ReferenceScene { materials: Vec::new(), surfaces: Vec::new(), ..found };
        let again = kept.in_scene(&shown);
        for (before, after) in source.materials.iter().zip(&again.materials) {
            let (before, after) = (before.lookups(), after.lookups());
            let pairs = before.iter().zip(&after);
            assert!(pairs.clone().count() >= 1);
            for (before, after) in pairs {
                assert_eq!(source.textures[before.texture.0], again.textures[after.texture.0]);
                assert_eq!((before.channel, before.uv), (after.channel, after.uv));
            }
        }
    }

    #[test]
    fn colours_beyond_one_are_clipped_and_reported() {
        let model = MaterialModel::Diffuse { reflectance: ColorInput::Constant([2.0, 0.5, 0.5]), alpha: None };
        let found = convert_materials(scene(vec![material(model)], Vec::new()), "scene.xml").unwrap();
        assert_eq!(found.findings[0].code, "base_color_clipped");
        assert!(is_scored_model(&found.scene.materials[0]));
        let float = texture("a.exr", Texels::Linear(vec![[0.5; 3], [0.5; 3], [1.5; 3], [0.5; 3]]));
        let model = scored_model(lookup(0), ScalarInput::Constant(1.5), ScalarInput::Constant(0.0));
        let source = Material { two_sided: true, ..material(model) };
        let found = convert_materials(scene(vec![source], vec![float]), "scene.xml").unwrap();
        assert_eq!(found.findings[0].code, "base_color_clipped");
        assert_eq!(found.scene.textures[0].texture.texel(0, 1), [1.0; 3]);
    }

    /// Rooms of 3D-FRONT need no conversion and no second set of files. Their twins with a bump, one side, or another
    /// `specular` do.
    #[test]
    fn the_scored_model_stays() {
        let numbers = [0.5, 0.0].map(ScalarInput::Constant);
        let own = Material { two_sided: true, ..material(scored_model(grey(0.4), numbers[0], numbers[1])) };
        let plain = scene(vec![own.clone()], Vec::new());
        let found = convert_materials(plain.clone(), "house.json").unwrap();
        assert_eq!((found.scene, found.source), (plain, None));
        let MaterialModel::Principled { base_color, roughness, metallic, flavour, .. } = own.model else { panic!() };
        let shiny = MaterialModel::Principled { base_color, roughness, metallic, specular: 0.6, flavour };
        let mitsubas = MaterialModel::Principled {
            base_color,
            roughness,
            metallic,
            specular: SPECULAR,
            flavour: PrincipledFlavour::Mitsuba,
        };
        let bump = Some(BumpMap { height: ScalarInput::Constant(0.0), scale: 1.0 });
        for twin in [
            Material { two_sided: false, ..own.clone() },
            Material { bump, ..own.clone() },
            Material { model: shiny, ..own.clone() },
            Material { model: mitsubas, ..own.clone() },
        ] {
            let found = convert_materials(scene(vec![twin], Vec::new()), "house.json").unwrap();
            assert_eq!(found.scene.materials, std::slice::from_ref(&own));
            assert!(found.source.is_some());
        }
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let negative = plastic(-1.5, true, 0.5, 0.1);
        let error =
            convert_materials(scene(vec![material(negative)], Vec::new()), "scene.xml").unwrap_err().to_string();
        assert!(error.contains("'m'"), "{error}");
        let dangling = MaterialModel::Diffuse { reflectance: lookup(3), alpha: None };
        let found = convert_materials(scene(vec![material(dangling)], Vec::new()), "scene.xml").unwrap().scene;
        let surface = Surface {
            name: "s".to_owned(),
            mesh: TriangleMesh {
                positions: vec![glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y],
                triangles: vec![[0, 1, 2]],
                ..Default::default()
            },
            material: MaterialIndex(0),
        };
        let found = ReferenceScene { surfaces: vec![surface], ..found };
        assert!(mateval_tracer::World::new(std::sync::Arc::new(found)).is_err());
    }
}
