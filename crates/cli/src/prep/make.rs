//! The commands that make a dataset: `mateval prep survey`, `build`, `render`, `finish` and `perturb`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context as _, bail};
use clap::builder::TypedValueParser;
use mateval_dataset::dataset::PerturbationKind;
use mateval_dataset::open::check_outside_datasets;
use mateval_dataset::{Finding, SceneId, Severity};
use mateval_eval::light::reference::{RELEASE_SAMPLES, ReferenceOptions, make_references};
use mateval_files::work_folder::check_free;
use mateval_prep::build::BuildOptions;
use mateval_prep::build::finish::finish_again;
use mateval_prep::build::upgrade::bring_up_to_date;
use mateval_prep::perturb::{PerturbOptions, PerturbedScene, perturb};
use mateval_prep::recipe::{MOST_SAMPLES, Redress};
use mateval_prep::render::{BlenderOptions, BlenderProgram, DeviceChoice, RenderOptions, Renderer, RendererKind};
use mateval_prep::stats::findings::by_code;
use mateval_prep::survey::rules::SelectionRules;
use mateval_prep::survey::selection::SelectionGoal;
use mateval_prep::survey::{Selection, SurveyFile, SurveyOptions, TargetedMean, survey};
use mateval_sources::front3d::camera_rules::CameraRules;

use crate::TOOL;
use crate::arguments::word_parser;
use crate::fetch::{FETCH_BLENDER, cache_folder, check_blender};
use crate::terminal::{Outcome, counted, print, say, say_findings, with_progress};

#[derive(clap::Args)]
pub struct SurveyArgs {
    /// 3D-FRONT houses (JSON files) or folders of houses, relative to --source.
    #[arg(required = true)]
    houses: Vec<PathBuf>,
    /// Folder that all paths are relative to, as in a recipe [default: the current folder; where a path is absolute,
    /// the lowest folder that contains all paths].
    #[arg(long)]
    source: Option<PathBuf>,
    /// Folder of the 3D-FUTURE models, relative to --source.
    #[arg(long)]
    models: PathBuf,
    /// Folder of the 3D-FRONT textures, relative to --source. Without it the architecture has plain colours.
    #[arg(long)]
    textures: Option<PathBuf>,
    /// File of designers' cameras that comes with the houses, relative to --source.
    #[arg(long)]
    cameras: Option<PathBuf>,
    /// TOML file with the conditions that a room must meet.
    #[arg(long)]
    rules: Option<PathBuf>,
    /// The rules that drawn cameras keep. They also decide on resolution and field of view where none is given.
    #[arg(
        long,
        default_value = CameraRules::default().word(),
        value_parser = word_parser(CameraRules::ALL, |rules| (rules.word(), rules.summary())),
    )]
    camera_rules: CameraRules,
    /// Choose this many scenes for the recipe, which together are like the paper's: with 13.2 objects of 4.3
    /// super-categories on average, and equally many of each room type. Without it the recipe has every accepted room.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    scenes: Option<u32>,
    /// With --scenes: the most scenes of one house.
    #[arg(long, value_name = "NUMBER", requires = "scenes", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    scenes_per_house: u32,
    /// Redress the recipe's scenes: give all their parts other materials, drawn with this key, a file of at least 32
    /// random bytes. It must lie outside of --source and --out.
    #[arg(long, value_name = "KEY")]
    redress: Option<PathBuf>,
    /// With --redress: a private folder of tileable materials, in the layout of CC0 libraries, to draw from instead of
    /// the built-in procedural ones. It must lie outside of --source and --out.
    #[arg(long, value_name = "FOLDER", requires = "redress")]
    redress_materials: Option<PathBuf>,
    /// Search this house only, and leave the survey of all to a later run without --house; may be given several times.
    /// It is a house's file relative to --source, or the file's name without .json. Several processes may search
    /// different houses of one survey at once.
    #[arg(long = "house", value_name = "HOUSE", conflicts_with = "scenes")]
    only: Vec<String>,
    /// Seed of the drawn cameras.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(..=u64::from(u32::MAX)))]
    seed: u64,
    /// Number of cameras drawn in each room; with the rules 3dlg it is the mean over a house's rooms, and large ones
    /// get more.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=1000))]
    cameras_per_room: u32,
    /// Width and height of the scenes' pictures, in pixels [default: 480 270; 480 360 with the rules 3dlg].
    #[arg(long, num_args = 2, value_names = ["WIDTH", "HEIGHT"], value_parser = clap::value_parser!(u32).range(16..=8192))]
    resolution: Vec<u32>,
    /// Vertical field of view of the drawn cameras, in degrees: above 0, below 179 [default: 45; 73.74 with the rules
    /// 3dlg, which is 90 degrees wide].
    #[arg(long)]
    fov_y_deg: Option<f64>,
    /// Folder for the page, its thumbnails, the recipe and survey.json. A survey that was interrupted there is resumed.
    #[arg(long)]
    out: PathBuf,
    /// Replace a finished survey. Houses that would be searched again in the same way are kept.
    #[arg(long)]
    force: bool,
}

