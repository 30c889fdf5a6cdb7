//! The commands that show results: `mateval eval tables`, `explain`, `pictures`, `leaderboard` and `votes`.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::builder::PossibleValue;
use mateval_dataset::open::{Dataset, check_outside_datasets};
use mateval_dataset::{SceneId, json};
use mateval_eval::metric::PictureKind;
use mateval_eval::protocol::{Protocol, Track};
use mateval_eval::result::ResultFile;
use mateval_report::explain::{self, ExplainPlan};
use mateval_report::leaderboard::entries::ResultsFolder;
use mateval_report::leaderboard::marks::{TrustedKeys, Verified};
use mateval_report::leaderboard::{self, Hub, LeaderboardPlan, Submissions, entries, marks};
use mateval_report::strips::{self, Shown, StripPlan};
use mateval_report::tables::{Grouping, TableFormat, tables};
use mateval_report::votes::{plain, preferences};
use mateval_submission::archive::Opened;

use crate::TOOL;
use crate::arguments::{Format, open_submission};
use crate::terminal::{Outcome, columns, print, say, with_progress};

#[derive(clap::Args)]
pub struct TablesArgs {
    /// RESULT.json files.
    #[arg(required = true, value_name = "RESULT.json")]
    results: Vec<PathBuf>,
    /// RESULT.json of the truth itself (`mateval baseline gt`), shown in the last row as the ceiling of each column.
    #[arg(long, value_name = "RESULT.json")]
    ceiling: Option<PathBuf>,
    /// Protocol whose scores are shown.
    #[arg(long, default_value = Protocol::DEFAULT)]
    protocol: String,
    /// Format of the tables.
    #[arg(long, value_enum, default_value = "markdown")]
    format: FormatName,
    /// One row per scene, or per category of instances, whose errors are pooled over all their pixels [default: one row
    /// per result, over the whole dataset].
    #[arg(long, value_enum)]
    by: Option<GroupName>,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum GroupName {
    Scene,
    Category,
    SuperCategory,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum FormatName {
    Markdown,
    Latex,
    Csv,
    Text,
}

impl TablesArgs {
    /// Prints the tables, and a warning for each metric that a result lacks.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let results = self.results.iter().map(|path| ResultFile::read(path)).collect::<Result<Vec<_>, _>>()?;
        let format = match self.format {
            FormatName::Markdown => TableFormat::Markdown,
            FormatName::Latex => TableFormat::Latex,
            FormatName::Csv => TableFormat::Csv,
            FormatName::Text => TableFormat::Text { bold: std::io::stdout().is_terminal(), columns: columns() },
        };
        let grouping = match self.by {
            None => Grouping::Dataset,
            Some(GroupName::Scene) => Grouping::Scene,
            Some(GroupName::Category) => Grouping::Category,
            Some(GroupName::SuperCategory) => Grouping::SuperCategory,
        };
        let ceiling = self.ceiling.as_deref().map(ResultFile::read).transpose()?;
        print(&tables(&results, ceiling.as_ref(), &self.protocol, grouping, format)?)?;
        for result in results.iter().chain(&ceiling) {
            for missing in &result.missing {
                say(&format!(
                    "warning: '{}': {} is missing: {}; run: {}",
                    result.method, missing.metric, missing.reason, missing.fix
                ));
            }
        }
        Ok(Outcome::Good)
    }
}

#[derive(clap::Args)]
pub struct ExplainArgs {
    /// The RESULT.json file.
    #[arg(value_name = "RESULT.json")]
    result: PathBuf,
    /// The scene to explain.
    #[arg(long)]
    scene: SceneId,
    /// Folder of the dataset that the result was scored on.
    #[arg(long)]
    dataset: PathBuf,
    /// The submission that was scored: a folder, a .zip or a .tar.gz archive.
    #[arg(long)]
    submission: PathBuf,
    /// Protocol whose scores are explained.
    #[arg(long, default_value = Protocol::DEFAULT)]
    protocol: String,
    /// Folder for explain.md and pictures of the ten worst instances.
    #[arg(long)]
    out: Option<PathBuf>,
    /// How to print the explanation.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// Replace files that already exist.
    #[arg(long)]
    force: bool,
}

impl ExplainArgs {
    pub fn run(&self) -> anyhow::Result<Outcome> {
        self.out.iter().try_for_each(|out| explain::check_out(out, self.force))?;
        let result = ResultFile::read(&self.result)?;
        let dataset = Dataset::open(&self.dataset).context("cannot open the dataset")?;
        let submission = open_submission(&self.submission)?;
        let plan = ExplainPlan {
            result: &result,
            protocol: &self.protocol,
            dataset: &dataset,
            submission: submission.root(),
            scene: &self.scene,
            tool: TOOL.to_owned(),
        };
        let found = with_progress(|progress| explain::explain(&plan, progress)).context("cannot explain")?;
        if let Some(out) = &self.out {
            for path in found.write(out, self.force)? {
                say(&format!("wrote '{}'", path.display()));
            }
        }
        print(&match self.format {
            Format::Json => json::to_text(&found.file),
            Format::Text => explain::text::plain(&found.file, columns()),
        })?;
        Ok(Outcome::Good)
    }
}

/// Pictures to draw, and how exactly.
#[derive(clap::Args)]
pub struct StripArgs {
    /// What the pictures show; may be given several times [default: albedo; in a leaderboard also rgb_true, if the
    /// dataset has renders].
    #[arg(long = "picture", value_name = "PICTURE", value_enum)]
    shown: Vec<StripPicture>,
    /// Samples per pixel of lit pictures; each of the two halves of a picture has half of them.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(2..=65536))]
    samples: u32,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum StripPicture {
    Albedo,
    RgbTrue,
    RgbFitted,
}

impl clap::ValueEnum for StripPicture {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Albedo, Self::RgbTrue, Self::RgbFitted]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (kind, help) = match self {
            Self::Albedo => (PictureKind::Albedo, "base_color"),
            Self::RgbTrue => (PictureKind::RgbTrue, "RGB under the scene's own lights"),
            Self::RgbFitted => (PictureKind::RgbFitted, "RGB under lights fitted to the input view"),
        };
        Some(PossibleValue::new(kind.word()).help(help))
    }
}

