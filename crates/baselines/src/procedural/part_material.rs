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

/// The error of a graph that predicts a pattern is below this share of that of one colour.
const MOST_ERROR: f64 = 0.98;

/// And it is lower by this at least: storing colours as bytes changes as much.
const LEAST_GAIN: f64 = 2e-6;

/// By how much a graph's error must be lower for each number that it has more than another.
const PRICE: f64 = 0.002;

/// The least standard deviation of what is no noise, relative to the mean colour.
const LEAST_DEVIATION: f64 = 0.1;

/// What decided on a part's material.
#[derive(Clone, Debug)]
pub(super) enum Reason {
    /// No pixel shows it: it has the colour of its instance, or of its category.
    Unseen,
    /// Too few pixels of one side show it: it has the median of its pixels.
    FewSamples,
    /// No graph is better than one colour: it has the median of its pixels.
    OneColor(Fit),
    /// A graph is better.
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
        let accepted = match options.mode {
            FitMode::Best => accepted(&fit, flat.values),
            FitMode::Paper => Some(&fit.chosen).filter(|chosen| !is_flat(chosen)),
        };
        let graph = accepted.map(|accepted| accepted.with_detail(options.detail));
        let reason = if graph.is_some() { Reason::Graph(fit) } else { Reason::OneColor(fit) };
        Ok(Self { graph, chart, reason, ..flat })
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

/// The graph of a fit that a room's part gets; none for one colour.
///
/// An estimate of a room is blurred and has light and noise left in it, whose statistics look like those of a texture.
/// So pixels decide: the graph that predicts held-out ones best, if it does so better than one colour. Only where no
/// graph does, and the estimate varies so much that it is no noise, the fit's own choice is taken, whose randomness has
/// the look of what is seen.
fn accepted(fit: &Fit, values: Values) -> Option<&Candidate> {
    let all = || std::iter::once(&fit.chosen).chain(&fit.others);
    let of_one_color = all().find(|found| is_flat(found))?.error;
    let predicts = |found: &&Candidate| found.error < (MOST_ERROR * of_one_color).min(of_one_color - LEAST_GAIN);
    if let Some(best) = all().filter(predicts).min_by(|a, b| priced(a).total_cmp(&priced(b))) {
        return Some(best);
    }
    let mean = values[..3].iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0;
    let varies = of_one_color.sqrt() > LEAST_DEVIATION * mean;
    Some(&fit.chosen).filter(|chosen| varies && !is_flat(chosen))
}

/// The error, of two graphs that are as good less for the one with fewer numbers.
fn priced(found: &Candidate) -> f64 {
    found.error * (1.0 + PRICE * found.settings.numbers().len() as f64)
}

fn is_flat(found: &Candidate) -> bool {
    found.class == Some(Class::Flat)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use mateval_procedural::Settings;
    use mateval_procedural::library::entry;

    use super::*;

    fn candidate(name: &str, error: f64) -> Candidate {
        let entry = entry(name).unwrap();
        let graph = Arc::new(entry.graph().unwrap());
        let settings = Settings::defaults(&graph);
        Candidate { graph, class: Some(entry.class), settings, error, cells: 0.0, distance: 0.0 }
    }

    fn chosen(all: [(&str, f64); 3], grey: f32) -> Option<String> {
        let [first, others @ ..] = all.map(|(name, error)| candidate(name, error));
        let fit = Fit { chosen: first, others: others.into() };
        accepted(&fit, [grey, grey, grey, 0.5, 0.0]).map(|found| found.graph.name.clone())
    }

    #[test]
    fn pixels_decide_before_statistics() {
        let name = |name: &str| Some(name.to_owned());
        assert_eq!(chosen([("mosaic", 3.0e-4), ("stripes", 2.0e-4), ("paint", 3.0e-4)], 0.5), name("stripes"));
        // A gain of 1 % is none, and neither is one that bytes cannot hold.
        assert_eq!(chosen([("stripes", 2.97e-4), ("paint", 3.0e-4), ("checks", 3.0e-4)], 0.5), None);
        assert_eq!(chosen([("stripes", 1.0e-6), ("paint", 2.0e-6), ("checks", 2.0e-6)], 0.5), None);
        // What varies much has a texture, what varies little is noise.
        let granite = [("granite", 3.0e-3), ("paint", 3.0e-3), ("carpet", 3.0e-3)];
        assert_eq!([chosen(granite, 0.3), chosen(granite, 0.9)], [name("granite"), None]);
        // Of two that predict the same, the one with fewer numbers is taken.
        assert_eq!(chosen([("plaid", 1.0e-4), ("stripes", 1.0e-4), ("paint", 3.0e-4)], 0.5), name("stripes"));
    }
}
