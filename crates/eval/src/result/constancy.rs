//! The constancy of a result: how far a submission's answers to a scene and its twins lie apart, and the means over
//! scenes that tables and boards show.

use mateval_dataset::SceneId;
use mateval_dataset::lighting::LightingName;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::metric::HALF_A_BYTE;

/// The constancy of a submission's base colours in one family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Constancy {
    /// The scene that the family shows.
    pub scene: SceneId,
    /// The lightings of its twins.
    pub lightings: Vec<LightingName>,
    /// The area of the texels that the input view shows, in square metres.
    pub area_m2: f64,
    /// Of the base colours as they are.
    pub raw: Deviation,
    /// Of the base colours of each scene and twin after one scale a channel, which brings their mean to that of the
    /// family.
    pub aligned: Deviation,
    /// The mean squared error of the family's mean of raw base colours, linear, mean over channels.
    pub mean_mse: f64,
    /// The mean CIEDE2000 difference of the family's mean of raw base colours from the truth.
    pub mean_delta_e: f64,
}

/// How far the answers to a family lie from their mean. Root mean squares over texels, by area, and over the family.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Deviation {
    /// Linear, also over channels.
    pub linear: f64,
    /// In CIEDE2000, of colours clipped to 0..1.
    pub delta_e: f64,
    /// Of the luminance.
    pub luminance: PartSpread,
    /// Of what remains of a colour without its luminance, also over channels.
    pub chroma: PartSpread,
    /// The deviations of luminance and of chroma, each divided by its contrast: their root mean square. Null where one
    /// of both contrasts is at most 0.505/255, which counts as none.
    pub relative: Option<f64>,
}

/// Of one part of the colours, linear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartSpread {
    /// How far the answers to a family lie from their mean.
    pub deviation: f64,
    /// How far the texels of the family's mean lie from the mean of all its texels.
    pub contrast: f64,
}

impl Deviation {
    /// The value of [`Self::relative`].
    pub(crate) fn guarded(&self) -> Option<f64> {
        let has_contrast = [self.luminance, self.chroma].iter().all(|part| part.contrast > f64::from(HALF_A_BYTE));
        let square = |part: PartSpread| (part.deviation / part.contrast).powi(2);
        has_contrast.then(|| ((square(self.luminance) + square(self.chroma)) / 2.0).sqrt())
    }
}

/// The means of a submission over its families.
#[derive(Clone, Debug, PartialEq)]
pub struct ConstancyMeans {
    pub families: usize,
    /// The number of families in which [`Self::relative`] has a value.
    pub with_contrast: usize,
    /// Root mean square of linear deviations: raw, then aligned.
    pub linear: [f64; 2],
    /// Root mean square in CIEDE2000: raw, then aligned.
    pub delta_e: [f64; 2],
    /// Raw, then aligned; the mean over the families that have a value.
    pub relative: [Option<f64>; 2],
    /// PSNR in dB of the families' means: the mean over families.
    pub mean_psnr: f64,
    pub mean_delta_e: f64,
}

impl ConstancyMeans {
    /// Absent where there is no family.
    pub fn of(families: &[Constancy]) -> Option<Self> {
        let count = families.len();
        let mean = |value: &dyn Fn(&Constancy) -> f64| families.iter().map(value).sum::<f64>() / count as f64;
        let both = |value: fn(&Deviation) -> f64| [mean(&|f| value(&f.raw)), mean(&|f| value(&f.aligned))];
        let relative = [|f: &Constancy| f.raw.relative, |f: &Constancy| f.aligned.relative].map(|of| {
            let known: Vec<f64> = families.iter().filter_map(of).collect();
            (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
        });
        let psnr = |f: &Constancy| mateval_metrics::Psnr::from_mse(f.mean_mse).map_or(0.0, |psnr| psnr.db);
        (count > 0).then(|| Self {
            families: count,
            with_contrast: families.iter().filter(|family| family.raw.relative.is_some()).count(),
            linear: both(|deviation| deviation.linear),
            delta_e: both(|deviation| deviation.delta_e),
            relative,
            mean_psnr: mean(&psnr),
            mean_delta_e: mean(&|family| family.mean_delta_e),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_over_families_skip_what_has_no_value() {
        let family = |relative, mse| Constancy {
            scene: SceneId::new("s").unwrap(),
            lightings: vec![LightingName::WarmCool],
            area_m2: 1.0,
            raw: Deviation { linear: 0.2, relative, ..Deviation::default() },
            aligned: Deviation { linear: 0.1, ..Deviation::default() },
            mean_mse: mse,
            mean_delta_e: 3.0,
        };
        let found = ConstancyMeans::of(&[family(Some(0.5), 0.1), family(None, 0.001)]).unwrap();
        assert_eq!((found.families, found.with_contrast), (2, 1));
        assert_eq!((found.relative, found.linear), ([Some(0.5), None], [0.2, 0.1]));
        assert!((found.mean_psnr - 20.0).abs() < 1e-12);
        assert_eq!(ConstancyMeans::of(&[]), None);
    }
}
