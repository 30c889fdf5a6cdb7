//! The commands that pass a dataset on: `mateval prep publish` and `export`.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use mateval_dataset::dataset::SceneFile;
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::open::{Dataset, check_outside_datasets};
use mateval_dataset::{Finding, SceneId, Severity, ViewId};
use mateval_eval::metric::{Better, PictureKind};
use mateval_eval::protocol::Protocol;
use mateval_eval::result::ResultFile;
use mateval_eval::result::key::ResultKey;
use mateval_export::codabench::{self, Column, Competition};
use mateval_export::mitsuba::export_view;
use mateval_export::{ExportOptions, Exported, Format, croissant, export};
use mateval_files::work_folder::{check_free, is_inside};
use mateval_prep::recipe::{self, RECIPE};
use mateval_report::publish::{Published, publish};
use mateval_report::release::file::Day;
use mateval_report::release::{CheckedRelease, Publication, ReleaseFile, ReleaseOptions};
use mateval_report::rounded::check_floor;

use crate::TOOL;
use crate::prep::make::samples_parser;
use crate::terminal::{Outcome, counted, print, say, with_progress};

#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("what").args(["withhold", "report"]).required(true).multiple(true))]
pub struct PublishArgs {
    /// Folder of the dataset, with its ground truth.
    dataset: PathBuf,
    /// The part that the public folder leaves out; without it the dataset is not split.
    #[arg(long, value_enum, requires_all = ["public", "private"])]
    withhold: Option<Withheld>,
    /// Folder for the public files: the dataset without the withheld part.
    #[arg(long, requires = "withhold")]
    public: Option<PathBuf>,
    /// Folder for the withheld files. Copied over the public folder they give the whole dataset.
    #[arg(long, requires = "withhold")]
    private: Option<PathBuf>,
    /// Withhold the truth of scenes that can be made again from public files, too: the dataset, its page and boards then
    /// say "truth withheld, not secret".
    #[arg(long, requires = "withhold")]
    open_book: bool,
    /// For a report without --withhold: describe a hidden split with its ground truth, which is refused otherwise.
    #[arg(long, requires = "report", conflicts_with = "withhold")]
    with_ground_truth: bool,
    #[command(flatten)]
    report: ReportArgs,
    /// Replace folders that already exist.
    #[arg(long)]
    force: bool,
}

/// The report of a release.
#[derive(clap::Args)]
struct ReportArgs {
    /// Folder for a page that describes the release. With --withhold it shows no measurement of single scenes' ground
    /// truth.
    #[arg(long, value_name = "FOLDER")]
    report: Option<PathBuf>,
    /// Verdicts for the report: a file of `prep compare`, or a folder with such files in it or directly below it; may
    /// be given several times.
    #[arg(long, value_name = "PATH", requires = "report")]
    verdicts: Vec<PathBuf>,
    /// For the report: the result of the truth itself, `baseline gt`.
    #[arg(long, value_name = "RESULT.json", requires = "report")]
    ceiling: Option<PathBuf>,
    /// For the report: the result of a constant estimate, `baseline grey`.
    #[arg(long, value_name = "RESULT.json", requires = "report")]
    floor: Option<PathBuf>,
    /// For the report: the protocol whose scores are shown.
    #[arg(long, default_value = Protocol::DEFAULT, requires = "report")]
    protocol: String,
    /// For the report: the day of publication, as in 2026-11-24.
    #[arg(long, requires = "report")]
    date: Option<Day>,
    /// For the report: the address of the dataset.
    #[arg(long, requires = "report")]
    url: Option<String>,
    /// For the report: the authors, as in "A. Author and B. Author".
    #[arg(long, requires = "report")]
    authors: Option<String>,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Withheld {
    /// All files in `scenes/<scene>/ground_truth`.
    #[value(name = "ground_truth")]
    GroundTruth,
}

impl PublishArgs {
    /// Checks what is given for the report, then splits the dataset and prints the commitment, a hash of the withheld
    /// files, then writes the report.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let options = release_options(self);
        let halves = halves(self)?;
        if let Some(options) = &options {
            check_report(options, &halves)?;
        }
        if halves.is_none() {
            Dataset::open(&self.dataset)
                .and_then(|dataset| dataset.check_may_be_shown(self.with_ground_truth))
                .context("cannot report on the release")?;
        }
        let release = options.as_ref().map(CheckedRelease::new).transpose().context("cannot report on the release")?;
        let published = halves.map(|[public, private]| split(self, public, private)).transpose()?;
        let Some(release) = release else { return Ok(Outcome::Good) };
        let file = with_progress(|progress| release.write(TOOL, published.as_ref(), progress))
            .context("cannot report on the release")?;
        print(&summary(self, &file))?;
        Ok(if file.is_good() { Outcome::Good } else { Outcome::No })
    }
}

