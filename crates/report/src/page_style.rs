//! The style sheet of all pages, light and dark, and the script that sorts their tables.

/// The style sheet.
pub const STYLE: &str = include_str!("leaderboard/templates/site.css");

/// Sorts tables with `data-sortable` when a button in their head is pressed.
pub const SORT: &str = include_str!("leaderboard/templates/sort.js");
