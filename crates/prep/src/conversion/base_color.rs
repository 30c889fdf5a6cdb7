//! The base colour with which the scored model reflects the same share of uniform light as a source material.

use mateval_scene::material::{ColorInput, MaterialModel};
use mateval_tracer::MaterialFault;
use mateval_tracer::bsdf::ReflectanceMeter;

/// How the base colour of a converted material follows from the colour of its source.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BaseColorRule {
    /// None where the source's colour is a base colour already.
    measured: Option<Measured>,
}

#[derive(Clone, Debug, PartialEq)]
struct Measured {
    source: [SourceLight; 3],
    /// The share of uniform light that the scored model reflects, for evenly spaced base colours from 0 to 1. It rises.
    converted: Vec<f64>,
}

/// The share of uniform light that a source material reflects in one channel, for a colour x:
/// `coat + (linear x + square x^2) / (1 - inside x)`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SourceLight {
    coat: f64,
    linear: f64,
    square: f64,
    inside: f64,
}

/// Base colours at which metals are measured, three at once, one a channel.
const METAL_STEPS: usize = 18;

impl BaseColorRule {
    /// The rule that keeps colours.
    pub(super) fn identity() -> Self {
        Self { measured: None }
    }

    /// Measures the models that `source` and `scored` make from a colour.
    pub(super) fn measure(
        meter: &mut ReflectanceMeter,
        source: impl Fn(ColorInput) -> MaterialModel,
        scored: impl Fn(ColorInput) -> MaterialModel,
        metallic: f32,
    ) -> Result<Self, MaterialFault> {
        let mut grey = |make: &dyn Fn(ColorInput) -> MaterialModel, value: f32| {
            meter.uniform(&make(ColorInput::Constant([value; 3])))
        };
        let found = [0.0, 0.5, 1.0].map(|value| grey(&source, value));
        let [black, half, white] = found;
        let (black, half, white) = (black?, half?, white?);
        let is_plastic = matches!(source(ColorInput::Constant([0.0; 3])), MaterialModel::Plastic { .. });
        let light = |c: usize| SourceLight::through(black[c], half[c] - black[c], white[c] - black[c], is_plastic);
        // The light of a base under facets is linear in its colour; that of metal is not.
        let last = if metallic > 0.0 { METAL_STEPS - 1 } else { 2 };
        let mut converted = Vec::with_capacity(last + 1);
        for step in (0..=last).step_by(3) {
            let values = [0, 1, 2].map(|next| (step + next) as f32 / last as f32);
            converted.extend(meter.uniform(&scored(ColorInput::Constant(values)))?);
        }
        Ok(Self { measured: Some(Measured { source: std::array::from_fn(light), converted }) })
    }

    /// The base colour of a linear colour of the source; both are clipped to 0..1.
    pub(super) fn apply(&self, color: [f32; 3]) -> [f32; 3] {
        let clipped = color.map(|value| value.clamp(0.0, 1.0));
        match &self.measured {
            None => clipped,
            Some(measured) => std::array::from_fn(|c| measured.channel(c, f64::from(clipped[c])) as f32),
        }
    }
}

impl Measured {
    fn channel(&self, channel: usize, color: f64) -> f64 {
        let source = &self.source[channel];
        let black = self.converted[0];
        let rise = rise_above(source.of_color(color), black - source.coat);
        self.base_color_for(black + rise)
    }

    /// The base colour with which the scored model reflects this share; the nearest of 0..1.
    fn base_color_for(&self, share: f64) -> f64 {
        let above = self.converted.partition_point(|found| *found < share).clamp(1, self.converted.len() - 1);
        let [lower, upper] = [self.converted[above - 1], self.converted[above]];
        let part = (share - lower) / (upper - lower);
        ((above as f64 - 1.0 + part) / (self.converted.len() - 1) as f64).clamp(0.0, 1.0)
    }
}

impl SourceLight {
    /// The curve through the light above black of a half and of a whole colour.
    fn through(coat: f64, half: f64, white: f64, is_plastic: bool) -> Self {
        if white <= 0.0 {
            return Self { coat, linear: 0.0, square: 0.0, inside: 0.0 };
        }
        if is_plastic {
            // Light that the coat sends back to the base: half / white = (1 - inside) / (2 - inside).
            let ratio = half / white;
            let inside = (1.0 - 2.0 * ratio) / (1.0 - ratio);
            return Self { coat, linear: white * (1.0 - inside), square: 0.0, inside };
        }
        // Oren and Nayar's second reflection is a square.
        let linear = 4.0 * half - white;
        Self { coat, linear, square: white - linear, inside: 0.0 }
    }

    /// The light of the colour alone, without the coat's.
    fn of_color(&self, x: f64) -> f64 {
        (self.linear * x + self.square * x * x) / (1.0 - self.inside * x)
    }
}

/// The light that the base has to add to that of the facets, so that both are `light`, where the facets alone reflect
/// `excess` more than the source's coat.
///
/// A surface of the scored model is never darker than its facets, which reflect 2 % at roughness 1. Below twice the excess a
/// parabola, which continues the line with its slope, keeps dark colours distinct; the result is brighter than the source
/// by at most the excess, at black.
fn rise_above(light: f64, excess: f64) -> f64 {
    if light >= 2.0 * excess { light - excess } else { light * light / (4.0 * excess) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parabola_continues_the_line() {
        for excess in [-0.01, 0.0] {
            assert_eq!(rise_above(0.3, excess), 0.3 - excess);
        }
        let excess = 0.02;
        assert_eq!((rise_above(0.0, excess), rise_above(0.04, excess)), (0.0, 0.02));
        let slope = |at: f64| (rise_above(at + 1e-6, excess) - rise_above(at - 1e-6, excess)) / 2e-6;
        assert!((slope(0.04 - 2e-6) - 1.0).abs() < 1e-3 && (slope(0.04 + 2e-6) - 1.0).abs() < 1e-3);
        let steps: Vec<f64> = (0..100).map(|k| rise_above(k as f64 * 1e-3, excess)).collect();
        assert!(steps.windows(2).all(|pair| pair[0] < pair[1]));
    }

    #[test]
    fn a_curve_passes_through_its_points() {
        let plastic = SourceLight { coat: 0.09, linear: 0.4, square: 0.0, inside: 0.6 };
        let (half, white) = (plastic.of_color(0.5), plastic.of_color(1.0));
        let found = SourceLight::through(0.09, half, white, true);
        assert!((found.inside - 0.6).abs() < 1e-9 && (found.linear - 0.4).abs() < 1e-9, "{found:?}");
        let matt = SourceLight { coat: 0.0, linear: 0.8, square: 0.1, inside: 0.0 };
        let found = SourceLight::through(0.0, matt.of_color(0.5), matt.of_color(1.0), false);
        assert!((found.linear - 0.8).abs() < 1e-9 && (found.square - 0.1).abs() < 1e-9, "{found:?}");
    }
}
