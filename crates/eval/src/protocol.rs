//! Protocols: the rules that every number depends on, as data with a fingerprint.

use std::collections::BTreeMap;

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::lighting::{LightingName, RelitRules, lightings};
use mateval_dataset::material::PrincipledFlavour;
use mateval_dataset::{SceneId, word_enum};
use mateval_light::light_fit::FitRules;
use mateval_light::light_stage::StageRules;
use mateval_light::photo_pixels::PhotoRules;
use mateval_metrics::mask_rule::MaskRule;
use mateval_metrics::measured::{MAW_LEAST, MAW_SIZE};
use mateval_tracer::LightMix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::EvalError;
use crate::fixed_rules::FixedRules;
use crate::metric::PictureKind;
use crate::result::key::{CAPTURE_HEADLINE, HEADLINE, PAPER_HEADLINE, ResultKey};

/// Colour space in which MSE and PSNR of albedo are taken. SSIM and LPIPS always see sRGB.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AlbedoSpace {
    /// Linear Rec. 709.
    Linear,
    /// Clipped to 0..1 and sRGB-encoded.
    Srgb,
}

/// A protocol. Its fingerprint is the hash of it and of everything else that a number depends on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Protocol {
    /// `mateval-3`, `paper` or `capture-1`.
    pub name: String,
    /// The treatment of pixels outside a mask.
    pub mask_rule: MaskRule,
    /// The colour space of albedo's MSE and PSNR.
    pub albedo_space: AlbedoSpace,
    /// Whether views from other places than the input view's are scored, where a scene has any.
    pub wide_views: bool,
    /// The number of decimals to which LPIPS and FLIP are rounded: the last bits of LPIPS depend on the processor.
    pub rounded_decimals: u32,
    /// The numbers that a table would print; the first orders boards.
    pub headline: Vec<ResultKey>,
    /// The rules of scores under light.
    pub light: LightRules,
    /// The rules of measured colours. A protocol that has them scores captured scenes alone, all others score all but
    /// captured scenes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured: Option<MeasuredRules>,
    /// The pixels of a captured scene's photos that do not count.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub photos: Option<PhotoRules>,
    /// Constants that all protocols share because the code holds them.
    pub fixed: FixedRules,
    /// The version of the scorer; `CHANGELOG.md` lists what each changed.
    pub scorer_version: u32,
}

/// How predictions are compared with measured colours.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredRules {
    /// Width and height of the picture that MAW's two numbers are taken from.
    pub maw_size: [usize; 2],
    /// The least denominator of MAW's factors.
    pub maw_least: f64,
}

impl MeasuredRules {
    /// The code holds these constants, and no protocol can change them.
    const OF_THIS_SCORER: Self = Self { maw_size: MAW_SIZE, maw_least: MAW_LEAST };
}

/// Rises whenever a number could change for the same inputs; `dataset_spec/CHANGELOG.md` says what each version
/// changed.
pub const SCORER_VERSION: u32 = 12;

impl Protocol {
    pub const NAMES: [&str; 3] = [Self::DEFAULT, "paper", Self::CAPTURE];

    /// The protocol of commands that name none.
    pub const DEFAULT: &str = "mateval-3";

    /// The protocol of captured scenes.
    pub const CAPTURE: &str = "capture-1";

    pub fn named(name: &str) -> Result<Self, EvalError> {
        // PSNR under fitted light is near 22 dB, so 16 plain samples are enough.
        let fitted = || {
            let mut light = LightRules::new(vec![Track::Fitted], PrincipledFlavour::Mitsuba);
            light.samples.each_half = 16;
            light
        };
        let (mask_rule, albedo_space, light) = match name {
            Self::DEFAULT => {
                let tracks = vec![Track::True, Track::Relit];
                (MaskRule::Inside, AlbedoSpace::Linear, LightRules::new(tracks, PrincipledFlavour::Blender))
            }
            "paper" => (MaskRule::BlackFill, AlbedoSpace::Srgb, fitted()),
            // Of a captured room only measured colours and photos are known.
            Self::CAPTURE => (MaskRule::Inside, AlbedoSpace::Linear, fitted()),
            _ => return Err(EvalError::UnknownProtocol { name: name.to_owned(), known: &Self::NAMES }),
        };
        Ok(Self {
            name: name.to_owned(),
            mask_rule,
            albedo_space,
            // The paper has no views from other places.
            wide_views: name != "paper",
            rounded_decimals: 6,
            headline: match name {
                "paper" => PAPER_HEADLINE.to_vec(),
                Self::CAPTURE => CAPTURE_HEADLINE.to_vec(),
                _ => HEADLINE.to_vec(),
            },
            light,
            measured: (name == Self::CAPTURE).then_some(MeasuredRules::OF_THIS_SCORER),
            photos: (name == Self::CAPTURE).then(PhotoRules::default),
            fixed: FixedRules::of_this_scorer(),
            scorer_version: SCORER_VERSION,
        })
    }

