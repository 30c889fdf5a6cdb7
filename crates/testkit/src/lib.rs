//! Code that the tests and benches of several crates share. It is only a dev-dependency: no released crate uses it.
//!
//! [`data`] finds inputs that are not in the repository; [`synthetic_noise`] makes noisy pictures whose expectation is
//! known; [`box_room`] is a plain closed room, [`scenes`] builds small scenes, [`bench_scene`] reads larger ones and
//! [`statistics`] compares their noisy renders; [`sample_dataset`] is the built-in sample as a dataset, with
//! submissions for it, and [`faulty_house`] its house with a third room and faults; [`packed`] writes archives byte by
//! byte; [`kept_folder`] makes folders that tests share.

#![allow(clippy::unwrap_used, clippy::missing_panics_doc, reason = "a test that cannot be set up has failed")]

pub mod bench_scene;
pub mod box_room;
pub mod data;
pub mod faulty_house;
pub mod kept_folder;
pub mod packed;
pub mod sample_dataset;
pub mod scenes;
pub mod statistics;
pub mod synthetic_noise;
