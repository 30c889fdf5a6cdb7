//! Tests that cross crates: the command `mateval` runs on the built-in sample, on planted faults, and on the real
//! scenes if these exist. Each module holds one concept; all are one binary.

#![allow(
    clippy::unwrap_used,
    reason = "tests unwrap; clippy exempts only functions marked as tests, not what they call"
)]

mod suite {
    mod apart;
    mod arrows;
    mod attacks;
    mod bad_input;
    mod blender;
    mod blender_import;
    mod captured_export;
    mod captured_rooms;
    mod circles;
    mod command;
    mod compare;
    mod converted;
    mod delighting;
    mod demo;
    mod determinism;
    mod estimates;
    mod fetching;
    mod flat_bases;
    mod full_disk;
    mod gltf;
    mod graph;
    mod help;
    mod house;
    mod images;
    mod importing;
    mod leaks;
    mod lifting;
    mod linting;
    mod map;
    mod mitsuba_export;
    mod part_labels;
    mod partial;
    mod partial_board;
    mod perturb;
    mod photo;
    mod planted;
    mod procedural;
    mod publish;
    mod real_scenes;
    mod recentred;
    mod redress;
    mod release;
    mod relit;
    mod reprojection;
    mod results_folder;
    mod resume;
    mod sample;
    mod schemas;
    mod scores;
    mod stated;
    mod stats;
    mod survey;
    mod twins;
    mod unsound_submissions;
    mod verify_faults;
    mod wide_views;
}
