//! The leaderboard as a static site that opens from the disk.
//!
//! In: results of one protocol, perhaps pictures. Out: a folder with a page for the board, each method and each scene, the
//! protocol, the paper's own numbers and errata, and the numbers as files.
//!
//! `columns` says which numbers there are, `heads` what is shown of a method; a file for each page puts together what its
//! template in `templates` needs, and `site` writes it. No page needs a server or anything from elsewhere.

mod board_page;
mod columns;
mod downloads;
pub mod errata;
pub mod file;
mod heads;
mod method_page;
mod paper;
mod pictures;
mod protocol_page;
mod scene_page;
mod site;
#[cfg(test)]
mod tests;
pub mod verified;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mateval_scene::dataset_id::DatasetId;
use mateval_scene::open::Dataset;
use mateval_scene::work_folder::{WorkFolder, check_free};
use mateval_scene::{Progress, SceneId};
use minijinja::context;
use minijinja::value::Serde;

use self::columns::Column;
use self::errata::ErrataFile;
use self::file::{LEADERBOARD_FORMAT, LeaderboardDataset, LeaderboardFile, LeaderboardMethod};
use self::heads::MethodHead;
use self::site::{PAGES, Page, Site, SiteWriter};
use self::verified::Verified;
use crate::error::ReportError;
use crate::picture_set::PictureSet;
use crate::ranking::file::{RankedMethod, Ranking};
use crate::ranking::rank;
use crate::strips::Shown;
use mateval_eval::result::{ProtocolResult, ResultFile};

/// What every leaderboard's folder holds.
const LEADERBOARD: &str = "downloads/leaderboard.json";

/// What a leaderboard is made of.
pub struct LeaderboardPlan<'a> {
    /// The results.
    pub results: &'a [ResultFile],
    /// Whether each of them was verified.
    pub verified: Vec<Verified>,
    /// Under which rules.
    pub protocol: &'a str,
    /// Whether results that cover some scenes only are let in.
    pub partial: bool,
    /// What was found wrong later.
    pub errata: Option<&'a ErrataFile>,
    /// A set of pictures to show; see [`crate::picture_set`].
    pub pictures: Option<&'a Path>,
    /// What to make pictures from.
    pub submissions: Option<Submissions<'a>>,
    /// Name and version of the tool.
    pub tool: String,
}

/// Submissions whose pictures are shown.
pub struct Submissions<'a> {
    /// What they were scored on.
    pub dataset: &'a Dataset,
    /// Their folders.
    pub folders: Vec<PathBuf>,
    /// What of them is shown.
    pub shown: Vec<Shown>,
}

/// All that pages are made of.
struct Board<'a> {
    results: &'a [ResultFile],
    scores: Vec<&'a ProtocolResult>,
    file: LeaderboardFile,
    heads: Vec<MethodHead>,
    columns: Vec<Column>,
    pictures: PictureSet,
}

impl Board<'_> {
    fn ranking(&self) -> &Ranking {
        &self.file.ranking
    }

    /// The column that the board is sorted by at first.
    fn first(&self) -> Option<&Column> {
        columns::first(&self.columns)
    }

    /// What the method at this place has of a scene, as tables show it.
    fn texts(&self, at: usize, scene: &SceneId, columns: &[&Column]) -> Vec<Option<String>> {
        let values = self.scores[at].scenes.get(scene);
        columns.iter().map(|column| Some(column.text(*values?.get(&column.key)?))).collect()
    }
}

/// Writes the site into the folder `out`, whole or not at all. An earlier leaderboard there is replaced if `force`; nothing
/// else ever is.
pub fn write(plan: &LeaderboardPlan<'_>, out: &Path, force: bool, progress: Progress<'_>) -> Result<(), ReportError> {
    check_place(out, force)?;
    progress("ranking", 0, 1);
    let ranking = rank(plan.results, plan.protocol, plan.partial)?;
    let work = WorkFolder::start(out)?;
    let pictures = pictures::gather(plan, &ranking, &work.path().join("pictures"), progress)?;
    let board = board(plan, ranking, pictures);
    let site = SiteWriter::new(work.path(), site(&board));
    site.assets()?;
    downloads::write(&board, plan.protocol, &site)?;
    board_page::write(&board, &site)?;
    let pages = board.heads.len() + board.ranking().scenes.len();
    for at in 0..board.heads.len() {
        progress("pages", at, pages);
        method_page::write(&board, at, &site)?;
    }
    for at in 0..board.ranking().scenes.len() {
        progress("pages", board.heads.len() + at, pages);
        scene_page::write(&board, at, &site)?;
    }
    scene_page::write_list(&board, &site)?;
    protocol_page::write(&board, &site)?;
    write_plain(plan, &site)?;
    Ok(work.finish()?)
}

fn check_place(out: &Path, force: bool) -> Result<(), ReportError> {
    let path = out.display();
    if !out.exists() || out.read_dir().is_ok_and(|mut files| files.next().is_none()) {
        return Ok(());
    }
    if !out.join(LEADERBOARD).is_file() {
        let what = format!("'{path}' is there and is no leaderboard; choose another --out");
        return Err(ReportError::Invalid(what));
    }
    Ok(check_free(out, force, "--out")?)
}

fn board<'a>(plan: &LeaderboardPlan<'a>, ranking: Ranking, pictures: PictureSet) -> Board<'a> {
    let method = |((method, result), verified): ((&RankedMethod, &ResultFile), &Verified)| {
        let said = result.submission.clone();
        LeaderboardMethod {
            id: method.id.clone(),
            description: said.description,
            url: said.url,
            licence: said.licence,
            cost: said.cost,
            verified: *verified,
        }
    };
    let methods: Vec<_> = ranking.methods.iter().zip(plan.results).zip(&plan.verified).map(method).collect();
    // The ranking has refused an empty list.
    let dataset = plan.results.first().map(|result| &result.dataset);
    let text = |of: fn(&DatasetId) -> &String| dataset.map(of).cloned().unwrap_or_default();
    let dataset = LeaderboardDataset {
        name: text(|dataset| &dataset.name),
        version: text(|dataset| &dataset.version),
        manifest_sha256: text(|dataset| &dataset.manifest_sha256),
    };
    let heads = ranking.methods.iter().zip(&methods).map(|(ranked, said)| MethodHead::new(ranked, said, &ranking));
    Board {
        results: plan.results,
        scores: plan.results.iter().filter_map(|result| result.protocols.get(plan.protocol)).collect(),
        heads: heads.collect(),
        columns: columns::columns(&ranking),
        pictures,
        file: LeaderboardFile {
            format: LEADERBOARD_FORMAT.to_owned(),
            tool: plan.tool.clone(),
            dataset,
            methods,
            ranking,
        },
    }
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
        pages: PAGES,
    }
}

/// The pages that hold nothing of the results.
fn write_plain(plan: &LeaderboardPlan<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
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
