//! What the tests and benches of several crates share. A dev-dependency only: no crate that is shipped uses it.
//!
//! [`data`] finds inputs that are not in the repository; [`synthetic_noise`] makes noisy pictures whose expectation is
//! known.

pub mod data;
pub mod synthetic_noise;
