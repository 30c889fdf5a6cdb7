//! Protocols: the rules that every number depends on, as data with a fingerprint.

use mateval_scene::SceneId;
use mateval_scene::material::PrincipledFlavour;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::EvalError;
use crate::fixed_rules::FixedRules;
use crate::light::rules::{LightRules, SampleRules, Track};
pub use crate::mask_rule::MaskRule;
use crate::result_key::{HEADLINE, PAPER_HEADLINE, ResultKey};

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
    /// Its name.
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
    /// The light under which predictions are compared.
    pub light: LightRules,
    /// Constants that all protocols share because the code holds them.
    pub fixed: FixedRules,
    /// [`SCORER_VERSION`].
    pub scorer_version: u32,
}

/// Rises whenever a number could change for the same inputs; `dataset_spec/CHANGELOG.md` says what each version changed.
pub const SCORER_VERSION: u32 = 10;

impl Protocol {
    /// The names that [`Protocol::named`] knows.
    pub const NAMES: [&str; 2] = ["mateval-3", "paper"];

    /// A protocol by name.
    pub fn named(name: &str) -> Result<Self, EvalError> {
        let (mask_rule, albedo_space, light) = match name {
            "mateval-3" => {
                let tracks = vec![Track::True, Track::Relit];
                (MaskRule::Inside, AlbedoSpace::Linear, LightRules::new(tracks, PrincipledFlavour::Blender))
            }
            "paper" => {
                let mut light = LightRules::new(vec![Track::Fitted], PrincipledFlavour::Mitsuba);
                // Its numbers lie near 22 dB: a few plain samples are enough.
                light.samples = SampleRules { at_320x240: 16, least: 16, most: 16, ..light.samples };
                (MaskRule::BlackFill, AlbedoSpace::Srgb, light)
            }
            "mateval-1" => {
                let reason = "under it the true material did not always score best";
                return Err(EvalError::RemovedProtocol { name: name.to_owned(), reason });
            }
            "mateval-2" => {
                let reason = "it compared renders with another renderer's noise, and stated errors that were up to five times off";
                return Err(EvalError::RemovedProtocol { name: name.to_owned(), reason });
            }
            _ => {
                return Err(EvalError::UnknownProtocol { name: name.to_owned(), known: &Self::NAMES });
            }
        };
        Ok(Self {
            name: name.to_owned(),
            mask_rule,
            albedo_space,
            // The paper has none.
            wide_views: name != "paper",
            rounded_decimals: 6,
            headline: if name == "paper" { PAPER_HEADLINE.to_vec() } else { HEADLINE.to_vec() },
            light,
            fixed: FixedRules::of_this_scorer(),
            scorer_version: SCORER_VERSION,
        })
    }

    /// Fails if this scorer cannot score under the protocol: it is of another version, or its code holds other constants.
    pub fn check(&self) -> Result<(), EvalError> {
        let protocol = || self.name.clone();
        if self.scorer_version != SCORER_VERSION {
            let (expected, found) = (SCORER_VERSION, self.scorer_version);
            return Err(EvalError::ScorerVersion { protocol: protocol(), expected, found });
        }
        match self.fixed.first_difference(&FixedRules::of_this_scorer()) {
            Some((rule, [found, expected])) => {
                Err(EvalError::FixedRule { protocol: protocol(), rule, expected, found })
            }
            None => Ok(()),
        }
    }

    /// SHA-256, hex, of the protocol alone, as `dataset_spec/PROTOCOL.md` publishes it.
    pub fn sha256(&self) -> String {
        mateval_scene::manifest::sha256_of_bytes(mateval_scene::json::to_text(self).as_bytes())
    }

