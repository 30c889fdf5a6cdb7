//! A submission checked before it is scored: every fault at once, in seconds, without a render.
//!
//! In: a submission's folder and the public part of a dataset. Out: a [`LintFile`] with findings, folded by code, and a
//! verdict.
//!
//! Between: `tree` lists the folder; `submission_json` and `layout` compare names with the dataset; `map_remarks`
//! judges the headers of maps that can be read. The maps are then compared with the input picture: `sight` finds which
//! texel each pixel shows, `looks` what the maps hold there, and `orientation`, `colours`, `readings`, `shading`,
//! `scalars`, `unobserved` and `copies` judge that. `scene` runs all of this for one scene, `whole_submission` for all.
//!
//! An error is something that scoring refuses or replaces by a default. A warning is scored, but probably a mistake. A
//! note is for information. Evidence from pictures is never an error; the message states it.
//!
//! A new finding belongs into the file of its concept, with a row in FORMAT.md and one in the table of planted faults
//! (`tests/suite/lint/`). A new concept is also called in `scene`.

mod colours;
mod copies;
mod file;
mod finding;
mod fold;
mod instance_facts;
mod layout;
mod looks;
mod map_remarks;
mod names;
mod orientation;
mod plan;
mod readings;
mod scalars;
mod scene;
mod shading;
mod sight;
mod statistics;
pub mod submission_json;
mod text;
mod tree;
mod unobserved;
mod whole_submission;

pub use file::{FoldedFinding, LINT_FORMAT, LintFile};
pub use plan::LintPlan;
pub use text::plain;
pub use whole_submission::{lint, refused};
