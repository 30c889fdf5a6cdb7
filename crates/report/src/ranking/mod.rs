//! Methods ranked: every number with its interval, each two methods compared, ranks as ranges.
//!
//! Scenes of one house are alike, so houses are drawn with replacement, the same for all methods: `draws` says which,
//! `clusters` gathers values by house, `bootstrap` makes intervals and verdicts, `holm` corrects these for their number,
//! `key_ranking` puts one key together. `comparable` says what may be ranked together at all.

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

/// Draws of the houses, where pairs do not ask for more.
const DRAWS: usize = 10_000;

/// Draws for each pair: so many pairs' least possible chance, 2 / (draws + 1), is still under Holm's first step.
const DRAWS_A_PAIR: usize = 40;

/// Where the random numbers begin.
const SEED: u64 = 0;

/// Under so many houses intervals are Student's: percentiles are too narrow there.
const STUDENT_BELOW: usize = 50;

/// Under so many houses draws of a single house, which say nothing, are too frequent: one in 9 of three houses, one in 64 of
/// four.
const LEAST_HOUSES: usize = 5;

/// Ranks the results under one protocol. Results of different fingerprints are refused, and so are those of fewer scenes than
/// others unless `partial`: then each is ranked on what it covers. Without it a scene that a submission leaves out counts
/// as the grey that it is scored as.
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

/// The number of each scene's house.
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
            id: unused_id(&entrant.result.method, &mut ids),
            method: entrant.result.method.clone(),
            submission_sha256: entrant.result.submission.sha256.clone(),
            partial: partial && !(not_scored.is_empty() && entrant.left_out.is_empty()),
            not_scored,
            left_out: entrant.left_out.iter().cloned().collect(),
        }
    };
    board.entrants.iter().map(method).collect()
}

/// The name in lower case with hyphens for all that is neither a letter of ASCII nor a digit.
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

/// Every key, and what each method has of it.
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
