//! The columns of the board and their cells: one column for each key of the results, chosen by picture, views, metric
//! and surfaces, and one for each fact about methods. Also how pages name a method.

use mateval_dataset::submission::{Cost, Map};
use mateval_eval::metric::{Better, Metric, PictureKind};
use mateval_eval::result::key::{ResultKey, Surfaces, Views};
use mateval_eval::result::{ProtocolResult, ResultFile};
use serde::Serialize;

use super::file::LeaderboardMethod;
use super::marks::Verified;
use crate::ranking::file::{RankRange, RankedMethod, Ranking, Standing};

#[derive(Clone, Serialize)]
pub(super) struct Column {
    pub(super) key: ResultKey,
    pub(super) picture: &'static str,
    pub(super) views: &'static str,
    pub(super) metric: &'static str,
    pub(super) region: &'static str,
    /// The stem of the map that it is about; none for light.
    pub(super) map: Option<&'static str>,
    /// As in `Albedo, novel views`.
    pub(super) title: String,
    /// As in `PSNR`.
    pub(super) metric_title: &'static str,
    pub(super) better: Better,
    /// The least part of the axis that charts of this column show.
    pub(super) least_span: f64,
    pub(super) is_shown: bool,
}

/// The least part of an axis that a chart of a metric shows: a hundred steps of the last shown digit, as 1 dB, so that a
/// difference that hardly matters does not fill the chart.
pub(super) fn least_span(metric: Metric) -> f64 {
    let style = metric.style();
    100.0 / (style.scale * 10_f64.powi(style.digits as i32))
}

impl Column {
    fn of_key(key: ResultKey) -> Self {
        let ResultKey { picture, views, metric } = key;
        let region = match picture.surfaces {
            Surfaces::All => "",
            Surfaces::Specular => ", specular",
        };
        Self {
            key,
            picture: picture.kind.word(),
            views: views.word(),
            metric: metric.word(),
            region: picture.surfaces.word(),
            map: picture.kind.map().map(Map::stem),
            title: format!("{}, {}{region}", picture.kind.title(), views.title().to_lowercase()),
            metric_title: metric.style().title,
            better: metric.better(),
            least_span: least_span(metric),
            is_shown: is_shown(key),
        }
    }

    fn order(&self) -> [usize; 4] {
        fn place<T: PartialEq>(all: &[T], one: T) -> usize {
            all.iter().position(|known| *known == one).unwrap_or(all.len())
        }
        let ResultKey { picture, views, metric } = self.key;
        [
            place(Surfaces::ALL, picture.surfaces),
            place(PictureKind::ALL, picture.kind),
            place(Views::ALL, views),
            place(Metric::ALL, metric),
        ]
    }

    /// The value as tables show it.
    pub(super) fn text(&self, value: f64) -> String {
        self.key.metric.style().text(value)
    }
}

fn is_shown(ResultKey { picture, views, metric }: ResultKey) -> bool {
    let is_first = match picture.kind {
        PictureKind::Albedo | PictureKind::RgbTrue | PictureKind::RgbFitted => {
            matches!(views, Views::Input | Views::Novel)
        }
        // Beside the headline, in which a wrong tint hides how much of the texture a method has right.
        PictureKind::AlbedoAligned => views == Views::Novel,
        // The first headline number of captured rooms.
        PictureKind::Measured => return metric == Metric::RegionDeltaE,
        _ => false,
    };
    is_first && metric == Metric::Psnr && picture.surfaces == Surfaces::All
}

/// Every key of the ranking, in the order of surfaces, pictures, views and metrics.
pub(super) fn columns(ranking: &Ranking) -> Vec<Column> {
    let mut columns: Vec<Column> = ranking.keys.keys().map(|key| Column::of_key(*key)).collect();
    columns.sort_by_key(Column::order);
    if !columns.iter().any(|column| column.is_shown) {
        columns.iter_mut().take(4).for_each(|column| column.is_shown = true);
    }
    columns
}

/// The columns that are shown initially, five at most: pages of methods open with them.
pub(super) fn shown(columns: &[Column]) -> Vec<&Column> {
    columns.iter().filter(|column| column.is_shown).collect()
}

/// The column that a board is sorted by initially: the first headline number of the protocol that the board has.
pub(super) fn first<'a>(columns: &'a [Column], headline: &[ResultKey]) -> Option<&'a Column> {
    let known = headline.iter().find_map(|key| columns.iter().find(|column| column.key == *key));
    known.or_else(|| columns.iter().find(|column| column.is_shown))
}

/// The columns that pages of scenes and methods show: PSNR on all surfaces, for each picture and views, and every
/// number of measured colours.
pub(super) fn headlines(columns: &[Column]) -> Vec<&Column> {
    let is_headline = |column: &&Column| {
        let ResultKey { picture, metric, .. } = column.key;
        picture.kind == PictureKind::Measured || (metric == Metric::Psnr && picture.surfaces == Surfaces::All)
    };
    columns.iter().filter(is_headline).collect()
}

