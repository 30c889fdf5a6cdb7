//! Ranks methods: an interval for every score, a comparison of every pair of methods, and ranks as ranges.
//!
//! Scenes of one house are alike, so that whole houses are drawn with replacement, the same ones for all methods:
//! `bootstrap` draws them and computes intervals and p-values, `key_ranking` corrects these for their number and
//! derives the ranks by one score. Here, results are checked for being comparable, and their numbers gathered by score.

mod bootstrap;
pub mod file;
mod key_ranking;

use std::collections::{BTreeMap, BTreeSet};

use mateval_dataset::SceneId;
use mateval_dataset::ids::unused_name;
use mateval_dataset::submission::Map;
use mateval_eval::metric::Metric;
use mateval_eval::protocol::Track;
use mateval_eval::result::key::ResultKey;
use mateval_eval::result::{ProtocolResult, ResultFile};
use mateval_submission::prediction::MISSING_MAP;
use rayon::prelude::*;

use self::bootstrap::{DrawTable, TAIL};
pub(crate) use self::bootstrap::{Draws, tails};
use self::file::{LEVEL, RankedMethod, Ranking, RankingRules};
pub(crate) use self::key_ranking::kendall_tau_b;
use self::key_ranking::{KeyValues, rank_key};
use crate::error::{Mismatch, ReportError};

/// The number of draws of houses, unless the pairs of methods need more.
const DRAWS: usize = 10_000;

/// Draws for each pair of methods: enough for the smallest possible p-value, 2 / (draws + 1), to stay below Holm's
/// first step.
const DRAWS_A_PAIR: usize = 40;

const SEED: u64 = 0;

/// With fewer houses, intervals are Student's, as those of percentiles are too narrow.
const STUDENT_BELOW: usize = 50;

/// With fewer houses, draws of a single house, which have no variance, are too frequent: one in 9 with three houses,
/// one in 64 with four.
const LEAST_HOUSES: usize = 5;

/// Ranks the results under one protocol. Results with different fingerprints are refused. So are results that lack
/// scenes of others unless `partial`, which ranks each result on the scenes that it covers. Without `partial`, a scene
/// that a submission leaves out counts as the grey that it was scored as.
pub fn rank(results: &[ResultFile], protocol: &str, partial: bool) -> Result<Ranking, ReportError> {
    let entrants = comparable(results, protocol, partial)?;
    let rules = rules(results.len());
    let houses = house_numbers(&entrants)?;
    let methods = methods(&entrants, partial);
    let values = values_by_key(&entrants, &methods, partial);
    let draws = DrawTable::new(rules.seed, rules.draws);
    let keys: BTreeMap<ResultKey, _> =
        values.par_iter().map(|(key, values)| (*key, rank_key(values, &houses, &rules, &draws))).collect();
    if keys.is_empty() {
        return Err(ReportError::NothingToShow { protocol: protocol.to_owned(), output: "a ranking" });
    }
    let Entrants { scenes, houses, fingerprint, .. } = entrants;
    Ok(Ranking { protocol: protocol.to_owned(), fingerprint, rules, scenes, houses, methods, keys })
}

/// A method's name and its means.
pub(crate) type MethodMeans = (String, Vec<Option<f64>>);

/// The name of each method and its means of the keys over the scenes that it would be ranked on. Refuses results as
/// [`rank`] does.
pub(crate) fn method_means(
    results: &[ResultFile],
    protocol: &str,
    partial: bool,
    keys: &[ResultKey],
) -> Result<Vec<MethodMeans>, ReportError> {
    let entrants = comparable(results, protocol, partial)?;
    let mean = |entrant: &Entrant<'_>, key: &ResultKey| {
        let ranked = entrant.scores.scenes.iter().filter(|(scene, _)| !(partial && entrant.left_out.contains(*scene)));
        let values: Vec<f64> = ranked.filter_map(|(_, values)| values.get(key).copied()).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    let means = |entrant: &Entrant<'_>| (entrant.name(), keys.iter().map(|key| mean(entrant, key)).collect::<Vec<_>>());
    Ok(entrants.all.iter().map(means).collect())
}

