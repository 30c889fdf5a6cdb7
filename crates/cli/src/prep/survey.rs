//! `mateval prep survey`.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use mateval_prep::survey::rules::{RejectionLists, SelectionRules};
use mateval_prep::survey::{SurveyFile, SurveyOptions, Surveyed, survey};

use crate::TOOL;
use crate::bars::Bars;
use crate::outcome::{Outcome, print, say};

/// What it is given.
#[derive(clap::Args)]
pub struct SurveyArgs {
    /// Houses of 3D-FRONT (JSON), or folders of them, relative to --source.
    #[arg(required = true)]
    houses: Vec<PathBuf>,
    /// Folder that all paths are relative to, as in a recipe; the current one if absent, or the one that absolute paths
    /// have in common.
    #[arg(long)]
    source: Option<PathBuf>,
    /// Folder of 3D-FUTURE's models, relative to --source.
    #[arg(long)]
    models: PathBuf,
    /// Folder of the layout's textures, relative to --source; without it the architecture has its colours only.
    #[arg(long)]
    textures: Option<PathBuf>,
    /// A file of designers' cameras beside the houses, relative to --source.
    #[arg(long)]
    cameras: Option<PathBuf>,
    /// What a room must be like, a TOML file.
    #[arg(long)]
    rules: Option<PathBuf>,
    /// Rooms, houses and models that are known to be bad, a CSV of `id,reason`; may be given several times.
    #[arg(long = "list", value_name = "LIST.csv")]
    lists: Vec<PathBuf>,
    /// Of the cameras.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(..=u64::from(u32::MAX)))]
    seed: u64,
    /// Cameras drawn in each room.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=1000))]
    cameras_per_room: u32,
    /// Width and height of the scenes' pictures.
    #[arg(long, num_args = 2, default_values_t = [480, 270], value_parser = clap::value_parser!(u32).range(16..=8192))]
    resolution: Vec<u32>,
    /// Vertical field of view of drawn cameras, degrees.
    #[arg(long, default_value_t = 45.0)]
    fov_y_deg: f64,
    /// Folder for the page, its thumbnails, the recipe and survey.json.
    #[arg(long)]
    out: PathBuf,
    /// Replace a survey that is there.
    #[arg(long)]
    force: bool,
}

/// Runs it.
pub fn run(args: &SurveyArgs) -> anyhow::Result<Outcome> {
    anyhow::ensure!(
        args.fov_y_deg > 0.0 && args.fov_y_deg < 179.0,
        "--fov-y-deg {}: expected a number above 0 and below 179",
        args.fov_y_deg
    );
    let rules = args.rules.as_deref().map(SelectionRules::read).transpose().context("cannot read the rules")?;
    let mut lists = RejectionLists::default();
    for list in &args.lists {
        lists.add(list).context("cannot read a list")?;
    }
    let options = SurveyOptions {
        source: args.source.clone(),
        houses: args.houses.clone(),
        models: args.models.clone(),
        textures: args.textures.clone(),
        cameras: args.cameras.clone(),
        rules: rules.unwrap_or_default(),
        lists,
        seed: args.seed,
        cameras_per_room: args.cameras_per_room,
        resolution: [args.resolution[0], args.resolution[1]],
        fov_y_deg: args.fov_y_deg,
        out: args.out.clone(),
        force: args.force,
    };
    let bars = Bars::new();
    let Surveyed { file, source } =
        survey(&options, TOOL, &|step, done, all| bars.step(step, done, all)).context("cannot survey the houses")?;
    drop(bars);
    tell(&file);
    if args.source.is_none() && source != Path::new(".") {
        say(&format!("its paths are relative to '{0}': build with --source '{0}'", source.display()));
    }
    let rooms = || file.houses.iter().flat_map(|house| &house.rooms);
    let offered = rooms().filter(|room| !room.cameras.is_empty()).count();
    let page = args.out.join("index.html");
    print(&format!("{}: {offered} of {} rooms to pick from\n", page.display(), rooms().count()))?;
    Ok(if offered > 0 { Outcome::Good } else { Outcome::No })
}

fn tell(file: &SurveyFile) {
    for house in &file.houses {
        if let Some(error) = &house.error {
            say(&format!("left out: {error}"));
        }
    }
}
