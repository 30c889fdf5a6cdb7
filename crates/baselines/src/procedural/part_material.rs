//! The material of a part: a fitted graph, or one colour.

use mateval_procedural::fit::candidate::Candidate;
use mateval_procedural::fit::choose::{Fit, Fitter, LEAST_POINTS};
use mateval_procedural::fit::paper::fit_as_paper;
use mateval_procedural::fit::points::Point;
use mateval_procedural::library::Class;

use super::options::{FitMode, ProceduralOptions};
use super::part_frame::{Chart, PartFrame};
use super::part_samples::PartSamples;
use crate::error::BaselineError;
use crate::estimate::{GivenMaps, Values};
use crate::median::median;

/// The most samples of a part that are looked at.
const MOST_SAMPLES: usize = 8192;

/// What decided on a part's material.
#[derive(Clone, Debug)]
pub(super) enum Reason {
    /// No pixel shows it: it has the colour of its instance, or of its category.
    Unseen,
    /// Too few pixels of one side show it: it has the median of its pixels.
    FewSamples,
    /// No graph predicts held-out pixels better than one colour does: it has the median of its pixels.
    OneColor(Fit),
    /// A graph predicts them better.
    Graph(Fit),
}

/// The material of a part.
#[derive(Clone, Debug)]
pub(super) struct PartMaterial {
    /// The median of its pixels, or what stands for them.
    pub(super) values: Values,
    /// The graph, for places of the unfolded box.
    pub(super) graph: Option<Candidate>,
    /// The side that it was fitted to.
    pub(super) chart: Option<Chart>,
    pub(super) frame: Option<PartFrame>,
    pub(super) reason: Reason,
    /// The number of pixels that show the part.
    pub(super) pixels: usize,
}

impl PartMaterial {
    /// Fits a part. `unseen` is what a part that is not seen takes.
    pub(super) fn fitted(
        fitter: &Fitter,
        part: &PartSamples,
        category: Option<&str>,
        options: &ProceduralOptions,
        unseen: Values,
    ) -> Result<Self, BaselineError> {
        let mut all: Vec<Values> = part.samples.iter().map(|sample| sample.values).collect();
        let pixels = all.len();
        let values = if all.is_empty() { unseen } else { median(&mut all) };
        let flat = Self { values, graph: None, chart: None, frame: part.frame, reason: Reason::Unseen, pixels };
        let Some((chart, samples)) = part.of_main_chart() else { return Ok(flat) };
        let chart = Some(chart);
        let points: Vec<Point> = samples.iter().take(MOST_SAMPLES).map(|sample| sample.point).collect();
        if points.len() < LEAST_POINTS {
            return Ok(Self { chart, reason: Reason::FewSamples, ..flat });
        }
        let fit = match options.mode {
            FitMode::Best => fitter.fit(&points, category)?,
            FitMode::Paper => fit_as_paper(fitter, &points)?,
        };
        if fit.chosen.class == Some(Class::Flat) {
            return Ok(Self { chart, reason: Reason::OneColor(fit), ..flat });
        }
        let graph = Some(fit.chosen.with_detail(options.detail));
        Ok(Self { graph, chart, reason: Reason::Graph(fit), ..flat })
    }

    /// The material at places of the unfolded box, `[u, v, footprint]` in metres. Roughness and metallic are those of
    /// the estimate, or the graph's where it has none.
    pub(super) fn at(&self, places: &[[f64; 3]], given: GivenMaps) -> Vec<Values> {
        let Some(graph) = &self.graph else { return vec![self.values; places.len()] };
        let of_outputs = |[red, green, blue, roughness, metallic]: [f64; 5]| {
            let [.., median_roughness, median_metallic] = self.values;
            let color = [red, green, blue].map(|v| v.clamp(0.0, 1.0) as f32);
            let roughness = if given.roughness { median_roughness } else { roughness.clamp(0.0, 1.0) as f32 };
            let metallic = if given.metallic { median_metallic } else { metallic.clamp(0.0, 1.0) as f32 };
            [color[0], color[1], color[2], roughness, metallic]
        };
        graph.evaluate(places).into_iter().map(of_outputs).collect()
    }

    /// The fit; none for a part that is hardly seen.
    pub(super) fn fit(&self) -> Option<&Fit> {
        match &self.reason {
            Reason::OneColor(fit) | Reason::Graph(fit) => Some(fit),
            Reason::Unseen | Reason::FewSamples => None,
        }
    }
}