fn rules(methods: usize) -> RankingRules {
    let pairs = methods * methods.saturating_sub(1) / 2;
    RankingRules {
        seed: SEED,
        draws: DRAWS.max(DRAWS_A_PAIR * pairs),
        confidence: 1.0 - 2.0 * TAIL,
        level: LEVEL,
        student_below: STUDENT_BELOW,
        least_houses: LEAST_HOUSES,
    }
}

/// For each scene, the number of its house.
fn house_numbers(entrants: &Entrants<'_>) -> Result<Vec<usize>, ReportError> {
    let names: Vec<&str> = entrants.houses.values().map(String::as_str).collect::<BTreeSet<_>>().into_iter().collect();
    if names.len() > Draws::MOST_CLUSTERS {
        return Err(ReportError::TooManyHouses { houses: names.len(), most: Draws::MOST_CLUSTERS });
    }
    let number = |scene: &SceneId| names.binary_search(&entrants.houses.get(scene)?.as_str()).ok();
    Ok(entrants.scenes.iter().filter_map(number).collect())
}

fn methods(entrants: &Entrants<'_>, partial: bool) -> Vec<RankedMethod> {
    let mut ids = BTreeSet::new();
    let method = |entrant: &Entrant<'_>| {
        let scored = &entrant.result.dataset.scenes;
        let not_scored: Vec<SceneId> =
            entrants.scenes.iter().filter(|scene| !scored.contains(scene)).cloned().collect();
        RankedMethod {
            id: unused_name(&method_id(&entrant.result.shown_method()), '-', &mut ids),
            method: entrant.result.shown_method(),
            submission_sha256: entrant.result.submission.sha256.clone(),
            partial: partial && !(not_scored.is_empty() && entrant.left_out.is_empty()),
            not_scored,
            left_out: entrant.left_out.iter().cloned().collect(),
        }
    };
    entrants.all.iter().map(method).collect()
}

/// The id of a method: its name in lower case, with hyphens for everything that is neither an ASCII letter nor a digit.
pub(crate) fn method_id(name: &str) -> String {
    let plain: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    let words: Vec<&str> = plain.split('-').filter(|word| !word.is_empty()).collect();
    let short: String = words.join("-").chars().take(48).collect();
    let short = short.trim_end_matches('-');
    if short.is_empty() { "method" } else { short }.to_owned()
}

/// Every key with the values that each method has for it.
fn values_by_key<'a>(
    entrants: &Entrants<'_>,
    methods: &'a [RankedMethod],
    partial: bool,
) -> BTreeMap<ResultKey, KeyValues<'a>> {
    let keys: BTreeSet<&ResultKey> =
        entrants.all.iter().flat_map(|entrant| entrant.scores.scenes.values().flat_map(BTreeMap::keys)).collect();
    let of_key = |key: &ResultKey| {
        let column = |entrant: &Entrant<'_>| -> Vec<Option<f64>> {
            let covers = |scene: &SceneId| !(partial && entrant.left_out.contains(scene));
            let value = |scene: &SceneId| entrant.scores.scenes.get(scene)?.get(key).copied();
            entrants.scenes.iter().map(|scene| value(scene).filter(|_| covers(scene))).collect()
        };
        let columns = methods.iter().zip(entrants.all.iter().map(column));
        let (methods, values) = columns
            .filter(|(_, values)| values.iter().any(Option::is_some))
            .map(|(method, values)| (method.id.as_str(), values))
            .unzip();
        (*key, KeyValues { better: key.metric.better(), methods, values })
    };
    keys.into_iter().map(of_key).filter(|(_, values)| !values.methods.is_empty()).collect()
}

/// One result's scores under the protocol.
struct Entrant<'a> {
    result: &'a ResultFile,
    scores: &'a ProtocolResult,
    /// Scenes for which the submission has no base colour.
    left_out: BTreeSet<SceneId>,
}

