//! The page that shows how a method's scores fall the more the geometry that it is given differs from the true one.

use std::collections::BTreeMap;

use mateval_scene::perturbation::PerturbationKind;
use minijinja::context;
use minijinja::value::Serde;

use super::board::Board;
use super::chart::{Chart, Section, Values};
use super::columns::{Column, headlines};
use super::site::{Page, SiteWriter};
use crate::error::ReportError;

/// Whether any submission was made from perturbed geometry.
pub(super) fn has_any(board: &Board<'_>) -> bool {
    board.results.iter().any(|result| result.submission.geometry.is_some())
}

/// Writes the page, if any submission was made from perturbed geometry.
pub(super) fn write(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    if !has_any(board) {
        return Ok(());
    }
    let sections: Vec<Section> = PerturbationKind::ALL.into_iter().filter_map(|kind| section(board, kind)).collect();
    site.page(&Page {
        file: "perturbed.html",
        template: "perturbed.j2",
        title: "Imperfect geometry",
        scripts: &[],
        values: context! { sections => Serde(&sections) },
    })
}

/// The charts of one kind; none where no submission was made from such geometry.
fn section(board: &Board<'_>, kind: PerturbationKind) -> Option<Section> {
    let mut stated = board.results.iter().filter_map(|result| result.submission.geometry);
    if !stated.any(|perturbation| perturbation.kind == kind) {
        return None;
    }
    let charts: Vec<Chart> = headlines(&board.columns)
        .into_iter()
        .filter_map(|column| {
            let title = format!("{}, {}", column.title, column.metric_title);
            let level = |level| if level == 0 { "true".to_owned() } else { format!("level {level}") };
            Chart::new(title, level, &by_level(board, kind, column), |value| column.text(value))
        })
        .collect();
    let title = match kind {
        PerturbationKind::Pose => "Furniture that is moved and turned",
        PerturbationKind::Scale => "Furniture that is enlarged or reduced",
        PerturbationKind::Shape => "Furniture whose surface is bent",
    };
    Some(Section { title: title.to_owned(), charts })
}

/// The values of the methods that have one of this kind, by level; level 0 is the true geometry.
fn by_level<'a>(board: &'a Board<'_>, kind: PerturbationKind, column: &Column) -> Vec<Values<'a>> {
    let mut lines: Vec<Values<'_>> = Vec::new();
    for at in board.best_first() {
        let result = &board.results[at];
        let level = match result.submission.geometry {
            None => 0,
            Some(perturbation) if perturbation.kind == kind => perturbation.level,
            Some(_) => continue,
        };
        let Some(value) = board.scores[at].summary.get(&column.key) else { continue };
        let place = lines.iter().position(|(name, _)| *name == result.method).unwrap_or(lines.len());
        if place == lines.len() {
            lines.push((&result.method, BTreeMap::new()));
        }
        // Of several submissions of a method at one level, the one that the board lists first counts.
        lines[place].1.entry(level).or_insert(*value);
    }
    lines.retain(|(_, values)| values.keys().any(|level| *level > 0));
    lines
}
