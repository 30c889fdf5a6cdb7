//! Shows results and releases to people.
//!
//! In: results; for pictures also the dataset and the submissions. Out: tables ([`tables`]), ranks with intervals
//! ([`ranking`]), a site ([`leaderboard`]), pictures side by side ([`strips`]), an explanation of where and how the
//! albedo of a scene errs ([`explain`]), the metrics of two picture files ([`pair`]), the strengths of methods by people's
//! votes on a site's pictures ([`votes`]). Results that contradict each other, or what they are shown with, are refused
//! with every reason ([`error`]).
//!
//! Of a dataset that is released, [`publish`] makes a public and a private copy, [`rounded`] the numbers of a hidden
//! split that may be shown, and [`release`] a page that describes it and can be cited.

pub mod error;
pub mod explain;
pub mod leaderboard;
pub mod pair;
pub mod publish;
pub mod ranking;
pub mod release;
pub mod rounded;
pub mod strips;
pub mod tables;
pub mod votes;

pub use error::ReportError;
