//! Compares the tracer with other renderers on the same scenes, which are made by the same code.
//!
//! `tools/test_peers.sh` installs the renderers, sets `MATEVAL_PEERS_PYTHON` and `MATEVAL_PEERS_BLENDER` to the Python
//! interpreters that have them, and runs these tests.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]
#![allow(clippy::print_stderr, reason = "measurements and skipped cases are printed")]
#![allow(dead_code, reason = "the tracer's own tests use more of the shared modules")]

#[path = "../crates/tracer/tests/suite/bench_scene.rs"]
mod bench_scene;
#[path = "../crates/tracer/tests/suite/scenes.rs"]
mod scenes;
#[path = "../crates/tracer/tests/suite/statistics.rs"]
mod statistics;

mod peers {
    mod blender;
    mod blender_job;
    mod mitsuba;
    mod mitsuba_rooms;
    mod mitsuba_small;
    mod python;
    mod tiles;
    mod z_test;
}
