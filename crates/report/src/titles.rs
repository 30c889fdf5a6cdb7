//! What tables, boards and pages call methods, pictures, views and surfaces.

use mateval_eval::metric::PictureKind;
use mateval_eval::result::ResultFile;
use mateval_eval::result::key::{Surfaces, Views};

/// The method's name with the geometry that it was given, as in `nn (pose 2)`.
pub fn shown_method(result: &ResultFile) -> String {
    match &result.submission.geometry {
        None => result.method.clone(),
        Some(perturbation) => format!("{} ({perturbation})", result.method),
    }
}

/// A word of results that people read by a title.
pub(crate) trait Titled {
    fn title(self) -> &'static str;
}

impl Titled for PictureKind {
    fn title(self) -> &'static str {
        match self {
            Self::Albedo => "Albedo",
            Self::AlbedoAligned => "Aligned albedo",
            Self::RgbTrue => "RGB, true light",
            Self::RgbFitted => "RGB, fitted light",
            Self::RgbRelit => "RGB, relit",
            Self::Roughness => "Roughness",
            Self::Metallic => "Metallic",
            Self::TextureBaseColor => "Base colour texels",
            Self::Measured => "Measured colours",
        }
    }
}

impl Titled for Views {
    fn title(self) -> &'static str {
        match self {
            Self::Input => "Input view",
            Self::Novel => "Novel views",
            Self::Observed => "Observed",
            Self::Unobserved => "Unobserved",
            Self::Wide => "Wide views",
            Self::WideUnobserved => "Unobserved in wide views",
        }
    }
}

impl Titled for Surfaces {
    fn title(self) -> &'static str {
        match self {
            Self::All => "All surfaces",
            Self::Specular => "Specular regions",
        }
    }
}
