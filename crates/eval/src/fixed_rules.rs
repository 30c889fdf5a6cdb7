//! The part of a protocol that the code holds: constants that move numbers and that no protocol can change.
//!
//! Each value is taken from the constant that the code uses, so that what a result publishes cannot differ from what was
//! computed. Constants of published definitions are not listed: sRGB's curve, Rec. 709's luminance, the weights and layers
//! of LPIPS' network (whose hash is in the result). Nor are constants of the path tracer that decide only which of many equal
//! estimates of an integral a seed stands for; the scorer's version rises with them.

use mateval_light::light_fit;
use mateval_metrics::{Psnr, flip, lpips, ssim};
use mateval_scene::submission::MAP_SIZES;
use mateval_submission::{bad_texels, default_map, map_file, memory_budget, reach, texel_map};
use mateval_tracer::emitter::{self, group_shares};
use mateval_tracer::{noise_filter, world};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::light::difference::{DIFFERENCE, DifferenceRules};
use crate::light::error::ONE_SIDED_95;
use crate::metric::{HALF_A_BYTE, LPIPS_NET};

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
    /// The weights of that filter along a row or column, by distance.
    pub shown_kernel: [f32; 4],
    /// The smallest share of the light samples that a light group gets.
    pub least_group_share: f64,
    /// The share of the light samples that is drawn without regard to distance.
    pub uniform_light_share: f32,
    /// The number of places along each side of the input view by which the shares of groups are set.
    pub group_probes: u32,
    /// The constants of the difference of light.
    pub difference: DifferenceRules,
    /// A difference of roughness or metallic of at most this counts as none.
    pub scalar_tolerance: f32,
    /// Pixels a degree at which FLIP looks at pictures.
    pub flip_pixels_per_degree: f64,
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
            lower_bound_standard_errors: ONE_SIDED_95,
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
            shown_kernel: noise_filter::KERNEL,
            least_group_share: group_shares::LEAST_SHARE,
            uniform_light_share: emitter::UNIFORM_SHARE,
            group_probes: world::PROBES,
            difference: DIFFERENCE,
            scalar_tolerance: HALF_A_BYTE,
            flip_pixels_per_degree: flip::PIXELS_PER_DEGREE,
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
