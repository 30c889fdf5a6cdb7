//! Ranks methods: an interval for every score, a comparison of every pair of methods, and ranks as ranges.
//!
//! `comparable` checks which results can be ranked together. Scenes of one house are alike, so that whole houses are
//! drawn with replacement, the same ones for all methods: `draws` draws them, `clusters` sums scores by house,
//! `bootstrap` computes intervals and p-values, `holm` corrects these for their number, `rank_ranges` derives ranks,
//! and `key_ranking` combines these steps for one score.

mod bootstrap;
mod clusters;
mod comparable;
mod draws;
pub mod file;
mod holm;
mod key_ranking;
mod rank_ranges;
#[cfg(test)]
pub(crate) mod tests;

use std::collections::{BTreeMap, BTreeSet};

use mateval_scene::SceneId;
use rayon::prelude::*;

use self::comparable::{Board, Entrant};
use self::draws::{DrawTable, Draws};
use self::file::{RankedMethod, Ranking, RankingRules};
use self::key_ranking::{KeyValues, rank_key};
use crate::error::ReportError;
use mateval_eval::result::ResultFile;
use mateval_eval::result_key::ResultKey;

/// The number of draws of houses, unless the pairs of methods need more.
const DRAWS: usize = 10_000;

/// Draws for each pair of methods: enough for the smallest possible p-value, 2 / (draws + 1), to stay below Holm's
/// first step.
const DRAWS_A_PAIR: usize = 40;

/// The seed of the random numbers.
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
    let board = comparable::board(results, protocol, partial)?;
    let rules = rules(results.len());
    let houses = house_numbers(&board)?;
    let methods = methods(&board, partial);
    let values = values_by_key(&board, &methods, partial);
    let draws = DrawTable::new(rules.seed, rules.draws);
    let keys: BTreeMap<ResultKey, _> =
        values.par_iter().map(|(key, values)| (*key, rank_key(values, &houses, &rules, &draws))).collect();
    if keys.is_empty() {
        return Err(ReportError::NothingToShow { protocol: protocol.to_owned(), output: "a ranking" });
    }
    let Board { scenes, houses, fingerprint, .. } = board;
    Ok(Ranking { protocol: protocol.to_owned(), fingerprint, rules, scenes, houses, methods, keys })
}

fn rules(methods: usize) -> RankingRules {
    let pairs = methods * methods.saturating_sub(1) / 2;
    RankingRules {
        seed: SEED,
        draws: DRAWS.max(DRAWS_A_PAIR * pairs),
        confidence: 0.95,
        level: holm::LEVEL,
        student_below: STUDENT_BELOW,
        least_houses: LEAST_HOUSES,
    }
}

/// For each scene, the number of its house.
fn house_numbers(board: &Board<'_>) -> Result<Vec<usize>, ReportError> {
    let names: Vec<&str> = board.houses.values().map(String::as_str).collect::<BTreeSet<_>>().into_iter().collect();
    if names.len() > Draws::MOST_CLUSTERS {
        return Err(ReportError::TooManyHouses { houses: names.len(), most: Draws::MOST_CLUSTERS });
    }
    let number = |scene: &SceneId| names.binary_search(&board.houses.get(scene)?.as_str()).ok();
    Ok(board.scenes.iter().filter_map(number).collect())
}

fn methods(board: &Board<'_>, partial: bool) -> Vec<RankedMethod> {
    let mut ids = BTreeSet::new();
    let method = |entrant: &Entrant<'_>| {
        let scored = &entrant.result.dataset.scenes;
        let not_scored: Vec<SceneId> = board.scenes.iter().filter(|scene| !scored.contains(scene)).cloned().collect();
        RankedMethod {
            id: unused_id(&entrant.result.shown_method(), &mut ids),
            method: entrant.result.shown_method(),
            submission_sha256: entrant.result.submission.sha256.clone(),
            partial: partial && !(not_scored.is_empty() && entrant.left_out.is_empty()),
            not_scored,
            left_out: entrant.left_out.iter().cloned().collect(),
        }
    };
    board.entrants.iter().map(method).collect()
}

/// An unused id: the name in lower case, with hyphens for everything that is neither an ASCII letter nor a digit.
fn unused_id(name: &str, used: &mut BTreeSet<String>) -> String {
    let plain: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    let words: Vec<&str> = plain.split('-').filter(|word| !word.is_empty()).collect();
    let short: String = words.join("-").chars().take(48).collect();
    let short = short.trim_end_matches('-');
    let stem = if short.is_empty() { "method" } else { short };
    let numbered = (2..).map(|number| format!("{stem}-{number}"));
    let id = std::iter::once(stem.to_owned()).chain(numbered).find(|id| !used.contains(id)).unwrap_or_default();
    used.insert(id.clone());
    id
}

/// Every key with the values that each method has for it.
fn values_by_key<'a>(
    board: &Board<'_>,
    methods: &'a [RankedMethod],
    partial: bool,
) -> BTreeMap<ResultKey, KeyValues<'a>> {
    let keys: BTreeSet<&ResultKey> =
        board.entrants.iter().flat_map(|entrant| entrant.scores.scenes.values().flat_map(BTreeMap::keys)).collect();
    let of_key = |key: &ResultKey| {
        let column = |entrant: &Entrant<'_>| -> Vec<Option<f64>> {
            let covers = |scene: &SceneId| !(partial && entrant.left_out.contains(scene));
            let value = |scene: &SceneId| entrant.scores.scenes.get(scene)?.get(key).copied();
            board.scenes.iter().map(|scene| value(scene).filter(|_| covers(scene))).collect()
        };
        let columns = methods.iter().zip(board.entrants.iter().map(column));
        let (methods, values) = columns
            .filter(|(_, values)| values.iter().any(Option::is_some))
            .map(|(method, values)| (method.id.as_str(), values))
            .unzip();
        (*key, KeyValues { better: key.metric.better(), methods, values })
    };
    keys.into_iter().map(of_key).filter(|(_, values)| !values.methods.is_empty()).collect()
}
