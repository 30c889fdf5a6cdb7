//! The noise of the truth's own pictures, and the methods whose light it cannot tell apart.

use mateval_eval::result::ProtocolResult;
use mateval_eval::result_key::ResultKey;
use mateval_scene::SceneId;

/// The standard error of a scene's mean PSNR due to the noise of the truth, in dB; none for numbers without render noise.
pub(crate) fn of_scene(scores: &ProtocolResult, scene: &SceneId, key: &ResultKey) -> Option<f64> {
    scores.noise.get(scene)?.get(key)?.truth_db
}

/// The same of the mean over all scenes, whose truths are rendered independently.
pub(crate) fn of_dataset(scores: &ProtocolResult, key: &ResultKey) -> Option<f64> {
    let valued = scores.scenes.iter().filter(|(_, values)| values.contains_key(key));
    let errors: Vec<f64> = valued.map(|(scene, _)| of_scene(scores, scene, key)).collect::<Option<_>>()?;
    (!errors.is_empty()).then(|| errors.iter().map(|error| error * error).sum::<f64>().sqrt() / errors.len() as f64)
}

/// A method's PSNR.
pub(crate) struct Measured<'a> {
    pub(crate) method: &'a str,
    /// In dB.
    pub(crate) psnr: f64,
    /// Its standard error due to the noise of the truth, in dB.
    pub(crate) truth_noise: f64,
}

/// Two methods that stand side by side, closer than the noise of the truth.
#[derive(Debug, PartialEq)]
pub(crate) struct ClosePair<'a> {
    pub(crate) better: &'a str,
    pub(crate) worse: &'a str,
    pub(crate) apart_db: f64,
    pub(crate) truth_noise_db: f64,
}

impl std::fmt::Display for ClosePair<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { better, worse, apart_db, truth_noise_db } = self;
        write!(f, "{better} and {worse} are {apart_db:.3} dB apart, the truth's noise is {truth_noise_db:.3} dB")
    }
}

/// All such pairs, the best first.
pub(crate) fn close_pairs<'a>(mut methods: Vec<Measured<'a>>) -> Vec<ClosePair<'a>> {
    methods.sort_by(|a, b| b.psnr.total_cmp(&a.psnr));
    let pair = |two: &[Measured<'a>]| {
        let (apart_db, truth_noise_db) = (two[0].psnr - two[1].psnr, two[0].truth_noise.max(two[1].truth_noise));
        let pair = ClosePair { better: two[0].method, worse: two[1].method, apart_db, truth_noise_db };
        (apart_db < truth_noise_db).then_some(pair)
    };
    methods.windows(2).filter_map(pair).collect()
}
