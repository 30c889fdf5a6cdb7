//! The principled model: base_color, roughness and metallic, in two flavours. Front side only; GGX with alpha =
//! roughness^2.
//!
//! Both flavours have a diffuse base (weight 1 - metallic) and one bounce off GGX facets. The Fresnel term of the
//! facets is Schlick's with base_color (weight metallic) plus the exact dielectric one (weight 1 - metallic).
//!
//! - Mitsuba: Burley, "Physically Based Shading at Disney" (2012) and "Extending the Disney BRDF to a BSDF" (2015), as
//!   documented for `principled` of Mitsuba 3, with defaults for all parameters but base_color, roughness, metallic and
//!   specular. Masking is separable. The base is Disney's with retro-reflection, not reduced by what the facets
//!   reflect.
//! - Blender: what Cycles of Blender 4.5 computes for its Principled BSDF, with defaults for all parameters but
//!   base_color, roughness, metallic and specular IOR level. Masking is height-correlated. Both Fresnel terms are
//!   scaled up by the light of further bounces (Kulla and Conty 2017). The base is Lambertian, reduced by what the
//!   dielectric facets reflect towards the viewer, so the model is not reciprocal, as in Blender. `tests/peers`
//!   compares it with Blender.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use mateval_dataset::material::{Distribution, PrincipledFlavour};

use super::blender_tables::{BlenderTables, FacetAlbedo};
use super::facets::{Facets, LocalSample, fresnel_from_thinner, reflect, schlick_weight};
use crate::sampling;

/// The material at one point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Principled<'w> {
    pub(crate) base_color: Vec3,
    pub(crate) roughness: f32,
    pub(crate) metallic: f32,
    pub(crate) eta: f32,
    pub(crate) style: Style<'w>,
}

/// The flavour, with the tables it needs.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Style<'w> {
    Mitsuba,
    Blender(&'w BlenderTables),
}

/// The material seen from one direction: all terms that depend neither on the base colour nor on the light's direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PrincipledView {
    wo: Vec3,
    alpha: f32,
    /// The value of [`slope`] for the viewer.
    slope: f32,
    eta: f32,
    /// The weight of the dielectric Fresnel term.
    dielectric: f32,
    metallic: f32,
    /// For Blender's flavour: the light from the viewer that facets keep after one bounce.
    albedo: Option<FacetAlbedo>,
    base: Base,
    /// The factor between the base colour and the diffuse part.
    base_weight: f32,
    /// The probability of sampling the facets.
    facet_share: f32,
    /// Factors of the two densities: that of the facets over half the facets' own density, that of the base over the
    /// cosine.
    facet_density: f32,
    base_density: f32,
}

/// The terms that depend on the base colour alone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tint {
    /// Schlick's Fresnel term: its value at normal incidence, and its rise towards grazing angles.
    metal: Vec3,
    metal_rise: Vec3,
    /// The diffuse part over the cosine and over [`Response::base`].
    base: Vec3,
}

/// A [`PrincipledView`] for one light direction: the factors of a [`Tint`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Response {
    /// What the facets reflect for a Fresnel term of 1, with the cosine.
    bounce: f32,
    /// Schlick's weight for the angle between viewer and light.
    schlick: f32,
    /// The dielectric Fresnel term.
    dielectric: f32,
    /// The diffuse part over its colour and the cosine.
    base: f32,
    cos: f32,
    /// The density with which [`PrincipledView::sample`] samples the direction.
    pub(crate) density: f32,
}

/// The shape of the diffuse part, and the masking of the facets above it.
#[derive(Clone, Copy, Debug)]
enum Base {
    /// Blender's flavour: Lambertian, with height-correlated masking.
    Lambert,
    /// Mitsuba's flavour: Disney's, with separable masking. `fresnel` is Schlick's weight for the viewer.
    Disney { roughness: f32, fresnel: f32 },
}

/// The smallest alpha, which keeps the peak of a mirror finite: for Mitsuba (and Disney), and for Blender what f32 can
/// represent.
const SMALLEST_ALPHA: [f32; 2] = [1e-3, 1e-4];

/// The weight of a base of any colour in the choice of a lobe, and the smallest probability of sampling the facets.
const TYPICAL_BASE: f32 = 0.5;
const LEAST_FACET_SHARE: f32 = 0.25;

