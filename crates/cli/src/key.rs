//! `mateval key`: the keys by which a board's keeper marks results as verified; and the day on which that happens.

use std::path::PathBuf;
use std::time::UNIX_EPOCH;

use anyhow::Context as _;
use mateval_report::leaderboard::marks::{new_key, public_of};
use mateval_report::release::file::Day;

use crate::arguments::check_output_file;
use crate::terminal::{Outcome, print};

#[derive(clap::Subcommand)]
pub enum Command {
    /// Makes a pair of keys: a secret one, with which `eval verify --sign` marks results as verified, and a public one,
    /// which boards take as `--trust`. The program minisign reads both.
    New(NewArgs),
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    let Command::New(args) = command;
    args.run()
}

#[derive(clap::Args)]
pub struct NewArgs {
    /// File for the secret key, which only its owner may read and which has no password; the public key lies beside it,
    /// with the ending .pub.
    key: PathBuf,
    /// Replace keys that already exist: boards that trust the old one no longer count what the new one signs.
    #[arg(long)]
    force: bool,
}

impl NewArgs {
    fn run(&self) -> anyhow::Result<Outcome> {
        let public = public_of(&self.key);
        check_output_file(&self.key, "KEY", "key", self.force)?;
        check_output_file(&public, "KEY", "key", self.force)?;
        let word = new_key(&self.key).context("cannot make a pair of keys")?;
        print(&format!("{}: secret, keep it to yourself\n{}: {word}\n", self.key.display(), public.display()))?;
        Ok(Outcome::Good)
    }
}

/// The present day in UTC.
pub fn today() -> Day {
    let days = UNIX_EPOCH.elapsed().map_or(0, |time| time.as_secs() / 86_400);
    Day::since_epoch(i64::try_from(days).unwrap_or(0))
}
