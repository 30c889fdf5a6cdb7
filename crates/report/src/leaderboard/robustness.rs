//! What the order of methods is worth. How much it depends on choices that somebody made: the number, how scenes are
//! summarised, and how many houses there are. Bounds that were made from the truth are left out there, as they would
//! agree with everything. And how far methods fall from rooms with public textures to redressed ones.

use std::collections::{BTreeMap, BTreeSet};

use mateval_dataset::SceneId;
use mateval_dataset::dataset::DatasetVersion;
use mateval_eval::metric::{Metric, PictureKind};
use mateval_eval::result::ResultFile;
use mateval_eval::result::key::{ResultKey, Views};
use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;

use super::board::Board;
use super::columns::{Column, Fact, MethodHead, standing, trained_on};
use super::entries::LeaderboardPlan;
use super::site::{Page, SiteWriter};
use crate::error::{Mismatch, ReportError};
use crate::ranking::{kendall_tau_b, method_means};

/// The difference that the page asks about, in dB.
const DIFFERENCE_DB: f64 = 0.3;

/// Quantiles of the standard normal distribution at 0.975 (a two-sided level of 5 %) and 0.8 (the power).
const QUANTILES: [f64; 2] = [1.959_964, 0.841_621];

#[derive(Serialize)]
struct RobustnessPage<'a> {
    headlines: Vec<&'a Column>,
    /// Tau between the orders by each pair of headline numbers, row by row.
    taus: Vec<Vec<Option<String>>>,
    first: &'a Column,
    /// None if there is no scene that all methods have the first number of.
    summaries: Option<Summaries<'a>>,
    /// None if the first number is not in dB, or there are fewer than two houses.
    houses: Option<HousesNeeded<'a>>,
    difference_db: f64,
}

/// The methods under each way to summarise scenes.
#[derive(Serialize)]
struct Summaries<'a> {
    scenes: usize,
    rows: Vec<SummaryRow<'a>>,
    /// Tau between the orders by mean and median, mean and ranks, median and ranks.
    taus: [Option<String>; 3],
}

#[derive(Serialize)]
struct SummaryRow<'a> {
    method: &'a MethodHead,
    mean: String,
    median: String,
    rank: String,
}

/// How many houses tell the two best methods apart, if they differ by [`DIFFERENCE_DB`].
#[derive(Serialize)]
struct HousesNeeded<'a> {
    methods: [&'a MethodHead; 2],
    difference: String,
    deviation: String,
    houses: usize,
    needed: usize,
}

/// The places of methods that have the first number, the best first.
fn compared(board: &Board<'_>) -> Vec<usize> {
    let Some(first) = board.first() else { return Vec::new() };
    let is_compared = |at: &usize| {
        let head = &board.heads[*at];
        !head.oracle && standing(board.ranking(), first.key, &head.id).is_some()
    };
    board.best_first().into_iter().filter(is_compared).collect()
}

pub(super) fn has_page(board: &Board<'_>) -> bool {
    compared(board).len() > 1
}

/// Writes the page, if there are two methods to compare.
pub(super) fn write(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    let (Some(first), methods) = (board.first(), compared(board)) else { return Ok(()) };
    if methods.len() < 2 {
        return Ok(());
    }
    let keys = board.scores.first().map_or(&[][..], |scores| &scores.protocol.headline);
    let headlines: Vec<&Column> =
        keys.iter().filter_map(|key| board.columns.iter().find(|column| column.key == *key)).collect();
    let tau = |a: &&Column, b: &&Column| {
        let value =
            |column: &Column, id: &str| Some(column.better.sign() * standing(board.ranking(), column.key, id)?.value);
        let ids = methods.iter().map(|at| board.heads[*at].id.as_str());
        let both: (Vec<f64>, Vec<f64>) = ids.filter_map(|id| Some((value(a, id)?, value(b, id)?))).unzip();
        tau_text(&both.0, &both.1)
    };
    let page = RobustnessPage {
        taus: headlines.iter().map(|a| headlines.iter().map(|b| tau(a, b)).collect()).collect(),
        headlines,
        first,
        summaries: summaries(board, first, &methods),
        houses: houses_needed(board, first, &methods),
        difference_db: DIFFERENCE_DB,
    };
    site.page(&Page {
        file: "robustness.html",
        template: "robustness.j2",
        title: "Robustness",
        scripts: &[],
        values: context! { page => Serde(&page) },
    })
}

