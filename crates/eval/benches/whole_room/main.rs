//! Measures the cost of scoring one submission in one room completely, with MatEval and with other projects' software.
//!
//! `MATEVAL_PEERS_PYTHON=... cargo bench --workspace --bench whole_room -- DATASET SCENE SUBMISSION [full]`;
//! `tools/bench_whole_room.sh` makes all three arguments from the shared data and runs the bench. Ours: `score` under
//! protocol `mateval-2` with track `fitted` in place of `relit`, from opening the dataset to the result, apart from the
//! companions, which are made once for a dataset and are shown apart. Theirs, by
//! `tests/peers/score_room_mitsuba.py`: both tracks' five views by Mitsuba, radiances fitted by `prb` and Adam, albedo
//! by its `aov`; MSE, PSNR and SSIM by scikit-image and LPIPS by `lpips`, for both tracks and for albedo, raw and
//! aligned. Theirs has no track `relit`, no texture space, no roughness and metallic, no specular regions and no
//! halves. Importing and compiling is not counted for theirs. The tools run alternately.
//!
//! **The fit**: 100 iterations of 8 samples a pixel at the photo's size. At 480 x 270 pixels these are as many paths as
//! in `five_views`, where the number is our assumption. PSDR-Room, whose stage this is, publishes 201 iterations of 128
//! samples forward and 4 backward at 800 x 600 pixels, for materials and lights together.
//!
//! **Scaling**: with `full` times are scaled only for equal noise. Otherwise theirs is timed for 5 iterations and a
//! quarter of the samples, and the times of the fit and of the renders are multiplied.
//!
//! **Equal noise**: theirs takes as many samples a pixel as ours, both halves together; then the time of its renders,
//! and of nothing else, is multiplied by a factor. Three factors are computed, since noise can be defined in three
//! ways. The first two are ratios of its noise to ours: of the variance of a pixel, clipped and sRGB-encoded; and of
//! the squared standard error of the mean PSNR that results certify, the larger of the input view's and the novel
//! views'. A script that measured its error from halves, as ours does, would need these numbers of samples. A script
//! that passes noisy pictures to scikit-image, as this one does, gets an MSE that is too large by the variance of a
//! pixel: the third factor is the number of samples that reduces this bias to the standard error that ours certifies.
//! Ours renders five views from one set of paths, so their noise is not independent; the second and third factors
//! account for this. Noise is compared between pictures with the same number of samples, of our fitted radiances and of
//! Mitsuba's `principled`, which both can render, so that the tools converge to the same picture (the remaining
//! difference is printed). Pixels that show lights which only ours can hide from the camera are left out, and lights
//! with a map have its mean in both.

#![allow(clippy::unwrap_used, reason = "a bench that cannot be set up has failed")]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a bench prints")]

#[path = "../five_views/noise.rs"]
#[allow(dead_code, reason = "five_views uses all of it")]
mod noise;
mod ours;
mod peer_scene;
mod peers;
mod pictures;
mod report;
mod room;
#[path = "../five_views/stage.rs"]
#[allow(dead_code, reason = "five_views uses all of it")]
mod stage;

use std::path::Path;

use room::Room;
use stage::Stage;

/// Iterations of the fit, and those that are timed unless `full`.
pub const ITERATIONS: [u32; 2] = [100, 5];
/// Our samples divided by theirs that are timed, with `full` and without.
const FEWER: [u32; 2] = [1, 4];
const ROUNDS: u64 = 2;

/// The pictures that both tools render.
pub const TRACKS: [&str; 2] = ["true", "fitted"];

/// One run of a tool on the room.
pub struct Run {
    /// The stages and their times.
    pub stages: Vec<Stage>,
    /// All views of each of [`TRACKS`]; empty for ours, whose result holds no pictures.
    pub pictures: [Vec<pictures::Linear>; 2],
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let full = words.iter().any(|word| word == "full");
    let words: Vec<&str> =
        words.iter().map(String::as_str).filter(|word| !word.starts_with("--") && *word != "full").collect();
    let [dataset, scene, submission] = words[..] else {
        return println!("whole_room: give DATASET SCENE SUBMISSION [full]");
    };
    let Some(python) = std::env::var_os("MATEVAL_PEERS_PYTHON") else {
        return eprintln!("SKIPPED: whole_room: MATEVAL_PEERS_PYTHON names no Python; see tools/bench_whole_room.sh");
    };
    let weights =
        std::env::var_os("MATEVAL_CACHE").map(|cache| Path::new(&cache).join(mateval_metrics::Net::Alex.file_name()));
    let room = Room::open(Path::new(dataset), scene, Path::new(submission), weights);
    let (mut own, mut theirs) = (Vec::new(), Vec::new());
    // The first run determines the number of samples that theirs takes.
    let mut scored = None;
    for round in 0..ROUNDS {
        let (run, result) = ours::score(&room);
        own.push(run);
        let scored = scored.get_or_insert(result);
        let iterations = if round > 0 { 0 } else { ITERATIONS[usize::from(!full)] };
        let samples = pictures::samples(scored).map(|half| 2 * half / FEWER[usize::from(!full)]);
        theirs.push(peers::run(&python, &room, scored, round, iterations, samples));
    }
    report::print(&room, &scored.unwrap(), &own, &theirs);
}
