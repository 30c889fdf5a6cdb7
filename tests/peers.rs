//! Compares the tracer with other renderers on the same scenes, which are made by the same code.
//!
//! `tools/test_peers.sh` installs the renderers, sets `MATEVAL_PEERS_PYTHON` and `MATEVAL_PEERS_BLENDER` to the Python
//! interpreters that have them, and runs these tests.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]
#![allow(clippy::print_stderr, reason = "measurements and skipped cases are printed")]

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
