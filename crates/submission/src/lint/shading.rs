//! The input picture itself as base colour, with its light and shadow.

use mateval_image::LinearRgb;
use mateval_scene::Finding;

use super::finding::warning;
use super::looks::Look;
use super::statistics::Pairs;

/// Fewest pixels that say anything.
const FEWEST: f64 = 400.0;
/// How much the picture's brightness must differ within instances, as a standard deviation of logarithms.
const LEAST_SHADING: f64 = 0.15;
/// From this correlation on nothing but the picture is in the base colour: at most a tenth of the picture's variance is left
/// for light. A picture of 64x48 pixels, blurred by its way through atlases, has 0.97; the truth has 0.3 to 0.4 there.
const LEAST_CORRELATION: f64 = 0.95;
const DARKEST: f64 = 1e-3;

/// A finding where, within instances, the base colour is as bright as the picture is.
pub(super) fn check(place: &str, looks: &[Look]) -> Option<Finding> {
    let pair = |look: &Look| {
        let [base, photo] = [LinearRgb(look.own()).luminance(), LinearRgb(look.photo?).luminance()];
        // White is where a picture was clipped.
        (photo > DARKEST && base > DARKEST && base < 0.98).then(|| (look.instance, base.ln(), photo.ln()))
    };
    let pairs = Pairs::within(looks.iter().filter_map(pair));
    let ([_, photo], correlation) = (pairs.deviations(), pairs.correlation());
    if pairs.count() < FEWEST || photo < LEAST_SHADING || correlation < LEAST_CORRELATION {
        return None;
    }
    let message = format!(
        "base colours are the input picture, light and shadow and all (correlation {correlation:.3} within instances, \
         over {:.0} pixels)",
        pairs.count()
    );
    Some(warning("shading_baked_in", place, message, "take the light out: base colour is the material's alone"))
}
