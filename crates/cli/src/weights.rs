//! The cache folder, and the LPIPS weights in it.

use std::path::PathBuf;

use mateval_eval::score::LpipsWeights;
use mateval_metrics::{Lpips, Net};

use crate::outcome::say;

/// The command that downloads missing weights.
pub const FETCH_LPIPS: &str = "mateval fetch lpips";

/// `$MATEVAL_CACHE`, else `$XDG_CACHE_HOME/mateval`, else `~/.cache/mateval`.
pub fn cache_folder() -> PathBuf {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    set("MATEVAL_CACHE")
        .or_else(|| set("XDG_CACHE_HOME").map(|folder| folder.join("mateval")))
        .or_else(|| set("HOME").map(|folder| folder.join(".cache/mateval")))
        .unwrap_or_default()
}

/// The network, or why it could not be loaded.
pub fn find_weights(net: Net) -> LpipsWeights {
    match Lpips::load(net, &cache_folder().join(net.file_name())) {
        Ok(lpips) => LpipsWeights::Loaded(Box::new(lpips)),
        Err(error) => LpipsWeights::Missing { reason: error.to_string(), fix: FETCH_LPIPS.to_owned() },
    }
}

/// Like [`find_weights`]; that the network is missing is printed as a warning too.
pub fn load(net: Net) -> LpipsWeights {
    let found = find_weights(net);
    if let LpipsWeights::Missing { reason, fix } = &found {
        say(&format!("warning: {} is missing: {reason}; run: {fix}", net.key()));
    }
    found
}