impl StripArgs {
    /// The pictures as the library draws them; albedo by default.
    pub fn shown(&self) -> Vec<Shown> {
        self.shown_or(&[StripPicture::Albedo])
    }

    /// As [`Self::shown`], but by default also of the light of a dataset that has renders to compare with.
    pub fn shown_in_leaderboard(&self, dataset: &Dataset) -> Vec<Shown> {
        match dataset.file.photo_renderer {
            Some(_) => self.shown_or(&[StripPicture::Albedo, StripPicture::RgbTrue]),
            None => self.shown(),
        }
    }

    fn shown_or(&self, default: &[StripPicture]) -> Vec<Shown> {
        let light = |track| Shown::Light { track, samples: self.samples / 2 };
        let shown = |picture: &StripPicture| match picture {
            StripPicture::Albedo => Shown::Albedo,
            StripPicture::RgbTrue => light(Track::True),
            StripPicture::RgbFitted => light(Track::Fitted),
        };
        let chosen = if self.shown.is_empty() { default } else { &self.shown };
        chosen.iter().map(shown).collect()
    }
}

#[derive(clap::Args)]
pub struct PicturesArgs {
    /// Submissions: folders, .zip or .tar.gz archives. Each has a column after the truth's.
    #[arg(required = true, value_name = "SUBMISSION")]
    submissions: Vec<PathBuf>,
    /// Folder of the dataset.
    #[arg(long)]
    dataset: PathBuf,
    /// Folder for the pictures.
    #[arg(long)]
    out: PathBuf,
    /// Draw this scene only; may be given several times.
    #[arg(long = "scene", value_name = "SCENE")]
    scenes: Vec<SceneId>,
    #[command(flatten)]
    strips: StripArgs,
    /// Replace pictures that already exist.
    #[arg(long)]
    force: bool,
}

impl PicturesArgs {
    /// Writes the pictures and prints their paths.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        check_outside_datasets(&self.out.join("pictures"), "--out")?;
        let dataset = Dataset::open(&self.dataset).context("cannot open the dataset")?;
        let opened = self.submissions.iter().map(|path| open_submission(path)).collect::<Result<Vec<_>, _>>()?;
        let submissions: Vec<&Path> = opened.iter().map(Opened::root).collect();
        let plan = StripPlan {
            dataset: &dataset,
            submissions: &submissions,
            scenes: &self.scenes,
            shown: &self.strips.shown(),
            out: &self.out,
            force: self.force,
        };
        let written = with_progress(|progress| strips::write(&plan, progress))?;
        written.iter().try_for_each(|path| print(&format!("{}\n", path.display())))?;
        Ok(Outcome::Good)
    }
}

