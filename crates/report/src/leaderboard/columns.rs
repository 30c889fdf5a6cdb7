//! The columns of the board that hold scores: one for each key of the results, chosen by picture, views, metric and
//! surfaces.

use mateval_eval::metric::{Better, Metric};
use mateval_eval::result_key::{PictureKind, ResultKey, Surfaces, Views};
use mateval_scene::submission::Map;
use serde::Serialize;

use crate::ranking::file::Ranking;

/// A column of scores.
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
    /// Whether it is shown initially.
    pub(super) is_shown: bool,
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

/// Whether a column is shown initially.
fn is_shown(ResultKey { picture, views, metric }: ResultKey) -> bool {
    matches!(picture.kind, PictureKind::Albedo | PictureKind::RgbTrue | PictureKind::RgbFitted)
        && matches!(views, Views::Input | Views::Novel)
        && metric == Metric::Psnr
        && picture.surfaces == Surfaces::All
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

/// The columns that are shown initially, four at most: pages of methods open with them.
pub(super) fn shown(columns: &[Column]) -> Vec<&Column> {
    columns.iter().filter(|column| column.is_shown).collect()
}

/// The column that a board is sorted by initially: the first headline number of the protocol that the board has.
pub(super) fn first<'a>(columns: &'a [Column], headline: &[ResultKey]) -> Option<&'a Column> {
    let known = headline.iter().find_map(|key| columns.iter().find(|column| column.key == *key));
    known.or_else(|| columns.iter().find(|column| column.is_shown))
}

/// The columns that pages of scenes and methods show: PSNR on all surfaces, for each picture and views.
pub(super) fn headlines(columns: &[Column]) -> Vec<&Column> {
    let is_headline =
        |column: &&Column| column.key.metric == Metric::Psnr && column.key.picture.surfaces == Surfaces::All;
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