    /// Whether it has values for the scene.
    pub fn scores(&self, scene: &SceneFile) -> bool {
        self.measured.is_none() == scene.source.kind.states_materials()
    }

    /// Fails if this scorer cannot score under the protocol: it is of another version, or its code holds other
    /// constants.
    pub fn check(&self) -> Result<(), EvalError> {
        let versions = [self.scorer_version, SCORER_VERSION].map(|version| version.to_string());
        let of_version = (versions[0] != versions[1]).then(|| ("scorer_version".to_owned(), versions));
        let known = MeasuredRules::OF_THIS_SCORER;
        let measured = self.measured.as_ref().filter(|rules| **rules != known);
        let measured = measured.map(|rules| ("measured".to_owned(), [rules, &known].map(|rules| format!("{rules:?}"))));
        match of_version.or(measured).or_else(|| self.fixed.first_difference(&FixedRules::of_this_scorer())) {
            Some((rule, [found, expected])) => {
                Err(EvalError::OtherRule { protocol: self.name.clone(), rule, expected, found })
            }
            None => Ok(()),
        }
    }

    /// SHA-256, hex, of the protocol alone, as `dataset_spec/PROTOCOL.md` publishes it.
    pub fn sha256(&self) -> String {
        mateval_files::untrusted::sha256_of_bytes(mateval_dataset::json::to_text(self).as_bytes())
    }

    /// SHA-256, hex, over this protocol, the dataset's manifest, the scored scenes, and the weights of LPIPS, which may
    /// be missing.
    pub fn fingerprint(
        &self,
        dataset_manifest_sha256: &str,
        scenes: &[&SceneId],
        lpips_weights_sha256: Option<&str>,
    ) -> String {
        let weights = lpips_weights_sha256.unwrap_or("missing");
        let text = mateval_dataset::json::to_text(&(self, dataset_manifest_sha256, scenes, weights));
        mateval_files::untrusted::sha256_of_bytes(text.as_bytes())
    }
}

word_enum! {
    /// The light under which a prediction is rendered.
    Track, a "track":
    /// The paper's track: radiances fitted to the input view, of a light stage (3D-FRONT, captures) or the scene's own
    /// emitters (Bitterli).
    Fitted = "fitted",
    /// The scene's own emitters.
    True = "true",
    /// The same emitters with weights that no method has seen. Only together with `true`.
    Relit = "relit",
}

/// What sets a track apart, besides its lightings.
pub struct TrackRow {
    pub picture: PictureKind,
    /// Whether renders are compared with the photo, to which radiances are fitted; all others are compared with R.
    pub is_fitted: bool,
    /// Whether its errors are also stated by instance, and its pictures shown on pages.
    pub is_shown: bool,
}

