//! The materials of all parts of a scene: for each a fitted graph, or one colour.
//!
//! Light and colour that is left in an estimate changes slowly, so that a pattern of few wide stripes predicts it well,
//! and so do its neighbours. Only what they do not predict speaks for a pattern.
//!
//! A material continues a pattern. What remains of the estimate, such as a stain, wear or light that was not taken out,
//! changes slowly. This residual at a place that the input view does not show is estimated by the mean of the residuals
//! of the nearest seen points, weighted by their distance (Nadaraya 1964, Watson 1964) and drawn to 0 where none is
//! near.

use std::array::from_fn;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use mateval_dataset::dataset::Instance;
use mateval_dataset::{PartSetId, Progress, Report, word_enum};
use mateval_procedural::fit::candidate::Candidate;
use mateval_procedural::fit::choose::{Fit, Fitter, LEAST_POINTS};
use mateval_procedural::fit::paper::fit_as_paper;
use mateval_procedural::fit::{Point, split};
use mateval_procedural::graph::slots;
use mateval_procedural::library::Class;
use mateval_procedural::unfolding::{Chart, PartFrame};
use mateval_procedural::value::Type;
use rayon::prelude::*;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use serde::Serialize;

use super::part_samples::{PartSamples, Sample};
use crate::error::BaselineError;
use crate::estimate::{Estimate, GivenMaps, Values};
use crate::geometry::{PartTriangles, SceneGeometry, SeenPixels};
use crate::maps::{DEFAULT, Medians, lower_median};

word_enum! {
    /// How a graph is chosen.
    FitMode, a "way to choose graphs":
    /// Orientation and sizes in closed form, acceptance by held-out pixels.
    Best = "best",
    /// In the way of PSDR-Room, for comparison: a grid of turns and scales, then gradient descent
    /// ([`mateval_procedural::fit::paper`] states the differences).
    Paper = "paper",
}

/// How the materials of parts are found and baked.
#[derive(Clone, Debug, PartialEq)]
pub struct ProceduralOptions {
    /// The part set; `None` stands for the parts of the source.
    pub part_set: Option<PartSetId>,
    pub mode: FitMode,
    /// Whether texels that the input view shows hold the estimate, so that graphs fill only the others.
    pub keep_seen: bool,
    /// How much of what is random in a pattern is kept, 0 to 1. Its phase cannot be known: 1 looks most alike, 0 has
    /// the least error.
    pub detail: f64,
    /// A folder of `.mtlx` files that are fitted beside the built-in graphs.
    pub graphs: Option<PathBuf>,
}

impl ProceduralOptions {
    /// Fails unless `detail` is 0 to 1.
    pub fn check(&self) -> Result<(), BaselineError> {
        match self.detail {
            0.0..=1.0 => Ok(()),
            detail => Err(BaselineError::Unusable(format!("the detail is {detail}; expected 0 to 1"))),
        }
    }
}

impl Default for ProceduralOptions {
    fn default() -> Self {
        Self { part_set: None, mode: FitMode::Best, keep_seen: false, detail: 1.0, graphs: None }
    }
}

/// The parts of a scene with what was seen of each and its material.
pub(super) struct SceneMaterials<'a> {
    pub(super) triangles: PartTriangles<'a>,
    pub(super) samples: Vec<PartSamples>,
    pub(super) of_part: Vec<PartMaterial>,
    /// By how much the estimate differs from each part's material; none unless seen texels are kept.
    pub(super) residuals: Option<Vec<Residuals>>,
    /// The maps that the estimate gives.
    pub(super) given: GivenMaps,
}

