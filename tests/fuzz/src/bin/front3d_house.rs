#![no_main]
//! A 3D-FRONT house's JSON.

use libfuzzer_sys::fuzz_target;
use mateval_sources::front3d::{Limits, read_house};

fuzz_target!(|bytes: &[u8]| {
    mateval_fuzz::with_file("house.json", bytes, |path| drop(read_house(path, &Limits::default())));
});
