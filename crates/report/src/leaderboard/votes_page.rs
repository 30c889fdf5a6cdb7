//! The page on which people vote: pairs of methods' pictures beside the truth, without names. It works from the disk,
//! and saves what `votes` counts. Which pairs exist is stated here; the script draws their order and sides for each
//! voter. The pictures are copies that are named after their content, since the address of a picture is shown to
//! whoever points at it.

use std::collections::BTreeSet;

use mateval_files::FileError;
use mateval_files::untrusted::sha256_of_file;
use mateval_files::work_folder::make_folder;
use minijinja::context;
use serde::Serialize;

use super::board::Board;
use super::columns::MethodHead;
use super::pictures::{ERROR, Kind, TRUTH, kinds_in_order};
use super::site::{Page, SiteWriter};
use crate::error::ReportError;
use crate::votes::{VOTES_FORMAT, VotedMethod};

/// What the script shows, and states in the files that it saves.
#[derive(Serialize)]
struct Ballot<'a> {
    format: &'static str,
    tool: &'a str,
    protocol: &'a str,
    fingerprint: &'a str,
    /// The folder of the pictures.
    folder: &'static str,
    methods: Vec<VotedMethod>,
    kinds: Vec<Kind>,
    pictures: Vec<BallotPicture<'a>>,
}

/// A view of a scene that the truth and at least two methods show in pictures of one kind.
#[derive(Serialize)]
struct BallotPicture<'a> {
    scene: &'a str,
    view: &'a str,
    picture: &'a str,
    /// The file of the truth's picture.
    truth: String,
    methods: Vec<BallotMethod<'a>>,
}

#[derive(Serialize)]
struct BallotMethod<'a> {
    id: &'a str,
    /// The file of its picture.
    file: String,
}

/// The folder of the page's pictures.
const FOLDER: &str = "votes";

/// Writes `votes.html`. Fails where no picture can be voted on. What was made from the truth is no method.
pub(super) fn write(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    let ranking = board.ranking();
    let heads: Vec<&MethodHead> = board.heads.iter().filter(|head| !head.oracle).collect();
    let mut pictures = Vec::new();
    for scene in &ranking.scenes {
        for view in board.pictures.views(scene) {
            let kinds = board.pictures.kinds(TRUTH, scene, view);
            for picture in kinds.into_iter().filter(|kind| !kind.ends_with(ERROR)) {
                let has_it = |head: &&&MethodHead| board.pictures.kinds(&head.id, scene, view).contains(&picture);
                let ids: Vec<&str> = heads.iter().filter(has_it).map(|head| head.id.as_str()).collect();
                if ids.len() > 1 {
                    let file = |method: &str| unnamed(site, &format!("{method}/{scene}/{view}/{picture}.png"));
                    let methods = ids.into_iter().map(|id| Ok(BallotMethod { id, file: file(id)? }));
                    let methods = methods.collect::<Result<Vec<_>, ReportError>>()?;
                    pictures.push(BallotPicture { scene: scene.as_str(), view, picture, truth: file(TRUTH)?, methods });
                }
            }
        }
    }
    if pictures.is_empty() {
        return Err(ReportError::NothingToVoteOn);
    }
    let is_shown = |id: &str| pictures.iter().any(|picture| picture.methods.iter().any(|method| method.id == id));
    let shown = ranking.methods.iter().filter(|method| is_shown(&method.id));
    let ballot = Ballot {
        format: VOTES_FORMAT,
        tool: &board.file.tool,
        protocol: &ranking.protocol,
        fingerprint: &ranking.fingerprint,
        folder: FOLDER,
        methods: shown
            .map(|method| VotedMethod {
                id: method.id.clone(),
                method: method.method.clone(),
                submission_sha256: method.submission_sha256.clone(),
            })
            .collect(),
        kinds: kinds_in_order(pictures.iter().map(|picture| picture.picture).collect::<BTreeSet<_>>()),
        pictures,
    };
    site.file("votes.js", include_str!("templates/votes.js"))?;
    site.page(&Page {
        file: "votes.html",
        template: "votes.j2",
        title: "Which picture is closer to the truth?",
        scripts: &["votes.js"],
        values: context! { ballot => serde_json::json!(ballot).to_string() },
    })
}

/// Copies one of the site's pictures to the page's folder, and returns its name there.
fn unnamed(site: &SiteWriter<'_>, picture: &str) -> Result<String, ReportError> {
    let from = site.path("pictures").join(picture);
    let name = format!("{}.png", &sha256_of_file(&from)?[..32]);
    let folder = site.path(FOLDER);
    make_folder(&folder)?;
    std::fs::copy(&from, folder.join(&name)).map_err(FileError::io("copy", &from))?;
    Ok(name)
}