fn tau_text(a: &[f64], b: &[f64]) -> Option<String> {
    kendall_tau_b(a, b).map(|tau| format!("{tau:.2}"))
}

/// The scenes that all of the methods are ranked on, each with their values of the column.
fn shared<'a>(board: &'a Board<'_>, column: &Column, methods: &[usize]) -> Vec<(&'a SceneId, Vec<f64>)> {
    let value = |at: usize, scene: &SceneId| {
        let ranked = &board.ranking().methods[at];
        let is_ranked = !(ranked.partial && ranked.left_out.contains(scene));
        board.scores[at].scenes.get(scene)?.get(&column.key).copied().filter(|_| is_ranked)
    };
    let values = |scene: &'a SceneId| Some((scene, methods.iter().map(|at| value(*at, scene)).collect::<Option<_>>()?));
    board.ranking().scenes.iter().filter_map(values).collect()
}

fn summaries<'a>(board: &'a Board<'_>, first: &Column, methods: &[usize]) -> Option<Summaries<'a>> {
    let scenes = shared(board, first, methods);
    if scenes.is_empty() {
        return None;
    }
    let of_method = |at: usize| scenes.iter().map(|(_, values)| values[at]).collect::<Vec<f64>>();
    let all = || (0..methods.len()).map(of_method);
    let [means, medians]: [Vec<f64>; 2] = [all().map(|values| mean(&values)).collect(), all().map(median).collect()];
    let sign = first.better.sign();
    let ranks: Vec<Vec<f64>> = scenes.iter().map(|(_, values)| ranks(values, sign)).collect();
    let mean_ranks: Vec<f64> =
        (0..methods.len()).map(|at| mean(&ranks.iter().map(|ranks| ranks[at]).collect::<Vec<_>>())).collect();
    let row = |at: usize| SummaryRow {
        method: &board.heads[methods[at]],
        mean: first.text(means[at]),
        median: first.text(medians[at]),
        rank: format!("{:.2}", mean_ranks[at]),
    };
    // More is better, as of ranks turned around.
    let better = |values: &[f64], sign: f64| values.iter().map(|value| sign * value).collect::<Vec<_>>();
    let [by_mean, by_median, by_rank] = [better(&means, sign), better(&medians, sign), better(&mean_ranks, -1.0)];
    Some(Summaries {
        scenes: scenes.len(),
        rows: (0..methods.len()).map(row).collect(),
        taus: [tau_text(&by_mean, &by_median), tau_text(&by_mean, &by_rank), tau_text(&by_median, &by_rank)],
    })
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}

/// 1 for the best value; equal values share the mean of their ranks.
fn ranks(values: &[f64], sign: f64) -> Vec<f64> {
    let count = |is: &dyn Fn(f64) -> bool| values.iter().filter(|value| is(**value)).count() as f64;
    let rank = |value: &f64| {
        let better = count(&|other| sign * other > sign * value);
        let equal = count(&|other| other == *value);
        better + 0.5 * (equal + 1.0)
    };
    values.iter().map(rank).collect()
}

fn houses_needed<'a>(board: &'a Board<'_>, first: &Column, methods: &[usize]) -> Option<HousesNeeded<'a>> {
    let [best, second] = *methods.first_chunk()?;
    if first.key.metric != Metric::Psnr {
        return None;
    }
    let mut houses: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (scene, values) in shared(board, first, &[best, second]) {
        houses.entry(board.ranking().houses.get(scene)?).or_default().push(values[0] - values[1]);
    }
    let differences: Vec<f64> = houses.values().map(|values| mean(values)).collect();
    let variance = variance(&differences)?;
    Some(HousesNeeded {
        methods: [best, second].map(|at| &board.heads[at]),
        difference: format!("{:.2}", mean(&differences)),
        deviation: format!("{:.2}", variance.sqrt()),
        houses: differences.len(),
        needed: sample_size(variance, DIFFERENCE_DB),
    })
}