impl SurveyArgs {
    fn checked(&self) -> anyhow::Result<SurveyOptions> {
        let fov_y_deg = self.fov_y_deg.unwrap_or(self.camera_rules.fov_y_deg());
        let is_sound = fov_y_deg > 0.0 && fov_y_deg < 179.0;
        anyhow::ensure!(is_sound, "--fov-y-deg {fov_y_deg}: expected a number above 0 and below 179");
        let rules = self.rules.as_deref().map(SelectionRules::read).transpose().context("cannot read the rules")?;
        Ok(SurveyOptions {
            source: self.source.clone(),
            houses: self.houses.clone(),
            models: self.models.clone(),
            textures: self.textures.clone(),
            cameras: self.cameras.clone(),
            rules: rules.unwrap_or_default(),
            seed: self.seed,
            cameras_per_room: self.cameras_per_room,
            resolution: self.resolution.as_slice().try_into().unwrap_or(self.camera_rules.resolution()),
            fov_y_deg,
            camera_rules: self.camera_rules,
            only: self.only.clone(),
            goal: self.scenes.map(|scenes| SelectionGoal::of_paper(scenes as usize, self.scenes_per_house as usize)),
            redress: self.redress.clone().map(|key| Redress { key, materials: self.redress_materials.clone() }),
            out: self.out.clone(),
            force: self.force,
        })
    }

    /// Surveys the houses; the answer is no where no room qualifies, or fewer than the scenes that are wanted.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let options = self.checked()?;
        check_outside_datasets(&self.out, "--out")?;
        let surveyed =
            with_progress(|progress| survey(&options, TOOL, progress)).context("cannot survey the houses")?;
        if surveyed.kept > 0 {
            say(&format!("{} of {} houses were already searched by an earlier run", surveyed.kept, surveyed.houses));
        }
        match &surveyed.file {
            Some(file) => report(self, file, &surveyed.source),
            None => {
                print(&format!("{}: {} searched\n", self.out.display(), counted(surveyed.houses, "house")))?;
                say("when all houses are done, run the command without --house");
                Ok(Outcome::Good)
            }
        }
    }
}

fn report(args: &SurveyArgs, file: &SurveyFile, source: &Path) -> anyhow::Result<Outcome> {
    for error in file.houses.iter().filter_map(|house| house.error.as_ref()) {
        say(&format!("left out: {error}"));
    }
    if args.source.is_none() && source != Path::new(".") {
        say(&format!("the recipe's paths are relative to '{0}': build with --source '{0}'", source.display()));
    }
    let rooms = || file.houses.iter().flat_map(|house| &house.rooms);
    let offered = rooms().filter(|room| !room.cameras.is_empty()).count();
    let page = args.out.join("index.html");
    print(&format!("{}: {offered} of {} rooms to pick from\n", page.display(), rooms().count()))?;
    let Some(selection) = &file.selection else {
        return Ok(if offered > 0 { Outcome::Good } else { Outcome::No });
    };
    report_selection(&args.out.join("recipe.toml"), selection)
}

