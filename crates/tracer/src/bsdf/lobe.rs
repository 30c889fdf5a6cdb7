//! The scattering models behind one enum: parameters looked up at a point, in the frame of the shading normal.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI};
use std::sync::Arc;

use glam::{Vec2, Vec3};
use mateval_dataset::material::{ColorInput, ConductorIor, Material, MaterialModel, Microfacets};
use mateval_image::Texture;

use super::blender_tables::BlenderTables;
use super::facets::{
    Facets, LocalSample, eta_from_specular, fresnel_conductor, fresnel_dielectric, reflect, reflection,
    reflection_density,
};
use super::principled::Principled;
use super::rough_coat::RoughCoat;
use crate::sampling;

/// The precomputed values of one material.
#[derive(Clone, Debug, Default)]
pub(crate) struct Table {
    /// For Blender's principled.
    pub(crate) reflection: Option<Arc<BlenderTables>>,
    /// For rough plastic.
    pub(crate) coat: Option<Arc<RoughCoat>>,
    /// For smooth plastic: the fraction of uniform light from inside that its coat reflects back.
    pub(crate) inside: f32,
}

/// A material's parameters at one point. Opaque materials expect `wo.z > 0`, dielectrics accept either side.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Lobe<'w> {
    Black,
    Lambert { reflectance: Vec3 },
    OrenNayar { reflectance: Vec3, alpha: f32 },
    Mirror(Conductor),
    RoughConductor(Conductor, Facets),
    Plastic(Plastic<'w>),
    Dielectric(Dielectric),
    ThinDielectric(Dielectric),
    RoughDielectric(Dielectric, Facets),
    Principled(Principled<'w>),
}

impl<'w> Lobe<'w> {
    /// The material's parameters at `uv`. Long because it has one arm for each model.
    pub(crate) fn at(material: &Material, table: &'w Table, textures: &[Texture], uv: Vec2) -> Self {
        let color = |input: &ColorInput| Vec3::from_array(input.at(textures, uv));
        let facets = |m: &Microfacets| Facets::new(m.distribution, m.alpha.at(textures, uv));
        match &material.model {
            MaterialModel::Diffuse { reflectance, alpha: None } => Self::Lambert { reflectance: color(reflectance) },
            MaterialModel::Diffuse { reflectance, alpha: Some(alpha) } => {
                Self::OrenNayar { reflectance: color(reflectance), alpha: alpha.at(textures, uv) }
            }
            MaterialModel::Conductor { ior, specular_reflectance, microfacets } => {
                let conductor = Conductor { ior: *ior, tint: color(specular_reflectance) };
                match microfacets {
                    None => Self::Mirror(conductor),
                    Some(microfacets) => Self::RoughConductor(conductor, facets(microfacets)),
                }
            }
            MaterialModel::Plastic { eta, nonlinear, diffuse_reflectance, specular_reflectance, microfacets } => {
                let coat = match (microfacets, &table.coat) {
                    (Some(microfacets), Some(table)) => {
                        let alpha = microfacets.alpha.at(textures, uv);
                        Coat::Rough { facets: Facets::new(microfacets.distribution, alpha), alpha, table }
                    }
                    _ => Coat::Smooth { inside: table.inside },
                };
                let (base, tint) = (color(diffuse_reflectance), color(specular_reflectance));
                Self::Plastic(Plastic { eta: *eta, nonlinear: *nonlinear, base, tint, coat })
            }
            MaterialModel::Dielectric { eta, specular_reflectance, specular_transmittance, microfacets } => {
                let (reflectance, transmittance) = (color(specular_reflectance), color(specular_transmittance));
                let dielectric = Dielectric { eta: *eta, reflectance, transmittance };
                match microfacets {
                    None => Self::Dielectric(dielectric),
                    Some(microfacets) => Self::RoughDielectric(dielectric, facets(microfacets)),
                }
            }
            MaterialModel::ThinDielectric { eta, specular_reflectance, specular_transmittance } => {
                let (reflectance, transmittance) = (color(specular_reflectance), color(specular_transmittance));
                Self::ThinDielectric(Dielectric { eta: *eta, reflectance, transmittance })
            }
            MaterialModel::Principled { base_color, roughness, metallic, specular, flavour } => {
                Self::Principled(Principled {
                    base_color: color(base_color),
                    roughness: roughness.at(textures, uv).clamp(0.0, 1.0),
                    metallic: metallic.at(textures, uv).clamp(0.0, 1.0),
                    eta: eta_from_specular(*specular),
                    style: Principled::style(*flavour, table.reflection.as_deref()),
                })
            }
        }
    }

    /// Whether light passes to the other side.
    pub(crate) fn transmits(&self) -> bool {
        matches!(self, Self::Dielectric(_) | Self::ThinDielectric(_) | Self::RoughDielectric(..))
    }

    /// Whether all scattered directions are delta distributions, so that lights need not be sampled.
    pub(crate) fn is_delta(&self) -> bool {
        matches!(self, Self::Black | Self::Mirror(_) | Self::Dielectric(_) | Self::ThinDielectric(_))
    }

    /// The value times the cosine of `wi`. Delta lobes are left out.
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        match self {
            Self::RoughDielectric(dielectric, facets) => dielectric.eval_rough(facets, wo, wi),
            _ if wo.z <= 0.0 || wi.z <= 0.0 => Vec3::ZERO,
            Self::Lambert { reflectance } => lambert(*reflectance, wi),
            Self::OrenNayar { reflectance, alpha } => oren_nayar(*reflectance, *alpha, wo, wi),
            Self::RoughConductor(conductor, facets) => conductor.eval(facets, wo, wi),
            Self::Plastic(plastic) => plastic.eval(wo, wi),
            Self::Principled(principled) => principled.eval(wo, wi),
            Self::Black | Self::Mirror(_) | Self::Dielectric(_) | Self::ThinDielectric(_) => Vec3::ZERO,
        }
    }

    /// The density with which [`Self::sample`] samples `wi`, per solid angle. Delta lobes are left out.
    pub(crate) fn density(&self, wo: Vec3, wi: Vec3) -> f32 {
        match self {
            Self::RoughDielectric(dielectric, facets) => dielectric.density_rough(facets, wo, wi),
            _ if wo.z <= 0.0 || wi.z <= 0.0 => 0.0,
            Self::Lambert { .. } | Self::OrenNayar { .. } => sampling::cosine_density(wi.z),
            Self::RoughConductor(_, facets) => reflection_density(facets, wo, wi),
            Self::Plastic(plastic) => plastic.density(wo, wi),
            Self::Principled(principled) => principled.density(wo, wi),
            Self::Black | Self::Mirror(_) | Self::Dielectric(_) | Self::ThinDielectric(_) => 0.0,
        }
    }

    /// Samples a direction for `wo`; `u[0]` selects the lobe. `None` if the sample is absorbed.
    pub(crate) fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<LocalSample> {
        if wo.z == 0.0 || (wo.z < 0.0 && !self.transmits()) {
            return None;
        }
        let pair = [u[1], u[2]];
        match self {
            Self::Black => None,
            Self::Lambert { .. } | Self::OrenNayar { .. } => sample_diffuse(pair, |wi| self.eval(wo, wi)),
            Self::Mirror(conductor) => Some(conductor.mirror(wo)),
            Self::RoughConductor(conductor, facets) => conductor.sample(facets, wo, pair),
            Self::Plastic(plastic) => plastic.sample(wo, u),
            Self::Dielectric(dielectric) => Some(dielectric.sample_smooth(wo, u[0])),
            Self::ThinDielectric(dielectric) => Some(dielectric.sample_thin(wo, u[0])),
            Self::RoughDielectric(dielectric, facets) => dielectric.sample_rough(facets, wo, u),
            Self::Principled(principled) => principled.sample(wo, u),
        }
    }
}