/// The variance of the population that the values are drawn from; none with fewer than two.
fn variance(values: &[f64]) -> Option<f64> {
    let mean = mean(values);
    (values.len() > 1)
        .then(|| values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64)
}

/// The number of paired differences with this variance that shows a mean of `difference` with a two-sided level of 5 %
/// and a power of 80 %: (z_0.975 + z_0.8)^2 variance / difference^2 (Chow, Shao and Wang, "Sample Size Calculations in
/// Clinical Research", 2008, section 3.1). At least the two that a variance needs.
fn sample_size(variance: f64, difference: f64) -> usize {
    let quantiles: f64 = QUANTILES.iter().sum();
    ((quantiles / difference).powi(2) * variance).ceil().max(2.0) as usize
}

/// The numbers whose fall is shown. The last one that results have orders the methods: a scale per channel leaves out
/// the tint, which differs between the sets.
pub(super) const FALLS: [ResultKey; 2] = [
    ResultKey::whole(PictureKind::Albedo, Views::Novel, Metric::Psnr),
    ResultKey::whole(PictureKind::AlbedoAligned, Views::Novel, Metric::Psnr),
];

/// The methods with a result on the original rooms and on the board's redressed ones, and those without.
pub(super) struct Falls {
    original: DatasetVersion,
    pairs: Vec<Fall>,
    /// The names of the board's methods that have no result on the original rooms.
    only_here: Vec<String>,
    only_there: Vec<String>,
}

struct Fall {
    /// The place of the method among the board's.
    at: usize,
    /// The means on the original and on the redressed rooms, for each of [`FALLS`]; absent where one is missing.
    means: Vec<Option<[f64; 2]>>,
}

/// Pairs the board's results with those on the original rooms, by the names of methods; absent without the latter. Fails
/// with every reason for which they say nothing about contamination.
pub(super) fn falls(plan: &LeaderboardPlan<'_>) -> Result<Option<Falls>, ReportError> {
    let Some(results) = plan.original else { return Ok(None) };
    let means = |results: &[ResultFile]| method_means(results, plan.protocol, plan.partial, &FALLS);
    let here = means(plan.results)?;
    let there = means(results).map_err(|error| ReportError::Original(Box::new(error)))?;
    // No list is empty, as that was refused.
    let (Some(board), Some(original)) = (plan.results.first(), results.first()) else { return Ok(None) };
    let mut mismatches = Vec::new();
    if board.dataset.manifest_sha256 == original.dataset.manifest_sha256 {
        mismatches.push(Mismatch::SameDataset { dataset: board.dataset.named() });
    }
    let scenes = |results: &[ResultFile]| -> BTreeSet<SceneId> {
        results.iter().flat_map(|result| result.dataset.scenes.iter().cloned()).collect()
    };
    if scenes(plan.results) != scenes(results) {
        mismatches.push(Mismatch::Scenes { first: board.shown_method(), other: original.shown_method() });
    }
    let both = board.protocols.get(plan.protocol).zip(original.protocols.get(plan.protocol));
    if let Some((board, original)) = both.filter(|(board, original)| board.protocol != original.protocol) {
        let [board, original] = [board, original].map(|scores| scores.protocol.scorer_version);
        mismatches.push(Mismatch::OtherRules { protocol: plan.protocol.to_owned(), board, original });
    }
    let pair = |(at, (name, own)): (usize, &(String, Vec<Option<f64>>))| {
        let (_, original) = there.iter().find(|(other, _)| other == name)?;
        let both = |(original, own): (&Option<f64>, &Option<f64>)| Some([(*original)?, (*own)?]);
        Some(Fall { at, means: original.iter().zip(own).map(both).collect() })
    };
    let pairs: Vec<Fall> = here.iter().enumerate().filter_map(pair).collect();
    let [own, others] = [&here, &there].map(|all| all.iter().map(|(name, _)| name.clone()).collect::<Vec<String>>());
    if pairs.is_empty() {
        mismatches.push(Mismatch::NoPair { board: own.clone(), original: others.clone() });
    }
    ReportError::refuse(mismatches)?;
    if pairs.iter().all(|pair| pair.means.iter().all(Option::is_none)) {
        let protocol = plan.protocol.to_owned();
        return Err(ReportError::NothingToShow { protocol, output: "the page 'Contamination'" });
    }
    Ok(Some(Falls {
        original: original.dataset.named(),
        pairs,
        only_here: own.iter().filter(|name| !others.contains(name)).cloned().collect(),
        only_there: others.iter().filter(|name| !own.contains(name)).cloned().collect(),
    }))
}

