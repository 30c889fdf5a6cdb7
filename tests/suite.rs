//! Everything that crosses crates: the command `mateval` run on the sample that it makes itself, on planted faults, and
//! on the real scenes where they are there. One concept a module, one binary for all.

#![allow(
    clippy::unwrap_used,
    reason = "tests unwrap; clippy exempts only functions marked as tests, not what they call"
)]

mod suite {
    mod arrows;
    mod bad_input;
    mod blender;
    mod circles;
    mod command;
    mod compare;
    mod determinism;
    mod full_disk;
    mod help;
    mod house;
    mod images;
    mod importing;
    mod kept_folder;
    mod lifting;
    mod linting;
    mod map;
    mod mitsuba_export;
    #[path = "../../crates/eval/tests/suite/packed.rs"]
    mod packed;
    mod part_labels;
    mod planted;
    mod publish;
    mod readme;
    mod real_scenes;
    mod relit;
    mod reprojection;
    mod resume;
    mod sample;
    mod schemas;
    mod scores;
    mod stats;
    mod unsound_submissions;
    mod verify_faults;
}
