//! Keys of results as the columns that readers choose from: picture, views, metric.

use serde::Serialize;

use crate::ranking::file::Ranking;
use mateval_eval::metric_kind::{Better, Metric, SCORES, score_of_key};

/// Pictures in the order in which they are offered.
const PICTURES: [(&str, &str); 10] = [
    ("albedo", "Albedo"),
    ("albedo_aligned", "Aligned albedo"),
    ("rgb_true", "RGB, true light"),
    ("rgb_fitted", "RGB, fitted light"),
    ("rgb_relit", "RGB, relit"),
    ("roughness", "Roughness"),
    ("metallic", "Metallic"),
    ("texture_base_color", "Base colour texels"),
    ("texture_roughness", "Roughness texels"),
    ("texture_metallic", "Metallic texels"),
];

const VIEWS: [(&str, &str); 4] =
    [("input", "Input view"), ("novel", "Novel views"), ("observed", "Observed"), ("unobserved", "Unobserved")];

/// What of a picture counts.
const REGIONS: [(&str, &str); 2] = [("all", "All surfaces"), ("specular", "Specular regions")];

/// Behind the name of a picture of which only specular regions count.
const SPECULAR: &str = "_specular";

/// What is shown before anybody has chosen.
const SHOWN: [&[&str]; 4] = [&["albedo", "rgb_true"], &["input", "novel"], &["psnr"], &["all"]];

/// A board is sorted by the first of these that it has.
const FIRST: [&str; 3] = ["albedo.novel.psnr", "albedo.novel.mse", "albedo.input.psnr"];

/// One number of a method.
#[derive(Clone, Serialize)]
pub(super) struct Column {
    pub(super) key: String,
    pub(super) picture: &'static str,
    pub(super) views: &'static str,
    pub(super) metric: &'static str,
    pub(super) region: &'static str,
    /// As in `Albedo, novel views`.
    pub(super) title: String,
    /// As in `PSNR`.
    pub(super) metric_title: &'static str,
    pub(super) better: Better,
    /// Whether it is shown before anybody has chosen.
    pub(super) is_shown: bool,
    #[serde(skip)]
    pub(super) kind: &'static Metric,
}

impl Column {
    fn of_key(key: &str) -> Option<Self> {
        let kind = score_of_key(key)?;
        let mut words = key.split('.');
        // Keys become names of files: picture, views, metric, and nothing besides.
        let (picture, views, None) = (words.next()?, words.next()?, words.nth(1)) else { return None };
        let (picture, region) = match picture.strip_suffix(SPECULAR) {
            Some(whole) => (whole, REGIONS[1]),
            None => (picture, REGIONS[0]),
        };
        let [picture, views] = [find(&PICTURES, picture)?, find(&VIEWS, views)?];
        let of_region = if region == REGIONS[1] { ", specular" } else { "" };
        let chosen = [picture.0, views.0, kind.key, region.0];
        Some(Self {
            key: key.to_owned(),
            picture: picture.0,
            views: views.0,
            metric: kind.key,
            region: region.0,
            title: format!("{}, {}{of_region}", picture.1, views.1.to_lowercase()),
            metric_title: kind.title,
            better: kind.better?,
            is_shown: SHOWN.iter().zip(chosen).all(|(shown, word)| shown.contains(&word)),
            kind,
        })
    }

    fn order(&self) -> [usize; 4] {
        let place = |words: &[(&str, &str)], word| words.iter().position(|(known, _)| *known == word).unwrap_or(0);
        let metric = SCORES.iter().position(|metric| metric.key == self.metric).unwrap_or(0);
        [place(&REGIONS, self.region), place(&PICTURES, self.picture), place(&VIEWS, self.views), metric]
    }

    /// The value as tables show it.
    pub(super) fn text(&self, value: f64) -> String {
        format!("{:.*}", self.kind.digits, value * self.kind.scale)
    }
}

fn find(words: &[(&'static str, &'static str)], word: &str) -> Option<(&'static str, &'static str)> {
    words.iter().find(|(known, _)| *known == word).copied()
}

/// Every key of the ranking that a reader can choose, in the order of pictures, views and metrics.
pub(super) fn columns(ranking: &Ranking) -> Vec<Column> {
    let mut columns: Vec<Column> = ranking.keys.keys().filter_map(|key| Column::of_key(key)).collect();
    columns.sort_by_key(Column::order);
    if !columns.iter().any(|column| column.is_shown) {
        columns.iter_mut().take(4).for_each(|column| column.is_shown = true);
    }
    columns
}

/// The column that a board is sorted by at first.
pub(super) fn first(columns: &[Column]) -> Option<&Column> {
    let known = FIRST.iter().find_map(|key| columns.iter().find(|column| column.key == *key));
    known.or_else(|| columns.iter().find(|column| column.is_shown))
}

/// A column a picture and views, of whole pictures and in its best known metric: what a page of a scene or a method shows.
pub(super) fn headlines(columns: &[Column]) -> Vec<&Column> {
    let is_headline = |column: &&Column| column.metric == "psnr" && column.region == REGIONS[0].0;
    columns.iter().filter(is_headline).collect()
}

/// What readers choose from.
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

/// The words that some column has.
pub(super) fn choices(columns: &[Column]) -> Choices {
    let metrics: Vec<(&str, &str)> = SCORES.iter().map(|metric| (metric.key, metric.title)).collect();
    type Group<'a> = (&'static str, &'static str, &'a [(&'static str, &'static str)], fn(&Column) -> &'static str);
    let groups: [Group<'_>; 4] = [
        ("picture", "Pictures", &PICTURES, |column| column.picture),
        ("views", "Views", &VIEWS, |column| column.views),
        ("metric", "Metrics", &metrics, |column| column.metric),
        ("region", "Where", &REGIONS, |column| column.region),
    ];
    let group = |(name, title, words, of): Group<'_>| {
        let has = |word: &str, shown: bool| columns.iter().any(|c| of(c) == word && (c.is_shown || !shown));
        let choice = |&(word, title): &(&'static str, &'static str)| Choice { word, title, is_shown: has(word, true) };
        ChoiceGroup { name, title, choices: words.iter().filter(|(word, _)| has(word, false)).map(choice).collect() }
    };
    Choices { groups: groups.map(group).into() }
}
