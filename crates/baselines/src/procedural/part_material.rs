//! The material of a part: a fitted graph, or one colour.

use std::array::from_fn;

use mateval_procedural::fit::candidate::Candidate;
use mateval_procedural::fit::choose::{Fit, Fitter, LEAST_POINTS};
use mateval_procedural::fit::paper::fit_as_paper;
use mateval_procedural::fit::points::Point;
use mateval_procedural::graph::slots;
use mateval_procedural::library::Class;
use mateval_procedural::value::Type;

use super::interpolation::interpolation_error;
use super::options::{FitMode, ProceduralOptions};
use super::part_frame::{Chart, PartFrame};
use super::part_samples::PartSamples;
use crate::error::BaselineError;
use crate::estimate::{GivenMaps, Values};
use crate::median::{DEFAULT, median};

/// The most samples of a part that are looked at.
const MOST_SAMPLES: usize = 8192;

/// The largest error of a graph that predicts a pattern, as a share of the error of one colour.
const MOST_RELATIVE_ERROR: f64 = 0.98;

/// The least difference of these errors: storing colours as bytes changes them by as much.
const LEAST_GAIN: f64 = 2e-6;

/// By how much a graph's error must be lower for each number that it has more than another.
const RELATIVE_PRICE_PER_NUMBER: f64 = 0.002;

/// The standard deviation, relative to the mean colour, below which a pattern cannot be distinguished from leftover
/// light.
const LEAST_OF_PATTERN: f64 = 0.05;

/// The same for colours without a pattern: above it they are a texture and not noise.
const LEAST_OF_TEXTURE: f64 = 0.1;

/// What decided on a part's material.
#[derive(Clone, Debug)]
pub(super) enum Reason {
    /// No pixel shows it: it has the colour of its instance, or of its category.
    Unseen,
    /// Too few pixels of one side show it: it has the median of its pixels.
    FewPixels,
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
        given: GivenMaps,
        unseen: Values,
    ) -> Result<Self, BaselineError> {
        let pixels = part.shown.len();
        let values = if pixels == 0 { unseen } else { median(&mut part.shown.clone()) };
        let values = completed(values, given);
        let flat = Self { values, graph: None, chart: None, frame: part.frame, reason: Reason::Unseen, pixels };
        if pixels == 0 {
            return Ok(flat);
        }
        let (chart, samples) = part.of_main_chart().unzip();
        let points = samples.into_iter().flatten().map(|sample| sample.point).filter(Point::is_sound);
        let points: Vec<Point> = points.take(MOST_SAMPLES).collect();
        if points.len() < LEAST_POINTS {
            return Ok(Self { chart, reason: Reason::FewPixels, ..flat });
        }
        let fit = match options.mode {
            FitMode::Best => fitter.fit(&points, category)?,
            FitMode::Paper => fit_as_paper(fitter, &points)?,
        };
        let accepted = match options.mode {
            FitMode::Best => accepted(&fit, interpolation_error(&points), flat.values),
            FitMode::Paper => Some(&fit.chosen).filter(|chosen| !is_flat(chosen)),
        };
        let Some(graph) = accepted.map(|accepted| accepted.with_detail(options.detail)) else {
            return Ok(Self { chart, reason: Reason::OneColor(fit), ..flat });
        };
        Ok(Self { graph: Some(with_median_of(graph, &points)), chart, reason: Reason::Graph(fit), ..flat })
    }

    /// The material at places of the unfolded box, `[u, v, footprint]` in metres. Roughness and metallic are those of
    /// the estimate, or the graph's where it has none.
    pub(super) fn at(&self, places: &[[f64; 3]], given: GivenMaps) -> Vec<Values> {
        let Some(graph) = &self.graph else { return vec![self.values; places.len()] };
        let of_outputs = |outputs: [f64; 5]| {
            // A user's graph may divide by zero.
            if outputs.iter().any(|output| !output.is_finite()) {
                return self.values;
            }
            let [red, green, blue, roughness, metallic] = outputs;
            let [.., median_roughness, median_metallic] = self.values;
            let color = [red, green, blue].map(|v| v.clamp(0.0, 1.0) as f32);
            let roughness = if given.roughness { median_roughness } else { roughness.clamp(0.0, 1.0) as f32 };
            let metallic = if given.metallic { median_metallic } else { metallic.clamp(0.0, 1.0) as f32 };
            [color[0], color[1], color[2], roughness, metallic]
        };
        graph.evaluate(places).into_iter().map(of_outputs).collect()
    }

    /// The fit; none for a part that too few pixels show.
    pub(super) fn fit(&self) -> Option<&Fit> {
        match &self.reason {
            Reason::OneColor(fit) | Reason::Graph(fit) => Some(fit),
            Reason::Unseen | Reason::FewPixels => None,
        }
    }
}