fn release_options(args: &PublishArgs) -> Option<ReleaseOptions> {
    let of = &args.report;
    Some(ReleaseOptions {
        dataset: args.dataset.clone(),
        out: of.report.clone()?,
        force: args.force,
        verdicts: of.verdicts.clone(),
        ceiling: of.ceiling.clone(),
        floor: of.floor.clone(),
        protocol: of.protocol.clone(),
        publication: Publication { date: of.date.clone(), url: of.url.clone(), authors: of.authors.clone() },
    })
}

/// The public and the private folder, if the dataset is to be split.
fn halves(args: &PublishArgs) -> anyhow::Result<Option<[&PathBuf; 2]>> {
    let (Some(public), Some(private)) = (&args.public, &args.private) else { return Ok(None) };
    if public == private {
        bail!("--public and --private are the same folder; the ground truth would not be withheld");
    }
    if lies_in(public, private) || lies_in(private, public) {
        bail!("--public and --private would lie in each other; choose two separate folders");
    }
    for (place, flag) in [(public, "--public"), (private, "--private")] {
        check_outside_datasets(place, flag)?;
        if place.exists() && !args.force {
            bail!("'{}' already exists; choose another folder, or add --force to overwrite it", place.display());
        }
    }
    Ok(Some([public, private]))
}

/// Whether `inner` would lie in `outer`; neither need exist.
fn lies_in(inner: &Path, outer: &Path) -> bool {
    let [inner, outer] = [inner, outer].map(|path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned()));
    inner.starts_with(&outer) || is_inside(&inner, &outer)
}

/// Fails where the report would lie in a folder of the split, which holds nothing but files of the dataset, or the
/// other way round, where replacing the report would delete it.
fn check_report(options: &ReleaseOptions, halves: &Option<[&PathBuf; 2]>) -> anyhow::Result<()> {
    let out = options.out.as_path();
    for half in halves.iter().flatten() {
        if lies_in(out, half) || lies_in(half, out) {
            bail!("'{}' and '{}' would lie in each other; choose another --report", out.display(), half.display());
        }
    }
    Ok(())
}

fn split(args: &PublishArgs, public: &Path, private: &Path) -> anyhow::Result<Published> {
    let found = with_progress(|progress| publish(&args.dataset, public, private, args.open_book, progress))
        .context("cannot publish the dataset")?;
    print(&format!(
        "{}: {}, {}\n{}: {}\ncommitment {}\n",
        public.display(),
        counted(found.public_files, "file"),
        found.secrecy.text(),
        private.display(),
        counted(found.private_files, "file"),
        found.commitment
    ))?;
    Ok(found)
}

/// One line: where the report lies, and what it states.
fn summary(args: &PublishArgs, file: &ReleaseFile) -> String {
    let place = args.report.report.as_ref().map(|out| out.join("index.html")).unwrap_or_default();
    let verdict = if file.verification.sound { "sound" } else { "NOT sound" };
    let (all, given) = (file.scenes.len(), file.comparisons().count());
    let agree = file.comparisons().filter(|verdict| verdict.agrees).count();
    let compared = match given {
        0 => "no scene compared".to_owned(),
        _ => format!("renderers agree on {agree} of {given} compared scenes"),
    };
    format!("{}: {}, {verdict}; {compared}\n", place.display(), counted(all, "scene"))
}

#[derive(clap::Args)]
pub struct ExportArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// The format to write.
    #[arg(long = "as", value_enum, value_name = "FORMAT")]
    format: FormatName,
    /// Folder to write.
    #[arg(long)]
    out: PathBuf,
    /// For croissant: the address of the folder where the files will be published; without it their places are
    /// relative. For codabench: where participants download the dataset.
    #[arg(long)]
    url: Option<String>,
    /// For croissant: the day of publication, as in 2026-11-24. For codabench: the day on which the board opens
    /// [default: at once].
    #[arg(long)]
    date: Option<String>,
    /// For croissant: how to cite the dataset [default: its name, version and hash].
    #[arg(long)]
    citation: Option<String>,
    /// For mitsuba: the scene to write.
    #[arg(long, required_if_eq("format", "mitsuba"))]
    scene: Option<SceneId>,
    /// For mitsuba: the view to write.
    #[arg(long, requires = "scene", default_value = "input")]
    view: ViewId,
    /// For mitsuba: samples per pixel [default: the recipe's].
    #[arg(long, requires = "scene", value_parser = samples_parser())]
    samples: Option<u32>,
    #[command(flatten)]
    competition: CompetitionArgs,
    /// Pass on the ground truth of a hidden split, too, which is refused otherwise.
    #[arg(long)]
    with_ground_truth: bool,
    /// For mitsuba: replace a folder that already exists.
    #[arg(long, requires = "scene")]
    force: bool,
}

