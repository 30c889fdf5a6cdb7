//! One point of a surface as `K` principled variants see it: one base colour each, over one or two pairs of roughness and
//! metallic.
//!
//! All variants share the directions that are sampled. With two pairs, directions come from both densities in equal
//! parts (the balance heuristic for one sample, Veach 1997, section 9.2.4): a variant's weight is then at most twice what
//! its own density would give it, so that paths serve both pairs.

use glam::Vec3;

use super::lobe::{Principled, PrincipledView, Response, Tint};
use super::part::BsdfPart;

/// The variants at one point, seen from one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct PrincipledVariants<const K: usize> {
    view: PrincipledView,
    second: Option<Second>,
    tints: [Tint; K],
}

/// A second material at the same point, and the number of the first variant that has its roughness and metallic.
pub(super) type SecondPrincipled<'w> = (Principled<'w>, usize);

/// The other pair of roughness and metallic.
#[derive(Clone, Copy, Debug)]
struct Second {
    view: PrincipledView,
    /// The first variant that has it; all later ones do too.
    from: usize,
}

/// The responses to one direction of light, and the density with which the direction is sampled.
struct Responses {
    first: Response,
    second: Option<(Response, usize)>,
    density: f32,
}

impl<const K: usize> PrincipledVariants<K> {
    /// Variants of `base_colors`, seen from `wo` in the frame. Those from number `second.1` on have the roughness and
    /// metallic of `second.0`, the others those of `first`.
    pub(super) fn new(
        first: &Principled<'_>,
        second: Option<&SecondPrincipled<'_>>,
        base_colors: &[Vec3; K],
        wo: Vec3,
    ) -> Self {
        let view = first.seen_from(wo);
        let second = second.map(|(principled, from)| Second { view: principled.seen_from(wo), from: *from });
        let tint = |k: usize| match &second {
            Some(second) if k >= second.from => second.view.tint(base_colors[k]),
            _ => view.tint(base_colors[k]),
        };
        Self { view, second, tints: std::array::from_fn(tint) }
    }

    /// The values with the cosine, per variant, and the density with which [`Self::sample`] samples `wi`.
    pub(super) fn evaluate(&self, wi: Vec3, part: BsdfPart) -> ([Vec3; K], f32) {
        let responses = self.responses(wi);
        (self.values(&responses, part), responses.density)
    }

    /// A direction above the surface with its weights (values over density) and density. `None` if the sample falls
    /// below the surface.
    pub(super) fn sample(&self, u: [f32; 3]) -> Option<(Vec3, [Vec3; K], f32)> {
        let (wi, responses) = match &self.second {
            None => {
                let (wi, first) = self.view.sample(u)?;
                let density = first.density;
                (wi, Responses { first, second: None, density })
            }
            Some(second) => {
                let (view, choice) =
                    if u[0] < 0.5 { (&self.view, 2.0 * u[0]) } else { (&second.view, 2.0 * u[0] - 1.0) };
                let (wi, _) = view.sample([choice, u[1], u[2]])?;
                (wi, self.responses(wi))
            }
        };
        let density = responses.density;
        Some((wi, self.values(&responses, BsdfPart::All).map(|value| value / density), density))
    }

    fn responses(&self, wi: Vec3) -> Responses {
        let first = self.view.response(wi);
        match &self.second {
            None => Responses { density: first.density, first, second: None },
            Some(Second { view, from }) => {
                let other = view.response(wi);
                let density = 0.5 * (first.density + other.density);
                Responses { first, second: Some((other, *from)), density }
            }
        }
    }

    fn values(&self, responses: &Responses, part: BsdfPart) -> [Vec3; K] {
        let shown = |view: &PrincipledView, response: Response| match part {
            BsdfPart::All => response,
            BsdfPart::Stage => view.without_highlights(response),
        };
        let first = shown(&self.view, responses.first);
        match (&self.second, &responses.second) {
            (Some(Second { view, .. }), Some((other, from))) => {
                let other = shown(view, *other);
                std::array::from_fn(|k| self.tints[k].value(if k >= *from { &other } else { &first }))
            }
            _ => self.tints.map(|tint| tint.value(&first)),
        }
    }
}
