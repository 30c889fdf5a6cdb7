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
    day(i64::try_from(days).unwrap_or(0))
}

/// The day that lies this many days after 1970-01-01. Howard Hinnant, "chrono-Compatible Low-Level Date Algorithms":
/// years begin in March, so that a leap day is the last of its year, and an era has 400 years.
fn day(days: i64) -> Day {
    let days = days + 719_468;
    let (era, of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year_of_era = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = era * 400 + year_of_era + i64::from(month <= 2);
    let text = format!("{year:04}-{month:02}-{day:02}");
    text.parse().expect("a day of the calendar is a day")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Days by Python's `datetime.date.fromordinal`.
    #[test]
    fn days_are_those_of_the_calendar() {
        let of = |days| String::from(day(days));
        assert_eq!([of(0), of(59), of(11_016), of(11_017)], ["1970-01-01", "1970-03-01", "2000-02-29", "2000-03-01"]);
        assert_eq!([of(20_784), of(47_540)], ["2026-11-27", "2100-02-28"]);
    }
}
