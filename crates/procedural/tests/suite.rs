//! Graphs as users meet them: files, pictures, derivatives, refusals.

#![allow(
    clippy::unwrap_used,
    reason = "tests unwrap; clippy exempts only functions marked as tests, not what they call"
)]
#![allow(clippy::print_stderr, reason = "measurements are printed")]

mod planting;

mod suite {
    mod derivatives;
    mod files;
    mod footprint;
    mod graphs;
    mod hostile;
    mod library;
    mod nodes;
    mod pictures;
    mod planted;
    mod settings;
}
