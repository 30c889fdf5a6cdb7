//! The part of a protocol that the code holds: constants that move numbers and that no protocol can change.
//!
//! Each value is taken from the constant that the code uses, so that what a result publishes cannot differ from what was
//! computed. Constants of published definitions are not listed: sRGB's curve, Rec. 709's luminance, the weights and layers
//! of LPIPS' network (whose hash is in the result). Nor are those of the path tracer, which estimates an integral that does
//! not depend on them.

use mateval_light::light_fit;
use mateval_metrics::{Psnr, lpips, noise_free, ssim};
use mateval_scene::submission::MAP_SIZES;
use mateval_submission::{bad_texels, default_map, map_file, memory_budget, reach, texel_map};
use mateval_tracer::noise_filter;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::companions::COMPANION_SCALES;
use crate::control_variate;
use crate::metric::LPIPS_NET;
use crate::shown_render;

/// Constants that all protocols share and none can change, because code, format or a published definition fixes them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FixedRules {
    /// Number of places, in a regular square, whose mean is a pixel of a map. The dataset's pictures are made with them.
    pub subpixels: usize,
    /// Number of these places that are looked at first; where they agree, their mean is the pixel.
    pub coarse_subpixels: usize,
    /// The largest difference between values of such places that agree.
    pub flat_range: f32,
    /// Surfaces of lower opacity are looked through in those pictures, as in the dataset's.
    pub cut_out_below_opacity: f32,
    /// Value that replaces a missing or unsound base colour, linear. The format promises it to methods that leave maps out.
    pub missing_base_color: f32,
    /// Value that replaces a missing or unsound roughness, as the format promises.
    pub missing_roughness: f32,
    /// Value that replaces a missing or unsound metallic, as the format promises.
    pub missing_metallic: f32,
    /// A texel of a base colour with a value outside this range is bad, by the format.
    pub base_color_range: [f32; 2],
    /// A texel of a roughness or metallic with a value outside this range is bad, by the format.
    pub scalar_range: [f32; 2],
    /// A map of whose reached texels a larger share than this is bad is unsound, by the format.
    pub most_bad_share: f64,
    /// How much further than one texel from the surface a reached texel may lie, in texels, for uv of up to 1.
    pub reach_margin: f64,
    /// The smallest and the largest side of a map, in texels, by the format.
    pub map_sides: [usize; 2],
    /// A map whose file is larger than this, in bytes, is unsound, by the format.
    pub most_map_bytes: u64,
    /// An EXR map of more numbers than this is unsound, by the format.
    pub most_exr_numbers: usize,
    /// Maps of a scene that take more memory than this together, in bytes, are unsound, by the format.
    pub most_scene_bytes: usize,
    /// `specular` of predictions, which submissions do not hold.
    pub predicted_specular: f32,
    /// The largest PSNR, in dB, which an MSE of 1e-10 or less has. Results of all protocols are shown in one table.
    pub psnr_cap_db: f64,
    /// The PSNR of light is of at least this number of standard errors of its MSE: one-sided 95 %.
    pub lower_bound_standard_errors: f64,
    /// Width and height of the window of SSIM, in pixels, by its definition.
    pub ssim_window: usize,
    /// Standard deviation of that window, in pixels, by the definition of SSIM.
    pub ssim_sigma: f64,
    /// K1 in the definition of SSIM.
    pub ssim_k1: f64,
    /// K2 in the definition of SSIM.
    pub ssim_k2: f64,
    /// The network of LPIPS. A key of a result names it, so that another network would be another metric.
    pub lpips_net: String,
    /// Subtracted from the channels of a picture in -1..1, by the definition of LPIPS.
    pub lpips_shift: [f32; 3],
    /// Divides the channels of that picture, by the definition of LPIPS.
    pub lpips_scale: [f32; 3],
    /// Added to the length of a feature vector, by the definition of LPIPS.
    pub lpips_epsilon: f64,
    /// How far in front of a texel another surface may lie without hiding it, in roundings of the largest coordinate.
    pub observed_roundings: f64,
    /// The least cosine between ray and surface in that comparison.
    pub observed_least_cosine: f64,
    /// Mean complementarity at which the fit ends.
    pub fit_tolerance: f64,
    /// The largest number of steps of the fit.
    pub fit_most_steps: u32,
    /// Share of the way to the nearest bound that a step of the fit covers.
    pub fit_step_share: f64,
    /// Fitted radiances below this, relative to the target's mean, may become 0.
    pub fit_zero_below: f64,
    /// The number of passes of the filter that removes noise from what SSIM and LPIPS compare.
    pub shown_passes: u32,
    /// The difference between pixels at which that filter counts them a quarter, in standard deviations of the noise.
    pub shown_deviations: f32,
    /// The least cosine between the normals of pixels that it averages.
    pub shown_least_cosine: f32,
    /// The least base colour that it divides light by.
    pub shown_least_base_color: f32,
    /// The largest ratio of base colours by which the truth's picture is multiplied before the rest is filtered.
    pub shown_most_ratio: f32,
    /// The factors of the companions' base colours.
    pub companion_scales: Vec<f32>,
    /// The largest ratio of a prediction's base colour to the truth's by which companions are multiplied.
    pub companion_most_ratio: f32,
    /// The smallest base colour of the truth that a prediction's is divided by.
    pub companion_least_base_color: f32,
    /// Share of the trace that is added to the diagonal of the normal equations of the companions' coefficients.
    pub companion_ridge: f64,
    /// The range of exposed values whose slope of the sRGB curve weighs a pixel in these equations.
    pub companion_weighed_range: [f64; 2],
}