    /// SHA-256, hex, over this protocol, the dataset's manifest, the scored scenes, and the weights of LPIPS, which may be
    /// missing.
    pub fn fingerprint(
        &self,
        dataset_manifest_sha256: &str,
        scenes: &[&SceneId],
        lpips_weights_sha256: Option<&str>,
    ) -> String {
        let weights = lpips_weights_sha256.unwrap_or("missing");
        let text = mateval_scene::json::to_text(&(self, dataset_manifest_sha256, scenes, weights));
        mateval_scene::manifest::sha256_of_bytes(text.as_bytes())
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
            print(&Protocol { albedo_space: AlbedoSpace::Srgb, ..base.clone() }),
            print(&Protocol { mask_rule: MaskRule::BlackFill, ..base.clone() }),
            print(&Protocol { rounded_decimals: 5, ..base.clone() }),
        ];
        prints.sort();
        prints.dedup();
        assert_eq!(prints.len(), 9);
    }

    /// `PROTOCOL.md` publishes the hashes: a constant that changes must change them there, and raise [`SCORER_VERSION`] if
    /// numbers of the same protocol do.
    #[test]
    fn published_hashes_hold() {
        let text = include_str!("../../../dataset_spec/PROTOCOL.md");
        let rows = Protocol::NAMES.map(|name| format!("| `{name}` | `{}` |", Protocol::named(name).unwrap().sha256()));
        assert!(rows.iter().all(|row| text.contains(row)), "PROTOCOL.md should say:\n{}", rows.join("\n"));
    }

    /// Every number and word of a protocol, changed by itself, changes its hash.
    #[test]
    fn every_constant_is_in_the_hash() {
        let base = serde_json::to_value(Protocol::named("mateval-3").unwrap()).unwrap();
        let mut hashes = vec![Protocol::named("mateval-3").unwrap().sha256()];
        let mut pointers = Vec::new();
        leaves(&base, String::new(), &mut pointers);
        for pointer in &pointers {
            let mut changed = base.clone();
            let value = changed.pointer_mut(pointer).unwrap();
            let next = match &*value {
                serde_json::Value::Number(number) if number.is_u64() => (number.as_u64().unwrap() + 1).into(),
                serde_json::Value::Number(number) => (number.as_f64().unwrap() * 1.5 + 0.25).into(),
                serde_json::Value::String(word) => match word.as_str() {
                    "inside" => "black_fill".into(),
                    "linear" => "srgb".into(),
                    "blender" => "mitsuba".into(),
                    "fitted" | "true" => "relit".into(),
                    "relit" => "true".into(),
                    "lpips_alex" => "lpips_vgg".into(),
                    key if key.contains('.') => "albedo.wide.mse".into(),
                    other => format!("{other}x").into(),
                },
                serde_json::Value::Bool(holds) => (!holds).into(),
                other => panic!("{pointer}: {other}"),
            };
            *value = next;
            hashes.push(serde_json::from_value::<Protocol>(changed).unwrap().sha256());
        }
        let count = hashes.len();
        assert!(count > 45, "{count}");
        hashes.sort();
        hashes.dedup();
        assert_eq!(hashes.len(), count);
    }

    fn leaves(value: &serde_json::Value, at: String, found: &mut Vec<String>) {
        match value {
            serde_json::Value::Object(map) => {
                map.iter().for_each(|(key, value)| leaves(value, format!("{at}/{key}"), found))
            }
            serde_json::Value::Array(list) => {
                list.iter().enumerate().for_each(|(k, value)| leaves(value, format!("{at}/{k}"), found));
            }
            _ => found.push(at),
        }
    }

    #[test]
    fn an_unknown_name_says_what_is_known() {
        let error = Protocol::named("papr").unwrap_err().to_string();
        assert!(error.contains("'papr'") && error.contains("paper"), "{error}");
    }

    #[test]
    fn removed_protocols_are_refused_with_a_reason() {
        for (name, reason) in [("mateval-1", "did not always score best"), ("mateval-2", "another renderer's noise")] {
            let error = Protocol::named(name).unwrap_err().to_string();
            assert!(error.contains(reason) && error.contains("use 'mateval-3'"), "{error}");
        }
    }
}
