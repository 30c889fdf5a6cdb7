//! From results to what people look at.
//!
//! In: results, and for pictures the dataset and the submissions. Out: tables ([`tables`]), ranks with intervals
//! ([`ranking`]), a site ([`leaderboard`]), pictures side by side ([`picture_set`], [`strips`]), where and how a scene's
//! albedo errs ([`explain`]), the metrics of two picture files ([`pair`]).

pub mod error;
pub mod explain;
pub mod leaderboard;
pub mod mismatch;
pub mod pair;
pub mod picture_set;
pub mod ranking;
pub mod strips;
pub mod tables;

pub use error::ReportError;