impl<'w> Principled<'w> {
    pub(crate) fn style(flavour: PrincipledFlavour, tables: Option<&'w BlenderTables>) -> Style<'w> {
        match (flavour, tables) {
            (PrincipledFlavour::Blender, Some(tables)) => Style::Blender(tables),
            _ => Style::Mitsuba,
        }
    }

    /// The value with the cosine, per channel.
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let view = self.seen_from(wo);
        view.tint(self.base_color).value(&view.response(wi))
    }

    /// The density with which [`Self::sample`] samples `wi`.
    pub(crate) fn density(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.seen_from(wo).response(wi).density
    }

    pub(crate) fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<LocalSample> {
        let view = self.seen_from(wo);
        let (wi, response) = view.sample(u)?;
        Some(LocalSample::spread(wi, view.tint(self.base_color).value(&response), response.density))
    }

    /// Computes the terms that depend on the viewer.
    pub(crate) fn seen_from(&self, wo: Vec3) -> PrincipledView {
        match self.style {
            Style::Mitsuba => self.mitsuba(wo),
            Style::Blender(tables) => self.blender(tables, wo),
        }
    }

    fn mitsuba(&self, wo: Vec3) -> PrincipledView {
        let alpha = (self.roughness * self.roughness).max(SMALLEST_ALPHA[0]);
        let matt = 1.0 - self.metallic;
        let (slope, facet_share) = (slope(wo.z, alpha * alpha), 1.0 / (1.0 + matt));
        PrincipledView {
            wo,
            alpha,
            slope,
            eta: self.eta,
            dielectric: matt,
            metallic: self.metallic,
            albedo: None,
            base: Base::Disney { roughness: self.roughness, fresnel: schlick_weight(wo.z) },
            base_weight: matt * FRAC_1_PI,
            facet_share,
            facet_density: facet_share / (wo.z + slope),
            base_density: (1.0 - facet_share) * FRAC_1_PI,
        }
    }

    fn blender(&self, tables: &BlenderTables, wo: Vec3) -> PrincipledView {
        let alpha = (self.roughness * self.roughness).max(SMALLEST_ALPHA[1]);
        let albedo = tables.facet_albedo(self.roughness, wo.z);
        let matt = 1.0 - self.metallic;
        // The light that the dielectric facets reflect, and the light that they leave to the base.
        let gain = albedo.gain(tables.mean_fresnel);
        let reflected = albedo.directional * gain * (tables.f0 + (1.0 - tables.f0) * tables.rise(self.roughness, wo.z));
        let passed = matt * (1.0 - reflected).max(0.0);
        // Metal facets count with the light they keep, whatever their colour.
        let facets = self.metallic * albedo.directional + matt * reflected;
        let facet_share = (facets / (facets + TYPICAL_BASE * passed)).max(LEAST_FACET_SHARE);
        let slope = slope(wo.z, alpha * alpha);
        PrincipledView {
            wo,
            alpha,
            slope,
            eta: self.eta,
            dielectric: matt * gain,
            metallic: self.metallic,
            albedo: Some(albedo),
            base: Base::Lambert,
            base_weight: passed * FRAC_1_PI,
            facet_share,
            facet_density: facet_share / (wo.z + slope),
            base_density: (1.0 - facet_share) * FRAC_1_PI,
        }
    }
}

impl PrincipledView {
    pub(crate) fn tint(&self, base_color: Vec3) -> Tint {
        let (metal, metal_rise) = match &self.albedo {
            _ if self.metallic == 0.0 => (Vec3::ZERO, Vec3::ZERO),
            Some(albedo) => self.blender_metal(albedo, base_color),
            None => (base_color * self.metallic, (Vec3::ONE - base_color) * self.metallic),
        };
        Tint { metal, metal_rise, base: base_color * self.base_weight }
    }

    /// Schlick's value at normal incidence and its rise, both with the light of further bounces. The mean of Schlick's
    /// term over all directions is F0 + (1 - F0) / 21. Blender's tint at 82 degrees (Kutz et al. 2021) is white by
    /// default, which gives exactly this.
    fn blender_metal(&self, albedo: &FacetAlbedo, base_color: Vec3) -> (Vec3, Vec3) {
        let f0 = base_color.clamp(Vec3::ZERO, Vec3::ONE);
        let gain = Vec3::from_array(f0.to_array().map(|f0| self.metallic * albedo.gain(f0 + (1.0 - f0) / 21.0)));
        (gain * f0, gain * (Vec3::ONE - f0))
    }

