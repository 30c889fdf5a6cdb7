//! Arguments of a command that another command runs: parsed from words, so that defaults are stated once, in the
//! arguments themselves.

use std::ffi::OsString;
use std::path::Path;

use anyhow::Context as _;

/// The arguments `A` that these words stand for on a command line.
pub fn parse_args<A: clap::Args>(words: &[OsString]) -> anyhow::Result<A> {
    let command = A::augment_args(clap::Command::new("mateval").no_binary_name(true));
    let matches = command.try_get_matches_from(words).context("the arguments of a step are invalid, which is a bug")?;
    Ok(A::from_arg_matches(&matches)?)
}

/// The subcommand `C` that these words stand for on a command line.
pub fn parse_subcommand<C: clap::Subcommand>(words: &[OsString]) -> anyhow::Result<C> {
    let command = C::augment_subcommands(clap::Command::new("mateval").no_binary_name(true));
    let matches = command.try_get_matches_from(words).context("the arguments of a step are invalid, which is a bug")?;
    Ok(C::from_arg_matches(&matches)?)
}

/// `--NAME=PATH`, so that a path that begins with a hyphen is still read as a value.
pub fn path_option(name: &str, path: &Path) -> OsString {
    let mut word = OsString::from(format!("--{name}="));
    word.push(path);
    word
}
