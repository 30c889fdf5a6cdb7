//! Everything that the pages of a leaderboard are made from.

use mateval_dataset::layout::INPUT;
use mateval_dataset::{SceneId, SourceKind};
use mateval_eval::metric::PictureKind;
use mateval_eval::result::{ProtocolResult, ResultFile};
use serde::Serialize;

use super::columns::{self, Column, MethodHead, standing};
use super::entries::LeaderboardPlan;
use super::file::{Ceiling, LEADERBOARD_FORMAT, LeaderboardFile, LeaderboardMethod};
use super::marks::Verified;
use super::pictures::{ERROR, PictureSet, TRUTH, png_size};
use super::rooms::{Room, Rooms};
use super::site::SiteWriter;
use crate::error::{Mismatch, ReportError};
use crate::ranking::file::{RankedMethod, Ranking};

/// Everything that pages are made from. Results, scores and heads are in the order of the ranking's methods.
pub(super) struct Board<'a> {
    pub(super) results: &'a [ResultFile],
    /// The result of the truth itself.
    pub(super) ceiling: Option<&'a ResultFile>,
    pub(super) scores: Vec<&'a ProtocolResult>,
    pub(super) file: LeaderboardFile,
    pub(super) heads: Vec<MethodHead>,
    pub(super) columns: Vec<Column>,
    pub(super) pictures: PictureSet,
    pub(super) rooms: Rooms,
}

impl<'a> Board<'a> {
    /// Gathers what pages show from the plan's results and their ranking.
    pub(super) fn new(
        plan: &LeaderboardPlan<'a>,
        ranking: Ranking,
        ceiling: Option<Ceiling>,
        pictures: PictureSet,
        rooms: Rooms,
    ) -> Self {
        let method = |((method, result), verified): ((&RankedMethod, &ResultFile), &Verified)| {
            let submission = result.submission.clone();
            LeaderboardMethod {
                id: method.id.clone(),
                description: submission.description,
                url: submission.url,
                licence: submission.licence,
                cost: submission.cost,
                overlap: overlap(&submission.trained_on, result.dataset.sources.values()),
                trained_on: submission.trained_on,
                oracle: submission.oracle,
                verified: *verified,
            }
        };
        let methods: Vec<_> = ranking.methods.iter().zip(plan.results).zip(&plan.verified).map(method).collect();
        // The ranking has refused an empty list.
        let dataset = plan.results.first().map(|result| result.dataset.named()).unwrap_or_default();
        let heads = ranking.methods.iter().zip(&methods).zip(plan.results);
        let heads = heads.map(|((ranked, method), result)| MethodHead::new(ranked, method, result, &ranking));
        Self {
            results: plan.results,
            ceiling: plan.ceiling,
            scores: plan.results.iter().filter_map(|result| result.protocols.get(plan.protocol)).collect(),
            heads: heads.collect(),
            columns: columns::columns(&ranking),
            pictures,
            rooms,
            file: LeaderboardFile {
                format: LEADERBOARD_FORMAT.to_owned(),
                tool: plan.tool.clone(),
                dataset,
                ceiling,
                methods,
                ranking,
            },
        }
    }

    pub(super) fn ranking(&self) -> &Ranking {
        &self.file.ranking
    }

    /// Whether any score has an interval. Without intervals, ranks and comparisons of pairs mean nothing.
    pub(super) fn has_intervals(&self) -> bool {
        self.ranking().keys.values().flat_map(|key| &key.standings).any(|standing| standing.interval.is_some())
    }

    /// Whether the scene can be shown in 3D with the textures of a method.
    pub(super) fn has_room(&self, scene: &SceneId, method: &str) -> bool {
        matches!(self.rooms.get(scene), Some(Room::Shown { methods, .. }) if methods.iter().any(|id| id == method))
    }

    /// The indices of the methods in [`Self::heads`], the best first by the column that the board is sorted by
    /// initially; methods without a value are last.
    pub(super) fn best_first(&self) -> Vec<usize> {
        let order = |at: &usize| {
            let column = self.first()?;
            Some(-column.better.sign() * standing(self.ranking(), column.key, &self.heads[*at].id)?.value)
        };
        let mut places: Vec<usize> = (0..self.heads.len()).collect();
        places.sort_by(|a, b| order(a).unwrap_or(f64::INFINITY).total_cmp(&order(b).unwrap_or(f64::INFINITY)));
        places
    }

