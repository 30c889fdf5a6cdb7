//! The real networks of LPIPS, if their weights exist.

use mateval_metrics::{Lpips, Net};
use mateval_testkit::data::lpips_weights;

/// The network; none where its weights are missing and not required.
pub fn load_lpips(net: Net) -> Option<Lpips> {
    let lpips = Lpips::load(net, &lpips_weights(net.file_name())?).unwrap();
    assert_eq!((lpips.net(), lpips.sha256()), (net, net.expected_sha256()));
    Some(lpips)
}
