//! A square piece of a graph's material as pixels.

use rayon::prelude::*;

use crate::batch::Evaluator;
use crate::error::ProceduralError;
use crate::lanes::{LANES, Points};
use crate::program::compile::{OUTPUTS, Program};
use crate::settings::Settings;

/// The most pixels a side: a picture of them takes 0.7 GB.
pub const MOST_PIXELS: usize = 4096;

/// A square of the domain, whose lower left corner is the origin. Its footprint is the side of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Square {
    size_metres: f64,
    resolution: usize,
}

/// The outputs of a material at a pixel's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pixel {
    /// Linear colour.
    pub base_color: [f64; 3],
    /// Roughness.
    pub roughness: f64,
    /// Metallic.
    pub metallic: f64,
}

impl Square {
    /// A square of this side in metres and in pixels. Fails unless the size is finite and above 0, and the
    /// resolution is 1 to [`MOST_PIXELS`].
    pub fn new(size_metres: f64, resolution: usize) -> Result<Self, ProceduralError> {
        let fits = size_metres.is_finite() && size_metres > 0.0 && (1..=MOST_PIXELS).contains(&resolution);
        let refused = ProceduralError::PictureSize { size_metres, resolution, most: MOST_PIXELS };
        if fits { Ok(Self { size_metres, resolution }) } else { Err(refused) }
    }

    fn pixel_metres(&self) -> f64 {
        self.size_metres / self.resolution as f64
    }

    /// The points of a row of pixels from column `first` on; beyond the row's end the last one is repeated.
    fn points(&self, row: usize, first: usize) -> Points {
        let pixel = self.pixel_metres();
        let column = |lane: usize| (first + lane).min(self.resolution - 1);
        let v = ((self.resolution - 1 - row) as f64 + 0.5) * pixel;
        let u = std::array::from_fn(|lane| (column(lane) as f64 + 0.5) * pixel);
        Points { u, v: [v; LANES], footprint: [pixel; LANES] }
    }
}

/// Evaluates a graph at every pixel, row by row from the top. The same on any number of threads. Fails where a value is
/// not finite.
pub fn render(program: &Program, settings: &Settings, square: Square) -> Result<Vec<Pixel>, ProceduralError> {
    let prepare = || Evaluator::new(program, settings, &[]);
    let black = Pixel { base_color: [0.0; 3], roughness: 0.0, metallic: 0.0 };
    let mut pixels = vec![black; square.resolution * square.resolution];
    let rows = pixels.par_chunks_mut(square.resolution).enumerate();
    let rows = rows.map_init(prepare, |evaluator, (row, pixels)| fill(pixels, evaluator, program, square, row));
    let rows: Vec<Result<(), ProceduralError>> = rows.collect();
    // The first row that fails, on any number of threads.
    rows.into_iter().collect::<Result<(), _>>()?;
    Ok(pixels)
}

/// Evaluates a row of pixels.
fn fill(
    pixels: &mut [Pixel],
    evaluator: &mut Evaluator,
    program: &Program,
    square: Square,
    row: usize,
) -> Result<(), ProceduralError> {
    for (at, batch) in pixels.chunks_mut(LANES).enumerate() {
        let points = square.points(row, at * LANES);
        evaluator.run(&points);
        for (lane, place) in batch.iter_mut().enumerate() {
            *place = pixel(program, evaluator.outputs(lane), points.u[lane], points.v[lane])?;
        }
    }
    Ok(())
}

fn pixel(program: &Program, outputs: [f64; OUTPUTS], u: f64, v: f64) -> Result<Pixel, ProceduralError> {
    const NAMES: [&str; OUTPUTS] = ["red", "green", "blue", "roughness", "metallic"];
    if let Some(at) = outputs.iter().position(|value| !value.is_finite()) {
        let graph = program.name.clone();
        return Err(ProceduralError::NotFinite { graph, output: NAMES[at], u, v, value: outputs[at] });
    }
    let [red, green, blue, roughness, metallic] = outputs;
    Ok(Pixel { base_color: [red, green, blue], roughness, metallic })
}