impl<'a> SceneMaterials<'a> {
    /// Fits all parts, several at once. The same on any number of threads.
    pub(super) fn fitted(
        geometry: &SceneGeometry<'a>,
        estimate: &Estimate,
        seen: &SeenPixels,
        fitter: &Fitter,
        options: &ProceduralOptions,
        progress: Progress<'_>,
    ) -> Result<Self, BaselineError> {
        options.check()?;
        estimate.needs_color(&geometry.scene.id)?;
        let given = estimate.given_maps();
        let set = options.part_set.as_ref();
        let triangles = PartTriangles::read(geometry, set)?;
        let samples_of_parts = PartSamples::of_parts(geometry, set, &triangles, estimate, seen)?;
        let medians = Medians::new(geometry, seen, estimate);
        let done = AtomicUsize::new(0);
        let fitted = |(part, samples): (usize, &PartSamples)| {
            let owner = triangles.owners[part];
            let category = owner.and_then(|owner| category(&geometry.scene.instances[owner]));
            let unseen = owner.map_or(DEFAULT, |owner| medians.of(geometry, owner));
            let material = PartMaterial::fitted(fitter, samples, category, options, given, unseen);
            progress(Report::step("fit of parts", 1 + done.fetch_add(1, Ordering::Relaxed), samples_of_parts.len()));
            material
        };
        let of_part = samples_of_parts.par_iter().enumerate().map(fitted).collect::<Result<Vec<_>, _>>()?;
        let samples = samples_of_parts;
        let residuals = |(samples, material)| Residuals::new(samples, material, given);
        let residuals = options.keep_seen.then(|| samples.iter().zip(&of_part).map(residuals).collect());
        Ok(Self { triangles, samples, of_part, residuals, given })
    }

    /// Whether any part of an instance has a graph.
    pub(super) fn has_graph(&self, instance: usize) -> bool {
        let mut parts = self.triangles.owners.iter().zip(&self.of_part);
        parts.any(|(owner, material)| *owner == Some(instance) && material.graph.is_some())
    }
}

/// An instance's category, or the kind of a piece of the building.
fn category(instance: &Instance) -> Option<&str> {
    instance.category.as_deref().or(instance.role.architecture_kind())
}

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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Reason {
    /// No pixel shows it: it has the colour of its instance, or of its category.
    Unseen,
    /// Too few pixels of one side show it: it has the median of its pixels.
    FewPixels,
    /// No graph is better than one colour: it has the median of its pixels.
    OneColor,
    Graph,
}

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
    /// None for a part that too few pixels show.
    pub(super) fit: Option<Fit>,
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
        let values = if pixels == 0 { unseen } else { lower_median(&mut part.shown.clone()) };
        let values = completed(values, given);
        let (frame, reason) = (part.frame, Reason::Unseen);
        let flat = Self { values, graph: None, chart: None, frame, reason, fit: None, pixels };
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
            return Ok(Self { chart, reason: Reason::OneColor, fit: Some(fit), ..flat });
        };
        let graph = Some(with_median_of(graph, &points));
        Ok(Self { graph, chart, reason: Reason::Graph, fit: Some(fit), ..flat })
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

/// The number of neighbours whose mean is the prediction.
const PREDICTORS: usize = 16;

/// The most held-out points that are predicted.
const MOST_POINTS: usize = 1024;

/// The mean square of the differences between held-out points and the mean of the points nearest to them that are not
/// held out; absent if there are none of either.
fn interpolation_error(points: &[Point]) -> Option<f64> {
    let (seen, held_out) = split(points);
    if seen.is_empty() || held_out.is_empty() {
        return None;
    }
    let tree = RTree::bulk_load(seen.iter().map(|point| GeomWithData::new([point.u, point.v], point.albedo)).collect());
    let judged = &held_out[..held_out.len().min(MOST_POINTS)];
    let square = |point: &Point| {
        let nearest = tree.nearest_neighbor_iter(&[point.u, point.v]).take(PREDICTORS);
        let (sum, count) = nearest.fold(([0.0; 3], 0.0), |(sum, count), near| {
            (std::array::from_fn(|channel| sum[channel] + near.data[channel]), count + 1.0)
        });
        let of_channel = |channel: usize| (sum[channel] / count - point.albedo[channel]).powi(2);
        (0..3).map(of_channel).sum::<f64>() / 3.0
    };
    Some(judged.iter().map(square).sum::<f64>() / judged.len() as f64)
}

