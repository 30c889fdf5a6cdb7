//! The built-in sample as a tiny dataset with renders, scored.

use std::path::Path;

use mateval_dataset::SceneId;
use mateval_eval::protocol::Protocol;
use mateval_eval::result::ResultFile;
use mateval_eval::score::{LpipsWeights, ScorePlan, score};
use mateval_metrics::{Lpips, Net};
use mateval_testkit::lpips_weights;
pub use mateval_testkit::sample_dataset::{built, dataset, write_changed, write_grey, write_truth};

/// The network of LPIPS; none where its weights are missing.
pub fn lpips() -> Option<Lpips> {
    Some(Lpips::load(Net::Alex, &lpips_weights(Net::Alex.file_name())?).unwrap())
}

/// A plan that scores the submissions under `protocol`.
pub fn plan<'a>(submissions: &[&'a Path], protocol: &Protocol, scenes: &[&str]) -> ScorePlan<'a> {
    let lpips = LpipsWeights::Missing { reason: "not asked for".to_owned(), fix: String::new() };
    let plan = ScorePlan::new(dataset(), submissions.to_vec(), vec![protocol.clone()], lpips, "test");
    ScorePlan { scenes: scenes.iter().map(|id| SceneId::new(*id).unwrap()).collect(), ..plan }
}

/// `mateval-3` with as few samples as its rules can say.
pub fn hasty() -> Protocol {
    let mut protocol = Protocol::named("mateval-3").unwrap();
    protocol.light.fit.samples = 4;
    protocol.light.samples.each_half = 4;
    protocol
}

/// Scores without reporting progress.
pub fn scored(plan: &ScorePlan<'_>) -> Vec<ResultFile> {
    score(plan, &|_| ()).unwrap()
}

/// The text of `RESULT.json`.
pub fn text(result: &ResultFile) -> String {
    mateval_dataset::json::to_text(result)
}