impl FixedRules {
    /// The constants of this code.
    pub fn of_this_scorer() -> Self {
        let range = |range: std::ops::RangeInclusive<f32>| [*range.start(), *range.end()];
        Self {
            subpixels: mateval_tracer::aov::SUBPIXELS,
            coarse_subpixels: mateval_tracer::aov::COARSE_SUBPIXELS,
            flat_range: mateval_tracer::aov::FLAT_RANGE,
            cut_out_below_opacity: mateval_scene::material::CUT_OUT_BELOW_OPACITY,
            missing_base_color: mateval_scene::submission::GREY,
            missing_roughness: default_map::MISSING_ROUGHNESS,
            missing_metallic: default_map::MISSING_METALLIC,
            base_color_range: range(bad_texels::BASE_COLOR_RANGE),
            scalar_range: range(bad_texels::SCALAR_RANGE),
            most_bad_share: bad_texels::MOST_BAD_SHARE,
            reach_margin: reach::REACH_MARGIN,
            map_sides: [*MAP_SIZES.start(), *MAP_SIZES.end()],
            most_map_bytes: map_file::MAX_MAP_BYTES,
            most_exr_numbers: map_file::MAX_EXR_NUMBERS,
            most_scene_bytes: memory_budget::MAX_SCENE_BYTES,
            predicted_specular: mateval_tracer::repaint::SPECULAR,
            psnr_cap_db: Psnr::CAP_DB,
            lower_bound_standard_errors: noise_free::ONE_SIDED_95,
            ssim_window: ssim::WINDOW,
            ssim_sigma: ssim::SIGMA,
            ssim_k1: ssim::K1,
            ssim_k2: ssim::K2,
            lpips_net: LPIPS_NET.name().to_owned(),
            lpips_shift: lpips::SHIFT,
            lpips_scale: lpips::SCALE,
            lpips_epsilon: lpips::EPSILON,
            observed_roundings: texel_map::SAME_PLACE_ROUNDINGS,
            observed_least_cosine: texel_map::LEAST_COSINE,
            fit_tolerance: light_fit::TOLERANCE,
            fit_most_steps: light_fit::MOST_STEPS,
            fit_step_share: light_fit::STEP_SHARE,
            fit_zero_below: light_fit::ZERO_BELOW,
            shown_passes: noise_filter::PASSES,
            shown_deviations: noise_filter::DEVIATIONS,
            shown_least_cosine: noise_filter::LEAST_COSINE,
            shown_least_base_color: noise_filter::LEAST_BASE_COLOR,
            shown_most_ratio: shown_render::MOST_RATIO,
            companion_scales: COMPANION_SCALES.to_vec(),
            companion_most_ratio: control_variate::MOST_RATIO,
            companion_least_base_color: control_variate::LEAST_BASE_COLOR,
            companion_ridge: control_variate::RIDGE,
            companion_weighed_range: control_variate::WEIGHED_RANGE,
        }
    }

    /// The first constant, by name, in which the two differ, and both of its values as JSON.
    pub fn first_difference(&self, other: &Self) -> Option<(String, [String; 2])> {
        let values = |rules: &Self| serde_json::to_value(rules).expect("numbers and words become JSON");
        let (ours, theirs) = (values(self), values(other));
        let map = ours.as_object().expect("a struct becomes an object");
        let (rule, value) = map.iter().find(|(rule, value)| theirs[rule.as_str()] != **value)?;
        Some((rule.clone(), [value.to_string(), theirs[rule.as_str()].to_string()]))
    }
}
