//! `mateval prep survey`: rooms of 3D-FRONT that could become scenes.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use mateval_prep::survey::rules::{RejectionLists, SelectionRules};
use mateval_prep::survey::selection::SelectionGoal;
use mateval_prep::survey::{Selection, SurveyFile, SurveyOptions, TargetedMean, survey};
use mateval_sources::front3d::camera_rules::CameraRules;

use crate::bars::with_progress;
use crate::outcome::{Outcome, counted, print, say};
use crate::tool::TOOL;

/// Arguments of `prep survey`.
#[derive(clap::Args)]
pub struct SurveyArgs {
    /// 3D-FRONT houses (JSON files) or folders of houses, relative to --source.
    #[arg(required = true)]
    houses: Vec<PathBuf>,
    /// Folder that all paths are relative to, as in a recipe [default: the current folder; where a path is absolute, the
    /// lowest folder that contains all paths].
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
    /// CSV file (`id,reason`) of rooms, houses and models to reject; may be given several times.
    #[arg(long = "list", value_name = "LIST.csv")]
    lists: Vec<PathBuf>,
    /// The rules that drawn cameras keep. They also decide on resolution and field of view where none is given.
    #[arg(long, default_value = CameraRules::default().name(), value_parser = camera_rules_parser())]
    camera_rules: CameraRules,
    /// Choose this many scenes for the recipe, which together are like the paper's: with 13.2 objects of 4.3
    /// super-categories on average, and equally many of each room type. Without it the recipe has every accepted room.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    scenes: Option<u32>,
    /// With --scenes: the most scenes of one house.
    #[arg(long, value_name = "NUMBER", requires = "scenes", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    scenes_per_house: u32,
    /// Search this house only, and leave the survey of all to a later run without --house; may be given several times. It
    /// is a house's file relative to --source, or the file's name without .json. Several processes may search different
    /// houses of one survey at once.
    #[arg(long = "house", value_name = "HOUSE", conflicts_with = "scenes")]
    only: Vec<String>,
    /// Seed of the drawn cameras.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(..=u64::from(u32::MAX)))]
    seed: u64,
    /// Number of cameras drawn in each room; with the rules 3dlg it is the mean over a house's rooms, and large ones get more.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=1000))]
    cameras_per_room: u32,
    /// Width and height of the scenes' pictures, in pixels [default: 480 270; 480 360 with the rules 3dlg].
    #[arg(long, num_args = 2, value_names = ["WIDTH", "HEIGHT"], value_parser = clap::value_parser!(u32).range(16..=8192))]
    resolution: Vec<u32>,
    /// Vertical field of view of the drawn cameras, in degrees: above 0, below 179 [default: 45; 73.74 with the rules 3dlg,
    /// which is 90 degrees wide].
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
        let mut lists = RejectionLists::default();
        for list in &self.lists {
            lists.add(list).context("cannot read a list")?;
        }
        Ok(SurveyOptions {
            source: self.source.clone(),
            houses: self.houses.clone(),
            models: self.models.clone(),
            textures: self.textures.clone(),
            cameras: self.cameras.clone(),
            rules: rules.unwrap_or_default(),
            lists,
            seed: self.seed,
            cameras_per_room: self.cameras_per_room,
            resolution: self.resolution.as_slice().try_into().unwrap_or(self.camera_rules.resolution()),
            fov_y_deg,
            camera_rules: self.camera_rules,
            only: self.only.clone(),
            goal: self.scenes.map(|scenes| SelectionGoal::of_paper(scenes as usize, self.scenes_per_house as usize)),
            out: self.out.clone(),
            force: self.force,
        })
    }
}

/// Surveys the houses; the answer is no where no room qualifies, or fewer than the scenes that are wanted.
pub fn run(args: &SurveyArgs) -> anyhow::Result<Outcome> {
    let options = args.checked()?;
    let surveyed = with_progress(|progress| survey(&options, TOOL, progress)).context("cannot survey the houses")?;
    if surveyed.kept > 0 {
        say(&format!("{} of {} houses were already searched by an earlier run", surveyed.kept, surveyed.houses));
    }
    match &surveyed.file {
        Some(file) => report(args, file, &surveyed.source),
        None => {
            print(&format!("{}: {} searched\n", args.out.display(), counted(surveyed.houses, "house")))?;
            say("when all houses are done, run the command without --house");
            Ok(Outcome::Good)
        }
    }
}

/// Reports a finished survey.
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

/// Parses the name of a set of camera rules; the help text lists them.
fn camera_rules_parser() -> impl TypedValueParser<Value = CameraRules> {
    let names = CameraRules::ALL.map(|rules| PossibleValue::new(rules.name()).help(rules.summary()));
    PossibleValuesParser::new(names).try_map(|name| name.parse::<CameraRules>())
}