/// Reports the choice of scenes; the answer is no where they are too few.
fn report_selection(recipe: &Path, selection: &Selection) -> anyhow::Result<Outcome> {
    let Selection { wanted, candidates, chosen, per_house, objects, super_categories, .. } = selection;
    let shown = |of: &TargetedMean| of.mean.map_or("none".to_owned(), |mean| format!("{mean:.2}"));
    print(&format!(
        "{}: {chosen} of {candidates} rooms chosen, with {} objects of {} super-categories on average (aimed at {} and {})\n",
        recipe.display(),
        shown(objects),
        shown(super_categories),
        objects.target,
        super_categories.target
    ))?;
    if chosen < wanted {
        say(&format!(
            "{wanted} scenes were wanted, and {candidates} rooms at most {per_house} a house give {chosen}; survey more houses, \
             loosen the rules, or raise --scenes-per-house"
        ));
        return Ok(Outcome::No);
    }
    Ok(Outcome::Good)
}

#[derive(clap::Args)]
pub struct BuildArgs {
    /// The recipe, a TOML file.
    recipe: PathBuf,
    /// Folder of the dataset.
    #[arg(long)]
    out: PathBuf,
    /// Folder that the recipe's paths are relative to [default: the recipe's folder].
    #[arg(long)]
    source: Option<PathBuf>,
    /// Make this scene only, and leave the files of the whole dataset to `prep finish`; may be given several times.
    #[arg(long = "scene", value_name = "SCENE")]
    scenes: Vec<SceneId>,
    /// Replace a dataset that already exists; with --scene, only these scenes.
    #[arg(long)]
    force: bool,
    /// The Blender that reads `.blend` files: Blender 4.5, or a Python with that version's `bpy` module [default:
    /// $MATEVAL_BLENDER, else the one that `mateval fetch blender` installed].
    #[arg(long, value_name = "PATH")]
    blender: Option<PathBuf>,
}

impl BuildArgs {
    /// Builds the dataset and reports the findings of each scene.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        check_outside_datasets(&self.out, "--out")?;
        let options = BuildOptions {
            recipe: self.recipe.clone(),
            source: self.source.clone(),
            out: self.out.clone(),
            scenes: self.scenes.clone(),
            force: self.force,
            blender: find_blender(self.blender.as_deref())?,
            atlas_cache: Some(cache_folder().join("atlases")),
        };
        let report = with_progress(|progress| mateval_prep::build::build(&options, TOOL, progress))
            .context("cannot build the dataset")?;
        say_resumed(&report.resumed, report.findings.len());
        say_found(&report.findings);
        print(&format!("{}: {}\n", self.out.display(), counted(report.findings.len(), "scene")))?;
        say_if_apart(&self.scenes, &self.out);
        Ok(Outcome::Good)
    }
}

/// The most lines of one kind that are printed; further ones are counted.
const MOST_LINES: usize = 12;

/// Names the scenes that an earlier run has made, or counts them.
fn say_resumed(scenes: &[SceneId], all: usize) {
    if scenes.len() > MOST_LINES {
        return say(&format!("{} of {all} scenes were already made by an earlier run", scenes.len()));
    }
    for scene in scenes {
        say(&format!("scene '{scene}' was already made by an earlier run"));
    }
}

/// Prints the errors and warnings of all scenes and counts the notes. Where they are many, those of one code are one
/// line.
fn say_found(scenes: &[(SceneId, Vec<Finding>)]) {
    let shown = |finding: &&Finding| finding.severity != Severity::Note;
    let is_short = scenes.len() <= MOST_LINES
        && scenes.iter().flat_map(|(_, findings)| findings).filter(shown).count() <= MOST_LINES;
    if is_short {
        return scenes.iter().for_each(|(scene, findings)| say_findings(scene.as_str(), findings, "scene.json"));
    }
    let found = by_code(scenes.iter().map(|(scene, findings)| (scene, findings.as_slice())));
    let (notes, grave): (Vec<_>, Vec<_>) = found.into_iter().partition(|found| found.severity == Severity::Note);
    grave.iter().for_each(|found| say(&found.to_string()));
    if !notes.is_empty() {
        let count = notes.iter().map(|found| found.findings).sum();
        say(&format!("{} of {}", counted(count, "note"), counted(notes.len(), "code")));
    }
    if !(grave.is_empty() && notes.is_empty()) {
        say("each scene.json lists its own; `mateval prep stats DATASET --findings` sums up by scene");
    }
}

