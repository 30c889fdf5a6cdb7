//! `RESULT.json` is the same, byte for byte, for any number of threads, other submissions and parallel scenes.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_eval::score::{LpipsWeights, ScorePlan};
use mateval_image::LinearRgb;

use super::sample::{hasty, lpips, plan, scored, text, write_changed, write_grey, write_truth};
use mateval_testkit::kept_folder;

/// `gt`, `dark` (of the same roughness) and `grey` (of another).
static SUBMISSIONS: LazyLock<[PathBuf; 3]> = LazyLock::new(|| {
    let places = ["gt", "dark", "grey"].map(|name| kept_folder("bytes").join(name));
    write_truth(&places[0]);
    write_changed(&places[1], |truth| truth.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| 0.7 * v))));
    write_grey(&places[2]);
    places
});

fn all() -> Vec<&'static Path> {
    SUBMISSIONS.iter().map(PathBuf::as_path).collect()
}

fn texts(plan: &ScorePlan<'_>) -> Vec<String> {
    scored(plan).iter().map(text).collect()
}

/// All three together, one scene after the other.
static TOGETHER: LazyLock<Vec<String>> = LazyLock::new(|| texts(&plan(&all(), &hasty(), &[])));

fn on_threads(threads: usize, plan: &ScorePlan<'_>) -> Vec<String> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| texts(plan))
}

#[test]
fn on_any_number_of_threads() {
    // The others are scored on as many threads as there are cores.
    for threads in [1, 2, 7] {
        assert!(on_threads(threads, &plan(&all(), &hasty(), &[])) == *TOGETHER, "{threads} threads");
    }
}

#[test]
fn lpips_on_any_number_of_threads() {
    let Some(lpips) = lpips() else { return };
    let mut plan = plan(&all()[..1], &hasty(), &["room"]);
    plan.lpips = LpipsWeights::Loaded(Box::new(lpips));
    assert!(on_threads(1, &plan) == on_threads(2, &plan), "1 and 2 threads give different results");
}

#[test]
fn with_any_other_submissions() {
    let together = &*TOGETHER;
    for (at, &submission) in all().iter().enumerate() {
        assert!(texts(&plan(&[submission], &hasty(), &[]))[0] == together[at], "{}", submission.display());
    }
    let [gt, dark, grey] = [0, 1, 2].map(|at| all()[at]);
    let [one, other] = [[grey, gt], [dark, gt]].map(|pair| texts(&plan(&pair, &hasty(), &["room"])));
    assert!(one[1] == other[1], "another or the same roughness beside it");
    // The twins: methods differ, and so do numbers of samples.
    assert!(together[0] != together[1] && together[0] != together[2]);
    let mut fewer = hasty();
    fewer.light.samples.each_half = 2;
    // Those of the truth itself do not depend on samples.
    let pictures = |protocol| scored(&plan(&[dark], &protocol, &["room"]))[0].protocols["mateval-3"].pictures.clone();
    assert!(pictures(hasty()) != pictures(fewer));
}

#[test]
fn with_any_number_of_parallel_scenes() {
    let two = ScorePlan { jobs: 2, ..plan(&all(), &hasty(), &[]) };
    assert!(texts(&two) == *TOGETHER);
}
