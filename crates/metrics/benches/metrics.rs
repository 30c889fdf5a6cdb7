//! Wall time of SSIM, FLIP and LPIPS on 512x512 pictures: `cargo bench -p mateval-metrics -- FOLDER`, where the folder
//! holds the LPIPS weights; without one, SSIM and FLIP alone. Best of five; VGG best of two.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a bench prints

use std::path::PathBuf;
use std::time::Instant;

use mateval_image::{Picture, SrgbRgb};
use mateval_metrics::{Lpips, Net, flip, ssim};

fn best_of(runs: usize, what: &str, mut run: impl FnMut() -> f64) {
    let time = |_| {
        let start = Instant::now();
        std::hint::black_box(run());
        start.elapsed().as_secs_f64()
    };
    let best = (0..runs).map(time).fold(f64::INFINITY, f64::min);
    println!("{what}: {:.1} ms", 1e3 * best);
}

fn main() {
    let pattern = |a: usize, b: usize| {
        let value = move |x, y, c| ((x * a + y * b + c * 37) % 251) as f32 / 250.0;
        Picture::from_fn(512, 512, |x, y| SrgbRgb(std::array::from_fn(|c| value(x, y, c))))
    };
    let (p, r) = (pattern(3, 7), pattern(5, 2));
    best_of(5, "ssim", || ssim(&p, &r).unwrap());
    let all = Picture::filled(512, 512, true);
    best_of(5, "flip", || flip(&p, &r, &all).unwrap().unwrap());
    let Some(folder) = std::env::args().skip(1).find(|word| !word.starts_with("--")).map(PathBuf::from) else { return };
    for (net, runs) in [(Net::Alex, 5), (Net::Vgg, 2)] {
        let start = Instant::now();
        let lpips = Lpips::load(net, &folder.join(net.file_name())).unwrap();
        println!("{} load: {:.1} ms", net.key(), 1e3 * start.elapsed().as_secs_f64());
        best_of(runs, net.key(), || lpips.whole(&p, &r).unwrap());
    }
}
