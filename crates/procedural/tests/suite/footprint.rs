//! Edges and lines are as blurred as a pixel needs.

use mateval_procedural::evaluator::{Pixel, Square, render};
use mateval_procedural::library::LIBRARY;
use mateval_procedural::{Program, Settings};

fn mean(pixels: &[Pixel]) -> [f64; 3] {
    std::array::from_fn(|c| pixels.iter().map(|pixel| pixel.base_color[c]).sum::<f64>() / pixels.len() as f64)
}

fn variance(pixels: &[Pixel]) -> f64 {
    let [.., mean] = mean(pixels);
    pixels.iter().map(|pixel| (pixel.base_color[2] - mean).powi(2)).sum::<f64>() / pixels.len() as f64
}

/// Coarse pixels show the mean of fine ones: their mean colour is the same, though lines are thinner than a pixel.
#[test]
fn coarse_pixels_keep_the_mean_colour() {
    let mut seen = 0;
    for entry in &LIBRARY {
        let graph = entry.graph().unwrap();
        let program = Program::new(&graph);
        let settings = Settings::defaults(&graph);
        // Large enough that the mean over random cells is one.
        let [fine, coarse] = [1200, 300].map(|resolution| Square::new(3.0, resolution).unwrap());
        let [fine, coarse] = [fine, coarse].map(|square| render(&program, &settings, square).unwrap());
        for (fine, coarse) in mean(&fine).into_iter().zip(mean(&coarse)) {
            assert!((fine - coarse).abs() < 0.05 * fine + 0.002, "{}: {fine} {coarse}", entry.name);
        }
        assert!(variance(&coarse) <= variance(&fine) * 1.05 + 1e-6, "{}", entry.name);
        seen += 1;
    }
    assert_eq!(seen, 28);
}

/// The twin: without its footprint a coarse picture of thin lines has another mean at some phase.
#[test]
fn the_footprint_is_what_keeps_it() {
    let graph = mateval_procedural::library::entry("stripes").unwrap().graph().unwrap();
    let program = Program::new(&graph);
    let mut settings = Settings::defaults(&graph);
    settings.set(&graph, "period", "0.0401").unwrap();
    settings.set(&graph, "fine", "0").unwrap();
    let square = Square::new(3.0, 75).unwrap();
    let with = variance(&render(&program, &settings, square).unwrap());
    let sharp = mateval_procedural::mtlx::to_text(&graph).replace("interfacename=\"footprint\"", "value=\"0\"");
    let sharp = super::graphs::read(&sharp).unwrap();
    let without = variance(&render(&Program::new(&sharp), &settings, square).unwrap());
    assert!(with < 0.5 * without, "{with} {without}");
}
