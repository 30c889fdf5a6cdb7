//! The input picture itself as base colour, with its light and shadow.

use mateval_image::LinearRgb;
use mateval_scene::Finding;

use super::finding::warning;
use super::looks::Look;
use super::statistics::Pairs;

/// Fewest pixels that allow a judgement.
const FEWEST: f64 = 400.0;
/// The least standard deviation, of logarithms, of the picture's brightness within instances.
const LEAST_SHADING: f64 = 0.15;
/// The correlation from which the base colour is the picture itself: at most a tenth of the picture's variance is left
/// to light. A picture of 64x48 pixels, blurred by resampling to atlases, reaches 0.97; the truth 0.3 to 0.4.
const LEAST_CORRELATION: f64 = 0.95;
const DARKEST: f64 = 1e-3;

/// A finding where, within instances, the base colour varies in brightness as the picture does.
pub(super) fn check(place: &str, looks: &[Look]) -> Option<Finding> {
    let pair = |look: &Look| {
        let [base, photo] = [LinearRgb(look.own()).luminance(), LinearRgb(look.photo?).luminance()];
        // Pictures are clipped at white.
        (photo > DARKEST && base > DARKEST && base < 0.98).then(|| (look.instance, base.ln(), photo.ln()))
    };
    let pairs = Pairs::within(looks.iter().filter_map(pair));
    let ([_, photo], correlation) = (pairs.deviations(), pairs.correlation());
    if pairs.count() < FEWEST || photo < LEAST_SHADING || correlation < LEAST_CORRELATION {
        return None;
    }
    let message = format!(
        "base colours are the input picture with its light and shadow (correlation {correlation:.3} within instances, \
         over {:.0} pixels)",
        pairs.count()
    );
    Some(warning("shading_baked_in", place, message, "remove the light: base colour belongs to the material alone"))
}
