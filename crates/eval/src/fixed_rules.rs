//! The part of a protocol that the code holds: constants that move numbers and that no protocol can change.
//!
//! Each value is taken from the constant that the code uses, so that what a result publishes cannot differ from what
//! was computed. Constants of published definitions are not listed: sRGB's curve, Rec. 709's luminance, the weights and
//! layers of LPIPS' network (whose hash is in the result). Nor are constants of the path tracer that decide only which
//! of many equal estimates of an integral a seed stands for; the scorer's version rises with them.

use mateval_dataset::submission::MAP_SIZES;
use mateval_light::light_fit;
use mateval_metrics::{Psnr, flip, lpips, ssim};
use mateval_submission::{atlas, files, map_file, prediction, texel_map};
use mateval_tracer::emitter::group_shares;
use mateval_tracer::{emitter, noise_filter, world};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::light::difference::{DIFFERENCE, DifferenceRules};
use crate::light::mse::ONE_SIDED_95;
use crate::metric::{HALF_A_BYTE, LPIPS_NET};

/// Defines [`FixedRules`] and its one value: name, type and constant of every rule stand together.
macro_rules! fixed_rules {
    ($($(#[$doc:meta])+ $name:ident: $type:ty = $value:expr,)+) => {
        /// Constants that all protocols share and none can change, because code, format or a published definition fixes
        /// them.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub struct FixedRules {
            $($(#[$doc])+ pub $name: $type,)+
        }

        impl FixedRules {
            /// The constants of this code.
            pub fn of_this_scorer() -> Self {
                Self { $($name: $value,)+ }
            }
        }
    };
}

fixed_rules! {
    /// Number of places, in a regular square, whose mean is a pixel of a map. The dataset's pictures are made with
    /// them.
    subpixels: usize = mateval_tracer::aov::SUBPIXELS,
    /// Number of these places that are looked at first; where they agree, their mean is the pixel.
    coarse_subpixels: usize = mateval_tracer::aov::COARSE_SUBPIXELS,
    /// The largest difference between values of such places that agree.
    flat_range: f32 = mateval_tracer::aov::FLAT_RANGE,
    /// Surfaces of lower opacity are looked through in those pictures, as in the dataset's.
    cut_out_below_opacity: f32 = mateval_dataset::material::CUT_OUT_BELOW_OPACITY,
    /// Value that replaces a missing or unsound base colour, linear. The format promises it to methods that leave maps
    /// out.
    missing_base_color: f32 = mateval_dataset::submission::GREY,
    /// Value that replaces a missing or unsound roughness, as the format promises.
    missing_roughness: f32 = mateval_dataset::submission::MISSING_ROUGHNESS,
    /// Value that replaces a missing or unsound metallic, as the format promises.
    missing_metallic: f32 = mateval_dataset::submission::MISSING_METALLIC,
    /// A texel of a base colour with a value outside this range is bad, by the format.
    base_color_range: [f32; 2] = [*map_file::BASE_COLOR_RANGE.start(), *map_file::BASE_COLOR_RANGE.end()],
    /// A texel of a roughness or metallic with a value outside this range is bad, by the format.
    scalar_range: [f32; 2] = [*map_file::SCALAR_RANGE.start(), *map_file::SCALAR_RANGE.end()],
    /// A map of whose reached texels a larger share than this is bad is unsound, by the format.
    most_bad_share: f64 = map_file::MOST_BAD_SHARE,
    /// How much further than one texel from the surface a reached texel may lie, in texels, for uv of up to 1.
    reach_margin: f64 = atlas::REACH_MARGIN,
    /// The smallest and the largest side of a map, in texels, by the format.
    map_sides: [usize; 2] = [*MAP_SIZES.start(), *MAP_SIZES.end()],
    /// A map whose file is larger than this, in bytes, is unsound, by the format.
    most_map_bytes: u64 = files::MAX_MAP_BYTES,
    /// An EXR map of more numbers than this is unsound, by the format.
    most_exr_numbers: usize = map_file::MAX_EXR_NUMBERS,
    /// Maps of a scene that take more memory than this together, in bytes, are unsound, by the format.
    most_scene_bytes: usize = prediction::MAX_SCENE_BYTES,
    /// `specular` of predictions, which submissions do not hold.
    predicted_specular: f32 = mateval_tracer::repaint::SPECULAR,
    /// The largest PSNR, in dB, which an MSE of 1e-10 or less has. Results of all protocols are shown in one table.
    psnr_cap_db: f64 = Psnr::CAP_DB,
    /// The PSNR of light is of at least this number of standard errors of its MSE: one-sided 95 %.
    lower_bound_standard_errors: f64 = ONE_SIDED_95,
    /// Width and height of the window of SSIM, in pixels, by its definition.
    ssim_window: usize = ssim::WINDOW,
    /// Standard deviation of that window, in pixels, by the definition of SSIM.
    ssim_sigma: f64 = ssim::SIGMA,
    /// K1 in the definition of SSIM.
    ssim_k1: f64 = ssim::K1,
    /// K2 in the definition of SSIM.
    ssim_k2: f64 = ssim::K2,
    /// The network of LPIPS. A key of a result names it, so that another network would be another metric.
    lpips_net: String = LPIPS_NET.name().to_owned(),
    /// Subtracted from the channels of a picture in -1..1, by the definition of LPIPS.
    lpips_shift: [f32; 3] = lpips::SHIFT,
    /// Divides the channels of that picture, by the definition of LPIPS.
    lpips_scale: [f32; 3] = lpips::SCALE,
    /// Added to the length of a feature vector, by the definition of LPIPS.
    lpips_epsilon: f64 = lpips::EPSILON,
    /// How far in front of a texel another surface may lie without hiding it, in roundings of the largest coordinate.
    observed_roundings: f64 = texel_map::SAME_PLACE_ROUNDINGS,
    /// The least cosine between ray and surface in that comparison.
    observed_least_cosine: f64 = texel_map::LEAST_COSINE,
    /// Mean complementarity at which the fit ends.
    fit_tolerance: f64 = light_fit::TOLERANCE,
    /// The largest number of steps of the fit.
    fit_most_steps: u32 = light_fit::MOST_STEPS,
    /// Share of the way to the nearest bound that a step of the fit covers.
    fit_step_share: f64 = light_fit::STEP_SHARE,
    /// Fitted radiances below this, relative to the target's mean, may become 0.
    fit_zero_below: f64 = light_fit::ZERO_BELOW,
    /// The number of passes of the filter that removes noise from the pivot of a difference, and from what SSIM, LPIPS
    /// and FLIP compare.
    filter_passes: u32 = noise_filter::PASSES,
    /// The difference between pixels at which that filter counts them a quarter, in standard deviations of the noise.
    filter_deviations: f32 = noise_filter::DEVIATIONS,
    /// The least cosine between the normals of pixels that it averages.
    filter_least_cosine: f32 = noise_filter::LEAST_COSINE,
    /// The weights of that filter along a row or column, by distance.
    filter_kernel: [f32; 4] = noise_filter::KERNEL,
    /// The smallest share of the light samples that a light group gets.
    least_group_share: f64 = group_shares::LEAST_SHARE,
    /// The share of the light samples that is drawn without regard to distance.
    uniform_light_share: f32 = emitter::UNIFORM_SHARE,
    /// The number of places along each side of the input view by which the shares of groups are set.
    group_probes: u32 = world::PROBES,
    /// The constants of the difference of light.
    difference: DifferenceRules = DIFFERENCE,
    /// A difference of roughness or metallic of at most this counts as none.
    scalar_tolerance: f32 = HALF_A_BYTE,
    /// Pixels a degree at which FLIP looks at pictures.
    flip_pixels_per_degree: f64 = flip::PIXELS_PER_DEGREE,
}

impl FixedRules {
    /// The key, as in `fixed.ssim_k1`, of the first constant, by name, in which the two differ, and both of its values
    /// as JSON.
    pub fn first_difference(&self, other: &Self) -> Option<(String, [String; 2])> {
        let values = |rules: &Self| serde_json::to_value(rules).expect("numbers and words become JSON");
        let (ours, theirs) = (values(self), values(other));
        let map = ours.as_object().expect("a struct becomes an object");
        let (rule, value) = map.iter().find(|(rule, value)| theirs[rule.as_str()] != **value)?;
        Some((format!("fixed.{rule}"), [value.to_string(), theirs[rule.as_str()].to_string()]))
    }
}