/// The choices that readers have, in groups.
#[derive(Serialize)]
pub(super) struct Choices {
    groups: Vec<ChoiceGroup>,
}

#[derive(Serialize)]
struct ChoiceGroup {
    name: &'static str,
    title: &'static str,
    choices: Vec<Choice>,
}

#[derive(Serialize)]
struct Choice {
    word: &'static str,
    title: &'static str,
    is_shown: bool,
}

/// The choices that match at least one column.
pub(super) fn choices(columns: &[Column]) -> Choices {
    type Words = Vec<(&'static str, &'static str)>;
    let pictures: Words = PictureKind::ALL.iter().map(|kind| (kind.word(), kind.title())).collect();
    let views: Words = Views::ALL.iter().map(|views| (views.word(), views.title())).collect();
    let metrics: Words = Metric::ALL.iter().map(|metric| (metric.word(), metric.style().title)).collect();
    let surfaces: Words = Surfaces::ALL.iter().map(|surfaces| (surfaces.word(), surfaces.title())).collect();
    type Group = (&'static str, &'static str, Words, fn(&Column) -> &'static str);
    let groups: [Group; 4] = [
        ("picture", "Pictures", pictures, |column| column.picture),
        ("views", "Views", views, |column| column.views),
        ("metric", "Metrics", metrics, |column| column.metric),
        ("region", "Where", surfaces, |column| column.region),
    ];
    let group = |(name, title, words, of): Group| {
        let has = |word: &str, shown: bool| columns.iter().any(|c| of(c) == word && (c.is_shown || !shown));
        let choice = |&(word, title): &(&'static str, &'static str)| Choice { word, title, is_shown: has(word, true) };
        ChoiceGroup { name, title, choices: words.iter().filter(|(word, _)| has(word, false)).map(choice).collect() }
    };
    Choices { groups: groups.map(group).into() }
}

/// The columns that hold no scores, from left to right, behind those that do: what is known about a method besides its
/// numbers. A new column is one entry.
pub(super) const FACTS: [FactColumn; 4] = [
    FactColumn { key: "numbers", title: "Numbers", is_word: true, of: numbers },
    FactColumn { key: "cost", title: "Seconds a scene", is_word: false, of: cost },
    FactColumn { key: "trained_on", title: "Trained on", is_word: true, of: trained_on },
    FactColumn { key: "licence", title: "Licence", is_word: true, of: licence },
];

/// The most characters of a text that a cell shows.
const MOST_CHARACTERS: usize = 60;

#[derive(Clone, Copy, Serialize)]
pub(super) struct FactColumn {
    /// Its name in links to a sorted board.
    key: &'static str,
    title: &'static str,
    /// Whether its cells hold words, which are aligned to the left.
    is_word: bool,
    /// Its cell for a method; none if the method does not state it.
    #[serde(skip)]
    of: fn(&LeaderboardMethod, &ProtocolResult) -> Option<Fact>,
}

#[derive(Serialize)]
pub(super) struct Fact {
    /// What the column is sorted by: a number with all digits, or a word.
    value: String,
    text: String,
    /// Small print below the text.
    note: String,
}

/// A method's cells, one for each of [`FACTS`].
pub(super) fn facts(method: &LeaderboardMethod, scores: &ProtocolResult) -> Vec<Option<Fact>> {
    FACTS.iter().map(|column| (column.of)(method, scores)).collect()
}

fn numbers(method: &LeaderboardMethod, _: &ProtocolResult) -> Option<Fact> {
    let (text, note) = match method.verified {
        Verified::Claimed => ("claimed", ""),
        Verified::Confirmed => ("verified", ""),
        Verified::Refuted => ("refuted", "other numbers were computed"),
        Verified::Stale => ("claimed", "changed since they were verified"),
    };
    Some(Fact { value: text.to_owned(), text: text.to_owned(), note: note.to_owned() })
}

fn cost(method: &LeaderboardMethod, _: &ProtocolResult) -> Option<Fact> {
    let cost = method.cost.as_ref()?;
    let value = cost.seconds_a_scene.to_string();
    Some(Fact { value, text: seconds(cost.seconds_a_scene), note: shortened(&cost.hardware) })
}

pub(super) fn trained_on(method: &LeaderboardMethod, _: &ProtocolResult) -> Option<Fact> {
    if method.trained_on.is_empty() {
        return None;
    }
    let text = method.trained_on.join(", ");
    let note = match method.overlap.as_slice() {
        [] => String::new(),
        names => format!("scenes come from {}", shortened(&names.join(", "))),
    };
    Some(Fact { value: text.clone(), text: shortened(&text), note })
}

fn licence(method: &LeaderboardMethod, _: &ProtocolResult) -> Option<Fact> {
    let licence = method.licence.as_ref().filter(|licence| !licence.is_empty())?;
    Some(Fact { value: licence.clone(), text: shortened(licence), note: String::new() })
}

/// Seconds, rounded. Submissions state any number, and a column has a limited width.
fn seconds(seconds: f64) -> String {
    match seconds {
        1e7.. => format!("{seconds:.1e}"),
        100.0.. => format!("{seconds:.0}"),
        _ => format!("{seconds:.1}"),
    }
}

/// The text, cut after [`MOST_CHARACTERS`].
fn shortened(text: &str) -> String {
    let cut = text.char_indices().nth(MOST_CHARACTERS);
    cut.map_or_else(|| text.to_owned(), |(end, _)| format!("{}…", &text[..end]))
}

/// A method, as pages name it.
#[derive(Clone, Serialize)]
pub(super) struct MethodHead {
    pub(super) id: String,
    pub(super) name: String,
    pub(super) verified: Verified,
    pub(super) oracle: bool,
    description: String,
    /// Only if it leads to a web page, as the submission is untrusted.
    link: Option<String>,
    licence: Option<String>,
    cost: Option<Cost>,
    /// Its cost, rounded.
    seconds: String,
    partial: bool,
    /// The number of scenes that it is ranked on.
    covered: usize,
    /// The number of scenes of the leaderboard.
    scenes: usize,
    /// The number of scenes that the submission leaves out, scored as grey.
    left_out: usize,
    /// The stems of maps that the submission never contains.
    not_predicted: Vec<String>,
}

impl MethodHead {
    pub(super) fn new(
        ranked: &RankedMethod,
        method: &LeaderboardMethod,
        result: &ResultFile,
        ranking: &Ranking,
    ) -> Self {
        let is_page = |url: &String| url.starts_with("https://") || url.starts_with("http://");
        let scenes = ranking.scenes.len();
        Self {
            id: ranked.id.clone(),
            name: ranked.method.clone(),
            verified: method.verified,
            oracle: method.oracle,
            description: method.description.clone(),
            link: method.url.clone().filter(is_page),
            licence: method.licence.clone().filter(|licence| !licence.is_empty()),
            seconds: method.cost.as_ref().map_or_else(String::new, |cost| seconds(cost.seconds_a_scene)),
            cost: method.cost.clone(),
            partial: ranked.partial,
            covered: scenes - ranked.not_scored.len() - ranked.left_out.len(),
            scenes,
            left_out: ranked.left_out.len(),
            not_predicted: result.not_predicted.clone(),
        }
    }
}

/// One number of a method with its interval and its ranks.
#[derive(Serialize)]
pub(super) struct Cell {
    /// The number that scripts sort by.
    value: String,
    low: Option<String>,
    high: Option<String>,
    text: String,
    interval: Option<String>,
    rank: String,
}

impl Cell {
    pub(super) fn new(column: &Column, standing: &Standing) -> Self {
        let interval = standing.interval.as_ref();
        Self {
            value: seven_digits(standing.value),
            low: interval.map(|interval| seven_digits(interval.low)),
            high: interval.map(|interval| seven_digits(interval.high)),
            text: column.text(standing.value),
            interval: interval.map(|i| format!("{} – {}", column.text(i.low), column.text(i.high))),
            rank: rank_text(standing.rank),
        }
    }
}

/// The value with seven digits, which a page does not need more of; the downloads have all digits.
fn seven_digits(value: f64) -> String {
    format!("{value:.6e}").parse().map_or_else(|_| value.to_string(), |rounded: f64| rounded.to_string())
}

/// `2`, or `2–5`.
pub(super) fn rank_text(rank: RankRange) -> String {
    if rank.best == rank.worst { rank.best.to_string() } else { format!("{}–{}", rank.best, rank.worst) }
}

/// The standing of a method by one number; none if it has no such number.
pub(super) fn standing<'a>(ranking: &'a Ranking, key: ResultKey, method: &str) -> Option<&'a Standing> {
    ranking.keys.get(&key)?.standings.iter().find(|standing| standing.method == method)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_stay_short() {
        assert_eq!(
            [0.04, 12.34, 99.96, 123.4, 9_999_999.0, 1e300].map(seconds),
            ["0.0", "12.3", "100.0", "123", "9999999", "1.0e300"]
        );
        assert_eq!(shortened("MIT"), "MIT");
        assert_eq!(shortened(&"é".repeat(60)), "é".repeat(60));
        assert_eq!(shortened(&"é".repeat(61)), format!("{}…", "é".repeat(60)));
    }
}
