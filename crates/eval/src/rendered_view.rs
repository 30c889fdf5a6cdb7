//! A prediction's view under one light, in four quarters.

use mateval_image::{LinearRgb, Picture};
use mateval_tracer::ViewsRender;

use crate::companions::COMPANIONS;
use crate::control_variate::{Coefficients, combined};
use crate::stored_light::StoredLight;

/// Four independent renders of one view, exposed: the quarters of half A, then those of half B. Where companions correct
/// them, the part that comes from the companions' converged pictures is held apart, since both quarters of a half share it.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderedView {
    quarters: Vec<StoredLight>,
    /// For each half what its converged companions add.
    companions: Option<[StoredLight; 2]>,
    /// For each half what the converged companions of the other half would add under its own lights, where the halves have
    /// lights of their own; otherwise it is what they add to the other half.
    others: Option<[StoredLight; 2]>,
}

impl RenderedView {
    /// Quarters that nothing corrects, linear, before exposure.
    pub fn plain(quarters: [&Picture<LinearRgb>; 4], exposure: f64) -> Self {
        let quarters = quarters.into_iter().map(|quarter| StoredLight::exposed(quarter, exposure)).collect();
        Self { quarters, companions: None, others: None }
    }

    /// A view without quarters yet.
    pub(crate) fn empty() -> Self {
        Self { quarters: Vec::new(), companions: None, others: None }
    }

    /// Half A of one picture and half B of another, of the same view under lights that differ a little.
    pub(crate) fn of_halves(first: &Self, second: &Self) -> Self {
        let quarters = first.quarters[..2].iter().chain(&second.quarters[2..]).cloned().collect();
        let pair = first.companions.as_ref().zip(second.companions.as_ref());
        let half = |at: usize| pair.map(|(first, second)| [first[at].clone(), second[1 - at].clone()]);
        Self { quarters, companions: half(0), others: half(1) }
    }

    /// Adds the next quarter.
    pub(crate) fn add_quarter(&mut self, quarter: StoredLight) {
        self.quarters.push(quarter);
    }

    /// Sets what the converged companions add to each half.
    pub(crate) fn set_companions(&mut self, halves: [StoredLight; 2]) {
        self.companions = Some(halves);
    }

    /// One quarter of a half, exposed.
    pub(crate) fn quarter(&self, half: usize, quarter: usize) -> Picture<LinearRgb> {
        let paths = &self.quarters[2 * half + quarter];
        match &self.companions {
            None => paths.picture(),
            Some(companions) => sum(paths, &companions[half]),
        }
    }

    /// A half with the companions of the other half in place of its own; none without companions. `mean` is the half.
    pub(crate) fn with_other_companions(&self, half: usize, mean: &Picture<LinearRgb>) -> Option<Picture<LinearRgb>> {
        let companions = self.companions.as_ref()?;
        let other = self.others.as_ref().map_or(&companions[1 - half], |others| &others[half]);
        let own = &companions[half];
        let (width, height) = own.size();
        Some(Picture::from_fn(width, height, |x, y| {
            let (own, other) = (own.at(y * width + x), other.at(y * width + x));
            let LinearRgb(value) = mean.get(x, y);
            LinearRgb([0, 1, 2].map(|c| (f64::from(value[c]) + other[c] - own[c]) as f32))
        }))
    }
}

fn sum(a: &StoredLight, b: &StoredLight) -> Picture<LinearRgb> {
    let (width, height) = a.size();
    Picture::from_fn(width, height, |x, y| {
        let (a, b) = (a.at(y * width + x), b.at(y * width + x));
        LinearRgb([0, 1, 2].map(|c| (a[c] + b[c]) as f32))
    })
}

/// One quarter without what the paths show of the companions: P - r * sum of b * F. Linear radiances, stored exposed.
pub(crate) fn without_companions(
    prediction: &Picture<LinearRgb>,
    companions: [&Picture<LinearRgb>; COMPANIONS],
    coefficients: &Coefficients,
    ratio: &Picture<LinearRgb>,
    exposure: f64,
) -> StoredLight {
    StoredLight::from_pixels(prediction.width(), prediction.height(), |k| {
        let value = prediction.pixels()[k].0.map(f64::from);
        let companions = companions.map(|picture| picture.pixels()[k].0.map(f64::from));
        let known = combined(coefficients, ratio.pixels()[k].0, companions);
        [0, 1, 2].map(|c| exposure * (value[c] - known[c]))
    })
}

/// What the converged companions add: r * sum of b * C, from exposed pictures.
pub(crate) fn of_companions(
    companions: &[Picture<LinearRgb>; COMPANIONS],
    coefficients: &Coefficients,
    ratio: &Picture<LinearRgb>,
) -> StoredLight {
    StoredLight::from_pixels(ratio.width(), ratio.height(), |k| {
        let companions = [0, 1, 2].map(|j| companions[j].pixels()[k].0.map(f64::from));
        combined(coefficients, ratio.pixels()[k].0, companions)
    })
}

/// A picture of one view of a render of one seed.
pub(crate) fn picture_of(render: &ViewsRender, view: usize, picture: usize) -> &Picture<LinearRgb> {
    &render.views[view].halves[0].basis.pictures()[picture]
}
