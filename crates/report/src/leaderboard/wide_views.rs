//! The page that shows how scores fall in views from other places than the input view's.

use mateval_scene::dataset::WideView;
use minijinja::context;
use minijinja::value::Serde;

use super::board::Board;
use super::site::{Page, SiteWriter};
use super::wide_curves::{Axis, Chart, Method, charts};
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
    let all: Vec<&WideView> =
        methods.iter().take(1).flat_map(|m| m.wide_views.values()).flat_map(|v| v.values()).collect();
    let distances: Vec<Chart> = charts(&methods, Axis::Distance);
    let shares: Vec<Chart> = charts(&methods, Axis::UnseenShare);
    site.page(&Page {
        file: "wide_views.html",
        template: "wide_views.j2",
        title: "Wide views",
        scripts: &[],
        values: context! {
            views => all.len(),
            scenes => methods.first().map_or(0, |method| method.wide_views.len()),
            sections => [
                context! { title => "By distance from the input camera", charts => Serde(&distances) },
                context! { title => "By the share of the picture that the input view does not show", charts => Serde(&shares) },
            ],
        },
    })
}
