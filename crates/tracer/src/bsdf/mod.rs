//! BSDFs: a material's parameters at one point, with evaluation, density and sampling.
//!
//! `wo` points to the viewer, `wi` to the light, both away from the surface, of unit length and in world space.
//! Evaluation includes the cosine. The choice of a lobe never depends on a colour, so the same paths serve any base
//! colours.

mod bump;
mod facets;
mod fresnel;
mod lobe;
mod part;
mod principled_tables;
mod principled_variants;
mod rough_boundary;
mod sample;
mod tables;
#[cfg(test)]
mod tests;
mod uniform_reflectance;

use glam::Vec3;
use mateval_image::Texture;
use mateval_scene::TriangleMesh;
use mateval_scene::material::Material;

use crate::ray::SurfaceHit;
use crate::sampling::Frame;
pub(crate) use fresnel::eta_from_specular;
use lobe::Lobe;
pub(crate) use lobe::Principled;
pub(crate) use part::BsdfPart;
pub(crate) use principled_tables::BlenderTables;
use principled_variants::{PrincipledVariants, SecondPrincipled};
pub(crate) use tables::{MaterialTables, Table};
pub use uniform_reflectance::ReflectanceMeter;

/// The BSDF of a surface at one point, for `K` base colours at once.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<'w, const K: usize = 1> {
    frame: Frame,
    /// The geometric normal, on the side of the frame's z axis.
    geometric: Vec3,
    /// Towards the viewer, in the frame.
    wo: Vec3,
    lobe: Lobe<'w>,
    /// For principled materials, which most are: the terms that depend on `wo` and on the base colours alone.
    principled: Option<PrincipledVariants<K>>,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample<const K: usize = 1> {
    /// Towards the light.
    pub wi: Vec3,
    /// The value of [`Bsdf::evaluate`] over `density`, per base colour.
    pub weights: [Vec3; K],
    /// Per solid angle; for a delta sample, its probability.
    pub density: f32,
    /// Whether the direction comes from a delta distribution, such as a mirror, which light sampling cannot find.
    pub delta: bool,
}

/// The smallest cosine between the viewer and a shading normal on the visible side; smaller ones are raised to it.
const GRAZING: f32 = 1e-3;

impl Bsdf<'_> {
    /// The value times the cosine of `wi`, per channel, and the density with which [`Self::sample`] samples `wi`, per
    /// solid angle. Delta lobes are left out. See `Self::evaluate_all`.
    pub fn evaluate(&self, wi: Vec3) -> (Vec3, f32) {
        let ([value], density) = self.evaluate_all(wi, BsdfPart::All);
        (value, density)
    }
}

impl<'w, const K: usize> Bsdf<'w, K> {
    /// The BSDF of `material`, with its precomputed `table`, at `hit` on `mesh`, seen from `wo`. It is the same for all
    /// `K` base colours.
    ///
    /// The back of an opaque material that is not two-sided is black. A shading normal that points away from a viewer
    /// on its side of the triangle is turned towards the viewer.
    pub(crate) fn of_material(
        material: &Material,
        table: &'w Table,
        textures: &[Texture],
        mesh: &TriangleMesh,
        hit: &SurfaceHit,
        wo: Vec3,
    ) -> Self {
        let lobe = Lobe::at(material, table, textures, hit.uv);
        let normal = match &material.bump {
            Some(bump) => bump::bumped_normal(bump, textures, mesh, hit),
            None => hit.shading_normal,
        };
        Self::at(hit, normal, wo, lobe, material.two_sided, None)
    }

    /// The BSDF of a two-sided `principled` material at `hit`, seen from `wo`, for each of `base_colors`. With a
    /// `second` material and a number, the base colours from that number on have its roughness and metallic.
    pub(crate) fn of_principled(
        principled: Principled<'w>,
        second: Option<SecondPrincipled<'w>>,
        base_colors: &[Vec3; K],
        hit: &SurfaceHit,
        wo: Vec3,
    ) -> Self {
        let colors = Some((base_colors, second.as_ref()));
        Self::at(hit, hit.shading_normal, wo, Lobe::Principled(principled), true, colors)
    }

