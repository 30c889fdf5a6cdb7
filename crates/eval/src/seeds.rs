//! Seeds of paths: they follow from protocol, scene, pass and stream alone, so that predictions can share paths.

use mateval_scene::SceneId;
use mateval_scene::manifest::sha256_of_bytes;

/// The seed of one stream of paths, the same for every prediction. `word` is [`NoiseRules::seed`].
///
/// [`NoiseRules::seed`]: crate::light_rules::NoiseRules::seed
pub(crate) fn seed(word: &str, scene: &SceneId, pass: &str, stream: &str) -> u64 {
    let text = format!("{word}/{scene}/{pass}/{stream}");
    u64::from_str_radix(&sha256_of_bytes(text.as_bytes())[..16], 16).expect("a hash is hexadecimal")
}