fn lambert(reflectance: Vec3, wi: Vec3) -> Vec3 {
    reflectance * (FRAC_1_PI * wi.z)
}

/// Oren and Nayar, "Generalization of Lambert's Reflectance Model" (SIGGRAPH 1994), section 4.4, with interreflection.
/// As in Mitsuba 0.6's `roughdiffuse`, the standard deviation of the slope is `alpha` / sqrt(2).
fn oren_nayar(reflectance: Vec3, alpha: f32, wo: Vec3, wi: Vec3) -> Vec3 {
    let s2 = 0.5 * alpha * alpha;
    let (theta_o, theta_i) = (angle(wo), angle(wi));
    let (larger, smaller) = (theta_o.max(theta_i), theta_o.min(theta_i));
    let flat = (wo.truncate().length() * wi.truncate().length()).max(1e-12);
    let cos_phi = (wo.truncate().dot(wi.truncate()) / flat).clamp(-1.0, 1.0);
    let slope = 2.0 * smaller * FRAC_1_PI;
    // Direct illumination.
    let c1 = 1.0 - 0.5 * s2 / (s2 + 0.33);
    let behind = if cos_phi >= 0.0 { 0.0 } else { slope * slope * slope };
    let c2 = 0.45 * s2 / (s2 + 0.09) * (libm::sinf(larger) - behind);
    let product = 4.0 * larger * smaller * FRAC_1_PI * FRAC_1_PI;
    let c3 = 0.125 * s2 / (s2 + 0.09) * product * product;
    let tan = |angle: f32| libm::tanf(angle.min(FRAC_PI_2 - 1e-4));
    let direct = c1 + cos_phi * c2 * tan(smaller) + (1.0 - cos_phi.abs()) * c3 * tan(0.5 * (larger + smaller));
    // Interreflection between facets.
    let between = 0.17 * s2 / (s2 + 0.13) * (1.0 - cos_phi * slope * slope);
    (reflectance * direct + reflectance * reflectance * between) * (FRAC_1_PI * wi.z)
}

