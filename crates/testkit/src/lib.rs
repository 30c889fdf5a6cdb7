//! Code that the tests and benches of several crates share. It is only a dev-dependency: no released crate uses it.
//!
//! [`data`] finds inputs that are not in the repository; [`synthetic_noise`] makes noisy pictures whose expectation is
//! known; [`box_room`] is a plain closed room.

pub mod box_room;
pub mod data;
pub mod synthetic_noise;
