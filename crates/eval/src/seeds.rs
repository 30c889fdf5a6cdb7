//! Seeds of paths: they follow from scene, pass and stream alone, so that predictions can share paths.

use mateval_scene::SceneId;
use mateval_scene::manifest::sha256_of_bytes;

/// First word of the texts whose hashes are seeds.
pub const SEED_PREFIX: &str = "mateval";

/// The seed of one stream of paths, the same for every prediction.
pub(crate) fn seed(scene: &SceneId, pass: &str, stream: &str) -> u64 {
    let text = format!("{SEED_PREFIX}/{scene}/{pass}/{stream}");
    u64::from_str_radix(&sha256_of_bytes(text.as_bytes())[..16], 16).expect("a hash is hexadecimal")
}
