//! Writes the files of a site: filled templates with what every page shows, and assets.

use std::path::{Path, PathBuf};

use mateval_files::whole::write_whole;
use mateval_files::work_folder::make_folder;
use mateval_pages as pages;
use minijinja::value::{Serde, Value};
use minijinja::{Environment, context};
use serde::Serialize;

use crate::error::ReportError;

/// Files that are written unchanged.
const ASSETS: [(&str, &str); 6] = [
    ("site.css", pages::STYLE),
    ("sort.js", pages::SORT),
    ("slider.js", pages::SLIDER),
    ("board.js", include_str!("templates/board.js")),
    ("scene.js", include_str!("templates/scene.js")),
    ("downloads/PROTOCOL.md", include_str!("../../../../dataset_spec/PROTOCOL.md")),
];

const TEMPLATES: [(&str, &str); 16] = [
    ("base.j2", include_str!("templates/base.j2")),
    ("marks.j2", include_str!("templates/marks.j2")),
    ("board.j2", include_str!("templates/board.j2")),
    ("method.j2", include_str!("templates/method.j2")),
    ("scenes.j2", include_str!("templates/scenes.j2")),
    ("scene.j2", include_str!("templates/scene.j2")),
    ("room.j2", include_str!("templates/room.j2")),
    ("protocol.j2", include_str!("templates/protocol.j2")),
    ("about.j2", include_str!("templates/about.j2")),
    ("errata.j2", include_str!("templates/errata.j2")),
    ("wide_views.j2", include_str!("templates/wide_views.j2")),
    ("perturbed.j2", include_str!("templates/perturbed.j2")),
    ("constancy.j2", include_str!("templates/constancy.j2")),
    ("robustness.j2", include_str!("templates/robustness.j2")),
    ("contamination.j2", include_str!("templates/contamination.j2")),
    ("votes.j2", include_str!("templates/votes.j2")),
];

/// What every page shows.
#[derive(Clone, Serialize)]
pub(super) struct Site {
    pub(super) title: String,
    pub(super) tool: String,
    pub(super) protocol: String,
    /// Whether the protocol scores captured rooms.
    pub(super) captured: bool,
    /// What `eval score` needs besides the dataset; empty for the protocol that it uses by default.
    pub(super) protocol_words: String,
    pub(super) fingerprint: String,
    pub(super) scenes: usize,
    pub(super) houses: usize,
    /// That the truth is withheld, and what that is worth; none if it is public.
    pub(super) withheld: Option<&'static str>,
    /// Whether there are enough houses for intervals, ranks and comparisons of pairs.
    pub(super) has_intervals: bool,
    /// The fewest houses for which there are intervals.
    pub(super) least_houses: usize,
    pub(super) pages: Vec<PageLink>,
}

#[derive(Clone, Copy, Serialize)]
pub(super) struct PageLink {
    file: &'static str,
    title: &'static str,
}

/// The menu of every site.
pub(super) const PAGES: [PageLink; 5] = [
    PageLink { file: "index.html", title: "Leaderboard" },
    PageLink { file: "scenes.html", title: "Scenes" },
    PageLink { file: "protocol.html", title: "Protocol" },
    PageLink { file: "errata.html", title: "Errata" },
    PageLink { file: "about.html", title: "About" },
];

/// The entry of a site whose scenes have views from other places.
pub(super) const WIDE_VIEWS: PageLink = PageLink { file: "wide_views.html", title: "Wide views" };

/// The entry of a site with submissions that were made from perturbed geometry.
pub(super) const PERTURBED: PageLink = PageLink { file: "perturbed.html", title: "Imperfect geometry" };

/// The entry of a site whose dataset has twins that methods answer.
pub(super) const CONSTANCY: PageLink = PageLink { file: "constancy.html", title: "Constancy" };

/// The entry of a site with methods to compare.
pub(super) const ROBUSTNESS: PageLink = PageLink { file: "robustness.html", title: "Robustness" };

/// The entry of a site of redressed rooms, with results on the original ones.
pub(super) const CONTAMINATION: PageLink = PageLink { file: "contamination.html", title: "Contamination" };

/// The entry of a site on which people vote.
pub(super) const VOTES: PageLink = PageLink { file: "votes.html", title: "Vote" };

pub(super) struct Page<'a> {
    /// Its file in the site, at most one folder deep.
    pub(super) file: &'a str,
    pub(super) template: &'static str,
    pub(super) title: &'a str,
    pub(super) scripts: &'static [&'static str],
    /// The values for its template, besides those that every page has.
    pub(super) values: Value,
}

/// Writes files into a folder.
pub(super) struct SiteWriter<'a> {
    folder: &'a Path,
    site: Site,
    environment: Environment<'static>,
}

impl<'a> SiteWriter<'a> {
    pub(super) fn new(folder: &'a Path, site: Site) -> Self {
        let mut environment = pages::environment();
        for (name, text) in TEMPLATES {
            environment.add_template(name, text).expect("the templates are valid: a test fills all of them");
        }
        Self { folder, site, environment }
    }

    pub(super) fn assets(&self) -> Result<(), ReportError> {
        ASSETS.iter().try_for_each(|(file, text)| self.file(file, text))
    }

    pub(super) fn page(&self, page: &Page<'_>) -> Result<(), ReportError> {
        let root = if page.file.contains('/') { "../" } else { "" };
        let (shell, site) = (pages::linked(root, page.scripts), Serde(&self.site));
        let shared = context! { site, root, title => page.title, current => page.file, shell };
        let template = self.environment.get_template(page.template).expect("every page names one of the templates");
        let text = template.render(context! { ..page.values.clone(), ..shared });
        self.file(page.file, &text.expect("the templates are valid: a test fills all of them"))
    }

    pub(super) fn file(&self, file: &str, text: &str) -> Result<(), ReportError> {
        let path = self.path(file);
        if let Some(folder) = path.parent() {
            make_folder(folder)?;
        }
        Ok(write_whole(&path, text.as_bytes())?)
    }

    pub(super) fn title(&self) -> &str {
        &self.site.title
    }

    pub(super) fn path(&self, file: &str) -> PathBuf {
        self.folder.join(file)
    }
}