fn angle(w: Vec3) -> f32 {
    libm::acosf(w.z.clamp(0.0, 1.0))
}

/// Samples a direction with a density proportional to the cosine; `value_at` evaluates it.
fn sample_diffuse(u: [f32; 2], value_at: impl Fn(Vec3) -> Vec3) -> Option<LocalSample> {
    let wi = sampling::cosine_hemisphere(u);
    (wi.z > 0.0).then(|| LocalSample::spread(wi, value_at(wi), wi.z / PI))
}

/// A metal: its index of refraction and a tint of the reflected light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Conductor {
    ior: ConductorIor,
    tint: Vec3,
}

impl Conductor {
    /// The mirror direction as a delta sample.
    fn mirror(&self, wo: Vec3) -> LocalSample {
        let wi = Vec3::new(-wo.x, -wo.y, wo.z);
        LocalSample::delta(wi, self.tint * fresnel_conductor(wo.z, &self.ior), 1.0)
    }

    /// Walter et al. 2007, equation 20, with a conductor's Fresnel term.
    fn eval(&self, facets: &Facets, wo: Vec3, wi: Vec3) -> Vec3 {
        let Some(m) = (wo + wi).try_normalize() else { return Vec3::ZERO };
        let fresnel = fresnel_conductor(wo.dot(m).clamp(0.0, 1.0), &self.ior);
        self.tint * fresnel * reflection(facets, wo, wi, m)
    }

    fn sample(&self, facets: &Facets, wo: Vec3, u: [f32; 2]) -> Option<LocalSample> {
        let wi = reflect(wo, facets.sample(wo, u));
        let density = reflection_density(facets, wo, wi);
        (wi.z > 0.0 && density > 0.0).then(|| LocalSample::spread(wi, self.eval(facets, wo, wi), density))
    }
}

/// A boundary between clear media, with tints of the light it reflects and transmits.
///
/// `eta` is the index inside over that outside; z points outside. Radiance scales with the square of the index it
/// enters. As in Mitsuba, transmitted light is therefore divided by the square of the index ratio on the way from light
/// to viewer (Veach 1997, section 5.2). A path into and out of a closed body cancels the factor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dielectric {
    eta: f32,
    reflectance: Vec3,
    transmittance: Vec3,
}

