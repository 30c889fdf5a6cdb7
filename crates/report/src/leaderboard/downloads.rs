//! The numbers of a leaderboard as files.

use std::borrow::Cow;

use mateval_scene::{SceneId, json};

use super::board::Board;
use super::file::{LEADERBOARD_PATH, LeaderboardFile};
use super::site::SiteWriter;
use crate::error::ReportError;
use crate::tables::csv::quoted;
use crate::tables::{Grouping, TableFormat, tables};
use mateval_eval::result::{ProtocolResult, ResultFile};
use mateval_eval::result_key::ResultKey;

/// The tables in the paper's layout; not written if no result covers all scenes.
pub(super) const TABLES: &str = "downloads/tables.tex";

/// Writes all of the files.
pub(super) fn write(board: &Board<'_>, protocol: &str, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    site.file(LEADERBOARD_PATH, &json::to_text(&board.file))?;
    site.file("downloads/leaderboard.csv", &standings_csv(&board.file))?;
    // Tables compare only results that cover the same scenes.
    let scenes = &board.ranking().scenes;
    let is_whole = |result: &&ResultFile| result.dataset.scenes == *scenes;
    let whole: Cow<'_, [ResultFile]> = match board.results.iter().all(|result| is_whole(&result)) {
        true => board.results.into(),
        false => board.results.iter().filter(is_whole).cloned().collect(),
    };
    if !whole.is_empty() {
        for (file, format) in [(TABLES, TableFormat::Latex), ("downloads/tables.csv", TableFormat::Csv)] {
            site.file(file, &tables(&whole, board.ceiling, protocol, Grouping::Dataset, format)?)?;
        }
    }
    for (head, scores) in board.heads.iter().zip(&board.scores) {
        site.file(&format!("methods/{}.csv", head.id), &scenes_csv(scenes, scores))?;
    }
    Ok(())
}

/// One line for each method and key.
fn standings_csv(file: &LeaderboardFile) -> String {
    let mut lines =
        vec!["id,method,key,better,value,low,high,rank_best,rank_worst,scenes,houses,verified,partial".to_owned()];
    for (ranked, method) in file.ranking.methods.iter().zip(&file.methods) {
        for (key, ranking) in &file.ranking.keys {
            let Some(standing) = ranking.standings.iter().find(|standing| standing.method == ranked.id) else {
                continue;
            };
            let end = |of: fn(&crate::ranking::file::Interval) -> f64| {
                standing.interval.as_ref().map_or_else(String::new, |interval| of(interval).to_string())
            };
            lines.push(format!(
                "{},{},{key},{},{},{},{},{},{},{},{},{},{}",
                ranked.id,
                quoted(&ranked.method),
                word(&ranking.better),
                standing.value,
                end(|interval| interval.low),
                end(|interval| interval.high),
                standing.rank.best,
                standing.rank.worst,
                standing.scenes,
                standing.houses,
                word(&method.verified),
                ranked.partial
            ));
        }
    }
    lines.join("\n") + "\n"
}

/// The word for a value in JSON.
fn word<T: serde::Serialize>(value: &T) -> String {
    serde_json::to_value(value).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

/// One line for each scene, one column for each key.
fn scenes_csv(scenes: &[SceneId], scores: &ProtocolResult) -> String {
    let keys: std::collections::BTreeSet<&ResultKey> =
        scores.scenes.values().flat_map(std::collections::BTreeMap::keys).collect();
    let mut lines = vec![
        std::iter::once("scene".to_owned()).chain(keys.iter().map(ToString::to_string)).collect::<Vec<_>>().join(","),
    ];
    for scene in scenes {
        let values = scores.scenes.get(scene);
        let cells = keys
            .iter()
            .map(|key| values.and_then(|values| values.get(*key)).map_or_else(String::new, |value| value.to_string()));
        lines.push(std::iter::once(scene.to_string()).chain(cells).collect::<Vec<_>>().join(","));
    }
    lines.join("\n") + "\n"
}
