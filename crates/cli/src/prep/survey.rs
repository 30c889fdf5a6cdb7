//! `mateval prep survey`: rooms of 3D-FRONT that could become scenes.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use mateval_prep::survey::rules::{RejectionLists, SelectionRules};
use mateval_prep::survey::{SurveyOptions, Surveyed, survey};

use crate::bars::with_progress;
use crate::outcome::{Outcome, print, say};
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
    /// Seed of the drawn cameras.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(..=u64::from(u32::MAX)))]
    seed: u64,
    /// Number of cameras drawn in each room.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=1000))]
    cameras_per_room: u32,
    /// Width and height of the scenes' pictures, in pixels.
    #[arg(long, num_args = 2, value_names = ["WIDTH", "HEIGHT"], default_values_t = [480, 270], value_parser = clap::value_parser!(u32).range(16..=8192))]
    resolution: Vec<u32>,
    /// Vertical field of view of the drawn cameras, in degrees: above 0, below 179.
    #[arg(long, default_value_t = 45.0)]
    fov_y_deg: f64,
    /// Folder for the page, its thumbnails, the recipe and survey.json.
    #[arg(long)]
    out: PathBuf,
    /// Replace a survey that already exists.
    #[arg(long)]
    force: bool,
}

impl SurveyArgs {
    fn checked(&self) -> anyhow::Result<SurveyOptions> {
        anyhow::ensure!(
            self.fov_y_deg > 0.0 && self.fov_y_deg < 179.0,
            "--fov-y-deg {}: expected a number above 0 and below 179",
            self.fov_y_deg
        );
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
            resolution: [self.resolution[0], self.resolution[1]],
            fov_y_deg: self.fov_y_deg,
            out: self.out.clone(),
            force: self.force,
        })
    }
}

/// Surveys the houses; the answer is no where no room qualifies.
pub fn run(args: &SurveyArgs) -> anyhow::Result<Outcome> {
    let options = args.checked()?;
    let Surveyed { file, source } =
        with_progress(|progress| survey(&options, TOOL, progress)).context("cannot survey the houses")?;
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
    Ok(if offered > 0 { Outcome::Good } else { Outcome::No })
}