/// The graph of a fit that a room's part gets; none for one colour.
///
/// An estimate of a room is blurred and has light and noise left in it, whose statistics look like those of a texture.
/// So pixels decide: the graph that predicts held-out ones best, if it does so better than one colour and than the
/// pixels around them. Only where no graph does, and the estimate varies so much that it is no noise, the fit's own
/// choice is taken, whose randomness has the look of what is seen.
fn accepted(fit: &Fit, of_neighbours: Option<f64>, values: Values) -> Option<&Candidate> {
    let all = || std::iter::once(&fit.chosen).chain(&fit.others);
    let of_one_color = all().find(|found| is_flat(found))?.error;
    let mean = values[..3].iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0;
    let deviation = of_one_color.sqrt() / mean.max(f64::MIN_POSITIVE);
    if deviation < LEAST_OF_PATTERN {
        return None;
    }
    let of_others = of_neighbours.unwrap_or(of_one_color).min(of_one_color);
    let most = (MOST_RELATIVE_ERROR * of_others).min(of_others - LEAST_GAIN);
    let predicts = |found: &&Candidate| found.error < most;
    if let Some(best) = all().filter(predicts).min_by(|a, b| priced(a).total_cmp(&priced(b))) {
        return Some(best);
    }
    Some(&fit.chosen).filter(|chosen| deviation > LEAST_OF_TEXTURE && !is_flat(chosen))
}

/// The graph with its colours multiplied by the median ratio of points and graph, from a half to 2: a fit has the mean
/// of the points, which outliers move. All colours of a graph enter linearly.
fn with_median_of(mut graph: Candidate, points: &[Point]) -> Candidate {
    let places: Vec<[f64; 3]> = points.iter().map(|point| [point.u, point.v, point.footprint]).collect();
    let shown = graph.evaluate(&places);
    let gains: [f64; 3] = from_fn(|c| {
        let ratios = points.iter().zip(&shown).map(|(point, outputs)| point.albedo[c] / outputs[c]);
        let mut ratios: Vec<f64> = ratios.filter(|ratio| ratio.is_finite()).collect();
        ratios.sort_by(f64::total_cmp);
        ratios.get(ratios.len() / 2).map_or(1.0, |ratio| ratio.clamp(0.5, 2.0))
    });
    for (at, slot) in slots(&graph.graph).iter().enumerate() {
        if graph.graph.parameters[slot.parameter].value.kind() == Type::Color3 {
            let number = graph.settings.number_mut(at);
            *number = (*number * gains[slot.component]).clamp(0.0, 1.0);
        }
    }
    graph
}

/// The error, plus a small price for each number of the settings.
fn priced(found: &Candidate) -> f64 {
    found.error * (1.0 + RELATIVE_PRICE_PER_NUMBER * found.settings.numbers().len() as f64)
}

/// The values with the format's defaults for maps that the estimate lacks.
pub(super) fn completed(values: Values, given: GivenMaps) -> Values {
    let [red, green, blue, roughness, metallic] = values;
    let roughness = if given.roughness { roughness } else { DEFAULT[3] };
    let metallic = if given.metallic { metallic } else { DEFAULT[4] };
    [red, green, blue, roughness, metallic]
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
        accepted(&fit, None, [grey, grey, grey, 0.5, 0.0]).map(|found| found.graph.name.clone())
    }

    #[test]
    fn colours_get_the_median_of_the_points() {
        let checks = candidate("checks", 0.0);
        let place = |at: u32| [0.017 * f64::from(at % 50), 0.023 * f64::from(at / 50), 0.001];
        let places: Vec<[f64; 3]> = (0..1000).map(place).collect();
        let shown = checks.evaluate(&places);
        let point = |(&[u, v, footprint], outputs): (&[f64; 3], &[f64; 5])| {
            let albedo = [0.8 * outputs[0], outputs[1], 1.1 * outputs[2]];
            Point { u, v, footprint, albedo, weight: 1.0 }
        };
        let points: Vec<Point> = places.iter().zip(&shown).map(point).collect();
        let scaled = with_median_of(checks, &points).evaluate(&places);
        for (point, outputs) in points.iter().zip(&scaled) {
            assert!(point.albedo.iter().zip(outputs).all(|(a, b)| (a - b).abs() < 1e-9), "{point:?} {outputs:?}");
        }
    }

    #[test]
    fn what_neighbours_predict_is_no_pattern() {
        let others = vec![candidate("paint", 3.0e-4)];
        let fit = Fit { chosen: candidate("stripes", 2.0e-4), others };
        let is_taken = |of_neighbours| accepted(&fit, Some(of_neighbours), [0.2, 0.2, 0.2, 0.5, 0.0]).is_some();
        assert_eq!([is_taken(1.5e-4), is_taken(2.5e-4)], [false, true]);
    }

    #[test]
    fn pixels_decide_before_statistics() {
        let name = |name: &str| Some(name.to_owned());
        let striped = [("mosaic", 3.0e-4), ("stripes", 2.0e-4), ("paint", 3.0e-4)];
        assert_eq!(chosen(striped, 0.2), name("stripes"));
        // A pattern of less than 5 % of the mean, a gain of 1 %, and one that bytes cannot hold are none.
        assert_eq!(chosen(striped, 0.5), None);
        assert_eq!(chosen([("stripes", 2.97e-4), ("paint", 3.0e-4), ("checks", 3.0e-4)], 0.2), None);
        assert_eq!(chosen([("stripes", 1.0e-6), ("paint", 2.0e-6), ("checks", 2.0e-6)], 0.02), None);
        // What varies much has a texture, what varies little is noise.
        let granite = [("granite", 3.0e-3), ("paint", 3.0e-3), ("carpet", 3.0e-3)];
        assert_eq!([chosen(granite, 0.3), chosen(granite, 0.9)], [name("granite"), None]);
        // Of two that predict the same, the one with fewer numbers is taken.
        assert_eq!(chosen([("stripes", 1.0e-4), ("plaid", 1.0e-4), ("paint", 3.0e-4)], 0.2), name("plaid"));
    }
}