impl Dielectric {
    /// The index beyond the boundary over that on the side of `wo`.
    fn relative(&self, wo: Vec3) -> f32 {
        if wo.z > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    /// Samples a smooth boundary: the mirror direction or the refracted one, with probabilities by the Fresnel term.
    fn sample_smooth(&self, wo: Vec3, u: f32) -> LocalSample {
        let eta = self.relative(wo);
        let (reflected, beyond) = fresnel_dielectric(wo.z.abs(), eta);
        if u < reflected {
            return LocalSample::delta(Vec3::new(-wo.x, -wo.y, wo.z), self.reflectance, reflected);
        }
        let wi = Vec3::new(-wo.x / eta, -wo.y / eta, -beyond.copysign(wo.z)).normalize();
        LocalSample::delta(wi, self.transmittance / (eta * eta), 1.0 - reflected)
    }

    /// Samples a sheet with two boundaries: R + T^2 R / (1 - R^2) = 2 R / (1 + R) is reflected, the rest passes
    /// straight through.
    fn sample_thin(&self, wo: Vec3, u: f32) -> LocalSample {
        let once = fresnel_dielectric(wo.z.abs(), self.eta).0;
        let reflected = 2.0 * once / (1.0 + once);
        if u < reflected {
            return LocalSample::delta(Vec3::new(-wo.x, -wo.y, wo.z), self.reflectance, reflected);
        }
        LocalSample::delta(-wo, self.transmittance, 1.0 - reflected)
    }

    /// Walter et al. 2007, equations 20 and 21.
    fn eval_rough(&self, facets: &Facets, wo: Vec3, wi: Vec3) -> Vec3 {
        let Some(event) = Event::new(self.relative(wo), wo, wi) else { return Vec3::ZERO };
        let Event { wo, wi, m, eta, .. } = event;
        let (cos_o, cos_i) = (wo.dot(m), wi.dot(m));
        let reflected = fresnel_dielectric(cos_o, eta).0;
        let shape = facets.density(m) * facets.visible_from_both(wo, wi, m) / wo.z;
        if event.is_reflection() {
            return self.reflectance * (reflected * shape / 4.0);
        }
        let sum = cos_o + eta * cos_i;
        self.transmittance * ((1.0 - reflected) * shape * (cos_o * cos_i).abs() / (sum * sum))
    }

    /// The density of [`Self::sample_rough`].
    fn density_rough(&self, facets: &Facets, wo: Vec3, wi: Vec3) -> f32 {
        let Some(event) = Event::new(self.relative(wo), wo, wi) else { return 0.0 };
        let Event { wo, wi, m, eta, .. } = event;
        let (cos_o, cos_i) = (wo.dot(m), wi.dot(m));
        let reflected = fresnel_dielectric(cos_o, eta).0;
        let facet = facets.sample_density(wo, m);
        if event.is_reflection() {
            return reflected * facet / (4.0 * cos_o);
        }
        let sum = cos_o + eta * cos_i;
        (1.0 - reflected) * facet * eta * eta * cos_i.abs() / (sum * sum)
    }

    fn sample_rough(&self, facets: &Facets, wo: Vec3, u: [f32; 3]) -> Option<LocalSample> {
        let side = 1.0_f32.copysign(wo.z);
        let eta = self.relative(wo);
        let above = wo * side;
        let m = facets.sample(above, [u[1], u[2]]);
        let cos = above.dot(m);
        if cos <= 0.0 {
            return None;
        }
        let (reflected, beyond) = fresnel_dielectric(cos, eta);
        let wi = if u[0] < reflected { reflect(above, m) } else { m * (cos / eta - beyond) - above / eta };
        let goes_up = u[0] < reflected;
        let wi = wi.normalize() * side;
        let density = self.density_rough(facets, wo, wi);
        (goes_up == (wi.z * side > 0.0) && density > 0.0)
            .then(|| LocalSample::spread(wi, self.eval_rough(facets, wo, wi), density))
    }
}

/// Two directions and the facet between them, flipped so that `wo` lies above.
struct Event {
    wo: Vec3,
    wi: Vec3,
    m: Vec3,
    /// The index beyond over the index above.
    eta: f32,
}

impl Event {
    /// `None` if no facet sends one direction into the other.
    fn new(eta: f32, wo: Vec3, wi: Vec3) -> Option<Self> {
        let side = 1.0_f32.copysign(wo.z);
        let (wo, wi) = (wo * side, wi * side);
        if wo.z == 0.0 || wi.z == 0.0 {
            return None;
        }
        let m = if wi.z > 0.0 { wo + wi } else { wo + wi * eta }.try_normalize()?;
        let m = if m.z < 0.0 { -m } else { m };
        let possible = wo.dot(m) > 0.0 && wi.dot(m) * wi.z > 0.0;
        possible.then_some(Self { wo, wi, m, eta })
    }