impl<'a> Entrant<'a> {
    fn new(result: &'a ResultFile, scores: &'a ProtocolResult) -> Self {
        Self { result, scores, left_out: left_out(result, scores) }
    }

    fn name(&self) -> String {
        self.result.shown_method()
    }

    fn basis(&self, scenes: &[&SceneId]) -> String {
        basis(self.result, self.scores, scenes)
    }
}

/// An MSE of light that is not 0. Renders of the truth's own maps are equal to the reference in every bit, but under
/// `paper`, whose light is fitted to the photo, which another program may have rendered.
pub(crate) fn inexact_light(scores: &ProtocolResult) -> Option<(&ResultKey, f64)> {
    let is_inexact =
        |(key, value): &(&ResultKey, &f64)| key.metric == Metric::Mse && key.picture.kind.is_light() && **value != 0.0;
    let is_exact = scores.protocol.light.tracks.contains(&Track::True);
    scores.summary.iter().filter(|_| is_exact).find(is_inexact).map(|(key, value)| (key, *value))
}

/// The fingerprint that these scores of a result would have if these scenes had been scored; without scenes, a hash of
/// everything else that scores depend on.
pub(crate) fn basis(result: &ResultFile, scores: &ProtocolResult, scenes: &[&SceneId]) -> String {
    let weights = result.lpips_weights.get(&scores.protocol.fixed.lpips_net).and_then(Option::as_deref);
    scores.protocol.fingerprint(&result.dataset.manifest_sha256, scenes, weights)
}

struct Entrants<'a> {
    all: Vec<Entrant<'a>>,
    /// The scenes that any result covers, in the dataset's order.
    scenes: Vec<SceneId>,
    houses: BTreeMap<SceneId, String>,
    fingerprint: String,
}

/// Gathers results under one protocol. Fails with every reason for which they cannot be ranked together; results that
/// lack scenes are accepted only if `partial`.
fn comparable<'a>(results: &'a [ResultFile], protocol: &str, partial: bool) -> Result<Entrants<'a>, ReportError> {
    if results.is_empty() {
        return Err(ReportError::NoResults);
    }
    let mut mismatches: Vec<Mismatch> =
        results.iter().filter_map(|result| Mismatch::of_result(result, protocol)).collect();
    let is_readable = |result: &&ResultFile| Mismatch::of_result(result, protocol).is_none();
    let entrant = |result: &'a ResultFile| Some(Entrant::new(result, result.protocols.get(protocol)?));
    let entrants: Vec<Entrant<'a>> = results.iter().filter(is_readable).filter_map(entrant).collect();
    mismatches.extend(entrants.iter().filter_map(own_fault));
    mismatches.extend(entrants.iter().skip(1).filter_map(|entrant| mixed(&entrants[0], entrant)));
    let scenes = scenes_of_any(&entrants);
    if !partial {
        mismatches.extend(entrants.iter().filter_map(|entrant| too_few_scenes(entrant, &scenes)));
    }
    ReportError::refuse(mismatches)?;
    let houses = entrants.iter().flat_map(|entrant| entrant.result.dataset.houses.clone()).collect();
    let fingerprint = entrants[0].basis(&scenes.iter().collect::<Vec<_>>());
    Ok(Entrants { all: entrants, scenes, houses, fingerprint })
}

/// What is wrong with one result by itself: it contradicts its fingerprint, or holds impossible scores or scenes.
fn own_fault(entrant: &Entrant<'_>) -> Option<Mismatch> {
    changed(entrant).or_else(|| impossible_score(entrant)).or_else(|| faulty_scene(entrant))
}

fn changed(entrant: &Entrant<'_>) -> Option<Mismatch> {
    let found = entrant.basis(&entrant.result.dataset.scenes.iter().collect::<Vec<_>>());
    let stated = &entrant.scores.fingerprint;
    (found != *stated).then(|| Mismatch::Changed { method: entrant.name(), stated: stated.clone(), found })
}