#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("pictured").args(["dataset", "pictures"]).multiple(true))]
pub struct LeaderboardArgs {
    /// RESULT.json files. One is marked as verified if RESULT.verified.json lies beside it and a key that `--trust`
    /// names has signed it; all others are shown as claimed.
    #[arg(required_unless_present = "from", value_name = "RESULT.json")]
    results: Vec<PathBuf>,
    /// Folder of results, as collected by pull requests: every .json file in it and in the folders below it. In the
    /// folder itself, ceiling.json is taken for `--ceiling`, errata.json for `--errata` and about.md for `--about`.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["results", "ceiling", "errata", "about"])]
    from: Option<PathBuf>,
    /// RESULT.json of the truth itself (`mateval baseline gt`), shown below the methods as the ceiling of each column.
    #[arg(long, value_name = "RESULT.json")]
    ceiling: Option<PathBuf>,
    /// A public key, as `mateval key new` writes it, whose verifications count; may be given several times.
    #[arg(long, value_name = "KEY.pub")]
    trust: Vec<PathBuf>,
    /// Folder of the site; its index.html opens from the disk.
    #[arg(long)]
    out: PathBuf,
    /// Protocol whose scores are ranked.
    #[arg(long, default_value = Protocol::DEFAULT)]
    protocol: String,
    /// Accept results that lack scenes, and rank each on the scenes that it covers; they are marked.
    #[arg(long)]
    partial: bool,
    /// Folder of the dataset, to draw pictures of each `--submission`.
    #[arg(long, requires = "submissions")]
    dataset: Option<PathBuf>,
    /// A submission to show beside the truth: a folder, a .zip or a .tar.gz archive; may be given several times.
    #[arg(long = "submission", value_name = "SUBMISSION", requires = "dataset")]
    submissions: Vec<PathBuf>,
    #[command(flatten)]
    strips: StripArgs,
    /// Folder of further pictures to show: `<method>/<scene>/<view>/<kind>.png`, with `_truth` as the method of the
    /// truth's pictures.
    #[arg(long)]
    pictures: Option<PathBuf>,
    /// Show pictures of a hidden split, drawn from --dataset or given by --pictures: everybody can then see its ground
    /// truth.
    #[arg(long, requires = "pictured")]
    with_ground_truth: bool,
    /// Results of the methods on the original rooms, if the board's own rooms are redressed: a RESULT.json, or a folder
    /// of results as `--from` takes it; may be given several times. Adds contamination.html, which shows how far each
    /// method falls from rooms whose textures are public.
    #[arg(long, value_name = "DIR|RESULT.json")]
    original: Vec<PathBuf>,
    /// Add votes.html, on which people choose between pairs of pictures beside the truth; needs pictures of two methods.
    /// `mateval eval votes` counts the files that it saves.
    #[arg(long)]
    votes: bool,
    /// JSON file of errors that were found after publication.
    #[arg(long)]
    errata: Option<PathBuf>,
    /// Markdown file for the page "About": contact, licence of the dataset, the paper, the date of the board, how to
    /// submit.
    #[arg(long, value_name = "FILE.md")]
    about: Option<PathBuf>,
    /// The board's dataset on the Hugging Face Hub, as in `NAME/dataset`. Adds README.md, which makes the site a static
    /// Space, and in downloads/eval_results a file for the folder .eval_results of each method's model.
    #[arg(long, value_name = "NAME/DATASET", requires = "url", value_parser = hub_name)]
    hub_dataset: Option<String>,
    /// For --hub-dataset: the address where the site will be published.
    #[arg(long, requires = "hub_dataset", value_parser = web_address)]
    url: Option<String>,
    /// Replace a leaderboard that already exists.
    #[arg(long)]
    force: bool,
}

/// The name of a repository on the Hub.
fn hub_name(text: &str) -> anyhow::Result<String> {
    let is_name = |part: &str| {
        part.starts_with(|c: char| c.is_ascii_alphanumeric())
            && part.chars().all(|c| c.is_ascii_alphanumeric() || ['-', '_', '.'].contains(&c))
    };
    match text.split('/').collect::<Vec<_>>()[..] {
        [owner, name] if is_name(owner) && is_name(name) => Ok(text.to_owned()),
        _ => bail!("expected OWNER/NAME of a repository"),
    }
}