    /// The column that the board is sorted by initially.
    pub(super) fn first(&self) -> Option<&Column> {
        columns::first(&self.columns, self.scores.first().map_or(&[][..], |scores| &scores.protocol.headline))
    }

    /// The values of the method at place `at` for a scene, as tables show them; absent if the scene has no such value.
    pub(super) fn texts(&self, at: usize, scene: &SceneId, columns: &[&Column]) -> Vec<Option<String>> {
        let values = self.scores[at].scenes.get(scene);
        columns.iter().map(|column| Some(column.text(*values?.get(&column.key)?))).collect()
    }
}

/// The datasets among `trained_on` that scenes of these sources come from: a method may have seen their truth.
fn overlap<'a>(trained_on: &[String], sources: impl Iterator<Item = &'a SourceKind>) -> Vec<String> {
    let plain = |text: &str| text.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_ascii_lowercase();
    let names: Vec<&str> = sources.flat_map(|kind| kind.datasets()).copied().collect();
    trained_on.iter().filter(|trained| names.iter().any(|name| plain(trained).contains(name))).cloned().collect()
}

/// The scores of the truth's `result`. Fails if it was not scored on the scenes and under the rules of the ranking.
pub(super) fn ceiling(result: &ResultFile, ranking: &Ranking) -> Result<Ceiling, ReportError> {
    let mut mismatches: Vec<Mismatch> = Mismatch::of_result(result, &ranking.protocol).into_iter().collect();
    let first = ranking.methods.first().map_or_else(String::new, |method| method.method.clone());
    let other = result.method.clone();
    let scores = result.protocols.get(&ranking.protocol);
    if result.dataset.scenes != ranking.scenes {
        mismatches.push(Mismatch::Scenes { first, other });
    } else if scores.is_some_and(|scores| scores.fingerprint != ranking.fingerprint) {
        mismatches.push(Mismatch::Fingerprints { first, other });
    }
    ReportError::refuse(mismatches)?;
    let (values, standard_errors_db) =
        scores.map(|scores| (scores.summary.clone(), scores.summary_noise.clone())).unwrap_or_default();
    Ok(Ceiling { method: result.method.clone(), values, standard_errors_db })
}

/// The kinds that are shown where they exist: the albedo, and the room in the light of its own lamps.
pub(super) const KINDS: [PictureKind; 2] = [PictureKind::Albedo, PictureKind::RgbTrue];

/// A prediction of one kind beside the truth, in the input view. Paths are relative to the site.
#[derive(Serialize)]
pub(super) struct Comparison<'a> {
    scene: &'a str,
    method: &'a str,
    /// The title of the kind of picture, such as `Albedo`.
    kind: String,
    prediction: String,
    truth: String,
    width: u32,
    height: u32,
}

/// The comparisons of a method in a scene: those of [`KINDS`], or of the first kind that both have if there are none.
pub(super) fn comparisons<'a>(
    board: &Board<'_>,
    site: &SiteWriter<'_>,
    method: &'a MethodHead,
    scene: &'a SceneId,
) -> Vec<Comparison<'a>> {
    let truth = board.pictures.kinds(TRUTH, scene, INPUT);
    let predicted = board.pictures.kinds(&method.id, scene, INPUT);
    let both: Vec<&str> = predicted.into_iter().filter(|kind| truth.contains(kind) && !kind.ends_with(ERROR)).collect();
    let known: Vec<&str> = KINDS.iter().map(|kind| kind.word()).filter(|kind| both.contains(kind)).collect();
    let shown = if known.is_empty() { both.into_iter().take(1).collect() } else { known };
    let comparison = |word: &str| {
        let place = |of: &str| format!("pictures/{of}/{scene}/{INPUT}/{word}.png");
        let [width, height] = png_size(&site.path(&place(TRUTH))).unwrap_or([4, 3]);
        let title = word.parse::<PictureKind>().map_or_else(|_| word.replace('_', " "), |kind| kind.title().to_owned());
        Comparison {
            scene: scene.as_str(),
            method: &method.name,
            kind: title,
            prediction: place(&method.id),
            truth: place(TRUTH),
            width,
            height,
        }
    };
    shown.into_iter().map(comparison).collect()
}
