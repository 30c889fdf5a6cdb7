//! Measures how well the radiances of a real room's lights are recovered.
//!
//! `cargo bench --workspace --bench planted_fit -- DATASET SCENE SUBMISSION...`, on the light stage of a 3D-FRONT room or on
//! the own emitters of another scene.
//!
//! - [`planted`]: radiances are planted and fitted to a noisy photo of the first submission's materials.
//! - [`photo`]: radiances of every submission are fitted to the dataset's photo, under several rules. It prints the lights
//!   that end at zero, the PSNR of all views, and the noise of that PSNR that the fit causes.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a bench prints

mod photo;
mod planted;
mod room;

use std::path::Path;

use room::Room;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let [dataset, scene, submissions @ ..] = words.as_slice() else {
        println!("give DATASET SCENE SUBMISSION...");
        return;
    };
    let room = Room::open(Path::new(dataset), scene);
    println!("{} lights: {}", room.names.len(), room.names.join(" "));
    for submission in submissions {
        photo::measure(&room, Path::new(submission));
    }
    if let Some(submission) = submissions.first() {
        planted::measure(&room, Path::new(submission));
    }
}