/// Arguments that concern Blender alone.
#[derive(clap::Args, Clone, Debug)]
pub struct BlenderArgs {
    /// Blender 4.5, or a Python with that version's `bpy` module [default: $MATEVAL_BLENDER, else the one that
    /// `mateval fetch blender` installed].
    #[arg(long, value_name = "PATH")]
    blender: Option<PathBuf>,
    /// The device that Blender renders on. All views of a scene come from one kind of device.
    #[arg(long, value_parser = device_parser(), default_value = "cpu")]
    device: DeviceChoice,
    /// Number of scenes that Blender renders at once, each on a graphics card of its own where there are several.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=64))]
    jobs: u16,
    /// Longest time that a Blender may take for a scene, in seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 7200, value_parser = clap::value_parser!(u32).range(1..))]
    time_limit: u32,
    /// Most memory that each Blender may take, in GiB.
    #[arg(long, value_name = "GIB", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=4096))]
    memory_limit: u32,
    /// How often Blender is run for a scene before the scene counts as failed.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=10))]
    attempts: u32,
}

/// The Blender at this path, or else the usual one; absent if no path is given and none is installed.
fn find_blender(path: Option<&Path>) -> anyhow::Result<Option<BlenderOptions>> {
    match find_program(path) {
        Ok(program) => Ok(Some(BlenderOptions::new(BlenderProgram(program)))),
        Err(error) if named_program(path).is_some() => Err(error),
        Err(_) => Ok(None),
    }
}

/// The program that the user names, and where; `option` is that of `--blender`.
fn named_program(option: Option<&Path>) -> Option<(PathBuf, &'static str)> {
    let from_environment = std::env::var_os("MATEVAL_BLENDER").filter(|value| !value.is_empty());
    let from_option = option.map(|path| (path.to_owned(), "--blender"));
    from_option.or_else(|| from_environment.map(|path| (path.into(), "MATEVAL_BLENDER")))
}

/// The program that the user names, or else the one that was fetched; fails if it does not exist.
fn find_program(option: Option<&Path>) -> anyhow::Result<PathBuf> {
    let Some((program, origin)) = named_program(option) else {
        let installed = cache_folder().join("blender/bin/python");
        if installed.exists() {
            return Ok(installed);
        }
        bail!(
            "no Blender found: neither --blender nor MATEVAL_BLENDER is given, and '{}' does not exist; run: \
             {FETCH_BLENDER}, or give --renderer builtin",
            installed.display()
        );
    };
    // A name without a folder is searched for in PATH when it is run.
    if program.components().count() > 1 && !program.is_file() {
        let shown = program.display();
        bail!("{origin} is '{shown}', which does not exist; expected Blender, or a Python with bpy");
    }
    Ok(program)
}

impl BlenderArgs {
    /// How Blender is run; fails where it cannot be found.
    pub fn options(&self) -> anyhow::Result<BlenderOptions> {
        let mut options = BlenderOptions::new(BlenderProgram(find_program(self.blender.as_deref())?));
        options.device = self.device;
        options.jobs = usize::from(self.jobs);
        options.attempts = self.attempts;
        options.limits.time = Duration::from_secs(u64::from(self.time_limit));
        options.limits.memory_bytes = u64::from(self.memory_limit) << 30;
        Ok(options)
    }

    /// Whether the user names a program, which must then be usable.
    pub fn is_given(&self) -> bool {
        named_program(self.blender.as_deref()).is_some()
    }
}

