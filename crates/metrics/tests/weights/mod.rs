//! The real networks, where their weights are.

use std::path::PathBuf;

use mateval_metrics::{Lpips, Net};

/// The network; `None`, said on stderr, where its weights are absent.
pub fn load_lpips(net: Net) -> Option<Lpips> {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let folder = set("MATEVAL_CACHE")
        .or_else(|| set("XDG_CACHE_HOME").map(|folder| folder.join("mateval")))
        .or_else(|| set("HOME").map(|folder| folder.join(".cache/mateval")))?;
    let path = folder.join(net.file_name());
    if !path.is_file() {
        eprintln!("SKIPPED: no '{}'; run: python3 tools/fetch_lpips_weights.py", path.display());
        return None;
    }
    let lpips = Lpips::load(net, &path).unwrap();
    assert_eq!((lpips.net(), lpips.sha256()), (net, net.expected_sha256()));
    Some(lpips)
}
