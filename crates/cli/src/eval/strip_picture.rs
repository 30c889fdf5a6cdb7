//! What the pictures of `eval pictures` and `eval leaderboard` show: `--picture` and `--samples`.

use clap::builder::PossibleValue;
use mateval_eval::light::rules::Track;
use mateval_eval::result_key::PictureKind;
use mateval_report::strips::Shown;
use mateval_scene::open::Dataset;

/// Pictures to draw, and how exactly.
#[derive(clap::Args)]
pub struct StripArgs {
    /// What the pictures show; may be given several times [default: albedo; in a leaderboard also rgb_true, if the
    /// dataset has renders].
    #[arg(long = "picture", value_name = "PICTURE", value_enum)]
    shown: Vec<StripPicture>,
    /// Samples per pixel of lit pictures; each of the two halves of a picture has half of them.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(2..=65536))]
    samples: u32,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum StripPicture {
    Albedo,
    RgbTrue,
    RgbFitted,
}

impl clap::ValueEnum for StripPicture {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Albedo, Self::RgbTrue, Self::RgbFitted]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (kind, help) = match self {
            Self::Albedo => (PictureKind::Albedo, "base_color"),
            Self::RgbTrue => (PictureKind::RgbTrue, "RGB under the scene's own lights"),
            Self::RgbFitted => (PictureKind::RgbFitted, "RGB under lights fitted to the input view"),
        };
        Some(PossibleValue::new(kind.word()).help(help))
    }
}

impl StripArgs {
    /// The pictures as the library draws them; albedo by default.
    pub fn shown(&self) -> Vec<Shown> {
        self.shown_or(&[StripPicture::Albedo])
    }

    /// As [`Self::shown`], but by default also of the light of a dataset that has renders to compare with.
    pub fn shown_in_leaderboard(&self, dataset: &Dataset) -> Vec<Shown> {
        match dataset.file.photo_renderer {
            Some(_) => self.shown_or(&[StripPicture::Albedo, StripPicture::RgbTrue]),
            None => self.shown(),
        }
    }

    fn shown_or(&self, default: &[StripPicture]) -> Vec<Shown> {
        let light = |track| Shown::Light { track, samples: self.samples / 2 };
        let shown = |picture: &StripPicture| match picture {
            StripPicture::Albedo => Shown::Albedo,
            StripPicture::RgbTrue => light(Track::True),
            StripPicture::RgbFitted => light(Track::Fitted),
        };
        let chosen = if self.shown.is_empty() { default } else { &self.shown };
        chosen.iter().map(shown).collect()
    }
}
