//! The page that shows how scores fall in views from other places than the input view's.

use std::collections::BTreeMap;

use minijinja::context;
use minijinja::value::Serde;

use super::board::Board;
use super::chart::Section;
use super::site::{Page, SiteWriter};
use super::wide_curves::{Axis, Method, charts};
use crate::error::ReportError;

/// Whether any scene has wide views.
pub(super) fn has_any(board: &Board<'_>) -> bool {
    board.results.iter().any(|result| !result.dataset.wide_views.is_empty())
}

/// Writes the page, if any scene has wide views.
pub(super) fn write(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    if !has_any(board) {
        return Ok(());
    }
    let methods: Vec<Method<'_>> = board
        .best_first()
        .into_iter()
        .map(|at| Method {
            name: &board.heads[at].name,
            pictures: &board.scores[at].pictures,
            wide_views: &board.results[at].dataset.wide_views,
        })
        .collect();
    let scenes = methods.first().map(|method| method.wide_views);
    let sections = [
        ("By distance from the input camera", Axis::Distance),
        ("By the share of the picture that the input view does not show", Axis::UnseenShare),
    ]
    .map(|(title, axis)| Section { title: title.to_owned(), charts: charts(&methods, axis) });
    site.page(&Page {
        file: "wide_views.html",
        template: "wide_views.j2",
        title: "Wide views",
        scripts: &[],
        values: context! {
            views => scenes.map_or(0, |scenes| scenes.values().map(BTreeMap::len).sum()),
            scenes => scenes.map_or(0, BTreeMap::len),
            sections => Serde(&sections),
        },
    })
}
