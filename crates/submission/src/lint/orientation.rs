//! Atlases that are flipped or turned: v counted from the wrong end, left and right exchanged.
//!
//! Within an instance and a small neighbourhood of the picture, light hardly changes: a brighter pixel shows a brighter
//! material. So the base colour correlates with the picture where it lies right and does not where it was turned.
//! Turning it back must then restore the correlation.

use mateval_image::LinearRgb;
use mateval_scene::Finding;

use super::finding::warning;
use super::looks::{Look, Turn};
use super::statistics::Pairs;

/// Fewest pixels that allow a judgement.
const FEWEST: f64 = 400.0;
/// The least correlation of the base colour, turned back, with the picture.
const LEAST_CORRELATION: f64 = 0.35;
/// How much larger that must be than the correlation of the base colour as it is.
const LEAST_GAIN: f64 = 0.25;
/// Darker values hold more noise than material.
const DARKEST: f64 = 1e-3;

/// A finding where another turn explains the picture clearly better.
pub(super) fn check(place: &str, looks: &[Look]) -> Option<Finding> {
    let own = detail(looks, 0);
    let (turn, best) = (1..Turn::ALL.len())
        .map(|at| (Turn::ALL[at], detail(looks, at)))
        .max_by(|a, b| a.1.correlation().total_cmp(&b.1.correlation()))?;
    let (now, then) = (own.correlation(), best.correlation());
    if own.count() < FEWEST || then < LEAST_CORRELATION || then - now < LEAST_GAIN {
        return None;
    }
    let (code, what, action) = match turn {
        Turn::None => return None,
        Turn::Vertical => {
            ("flipped_vertically", "upside down", "write row 0 of a texture at v = 0 of instances.glb: the top")
        }
        Turn::Horizontal => ("flipped_horizontally", "left and right exchanged", "write column 0 at u = 0"),
        Turn::Half => ("turned_half", "turned by half a turn", "write column 0 at u = 0, row 0 at v = 0: the top left"),
        Turn::Transposed => ("transposed", "rows and columns exchanged", "write u along rows, v along columns"),
    };
    let message = format!(
        "base colours seem {what}: turned back, their detail correlates with the input picture's by {then:.2}, as they are by \
         {now:.2} (over {:.0} pixels)",
        own.count()
    );
    Some(warning(code, place, message, action))
}

/// Brightness of the base colour and of the picture, within instances and neighbourhoods.
fn detail(looks: &[Look], turn: usize) -> Pairs {
    let pair = |look: &Look| {
        let [base, photo] = [LinearRgb(look.base_color[turn]).luminance(), LinearRgb(look.photo?).luminance()];
        (photo > DARKEST).then(|| ((look.instance, look.tile), base.max(DARKEST).ln(), photo.ln()))
    };
    Pairs::within(looks.iter().filter_map(pair))
}