#[derive(clap::Args)]
pub struct RenderArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// Make only one kind of picture [default: both].
    #[arg(long, value_enum)]
    only: Option<Only>,
    /// The renderer of the photos.
    #[arg(long, value_parser = renderer_parser(), default_value = "builtin")]
    renderer: RendererKind,
    #[command(flatten)]
    blender: BlenderArgs,
    /// Samples per pixel of each of the two halves of a photo [default: the recipe's].
    #[arg(long, value_parser = samples_parser())]
    samples: Option<u32>,
    /// Samples per pixel of each of the two halves of the scorer's reference.
    #[arg(long, value_parser = samples_parser(), default_value_t = RELEASE_SAMPLES)]
    scorer_samples: u32,
    /// Render this scene only, and leave the manifest to `prep finish`; may be given several times.
    #[arg(long = "scene", value_name = "SCENE")]
    scenes: Vec<SceneId>,
    /// Render pictures again that already exist.
    #[arg(long)]
    force: bool,
}

/// A kind of picture that `prep render` makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Only {
    /// Photos: every view by the renderer, its input view being what methods see.
    Photo,
    /// The scorer's reference: its own render of the true materials, with which scores under light compare. A dataset
    /// of the format before this one is brought up to date first.
    Scorer,
}

/// Reads a renderer's word; the help lists every renderer with its summary.
pub fn renderer_parser() -> impl TypedValueParser<Value = RendererKind> {
    word_parser(RendererKind::ALL, |kind| (kind.word(), kind.summary()))
}

/// Reads a device's word; the help lists every device with its summary.
fn device_parser() -> impl TypedValueParser<Value = DeviceChoice> {
    word_parser(DeviceChoice::ALL, |device| (device.word(), device.summary()))
}

/// Reads a number of samples, as large as a recipe's may be.
pub fn samples_parser() -> impl TypedValueParser<Value = u32> {
    clap::value_parser!(u32).range(1..=i64::from(MOST_SAMPLES))
}

/// The renderer with its options. For Blender, fails if it cannot be found, or is a module that cannot be imported.
pub fn checked_renderer(kind: RendererKind, blender: &BlenderArgs) -> anyhow::Result<Renderer> {
    Ok(match kind {
        RendererKind::Builtin if blender.device != DeviceChoice::Cpu => bail!(
            "--device {} is for Blender alone, and the renderer is '{kind}', which runs on the processor; add \
             --renderer blender, or leave out --device",
            blender.device
        ),
        RendererKind::Builtin => Renderer::Builtin,
        RendererKind::Blender => {
            let options = blender.options()?;
            if options.program.is_python() {
                check_blender(&options.program.0).context("cannot render with Blender")?;
            }
            Renderer::Blender(options)
        }
    })
}

impl RenderArgs {
    /// Renders the dataset: photos first, then references.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        if self.only == Some(Only::Scorer) {
            let is_new = with_progress(|progress| bring_up_to_date(&self.dataset, progress))
                .context("cannot bring the dataset up to date")?;
            if is_new {
                say(&format!("{}: brought up to date; its identity has changed", self.dataset.display()));
            }
        } else {
            let failed = render_photos(self)?;
            if failed > 0 {
                say_if_apart(&self.scenes, &self.dataset);
                let failed = counted(failed, "scene");
                bail!(
                    "{failed} could not be rendered; all others were rendered. Run the command again: references follow the photos"
                );
            }
        }
        if self.only != Some(Only::Photo) {
            render_references(self)?;
        }
        say_if_apart(&self.scenes, &self.dataset);
        Ok(Outcome::Good)
    }
}

/// Returns the number of scenes that could not be rendered.
fn render_photos(args: &RenderArgs) -> anyhow::Result<usize> {
    let renderer = checked_renderer(args.renderer, &args.blender)?;
    let options = RenderOptions { renderer, samples: args.samples, scenes: args.scenes.clone(), force: args.force };
    let report = with_progress(|progress| mateval_prep::render::render(&args.dataset, &options, progress))
        .context("cannot render the dataset")?;
    for line in &report.remarks {
        say(line);
    }
    for failure in &report.failures {
        say(&failure.to_string());
    }
    let rendered = counted(report.rendered, "view");
    print(&format!("{}: {rendered} rendered, {} kept\n", args.dataset.display(), report.kept))?;
    Ok(report.failures.len())
}

