//! Exports of the built-in sample.

#![allow(
    clippy::unwrap_used,
    reason = "tests unwrap; clippy exempts only functions marked as tests, not what they call"
)]

mod suite {
    mod cameras;
    mod licences;
    mod partial;
    mod refused;
    mod sample;
    mod tables;
    mod tars;
}