/// The number of points that are averaged.
const NEIGHBOURS: usize = 32;

/// The distance, in metres, at which a point has a quarter of its weight.
const REACH_METRES: f64 = 0.15;

/// The weight of a residual of 0, in points of full weight.
const PRIOR: f64 = 0.1;

/// A point with the difference of base colours, estimate less material, linear.
type Residual = GeomWithData<[f32; 3], [f32; 3]>;

/// The residuals at the points of a part.
pub(super) struct Residuals(RTree<Residual>);

impl Residuals {
    /// The residuals at all samples of a part.
    pub(super) fn new(part: &PartSamples, material: &PartMaterial, given: GivenMaps) -> Self {
        let shown = material.at(&part.places(), given);
        let point = |(sample, shown): (&Sample, Values)| {
            let difference = std::array::from_fn(|channel| sample.values[channel] - shown[channel]);
            GeomWithData::new(sample.position.as_vec3().to_array(), difference)
        };
        Self(RTree::bulk_load(part.samples.iter().zip(shown).map(point).collect()))
    }

    /// The residual to be expected at a place in world space.
    pub(super) fn at(&self, place: DVec3) -> [f32; 3] {
        let (mut sum, mut total) = ([0.0_f64; 3], PRIOR);
        let nearest = self.0.nearest_neighbor_iter_with_distance_2(&place.as_vec3().to_array());
        for (point, distance_2) in nearest.take(NEIGHBOURS) {
            let weight = (1.0 + f64::from(distance_2) / REACH_METRES.powi(2)).powi(-2);
            sum.iter_mut().zip(point.data).for_each(|(sum, value)| *sum += weight * f64::from(value));
            total += weight;
        }
        sum.map(|sum| (sum / total) as f32)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use mateval_procedural::Settings;
    use mateval_procedural::library::entry;
    use mateval_procedural::noise::cell;

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

    fn error(color: impl Fn(f64, f64) -> f64) -> f64 {
        let point = |at: u32| {
            let [u, v] = [0.5, 1.5].map(|row| 2.0 * cell(f64::from(at) + 0.5, row));
            Point { u, v, footprint: 0.01, albedo: [color(u, v); 3], weight: 1.0 }
        };
        interpolation_error(&(0..4096).map(point).collect::<Vec<_>>()).unwrap()
    }

    /// Slow changes are predicted, and fine stripes are not.
    #[test]
    fn neighbours_predict_what_changes_slowly() {
        let slow = error(|u, _| 0.5 + 0.2 * (1.5 * u).sin());
        let stripes = error(|u, _| if (u / 0.1).fract() < 0.5 { 0.7 } else { 0.3 });
        assert!(slow < 1e-3 && stripes > 0.02, "{slow} {stripes}");
        assert_eq!(interpolation_error(&[]), None);
    }

    /// Near seen points the residual is theirs, far away it is 0.
    #[test]
    fn residuals_fade() {
        let point =
            |at: u16| GeomWithData::new([f32::from(at % 16) * 0.01, f32::from(at / 16) * 0.01, 0.0], [0.1, -0.2, 0.0]);
        let residuals = Residuals(RTree::bulk_load((0..256).map(point).collect()));
        let near = residuals.at(DVec3::new(0.08, 0.08, 0.0));
        assert!((near[0] - 0.1).abs() < 0.002 && (near[1] + 0.2).abs() < 0.003 && near[2] == 0.0, "{near:?}");
        let [closer, farther] = [0.5, 5.0].map(|x| residuals.at(DVec3::new(x, 0.0, 0.0))[0]);
        assert!(near[0] > closer && closer > 0.05 && farther < 0.005, "{closer} {farther}");
        assert_eq!(Residuals(RTree::new()).at(DVec3::ZERO), [0.0; 3]);
    }
}