    /// The response to light from `wi`. Both directions lie above the surface.
    pub(crate) fn response(&self, wi: Vec3) -> Response {
        let half = self.wo + wi;
        let length2 = half.length_squared();
        let cos = 0.5 * length2.sqrt();
        let alpha2 = self.alpha * self.alpha;
        // Walter et al. 2007, equation 33, for half / |half|.
        let stretched = length2 / (half.x * half.x + half.y * half.y + alpha2 * (half.z * half.z));
        let facets = 0.5 * FRAC_1_PI * alpha2 * stretched * stretched;
        let dielectric = self.dielectric > 0.0;
        Response {
            bounce: facets * wi.z * self.unmasked(wi.z, alpha2),
            schlick: schlick_weight(cos),
            dielectric: if dielectric { self.dielectric * fresnel_from_thinner(cos, self.eta) } else { 0.0 },
            base: self.base(wi.z, cos),
            cos: wi.z,
            density: facets * self.facet_density + self.base_density * wi.z,
        }
    }

    /// `response` without highlights: the dielectric facets are left out, and metal reflects what its facets keep at
    /// normal incidence as a Lambertian surface.
    pub(crate) fn without_highlights(&self, response: Response) -> Response {
        let kept = self.albedo.as_ref().map_or(1.0, |albedo| albedo.directional);
        Response { bounce: kept * FRAC_1_PI * response.cos, schlick: 0.0, dielectric: 0.0, ..response }
    }

    /// Smith's masking and shadowing over twice the product of the cosines, expressed by [`slope`] instead of Lambda:
    /// height-correlated (Heitz, JCGT 2014, equation 99) or separable (Walter et al. 2007, equation 34).
    fn unmasked(&self, cos_i: f32, alpha2: f32) -> f32 {
        let (cos_o, slope_o, slope_i) = (self.wo.z, self.slope, slope(cos_i, alpha2));
        match self.base {
            Base::Lambert => 1.0 / (cos_i * slope_o + cos_o * slope_i),
            Base::Disney { .. } => 2.0 / ((cos_o + slope_o) * (cos_i + slope_i)),
        }
    }

    /// The shape of the base: Lambert's, or Burley 2015, equation 4, without subsurface scattering.
    fn base(&self, cos_i: f32, cos_difference: f32) -> f32 {
        match self.base {
            Base::Lambert => 1.0,
            Base::Disney { roughness, fresnel: fo } => {
                let fi = schlick_weight(cos_i);
                let retro = 2.0 * roughness * cos_difference * cos_difference;
                (1.0 - 0.5 * fo) * (1.0 - 0.5 * fi) + retro * (fo + fi + fo * fi * (retro - 1.0))
            }
        }
    }

    /// Samples a direction above the surface, with its response. `None` if the facets send the sample below the
    /// surface.
    pub(crate) fn sample(&self, u: [f32; 3]) -> Option<(Vec3, Response)> {
        let wi = if u[0] < self.facet_share {
            reflect(self.wo, Facets::new(Distribution::Ggx, self.alpha).sample(self.wo, [u[1], u[2]]))
        } else {
            sampling::cosine_hemisphere([u[1], u[2]])
        };
        if wi.z <= 0.0 {
            return None;
        }
        let response = self.response(wi);
        (response.density > 0.0).then_some((wi, response))
    }
}

impl Tint {
    /// The value with the cosine, per channel.
    #[inline]
    pub(crate) fn value(&self, response: &Response) -> Vec3 {
        let fresnel = self.metal + self.metal_rise * response.schlick + response.dielectric;
        fresnel * response.bounce + self.base * response.base * response.cos
    }
}

/// The cosine times 1 + 2 Lambda, for Smith's Lambda of GGX (Heitz 2014, equation 72).
fn slope(cos: f32, alpha2: f32) -> f32 {
    let cos2 = cos * cos;
    (cos2 + alpha2 * (1.0 - cos2)).max(0.0).sqrt()
}

/// The part of a BSDF to evaluate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BsdfPart {
    /// All of it.
    All,
    /// The part that reflects stage lights ([`crate::StageLight`]), without highlights. Of principled materials this is
    /// the base and, in place of metal facets, a diffuse part with the light that they keep; of others, all but delta
    /// lobes.
    Stage,
}

/// One point of a surface, seen from one direction, as `K` principled variants: one base colour each, over one or two
/// pairs of roughness and metallic.
///
/// All variants share the directions that are sampled. With two pairs, directions come from both densities in equal
/// parts (the balance heuristic for one sample, Veach 1997, section 9.2.4): a variant's weight is then at most twice
/// what its own density would give it, so that paths serve both pairs.
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