fn render_references(args: &RenderArgs) -> anyhow::Result<()> {
    let options = ReferenceOptions { samples: args.scorer_samples, scenes: args.scenes.clone(), force: args.force };
    let report = with_progress(|progress| make_references(&args.dataset, &options, progress))
        .context("cannot render the scorer's references")?;
    if args.scenes.is_empty() {
        with_progress(|progress| finish_again(&args.dataset, progress)).context("cannot finish the dataset")?;
    }
    let rendered = counted(report.rendered, "scene");
    print(&format!("{}: references of {rendered} rendered, {} kept\n", args.dataset.display(), report.kept))
}

#[derive(clap::Args)]
pub struct FinishArgs {
    /// Folder of the dataset.
    dataset: PathBuf,
    /// Leave this scene of the recipe out; may be given several times. A later call without it takes the scene in
    /// again.
    #[arg(long, value_name = "SCENE")]
    without: Vec<SceneId>,
}

impl FinishArgs {
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let finish = |progress: mateval_dataset::Progress<'_>| {
            mateval_prep::build::finish::finish(&self.dataset, &self.without, TOOL, progress)
        };
        let dataset = with_progress(finish).context("cannot finish the dataset")?;
        let photos = dataset.photo_renderer.map_or("without photos".to_owned(), |id| format!("photos by {id}"));
        let twins = dataset.twins.len();
        let scenes = counted(dataset.scenes.len() - twins, "scene");
        let twins = if twins == 0 { String::new() } else { format!(" and {}", counted(twins, "twin")) };
        print(&format!("{}: {scenes}{twins}, {photos}\n", self.dataset.display()))?;
        Ok(Outcome::Good)
    }
}

/// Says that the dataset is to be finished, where only some scenes were worked on.
pub fn say_if_apart(scenes: &[SceneId], dataset: &Path) {
    if !scenes.is_empty() {
        say(&format!("when all scenes are done, run `mateval prep finish {}`", dataset.display()));
    }
}

#[derive(clap::Args)]
pub struct PerturbArgs {
    /// Folder of the dataset, with its ground truth.
    dataset: PathBuf,
    /// How the furniture differs from the true one.
    #[arg(long, value_parser = word_parser(PerturbationKind::ALL, shown_kind))]
    kind: PerturbationKind,
    /// How far: 0 (not at all) to 3 for pose and shape, to 2 for scale.
    #[arg(long)]
    level: u32,
    /// The seed of the directions. They are the same at every level.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Folder for the public files with other geometry.
    #[arg(long)]
    out: PathBuf,
    /// Replace a folder that already exists.
    #[arg(long)]
    force: bool,
}

fn shown_kind(kind: &PerturbationKind) -> (&'static str, &'static str) {
    let help = match kind {
        PerturbationKind::Pose => "Moved on the floor by 1, 5, 10 cm and turned by 1, 5, 5 degrees",
        PerturbationKind::Scale => "Enlarged or reduced by 2, 5 %",
        PerturbationKind::Shape => "Bent by at most 0.5, 1, 3 cm",
    };
    (kind.word(), help)
}

impl PerturbArgs {
    /// Writes the folder, and prints a line for each scene.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        check_free(&self.out, self.force, "--out")?;
        check_outside_datasets(&self.out, "--out")?;
        let options = PerturbOptions { kind: self.kind, level: self.level, seed: self.seed };
        let scenes = with_progress(|progress| perturb(&self.dataset, &self.out, &options, progress))
            .context("cannot perturb the dataset")?;
        print(&scenes.iter().map(perturbed_line).collect::<String>())?;
        Ok(Outcome::Good)
    }
}

fn perturbed_line(found: &PerturbedScene) -> String {
    let names: Vec<String> = found.crossing.iter().map(|id| format!("'{id}'")).collect();
    let walls = match &names[..] {
        [] => "none passes through a wall or floor".to_owned(),
        names => format!("{} newly pass through a wall or floor: {}", names.len(), names.join(", ")),
    };
    format!("{}: {} pieces of furniture moved; {walls}\n", found.scene, found.moved)
}