impl Track {
    pub const fn row(self) -> TrackRow {
        match self {
            Self::Fitted => TrackRow { picture: PictureKind::RgbFitted, is_fitted: true, is_shown: true },
            Self::True => TrackRow { picture: PictureKind::RgbTrue, is_fitted: false, is_shown: true },
            Self::Relit => TrackRow { picture: PictureKind::RgbRelit, is_fitted: false, is_shown: false },
        }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightRules {
    /// The lights under which predictions are scored.
    pub tracks: Vec<Track>,
    /// The renderer whose `principled` material predictions use, with specular 0.5, two-sided and without bumps.
    pub flavour: PrincipledFlavour,
    /// The largest number of scatterings after the first hit.
    pub max_bounces: u32,
    /// The first bounce at which Russian roulette may end a path.
    pub roulette_start: u32,
    /// The probability that a path survives Russian roulette.
    pub roulette_survival: f32,
    /// The positions of a stage's lights: constants by name, which `PROTOCOL.md` defines.
    #[schemars(with = "BTreeMap<String, f64>")]
    pub stage: StageRules,
    pub fit: FitRules,
    pub relit: RelitRules,
    /// How many paths are traced.
    pub samples: SampleRules,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SampleRules {
    /// First word of the texts whose hashes seed the paths.
    pub seed: String,
    /// Samples per pixel of each half.
    pub each_half: u32,
    /// Side of the blocks of pixels within which noise counts as correlated, in pixels of the first view from each place.
    pub block_pixels: u32,
}

impl LightRules {
    /// Rules of `mateval-3`; [`Protocol::named`] changes the samples of the others.
    pub fn new(tracks: Vec<Track>, flavour: PrincipledFlavour) -> Self {
        let settings = mateval_tracer::RenderSettings::default();
        Self {
            tracks,
            flavour,
            max_bounces: settings.max_bounces,
            roulette_start: settings.roulette_start,
            roulette_survival: settings.roulette_survival,
            stage: StageRules::default(),
            fit: FitRules::default(),
            relit: RelitRules::with_alone(1),
            samples: SampleRules { seed: "mateval".to_owned(), each_half: 8, block_pixels: 16 },
        }
    }

    /// The lightings of a track, as weights of the scene's own light groups; empty if lights are fitted. `group_light` is
    /// the light of each group in R's input view.
    pub(crate) fn lightings_of(&self, track: Track, group_light: &[[f64; 3]]) -> Vec<(Option<LightingName>, LightMix)> {
        match track {
            Track::Fitted => Vec::new(),
            Track::True => vec![(None, vec![[1.0; 3]; group_light.len()])],
            Track::Relit => {
                let relit = lightings(&self.relit, group_light).into_iter();
                relit.map(|lighting| (Some(lighting.name), lighting.weights)).collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fingerprint_holds_everything() {
        let base = Protocol::named("mateval-3").unwrap();
        let scene = SceneId::new("s").unwrap();
        let print = |protocol: &Protocol| protocol.fingerprint("a", &[&scene], Some("w"));
        let mut prints = vec![
            print(&base),
            base.fingerprint("b", &[&scene], Some("w")),
            base.fingerprint("a", &[], Some("w")),
            base.fingerprint("a", &[&scene], Some("v")),
            base.fingerprint("a", &[&scene], None),
            print(&Protocol::named("paper").unwrap()),
        ];
        prints.sort();
        prints.dedup();
        assert_eq!(prints.len(), 6);
    }

    /// `PROTOCOL.md` holds the table of metrics and the hashes, the example of a result the protocol; with
    /// `MATEVAL_WRITE_DOCS=1` this writes them. A constant that changes a hash raises [`SCORER_VERSION`] if numbers of
    /// the same protocol change.
    #[test]
    fn published_tables_hold() {
        let spec = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../dataset_spec"));
        let read = |name: &str| std::fs::read_to_string(spec.join(name)).unwrap();
        let replaced = |text: &str, start: &str, end: &str, by: &str| {
            let (head, rest) = text.split_once(start).unwrap_or_else(|| panic!("'{start}' is missing"));
            let (_, tail) = rest.split_once(end).unwrap();
            format!("{head}{by}{end}{tail}")
        };
        let (document, example) = ("PROTOCOL.md", "examples/result.json");
        let mut text = replaced(&read(document), "| Metric | Better", "\n\n", crate::metric::markdown().trim_end());
        for name in Protocol::NAMES {
            let start = format!("| `{name}` | `");
            text = replaced(&text, &start, "` |", &format!("{start}{}", Protocol::named(name).unwrap().sha256()));
        }
        let protocol = mateval_dataset::json::to_text(&Protocol::named(Protocol::DEFAULT).unwrap());
        let (start, end) = ("      \"protocol\": ", ",\n      \"fingerprint\"");
        let protocol = format!("{start}{}", protocol.trim_end().replace('\n', "\n      "));
        for (name, text) in [(document, text), (example, replaced(&read(example), start, end, &protocol))] {
            if std::env::var_os("MATEVAL_WRITE_DOCS").is_some() {
                std::fs::write(spec.join(name), text).unwrap();
            } else {
                assert!(text == read(name), "{name} is outdated; set MATEVAL_WRITE_DOCS=1 and run this test again");
            }
        }
    }

    #[test]
    fn rules_of_measured_colours_are_those_of_the_code() {
        let mut protocol = Protocol::named(Protocol::CAPTURE).unwrap();
        assert!(protocol.check().is_ok());
        protocol.measured = Some(MeasuredRules { maw_least: 0.5, ..MeasuredRules::OF_THIS_SCORER });
        assert!(protocol.check().unwrap_err().to_string().contains("states measured = MeasuredRules"));
    }

    #[test]
    fn an_unknown_name_says_what_is_known() {
        for name in ["papr", "mateval-2"] {
            let error = Protocol::named(name).unwrap_err().to_string();
            assert!(error.contains(name) && error.contains("use one of: mateval-3, paper, capture-1"), "{error}");
        }
    }
}
