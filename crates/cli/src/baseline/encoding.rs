//! `mateval baseline encoding`: which encoding a method's numbers fit, before they are scored.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::bail;
use mateval_baselines::adapter::Adapter;
use mateval_baselines::encoding_fit::{FittedEncoding, LEAST_EXPLAINED, Verdict, best_explained};
use mateval_baselines::encoding_report::{self, EncodingReport, MapEncoding, Reading};
use mateval_dataset::json;

use crate::arguments::{Format, open_dataset};
use crate::terminal::{Outcome, print, with_progress};

#[derive(clap::Args)]
pub struct EncodingArgs {
    /// Folder of a method's pictures.
    folder: PathBuf,
    /// A built-in adapter or a TOML file, which states the names and encodings of the folder's files.
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "plain")]
    adapter: String,
    /// Folder of the dataset, with its ground truth.
    #[arg(long)]
    dataset: PathBuf,
    /// How to print the report.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

impl EncodingArgs {
    /// Compares the pictures with the truth; the answer is no where a map contradicts the adapter.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        let adapter = Adapter::find(&self.adapter)?;
        if !self.folder.is_dir() {
            bail!("'{}' does not exist; expected a folder of a method's pictures", self.folder.display());
        }
        let dataset = open_dataset(&self.dataset)?;
        let report = with_progress(|progress| encoding_report::report(&dataset, &self.folder, &adapter, progress))?;
        match self.format {
            Format::Json => print(&json::to_text(&report))?,
            Format::Text => print(&text(&report))?,
        }
        Ok(if report.agrees { Outcome::Good } else { Outcome::No })
    }
}

/// For each map the verdict, then a line for each encoding.
fn text(report: &EncodingReport) -> String {
    let mut text = String::new();
    for map in &report.maps {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{}: {}", map.map.stem(), verdict(map));
        let stated = if map.encoding_stated { "" } else { ", which the method's authors do not state" };
        let _ = writeln!(
            text,
            "  the adapter '{}' states {}{stated}; samples: {}, instances: {}, scenes: {}",
            report.adapter, map.adapter_encoding, map.samples, map.instances, map.scenes
        );
        for candidate in &map.candidates {
            let _ = writeln!(
                text,
                "  {:8} slope {:6.3}, correlation {:6.3}, mean error {:.4} (natural logarithm), explained {:5.1} %",
                candidate.encoding.word(),
                candidate.slope,
                candidate.correlation,
                candidate.error,
                100.0 * candidate.explained
            );
        }
    }
    text
}

/// What the numbers show and what to do.
fn verdict(map: &MapEncoding) -> String {
    if let Some(advice) = advice(map.reading) {
        return format!("the numbers fit far better {advice}");
    }
    let words = map.fits.iter().map(|fitted| fitted.word()).collect::<Vec<_>>().join(", ");
    match (map.verdict, map.agrees) {
        (Verdict::Fits, true) => format!("the numbers fit {words}, as the adapter states"),
        (Verdict::Fits, false) if map.fits == [FittedEncoding::Log] => {
            "the numbers fit a logarithm, which no adapter decodes; convert the pictures to linear numbers first"
                .to_owned()
        }
        (Verdict::Fits, false) => format!("the numbers fit {words}; write encoding = \"{words}\" in the adapter"),
        (Verdict::Undecided, _) => undecided(map, &words),
        (Verdict::TooLittle, _) => {
            "too few instances or too little variation to decide; use more scenes, or ask the authors".to_owned()
        }
        (Verdict::Unrelated, _) => {
            "the numbers do not follow the truth in any encoding; check `files`, `channel`, `range` and `placement`"
                .to_owned()
        }
    }
}

/// What another reading than the stated one means, and what to do.
fn advice(reading: Reading) -> Option<&'static str> {
    Some(match reading {
        Reading::AsStated => return None,
        Reading::MinusOneToOne => "as numbers from -1 to 1; write range = [-1.0, 1.0] in the adapter",
        Reading::To255 => "as numbers from 0 to 255; write range = [0.0, 255.0] in the adapter",
        Reading::Bgr => "with red and blue swapped (OpenCV's order); swap them in the files",
        Reading::FlippedRows => "with the rows in reverse order; flip the files upside down",
        Reading::FlippedColumns => "with the columns in reverse order; mirror the files",
        Reading::Turned => "turned by 180 degrees; turn the files",
        Reading::Inverted => "as 1 minus the number, such as a glossiness; invert the files",
        Reading::Squared => "as the square of the value, such as alpha in place of roughness; store the square root",
        Reading::Green => "in the green channel; write channel = \"g\" in the adapter",
        Reading::Blue => "in the blue channel; write channel = \"b\" in the adapter",
        Reading::CentreCrop => "as a crop of the view's middle; write placement = \"centre_crop\" in the adapter",
    })
}

/// The two best encodings with their errors, and what to do.
fn undecided(map: &MapEncoding, words: &str) -> String {
    let error =
        |fitted: &FittedEncoding| map.candidates.iter().find(|other| other.encoding == *fitted).map(|c| c.error);
    let named = |fitted: &FittedEncoding| Some(format!("{} (mean error {:.4})", fitted.word(), error(fitted)?));
    let best = map.fits.iter().take(2).filter_map(named).collect::<Vec<_>>().join(" and ");
    let explained = best_explained(&map.candidates);
    if explained < LEAST_EXPLAINED {
        let percent = 100.0 * explained.max(0.0);
        return format!(
            "undecided: the best encodings are {best}, but none explains more than {percent:.0} % of the truth's variance; ask \
             the authors"
        );
    }
    let advice = match map.agrees {
        true => "the adapter's is one of these",
        false => "none of them is the adapter's; state one of these in the adapter",
    };
    format!("undecided: {best} cannot be distinguished, out of: {words}; {advice}")
}