fn web_address(text: &str) -> anyhow::Result<String> {
    match text.starts_with("https://") || text.starts_with("http://") {
        true => Ok(text.to_owned()),
        false => bail!("expected an address that begins with https:// or http://"),
    }
}

impl LeaderboardArgs {
    /// Writes the site and prints the path of its first page.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        check_outside_datasets(&self.out, "--out")?;
        let files = match &self.from {
            Some(folder) => ResultsFolder::list(folder)?,
            None => ResultsFolder {
                results: self.results.clone(),
                ceiling: self.ceiling.clone(),
                errata: self.errata.clone(),
                about: self.about.clone(),
                skipped: Vec::new(),
            },
        };
        for path in &files.skipped {
            say(&format!("note: skipped '{}', whose name is that of a hidden or left-over file", path.display()));
        }
        let entries = entries::read(&files, &TrustedKeys::read(&self.trust)?)?;
        for (path, mark) in files.results.iter().zip(&entries.verified) {
            let sidecar = marks::sidecar(path);
            let why = match mark {
                Verified::Stale => "verifies an earlier version of the result; run `eval verify` again",
                Verified::Claimed if sidecar.exists() => {
                    "has no signature of a key that --trust names, and does not count; the result is shown as claimed"
                }
                Verified::Claimed | Verified::Confirmed | Verified::Refuted => continue,
            };
            say(&format!("warning: '{}' {why}", sidecar.display()));
        }
        let dataset = self.dataset.as_deref().map(Dataset::open).transpose().context("cannot open the dataset")?;
        dataset.iter().try_for_each(|dataset| dataset.check_may_be_shown(self.with_ground_truth))?;
        let opened = self.submissions.iter().map(|path| open_submission(path)).collect::<Result<Vec<_>, _>>()?;
        if let Some(pictures) = &self.pictures {
            if !pictures.is_dir() {
                bail!("'{}' is not a folder; expected a folder of pictures", pictures.display());
            }
            if !self.with_ground_truth {
                leaderboard::check_may_be_shown(pictures, &entries.results)?;
            }
        }
        let original = match self.original.is_empty() {
            true => None,
            false => Some(entries::read_original(&self.original).context("cannot read --original")?),
        };
        let plan = LeaderboardPlan {
            results: &entries.results,
            ceiling: entries.ceiling.as_ref(),
            verified: entries.verified.clone(),
            protocol: &self.protocol,
            partial: self.partial,
            errata: entries.errata.as_ref(),
            about: entries.about.as_deref(),
            pictures: self.pictures.as_deref(),
            submissions: dataset.as_ref().map(|dataset| Submissions {
                dataset,
                folders: opened.iter().map(|submission| submission.root().to_owned()).collect(),
                shown: self.strips.shown_in_leaderboard(dataset),
            }),
            votes: self.votes,
            original: original.as_deref(),
            hub: self.hub_dataset.clone().zip(self.url.clone()).map(|(dataset, url)| Hub { dataset, url }),
            tool: TOOL.to_owned(),
        };
        with_progress(|progress| leaderboard::write(&plan, &self.out, self.force, progress))
            .context("cannot write the leaderboard")?;
        if entries.about.is_none() {
            say("note: the page 'About' states no contact, licence, paper or date; give them in about.md (--about)");
        }
        print(&format!("{}\n", self.out.join("index.html").display()))?;
        Ok(Outcome::Good)
    }
}

#[derive(clap::Args)]
pub struct VotesArgs {
    /// Files that votes.html of a leaderboard has saved.
    #[arg(required = true, value_name = "VOTES.json")]
    votes: Vec<PathBuf>,
    /// RESULT.json files of the leaderboard that was voted on, all of them.
    #[arg(long = "result", required = true, num_args = 1.., value_name = "RESULT.json")]
    results: Vec<PathBuf>,
    /// The leaderboard was made with --partial.
    #[arg(long)]
    partial: bool,
    /// How to print the strengths and correlations.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

impl VotesArgs {
    /// Prints the strengths of methods, and how well each headline number predicts them.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let results = self.results.iter().map(|path| ResultFile::read(path)).collect::<Result<Vec<_>, _>>()?;
        let found = preferences(&self.votes, &results, self.partial, TOOL)?;
        print(&match self.format {
            Format::Json => json::to_text(&found),
            Format::Text => plain(&found, columns()),
        })?;
        Ok(Outcome::Good)
    }
}