/// A competition on Codabench.
#[derive(clap::Args)]
struct CompetitionArgs {
    /// For codabench: the image in which submissions are scored, its name and tag on Docker Hub.
    #[arg(long, required_if_eq("format", "codabench"))]
    image: Option<String>,
    /// For codabench: the private folder of the split whose public folder the dataset is.
    #[arg(long, requires = "image")]
    private: Option<PathBuf>,
    /// For codabench: the result of a baseline that anybody can make from the public files, such as `nn` on `delight`.
    /// Of a hidden split participants see only numbers that are better; may be given several times.
    #[arg(long = "floor", value_name = "RESULT.json", requires = "image")]
    floors: Vec<PathBuf>,
    /// For codabench: how long a scene takes to score, in seconds, so that the scenes are cut into tasks that keep to
    /// --limit [default: one task].
    #[arg(long, requires = "image", value_parser = clap::value_parser!(u32).range(1..))]
    seconds_a_scene: Option<u32>,
    /// For codabench: the most seconds that a task may take [default: 600, the most of the shared queue].
    #[arg(long, requires = "image", value_parser = clap::value_parser!(u32).range(1..))]
    limit: Option<u32>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum FormatName {
    /// One tar for each scene and base.tar for the rest, so that scenes can be downloaded one by one.
    Tar,
    /// The same tars, described by a Croissant file.
    Croissant,
    /// A Parquet file with a row for each view, and a dataset card for the Hugging Face Hub.
    Huggingface,
    /// For each scene a folder with transforms.json.
    Nerfstudio,
    /// For each scene a folder with COLMAP's text model.
    Colmap,
    /// A view with its ground truth as a scene for Mitsuba 3. Exit code 1: Mitsuba cannot express all of it.
    Mitsuba,
    /// A competition for Codabench, with the truth: a folder to be packed as a .zip.
    Codabench,
}

impl ExportArgs {
    /// Exports the dataset and prints what was written.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let format = match (self.format, &self.scene) {
            (FormatName::Codabench, None) => return self.run_codabench(),
            (FormatName::Mitsuba, Some(scene)) => return self.run_mitsuba(scene),
            (FormatName::Mitsuba, None) => bail!("--as mitsuba writes one scene; give --scene SCENE"),
            (_, Some(_)) => bail!("--scene is for --as mitsuba; the other formats hold the whole dataset"),
            (FormatName::Tar, None) => Format::Tar,
            (FormatName::Croissant, None) => Format::Croissant,
            (FormatName::Huggingface, None) => Format::Huggingface,
            (FormatName::Nerfstudio, None) => Format::Nerfstudio,
            (FormatName::Colmap, None) => Format::Colmap,
        };
        let dataset = Dataset::open(&self.dataset).context("cannot export the dataset")?;
        dataset.check_may_be_shown(self.with_ground_truth).context("cannot export the dataset")?;
        warn_without_licence(&dataset);
        let options = ExportOptions {
            dataset: self.dataset.clone(),
            format,
            out: self.out.clone(),
            publication: croissant::Publication {
                url: self.url.clone(),
                date: self.date.clone(),
                citation: self.citation.clone(),
            },
        };
        let Exported { scenes, views, without_picture } =
            with_progress(|progress| export(&options, progress)).context("cannot export the dataset")?;
        let mut line = format!("{}: {}", self.out.display(), counted(scenes, "scene"));
        if let Some(views) = views {
            line.push_str(&format!(", {}", counted(views, "view")));
        }
        if without_picture > 0 {
            line.push_str(&format!(
                "; {} without a picture, because theirs is withheld or was not rendered",
                counted(without_picture, "view")
            ));
        }
        print(&format!("{line}\n"))?;
        Ok(Outcome::Good)
    }

    /// Writes a competition and states what holds its truth.
    fn run_codabench(&self) -> anyhow::Result<Outcome> {
        let dataset = Dataset::open(&self.dataset)?;
        dataset.check_may_be_shown(self.with_ground_truth)?;
        warn_without_licence(&dataset);
        let is_without_truth = |scene: &SceneFile| !dataset.folder(&scene.id).truth().is_dir();
        if self.competition.private.is_none() && dataset.scenes.iter().any(is_without_truth) {
            bail!("'{}' has no ground truth, which scores need; give --private FOLDER", self.dataset.display());
        }
        if dataset.is_hidden() && self.competition.floors.is_empty() {
            bail!(
                "the rounded numbers of a hidden split begin at those of a public baseline; give its result by --floor \
                 RESULT.json"
            );
        }
        for path in &self.competition.floors {
            check_floor(&ResultFile::read(path)?, &dataset, &dataset.file.scenes)?;
        }
        let protocol = protocol_of(&dataset.scenes)?;
        let truth = self.competition.private.as_ref().unwrap_or(&self.dataset);
        let has_measured = dataset.scenes.iter().any(|scene| SceneFolder::of(truth, &scene.id).has_measured());
        let has_values = |key: &&ResultKey| key.picture.kind != PictureKind::Measured || has_measured;
        let column = |key: &ResultKey| {
            let style = &key.metric.row().style;
            Column {
                key: key.to_string(),
                higher_is_better: key.metric.better() == Better::Higher,
                digits: style.digits,
            }
        };
        let competition = Competition {
            dataset: self.dataset.clone(),
            private: self.competition.private.clone(),
            floors: self.competition.floors.clone(),
            out: self.out.clone(),
            image: self.competition.image.clone().unwrap_or_default(),
            columns: protocol.headline.iter().filter(has_values).map(column).collect(),
            protocol: protocol.name,
            seconds_a_scene: self.competition.seconds_a_scene,
            limit: self.competition.limit.unwrap_or(600),
            url: self.url.clone(),
            date: self.date.clone(),
        };
        let (scenes, tasks) = with_progress(|progress| codabench::export(&competition, progress))
            .context("cannot write the competition")?;
        print(&format!(
            "{}: {}, {}; it holds the truth: upload it, and publish it nowhere\n",
            self.out.display(),
            counted(scenes, "scene"),
            counted(tasks, "task")
        ))?;
        Ok(Outcome::Good)
    }

    /// Exports a view and reports what Mitsuba cannot express.
    fn run_mitsuba(&self, scene: &SceneId) -> anyhow::Result<Outcome> {
        let findings = self.export_view(scene).context("cannot export to Mitsuba")?;
        for finding in &findings {
            say(&format!("{scene}: {finding}"));
        }
        let differences = findings.iter().filter(|finding| finding.severity != Severity::Note).count();
        let verdict = if differences == 0 { "means the same" } else { "does NOT mean the same" };
        let file = self.out.join("scene.xml");
        print(&format!("{}: {verdict} in Mitsuba, {}\n", file.display(), counted(differences, "difference")))?;
        Ok(if differences == 0 { Outcome::Good } else { Outcome::No })
    }

    fn export_view(&self, scene: &SceneId) -> anyhow::Result<Vec<Finding>> {
        check_free(&self.out, self.force, "folder")?;
        check_outside_datasets(&self.out, "--out")?;
        let dataset = Dataset::open(&self.dataset)?;
        dataset.check_may_be_shown(self.with_ground_truth)?;
        warn_without_licence(&dataset);
        let samples = match self.samples {
            Some(samples) => samples,
            None => recipe::read(&self.dataset.join(RECIPE))?.0.samples,
        };
        Ok(export_view(&dataset, scene, &self.view, samples, &self.out)?)
    }
}

/// The protocol that has values for all of the scenes: a competition has one table.
fn protocol_of(scenes: &[SceneFile]) -> anyhow::Result<Protocol> {
    for name in [Protocol::DEFAULT, Protocol::CAPTURE] {
        let protocol = Protocol::named(name)?;
        if scenes.iter().all(|scene| protocol.scores(scene)) {
            return Ok(protocol);
        }
    }
    bail!(
        "the dataset holds captured and rendered scenes, which no protocol scores together; build a dataset and a \
         competition of each"
    )
}

/// Whoever gets the dataset cannot know what it may be used for.
fn warn_without_licence(dataset: &Dataset) {
    if let Some(unstated) = dataset.unstated_licences() {
        say(&format!("warning: {unstated}; state it in the recipe, by `licences`, and run `mateval prep build` again"));
    }
}
