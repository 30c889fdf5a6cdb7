//! How a command prints its result: `--format text|json`.

/// For people or for programs.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// Lines for people; numbers are rounded.
    Text,
    /// One JSON document with exact numbers.
    Json,
}
