//! Describes the release of a dataset on a page that can be cited.
//!
//! In: a dataset with its `.build`, and optionally verdicts of `prep compare`, results of the truth and of a constant
//! estimate, and facts about the publication. Out: a folder with `index.html`, `release.json` ([`ReleaseFile`]) and small
//! pictures.
//!
//! [`CheckedRelease::new`] reads and checks everything that is given ([`comparisons`], [`reference_scores`]) before
//! [`CheckedRelease::write`] verifies the dataset and gathers the rest: counts beside the paper's ([`table_one`]), the noise
//! of the photo's renderer ([`truth_renders`]), licences and hashes of the inputs ([`inputs`]), commands ([`remake`]), the citation
//! ([`publication`]) and pictures ([`thumbnails`]). If the ground truth is withheld, `withholding` removes what was measured
//! on it. `page` and the files beside it fill the template.
//!
//! Nothing depends on a clock: the same inputs give the same bytes.

pub mod comparisons;
pub mod error;
pub mod file;
pub mod inputs;
mod page;
mod page_scene;
mod page_summary;
#[cfg(test)]
mod page_tests;
pub mod publication;
pub mod reference_scores;
mod release;
pub mod remake;
pub mod table_one;
pub mod thumbnails;
pub mod truth_renders;
mod unfit;
mod withholding;

pub use error::ReleaseError;
pub use file::ReleaseFile;
pub use publication::Publication;
pub use release::{CheckedRelease, ReleaseOptions};