    fn is_reflection(&self) -> bool {
        self.wi.z > 0.0
    }
}

/// A diffuse base under a dielectric coat, smooth or rough: Mitsuba's `plastic` and `roughplastic`.
///
/// Light enters through the coat, is scattered by the base, is reflected back by the coat any number of times and
/// leaves: T(wi) T(wo) / eta^2 * base / (1 - base * R_inside) / pi (Mitsuba 3's documentation of `plastic`). Without
/// `nonlinear`, the denominator does not contain the colour of the base.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plastic<'w> {
    eta: f32,
    nonlinear: bool,
    base: Vec3,
    tint: Vec3,
    coat: Coat<'w>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Coat<'w> {
    /// `inside` is the fraction of uniform light from inside that the coat reflects back.
    Smooth { inside: f32 },
    /// `table` holds the directional albedos of the facets.
    Rough { facets: Facets, alpha: f32, table: &'w RoughCoat },
}

impl Plastic<'_> {
    /// The fraction of light that the coat transmits from or to the cosine `cos`. It is also the probability of
    /// sampling the base, so that the choice does not depend on colours.
    fn transmitted(&self, cos: f32) -> f32 {
        match self.coat {
            Coat::Smooth { .. } => 1.0 - fresnel_dielectric(cos, self.eta).0,
            Coat::Rough { alpha, table, .. } => table.transmitted(cos, alpha),
        }
    }

    fn base_value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        self.base / (Vec3::ONE - self.returned()) * self.base_share(wo, wi)
    }

    /// The fraction of the light from the base that the coat reflects back and the base scatters again.
    fn returned(&self) -> Vec3 {
        let inside = match self.coat {
            Coat::Smooth { inside } => inside,
            Coat::Rough { alpha, table, .. } => table.reflected_inside(alpha),
        };
        if self.nonlinear { self.base * inside } else { Vec3::splat(inside) }
    }

    /// What a white base would scatter once, with the cosine.
    fn base_share(&self, wo: Vec3, wi: Vec3) -> f32 {
        let through = self.transmitted(wo.z) * self.transmitted(wi.z) / (self.eta * self.eta);
        through * FRAC_1_PI * wi.z
    }

    /// The base, and the coat if it is rough.
    fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let base = self.base_value(wo, wi);
        let (Coat::Rough { facets, .. }, Some(m)) = (self.coat, (wo + wi).try_normalize()) else { return base };
        let reflected = fresnel_dielectric(wo.dot(m).clamp(0.0, 1.0), self.eta).0;
        base + self.tint * (reflected * reflection(&facets, wo, wi, m))
    }

    /// The density of the directions that [`Self::eval`] covers.
    fn density(&self, wo: Vec3, wi: Vec3) -> f32 {
        let coat_share = 1.0 - self.transmitted(wo.z);
        let base = (1.0 - coat_share) * sampling::cosine_density(wi.z);
        match self.coat {
            Coat::Smooth { .. } => base,
            Coat::Rough { facets, .. } => base + coat_share * reflection_density(&facets, wo, wi),
        }
    }

    fn sample(&self, wo: Vec3, u: [f32; 3]) -> Option<LocalSample> {
        let coat_share = 1.0 - self.transmitted(wo.z);
        let wi = match self.coat {
            _ if u[0] >= coat_share => sampling::cosine_hemisphere([u[1], u[2]]),
            Coat::Smooth { .. } => {
                return Some(LocalSample::delta(Vec3::new(-wo.x, -wo.y, wo.z), self.tint, coat_share));
            }
            Coat::Rough { facets, .. } => reflect(wo, facets.sample(wo, [u[1], u[2]])),
        };
        let density = self.density(wo, wi);
        (wi.z > 0.0 && density > 0.0).then(|| LocalSample::spread(wi, self.eval(wo, wi), density))
    }
}
