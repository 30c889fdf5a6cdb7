//! Tests of whole pictures: closed forms, agreement between estimators, identical bytes, agreement with Mitsuba.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

#[path = "suite/bench_room.rs"]
mod bench_room;
#[path = "suite/bench_scene.rs"]
mod bench_scene;
#[path = "suite/closed_forms.rs"]
mod closed_forms;
#[path = "suite/estimators.rs"]
mod estimators;
#[path = "suite/light_basis.rs"]
mod light_basis;
#[path = "suite/mapped_lamps.rs"]
mod mapped_lamps;
#[path = "suite/repaint.rs"]
mod repaint;
#[path = "suite/same_bytes.rs"]
mod same_bytes;
#[path = "suite/scenes.rs"]
mod scenes;
#[path = "suite/shared_centre.rs"]
mod shared_centre;
#[path = "suite/statistics.rs"]
mod statistics;