/// Scores are bounded, so that no sum of them is infinite.
fn impossible_score(entrant: &Entrant<'_>) -> Option<Mismatch> {
    let is_possible = |value: f64| value.abs() < 1e12;
    let (key, value) = entrant.scores.scenes.values().flatten().find(|(_, value)| !is_possible(**value))?;
    Some(Mismatch::ImpossibleScore { method: entrant.name(), key: *key, value: *value })
}

fn faulty_scene(entrant: &Entrant<'_>) -> Option<Mismatch> {
    let dataset = &entrant.result.dataset;
    if dataset.scenes.iter().collect::<BTreeSet<_>>().len() < dataset.scenes.len() {
        return Some(Mismatch::RepeatedScene { method: entrant.name() });
    }
    let scene = dataset.scenes.iter().find(|scene| !dataset.houses.contains_key(*scene))?;
    Some(Mismatch::NoHouse { method: entrant.name(), scene: scene.clone() })
}

fn mixed(first: &Entrant<'_>, other: &Entrant<'_>) -> Option<Mismatch> {
    if first.basis(&[]) != other.basis(&[]) {
        return Some(Mismatch::Fingerprints { first: first.name(), other: other.name() });
    }
    let houses = &other.result.dataset.houses;
    let mut known = first.result.dataset.houses.iter();
    let (scene, _) = known.find(|(scene, house)| houses.get(*scene).is_some_and(|other| other != *house))?;
    Some(Mismatch::Houses { first: first.name(), other: other.name(), scene: scene.clone() })
}

fn too_few_scenes(entrant: &Entrant<'_>, scenes: &[SceneId]) -> Option<Mismatch> {
    let (scored, scenes) = (entrant.result.dataset.scenes.len(), scenes.len());
    (scored < scenes).then(|| Mismatch::TooFewScenes { method: entrant.name(), scored, scenes })
}

