//! Protocols: every rule that a number depends on, as data with a fingerprint.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::EvalError;

/// What is done outside a mask by the metrics whose windows look across its edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaskRule {
    /// Both pictures black outside; SSIM and LPIPS are averaged over the whole frame.
    BlackFill,
    /// SSIM over windows wholly inside; LPIPS of the prediction with the truth's pixels outside, its map summed over the
    /// picture and divided by the mask's pixels.
    Inside,
}

/// Colour space in which MSE and PSNR of albedo are taken. SSIM and LPIPS always see sRGB.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AlbedoSpace {
    /// Linear Rec. 709.
    Linear,
    /// Clipped to 0..1 and sRGB-encoded.
    Srgb,
}

/// A protocol. Its fingerprint is the hash of this and of all that a number depends on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Protocol {
    /// Its name.
    pub name: String,
    /// How masks are treated.
    pub mask_rule: MaskRule,
    /// In which space albedo's MSE and PSNR are taken.
    pub albedo_space: AlbedoSpace,
    /// The network of LPIPS.
    pub lpips_net: String,
}

/// Raised whenever a number could change for the same inputs.
pub const SCORER_VERSION: u32 = 1;

impl Protocol {
    /// The names that [`Protocol::named`] knows.
    pub const NAMES: [&str; 2] = ["mateval-1", "paper"];

    /// A protocol by name.
    pub fn named(name: &str) -> Result<Self, EvalError> {
        let (mask_rule, albedo_space) = match name {
            "mateval-1" => (MaskRule::Inside, AlbedoSpace::Linear),
            "paper" => (MaskRule::BlackFill, AlbedoSpace::Srgb),
            _ => {
                let known = Self::NAMES.join("', '");
                return Err(EvalError::Invalid(format!("there is no protocol '{name}'; known are '{known}'")));
            }
        };
        Ok(Self { name: name.to_owned(), mask_rule, albedo_space, lpips_net: "alex".to_owned() })
    }

    /// SHA-256, hex, over the scorer's version, this protocol, the dataset's manifest and the weights of LPIPS (or a
    /// word for their absence).
    pub fn fingerprint(&self, dataset_manifest_sha256: &str, lpips_weights_sha256: Option<&str>) -> String {
        let text = mateval_scene::json::to_text(&(
            SCORER_VERSION,
            self,
            dataset_manifest_sha256,
            lpips_weights_sha256.unwrap_or("missing"),
        ));
        mateval_scene::manifest::sha256_of_bytes(text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fingerprint_holds_everything() {
        let base = Protocol::named("mateval-1").unwrap();
        let mut prints = vec![
            base.fingerprint("a", Some("w")),
            base.fingerprint("b", Some("w")),
            base.fingerprint("a", Some("v")),
            base.fingerprint("a", None),
            Protocol::named("paper").unwrap().fingerprint("a", Some("w")),
            Protocol { albedo_space: AlbedoSpace::Srgb, ..base.clone() }.fingerprint("a", Some("w")),
            Protocol { mask_rule: MaskRule::BlackFill, ..base.clone() }.fingerprint("a", Some("w")),
        ];
        prints.sort();
        prints.dedup();
        assert_eq!(prints.len(), 7);
    }

    #[test]
    fn an_unknown_name_says_what_is_known() {
        assert!(Protocol::named("papr").unwrap_err().to_string().contains("'paper'"));
    }
}
