//! Shows results to people.
//!
//! In: results; for pictures also the dataset and the submissions. Out: tables ([`tables`]), ranks with intervals
//! ([`ranking`]), a site ([`leaderboard`]), pictures side by side ([`picture_set`], [`strips`]), an explanation of
//! where and how the albedo of a scene errs ([`explain`]), the metrics of two picture files ([`pair`]). Results that
//! contradict each other, or what they are shown with, are refused with every reason ([`mismatch`]).

pub mod error;
pub mod explain;
pub mod leaderboard;
pub mod mismatch;
pub mod page_style;
pub mod pair;
pub mod picture_set;
pub mod ranking;
pub mod strips;
pub mod tables;

pub use error::ReportError;
