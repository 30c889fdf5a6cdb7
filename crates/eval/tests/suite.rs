//! Tests the promises of the scoring protocol on rooms that are scored in seconds: the truth is never beaten, noise is
//! as large as reported and adds no bias, planted light is recovered, the same input gives the same bytes.

#![allow(
    clippy::unwrap_used,
    reason = "tests unwrap; clippy exempts only functions marked as tests, not what they call"
)]

mod suite {
    mod cache;
    mod capture;
    mod captured_photos;
    mod constancy;
    mod damages;
    mod mask_rules;
    mod planted_light;
    mod protocol_rules;
    mod same_bytes;
    mod sample;
    mod truth;
    mod verify;
}
