//! A prediction's pictures under one light, compared with a reference.

use mateval_image::{LinearRgb, Picture, SrgbRgb};
use mateval_tracer::ViewsRender;
use mateval_tracer::noise_filter::Surfaces;
use rayon::prelude::*;

use super::difference::{LightDifference, ViewGuide, difference};
use super::lighting::{FittedRadiances, LightingName};
use super::rules::Track;
use crate::error::EvalError;
use crate::mask_rule::ReferenceFeatures;
use crate::truth::ViewTruth;

/// A prediction under one light, compared with the reference.
pub(crate) struct LitPicture<'a> {
    pub(crate) track: Track,
    /// For track `relit`.
    pub(crate) lighting: Option<LightingName>,
    /// What it is compared with, by view.
    pub(crate) references: &'a [EncodedReference],
    /// By view.
    pub(crate) views: Vec<LightDifference>,
    /// For fitted lights, the views under the lights of each of two fits.
    pub(crate) of_fits: Option<[Vec<LightDifference>; 2]>,
    pub(crate) fit: Option<FittedRadiances>,
    /// Contributions of light that were not finite and count as none.
    pub(crate) not_finite: u64,
}

/// A reference picture, within 0..1 and encoded, with what LPIPS compares of it.
pub(crate) struct EncodedReference {
    pub(crate) picture: Picture<SrgbRgb>,
    pub(crate) features: ReferenceFeatures,
}

impl EncodedReference {
    pub(crate) fn new(exposed: &Picture<LinearRgb>) -> Self {
        Self { picture: exposed.to_srgb(), features: ReferenceFeatures::default() }
    }
}

/// Passes a prediction's picture on, with its number.
pub(crate) type Each<'a> = dyn FnMut(usize, LitPicture<'_>) -> Result<(), EvalError> + 'a;

/// A picture of one view of a render of one seed.
pub(crate) fn picture_of(render: &ViewsRender, view: usize, picture: usize) -> &Picture<LinearRgb> {
    &render.views[view].halves[0].basis.pictures()[picture]
}

/// What is known of each view of a prediction in one lighting.
pub(crate) struct Guides<'a> {
    pub(crate) truths: &'a [ViewTruth],
    /// r.
    pub(crate) ratios: &'a [Picture<LinearRgb>],
    /// R, exposed.
    pub(crate) references: &'a [Picture<LinearRgb>],
}

impl Guides<'_> {
    pub(crate) fn of(&self, view: usize) -> ViewGuide<'_> {
        let ViewTruth { instances, normals, valid, .. } = &self.truths[view];
        let surfaces = Surfaces { base_color: None, instances, normals, valid };
        ViewGuide { reference: &self.references[view], ratio: &self.ratios[view], surfaces }
    }

    pub(crate) fn differences(&self, quarters: Vec<Vec<Picture<LinearRgb>>>) -> Vec<LightDifference> {
        let views = quarters.par_iter().enumerate();
        views.map(|(view, quarters)| difference([0, 1, 2, 3].map(|at| &quarters[at]), &self.of(view))).collect()
    }
}