#[derive(Serialize)]
struct ContaminationPage<'a> {
    original: &'a DatasetVersion,
    columns: Vec<&'a Column>,
    rows: Vec<FallRow<'a>>,
    only_here: &'a [String],
    only_there: &'a [String],
}

#[derive(Serialize)]
struct FallRow<'a> {
    method: &'a MethodHead,
    /// For each column the number on the original rooms, on the redressed ones, and the fall.
    cells: Vec<Option<[String; 3]>>,
    trained_on: Option<Fact>,
}

/// Writes the page, if there are results on original rooms: the method that falls furthest first.
pub(super) fn write_contamination(
    board: &Board<'_>,
    falls: Option<&Falls>,
    site: &SiteWriter<'_>,
) -> Result<(), ReportError> {
    let Some(falls) = falls else { return Ok(()) };
    // The numbers that a method has in both sets, each with its place in `FALLS`.
    let has = |at: usize| falls.pairs.iter().any(|pair| pair.means[at].is_some());
    let shown: Vec<(usize, &Column)> = FALLS
        .iter()
        .enumerate()
        .filter(|(at, _)| has(*at))
        .filter_map(|(at, key)| Some((at, board.columns.iter().find(|column| column.key == *key)?)))
        .collect();
    let fall = |pair: &Fall| {
        let [original, own] = shown.last().and_then(|(at, _)| pair.means[*at])?;
        Some(original - own)
    };
    let mut pairs: Vec<&Fall> = falls.pairs.iter().collect();
    // Methods that lack the number are last.
    let order = |pair: &Fall| fall(pair).unwrap_or(f64::NEG_INFINITY);
    pairs.sort_by(|a, b| order(b).total_cmp(&order(a)));
    let cells = |pair: &Fall, (at, column): &(usize, &Column)| {
        pair.means[*at].map(|[original, own]| [original, own, original - own].map(|value| column.text(value)))
    };
    let row = |pair: &Fall| FallRow {
        method: &board.heads[pair.at],
        cells: shown.iter().map(|column| cells(pair, column)).collect(),
        trained_on: trained_on(&board.file.methods[pair.at], board.scores[pair.at]),
    };
    let page = ContaminationPage {
        original: &falls.original,
        rows: pairs.into_iter().map(row).collect(),
        columns: shown.iter().map(|(_, column)| *column).collect(),
        only_here: &falls.only_here,
        only_there: &falls.only_there,
    };
    site.page(&Page {
        file: "contamination.html",
        template: "contamination.j2",
        title: "Contamination",
        scripts: &[],
        values: context! { page => Serde(&page) },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        assert_eq!([median(vec![3.0, 1.0, 2.0]), median(vec![4.0, 1.0, 2.0, 3.0])], [2.0, 2.5]);
        assert_eq!(ranks(&[2.0, 5.0, 5.0, 1.0], 1.0), [3.0, 1.5, 1.5, 4.0]);
        assert_eq!(ranks(&[2.0, 5.0, 5.0, 1.0], -1.0), [2.0, 3.5, 3.5, 1.0]);
        assert_eq!((variance(&[1.0, 2.0, 3.0]), variance(&[1.0])), (Some(1.0), None));
    }

    /// Half a standard deviation takes 32 pairs, as normal approximations of Cohen's d = 0.5 state (31.4).
    #[test]
    fn the_textbooks_sample_size() {
        assert_eq!([sample_size(1.0, 0.5), sample_size(0.09, 0.3), sample_size(0.0, 0.3)], [32, 8, 2]);
    }
}