    fn at(
        hit: &SurfaceHit,
        mut normal: Vec3,
        wo: Vec3,
        mut lobe: Lobe<'w>,
        two_sided: bool,
        colors: Option<(&[Vec3; K], Option<&SecondPrincipled<'w>>)>,
    ) -> Self {
        // Face the viewer, unless light passes to the other side.
        let mut geometric = hit.geometric_normal;
        let front = hit.is_front(wo);
        if !front && !lobe.transmits() {
            (normal, geometric) = (-normal, -geometric);
            if !two_sided {
                lobe = Lobe::Black;
            }
        }
        // Build the frame of the shading normal on the side of the viewer.
        let seen_side = if front || !lobe.transmits() { 1.0 } else { -1.0 };
        let normal = turned_to(normal * seen_side, wo) * seen_side;
        let frame = Frame::around(normal);
        let wo = frame.local_from_world(wo);
        // Compute what does not depend on the light.
        let principled = match &lobe {
            Lobe::Principled(principled) if wo.z > 0.0 => {
                let own = [principled.base_color; K];
                let (base_colors, second) = colors.unwrap_or((&own, None));
                Some(PrincipledVariants::new(principled, second, base_colors, wo))
            }
            _ => None,
        };
        Self { frame, geometric, wo, lobe, principled }
    }

    /// The value times the cosine of `wi`, per base colour and channel, and the density with which [`Self::sample`]
    /// samples `wi`, per solid angle. Delta lobes are left out.
    ///
    /// Both are zero where `wi` lies above the shading normal's plane and below the triangle's, or the reverse: such
    /// light would pass through the surface.
    pub(crate) fn evaluate_all(&self, wi: Vec3, part: BsdfPart) -> ([Vec3; K], f32) {
        let local = self.frame.local_from_world(wi);
        if self.geometric.dot(wi) * local.z <= 0.0 {
            return ([Vec3::ZERO; K], 0.0);
        }
        match &self.principled {
            Some(_) if local.z <= 0.0 => ([Vec3::ZERO; K], 0.0),
            Some(variants) => variants.evaluate(local, part),
            None => ([self.lobe.eval(self.wo, local); K], self.lobe.density(self.wo, local)),
        }
    }

    /// Samples a direction from three numbers in [0, 1), independently of the base colours. `None` if the sample is
    /// absorbed.
    pub fn sample(&self, u: [f32; 3]) -> Option<BsdfSample<K>> {
        let (local, weights, density, delta) = match &self.principled {
            Some(variants) => {
                let (wi, weights, density) = variants.sample(u)?;
                (wi, weights, density, false)
            }
            None => {
                let sample = self.lobe.sample(self.wo, u)?;
                (sample.wi, [sample.weight; K], sample.density, sample.delta)
            }
        };
        let wi = self.frame.world_from_local(local).normalize();
        (self.geometric.dot(wi) * local.z > 0.0).then_some(BsdfSample { wi, weights, density, delta })
    }

    /// The weights of `sample`, returned by [`Self::sample`], for stage lights: parts that do not reflect them are left
    /// out.
    pub(crate) fn stage_weights(&self, sample: &BsdfSample<K>) -> [Vec3; K] {
        match &self.principled {
            _ if sample.delta => [Vec3::ZERO; K],
            Some(_) => {
                let (values, _) = self.evaluate_all(sample.wi, BsdfPart::Stage);
                values.map(|value| value / sample.density)
            }
            _ => sample.weights,
        }
    }

    /// Whether all lobes are delta distributions, so that light sampling finds nothing.
    pub fn is_delta(&self) -> bool {
        self.lobe.is_delta()
    }

    /// Whether all light is absorbed.
    pub fn is_black(&self) -> bool {
        matches!(self.lobe, Lobe::Black)
    }
}

/// `normal`, or if that points away from `wo`, the nearest normal that does not.
fn turned_to(normal: Vec3, wo: Vec3) -> Vec3 {
    let cos = normal.dot(wo);
    if cos >= GRAZING { normal } else { (normal + wo * (GRAZING - cos)).normalize() }
}
