//! The leaderboard as a static site that opens from the disk.
//!
//! In: results under one protocol, and optionally pictures. Out: a folder with pages for the board, for each method and
//! scene, for the protocol, the paper's own numbers and errata, and with the numbers as files.
//!
//! `results_folder` lists the files of a folder, and `entries` reads them and refuses those that cannot make a board.
//! `board` gathers what pages show: `columns` of scores, `facts` about methods, `heads` that name a method, `pictures`,
//! of which `comparison` chooses those beside the truth, and `rooms` in 3D. Each page has a file that collects the
//! values for its template in `templates`, and `site` writes it. No page needs a server or loads anything from
//! elsewhere.

mod board;
mod board_page;
mod ceiling;
mod chart;
mod columns;
mod comparison;
mod downloads;
pub mod entries;
pub mod errata;
mod facts;
pub mod file;
mod heads;
mod method_page;
mod named_submission;
mod paper;
mod perturbed;
mod pictures;
mod plan;
mod protocol_page;
pub mod results_folder;
mod room_maps;
mod room_page;
mod rooms;
mod scene_page;
mod site;
#[cfg(test)]
mod tests;
pub mod verified;
mod wide_curves;
mod wide_views;

pub use plan::{LeaderboardPlan, Submissions};

use std::collections::BTreeSet;
use std::path::Path;

use mateval_scene::work_folder::{WorkFolder, check_free};
use mateval_scene::{Progress, Report};
use minijinja::context;
use minijinja::value::Serde;

use self::board::Board;
use self::file::LEADERBOARD_PATH;
use self::site::{PAGES, PERTURBED, Page, Site, SiteWriter, WIDE_VIEWS};
use crate::error::ReportError;
use crate::ranking::rank;

/// Writes the site into the folder `out`, completely or not at all. Replaces a leaderboard that exists there if
/// `force`, and never replaces anything else.
pub fn write(plan: &LeaderboardPlan<'_>, out: &Path, force: bool, progress: Progress<'_>) -> Result<(), ReportError> {
    check_place(out, force)?;
    progress(Report::step("ranking", 0, 1));
    let ranking = rank(plan.results, plan.protocol, plan.partial)?;
    let ceiling = plan.ceiling.map(|result| ceiling::of(result, &ranking)).transpose()?;
    let work = WorkFolder::start(out)?;
    let named = named_submission::named(plan, &ranking)?;
    let pictures = pictures::gather(plan, &named, &ranking, &work.path().join("pictures"), progress)?;
    let rooms = rooms::write(plan, &named, &ranking, &work.path().join("rooms"), progress)?;
    let board = Board::new(plan, ranking, ceiling, pictures, rooms);
    let site = SiteWriter::new(work.path(), site(&board));
    site.assets()?;
    downloads::write(&board, plan.protocol, &site)?;
    board_page::write(&board, &site)?;
    let pages = board.heads.len() + board.ranking().scenes.len();
    for at in 0..board.heads.len() {
        progress(Report::step("pages", at, pages));
        method_page::write(&board, at, &site)?;
    }
    for at in 0..board.ranking().scenes.len() {
        progress(Report::step("pages", board.heads.len() + at, pages));
        scene_page::write(&board, at, &site)?;
    }
    scene_page::write_list(&board, &site)?;
    room_page::write(&board, &site)?;
    wide_views::write(&board, &site)?;
    perturbed::write(&board, &site)?;
    protocol_page::write(&board, &site)?;
    write_constant_pages(plan, &site)?;
    Ok(work.finish()?)
}

fn check_place(out: &Path, force: bool) -> Result<(), ReportError> {
    if !out.exists() || out.read_dir().is_ok_and(|mut files| files.next().is_none()) {
        return Ok(());
    }
    if !out.join(LEADERBOARD_PATH).is_file() {
        return Err(ReportError::NotALeaderboard { path: out.to_owned() });
    }
    Ok(check_free(out, force, "--out")?)
}

fn site(board: &Board<'_>) -> Site {
    let (dataset, ranking) = (&board.file.dataset, board.ranking());
    Site {
        title: format!("{} {} leaderboard", dataset.name, dataset.version),
        tool: board.file.tool.clone(),
        protocol: ranking.protocol.clone(),
        fingerprint: ranking.fingerprint.clone(),
        scenes: ranking.scenes.len(),
        houses: ranking.houses.values().collect::<BTreeSet<_>>().len(),
        has_intervals: board.has_intervals(),
        least_houses: ranking.rules.least_houses,
        pages: PAGES
            .into_iter()
            .chain(wide_views::has_any(board).then_some(WIDE_VIEWS))
            .chain(perturbed::has_any(board).then_some(PERTURBED))
            .collect(),
    }
}

/// Writes the pages that do not depend on the results.
fn write_constant_pages(plan: &LeaderboardPlan<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    let paper = paper::page();
    site.page(&Page {
        file: "paper.html",
        template: "paper.j2",
        title: "The paper's numbers",
        scripts: &["sort.js"],
        values: context! { paper => Serde(&paper) },
    })?;
    let errata = plan.errata.map_or(&[][..], |errata| &errata.entries);
    site.page(&Page {
        file: "errata.html",
        template: "errata.j2",
        title: "Errata",
        scripts: &[],
        values: context! { errata => Serde(errata) },
    })
}
