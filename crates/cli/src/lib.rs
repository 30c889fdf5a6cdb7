//! The `mateval` command. Only this crate prints and reads the environment.
//!
//! In: the words of a command line. Out: what the command prints and writes, and its exit code ([`main`]). The Python
//! package runs the same function, and takes the tool's name, its weights and the text of errors from here.
//!
//! Each group of commands has a file, with a folder beside it where one file would be too long. A command parses its
//! arguments, checks them and everything else that can fail early, and then calls a library, which returns values.
//! Results go to stdout; progress and warnings go to stderr. Exit codes: 0 the command did its work and the answer is
//! good, 1 it did its work and the answer is no, 2 it could not do its work.

mod arguments;
mod baseline;
mod demo;
mod eval;
mod fetch;
mod graph;
mod key;
mod prep;
mod terminal;

use std::ffi::OsString;
use std::path::Path;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, Parser, Subcommand};
use clap_complete::Shell;
use mateval_dataset::SceneId;
use mateval_dataset::open::read_dataset_file;
use mateval_files::untrusted::nearest;

pub use fetch::{cache_folder, find_weights};
use terminal::Outcome;
pub use terminal::{TOOL, error_text};

/// Makes and scores a benchmark for recovering the materials of an indoor room from one photo.
#[derive(Parser)]
#[command(version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Runs everything on the built-in sample: dataset, renders, baselines, scores and leaderboard.
    Demo(demo::DemoArgs),
    /// Writes the built-in sample: the source scenes of a small CC0 room and a house, and a recipe for them.
    Sample(demo::SampleArgs),
    /// Makes, checks and describes datasets.
    #[command(subcommand)]
    Prep(prep::Command),
    /// Makes a submission by a method that comes with the tool, or from another method's files.
    #[command(subcommand)]
    Baseline(baseline::Command),
    /// Checks, scores and compares submissions.
    #[command(subcommand)]
    Eval(eval::Command),
    /// Lists, checks and renders procedural materials: graphs of MaterialX nodes.
    #[command(subcommand)]
    Graph(graph::Command),
    /// Makes the keys with which a board's keeper marks results as verified.
    #[command(subcommand)]
    Key(key::Command),
    /// Downloads LPIPS' weights and Blender, which are not part of the tool.
    Fetch(fetch::FetchArgs),
    /// Prints the completions of a shell: `mateval completions bash > ~/.local/share/bash-completion/completions/mateval`.
    Completions {
        /// The shell that reads the script.
        shell: Shell,
    },
}

/// Runs the command with these words, of which the first is the program's name, and returns its exit code.
pub fn main(words: impl IntoIterator<Item = OsString>) -> u8 {
    let words: Vec<OsString> = words.into_iter().collect();
    // A panic is a bug and has printed its own message.
    std::panic::catch_unwind(|| run(&words)).unwrap_or(2)
}

fn run(words: &[OsString]) -> u8 {
    let result = match Cli::try_parse_from(words) {
        Ok(cli) => carry_out(&cli.command),
        Err(refusal) if refusal.use_stderr() => {
            // Nothing can be done where stderr is gone.
            let refusal = with_tip(refusal, words);
            let _ = refusal.print();
            return u8::try_from(refusal.exit_code()).unwrap_or(2);
        }
        Err(help) => terminal::print_help(&help).map(|()| Outcome::Good),
    };
    match result {
        Ok(Outcome::Good) => 0,
        Ok(Outcome::No) => 1,
        Err(error) => {
            terminal::say(&format!("error: {}", terminal::error_text(&error)));
            2
        }
    }
}

/// The refusal of a command line, with the command or the scene that was probably meant.
fn with_tip(mut refusal: clap::Error, words: &[OsString]) -> clap::Error {
    let text = |kind| refusal.get(kind).map(ToString::to_string).unwrap_or_default();
    let tip = match refusal.kind() {
        ErrorKind::InvalidSubcommand => {
            let mut found = Vec::new();
            find_commands(&Cli::command(), &text(ContextKind::InvalidSubcommand), "mateval", &mut found);
            (!found.is_empty()).then(|| format!("did you mean {}?", found.join(" or ")))
        }
        ErrorKind::ValueValidation if text(ContextKind::InvalidArg).ends_with("<SCENE>") => {
            Some(scene_tip(&text(ContextKind::InvalidValue), words))
        }
        _ => None,
    };
    if let Some(tip) = tip {
        // Where the name exists elsewhere, clap's list of similar names distracts.
        refusal.remove(ContextKind::SuggestedSubcommand);
        refusal.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    refusal
}

/// The commands below `command` that have this name, with the words before it.
fn find_commands(command: &clap::Command, name: &str, before: &str, found: &mut Vec<String>) {
    for below in command.get_subcommands() {
        let words = format!("{before} {}", below.get_name());
        if below.get_name() == name {
            found.push(format!("`{words}`"));
        }
        find_commands(below, name, &words, found);
    }
}

/// What helps where `given` cannot be a scene's id: the scenes of the dataset that the command line names.
fn scene_tip(given: &str, words: &[OsString]) -> String {
    let paths =
        words.iter().filter_map(|word| word.to_str()).map(|word| word.strip_prefix("--dataset=").unwrap_or(word));
    let dataset = paths.map(Path::new).find_map(|path| Some((path, read_dataset_file(path).ok()?)));
    let Some((path, dataset)) = dataset else {
        return "`mateval prep stats DATASET` lists the ids of a dataset's scenes".to_owned();
    };
    match nearest(given, dataset.scenes.iter().map(SceneId::as_str)) {
        Some(scene) => format!("did you mean '{scene}'?"),
        None => format!("`mateval prep stats {}` lists the ids of its scenes", path.display()),
    }
}

fn carry_out(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Demo(args) => args.run(),
        Command::Sample(args) => args.run(),
        Command::Prep(command) => prep::run(command),
        Command::Baseline(command) => baseline::run(command),
        Command::Eval(command) => eval::run(command),
        Command::Graph(command) => graph::run(command),
        Command::Key(command) => key::run(command),
        Command::Fetch(args) => args.run(),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "mateval", &mut script);
            terminal::print(&String::from_utf8_lossy(&script)).map(|()| Outcome::Good)
        }
    }
}
