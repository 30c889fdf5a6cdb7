//! Graphs as users meet them: files, pictures, derivatives, refusals.

#![allow(
    clippy::unwrap_used,
    reason = "tests unwrap; clippy exempts only functions marked as tests, not what they call"
)]
#![allow(clippy::print_stderr, reason = "measurements are printed")]

mod planting;

mod suite {
    mod graphs;
    mod hostile;
    mod library;
    mod planted;
}
