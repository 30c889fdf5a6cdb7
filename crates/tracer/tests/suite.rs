//! Tests of whole pictures: closed forms, agreement between estimators, identical bytes, agreement with Mitsuba.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod suite {
    mod bench_room;
    mod closed_forms;
    mod escaping;
    mod estimators;
    mod light_basis;
    mod mapped_lamps;
    mod repaint;
    mod same_bytes;
    mod shared_centre;
    mod split;
}