/// The scenes of the result that covers most of them, in the dataset's order, then those that it lacks, by name.
fn scenes_of_any(entrants: &[Entrant<'_>]) -> Vec<SceneId> {
    let longest = entrants.iter().map(|entrant| &entrant.result.dataset.scenes).max_by_key(|scenes| scenes.len());
    let mut scenes = longest.cloned().unwrap_or_default();
    let rest: BTreeSet<&SceneId> = entrants.iter().flat_map(|entrant| &entrant.result.dataset.scenes).collect();
    scenes.extend(rest.into_iter().filter(|scene| !scenes.contains(scene)).cloned().collect::<Vec<_>>());
    scenes
}

/// Scenes all of whose base colours are missing.
fn left_out(result: &ResultFile, scores: &ProtocolResult) -> BTreeSet<SceneId> {
    let mut instances: BTreeMap<&str, usize> = BTreeMap::new();
    for texels in &scores.texels {
        *instances.entry(texels.scene.as_str()).or_default() += 1;
    }
    let mut missing: BTreeMap<&str, usize> = BTreeMap::new();
    for finding in result.findings.iter().filter(|finding| finding.code == MISSING_MAP) {
        let mut parts = finding.file.split('/').skip(1);
        let (scene, map) = (parts.next(), parts.nth(1));
        if let Some(scene) = scene.filter(|_| map.is_some_and(|map| map.starts_with(Map::BaseColor.stem()))) {
            *missing.entry(scene).or_default() += 1;
        }
    }
    let is_out =
        |scene: &&SceneId| instances.get(scene.as_str()).is_some_and(|n| missing.get(scene.as_str()) == Some(n));
    result.dataset.scenes.iter().filter(is_out).cloned().collect()
}

#[cfg(test)]
pub(crate) mod tests {
    //! Rankings of simulated leaderboards, whose true means are known.

    use mateval_dataset::open::DatasetId;
    use mateval_dataset::{Finding, InstanceId, Severity, ViewId, splitmix64};
    use mateval_eval::metric::PictureKind;
    use mateval_eval::protocol::Protocol;
    use mateval_eval::result::key::{Region, Views};
    use mateval_eval::result::means;
    use mateval_eval::result::{InstanceTexelErrors, PictureValues, RESULT_FORMAT, SubmissionId, TexelErrors};

    use super::bootstrap::{Clusters, duels, intervals};
    use super::file::{IntervalKind, RankRange, Standing};
    use super::*;

    /// A sequence of random numbers, uniform and standard normal.
    struct Chance(u64, u64);

    impl Chance {
        fn uniform(&mut self) -> f64 {
            self.1 += 1;
            (splitmix64::number(self.0, self.1) >> 11) as f64 / (1_u64 << 53) as f64
        }

        /// Box and Muller 1958.
        fn normal(&mut self) -> f64 {
            let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
            radius * (2.0 * std::f64::consts::PI * self.uniform()).cos()
        }
    }

    const PSNR: ResultKey = ResultKey::whole(PictureKind::Albedo, Views::Input, Metric::Psnr);
    const MSE: ResultKey = PSNR.with(Metric::Mse);

    const METHODS: usize = 4;
    const VIEWS: usize = 4;

    /// One simulated board: PSNR of each method, scene by scene (the mean of its views) and picture by picture.
    struct Simulated {
        scenes: Vec<Vec<f64>>,
        houses: Vec<usize>,
        pictures: Vec<Vec<f64>>,
    }

    /// The mean of every method over the whole population of houses.
    const TRUTH: f64 = 25.0;

    /// Houses of one to four scenes and equally good methods. PSNR varies by 2 dB between houses and by 1 dB between
    /// scenes, alike for all methods, and independently for each method by 1 dB between houses and by 1 dB between
    /// views.
    fn simulate(houses: usize, seed: u64) -> Simulated {
        let mut chance = Chance(seed, 0);
        let mut board =
            Simulated { scenes: vec![Vec::new(); METHODS], houses: Vec::new(), pictures: vec![Vec::new(); METHODS] };
        for house in 0..houses {
            let of_house = 2.0 * chance.normal();
            let of_method: Vec<f64> = (0..METHODS).map(|_| chance.normal()).collect();
            for _ in 0..1 + (4.0 * chance.uniform()) as usize {
                let of_scene = chance.normal();
                board.houses.push(house);
                for (method, own) in of_method.iter().enumerate() {
                    let views: Vec<f64> =
                        (0..VIEWS).map(|_| TRUTH + of_house + of_scene + own + chance.normal()).collect();
                    board.scenes[method].push(views.iter().sum::<f64>() / VIEWS as f64);
                    board.pictures[method].extend(views);
                }
            }
        }
        board
    }

    /// What the bootstrap concludes over many boards of equally good methods.
    struct Conclusions {
        /// The share of intervals that hold the true mean.
        coverage: f64,
        /// The share of p-values below 5 %.
        rejected: f64,
    }

    fn conclusions(boards: u64, houses: usize, kind: IntervalKind, by: fn(&Simulated) -> Clusters) -> Conclusions {
        let (mut held, mut rejected) = (0, 0);
        for board in 0..boards {
            let clusters = by(&simulate(houses, board));
            let draws = Draws::new(board, BOARD_DRAWS, clusters.len());
            let found = intervals(&clusters, &draws, kind).into_iter().filter_map(|(_, interval)| interval);
            held += found.filter(|interval| interval.low <= TRUTH && TRUTH <= interval.high).count();
            rejected += duels(&clusters, &[(0, 1), (2, 3)], &draws, kind).iter().filter(|duel| duel.p < 0.05).count();
        }
        let boards = boards as usize;
        Conclusions {
            coverage: held as f64 / (boards * METHODS) as f64,
            rejected: rejected as f64 / (boards * METHODS / 2) as f64,
        }
    }

    const BOARDS: u64 = 1000;

    /// The number of boards for the twins, which miss by far.
    const FEW_BOARDS: u64 = 200;

    /// Fewer than [`DRAWS`], to save time: the ends of an interval vary a little more from board to board.
    const BOARD_DRAWS: usize = 1000;

    fn by_house(board: &Simulated) -> Clusters {
        Clusters::gather(&board.scenes, &board.houses)
    }

    fn by_picture(board: &Simulated) -> Clusters {
        let pictures: Vec<usize> = (0..board.pictures[0].len()).collect();
        Clusters::gather(&board.pictures, &pictures)
    }

    #[test]
    fn intervals_and_p_values_of_many_houses() {
        let found = conclusions(BOARDS, 60, IntervalKind::Percentile, by_house);
        assert!((0.93..=0.97).contains(&found.coverage), "{}", found.coverage);
        assert!((0.03..=0.07).contains(&found.rejected), "{}", found.rejected);
        // The twin draws pictures as if those of one house were independent.
        let found = conclusions(FEW_BOARDS, 60, IntervalKind::Percentile, by_picture);
        assert!(found.coverage < 0.7, "{}", found.coverage);
        assert!(found.rejected > 0.15, "{}", found.rejected);
    }

    #[test]
    fn intervals_and_p_values_of_few_houses() {
        let found = conclusions(BOARDS, 12, IntervalKind::Student, by_house);
        assert!((0.92..=0.98).contains(&found.coverage), "{}", found.coverage);
        assert!((0.03..=0.07).contains(&found.rejected), "{}", found.rejected);
        // The twins: percentiles, which need more houses, and pictures.
        let found = conclusions(BOARDS, 12, IntervalKind::Percentile, by_house);
        assert!(found.coverage < 0.92, "{}", found.coverage);
        let found = conclusions(FEW_BOARDS, 12, IntervalKind::Student, by_picture);
        assert!(found.coverage < 0.7, "{}", found.coverage);
    }

    fn scene(number: usize) -> SceneId {
        SceneId::new(format!("s{number:02}")).unwrap()
    }

    /// The result of a method with these PSNR, one for each scene, and one scene in each house.
    pub(crate) fn result(method: &str, psnr: &[f64]) -> ResultFile {
        let picture = |(at, psnr): (usize, &f64)| PictureValues {
            scene: scene(at),
            view: ViewId::new("input").unwrap(),
            picture: PSNR.picture,
            lighting: None,
            region: Region::Valid,
            pixels: 1,
            left_out: None,
            values: BTreeMap::from([(Metric::Psnr, *psnr), (Metric::Mse, 10_f64.powf(-psnr / 10.0))]),
            mse_error: None,
            exact: false,
            lower_bound: false,
        };
        let pictures: Vec<PictureValues> = psnr.iter().enumerate().map(picture).collect();
        let (scenes, summary) = means(&pictures, &[]);
        let protocol = Protocol::named("mateval-3").unwrap();
        let ids: Vec<SceneId> = scenes.keys().cloned().collect();
        let scores = ProtocolResult {
            fingerprint: protocol.fingerprint("m", &ids.iter().collect::<Vec<_>>(), None),
            protocol,
            summary,
            scenes,
            summary_noise: BTreeMap::new(),
            noise: BTreeMap::new(),
            fits: BTreeMap::new(),
            pictures,
            texels: Vec::new(),
            instances: Vec::new(),
            measured: Vec::new(),
        };
        ResultFile {
            format: RESULT_FORMAT.to_owned(),
            tool: String::new(),
            method: method.to_owned(),
            submission: SubmissionId {
                sha256: String::new(),
                description: String::new(),
                url: None,
                licence: None,
                cost: None,
                trained_on: Vec::new(),
                oracle: false,
                geometry: None,
            },
            dataset: DatasetId {
                name: "d".to_owned(),
                version: "1".to_owned(),
                manifest_sha256: "m".to_owned(),
                total_scenes: ids.len(),
                wide_views: BTreeMap::new(),
                sources: Default::default(),
                houses: ids.iter().map(|id| (id.clone(), format!("house of {id}"))).collect(),
                scenes: ids,
                photo_renderer: None,
                withheld: None,
            },
            lpips_weights: BTreeMap::from([("alex".to_owned(), None)]),
            protocols: BTreeMap::from([("mateval-3".to_owned(), scores)]),
            constancy: Vec::new(),
            not_predicted: Vec::new(),
            tracer_check: None,
            missing: Vec::new(),
            findings: Vec::new(),
        }
    }

    /// PSNR of twelve scenes around a mean, the same for all methods except for `wobble`.
    pub(crate) fn scores(mean: f64, wobble: f64) -> Vec<f64> {
        (0..12).map(|at| mean + 0.7 * f64::from(at % 5) + wobble * f64::from(at * 7 % 11 - 5)).collect()
    }

    fn standings<'a>(ranking: &'a Ranking, key: &ResultKey) -> &'a [Standing] {
        &ranking.keys[key].standings
    }

    #[test]
    fn copies_share_a_rank() {
        let results = [
            result("Good", &scores(30.0, 0.1)),
            result("bad", &scores(20.0, 0.0)),
            result("good!", &scores(30.0, 0.1)),
        ];
        let ranking = rank(&results, "mateval-3", false).unwrap();
        let ids: Vec<&str> = ranking.methods.iter().map(|method| method.id.as_str()).collect();
        assert_eq!(ids, ["good", "bad", "good-2"]);
        for key in &[PSNR, MSE] {
            let ranks: Vec<RankRange> = standings(&ranking, key).iter().map(|standing| standing.rank).collect();
            let [first, last] = [RankRange { best: 1, worst: 2 }, RankRange { best: 3, worst: 3 }];
            assert_eq!(ranks, [first, last, first], "{key}");
            let pair = &ranking.keys[key].pairs[1];
            assert_eq!((pair.first.as_str(), pair.second.as_str()), ("good", "good-2"));
            assert_eq!((pair.difference, pair.win, pair.p_holm), (Some(0.0), Some(0.5), Some(1.0)));
            // Higher PSNR and lower MSE are better: the same method wins by both.
            assert_eq!(ranking.keys[key].pairs[0].win, Some(1.0), "{key}");
        }
    }

    #[test]
    fn the_same_bytes_whatever_the_threads() {
        let results =
            [result("a", &scores(25.0, 0.3)), result("b", &scores(25.1, -0.2)), result("c", &scores(24.0, 0.5))];
        let text = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            mateval_dataset::json::to_text(&pool.install(|| rank(&results, "mateval-3", false)).unwrap())
        };
        assert_eq!(text(1), text(3));
    }

    /// Fifty methods are 1225 pairs, of which 10,000 draws could not show a single significant difference.
    #[test]
    fn many_methods_need_more_draws() {
        for methods in [2, 22, 23, 50] {
            let pairs = methods * (methods - 1) / 2;
            let least = 2.0 / (rules(methods).draws + 1) as f64;
            assert!(least * (pairs as f64) < LEVEL, "{methods}");
        }
        assert_eq!(rules(22).draws, DRAWS);
    }

    #[test]
    fn few_houses_give_no_intervals() {
        let [four, five] = [4, 5].map(|scenes| {
            let cut = |method: &str, mean| result(method, &scores(mean, 0.1)[..scenes]);
            rank(&[cut("a", 30.0), cut("b", 20.0)], "mateval-3", false).unwrap()
        });
        let first = |ranking: &Ranking| standings(ranking, &PSNR)[0].clone();
        assert!(first(&four).interval.is_none() && first(&five).interval.is_some());
        let pair = &four.keys[&PSNR].pairs[0];
        assert_eq!((pair.win, pair.p, first(&four).rank), (None, None, RankRange { best: 1, worst: 2 }));
    }

    #[test]
    fn partial_results_are_accepted_only_on_request() {
        let part = result("part", &scores(40.0, 0.0)[..6]);
        let results = [result("whole", &scores(30.0, 0.0)), part.clone(), result("low", &scores(20.0, 0.0))];
        let error = rank(&results, "mateval-3", false).unwrap_err().to_string();
        assert!(error.contains("'part' was scored on 6 of 12 scenes") && error.contains("--partial"), "{error}");
        let ranking = rank(&results, "mateval-3", true).unwrap();
        let partial: Vec<bool> = ranking.methods.iter().map(|method| method.partial).collect();
        assert_eq!((partial, ranking.methods[1].not_scored.len()), (vec![false, true, false], 6));
        let standings = standings(&ranking, &PSNR);
        assert_eq!([standings[0].scenes, standings[1].scenes], [12, 6]);
        let pairs: Vec<usize> = ranking.keys[&PSNR].pairs.iter().map(|pair| pair.scenes).collect();
        assert_eq!(pairs, [6, 12, 6]);
        // The intervals of complete results do not depend on the partial one.
        let alone = rank(&[results[0].clone(), results[2].clone()], "mateval-3", false).unwrap();
        let interval = |ranking: &Ranking| ranking.keys[&PSNR].standings[0].interval;
        assert_eq!(interval(&ranking), interval(&alone));
    }

    /// A scene without any base colour counts as grey by default, and does not count with `partial`.
    #[test]
    fn scenes_left_out_of_a_submission() {
        let mut gaps = result("gaps", &scores(30.0, 0.0));
        let instance = InstanceId::new("sofa").unwrap();
        let texels = |scene| InstanceTexelErrors {
            scene,
            instance: instance.clone(),
            observed: TexelErrors::default(),
            unobserved: TexelErrors::default(),
        };
        gaps.protocols.get_mut("mateval-3").unwrap().texels = (0..12).map(|at| texels(scene(at))).collect();
        let missing = |file: &str| Finding::new(Severity::Warning, "missing_map", file, "", "", "");
        gaps.findings = vec![missing("scenes/s03/sofa/base_color.png"), missing("scenes/s04/sofa/roughness.png")];
        let results = [gaps, result("whole", &scores(31.0, 0.0))];
        for (partial, scenes) in [(false, 12), (true, 11)] {
            let ranking = rank(&results, "mateval-3", partial).unwrap();
            assert_eq!(ranking.methods[0].left_out, [scene(3)]);
            assert_eq!(standings(&ranking, &PSNR)[0].scenes, scenes);
            assert_eq!(ranking.methods[0].partial, partial);
        }
    }

    #[test]
    fn results_that_cannot_be_ranked_together() {
        let good = result("good", &scores(30.0, 0.0));
        let refused = |change: fn(&mut ResultFile)| {
            let mut other = result("other", &scores(20.0, 0.0));
            change(&mut other);
            rank(&[good.clone(), other], "mateval-3", true).unwrap_err().to_string()
        };
        let scored_anew = |result: &mut ResultFile, manifest: &str| {
            result.dataset.manifest_sha256 = manifest.to_owned();
            let ids: Vec<&SceneId> = result.dataset.scenes.iter().collect();
            let scores = result.protocols.get_mut("mateval-3").unwrap();
            scores.fingerprint = scores.protocol.fingerprint(manifest, &ids, None);
        };
        let mut other = result("other", &scores(20.0, 0.0));
        scored_anew(&mut other, "another");
        let error = rank(&[good.clone(), other], "mateval-3", true).unwrap_err().to_string();
        assert!(error.contains("'good' and 'other' have different fingerprints"), "{error}");
        let error = refused(|other| other.dataset.manifest_sha256 = "another".to_owned());
        assert!(error.contains("it was changed"), "{error}");
        let error = refused(|other| other.dataset.houses.clear());
        assert!(error.contains("the house of scene 's00'"), "{error}");
        let mut other = result("other", &scores(20.0, 0.0));
        let scenes = &mut other.protocols.get_mut("mateval-3").unwrap().scenes;
        scenes.get_mut(&scene(3)).unwrap().insert(PSNR, 1e300);
        let error = rank(&[good.clone(), other], "mateval-3", false).unwrap_err().to_string();
        assert!(error.contains("1e300 for 'albedo.input.psnr', which is not a possible score"), "{error}");
        let error = refused(|other| other.dataset.houses.values_mut().for_each(|house| house.push('2')));
        assert!(error.contains("assign scene 's00' to different houses"), "{error}");
        let error = refused(|other| other.protocols.clear());
        assert!(error.contains("score it with --protocol mateval-3"), "{error}");
        assert!(rank(&[], "mateval-3", false).is_err());
    }
}
